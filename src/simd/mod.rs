//! The few vector operations the kernels need, once for each instruction set, and the choice between them.
//!
//! A backend is a zero-sized token, [`Portable`] or `Avx2`, that exists only where its instructions do:
//! vectors are made through a token, so everything built on them is safe code. [`Backend`] is the choice
//! made when running; [`Backend::run`] is the one place where it is acted on.
//!
//! Operations that decide a hit (`+ - * /`, comparisons, [`Vector::select`], [`Vector::permute`]) give the
//! same bits on every backend. [`Vector::mul_add`], [`Vector::min`] and [`Vector::max`] may differ in
//! rounding, NaN and the sign of zero; the box test uses them, and is conservative.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod backend;
mod portable;
mod vector;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
pub use backend::Backend;
pub(crate) use backend::Operation;
pub(crate) use portable::Portable;
pub(crate) use vector::{Simd, Vector, splat3};
