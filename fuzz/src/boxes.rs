//! Boxes, and primitives in them.

use crate::{Float, floats};
use arbitrary::Arbitrary;
use glam::Vec3;
use wide_bvh::{
    geometry::{Aabb, Ray},
    primitive::Primitives,
};

/// A box.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub enum BoxBytes {
    /// Of any bounds: inside out, NaN.
    Raw([[Float; 3]; 2]),
    /// Around two points: a box, if they are finite.
    Around([[Float; 3]; 2]),
    /// Of what is never hit.
    Empty,
}

impl BoxBytes {
    pub fn aabb(self) -> Aabb {
        match self {
            Self::Raw([min, max]) => Aabb::new(floats(min).into(), floats(max).into()),
            Self::Around(points) => Aabb::from_points(points.map(|point| floats(point).into())),
            Self::Empty => Aabb::EMPTY,
        }
    }
}

/// The boxes, `copies` times over, each copy farther along x.
pub fn boxes(bytes: &[BoxBytes], copies: usize) -> Vec<Aabb> {
    let copy = |copy: usize| {
        let shift = Vec3::X * copy as f32 * 0.75;
        let shifted = move |aabb: Aabb| Aabb::new(aabb.min + shift, aabb.max + shift);
        bytes.iter().map(move |bytes| shifted(bytes.aabb()))
    };
    (0..copies).flat_map(copy).collect()
}

/// Three points of each box, to aim rays at.
pub fn corners(boxes: &[Aabb]) -> Vec<[Vec3; 3]> {
    boxes
        .iter()
        .map(|aabb| [aabb.min, aabb.max, aabb.center()])
        .collect()
}

/// Primitives of whose test nothing is true but that it depends on its arguments alone.
#[derive(Clone, Copy, Debug)]
pub struct Liar<'a>(pub &'a [Aabb]);

impl Primitives for Liar<'_> {
    type Detail = ();

    fn aabb(&self, primitive: u32) -> Aabb {
        let aabb = self.0.get(primitive as usize);
        aabb.copied().unwrap_or(Aabb::EMPTY)
    }

    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, ())> {
        let noise = (ray.direction.x.to_bits() ^ ray.origin.y.to_bits() ^ primitive)
            .wrapping_mul(0x9e37_79b9);
        match noise >> 28 {
            0 => None,
            1 => Some((f32::from_bits(noise << 4), ())),
            _ => Some(((noise >> 8) as f32 / 1e6 - 4.0, ())),
        }
    }
}
