//! The grid that a compact node's boxes are on: where it begins, and how far its planes are apart.

use crate::{geometry::Aabb, slab::pow2};
use bytemuck::{Pod, Zeroable};

/// The grid of a node's planes, by axis.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Frame {
    pub origin: [f32; 3],
    /// The exponents of the steps, as floats have them.
    steps: [u8; 3],
    /// The node's.
    pub more: u8,
}

/// The numbers of a node's planes: by axis, lower and upper ones.
pub(super) type Planes<const W: usize> = [[[u8; W]; 2]; 3];
/// Where boxes are, likewise.
type Sides<const W: usize> = [[[f32; W]; 2]; 3];

/// Coordinates are cut off here. No box test looks at planes of such scenes: see [`slab`](crate::slab), (6).
pub(super) const MOST: f32 = pow2(100);
/// The exponent of the least step there is, 2^-100: that of a denormal is lost where a program flushes those.
const LEAST_STEP: u8 = 27;

/// Faces of boxes in the same one of so many parts of a step are at one plane, as good as.
const PARTS: usize = 64;
/// By how much faces of boxes without thickness, which are surfaces for certain, count for more.
const THIN: f32 = 2.0;
/// By how much upper faces count for more: what has a top has a bottom, too, but from that few rays leave.
const UPPER: f32 = 1.125;

impl Frame {
    /// The grid for `aabbs`, and the planes on it. Lanes without a box have planes 0.
    pub fn new<const W: usize>(aabbs: &[Aabb]) -> (Self, Planes<W>) {
        let count = aabbs.len().min(W);
        let mut sides: Sides<W> = [[[0.0; W]; 2]; 3];
        for (axis, sides) in sides.iter_mut().enumerate() {
            for (lane, aabb) in aabbs[..count].iter().enumerate() {
                sides[0][lane] = aabb.min[axis].clamp(-MOST, MOST) + 0.0;
                sides[1][lane] = aabb.max[axis].clamp(-MOST, MOST) + 0.0;
            }
        }
        let mut frame = Self::zeroed();
        let mut planes = [[[0; W]; 2]; 3];
        for (axis, [below, above]) in planes.iter_mut().enumerate() {
            let [los, his] = sides[axis].each_ref().map(|sides| &sides[..count]);
            let origin = los.iter().copied().fold(MOST, f32::min);
            let end = his.iter().copied().fold(-MOST, f32::max);
            frame.origin[axis] = origin;
            let step = (f64::from(end) - f64::from(origin)) / 255.0;
            frame.steps[axis] = ((step as f32).to_bits() >> 23).max(LEAST_STEP.into()) as u8;
            // The step was rounded down to a power of two; and so is the plane, to a float.
            while frame.plane(axis, u8::MAX) < end {
                frame.steps[axis] += 1;
            }
            if let Some(face) = frame.main_face(axis, &sides, count) {
                frame.align(axis, face, end);
            }
            *below = frame.below(axis, &sides[axis][0]);
            *above = frame.above(axis, &sides[axis][1]);
            below[count..].fill(0);
            above[count..].fill(0);
        }
        (frame, planes)
    }

    /// Where along an axis the boxes have faces that matter most: a coordinate, and whether an upper face is there.
    ///
    /// Rays leave from surfaces. Where one faces along an axis, a box around it ends there; if it ends a little later on the
    /// grid, every ray that leaves the surface is in the box, and has its triangles tested.
    fn main_face<const W: usize>(
        &self,
        axis: usize,
        sides: &Sides<W>,
        count: usize,
    ) -> Option<(f32, bool)> {
        let size = |axis: usize, lane: usize| sides[axis][1][lane] - sides[axis][0][lane];
        // By part.
        let mut weights = [0.0; PARTS];
        // By side and lane, and by lane and side.
        let (mut parts, mut areas) = ([[0; W]; 2], [[0.0; 2]; W]);
        for (parts, sides) in parts.iter_mut().zip(&sides[axis]) {
            for (part, &x) in parts.iter_mut().zip(sides) {
                let steps = self.steps_to(axis, x);
                let nearest = floor((steps - floor(steps)) * PARTS as f64 + 0.5);
                *part = integer(nearest) as usize % PARTS;
            }
        }
        for (lane, areas) in areas.iter_mut().enumerate() {
            let area = size((axis + 1) % 3, lane) * size((axis + 2) % 3, lane);
            let is_thin = size(axis, lane) * PARTS as f32 <= self.step(axis);
            let area = if is_thin { area * THIN } else { area };
            *areas = [area, area * UPPER];
        }
        for lane in 0..count {
            for side in 0..2 {
                weights[parts[side][lane]] += areas[lane][side];
            }
        }
        let (mut most, mut face) = ((0.0, 0.0), None);
        for side in 0..2 {
            for lane in 0..count {
                let weight = (weights[parts[side][lane]], areas[lane][side]);
                if weight > most {
                    (most, face) = (weight, Some((sides[axis][side][lane], side == 1)));
                }
            }
        }
        face
    }

    /// Moves the grid along an axis, down by less than a step, to have a plane at a face, if boxes that end at `end` have
    /// room then.
    fn align(&mut self, axis: usize, (face, is_upper): (f32, bool), end: f32) {
        let mut moved = *self;
        let steps = self.steps_to(axis, face);
        let number = (steps as u8).saturating_add(u8::from(f64::from(steps as u8) < steps));
        let below = f64::from(number) * f64::from(self.step(axis));
        let origin = (f64::from(face) - below) as f32;
        moved.origin[axis] = origin;
        // Rounded, the plane may be on the wrong side.
        let plane = moved.plane(axis, number);
        if is_upper && plane < face {
            moved.origin[axis] = origin.next_up();
        } else if !is_upper && plane > face {
            moved.origin[axis] = origin.next_down();
        }
        let [first, last] = [0, u8::MAX].map(|number| moved.plane(axis, number));
        if first <= self.origin[axis] && end <= last {
            *self = moved;
        }
    }

    /// The numbers of the last planes that are not above coordinates, which are not below the first.
    fn below<const W: usize>(&self, axis: usize, all: &[f32; W]) -> [u8; W] {
        self.nearest(axis, all, (-1.0, 0.0), |plane, x| plane > x)
    }

    /// The numbers of the first planes that are not below coordinates, or of the last if there is none.
    fn above<const W: usize>(&self, axis: usize, all: &[f32; W]) -> [u8; W] {
        self.nearest(axis, all, (1.0, 255.0), |plane, x| plane < x)
    }

    /// The numbers of planes near coordinates, moved on by `step`, to `last` at most, for as long as they are on the wrong side.
    #[inline(always)]
    fn nearest<const W: usize>(
        &self,
        axis: usize,
        all: &[f32; W],
        (step, last): (f32, f32),
        is_wrong: impl Fn(f32, f32) -> bool,
    ) -> [u8; W] {
        // No `map`, which stays a call.
        let mut numbers = [0.0; W];
        for (number, &x) in numbers.iter_mut().zip(all) {
            *number = floor(self.steps_to(axis, x)).clamp(0.0, 255.0) as f32;
        }
        loop {
            let mut any = false;
            for (number, &x) in numbers.iter_mut().zip(all) {
                let moves = (*number != last) & is_wrong(self.plane_at(axis, *number), x);
                *number += if moves { step } else { 0.0 };
                any |= moves;
            }
            if !any {
                break;
            }
        }
        let mut bytes = [0; W];
        for (byte, number) in bytes.iter_mut().zip(numbers) {
            *byte = number as u8;
        }
        bytes
    }

    /// How many steps it is from the first plane to `x`.
    fn steps_to(&self, axis: usize, x: f32) -> f64 {
        // A power of two has its inverse.
        let exponent = 1023 + 127 - u64::from(self.steps[axis]);
        (f64::from(x) - f64::from(self.origin[axis])) * f64::from_bits(exponent << 52)
    }

    #[inline(always)]
    pub fn step(&self, axis: usize) -> f32 {
        f32::from_bits(u32::from(self.steps[axis]) << 23)
    }

    #[inline(always)]
    pub fn plane(&self, axis: usize, number: u8) -> f32 {
        self.plane_at(axis, f32::from(number))
    }

    #[inline(always)]
    fn plane_at(&self, axis: usize, number: f32) -> f32 {
        number * self.step(axis) + self.origin[axis]
    }
}

/// 2^52: from it on floats are integers.
const INTEGERS: f64 = (1u64 << 52) as f64;

/// The greatest integer that is not above `x`, which is much less than 2^52 or an integer. As vectors have it, without a conversion.
#[inline(always)]
fn floor(x: f64) -> f64 {
    let nearest = (x + INTEGERS) - INTEGERS;
    nearest - if nearest > x { 1.0 } else { 0.0 }
}

/// An integer from its float, likewise.
#[inline(always)]
fn integer(x: f64) -> u64 {
    (x + INTEGERS).to_bits()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A floor among smaller things, at any height, is as flat on the grid as it is.
    #[test]
    fn a_large_face_is_on_the_grid() {
        let mut rng = fastrand::Rng::with_seed(9);
        for _ in 0..2_000 {
            let mut point = |size: f32| Vec3::new(rng.f32(), rng.f32(), rng.f32()) * size;
            let aabbs = [(); 8].map(|()| {
                let min = point(100.0);
                Aabb::new(min, min + point(20.0))
            });
            for axis in 0..3 {
                let mut aabbs = aabbs;
                let floor = &mut aabbs[rng.usize(..8)];
                *floor = Aabb::new(Vec3::ZERO, Vec3::splat(120.0));
                let height = rng.f32() * 100.0;
                (floor.min[axis], floor.max[axis]) = (height, height);
                let lane = aabbs.iter().position(|aabb| aabb.max[axis] == height);
                let (frame, planes) = Frame::new::<8>(&aabbs);
                let sides = planes[axis].map(|numbers| frame.plane(axis, numbers[lane.unwrap()]));
                let nearly = frame.step(axis) / PARTS as f32;
                assert!(sides[0] <= height && height <= sides[1]);
                let is_flat = sides[1] - height <= nearly || height - sides[0] <= nearly;
                // With a step more than the grid is long there would be no room to move it.
                let ends = aabbs.iter().fold(Aabb::EMPTY, |all, aabb| all.join(*aabb));
                let full = ends.size()[axis] > 254.0 * frame.step(axis);
                assert!(is_flat || full, "{sides:?} around {height}");
            }
        }
    }
}
