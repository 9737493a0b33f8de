//! What the tests need of a ray, a number each, for rays that wait for their turn.

use super::{MAX_EXTENT, RaySlabs, first_planes, prepared::PreparedLanes};
use crate::{
    geometry::Aabb,
    simd::{Lanes, Simd, Vector, splat3},
};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// [`RaySlabs`] and more in one cache line.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct NarrowRay {
    reciprocal: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    t_min: f32,
    margin: f32,
    first: [u32; 3],
    along: f32,
    axes: u32,
}

impl NarrowRay {
    /// Eight rays, for boxes within `bounds` in nodes of `width` children, and a bit for each that is
    /// [ordinary](PreparedLanes) and not too far away. The others are of no meaning.
    #[inline(always)]
    pub(crate) fn eight<T: Simd>(
        token: T,
        origin: [T::F32x8; 3],
        direction: [T::F32x8; 3],
        range: [T::F32x8; 2],
        bounds: &Aabb,
        width: usize,
    ) -> ([Self; 8], u32) {
        let prepared = PreparedLanes::new(token, origin, direction, range);
        let PreparedLanes {
            reciprocal,
            along,
            axes,
            ordinary,
        } = prepared;
        let [t_min, _] = range;
        let (slabs, extent) =
            RaySlabs::of_lanes(token, origin, reciprocal, t_min, Vec3::ONE, bounds);
        let side = width * size_of::<f32>();
        // Numbers of bytes, as bits.
        let [mut x, mut y, mut z] = splat3(token, [0.0; 3]);
        for (axis, first) in [&mut x, &mut y, &mut z].into_iter().enumerate() {
            let negative = reciprocal[axis].lt(T::F32x8::splat(token, 0.0));
            let [ahead, behind] = [1.0, -1.0].map(|sign| first_planes(axis, sign, side) as u32);
            *first = negative.select(
                T::F32x8::splat(token, f32::from_bits(behind)),
                T::F32x8::splat(token, f32::from_bits(ahead)),
            );
        }
        let [rx, ry, rz] = reciprocal;
        let ([nx, ny, nz], [fx, fy, fz]) = (slabs.near, slabs.far);
        let starts = token.transpose([rx, ry, rz, nx, ny, nz, fx, fy]);
        let ends = token.transpose([fz, slabs.t_min, slabs.margin, x, y, z, along, axes]);
        let mut rays = [Self::zeroed(); 8];
        for ((ray, start), end) in rays.iter_mut().zip(starts).zip(ends) {
            let [a, b]: &mut [[f32; 8]; 2] = bytemuck::cast_mut(ray);
            (*a, *b) = (start.to_array(), end.to_array());
        }
        let near = extent.lt(T::F32x8::splat(token, MAX_EXTENT));
        (rays, (ordinary & near).bits())
    }

    /// In every lane of vectors, for nodes of the width they were made for.
    #[inline(always)]
    pub(crate) fn widen<const N: usize, V: Vector<N>>(&self, token: V::Token) -> RaySlabs<N, V> {
        let [x, y, z] = self.first;
        RaySlabs {
            reciprocal: splat3(token, self.reciprocal),
            near: splat3(token, self.near),
            far: splat3(token, self.far),
            t_min: V::splat(token, self.t_min),
            margin: V::splat(token, self.margin),
            first: [x as usize, y as usize, z as usize],
        }
    }

    /// As [`RaySlabs::margin`].
    #[inline(always)]
    pub(crate) fn margin(&self) -> f32 {
        self.margin
    }

    /// The axes of the shear.
    #[inline(always)]
    pub(crate) fn axes(&self) -> &'static [usize; 3] {
        PreparedLanes::<f32>::axes(self.axes)
    }

    /// Of the direction's component along the last of them.
    #[inline(always)]
    pub(crate) fn along(&self) -> f32 {
        self.along
    }
}
