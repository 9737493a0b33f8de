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
    assembly::Assembly,
    binary::BinaryTree,
    binned::{self, bounds_of_centers},
    clip::clip,
    input::Input,
    monitor::Watch,
    parallel::{TASK, join},
    pieces::{Known, Piece, Pieces},
    planes::{self, Plane, meet},
    refs::{Bounds, Ref, Refs},
    split::Cut,
    sweep::Leaves,
};
use crate::geometry::TriangleMesh;
use std::{boxed::Box, vec, vec::Vec};
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
/// Numbers that a cut takes: both parts have a new one each, and what is cut keeps its own, should the cut be given up.
const NUMBERS: usize = 2;

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
    let numbers = TriangleMesh::MAX_TRIANGLES.saturating_sub(input.len()) / NUMBERS;
    let budget = ((count as f64 * f64::from(fraction.max(0.0))) as usize).min(numbers);
    let mut pieces = Pieces::whole(input);
    if !I::CAN_SPLIT || budget == 0 || count <= LEAST {
        watch.phase(BUILT, count)?;
        let tree = binned::build(&pieces, refs, leaves, watch)?;
        return Ok((tree, pieces));
    }
    let levels = (count / LEAST).ilog2() as usize + 1;
    watch.phase(CUT, levels * count)?;
    let upper = Upper {
        input,
        watch,
        scale: refs.scale(),
        least_overlap: OVERLAP * bounds_of(&refs.refs).half_area(),
    };
    let part = Part {
        refs: refs.refs,
        known: Known::NONE,
        first: input.len() as u32,
        budget,
        depth: 0,
    };
    let root = upper.grow(part);
    watch.phase(BUILT, root.count)?;
    let tree = finish(&mut pieces, root, leaves, watch)?;
    Ok((tree, pieces))
}

/// A part of the tree.
enum Grown {
    Inner {
        /// What was made here of what is cut, and the number of the first.
        pieces: Vec<Piece>,
        first: u32,
        sides: Box<[Counted; 2]>,
    },
    /// What the other builder builds.
    Rest(Vec<Ref>),
}

/// A part and how many references it has.
struct Counted {
    part: Grown,
    count: usize,
}

/// What is to be grown.
struct Part<'p> {
    refs: Vec<Ref>,
    /// What was cut above.
    known: Known<'p>,
    /// The first of the numbers of what is cut here and below.
    first: u32,
    /// How many references may be added. There are [`NUMBERS`] for each, so that those of other parts are known: they grow at
    /// the same time.
    budget: usize,
    depth: u32,
}

/// What all of it needs.
struct Upper<'u, I> {
    input: &'u I,
    watch: &'u Watch<'u>,
    scale: f32,
    /// Scaled, as all boxes of references are.
    least_overlap: f32,
}

impl<I: Input> Upper<'_, I> {
    /// Grows the tree over a part.
    fn grow(&self, part: Part) -> Counted {
        let Part {
            refs,
            known,
            first,
            budget,
            depth,
        } = part;
        let bounds = bounds_of(&refs);
        // What overlaps in there is no larger.
        let is_small = refs.len() <= LEAST || bounds.half_area() <= self.least_overlap;
        let go_on = self.watch.advance(refs.len());
        if is_small || budget == 0 || depth >= MAX_DEPTH || !go_on {
            return rest(refs);
        }
        let Some(cut) = Cut::find(&refs, &bounds_of_centers(&refs)) else {
            return rest(refs);
        };
        let [left, right] = sides(&refs, |r| cut.is_left(r));
        let (left_bounds, right_bounds) = (bounds_of(&left), bounds_of(&right));
        let overlap = meet(left_bounds, right_bounds).map_or(0.0, |both| both.half_area());
        let (mut both, mut cut) = ([left, right], Vec::new());
        if overlap > self.least_overlap.max(bounds.half_area() * OVERLAP_HERE) {
            let large = bounds.half_area() * LARGE;
            let [large, others] = sides(&refs, |r| r.bounds().half_area() > large);
            if !large.is_empty() && large.len() <= others.len() / 4 {
                let others = Part {
                    refs: others,
                    known,
                    first,
                    budget,
                    depth: depth + 1,
                };
                return inner(first, Vec::new(), [rest(large), self.grow(others)]);
            }
            let cost = left_bounds.half_area() * both[0].len() as f32
                + right_bounds.half_area() * both[1].len() as f32;
            let corners = |r: &Ref| self.corners(&known, r);
            let plane = planes::cheapest(&refs, &bounds, corners, self.watch);
            if let Some(plane) = plane.filter(|plane| plane.cost < cost) {
                let (sides, pieces) = self.cut(&refs, plane, &known, first, budget);
                if sides
                    .iter()
                    .all(|side| !side.is_empty() && side.len() < refs.len())
                {
                    (both, cut) = (sides, pieces);
                }
            }
        }
        drop(refs);
        let known = Known {
            first,
            pieces: &cut,
            above: Some(&known),
        };
        let [left, right] = both;
        let budget = budget - cut.len() / NUMBERS;
        let count = left.len() + right.len();
        let left_budget = (budget as u64 * left.len() as u64 / count as u64) as usize;
        let first_below = first + cut.len() as u32;
        let worth_it = left.len().min(right.len()) > TASK;
        let left = Part {
            refs: left,
            known,
            first: first_below,
            budget: left_budget,
            depth: depth + 1,
        };
        let right = Part {
            refs: right,
            known,
            first: first_below + (NUMBERS * left_budget) as u32,
            budget: budget - left_budget,
            depth: depth + 1,
        };
        let (left, right) = join(worth_it, || self.grow(left), || self.grow(right));
        inner(first, cut, [left, right])
    }

    /// The corners of a triangle, scaled.
    fn corners(&self, known: &Known, r: &Ref) -> [f32x4; 3] {
        let id = known.piece(r.id()).map_or(r.id(), |piece| piece.id);
        let corners = self.input.triangle(id).unwrap_or_default();
        corners.map(|corner| {
            let corner = corner * self.scale;
            f32x4::new([corner.x, corner.y, corner.z, 0.0])
        })
    }

    /// Both sides of a plane, and the pieces they have of what it meets, whose numbers begin at `first`. That is cut, unless it
    /// is cheaper on one side as a whole.
    fn cut(
        &self,
        refs: &[Ref],
        plane: Plane,
        known: &Known,
        first: u32,
        budget: usize,
    ) -> ([Vec<Ref>; 2], Vec<Piece>) {
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
        let mut pieces = Vec::new();
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
            let is_cheaper = apart <= all_left.min(all_right) && pieces.len() < NUMBERS * budget;
            if is_cheaper && let Some(parts) = self.cut_one(&r, known, axis, at) {
                let number = first + pieces.len() as u32;
                let [below, above] = [0, 1].map(|side| {
                    let bounds = Bounds::of(&parts[side].aabb);
                    Ref::new(&bounds, number + side as u32).scaled(self.scale)
                });
                pieces.extend(parts);
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
        ([lefts, rights], pieces)
    }

    /// Both parts of what a reference is to, if there are two.
    fn cut_one(&self, r: &Ref, known: &Known, axis: usize, at: f32) -> Option<[Piece; NUMBERS]> {
        let (aabb, id) = match known.piece(r.id()) {
            Some(&Piece { aabb, id }) => (aabb, id),
            None => (self.input.aabb(r.id()), r.id()),
        };
        let corners = self.input.triangle(id)?;
        // Whatever is lost here of a denormal number, both parts have the same plane.
        let at = at / self.scale;
        if !(aabb.min[axis] < at && at < aabb.max[axis]) {
            return None;
        }
        let (mut below, mut above) = (aabb, aabb);
        below.max[axis] = at;
        above.min[axis] = at;
        let (below, above) = (clip(corners, &below)?, clip(corners, &above)?);
        Some([below, above].map(|aabb| Piece { aabb, id }))
    }
}

/// A part that is left to the other builder.
fn rest(refs: Vec<Ref>) -> Counted {
    Counted {
        count: refs.len(),
        part: Grown::Rest(refs),
    }
}

/// A part over two, where pieces were made whose numbers begin at `first`.
fn inner(first: u32, pieces: Vec<Piece>, sides: [Counted; 2]) -> Counted {
    Counted {
        count: sides[0].count + sides[1].count,
        part: Grown::Inner {
            pieces,
            first,
            sides: Box::new(sides),
        },
    }
}

/// References for which something holds, and the others.
fn sides(refs: &[Ref], holds: impl Fn(&Ref) -> bool) -> [Vec<Ref>; 2] {
    let (holding, others) = refs.iter().partition(|r| holds(r));
    [holding, others]
}

fn bounds_of(refs: &[Ref]) -> Bounds {
    refs.iter()
        .fold(Bounds::EMPTY, |bounds, r| bounds.join(r.bounds()))
}

/// Has what is left built, and puts all together.
fn finish<I: Input>(
    pieces: &mut Pieces<I>,
    mut root: Counted,
    leaves: Leaves,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    number(pieces, &mut root);
    let tree = built(pieces, root, leaves, watch).tree();
    watch.check()?;
    Ok(tree)
}

/// Takes pieces from where they were made, and gives them the numbers that they have from now on.
fn number<I: Input>(pieces: &mut Pieces<I>, root: &mut Counted) {
    // Where pieces are now whose numbers begin at what is in their order.
    let mut moved: Vec<(u32, usize)> = Vec::new();
    let known = pieces.input.len();
    let mut todo = vec![root];
    while let Some(part) = todo.pop() {
        match &mut part.part {
            Grown::Inner {
                pieces: here,
                first,
                sides,
            } => {
                if !here.is_empty() {
                    moved.push((*first, known + pieces.pieces.len()));
                    pieces.pieces.append(here);
                }
                let [left, right] = &mut **sides;
                todo.extend([right, left]);
            }
            Grown::Rest(refs) => {
                for r in refs.iter_mut().filter(|r| r.id() as usize >= known) {
                    let after = moved.partition_point(|&(first, _)| first <= r.id());
                    if let Some((first, place)) = after.checked_sub(1).map(|at| moved[at]) {
                        *r = r.with_id((r.id() - first) + place as u32);
                    }
                }
            }
        }
    }
}

/// A part with what is left built.
fn built<I: Input>(pieces: &Pieces<I>, part: Counted, leaves: Leaves, watch: &Watch) -> Assembly {
    match part.part {
        Grown::Rest(mut refs) => binned::subtree(pieces, &mut refs, leaves, watch),
        Grown::Inner { sides, .. } => {
            let [left, right] = *sides;
            let (left, right) = join(
                left.count.min(right.count) > TASK,
                || built(pieces, left, leaves, watch),
                || built(pieces, right, leaves, watch),
            );
            Assembly::two(left, right)
        }
    }
}
