//! What meets exactly: axes, grids, surfaces, boxes.

use super::meshes;
use crate::stress::{
    aim::{Aim, Reach, rays},
    case::Case,
};
use fastrand::Rng;
use wide_bvh_scenes::{Mesh, shapes};

/// Along axes and in the planes of boxes.
pub fn axes(rng: &mut Rng) -> Case {
    let mesh = if rng.bool() {
        meshes::any(rng)
    } else {
        boxes_mesh(rng)
    };
    let aims = [Aim::AlongAxis, Aim::AlongAxis, Aim::InAxesPlane, Aim::Box];
    let rays = rays(rng, &mesh, &aims, Reach::NEAR, 200);
    Case::of(rng, mesh, rays)
}

/// Boxes side by side on a grid.
fn boxes_mesh(rng: &mut Rng) -> Mesh {
    let mut mesh = Mesh::default();
    for _ in 0..rng.usize(1..12) {
        let min = [(); 3].map(|()| rng.u32(..8) as f32 / 2.0);
        let max = min.map(|x| x + rng.u32(..4) as f32 / 2.0);
        mesh.append(&shapes::cuboid(min, max));
    }
    mesh
}

/// Whole coordinates.
pub fn quantised(rng: &mut Rng) -> Case {
    let mesh = meshes::quantised(rng);
    let aims = [
        Aim::AlongAxis,
        Aim::Vertex,
        Aim::Edge,
        Aim::InAxesPlane,
        Aim::FromSurface,
    ];
    let rays = rays(rng, &mesh, &aims, Reach::NEAR, 200);
    Case::of(rng, mesh, rays)
}

/// From the surface.
pub fn surface(rng: &mut Rng) -> Case {
    let mesh = meshes::any(rng);
    let mut rays = rays(
        rng,
        &mesh,
        &[Aim::FromSurface, Aim::InPlane],
        Reach::NEAR,
        200,
    );
    for ray in &mut rays {
        if rng.u32(..4) == 0 {
            ray.t_min = f32::MIN_POSITIVE;
        }
    }
    Case::of(rng, mesh, rays)
}

/// At boxes.
pub fn boxes(rng: &mut Rng) -> Case {
    let mesh = meshes::any(rng);
    let mut all = rays(rng, &mesh, &[Aim::Box, Aim::Vertex], Reach::NEAR, 100);
    all.extend(rays(
        rng,
        &mesh,
        &[Aim::Box, Aim::Vertex],
        Reach(2.0, 8.0),
        100,
    ));
    Case::of(rng, mesh, all)
}
