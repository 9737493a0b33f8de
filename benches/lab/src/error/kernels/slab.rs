//! Ways to test a ray against eight boxes.

use super::{tree::Planes, triangle::WIDTH};
use glam::Vec3;
use wide_bvh::geometry::{Aabb, Ray};

/// A ray made ready for a box test.
pub trait SlabTest: Copy + 'static {
    /// For boxes within `bounds`.
    fn new(ray: &Ray, bounds: &Aabb) -> Self;

    /// Up to which `t` boxes are to be opened when hits count up to `t`.
    fn reach(&self, t: f32) -> f32;

    /// Which boxes the ray may meet up to `reach`, a bit each, and from which `t` on.
    fn test(&self, planes: &Planes, reach: f32) -> (u32, [f32; WIDTH]);
}

/// The lesser; `a` if `b` is NaN.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// The greater; `a` if `b` is NaN.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// `x * y + z`, rounded once or twice.
#[inline(always)]
fn multiply_add<const FMA: bool>(x: f32, y: f32, z: f32) -> f32 {
    if FMA { x.mul_add(y, z) } else { x * y + z }
}

/// What they have in common: near and far of each axis, and which of each axis' planes is met first.
#[inline(always)]
fn test_axes(
    planes: &Planes,
    first: [usize; 3],
    t_min: f32,
    reach: f32,
    near: impl Fn(usize, f32) -> f32,
    far: impl Fn(usize, f32) -> f32,
) -> (u32, [f32; WIDTH]) {
    let mut enter = [t_min; WIDTH];
    let mut leave = [reach; WIDTH];
    for axis in 0..3 {
        let (nears, fars) = (
            &planes[axis][first[axis] & 1],
            &planes[axis][first[axis] & 1 ^ 1],
        );
        for lane in 0..WIDTH {
            enter[lane] = max(enter[lane], near(axis, nears[lane]));
            leave[lane] = min(leave[lane], far(axis, fars[lane]));
        }
    }
    let mut mask = 0;
    for lane in 0..WIDTH {
        mask |= u32::from(enter[lane] <= leave[lane]) << lane;
    }
    (mask, enter)
}

fn first_planes(direction: Vec3) -> [usize; 3] {
    direction
        .to_array()
        .map(|d| usize::from(d.is_sign_negative()))
}

/// Williams et al., "An Efficient and Robust Ray-Box Intersection Algorithm" (2005): (plane - origin) / direction, by
/// its reciprocal, or with one fused operation of both.
#[derive(Clone, Copy)]
pub struct PlainSlab<const FMA: bool> {
    first: [usize; 3],
    origin: [f32; 3],
    reciprocal: [f32; 3],
    at_origin: [f32; 3],
    t_min: f32,
}

impl<const FMA: bool> PlainSlab<FMA> {
    #[inline(always)]
    fn t(&self, axis: usize, plane: f32) -> f32 {
        if FMA {
            plane.mul_add(self.reciprocal[axis], self.at_origin[axis])
        } else {
            (plane - self.origin[axis]) * self.reciprocal[axis]
        }
    }
}

impl<const FMA: bool> SlabTest for PlainSlab<FMA> {
    #[inline(always)]
    fn new(ray: &Ray, _: &Aabb) -> Self {
        let reciprocal = ray.direction.to_array().map(|d| 1.0 / d);
        let origin = ray.origin.to_array();
        Self {
            first: first_planes(ray.direction),
            origin,
            reciprocal,
            at_origin: [0, 1, 2].map(|axis| -origin[axis] * reciprocal[axis]),
            t_min: ray.t_min,
        }
    }

    #[inline(always)]
    fn reach(&self, t: f32) -> f32 {
        t
    }

    #[inline(always)]
    fn test(&self, planes: &Planes, reach: f32) -> (u32, [f32; WIDTH]) {
        let t = |axis, plane| self.t(axis, plane);
        test_axes(planes, self.first, self.t_min, reach, t, t)
    }
}

/// Ize, "Robust BVH Ray Traversal" (JCGT 2013): the far side is moved out by two ULPs.
#[derive(Clone, Copy)]
pub struct Ize<const FMA: bool>(PlainSlab<FMA>);

/// 1 and two ULPs.
const TWO_ULPS: f32 = 1.0 + 2.0 * f32::EPSILON;

impl<const FMA: bool> SlabTest for Ize<FMA> {
    #[inline(always)]
    fn new(ray: &Ray, bounds: &Aabb) -> Self {
        Self(PlainSlab::new(ray, bounds))
    }

    #[inline(always)]
    fn reach(&self, t: f32) -> f32 {
        t
    }

    #[inline(always)]
    fn test(&self, planes: &Planes, reach: f32) -> (u32, [f32; WIDTH]) {
        let near = |axis, plane| self.0.t(axis, plane);
        let far = |axis, plane| self.0.t(axis, plane) * TWO_ULPS;
        test_axes(planes, self.0.first, self.0.t_min, reach, near, far)
    }
}

/// This crate's: slabs moved apart by the rounding of this test and of the triangle test, worked out once a ray from
/// the scene's bounds. Its constants, and why they suffice, are in the crate's `src/slab`.
#[derive(Clone, Copy)]
pub struct ThisCrates<const FMA: bool> {
    first: [usize; 3],
    reciprocal: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    t_min: f32,
    margin: f32,
}

const UNIT_ROUNDOFF: f32 = f32::EPSILON / 2.0;
const MAX_RECIPROCAL: f32 = (1_u64 << 48) as f32;

impl<const FMA: bool> SlabTest for ThisCrates<FMA> {
    #[inline(always)]
    fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let reciprocal = ray
            .direction
            .to_array()
            .map(|d| (1.0 / d).clamp(-MAX_RECIPROCAL, MAX_RECIPROCAL));
        let extent = (bounds.min.abs().max(bounds.max.abs()) + ray.origin.abs()).max_element();
        let error = |axis: usize| 14.0 * UNIT_ROUNDOFF * extent * reciprocal[axis].abs();
        let at_origin = |axis: usize| -(ray.origin[axis] * reciprocal[axis]);
        let [x, y, z] = reciprocal.map(f32::abs);
        let margin = 66.0 * UNIT_ROUNDOFF * extent * x.min(y).min(z);
        Self {
            first: first_planes(ray.direction),
            reciprocal,
            near: [0, 1, 2].map(|axis| at_origin(axis) - error(axis)),
            far: [0, 1, 2].map(|axis| at_origin(axis) + error(axis)),
            t_min: ray.t_min - margin,
            margin,
        }
    }

    #[inline(always)]
    fn reach(&self, t: f32) -> f32 {
        t + self.margin
    }

    #[inline(always)]
    fn test(&self, planes: &Planes, reach: f32) -> (u32, [f32; WIDTH]) {
        let near =
            |axis: usize, plane| multiply_add::<FMA>(plane, self.reciprocal[axis], self.near[axis]);
        let far =
            |axis: usize, plane| multiply_add::<FMA>(plane, self.reciprocal[axis], self.far[axis]);
        test_axes(planes, self.first, self.t_min, reach, near, far)
    }
}
