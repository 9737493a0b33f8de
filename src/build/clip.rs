//! The box around the part of a triangle that is in a box, which is never too small.

use crate::geometry::Aabb;
use glam::{DVec3, Vec3};

/// A box around all points that the triangle and `aabb` have in common, itself within `aabb`; `None` only if
/// there are none.
///
/// The triangle is clipped in `f64` against one side of the box after the other. A clip puts a corner in a place
/// that is off by 16·2^-53 of the largest coordinate at most, or leaves it: six, by less than 2^-46. But a corner
/// a little off an edge nearly parallel to the next side can cut off much. So the sides are moved out by a margin of
/// 2^-40 first: then all common points are within that margin of what is left.
pub(super) fn clip(corners: [Vec3; 3], aabb: &Aabb) -> Option<Aabb> {
    let largest = corners
        .iter()
        .fold(Vec3::ZERO, |largest, corner| largest.max(corner.abs()))
        .max_element();
    let margin = f64::from(largest) * f64::EPSILON * 4096.0;
    let mut polygon = Polygon::new(corners.map(|corner| corner.as_dvec3()));
    let (min, max) = (aabb.min.as_dvec3() - margin, aabb.max.as_dvec3() + margin);
    for axis in 0..3 {
        polygon.keep_above(axis, min[axis], 1.0);
        polygon.keep_above(axis, max[axis], -1.0);
    }
    if polygon.overflowed {
        return Some(*aabb);
    }
    let (low, high) = polygon.bounds();
    let (low, high) = (low - margin, high + margin);
    let around = Aabb::new(
        Vec3::from_array(low.to_array().map(round_down)).max(aabb.min),
        Vec3::from_array(high.to_array().map(|x| -round_down(-x))).min(aabb.max),
    );
    (!around.is_empty()).then_some(around)
}

/// The greatest `f32` that is not above.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x {
        nearest.next_down()
    } else {
        nearest
    }
}

/// A convex polygon. Each side of a box adds a corner at most.
struct Polygon {
    corners: [DVec3; 3 + 6],
    len: usize,
    /// Whether there are more: what is convex but for rounding could have some.
    overflowed: bool,
}

impl Polygon {
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let mut corners = [DVec3::ZERO; _];
        corners[..3].copy_from_slice(&[a, b, c]);
        Self {
            corners,
            len: 3,
            overflowed: false,
        }
    }

    /// Cuts off what has `sign` times the coordinate below `sign` times `bound` (Sutherland and Hodgman 1974).
    fn keep_above(&mut self, axis: usize, bound: f64, sign: f64) {
        let height = |corner: DVec3| (corner[axis] - bound) * sign;
        let corners = &self.corners[..self.len];
        if corners.iter().all(|&corner| height(corner) >= 0.0) {
            return;
        }
        let mut kept = Self {
            corners: [DVec3::ZERO; _],
            len: 0,
            overflowed: self.overflowed,
        };
        for (index, &to) in corners.iter().enumerate() {
            let from = corners[index.checked_sub(1).unwrap_or(corners.len() - 1)];
            let (from_height, to_height) = (height(from), height(to));
            if (from_height >= 0.0) != (to_height >= 0.0) {
                // Seen from the same end whichever way the edge goes.
                let mut cut = from + (to - from) * (from_height / (from_height - to_height));
                cut[axis] = bound;
                kept.push(cut);
            }
            if to_height >= 0.0 {
                kept.push(to);
            }
        }
        *self = kept;
    }

    fn push(&mut self, corner: DVec3) {
        match self.corners.get_mut(self.len) {
            Some(place) => {
                *place = corner;
                self.len += 1;
            }
            None => self.overflowed = true,
        }
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        self.corners[..self.len].iter().fold(
            (DVec3::INFINITY, DVec3::NEG_INFINITY),
            |(min, max), &corner| (min.min(corner), max.max(corner)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves() {
        let corners = [
            Vec3::ZERO,
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(0.0, 2.0, 0.0),
        ];
        let aabb = Aabb::new(Vec3::ZERO, Vec3::new(2.0, 2.0, 0.0));
        assert_eq!(clip(corners, &aabb), Some(aabb));
        let right = Aabb::new(Vec3::new(1.0, 0.0, 0.0), aabb.max);
        let clipped = clip(corners, &right).unwrap();
        assert_eq!(
            (clipped.min, clipped.max.x, clipped.max.z),
            (right.min, 2.0, 0.0)
        );
        assert!(clipped.max.y >= 1.0 && clipped.max.y < 1.000_001);
        // Only the line between two corners, only one corner, nothing.
        let aside = Aabb::new(Vec3::ZERO, Vec3::new(0.0, 2.0, 0.0));
        assert_eq!(clip(corners, &aside), Some(aside));
        let corner = Aabb::new(Vec3::new(2.0, 0.0, 0.0), Vec3::new(2.0, 2.0, 0.0));
        let clipped = clip(corners, &corner).unwrap();
        assert!(clipped.min == corner.min && clipped.max.y < 1e-6);
        let beyond = Aabb::new(Vec3::new(1.5, 1.5, 0.0), aabb.max);
        assert_eq!(clip(corners, &beyond), None);
    }
}
