//! How the cheapest forests below a node are made, for all numbers of roots at once: the recurrence that stands in
//! [`collapse`](super::collapse), in vectors.

use crate::simd::{Lanes, Simd, Vector};

/// The widest node there is.
pub(super) const MAX_WIDTH: usize = 8;

/// C(n, 1) to C(n, W) of a node n. They never rise.
pub(super) type Forest = [f32; MAX_WIDTH];

/// How the cheapest forests below a node are made.
///
/// The lowest bits, one for each number of roots from 1 on, say whether that many cost less than one less. Above them
/// are three bits for each: how many roots are below the left child.
#[derive(Clone, Copy)]
pub(super) struct Cuts(u32);

impl Cuts {
    /// Those of a leaf, which is one root.
    pub const NONE: Self = Self(0);
    const LEFT: u32 = 3;

    /// As few roots as do for the cost of so many, 1 to [`MAX_WIDTH`].
    #[inline(always)]
    pub fn fewest(self, roots: usize) -> usize {
        let fewer = self.0 & ((1 << roots) - 1) | 1;
        fewer.ilog2() as usize + 1
    }

    /// How many of so many roots, two at least, are below the left child.
    #[inline(always)]
    pub fn left(self, roots: usize) -> usize {
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

/// The same where all roots but one are below the left child.
const LEFTS_OF_ALL_BUT_ONE: [f32; MAX_WIDTH] = {
    let mut lefts = [0.0; MAX_WIDTH];
    let mut lane = 1;
    while lane < MAX_WIDTH {
        lefts[lane] = LEFTS[lane][lane];
        lane += 1;
    }
    lefts
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

/// What two children come to together.
pub(super) struct Joined<S: Simd> {
    /// C(left, k) + C(right, i - k), the least over k, for all i from 2 on; in the first lane is what no sum is greater than.
    least: S::F32x8,
    /// The first k of which it is, as [`LEFTS`] has it.
    lefts: S::F32x8,
}

impl<S: Simd> Joined<S> {
    /// Of nodes `W` wide.
    #[inline(always)]
    pub fn new<const W: usize>(token: S, left: &Forest, right: &Forest) -> Self {
        const { assert!(W >= 2 && W <= MAX_WIDTH) };
        // Most nodes have a child for which one root is as good as any number.
        if right[0] == right[W - 1] {
            return Self::with_one_root(token, left, right[0], &LEFTS_OF_ALL_BUT_ONE);
        }
        if left[0] == left[W - 1] {
            return Self::with_one_root(token, right, left[0], &LEFTS[1]);
        }
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
        Self { least, lefts }
    }

    /// Of a child and one that is one root and costs `one`.
    #[inline(always)]
    fn with_one_root(token: S, other: &Forest, one: f32, lefts: &[f32; MAX_WIDTH]) -> Self {
        let sum = S::F32x8::load(token, other).permute(&UP[1]) + S::F32x8::splat(token, one);
        let more_than_one = S::F32x8::of_bits(token, 0xfe);
        Self {
            least: more_than_one.select(sum, S::F32x8::splat(token, f32::INFINITY)),
            lefts: more_than_one & S::F32x8::load(token, lefts),
        }
    }

    /// C(n, W) if n is no root itself.
    #[inline(always)]
    pub fn most<const W: usize>(&self) -> f32 {
        self.least.to_array()[W - 1]
    }

    /// The forests of a node of which C(n, 1) is `one`, and how they are made.
    #[inline(always)]
    pub fn below<const W: usize>(self, token: S, one: f32) -> (Forest, Cuts) {
        // So many roots at most: one is never more than two, and so on.
        let forest = self.least.min(S::F32x8::splat(token, one));
        let mut cuts = forest.lt(forest.permute(&UP[1])).bits() & ((1 << W) - 1);
        for lefts in self.lefts.to_array() {
            cuts |= lefts.to_bits();
        }
        (forest.to_array(), Cuts(cuts))
    }
}
