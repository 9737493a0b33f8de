//! Which subtrees become leaves, and which nodes of the binary tree become the children of a wide one:
//! the cheapest of all ways, by dynamic programming.
//!
//! Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs" (2017), section
//! 3.1. C(n, i) is the least cost of what is below node n as at most i separate roots:
//!
//! - C(n, 1) is that of a leaf, if all fits into one, or of a wide node over C(n, W);
//! - C(n, i) is C(n, i - 1), or the least of C(left, k) + C(right, i - k).

use super::{
    binary::{BinaryNode, BinaryTree},
    cost::{self, Measure},
    cuts::{Cuts, Forest, Joined, MAX_WIDTH},
    emit::Shape,
    input::{Input, leaf_of},
    monitor::{STRIDE, Watch},
    pages, parallel,
    sweep::Leaves,
};
use crate::{
    geometry::Aabb,
    simd::{Backend, Operation, Simd},
};
use core::ops::Range;
use std::{vec, vec::Vec};

/// Primitives are fetched so many before they may be read, and where they are as many before that.
const AHEAD: usize = 24;
/// Subtrees of up to so many nodes are one task.
const TASK_NODES: usize = 1 << 14;

/// What is known of a binary node.
#[derive(Clone, Copy)]
struct Entry {
    forest: Forest,
    /// How they are made.
    cuts: Cuts,
    /// Where its primitives begin in the tree's order.
    first: u32,
    /// How many primitives it has, or 255 if more.
    count: u8,
    /// Whether they fit into a leaf.
    fits: bool,
    /// Whether C(n, 1) is a leaf's.
    is_leaf: bool,
}

impl Entry {
    const NONE: Self = Self {
        forest: [0.0; MAX_WIDTH],
        cuts: Cuts::NONE,
        first: 0,
        count: 0,
        fits: false,
        is_leaf: false,
    };
}

/// The cheapest collapse of a tree to nodes `W` wide.
pub(super) struct Collapse<'a, const W: usize> {
    nodes: &'a [BinaryNode],
    entries: Vec<Entry>,
}

impl<'a, const W: usize> Collapse<'a, W> {
    /// Of a tree in our order, whose leaves all fit, and are as full as they can be where it was built to have such.
    pub fn new<I: Input>(input: &I, tree: &'a BinaryTree, leaves: Leaves, watch: &Watch) -> Self {
        let nodes = tree.nodes();
        let mut entries = pages::filled(Entry::NONE, nodes.len());
        if let Some(root) = nodes.first() {
            let solver = Solver::<W, I> {
                input,
                nodes,
                order: tree.order(),
                tried: leaves.below,
                measure: Measure::of_bounds(&root.aabb),
                backend: Backend::detect(),
            };
            solver.solve_all(&mut entries, watch);
        }
        Self { nodes, entries }
    }

    /// The primitives of a node that becomes a leaf, as a range of the tree's order.
    pub fn places(&self, node: usize) -> Range<usize> {
        let entry = &self.entries[node];
        let first = entry.first as usize;
        first..first + entry.count as usize
    }
}

impl<const W: usize> Shape<W> for Collapse<'_, W> {
    fn len(&self) -> usize {
        self.nodes.len()
    }

    fn root(&self) -> usize {
        0
    }

    fn aabb(&self, node: usize) -> &Aabb {
        &self.nodes[node].aabb
    }

    fn is_leaf(&self, node: usize) -> bool {
        self.entries[node].is_leaf
    }

    /// As the binary node.
    fn leaf(&self, node: usize) -> u32 {
        node as u32
    }

    fn below(&self, node: usize) -> [usize; 2] {
        self.nodes[node].children()
    }

    fn cuts(&self, node: usize) -> Cuts {
        self.entries[node].cuts
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, token: S, node: usize) {
        for child in self.below(node) {
            token.prefetch_line((&raw const self.nodes[child]).cast());
            token.prefetch_line((&raw const self.entries[child].cuts).cast());
        }
    }
}

struct Solver<'a, const W: usize, I> {
    input: &'a I,
    nodes: &'a [BinaryNode],
    order: &'a [u32],
    /// Half the area of nodes up to which it is known that there are no more leaves than those that there are.
    tried: f32,
    measure: Measure,
    backend: Backend,
}

impl<const W: usize, I: Input> Solver<'_, W, I> {
    /// Every node after those below it, without recursion: the ranges below small subtrees first, at
    /// once, then what is above.
    fn solve_all(&self, entries: &mut [Entry], watch: &Watch) {
        let tasks = self.tasks();
        let mut slices = Vec::with_capacity(tasks.len());
        let (mut rest, mut passed) = (&mut *entries, 0);
        for task in &tasks {
            let (slice, after) = rest[task.start - passed..].split_at_mut(task.len());
            slices.push((task.start, slice));
            (rest, passed) = (after, task.end);
        }
        let solve = |(start, entries): (usize, &mut [Entry])| {
            self.backend.run(SolveTask {
                solver: self,
                start,
                entries,
                watch,
            });
        };
        parallel::map(slices, solve);

        self.backend.run(SolveRest {
            solver: self,
            tasks,
            entries,
        });
    }

    /// What is below the largest subtrees of up to [`TASK_NODES`] nodes, as ranges from left to right.
    fn tasks(&self) -> Vec<Range<usize>> {
        let nodes = self.nodes;
        let mut tasks = Vec::new();
        // A node, and where the range of the nodes below it ends.
        let mut todo = vec![(0, nodes.len())];
        while let Some((node, end)) = todo.pop() {
            if nodes[node].is_leaf() {
                continue;
            }
            let [left, right] = nodes[node].children();
            if end - left <= TASK_NODES {
                tasks.push(left..end);
                continue;
            }
            let right_node = &nodes[right];
            let middle = match right_node.is_leaf() {
                true => end,
                false => right_node.first as usize,
            };
            todo.extend([(right, end), (left, middle)]);
        }
        tasks
    }

    /// One node; those below it are in `entries`, of which the first is that of node `start`.
    #[inline(always)]
    fn solve<S: Simd>(&self, token: S, node: usize, entries: &[Entry], start: usize) -> Entry {
        let BinaryNode { aabb, first, count } = self.nodes[node];
        let area = self.measure.half_area(&aabb);
        if self.nodes[node].is_leaf() {
            // Those of leaves to come, in case they are to be one.
            for place in first as usize..(first + count) as usize {
                let soon = [1, 2].map(|times| place.wrapping_sub(times * AHEAD));
                self.input.fetch_of(token, self.order, soon);
            }
            return Entry {
                forest: [area * I::leaf_cost(count as usize); MAX_WIDTH],
                cuts: Cuts::NONE,
                first,
                count: count as u8,
                fits: true,
                is_leaf: true,
            };
        }

        let [left, right] = self.nodes[node].children();
        let (left, right) = (&entries[left - start], &entries[right - start]);
        let joined = Joined::new::<W>(token, &left.forest, &right.forest);
        // The least of W roots, under one node.
        let mut one = joined.most::<W>() + area * cost::NODE;

        let first = left.first;
        let count = left.count.saturating_add(right.count);
        let mut fits = left.fits && right.fits && count as usize <= I::MAX_LEAF;
        fits &= area >= self.tried;
        if fits {
            let places = self.order.get(first as usize..).unwrap_or(&[]);
            let ids = places.get(..count as usize);
            fits = ids.is_some_and(|ids| leaf_of(self.backend, self.input, ids, 0).is_some());
        }
        let mut is_leaf = false;
        if fits {
            let leaf = area * I::leaf_cost(count as usize);
            is_leaf = leaf <= one;
            if is_leaf {
                one = leaf;
            }
        }
        let (forest, cuts) = joined.below::<W>(token, one);
        Entry {
            forest,
            cuts,
            first,
            count,
            fits,
            is_leaf,
        }
    }
}

/// The nodes from number `start` on, all of which lead to one another alone.
struct SolveTask<'s, 'a, const W: usize, I> {
    solver: &'s Solver<'a, W, I>,
    start: usize,
    entries: &'s mut [Entry],
    watch: &'s Watch<'s>,
}

impl<const W: usize, I: Input> Operation for SolveTask<'_, '_, W, I> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let Self {
            solver,
            start,
            entries,
            watch,
        } = self;
        for node in (0..entries.len()).rev() {
            entries[node] = solver.solve(token, start + node, entries, start);
            if node % STRIDE == 0 {
                watch.advance(STRIDE);
            }
        }
    }
}

/// All but the tasks, which are solved.
struct SolveRest<'s, 'a, const W: usize, I> {
    solver: &'s Solver<'a, W, I>,
    tasks: Vec<Range<usize>>,
    entries: &'s mut [Entry],
}

impl<const W: usize, I: Input> Operation for SolveRest<'_, '_, W, I> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let Self {
            solver,
            mut tasks,
            entries,
        } = self;
        let mut node = entries.len();
        while node > 0 {
            if let Some(task) = tasks.pop_if(|task| task.end == node) {
                node = task.start;
                continue;
            }
            node -= 1;
            entries[node] = solver.solve(token, node, entries, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        build::{Builder, input::Boxes},
        geometry::Aabb,
    };
    use glam::Vec3;

    fn boxes(count: u32) -> Vec<Aabb> {
        let unit = |n: u32| f32::from(n.wrapping_mul(0x9e37_79b9).rotate_left(13) as u16) / 65536.0;
        let point = |n: u32| Vec3::new(unit(3 * n), unit(3 * n + 1), unit(3 * n + 2));
        let aabb = |i: u32| Aabb::from_points([point(2 * i), point(2 * i + 1)]);
        (0..count).map(aabb).collect()
    }

    /// Every way to take a subtree apart into roots: how many, and what they cost.
    fn forests<const W: usize>(
        tree: &BinaryTree,
        measure: &Measure,
        node: usize,
    ) -> (Vec<(usize, f32)>, usize) {
        let BinaryNode { aabb, count, .. } = tree.nodes()[node];
        let area = measure.half_area(&aabb);
        if count > 0 {
            return (vec![(1, area * Boxes::leaf_cost(1))], 1);
        }
        let [(left, left_count), (right, right_count)] = tree.nodes()[node]
            .children()
            .map(|child| forests::<W>(tree, measure, child));
        let count = left_count + right_count;
        let mut all = Vec::new();
        for (left_roots, left_cost) in &left {
            for (right_roots, right_cost) in &right {
                all.push((left_roots + right_roots, left_cost + right_cost));
            }
        }
        let costs = all
            .iter()
            .filter(|(roots, _)| *roots <= W)
            .map(|(_, cost)| cost);
        let mut whole = area * cost::NODE + costs.copied().fold(f32::INFINITY, f32::min);
        if count <= Boxes::MAX_LEAF {
            whole = whole.min(area * Boxes::leaf_cost(count));
        }
        all.push((1, whole));
        (all, count)
    }

    /// What the wide nodes and leaves below a node cost.
    fn cost_of<const W: usize>(collapse: &Collapse<W>, measure: &Measure, node: usize) -> f32 {
        let area = measure.half_area(&collapse.nodes[node].aabb);
        if collapse.is_leaf(node) {
            return area * Boxes::leaf_cost(collapse.places(node).len());
        }
        let (children, count) = collapse.children(node);
        assert!((2..=W).contains(&count));
        let below = children[..count]
            .iter()
            .map(|&child| cost_of(collapse, measure, child));
        area * cost::NODE + below.sum::<f32>()
    }

    fn check<const W: usize>(count: u32) {
        let boxes = boxes(count);
        let input = Boxes(&boxes);
        let tree = Builder::new().build_primitives_binary(&boxes).unwrap();
        let measure = Measure::of_bounds(&tree.nodes()[0].aabb);
        let collapse = Collapse::<W>::new(&input, &tree, Leaves::SINGLE, &Watch::none());
        let (all, _) = forests::<W>(&tree, &measure, 0);
        let whole = all.iter().filter(|(roots, _)| *roots == 1);
        let least = whole.map(|&(_, cost)| cost).fold(f32::INFINITY, f32::min);
        let promised = collapse.entries[0].forest[0];
        let found = cost_of(&collapse, &measure, 0);
        assert!((promised / least - 1.0).abs() < 1e-5, "{promised}, {least}");
        assert!((found / least - 1.0).abs() < 1e-5, "{found}, {least}");
    }

    #[test]
    fn no_cheaper_way() {
        for count in 1..18 {
            check::<2>(count);
            check::<4>(count);
            check::<8>(count);
        }
    }
}
