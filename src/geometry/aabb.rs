//! Axis-aligned bounding boxes.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// An axis-aligned bounding box, closed on every side.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Aabb {
    /// The corner with the least coordinates.
    pub min: Vec3,
    /// The corner with the greatest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing: `min` is +infinity, `max` is -infinity. Joining it changes nothing.
    pub const EMPTY: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// A box from two opposite corners, `min` no greater than `max` on each axis.
    #[inline]
    pub const fn new(min: Vec3, max: Vec3) -> Self {
        Self { min, max }
    }

    /// The least box around all `points`.
    #[inline]
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points
            .into_iter()
            .fold(Self::EMPTY, |aabb, p| aabb.join(Self::new(p, p)))
    }

    /// The least box around both.
    #[inline]
    pub fn join(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// Whether it holds no point: `min` above `max` on some axis, or a NaN.
    #[inline]
    pub fn is_empty(self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Whether no bound is NaN or infinite.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }

    /// The point half-way between the corners.
    #[inline]
    pub fn center(self) -> Vec3 {
        // Halved before the sum, so that bounds near `f32::MAX` do not overflow.
        self.min * 0.5 + self.max * 0.5
    }

    /// The length of each side.
    #[inline]
    pub fn size(self) -> Vec3 {
        self.max - self.min
    }

    /// Half the surface area: the chance that a random line meets a convex body is proportional to
    /// it, which is all that the surface area heuristic needs (MacDonald and Booth 1990). 0 if empty.
    #[inline]
    pub fn half_area(self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let s = self.size();
        s.x * s.y + s.y * s.z + s.z * s.x
    }
}
