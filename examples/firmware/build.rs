//! Bakes the scene: a mesh and rays, as the crate's tests have them, the hierarchy over it, and what brute force finds.

#[path = "../../tests/suite/vectors/file.rs"]
mod file;

use bytemuck::cast_slice;
use std::{env, error::Error, fs, path::PathBuf};
use wide_bvh::{build::Builder, geometry::TriangleMesh, layout::CompactBvh4, reference};

const VECTORS: &str = "../../tests/suite/vectors/knot.bin";

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var("OUT_DIR")?);
    println!("cargo::rerun-if-changed={VECTORS}");
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rustc-link-search={}", out.display());
    fs::copy("memory.x", out.join("memory.x"))?;

    let vectors = file::Vectors::parse(&fs::read(VECTORS)?);
    let mesh = TriangleMesh::new(&vectors.positions, &vectors.indices)?;
    let bvh: CompactBvh4 = Builder::new().splits(0.0).build_compact(&mesh)?;
    // In the order of leaves, as no list of numbers takes up flash then.
    let (bvh, new) = bvh.reorder(&mesh)?;
    let mesh = TriangleMesh::new(&new.positions, &new.indices)?;
    fs::write(out.join("scene.bin"), bvh.over(&mesh)?.to_bytes()?)?;
    let hit = |ray| file::bits(reference::closest_hit(&mesh, ray)).unwrap_or([u32::MAX; 4]);
    let hits: Vec<[u32; 4]> = vectors.rays.iter().map(hit).collect();
    // As both machines have them: little-endian.
    fs::write(out.join("rays.bin"), cast_slice::<_, u8>(&vectors.rays))?;
    fs::write(out.join("hits.bin"), cast_slice::<_, u8>(&hits))?;
    Ok(())
}
