//! What is done with a case: brute force, every variant held to it, and brute force held to the exact reference.

use super::{
    case::{Case, Flush},
    flush::flushed,
    tally::Tally,
    variants::{self, Builds, Mismatch, show},
};
use crate::exact::{Sheared, claims, margins};
use glam::{DVec2, DVec3, Vec3};
use wide_bvh::{
    geometry::{Hit, Ray, TriangleMesh},
    reference,
};

/// Something that must not be.
#[derive(Debug)]
pub struct Violation {
    /// The ray, unless there is none in particular.
    pub ray: Option<Ray>,
    /// Its place among the case's, those with other ranges of t included.
    pub place: usize,
    /// What is wrong.
    pub what: String,
}

/// Checks all there is to check of a case.
///
/// # Errors
/// The first violation.
pub fn check(case: &Case) -> Result<Tally, Box<Violation>> {
    if case.flush == Flush::Throughout {
        flushed(|| check_here(case))
    } else {
        check_here(case)
    }
}

fn check_here(case: &Case) -> Result<Tally, Box<Violation>> {
    let mesh = TriangleMesh::new(&case.mesh.positions, &case.mesh.indices).map_err(|error| {
        Box::new(Violation {
            ray: None,
            place: 0,
            what: error.to_string(),
        })
    })?;
    let flush_queries = case.flush == Flush::Queries;
    let (rays, expected) = if flush_queries {
        flushed(|| expect(&mesh, &case.rays))
    } else {
        expect(&mesh, &case.rays)
    };
    let violation = |place: usize, what: String| {
        Box::new(Violation {
            ray: rays.get(place).copied(),
            place,
            what,
        })
    };

    if case.closed
        && let Some(place) = expected[..case.rays.len()].iter().position(Option::is_none)
    {
        return Err(violation(place, "a ray gets out of a closed mesh".into()));
    }
    for (place, expected) in expected.iter().enumerate().step_by(8) {
        let any_hit = || reference::any_hit(&mesh, &rays[place]);
        let any = if flush_queries {
            flushed(any_hit)
        } else {
            any_hit()
        };
        if any != expected.is_some() {
            let what = format!("brute force: any hit {any}, closest {}", show(*expected));
            return Err(violation(place, what));
        }
    }

    let mut tally = Tally {
        meshes: 1,
        triangles: mesh.len() as u64,
        rays: rays.len() as u64,
        hits: expected.iter().flatten().count() as u64,
        ..Tally::default()
    };
    let builds = Builds::new(&case.tree, case.settings);
    let checks = variants::check(&mesh, &builds, &rays, &expected, flush_queries);
    tally.checks = checks.map_err(|Mismatch { ray, variant, got }| {
        let expected = ray.map_or("a build".into(), |ray| show(expected[ray]));
        let what = format!("{variant}: {got}\nbrute force: {expected}");
        match ray {
            Some(place) => violation(place, what),
            None => violation(usize::MAX, what),
        }
    })?;
    // Denormals that are flushed are no part of the claims.
    if case.flush == Flush::Never {
        for place in (0..rays.len()).step_by(case.exact_every) {
            exact(&mesh, &rays[place], expected[place], &mut tally)
                .map_err(|what| violation(place, what))?;
        }
    }
    Ok(tally)
}

/// The rays with brute force's answers; some that hit again with ranges of t that begin or end at the hit.
fn expect(mesh: &TriangleMesh, rays: &[Ray]) -> (Vec<Ray>, Vec<Option<Hit>>) {
    let mut all = rays.to_vec();
    let mut expected: Vec<_> = rays
        .iter()
        .map(|ray| reference::closest_hit(mesh, ray))
        .collect();
    for place in 0..rays.len() {
        let Some(Hit { t, .. }) = expected[place].filter(|_| place % 2 == 0) else {
            continue;
        };
        let (t_min, t_max) = match place / 2 % 5 {
            0 => (t, t),
            1 => (t.next_up(), f32::INFINITY),
            2 => (f32::NEG_INFINITY, t.next_down()),
            3 => (0.0, t),
            _ => (f32::NEG_INFINITY, f32::INFINITY),
        };
        let ray = rays[place].with_range(t_min, t_max);
        expected.push(reference::closest_hit(mesh, &ray));
        all.push(ray);
    }
    (all, expected)
}

/// How many triangles a ray are looked at without rounding, besides the one that is hit.
const CANDIDATES: usize = 3;

/// Holds brute force to the exact reference, on the triangle that is hit and others that the ray hits or nearly
/// does.
fn exact(
    mesh: &TriangleMesh,
    ray: &Ray,
    hit: Option<Hit>,
    tally: &mut Tally,
) -> Result<(), String> {
    let near: Vec<u32> = (0..mesh.len() as u32)
        .filter(|&primitive| corners(mesh, primitive).is_some_and(|c| may_hit(ray, c)))
        .collect();
    let step = near.len().div_ceil(CANDIDATES).max(1);
    let first = tally.exact as usize % step;
    let others = near.iter().copied().skip(first).step_by(step);
    let is_scaled = !(2f32.powi(-23)..2f32.powi(24)).contains(&ray.direction.abs().max_element());
    for primitive in hit.map(|hit| hit.primitive).into_iter().chain(others) {
        let Some(corners) = corners(mesh, primitive) else {
            continue;
        };
        let about = |what: String| format!("triangle {primitive}, {corners:?}: {what}");
        let alone = claims::check(ray, corners).map_err(about)?;
        tally.exact += 1;
        let margins = margins(ray, corners, alone.as_ref());
        if margins.slab > 1.0 {
            return Err(about(format!(
                "a box is met {} times the margin late",
                margins.slab
            )));
        }
        tally.worst = tally.worst.max(margins);

        // The closest of all is no farther than this one.
        let Some(alone) = alone else {
            if hit.is_some_and(|hit| hit.primitive == primitive) {
                return Err(about("hit, but not by itself".into()));
            }
            continue;
        };
        let is_behind = Sheared::new(ray, corners).is_none_or(|sheared| sheared.last() < ray.t_min);
        let in_range = ray.t_min <= alone.t && alone.t <= ray.t_max && !is_behind;
        let is_closest = hit.is_some_and(|hit| (hit.t, hit.primitive) <= (alone.t, primitive));
        if in_range && !is_closest && !is_scaled {
            return Err(about(format!(
                "at {} is closer than {}",
                alone.t,
                show(hit)
            )));
        }
    }
    Ok(())
}

fn corners(mesh: &TriangleMesh, primitive: u32) -> Option<[Vec3; 3]> {
    mesh.triangle(primitive as usize)
        .filter(|corners| corners.iter().all(|corner| corner.is_finite()))
}

/// Whether the ray comes so near to the triangle that rounding might have it hit.
fn may_hit(ray: &Ray, corners: [Vec3; 3]) -> bool {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let largest = d.abs().max_element();
    let Some(z) = (0..3).find(|&axis| d[axis].abs() == largest) else {
        return false;
    };
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let moved = corners.map(|corner| corner.as_dvec3() - o);
    let sheared =
        moved.map(|p: DVec3| DVec2::new(p[x] - p[z] * (d[x] / d[z]), p[y] - p[z] * (d[y] / d[z])));
    let [a, b, c] = moved.map(|p| p.abs().max_element());
    let doubt = a.max(b).max(c).max(f64::from(claims::MIN_EXTENT)) * 1e-6;
    let edge = |p: DVec2, q: DVec2| {
        let doubt = doubt * (p.abs() + q.abs()).element_sum() + doubt * doubt;
        let edge = p.perp_dot(q);
        (edge > doubt, edge < -doubt)
    };
    let [a, b, c] = sheared;
    let sides = [edge(a, b), edge(b, c), edge(c, a)];
    !(sides.iter().any(|side| side.0) && sides.iter().any(|side| side.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_be_hit() {
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let from = |x: f32, y: f32| Ray::new([x, y, -1.0], [0.0, 0.0, 1.0]);
        assert!(may_hit(&from(0.2, 0.2), triangle));
        assert!(may_hit(&from(0.5, -1e-9), triangle));
        assert!(!may_hit(&from(0.5, -1e-3), triangle));
        assert!(!may_hit(&from(1.0, 1.0), triangle));
        assert!(may_hit(&from(0.5, 0.5 + 1e-8), triangle));
    }
}
