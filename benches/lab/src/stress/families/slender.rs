//! Thin triangles, and triangles seen from the side.

use super::meshes;
use crate::stress::{
    aim::{Aim, Reach, log_uniform, rays, unit},
    case::Case,
};
use fastrand::Rng;
use glam::Vec3;

/// Needles, one short side, and slivers, one corner next to the opposite side.
pub fn needles(rng: &mut Rng) -> Case {
    let triangles: Vec<[Vec3; 3]> = (0..rng.usize(1..60))
        .map(|_| {
            let (a, b) = (unit(rng), unit(rng));
            let side = unit(rng) * log_uniform(rng, -7.0, -2.0) * a.distance(b);
            let along = if rng.bool() { 1.0 } else { rng.f32() };
            let c = a.lerp(b, along) + side;
            let mut corners = [a, b, c];
            corners.rotate_left(rng.usize(..3));
            corners
        })
        .collect();
    let mesh = meshes::of_triangles("needles", &triangles);
    let aims = [
        Aim::Face,
        Aim::Edge,
        Aim::Vertex,
        Aim::Grazing,
        Aim::FromSurface,
        Aim::InPlane,
    ];
    let rays = rays(rng, &mesh, &aims, Reach(-4.0, 3.0), 200);
    Case {
        exact_every: 16,
        ..Case::of(rng, mesh, rays)
    }
}

/// Rays next to a triangle's plane.
pub fn grazing(rng: &mut Rng) -> Case {
    let mesh = meshes::any(rng);
    let aims = [Aim::Grazing, Aim::Grazing, Aim::Grazing, Aim::InPlane];
    let rays = rays(rng, &mesh, &aims, Reach(-3.0, 4.0), 200);
    Case {
        exact_every: 16,
        ..Case::of(rng, mesh, rays)
    }
}
