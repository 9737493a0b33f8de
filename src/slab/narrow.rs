//! What the box test needs of a ray, a number each, for rays that wait for their turn.

use super::{
    K_BOX, K_T, MAX_EXTENT, MIN_EXTENT, RaySlabs, UNIT_ROUNDOFF, first_planes, plane_terms, pow2,
    prepared::{greater, lesser},
};
use crate::{
    geometry::{Aabb, Ray},
    simd::{Vector, splat3},
};

/// [`RaySlabs`] in a fifth of the memory. The fourth number of each row is of no meaning.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub struct NarrowSlabs {
    reciprocal: [f32; 4],
    near: [f32; 4],
    far: [f32; 4],
    first: [u32; 3],
    t_min: f32,
    margin: f32,
}

/// The largest coordinate of a scene's bounds, by axis.
#[derive(Clone, Copy)]
pub(crate) struct SceneExtent([f32; 4]);

impl SceneExtent {
    pub(crate) fn new(bounds: &Aabb) -> Self {
        let extent = bounds.min.abs().max(bounds.max.abs());
        Self([extent.x, extent.y, extent.z, 0.0])
    }
}

impl NarrowSlabs {
    /// As [`RaySlabs::new`], an axis a lane, for nodes of `width` children; and whether they are to be
    /// [opened](Self::open), where they are kept. `reciprocal` is that of the ray's direction.
    #[inline(always)]
    pub(crate) fn new<V: Vector<4>>(
        token: V::Token,
        ray: &Ray,
        reciprocal: V,
        scene: &SceneExtent,
        width: usize,
    ) -> (Self, bool) {
        let origin = V::load(token, ray.origin_and_more());
        let [x, y, z, _] = (V::load(token, &scene.0) + origin.abs()).to_array();
        let extent = greater(greater(x, y), greater(z, MIN_EXTENT));
        let error = V::splat(token, extent * (K_BOX * UNIT_ROUNDOFF));
        let (near, far) = plane_terms(token, origin, reciprocal, error);
        let [x, y, z, _] = reciprocal.abs().to_array();
        let margin = extent * (K_T * UNIT_ROUNDOFF) * lesser(lesser(x, y), z);
        let side = width * size_of::<f32>();
        let slabs = Self {
            reciprocal: reciprocal.to_array(),
            near: near.to_array(),
            far: far.to_array(),
            first: [
                first_planes(0, ray.direction.x, side) as u32,
                first_planes(1, ray.direction.y, side) as u32,
                first_planes(2, ray.direction.z, side) as u32,
            ],
            t_min: ray.t_min - margin,
            margin,
        };
        let near = matches!(
            extent.partial_cmp(&MAX_EXTENT),
            Some(core::cmp::Ordering::Less)
        );
        (slabs, !near)
    }

    /// As [`RaySlabs`] does.
    #[cold]
    #[inline(never)]
    pub(crate) fn open(&mut self) {
        self.reciprocal = self.reciprocal.map(|r| pow2(-126).copysign(r));
        self.near = [-f32::MAX; 4];
        self.far = [f32::MAX; 4];
    }

    /// In every lane of vectors, for nodes of the width they were made for.
    #[inline(always)]
    pub(crate) fn widen<const N: usize, V: Vector<N>>(&self, token: V::Token) -> RaySlabs<N, V> {
        let [rx, ry, rz, _] = self.reciprocal;
        let [nx, ny, nz, _] = self.near;
        let [fx, fy, fz, _] = self.far;
        let [x, y, z] = self.first;
        RaySlabs {
            reciprocal: splat3(token, [rx, ry, rz]),
            near: splat3(token, [nx, ny, nz]),
            far: splat3(token, [fx, fy, fz]),
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
}
