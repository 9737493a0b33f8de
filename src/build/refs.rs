//! References to primitives, as the top-down build sorts them: a box and a number in 32 bytes.

use super::{
    BuildError,
    cost::Measure,
    input::{Input, Verdict},
    monitor::Watch,
};
use crate::geometry::{Aabb, TriangleMesh};
use glam::Vec3A;
use std::{vec, vec::Vec};
use wide::f32x4;

/// A primitive's box, scaled by the scene's [`Measure`], and its number.
///
/// Each half is a vector; the number is the fourth lane of `max`, offset so that as a float it is an
/// ordinary one: arithmetic on all four lanes is then never slowed down by denormals.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Ref {
    min: f32x4,
    max: f32x4,
}

/// 2^-63 as bits. With numbers below 2^30 it makes floats of up to 2^65.
const NUMBER_OFFSET: u32 = 0x2000_0000;
const _: () = assert!(TriangleMesh::MAX_TRIANGLES <= 1 << 30);

impl Ref {
    pub const NONE: Self = Self {
        min: f32x4::ZERO,
        max: f32x4::ZERO,
    };

    #[inline]
    pub fn new(aabb: &Aabb, id: u32) -> Self {
        let Aabb { min, max } = *aabb;
        Self {
            min: f32x4::new([min.x, min.y, min.z, 0.0]),
            max: f32x4::new([max.x, max.y, max.z, f32::from_bits(id + NUMBER_OFFSET)]),
        }
    }

    /// The primitive's number.
    #[inline]
    pub fn id(&self) -> u32 {
        self.max.to_array()[3].to_bits().wrapping_sub(NUMBER_OFFSET)
    }

    #[inline(always)]
    pub fn bounds(&self) -> Bounds {
        Bounds {
            min: self.min,
            max: self.max,
        }
    }

    /// Twice the center of the box; the fourth lane is of no meaning.
    #[inline(always)]
    pub fn center2(&self) -> f32x4 {
        self.min + self.max
    }

    #[inline]
    pub fn scaled(self, scale: f32) -> Self {
        // A number is no length.
        let scale = f32x4::new([scale, scale, scale, 1.0]);
        Self {
            min: self.min * scale,
            max: self.max * scale,
        }
    }
}

/// A box of vectors; the fourth lanes are of no meaning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub min: f32x4,
    pub max: f32x4,
}

impl Bounds {
    // Finite, so that sums in lanes of no meaning make no NaN.
    pub const EMPTY: Self = Self {
        min: f32x4::splat(f32::MAX),
        max: f32x4::splat(f32::MIN),
    };

    #[inline(always)]
    pub fn join(self, other: Self) -> Self {
        Self {
            min: self.min.fast_min(other.min),
            max: self.max.fast_max(other.max),
        }
    }

    #[inline(always)]
    pub fn join_point(self, p: f32x4) -> Self {
        self.join(Self { min: p, max: p })
    }

    /// Of what is not empty.
    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        let [x, y, z, _] = (self.max - self.min).to_array();
        x * y + (x + y) * z
    }
}

/// Half the areas of three boxes that are not empty, one a lane; the fourth is of no meaning.
#[inline(always)]
pub(super) fn half_areas([a, b, c]: [Bounds; 3]) -> f32x4 {
    let sizes = [a.max - a.min, b.max - b.min, c.max - c.min, f32x4::ZERO];
    let [x, y, z, _] = f32x4::transpose(sizes);
    x * y + (x + y) * z
}

/// References to all primitives that have a place in the tree, and what was left out.
pub(super) struct Refs {
    pub refs: Vec<Ref>,
    pub dropped: usize,
    scale: f32,
}

/// What a run of primitives came to.
#[derive(Clone, Copy)]
struct Gathered {
    kept: usize,
    dropped: usize,
    largest: f32,
}

/// The share of a build that this is.
const GATHERED: f32 = 0.02;
/// How many primitives are gathered in one go.
const CHUNK: usize = 1 << 14;

impl Refs {
    /// Looks at every primitive, in parallel, and finds the scene's unit.
    ///
    /// # Errors
    /// The first primitive that is not finite, unless those are left out, or too many.
    pub fn gather<I: Input>(
        input: &I,
        drop_non_finite: bool,
        watch: &Watch,
    ) -> Result<Self, BuildError> {
        if input.len() > TriangleMesh::MAX_TRIANGLES {
            return Err(BuildError::TooManyPrimitives(input.len()));
        }
        watch.phase(GATHERED, input.len())?;
        let mut refs = vec![Ref::NONE; input.len()];
        let gather = |(chunk, refs): (usize, &mut [Ref])| {
            watch.advance(refs.len());
            gather_chunk(input, chunk * CHUNK, refs, drop_non_finite)
        };
        #[cfg(feature = "rayon")]
        let gathered: Vec<_> = {
            use rayon::prelude::*;
            refs.par_chunks_mut(CHUNK).enumerate().map(gather).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let gathered: Vec<_> = refs.chunks_mut(CHUNK).enumerate().map(gather).collect();

        // Close the gaps that primitives left out have left at the chunks' ends.
        let (mut kept, mut dropped, mut largest) = (0, 0, 0.0);
        for (chunk, gathered) in gathered.into_iter().enumerate() {
            let gathered: Gathered = gathered?;
            let start = chunk * CHUNK;
            if start != kept {
                refs.copy_within(start..start + gathered.kept, kept);
            }
            kept += gathered.kept;
            dropped += gathered.dropped;
            largest = gathered.largest.max(largest);
        }
        refs.truncate(kept);

        let scale = Measure::new(largest).scale();
        for r in &mut refs {
            *r = r.scaled(scale);
        }
        Ok(Self {
            refs,
            dropped,
            scale,
        })
    }

    /// What boxes are scaled by: a power of two.
    pub fn scale(&self) -> f32 {
        self.scale
    }
}

/// Fills the front of `refs` with the primitives that are kept, of those from `start` on.
fn gather_chunk<I: Input>(
    input: &I,
    start: usize,
    refs: &mut [Ref],
    drop_non_finite: bool,
) -> Result<Gathered, BuildError> {
    let mut gathered = Gathered {
        kept: 0,
        dropped: 0,
        largest: 0.0,
    };
    let mut largest = Vec3A::ZERO;
    for id in start..start + refs.len() {
        match input.verdict(id as u32) {
            Verdict::Keep(aabb) => {
                let (min, max) = (Vec3A::from(aabb.min), Vec3A::from(aabb.max));
                largest = largest.max(min.abs()).max(max.abs());
                refs[gathered.kept] = Ref::new(&aabb, id as u32);
                gathered.kept += 1;
            }
            Verdict::Unhittable => {}
            Verdict::NonFinite(_) if drop_non_finite => gathered.dropped += 1,
            Verdict::NonFinite(error) | Verdict::Invalid(error) => return Err(error),
        }
    }
    gathered.largest = largest.max_element();
    Ok(gathered)
}
