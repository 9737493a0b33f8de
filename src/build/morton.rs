//! References in the order of a space-filling curve: neighbours along it are neighbours in space.
//!
//! Morton (1966); as the start of a build: Lauterbach et al., "Fast BVH construction on GPUs" (2009).

use super::{
    binned::bounds_of_centers,
    monitor::{STRIDE, Watch},
    refs::Ref,
};
use std::{vec, vec::Vec};
use wide::f32x4;

/// Bits of a code along each axis, and of a digit of the sort.
const BITS: u32 = 11;
const CELLS: usize = 1 << BITS;
const DIGITS: usize = 3;
/// The bits below the code: a place among the references, of which there are fewer than 2^30.
const PLACE_BITS: u32 = 30;

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

/// The places of `refs` along the curve through the centers of their boxes.
pub(super) fn order(refs: &[Ref], watch: &Watch) -> Vec<u32> {
    let centers = bounds_of_centers(refs);
    let size = (centers.max - centers.min).to_array();
    // A little less than all cells, so that what is on the far bound is in the last. Centers as close as 1e-30 are
    // one point to a scene whose size is about 1.
    let scale = [0, 1, 2].map(|axis| match size[axis] > 1e-30 {
        true => CELLS as f32 * 0.9999 / size[axis],
        false => 0.0,
    });
    let scale = f32x4::new([scale[0], scale[1], scale[2], 0.0]);
    let key = |r: &Ref| {
        let cells = ((r.center2() - centers.min) * scale).fast_trunc_int();
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let cell = cells.to_array()[axis] as usize & (CELLS - 1);
            u64::from(SPREAD[cell])
        });
        (x << 2 | y << 1 | z) << PLACE_BITS
    };
    let mut keys = Vec::with_capacity(refs.len());
    for (run, first) in refs.chunks(STRIDE).zip((0..).step_by(STRIDE)) {
        keys.extend(run.iter().zip(first..).map(|(r, place)| key(r) | place));
        watch.advance(run.len());
    }
    sort(&mut keys);
    keys.iter()
        .map(|key| *key as u32 & ((1 << PLACE_BITS) - 1))
        .collect()
}

/// Sorts keys, no two of which are the same, and which are in order below the code.
fn sort(keys: &mut Vec<u64>) {
    #[cfg(feature = "rayon")]
    if rayon::current_num_threads() > 3 {
        use rayon::slice::ParallelSliceMut;
        keys.par_sort_unstable();
        return;
    }
    let digit =
        |key: u64, digit: usize| (key >> (PLACE_BITS + BITS * digit as u32)) as usize & (CELLS - 1);
    let mut counts = [[0u32; CELLS]; DIGITS];
    for &key in keys.iter() {
        for (place, counts) in counts.iter_mut().enumerate() {
            counts[digit(key, place)] += 1;
        }
    }
    let mut sorted = vec![0; keys.len()];
    for (place, counts) in counts.iter_mut().enumerate() {
        let mut next = 0;
        for count in counts.iter_mut() {
            next += core::mem::replace(count, next);
        }
        for &key in keys.iter() {
            let count = &mut counts[digit(key, place)];
            sorted[*count as usize] = key;
            *count += 1;
        }
        core::mem::swap(keys, &mut sorted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use glam::Vec3;

    #[test]
    fn the_curve_through_a_cube() {
        // All corners of a grid of 8 cells a side, last to first: sorted, each run of 8 is a small cube.
        let refs: Vec<_> = (0..512u32)
            .rev()
            .map(|i| {
                let p = Vec3::new((i >> 6) as f32, (i >> 3 & 7) as f32, (i & 7) as f32) / 8.0;
                Ref::new(&Aabb::new(p, p), i)
            })
            .collect();
        let order = order(&refs, &Watch::none());
        let cell = |&place: &u32| {
            let [x, y, z, _] = (refs[place as usize].center2() * f32x4::splat(4.0)).to_array();
            [x, y, z].map(|x| x as u32)
        };
        let expected = |i: u32| {
            [2, 1, 0].map(|axis| (0..3).map(|bit| (i >> (3 * bit + axis) & 1) << bit).sum())
        };
        let cells: Vec<_> = order.iter().map(cell).collect();
        let expected: Vec<[u32; 3]> = (0..512).map(expected).collect();
        assert_eq!(cells, expected);
    }
}
