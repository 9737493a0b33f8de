//! The cheapest collapse of a tree whose leaves stay what they are: as [`collapse`](super::collapse), but for speed.
//!
//! The costs of a node's forests are needed for its parent's, and then no more. What is kept is how each is made.

use super::{
    collapse::MAX_WIDTH,
    cost::{self, Measure},
    emit::Shape,
    input::Input,
    monitor::{STRIDE, Watch},
    ploc::Node,
};
use crate::{
    geometry::Aabb,
    simd::{Backend, Lanes, Operation, Simd, Vector},
};
use core::marker::PhantomData;
use std::vec::Vec;

/// The cheapest collapse to nodes `W` wide.
pub(super) struct LeafCollapse<'a, const W: usize> {
    nodes: &'a [Node],
    cuts: Vec<Cuts>,
}

impl<'a, const W: usize> LeafCollapse<'a, W> {
    pub fn new<I: Input>(nodes: &'a [Node], watch: &Watch) -> Self {
        const { assert!(W >= 2 && W <= MAX_WIDTH) };
        let bounds = nodes.last().map_or(Aabb::EMPTY, |root| root.aabb);
        let cuts = Backend::detect().run(Solve::<I, W> {
            nodes,
            measure: Measure::of_bounds(&bounds),
            watch,
            input: PhantomData,
        });
        Self { nodes, cuts }
    }
}

impl<const W: usize> Shape<W> for LeafCollapse<'_, W> {
    fn len(&self) -> usize {
        self.nodes.len()
    }

    fn root(&self) -> usize {
        self.nodes.len() - 1
    }

    #[inline(always)]
    fn aabb(&self, node: usize) -> &Aabb {
        &self.nodes[node].aabb
    }

    #[inline(always)]
    fn is_leaf(&self, node: usize) -> bool {
        self.nodes[node].is_leaf()
    }

    #[inline(always)]
    fn children(&self, node: usize) -> ([usize; W], usize) {
        let (mut children, mut count) = ([0; W], 0);
        // Forests still to be taken apart, and how many roots each has: never more than W in all.
        let mut todo = [(0, 0); W];
        let cut = |node: usize, roots: usize| {
            let [left, right] = self.nodes[node].children();
            let lefts = self.cuts[node].left(roots);
            [(right, roots - lefts), (left, lefts)]
        };
        [todo[0], todo[1]] = cut(node, W);
        let mut len = 2;
        while len > 0 {
            len -= 1;
            let (node, roots) = todo[len];
            let roots = self.cuts[node].fewest(roots);
            if roots == 1 {
                children[count] = node;
                count += 1;
            } else {
                [todo[len], todo[len + 1]] = cut(node, roots);
                len += 2;
            }
        }
        (children, count)
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, token: S, node: usize) {
        for child in self.nodes[node].children() {
            token.prefetch((&raw const self.nodes[child]).cast());
        }
    }
}

/// How the cheapest forests below a node are made.
///
/// The lowest bits, one for each number of roots from 1 on, say whether that many cost less than one less. Above them
/// are three bits for each: how many roots are below the left child.
#[derive(Clone, Copy)]
struct Cuts(u32);

impl Cuts {
    /// There is one root only: a leaf.
    const NONE: Self = Self(0);
    const LEFT: u32 = 3;

    /// As few roots as do for the cost of so many, 1 to [`MAX_WIDTH`].
    #[inline(always)]
    fn fewest(self, roots: usize) -> usize {
        let fewer = self.0 & ((1 << roots) - 1) | 1;
        fewer.ilog2() as usize + 1
    }

    /// How many of so many roots, two at least, are below the left child.
    #[inline(always)]
    fn left(self, roots: usize) -> usize {
        let shift = MAX_WIDTH as u32 + Self::LEFT * (roots as u32 - 1);
        (self.0 >> shift) as usize & (MAX_WIDTH - 1)
    }
}

/// For each number of roots below the left child what [`Cuts`] has of it, for each number of roots in all.
const LEFTS: [[f32; MAX_WIDTH]; MAX_WIDTH] = {
    let mut all = [[0.0; MAX_WIDTH]; MAX_WIDTH];
    let mut left = 0;
    while left < MAX_WIDTH {
        let mut lane = 0;
        while lane < MAX_WIDTH {
            let shift = MAX_WIDTH as u32 + Cuts::LEFT * lane as u32;
            all[left][lane] = f32::from_bits((left as u32) << shift);
            lane += 1;
        }
        left += 1;
    }
    all
};

/// For each number of lanes those that lanes come from that move up by so many.
const UP: [[u8; MAX_WIDTH]; MAX_WIDTH] = {
    let mut all = [[0; MAX_WIDTH]; MAX_WIDTH];
    let mut by = 0;
    while by < MAX_WIDTH {
        let mut lane = by;
        while lane < MAX_WIDTH {
            all[by][lane] = (lane - by) as u8;
            lane += 1;
        }
        by += 1;
    }
    all
};

struct Solve<'a, I, const W: usize> {
    nodes: &'a [Node],
    measure: Measure,
    watch: &'a Watch<'a>,
    input: PhantomData<I>,
}

impl<I: Input, const W: usize> Operation for Solve<'_, I, W> {
    type Output = Vec<Cuts>;

    /// Every node after those below it.
    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Vec<Cuts> {
        // C(n, 1) to C(n, W), as `collapse` has it. They never rise.
        let mut forests = Vec::<[f32; MAX_WIDTH]>::with_capacity(self.nodes.len());
        let mut all = Vec::with_capacity(self.nodes.len());
        for nodes in self.nodes.chunks(STRIDE) {
            self.watch.advance(nodes.len());
            for node in nodes {
                let area = self.measure.half_area(&node.aabb);
                if node.is_leaf() {
                    forests.push([area * I::leaf_cost(node.count()); _]);
                    all.push(Cuts::NONE);
                    continue;
                }
                let [left, right] = node.children();
                let (least, lefts) = least::<S, W>(token, &forests[left], &forests[right]);
                let whole = least.to_array()[W - 1] + area * cost::NODE;
                // So many roots at most: one is never more than two, and so on.
                let forest = least.min(S::F32x8::splat(token, whole));
                let fewer = forest.lt(forest.permute(&UP[1])).bits() & ((1 << W) - 1);
                let mut cuts = fewer;
                for lefts in lefts.to_array() {
                    cuts |= lefts.to_bits();
                }
                forests.push(forest.to_array());
                all.push(Cuts(cuts));
            }
        }
        all
    }
}

/// C(left, k) + C(right, i - k), the least over k, for all i from 2 on, with the first k of which it is, as [`LEFTS`] has
/// it; in the first lane is what no sum is greater than.
#[inline(always)]
fn least<S: Simd, const W: usize>(
    token: S,
    left: &[f32; MAX_WIDTH],
    right: &[f32; MAX_WIDTH],
) -> (S::F32x8, S::F32x8) {
    let right = S::F32x8::load(token, right);
    let mut least = S::F32x8::splat(token, f32::INFINITY);
    let mut lefts = S::F32x8::splat(token, 0.0);
    for k in 1..W {
        let sum = right.permute(&UP[k]) + S::F32x8::splat(token, left[k - 1]);
        let more_than_left = S::F32x8::of_bits(token, 0xff << k & 0xff);
        let is_less = sum.lt(least) & more_than_left;
        least = is_less.select(sum, least);
        lefts = is_less.select(S::F32x8::load(token, &LEFTS[k]), lefts);
    }
    (least, lefts)
}
