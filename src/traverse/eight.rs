//! Rays by lanes.

use crate::{
    geometry::Ray,
    simd::{Simd, load_all},
};

/// Eight rays, a lane each.
pub(super) struct Eight<T: Simd> {
    pub(super) origin: [T::F32x8; 3],
    pub(super) direction: [T::F32x8; 3],
    /// Where their ranges of `t` begin and end.
    pub(super) range: [T::F32x8; 2],
}

impl<T: Simd> Eight<T> {
    #[inline(always)]
    pub(super) fn new(token: T, [a, b, c, d, e, f, g, h]: [&Ray; 8]) -> Self {
        let rows = load_all(
            token,
            [
                bytemuck::cast_ref(a),
                bytemuck::cast_ref(b),
                bytemuck::cast_ref(c),
                bytemuck::cast_ref(d),
                bytemuck::cast_ref(e),
                bytemuck::cast_ref(f),
                bytemuck::cast_ref(g),
                bytemuck::cast_ref(h),
            ],
        );
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = token.transpose(rows);
        Self {
            origin: [ox, oy, oz],
            direction: [dx, dy, dz],
            range: [t_min, t_max],
        }
    }
}
