//! Where to cut a run of references in two: bins of equal width along each axis, the surface area
//! heuristic at every boundary between them.
//!
//! Wald, "On fast construction of SAH-based bounding volume hierarchies" (2007).

use super::refs::{Bounds, Ref, half_areas};
use std::vec::Vec;
use wide::{f32x4, i32x4};

/// So many references are binned in one go where many cores share the work.
#[cfg(feature = "rayon")]
const CHUNK: usize = 1 << 14;

/// Which bin a reference is in, by the bounds of all twice-centers.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    origin: f32x4,
    scale: f32x4,
}

impl Grid {
    fn new(centers: &Bounds, bins: usize) -> Self {
        let size = (centers.max - centers.min).to_array();
        let scale = |axis: usize| {
            // Centers as close as this are one point to a scene whose size is about 1. It keeps the
            // quotient finite, too.
            if size[axis] > 1e-30 {
                // A little less than all bins, so that what is on the far bound is in the last.
                (bins as f32 * 0.9999) / size[axis]
            } else {
                0.0
            }
        };
        Self {
            origin: centers.min,
            scale: f32x4::new([scale(0), scale(1), scale(2), 0.0]),
        }
    }

    /// The bin by axis. The fourth is of no meaning.
    #[inline(always)]
    fn bins(&self, center2: f32x4) -> [i32; 4] {
        ((center2 - self.origin) * self.scale)
            .fast_trunc_int()
            .to_array()
    }
}

/// What is in the bins.
#[derive(Clone)]
struct Bins<const B: usize> {
    bounds: [[Bounds; 3]; B],
    counts: [[u32; 4]; B],
}

impl<const B: usize> Bins<B> {
    const EMPTY: Self = Self {
        bounds: [[Bounds::EMPTY; 3]; B],
        counts: [[0; 4]; B],
    };

    #[inline(always)]
    fn fill(&mut self, grid: &Grid, refs: &[Ref]) {
        for r in refs {
            let bounds = r.bounds();
            let bins = grid.bins(r.center2());
            for (axis, &bin) in bins[..3].iter().enumerate() {
                // The mask changes nothing; it shows that the bin is there.
                let bin = bin as usize & (B - 1);
                let place = &mut self.bounds[bin][axis];
                *place = place.join(bounds);
                self.counts[bin][axis] += 1;
            }
        }
    }

    /// Joins what is in another's bins. Neither order nor grouping of such joins shows in the result.
    #[cfg(feature = "rayon")]
    fn join(mut self: std::boxed::Box<Self>, other: &Self) -> std::boxed::Box<Self> {
        for bin in 0..B {
            for axis in 0..3 {
                self.bounds[bin][axis] = self.bounds[bin][axis].join(other.bounds[bin][axis]);
                self.counts[bin][axis] += other.counts[bin][axis];
            }
        }
        self
    }
}

/// A cut between two bins.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    grid: Grid,
    axis: usize,
    /// The first bin of the right side.
    bin: i32,
    /// How many are left.
    left: usize,
}

impl Cut {
    /// The cheapest cut, or `None` if all centers are in one place.
    #[inline(always)]
    pub fn find(refs: &[Ref], centers: &Bounds) -> Option<Self> {
        // Few references need few bins: there is as much work in a bin as in some references.
        match refs.len() {
            0..256 => Self::find_in::<16>(refs, centers),
            _ => Self::find_in::<32>(refs, centers),
        }
    }

    /// The cheapest of the cuts between `B` bins, a power of two.
    #[inline(always)]
    fn find_in<const B: usize>(refs: &[Ref], centers: &Bounds) -> Option<Self> {
        let grid = Grid::new(centers, B);
        #[cfg(feature = "rayon")]
        if refs.len() > 4 * CHUNK {
            use rayon::prelude::*;
            use std::boxed::Box;
            let filled = |refs: &[Ref]| {
                let mut bins = Box::new(Bins::<B>::EMPTY);
                bins.fill(&grid, refs);
                bins
            };
            let bins = refs
                .par_chunks(CHUNK)
                .map(filled)
                .reduce(|| Box::new(Bins::EMPTY), |a, b| a.join(&b));
            return grid.cheapest(&bins);
        }
        let mut bins = Bins::<B>::EMPTY;
        bins.fill(&grid, refs);
        grid.cheapest(&bins)
    }

    /// Whether a reference is left of the cut.
    #[inline(always)]
    pub fn is_left(&self, r: &Ref) -> bool {
        self.grid.bins(r.center2())[self.axis] < self.bin
    }

    /// Sorts `refs`, of which the cut was found, into those left of it and the others: how many are left, and the bounds of
    /// either side's twice-centers.
    ///
    /// Either side keeps its order: what lies together in a mesh is read together later. Which side is a toss-up: all is
    /// done for both, and no branch is taken.
    #[inline(always)]
    pub fn partition(&self, refs: &mut [Ref]) -> (usize, Bounds, Bounds) {
        // One more, to write to in vain once all are there. Room for all of them would be pages never seen before: 4 % of an
        // abyss's build.
        let mut others = Vec::with_capacity(refs.len() - self.left + 1);
        let room = others.spare_capacity_mut();
        let (mut left_centers, mut other_centers) = (Bounds::EMPTY, Bounds::EMPTY);
        let mut left = 0;
        for place in 0..refs.len() {
            let r = refs[place];
            let is_left = self.is_left(&r);
            let mask = f32x4::splat(f32::from_bits(0u32.wrapping_sub(u32::from(is_left))));
            let center2 = r.center2();
            left_centers = left_centers.join(Bounds {
                min: mask.select(center2, Bounds::EMPTY.min),
                max: mask.select(center2, Bounds::EMPTY.max),
            });
            other_centers = other_centers.join(Bounds {
                min: mask.select(Bounds::EMPTY.min, center2),
                max: mask.select(Bounds::EMPTY.max, center2),
            });
            refs[left] = r;
            room[place - left].write(r);
            left += usize::from(is_left);
        }
        // SAFETY: each place below the length was written, by an index that was checked, before it was left behind.
        unsafe { others.set_len(refs.len() - left) };
        refs[left..].copy_from_slice(&others);
        (left, left_centers, other_centers)
    }
}

impl Grid {
    #[inline(always)]
    fn cheapest<const B: usize>(&self, bins: &Bins<B>) -> Option<Cut> {
        let join = |all: &mut [Bounds; 3], bin: &[Bounds; 3]| {
            *all = [0, 1, 2].map(|axis| all[axis].join(bin[axis]));
        };
        // What the right side of a cut before each bin comes to: an axis a lane.
        let mut right_costs = [f32x4::ZERO; B];
        let mut right_counts = [[0; 4]; B];
        let (mut bounds, mut counts) = ([Bounds::EMPTY; 3], [0; 4]);
        for bin in (1..B).rev() {
            join(&mut bounds, &bins.bounds[bin]);
            add(&mut counts, &bins.counts[bin]);
            right_counts[bin] = counts;
            right_costs[bin] = half_areas(bounds) * floats(counts);
        }
        // By axis, the cost, and then how uneven it is: where areas are all zero, halves keep the tree shallow.
        let mut best = [((f32::INFINITY, u32::MAX), 0, 0); 3];
        let mut least = f32x4::splat(f32::INFINITY);
        let (mut bounds, mut counts) = ([Bounds::EMPTY; 3], [0; 4]);
        for bin in 1..B {
            join(&mut bounds, &bins.bounds[bin - 1]);
            add(&mut counts, &bins.counts[bin - 1]);
            let costs = half_areas(bounds) * floats(counts) + right_costs[bin];
            if costs.simd_le(least).to_bitmask() & 7 == 0 {
                continue;
            }
            let costs = costs.to_array();
            for (axis, best) in best.iter_mut().enumerate() {
                let (left, right) = (counts[axis], right_counts[bin][axis]);
                let key = (costs[axis], left.abs_diff(right));
                if left > 0 && right > 0 && key < best.0 {
                    *best = (key, bin, left);
                }
            }
            least = f32x4::new([best[0].0.0, best[1].0.0, best[2].0.0, f32::NEG_INFINITY]);
        }
        let scale = self.scale.to_array();
        let mut cheapest = (f32::INFINITY, u32::MAX);
        let mut cut = None;
        for (axis, (key, bin, left)) in best.into_iter().enumerate() {
            if scale[axis] > 0.0 && key < cheapest {
                cheapest = key;
                cut = Some(Cut {
                    grid: *self,
                    axis,
                    bin: bin as i32,
                    left: left as usize,
                });
            }
        }
        cut
    }
}

fn add(all: &mut [u32; 4], counts: &[u32; 4]) {
    for (all, count) in all.iter_mut().zip(counts) {
        *all += count;
    }
}

/// Counts as floats: they are less than 2^31.
#[inline(always)]
fn floats(counts: [u32; 4]) -> f32x4 {
    f32x4::from_i32x4(i32x4::new(counts.map(|count| count as i32)))
}
