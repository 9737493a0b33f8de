//! Whether an answer is right for some ray beside the one that was traced.

use super::Scale;
use crate::error::truth::{ExactRay, First, Truth};
use glam::{DVec3, Vec3};
use std::f64::consts::TAU;
use wide_bvh::geometry::{Hit, Ray};

/// Whether the answer is right for a ray beside `ray`.
pub fn at_edge(truth: &Truth<'_>, ray: &Ray, first: Option<&First>, answer: Option<&Hit>) -> bool {
    let scale = Scale::new(truth, ray, first, answer);
    let is_right = |ray: ExactRay| match (truth.first(&ray), answer) {
        (None, None) => true,
        (Some(first), Some(hit)) => (first.t - f64::from(hit.t)).abs() <= scale.t_rounding,
        _ => false,
    };
    let exact = ExactRay::from(ray);
    let [least, most] = exact.range;
    let rounding = scale.t_rounding;
    let mut ranges = vec![exact.range];
    let times = first.map(|first| first.t).into_iter();
    let times = times.chain(answer.map(|hit| f64::from(hit.t)));
    let near_end = |t: f64| {
        [least, most]
            .map(|end| (t - end).abs())
            .into_iter()
            .any(|off| off <= 2.0 * rounding)
    };
    if times.into_iter().any(near_end) {
        ranges.push([least + rounding, most - rounding]);
        ranges.push([least - rounding, most + rounding]);
    }
    let onto_answer = answer.map_or_else(Vec::new, |hit| {
        shifts_onto(
            truth.corners(hit.primitive),
            &exact,
            f64::from(hit.t),
            scale.shift,
        )
    });
    let around = sideways(exact.direction)
        .flat_map(|way| [0.25, 0.5, 1.0].map(|part| way * (part * scale.shift)));
    [DVec3::ZERO]
        .into_iter()
        .chain(onto_answer)
        .chain(around)
        .any(|shift| {
            let origin = exact.origin + shift;
            let shifted = |&range: &[f64; 2]| ExactRay {
                origin,
                range,
                ..exact
            };
            ranges.iter().map(shifted).any(is_right)
        })
}

/// Shifts of at most `limit` that bring a ray's point at `t` onto a triangle, if there are any. On one that is seen
/// nearly edge-on the least shift moves the hit far, so those around it would not find it.
fn shifts_onto(corners: [Vec3; 3], ray: &ExactRay, t: f64, limit: f64) -> Vec<DVec3> {
    let corners = corners.map(|corner| corner.as_dvec3());
    let [a, b, c] = corners;
    let point = ray.origin + ray.direction * t;
    let closest = closest_point(corners, point);
    let inwards = ((a + b + c) / 3.0 - closest).normalize_or_zero();
    // A little further in, for the shift is rounded, too.
    [1e-4, 1e-2, 0.1]
        .map(|part| closest + inwards * (part * limit) - point)
        .map(|shift| shift.reject_from(ray.direction))
        .into_iter()
        .filter(|shift| shift.length() <= limit)
        .collect()
}

/// The point of a triangle that is closest to a point.
fn closest_point([a, b, c]: [DVec3; 3], point: DVec3) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let foot = point - (point - a).project_onto(normal);
    let edges = [(a, b), (b, c), (c, a)];
    if edges
        .iter()
        .all(|&(p, q)| (q - p).cross(foot - p).dot(normal) >= 0.0)
    {
        return foot;
    }
    let on_edge = edges.map(|(p, q)| {
        let along = (point - p).dot(q - p) / (q - p).length_squared();
        p.lerp(q, along.clamp(0.0, 1.0))
    });
    let [first, others @ ..] = on_edge;
    others.into_iter().fold(first, |best, other| {
        if other.distance_squared(point) < best.distance_squared(point) {
            other
        } else {
            best
        }
    })
}

/// Sixteen unit vectors across a direction.
fn sideways(direction: DVec3) -> impl Iterator<Item = DVec3> {
    let (x, y) = direction.normalize().any_orthonormal_pair();
    (0..16).map(move |i| {
        let (sin, cos) = (TAU / 16.0 * f64::from(i)).sin_cos();
        cos * x + sin * y
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_point_of_a_triangle_is_inside_on_an_edge_or_a_corner() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (point, closest) in [
            ([0.25, 0.25, 3.0], [0.25, 0.25, 0.0]),
            ([0.5, -1.0, 1.0], [0.5, 0.0, 0.0]),
            ([1.0, 1.0, 0.0], [0.5, 0.5, 0.0]),
            ([-1.0, -2.0, 5.0], [0.0; 3]),
        ] {
            let found = closest_point(corners, point.into());
            assert!(found.distance(closest.into()) < 1e-12, "{found}");
        }
    }
}
