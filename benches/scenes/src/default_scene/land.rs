//! The land around: hills and trees.

use crate::{
    Mesh,
    shapes::{Wrap, hills_at, revolved, terrain},
};
use glam::Vec3;
use std::f32::consts::TAU;

/// Which hills.
const SEED: u64 = 7;
/// How far the land goes, from the middle.
const LAND: f32 = 90.0;

/// Level around the court, rising further off.
pub(super) fn hills() -> Mesh {
    terrain(220, 1.0, SEED).moved(|p| land_at(p.with_y(0.0) * LAND, p.y))
}

/// Slender trees strewn over the slopes.
pub(super) fn cypresses() -> Mesh {
    let profile = [
        [0.2, -0.8],
        [0.2, 0.1],
        [0.55, 0.15],
        [0.7, 0.9],
        [0.72, 1.9],
        [0.62, 3.2],
        [0.42, 4.6],
        [0.2, 5.8],
        [0.0, 6.6],
    ];
    let cypress = revolved(&profile, Wrap::Open, 12);
    let mut rng = fastrand::Rng::with_seed(3);
    let mut grove = Mesh::default();
    for _ in 0..220 {
        let turn = TAU * rng.f32();
        let away = (17.0 + 45.0 * rng.f32()) * Vec3::new(turn.sin(), 0.0, turn.cos());
        let size = 0.6 + 0.8 * rng.f32();
        let root = land_at(away, hills_at(away.x / LAND, away.z / LAND, SEED));
        grove.append(&cypress.clone().moved(|p| root + size * p));
    }
    grove
}

/// The ground `away` from the middle, where the noise of its height is `rough`.
fn land_at(away: Vec3, rough: f32) -> Vec3 {
    let slope = ((away.length() - 15.0) / 50.0).clamp(0.0, 1.0);
    let rise = slope * slope * (3.0 - 2.0 * slope);
    away.with_y(rise * 36.0 * rough + 0.8 * (rough - 0.5) - 1.0)
}
