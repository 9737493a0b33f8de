//! What a query is expected to cost: the surface area heuristic, and its constants in one place.
//!
//! MacDonald and Booth, "Heuristics for ray tracing using space subdivision" (1990): a ray that meets a
//! box meets a box inside it with a chance of the ratio of their areas.

use crate::geometry::Aabb;

/// The cost of a node: its boxes tested, its children sorted. The unit of the others.
pub(super) const NODE: f32 = 1.0;
/// The cost of a leaf of triangles, whatever it holds: all its lanes are tested at once. From 0.5 to 2 the
/// speed measured is the same: how many vertices a leaf has room for decides.
pub(super) const TRIANGLE_LEAF: f32 = 1.0;
/// What each triangle of a leaf adds. 0 to 0.15 are as good.
pub(super) const TRIANGLE: f32 = 0.05;
/// How many times the cost of two leaves one may have for which they are given up. Measured on a scan, a room and a
/// game level: from 1 to 1.5 the speed is the same, but a triangle of the scan takes 47, 44 (at 1.1), 41 (1.3) or
/// 40 bytes (1.5).
pub(super) const TRIANGLES_JOINED: f32 = 1.3;
/// The cost of a leaf of triangles that are read where a mesh has them.
pub(super) const RUN_LEAF: f32 = 1.0;
/// What each of its triangles adds: its corners are fetched one by one.
pub(super) const RUN_TRIANGLE: f32 = 0.15;
/// As [`TRIANGLES_JOINED`].
pub(super) const RUNS_JOINED: f32 = 1.1;
/// The cost of getting to a leaf of a caller's primitives. Assumed.
pub(super) const PRIMITIVE_LEAF: f32 = 0.3;
/// The cost of a caller's primitive: a call and a test, one at a time. Assumed: what it does is not known.
pub(super) const PRIMITIVE: f32 = 0.5;

/// Areas of boxes in a scene's own unit, so that no square overflows or vanishes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    scale: f32,
}

impl Measure {
    /// For a scene whose coordinates are no greater in magnitude than `largest`, which is finite. They
    /// are scaled by a power of two, which is exact, to less than 4.
    pub fn new(largest: f32) -> Self {
        let exponent = (largest.to_bits() >> 23) & 0xff;
        // 2^-e, kept to normal numbers.
        let scale = f32::from_bits((254 - exponent.clamp(1, 253)) << 23);
        Self { scale }
    }

    /// For a scene with these bounds.
    pub fn of_bounds(bounds: &Aabb) -> Self {
        if bounds.is_empty() {
            return Self::new(0.0);
        }
        Self::new(bounds.min.abs().max(bounds.max.abs()).max_element())
    }

    /// What coordinates are multiplied by.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Half the area of a box that is not empty.
    #[inline]
    pub fn half_area(&self, aabb: &Aabb) -> f32 {
        let d = aabb.max * self.scale - aabb.min * self.scale;
        d.x * d.y + (d.x + d.y) * d.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn areas_at_the_ends_of_the_range() {
        for largest in [f32::MAX, 1e30, 1.0, 3e-20, f32::MIN_POSITIVE] {
            let bounds = Aabb::new(Vec3::splat(-largest), Vec3::splat(largest));
            let measure = Measure::of_bounds(&bounds);
            let scaled = largest * measure.scale();
            assert!((1.0..4.0).contains(&scaled), "{largest}");
            assert_eq!(measure.half_area(&bounds), 3.0 * (2.0 * scaled).powi(2));
        }
        for largest in [0.0, 1e-45] {
            let bounds = Aabb::new(Vec3::ZERO, Vec3::splat(largest));
            assert!(Measure::of_bounds(&bounds).half_area(&bounds).is_finite());
        }
        assert!(Measure::of_bounds(&Aabb::EMPTY).scale().is_finite());
    }
}
