//! What a query is expected to cost: the surface area heuristic, and its constants in one place.
//!
//! MacDonald and Booth, "Heuristics for ray tracing using space subdivision" (1990): a ray that meets a
//! box meets a box inside it with a chance of the ratio of their areas.

use crate::geometry::Aabb;

/// The cost of a node: its boxes tested, its children sorted. The unit of the others.
pub(super) const NODE: f32 = 1.0;
/// The cost of a leaf of triangles, whatever it holds: all its lanes are tested at once.
pub(super) const TRIANGLE_LEAF: f32 = 1.0;
/// What each triangle of a leaf adds.
pub(super) const TRIANGLE: f32 = 0.05;
/// How many times the cost of two leaves one may have for which they are given up. Measured on the dragon, a
/// game level and a room: from 1 to 1.5 the speed is the same, but memory is 49, 44 (at 1.1), 41 (1.25), 40 (1.5)
/// bytes a triangle.
pub(super) const TRIANGLES_JOINED: f32 = 1.3;
/// The cost of getting to a leaf of a caller's primitives.
pub(super) const PRIMITIVE_LEAF: f32 = 0.3;
/// The cost of a caller's primitive: a call and a test, one at a time.
pub(super) const PRIMITIVE: f32 = 0.5;

/// Areas of boxes in a scene's own unit, so that no square overflows or vanishes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    scale: f32,
}

impl Measure {
    /// For a scene whose coordinates are no greater in magnitude than `largest`, which is finite. They
    /// are scaled by a power of two, which is exact, to less than 2.
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
