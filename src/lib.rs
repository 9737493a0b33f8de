#![no_std]
//! Wide bounding volume hierarchies.

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod geometry;
pub mod layout;
pub mod primitive;
pub mod reference;
pub mod simd;
mod slab;
pub mod traverse;

//#[cfg(feature = "std")]
//pub mod build;
