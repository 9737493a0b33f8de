//! Bakes the scene: a mesh with rays and hits, as the crate's tests have them, and the hierarchy over it.

#[path = "../../tests/vectors/file.rs"]
mod file;

use bytemuck::{Pod, cast_slice};
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
    let write = |name: &str, bytes: &[u8]| fs::write(out.join(name).with_extension("bin"), bytes);
    write("positions", bytes(&vectors.positions))?;
    write("indices", bytes(&vectors.indices))?;
    write("rays", bytes(&vectors.rays))?;
    write("hits", bytes(&hits))?;
    write("nodes", bytes(bvh.nodes()))?;
    write("primitives", bytes(bvh.primitives()))?;
    write("bounds", bytes(&[*bvh.bounds()]))?;
    Ok(())
}

/// As both machines have them: little-endian.
fn bytes<T: Pod>(items: &[T]) -> &[u8] {
    cast_slice(items)
}
