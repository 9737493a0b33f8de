//! Many rays a call.

#[cfg(feature = "std")]
use super::compiled;
use super::{
    bundle::{self, Tightness},
    classes::{self, Patience},
    feed::{self, Feed},
    query::{AnyHit, ClosestHit, Query},
    wave::{self, Lane},
};
use crate::{
    geometry::{Hit, Ray},
    layout::{Bvh, Storage, TriangleLeaves, WideNode},
    simd::{Operation, Simd},
};
use core::{fmt, marker::PhantomData, mem::MaybeUninit};

/// Rays under way at a time where the memory is ours to choose.
const LANES: usize = 32;

/// As many rays are sorted out before those left over are interleaved.
const WINDOW: usize = feed::GROUPS * bundle::RAYS;

/// What `LANES` rays under way at a time are kept in, for batches on small stacks; 1 to 64 of them, some 2.4 KiB each.
///
/// It need not be cleared between batches, and fits any hierarchy of triangles.
pub struct Scratch<const LANES: usize>([MaybeUninit<Lane>; LANES]);

impl<const LANES: usize> Scratch<LANES> {
    /// Fresh memory: nothing is written.
    #[inline]
    pub const fn new() -> Self {
        const { assert!(0 < LANES && LANES <= wave::MOST_LANES, "1 to 64 lanes") };
        Self([const { MaybeUninit::uninit() }; LANES])
    }
}

impl<const LANES: usize> Default for Scratch<LANES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const LANES: usize> fmt::Debug for Scratch<LANES> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scratch").field("lanes", &LANES).finish()
    }
}

/// Batches. The answers are those of one ray a call, bit for bit, in the order of the rays, whatever that order is; where
/// `rays` and answers are not as many, the rest of the longer one is left alone.
///
/// Rays next to each other that start and go alike, such as the camera's by tiles, or shadow rays towards a light, go through
/// the tree side by side; others are interleaved, where the [backend](crate::simd::Backend) is faster so (AVX2 and AVX-512), and
/// else traced one after the other. Nobody need say which are which.
impl<N: WideNode, L: TriangleLeaves, S: Storage> Bvh<N, L, S> {
    /// The [closest hit](Self::closest_hit) of each ray. Takes up to 96 KiB of stack, where this crate is optimised.
    ///
    /// ```
    /// # use wide_bvh::{Builder, Ray, TriangleMesh};
    /// # let positions = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0_f32]];
    /// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2_u32]])?;
    /// # let bvh = Builder::new().build(&mesh)?;
    /// let rays: Vec<Ray> = (0..9).map(|i| Ray::new([0.2 * i as f32, 0.1, 0.0], [0.0, 0.0, 1.0])).collect();
    /// let mut hits = vec![None; rays.len()];
    /// bvh.closest_hits(&rays, &mut hits);
    /// assert_eq!(hits.iter().flatten().count(), 5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        #[cfg(feature = "std")]
        if Self::IS_BVH8 {
            return compiled::closest_hits(self.as_bvh8(), rays, hits);
        }
        trace::<N, L, S, ClosestHit>(self, rays, hits);
    }

    /// Whether [anything is in the way](Self::any_hit) of each ray. Takes up to 96 KiB of stack, where this crate is optimised.
    pub fn any_hits(&self, rays: &[Ray], occluded: &mut [bool]) {
        #[cfg(feature = "std")]
        if Self::IS_BVH8 {
            return compiled::any_hits(self.as_bvh8(), rays, occluded);
        }
        trace::<N, L, S, AnyHit>(self, rays, occluded);
    }

    /// As [`closest_hits`](Self::closest_hits), in the caller's memory and with hardly more stack than one ray
    /// takes. All rays are interleaved, `LANES` at a time, or else all are traced one after the other.
    pub fn closest_hits_in<const LANES: usize>(
        &self,
        scratch: &mut Scratch<LANES>,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) {
        self.backend().run(Wave::<N, L, S, ClosestHit, LANES> {
            bvh: self,
            rays,
            answers: hits,
            scratch,
        });
    }

    /// As [`any_hits`](Self::any_hits), in the caller's memory. See [`closest_hits_in`](Self::closest_hits_in).
    pub fn any_hits_in<const LANES: usize>(
        &self,
        scratch: &mut Scratch<LANES>,
        rays: &[Ray],
        occluded: &mut [bool],
    ) {
        self.backend().run(Wave::<N, L, S, AnyHit, LANES> {
            bvh: self,
            rays,
            answers: occluded,
            scratch,
        });
    }
}

/// Packets: as many rays side by side as an array holds, up to 64; 4 and 8 fill vectors.
impl<N: WideNode, L: TriangleLeaves, S: Storage> Bvh<N, L, S> {
    /// The [closest hit](Self::closest_hit) of each ray that `active` has a bit for, of the first for the lowest; `None` for
    /// the others.
    pub fn closest_hit_packet<const RAYS: usize>(
        &self,
        rays: &[Ray; RAYS],
        active: u64,
    ) -> [Option<Hit>; RAYS] {
        self.backend().run(Packet::<N, L, S, ClosestHit, RAYS> {
            bvh: self,
            rays,
            active,
            query: PhantomData,
        })
    }

    /// Whether [anything is in the way](Self::any_hit) of each ray that `active` has a bit for; `false` for the others.
    pub fn any_hit_packet<const RAYS: usize>(
        &self,
        rays: &[Ray; RAYS],
        active: u64,
    ) -> [bool; RAYS] {
        self.backend().run(Packet::<N, L, S, AnyHit, RAYS> {
            bvh: self,
            rays,
            active,
            query: PhantomData,
        })
    }
}

/// Rays of a task on a thread of its own: a few hundred microseconds.
#[cfg(feature = "rayon")]
const TASK: usize = 4096;

#[cfg(feature = "rayon")]
impl<N: WideNode, L: TriangleLeaves, S: Storage> Bvh<N, L, S>
where
    Self: Sync,
{
    /// [`closest_hits`](Self::closest_hits) on all threads of the current `rayon` pool.
    pub fn par_closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        use rayon::prelude::*;
        let tasks = rays.par_chunks(TASK).zip(hits.par_chunks_mut(TASK));
        tasks.for_each(|(rays, hits)| self.closest_hits(rays, hits));
    }

    /// [`any_hits`](Self::any_hits) on all threads of the current `rayon` pool.
    pub fn par_any_hits(&self, rays: &[Ray], occluded: &mut [bool]) {
        use rayon::prelude::*;
        let tasks = rays.par_chunks(TASK).zip(occluded.par_chunks_mut(TASK));
        tasks.for_each(|(rays, occluded)| self.any_hits(rays, occluded));
    }
}

/// As many rays as answers.
#[inline(always)]
fn paired<'a, A>(rays: &'a [Ray], answers: &'a mut [A]) -> (&'a [Ray], &'a mut [A]) {
    let count = rays.len().min(answers.len());
    (&rays[..count], &mut answers[..count])
}

/// Answers a batch.
#[inline(always)]
pub(super) fn trace<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
    bvh: &Bvh<N, L, S>,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) {
    let batch = Batch::<N, L, S, Q> { bvh, rays, answers };
    bvh.backend().run(batch);
}

/// Bundles of the rays that are alike, and waves of what lies between.
struct Batch<'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> {
    bvh: &'a Bvh<N, L, S>,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
}

impl<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> Operation for Batch<'_, N, L, S, Q> {
    type Output = ();

    #[inline(always)]
    fn run<T: Simd>(self, token: T) {
        let bvh = self.bvh;
        let (rays, answers) = paired(self.rays, self.answers);
        let mut patience = Patience::default();
        for (rays, answers) in rays.chunks(WINDOW).zip(answers.chunks_mut(WINDOW)) {
            let mut waiting = [0; feed::GROUPS];
            let groups = rays
                .chunks(bundle::RAYS)
                .zip(answers.chunks_mut(bundle::RAYS));
            for (waiting, (rays, answers)) in waiting.iter_mut().zip(groups) {
                *waiting =
                    classes::trace::<T, N, L, S, Q>(token, bvh, rays, answers, &mut patience);
            }
            // By a call, as bundles are: what those need of registers is not taken from waves.
            bvh.backend().call(Rest::<N, L, S, Q> {
                bvh,
                rays,
                answers,
                waiting: &waiting,
            });
        }
    }
}

/// The rays of a window that `waiting` has bits for.
struct Rest<'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> {
    bvh: &'a Bvh<N, L, S>,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    waiting: &'a [u64; feed::GROUPS],
}

impl<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> Operation for Rest<'_, N, L, S, Q> {
    type Output = ();

    #[inline(always)]
    fn run<T: Simd>(self, token: T) {
        let Scratch(mut lanes) = Scratch::<LANES>::new();
        trace_rest::<T, N, L, S, Q, LANES>(
            token,
            self.bvh,
            self.rays,
            self.answers,
            self.waiting,
            &mut lanes,
        );
    }
}

/// Traces the rays that `waiting` has bits for: in waves, if they are of use.
#[inline(always)]
fn trace_rest<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query, const LANES: usize>(
    token: T,
    bvh: &Bvh<N, L, S>,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    waiting: &[u64; feed::GROUPS],
    lanes: &mut [MaybeUninit<Lane>; LANES],
) {
    if T::INTERLEAVES {
        let mut feed = Feed::<N, L, S, Q>::new(bvh, rays, answers, waiting);
        wave::trace(token, bvh, &mut feed, lanes);
        return;
    }
    let groups = rays
        .chunks(bundle::RAYS)
        .zip(answers.chunks_mut(bundle::RAYS));
    for ((rays, answers), &waiting) in groups.zip(waiting) {
        for place in classes::places(waiting) {
            if let (Some(ray), Some(answer)) = (rays.get(place), answers.get_mut(place)) {
                *answer = Q::one(bvh, ray);
            }
        }
    }
}

/// Waves alone.
struct Wave<'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query, const LANES: usize> {
    bvh: &'a Bvh<N, L, S>,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    scratch: &'a mut Scratch<LANES>,
}

impl<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query, const LANES: usize> Operation
    for Wave<'_, N, L, S, Q, LANES>
{
    type Output = ();

    #[inline(always)]
    fn run<T: Simd>(self, token: T) {
        let (rays, answers) = paired(self.rays, self.answers);
        for (rays, answers) in rays.chunks(WINDOW).zip(answers.chunks_mut(WINDOW)) {
            let all = [u64::MAX; feed::GROUPS];
            let lanes = &mut self.scratch.0;
            trace_rest::<T, N, L, S, Q, LANES>(token, self.bvh, rays, answers, &all, lanes);
        }
    }
}

/// One bundle, or if the rays are not alike one after the other.
struct Packet<'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query, const RAYS: usize> {
    bvh: &'a Bvh<N, L, S>,
    rays: &'a [Ray; RAYS],
    active: u64,
    query: PhantomData<Q>,
}

impl<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query, const RAYS: usize> Operation
    for Packet<'_, N, L, S, Q, RAYS>
{
    type Output = [Q::Answer; RAYS];

    #[inline(always)]
    fn run<T: Simd>(self, token: T) -> [Q::Answer; RAYS] {
        const { assert!(0 < RAYS && RAYS <= bundle::RAYS) };
        // The active ones, and where they come from.
        let (mut rays, mut lanes, mut count) = ([self.rays[0]; RAYS], [0; RAYS], 0);
        for (lane, ray) in self.rays.iter().enumerate() {
            if self.active >> lane & 1 != 0 {
                (rays[count], lanes[count]) = (*ray, lane);
                count += 1;
            }
        }
        let (rays, mut found) = (&rays[..count], [Q::MISS; RAYS]);
        let out = &mut found[..count];
        let outcome = if RAYS <= 8 {
            bundle::trace_eight::<T, N, L, S, Q>(token, self.bvh, rays, out)
        } else {
            let before = &mut Tightness::default();
            bundle::trace::<N, L, S, Q>(self.bvh, rays, out, before)
        };
        if !outcome.is_traced() {
            for (ray, answer) in rays.iter().zip(&mut found) {
                *answer = Q::one(self.bvh, ray);
            }
        }
        let mut answers = [Q::MISS; RAYS];
        for (&lane, &answer) in lanes[..count].iter().zip(&found) {
            answers[lane] = answer;
        }
        answers
    }
}
