//! Rays on their way to the lanes of a wave, and the answers back.
//!
//! Rays are made ready eight at a time, a ray a lane of vectors, which is much less work than one by one. Those that are
//! out of the ordinary, because they hit nothing, have to be scaled or are too far away, are answered at once.

use super::{query::Query, ray_lanes::RayLanes, triangles::Found};
use crate::{
    geometry::Ray,
    layout::{Bvh, Storage, TriangleLeaves, WideNode},
    primitive::triangle::bits,
    simd::{Operation, Simd},
    slab::{NarrowRay, PreparedRay},
};
use bytemuck::Zeroable;

/// The most runs of 64 rays.
pub(super) const GROUPS: usize = 256;

/// How many rays are made ready at a time.
const READY: usize = 8;

/// Rays to be traced.
pub(super) struct Feed<'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> {
    bvh: &'a Bvh<N, L, S>,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
    /// For each run of 64 rays a bit for each to be traced.
    waiting: &'a [u64; GROUPS],
    /// The run that is made ready now, and those of it that are left.
    group: usize,
    left: u64,
    /// What is ready, the caller's numbers of it, and a bit for each that is still to start.
    ready: [NarrowRay; READY],
    indices: [usize; READY],
    to_start: u32,
}

impl<'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> Feed<'a, N, L, S, Q> {
    /// Those `rays` that `waiting` has a bit for, the first 64 in its first number and so on. There are as many as
    /// `answers`. Bits past the last ray are passed over.
    #[inline(always)]
    pub(super) fn new(
        bvh: &'a Bvh<N, L, S>,
        rays: &'a [Ray],
        answers: &'a mut [Q::Answer],
        waiting: &'a [u64; GROUPS],
    ) -> Self {
        Self {
            bvh,
            rays,
            answers,
            waiting,
            group: 0,
            left: waiting[0],
            ready: [NarrowRay::zeroed(); READY],
            indices: [0; READY],
            to_start: 0,
        }
    }

    /// The next ray: the caller's number of it, the ray, and as it was made ready.
    #[inline(always)]
    pub(super) fn next(&mut self) -> Option<(usize, &Ray, &NarrowRay)> {
        if self.to_start == 0 {
            self.bvh.backend().call(MakeReady(self));
            if self.to_start == 0 {
                return None;
            }
        }
        let place = self.to_start.trailing_zeros() as usize % READY;
        self.to_start &= self.to_start - 1;
        let index = self.indices[place];
        Some((index, self.rays.get(index)?, &self.ready[place]))
    }

    /// Writes down what a ray has found.
    #[inline(always)]
    pub(super) fn answer(&mut self, index: usize, found: Option<Found>) {
        if let Some(answer) = self.answers.get_mut(index) {
            *answer = match found {
                None => Q::MISS,
                Some(found) => Q::answer(found, self.bvh.primitives()),
            };
        }
    }

    /// The number of the next ray to be made ready.
    #[inline(always)]
    fn next_index(&mut self) -> Option<usize> {
        while self.left == 0 {
            self.group += 1;
            self.left = *self.waiting.get(self.group)?;
        }
        let place = self.left.trailing_zeros() as usize;
        self.left &= self.left - 1;
        let index = 64 * self.group + place;
        (index < self.rays.len()).then_some(index)
    }
}

/// Makes the next rays ready, if there are any.
///
/// A call, for it would take the registers that lists of lanes are in.
struct MakeReady<'f, 'a, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
    &'f mut Feed<'a, N, L, S, Q>,
);

impl<N: WideNode, L: TriangleLeaves, S: Storage, Q: Query> Operation
    for MakeReady<'_, '_, N, L, S, Q>
{
    type Output = ();

    #[inline(always)]
    fn run<T: Simd>(self, token: T) {
        let Self(feed) = self;
        while feed.to_start == 0 {
            // Lanes past the last ray hit nothing.
            let (mut rays, mut count) = ([PreparedRay::ROOM; READY], 0);
            while count < READY
                && let Some(index) = feed.next_index()
            {
                rays[count] = feed.rays[index];
                feed.indices[count] = index;
                count += 1;
            }
            if count == 0 {
                return;
            }
            let RayLanes {
                origin,
                direction,
                range,
            } = RayLanes::<T::F32x8>::new(token, rays.each_ref());
            let bounds = feed.bvh.bounds();
            let ready = &mut feed.ready;
            let ordinary =
                NarrowRay::eight(token, origin, direction, range, bounds, N::WIDTH, ready);
            let all = (1 << count) - 1;
            feed.to_start = all & ordinary;
            for place in bits(all & !ordinary) {
                let index = feed.indices[place];
                feed.answers[index] = Q::one(feed.bvh, &feed.rays[index]);
            }
        }
    }
}
