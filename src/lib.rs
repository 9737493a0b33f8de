#![no_std]
//! Ray queries over wide bounding volume hierarchies: which primitive does this ray hit first, and is
//! anything in the way.
//!
//! ```
//! use wide_bvh::{Builder, Ray, TriangleMesh};
//!
//! let positions = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0_f32]];
//! let indices = [[0, 1, 2_u32]];
//! let mesh = TriangleMesh::new(&positions, &indices)?;
//! let bvh = Builder::new().build(&mesh)?;
//!
//! let hit = bvh.closest_hit(&Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0])).unwrap();
//! assert_eq!((hit.primitive, hit.t), (0, 5.0));
//! assert!(!bvh.any_hit(&Ray::segment([0.25, 0.25, 0.0], [0.25, 0.25, 4.0])));
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! # What is promised
//!
//! 1. The answer of [`mod@reference`], bit for bit: of all primitives hit within the ray's range the one
//!    of least `t`, of equal ones the one of least number. The tree, its width, the processor, the number of
//!    threads that built it, and what other rays are asked about in the same call change nothing.
//! 2. No ray slips through a closed mesh whose triangles share their vertices' positions.
//! 3. A ray with a NaN, an infinite origin or direction, a zero direction or an empty range is no error: it hits
//!    nothing. No input to a safe function panics, hangs or reads out of bounds.
//!
//! # Where things are
//!
//! [`geometry`] has the boxes, rays, hits and meshes; [`build`] makes a hierarchy (with the feature `std`);
//! [`layout`] says how it lies in memory, and in [`layout::bytes`] in files; [`traverse`] lists the queries, which are
//! methods of [`layout::Bvh`]; [`primitive`] is for a caller's own primitives; [`simd`] chooses the instructions.
//!
//! # Features
//!
//! - `std` (default): the builder.
//! - `alloc`: hierarchies that own their memory. Without it they are borrowed slices.
//! - `rayon`: builds on all cores, and batches if asked to. Tree and answers are the same, bit for bit.

#[cfg(all(target_arch = "x86", not(target_feature = "sse2")))]
compile_error!(
    "answers are exact where each operation on floats rounds once: x87 rounds twice, so 32-bit x86 needs SSE2, \
    which i686 has"
);

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

#[cfg(feature = "std")]
pub mod build;
pub mod geometry;
pub mod layout;
pub mod primitive;
pub mod reference;
pub mod simd;
mod slab;
pub mod traverse;

pub use glam;

#[cfg(feature = "std")]
pub use build::{Builder, Preset};
pub use geometry::{Aabb, Hit, Ray, TriangleMesh};
#[cfg(feature = "alloc")]
pub use layout::{Bvh4, Bvh8};

/// The README's code, run as tests.
#[cfg(all(doctest, feature = "std"))]
#[doc = include_str!("../README.md")]
struct Readme;
