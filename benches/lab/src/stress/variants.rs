//! Every way to ask this crate, held to the same answers.
//!
//! Three places grow with the crate: [`Builds`] by the builder's settings, [`check`] by layouts and widths,
//! [`ask`] by kinds of call. What is opened from bytes has to answer as what was written.

use super::flush::flushed;
use crate::reference::bits;
use fastrand::Rng;
use wide_bvh::{
    build::{BinaryTree, BuildError, Builder, Preset},
    geometry::{Hit, Ray, TriangleMesh},
    layout::{
        AlignedBytes, Borrowed, Bvh, CompactNode4, CompactNode8, InBytes, MeshLeaf, Node4, Node8,
        Open, Owned, RunLeaf, Storage, TriangleLeaf, TriangleLeaves, WideNode,
    },
    reference,
    simd::Backend,
    traverse::Scratch,
};

/// An answer that is not brute force's.
#[derive(Debug)]
pub struct Mismatch {
    /// The ray's place; `None` where the build failed.
    pub ray: Option<usize>,
    /// The build, width, backend and call.
    pub variant: String,
    /// What it answered.
    pub got: String,
}

/// What the builder is told.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    preset: Preset,
    /// If not the preset's.
    splits: Option<f32>,
}

impl Settings {
    const fn of(preset: Preset) -> Self {
        Self {
            preset,
            splits: None,
        }
    }

    const fn with_splits(self, splits: f32) -> Self {
        Self {
            splits: Some(splits),
            ..self
        }
    }

    /// Any preset with any splits, from hardly any to more than are ever wanted.
    pub fn random(rng: &mut Rng) -> Self {
        let preset = [Preset::Fast, Preset::Balanced, Preset::Best][rng.usize(..3)];
        Self::of(preset).with_splits(10.0_f32.powf(rng.f32() * 4.0 - 3.0))
    }

    fn builder(self) -> Builder<'static> {
        let builder = Builder::new().preset(self.preset);
        match self.splits {
            Some(splits) => builder.splits(splits),
            None => builder,
        }
    }
}

/// How hierarchies come to be.
pub struct Builds<'a> {
    /// By the builder's own trees, and what each is called.
    own: [(String, Settings); 7],
    /// By this one.
    tree: &'a BinaryTree,
}

impl<'a> Builds<'a> {
    /// Those that every case has, one with these settings, and one from this tree.
    pub fn new(tree: &'a BinaryTree, drawn: Settings) -> Self {
        let default = Settings::of(Preset::default());
        let balanced = Settings::of(Preset::Balanced);
        let own = [
            ("default build".into(), default),
            ("fast".into(), Settings::of(Preset::Fast)),
            ("balanced".into(), balanced),
            ("no splits".into(), default.with_splits(0.0)),
            ("many splits".into(), default.with_splits(4.0)),
            ("balanced, many splits".into(), balanced.with_splits(4.0)),
            (format!("{drawn:?}"), drawn),
        ];
        Self { own, tree }
    }
}

/// Holds every variant's answers to the `expected` ones, bit for bit; with denormals flushed to zero, in queries
/// alone, if `flush` is set. How many were compared.
///
/// # Errors
/// The first that differs.
pub fn check(
    mesh: &TriangleMesh,
    builds: &Builds,
    rays: &[Ray],
    expected: &[Option<Hit>],
    flush: bool,
) -> Result<u64, Mismatch> {
    Ok(
        check_width::<Node8>(mesh, builds, rays, expected, flush, 0)?
            + check_width::<Node4>(mesh, builds, rays, expected, flush, 1)?
            + check_compact::<CompactNode8>(mesh, builds, rays, expected, flush, 2)?
            + check_compact::<CompactNode4>(mesh, builds, rays, expected, flush, 3)?,
    )
}

/// What a ray by itself is asked, and which rays are.
#[derive(Clone, Copy)]
enum Share {
    /// All rays, for the closest hit and for any.
    Whole,
    /// All rays, for one of the two.
    Half,
    /// One ray in [`TURNS`], for one of the two; which, by the number.
    Turn(usize),
}

/// Each ray is asked of each build in one of the layouts and widths, of which there are so many.
const TURNS: usize = 4;

impl Share {
    /// Whether a ray is asked for the closest hit, and for any.
    fn of(self, place: usize) -> [bool; 2] {
        match self {
            Self::Whole => [true; 2],
            Self::Half if place.is_multiple_of(2) => [true, false],
            Self::Half => [false, true],
            Self::Turn(turn) if place % TURNS == turn % TURNS => Self::Half.of(place / TURNS),
            Self::Turn(_) => [false; 2],
        }
    }
}

fn check_width<N: WideNode>(
    mesh: &TriangleMesh,
    builds: &Builds,
    rays: &[Ray],
    expected: &[Option<Hit>],
    flush: bool,
    layout: usize,
) -> Result<u64, Mismatch> {
    let finite = is_finite(mesh);
    let mut checked = 0;
    let mut known: Vec<Bvh<N, TriangleLeaf, Owned>> = Vec::new();
    let own = builds.own.iter();
    let own = own.map(|(name, settings)| (name.as_str(), settings.builder(), false));
    let from_tree = [("from a tree", Builder::new(), true)];
    for (number, (name, builder, from_tree)) in own.chain(from_tree).enumerate() {
        let name = format!("{name}, {}-wide", N::WIDTH);
        let builder = builder.drop_non_finite(!finite);
        let built = if from_tree {
            builder.build_from_tree_as(mesh, builds.tree)
        } else {
            builder.build_as(mesh)
        };
        let mut bvh: Bvh<N, _, _> = built.map_err(|error: BuildError| Mismatch {
            ray: None,
            variant: name.clone(),
            got: error.to_string(),
        })?;
        // One that came out the same, byte for byte, answers the same.
        if known.iter().any(|other| same_bytes(&bvh, other)) {
            continue;
        }
        let first = known.is_empty();
        // Both ways are asked: the first as it is, all others looking ahead.
        bvh.set_looks_ahead(!first);
        for (place, backend) in backends(first, rays).enumerate() {
            bvh.set_backend(backend);
            let name = || format!("{name}, {}", backend.name());
            // Batches go the same way in all trees: some will do in those after the first.
            let (share, batched) = match (first, place) {
                (true, 0) => (Share::Whole, rays.len()),
                (true, _) => (Share::Half, rays.len() / 8),
                // Compact layouts have none of these.
                _ if from_tree => (Share::Half, rays.len() / 16),
                _ => (Share::Turn(number + layout), rays.len() / 16),
            };
            let asked = [rays, &rays[..batched]];
            checked += flushed_if(flush, || ask(&bvh, name, asked, expected, share))?;
        }
        // The same code on other memory: some will do.
        let some = &rays[..rays.len() / 16];
        let whole = Share::Whole;
        checked += if first {
            let name = format!("{name}, opened");
            let bytes = written(&bvh, &name)?;
            let bvh = opened::<N, TriangleLeaf>(&bytes, &name)?;
            flushed_if(flush, || {
                ask(&bvh, || name.clone(), [some; 2], expected, whole)
            })?
        } else {
            let name = || format!("{name}, borrowed");
            flushed_if(flush, || {
                ask_one_by_one(&bvh.as_borrowed(), name, some, expected, whole)
            })?
        };
        known.push(bvh);
    }
    Ok(checked)
}

/// Compact nodes over the mesh itself. The first also opened, in the order of its leaves, and with leaves that are stored.
fn check_compact<N: WideNode>(
    mesh: &TriangleMesh,
    builds: &Builds,
    rays: &[Ray],
    expected: &[Option<Hit>],
    flush: bool,
    layout: usize,
) -> Result<u64, Mismatch> {
    let some = |part: usize| &rays[..rays.len() / part];
    let mut checked = 0;
    let mut known: Vec<Bvh<N, RunLeaf, Owned>> = Vec::new();
    for (number, (name, settings)) in builds.own.iter().enumerate() {
        let name = format!("{name}, {}-wide, compact", N::WIDTH);
        let builder = settings.builder().drop_non_finite(!is_finite(mesh));
        let tree = builder.build_compact::<N>(mesh);
        let tree = tree.map_err(|error| no_build(&name, error))?;
        if known.iter().any(|other| same_runs(&tree, other)) {
            continue;
        }
        let first = known.is_empty();
        let mut bvh = tree.over(mesh).map_err(|error| no_build(&name, error))?;
        bvh.set_looks_ahead(!first);
        for backend in backends(first, rays) {
            bvh.set_backend(backend);
            let name = || format!("{name}, {}", backend.name());
            let share = match first {
                true => Share::Half,
                false => Share::Turn(number + layout),
            };
            checked += flushed_if(flush, || ask_one_by_one(&bvh, name, rays, expected, share))?;
        }
        if !first {
            known.push(tree);
            continue;
        }
        checked += flushed_if(flush, || {
            ask_at_once(&bvh, wrong(|| name.clone()), some(4), expected)
        })?;
        checked += check_opened(mesh, &tree, &name, some(16), expected, flush)?;
        checked += check_ordered::<N>(mesh, builder, &name, some(16), flush)?;
        let stored = builder.build_as::<N>(mesh);
        let stored = stored.map_err(|error| no_build(&name, error))?;
        let name = || format!("{name}, leaves stored");
        let asked = [some(2), some(4)];
        checked += flushed_if(flush, || ask(&stored, name, asked, expected, Share::Half))?;
        known.push(tree);
    }
    Ok(checked)
}

/// A compact hierarchy opened from bytes, without the mesh in them and with it.
fn check_opened<N: WideNode>(
    mesh: &TriangleMesh,
    tree: &Bvh<N, RunLeaf, Owned>,
    name: &str,
    rays: &[Ray],
    expected: &[Option<Hit>],
    flush: bool,
) -> Result<u64, Mismatch> {
    let name = format!("{name}, opened");
    let bytes = written(tree, &name)?;
    let alone = opened::<N, RunLeaf>(&bytes, &name)?;
    let alone = alone.over(mesh).map_err(|error| no_build(&name, error))?;
    let mut checked = flushed_if(flush, || {
        ask_one_by_one(&alone, || name.clone(), rays, expected, Share::Whole)
    })?;
    let name = format!("{name} with its mesh");
    let bytes = written(&alone, &name)?;
    let whole = opened::<N, MeshLeaf>(&bytes, &name)?;
    checked += flushed_if(flush, || {
        ask_one_by_one(&whole, || name.clone(), rays, expected, Share::Whole)
    })?;
    Ok(checked)
}

/// A compact hierarchy over the mesh in the order of its leaves, where triangles have other numbers: held to brute force over that
/// mesh.
fn check_ordered<N: WideNode>(
    mesh: &TriangleMesh,
    builder: Builder,
    name: &str,
    rays: &[Ray],
    flush: bool,
) -> Result<u64, Mismatch> {
    let name = format!("{name}, in order");
    let tree = builder.splits(0.0).build_compact::<N>(mesh);
    let tree = tree.map_err(|error| no_build(&name, error))?;
    let (tree, new) = tree.reorder(mesh).map_err(|error| no_build(&name, error))?;
    let mesh = TriangleMesh::new(&new.positions, &new.indices);
    let mesh = mesh.map_err(|error| no_build(&name, error))?;
    let mut bvh = tree.over(&mesh).map_err(|error| no_build(&name, error))?;
    bvh.set_looks_ahead(true);
    flushed_if(flush, || {
        let closest = |ray| reference::closest_hit(&mesh, ray);
        let expected: Vec<_> = rays.iter().map(closest).collect();
        let ask = || {
            let one_by_one = ask_one_by_one(&bvh, || name.clone(), rays, &expected, Share::Whole)?;
            Ok(one_by_one + ask_at_once(&bvh, wrong(|| name.clone()), rays, &expected)?)
        };
        ask().map_err(|mismatch: Mismatch| {
            let hit = mismatch.ray.map(|ray| show(expected[ray]));
            let hit = hit.unwrap_or_default();
            let got = format!("{}\nbrute force in that order: {hit}", mismatch.got);
            Mismatch { got, ..mismatch }
        })
    })
}

fn is_finite(mesh: &TriangleMesh) -> bool {
    mesh.positions().iter().flatten().all(|x| x.is_finite())
}

fn no_build(variant: &str, error: impl std::error::Error) -> Mismatch {
    Mismatch {
        ray: None,
        variant: variant.to_owned(),
        got: error.to_string(),
    }
}

fn flushed_if<T>(flush: bool, ask: impl FnOnce() -> T) -> T {
    if flush { flushed(ask) } else { ask() }
}

/// A hierarchy as bytes, where any may be opened.
fn written<N: WideNode, L: InBytes, S: Storage>(
    bvh: &Bvh<N, L, S>,
    variant: &str,
) -> Result<AlignedBytes, Mismatch> {
    let bytes = bvh.to_bytes().map_err(|error| no_build(variant, error))?;
    Ok(AlignedBytes::new(&bytes))
}

fn opened<'a, N: WideNode, L: Open<'a>>(
    bytes: &'a AlignedBytes,
    variant: &str,
) -> Result<Bvh<N, L, Borrowed<'a>>, Mismatch> {
    Bvh::from_bytes(bytes).map_err(|error| no_build(variant, error))
}

/// Every backend for the first build, and one for the others, from case to case another: it is other trees that they are
/// for.
fn backends(first: bool, rays: &[Ray]) -> impl Iterator<Item = Backend> {
    let count = Backend::available().count();
    let turn = rays
        .first()
        .map_or(0, |ray| ray.origin.x.to_bits() as usize);
    let (from, to) = if first {
        (0, count)
    } else {
        (turn % count, turn % count + 1)
    };
    Backend::available().skip(from).take(to - from)
}

fn same_bytes<N: WideNode>(
    a: &Bvh<N, TriangleLeaf, Owned>,
    b: &Bvh<N, TriangleLeaf, Owned>,
) -> bool {
    same(a.nodes(), b.nodes()) && same(a.leaves(), b.leaves()) && a.primitives() == b.primitives()
}

fn same_runs<N: WideNode>(a: &Bvh<N, RunLeaf, Owned>, b: &Bvh<N, RunLeaf, Owned>) -> bool {
    same(a.nodes(), b.nodes()) && a.primitives() == b.primitives()
}

fn same<T: bytemuck::Pod>(a: &[T], b: &[T]) -> bool {
    bytemuck::cast_slice::<T, u8>(a) == bytemuck::cast_slice::<T, u8>(b)
}

/// Every kind of call: over some rays one by one, and over others at once.
fn ask<N: WideNode, S: Storage>(
    bvh: &Bvh<N, TriangleLeaf, S>,
    name: impl Fn() -> String,
    [rays, batched]: [&[Ray]; 2],
    expected: &[Option<Hit>],
    share: Share,
) -> Result<u64, Mismatch> {
    let one_by_one = ask_one_by_one(bvh, &name, rays, expected, share)?;
    Ok(one_by_one + ask_at_once(bvh, wrong(name), batched, expected)?)
}

/// A call that was answered wrong.
fn wrong(name: impl Fn() -> String) -> impl Fn(usize, &str, String) -> Mismatch {
    move |ray, call, got| Mismatch {
        ray: Some(ray),
        variant: format!("{}, {call}", name()),
        got,
    }
}

/// A ray a call.
fn ask_one_by_one<N: WideNode, L: TriangleLeaves, S: Storage>(
    bvh: &Bvh<N, L, S>,
    name: impl Fn() -> String,
    rays: &[Ray],
    expected: &[Option<Hit>],
    share: Share,
) -> Result<u64, Mismatch> {
    let wrong = wrong(name);
    let mut checked = 0;
    for (place, (ray, expected)) in rays.iter().zip(expected).enumerate() {
        let [closest, any] = share.of(place);
        if closest {
            let hit = bvh.closest_hit(ray);
            if bits(hit) != bits(*expected) {
                return Err(wrong(place, "closest_hit", show(hit)));
            }
        }
        if any {
            let any = bvh.any_hit(ray);
            if any != expected.is_some() {
                return Err(wrong(place, "any_hit", any.to_string()));
            }
        }
        checked += u64::from(closest) + u64::from(any);
        // The same walk as above: some will do.
        if closest && place % 16 == 0 {
            let (hit, _) = bvh.closest_hit_counted(ray);
            if bits(hit) != bits(*expected) {
                return Err(wrong(place, "closest_hit_counted", show(hit)));
            }
            checked += 1;
        }
    }
    Ok(checked)
}

/// Batches over all rays, and of some of them in lent memory and packets of eight.
fn ask_at_once<N: WideNode, L: TriangleLeaves, S: Storage>(
    bvh: &Bvh<N, L, S>,
    wrong: impl Fn(usize, &str, String) -> Mismatch,
    rays: &[Ray],
    expected: &[Option<Hit>],
) -> Result<u64, Mismatch> {
    let mut hits = vec![None; rays.len()];
    let mut occluded = vec![false; rays.len()];
    let mut checked = 0;
    let mut compare = |call: [&str; 2], first: usize, hits: &[Option<Hit>], any: &[bool]| {
        for (lane, (&hit, &any)) in hits.iter().zip(any).enumerate() {
            let place = first + lane;
            let expected = expected[place];
            if bits(hit) != bits(expected) {
                return Err(wrong(place, call[0], show(hit)));
            }
            if any != expected.is_some() {
                return Err(wrong(place, call[1], any.to_string()));
            }
            checked += 2;
        }
        Ok(())
    };
    bvh.closest_hits(rays, &mut hits);
    bvh.any_hits(rays, &mut occluded);
    compare(["closest_hits", "any_hits"], 0, &hits, &occluded)?;
    // The same waves, of fewer rays: some will do.
    let some = rays.len() / 8;
    let mut scratch = Scratch::<5>::new();
    bvh.closest_hits_in(&mut scratch, &rays[..some], &mut hits[..some]);
    bvh.any_hits_in(&mut scratch, &rays[..some], &mut occluded[..some]);
    let call = ["closest_hits_in", "any_hits_in"];
    compare(call, 0, &hits[..some], &occluded[..some])?;
    // The same bundles as in batches, of fewer rays: some will do.
    let (packets, _) = rays.as_chunks::<8>();
    for (packet, rays) in packets.iter().enumerate().step_by(8) {
        let (hits, any) = (
            bvh.closest_hit_packet(rays, 0xff),
            bvh.any_hit_packet(rays, 0xff),
        );
        let call = ["closest_hit_packet", "any_hit_packet"];
        compare(call, 8 * packet, &hits, &any)?;
    }
    Ok(checked)
}

/// A hit for people, with its bits.
pub fn show(hit: Option<Hit>) -> String {
    match hit {
        None => "no hit".into(),
        Some(hit) => {
            let Hit { t, u, v, primitive } = hit;
            let [tb, ub, vb] = [t, u, v].map(f32::to_bits);
            format!("triangle {primitive}, t {t:e} ({tb:#x}), u {u:e} ({ub:#x}), v {v:e} ({vb:#x})")
        }
    }
}
