//! Rays as triangles see them, a lane each.

use crate::{
    geometry::Ray,
    layout::{Gathered, Triangles, number_at},
    primitive::{
        exact::{Pair, Pairs},
        triangle::{Along, Edges, Sheared, Where, Whether, bits},
    },
    simd::{Vector, splat3},
    slab::{PreparedRay, reciprocal},
    traverse::{query::Query, ray_lanes::RayLanes},
};

/// Which of a packet's rays are asked for triangles.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a, const LANES: usize> {
    /// A bit each.
    pub(super) lanes: u32,
    /// The lanes that have found something.
    pub(super) found: u32,
    /// The packet's, and those after it; or all.
    pub(super) rays: &'a [Ray],
    /// The numbers of the lanes' rays among those.
    pub(super) numbers: &'a [u8; LANES],
    /// Of the shear.
    pub(super) axes: &'static [usize; 3],
}

/// What the triangle test needs of the rays, and what it has found.
pub(super) struct Shears<const LANES: usize, V> {
    pub(super) origin: [V; 3],
    pub(super) slope: [V; 2],
    pub(super) along: Along<V>,
    /// The best hits so far, in the lanes that have one.
    pub(super) t_max: V,
    pub(super) u: V,
    pub(super) v: V,
    /// Their places in the list of primitive numbers, as bits.
    pub(super) places: V,
}

impl<const LANES: usize, V: Vector<LANES>> Shears<LANES, V> {
    /// Of rays that have found nothing so far. `reciprocal` is of the direction along the last of the axes of the shear.
    #[inline(always)]
    pub(super) fn new(
        origin: [V; 3],
        direction: [V; 3],
        [t_min, t_max]: [V; 2],
        reciprocal: V,
        [kx, ky, _]: [usize; 3],
    ) -> Self {
        Self {
            origin,
            slope: [direction[kx] * reciprocal, direction[ky] * reciprocal],
            along: Along { reciprocal, t_min },
            t_max,
            // Whatever: to clear them takes longer.
            u: t_max,
            v: t_max,
            places: t_max,
        }
    }

    /// The same of prepared rays, each as its caller gave it.
    #[inline(always)]
    pub(super) fn of(token: V::Token, rays: [&Ray; LANES], axes: [usize; 3]) -> Self {
        let RayLanes {
            origin,
            direction,
            range,
        } = RayLanes::new(token, rays);
        let along = reciprocal(token, direction[axes[2]]);
        Self::new(origin, direction, range, along, axes)
    }

    /// All lanes at once, a triangle after the other. The lanes that have a new best hit.
    #[inline(always)]
    pub(super) fn test<Q: Query, G: Gathered>(
        &mut self,
        token: V::Token,
        triangles: G,
        primitives: &[u32],
        asked: Asked<LANES>,
    ) -> u32 {
        let Asked {
            mut lanes,
            mut found,
            rays,
            numbers,
            axes,
        } = asked;
        let leaf = triangles.stored();
        let [kx, ky, kz] = *axes;
        // SAFETY: a prepared ray's axes, a permutation of 0 to 2.
        unsafe { core::hint::assert_unchecked(kx < 3 && ky < 3 && kz < 3) };
        let origin = [self.origin[kx], self.origin[ky], self.origin[kz]];
        let nowhere = [V::splat(token, 0.0); 3];
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
                numbers,
                axes,
            };
            if !Q::CLOSEST {
                // Not all lanes that are hit at once, but some if there are any.
                while edges.candidates != 0 {
                    let hits = (self.along).test::<LANES, Whether, G::Precision, _>(
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
                .test::<LANES, Where, G::Precision, _>(token, corners, edges, self.t_max, pairs);
            let nearer = hits.t.lt(self.t_max).bits() | !found;
            let mut closer = hits.mask & nearer;
            for lane in bits(hits.mask & !nearer) {
                // As near as the best one: the lesser number.
                let best = self.places.to_array()[lane % LANES].to_bits() as usize;
                let is_less = number_at(primitives, place) < number_at(primitives, best);
                closer |= u32::from(is_less) << lane;
            }
            let set = V::of_bits(token, closer);
            self.t_max = set.select(hits.t, self.t_max);
            self.u = set.select(hits.u, self.u);
            self.v = set.select(hits.v, self.v);
            let places = V::splat(token, f32::from_bits(place as u32));
            self.places = set.select(places, self.places);
            found |= closer;
            new |= closer;
        }
        new
    }
}

/// The rays of a packet against one triangle of a leaf.
#[derive(Clone, Copy)]
struct OneTriangle<'a, const LANES: usize, R> {
    triangles: R,
    triangle: usize,
    rays: &'a [Ray],
    numbers: &'a [u8; LANES],
    axes: &'static [usize; 3],
}

impl<const LANES: usize, R: Triangles> Pairs for OneTriangle<'_, LANES, R> {
    #[inline(always)]
    fn pair(&self, lane: usize) -> Pair {
        // Lanes past the last ray are not among those that are asked for.
        let number = usize::from(self.numbers[lane % LANES]);
        let ray = self.rays.get(number).unwrap_or(&PreparedRay::ROOM);
        Pair::new(&self.triangles.triangle(self.triangle), ray, self.axes)
    }
}
