//! Rationals and points of them.

use dashu_ratio::Relaxed;
use glam::Vec3;

/// A rational. This kind divides by no common factor but 2, which is all that sums and products of floats have.
pub type Number = Relaxed;

/// A point or a vector.
pub type Point = [Number; 3];

/// The number that a float is.
///
/// # Panics
/// If it is NaN or infinite.
pub fn exact(x: f32) -> Number {
    Number::try_from(x).expect("a finite number")
}

/// The point that a vector of floats is.
///
/// # Panics
/// If it is not finite.
pub fn point(p: Vec3) -> Point {
    p.to_array().map(exact)
}

/// a - b
pub fn sub(a: &Point, b: &Point) -> Point {
    [&a[0] - &b[0], &a[1] - &b[1], &a[2] - &b[2]]
}

/// a · b
pub fn dot(a: &Point, b: &Point) -> Number {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

/// a × b
pub fn cross(a: &Point, b: &Point) -> Point {
    let minor = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

/// Without the sign.
pub fn abs(x: &Number) -> Number {
    if *x < Number::ZERO { -x } else { x.clone() }
}

/// The greatest float that is no greater, and the least that is no less.
///
/// # Panics
/// If it is beyond the floats.
pub fn between_floats(x: &Number) -> (f32, f32) {
    let mut low = x.to_f64_fast() as f32;
    while exact(low) > *x {
        low = low.next_down();
    }
    while low < f32::MAX && exact(low.next_up()) <= *x {
        low = low.next_up();
    }
    let high = if exact(low) == *x { low } else { low.next_up() };
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_are_exact() {
        for x in [0.1, -0.0, f32::MAX, f32::from_bits(1), -1.0 / 3.0] {
            assert_eq!(between_floats(&exact(x)), (x, x));
        }
        let sum = exact(1.0) + exact(f32::from_bits(1));
        assert_ne!(sum, exact(1.0));
        assert_eq!(between_floats(&sum), (1.0, 1.0_f32.next_up()));
        let third = exact(-1.0) / exact(3.0);
        let (low, high) = between_floats(&third);
        assert!(exact(low) < third && third < exact(high) && low.next_up() == high);
    }

    #[test]
    fn products() {
        let (x, y) = (point(Vec3::X), point(Vec3::Y));
        assert_eq!(cross(&x, &y), point(Vec3::Z));
        assert_eq!(dot(&x, &y), Number::ZERO);
        assert_eq!(sub(&x, &y), point(Vec3::new(1.0, -1.0, 0.0)));
        assert_eq!(abs(&exact(-2.0)), exact(2.0));
    }
}
