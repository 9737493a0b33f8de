//! The choice of instructions when running.
//!
//! A hierarchy takes the fastest [`Backend`] that the processor has. Every one gives the same answers, bit for bit.

// The few vector operations that the kernels need are here once for each instruction set. Every one that decides a hit
// gives the same bits on all of them.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod backend;
mod one;
mod portable;
#[cfg(test)]
mod tests;
mod vector;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
pub use backend::Backend;
pub(crate) use backend::{Operation, PacketOperation};
pub(crate) use one::F32x1;
pub(crate) use portable::Portable;
pub(crate) use vector::{
    Lanes, MAX_RUN, PREFETCHED, RUN_FIRST_BITS, Simd, Vector, packed_run, splat3,
};
