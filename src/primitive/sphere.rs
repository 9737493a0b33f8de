//! Spheres, as a caller would bring them.

use super::Primitives;
use crate::geometry::{Aabb, Ray};
use glam::{DVec3, Vec3};

/// A ball's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub center: Vec3,
    /// Its radius, not negative.
    pub radius: f32,
}

/// Spheres in a slice, numbered by their place. A ray from inside meets the far side.
#[derive(Clone, Copy, Debug)]
pub struct Spheres<'a>(pub &'a [Sphere]);

impl Primitives for Spheres<'_> {
    type Detail = ();

    fn aabb(&self, primitive: u32) -> Aabb {
        self.0.get(primitive as usize).map_or(Aabb::EMPTY, |s| {
            Aabb::new(s.center - s.radius, s.center + s.radius)
        })
    }

    /// In `f64`: the textbook quadratic loses all its digits to cancellation in `f32`, for a small
    /// sphere far away.
    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, ())> {
        let sphere = self.0.get(primitive as usize)?;
        let d = ray.direction.as_dvec3();
        let to_center: DVec3 = sphere.center.as_dvec3() - ray.origin.as_dvec3();
        let dd = d.dot(d);
        let nearest = to_center.dot(d) / dd;
        let offset = to_center - nearest * d;
        let square = f64::from(sphere.radius) * f64::from(sphere.radius) - offset.dot(offset);
        if square.is_nan() || square < 0.0 {
            return None;
        }
        let half = wide::f64x2::splat(square / dd).sqrt().to_array()[0];
        [nearest - half, nearest + half]
            .into_iter()
            .map(|t| t as f32)
            .find(|t| (ray.t_min..=ray.t_max).contains(t))
            .map(|t| (t, ()))
    }
}
