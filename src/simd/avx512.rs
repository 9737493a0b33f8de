//! The backend of x86-64 processors with AVX-512: Skylake servers (2017), Zen 4 (2022) and later.
//!
//! Its vectors of 4 and 8 are those of AVX2: twice as many registers hold them, so that nothing of a ray is put away at
//! a leaf and fetched again, and comparisons and logic take fewer instructions. Packets of rays are 16.

use super::{
    Lanes, Vector,
    avx2::{Avx2, X86, impl_operator, impl_vector},
};
use core::arch::x86_64::*;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// With AVX-512.
pub type Avx512 = X86<true>;

impl Avx512 {
    /// The token, if this processor has the instructions. Asks the processor once a program.
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        cpufeatures::new!(detected, "avx512f", "avx512vl", "avx512dq", "avx512bw");
        let avx2 = Avx2::detect()?;
        // SAFETY: they were just seen.
        detected::get().then(|| unsafe { avx2.with_avx512() })
    }
}

/// Sixteen floats. Made from an [`Avx512`] token or another vector alone.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct F32x16(__m512);

impl_vector!(
    []
    F32x16,
    Avx512,
    16,
    _mm512_set1_ps,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_div_ps,
    _mm512_and_ps,
    _mm512_or_ps,
    _mm512_andnot_ps,
    _mm512_fmadd_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    compare,
    blend,
    mask_of,
    permute,
    least,
    compress,
    of_bits,
    of_bytes,
    _mm512_castps_si512,
    _mm512_castsi512_ps,
    _mm512_max_epi32,
    _mm512_min_epi32,
    {
        #[inline(always)]
        fn columns(_: Avx512, rows: [&[f32; 8]; 16]) -> [Self; 8] {
            // SAFETY: as above.
            unsafe { columns(rows) }
        }
    }
);

// SAFETY of what follows: called with vectors of this module alone, or where an `Avx512` token was given.
//
// A comparison's outcome is a mask in a register of its own, here; as a vector it is one only for the compiler, which has it
// vanish where it is asked for bits or chooses between numbers.

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn compare<const PREDICATE: i32>(a: __m512, b: __m512) -> __m512 {
    of_mask(_mm512_cmp_ps_mask::<PREDICATE>(a, b))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn of_mask(mask: __mmask16) -> __m512 {
    _mm512_castsi512_ps(_mm512_movm_epi32(mask))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn mask_of(lanes: __m512) -> __mmask16 {
    _mm512_movepi32_mask(_mm512_castps_si512(lanes))
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn of_bits(bits: u32) -> __m512 {
    of_mask(bits as __mmask16)
}

#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn blend(no: __m512, yes: __m512, lanes: __m512) -> __m512 {
    _mm512_mask_blend_ps(mask_of(lanes), no, yes)
}

#[inline]
#[target_feature(enable = "avx512f")]
fn compress(lanes: __m512, mask: u32) -> __m512 {
    _mm512_maskz_compress_ps(mask as __mmask16, lanes)
}

#[inline]
#[target_feature(enable = "avx512f")]
fn integers(bytes: &[u8; 16]) -> __m512i {
    // SAFETY: sixteen bytes.
    _mm512_cvtepu8_epi32(unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) })
}

#[inline]
#[target_feature(enable = "avx512f")]
fn permute(vector: __m512, lanes: &[u8; 16]) -> __m512 {
    _mm512_permutexvar_ps(integers(lanes), vector)
}

#[inline]
#[target_feature(enable = "avx512f")]
fn of_bytes(bytes: &[u8; 16]) -> __m512 {
    _mm512_cvtepi32_ps(integers(bytes))
}

/// Numbers as integers, with their lane in the lowest bits.
#[inline]
#[target_feature(enable = "avx512f,avx512dq")]
fn least(numbers: __m512, among: __m512) -> usize {
    let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    let keys = _mm512_and_si512(_mm512_castps_si512(numbers), _mm512_set1_epi32(!15));
    let keys = _mm512_or_si512(keys, lanes);
    (_mm512_mask_reduce_min_epi32(mask_of(among), keys) & 15) as usize
}

#[inline]
#[target_feature(enable = "avx512f")]
fn columns(rows: [&[f32; 8]; 16]) -> [F32x16; 8] {
    let [a, b, c, d] = columns_from::<0>(rows);
    let [e, f, g, h] = columns_from::<4>(rows);
    [a, b, c, d, e, f, g, h]
}

/// Four of them.
#[inline]
#[target_feature(enable = "avx512f")]
fn columns_from<const FIRST: usize>(rows: [&[f32; 8]; 16]) -> [F32x16; 4] {
    let (a, b) = (fours::<FIRST, 0>(rows), fours::<FIRST, 1>(rows));
    let (c, d) = (fours::<FIRST, 2>(rows), fours::<FIRST, 3>(rows));
    let (ab0, ab1) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
    let (cd0, cd1) = (_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
    const LOW: i32 = 0b01_00_01_00;
    const HIGH: i32 = 0b11_10_11_10;
    [
        F32x16(_mm512_shuffle_ps::<LOW>(ab0, cd0)),
        F32x16(_mm512_shuffle_ps::<HIGH>(ab0, cd0)),
        F32x16(_mm512_shuffle_ps::<LOW>(ab1, cd1)),
        F32x16(_mm512_shuffle_ps::<HIGH>(ab1, cd1)),
    ]
}

/// Of every fourth row from `ROW` on, four numbers.
#[inline]
#[target_feature(enable = "avx512f")]
fn fours<const FIRST: usize, const ROW: usize>(rows: [&[f32; 8]; 16]) -> __m512 {
    const { assert!(FIRST + 4 <= 8 && ROW + 12 < 16) };
    // SAFETY: four numbers of a row's eight.
    let [a, b, c, d] = unsafe {
        [
            _mm_loadu_ps(rows[ROW].as_ptr().add(FIRST)),
            _mm_loadu_ps(rows[ROW + 4].as_ptr().add(FIRST)),
            _mm_loadu_ps(rows[ROW + 8].as_ptr().add(FIRST)),
            _mm_loadu_ps(rows[ROW + 12].as_ptr().add(FIRST)),
        ]
    };
    let ab = _mm512_insertf32x4::<1>(_mm512_castps128_ps512(a), b);
    _mm512_insertf32x4::<3>(_mm512_insertf32x4::<2>(ab, c), d)
}
