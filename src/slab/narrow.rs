//! What the tests need of a ray, a number each: of one that is traced by itself, or of many that wait for their turn.

use super::{
    K_BOX, MAX_EXTENT, MIN_EXTENT, PreparedRay, RaySlabs, UNIT_ROUNDOFF, first_planes, plane_terms,
    pow2,
    prepared::{PreparedLanes, greater, lanes, reciprocal},
    slack,
};
use crate::{
    geometry::Aabb,
    simd::{F32x1, Lanes, Portable, Simd, Vector, splat3},
};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use wide::f32x4;

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
    /// Room for [`new`](Self::new).
    pub(crate) const ROOM: Self = Self {
        reciprocal: [0.0; 3],
        near: [0.0; 3],
        far: [0.0; 3],
        t_min: 0.0,
        margin: 0.0,
        first: [0; 3],
        along: 0.0,
        axes: 0,
    };

    /// A ray, for boxes within `bounds` in nodes of `width` children. Written where it stays: a copy, right after, would
    /// wait for all that is written.
    #[inline(always)]
    pub(crate) fn new<'a>(
        prepared: &PreparedRay,
        bounds: &Aabb,
        width: usize,
        room: &'a mut Self,
    ) -> &'a Self {
        let [lx, ly, lz, hx, hy, hz]: [f32; 6] = bytemuck::cast(*bounds);
        // As `RaySlabs::of_lanes`, but an axis a lane; what is in the fourth is of no meaning.
        let [origin, direction] = lanes(prepared.ray);
        let (lo, hi) = (f32x4::new([lx, ly, lz, hx]), f32x4::new([hx, hy, hz, lz]));
        let reciprocal = reciprocal(Portable, direction);
        let [x, y, z, _] = (Vector::max(lo.abs(), hi.abs()) + origin.abs()).to_array();
        let extent = greater(greater(greater(x, y), z), MIN_EXTENT);
        let error = f32x4::splat(extent * (K_BOX * UNIT_ROUNDOFF));
        let (near, far) = plane_terms(Portable, origin, reciprocal, error);

        let direction = prepared.ray.direction;
        let side = width * size_of::<f32>();
        let numbers: &mut [f32; 16] = bytemuck::cast_mut(room);
        // The fourth of each is written over.
        numbers[..4].copy_from_slice(&reciprocal.to_array());
        numbers[3..7].copy_from_slice(&near.to_array());
        numbers[6..10].copy_from_slice(&far.to_array());
        // Not of the numbers just written: nothing reads those before all are, so what was in their room is not cleared
        // first, which would be one store of 64 bytes, and 10 ns on Intel's processors.
        room.along = reciprocal.to_array()[prepared.number as usize / 2 % 4];
        room.first = [
            first_planes(0, direction.x, side) as u32,
            first_planes(1, direction.y, side) as u32,
            first_planes(2, direction.z, side) as u32,
        ];
        room.axes = prepared.number;
        let t_min = F32x1(prepared.ray.t_min);
        let margin = F32x1(extent * UNIT_ROUNDOFF * room.along.abs());
        room.margin = margin.0;
        let start = (t_min - slack(Portable, t_min, margin)).0;
        room.t_min = greater(start, 0.0);
        if t_min.0 < 0.0 {
            room.move_to_zero(start, t_min);
        }
        if extent >= MAX_EXTENT {
            room.open();
        }
        room
    }

    /// [`RaySlabs::begin_at_zero`], of a ray whose least `t`, less the margin, is `start`.
    #[cold]
    #[inline(never)]
    fn move_to_zero(&mut self, start: f32, t_min: F32x1) {
        self.t_min = start;
        let mut slabs: RaySlabs<1, F32x1> = self.widen(Portable);
        slabs.begin_at_zero(Portable, t_min);
        self.near = slabs.near.map(|x| x.0);
        self.far = slabs.far.map(|x| x.0);
        self.t_min = slabs.t_min.0;
        self.margin = slabs.margin.0;
    }

    /// Has every box passed but the empty one.
    #[cold]
    #[inline(never)]
    fn open(&mut self) {
        for axis in 0..3 {
            self.reciprocal[axis] = pow2(-126).copysign(self.reciprocal[axis]);
            self.near[axis] = -f32::MAX;
            self.far[axis] = f32::MAX;
        }
    }

    /// Writes eight rays, for boxes within `bounds` in nodes of `width` children. A bit for each that is
    /// [ordinary](PreparedLanes) and not too far away; the others are of no meaning.
    #[inline(always)]
    pub(crate) fn eight<T: Simd>(
        token: T,
        origin: [T::F32x8; 3],
        direction: [T::F32x8; 3],
        range: [T::F32x8; 2],
        bounds: &Aabb,
        width: usize,
        rays: &mut [Self; 8],
    ) -> u32 {
        let prepared = PreparedLanes::new(token, origin, direction, range);
        let PreparedLanes {
            reciprocal,
            along,
            axes,
            ordinary,
        } = prepared;
        let [t_min, _] = range;
        let (mut slabs, extent) =
            RaySlabs::of_lanes(token, origin, reciprocal, t_min, Vec3::ONE, bounds);
        slabs.begin_at_zero(token, t_min);
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
        for ((ray, start), end) in rays.iter_mut().zip(starts).zip(ends) {
            let [a, b]: &mut [[f32; 8]; 2] = bytemuck::cast_mut(ray);
            (*a, *b) = (start.to_array(), end.to_array());
        }
        let near = extent.lt(T::F32x8::splat(token, MAX_EXTENT));
        (ordinary & near).bits()
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

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use crate::{
        geometry::Ray,
        layout::{Child, Node8, WideNode},
        simd::Backend,
        traverse::sweep::{count_boxes, count_boxes_of_bundle},
    };
    use fastrand::Rng;
    use std::vec::Vec;

    /// Boxes that a ray passes by definition, with what rounding may do to either side.
    fn count_exactly(boxes: &[Aabb], ray: &Ray) -> [u32; 2] {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let passed = |aabb: &&Aabb, more: f64| {
            let (mut near, mut far) = (f64::from(ray.t_min), f64::from(ray.t_max));
            for axis in 0..3 {
                let [a, b] = [aabb.min, aabb.max].map(|p| (f64::from(p[axis]) - o[axis]) / d[axis]);
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            near <= far + more
        };
        [-1e-5, 1e-5].map(|more| boxes.iter().filter(|aabb| passed(aabb, more)).count() as u32)
    }

    /// Wherever the range begins, no box is passed that is outside it: none behind the ray, either.
    #[test]
    fn boxes_are_passed_within_ranges_of_any_sign() {
        let mut rng = Rng::with_seed(7);
        let mut point = |size: f32| Vec3::new(rng.f32(), rng.f32(), rng.f32()) * size;
        let boxes: Vec<_> = (0..800)
            .map(|_| {
                let min = point(10.0);
                Aabb::new(min, min + point(2.0))
            })
            .collect();
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, aabb| all.join(*aabb));
        let nodes: Vec<_> = boxes
            .chunks(8)
            .map(|boxes| Node8::from_children(boxes.iter().map(|&aabb| (aabb, Child::leaf(0)))))
            .collect();
        let mut counted = 0;
        for _ in 0..200 {
            let ray = Ray::new(point(10.0), point(2.0) - Vec3::ONE);
            let (inf, some) = (f32::INFINITY, 0.1 + point(6.0).x);
            for (t_min, t_max) in [
                (0.0, inf),
                (-0.0, some),
                (some, inf),
                (-inf, inf),
                (-inf, 0.0),
                (-inf, -some),
                (-f32::MAX, f32::MAX),
                (-some, some),
                (-2.0 * some, -some),
                (-1e-30, 1e-30),
            ] {
                let ray = ray.with_range(t_min, t_max);
                let [least, most] = count_exactly(&boxes, &ray);
                counted += least;
                for backend in Backend::available() {
                    let passed = count_boxes(backend, &nodes, &bounds, &ray);
                    assert!(least <= passed && passed <= most, "{backend:?} {ray:?}");
                    let alike = [ray; 3];
                    let passed = count_boxes_of_bundle(backend, &nodes, &bounds, &alike);
                    assert!(
                        passed.is_some_and(|passed| least <= passed),
                        "{backend:?} {ray:?}"
                    );
                }
            }
        }
        assert!(counted > 5_000, "{counted}");
    }
}
