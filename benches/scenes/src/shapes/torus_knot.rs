//! A tube along a torus knot: many small triangles that hide one another.

use super::{Wrap, patch};
use crate::Mesh;
use glam::Vec3;
use std::f32::consts::TAU;

/// A tube of radius `tube` along the knot that goes `p` times around the axis of a torus and `q` times
/// through its hole, `segments` steps long and `sides` around. The torus has radii 1 and 0.4, lies around the y
/// axis, and the mesh is closed: 2 * `segments` * `sides` triangles.
///
/// # Panics
/// If there are more points than an index can name.
pub fn torus_knot(p: u32, q: u32, tube: f32, segments: usize, sides: usize) -> Mesh {
    let (p, q) = (p as f32, q as f32);
    let centre = |turn: f32| {
        let (through, around) = ((q * turn).sin_cos(), (p * turn).sin_cos());
        let radius = 1.0 + 0.4 * through.1;
        Vec3::new(radius * around.1, 0.4 * through.0, radius * around.0)
    };
    let frame = |segment: usize| {
        let turn = TAU * segment as f32 / segments as f32;
        let here = centre(turn);
        let along = (centre(turn + 1e-2) - centre(turn - 1e-2)).normalize();
        // The direction away from the torus's own circle is never along the knot, and comes back to
        // where it began: the tube closes without a twist.
        let spine = Vec3::new(here.x, 0.0, here.z).normalize();
        let outward = (here - spine).reject_from_normalized(along).normalize();
        (here, outward, along.cross(outward))
    };
    let frames: Vec<_> = (0..segments).map(frame).collect();
    let around = (sides, Wrap::Closed);
    patch(
        "torus knot",
        around,
        (segments, Wrap::Closed),
        |side, segment| {
            let (here, outward, across) = frames[segment];
            let (sin, cos) = (TAU * side as f32 / sides as f32).sin_cos();
            here + tube * (cos * outward + sin * across)
        },
    )
}
