//! How much of each bound a ray and a triangle use up: to see how far the crate's constants are from what happens,
//! and to look for rays that use more.
//!
//! In `f64`, good to a part in a million: enough to measure by. [`claims`](super::claims) decides.

use super::{
    claims::{K_PLACE, K_RELATIVE, K_SHEAR, MIN_EXTENT},
    sheared::Sheared,
};
use glam::Vec3;
use wide_bvh::geometry::{Hit, Ray};

/// The crate's margin of the box test.
const K_BOX: f64 = 14.0;
const U: f64 = 1.0 / (1 << 24) as f64;

/// What is used, as a fraction of the bound: above 1 it would be broken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Margins {
    /// Of how far a corner may be off after the shear.
    pub shear: f64,
    /// Of how far t may be off.
    pub t: f64,
    /// Of how far a plane of a box may seem to be on the wrong side of the hit.
    pub slab: f64,
    /// The share of the box test's margin without which a box of the one point hit would be lost. No more than
    /// `slab`: it takes two planes to lose a box.
    pub gap: f64,
}

impl Margins {
    /// The greater of each.
    pub fn max(self, other: Self) -> Self {
        Self {
            shear: self.shear.max(other.shear),
            t: self.t.max(other.t),
            slab: self.slab.max(other.slab),
            gap: self.gap.max(other.gap),
        }
    }
}

/// What a ray and a triangle use, where `hit` is brute force's answer for the triangle, t without bounds.
/// Nothing, where nothing is promised.
pub fn margins(ray: &Ray, corners: [Vec3; 3], hit: Option<&Hit>) -> Margins {
    let sheared = Sheared::new(ray, corners).filter(|sheared| sheared.is_ordinary(ray));
    let Some(sheared) = sheared else {
        return Margins::default();
    };
    let mut margins = Margins {
        shear: shear(ray, corners, &sheared),
        ..Margins::default()
    };
    if let Some(hit) = hit.filter(|hit| (1e-30..1e30).contains(&hit.t.abs())) {
        let weights = weights(&sheared);
        let z = sheared.axes[2];
        let mean: f64 = (0..3)
            .map(|i| weights[i] * f64::from(sheared.corners[i].z))
            .sum();
        let t_star = mean / f64::from(sheared.direction[z]);
        let t = f64::from(hit.t) * sheared.scale;
        let depth = f64::from(sheared.depth().max(MIN_EXTENT));
        let bound =
            U * depth / f64::from(sheared.direction[z].abs()) + f64::from(K_RELATIVE) * U * t.abs();
        margins.t = ((t - t_star).abs() / bound).min(place(ray, corners, hit, &sheared));
        [margins.slab, margins.gap] = slab(ray, corners, &sheared, weights, t_star);
    }
    margins
}

/// How far the ray at t is from the point that u and v say, in bounds.
fn place(ray: &Ray, corners: [Vec3; 3], hit: &Hit, sheared: &Sheared) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let [t, u, v] = [hit.t, hit.u, hit.v].map(f64::from);
    let at_t = ray.origin.as_dvec3() + ray.direction.as_dvec3() * t;
    let at_uv = a + (b - a) * u + (c - a) * v;
    let bound = f64::from(K_PLACE) * U * f64::from(sheared.distance().max(MIN_EXTENT));
    (at_t - at_uv).abs().max_element() / bound
}

fn shear(ray: &Ray, corners: [Vec3; 3], sheared: &Sheared) -> f64 {
    let [x, y, z] = sheared.axes;
    let (o, d) = (ray.origin.as_dvec3(), sheared.direction.as_dvec3());
    let mut worst = 0.0_f64;
    for (corner, computed) in corners.iter().zip(sheared.corners) {
        let moved = corner.as_dvec3() - o;
        for (axis, computed) in [(x, computed.x), (y, computed.y)] {
            let exactly = moved[axis] - moved[z] * (d[axis] / d[z]);
            worst = worst.max((f64::from(computed) - exactly).abs());
        }
    }
    worst / (f64::from(K_SHEAR) * U * f64::from(sheared.distance().max(MIN_EXTENT)))
}

/// Each a rounded difference of exact products, all of one sign: good to a few 2^-53.
fn weights(sheared: &Sheared) -> [f64; 3] {
    let [a, b, c] = sheared
        .corners
        .map(|corner| [f64::from(corner.x), f64::from(corner.y)]);
    let edge = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
    let weights = [edge(b, c), edge(c, a), edge(a, b)];
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

/// The box test's formula without its margin, for a box of the one point: how late it enters or how early it leaves by
/// one plane, and the margin without which it leaves before it enters.
fn slab(
    ray: &Ray,
    corners: [Vec3; 3],
    sheared: &Sheared,
    weights: [f64; 3],
    t_star: f64,
) -> [f64; 2] {
    let bound = corners
        .iter()
        .fold(Vec3::ZERO, |most, corner| most.max(corner.abs()));
    let extent = (bound + ray.origin.abs()).max_element().max(MIN_EXTENT);
    let place = |axis: usize| -> f64 {
        (weights.iter().zip(corners))
            .map(|(weight, corner)| weight * f64::from(corner[axis]))
            .sum()
    };
    // With a fused operation and without, as backends differ; where each plane is met, and the unit of its margin.
    let mut planes = [[[0.0; 3]; 3]; 2];
    for axis in 0..3 {
        let r = (1.0 / sheared.direction[axis]).clamp(-(2f32.powi(48)), 2f32.powi(48));
        let at_origin = -(ray.origin[axis] * r);
        let place = place(axis);
        let rounded = place as f32;
        let low = if f64::from(rounded) > place {
            rounded.next_down()
        } else {
            rounded
        };
        let high = if f64::from(rounded) < place {
            rounded.next_up()
        } else {
            rounded
        };
        let (near, far) = if r.is_sign_negative() {
            (high, low)
        } else {
            (low, high)
        };
        let margin = K_BOX * U * f64::from(extent) * f64::from(r.abs());
        let fused = [near.mul_add(r, at_origin), far.mul_add(r, at_origin)];
        let apart = [near * r + at_origin, far * r + at_origin];
        for (plane, [near, far]) in planes.iter_mut().zip([fused, apart]) {
            plane[axis] = [f64::from(near), f64::from(far), margin];
        }
    }
    let mut worst = [0.0_f64; 2];
    for axes in planes {
        for [near, far, margin] in axes {
            worst[0] = worst[0].max((near - t_star).max(t_star - far) / margin);
            for [_, other_far, other_margin] in axes {
                worst[1] = worst[1].max((near - other_far) / (margin + other_margin));
            }
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::claims::check;

    #[test]
    fn some_is_used_and_never_all() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut worst = Margins::default();
        for _ in 0..1000 {
            let mut any = || Vec3::from([(); 3].map(|()| random.f32() - 0.5));
            let corners = [any(), any(), any()];
            let origin = any() * 3.0;
            let ray = Ray::new(
                origin,
                (corners[0] + corners[1] + corners[2]) / 3.0 - origin,
            );
            let hit = check(&ray, corners).unwrap();
            worst = worst.max(margins(&ray, corners, hit.as_ref()));
        }
        for used in [worst.shear, worst.t, worst.slab] {
            assert!(0.02 < used && used < 1.0, "{worst:?}");
        }
    }
}
