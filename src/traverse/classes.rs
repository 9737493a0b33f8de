//! Rays of a batch sorted out: by the signs of their directions, and by their largest components.
//!
//! Those of a bundle have to agree on them. Where a tile of a picture, or of points that look towards a light, straddles a
//! border between two classes, its rays make a bundle each class.

use super::{
    bundle::{self, Outcome, Tightness},
    query::Query,
    ray_lanes::RayLanes,
};
use crate::{
    geometry::Ray,
    layout::{Bvh, Storage, TriangleLeaves, WideNode},
    simd::{Lanes, Simd, Vector},
    slab::PreparedRay,
};
use core::array;

/// Fewer rays than this are no bundle of their own.
const LEAST: u32 = 8;

/// For every ray a bit each: the signs of its direction, and whether x, or y, is its largest component.
struct Classes([u64; 5]);

/// What batches do not try for a while, since it was of no use.
#[derive(Default)]
pub(super) struct Patience {
    /// Bundles.
    loose: Pause,
    /// Classes.
    unlike: Pause,
    /// Of the bundles so far.
    tightness: Tightness,
}

/// For how many runs of rays something is not tried: the more, the more often it was of no use.
#[derive(Default)]
struct Pause {
    left: u32,
    next: u32,
}

impl Pause {
    const MOST: u32 = 31;

    #[inline(always)]
    fn is_out(&mut self) -> bool {
        let out = self.left > 0;
        self.left -= u32::from(out);
        out
    }

    /// Takes note of whether it was of use.
    #[inline(always)]
    fn note(&mut self, of_use: bool) {
        self.next = if of_use {
            0
        } else {
            (2 * self.next + 1).min(Self::MOST)
        };
        self.left = self.next;
    }
}

/// Traces rays, no more than [`bundle::RAYS`], of which there are as many as answers, in bundles where they are alike.
/// A bit for each ray that is left.
#[inline(always)]
pub(super) fn trace<T: Simd, N: WideNode, L: TriangleLeaves, S: Storage, Q: Query>(
    token: T,
    bvh: &Bvh<N, L, S>,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    patience: &mut Patience,
) -> u64 {
    if rays.is_empty() {
        return 0;
    }
    let all = u64::MAX >> (bundle::RAYS - rays.len().min(bundle::RAYS));
    if patience.loose.is_out() {
        return all;
    }
    let (mut class, mut classes) = (all, None);
    let (mut left, mut waiting) = (all, 0);
    let (mut any_tight, mut any_loose) = (false, false);
    // Rays of a class and their answers. Cleared when it is needed: mostly all rays are one.
    let mut room = None;
    loop {
        let count = class.count_ones() as usize;
        let whole = class == all;
        let (part, out) = if whole {
            (rays, &mut *answers)
        } else {
            let (gathered, found) =
                room.get_or_insert(([PreparedRay::ROOM; bundle::RAYS], [Q::MISS; bundle::RAYS]));
            for (ray, place) in gathered.iter_mut().zip(places(class)) {
                *ray = rays[place];
            }
            (&gathered[..count], &mut found[..count])
        };
        let outcome = bundle::trace::<N, L, S, Q>(bvh, part, out, &mut patience.tightness);
        let (alike, tight) = (outcome != Outcome::Unlike, outcome == Outcome::Tight);
        if whole {
            if alike {
                patience.loose.note(tight);
                return if outcome.is_traced() { 0 } else { all };
            }
            if patience.unlike.is_out() {
                return all;
            }
            classes = Some(Classes::new(token, rays));
        } else {
            left &= !class;
            any_tight |= tight;
            any_loose |= alike && !tight;
            match &room {
                Some((_, found)) if outcome.is_traced() => {
                    for (&answer, place) in found.iter().zip(places(class)) {
                        answers[place] = answer;
                    }
                }
                _ => waiting |= class,
            }
        }
        // The next class of some size.
        loop {
            let Some(classes) = &classes else {
                return left | waiting;
            };
            if left.count_ones() < LEAST {
                patience.unlike.note(any_tight);
                if any_tight || any_loose {
                    patience.loose.note(!any_loose);
                }
                return left | waiting;
            }
            class = classes.of_first(left);
            if class == all {
                // Not alike for another reason.
                patience.unlike.note(false);
                return all;
            }
            if class.count_ones() >= LEAST {
                break;
            }
            left &= !class;
            waiting |= class;
        }
    }
}

impl Classes {
    #[inline(always)]
    fn new<T: Simd>(token: T, rays: &[Ray]) -> Self {
        let mut bits = [0; 5];
        for (index, rays) in rays.chunks(8).enumerate() {
            let eight = array::from_fn(|lane| rays.get(lane).unwrap_or(&PreparedRay::ROOM));
            let [x, y, z] = RayLanes::<T::F32x8>::new(token, eight).direction;
            let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
            let largest = [ay.le(ax) & az.le(ax), ax.lt(ay) & az.le(ay)];
            let of_eight = [
                x.bits(),
                y.bits(),
                z.bits(),
                largest[0].bits(),
                largest[1].bits(),
            ];
            for (bits, of_eight) in bits.iter_mut().zip(of_eight) {
                *bits |= u64::from(of_eight) << (8 * index);
            }
        }
        Self(bits)
    }

    /// The class of the first of some rays, of those.
    #[inline(always)]
    fn of_first(&self, rays: u64) -> u64 {
        let first = rays.trailing_zeros();
        let mut class = rays;
        for bits in self.0 {
            class &= if bits >> first & 1 == 0 { !bits } else { bits };
        }
        class
    }
}

/// The places of the bits that are set.
#[inline(always)]
pub(super) fn places(mut mask: u64) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lowest = mask.trailing_zeros() as usize;
        (mask != 0).then(|| {
            mask &= mask - 1;
            lowest
        })
    })
}
