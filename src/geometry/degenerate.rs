//! Triangles without area, told apart exactly.

use glam::{Vec3, Vec3A};

/// Whether a triangle's corners lie on one line, exactly: no rounding is involved.
///
/// Such a triangle is never hit. It has no normal, and whether a ray "meets" it would be a matter of rounding.
#[inline]
pub(crate) fn is_degenerate(corners: [Vec3; 3]) -> bool {
    !has_area(corners.map(Vec3A::from)) && is_collinear(corners)
}

/// Whether `f32` is enough to see that a triangle has an area, as nearly every one that has does: then it is not
/// [degenerate](is_degenerate).
///
/// A difference is off by 2^-24 of itself, a product by three times that, and the normal by 2^-21 of the terms; what
/// products lose to underflow is less than that of terms of 2^-100. Sums are no less than what they are of, and not finite
/// where a corner is not: the answer is no then.
#[inline(always)]
pub(crate) fn has_area([a, b, c]: [Vec3A; 3]) -> bool {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac).abs();
    let terms = ab.abs().element_sum() * ac.abs().element_sum();
    let least = Vec3A::splat(terms * (f32::EPSILON * 16.0));
    terms > f32::from_bits(27 << 23) && normal.cmpgt(least).any()
}

fn is_collinear(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    // Nearly every triangle is told by this: an error of 2^-50 times the terms is more than generous.
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac).abs();
    let terms = ab.abs().max_element() * ac.abs().max_element();
    if normal.max_element() > terms * f64::EPSILON * 4.0 {
        return false;
    }
    [(0, 1), (1, 2), (2, 0)].iter().all(|&(x, y)| {
        // Twice the area of the triangle seen along the third axis. The products are exact in `f64`.
        sum_is_zero([
            a[x] * b[y],
            -a[y] * b[x],
            b[x] * c[y],
            -b[y] * c[x],
            c[x] * a[y],
            -c[y] * a[x],
        ])
    })
}

/// Whether the exact sum of `terms` is 0.
///
/// Each pass replaces neighbours by their rounded sum and its error, which keeps the exact sum (Knuth's
/// two-sum), and moves the magnitude towards the end. When a pass changes nothing, the terms do not
/// overlap, and their sum is 0 only if they all are.
fn sum_is_zero(mut terms: [f64; 6]) -> bool {
    loop {
        let before = terms;
        for i in 1..terms.len() {
            let (x, y) = (terms[i - 1], terms[i]);
            let sum = x + y;
            let y_part = sum - x;
            terms[i - 1] = (x - (sum - y_part)) + (y - y_part);
            terms[i] = sum;
        }
        if terms == before {
            return terms == [0.0; 6];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exactly_collinear() {
        let line = [
            Vec3::new(0.1, 0.2, 0.3),
            Vec3::new(0.2, 0.4, 0.6),
            Vec3::new(0.4, 0.8, 1.2),
        ];
        assert!(is_degenerate(line));
        assert!(is_degenerate([line[0], line[0], line[2]]));
        assert!(is_degenerate([line[1]; 3]));
        for (corner, axis) in [(0, 0), (1, 1), (2, 2), (0, 2)] {
            let mut bent = line;
            bent[corner][axis] = bent[corner][axis].next_up();
            assert!(!is_degenerate(bent), "{bent:?}");
        }
    }

    #[test]
    fn of_any_scale() {
        for exponent in -149..=124 {
            let unit = 2f64.powi(exponent) as f32;
            let at = |x: f32, y: f32| Vec3::new(x, y, -x) * unit;
            assert!(is_degenerate([at(1.0, 2.0), at(2.0, 4.0), at(4.0, 8.0)]));
            assert!(!is_degenerate([at(1.0, 2.0), at(2.0, 4.0), at(4.0, 7.0)]));
        }
        let mixed = Vec3::new(f32::MAX, 1.0, f32::MIN_POSITIVE);
        assert!(!is_degenerate([Vec3::ZERO, mixed, 2.0 * Vec3::X]));
        assert!(is_degenerate([-mixed, mixed, Vec3::ZERO]));
    }
}
