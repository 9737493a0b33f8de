//! The backend of x86-64 processors with AVX2, FMA and BMI: Haswell (2013), Zen (2017) and later.

use super::{Simd, Vector};
use core::arch::x86_64::*;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// A proof that the processor has AVX2, FMA, BMI1, BMI2 and POPCNT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx2(());

impl Avx2 {
    /// The token, if this processor has the instructions. Asks the processor once a program.
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        cpufeatures::new!(detected, "avx2", "fma", "bmi1", "bmi2", "popcnt");
        detected::get().then_some(Self(()))
    }
}

impl Simd for Avx2 {
    type F32x4 = F32x4;
    type F32x8 = F32x8;

    #[inline(always)]
    fn low(vector: F32x8) -> F32x4 {
        // SAFETY: the vector exists only where an `Avx2` token was given.
        F32x4(unsafe { _mm256_castps256_ps128(vector.0) })
    }

    #[inline(always)]
    fn prefetch(self, address: *const u8) {
        for line in 0..3 {
            // SAFETY: the token says that the instructions are there; a prefetch never faults.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(address.wrapping_add(64 * line).cast()) };
        }
    }
}

/// Four floats. Made from an [`Avx2`] token or another vector alone.
#[derive(Clone, Copy)]
pub struct F32x4(__m128);

/// Eight floats. Made from an [`Avx2`] token or another vector alone.
#[derive(Clone, Copy)]
pub struct F32x8(__m256);

macro_rules! impl_operator {
    ($vector:ident, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for $vector {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: a vector of this module exists only where an `Avx2` token was given.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

macro_rules! impl_vector {
    (
        $vector:ident, $n:literal, $splat:ident, $load:ident, $store:ident,
        $add:ident, $sub:ident, $mul:ident, $div:ident, $and:ident, $or:ident, $andnot:ident,
        $fmadd:ident, $min:ident, $max:ident, $cmp:ident, $blend:ident, $movemask:ident, $permute:expr
    ) => {
        impl_operator!($vector, Add, add, $add);
        impl_operator!($vector, Sub, sub, $sub);
        impl_operator!($vector, Mul, mul, $mul);
        impl_operator!($vector, Div, div, $div);
        impl_operator!($vector, BitAnd, bitand, $and);
        impl_operator!($vector, BitOr, bitor, $or);

        // SAFETY of every block below: `Avx2::detect` saw the instructions, and only its token, or a
        // vector made through it, gets here. Loads and stores are of whole arrays, unaligned.
        #[allow(clippy::undocumented_unsafe_blocks)]
        impl Vector<$n> for $vector {
            type Token = Avx2;

            #[inline(always)]
            fn splat(_: Avx2, x: f32) -> Self {
                Self(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn load(_: Avx2, lanes: &[f32; $n]) -> Self {
                Self(unsafe { $load(lanes.as_ptr()) })
            }
            #[inline(always)]
            fn to_array(self) -> [f32; $n] {
                let mut lanes = [0.0; $n];
                unsafe { $store(lanes.as_mut_ptr(), self.0) };
                lanes
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                Self(unsafe { $fmadd(self.0, factor.0, addend.0) })
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(unsafe { $andnot($splat(-0.0), self.0) })
            }
            #[inline(always)]
            fn lt(self, other: Self) -> Self {
                Self(unsafe { $cmp::<_CMP_LT_OQ>(self.0, other.0) })
            }
            #[inline(always)]
            fn le(self, other: Self) -> Self {
                Self(unsafe { $cmp::<_CMP_LE_OQ>(self.0, other.0) })
            }
            #[inline(always)]
            fn select(self, yes: Self, no: Self) -> Self {
                Self(unsafe { $blend(no.0, yes.0, self.0) })
            }
            #[inline(always)]
            fn bits(self) -> u32 {
                unsafe { $movemask(self.0) as u32 }
            }
            #[inline(always)]
            fn permute(self, lanes: &[u8; $n]) -> Self {
                Self(unsafe { $permute(self.0, lanes) })
            }
        }
    };
}

impl_vector!(
    F32x4,
    4,
    _mm_set1_ps,
    _mm_loadu_ps,
    _mm_storeu_ps,
    _mm_add_ps,
    _mm_sub_ps,
    _mm_mul_ps,
    _mm_div_ps,
    _mm_and_ps,
    _mm_or_ps,
    _mm_andnot_ps,
    _mm_fmadd_ps,
    _mm_min_ps,
    _mm_max_ps,
    _mm_cmp_ps,
    _mm_blendv_ps,
    _mm_movemask_ps,
    |vector, lanes: &[u8; 4]| {
        let lanes = _mm_cvtsi32_si128(i32::from_le_bytes(*lanes));
        _mm_permutevar_ps(vector, _mm_cvtepu8_epi32(lanes))
    }
);

impl_vector!(
    F32x8,
    8,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_div_ps,
    _mm256_and_ps,
    _mm256_or_ps,
    _mm256_andnot_ps,
    _mm256_fmadd_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    _mm256_cmp_ps,
    _mm256_blendv_ps,
    _mm256_movemask_ps,
    |vector, lanes: &[u8; 8]| {
        let lanes = _mm_cvtsi64_si128(i64::from_le_bytes(*lanes));
        _mm256_permutevar8x32_ps(vector, _mm256_cvtepu8_epi32(lanes))
    }
);
