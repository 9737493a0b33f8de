//! The backend of any machine, over the `wide` crate: SSE2, NEON, simd128 or scalar, as compiled for.

use super::{Lanes, Simd, Vector};
use bytemuck::cast;
use wide::{f32x4, f32x8, u8x16, u8x32};

/// Whether a table of two vectors is read byte by byte in one instruction. SSSE3 and simd128 take two and more for one
/// vector: slower, by 3 and 5 %, than number by number.
const HAS_TABLES: bool = cfg!(all(target_feature = "neon", target_arch = "aarch64"));

/// The instructions that the program was compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Portable;

impl Simd for Portable {
    type F32x4 = f32x4;
    type F32x8 = f32x8;

    // What `wide` has vectors for.
    const ONE_BY_ONE: bool = !cfg!(any(
        target_feature = "sse",
        target_feature = "simd128",
        all(target_feature = "neon", target_arch = "aarch64")
    ));

    // With AVX `wide` has vectors of eight.
    const IN_FOURS: bool = !cfg!(target_feature = "avx");

    // Stacks are written lane by lane, which takes what interleaving gains and a sixth more. Miri, which has this backend
    // alone, is to see it nevertheless.
    const INTERLEAVES: bool = cfg!(miri);

    // Where there are tables.
    #[cfg(all(target_feature = "neon", target_arch = "aarch64"))]
    #[inline(always)]
    fn pick(self, from: f32x8, &[a, b, c, d]: &[u8; 4]) -> f32x4 {
        let [picked, _]: [f32x4; 2] = cast(from.permute(&[a, b, c, d, a, b, c, d]));
        picked
    }

    #[inline(always)]
    fn prefetch_line(self, _: *const u8) {}
}

macro_rules! impl_vector {
    ($vector:ty, $n:literal, $bytes:ty) => {
        impl Lanes for $vector {
            type Token = Portable;
            type Array = [f32; $n];

            #[inline(always)]
            fn splat(_: Portable, x: f32) -> Self {
                <$vector>::splat(x)
            }
            #[inline(always)]
            fn to_array(self) -> [f32; $n] {
                self.to_array()
            }
            #[inline(always)]
            fn bits(self) -> u32 {
                self.to_bitmask()
            }
            #[inline(always)]
            fn least(self, among: Self) -> usize {
                let (lanes, mut mask) = (self.to_array(), among.bits());
                let mut least = mask.trailing_zeros() as usize % $n;
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize % $n;
                    if lanes[lane] < lanes[least] {
                        least = lane;
                    }
                    mask &= mask - 1;
                }
                least
            }
            #[inline(always)]
            unsafe fn compress(self, mut mask: u32, mut to: *mut f32) {
                let lanes = self.to_array();
                while mask != 0 {
                    // SAFETY: no more floats than there are lanes, which the caller has room for.
                    unsafe {
                        to.write(lanes[mask.trailing_zeros() as usize % $n]);
                        to = to.add(1);
                    }
                    mask &= mask - 1;
                }
            }
        }

        impl Vector<$n> for $vector {
            #[inline(always)]
            fn load(_: Portable, lanes: &[f32; $n]) -> Self {
                <$vector>::new(*lanes)
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                self.mul_add(factor, addend)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                self.fast_min(other)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.fast_max(other)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn lt(self, other: Self) -> Self {
                self.simd_lt(other)
            }
            #[inline(always)]
            fn le(self, other: Self) -> Self {
                self.simd_le(other)
            }
            #[inline(always)]
            fn eq(self, other: Self) -> Self {
                self.simd_eq(other)
            }
            #[inline(always)]
            fn select(self, yes: Self, no: Self) -> Self {
                <$vector>::bitselect(self, yes, no)
            }
            #[inline(always)]
            fn of_bits(_: Portable, bits: u32) -> Self {
                let mut lanes = [0.0; $n];
                for (lane, set) in lanes.iter_mut().enumerate() {
                    *set = f32::from_bits(0u32.wrapping_sub(bits >> lane & 1));
                }
                <$vector>::new(lanes)
            }
            #[inline(always)]
            fn permute(self, lanes: &[u8; $n]) -> Self {
                if HAS_TABLES {
                    // The numbers of each lane's four bytes.
                    let bytes = lanes.map(|lane| {
                        (u32::from(lane) % $n * 0x0404_0404 + 0x0302_0100).to_le_bytes()
                    });
                    return cast(cast::<$vector, $bytes>(self).shuffle(cast(bytes)));
                }
                let from = self.to_array();
                <$vector>::new(lanes.map(|lane| from[lane as usize % $n]))
            }
        }
    };
}

impl_vector!(f32x4, 4, u8x16);
impl_vector!(f32x8, 8, u8x32);
