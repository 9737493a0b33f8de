//! A line against an axis-aligned box, by definition.

use super::number::{Number, Point, exact};
use wide_bvh::geometry::Aabb;

/// From which t to which the line o + t·d is in the closed box; `None` if nowhere, or if the direction is zero.
pub fn interval(origin: &Point, direction: &Point, aabb: &Aabb) -> Option<[Number; 2]> {
    let mut common: Option<[Number; 2]> = None;
    for axis in 0..3 {
        let (o, d) = (&origin[axis], &direction[axis]);
        let (low, high) = (exact(aabb.min[axis]) - o, exact(aabb.max[axis]) - o);
        if *d == Number::ZERO {
            if low > Number::ZERO || high < Number::ZERO {
                return None;
            }
            continue;
        }
        let (a, b) = (low / d, high / d);
        let (enter, leave) = if a <= b { (a, b) } else { (b, a) };
        common = Some(match common {
            None => [enter, leave],
            Some([from, to]) => [from.max(enter), to.min(leave)],
        });
    }
    common.filter(|[from, to]| from <= to)
}

#[cfg(test)]
mod tests {
    use super::super::number::point;
    use super::*;
    use glam::Vec3;

    fn of(origin: [f32; 3], direction: [f32; 3]) -> Option<[f64; 2]> {
        let aabb = Aabb::new(Vec3::ZERO, Vec3::new(1.0, 2.0, 4.0));
        interval(&point(origin.into()), &point(direction.into()), &aabb)
            .map(|ends| ends.map(|t| t.to_f64_fast()))
    }

    #[test]
    fn through_along_and_past() {
        assert_eq!(of([-1.0, 1.0, 1.0], [1.0, 0.0, 0.0]), Some([1.0, 2.0]));
        assert_eq!(of([-1.0, 1.0, 1.0], [-2.0, -0.0, 0.0]), Some([-1.0, -0.5]));
        // In the plane of a face, through an edge, through a corner alone.
        assert_eq!(of([-1.0, 2.0, 1.0], [1.0, 0.0, 0.0]), Some([1.0, 2.0]));
        assert_eq!(of([-1.0, 2.0, 4.0], [1.0, 0.0, 0.0]), Some([1.0, 2.0]));
        assert_eq!(of([-1.0, 1.0, 0.0], [1.0, -1.0, 0.0]), Some([1.0, 1.0]));
        assert_eq!(of([-1.0, 2.0_f32.next_up(), 1.0], [1.0, 0.0, 0.0]), None);
        assert_eq!(of([-1.0, 1.0_f32.next_down(), 0.0], [1.0, -1.0, 0.0]), None);
        assert_eq!(of([0.5, 0.5, 0.5], [0.0; 3]), None);
    }
}
