//! Builds the hierarchy over a mesh and writes it as bytes, to be opened in place.
//!
//! `cargo run --release --example bake -- --help` tells what can be asked for; `render` takes what it writes.

mod args;
#[path = "../render/say.rs"]
mod say;

use args::{Args, Layout, MeshInFile, Request, Width};
use indicatif::ProgressBar;
use say::say;
use std::{
    error::Error,
    fs,
    path::Path,
    process::ExitCode,
    time::{Duration, Instant},
};
use wide_bvh::{
    build::{Builder, ReorderedMesh},
    geometry::TriangleMesh,
    layout::{CompactNode4, CompactNode8, Node4, Node8, WideNode},
};
use wide_bvh_scenes::{Mesh, load};

fn main() -> ExitCode {
    let outcome = match args::parse() {
        Ok(Request::Help) => {
            say(args::HELP);
            Ok(())
        }
        Ok(Request::Bake(args)) => bake(&args),
        Err(error) => Err(error.into()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bake: {error}");
            ExitCode::FAILURE
        }
    }
}

fn bake(args: &Args) -> Result<(), Box<dyn Error>> {
    let mesh = load(&args.mesh)?;
    let spinner = ProgressBar::new_spinner().with_message("building");
    spinner.enable_steady_tick(Duration::from_millis(80));
    let baked = match (args.layout, args.width) {
        (Layout::Compact(in_file), Width::Four) => compact::<CompactNode4>(&mesh, in_file),
        (Layout::Compact(in_file), Width::Eight) => compact::<CompactNode8>(&mesh, in_file),
        (Layout::Full, Width::Four) => full::<Node4>(&mesh),
        (Layout::Full, Width::Eight) => full::<Node8>(&mesh),
    };
    spinner.finish_and_clear();
    let baked = baked.map_err(|error| format!("{}: {error}", args.mesh.display()))?;
    write(&args.out, &baked.bytes)?;
    if let Some(path) = &args.numbers {
        let bytes = baked.numbers.iter().flat_map(|number| number.to_le_bytes());
        write(path, &bytes.collect::<Vec<_>>())?;
    }

    let all = mesh.indices.len();
    let kept = all - baked.dropped;
    say(format_args!("triangles   {kept} of {:?}", mesh.name));
    if baked.dropped > 0 {
        let dropped = baked.dropped;
        say(format_args!(
            "dropped     {dropped} of {all} triangles: a vertex is not finite"
        ));
    }
    say(format_args!(
        "build       {:.2} s",
        baked.time.as_secs_f64()
    ));
    for (name, bytes) in baked.parts {
        let a_triangle = bytes as f64 / kept.max(1) as f64;
        say(format_args!("{name:<11} {a_triangle:.1} bytes a triangle"));
    }
    let (len, out) = (baked.bytes.len(), args.out.display());
    say(format_args!("file        {len} bytes, {out}"));
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::write(path, bytes)
        .map_err(|error| format!("{}: cannot be written: {error}", path.display()))
}

/// What was made.
struct Baked {
    bytes: Vec<u8>,
    /// Those that triangles had, then those that vertices had, if they are others now.
    numbers: Vec<u32>,
    time: Duration,
    dropped: usize,
    /// Bytes of each part, of which there are any.
    parts: Vec<(&'static str, usize)>,
}

fn compact<N: WideNode>(mesh: &Mesh, in_file: MeshInFile) -> Result<Baked, Box<dyn Error>> {
    let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices)?;
    let mut numbers = Vec::new();
    let start = Instant::now();
    let builder = match in_file {
        MeshInFile::Reordered => builder().splits(0.0),
        _ => builder(),
    };
    let tree = builder.build_compact::<N>(&triangles)?;
    let time = start.elapsed();
    let mut parts = vec![("nodes", size_of_val(tree.nodes()))];
    let list = ("leaf data", size_of_val(tree.primitives()));
    let mesh_part = |mesh: &TriangleMesh| {
        let bytes = size_of_val(mesh.positions()) + size_of_val(mesh.indices());
        ("mesh", bytes)
    };
    let bytes = match in_file {
        MeshInFile::None => {
            parts.push(list);
            tree.to_bytes()?
        }
        MeshInFile::AsItIs => {
            parts.extend([list, mesh_part(&triangles)]);
            tree.over(&triangles)?.to_bytes()?
        }
        MeshInFile::Reordered => {
            let (ordered, new) = tree.reorder(&triangles)?;
            let ReorderedMesh {
                positions,
                indices,
                vertices,
                triangles,
            } = new;
            numbers.extend(triangles.into_iter().chain(vertices));
            let mesh = TriangleMesh::new(&positions, &indices)?;
            parts.push(mesh_part(&mesh));
            ordered.over(&mesh)?.to_bytes()?
        }
    };
    Ok(Baked {
        bytes,
        numbers,
        time,
        dropped: tree.dropped(),
        parts,
    })
}

fn full<N: WideNode>(mesh: &Mesh) -> Result<Baked, Box<dyn Error>> {
    let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices)?;
    let start = Instant::now();
    let bvh = builder().build_as::<N>(&triangles)?;
    let time = start.elapsed();
    let leaf_data = size_of_val(bvh.leaves()) + size_of_val(bvh.primitives());
    Ok(Baked {
        bytes: bvh.to_bytes()?,
        numbers: Vec::new(),
        time,
        dropped: bvh.dropped(),
        parts: vec![
            ("nodes", size_of_val(bvh.nodes())),
            ("leaf data", leaf_data),
        ],
    })
}

fn builder() -> Builder<'static> {
    Builder::new().drop_non_finite(true)
}
