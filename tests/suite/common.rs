//! What the contract's tests share: every variant of a hierarchy, held to the reference.

pub use crate::vectors::bits;
use glam::Vec3;
use proptest::{
    prelude::*,
    test_runner::{Config, RngSeed},
};
use wide_bvh::{
    build::{Builder, Preset},
    geometry::{Hit, Ray, TriangleMesh},
    layout::{
        Borrowed, Bvh, CompactNode4, CompactNode8, MeshLeaf, Node4, Node8, Owned, RunLeaf, Storage,
        TriangleLeaves, WideNode,
    },
    reference,
    simd::Backend,
};

/// The seed of every random test, so that a failure is there again the next time.
pub const SEED: u64 = 0x5eed_0b0e;

/// `count`, or the part of it that is asked for: `TEST_PART=20` is a twentieth of all random tests, for processors that
/// are emulated.
pub fn part(count: usize) -> usize {
    let part = std::env::var("TEST_PART").map(|part| part.parse());
    count.div_ceil(part.map_or(1, |part| part.expect("TEST_PART: a number, 1 or more")))
}

/// `cases` cases, or the [`part`] of them, from the fixed seed.
pub fn config(cases: u32) -> Config {
    Config {
        cases: part(cases as usize) as u32,
        rng_seed: RngSeed::Fixed(SEED),
        failure_persistence: None,
        ..Config::default()
    }
}

/// A variant's name, and what it answers: closest hit and any hit.
type Query = (String, Box<dyn Fn(&Ray) -> (Option<Hit>, bool) + Sync>);

/// A scene under every width and on every backend of this machine.
pub struct Variants {
    positions: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
    queries: Vec<Query>,
}

impl Variants {
    pub fn new(positions: Vec<[f32; 3]>, indices: Vec<[u32; 3]>) -> Self {
        let mut queries = Vec::new();
        // Compact layouts read the mesh for as long as they are asked.
        let (kept, kept_indices) = (leaked(positions.clone()), leaked(indices.clone()));
        let mesh = TriangleMesh::new(kept, kept_indices).unwrap();
        let builder = Builder::new().drop_non_finite(true);
        add_backends(
            &mut queries,
            "full",
            builder.build_as::<Node8>(&mesh).unwrap(),
        );
        add_backends(
            &mut queries,
            "full",
            builder.build_as::<Node4>(&mesh).unwrap(),
        );
        add_backends(
            &mut queries,
            "compact",
            compact::<CompactNode8>(&builder, &mesh),
        );
        add_backends(
            &mut queries,
            "compact",
            compact::<CompactNode4>(&builder, &mesh),
        );
        for preset in [Preset::Balanced, Preset::Fast] {
            let builder = Builder::new().preset(preset).drop_non_finite(true);
            let name = |kind| format!("{preset:?}, {kind}");
            let bvh = builder.build_as::<Node8>(&mesh).unwrap();
            add(&mut queries, name("8-wide"), bvh);
            let bvh = builder.build_as::<Node4>(&mesh).unwrap();
            add(&mut queries, name("4-wide"), bvh);
            let bvh = compact::<CompactNode8>(&builder, &mesh);
            add(&mut queries, name("compact"), bvh);
            let bvh = builder.build_as::<CompactNode8>(&mesh).unwrap();
            add(&mut queries, name("compact with leaves"), bvh);
        }
        Self {
            positions,
            indices,
            queries,
        }
    }

    pub fn mesh(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions, &self.indices).unwrap()
    }

    /// The reference's answer, if every variant gives it, bit for bit.
    pub fn check(&self, ray: &Ray) -> Result<Option<Hit>, String> {
        let expected = reference::closest_hit(&self.mesh(), ray);
        for (name, query) in &self.queries {
            let (hit, any) = query(ray);
            if bits(hit) != bits(expected) {
                return Err(format!("{name}: {hit:?}, not {expected:?}, for {ray:?}"));
            }
            if any != expected.is_some() {
                return Err(format!(
                    "{name}: any hit {any}, not {expected:?}, for {ray:?}"
                ));
            }
        }
        Ok(expected)
    }

    /// Every variant's closest hit, if they agree; for scenes too large for the reference.
    pub fn agreed(&self, ray: &Ray) -> Result<Option<Hit>, String> {
        let expected = self.queries[0].1(ray).0;
        for (name, query) in &self.queries {
            let (hit, any) = query(ray);
            if bits(hit) != bits(expected) || any != expected.is_some() {
                return Err(format!(
                    "{name}: {hit:?}, {any}, not {expected:?}, for {ray:?}"
                ));
            }
        }
        Ok(expected)
    }
}

/// Memory that stays: tests are short.
fn leaked<T>(memory: T) -> &'static T {
    Box::leak(Box::new(memory))
}

fn compact<N: WideNode>(
    builder: &Builder,
    mesh: &TriangleMesh<'static>,
) -> Bvh<N, MeshLeaf<'static>, Borrowed<'static>> {
    let tree: Bvh<N, RunLeaf, Owned> = builder.build_compact(mesh).unwrap();
    leaked(tree).over(mesh).unwrap()
}

fn add_backends<N: WideNode + Sync, L: TriangleLeaves, S: Storage>(
    queries: &mut Vec<Query>,
    kind: &str,
    bvh: Bvh<N, L, S>,
) where
    Bvh<N, L, S>: Clone + Sync + 'static,
{
    for backend in Backend::available() {
        for (looks_ahead, how) in [(false, ""), (true, ", looking ahead")] {
            let mut bvh = bvh.clone();
            bvh.set_backend(backend);
            bvh.set_looks_ahead(looks_ahead);
            let name = format!("{kind}, {}-wide, {}{how}", N::WIDTH, backend.name());
            add(queries, name, bvh);
        }
    }
}

fn add<N: WideNode, L: TriangleLeaves, S: Storage>(
    queries: &mut Vec<Query>,
    name: String,
    bvh: Bvh<N, L, S>,
) where
    Bvh<N, L, S>: Sync + 'static,
{
    let query = move |ray: &Ray| (bvh.closest_hit(ray), bvh.any_hit(ray));
    queries.push((name, Box::new(query)));
}

/// Any float at all, NaN, infinities, zeros and denormals as likely as the others together.
pub fn any_float() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits),
        prop::sample::select(vec![
            0.0,
            -0.0,
            1.0,
            -1.0,
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MIN_POSITIVE,
            -f32::MIN_POSITIVE,
            f32::from_bits(1),
            -f32::from_bits(1),
            f32::MAX,
            f32::MIN,
            f32::EPSILON,
        ]),
        -2.0f32..2.0,
    ]
}

/// Coordinates that often coincide, and often do not.
pub fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        (-3i8..=3).prop_map(f32::from),
        (-8i8..=8).prop_map(|x| f32::from(x) / 4.0 + 0.1),
        -3.0f32..3.0,
    ]
}

pub fn point() -> impl Strategy<Value = [f32; 3]> {
    [coordinate(), coordinate(), coordinate()]
}

/// Triangles that share vertices, cross one another, lie in planes of an axis, are degenerate.
pub fn soup(
    triangles: std::ops::Range<usize>,
) -> impl Strategy<Value = (Vec<[f32; 3]>, Vec<[u32; 3]>)> {
    prop::collection::vec(point(), 3..40).prop_flat_map(move |positions| {
        let index = 0..positions.len() as u32;
        let corners = [index.clone(), index.clone(), index];
        (
            Just(positions),
            prop::collection::vec(corners, triangles.clone()),
        )
    })
}

/// Where on a triangle a ray is aimed, as weights of its second and third corner.
pub fn target() -> impl Strategy<Value = (f32, f32)> {
    prop_oneof![
        Just((0.0, 0.0)),
        Just((1.0, 0.0)),
        Just((0.0, 1.0)),
        (0.0f32..=1.0).prop_map(|u| (u, 0.0)),
        (0.0f32..=1.0).prop_map(|v| (0.0, v)),
        (0.0f32..=1.0).prop_map(|u| (u, 1.0 - u)),
        (0.0f32..=1.0, 0.0f32..=1.0).prop_map(|(u, v)| if u + v > 1.0 {
            (1.0 - u, 1.0 - v)
        } else {
            (u, v)
        }),
    ]
}

/// The point of a triangle with the given weights.
pub fn point_on(triangle: [Vec3; 3], (u, v): (f32, f32)) -> Vec3 {
    let [a, b, c] = triangle;
    a + u * (b - a) + v * (c - a)
}
