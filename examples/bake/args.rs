//! The command line.

use lexopt::{Arg, Parser, ValueExt};
use std::{ffi::OsString, path::PathBuf};

/// What `--help` prints.
pub const HELP: &str = "\
Builds the hierarchy over a mesh and writes it as bytes, to be opened in place by `Bvh::from_bytes`:
memory-mapped, from flash, from `include_bytes!`, without a copy, an allocation or `std`.

Usage: bake MESH OUT [OPTIONS]

  MESH                 a PLY, OBJ or glTF file
  OUT                  the file to write, whose name ends in .wbvh
  -w, --width N        children a node, 4 or 8 [8]
  -l, --layout LAYOUT  compact: small nodes; leaves are numbers of triangles, which are read where the mesh
                       has them [the default]
                       full: nodes of whole floats, leaves that have the triangles: faster, larger; no mesh
                       in the file
      --reorder        compact with the mesh in the order in which rays read it, its vertices, too, and the numbers in
                       hits: no list of numbers, and large meshes are faster, see `Bvh::reorder`
      --numbers FILE   with --reorder: writes the numbers that triangles had, then those that vertices had, for what
                       else goes by them; 32 bits each, the lowest byte first
      --without-mesh   compact without the mesh: for who has that in memory already, see `Bvh::over`
  -h, --help           this text

`cargo run --release --example render -- OUT` shows what is in it.";

/// What the user wants.
pub enum Request {
    /// To know what can be wanted.
    Help,
    /// A file.
    Bake(Args),
}

/// What to build, and how.
pub struct Args {
    /// The mesh's file.
    pub mesh: PathBuf,
    /// The file to write.
    pub out: PathBuf,
    /// How many children a node has.
    pub width: Width,
    /// Nodes and leaves.
    pub layout: Layout,
    /// The file for the numbers that triangles and vertices had, if they get others.
    pub numbers: Option<PathBuf>,
}

/// How many children a node has.
#[derive(Clone, Copy)]
pub enum Width {
    /// 4.
    Four,
    /// 8.
    Eight,
}

/// Nodes and leaves.
#[derive(Clone, Copy)]
pub enum Layout {
    /// Small nodes; leaves that read the mesh.
    Compact(MeshInFile),
    /// Nodes of whole floats, leaves that have the triangles.
    Full,
}

/// What of the mesh is in the file.
#[derive(Clone, Copy)]
pub enum MeshInFile {
    /// Nothing.
    None,
    /// All, as it is.
    AsItIs,
    /// All, in the order of leaves.
    Reordered,
}

/// Reads the program's own arguments.
pub fn parse() -> Result<Request, lexopt::Error> {
    let (mut mesh, mut out, mut numbers) = (None, None, None);
    let (mut width, mut compact) = (Width::Eight, true);
    let (mut without_mesh, mut reorder) = (false, false);
    let mut parser = Parser::from_env();
    while let Some(argument) = parser.next()? {
        match argument {
            Arg::Short('h') | Arg::Long("help") => return Ok(Request::Help),
            Arg::Short('w') | Arg::Long("width") => {
                width = parser.value()?.parse_with(parse_width)?;
            }
            Arg::Short('l') | Arg::Long("layout") => {
                compact = parser.value()?.parse_with(is_compact)?;
            }
            Arg::Long("reorder") => reorder = true,
            Arg::Long("numbers") => numbers = Some(file(parser.value()?)?),
            Arg::Long("without-mesh") => without_mesh = true,
            Arg::Value(path) if mesh.is_none() => mesh = Some(file(path)?),
            Arg::Value(path) if out.is_none() => out = Some(file(path)?),
            other => return Err(other.unexpected()),
        }
    }
    let mesh = mesh.ok_or("which mesh? see --help")?;
    let out: PathBuf = out.ok_or("into which file? see --help")?;
    if out.extension().is_none_or(|extension| extension != "wbvh") {
        // A mesh named there by mistake is not overwritten.
        return Err(format!("{}: a baked file's name ends in .wbvh", out.display()).into());
    }
    let layout = match (compact, without_mesh, reorder) {
        (true, false, false) => Layout::Compact(MeshInFile::AsItIs),
        (true, false, true) => Layout::Compact(MeshInFile::Reordered),
        (true, true, false) => Layout::Compact(MeshInFile::None),
        (false, _, false) => Layout::Full,
        (true, true, true) => return Err("--reorder, --without-mesh: which?".into()),
        (false, _, true) => return Err("--reorder: of the compact layout alone".into()),
    };
    if numbers.is_some() && !reorder {
        return Err("--numbers: without --reorder they stay what they are".into());
    }
    Ok(Request::Bake(Args {
        mesh,
        out,
        width,
        layout,
        numbers,
    }))
}

fn file(path: OsString) -> Result<PathBuf, lexopt::Error> {
    match path.is_empty() {
        true => Err("a file's name is empty".into()),
        false => Ok(path.into()),
    }
}

fn parse_width(text: &str) -> Result<Width, &'static str> {
    match text {
        "4" => Ok(Width::Four),
        "8" => Ok(Width::Eight),
        _ => Err("it is 4 or 8"),
    }
}

fn is_compact(text: &str) -> Result<bool, &'static str> {
    match text {
        "compact" => Ok(true),
        "full" => Ok(false),
        _ => Err("it is compact or full"),
    }
}
