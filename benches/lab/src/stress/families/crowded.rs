//! Larger meshes: much in one place, deep trees, triangles in pieces. Fewer rays, for brute force takes its time.

use super::meshes;
use crate::stress::{
    aim::{ALL, Aim, Reach, log_uniform, rays, unit},
    case::Case,
    trees as shapes_of_trees,
};
use fastrand::Rng;
use glam::Vec3;
use wide_bvh_scenes::{Mesh, shapes};

const RAYS: usize = 100;

fn at(rng: &mut Rng, mesh: Mesh, aims: &[Aim]) -> Case {
    let rays = rays(rng, &mesh, aims, Reach::NEAR, RAYS);
    Case {
        exact_every: 64,
        ..Case::of(rng, mesh, rays)
    }
}

/// A deep tree: a chain, or another odd one, over hundreds to thousands.
pub fn trees(rng: &mut Rng) -> Case {
    let count = log_uniform(rng, 1.5, 3.2) as usize;
    let mesh = if rng.bool() {
        shapes::soup(count, rng.u64(..))
    } else {
        // Each half as large as the one before and inside it, so that boxes shrink along a chain.
        let nested: Vec<[Vec3; 3]> = (0..count)
            .map(|i| [unit(rng), unit(rng), unit(rng)].map(|p| p * 0.9_f32.powi(i as i32 % 400)))
            .collect();
        meshes::of_triangles("nested", &nested)
    };
    let mut case = at(rng, mesh, ALL);
    if rng.bool() {
        case.tree = shapes_of_trees::chain(rng, case.mesh.indices.len());
    }
    case
}

/// The same few triangles over and over, with the corners in any order.
pub fn coincident(rng: &mut Rng) -> Case {
    let mut mesh = if rng.bool() {
        meshes::pool(rng)
    } else {
        meshes::of_triangles("one", &[[unit(rng), unit(rng), unit(rng)]])
    };
    let count = mesh.indices.len();
    for _ in 0..log_uniform(rng, 2.0, 3.5) as usize {
        let mut corners = mesh.indices[rng.usize(..count)];
        match rng.u32(..4) {
            0 => corners.rotate_left(1),
            1 => corners.swap(0, 1),
            _ => {}
        }
        mesh.indices.push(corners);
    }
    rng.shuffle(&mut mesh.indices);
    at(rng, mesh, ALL)
}

/// One triangle up to a million times as large as the rest.
pub fn dust(rng: &mut Rng) -> Case {
    let size = log_uniform(rng, 1.0, 6.0);
    let mut triangles: Vec<[Vec3; 3]> = (0..log_uniform(rng, 1.0, 3.2) as usize)
        .map(|_| {
            let at = unit(rng);
            [(); 3].map(|()| at + unit(rng) * 0.01)
        })
        .collect();
    let giant = [unit(rng), unit(rng), unit(rng)].map(|p| p * size);
    triangles.insert(rng.usize(..=triangles.len()), giant);
    let mesh = meshes::of_triangles("dust", &triangles);
    let mut case = at(rng, mesh, ALL);
    // Most from among the dust: distances above are those of the giant.
    for ray in case.rays.iter_mut().step_by(2) {
        let (origin, target) = (unit(rng) * 1.5, triangles[rng.usize(..triangles.len())][0]);
        (ray.origin, ray.direction) = (origin, target - origin);
    }
    case
}

/// Long triangles across one another, enough of them for the builder to cut some; or many, nearly the same, that one
/// plane meets all of.
pub fn pieces(rng: &mut Rng) -> Case {
    let count = rng.usize(1100..1600);
    let alike = rng.usize(1..40);
    let jitter = if rng.bool() {
        0.0
    } else {
        log_uniform(rng, -3.0, 0.0)
    };
    let mut triangles: Vec<[Vec3; 3]> = (0..count)
        .map(|i| {
            let at = unit(rng) * 10.0;
            let far = unit(rng) * if i % 3 == 0 { 6.0 } else { 0.3 };
            [at, at + unit(rng) * 0.1, at + far]
        })
        .collect();
    if rng.bool() {
        let size = log_uniform(rng, 0.0, 2.0);
        for i in alike..count {
            triangles[i] = triangles[i % alike].map(|p| p + unit(rng) * jitter);
        }
        for triangle in triangles.iter_mut().step_by(rng.usize(1..5)) {
            *triangle = triangle.map(|p| triangle[0].lerp(p, size));
        }
    }
    let mesh = meshes::of_triangles("pieces", &triangles);
    at(rng, mesh, ALL)
}
