//! Primitives in the order of a space-filling curve: neighbours along it are neighbours in space.
//!
//! Morton (1966); as the start of a build: Lauterbach et al., "Fast BVH construction on GPUs" (2009).

use super::{
    BuildError,
    cost::Measure,
    input::Input,
    monitor::Watch,
    radix::sorted,
    refs::{Bounds, gather},
};
use std::vec::Vec;
use wide::f32x4;

/// Bits of a code along each axis.
pub(super) const BITS: u32 = 11;
pub(super) const CELLS: usize = 1 << BITS;
/// The bits below the code: a primitive's number, of which there are no more than 2^30.
pub(super) const ID_BITS: u32 = 30;

/// Each number with two zeros after every bit.
const SPREAD: [u32; CELLS] = {
    let mut spread = [0; CELLS];
    let mut x = 0;
    while x < CELLS {
        let mut bit = 0;
        while bit < BITS {
            spread[x] |= (x as u32 >> bit & 1) << (3 * bit);
            bit += 1;
        }
        x += 1;
    }
    spread
};

/// Cells along each axis.
#[derive(Clone, Copy)]
struct Grid {
    /// Of all coordinates, so that no difference overflows.
    unit: f32x4,
    origin: f32x4,
    scale: f32x4,
}

impl Grid {
    /// Cells within `bounds`, which are not empty.
    fn new(bounds: &Bounds) -> Self {
        let unit = f32x4::splat(bounds.measure().scale());
        let (min, max) = (bounds.min * unit, bounds.max * unit);
        let size = (max - min).to_array();
        // A little less than all cells, so that what is on the far bound is in the last. What is as close as 1e-30 is
        // one point to a scene whose size is about 1.
        let scale = [0, 1, 2].map(|axis| match size[axis] > 1e-30 {
            true => CELLS as f32 * 0.49999 / size[axis],
            false => 0.0,
        });
        Self {
            unit,
            origin: min + min,
            scale: f32x4::new([scale[0], scale[1], scale[2], 0.0]),
        }
    }

    /// Where the center of a box is along the curve.
    #[inline(always)]
    fn key(&self, &Bounds { min, max }: &Bounds, id: u32) -> u64 {
        let center2 = min * self.unit + max * self.unit;
        let cells = ((center2 - self.origin) * self.scale).fast_trunc_int();
        let [x, y, z, _] = cells.to_array();
        let spread = |cell: i32| u64::from(SPREAD[cell as usize & (CELLS - 1)]);
        let code = spread(x) << 2 | spread(y) << 1 | spread(z);
        code << ID_BITS | u64::from(id)
    }

    /// How many times as large as `bounds` it is, at the least.
    fn excess(&self, bounds: &Bounds) -> f32 {
        let cells = ((bounds.max - bounds.min) * self.unit * self.scale).to_array();
        let [x, y, z, _] = cells.map(|cells| 2.0 * cells);
        CELLS as f32 / x.max(y).max(z)
    }
}

/// Primitives along the curve.
pub(super) struct Curve {
    /// Their numbers.
    pub order: Vec<u32>,
    /// How many are not finite and were left out.
    pub dropped: usize,
    pub measure: Measure,
}

/// The curve through the centers of the boxes of all primitives that have a place in the tree.
///
/// # Errors
/// The first primitive that is not finite, unless those are left out, or too many; or the build was cancelled.
pub(super) fn curve<I: Input>(
    input: &I,
    drop_non_finite: bool,
    watch: &Watch,
) -> Result<Curve, BuildError> {
    let keys = |grid: Grid| {
        gather(input, drop_non_finite, watch, 0, move |bounds, id| {
            grid.key(bounds, id)
        })
    };
    let grid = Grid::new(&input.around());
    let mut gathered = keys(grid)?;
    // Points that no primitive has are far away.
    if grid.excess(&gathered.bounds) > 2.0 && !gathered.all.is_empty() {
        gathered = keys(Grid::new(&gathered.bounds))?;
    }
    watch.phase(0.3, gathered.all.len())?;
    Ok(Curve {
        order: sorted(gathered.all),
        dropped: gathered.dropped,
        measure: gathered.bounds.measure(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        build::input::{Boxes, Triangles},
        geometry::{Aabb, TriangleMesh},
    };
    use glam::Vec3;

    #[test]
    fn the_curve_through_a_cube() {
        // All corners of a grid of 8 cells a side, last to first: sorted, each run of 8 is a small cube.
        let cell = |i: usize| [i >> 6, i >> 3 & 7, i & 7].map(|x| x as u32);
        let mut boxes: Vec<_> = (0..512)
            .rev()
            .map(|i| {
                let p = Vec3::from(cell(i).map(|x| x as f32)) / 8.0;
                Aabb::new(p, p)
            })
            .collect();
        let expected = |i: u32| {
            [2, 1, 0].map(|axis| (0..3).map(|bit| (i >> (3 * bit + axis) & 1) << bit).sum())
        };
        let expected: Vec<[u32; 3]> = (0..512).map(expected).collect();
        let cells = |boxes: &[Aabb]| {
            let curve = curve(&Boxes(boxes), true, &Watch::none()).unwrap();
            let cells = curve.order.iter().map(|&id| cell(511 - id as usize));
            (cells.collect::<Vec<_>>(), curve.dropped)
        };
        assert_eq!(cells(&boxes), (expected.clone(), 0));
        // What is left out is no part of the grid.
        boxes.push(Aabb::new(Vec3::ZERO, Vec3::splat(f32::INFINITY)));
        assert_eq!(cells(&boxes), (expected, 1));
    }

    /// A grid around points of which none is used would have all in one cell.
    #[test]
    fn unused_points_far_away() {
        let mut positions = std::vec![[1e30, -1e38, f32::MAX]];
        for i in (0..100).rev() {
            let x = i as f32;
            positions.extend([[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]]);
        }
        let indices: Vec<_> = (0..100)
            .map(|i| [3 * i + 1, 3 * i + 2, 3 * i + 3])
            .collect();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let curve = curve(&Triangles(&mesh), false, &Watch::none()).unwrap();
        assert!(curve.order.into_iter().eq((0..100).rev()));
    }
}
