//! Meshes whose coordinates are small whole numbers, so that rays along axes meet edges and vertices exactly.

use crate::Mesh;
use glam::Vec3;

/// The mesh with its vertices rounded to whole numbers, 0 to `grid_steps` along the longest side of its
/// bounds. Indices stay as they are, so what was closed stays so; triangles may become degenerate.
pub fn quantised(mesh: Mesh, grid_steps: u32) -> Mesh {
    let (min, max) = mesh.bounds();
    let (min, max) = (Vec3::from(min), Vec3::from(max));
    let longest = (max - min).max_element();
    let scale = if longest > 0.0 {
        grid_steps as f32 / longest
    } else {
        0.0
    };
    mesh.moved(|p| ((p - min) * scale).round())
}
