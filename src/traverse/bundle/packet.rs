//! Some rays of a bundle, a lane each.

use super::shears::{Asked, Shears};
use crate::{
    geometry::{Aabb, Ray},
    layout::{Gathered, Triangles},
    primitive::triangle::{RayShear, bits},
    simd::Vector,
    slab::{PreparedRay, RaySlabs, reach, reciprocals},
    traverse::{query::Query, ray_lanes::RayLanes, triangles::Found},
};
use core::array;

/// Rays side by side.
pub(super) struct Packet<const LANES: usize, V> {
    pub(super) slabs: RaySlabs<LANES, V>,
    /// Up to which `t` boxes are of interest: `t_max` and the margin.
    pub(super) far: V,
    pub(super) shears: Shears<LANES, V>,
}

impl<const LANES: usize, V: Vector<LANES>> Packet<LANES, V> {
    /// Of the first rays, as many as there are or fill it, if they are like the one that is prepared; each one's D, and before
    /// which `t` it hits nothing.
    #[inline(always)]
    pub(super) fn new(
        token: V::Token,
        bounds: &Aabb,
        rays: &[Ray],
        like: &PreparedRay,
    ) -> Option<(Self, V, V)> {
        let padded: [Ray; LANES];
        let rays = match rays.first_chunk() {
            Some(rays) => rays,
            None => {
                padded = array::from_fn(|lane| *rays.get(lane).unwrap_or(like.ray));
                &padded
            }
        };
        let RayLanes {
            origin,
            direction,
            range,
        } = RayLanes::new(token, rays.each_ref());
        let [t_min, t_max] = range;
        if !like.is_like(token, origin, direction, range) {
            return None;
        }
        let reciprocals = reciprocals(token, direction);
        let signs = like.ray.direction;
        let (mut slabs, extent) =
            RaySlabs::of_lanes(token, origin, reciprocals, t_min, signs, bounds);
        let start = slabs.begin_at_zero(token, t_min);
        let along = reciprocals[like.axes[2]];
        let packet = Self {
            slabs,
            far: reach(token, t_max, slabs.margins()),
            shears: Shears::new(origin, direction, range, along, *like.axes),
        };
        Some((packet, extent, start))
    }

    /// All lanes at once, a triangle after the other. The lanes that have a new best hit.
    #[inline(always)]
    pub(super) fn test_leaf<Q: Query, G: Gathered>(
        &mut self,
        token: V::Token,
        triangles: G,
        primitives: &[u32],
        asked: Asked<LANES>,
    ) -> u32 {
        let new = self
            .shears
            .test::<Q, G>(token, triangles, primitives, asked);
        self.far = self.reach(token);
        new
    }

    /// All triangles at once, a lane after the other. The lanes that have a new best hit.
    #[inline(always)]
    pub(super) fn test_by_ray<Q: Query>(
        &mut self,
        token: V::Token,
        triangles: impl Triangles,
        primitives: &[u32],
        asked: Asked<LANES>,
    ) -> u32 {
        let Asked {
            lanes,
            found,
            rays,
            axes,
            ..
        } = asked;
        let shears = &mut self.shears;
        let (t_max, reciprocals) = (shears.t_max.to_array(), shears.along.reciprocal.to_array());
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
                    place: shears.places.to_array()[lane].to_bits() as usize,
                    ..Found::default()
                });
            }
            let closer = Found::update(token, &mut best, &mut t_max, triangles, &shear, primitives);
            if let (true, Some(best)) = (closer, best) {
                let place = f32::from_bits(best.place as u32);
                shears.t_max = shears.t_max.replace(token, lane, best.t);
                shears.u = shears.u.replace(token, lane, best.u);
                shears.v = shears.v.replace(token, lane, best.v);
                shears.places = shears.places.replace(token, lane, place);
                new |= 1 << lane;
            }
        }
        self.far = self.reach(token);
        new
    }

    /// Up to which `t` boxes are of interest now.
    #[inline(always)]
    fn reach(&self, token: V::Token) -> V {
        reach(token, self.shears.t_max, self.slabs.margins())
    }
}
