//! Rays.

use crate::{Float, floats};
use arbitrary::Arbitrary;
use glam::Vec3;
use wide_bvh::geometry::Ray;

/// One ray, or some that are like those before.
#[derive(Arbitrary, Debug)]
pub enum RayBytes {
    /// Of any bits.
    Free {
        origin: [Float; 3],
        direction: [Float; 3],
        range: Option<[Float; 2]>,
    },
    /// From a point towards one of a triangle, a corner or an edge of it, and beyond or not.
    Aimed {
        from: [Float; 3],
        triangle: u16,
        weights: [u8; 2],
        segment: bool,
    },
    /// The last one but for some last bits.
    Alike(Vec<[u8; 6]>),
    /// From where the last one begins.
    Fan(Vec<[i8; 3]>),
    /// The last one so many times.
    Repeated(u8),
}

/// The rays, of which there are `most` at most. `targets` are what some of them are aimed at.
pub fn rays(bytes: &[RayBytes], targets: &[[Vec3; 3]], most: usize) -> Vec<Ray> {
    let mut rays = Vec::new();
    for bytes in bytes {
        let last = rays.last().copied();
        let last = last.unwrap_or(Ray::new([0.25, 0.25, -3.0], [0.125, -0.25, 1.0]));
        match bytes {
            &RayBytes::Free {
                origin,
                direction,
                range,
            } => {
                let [t_min, t_max] = range.map_or([0.0, f32::INFINITY], floats);
                let ray = Ray::new(floats(origin), floats(direction));
                rays.push(ray.with_range(t_min, t_max));
            }
            &RayBytes::Aimed {
                from,
                triangle,
                weights,
                segment,
            } => {
                let from = Vec3::from(floats(from));
                let to = target(targets, triangle, weights);
                rays.push(match segment {
                    true => Ray::segment(from, to),
                    false => Ray::new(from, to - from),
                });
            }
            RayBytes::Alike(nudges) => rays.extend(nudges.iter().map(|nudge| nudged(last, *nudge))),
            RayBytes::Fan(directions) => rays.extend(directions.iter().map(|direction| {
                let direction = Vec3::from(direction.map(f32::from)) / 64.0;
                Ray { direction, ..last }
            })),
            &RayBytes::Repeated(times) => rays.extend((0..times).map(|_| last)),
        }
        if rays.len() >= most {
            break;
        }
    }
    rays.truncate(most);
    rays
}

fn target(targets: &[[Vec3; 3]], triangle: u16, weights: [u8; 2]) -> Vec3 {
    if targets.is_empty() {
        return Vec3::ZERO;
    }
    let [a, b, c] = targets[usize::from(triangle) % targets.len()];
    let [u, v] = weights.map(|weight| f32::from(weight) / 255.0);
    a + u * (b - a) + v * (c - a)
}

fn nudged(ray: Ray, nudge: [u8; 6]) -> Ray {
    let nudged = |x: f32, by: u8| f32::from_bits(x.to_bits() ^ u32::from(by));
    let [a, b, c, d, e, f] = nudge;
    let (o, r) = (ray.origin, ray.direction);
    let origin = [nudged(o.x, a), nudged(o.y, b), nudged(o.z, c)];
    let direction = [nudged(r.x, d), nudged(r.y, e), nudged(r.z, f)];
    Ray::new(origin, direction).with_range(ray.t_min, ray.t_max)
}
