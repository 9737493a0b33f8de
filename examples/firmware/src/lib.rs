#![no_std]
//! What lies in flash, and the hierarchy over it: nothing is copied.

use wide_bvh::{geometry::Ray, layout::OrderedMeshBvh4};

/// As aligned as anything that is baked has to be.
#[repr(C, align(64))]
struct Aligned<T: ?Sized>(T);

macro_rules! baked {
    ($name:literal) => {{
        static BYTES: &Aligned<[u8]> = &Aligned(*include_bytes!(concat!(
            env!("OUT_DIR"),
            "/",
            $name,
            ".bin"
        )));
        &BYTES.0
    }};
}

/// The hierarchy and the mesh that it is over, checked once. `None` if what was baked is none.
pub fn open() -> Option<OrderedMeshBvh4<'static>> {
    OrderedMeshBvh4::from_bytes(baked!("scene")).ok()
}

/// Rays of every kind.
pub fn rays() -> &'static [Ray] {
    bytemuck::cast_slice(baked!("rays"))
}

/// Their hits, as bits: `t`, `u`, `v` and the triangle's number, all bits set for a miss.
pub fn hits() -> &'static [[u32; 4]] {
    bytemuck::cast_slice(baked!("hits"))
}
