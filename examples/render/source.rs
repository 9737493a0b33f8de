//! Where the mesh and its hierarchy come from: a mesh that is loaded and built on, or a baked file that is mapped and
//! opened where it is.

use crate::{
    say::say,
    world::{Hierarchy, World},
};
use indicatif::ProgressBar;
use memmap2::Mmap;
use std::{
    error::Error,
    fs::File,
    path::Path,
    time::{Duration, Instant},
};
use wide_bvh::{
    build::Builder,
    geometry::{Hit, Ray, TriangleMesh},
    layout::{
        Borrowed, Bvh, ByList, BytesError, CompactNode4, CompactNode8, InOrder, Node4, Node8,
        Order, Runs, TriangleLeaf, WideNode, bytes::Header,
    },
    traverse::Counts,
};
use wide_bvh_scenes::{Camera, Mesh, bounds, cameras_of, default_scene, load};

/// What is in memory.
pub enum Source {
    /// A mesh, to be built on.
    Loaded(Mesh),
    /// A baked file, and a mesh if it was asked for.
    Baked(Baked),
}

/// A baked file.
pub struct Baked {
    path: String,
    name: String,
    map: Mmap,
    over: Option<Mesh>,
}

/// A mesh, and its hierarchy if that is there already.
pub struct Scene<'m> {
    name: &'m str,
    mesh: TriangleMesh<'m>,
    opened: Option<Box<dyn Hierarchy + 'm>>,
}

impl Source {
    /// Loads or maps the file, or makes the scene that is made by code. `over` is the mesh of a baked file without one.
    pub fn read(path: Option<&Path>, over: Option<&Path>) -> Result<Self, Box<dyn Error>> {
        let baked = match path {
            Some(path) => Baked::map(path, over)?,
            None => None,
        };
        Ok(match (baked, path) {
            (Some(baked), _) => Self::Baked(baked),
            _ if over.is_some() => return Err("--over is for a baked file".into()),
            (None, Some(path)) => Self::Loaded(load(path)?),
            (None, None) => Self::Loaded(default_scene()),
        })
    }

    /// What there is to see.
    pub fn scene(&self) -> Result<Scene<'_>, Box<dyn Error>> {
        match self {
            Self::Loaded(mesh) => Ok(Scene {
                name: &mesh.name,
                mesh: TriangleMesh::new(&mesh.positions, &mesh.indices)?,
                opened: None,
            }),
            Self::Baked(baked) => baked.open(),
        }
    }
}

impl Baked {
    /// The file, if it is one that was baked.
    fn map(path: &Path, over: Option<&Path>) -> Result<Option<Self>, Box<dyn Error>> {
        // What cannot be mapped, a folder or an empty file, is no such file: whatever reads meshes tells what is wrong.
        let Ok(file) = File::open(path) else {
            return Ok(None);
        };
        // SAFETY: as of every mapped file, nobody is to change it while it is open here.
        let Ok(map) = (unsafe { Mmap::map(&file) }) else {
            return Ok(None);
        };
        if matches!(
            Header::read(&map),
            Err(BytesError::NoHeader(_) | BytesError::NotAHierarchy)
        ) {
            return Ok(None);
        }
        Ok(Some(Self {
            path: path.display().to_string(),
            name: path
                .file_stem()
                .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
            map,
            over: over.map(load).transpose()?,
        }))
    }

    /// Opens it in place.
    fn open(&self) -> Result<Scene<'_>, Box<dyn Error>> {
        let start = Instant::now();
        let failed = |error: BytesError| format!("{}: {error}", self.path);
        let header = Header::read(&self.map).map_err(failed)?;
        let (mesh, opened) = match (header.node_kind, header.leaf_kind) {
            (1, 1) => self.own_leaves::<Node4>(),
            (2, 1) => self.own_leaves::<Node8>(),
            (3, 3) => self.runs::<CompactNode4, ByList>(),
            (4, 3) => self.runs::<CompactNode8, ByList>(),
            (3, 4) => self.runs::<CompactNode4, InOrder>(),
            (4, 4) => self.runs::<CompactNode8, InOrder>(),
            (nodes, leaves) => Err(format!(
                "nodes of kind {nodes} with leaves of kind {leaves}"
            ))?,
        }
        .map_err(|error| format!("{}: {error}", self.path))?;
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        say(format_args!(
            "triangles   {} of {:?}",
            mesh.len(),
            self.name
        ));
        say(format_args!(
            "open        {milliseconds:.1} ms, {:.1} bytes a triangle in the file",
            self.map.len() as f64 / mesh.len().max(1) as f64
        ));
        Ok(Scene {
            name: &self.name,
            mesh,
            opened: Some(opened),
        })
    }

    /// The mesh that the file is over.
    fn over(&self) -> Result<TriangleMesh<'_>, Box<dyn Error>> {
        let mesh = self.over.as_ref();
        let mesh = mesh.ok_or("there is no mesh in it: name the one it is over with --over")?;
        Ok(TriangleMesh::new(&mesh.positions, &mesh.indices)?)
    }

    /// Leaves that have the triangles. The mesh is for what they look like.
    fn own_leaves<N: WideNode + Sync>(&self) -> Result<Opened<'_>, Box<dyn Error>> {
        let bvh = Bvh::<N, TriangleLeaf, Borrowed>::from_bytes(&self.map)?;
        let mesh = self.over()?;
        let needed = bvh
            .primitives()
            .iter()
            .max()
            .map_or(0, |&last| last as usize + 1);
        if needed > mesh.len() {
            let triangles = mesh.len();
            return Err(format!("{triangles} triangles in --over, where it has {needed}").into());
        }
        Ok((mesh, Box::new(bvh)))
    }

    /// Leaves that read the mesh, which is in the file or not.
    fn runs<N: WideNode, O: Order + 'static>(&self) -> Result<Opened<'_>, Box<dyn Error>> {
        match Bvh::<N, Runs<TriangleMesh, O>, Borrowed>::from_bytes(&self.map) {
            Ok(_) if self.over.is_some() => Err("its mesh is in it: it takes no --over".into()),
            Ok(bvh) => Ok((*bvh.mesh(), Box::new(bvh))),
            Err(BytesError::MeshTooSmall(small)) if small.triangles == 0 => {
                let tree = Bvh::<N, Runs<(), O>, Borrowed>::from_bytes(&self.map)?;
                let mesh = self.over()?;
                tree.over(&mesh)?;
                Ok((mesh, Box::new(Over { tree, mesh })))
            }
            Err(error) => Err(error.into()),
        }
    }
}

/// A mesh, and what was opened over it.
type Opened<'m> = (TriangleMesh<'m>, Box<dyn Hierarchy + 'm>);

/// A tree without its mesh, and that.
struct Over<'m, N: WideNode, O: Order> {
    tree: Bvh<N, Runs<(), O>, Borrowed<'m>>,
    mesh: TriangleMesh<'m>,
}

impl<N: WideNode, O: Order> Over<'_, N, O> {
    /// What the two are together. It takes next to nothing.
    fn bvh(&self) -> Bvh<N, Runs<TriangleMesh<'_>, O>, Borrowed<'_>> {
        let bvh = self.tree.over(&self.mesh);
        bvh.expect("as when it was opened")
    }
}

impl<N: WideNode, O: Order> Hierarchy for Over<'_, N, O> {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.bvh().closest_hit(ray)
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.bvh().any_hit(ray)
    }

    fn cost(&self, ray: &Ray) -> Counts {
        self.bvh().closest_hit_counted(ray).1
    }
}

impl<'m> Scene<'m> {
    /// The cameras to look at it from.
    pub fn cameras(&self) -> Vec<Camera> {
        cameras_of(
            self.name,
            bounds(self.mesh.positions(), self.mesh.indices()),
        )
    }

    /// With a hierarchy, which is built if it is not there.
    pub fn world(self) -> Result<World<'m>, Box<dyn Error>> {
        let bvh = match self.opened {
            Some(bvh) => bvh,
            None => build(self.name, &self.mesh)?,
        };
        Ok(World::new(self.mesh, bvh))
    }
}

/// Builds the hierarchy and tells what became of it.
fn build(name: &str, mesh: &TriangleMesh<'_>) -> Result<Box<dyn Hierarchy>, Box<dyn Error>> {
    let spinner = ProgressBar::new_spinner().with_message("building");
    spinner.enable_steady_tick(Duration::from_millis(80));
    let start = Instant::now();
    let bvh = Builder::new().drop_non_finite(true).build(mesh)?;
    let seconds = start.elapsed().as_secs_f64();
    spinner.finish_and_clear();

    let report = bvh.report();
    let (all, dropped) = (mesh.len(), report.dropped);
    let kept = all - dropped;
    if kept == 0 {
        return Err("no triangle has finite vertices".into());
    }
    let bytes = report.bytes as f64 / kept as f64;
    say(format_args!("triangles   {kept} of {name:?}"));
    if dropped > 0 {
        say(format_args!(
            "dropped     {dropped} of {all} triangles: a vertex is not finite"
        ));
    }
    say(format_args!(
        "build       {seconds:.2} s, {bytes:.1} bytes a triangle"
    ));
    Ok(Box::new(bvh))
}
