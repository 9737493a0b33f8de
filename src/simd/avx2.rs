//! The backend of x86-64 processors with AVX2, FMA and BMI: Haswell (2013), Zen (2017) and later; and what that of
//! [AVX-512](super::avx512) has of it.

use super::{
    Lanes, PacketOperation, Simd, Vector, avx512,
    vector::{MAX_RUN, RUN_FIRST_BITS, load_all},
};
use core::arch::x86_64::*;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// A proof that the processor has AVX2, FMA, BMI1, BMI2 and POPCNT, and with `AVX512` its F, VL, DQ and BW as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct X86<const AVX512: bool>(());

/// Without AVX-512, or not asked for it.
pub type Avx2 = X86<false>;

impl Avx2 {
    /// The token, if this processor has the instructions. Asks the processor once a program.
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        cpufeatures::new!(detected, "avx2", "fma", "bmi1", "bmi2", "popcnt");
        detected::get().then_some(X86(()))
    }

    /// With AVX-512.
    ///
    /// # Safety
    /// The processor has it: F, VL, DQ and BW.
    #[inline(always)]
    pub(super) unsafe fn with_avx512(self) -> X86<true> {
        X86(())
    }
}

impl<const AVX512: bool> Simd for X86<AVX512> {
    type F32x4 = F32x4<AVX512>;
    type F32x8 = F32x8<AVX512>;

    const FETCHES: bool = true;
    const INTERLEAVES: bool = true;

    #[inline(always)]
    fn transpose(self, rows: [Self::F32x8; 8]) -> [Self::F32x8; 8] {
        // SAFETY: the token says that the instructions are there.
        unsafe { transpose(rows) }
    }

    #[inline(always)]
    fn coordinates(self, points: [&[f32; 3]; 4]) -> [Self::F32x4; 3] {
        // SAFETY: the token says that the instructions are there.
        unsafe { coordinates(points) }
    }

    #[inline(always)]
    fn in_packets<O: PacketOperation>(self, operation: O) -> O::Output {
        if AVX512 {
            // Of this very type: it stands for the same.
            operation.run::<16, avx512::F32x16>(X86(()))
        } else {
            operation.run::<8, Self::F32x8>(self)
        }
    }

    #[inline(always)]
    fn prefetch_line(self, address: *const u8) {
        // SAFETY: the token says that the instructions are there; a prefetch never faults.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) };
    }
}

/// Four floats. Made from an [`X86`] token or another vector alone.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct F32x4<const AVX512: bool>(__m128);

/// Eight floats. Made from an [`X86`] token or another vector alone.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct F32x8<const AVX512: bool>(__m256);

macro_rules! impl_operator {
    ([$($generic:tt)*] $vector:ty, $trait:ident, $method:ident, $intrinsic:ident) => {
        impl<$($generic)*> $trait for $vector {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: a vector exists only where the token for its instructions was given.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

/// `$vector`, with the instructions named, and what else it has of [`Vector`].
macro_rules! impl_vector {
    (
        [$($generic:tt)*] $vector:ty, $token:ty, $n:literal,
        $splat:ident, $load:ident, $store:ident,
        $add:ident, $sub:ident, $mul:ident, $div:ident, $and:ident, $or:ident, $andnot:ident,
        $fmadd:ident, $min:ident, $max:ident, $cmp:ident, $blend:ident, $movemask:ident, $permute:ident,
        $least:ident, $compress:ident, $of_bits:ident, $of_bytes:ident,
        $to_int:ident, $from_int:ident, $max_int:ident, $min_int:ident,
        { $($more:tt)* }
    ) => {
        impl_operator!([$($generic)*] $vector, Add, add, $add);
        impl_operator!([$($generic)*] $vector, Sub, sub, $sub);
        impl_operator!([$($generic)*] $vector, Mul, mul, $mul);
        impl_operator!([$($generic)*] $vector, Div, div, $div);
        impl_operator!([$($generic)*] $vector, BitAnd, bitand, $and);
        impl_operator!([$($generic)*] $vector, BitOr, bitor, $or);

        // SAFETY of every block below: the processor was seen to have the instructions, and only the token for that, or a
        // vector made through it, gets here. Loads and stores are of whole arrays, unaligned; but for `compress`, which
        // writes where its caller promises room for a vector.
        #[allow(clippy::undocumented_unsafe_blocks)]
        impl<$($generic)*> Lanes for $vector {
            type Token = $token;
            type Array = [f32; $n];

            #[inline(always)]
            fn splat(_: $token, x: f32) -> Self {
                Self(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn to_array(self) -> [f32; $n] {
                let mut lanes = [0.0; $n];
                unsafe { $store(lanes.as_mut_ptr(), self.0) };
                lanes
            }
            #[inline(always)]
            fn bits(self) -> u32 {
                unsafe { $movemask(self.0) as u32 }
            }
            #[inline(always)]
            fn least(self, among: Self) -> usize {
                unsafe { $least(self.0, among.0) }
            }
            #[inline(always)]
            unsafe fn compress(self, mask: u32, to: *mut f32) {
                unsafe { $store(to, $compress(self.0, mask)) };
            }
        }

        #[allow(clippy::undocumented_unsafe_blocks)]
        impl<$($generic)*> Vector<$n> for $vector {
            #[inline(always)]
            fn load(_: $token, lanes: &[f32; $n]) -> Self {
                Self(unsafe { $load(lanes.as_ptr()) })
            }
            #[inline(always)]
            fn of_bytes(_: $token, bytes: &[u8; $n]) -> Self {
                Self(unsafe { $of_bytes(bytes) })
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
            fn max_from_zero(self, other: Self) -> Self {
                Self(unsafe { $from_int($max_int($to_int(self.0), $to_int(other.0))) })
            }
            #[inline(always)]
            fn min_from_zero(self, other: Self) -> Self {
                Self(unsafe { $from_int($min_int($to_int(self.0), $to_int(other.0))) })
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
            fn eq(self, other: Self) -> Self {
                Self(unsafe { $cmp::<_CMP_EQ_OQ>(self.0, other.0) })
            }
            #[inline(always)]
            fn select(self, yes: Self, no: Self) -> Self {
                Self(unsafe { $blend(no.0, yes.0, self.0) })
            }
            #[inline(always)]
            fn of_bits(_: $token, bits: u32) -> Self {
                Self(unsafe { $of_bits(bits) })
            }
            #[inline(always)]
            fn permute(self, lanes: &[u8; $n]) -> Self {
                Self(unsafe { $permute(self.0, lanes) })
            }
            $($more)*
        }
    };
}
pub(super) use {impl_operator, impl_vector};

impl_vector!(
    [const AVX512: bool]
    F32x4<AVX512>,
    X86<AVX512>,
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
    permute4,
    least4,
    compress4,
    of_bits4,
    of_bytes4,
    _mm_castps_si128,
    _mm_castsi128_ps,
    _mm_max_epi32,
    _mm_min_epi32,
    {
        #[inline(always)]
        fn links(_: X86<AVX512>, ends: &[u8; 4], base: u32, stride: u32, first: u32) -> Self {
            // SAFETY: as above.
            Self(unsafe { links4(ends, base, stride, first) })
        }
    }
);

impl_vector!(
    [const AVX512: bool]
    F32x8<AVX512>,
    X86<AVX512>,
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
    permute8,
    least8,
    compress8,
    of_bits8,
    of_bytes8,
    _mm256_castps_si256,
    _mm256_castsi256_ps,
    _mm256_max_epi32,
    _mm256_min_epi32,
    {
        #[inline(always)]
        fn links(_: X86<AVX512>, ends: &[u8; 8], base: u32, stride: u32, first: u32) -> Self {
            // SAFETY: as above.
            Self(unsafe { links8(ends, base, stride, first) })
        }

        #[inline(always)]
        fn columns(token: X86<AVX512>, rows: [&[f32; 8]; 8]) -> [Self; 8] {
            token.transpose(load_all(token, rows))
        }
    }
);

/// For a mask of lanes, their numbers in order.
//
// Not a static: another crate's code would look its address up first.
const COMPRESSED: &[[u8; 8]; 256] = &{
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 != 0 {
                table[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

// SAFETY of what follows: called with vectors of this module alone, which exist only where an [`X86`] token was given.

#[inline]
#[target_feature(enable = "avx2")]
fn permute4(vector: __m128, lanes: &[u8; 4]) -> __m128 {
    let lanes = _mm_cvtsi32_si128(i32::from_le_bytes(*lanes));
    _mm_permutevar_ps(vector, _mm_cvtepu8_epi32(lanes))
}

#[inline]
#[target_feature(enable = "avx2")]
fn permute8(vector: __m256, lanes: &[u8; 8]) -> __m256 {
    let lanes = _mm_cvtsi64_si128(i64::from_le_bytes(*lanes));
    _mm256_permutevar8x32_ps(vector, _mm256_cvtepu8_epi32(lanes))
}

#[inline]
#[target_feature(enable = "avx2")]
fn compress4(vector: __m128, mask: u32) -> __m128 {
    let [a, b, c, d, ..] = COMPRESSED[mask as usize % 16];
    permute4(vector, &[a, b, c, d])
}

#[inline]
#[target_feature(enable = "avx2")]
fn compress8(vector: __m256, mask: u32) -> __m256 {
    permute8(vector, &COMPRESSED[mask as usize % 256])
}

#[inline]
#[target_feature(enable = "avx2")]
fn of_bytes4(bytes: &[u8; 4]) -> __m128 {
    let bytes = _mm_cvtsi32_si128(i32::from_le_bytes(*bytes));
    _mm_cvtepi32_ps(_mm_cvtepu8_epi32(bytes))
}

#[inline]
#[target_feature(enable = "avx2")]
fn of_bytes8(bytes: &[u8; 8]) -> __m256 {
    // Sooner than by `vpmovzxbd`, which crosses halves: loads broadcast by themselves.
    const NONE: i8 = -1;
    let spread = _mm256_setr_epi8(
        0, NONE, NONE, NONE, 1, NONE, NONE, NONE, 2, NONE, NONE, NONE, 3, NONE, NONE, NONE, 4,
        NONE, NONE, NONE, 5, NONE, NONE, NONE, 6, NONE, NONE, NONE, 7, NONE, NONE, NONE,
    );
    let bytes = _mm256_set1_epi64x(i64::from_le_bytes(*bytes));
    _mm256_cvtepi32_ps(_mm256_shuffle_epi8(bytes, spread))
}

#[inline]
#[target_feature(enable = "avx2")]
fn links4(ends: &[u8; 4], base: u32, stride: u32, first: u32) -> __m128 {
    let ends = u32::from_le_bytes(*ends);
    let starts = _mm_cvtepu8_epi32(_mm_cvtsi32_si128((ends << 8) as i32));
    let ends = _mm_cvtepu8_epi32(_mm_cvtsi32_si128(ends as i32));
    let lanes = _mm_setr_epi32(0, 1, 2, 3);
    let strides = _mm_mullo_epi32(lanes, _mm_set1_epi32(stride as i32));
    let nodes = _mm_add_epi32(_mm_set1_epi32(base as i32), strides);
    let first = _mm_add_epi32(_mm_set1_epi32(first as i32), starts);
    let first = _mm_and_si128(first, _mm_set1_epi32((1 << RUN_FIRST_BITS) - 1));
    let counts = _mm_sub_epi32(_mm_sub_epi32(ends, starts), _mm_set1_epi32(1));
    let counts = _mm_slli_epi32::<{ RUN_FIRST_BITS as i32 }>(_mm_and_si128(
        counts,
        _mm_set1_epi32(MAX_RUN as i32 - 1),
    ));
    let leaves = _mm_or_si128(_mm_or_si128(first, counts), _mm_set1_epi32(i32::MIN));
    let is_node = _mm_cmpeq_epi32(ends, _mm_setzero_si128());
    _mm_castsi128_ps(_mm_blendv_epi8(leaves, nodes, is_node))
}

#[inline]
#[target_feature(enable = "avx2")]
fn links8(ends: &[u8; 8], base: u32, stride: u32, first: u32) -> __m256 {
    let ends = u64::from_le_bytes(*ends);
    let starts = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128((ends << 8) as i64));
    let ends = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(ends as i64));
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let strides = _mm256_mullo_epi32(lanes, _mm256_set1_epi32(stride as i32));
    let nodes = _mm256_add_epi32(_mm256_set1_epi32(base as i32), strides);
    let first = _mm256_add_epi32(_mm256_set1_epi32(first as i32), starts);
    let first = _mm256_and_si256(first, _mm256_set1_epi32((1 << RUN_FIRST_BITS) - 1));
    let counts = _mm256_sub_epi32(_mm256_sub_epi32(ends, starts), _mm256_set1_epi32(1));
    let counts = _mm256_slli_epi32::<{ RUN_FIRST_BITS as i32 }>(_mm256_and_si256(
        counts,
        _mm256_set1_epi32(MAX_RUN as i32 - 1),
    ));
    let leaves = _mm256_or_si256(_mm256_or_si256(first, counts), _mm256_set1_epi32(i32::MIN));
    let is_node = _mm256_cmpeq_epi32(ends, _mm256_setzero_si256());
    _mm256_castsi256_ps(_mm256_blendv_epi8(leaves, nodes, is_node))
}

#[inline]
#[target_feature(enable = "avx2")]
fn of_bits4(bits: u32) -> __m128 {
    let lanes = _mm_setr_epi32(1, 2, 4, 8);
    let set = _mm_and_si128(_mm_set1_epi32(bits as i32), lanes);
    _mm_castsi128_ps(_mm_cmpeq_epi32(set, lanes))
}

#[inline]
#[target_feature(enable = "avx2")]
fn of_bits8(bits: u32) -> __m256 {
    let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
    _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lanes))
}

/// Numbers as integers, which are ordered alike if they are not negative, with their lane in the lowest bits.
#[inline]
#[target_feature(enable = "avx2")]
fn least8(numbers: __m256, among: __m256) -> usize {
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let numbers = _mm256_and_si256(_mm256_castps_si256(numbers), _mm256_set1_epi32(!7));
    let numbers = _mm256_castsi256_ps(_mm256_or_si256(numbers, lanes));
    let most = _mm256_castsi256_ps(_mm256_set1_epi32(i32::MAX));
    let keys = _mm256_castps_si256(_mm256_blendv_ps(most, numbers, among));
    let halves = _mm_min_epi32(
        _mm256_castsi256_si128(keys),
        _mm256_extracti128_si256::<1>(keys),
    );
    least_key(halves)
}

#[inline]
#[target_feature(enable = "avx2")]
fn least4(numbers: __m128, among: __m128) -> usize {
    let lanes = _mm_setr_epi32(0, 1, 2, 3);
    let numbers = _mm_and_si128(_mm_castps_si128(numbers), _mm_set1_epi32(!7));
    let numbers = _mm_castsi128_ps(_mm_or_si128(numbers, lanes));
    let most = _mm_castsi128_ps(_mm_set1_epi32(i32::MAX - 4));
    least_key(_mm_castps_si128(_mm_blendv_ps(most, numbers, among)))
}

/// The three lowest bits of the least.
#[inline]
#[target_feature(enable = "avx2")]
fn least_key(keys: __m128i) -> usize {
    let pairs = _mm_min_epi32(keys, _mm_shuffle_epi32::<0b01_00_11_10>(keys));
    let least = _mm_min_epi32(pairs, _mm_shuffle_epi32::<0b10_11_00_01>(pairs));
    (_mm_cvtsi128_si32(least) & 7) as usize
}

#[inline]
#[target_feature(enable = "avx2")]
fn coordinates<const AVX512: bool>(points: [&[f32; 3]; 4]) -> [F32x4<AVX512>; 3] {
    let [a, b, c, d] = points;
    // By twos and ones: a masked load of three is many times as slow on the first Zens.
    // SAFETY: two floats, then the third, of each.
    let (ab, cd, z) = unsafe {
        (
            _mm_loadh_pd(_mm_load_sd(a.as_ptr().cast()), b.as_ptr().cast()),
            _mm_loadh_pd(_mm_load_sd(c.as_ptr().cast()), d.as_ptr().cast()),
            _mm_setr_ps(a[2], b[2], c[2], d[2]),
        )
    };
    let (ab, cd) = (_mm_castpd_ps(ab), _mm_castpd_ps(cd));
    [
        F32x4(_mm_shuffle_ps::<0b10_00_10_00>(ab, cd)),
        F32x4(_mm_shuffle_ps::<0b11_01_11_01>(ab, cd)),
        F32x4(z),
    ]
}

#[inline]
#[target_feature(enable = "avx2")]
fn transpose<const AVX512: bool>(rows: [F32x8<AVX512>; 8]) -> [F32x8<AVX512>; 8] {
    let [
        F32x8(r0),
        F32x8(r1),
        F32x8(r2),
        F32x8(r3),
        F32x8(r4),
        F32x8(r5),
        F32x8(r6),
        F32x8(r7),
    ] = rows;
    // Pairs of rows, then fours, within each half of a vector; then the halves.
    let (a, b) = (_mm256_unpacklo_ps(r0, r1), _mm256_unpackhi_ps(r0, r1));
    let (c, d) = (_mm256_unpacklo_ps(r2, r3), _mm256_unpackhi_ps(r2, r3));
    let (e, f) = (_mm256_unpacklo_ps(r4, r5), _mm256_unpackhi_ps(r4, r5));
    let (g, h) = (_mm256_unpacklo_ps(r6, r7), _mm256_unpackhi_ps(r6, r7));
    const LOW: i32 = 0b01_00_01_00;
    const HIGH: i32 = 0b11_10_11_10;
    let (ac0, ac1) = (
        _mm256_shuffle_ps::<LOW>(a, c),
        _mm256_shuffle_ps::<HIGH>(a, c),
    );
    let (bd0, bd1) = (
        _mm256_shuffle_ps::<LOW>(b, d),
        _mm256_shuffle_ps::<HIGH>(b, d),
    );
    let (eg0, eg1) = (
        _mm256_shuffle_ps::<LOW>(e, g),
        _mm256_shuffle_ps::<HIGH>(e, g),
    );
    let (fh0, fh1) = (
        _mm256_shuffle_ps::<LOW>(f, h),
        _mm256_shuffle_ps::<HIGH>(f, h),
    );
    [
        F32x8(_mm256_permute2f128_ps::<0x20>(ac0, eg0)),
        F32x8(_mm256_permute2f128_ps::<0x20>(ac1, eg1)),
        F32x8(_mm256_permute2f128_ps::<0x20>(bd0, fh0)),
        F32x8(_mm256_permute2f128_ps::<0x20>(bd1, fh1)),
        F32x8(_mm256_permute2f128_ps::<0x31>(ac0, eg0)),
        F32x8(_mm256_permute2f128_ps::<0x31>(ac1, eg1)),
        F32x8(_mm256_permute2f128_ps::<0x31>(bd0, fh0)),
        F32x8(_mm256_permute2f128_ps::<0x31>(bd1, fh1)),
    ]
}
