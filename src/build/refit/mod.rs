//! Hierarchies whose primitives have moved: the same tree, its boxes made anew from the leaves up.

mod primitives;
mod runs;
mod triangles;

use super::{
    compact::CHUNK,
    error::{BuildError, RefitError},
    input::{Input, Verdict},
    parallel,
};
use crate::{
    geometry::Aabb,
    layout::{Bvh, Child, ChildKind, Leaf, Leaves, Owned, WideNode, tested_bounds},
};
use core::ops::Range;
use glam::Vec3;
use std::{vec, vec::Vec};

/// Makes the boxes of all nodes anew, from those of leaves, which are told by their places.
fn update_nodes<N: WideNode, L: Leaves>(
    bvh: &mut Bvh<N, L, Owned>,
    of_leaf: impl Fn(usize) -> Aabb + Sync,
) {
    let root = bvh.root().kind();
    let (_, nodes, bounds) = bvh.moving_parts();
    // Each node comes before those below it.
    let mut node_boxes = vec![Aabb::EMPTY; nodes.len()];
    let of = |child: ChildKind, node_boxes: &[Aabb]| match child {
        ChildKind::Empty => Aabb::EMPTY,
        ChildKind::Node(node) => node_boxes[node],
        ChildKind::Leaf(leaf) => of_leaf(leaf),
    };
    let moved = |node: &N, node_boxes: &[Aabb]| {
        let children = (0..N::WIDTH).map(|lane| node.child(lane));
        let children = children.take_while(|&child| child != Child::EMPTY);
        let children = children.map(|child| (of(child.kind(), node_boxes), child));
        N::from_children(children).with_first_vertex(node.first_vertex() as u32)
    };
    for (index, node) in nodes.iter_mut().enumerate().rev() {
        let children = (0..N::WIDTH).map(|lane| of(node.child(lane).kind(), &node_boxes));
        node_boxes[index] = children.fold(Aabb::EMPTY, |all, aabb| all.join(aabb));
        if !N::NODES_FIRST {
            *node = moved(node, &node_boxes);
        }
    }
    *bounds = of(root, &node_boxes);
    if !N::NODES_FIRST {
        return;
    }
    // To find the grids of nodes takes much longer.
    let move_all = |nodes: &mut [N]| {
        for node in &mut *nodes {
            *node = moved(node, &node_boxes);
        }
        tested_bounds(nodes, Aabb::EMPTY)
    };
    let tested = parallel::map(nodes.chunks_mut(CHUNK), move_all);
    *bounds = tested.iter().fold(*bounds, |all, aabb| all.join(*aabb));
}

fn places<L: Leaf>(leaf: &L) -> Range<usize> {
    let Range { start, end } = leaf.primitives();
    start as usize..end as usize
}

fn at(primitive: u32, error: BuildError) -> RefitError {
    RefitError::Primitive {
        primitive: primitive as usize,
        error,
    }
}

fn in_range(primitive: u32, count: usize) -> Result<u32, RefitError> {
    match (primitive as usize) < count {
        true => Ok(primitive),
        false => Err(RefitError::PrimitiveGone {
            primitive: primitive as usize,
        }),
    }
}

/// What moved is of all leaves.
///
/// # Errors
/// Of all errors that of the least primitive.
fn map_all<L: Sync, R: Send>(
    leaves: &[L],
    moved: impl Fn(&L) -> Result<R, RefitError> + Sync,
) -> Result<Vec<R>, RefitError> {
    #[cfg(feature = "rayon")]
    let all = {
        use rayon::prelude::*;
        leaves.par_iter().map(&moved).collect::<Result<_, _>>()
    };
    #[cfg(not(feature = "rayon"))]
    let all = leaves.iter().map(&moved).collect::<Result<_, _>>();
    all.map_err(|error| least(leaves.iter().map(moved), error))
}

/// Of all errors that of the least primitive; `error` is one.
#[cold]
fn least<R>(all: impl Iterator<Item = Result<R, RefitError>>, error: RefitError) -> RefitError {
    let errors = all.filter_map(Result::err);
    errors.min_by_key(RefitError::primitive).unwrap_or(error)
}

/// The box around primitives of these numbers; of those that cannot be hit it is what `unhittable` says.
///
/// # Errors
/// Of all errors that of the least primitive.
fn around<I: Input>(
    input: &I,
    numbers: impl Iterator<Item = u32> + Clone,
    unhittable: impl Fn(u32) -> Result<Aabb, RefitError>,
) -> Result<Aabb, RefitError> {
    let own = |id| match in_range(id, input.len()).map(|id| input.verdict(id))? {
        Verdict::Keep(own) => Ok(own.aabb()),
        Verdict::Unhittable => unhittable(id),
        Verdict::NonFinite(error) | Verdict::Invalid(error) => Err(at(id, error)),
    };
    let mut boxes = numbers.clone().map(own);
    let around = boxes.try_fold(Aabb::EMPTY, |all, own| Ok(all.join(own?)));
    around.map_err(|error| least(numbers.map(own), error))
}

/// Gives leaves of nothing a place: they are still leaves.
fn put_somewhere(boxes: &mut [Aabb]) {
    let bounds = boxes.iter().fold(Aabb::EMPTY, |all, &aabb| all.join(aabb));
    let place = match bounds.is_empty() {
        true => Vec3::ZERO,
        false => bounds.min,
    };
    for aabb in boxes.iter_mut().filter(|aabb| aabb.is_empty()) {
        *aabb = Aabb::new(place, place);
    }
}

/// The primitives in leaves. Parts that were put together may list what is in none.
fn listed<N: WideNode, L: Leaf>(bvh: &Bvh<N, L, Owned>) -> impl Iterator<Item = u32> {
    let lists = bvh
        .leaves()
        .iter()
        .map(|leaf| &bvh.primitives()[places(leaf)]);
    lists.flatten().copied()
}

/// What is in no leaf cannot be hit. `ids` are in leaves.
fn none_is_missing<I: Input>(input: &I, ids: impl Iterator<Item = u32>) -> Result<(), RefitError> {
    let mut listed = vec![0u64; input.len().div_ceil(64)];
    for id in ids {
        if let Some(word) = listed.get_mut(id as usize / 64) {
            *word |= 1 << (id % 64);
        }
    }
    for (word, &listed) in listed.iter().enumerate() {
        let mut missing = !listed;
        while missing != 0 {
            let primitive = 64 * word + missing.trailing_zeros() as usize;
            missing &= missing - 1;
            if primitive < input.len()
                && matches!(input.verdict(primitive as u32), Verdict::Keep(_))
            {
                return Err(RefitError::PrimitiveLeftOut { primitive });
            }
        }
    }
    Ok(())
}
