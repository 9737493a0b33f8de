//! Trees too deep for a walk's stack, made shallow.

use super::{
    binary::{BinaryNode, BinaryTree},
    lay_out::{Part, lay_out},
};
use core::ops::Range;
use std::{vec, vec::Vec};

/// What goes into the new tree, and how many nodes its leaves may be below.
enum Task {
    /// A node of the old one.
    Keep { node: usize, levels: u32 },
    /// A run of leaves, halved down to single ones.
    Halve(Range<usize>),
}

/// The same leaves from left to right, none below more than `levels` nodes, which must be no fewer than halving
/// all leaves takes. Subtrees that are shallow enough stay as they are.
pub(super) fn rebalance(tree: &BinaryTree, levels: u32) -> BinaryTree {
    let nodes = tree.nodes();
    if nodes.is_empty() {
        return BinaryTree::default();
    }
    let mut leaves: Vec<BinaryNode> = nodes.iter().filter(|n| n.is_leaf()).copied().collect();
    leaves.sort_unstable_by_key(|leaf| leaf.first);
    let runs = runs(nodes);
    // How many leaves come before a node's; told apart by the first of them.
    let rank = |first: u32| leaves.partition_point(|leaf| leaf.first < first);
    let root = Task::Keep { node: 0, levels };
    let leaf = |leaf: &BinaryNode| {
        let primitives = &tree.order()[leaf.first as usize..][..leaf.count as usize];
        Part::Leaf(leaf.aabb, primitives)
    };
    lay_out(leaves.len(), root, |task| match task {
        Task::Keep { node, .. } if nodes[node].is_leaf() => leaf(&nodes[node]),
        Task::Keep { node, levels } => {
            let [left, right] = nodes[node].children();
            let Run {
                first,
                count,
                depth,
            } = runs[node];
            let fits = |child: usize| halvings(runs[child].count) < levels;
            if depth <= levels || (fits(left) && fits(right)) {
                let levels = levels - 1;
                Part::Inner([left, right].map(|node| Task::Keep { node, levels }))
            } else {
                let first = rank(first);
                halve(first..first + count)
            }
        }
        Task::Halve(run) if run.len() == 1 => leaf(&leaves[run.start]),
        Task::Halve(run) => halve(run),
    })
}

fn halve<'a>(run: Range<usize>) -> Part<'a, Task> {
    let middle = run.start + run.len() / 2;
    Part::Inner([run.start..middle, middle..run.end].map(Task::Halve))
}

/// How many levels of nodes halving `count` leaves down to single ones takes.
fn halvings(count: usize) -> u32 {
    count.next_power_of_two().trailing_zeros()
}

/// The leaves below a node.
#[derive(Clone, Copy, Default)]
struct Run {
    /// The first place that they have in the tree's order.
    first: u32,
    count: usize,
    /// How many nodes the deepest is below.
    depth: u32,
}

fn runs(nodes: &[BinaryNode]) -> Vec<Run> {
    let mut runs = vec![Run::default(); nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        runs[index] = if node.is_leaf() {
            Run {
                first: node.first,
                count: 1,
                depth: 0,
            }
        } else {
            let [left, right] = node.children().map(|child| runs[child]);
            Run {
                first: left.first,
                count: left.count + right.count,
                depth: left.depth.max(right.depth) + 1,
            }
        };
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;

    #[test]
    fn no_deeper_than_asked() {
        // A chain, in our order: leaves left.
        for leaves in [1, 2, 3, 37, 38, 1000, 70_000u32] {
            let mut nodes = vec![BinaryNode {
                aabb: Aabb::EMPTY,
                first: 1,
                count: 0,
            }];
            for leaf in 0..leaves - 1 {
                let below = nodes.len() as u32 + 2;
                nodes.push(BinaryNode {
                    aabb: Aabb::EMPTY,
                    first: leaf,
                    count: 1,
                });
                nodes.push(BinaryNode {
                    aabb: Aabb::EMPTY,
                    first: below,
                    count: 0,
                });
            }
            let last = nodes.len() - 1;
            nodes[last] = BinaryNode {
                aabb: Aabb::EMPTY,
                first: leaves - 1,
                count: 1,
            };
            let tree = BinaryTree::new(nodes, (0..leaves).collect()).unwrap();
            for levels in [halvings(leaves as usize), 17, 36] {
                let balanced = rebalance(&tree, levels);
                assert!(runs(balanced.nodes())[0].depth <= levels);
                let (nodes, order) = balanced.into_parts();
                assert_eq!(nodes.len(), tree.nodes().len());
                assert!(BinaryTree::new(nodes, order).is_ok());
            }
            // What is shallow enough stays.
            assert_eq!(rebalance(&tree, leaves), tree);
        }
    }
}
