//! The fast way: leaves of neighbours along a curve, then a tree over leaves, from the bottom up.

use super::{
    BuildError,
    emit::Parts,
    input::Input,
    leaf_collapse::LeafCollapse,
    monitor::Watch,
    morton,
    pages::{self, Slots},
    sections::Sections,
    walk::walk,
};
use crate::{
    geometry::Aabb,
    layout::WideNode,
    simd::{Backend, Operation, Simd},
};
use std::vec::Vec;

/// So many leaves are copied in one go.
const CHUNK: usize = 1 << 10;
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
    let mut sections = Sections::grow::<I, W>(input, &curve, watch)?;
    let (nodes, cuts) = sections.join::<I, W>(curve.measure, watch)?;
    watch.phase(1.0, nodes.len())?;
    let collapse = LeafCollapse::<W> {
        nodes: &nodes,
        cuts: &cuts,
    };
    let walked = walk(&collapse, watch)?;
    let parts = Parts {
        nodes: walked.nodes,
        leaves: in_order(&sections, &walked.leaves),
        primitives: curve.order,
        bounds: nodes.last().map_or(Aabb::EMPTY, |root| root.aabb),
    };
    Ok((parts, curve.dropped))
}

/// The leaves of these numbers. They are not copied one by one in the walk, nor put in place along cycles: each would
/// wait for the one before.
fn in_order<L: Copy + Send + Sync>(sections: &Sections<L>, order: &[u32]) -> Vec<L> {
    let backend = Backend::detect();
    pages::made(order.len(), CHUNK, |first, to| {
        backend.run(Copies {
            sections,
            order: &order[first..],
            to,
        });
    })
}

struct Copies<'a, 's, L> {
    sections: &'a Sections<L>,
    /// Of those that are copied, and of those after them.
    order: &'a [u32],
    to: &'a mut Slots<'s, L>,
}

impl<L: Copy> Operation for Copies<'_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let Self {
            sections,
            order,
            to,
        } = self;
        for index in 0..to.left() {
            if let Some(&later) = order.get(index + AHEAD) {
                token.prefetch((&raw const *sections.leaf(later)).cast());
            }
            to.push(*sections.leaf(order[index]));
        }
    }
}
