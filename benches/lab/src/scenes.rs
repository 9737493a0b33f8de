//! What to measure over: the scenes of the command line.

use std::{error::Error, path::PathBuf};
use wide_bvh_scenes::{Mesh, default_scene, load, shapes::crowd};

/// How many triangles a crowd has at least.
const CROWD: usize = 10_000_000;

/// Whence they come.
#[derive(clap::Args)]
#[group(skip)]
pub struct Args {
    /// Meshes to measure over (PLY, OBJ, binary glTF); without any, a scene made by code
    #[arg(long, value_name = "FILE", num_args = 1..)]
    scenes: Vec<PathBuf>,
    /// Also measure over a scene of ten million triangles: copies of this mesh, turned, scaled, and strewn
    /// over a grid. It takes minutes and some gigabytes for every tree that is built
    #[arg(long, value_name = "FILE")]
    crowd: Option<PathBuf>,
}

impl Args {
    /// Reads them, and makes the crowd.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn load(&self) -> Result<Vec<Mesh>, Box<dyn Error>> {
        if self.scenes.is_empty() && self.crowd.is_none() {
            return Ok(vec![default_scene()]);
        }
        let mut scenes = Vec::new();
        for path in &self.scenes {
            scenes.push(load(path)?);
        }
        if let Some(path) = &self.crowd {
            let one = load(path)?;
            let copies = CROWD.div_ceil(one.indices.len());
            scenes.push(crowd(&one, copies, 1));
        }
        Ok(scenes)
    }
}
