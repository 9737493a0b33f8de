//! Closed meshes from within.

use crate::stress::{
    aim::{log_uniform, sign, unit},
    case::Case,
};
use fastrand::Rng;
use glam::Vec3;
use wide_bvh::geometry::Ray;
use wide_bvh_scenes::shapes;

/// Rays from near the centre of a closed mesh that is star-shaped around it, at vertices, edges and faces: each hits.
pub fn closed(rng: &mut Rng) -> Case {
    let (mesh, quantised) = match rng.u32(..4) {
        0 => (shapes::cuboid([-1.0; 3], [1.0; 3]), false),
        1 => (shapes::quantised(shapes::icosphere(2), 64), true),
        _ => (shapes::icosphere(rng.u32(..4)), false),
    };
    let (centre, radius) = if quantised {
        (Vec3::splat(32.0), 25.0)
    } else {
        (Vec3::ZERO, 0.6)
    };
    // What is squashed along axes stays closed, and what is moved, as long as rounding leaves the centre inside.
    let squash = Vec3::from([(); 3].map(|()| log_uniform(rng, -3.0, 0.0)));
    let scale = log_uniform(rng, -12.0, 12.0);
    let offset = if rng.bool() {
        Vec3::ZERO
    } else {
        unit(rng) * log_uniform(rng, 0.0, 2.0)
    };
    let motion = |p: Vec3| ((p - centre) * squash / radius + offset) * scale;
    let mesh = mesh.moved(motion);
    let middle = motion(centre);

    let rays = (0..300)
        .map(|i| {
            let inside = unit(rng) * squash * (0.4 * rng.f32()) * scale;
            let origin = if i % 2 == 0 { middle } else { middle + inside };
            let [a, b, c] = mesh.indices[rng.usize(..mesh.indices.len())]
                .map(|corner| Vec3::from(mesh.positions[corner as usize]));
            let target = match i % 5 {
                0 => a,
                1 => a.lerp(b, rng.f32()),
                2 => a.lerp(b, 0.5),
                3 => a.lerp(b, rng.f32()).lerp(c, rng.f32()),
                _ => origin + Vec3::AXES[rng.usize(..3)] * sign(rng) * scale,
            };
            let mut direction = target - origin;
            if direction == Vec3::ZERO {
                direction = Vec3::X;
            }
            Ray::new(origin, direction)
        })
        .collect();
    Case {
        closed: true,
        ..Case::of(rng, mesh, rays)
    }
}
