//! Trees too deep for a walk's stack, made shallow.

use super::{
    adopt::{inner, refit},
    binary::{BinaryNode, BinaryTree},
    input::Input,
};
use bytemuck::Zeroable;
use std::{vec, vec::Vec};

/// What goes where in the new tree.
enum Task {
    /// A node of the old tree.
    Keep(usize),
    /// A run of its leaves, in its order, halved down to single ones.
    Halve { first: usize, count: usize },
}

/// The same leaves in the same order, none below more than `levels` other nodes, which must be as many as halves
/// need: the binary logarithm of the leaves' number. Subtrees that are shallow enough stay as they are.
///
/// `tree` is as the builder makes them.
pub(super) fn rebalance<I: Input>(input: &I, tree: &BinaryTree, levels: u32) -> BinaryTree {
    let old = tree.nodes();
    let runs = runs(old);
    let mut nodes = vec![BinaryNode::zeroed(); old.len()];
    // What, into which slot, the nodes below where, and how many levels there are left.
    let mut todo = Vec::new();
    if !old.is_empty() {
        todo.push((Task::Keep(0), 0, 1, levels));
    }
    while let Some((task, slot, at, levels)) = todo.pop() {
        // The two parts, and how many leaves are in the left.
        let (left, right, left_count) = match task {
            Task::Keep(index) if old[index].is_leaf() => {
                nodes[slot] = old[index];
                continue;
            }
            Task::Keep(index) => {
                let [left, right] = old[index].children();
                let fits = |child: usize| levels > 0 && halvings(runs[child].count) < levels;
                if runs[index].depth <= levels || (fits(left) && fits(right)) {
                    (Task::Keep(left), Task::Keep(right), runs[left].count)
                } else {
                    halve(runs[index].first, runs[index].count)
                }
            }
            Task::Halve { first, count: 1 } => {
                nodes[slot] = BinaryNode {
                    aabb: input.aabb(tree.order()[first]),
                    first: first as u32,
                    count: 1,
                };
                continue;
            }
            Task::Halve { first, count } => halve(first, count),
        };
        nodes[slot] = inner(at);
        let levels = levels.saturating_sub(1);
        let left_at = at + 2;
        let right_at = left_at + 2 * left_count - 2;
        todo.push((right, at + 1, right_at, levels));
        todo.push((left, at, left_at, levels));
    }
    refit(&mut nodes);
    BinaryTree::new_unchecked(nodes, tree.order().to_vec())
}

fn halve(first: usize, count: usize) -> (Task, Task, usize) {
    let half = count / 2;
    let left = Task::Halve { first, count: half };
    let right = Task::Halve {
        first: first + half,
        count: count - half,
    };
    (left, right, half)
}

/// How many levels halving `count` leaves down to single ones takes.
fn halvings(count: usize) -> u32 {
    count.next_power_of_two().trailing_zeros()
}

/// The leaves below a node.
#[derive(Clone, Copy, Default)]
struct Run {
    first: usize,
    count: usize,
    /// How many nodes the deepest is below.
    depth: u32,
}

fn runs(nodes: &[BinaryNode]) -> Vec<Run> {
    let mut runs = vec![Run::default(); nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        runs[index] = if node.is_leaf() {
            Run {
                first: node.first as usize,
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
