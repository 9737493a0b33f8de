//! The command line.

use lexopt::{Arg, Parser, ValueExt};
use std::{ffi::OsString, path::PathBuf};

/// What `--help` prints.
pub const HELP: &str = "\
Renders a mesh to a PNG.

Usage: render [MESH] [OPTIONS]

  MESH                 a PLY, OBJ or glTF file, or one that `bake` has written, which is traced where it is;
                       without it, a scene made by code
      --over MESH      the mesh of a baked file that has none in it
  -o, --out FILE       the picture [render.png]
  -s, --size WxH       its size in pixels [1280x720]
  -m, --mode MODE      shaded: sun, shadows and sky [the default]
                       ao: ambient occlusion
                       heatmap: nodes and triangles tested for each pixel's ray
  -n, --samples N      rays from the camera a pixel, shaded and ao [4]
  -v, --view N         which of a known level's four views [0]
  -h, --help           this text";

/// What the user wants.
pub enum Request {
    /// To know what can be wanted.
    Help,
    /// A picture.
    Render(Args),
}

/// What to render, and how.
pub struct Args {
    /// The mesh's file, or none for the scene made by code.
    pub mesh: Option<PathBuf>,
    /// The file of the mesh that a baked file is over.
    pub over: Option<PathBuf>,
    /// Where the picture goes.
    pub out: PathBuf,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// What a pixel's colour stands for.
    pub mode: Mode,
    /// Rays from the camera for each pixel.
    pub samples: u32,
    /// Which of the mesh's cameras.
    pub view: usize,
}

/// What a pixel's colour stands for.
#[derive(Clone, Copy)]
pub enum Mode {
    /// Light: sun, shadows, sky.
    Shaded,
    /// How much of the surroundings is near.
    Ao,
    /// How much work its ray was.
    Heatmap,
}

/// The longest side of a picture.
const MAX_SIDE: u32 = 16_384;
/// The most pixels in one: 192 MB of colours.
const MAX_PIXELS: u64 = 1 << 26;
/// More samples than this are hours of work without a difference to be seen.
const MAX_SAMPLES: u32 = 1024;

/// Reads the program's own arguments.
pub fn parse() -> Result<Request, lexopt::Error> {
    let mut args = Args {
        mesh: None,
        over: None,
        out: "render.png".into(),
        width: 1280,
        height: 720,
        mode: Mode::Shaded,
        samples: 4,
        view: 0,
    };
    let mut parser = Parser::from_env();
    while let Some(argument) = parser.next()? {
        match argument {
            Arg::Short('h') | Arg::Long("help") => return Ok(Request::Help),
            Arg::Long("over") => args.over = Some(mesh(parser.value()?)?),
            Arg::Short('o') | Arg::Long("out") => args.out = parser.value()?.into(),
            Arg::Short('s') | Arg::Long("size") => {
                (args.width, args.height) = parser.value()?.parse_with(size)?;
            }
            Arg::Short('m') | Arg::Long("mode") => args.mode = parser.value()?.parse_with(mode)?,
            Arg::Short('n') | Arg::Long("samples") => {
                args.samples = parser.value()?.parse_with(samples)?;
            }
            Arg::Short('v') | Arg::Long("view") => args.view = parser.value()?.parse()?,
            Arg::Value(path) if args.mesh.is_none() => args.mesh = Some(mesh(path)?),
            other => return Err(other.unexpected()),
        }
    }
    Ok(Request::Render(args))
}

fn mesh(path: OsString) -> Result<PathBuf, lexopt::Error> {
    match path.is_empty() {
        true => Err("the mesh's file name is empty".into()),
        false => Ok(path.into()),
    }
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once(['x', 'X']);
    let sides = sides.and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let (width, height): (u32, u32) =
        sides.ok_or("it is written as width x height, like 1280x720")?;
    let side = 1..=MAX_SIDE;
    if !side.contains(&width) || !side.contains(&height) {
        return Err(format!("each side is 1 to {MAX_SIDE} pixels"));
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!("a picture has at most {MAX_PIXELS} pixels"));
    }
    Ok((width, height))
}

fn mode(text: &str) -> Result<Mode, &'static str> {
    match text {
        "shaded" => Ok(Mode::Shaded),
        "ao" => Ok(Mode::Ao),
        "heatmap" => Ok(Mode::Heatmap),
        _ => Err("it is one of shaded, ao, heatmap"),
    }
}

fn samples(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(samples @ 1..=MAX_SAMPLES) => Ok(samples),
        _ => Err(format!("it is 1 to {MAX_SAMPLES}")),
    }
}
