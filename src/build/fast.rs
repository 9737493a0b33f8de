//! The fast way: leaves of neighbours along a curve, then a tree over leaves, from the bottom up.

use super::{
    BuildError,
    emit::{Parts, walk},
    input::Input,
    leaf_collapse::LeafCollapse,
    monitor::Watch,
    morton::{self, Curve},
    pages,
    ploc::{self, Node},
    runs::{self, Runs},
};
use crate::{
    geometry::Aabb,
    layout::WideNode,
    simd::{Backend, Operation, Simd},
};
use std::vec::Vec;

/// So many primitives are one task, along the curve.
const PART: usize = 1 << 12;
/// One of so many clusters of a part is left for those of other parts to be joined with.
const LEFT: usize = 16;
/// Leaves are fetched so many before they are copied: with children of children fetched by the walk, 3 % off the build.
const AHEAD: usize = 12;

/// The parts of a hierarchy over all primitives that have a place in it, and how many were left out for not being
/// finite.
///
/// # Errors
/// The first primitive that is not finite, unless those are left out, or too many; the tree is too deep; or the build
/// was cancelled.
pub(super) fn build<N: WideNode, I: Input, const W: usize>(
    input: &I,
    drop_non_finite: bool,
    watch: &Watch,
) -> Result<(Parts<N, I::Leaf>, usize), BuildError> {
    let curve = morton::curve(input, drop_non_finite, watch)?;
    let Grown { leaves, nodes, .. } = Grown::of(input, &curve, watch)?;
    watch.phase(0.93, nodes.len())?;
    let collapse = LeafCollapse::<W>::new::<I>(&nodes, watch);
    watch.phase(1.0, nodes.len())?;
    let mut order = Vec::with_capacity(leaves.len());
    let wide = walk(&collapse, watch, |leaf| {
        order.push(nodes[leaf].number() as u32);
    })?;
    // Not one by one in the walk, nor in place along cycles: each would wait for the one before.
    let leaves = Backend::detect().run(InOrder {
        all: &leaves,
        order: &order,
    });
    let parts = Parts {
        nodes: wide,
        leaves,
        primitives: curve.order,
        bounds: nodes.last().map_or(Aabb::EMPTY, |root| root.aabb),
    };
    Ok((parts, curve.dropped))
}

/// Copies of all at the places of an order.
struct InOrder<'a, T> {
    all: &'a [T],
    order: &'a [u32],
}

impl<T: Copy> Operation for InOrder<'_, T> {
    type Output = Vec<T>;

    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Vec<T> {
        let mut copies = pages::with_capacity(self.order.len());
        for (index, &place) in self.order.iter().enumerate() {
            if let Some(&later) = self.order.get(index + AHEAD) {
                token.prefetch((&raw const self.all[later as usize]).cast());
            }
            copies.push(self.all[place as usize]);
        }
        copies
    }
}

/// Leaves and the tree over them.
struct Grown<L> {
    leaves: Vec<L>,
    /// The root last.
    nodes: Vec<Node>,
    /// What is not joined yet.
    roots: Vec<u32>,
}

impl<L: Copy + Send> Grown<L> {
    /// Room for what comes of so many primitives; seldom it takes more. What is not used is not touched.
    fn with_room(primitives: usize) -> Self {
        let leaves = primitives / 8 * 3 + 1;
        Self {
            leaves: pages::with_capacity(leaves),
            nodes: pages::with_capacity(2 * leaves),
            roots: Vec::new(),
        }
    }

    /// Over all that is on the curve.
    ///
    /// # Errors
    /// The build was cancelled.
    fn of<I: Input<Leaf = L>>(input: &I, curve: &Curve, watch: &Watch) -> Result<Self, BuildError> {
        let &Curve {
            ref order, scale, ..
        } = curve;
        watch.phase(0.8, 2 * order.len())?;
        let mut all = Self::with_room(order.len());
        #[cfg(feature = "rayon")]
        if rayon::current_num_threads() > 1 {
            use rayon::prelude::*;
            let part = |(index, ids): (usize, &[u32])| {
                let mut part = Self::with_room(ids.len());
                part.grow(input, ids, index * PART, scale, watch);
                part
            };
            let parts: Vec<_> = order.par_chunks(PART).enumerate().map(part).collect();
            parts.iter().for_each(|part| all.append(part));
            return all.finish(scale, watch);
        }
        for (ids, first) in order.chunks(PART).zip((0..).step_by(PART)) {
            all.grow(input, ids, first, scale, watch);
        }
        all.finish(scale, watch)
    }

    /// Adds a part: joined apart from the rest, it is on one core, and in its cache.
    fn grow<I: Input<Leaf = L>>(
        &mut self,
        input: &I,
        ids: &[u32],
        first: usize,
        scale: f32,
        watch: &Watch,
    ) {
        if !watch.advance(ids.len()) {
            return;
        }
        let start = self.nodes.len() as u32;
        let runs = Runs {
            leaves: &mut self.leaves,
            nodes: &mut self.nodes,
        };
        runs::cut(input, ids, first, scale, runs);
        let clusters: Vec<_> = (start..self.nodes.len() as u32).collect();
        let until = clusters.len() / LEFT;
        let roots = ploc::join(&mut self.nodes, clusters, until, scale, watch);
        self.roots.extend(roots);
    }

    /// Adds a part that was grown elsewhere.
    #[cfg(feature = "rayon")]
    fn append(&mut self, part: &Self) {
        let (leaves, nodes) = (self.leaves.len() as u32, self.nodes.len() as u32);
        self.roots
            .extend(part.roots.iter().map(|root| root + nodes));
        let after = part.nodes.iter().map(|node| node.after(leaves, nodes));
        self.nodes.extend(after);
        self.leaves.extend_from_slice(&part.leaves);
    }

    /// Joins what is left.
    fn finish(mut self, scale: f32, watch: &Watch) -> Result<Self, BuildError> {
        let roots = core::mem::take(&mut self.roots);
        watch.phase(0.9, roots.len())?;
        ploc::join(&mut self.nodes, roots, 1, scale, watch);
        watch.check()?;
        Ok(self)
    }
}
