//! No ray from inside a closed mesh gets out, wherever it is aimed: a million rays.

use crate::common::{SEED, Variants, part};
use glam::Vec3;
use wide_bvh::geometry::Ray;
use wide_bvh_scenes::{Mesh, shapes};

/// Rays from near the centre of a closed mesh that is star-shaped around it: at vertices, at points of
/// edges, at points of faces, along the axes, anywhere. On 2 widths and each backend.
fn no_ray_gets_out(mesh: Mesh, centre: Vec3, inner_radius: f32, rays: usize) {
    println!("seed {SEED}");
    let mut random = fastrand::Rng::with_seed(SEED);
    let scene = Variants::new(mesh.positions.clone(), mesh.indices.clone());
    let vertices: Vec<Vec3> = mesh.positions.iter().map(|&p| p.into()).collect();
    let mut checked = 0;
    for i in 0..part(rays) {
        let offset = Vec3::from([0; 3].map(|_| random.f32() - 0.5)) * inner_radius;
        // Every other ray from the exact centre, where symmetric meshes line up.
        let origin = if i % 2 == 0 { centre } else { centre + offset };
        let [a, b, c] = mesh.indices[random.usize(..mesh.indices.len())]
            .map(|corner| vertices[corner as usize]);
        let (s, t) = (random.f32(), random.f32());
        let direction = match i % 7 {
            0 => a - origin,
            1 => a + s * (b - a) - origin,
            2 => (a + b) * 0.5 - origin,
            3 => a + s * (b - a) + (1.0 - s) * t * (c - a) - origin,
            4 => Vec3::AXES[random.usize(..3)] * if random.bool() { 1.0 } else { -1.0 },
            5 => {
                // In a plane through two axes.
                let mut d = a - origin;
                d[random.usize(..3)] = 0.0;
                d
            }
            _ => Vec3::from([0; 3].map(|_| random.f32() - 0.5)),
        };
        if direction == Vec3::ZERO {
            continue;
        }
        let ray = Ray::new(origin, direction);
        let hit = scene.agreed(&ray).unwrap();
        assert!(hit.is_some(), "{} leaks at {ray:?}", mesh.name);
        checked += 1;
    }
    println!("{}: {checked} rays, none got out", mesh.name);
}

#[test]
fn icosphere() {
    no_ray_gets_out(shapes::icosphere(4), Vec3::ZERO, 0.5, 250_000);
}

#[test]
fn icosphere_far_from_the_origin() {
    let far = Vec3::new(1.0e4, -3.0e3, 777.7);
    let mesh = shapes::icosphere(4).moved(|p| p + far);
    no_ray_gets_out(mesh, far, 0.5, 250_000);
}

/// Integer coordinates make edges and vertices that rays along an axis meet exactly (tinybvh #168).
#[test]
fn icosphere_on_an_integer_grid() {
    let mesh = shapes::quantised(shapes::icosphere(4), 64);
    let centre = {
        let (min, max) = mesh.bounds();
        ((Vec3::from(min) + Vec3::from(max)) * 0.5).round()
    };
    no_ray_gets_out(mesh, centre, 4.0, 250_000);
}

#[test]
fn cube() {
    let mesh = shapes::cuboid([-1.0; 3], [1.0; 3]);
    no_ray_gets_out(mesh, Vec3::ZERO, 1.5, 150_000);
}

#[test]
fn flattened_icosphere() {
    let mesh = shapes::icosphere(3).moved(|p| p * Vec3::new(1.0e3, 1.0, 1.0e-3));
    no_ray_gets_out(mesh, Vec3::ZERO, 1.0e-4, 150_000);
}
