//! Rays by lanes.

use crate::{geometry::Ray, simd::Vector};

/// Rays, a lane each.
pub(super) struct RayLanes<V> {
    pub(super) origin: [V; 3],
    pub(super) direction: [V; 3],
    /// Where their ranges of `t` begin and end.
    pub(super) range: [V; 2],
}

impl<V> RayLanes<V> {
    #[inline(always)]
    pub(super) fn new<const N: usize>(token: V::Token, rays: [&Ray; N]) -> Self
    where
        V: Vector<N>,
    {
        // By a loop: a closure would not have the backend's instructions.
        let mut rows = [&[0.0; 8]; N];
        for (row, ray) in rows.iter_mut().zip(rays) {
            *row = bytemuck::cast_ref(ray);
        }
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = V::columns(token, rows);
        Self {
            origin: [ox, oy, oz],
            direction: [dx, dy, dz],
            range: [t_min, t_max],
        }
    }
}
