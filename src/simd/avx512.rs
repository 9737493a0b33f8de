//! The backend of x86-64 processors with AVX-512: Skylake servers (2017), Zen 4 (2022) and later.
//!
//! Its vectors are those of [`Avx2`]: twice as many registers hold them, so that nothing of a ray is put away at
//! a leaf and fetched again, and comparisons and logic take fewer instructions.

use super::Avx2;

/// A proof that the processor has AVX-512 F, VL, DQ and BW, and what [`Avx2`] stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx512(Avx2);

impl Avx512 {
    /// The token, if this processor has the instructions. Asks the processor once a program.
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        cpufeatures::new!(detected, "avx512f", "avx512vl", "avx512dq", "avx512bw");
        let avx2 = Avx2::detect()?;
        detected::get().then_some(Self(avx2))
    }

    /// The token of its vectors.
    #[inline(always)]
    pub(super) fn vectors(self) -> Avx2 {
        self.0
    }
}
