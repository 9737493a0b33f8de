//! A vector of one float: what a target without vectors does with several, it does faster and in less code one by one.

use super::{Lanes, Portable, Vector};
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// One float.
#[derive(Clone, Copy)]
pub struct F32x1(pub f32);

impl F32x1 {
    #[inline(always)]
    fn of_mask(set: bool) -> Self {
        Self(f32::from_bits(0u32.wrapping_sub(set.into())))
    }
}

macro_rules! impl_operator {
    ($trait:ident, $method:ident, $a:ident, $b:ident, $result:expr) => {
        impl $trait for F32x1 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let ($a, $b) = (self.0, other.0);
                Self($result)
            }
        }
    };
}

impl_operator!(Add, add, a, b, a + b);
impl_operator!(Sub, sub, a, b, a - b);
impl_operator!(Mul, mul, a, b, a * b);
impl_operator!(Div, div, a, b, a / b);
impl_operator!(
    BitAnd,
    bitand,
    a,
    b,
    f32::from_bits(a.to_bits() & b.to_bits())
);
impl_operator!(
    BitOr,
    bitor,
    a,
    b,
    f32::from_bits(a.to_bits() | b.to_bits())
);

impl Lanes for F32x1 {
    type Token = Portable;
    type Array = [f32; 1];

    #[inline(always)]
    fn splat(_: Portable, x: f32) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 1] {
        [self.0]
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.to_bits() >> 31
    }
    #[inline(always)]
    fn least(self, _: Self) -> usize {
        0
    }
    #[inline(always)]
    unsafe fn compress(self, _: u32, to: *mut f32) {
        // SAFETY: the caller has room for one. Unwanted, it is what may follow.
        unsafe { to.write(self.0) };
    }
}

impl Vector<1> for F32x1 {
    #[inline(always)]
    fn load(_: Portable, &[x]: &[f32; 1]) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(if self.0 < other.0 { self.0 } else { other.0 })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(if self.0 > other.0 { self.0 } else { other.0 })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self {
        Self::of_mask(self.0 < other.0)
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self {
        Self::of_mask(self.0 <= other.0)
    }
    #[inline(always)]
    fn eq(self, other: Self) -> Self {
        Self::of_mask(self.0 == other.0)
    }
    #[inline(always)]
    fn select(self, yes: Self, no: Self) -> Self {
        if self.bits() != 0 { yes } else { no }
    }
    #[inline(always)]
    fn of_bits(_: Portable, bits: u32) -> Self {
        Self::of_mask(bits & 1 != 0)
    }
    #[inline(always)]
    fn permute(self, _: &[u8; 1]) -> Self {
        self
    }
    #[inline(always)]
    fn replace(self, _: Portable, _: usize, x: f32) -> Self {
        Self(x)
    }
}
