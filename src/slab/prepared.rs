//! A ray made ready for the kernels: checked, and scaled if need be.

use crate::{
    geometry::Ray,
    simd::{Lanes, Portable, Simd, Vector, splat3},
};
use wide::f32x4;

/// A ray that can hit something, in numbers that the kernels can work with.
///
/// The largest component of its direction is within 2^-23 and 2^24. Directions of another length are
/// multiplied by a power of two, and `t` with them: exactly, but for components 2^126 times smaller than
/// the largest, and lengths of which no float is the inverse. What is rounded there is part of what the
/// prepared ray *is*: every kernel, and the reference, sees this one.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay<'a> {
    /// The caller's ray, or a scaled one.
    pub(crate) ray: &'a Ray,
    /// The axes x, y, z of the shear: z is where the direction is largest, and x, y, z turn as the
    /// caller's axes do, mirrored if the ray runs against z.
    pub(crate) axes: &'static [usize; 3],
    /// Their [number](PreparedLanes::axes).
    pub(crate) number: u32,
    /// What the caller's `t` was multiplied by: a power of two.
    scale: f32,
    /// Its inverse.
    unscale: f32,
}

/// The largest component of a direction is left as it is from here...
const LEAST_DIRECTION: f32 = pow2(-23);
/// ... to below here.
const LONG_DIRECTION: f32 = pow2(24);

/// Above this a reciprocal is cut off, so that a direction component that is zero, or next to it, needs no
/// branch and makes no 0 · ∞. What it must satisfy is said in [`slab`](super).
const MAX_RECIPROCAL: f32 = pow2(48);

/// 1 / direction, a component, no greater in magnitude than [`MAX_RECIPROCAL`].
#[inline(always)]
pub(crate) fn reciprocal<const N: usize, V: Vector<N>>(token: V::Token, direction: V) -> V {
    (V::splat(token, 1.0) / direction)
        .max(V::splat(token, -MAX_RECIPROCAL))
        .min(V::splat(token, MAX_RECIPROCAL))
}

/// Those of a direction's components.
#[inline(always)]
pub(crate) fn reciprocals<const N: usize, V: Vector<N>>(
    token: V::Token,
    [x, y, z]: [V; 3],
) -> [V; 3] {
    [
        reciprocal(token, x),
        reciprocal(token, y),
        reciprocal(token, z),
    ]
}

impl<'a> PreparedRay<'a> {
    /// `None` if the ray can hit nothing: it holds a NaN, its origin or direction is infinite, its
    /// direction is zero, or its range is empty. `scaled` is room for a ray that has to be scaled.
    #[inline(always)]
    pub(crate) fn new(ray: &'a Ray, scaled: &'a mut Ray) -> Option<Self> {
        let [mx, my, mz] = [
            ray.direction.x.abs(),
            ray.direction.y.abs(),
            ray.direction.z.abs(),
        ];
        let largest = greater(greater(mx, my), mz);
        let valid = (largest > 0.0)
            & (ray.t_min <= ray.t_max)
            & (ray.t_min < f32::INFINITY)
            & is_finite(ray);
        if !valid {
            return None;
        }
        let number = axes_number(ray, largest);
        let axes = PreparedLanes::<f32>::axes(number);
        if (LEAST_DIRECTION..LONG_DIRECTION).contains(&largest) {
            return Some(Self {
                ray,
                axes,
                number,
                scale: 1.0,
                unscale: 1.0,
            });
        }
        let (scale, unscale) = scale_ray(ray, largest, scaled);
        Some(Self {
            ray: scaled,
            axes,
            number,
            scale,
            unscale,
        })
    }

    /// Whether the rays, a number of theirs a vector, are all as the caller gave them once they are prepared, of
    /// directions with signs as this ray's and with these axes.
    #[inline(always)]
    pub(crate) fn is_like<const N: usize, V: Vector<N>>(
        &self,
        token: V::Token,
        origin: [V; 3],
        direction: [V; 3],
        [t_min, t_max]: [V; 2],
    ) -> bool {
        let all = u32::MAX >> (32 - N);
        let [x, y, z] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let largest = x.max(y).max(z);
        let along = [x.lt(largest), x.lt(largest) & y.lt(largest)];
        let axis = match self.axes[2] {
            0 => largest.le(x),
            1 => largest.le(y) & along[0],
            _ => largest.le(z) & along[1],
        };
        let ordinary = axis & ordinary(token, origin, direction, [t_min, t_max], largest);
        let mut alike = self.unscale == 1.0 && ordinary.bits() == all;
        for (axis, number) in direction.into_iter().enumerate() {
            let negative = self.ray.direction.as_ref()[axis].is_sign_negative();
            alike &= number.bits() == if negative { all } else { 0 };
        }
        alike
    }

    /// Room for [`PreparedRay::new`].
    pub(crate) const ROOM: Ray = Ray {
        origin: glam::Vec3::ZERO,
        direction: glam::Vec3::ZERO,
        t_min: 0.0,
        t_max: 0.0,
    };

    /// The reciprocals of the direction, by axis.
    #[inline(always)]
    pub(crate) fn reciprocals<const N: usize, V: Vector<N>>(&self, token: V::Token) -> [V; 3] {
        reciprocals(token, splat3(token, self.ray.direction.to_array()))
    }

    /// The reciprocal of the direction's component along the last of the axes.
    #[inline(always)]
    pub(crate) fn along(&self) -> f32 {
        let numbers: &[f32; 3] = self.ray.direction.as_ref();
        1.0 / numbers[self.axes[2]]
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
        let t = greater(lesser(t * self.unscale, f32::MAX), f32::MIN);
        // Adding 0 turns -0, from underflow or the range's end, into 0: `min` leaves open which it is.
        lesser(greater(t, ray.t_min), ray.t_max) + 0.0
    }
}

/// Rays, one a lane, as [`PreparedRay`] has them where it leaves them as they are.
#[derive(Clone, Copy)]
pub(crate) struct PreparedLanes<V> {
    pub(crate) reciprocal: [V; 3],
    /// That along the last axis of the shear.
    pub(crate) along: V,
    /// The number of the [axes](Self::axes) of the shear, as bits.
    pub(crate) axes: V,
    /// Which rays can hit something and need not be scaled. The others' numbers are of no meaning.
    pub(crate) ordinary: V,
}

impl<V> PreparedLanes<V> {
    #[inline(always)]
    pub(crate) fn new<const N: usize>(
        token: V::Token,
        origin: [V; 3],
        direction: [V; 3],
        range: [V; 2],
    ) -> Self
    where
        V: Vector<N>,
    {
        let [dx, dy, dz] = direction;
        let [rx, ry, rz] = reciprocals(token, direction);
        let largest = dx.abs().max(dy.abs()).max(dz.abs());
        let (not_x, not_y) = (dx.abs().lt(largest), dy.abs().lt(largest));
        let number = |bits| V::splat(token, f32::from_bits(bits));
        let along = not_x.select(not_y.select(rz, ry), rx);
        let pair = not_x.select(not_y.select(number(4), number(2)), number(0));
        Self {
            reciprocal: [rx, ry, rz],
            along,
            axes: pair | (along.lt(V::splat(token, 0.0)) & number(1)),
            ordinary: ordinary(token, origin, direction, range, largest),
        }
    }

    /// The axes of a number.
    #[inline(always)]
    pub(crate) fn axes(number: u32) -> &'static [usize; 3] {
        &SHEAR_AXES[number as usize % 8]
    }
}

/// Which rays, `largest` being the largest component of their directions, can hit something and need not be scaled. Nothing
/// that is worked out of them is NaN: of a range that ends at -∞ it would be.
#[inline(always)]
fn ordinary<const N: usize, V: Vector<N>>(
    token: V::Token,
    origin: [V; 3],
    direction: [V; 3],
    [t_min, t_max]: [V; 2],
    largest: V,
) -> V {
    // 0 times a finite number is 0, times any other NaN.
    let zero = V::splat(token, 0.0);
    let of_origin = origin[0] * zero + origin[1] * zero + origin[2] * zero;
    let of_direction = direction[0] * zero + direction[1] * zero + direction[2] * zero;
    V::splat(token, LEAST_DIRECTION).le(largest)
        & largest.lt(V::splat(token, LONG_DIRECTION))
        & (of_origin + of_direction).le(zero)
        & t_min.le(t_max)
        & t_min.lt(V::splat(token, f32::INFINITY))
        & V::splat(token, f32::NEG_INFINITY).lt(t_max)
}

/// x, y and z of the origin and of the direction. The fourth number of each is of no meaning.
#[inline(always)]
pub(super) fn lanes(ray: &Ray) -> [f32x4; 2] {
    let numbers: &[f32; 8] = bytemuck::cast_ref(ray);
    let [ox, oy, oz, dx, dy, dz, t_min, _] = *numbers;
    [
        f32x4::new([ox, oy, oz, dx]),
        f32x4::new([dx, dy, dz, t_min]),
    ]
}

/// Whether origin and direction are.
#[inline(always)]
fn is_finite(ray: &Ray) -> bool {
    // 0 times a finite number is 0, times any other NaN.
    if Portable::ONE_BY_ONE {
        let numbers: &[f32; 8] = bytemuck::cast_ref(ray);
        return numbers[..6].iter().all(|x| x * 0.0 == 0.0);
    }
    let [origin, direction] = lanes(ray);
    let zero = f32x4::ZERO;
    let zeros = origin * zero + direction * zero;
    Vector::le(zeros, zero).bits() & 0b111 == 0b111
}

/// The number of the axes of the shear, `largest` being the direction's largest component. Without branches, for which axis
/// it is cannot be foreseen.
#[inline(always)]
fn axes_number(ray: &Ray, largest: f32) -> u32 {
    if Portable::ONE_BY_ONE {
        let not_x = usize::from(ray.direction.x.abs() != largest);
        let z = not_x + (not_x & usize::from(ray.direction.y.abs() != largest));
        // Not by glam's index, which branches.
        let negative = ray.direction.as_ref()[z].is_sign_negative();
        return (2 * z + usize::from(negative)) as u32;
    }
    let [_, direction] = lanes(ray);
    let largest = Vector::le(f32x4::splat(largest), direction.abs());
    let z = largest.bits().trailing_zeros();
    2 * z + (direction.bits() >> (z % 4) & 1)
}

/// Writes `ray` with its direction scaled so that the largest component is in [1, 2), or as near as powers
/// of two get. What `t` was multiplied by, and its inverse.
#[cold]
#[inline(never)]
fn scale_ray(ray: &Ray, largest: f32, scaled: &mut Ray) -> (f32, f32) {
    let exponent = largest.to_bits() >> 23;
    // 2^-e for a component of exponent e, kept to powers whose inverse is a normal number too.
    let inverse_exponent = 254u32.saturating_sub(exponent).clamp(1, 253);
    let unscale = f32::from_bits(inverse_exponent << 23);
    let scale = f32::from_bits((254 - inverse_exponent) << 23);
    *scaled = Ray {
        origin: ray.origin,
        direction: ray.direction * unscale,
        t_min: ray.t_min * scale,
        t_max: ray.t_max * scale,
    };
    (scale, unscale)
}

/// The axes of the shear by the axis of the largest direction component, and whether it is negative.
static SHEAR_AXES: [[usize; 3]; 8] = [
    [1, 2, 0],
    [2, 1, 0],
    [2, 0, 1],
    [0, 2, 1],
    [0, 1, 2],
    [1, 0, 2],
    // As many as three bits tell apart.
    [0, 1, 2],
    [1, 0, 2],
];

/// The greater of two numbers, neither of them NaN.
#[inline(always)]
pub(super) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The lesser of two numbers, neither of them NaN.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// 2 to the power `exponent`, which is within -126 to 127.
pub(crate) const fn pow2(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}
