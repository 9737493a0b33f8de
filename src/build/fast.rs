//! The fast way: leaves of neighbours along a curve, then a tree over leaves, from the bottom up.

use super::{
    BinaryNode, BuildError,
    collapse::Collapse,
    emit::{Parts, walk},
    input::Input,
    monitor::Watch,
    morton,
    ploc::{self, Part},
    refs::Refs,
    runs::{self, Runs},
};
use crate::{
    geometry::Aabb,
    layout::{LayoutError, WideNode},
};
use std::vec::Vec;

/// So many primitives are one task, along the curve.
const PART: usize = 1 << 12;

/// The parts of a hierarchy over `refs`.
///
/// # Errors
/// The tree is too deep; or the build was cancelled.
pub(super) fn build<N: WideNode, I: Input, const W: usize>(
    input: &I,
    refs: &Refs,
    watch: &Watch,
) -> Result<Parts<N, I::Leaf>, BuildError> {
    let Grown {
        order,
        leaves,
        nodes,
    } = grow(input, refs, watch)?;
    let collapse = Collapse::<W>::of_leaves(input, &nodes, watch);
    watch.phase(0.93, nodes.len())?;
    let (wide, led_to) = walk(&nodes, &collapse, watch)?;
    watch.phase(1.0, led_to.len())?;
    let leaf = |&node: &usize| {
        watch.advance(1);
        let number = nodes[node].first as usize;
        leaves.get(number / PART)?.get(number % PART).copied()
    };
    let leaves = led_to.iter().map(leaf).collect::<Option<_>>();
    Ok(Parts {
        nodes: wide,
        leaves: leaves.ok_or(LayoutError::Leaf(0))?,
        primitives: order,
        bounds: nodes.first().map_or(Aabb::EMPTY, |root| root.aabb),
    })
}

struct Grown<L> {
    /// The primitives along the curve.
    order: Vec<u32>,
    /// By part: number `n` is in part `n / PART`.
    leaves: Vec<Vec<L>>,
    /// Of the binary tree; `first` of a leaf is its number.
    nodes: Vec<BinaryNode>,
}

fn grow<I: Input>(input: &I, refs: &Refs, watch: &Watch) -> Result<Grown<I::Leaf>, BuildError> {
    let scale = refs.scale();
    let refs = &refs.refs;
    watch.phase(0.3, refs.len())?;
    let mut order = morton::order(refs, watch);
    watch.phase(0.7, refs.len())?;
    let part = |(index, places): (usize, &[u32])| {
        let Runs { leaves, nodes, .. } = runs::cut(input, refs, places, index * PART, watch);
        (leaves, Part::new(nodes, scale, watch))
    };
    #[cfg(feature = "rayon")]
    let (leaves, parts): (Vec<_>, Vec<_>) = {
        use rayon::prelude::*;
        order.par_chunks(PART).enumerate().map(part).unzip()
    };
    #[cfg(not(feature = "rayon"))]
    let (leaves, parts): (Vec<_>, Vec<_>) = order.chunks(PART).enumerate().map(part).unzip();
    watch.phase(0.8, leaves.len())?;
    let nodes = ploc::tree(&parts, scale, watch);
    for place in &mut order {
        *place = refs[*place as usize].id();
    }
    watch.phase(0.9, nodes.len())?;
    Ok(Grown {
        order,
        leaves,
        nodes,
    })
}
