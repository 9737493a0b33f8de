//! Triangles with nothing in common.

use crate::Mesh;
use glam::Vec3;

/// `n` random triangles in the unit cube, of all sizes from a speck to its whole width: every size
/// a power of two down to 2^-10 is as likely. Equal seeds give equal soups.
pub fn soup(n: usize, seed: u64) -> Mesh {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut point = |low: f32, high: f32| {
        let mut axis = || low + (high - low) * rng.f32();
        Vec3::new(axis(), axis(), axis())
    };
    let mut positions = Vec::with_capacity(3 * n);
    for _ in 0..n {
        let size = point(-10.0, 0.0).x.exp2();
        let at = point(0.0, 1.0 - size);
        positions.extend([(); 3].map(|()| (at + size * point(0.0, 1.0)).to_array()));
    }
    Mesh {
        name: "soup".into(),
        positions,
        indices: (0..n as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect(),
    }
}
