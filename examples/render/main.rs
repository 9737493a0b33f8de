//! Renders a mesh to a PNG: the scene made by code, a PLY, OBJ or glTF file, or a hierarchy that `bake` has written.
//!
//! `cargo run --release --example render -- --help` tells what can be asked for. `main` is the course of
//! events; each module is one part of it.

mod args;
mod heatmap;
mod light;
mod picture;
mod sampling;
mod say;
mod source;
mod trace;
mod world;

use args::{Args, Mode, Request};
use picture::PngFile;
use say::say;
use source::Source;
use std::{error::Error, process::ExitCode};

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
    let source = Source::read(args.mesh.as_deref(), args.over.as_deref())?;
    let scene = source.scene()?;
    let cameras = scene.cameras();
    let camera = cameras.get(args.view).ok_or_else(|| {
        let (view, last) = (args.view, cameras.len() - 1);
        format!("there is no view {view}: this mesh has views 0 to {last}")
    })?;
    // Opened before the work, so that a wrong name costs no time.
    let file = PngFile::create(&args.out)?;

    let world = scene.world()?;
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
