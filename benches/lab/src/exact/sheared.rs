//! A triangle as the crate sees it from a ray: moved, permuted, sheared, in `f32`.
//!
//! The crate's hit-or-miss is exact from here on, so this is part of the definition of its answers; it is written out
//! again rather than called, for a second pair of eyes.

use glam::Vec3;
use wide_bvh::geometry::Ray;

/// The corners less the ray's origin, along the axes of the shear, sheared. As computed.
#[derive(Clone, Copy, Debug)]
pub struct Sheared {
    /// Which of the caller's axes are x, y and z here: z is the one along which the direction is largest.
    pub axes: [usize; 3],
    /// The ray's, with the largest component brought into range by a power of two.
    pub direction: Vec3,
    /// What t is multiplied by with that: the power's inverse.
    pub scale: f64,
    pub corners: [Corner; 3],
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Beside the ray, once sheared.
    pub x: f32,
    pub y: f32,
    /// Along the axis of the shear, not scaled.
    pub z: f32,
    /// The largest distance from the origin on any axis, before the shear.
    pub distance: f32,
}

impl Sheared {
    /// `None` if the ray's origin or direction is not finite, or the direction zero.
    pub fn new(ray: &Ray, corners: [Vec3; 3]) -> Option<Self> {
        let largest = ray.direction.abs().max_element();
        if !ray.origin.is_finite() || !ray.direction.is_finite() || largest == 0.0 {
            return None;
        }
        // The first of those that are as large.
        let z = (0..3).find(|&axis| ray.direction[axis].abs() == largest)?;
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let axes = if ray.direction[z] < 0.0 {
            [y, x, z]
        } else {
            [x, y, z]
        };
        let factor = if (2f32.powi(-23)..2f32.powi(24)).contains(&largest) {
            1.0
        } else {
            // To [1, 2), as far as a power of two goes that has an inverse.
            let exponent = (largest.to_bits() >> 23) as i32 - 127;
            2f32.powi((-exponent).clamp(-126, 126))
        };
        let direction = ray.direction * factor;
        let reciprocal = 1.0 / direction[z];
        let shear = axes.map(|axis| direction[axis] * reciprocal);
        let corner = |corner: Vec3| {
            let moved = corner - ray.origin;
            let [x, y, z] = axes.map(|axis| moved[axis]);
            Corner {
                x: x - shear[0] * z,
                y: y - shear[1] * z,
                z,
                distance: moved.abs().max_element(),
            }
        };
        Some(Self {
            axes,
            direction,
            scale: f64::from(factor).recip(),
            corners: corners.map(corner),
        })
    }

    /// The largest distance of a corner from the origin on any axis.
    pub fn distance(&self) -> f32 {
        let [a, b, c] = self.corners.map(|corner| corner.distance);
        a.max(b).max(c)
    }

    /// The largest distance along the axis of the shear.
    pub fn depth(&self) -> f32 {
        let [a, b, c] = self.corners.map(|corner| corner.z.abs());
        a.max(b).max(c)
    }

    /// The t of the farthest corner, as computed: a triangle that is all before the range of t is never hit.
    pub fn last(&self) -> f32 {
        let reciprocal = 1.0 / self.direction[self.axes[2]];
        let [a, b, c] = self.corners.map(|corner| corner.z * reciprocal);
        a.max(b).max(c)
    }

    /// Whether the crate's bounds hold: nothing may be near to overflow. See `MAX_EXTENT` in the crate's slab test.
    pub fn is_ordinary(&self, ray: &Ray) -> bool {
        let limit = 2f32.powi(76);
        self.distance() < limit && ray.origin.abs().max_element() < limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_axis() {
        let ray = Ray::new([1.0, 2.0, 3.0], [1.0, -4.0, 2.0]);
        let corners = [
            Vec3::new(1.0, 1.0, 3.0),
            Vec3::new(3.0, -2.0, 1.0),
            Vec3::ZERO,
        ];
        let sheared = Sheared::new(&ray, corners).unwrap();
        // y is the largest, and negative: z, x, y become x, z, y.
        assert_eq!(sheared.axes, [0, 2, 1]);
        let [a, b, _] = sheared.corners;
        assert_eq!((a.x, a.y, a.z, a.distance), (-0.25, -0.5, -1.0, 1.0));
        assert_eq!((b.x, b.y, b.z, b.distance), (1.0, -4.0, -4.0, 4.0));
        assert_eq!((sheared.depth(), sheared.distance()), (4.0, 4.0));
    }

    #[test]
    fn directions_of_any_length_are_alike() {
        let corners = [Vec3::X, Vec3::Y, Vec3::Z];
        let of = |length: f32| {
            let ray = Ray::new([0.3, 0.2, 0.1], Vec3::new(0.5, -0.25, 1.0) * length);
            Sheared::new(&ray, corners).unwrap()
        };
        let one = of(1.0);
        for exponent in -140..=127 {
            let other = of(2f64.powi(exponent) as f32);
            assert_eq!(
                other.corners.map(|c| [c.x, c.y, c.z]),
                one.corners.map(|c| [c.x, c.y, c.z])
            );
        }
        assert!(Sheared::new(&Ray::new([0.0; 3], [0.0, -0.0, 0.0]), corners).is_none());
        assert!(Sheared::new(&Ray::new([f32::NAN, 0.0, 0.0], [1.0; 3]), corners).is_none());
    }
}
