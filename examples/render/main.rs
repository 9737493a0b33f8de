//! Renders a mesh to a PNG: the scene made by code, or a PLY, OBJ or glTF file.
//!
//! `cargo run --release --example render -- --help` tells what can be asked for. `main` is the course of
//! events; each module is one part of it.

mod args;
mod heatmap;
mod light;
mod picture;
mod sampling;
mod say;
mod trace;
mod world;

use args::{Args, Mode, Request};
use indicatif::ProgressBar;
use picture::PngFile;
use say::say;
use std::{
    error::Error,
    process::ExitCode,
    time::{Duration, Instant},
};
use wide_bvh::{build::Builder, geometry::TriangleMesh};
use wide_bvh_scenes::{Mesh, cameras_for, default_scene, load};
use world::World;

fn main() -> ExitCode {
    let outcome = match args::parse() {
        Ok(Request::Help) => {
            say(args::HELP);
            Ok(())
        }
        Ok(Request::Render(args)) => render(&args),
        Err(error) => Err(error.into()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("render: {error}");
            ExitCode::FAILURE
        }
    }
}

fn render(args: &Args) -> Result<(), Box<dyn Error>> {
    let mesh = match &args.mesh {
        Some(path) => load(path)?,
        None => default_scene(),
    };
    let cameras = cameras_for(&mesh);
    let camera = cameras.get(args.view).ok_or_else(|| {
        let (view, last) = (args.view, cameras.len() - 1);
        format!("there is no view {view}: this mesh has views 0 to {last}")
    })?;
    // Opened before the work, so that a wrong name costs no time.
    let file = PngFile::create(&args.out)?;

    let world = build(&mesh)?;
    let picture = match args.mode {
        Mode::Shaded => light::shaded(&world, camera, args),
        Mode::Ao => light::ambient_occlusion(&world, camera, args),
        Mode::Heatmap => heatmap::render(&world, camera, args),
    };
    file.write(&picture)?;
    let (width, height, out) = (args.width, args.height, args.out.display());
    say(format_args!("picture     {width}x{height}, {out}"));
    Ok(())
}

/// Builds the hierarchy and tells what became of it.
fn build(mesh: &Mesh) -> Result<World<'_>, Box<dyn Error>> {
    let triangles = TriangleMesh::new(&mesh.positions, &mesh.indices)?;
    let spinner = ProgressBar::new_spinner().with_message("building");
    spinner.enable_steady_tick(Duration::from_millis(80));
    let start = Instant::now();
    let bvh = Builder::new().drop_non_finite(true).build(&triangles)?;
    let seconds = start.elapsed().as_secs_f64();
    spinner.finish_and_clear();

    let report = bvh.report();
    let (all, dropped) = (mesh.indices.len(), report.dropped);
    let kept = all - dropped;
    if kept == 0 {
        return Err("no triangle has finite vertices".into());
    }
    let bytes = report.bytes as f64 / kept as f64;
    say(format_args!("triangles   {kept} of {:?}", mesh.name));
    if dropped > 0 {
        say(format_args!(
            "dropped     {dropped} of {all} triangles: a vertex is not finite"
        ));
    }
    say(format_args!(
        "build       {seconds:.2} s, {bytes:.1} bytes a triangle"
    ));
    Ok(World::new(mesh, bvh))
}
