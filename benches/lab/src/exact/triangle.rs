//! A line against a triangle, by definition.

use super::number::{Number, Point, cross, dot, exact, sub};

/// Where a line meets a triangle: o + t·d = a + u·(b - a) + v·(c - a).
#[derive(Clone, Debug, PartialEq)]
pub struct ExactHit {
    pub t: Number,
    pub u: Number,
    pub v: Number,
}

/// The one point that the line o + t·d, t of any sign, has in common with the triangle, border and corners
/// included.
///
/// None by convention where there is no such one point: for a line in the plane of the triangle, whatever they have in
/// common, and for a triangle whose corners are on one line.
pub fn intersect(origin: &Point, direction: &Point, [a, b, c]: &[Point; 3]) -> Option<ExactHit> {
    let (ab, ac, ao) = (sub(b, a), sub(c, a), sub(origin, a));
    // Cramer's rule for u·(b - a) + v·(c - a) - t·d = o - a.
    let facing = dot(direction, &cross(&ab, &ac));
    if facing == Number::ZERO {
        return None;
    }
    let hit = ExactHit {
        t: -dot(&ao, &cross(&ab, &ac)) / &facing,
        u: dot(direction, &cross(&ao, &ac)) / &facing,
        v: dot(direction, &cross(&ab, &ao)) / &facing,
    };
    let inside = hit.u >= Number::ZERO && hit.v >= Number::ZERO && &hit.u + &hit.v <= exact(1.0);
    inside.then_some(hit)
}

/// Whether the corners are on one line.
pub fn is_degenerate([a, b, c]: &[Point; 3]) -> bool {
    cross(&sub(b, a), &sub(c, a)) == [Number::ZERO; 3]
}

#[cfg(test)]
mod tests {
    use super::super::number::point;
    use super::*;
    use glam::Vec3;

    fn hit(origin: Vec3, direction: Vec3, triangle: [Vec3; 3]) -> Option<[f64; 3]> {
        let triangle = triangle.map(point);
        intersect(&point(origin), &point(direction), &triangle)
            .map(|hit| [hit.t, hit.u, hit.v].map(|x| x.to_f64_fast()))
    }

    const TRIANGLE: [Vec3; 3] = [
        Vec3::ZERO,
        Vec3::new(2.0, 0.0, 0.0),
        Vec3::new(0.0, 4.0, 0.0),
    ];

    #[test]
    fn inside_outside_and_on_the_border() {
        let from = |x, y| hit(Vec3::new(x, y, -3.0), Vec3::Z * 0.5, TRIANGLE);
        assert_eq!(from(0.5, 1.0), Some([6.0, 0.25, 0.25]));
        assert_eq!(from(0.0, 0.0), Some([6.0, 0.0, 0.0]));
        assert_eq!(from(2.0, 0.0), Some([6.0, 1.0, 0.0]));
        assert_eq!(from(0.0, 4.0), Some([6.0, 0.0, 1.0]));
        assert_eq!(from(1.0, 2.0), Some([6.0, 0.5, 0.5]));
        assert_eq!(from(0.0, -f32::from_bits(1)), None);
        assert_eq!(from(1.0_f32.next_up(), 2.0), None);
        assert_eq!(from(-1e-30, 1.0), None);
    }

    #[test]
    fn behind_and_from_the_other_side() {
        let back = hit(Vec3::new(0.5, 1.0, -3.0), Vec3::NEG_Z, TRIANGLE);
        assert_eq!(back, Some([-3.0, 0.25, 0.25]));
    }

    #[test]
    fn no_one_point() {
        assert_eq!(hit(Vec3::NEG_X, Vec3::X, TRIANGLE), None);
        assert_eq!(
            hit(Vec3::NEG_Z, Vec3::Z, [Vec3::ZERO, Vec3::X, Vec3::X * 3.0]),
            None
        );
        assert!(is_degenerate(
            &[Vec3::ZERO, Vec3::X, Vec3::X * 3.0].map(point)
        ));
        assert!(!is_degenerate(&TRIANGLE.map(point)));
    }

    /// The two sides of the definition are equal, without rounding, for random lines.
    #[test]
    fn both_sides_of_the_definition() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut any = || Vec3::from([(); 3].map(|()| random.f32() - 0.5));
        let mut hits = 0;
        for _ in 0..200 {
            let [a, b, c, o, target] = [(); 5].map(|()| any());
            let triangle = [a, b, c].map(point);
            let target = (a + b + c) / 3.0 + target * 0.1;
            let (o, d) = (point(o), point(target - o));
            let Some(ExactHit { t, u, v }) = intersect(&o, &d, &triangle) else {
                continue;
            };
            hits += 1;
            let [a, b, c] = &triangle;
            for axis in 0..3 {
                let on_line = &o[axis] + &t * &d[axis];
                let (ab, ac) = (&b[axis] - &a[axis], &c[axis] - &a[axis]);
                assert_eq!(on_line, &a[axis] + &u * ab + &v * ac);
            }
        }
        assert!(hits > 100, "{hits}");
    }
}
