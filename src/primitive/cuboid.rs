//! Axis-aligned boxes as solids, as a caller would bring them.

use super::Primitives;
use crate::geometry::{Aabb, Ray};

/// The surfaces of boxes in a slice, numbered by their place. A ray from inside meets the far side.
#[derive(Clone, Copy, Debug)]
pub struct Cuboids<'a>(pub &'a [Aabb]);

impl Primitives for Cuboids<'_> {
    type Detail = ();

    fn aabb(&self, primitive: u32) -> Aabb {
        self.0
            .get(primitive as usize)
            .copied()
            .unwrap_or(Aabb::EMPTY)
    }

    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, ())> {
        let aabb = self.0.get(primitive as usize)?;
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let origin = f64::from(ray.origin[axis]);
            let direction = f64::from(ray.direction[axis]);
            let lo = f64::from(aabb.min[axis]) - origin;
            let hi = f64::from(aabb.max[axis]) - origin;
            if direction == 0.0 {
                if lo > 0.0 || hi < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (lo / direction, hi / direction);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        if enter > leave {
            return None;
        }
        [enter, leave]
            .into_iter()
            .map(|t| t as f32)
            .find(|t| (ray.t_min..=ray.t_max).contains(t))
            .map(|t| (t, ()))
    }
}
