//! Bakes the scene: a mesh with rays and hits, as the crate's tests have them, and the hierarchy over it.

#[path = "../../tests/vectors/file.rs"]
mod file;

use bytemuck::cast_slice;
use std::{env, error::Error, fs, path::PathBuf};
use wide_bvh::{build::Builder, geometry::TriangleMesh, layout::CompactBvh4};

const VECTORS: &str = "../../tests/vectors/knot.bin";

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var("OUT_DIR")?);
    println!("cargo::rerun-if-changed={VECTORS}");
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rustc-link-search={}", out.display());
    fs::copy("memory.x", out.join("memory.x"))?;

    let vectors = file::Vectors::parse(&fs::read(VECTORS)?);
    let mesh = TriangleMesh::new(&vectors.positions, &vectors.indices)?;
    let bvh: CompactBvh4 = Builder::new().build_compact(&mesh)?;
    let hits: Vec<[u32; 4]> = vectors
        .hits
        .iter()
        .map(|&hit| file::bits(hit).unwrap_or([u32::MAX; 4]))
        .collect();
    fs::write(out.join("scene.bin"), bvh.over(&mesh)?.to_bytes()?)?;
    // As both machines have them: little-endian.
    fs::write(out.join("rays.bin"), cast_slice::<_, u8>(&vectors.rays))?;
    fs::write(out.join("hits.bin"), cast_slice::<_, u8>(&hits))?;
    Ok(())
}
