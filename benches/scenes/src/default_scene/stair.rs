//! A spiral stair that leads nowhere.

use crate::{
    Mesh,
    shapes::{Wrap, cuboid, patch, revolved},
};
use glam::{Quat, Vec3};
use std::f32::consts::TAU;

/// How many treads there are.
const STEPS: usize = 30;
/// The angle from one to the next.
const TURN: f32 = TAU / 20.0;
/// The height from one to the next.
const RISE: f32 = 0.21;
/// How far from the pole the rail is, and how far above the treads.
const RAIL: [f32; 2] = [1.435, 0.95];

/// Wedges around a pole, with thin balusters and a rail.
pub(super) fn stair() -> Mesh {
    let mut stair = revolved(&[[0.12, -0.1], [0.12, 7.4], [0.0, 7.5]], Wrap::Open, 24);
    let tread = cuboid([-0.5, -0.06, 0.1], [0.5, 0.0, 1.5]).moved(|p| {
        // A wedge: as wide as the turn of a step, and some more for the overlap.
        Vec3::new(p.x * p.z * TURN * 1.25, p.y, p.z)
    });
    let baluster = cuboid(
        [-0.015, 0.0, RAIL[0] - 0.015],
        [0.015, RAIL[1], RAIL[0] + 0.015],
    );
    for step in 0..STEPS {
        for part in [&tread, &baluster] {
            stair.append(&part.clone().moved(|p| climbed(p, step as f32)));
        }
    }
    stair.append(&rail());
    stair.moved(|p| p + Vec3::new(-5.6, 0.0, 1.6))
}

/// A thin tube, four rings a step.
fn rail() -> Mesh {
    const SIDES: usize = 8;
    let (around, along) = ((SIDES, Wrap::Closed), (STEPS * 4, Wrap::Open));
    patch("rail", around, along, |side, ring| {
        let (sin, cos) = (TAU * side as f32 / SIDES as f32).sin_cos();
        let outline = Vec3::new(0.0, RAIL[1] + 0.03 * sin, RAIL[0] + 0.03 * cos);
        climbed(outline, ring as f32 / 4.0)
    })
}

/// Where the point `p` of the first step is on another.
fn climbed(p: Vec3, step: f32) -> Vec3 {
    Quat::from_rotation_y(TURN * step) * p + Vec3::Y * (RISE * (step + 1.0))
}
