//! The court: a paved floor upon steps, and what lies and stands on it.

use crate::{
    Mesh,
    shapes::{Wrap, cuboid, icosphere, revolved, torus_knot},
};
use glam::{EulerRot, Quat, Vec3};
use std::f32::consts::{PI, TAU};

/// Four round steps up to the court.
pub(super) fn steps() -> Mesh {
    let mut profile = Vec::new();
    for step in 0..4 {
        let (radius, height) = (13.0 - 0.45 * step as f32, -0.2 * (4 - step) as f32 - 0.02);
        profile.extend([[radius, height - 0.2], [radius, height]]);
    }
    profile.push([0.0, -0.22]);
    revolved(&profile, Wrap::Open, 128)
}

/// Rings of stone slabs with gaps between, none quite level with the next.
pub(super) fn floor() -> Mesh {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut slabs = Mesh::default();
    for ring in 2..11 {
        let radius = ring as f32 * 1.05 - 0.2;
        let slabs_around = (TAU * radius / 1.3).round() as usize;
        let half_width = PI * (radius + 0.5) / slabs_around as f32;
        for slab in 0..slabs_around {
            let turn = Quat::from_rotation_y(
                TAU * (slab as f32 + 0.5 * (ring % 2) as f32) / slabs_around as f32,
            );
            let top = 0.03 * rng.f32() - 0.03;
            let tile = cuboid([-1.0, -0.25, -0.5], [1.0, top, 0.48]).moved(|p| {
                // Slabs are wedges: narrower towards the middle.
                let taper = (radius + p.z) / (radius + 0.5);
                let across = p.x * (half_width * taper - 0.02);
                turn * Vec3::new(across, p.y, radius + p.z)
            });
            slabs.append(&tile);
        }
    }
    slabs
}

/// A torus knot on end upon a plinth.
pub(super) fn sculpture() -> Mesh {
    let profile = [
        [1.9, -0.2],
        [1.9, 0.2],
        [1.7, 0.25],
        [1.7, 0.5],
        [1.3, 0.6],
        [1.25, 1.2],
        [1.45, 1.3],
        [1.45, 1.5],
        [0.0, 1.5],
    ];
    let mut sculpture = revolved(&profile, Wrap::Open, 8);
    let upright = Quat::from_euler(EulerRot::YXZ, 0.45, PI / 2.0, 0.0);
    let knot = torus_knot(2, 3, 0.21, 1600, 32);
    sculpture.append(&knot.moved(|p| upright * (p * 2.0) + Vec3::Y * 4.6));
    sculpture
}

/// Large, middling and small ones, lying on the floor.
pub(super) fn spheres() -> Mesh {
    let mut spheres = Mesh::default();
    let mut place = |subdivisions, radius: f32, x: f32, z: f32| {
        let centre = Vec3::new(x, radius, z);
        spheres.append(&icosphere(subdivisions).moved(|p| p * radius + centre));
    };
    place(5, 1.15, 4.9, 2.4);
    place(4, 0.7, 3.0, 4.6);
    place(4, 0.55, -2.4, 5.6);
    place(4, 0.8, -3.2, -4.8);
    let mut rng = fastrand::Rng::with_seed(5);
    for i in 0..18 {
        let turn = TAU * (i as f32 + 0.7 * rng.f32()) / 18.0;
        let away = 2.6 + 4.2 * rng.f32();
        let radius = 0.12 + 0.2 * rng.f32();
        place(3, radius, away * turn.sin(), away * turn.cos());
    }
    spheres
}
