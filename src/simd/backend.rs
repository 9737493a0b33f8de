//! The choice of instruction set when running.

#[cfg(target_arch = "x86_64")]
use super::{Avx2, Avx512};
use super::{Portable, Simd, Vector};
use core::fmt;

/// A set of instructions that this processor has.
///
/// Hierarchies choose the fastest by themselves; every backend gives the same answers, bit for bit, so
/// another is of use to compare and to test alone.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Backend(Kind);

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

/// Something to be done with vectors, whatever the backend.
pub trait Operation: Sized {
    /// What comes of it.
    type Output;
    /// Does it. To be marked `#[inline(always)]`, or the backend's instructions do not reach it.
    fn run<S: Simd>(self, token: S) -> Self::Output;
}

/// Something to be done with packets of rays, one a lane, however many lanes there are.
pub trait PacketOperation {
    /// What comes of it.
    type Output;
    /// Does it. To be marked `#[inline(always)]`, as [`Operation::run`] is.
    fn run<const N: usize, V: Vector<N>>(self, token: V::Token) -> Self::Output;
}

impl Backend {
    /// What the program was compiled for: SSE2, NEON or simd128 where the target has it, else scalar.
    pub const PORTABLE: Self = Self(Kind::Portable);

    /// The fastest backend of this processor.
    #[inline]
    pub fn detect() -> Self {
        Self::available().next().unwrap_or(Self::PORTABLE)
    }

    /// Every backend of this processor, the fastest first.
    #[inline]
    pub fn available() -> impl Iterator<Item = Self> {
        [
            #[cfg(target_arch = "x86_64")]
            Avx512::detect().map(Kind::Avx512),
            #[cfg(target_arch = "x86_64")]
            Avx2::detect().map(Kind::Avx2),
            Some(Kind::Portable),
        ]
        .into_iter()
        .flatten()
        .map(Self)
    }

    /// A short name: `portable`, `avx2` or `avx512`.
    pub const fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => "avx512",
        }
    }

    /// As [`run`](Self::run), by a call, so that what `operation` needs of registers is not taken from the caller's.
    #[inline(never)]
    pub(crate) fn call<O: Operation>(self, operation: O) -> O::Output {
        self.run(operation)
    }

    /// Does `operation` with this backend's instructions: one predictable branch.
    #[inline(always)]
    pub(crate) fn run<O: Operation>(self, operation: O) -> O::Output {
        match self.0 {
            Kind::Portable => operation.on_portable(),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the token says that the processor has these instructions.
            Kind::Avx2(avx2) => unsafe { operation.on_avx2(avx2) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Kind::Avx512(avx512) => unsafe { operation.on_avx512(avx512) },
        }
    }
}

/// An operation on each backend.
///
/// Methods of the operation, not functions: compilers sort code by the module of what a method is of, and what they so put
/// together is compiled by one thread. All there is of queries and builds is in here.
trait On: Operation {
    /// A call where the others are: their callers' frames have no part of its own.
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    fn on_portable(self) -> Self::Output {
        self.run(Portable)
    }

    /// # Safety
    /// The processor has these instructions, as the token says.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
    unsafe fn on_avx2(self, token: Avx2) -> Self::Output {
        self.run(token)
    }

    /// # Safety
    /// The processor has these instructions, as the token says.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
    unsafe fn on_avx512(self, token: Avx512) -> Self::Output {
        self.run(token)
    }
}

impl<O: Operation> On for O {}

impl Default for Backend {
    fn default() -> Self {
        Self::detect()
    }
}

impl fmt::Debug for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
