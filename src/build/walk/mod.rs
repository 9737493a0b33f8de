//! The wide nodes of a collapsed tree, in the layout's order.
//!
//! With threads subtrees are walked by themselves, at once, and then put one after the other.

#[cfg(feature = "rayon")]
mod at_once;

use super::{BuildError, cost::Measure, emit::Shape, monitor::Watch, pages};
use crate::{
    layout::{Child, LayoutError, STACK, WideNode},
    simd::{Backend, Operation, Simd},
};
use core::marker::PhantomData;
use std::{vec, vec::Vec};

/// The wide nodes and the leaves, each in the layout's order.
///
/// # Errors
/// A node to which a walk would need more than its stack; or the build was cancelled.
pub(super) fn walk<N: WideNode, const W: usize>(
    shape: &(impl Shape<W> + Sync),
    watch: &Watch,
) -> Result<Walked<N>, BuildError> {
    let none_or_leaf = |leaves| Walked {
        nodes: Vec::new(),
        leaves,
    };
    if shape.len() == 0 {
        return Ok(none_or_leaf(Vec::new()));
    }
    let root = shape.root();
    if shape.is_leaf(root) {
        return Ok(none_or_leaf(vec![shape.leaf(root)]));
    }
    let walk = Walk {
        shape,
        measure: Measure::of_bounds(shape.aabb(root)),
        backend: Backend::detect(),
        watch,
        nodes: PhantomData,
    };
    #[cfg(feature = "rayon")]
    if super::parallel::is_worth_it(shape.len()) {
        return walk.at_once(root);
    }
    let mut walked = walk.below(root, 0, shape.len())?;
    walked.nodes.shrink_to_fit();
    Ok(walked)
}

struct Walk<'a, N, T, const W: usize> {
    shape: &'a T,
    measure: Measure,
    backend: Backend,
    watch: &'a Watch<'a>,
    nodes: PhantomData<N>,
}

/// What a subtree becomes: its nodes, the root first, and its leaves. Places count from the root's and from the first
/// leaf's.
pub(super) struct Walked<N> {
    pub nodes: Vec<N>,
    /// Called as [`Shape::leaf`] does.
    pub leaves: Vec<u32>,
}

/// What becomes the children of a wide node.
struct Children<const W: usize> {
    /// Binary nodes, in the order of lanes.
    lanes: [u32; W],
    count: usize,
    /// Those that become leaves, a bit each.
    leaves: u32,
}

impl<const W: usize> Children<W> {
    /// Each, and whether it becomes a leaf.
    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = (usize, bool)> {
        let lanes = self.lanes[..self.count].iter().enumerate();
        lanes.map(|(lane, &child)| (child as usize, self.leaves >> lane & 1 != 0))
    }

    /// The node over them, of which the first that is a node and the first that is a leaf have these places, and the
    /// others follow.
    #[inline(always)]
    fn node<N: WideNode>(&self, shape: &impl Shape<W>, node: usize, leaf: usize) -> N {
        let (mut node, mut leaf) = (node as u32, leaf as u32);
        N::from_children(self.iter().map(|(child, is_leaf)| {
            let link = if is_leaf {
                leaf += 1;
                Child::leaf(leaf - 1)
            } else {
                node += 1;
                Child::node(node - 1)
            };
            (*shape.aabb(child), link)
        }))
    }
}

impl<N: WideNode, T: Shape<W> + Sync, const W: usize> Walk<'_, N, T, W> {
    /// What becomes the children of a node, with so much of a walk's stack in use when it gets there; and how much is
    /// when it gets to them.
    #[inline(always)]
    fn children(&self, node: usize, used: usize) -> Result<(Children<W>, usize), BuildError> {
        let shape = self.shape;
        let (children, count) = shape.children(node);
        let used = used + count - 1;
        if used >= STACK {
            return Err(LayoutError::TooDeep(node).into());
        }
        // The likeliest first: its nodes follow, close by.
        let mut areas = [0.0; W];
        for (area, &child) in areas.iter_mut().zip(&children[..count]) {
            *area = self.measure.half_area(shape.aabb(child));
        }
        let mut lanes = [0; W];
        for (child, place) in children.into_iter().zip(places_by_size(&areas)) {
            lanes[place as usize % W] = child as u32;
        }
        let is_leaf = |&child: &u32| shape.is_leaf(child as usize);
        if N::NODES_FIRST {
            lanes[..count].sort_by_key(is_leaf);
        }
        let mut leaves = 0;
        for (lane, child) in lanes[..count].iter().enumerate() {
            leaves |= u32::from(is_leaf(child)) << lane;
        }
        let children = Children {
            lanes,
            count,
            leaves,
        };
        Ok((children, used))
    }

    /// What the subtree below `root` becomes. `room` is about how many binary nodes it has.
    fn below(&self, root: usize, used: usize, room: usize) -> Result<Walked<N>, BuildError> {
        self.backend.run(WalkBelow {
            walk: self,
            root,
            used,
            room,
        })
    }
}

struct WalkBelow<'a, N, T, const W: usize> {
    walk: &'a Walk<'a, N, T, W>,
    root: usize,
    used: usize,
    room: usize,
}

impl<N: WideNode, T: Shape<W> + Sync, const W: usize> Operation for WalkBelow<'_, N, T, W> {
    type Output = Result<Walked<N>, BuildError>;

    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Self::Output {
        let Self {
            walk,
            root,
            used,
            room,
        } = self;
        let shape = walk.shape;
        // Most trees have more than four leaves a wide node. What is not used is not touched.
        let mut nodes = pages::with_capacity(room / 8 + 1);
        let mut leaves = pages::with_capacity(room / 2 + 1);
        nodes.push(N::zeroed());
        // Binary nodes that become wide ones, their places, and the stack in use when a walk gets there.
        let mut todo = vec![(root, 0, used)];
        while let Some((node, place, used)) = todo.pop() {
            let (children, used) = walk.children(node, used)?;
            nodes[place] = children.node(shape, nodes.len(), leaves.len());
            let known = todo.len();
            for (child, is_leaf) in children.iter() {
                if is_leaf {
                    leaves.push(shape.leaf(child));
                } else {
                    todo.push((child, nodes.len() + todo.len() - known, used));
                    shape.fetch(token, child);
                }
            }
            nodes.resize(nodes.len() + todo.len() - known, N::zeroed());
            todo[known..].reverse();
            if !walk.watch.advance(children.count) {
                return Err(BuildError::Cancelled);
            }
        }
        Ok(Walked { nodes, leaves })
    }
}

/// The place of each size, none negative, the greatest first; of those that are nearly equal the first. Each is compared
/// with all: which is greater is a toss-up.
#[inline(always)]
fn places_by_size<const W: usize>(sizes: &[f32; W]) -> [u32; W] {
    const { assert!(W <= 8) };
    let mut keys = [0; W];
    for (lane, key) in keys.iter_mut().enumerate() {
        *key = sizes[lane].to_bits() & !7 | (7 - lane as u32);
    }
    let mut places = [0; W];
    for other in keys {
        for (place, key) in places.iter_mut().zip(keys) {
            *place += u32::from(other > key);
        }
    }
    places
}
