//! Rays as the caller gives them.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// The points `origin + t * direction` for `t` in [`t_min`, `t_max`](Self::t_max), ends included.
///
/// Any finite direction but zero will do: it need not be normalised, and its components may be zero,
/// negative zero, denormal or huge. A ray that holds a NaN, an infinite origin or direction, a zero
/// direction or an empty range is no error: it hits nothing.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Where `t` is 0.
    pub origin: Vec3,
    /// What one unit of `t` moves by.
    pub direction: Vec3,
    /// Least `t` at which a hit counts. May be negative.
    pub t_min: f32,
    /// Greatest `t` at which a hit counts. May be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray from `origin` along `direction` without end: `t` from 0 to infinity.
    #[inline]
    pub fn new(origin: impl Into<Vec3>, direction: impl Into<Vec3>) -> Self {
        Self {
            origin: origin.into(),
            direction: direction.into(),
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }

    /// The straight line between two points: `t` is 0 at `from` and 1 at `to`, and both are part of it. Of one that starts or
    /// ends on a surface see [`Hit`](super::Hit).
    #[inline]
    pub fn segment(from: impl Into<Vec3>, to: impl Into<Vec3>) -> Self {
        let from = from.into();
        Self::new(from, to.into() - from).with_range(0.0, 1.0)
    }

    /// The same ray with another range of `t`.
    #[inline]
    pub const fn with_range(self, t_min: f32, t_max: f32) -> Self {
        Self {
            t_min,
            t_max,
            ..self
        }
    }

    /// The point at `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}
