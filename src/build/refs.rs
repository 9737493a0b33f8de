//! References to primitives, as the top-down build sorts them: a box and a number in 32 bytes.

use super::{
    BuildError,
    cost::Measure,
    input::{Input, Verdict},
    monitor::Watch,
    pages, parallel,
};
use crate::{
    geometry::{Aabb, TriangleMesh},
    simd::{Backend, Operation, Simd},
};
use glam::Vec3;
use std::vec::Vec;
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
    pub fn new(bounds: &Bounds, id: u32) -> Self {
        let [x, y, z, _] = bounds.max.to_array();
        Self {
            min: bounds.min,
            max: f32x4::new([x, y, z, f32::from_bits(id + NUMBER_OFFSET)]),
        }
    }

    /// The primitive's number.
    #[inline]
    pub fn id(&self) -> u32 {
        self.max.to_array()[3].to_bits().wrapping_sub(NUMBER_OFFSET)
    }

    /// The same box of another number.
    pub fn with_id(&self, id: u32) -> Self {
        Self::new(&self.bounds(), id)
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

    #[inline(always)]
    pub fn of(&Aabb { min, max }: &Aabb) -> Self {
        Self {
            min: f32x4::new([min.x, min.y, min.z, 0.0]),
            max: f32x4::new([max.x, max.y, max.z, 0.0]),
        }
    }

    /// The unit of a scene of these bounds.
    pub fn measure(&self) -> Measure {
        // The fourth lanes are of no meaning, and those of what is empty neither.
        let [x, y, z, _] = self.min.abs().fast_max(self.max.abs()).to_array();
        match self.min.simd_le(self.max).to_bitmask() & 7 {
            7 => Measure::new(x.max(y).max(z)),
            _ => Measure::new(0.0),
        }
    }

    /// The sum turns -0.0 into 0.0, so that the order of joins never shows.
    #[inline(always)]
    pub fn aabb(&self) -> Aabb {
        let [x0, y0, z0, _] = (self.min + f32x4::ZERO).to_array();
        let [x1, y1, z1, _] = (self.max + f32x4::ZERO).to_array();
        Aabb::new(Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1))
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
        let gathered = gather(input, drop_non_finite, watch, Ref::NONE, Ref::new)?;
        let scale = gathered.bounds.measure().scale();
        let mut refs = gathered.all;
        parallel::map(refs.chunks_mut(CHUNK), |refs| {
            for r in refs {
                *r = r.scaled(scale);
            }
        });
        Ok(Self {
            refs,
            dropped: gathered.dropped,
            scale,
        })
    }

    /// What boxes are scaled by: a power of two.
    pub fn scale(&self) -> f32 {
        self.scale
    }
}

/// What was made of primitives.
pub(super) struct Gathered<T> {
    /// Of each that has a place in the tree, in their order.
    pub all: Vec<T>,
    /// How many are not finite and were left out.
    pub dropped: usize,
    /// Around all.
    pub bounds: Bounds,
}

/// Looks at every primitive, in parallel, and makes something of those that have a place in the tree.
///
/// # Errors
/// The first primitive that is not finite, unless those are left out, or too many.
pub(super) fn gather<I: Input, T: Copy + Send>(
    input: &I,
    drop_non_finite: bool,
    watch: &Watch,
    none: T,
    make: impl Fn(&Bounds, u32) -> T + Sync,
) -> Result<Gathered<T>, BuildError> {
    if input.len() > TriangleMesh::MAX_TRIANGLES {
        return Err(BuildError::TooManyPrimitives(input.len()));
    }
    watch.phase(GATHERED, input.len())?;
    let mut all = pages::filled(none, input.len());
    let backend = Backend::detect();
    let gather = |(chunk, all): (usize, &mut [T])| {
        watch.advance(all.len());
        backend.run(GatherChunk {
            input,
            start: chunk * CHUNK,
            all,
            drop_non_finite,
            make: &make,
        })
    };
    let gathered = parallel::map(all.chunks_mut(CHUNK).enumerate(), gather);

    // Close the gaps that primitives left out have left at the chunks' ends.
    let (mut kept, mut dropped, mut bounds) = (0, 0, Bounds::EMPTY);
    for (chunk, gathered) in gathered.into_iter().enumerate() {
        let gathered: Chunk = gathered?;
        let start = chunk * CHUNK;
        if start != kept {
            all.copy_within(start..start + gathered.kept, kept);
        }
        kept += gathered.kept;
        dropped += gathered.dropped;
        bounds = bounds.join(gathered.bounds);
    }
    all.truncate(kept);
    Ok(Gathered {
        all,
        dropped,
        bounds,
    })
}

/// What a run of primitives came to.
#[derive(Clone, Copy)]
struct Chunk {
    kept: usize,
    dropped: usize,
    bounds: Bounds,
}

/// Fills the front of `all` with what is made of primitives that are kept, of those from `start` on.
struct GatherChunk<'a, I, T, F> {
    input: &'a I,
    start: usize,
    all: &'a mut [T],
    drop_non_finite: bool,
    make: &'a F,
}

impl<I: Input, T, F: Fn(&Bounds, u32) -> T> Operation for GatherChunk<'_, I, T, F> {
    type Output = Result<Chunk, BuildError>;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Self::Output {
        let Self {
            input,
            start,
            all,
            drop_non_finite,
            make,
        } = self;
        let mut chunk = Chunk {
            kept: 0,
            dropped: 0,
            bounds: Bounds::EMPTY,
        };
        for id in start..start + all.len() {
            match input.verdict(id as u32) {
                Verdict::Keep(bounds) => {
                    chunk.bounds = chunk.bounds.join(bounds);
                    all[chunk.kept] = make(&bounds, id as u32);
                    chunk.kept += 1;
                }
                Verdict::Unhittable => {}
                Verdict::NonFinite(_) if drop_non_finite => chunk.dropped += 1,
                Verdict::NonFinite(error) | Verdict::Invalid(error) => return Err(error),
            }
        }
        Ok(chunk)
    }
}
