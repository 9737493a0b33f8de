//! Rays by lanes.

use crate::{
    geometry::Ray,
    simd::{Simd, Vector},
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
        let rows = [
            row(token, a),
            row(token, b),
            row(token, c),
            row(token, d),
            row(token, e),
            row(token, f),
            row(token, g),
            row(token, h),
        ];
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = token.transpose(rows);
        Self {
            origin: [ox, oy, oz],
            direction: [dx, dy, dz],
            range: [t_min, t_max],
        }
    }
}

/// A ray's eight numbers.
#[inline(always)]
fn row<T: Simd>(token: T, ray: &Ray) -> T::F32x8 {
    T::F32x8::load(token, bytemuck::cast_ref(ray))
}
