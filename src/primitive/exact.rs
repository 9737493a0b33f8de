//! A triangle that `f32` cannot decide, or not well enough, in `f64`.
//!
//! One lane at a time: in a scene of large walls some tenth of all hits come here, in one of small triangles hardly any.
//! Where processors have no `f64` it is emulated, in a few kilobytes of code: so one formula answers two questions.

use super::triangle::Corners;
use crate::{geometry::Ray, slab::UNIT_ROUNDOFF};
use core::ptr;

/// The triangles and the rays that are tested, as they were before the shear.
pub trait Pairs: Copy {
    /// Those of a lane.
    fn pair(&self, lane: usize) -> Pair;
}

/// A triangle and a ray, along the axes of the ray's shear.
#[derive(Clone, Copy)]
pub struct Pair {
    corners: [[f32; 3]; 3],
    origin: [f32; 3],
    direction: [f32; 3],
}

impl Pair {
    /// `axes` are those of the prepared ray.
    #[inline(always)]
    pub(crate) fn new(corners: &[[f32; 3]; 3], ray: &Ray, axes: &[usize; 3]) -> Self {
        let [x, y, z] = *axes;
        // SAFETY: the axes are those of a prepared ray, a permutation of 0 to 2.
        unsafe { core::hint::assert_unchecked(x < 3 && y < 3 && z < 3) };
        let along = |numbers: &[f32; 3]| [numbers[x], numbers[y], numbers[z]];
        let [a, b, c] = corners;
        Self {
            corners: [along(a), along(b), along(c)],
            origin: along(ray.origin.as_ref()),
            direction: along(ray.direction.as_ref()),
        }
    }
}

/// A corner after the shear, x and y times the direction's z.
fn shear(corner: &[f32; 3], origin: &[f64; 3], direction: &[f64; 3]) -> [f64; 3] {
    let ([x, y, z], [ox, oy, oz], [dx, dy, dz]) = (read(corner), origin, direction);
    let z = z - oz;
    [(x - ox) * dz - dx * z, (y - oy) * dz - dy * z, z]
}

/// Numbers that were written one by one, read one by one. Compilers would read several at once, and of what it has not yet
/// written to its cache a processor gives no two together: all that was begun before would be waited for.
fn read([x, y, z]: &[f32; 3]) -> [f64; 3] {
    // SAFETY: references are good for reads.
    let [x, y, z] = unsafe {
        [
            ptr::read_volatile(x),
            ptr::read_volatile(y),
            ptr::read_volatile(z),
        ]
    };
    [f64::from(x), f64::from(y), f64::from(z)]
}

impl Pairs for Pair {
    #[inline(always)]
    fn pair(&self, _: usize) -> Self {
        *self
    }
}

/// What `f32` leaves open.
pub(super) enum Open {
    /// Whether the triangle is hit.
    Signs,
    /// Where: at a `t` no farther than `error` from `about`.
    Place {
        about: f32,
        error: f32,
    },
    Both,
}

/// Whether a triangle is hit by the exact signs of the edge functions, and if so `t`, `u` and `v`, to `hit`. `sheared` are its
/// corners, in a lane of several.
///
/// If the place is open they are those of the triangle and the ray as given, to what `f32` holds, if these meet and `t` is
/// about what was said. Else, where these do not meet but for the rounding of the shear, they are those of the triangle as
/// sheared.
#[cold]
#[inline(never)]
pub(super) fn exact_hit<const N: usize>(
    pair: &Pair,
    sheared: &Corners<[f32; N]>,
    lane: usize,
    open: Open,
    hit: &mut [f32; 3],
) -> bool {
    let along = pair.direction[2];
    let as_sheared = |hit: &mut [f32; 3]| {
        let lane = lane % N;
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = sheared;
        let pair = Pair {
            corners: [
                [ax[lane], ay[lane], az[lane]],
                [bx[lane], by[lane], bz[lane]],
                [cx[lane], cy[lane], cz[lane]],
            ],
            origin: [0.0; 3],
            direction: [0.0, 0.0, 1.0],
        };
        solve(&pair, along, 0.0, hit)
    };
    let as_given = |hit: &mut [f32; 3]| solve(pair, along, f64::from(UNIT_ROUNDOFF), hit);
    match open {
        Open::Signs => as_sheared(hit),
        Open::Both => {
            let is_hit = as_sheared(hit);
            if is_hit {
                as_given(hit);
            }
            is_hit
        }
        Open::Place { about, error } => {
            as_given(hit) && (hit[0] - about).abs() <= error || as_sheared(hit)
        }
    }
}

/// Whether a ray meets a triangle, and the triangle's area, as the ray sees it, is not less than `least` of what it is the
/// difference of; if so `t`, for `along` a unit of z, `u` and `v`, to `hit`.
///
/// The test of this module in `f64`: the corners after the shear are off by 2^-50 of the greatest coordinate, those of a
/// ray from 0 along z not at all.
#[inline(never)]
fn solve(pair: &Pair, along: f32, least: f64, hit: &mut [f32; 3]) -> bool {
    let (origin, direction) = (read(&pair.origin), read(&pair.direction));
    let [a, b, c] = &pair.corners;
    let [a, b, c] = [
        shear(a, &origin, &direction),
        shear(b, &origin, &direction),
        shear(c, &origin, &direction),
    ];
    let mut largest = 0;
    let wa = edge(&c, &b, &mut largest);
    let wb = edge(&a, &c, &mut largest);
    let wc = edge(&b, &a, &mut largest);
    let area = wa + wb + wc;
    let size = magnitude(area);
    // Whether it is not 0 and of the other sign.
    let sign = area.to_bits() & SIGN;
    let against = |weight: f64| weight.to_bits() ^ sign > SIGN;
    if against(wa)
        || against(wb)
        || against(wc)
        || size == 0
        || size < magnitude(f64::from_bits(largest) * least)
        || size >= magnitude(f64::INFINITY)
    {
        return false;
    }
    let z = wa * a[2] + wb * b[2] + wc * c[2];
    let along = f64::from(along);
    let scale = reciprocal64(area * along);
    let t = (z * scale) as f32 + 0.0;
    let scale = scale * along;
    *hit = [t, (wb * scale) as f32, (wc * scale) as f32];
    true
}

/// On which side of the edge from p to q 0 lies. `largest` becomes no less than the magnitudes of what it is the difference
/// of.
fn edge(p: &[f64; 3], q: &[f64; 3], largest: &mut u64) -> f64 {
    let (less, more) = (p[1] * q[0], p[0] * q[1]);
    *largest = magnitude(less).max(magnitude(more)).max(*largest);
    more - less
}

const SIGN: u64 = 1 << 63;

/// Numbers are compared by their bits: where `f64` is emulated, comparisons are calls.
fn magnitude(number: f64) -> u64 {
    number.to_bits() & !SIGN
}

/// 1 / `number`, which is normal and has a normal inverse, to 2^-51: by Newton's method. Where `f64` is emulated, its
/// division alone would be a ninth of all code.
pub(crate) fn reciprocal64(number: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    let bits = number.to_bits();
    let one_to_two = f32::from_bits(1.0_f32.to_bits() | (bits >> 29) as u32 & 0x7f_ffff);
    let first = f64::from(1.0 / one_to_two).to_bits();
    let first = (first + 1.0_f64.to_bits()).wrapping_sub(bits & EXPONENT);
    let mut inverse = f64::from_bits(first | bits & 1 << 63);
    for _ in 0..2 {
        inverse = inverse * (2.0 - number * inverse);
    }
    inverse
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use std::vec;

    #[test]
    fn reciprocals_are_good_to_51_bits() {
        let mut rng = fastrand::Rng::with_seed(11);
        let mut numbers = vec![
            1.0,
            -1.0,
            2.0,
            1.0_f64.next_down(),
            2.0_f64.next_down(),
            1e-250,
            -1e250,
        ];
        numbers.extend((0..10_000).map(|_| (rng.f64() - 0.5) * 2.0_f64.powi(rng.i32(-900..900))));
        for number in numbers {
            let error = reciprocal64(number) * number - 1.0;
            assert!(error.abs() < 2.0_f64.powi(-51), "{number:e}: {error:e}");
        }
    }
}
