//! Height fields: flat ground and hills.

use super::{Wrap, patch};
use crate::Mesh;
use glam::Vec3;

/// The square of side 2 around the origin at height 0, in `cells` by `cells` squares. Open.
///
/// # Panics
/// If there are more points than an index can name.
pub fn plane(cells: usize) -> Mesh {
    let mut mesh = terrain(cells, 0.0, 0);
    mesh.name = "plane".into();
    mesh
}

/// Hills up to `height` over the square of side 2 around the origin, in `cells` by `cells` squares. Open.
/// Equal seeds give equal hills.
///
/// # Panics
/// If there are more points than an index can name.
pub fn terrain(cells: usize, height: f32, seed: u64) -> Mesh {
    let points = (cells + 1, Wrap::Open);
    patch("terrain", points, points, |column, row| {
        let x = 2.0 * column as f32 / cells as f32 - 1.0;
        let z = 1.0 - 2.0 * row as f32 / cells as f32;
        Vec3::new(x, height * hills_at(x, z, seed), z)
    })
}

/// The height of [`terrain`] at a point, for a height of 1: seven octaves of value noise, 0 to 1, each twice as fine and half as high as the one before.
pub fn hills_at(x: f32, z: f32, seed: u64) -> f32 {
    let octave = |o: i32| {
        let frequency = 2.0_f32.powi(o + 1);
        0.5_f32.powi(o + 1) * noise(x * frequency, z * frequency, seed + o as u64)
    };
    (0..7).map(octave).sum()
}

/// Random heights at whole coordinates, 0 to 1, and a smooth blend between them.
fn noise(x: f32, z: f32, seed: u64) -> f32 {
    let (x0, z0) = (x.floor(), z.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (tx, tz) = (smooth(x - x0), smooth(z - z0));
    let at = |dx: i64, dz: i64| {
        let (ix, iz) = (x0 as i64 + dx, z0 as i64 + dz);
        let cell = (ix as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (iz as u64).rotate_left(32);
        fastrand::Rng::with_seed(cell ^ seed.wrapping_mul(0xD6E8_FEB8_6659_FD93)).f32()
    };
    let near = at(0, 0) + tx * (at(1, 0) - at(0, 0));
    let far = at(0, 1) + tx * (at(1, 1) - at(0, 1));
    near + tz * (far - near)
}
