//! A walk by many threads.

use super::{Children, Walk, Walked};
use crate::{
    build::{BuildError, emit::Shape, pages},
    layout::WideNode,
};
use rayon::prelude::*;
use std::vec::Vec;

/// So many levels of nodes, of trees that are worth it, are above what one thread walks: 64 subtrees of nodes 8 wide.
const LEVELS: usize = 2;

/// What a subtree becomes.
enum Subtree<N, const W: usize> {
    Walked(Walked<N>),
    /// The root's children, its own leaves, and what becomes of its other children.
    Root(Children<W>, Vec<u32>, Vec<Self>),
}

impl<N, const W: usize> Subtree<N, W> {
    /// How many nodes and leaves.
    fn len(&self) -> (usize, usize) {
        match self {
            Self::Walked(Walked { nodes, leaves }) => (nodes.len(), leaves.len()),
            Self::Root(_, leaves, below) => {
                let add = |(a, b), (c, d)| (a + c, b + d);
                below.iter().map(Self::len).fold((1, leaves.len()), add)
            }
        }
    }
}

/// Where what is below a node goes, and how many nodes and leaves come before.
struct Room<'a, N> {
    nodes: &'a mut [N],
    leaves: &'a mut [u32],
    before: (usize, usize),
}

impl<N> Room<'_, N> {
    /// As much of the beginning.
    fn take(&mut self, nodes: usize, leaves: usize) -> Self {
        let before = self.before;
        self.before = (before.0 + nodes, before.1 + leaves);
        Self {
            nodes: self.nodes.split_off_mut(..nodes).unwrap_or_default(),
            leaves: self.leaves.split_off_mut(..leaves).unwrap_or_default(),
            before,
        }
    }
}

impl<N: WideNode, T: Shape<W> + Sync, const W: usize> Walk<'_, N, T, W> {
    /// As [`below`](Self::below) the root.
    pub(super) fn at_once(&self, root: usize) -> Result<Walked<N>, BuildError> {
        let subtree = self.subtree(root, 0, LEVELS)?;
        let (nodes, leaves) = subtree.len();
        let mut nodes = pages::filled(N::zeroed(), nodes);
        let mut leaves = pages::filled(0, leaves);
        nodes[0] = self.put(
            &subtree,
            Room {
                nodes: &mut nodes[1..],
                leaves: &mut leaves,
                before: (1, 0),
            },
        );
        Ok(Walked { nodes, leaves })
    }

    /// What the subtree below `root` becomes, those so many levels of nodes below it at once.
    fn subtree(
        &self,
        root: usize,
        used: usize,
        levels: usize,
    ) -> Result<Subtree<N, W>, BuildError> {
        if levels == 0 {
            let room = self.shape.len() / W.pow(LEVELS as u32);
            return self.below(root, used, room).map(Subtree::Walked);
        }
        let (children, used) = self.children(root, used)?;
        let (mut leaves, mut nodes) = (Vec::new(), Vec::new());
        for (child, is_leaf) in children.iter() {
            match is_leaf {
                true => leaves.push(self.shape.leaf(child)),
                false => nodes.push(child),
            }
        }
        let below = nodes.into_par_iter();
        let below = below.map(|child| self.subtree(child, used, levels - 1));
        let below: Result<_, _> = below.collect();
        Ok(Subtree::Root(children, leaves, below?))
    }

    /// Puts what is below a subtree's root where it goes: the root.
    fn put(&self, subtree: &Subtree<N, W>, mut room: Room<N>) -> N {
        match subtree {
            Subtree::Walked(Walked { nodes, leaves }) => {
                // The root counted as a node before.
                let (before, leaves_before) = room.before;
                let after = |node: &N| node.after(before as u32 - 1, leaves_before as u32);
                room.leaves.copy_from_slice(leaves);
                for (to, node) in room.nodes.iter_mut().zip(&nodes[1..]) {
                    *to = after(node);
                }
                after(&nodes[0])
            }
            Subtree::Root(children, leaves, below) => {
                let own = room.take(below.len(), leaves.len());
                own.leaves.copy_from_slice(leaves);
                let below: Vec<_> = below
                    .iter()
                    .map(|subtree| {
                        let (nodes, leaves) = subtree.len();
                        (subtree, room.take(nodes - 1, leaves))
                    })
                    .collect();
                let with_roots = below.into_par_iter().zip(own.nodes);
                with_roots.for_each(|((subtree, room), node)| *node = self.put(subtree, room));
                let (first_node, first_leaf) = own.before;
                children.node(self.shape, first_node, first_leaf)
            }
        }
    }
}
