//! Compact hierarchies that have followed a mesh, or primitives, answer as the reference does on them where they are.

use crate::common::{SEED, bits, config, coordinate, point, point_on, soup, target};
use fastrand::Rng;
use glam::Vec3;
use proptest::prelude::*;
use wide_bvh::{
    build::{Builder, Preset, RefitError, ReorderedMesh},
    geometry::{Ray, TriangleMesh},
    layout::{
        Bvh, CompactNode4, CompactNode8, OrderedBvh8Ref, OrderedLeaf, Owned, RunLeaf, WideNode,
    },
    reference,
};
use wide_bvh_scenes::shapes;

type Compact<N> = Bvh<N, RunLeaf, Owned>;
type Ordered<N> = Bvh<N, OrderedLeaf, Owned>;

fn builders() -> [Builder<'static>; 3] {
    [Preset::Best, Preset::Balanced, Preset::Fast].map(|preset| {
        Builder::new()
            .preset(preset)
            .drop_non_finite(true)
            .splits(0.0)
    })
}

/// A hierarchy by list, and one in order with its mesh.
struct Both<N: WideNode> {
    compact: Compact<N>,
    ordered: Ordered<N>,
    reordered: ReorderedMesh,
}

impl<N: WideNode> Both<N> {
    fn new(builder: &Builder, mesh: &TriangleMesh) -> Self {
        let compact: Compact<N> = builder.build_compact(mesh).unwrap();
        let (ordered, reordered) = compact.reorder(mesh).unwrap();
        Self {
            compact,
            ordered,
            reordered,
        }
    }

    /// Has both follow; the first one's outcome, which is the other's, too, but for the numbers.
    fn refit(&mut self, mesh: &TriangleMesh) -> Result<(), RefitError> {
        let before = (self.compact.clone(), self.ordered.clone());
        let outcome = self.compact.refit(mesh);
        let vertices = self.reordered.vertices.iter();
        let moved = vertices.map(|&vertex| mesh.positions()[vertex as usize]);
        self.reordered.positions = moved.collect();
        let (positions, indices) = (&self.reordered.positions, &self.reordered.indices);
        let in_order = TriangleMesh::new(positions, indices).unwrap();
        let of_ordered = self.ordered.refit(&in_order);
        assert_eq!(of_ordered.is_ok(), outcome.is_ok());
        if outcome.is_err() {
            assert!(before.0.to_bytes() == self.compact.to_bytes());
            assert!(before.1.to_bytes() == self.ordered.to_bytes());
        }
        outcome
    }

    fn mesh(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.reordered.positions, &self.reordered.indices).unwrap()
    }

    fn check(&self, mesh: &TriangleMesh, ray: &Ray) -> Result<bool, TestCaseError> {
        let expected = reference::closest_hit(mesh, ray);
        let compact = self.compact.over(mesh).unwrap();
        prop_assert_eq!(bits(compact.closest_hit(ray)), bits(expected), "{:?}", ray);
        prop_assert_eq!(compact.any_hit(ray), expected.is_some());
        let (own, expected) = (self.mesh(), reference::closest_hit(&self.mesh(), ray));
        let ordered = self.ordered.over(&own).unwrap();
        prop_assert_eq!(bits(ordered.closest_hit(ray)), bits(expected), "{:?}", ray);
        Ok(expected.is_some())
    }

    /// The parts are still those of sound hierarchies.
    fn check_parts(&self) {
        let (nodes, numbers) = (
            self.compact.nodes().to_vec(),
            self.compact.primitives().to_vec(),
        );
        Compact::<N>::from_parts(nodes, (), numbers, *self.compact.bounds()).unwrap();
    }
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn vertices_moved_anywhere(
        (positions, indices) in soup(1..60),
        motions in prop::collection::vec(
            prop::collection::vec((any::<prop::sample::Index>(), [coordinate(), coordinate(), coordinate()]), 0..40),
            1..4,
        ),
        rays in prop::collection::vec((point(), any::<prop::sample::Index>(), target()), 12),
    ) {
        for builder in builders() {
            let mesh = TriangleMesh::new(&positions, &indices).unwrap();
            let mut wide = Both::<CompactNode8>::new(&builder, &mesh);
            let mut narrow = Both::<CompactNode4>::new(&builder, &mesh);
            let mut moved = positions.clone();
            for motion in &motions {
                for (vertex, to) in motion {
                    moved[vertex.index(positions.len())] = *to;
                }
                let mesh = TriangleMesh::new(&moved, &indices).unwrap();
                let outcome = wide.refit(&mesh);
                prop_assert_eq!(narrow.refit(&mesh), outcome);
                match outcome {
                    Ok(()) => {}
                    Err(RefitError::PrimitiveLeftOut { primitive }) => {
                        prop_assert!(!wide.compact.primitives().contains(&(primitive as u32)));
                    }
                    Err(RefitError::AreaLost { primitive }) => {
                        prop_assert!(wide.compact.primitives().contains(&(primitive as u32)));
                        let alone = TriangleMesh::new(&moved, &indices[primitive..][..1]).unwrap();
                        prop_assert!(Builder::new().build(&alone).unwrap().primitives().is_empty());
                    }
                    Err(error) => prop_assert!(false, "{}", error),
                }
                if outcome.is_err() {
                    wide = Both::new(&builder, &mesh);
                    narrow = Both::new(&builder, &mesh);
                }
                wide.check_parts();
                narrow.check_parts();
                for (origin, pick, at) in &rays {
                    let triangle = mesh.triangle(pick.index(indices.len())).unwrap();
                    let ray = Ray::new(*origin, point_on(triangle, *at) - Vec3::from(*origin));
                    wide.check(&mesh, &ray)?;
                    narrow.check(&mesh, &ray)?;
                }
            }
        }
    }
}

/// Shapes that bend, some of one leaf alone; what was written after it opens.
#[test]
fn shapes_that_bend() {
    let mut rng = Rng::with_seed(SEED);
    for mesh in [
        shapes::icosphere(3),
        shapes::soup(700, 3),
        shapes::cuboid([0.0; 3], [1.0, 2.0, 3.0]),
        shapes::soup(3, 3),
    ] {
        let indices = &mesh.indices;
        let view = TriangleMesh::new(&mesh.positions, indices).unwrap();
        // Where triangles are cut, each piece gets the box of the whole.
        let cutting = Builder::new().splits(3.0);
        let mut cut: Compact<CompactNode4> = cutting.build_compact(&view).unwrap();
        for builder in builders() {
            let mut both = Both::<CompactNode8>::new(&builder, &view);
            let mut hits = 0;
            for frame in 1..6 {
                let bend = frame as f32 * 0.4;
                let bent = mesh.positions.iter().map(|&[x, y, z]| {
                    let (sin, cos) = (bend * y).sin_cos();
                    [cos * x + sin * z, y * (1.0 + bend), cos * z - sin * x]
                });
                let moved: Vec<[f32; 3]> = bent.collect();
                let view = TriangleMesh::new(&moved, indices).unwrap();
                both.refit(&view).unwrap();
                both.check_parts();
                cut.refit(&view).unwrap();
                let cut = cut.over(&view).unwrap();
                let bytes = both.ordered.to_bytes().unwrap();
                let opened = OrderedBvh8Ref::from_bytes(&bytes).unwrap();
                for _ in 0..60 {
                    let origin = 4.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 2.0;
                    let triangle = view.triangle(rng.usize(..indices.len())).unwrap();
                    let at = (rng.f32() * 0.5, rng.f32() * 0.5);
                    let ray = Ray::new(origin, point_on(triangle, at) - origin);
                    hits += usize::from(both.check(&view, &ray).unwrap());
                    let expected = reference::closest_hit(&view, &ray);
                    assert_eq!(bits(cut.closest_hit(&ray)), bits(expected));
                    let own = both.mesh();
                    let hit = opened.over(&own).unwrap().closest_hit(&ray);
                    assert_eq!(bits(hit), bits(reference::closest_hit(&own, &ray)));
                }
            }
            assert!(hits > 120);
        }
    }
}

/// To where it was is what it was.
#[test]
fn there_and_back() {
    let mesh = shapes::icosphere(3);
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    for builder in builders() {
        let built = Both::<CompactNode8>::new(&builder, &view);
        let mut both = Both::<CompactNode8>::new(&builder, &view);
        let moved: Vec<_> = mesh
            .positions
            .iter()
            .map(|p| p.map(|x| 3.0 * x + 1.0))
            .collect();
        both.refit(&TriangleMesh::new(&moved, &mesh.indices).unwrap())
            .unwrap();
        assert!(both.compact.to_bytes() != built.compact.to_bytes());
        both.refit(&view).unwrap();
        assert!(both.compact.to_bytes() == built.compact.to_bytes());
        assert!(both.ordered.to_bytes() == built.ordered.to_bytes());
    }
}

#[test]
fn offenders_are_named() {
    let mesh = shapes::soup(300, 5);
    let (mut positions, indices) = (mesh.positions, mesh.indices);
    // One without area.
    let [a, b, _] = indices[7].map(|vertex| vertex as usize);
    let was = positions[b];
    positions[b] = positions[a];
    let view = TriangleMesh::new(&positions, &indices).unwrap();
    for builder in builders() {
        let built: Compact<CompactNode8> = builder.build_compact(&view).unwrap();
        let refit = |positions: &[[f32; 3]], indices: &[[u32; 3]]| {
            let mut bvh = built.clone();
            let outcome = bvh.refit(&TriangleMesh::new(positions, indices).unwrap());
            assert!(outcome.is_ok() || bvh.to_bytes() == built.to_bytes());
            outcome
        };
        let mut moved = positions.clone();
        assert_eq!(refit(&moved, &indices), Ok(()));
        assert_eq!(
            refit(&moved, &indices[..200]),
            Err(RefitError::PrimitiveGone { primitive: 200 })
        );
        moved[b] = was;
        assert_eq!(
            refit(&moved, &indices),
            Err(RefitError::PrimitiveLeftOut { primitive: 7 })
        );
        for lost in [250, 40, 90] {
            let [a, b, _] = indices[lost].map(|vertex| vertex as usize);
            moved[b] = moved[a];
        }
        assert_eq!(
            refit(&moved, &indices),
            Err(RefitError::AreaLost { primitive: 40 })
        );
        moved[indices[30][2] as usize][1] = f32::NAN;
        let error = refit(&moved, &indices).unwrap_err();
        assert_eq!(error.primitive(), 30);
        assert!(matches!(error, RefitError::Primitive { .. }));
    }
}
