//! Many rays of about one origin and one direction against boxes, all at once.
//!
//! The planes that a ray meets first are at p·r - o·r. With a point c this is (p - c)·r - (o - c)·r: the first term is least
//! at an end of the range that r has over the rays; if c is near all origins, or where all rays pass, the second is nearly
//! the same for all. The sum of the least of each is where the first of the rays may meet the plane, rounding seen to as in
//! the [parent](super): from (2) there, 7u·D·|r| and 1u·D·|r| for the reciprocal; 2u·|r| times |p - c| for that and its
//! product, and times |o - c|, which come to 3·D at most together if c is one of the origins or within the bounds, so 6u·D·|r|;
//! 2u·D·|r| and u·E each for the sum with E and the last one: 18u·D·|r| + 3u·E, D being that of all the rays together.
//! **K_BUNDLE = 24** leaves 6, and (3) needs 2 where reciprocals were cut off. That the least product is at an end holds
//! after rounding, for rounding is monotone.
//!
//! Interval arithmetic over a bundle: Reshetov, Soupikov, Hurley, "Multi-level ray tracing algorithm" (2005); Wald et al.,
//! "Ray tracing deformable scenes using dynamic bounding volume hierarchies" (2007).

use super::{FirstPlanes, UNIT_ROUNDOFF};
use crate::simd::{Lanes, Vector, splat3};
use core::array;
use glam::Vec3;

/// Margin of the test of a bundle: derived above.
const K_BUNDLE: f32 = 24.0;

/// What the box test needs of a bundle of rays whose directions have the same signs.
#[derive(Clone, Copy)]
pub struct BundleSlabs {
    center: [f32; 3],
    /// The least and the greatest reciprocals.
    reciprocal: [[f32; 3]; 2],
    /// What is added for the planes met first, and for those met last.
    offset: [[f32; 3]; 2],
    /// The least of the rays' own, less the margin.
    t_min: f32,
    direction: Vec3,
}

/// Which of the boxes of a node a bundle's rays pass, a child a lane.
#[derive(Clone, Copy)]
pub struct BundlePasses<V> {
    /// A bit for each box that any of the rays may pass.
    pub(crate) any: u32,
    /// A bit for each box that all of them pass, or nearly.
    pub(crate) all: u32,
    /// From which `t` on any of them may meet it.
    pub(crate) near: V,
}

/// [`BundleSlabs`] in the making: of the first ray in a lane, the second in the next, and so on.
#[derive(Clone, Copy)]
pub(crate) struct Bundling<V> {
    center: [V; 3],
    error: V,
    reciprocal: [[V; 3]; 2],
    offset: [[V; 3]; 2],
}

impl<V: Lanes> Bundling<V> {
    /// Of no rays so far. `center` is one of their origins or within the bounds, `extent` no less than the D of any.
    #[inline(always)]
    pub(crate) fn new<const N: usize>(token: V::Token, center: Vec3, extent: f32) -> Self
    where
        V: Vector<N>,
    {
        let (least, most) = (
            V::splat(token, f32::NEG_INFINITY),
            V::splat(token, f32::INFINITY),
        );
        Self {
            center: splat3(token, center.to_array()),
            error: V::splat(token, K_BUNDLE * UNIT_ROUNDOFF * extent),
            reciprocal: [[most; 3], [least; 3]],
            offset: [[most; 3], [least; 3]],
        }
    }

    /// Adds a ray a lane.
    #[inline(always)]
    pub(crate) fn add<const N: usize>(
        &mut self,
        token: V::Token,
        origin: [V; 3],
        reciprocal: [V; 3],
    ) where
        V: Vector<N>,
    {
        let zero = V::splat(token, 0.0);
        for axis in 0..3 {
            let r = reciprocal[axis];
            let at_center = zero - (origin[axis] - self.center[axis]) * r;
            let error = self.error * r.abs();
            let [least, most] = &mut self.reciprocal;
            least[axis] = least[axis].min(r);
            most[axis] = most[axis].max(r);
            let [least, most] = &mut self.offset;
            least[axis] = least[axis].min(at_center - error);
            most[axis] = most[axis].max(at_center + error);
        }
    }

    /// All that were added. `direction` is that of any, and no hit is before `start`.
    #[inline(always)]
    pub(crate) fn finish<const N: usize>(self, direction: Vec3, start: f32) -> BundleSlabs
    where
        V: Vector<N>,
    {
        let [x, y, z] = self.center;
        BundleSlabs {
            center: [x.to_array()[0], y.to_array()[0], z.to_array()[0]],
            reciprocal: [least3(self.reciprocal[0]), most3(self.reciprocal[1])],
            offset: [least3(self.offset[0]), most3(self.offset[1])],
            t_min: start,
            direction,
        }
    }
}

impl BundleSlabs {
    /// Which side's planes are met first.
    #[inline(always)]
    pub(crate) fn first<const N: usize>(&self) -> FirstPlanes<N> {
        FirstPlanes::new(self.direction)
    }

    /// Which of the boxes the rays pass up to `t_max`, raised by their margins: of the planes that are met first and those
    /// that are met last.
    #[inline(always)]
    pub(crate) fn test<const N: usize, V: Vector<N>>(
        &self,
        token: V::Token,
        [near, far]: [[V; 3]; 2],
        t_max: V,
    ) -> BundlePasses<V> {
        // Of the first of the rays and of the last.
        let mut enter = [V::splat(token, self.t_min); 2];
        let mut leave = [t_max; 2];
        for axis in 0..3 {
            let center = V::splat(token, self.center[axis]);
            let least = V::splat(token, self.reciprocal[0][axis]);
            let most = V::splat(token, self.reciprocal[1][axis]);
            let first = V::splat(token, self.offset[0][axis]);
            let last = V::splat(token, self.offset[1][axis]);
            let (near, far) = (near[axis] - center, far[axis] - center);
            let (a, b) = (near * least, near * most);
            enter = [
                (a.min(b) + first).max(enter[0]),
                (a.max(b) + last).max(enter[1]),
            ];
            let (a, b) = (far * least, far * most);
            leave = [
                (a.min(b) + first).min(leave[0]),
                (a.max(b) + last).min(leave[1]),
            ];
        }
        BundlePasses {
            any: enter[0].le(leave[1]).bits(),
            all: enter[1].le(leave[0]).bits(),
            near: enter[0],
        }
    }
}

#[inline(always)]
fn least3<const N: usize, V: Vector<N>>([x, y, z]: [V; 3]) -> [f32; 3] {
    [least(x), least(y), least(z)]
}

#[inline(always)]
fn most3<const N: usize, V: Vector<N>>([x, y, z]: [V; 3]) -> [f32; 3] {
    [most(x), most(y), most(z)]
}

/// The least lane, none of which is NaN.
#[inline(always)]
pub(crate) fn least<const N: usize, V: Vector<N>>(numbers: V) -> f32 {
    let mut least = numbers;
    let mut step = N / 2;
    while step > 0 {
        least = least.min(least.permute(&across(step)));
        step /= 2;
    }
    least.to_array()[0]
}

/// The greatest lane, none of which is NaN.
#[inline(always)]
pub(crate) fn most<const N: usize, V: Vector<N>>(numbers: V) -> f32 {
    let mut most = numbers;
    let mut step = N / 2;
    while step > 0 {
        most = most.max(most.permute(&across(step)));
        step /= 2;
    }
    most.to_array()[0]
}

/// For each lane the one that is so many away, a power of two.
#[inline(always)]
fn across<const N: usize>(step: usize) -> [u8; N] {
    array::from_fn(|lane| (lane ^ step) as u8)
}
