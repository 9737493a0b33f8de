//! Surfaces of revolution: columns, rings, plinths.

use super::{Wrap, patch};
use crate::Mesh;
use glam::Vec3;
use std::f32::consts::TAU;

/// The `profile`, pairs of radius and height from the bottom up, turned around the y axis in `sides`
/// steps. With [`Wrap::Closed`] the profile's end joins its start, which makes a closed ring of it.
pub fn revolved(profile: &[[f32; 2]], ends: Wrap, sides: usize) -> Mesh {
    let around = (sides, Wrap::Closed);
    patch("revolved", around, (profile.len(), ends), |side, ring| {
        let (sin, cos) = (TAU * side as f32 / sides as f32).sin_cos();
        let [radius, height] = profile[ring];
        Vec3::new(radius * sin, height, radius * cos)
    })
}
