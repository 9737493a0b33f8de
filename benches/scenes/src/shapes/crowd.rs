//! Large scenes out of small ones.

use crate::Mesh;
use glam::{EulerRot, Quat, Vec3};

/// `copies` of `mesh`, each turned some way, scaled, and strewn about its cell of a cubic grid, as one mesh.
/// Neighbours may overlap a little, as the boxes of any large scene do. Equal seeds give equal crowds.
///
/// Cells have a side of 1. Each copy's bounds fit a ball of radius 0.4 to 0.6, whose centre is up to 0.2 off
/// the cell's along each axis.
///
/// # Panics
/// If there would be more vertices than an index can name.
pub fn crowd(mesh: &Mesh, copies: usize, seed: u64) -> Mesh {
    let (min, max) = mesh.bounds();
    let (min, max) = (Vec3::from(min), Vec3::from(max));
    let (centre, radius) = ((min + max) * 0.5, (max - min).length() * 0.5);
    let unit = if radius > 0.0 { radius.recip() } else { 1.0 };
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut between = |low: f32, high: f32| low + (high - low) * rng.f32();
    let side = (1..)
        .find(|side: &usize| side.pow(3) >= copies)
        .expect("a cube is large enough in time");
    let mut crowd = Mesh {
        name: format!("crowd of {}", mesh.name),
        positions: Vec::with_capacity(copies * mesh.positions.len()),
        indices: Vec::with_capacity(copies * mesh.indices.len()),
    };
    for copy in 0..copies {
        let cell = [copy % side, copy / side % side, copy / side / side];
        let cell = Vec3::from(cell.map(|i| i as f32 + 0.5));
        let at = cell + Vec3::from([(); 3].map(|()| between(-0.2, 0.2)));
        let angles = [(); 3].map(|()| between(0.0, std::f32::consts::TAU));
        let turn = Quat::from_euler(EulerRot::YXZ, angles[0], angles[1], angles[2]);
        let scale = between(0.4, 0.6) * unit;
        let base = crowd.positions.len();
        crowd.append(mesh);
        for position in &mut crowd.positions[base..] {
            let turned = turn * (Vec3::from(*position) - centre);
            *position = (at + scale * turned).to_array();
        }
    }
    crowd
}
