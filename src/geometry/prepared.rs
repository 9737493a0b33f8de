//! A ray made ready for the kernels: checked, scaled, its reciprocals and shear worked out once.

use super::Ray;

/// A ray that can hit something, in the kernels' terms.
///
/// The direction is scaled by a power of two so that its largest component is in [1, 2), exactly, and `t`
/// with it: whatever the caller's direction is, the kernels meet ordinary numbers. (A direction of
/// denormals ends at 2^-23 or more, a component 2^126 times smaller than the largest is rounded. Both
/// are part of what the prepared ray *is*: every kernel, and the reference, sees this one.)
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    /// Where `t` is 0.
    pub(crate) origin: [f32; 3],
    /// 1 / direction a component, no greater in magnitude than [`PreparedRay::MAX_RECIPROCAL`].
    pub(crate) reciprocal: [f32; 3],
    /// The axes x, y, z of the shear: z is where the direction is largest, and x, y, z turn as the
    /// caller's axes do, mirrored if the ray runs against z.
    pub(crate) axes: [usize; 3],
    /// direction.x / direction.z and direction.y / direction.z, by the axes of the shear.
    pub(crate) shear: [f32; 2],
    /// Least `t`, scaled.
    pub(crate) t_min: f32,
    /// Greatest `t`, scaled.
    pub(crate) t_max: f32,
    /// What turns the caller's `t` into a scaled one: a power of two.
    scale: f32,
    /// What turns it back.
    unscale: f32,
}

impl PreparedRay {
    /// Above this a reciprocal is cut off, so that a direction component that is zero, or next to it,
    /// needs no branch and makes no 0 · ∞. What it must satisfy is said in `slab`.
    pub(crate) const MAX_RECIPROCAL: f32 = pow2(48);

    /// `None` if the ray can hit nothing: it holds a NaN, its origin or direction is infinite, its
    /// direction is zero, or its range is empty.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Option<Self> {
        let magnitude = ray.direction.abs();
        let largest = magnitude.max_element();
        // Comparisons written so that a NaN fails them.
        let valid = largest > 0.0
            && ray.direction.is_finite()
            && ray.origin.is_finite()
            && ray.t_min <= ray.t_max
            && ray.t_min < f32::INFINITY;
        if !valid {
            return None;
        }

        // 2^-e for a component of exponent e, kept to powers whose inverse is a normal number too.
        let exponent = (largest.to_bits() >> 23) & 0xff;
        let inverse_exponent = (254 - exponent).clamp(1, 253);
        let unscale = f32::from_bits(inverse_exponent << 23);
        let scale = f32::from_bits((254 - inverse_exponent) << 23);
        let direction = (ray.direction * unscale).to_array();

        let z = match () {
            () if magnitude.x == largest => 0,
            () if magnitude.y == largest => 1,
            () => 2,
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            (x, y) = (y, x);
        }

        let reciprocal =
            direction.map(|d| (1.0 / d).clamp(-Self::MAX_RECIPROCAL, Self::MAX_RECIPROCAL));
        Some(Self {
            origin: ray.origin.to_array(),
            reciprocal,
            axes: [x, y, z],
            shear: [direction[x] / direction[z], direction[y] / direction[z]],
            t_min: ray.t_min * scale,
            t_max: ray.t_max * scale,
            scale,
            unscale,
        })
    }

    /// The caller's `t` as a scaled one.
    #[inline(always)]
    pub(crate) fn scaled(&self, t: f32) -> f32 {
        t * self.scale
    }

    /// A scaled `t` that was accepted as the caller's: finite and within `ray`'s range, should the
    /// scale take it out of what a float can hold.
    #[inline(always)]
    pub(crate) fn unscaled(&self, t: f32, ray: &Ray) -> f32 {
        (t * self.unscale)
            .min(f32::MAX)
            .max(ray.t_min)
            .min(ray.t_max)
    }
}

/// 2 to the power `exponent`, which is within -126 to 127.
pub(crate) const fn pow2(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}
