//! A triangle that `f32` cannot decide, or not well enough, in `f64`.
//!
//! One lane at a time: in a scene of large walls some tenth of all hits come here, in one of small triangles hardly any.
//! Where processors have no `f64` it is emulated, in a few kilobytes of code: so one formula answers two questions.

use crate::{geometry::Ray, slab::UNIT_ROUNDOFF};

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

    /// A corner after the shear, x and y times the direction's z.
    fn shear(&self, corner: usize) -> [f64; 3] {
        let [x, y, z] = self.corners[corner % 3];
        let ([ox, oy, oz], [dx, dy, dz]) = (self.origin, self.direction.map(f64::from));
        let less = |p: f32, q: f32| f64::from(p) - f64::from(q);
        let z = less(z, oz);
        [less(x, ox) * dz - dx * z, less(y, oy) * dz - dy * z, z]
    }
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

/// `t`, `u` and `v` of a triangle, or `None` for a miss by the exact signs of the edge functions.
///
/// If the place is open they are those of the triangle and the ray as given, to what `f32` holds, if these meet and `t` is
/// about what was said. Else, where these do not meet but for the rounding of the shear, they are those of the triangle as
/// sheared.
#[cold]
#[inline(never)]
pub(super) fn exact_hit(pair: &Pair, corners: [[f32; 3]; 3], open: Open) -> Option<[f32; 3]> {
    let along = pair.direction[2];
    let sheared = Pair {
        corners,
        origin: [0.0; 3],
        direction: [0.0, 0.0, 1.0],
    };
    let as_sheared = || solve(&sheared, along, 0.0);
    let as_given = || solve(pair, along, f64::from(UNIT_ROUNDOFF));
    match open {
        Open::Signs => as_sheared(),
        Open::Both => as_sheared().map(|sheared| as_given().unwrap_or(sheared)),
        Open::Place { about, error } => as_given()
            .filter(|[t, ..]| (t - about).abs() <= error)
            .or_else(as_sheared),
    }
}

/// `t`, for `along` a unit of z, `u` and `v` where a ray meets a triangle, if it does, and the triangle's area, as the ray
/// sees it, is not less than `least` of what it is the difference of.
///
/// The test of this module in `f64`: the corners after the shear are off by 2^-50 of the greatest coordinate, those of a
/// ray from 0 along z not at all.
#[inline(never)]
fn solve(pair: &Pair, along: f32, least: f64) -> Option<[f32; 3]> {
    let (a, b, c) = (pair.shear(0), pair.shear(1), pair.shear(2));
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
        return None;
    }
    let z = wa * a[2] + wb * b[2] + wc * c[2];
    let along = f64::from(along);
    let scale = reciprocal64(area * along);
    let t = (z * scale) as f32 + 0.0;
    let scale = scale * along;
    Some([t, (wb * scale) as f32, (wc * scale) as f32])
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
