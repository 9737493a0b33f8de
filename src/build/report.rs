//! What was built.

use super::cost::{self, Measure};
use super::input::{Boxes, Input, Triangles};
use crate::layout::{Bvh, Child, ChildKind, Leaf, Owned, PrimitiveLeaf, TriangleLeaf, WideNode};
use core::fmt;

/// What a build came to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BuildReport {
    /// Primitives in leaves, each counted once.
    pub primitives: usize,
    /// Primitives in leaves, once for every leaf that has them: more than there are where large triangles
    /// were cut into pieces.
    pub references: usize,
    /// Primitives left out because they are not finite.
    pub dropped: usize,
    /// Wide nodes.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Bytes of nodes, leaves and the list of primitives.
    pub bytes: usize,
    /// What a ray through the bounds is expected to cost, in tests of a node (the surface area heuristic).
    pub sah_cost: f32,
}

impl fmt::Display for BuildReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            primitives,
            references,
            dropped,
            nodes,
            leaves,
            bytes,
            sah_cost,
        } = self;
        write!(
            f,
            "{primitives} primitives in {leaves} leaves under {nodes} nodes, {bytes} bytes, SAH cost {sah_cost:.2}"
        )?;
        if references > primitives {
            write!(f, "; {references} references")?;
        }
        if *dropped > 0 {
            write!(f, "; {dropped} not finite and left out")?;
        }
        Ok(())
    }
}

impl<N: WideNode> Bvh<N, TriangleLeaf, Owned> {
    /// What building it came to.
    pub fn report(&self) -> BuildReport {
        report(self, Triangles::leaf_cost)
    }
}

impl<N: WideNode> Bvh<N, PrimitiveLeaf, Owned> {
    /// What building it came to.
    pub fn report(&self) -> BuildReport {
        report(self, Boxes::leaf_cost)
    }
}

fn report<N: WideNode, L: Leaf>(
    bvh: &Bvh<N, L, Owned>,
    leaf_cost: impl Fn(usize) -> f32,
) -> BuildReport {
    let mut primitives = bvh.primitives().to_vec();
    primitives.sort_unstable();
    primitives.dedup();
    BuildReport {
        primitives: primitives.len(),
        references: bvh.primitives().len(),
        dropped: bvh.dropped(),
        nodes: bvh.nodes().len(),
        leaves: bvh.leaves().len(),
        bytes: bvh.bytes(),
        sah_cost: sah_cost(bvh, leaf_cost),
    }
}

/// Every node and leaf, by the chance that a ray which meets the bounds meets it.
fn sah_cost<N: WideNode, L: Leaf>(bvh: &Bvh<N, L, Owned>, leaf_cost: impl Fn(usize) -> f32) -> f32 {
    let measure = Measure::of_bounds(bvh.bounds());
    let cost = |child: Child| match child.kind() {
        ChildKind::Empty => 0.0,
        ChildKind::Node(_) => cost::NODE,
        ChildKind::Leaf(leaf) => {
            let places = bvh.leaves()[leaf].primitives();
            leaf_cost((places.end - places.start) as usize)
        }
    };
    // In `f64`: a million small terms.
    let mut below = 0.0;
    for node in bvh.nodes() {
        for lane in 0..N::WIDTH {
            let child = node.child(lane);
            if child != Child::EMPTY {
                let area = measure.half_area(&node.child_aabb(lane));
                below += f64::from(area * cost(child));
            }
        }
    }
    let whole = f64::from(measure.half_area(bvh.bounds()));
    // Bounds without area: no ray meets them but by luck.
    let below = if whole > 0.0 { below / whole } else { 0.0 };
    cost(bvh.root()) + below as f32
}
