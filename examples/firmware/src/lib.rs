#![no_std]
//! What lies in flash, and the hierarchy over it: nothing is copied.

use wide_bvh::{
    geometry::{Aabb, Ray, TriangleMesh},
    layout::CompactBvh4Ref,
};

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
        bytemuck::cast_slice(&BYTES.0)
    }};
}

/// The hierarchy, checked once. `None` if what was baked is none.
pub fn open() -> Option<CompactBvh4Ref<'static>> {
    let bounds: &[Aabb] = baked!("bounds");
    CompactBvh4Ref::from_parts(baked!("nodes"), (), baked!("primitives"), *bounds.first()?).ok()
}

/// The mesh that it is over. `None` if what was baked is none.
pub fn mesh() -> Option<TriangleMesh<'static>> {
    let positions: &[[f32; 3]] = baked!("positions");
    let indices: &[[u32; 3]] = baked!("indices");
    TriangleMesh::new(positions, indices).ok()
}

/// Rays of every kind.
pub fn rays() -> &'static [Ray] {
    baked!("rays")
}

/// Their hits, as bits: `t`, `u`, `v` and the triangle's number, all bits set for a miss.
pub fn hits() -> &'static [[u32; 4]] {
    baked!("hits")
}
