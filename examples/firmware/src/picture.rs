//! A picture in letters.

use semihosting::print;
use wide_bvh::{geometry::Ray, layout::OrderedMeshBvh4};

const COLUMNS: usize = 64;
const ROWS: usize = 26;
/// From dark to light.
const LETTERS: &[u8] = b".:-=+*#%@";

/// Prints the scene from above, light where it is near.
pub fn draw(bvh: &OrderedMeshBvh4) {
    let bounds = bvh.bounds();
    let size = bounds.max - bounds.min;
    for row in 0..ROWS {
        let mut line = [b' '; COLUMNS + 1];
        line[COLUMNS] = b'\n';
        for (column, letter) in line[..COLUMNS].iter_mut().enumerate() {
            let mut from = bounds.max;
            from.x -= size.x * (column as f32 + 0.5) / COLUMNS as f32;
            from.y += size.y;
            from.z -= size.z * (row as f32 + 0.5) / ROWS as f32;
            if let Some(hit) = bvh.closest_hit(&Ray::new(from, [0.0, -size.y, 0.0])) {
                let light = (2.0 - hit.t) * LETTERS.len() as f32;
                *letter = LETTERS[(light as usize).min(LETTERS.len() - 1)];
            }
        }
        print!("{}", core::str::from_utf8(&line).unwrap_or_default());
    }
}
