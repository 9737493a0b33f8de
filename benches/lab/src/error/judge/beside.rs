//! Whether a wrong answer is excused: whether what it overlooks ends, or what it names begins, within rounding of the ray.

use super::Scale;
use crate::error::truth::{ExactRay, First, Truth};
use glam::DVec3;
use std::f64::consts::TAU;
use wide_bvh::geometry::{Hit, Ray};

/// Whether the point where an answer says that the ray hits is on its triangle, within rounding.
pub fn is_there(truth: &Truth<'_>, ray: &Ray, hit: &Hit) -> bool {
    let scale = Scale::new(truth, ray, [Some(hit.primitive), None]);
    let corners = truth.corners(hit.primitive).map(|corner| corner.as_dvec3());
    let direction = ray.direction.as_dvec3();
    let point = ray.origin.as_dvec3() + direction * f64::from(hit.t);
    let off = closest_point(corners, point) - point;
    off.reject_from(direction).length() <= scale.shift
        && off.project_onto(direction).length() <= scale.t_rounding * direction.length()
}

/// Whether each triangle that the ray hits in front of the answer ends right beside it, or is hit right at an end of its
/// range.
pub fn may_overlook(truth: &Truth<'_>, ray: &Ray, answer: Option<&Hit>) -> bool {
    let exact = ExactRay::from(ray);
    let mut overlooked = Vec::new();
    while let Some(First { t, triangles }) = truth.first_without(&exact, &overlooked) {
        if answer.is_some_and(|hit| t > f64::from(hit.t)) {
            break;
        }
        for &triangle in &triangles {
            let scale = Scale::new(
                truth,
                ray,
                [Some(triangle), answer.map(|hit| hit.primitive)],
            );
            let until = answer.map_or(f64::INFINITY, |hit| f64::from(hit.t) - scale.t_rounding);
            let at_end = |end: &f64| (t - end).abs() <= scale.t_rounding;
            if t < until
                && !exact.range.iter().any(at_end)
                && !ends_beside(truth, &exact, triangle, scale.shift, until)
            {
                return false;
            }
        }
        overlooked.extend(triangles);
    }
    true
}

/// Whether a shift of at most `limit` takes the ray off a triangle and off what goes on from it there, up to `until`.
///
/// What goes on are triangles that share an edge with it, and those that share a corner near the ray. Triangles that
/// only touch it, or meet it in the middle of an edge, do not: rounding moves them apart.
fn ends_beside(truth: &Truth<'_>, ray: &ExactRay, triangle: u32, limit: f64, until: f64) -> bool {
    let surface = surface_around(truth, ray, triangle, limit);
    let range = [ray.range[0], until];
    let is_off = |shift: DVec3| {
        let origin = ray.origin + shift;
        let shifted = ExactRay {
            origin,
            range,
            ..*ray
        };
        let missed = |&triangle: &u32| truth.hit(&shifted, triangle).is_none();
        shift.length() <= limit && surface.iter().all(missed)
    };
    let over_edges = surface
        .iter()
        .flat_map(|&triangle| shifts_over_edges(truth, ray, triangle, limit));
    over_edges
        .chain(shifts_around(ray.direction, limit))
        .any(is_off)
}

/// A triangle, those that share an edge with it, and those that share a corner of it that is near the ray.
fn surface_around(truth: &Truth<'_>, ray: &ExactRay, triangle: u32, limit: f64) -> Vec<u32> {
    let corners = truth.corners(triangle);
    let mut surface = Vec::new();
    let mut at_other_corners = Vec::new();
    for corner in corners {
        let off = (corner.as_dvec3() - ray.origin).reject_from(ray.direction);
        for other in truth.triangles_at(corner) {
            if off.length() <= 2.0 * limit || at_other_corners.contains(&other) {
                surface.push(other);
            }
            at_other_corners.push(other);
        }
    }
    surface.push(triangle);
    surface.sort_unstable();
    surface.dedup();
    surface
}

/// How far beyond an edge a shift goes, in parts of the greatest: it is rounded itself, and the strip between two outlines
/// may be narrow.
const BEYOND: [f64; 4] = [1e-6, 1e-4, 1e-2, 0.1];

/// Shifts that take a ray just over an edge of a triangle.
fn shifts_over_edges(
    truth: &Truth<'_>,
    ray: &ExactRay,
    triangle: u32,
    limit: f64,
) -> impl Iterator<Item = DVec3> {
    let [a, b, c] = truth.corners(triangle).map(|corner| corner.as_dvec3());
    let direction = ray.direction;
    let origin = ray.origin;
    [(a, b, c), (b, c, a), (c, a, b)]
        .into_iter()
        .flat_map(move |(a, b, opposite)| {
            // Across the edge and the ray, away from the third corner.
            let out = direction.cross(b - a).normalize_or_zero();
            let out = if out.dot(opposite - a) > 0.0 {
                -out
            } else {
                out
            };
            let distance = out.dot(a - origin);
            BEYOND.map(|part| out * (distance + part * limit))
        })
}

/// Shifts in sixteen directions, and of three lengths.
fn shifts_around(direction: DVec3, limit: f64) -> impl Iterator<Item = DVec3> {
    let (x, y) = direction.normalize().any_orthonormal_pair();
    (0..16).flat_map(move |i| {
        let (sin, cos) = (TAU / 16.0 * f64::from(i)).sin_cos();
        [0.25, 0.5, 1.0].map(|part| (cos * x + sin * y) * (part * limit))
    })
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
