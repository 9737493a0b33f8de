//! Eight rays of a bundle, a lane each.

use super::LANES;
use crate::{
    geometry::{Aabb, Ray},
    layout::{Gathered, Triangles},
    primitive::{
        exact::{Pair, Pairs},
        triangle::{Along, Edges, RayShear, Sheared, bits},
    },
    simd::{Lanes, Simd, Vector, load_all, splat3},
    slab::{PreparedRay, RaySlabs, reach, reciprocals},
    traverse::{query::Query, triangles::Found},
};

/// A number of each ray of a packet.
pub(super) type V<T> = <T as Simd>::F32x8;

/// Which of a packet's rays are asked for triangles.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    /// A bit each.
    pub(super) lanes: u32,
    /// The lanes that have found something.
    pub(super) found: u32,
    /// The packet's, and those after it.
    pub(super) rays: &'a [Ray],
    /// Of the shear.
    pub(super) axes: &'static [usize; 3],
}

/// Eight rays.
pub(super) struct Packet<T: Simd> {
    pub(super) origin: [V<T>; 3],
    pub(super) slabs: RaySlabs<LANES, V<T>>,
    /// Up to which `t` boxes are of interest: `t_max` and the margin.
    pub(super) far: V<T>,
    along: Along<V<T>>,
    pub(super) slope: [V<T>; 2],
    /// The best hits so far, in the lanes that have one.
    pub(super) t_max: V<T>,
    pub(super) u: V<T>,
    pub(super) v: V<T>,
    /// Their places in the list of primitive numbers, as bits.
    pub(super) places: V<T>,
}

impl<T: Simd> Packet<T> {
    /// Of the first eight rays, or as many as there are, if they are like the one that is prepared; each one's D, and before
    /// which `t` it hits nothing.
    #[inline(always)]
    pub(super) fn new(
        token: T,
        bounds: &Aabb,
        rays: &[Ray],
        like: &PreparedRay,
    ) -> Option<(Self, V<T>, V<T>)> {
        let mut padded = [[0.0; 8]; LANES];
        let rows: &[[f32; 8]; LANES] = match rays.first_chunk::<LANES>() {
            Some(rays) => bytemuck::cast_ref(rays),
            None => {
                for (lane, row) in padded.iter_mut().enumerate() {
                    *row = bytemuck::cast(*rays.get(lane).unwrap_or(like.ray));
                }
                &padded
            }
        };
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = token.transpose(load_all(token, rows));
        let (origin, direction) = ([ox, oy, oz], [dx, dy, dz]);
        if !like.is_like(token, origin, direction, [t_min, t_max]) {
            return None;
        }
        let reciprocals = reciprocals(token, direction);
        let signs = like.ray.direction;
        let (mut slabs, extent) =
            RaySlabs::of_lanes(token, origin, reciprocals, t_min, signs, bounds);
        let start = slabs.begin_at_zero(token, t_min);
        let [kx, ky, kz] = *like.axes;
        let zero = V::<T>::splat(token, 0.0);
        let packet = Self {
            origin,
            slabs,
            far: reach(token, t_max, slabs.margins()),
            along: Along {
                reciprocal: reciprocals[kz],
                t_min,
            },
            slope: [
                direction[kx] * reciprocals[kz],
                direction[ky] * reciprocals[kz],
            ],
            t_max,
            u: zero,
            v: zero,
            places: zero,
        };
        Some((packet, extent, start))
    }

    /// All lanes at once, a triangle after the other. The lanes that have a new best hit.
    #[inline(always)]
    pub(super) fn test_leaf<Q: Query, G: Gathered>(
        &mut self,
        token: T,
        triangles: G,
        primitives: &[u32],
        asked: Asked,
    ) -> u32 {
        let Asked {
            mut lanes,
            mut found,
            rays,
            axes,
        } = asked;
        let leaf = triangles.stored();
        let [kx, ky, kz] = *axes;
        // SAFETY: a prepared ray's axes, a permutation of 0 to 2.
        unsafe { core::hint::assert_unchecked(kx < 3 && ky < 3 && kz < 3) };
        let origin = [self.origin[kx], self.origin[ky], self.origin[kz]];
        let nowhere = [V::<T>::splat(token, 0.0); 3];
        let mut vertices = [Sheared::new(nowhere, nowhere, [nowhere[0]; 2]); 8];
        let [x, y, z] = [&leaf.vertices[kx], &leaf.vertices[ky], &leaf.vertices[kz]];
        for vertex in 0..8 {
            let position = splat3(token, [x[vertex], y[vertex], z[vertex]]);
            vertices[vertex] = Sheared::new(position, origin, self.slope);
        }
        let mut new = 0;
        for triangle in 0..triangles.count() % 16 {
            let place = triangles.first() + triangle;
            let triangle = triangle % 8;
            let [a, b, c] = &leaf.corners;
            let [a, b, c] = [
                vertices[a[triangle] as usize % 8],
                vertices[b[triangle] as usize % 8],
                vertices[c[triangle] as usize % 8],
            ];
            let corners = [[a.x, b.x, c.x], [a.y, b.y, c.y], [a.z, b.z, c.z]];
            let mut edges = Edges::new(token, corners, lanes);
            let pairs = OneTriangle {
                triangles,
                triangle,
                rays,
                axes,
            };
            if !Q::CLOSEST {
                // Not all lanes that are hit at once, but some if there are any.
                while edges.candidates != 0 {
                    let hits = (self.along).test::<LANES, false, G::Precision, _>(
                        token, corners, edges, self.t_max, pairs,
                    );
                    if hits.mask == 0 {
                        break;
                    }
                    new |= hits.mask;
                    lanes &= !hits.mask;
                    edges.candidates &= !hits.mask;
                }
                continue;
            }
            if edges.candidates == 0 {
                continue;
            }
            let hits = (self.along)
                .test::<LANES, true, G::Precision, _>(token, corners, edges, self.t_max, pairs);
            let nearer = hits.t.lt(self.t_max).bits() | !found;
            let mut closer = hits.mask & nearer;
            for lane in bits(hits.mask & !nearer) {
                // As near as the best one: the lesser number.
                let best = self.places.to_array()[lane % LANES].to_bits() as usize;
                closer |= u32::from(primitives[place] < primitives[best]) << lane;
            }
            let set = V::<T>::of_bits(token, closer);
            self.t_max = set.select(hits.t, self.t_max);
            self.u = set.select(hits.u, self.u);
            self.v = set.select(hits.v, self.v);
            let places = V::<T>::splat(token, f32::from_bits(place as u32));
            self.places = set.select(places, self.places);
            found |= closer;
            new |= closer;
        }
        self.far = self.reach(token);
        new
    }

    /// All triangles at once, a lane after the other. The lanes that have a new best hit.
    #[inline(always)]
    pub(super) fn test_by_ray<Q: Query>(
        &mut self,
        token: T,
        triangles: impl Triangles,
        primitives: &[u32],
        asked: Asked,
    ) -> u32 {
        let Asked {
            lanes,
            found,
            rays,
            axes,
        } = asked;
        let (t_max, reciprocals) = (self.t_max.to_array(), self.along.reciprocal.to_array());
        let mut new = 0;
        for lane in bits(lanes) {
            let lane = lane % LANES;
            let Some(ray) = rays.get(lane) else {
                break;
            };
            let shear = RayShear::of(ray, axes, reciprocals[lane]);
            let mut t_max = t_max[lane];
            if !Q::CLOSEST {
                let hit = triangles.is_hit(token, &shear, t_max);
                new |= u32::from(hit) << lane;
                continue;
            }
            let mut best = None;
            if found >> lane & 1 != 0 {
                best = Some(Found {
                    t: t_max,
                    place: self.places.to_array()[lane].to_bits() as usize,
                    ..Found::default()
                });
            }
            let closer = Found::update(token, &mut best, &mut t_max, triangles, &shear, primitives);
            if let (true, Some(best)) = (closer, best) {
                let place = f32::from_bits(best.place as u32);
                self.t_max = self.t_max.replace(token, lane, best.t);
                self.u = self.u.replace(token, lane, best.u);
                self.v = self.v.replace(token, lane, best.v);
                self.places = self.places.replace(token, lane, place);
                new |= 1 << lane;
            }
        }
        self.far = self.reach(token);
        new
    }

    /// Up to which `t` boxes are of interest now.
    #[inline(always)]
    fn reach(&self, token: T) -> V<T> {
        reach(token, self.t_max, self.slabs.margins())
    }
}

/// The rays of a packet against one triangle of a leaf.
#[derive(Clone, Copy)]
struct OneTriangle<'a, R> {
    triangles: R,
    triangle: usize,
    rays: &'a [Ray],
    axes: &'static [usize; 3],
}

impl<R: Triangles> Pairs for OneTriangle<'_, R> {
    #[inline(always)]
    fn pair(&self, lane: usize) -> Pair {
        // Lanes past the last ray are not among those that are asked for.
        let ray = self.rays.get(lane).unwrap_or(&PreparedRay::ROOM);
        Pair::new(&self.triangles.triangle(self.triangle), ray, self.axes)
    }
}
