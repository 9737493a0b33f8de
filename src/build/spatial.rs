//! The upper levels of the tree, where large triangles may be cut in two rather than make two boxes overlap.
//!
//! Stich, Friedrich, Dietrich, "Spatial splits in bounding volume hierarchies" (2009). Where the best cut between
//! references leaves two boxes that overlap, cuts through the triangles are weighed as well. Two things are not as there:
//!
//! - The heuristic takes a subtree to cost as much as all that is in it. So it cuts what is larger than nearly all
//!   else, of which a query pays less for one leaf close to the root. Such triangles are put there first.
//! - Below [`LEAST`] references nothing is cut: leaves that share vertices are worth more than what is left to gain.
//!
//! To cut before the build (Karras and Aila 2013) does not do: game levels did not get faster, at any budget.

use super::{
    BuildError,
    binary::{BinaryNode, BinaryTree},
    binned::{self, bounds_of_centers},
    clip::clip,
    input::Input,
    lay_out::{Part, lay_out, prune},
    monitor::{STRIDE, Watch},
    pieces::{Piece, Pieces},
    refs::{Bounds, Ref, Refs},
    split::Cut,
    sweep::Leaves,
};
use crate::geometry::TriangleMesh;
use std::{vec, vec::Vec};
use wide::f32x4;

/// With fewer references nothing is cut. From 64 on, more is faster, smaller and sooner built.
const LEAST: usize = 1024;
/// The least overlap for which cuts are weighed, of the area of all. 1e-4 adds twice as many references for as much
/// speed, 1e-2 gains half.
const OVERLAP: f32 = 1e-3;
/// And of the area of the node: less is not worth the look. 0.1 loses half of the gain.
const OVERLAP_HERE: f32 = 0.05;
/// What has more than this of the area of all around it goes up. Without, a temple pays 12 % more.
const LARGE: f32 = 0.15;
/// How deep this goes: then it is up to the other builder, which has a bound as well.
const MAX_DEPTH: u32 = 48;
/// 16 are sooner done, and a level that gains 9 % of nodes and leaves then gains 3.
const BINS: usize = 32;

/// Where in a build the cuts are done, and the tree.
const CUT: f32 = 0.35;
const BUILT: f32 = 0.5;

/// The tree over `refs`, one a leaf, and the pieces some are cut into: at most `fraction` of their number is added.
///
/// # Errors
/// The build was cancelled.
pub(super) fn build<'a, I: Input>(
    input: &'a I,
    refs: Refs,
    fraction: f32,
    leaves: Leaves,
    watch: &Watch,
) -> Result<(BinaryTree, Pieces<'a, I>), BuildError> {
    let count = refs.refs.len();
    // Every cut takes two new numbers at most.
    let numbers = TriangleMesh::MAX_TRIANGLES.saturating_sub(input.len()) / 2;
    let budget = ((count as f64 * f64::from(fraction.max(0.0))) as usize).min(numbers);
    let mut pieces = Pieces::whole(input);
    if !I::CAN_SPLIT || budget == 0 || count <= LEAST {
        watch.phase(BUILT, count)?;
        let tree = binned::build(&pieces, refs, leaves, watch)?;
        return Ok((tree, pieces));
    }
    let levels = (count / LEAST).ilog2() as usize + 1;
    watch.phase(CUT, levels * count)?;
    let mut upper = Upper {
        pieces: &mut pieces,
        watch,
        scale: refs.scale(),
        least_overlap: OVERLAP * bounds_of(&refs.refs).half_area(),
        parts: Vec::new(),
    };
    let root = upper.grow(refs.refs, budget, 0);
    let parts = upper.parts;
    watch.phase(BUILT, parts[root].count)?;
    let tree = finish(&pieces, root, parts, leaves, watch)?;
    Ok((tree, pieces))
}

/// A part of the tree.
enum Grown {
    Inner([usize; 2]),
    /// What the other builder builds.
    Rest(Vec<Ref>),
}

/// A part and how many references it has.
struct Counted {
    part: Grown,
    count: usize,
}

struct Upper<'p, 'a, I> {
    pieces: &'p mut Pieces<'a, I>,
    watch: &'p Watch<'p>,
    scale: f32,
    /// Scaled, as all boxes of references are.
    least_overlap: f32,
    parts: Vec<Counted>,
}

/// A cut through what it meets.
#[derive(Clone, Copy)]
struct Plane {
    cost: f32,
    axis: usize,
    at: f32,
    left: Bounds,
    right: Bounds,
    left_count: usize,
    right_count: usize,
}

impl<I: Input> Upper<'_, '_, I> {
    /// Grows the tree over `refs`: the place of its root among the parts.
    fn grow(&mut self, refs: Vec<Ref>, budget: usize, depth: u32) -> usize {
        let bounds = bounds_of(&refs);
        // What overlaps in there is no larger.
        let is_small = refs.len() <= LEAST || bounds.half_area() <= self.least_overlap;
        let go_on = self.watch.advance(refs.len());
        if is_small || budget == 0 || depth >= MAX_DEPTH || !go_on {
            return self.rest(refs);
        }
        let Some(cut) = Cut::find(&refs, &bounds_of_centers(&refs)) else {
            return self.rest(refs);
        };
        let (left, right) = refs.iter().partition::<Vec<_>, _>(|r| cut.is_left(r));
        let (left_bounds, right_bounds) = (bounds_of(&left), bounds_of(&right));
        let overlap = meet(left_bounds, right_bounds).map_or(0.0, |both| both.half_area());
        let [left, right] = if overlap > self.least_overlap.max(bounds.half_area() * OVERLAP_HERE) {
            let large = bounds.half_area() * LARGE;
            let (large, others) = refs
                .iter()
                .partition::<Vec<_>, _>(|r| r.bounds().half_area() > large);
            if !large.is_empty() && large.len() <= others.len() / 4 {
                let large = self.rest(large);
                let others = self.grow(others, budget, depth + 1);
                return self.inner([large, others]);
            }
            let cost = left_bounds.half_area() * left.len() as f32
                + right_bounds.half_area() * right.len() as f32;
            match self
                .cheapest(&refs, &bounds)
                .filter(|plane| plane.cost < cost)
            {
                Some(plane) => {
                    let known = self.pieces.pieces.len();
                    let sides = self.cut(&refs, plane, budget);
                    if sides
                        .iter()
                        .all(|side| !side.is_empty() && side.len() < refs.len())
                    {
                        sides
                    } else {
                        // What was cut stays whole.
                        self.pieces.pieces.truncate(known);
                        [left, right]
                    }
                }
                None => [left, right],
            }
        } else {
            [left, right]
        };
        let budget = budget.saturating_sub(left.len() + right.len() - refs.len());
        drop(refs);
        let count = left.len() + right.len();
        let left_budget = (budget as u64 * left.len() as u64 / count as u64) as usize;
        let left = self.grow(left, left_budget, depth + 1);
        let right = self.grow(right, budget - left_budget, depth + 1);
        self.inner([left, right])
    }

    fn rest(&mut self, refs: Vec<Ref>) -> usize {
        self.parts.push(Counted {
            count: refs.len(),
            part: Grown::Rest(refs),
        });
        self.parts.len() - 1
    }

    fn inner(&mut self, sides: [usize; 2]) -> usize {
        self.parts.push(Counted {
            count: sides.iter().map(|&side| self.parts[side].count).sum(),
            part: Grown::Inner(sides),
        });
        self.parts.len() - 1
    }

    /// The cheapest plane to cut at, of those between bins of equal width. Its boxes need not be exact.
    #[inline(never)]
    fn cheapest(&self, refs: &[Ref], bounds: &Bounds) -> Option<Plane> {
        let mut best: Option<Plane> = None;
        let mut bins = vec![[Bin::EMPTY; BINS]; 3];
        let (low, high) = (bounds.min.to_array(), bounds.max.to_array());
        let width = [0, 1, 2].map(|axis| (high[axis] - low[axis]) / BINS as f32);
        for (place, r) in refs.iter().enumerate() {
            if place % (16 * STRIDE) == 0 {
                self.watch.advance(0);
            }
            let whole = r.bounds();
            let (min, max) = (whole.min.to_array(), whole.max.to_array());
            let mut corners = None;
            for (axis, bins) in bins.iter_mut().enumerate() {
                // As close as this is one place to a scene whose size is about 1.
                if width[axis] <= 1e-30 {
                    continue;
                }
                let bin = |x: f32| (((x - low[axis]) / width[axis]) as usize).min(BINS - 1);
                let (first, last) = (bin(min[axis]), bin(max[axis]));
                bins[first].starts += 1;
                bins[last].ends += 1;
                if first == last {
                    bins[first].bounds = bins[first].bounds.join(whole);
                    continue;
                }
                let corners = *corners.get_or_insert_with(|| self.corners(r));
                let mut from = Bounds::EMPTY;
                for (place, bin) in bins.iter_mut().enumerate().take(last + 1).skip(first) {
                    let start = low[axis] + width[axis] * place as f32;
                    let end = start + width[axis];
                    let to = section(&corners, axis, end);
                    let mut part = from.join(to);
                    for corner in corners {
                        let x = corner.to_array()[axis];
                        if (x >= start || place == 0) && (x <= end || place == BINS - 1) {
                            part = part.join_point(corner);
                        }
                    }
                    if let Some(part) = meet(part, whole) {
                        bin.bounds = bin.bounds.join(part);
                    }
                    from = to;
                }
            }
        }
        for (axis, bins) in bins.iter().enumerate() {
            let mut rights = [(Bounds::EMPTY, 0); BINS];
            let (mut right, mut right_count) = (Bounds::EMPTY, 0);
            for place in (1..BINS).rev() {
                right = right.join(bins[place].bounds);
                right_count += bins[place].ends;
                rights[place] = (right, right_count);
            }
            let (mut left, mut left_count) = (Bounds::EMPTY, 0);
            for place in 1..BINS {
                left = left.join(bins[place - 1].bounds);
                left_count += bins[place - 1].starts;
                let (right, right_count) = rights[place];
                if left_count == 0 || right_count == 0 {
                    continue;
                }
                let cost =
                    left.half_area() * left_count as f32 + right.half_area() * right_count as f32;
                if cost < best.map_or(f32::INFINITY, |best| best.cost) {
                    best = Some(Plane {
                        cost,
                        axis,
                        at: low[axis] + width[axis] * place as f32,
                        left,
                        right,
                        left_count,
                        right_count,
                    });
                }
            }
        }
        best
    }

    /// The corners of a triangle, scaled.
    fn corners(&self, r: &Ref) -> [f32x4; 3] {
        let id = self.pieces.primitive(r.id());
        let corners = self.pieces.triangle(id).unwrap_or_default();
        corners.map(|corner| {
            let corner = corner * self.scale;
            f32x4::new([corner.x, corner.y, corner.z, 0.0])
        })
    }

    /// Both sides of a plane. What it meets is cut, unless it is cheaper on one side as a whole.
    fn cut(&mut self, refs: &[Ref], plane: Plane, mut budget: usize) -> [Vec<Ref>; 2] {
        let Plane {
            axis,
            at,
            mut left,
            mut right,
            mut left_count,
            mut right_count,
            ..
        } = plane;
        let (mut lefts, mut rights) = (Vec::new(), Vec::new());
        for &r in refs {
            let whole = r.bounds();
            if whole.max.to_array()[axis] <= at {
                lefts.push(r);
                continue;
            }
            if whole.min.to_array()[axis] >= at {
                rights.push(r);
                continue;
            }
            let (left_area, right_area) = (left.half_area(), right.half_area());
            let apart = left_area * left_count as f32 + right_area * right_count as f32;
            let (with_left, with_right) = (left.join(whole), right.join(whole));
            let all_left = with_left.half_area() * left_count as f32
                + right_area * right_count.saturating_sub(1) as f32;
            let all_right = left_area * left_count.saturating_sub(1) as f32
                + with_right.half_area() * right_count as f32;
            let is_cheaper = apart <= all_left.min(all_right) && budget > 0;
            if is_cheaper && let Some([below, above]) = self.cut_one(&r, axis, at) {
                budget -= 1;
                lefts.push(below);
                rights.push(above);
            } else if all_left <= all_right {
                left = with_left;
                right_count = right_count.saturating_sub(1);
                lefts.push(r);
            } else {
                right = with_right;
                left_count = left_count.saturating_sub(1);
                rights.push(r);
            }
        }
        [lefts, rights]
    }

    /// Both parts of what a reference is to, if there are two.
    fn cut_one(&mut self, r: &Ref, axis: usize, at: f32) -> Option<[Ref; 2]> {
        let number = r.id();
        let aabb = self.pieces.aabb(number);
        let id = self.pieces.primitive(number);
        let corners = self.pieces.triangle(id)?;
        // Whatever is lost here of a denormal number, both parts have the same plane.
        let at = at / self.scale;
        if !(aabb.min[axis] < at && at < aabb.max[axis]) {
            return None;
        }
        let (mut below, mut above) = (aabb, aabb);
        below.max[axis] = at;
        above.min[axis] = at;
        let below = clip(corners, &below)?;
        let above = clip(corners, &above)?;
        // Not in the place of what is cut, which is as it was if the cut is given up.
        let below = self.pieces.add_piece(Piece { aabb: below, id });
        let above = self.pieces.add_piece(Piece { aabb: above, id });
        Some([below, above].map(|number| {
            Ref::new(&Bounds::of(&self.pieces.aabb(number)), number).scaled(self.scale)
        }))
    }
}

/// What is between two planes.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds,
    /// How many references begin here.
    starts: usize,
    /// How many end.
    ends: usize,
}

impl Bin {
    const EMPTY: Self = Self {
        bounds: Bounds::EMPTY,
        starts: 0,
        ends: 0,
    };
}

/// Around the line in which a triangle meets a plane.
fn section(corners: &[f32x4; 3], axis: usize, at: f32) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for (a, b) in [(0, 1), (1, 2), (2, 0)] {
        let (a, b) = (corners[a], corners[b]);
        let (from, to) = (a.to_array()[axis], b.to_array()[axis]);
        if (from < at) != (to < at) {
            let share = (at - from) / (to - from);
            bounds = bounds.join_point(a + (b - a) * f32x4::splat(share));
        }
    }
    bounds
}

/// What two boxes share.
fn meet(a: Bounds, b: Bounds) -> Option<Bounds> {
    let both = Bounds {
        min: a.min.fast_max(b.min),
        max: a.max.fast_min(b.max),
    };
    let (min, max) = (both.min.to_array(), both.max.to_array());
    (0..3).all(|axis| min[axis] <= max[axis]).then_some(both)
}

fn bounds_of(refs: &[Ref]) -> Bounds {
    refs.iter()
        .fold(Bounds::EMPTY, |bounds, r| bounds.join(r.bounds()))
}

/// Where what the other builder builds goes.
struct Job {
    refs: Vec<Ref>,
    first: usize,
    below: usize,
}

/// Has what is left built, and puts all together.
fn finish<I: Input>(
    pieces: &Pieces<I>,
    root: usize,
    mut parts: Vec<Counted>,
    leaves: Leaves,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    // In the order of `lay_out`.
    let mut jobs = Vec::new();
    let mut todo = vec![(root, 0, 1)];
    while let Some((part, first, below)) = todo.pop() {
        match &mut parts[part].part {
            &mut Grown::Inner([left, right]) => {
                let left_count = parts[left].count;
                let below_right = below + 2 + 2 * left_count - 2;
                todo.push((right, first + left_count, below_right));
                todo.push((left, first, below + 2));
            }
            Grown::Rest(refs) => jobs.push(Job {
                refs: core::mem::take(refs),
                first,
                below,
            }),
        }
    }
    let build =
        |job: &mut Job| binned::subtree(pieces, &mut job.refs, job.first, job.below, leaves, watch);
    #[cfg(feature = "rayon")]
    let built: Vec<Vec<BinaryNode>> = {
        use rayon::prelude::*;
        jobs.par_iter_mut().map(build).collect()
    };
    #[cfg(not(feature = "rayon"))]
    let built: Vec<Vec<BinaryNode>> = jobs.iter_mut().map(build).collect();

    watch.check()?;
    let order = jobs.iter().flat_map(|job| job.refs.iter().map(Ref::id));
    let order = order.collect();
    let mut built = built.into_iter();
    let nodes = lay_out(parts[root].count, root, |part, _| match parts[part].part {
        Grown::Inner([left, right]) => Part::Inner {
            left,
            right,
            left_leaves: parts[left].count,
        },
        Grown::Rest(_) => {
            watch.advance(STRIDE);
            Part::Tree(built.next().unwrap_or_default())
        }
    });
    watch.advance(0);
    let nodes = prune(nodes, leaves, watch);
    Ok(BinaryTree::new_unchecked(nodes, order))
}
