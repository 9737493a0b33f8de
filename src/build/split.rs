//! Where to cut a run of references in two: bins of equal width along each axis, the surface area
//! heuristic at every boundary between them.
//!
//! Wald, "On fast construction of SAH-based bounding volume hierarchies" (2007).

use super::refs::{Bounds, Ref};
use wide::f32x4;

/// The most bins an axis is cut into.
const MAX_BINS: usize = 32;
/// So many references are binned in one go where many cores share the work.
#[cfg(feature = "rayon")]
const CHUNK: usize = 1 << 14;

/// Which bin a reference is in, by the bounds of all twice-centers.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    origin: f32x4,
    scale: f32x4,
    bins: usize,
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
            bins,
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
struct Bins {
    bounds: [[Bounds; 3]; MAX_BINS],
    counts: [[u32; 3]; MAX_BINS],
}

impl Bins {
    const EMPTY: Self = Self {
        bounds: [[Bounds::EMPTY; 3]; MAX_BINS],
        counts: [[0; 3]; MAX_BINS],
    };

    fn fill(&mut self, grid: &Grid, refs: &[Ref]) {
        for r in refs {
            let bounds = r.bounds();
            let bins = grid.bins(r.center2());
            for (axis, &bin) in bins[..3].iter().enumerate() {
                // The mask changes nothing; it shows that the bin is there.
                let bin = bin as usize & (MAX_BINS - 1);
                let place = &mut self.bounds[bin][axis];
                *place = place.join(bounds);
                self.counts[bin][axis] += 1;
            }
        }
    }

    /// Joins what is in another's bins. Neither order nor grouping of such joins shows in the result.
    #[cfg(feature = "rayon")]
    fn join(mut self: std::boxed::Box<Self>, other: &Self) -> std::boxed::Box<Self> {
        for bin in 0..MAX_BINS {
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
}

impl Cut {
    /// The cheapest cut, or `None` if all centers are in one place.
    pub fn find(refs: &[Ref], centers: &Bounds) -> Option<Self> {
        // Few references need few bins: there is as much work in a bin as in some references.
        let bins = if refs.len() < 256 {
            MAX_BINS / 2
        } else {
            MAX_BINS
        };
        let grid = Grid::new(centers, bins);
        #[cfg(feature = "rayon")]
        if refs.len() > 4 * CHUNK {
            use rayon::prelude::*;
            use std::boxed::Box;
            let filled = |refs: &[Ref]| {
                let mut bins = Box::new(Bins::EMPTY);
                bins.fill(&grid, refs);
                bins
            };
            let bins = refs
                .par_chunks(CHUNK)
                .map(filled)
                .reduce(|| Box::new(Bins::EMPTY), |a, b| a.join(&b));
            return grid.cheapest(&bins);
        }
        let mut bins = Bins::EMPTY;
        bins.fill(&grid, refs);
        grid.cheapest(&bins)
    }

    /// Whether a reference is left of the cut.
    pub fn is_left(&self, r: &Ref) -> bool {
        self.grid.bins(r.center2())[self.axis] < self.bin
    }

    /// Sorts `refs` into those left and right of the cut: how many are left, and the bounds of either
    /// side's twice-centers.
    pub fn partition(&self, refs: &mut [Ref]) -> (usize, Bounds, Bounds) {
        let (mut left, mut right) = (Bounds::EMPTY, Bounds::EMPTY);
        let (mut start, mut end) = (0, refs.len());
        while start < end {
            let center2 = refs[start].center2();
            if self.grid.bins(center2)[self.axis] < self.bin {
                left = left.join_point(center2);
                start += 1;
            } else {
                right = right.join_point(center2);
                end -= 1;
                refs.swap(start, end);
            }
        }
        (start, left, right)
    }
}

impl Grid {
    fn cheapest(&self, bins: &Bins) -> Option<Cut> {
        // Cost, then how uneven it is: where areas are all zero, halves keep the tree shallow.
        let mut best = (f32::INFINITY, u32::MAX);
        let mut cut = None;
        for axis in 0..3 {
            if self.scale.to_array()[axis] == 0.0 {
                continue;
            }
            // What the right side of a cut before each bin comes to.
            let mut right = [(0.0, 0); MAX_BINS];
            let (mut bounds, mut count) = (Bounds::EMPTY, 0);
            for bin in (1..self.bins).rev() {
                bounds = bounds.join(bins.bounds[bin][axis]);
                count += bins.counts[bin][axis];
                if count > 0 {
                    right[bin] = (bounds.half_area() * count as f32, count);
                }
            }
            let (mut bounds, mut count) = (Bounds::EMPTY, 0);
            for (bin, &(right_cost, right_count)) in right[..self.bins].iter().enumerate().skip(1) {
                bounds = bounds.join(bins.bounds[bin - 1][axis]);
                count += bins.counts[bin - 1][axis];
                if count == 0 || right_count == 0 {
                    continue;
                }
                let cost = bounds.half_area() * count as f32 + right_cost;
                let key = (cost, count.abs_diff(right_count));
                if key < best {
                    best = key;
                    cut = Some(Cut {
                        grid: *self,
                        axis,
                        bin: bin as i32,
                    });
                }
            }
        }
        cut
    }
}
