//! Builders of every setting on triangles and boxes of any bits, from few to thousands: the errors there should be and no
//! others, hierarchies that answer as the reference does, before and after primitives have moved.
#![no_main]

use arbitrary::Arbitrary;
use bytemuck::cast_slice;
use libfuzzer_sys::fuzz_target;
use wide_bvh::{
    build::{BuildError, Builder, RefitError},
    geometry::{Aabb, MeshError, Ray, TriangleMesh},
    layout::{Bvh, Leaf, Node4, Node8, Owned, WideNode},
    primitive::{Cuboids, Primitives},
};
use wide_bvh_fuzz::{
    BoxBytes, Boxes, Cancel, Float, Liar, Mesh, MeshBytes, Move, RayBytes, Settings, Triangles,
    Width, assert_all, boxes, corners, first_not_finite, floats, moved, of_boxes, of_mesh, rays,
};

#[derive(Arbitrary, Debug)]
struct Input {
    settings: Settings,
    /// After so many calls of the monitor the build is cancelled.
    cancel: Option<u8>,
    wide: bool,
    /// By way of a binary tree.
    binary: bool,
    primitives: PrimitiveBytes,
    rays: Vec<RayBytes>,
}

#[derive(Arbitrary, Debug)]
enum PrimitiveBytes {
    Triangles {
        mesh: MeshBytes,
        /// Somewhere, an index that is not in range.
        stray: Option<Stray>,
        moves: Vec<Moves>,
    },
    Boxes {
        boxes: Vec<BoxBytes>,
        copies: u8,
        moves: Vec<(u16, [Float; 6])>,
        /// So many are there no longer, or are new.
        more: i8,
    },
}

#[derive(Arbitrary, Debug)]
struct Stray {
    triangle: u16,
    corner: u8,
    by: u32,
}

#[derive(Arbitrary, Debug)]
struct Moves {
    vertices: Vec<Move>,
    /// The last triangles are there no longer.
    fewer: Option<u8>,
}

fuzz_target!(|input: Input| {
    match input.wide {
        true => check::<Node8>(&input),
        false => check::<Node4>(&input),
    }
});

fn check<N: Width>(input: &Input) {
    match &input.primitives {
        PrimitiveBytes::Triangles { mesh, stray, moves } => {
            let mesh = mesh.mesh();
            if let Some(stray) = stray {
                assert_stray(mesh.clone(), stray);
            }
            triangles::<N>(input, &mesh, moves);
        }
        PrimitiveBytes::Boxes {
            boxes: bytes,
            copies,
            moves,
            more,
        } => {
            let copies = usize::from(copies.saturating_sub(200)) * 8 + 1;
            let boxes = boxes(bytes, copies);
            let mut moved = boxes.clone();
            for &(place, bounds) in moves {
                let [a, b, c, d, e, f] = floats(bounds);
                let count = moved.len().max(1);
                if let Some(aabb) = moved.get_mut(usize::from(place) % count) {
                    *aabb = Aabb::new([a, b, c].into(), [d, e, f].into());
                }
            }
            let count = moved.len().saturating_add_signed((*more).into());
            moved.resize(count, Aabb::new([0.0; 3].into(), [1.0; 3].into()));
            self::primitives::<N>(input, &boxes, &moved);
        }
    }
}

/// An index past the positions is seen, and the first one is named.
fn assert_stray(mut mesh: Mesh, stray: &Stray) {
    let count = mesh.indices.len();
    if count == 0 {
        return;
    }
    let (triangle, corner) = (
        usize::from(stray.triangle) % count,
        usize::from(stray.corner % 3),
    );
    let positions = mesh.positions.len();
    let index = (positions as u32).saturating_add(stray.by);
    mesh.indices[triangle][corner] = index;
    mesh.indices[count - 1][2] = u32::MAX;
    let index = mesh.indices[triangle][corner];
    let error = TriangleMesh::new(&mesh.positions, &mesh.indices).expect_err("a stray index");
    let expected = MeshError::IndexOutOfRange {
        triangle,
        corner,
        index,
        positions,
    };
    assert_eq!(error, expected);
}

/// A build's outcome, if it is the one there should be: a hierarchy, `error`, or the monitor's will.
fn outcome<T>(
    built: Result<T, BuildError>,
    error: Option<BuildError>,
    cancel: &Cancel,
) -> Option<T> {
    match (built, error) {
        (Ok(built), None) => {
            assert!(!cancel.has_cancelled(), "built all the same");
            Some(built)
        }
        (Ok(_), Some(error)) => panic!("built in spite of {error}"),
        (Err(BuildError::Cancelled), _) => {
            assert!(cancel.has_cancelled(), "nobody cancelled it");
            None
        }
        (Err(found), error) => {
            // As text: a position may be NaN.
            assert_eq!(
                Some(found.to_string()),
                error.map(|error| error.to_string())
            );
            None
        }
    }
}

/// What should be wrong with a mesh.
fn mesh_error(settings: &Settings, mesh: &Mesh) -> Option<BuildError> {
    let triangles = mesh.corners();
    let (triangle, corner) = first_not_finite(&triangles).filter(|_| !settings.drop_non_finite)?;
    Some(BuildError::NonFinitePosition {
        triangle,
        corner,
        vertex: mesh.indices[triangle][corner],
        position: triangles[triangle][corner],
    })
}

fn build<N: Width>(
    builder: &Builder,
    cancel: &Cancel,
    binary: bool,
    mesh: &TriangleMesh,
) -> Result<Triangles<N>, BuildError> {
    match binary {
        false => N::build(builder, mesh),
        true => {
            let tree = builder.build_binary(mesh)?;
            cancel.begin();
            N::build_from_tree(builder, mesh, &tree)
        }
    }
}

fn triangles<N: Width>(input: &Input, mesh: &Mesh, moves: &[Moves]) {
    let cancel = Cancel::after(input.cancel);
    let builder = input.settings.builder().monitor(&cancel);
    let built = build::<N>(&builder, &cancel, input.binary, &mesh.view());
    let Some(mut bvh) = outcome(built, mesh_error(&input.settings, mesh), &cancel) else {
        return;
    };
    let finite = |corners: &&[_; 3]| first_not_finite(&[**corners]).is_none();
    let corners = mesh.corners();
    let dropped = corners.len() - corners.iter().filter(finite).count();
    assert_eq!(bvh.dropped(), dropped);
    assert!(bvh.report().sah_cost.is_finite(), "{}", bvh.report());

    let most = if mesh.is_large() { 8 } else { 40 };
    let rays = rays(&input.rays, &corners, most);
    answers_are_right(&bvh, mesh, &rays);
    let mut mesh = mesh.clone();
    for Moves { vertices, fewer } in moves {
        mesh.positions = moved(&mesh.positions, vertices);
        let mut now = mesh.clone();
        let fewer = fewer.map_or(0, usize::from);
        now.indices
            .truncate(mesh.indices.len().saturating_sub(fewer));
        refit(&mut bvh, &now, &rays);
    }
}

fn answers_are_right<N: Width>(bvh: &Triangles<N>, mesh: &Mesh, rays: &[Ray]) {
    assert_sound(bvh);
    let truth = of_mesh(&mesh.view(), rays);
    assert_all(
        &N::ask(bvh.as_borrowed(), rays, 0x5555_5555_5555_5555),
        rays,
        &truth,
    );
}

/// The parts are those of a hierarchy.
fn assert_sound<N: WideNode, L: Leaf>(bvh: &Bvh<N, L, Owned>) {
    let parts = bvh.as_borrowed();
    let (nodes, leaves, primitives) = (parts.nodes(), parts.leaves(), parts.primitives());
    let check = Bvh::<N, L, Owned>::from_parts(
        nodes.to_vec(),
        leaves.to_vec(),
        primitives.to_vec(),
        *bvh.bounds(),
    );
    assert!(check.is_ok(), "{:?}", check.err());
}

fn bytes<N: WideNode, L: Leaf>(bvh: &Bvh<N, L, Owned>) -> Vec<u8> {
    let bounds = [bvh.bounds().min.to_array(), bvh.bounds().max.to_array()];
    [
        cast_slice(bvh.nodes()),
        cast_slice(bvh.leaves()),
        cast_slice(bvh.primitives()),
        cast_slice(&bounds),
    ]
    .concat()
}

/// Follows a mesh that has moved: with right answers, or an error that is true, and nothing changed.
fn refit<N: Width>(bvh: &mut Triangles<N>, mesh: &Mesh, rays: &[Ray]) {
    let before = bytes(bvh);
    let Err(error) = N::refit(bvh, &mesh.view()) else {
        return answers_are_right(bvh, mesh, rays);
    };
    assert!(before == bytes(bvh), "changed in spite of {error}");
    let (primitive, count) = (error.primitive(), mesh.indices.len());
    let is_listed = bvh.primitives().contains(&(primitive as u32));
    match error {
        RefitError::PrimitiveGone { .. } => assert!(primitive >= count && is_listed),
        RefitError::PrimitiveLeftOut { .. } => assert!(primitive < count && !is_listed),
        RefitError::VerticesParted { .. } => assert!(primitive < count && is_listed),
        RefitError::Primitive { error, .. } => {
            let corners = mesh.corners()[primitive];
            let corner = first_not_finite(&[corners])
                .expect("one that is not finite")
                .1;
            let found = matches!(error, BuildError::NonFinitePosition { triangle, corner: at, .. }
                if triangle == primitive && at == corner);
            assert!(found && is_listed, "{error}");
        }
        error => panic!("{error}"),
    }
}

/// The first box that is none.
fn box_error(settings: &Settings, boxes: &[Aabb]) -> Option<BuildError> {
    let error = |(primitive, &aabb): (usize, &Aabb)| match () {
        () if aabb == Aabb::EMPTY => None,
        () if !aabb.is_finite() => {
            (!settings.drop_non_finite).then_some(BuildError::NonFiniteBox { primitive })
        }
        () => aabb
            .is_empty()
            .then_some(BuildError::InvalidBox { primitive }),
    };
    boxes.iter().enumerate().find_map(error)
}

fn build_primitives<N: Width>(
    builder: &Builder,
    cancel: &Cancel,
    binary: bool,
    boxes: &[Aabb],
) -> Result<Boxes<N>, BuildError> {
    match binary {
        false => N::build_primitives(builder, boxes),
        true => {
            let tree = builder.build_primitives_binary(boxes)?;
            cancel.begin();
            N::build_primitives_from_tree(builder, boxes, &tree)
        }
    }
}

fn primitives<N: Width>(input: &Input, boxes: &[Aabb], moved: &[Aabb]) {
    let cancel = Cancel::after(input.cancel);
    let builder = input.settings.builder().monitor(&cancel);
    let built = build_primitives::<N>(&builder, &cancel, input.binary, boxes);
    let Some(mut bvh) = outcome(built, box_error(&input.settings, boxes), &cancel) else {
        return;
    };
    assert_sound(&bvh);
    assert!(bvh.report().sah_cost.is_finite(), "{}", bvh.report());
    let most = if boxes.len() > 256 { 8 } else { 40 };
    let rays = rays(&input.rays, &corners(boxes), most);
    let dropped = boxes
        .iter()
        .filter(|aabb| !aabb.is_finite() && **aabb != Aabb::EMPTY);
    assert_eq!(bvh.dropped(), dropped.count());
    primitives_are_right(&bvh, &Cuboids(boxes), boxes.len(), &rays);
    primitives_are_right(&bvh, &Liar(boxes), boxes.len(), &rays);

    let before = bytes(&bvh);
    match N::refit_primitives(&mut bvh, moved) {
        Ok(()) => {
            assert_sound(&bvh);
            primitives_are_right(&bvh, &Cuboids(moved), moved.len(), &rays);
            primitives_are_right(&bvh, &Liar(moved), moved.len(), &rays);
        }
        Err(error) => {
            assert!(before == bytes(&bvh), "changed in spite of {error}");
            let primitive = error.primitive();
            let aabb = moved.get(primitive).copied();
            let is_listed = bvh.primitives().contains(&(primitive as u32));
            match error {
                RefitError::PrimitiveGone { .. } => assert!(aabb.is_none() && is_listed),
                RefitError::PrimitiveLeftOut { .. } => assert!(aabb.is_some() && !is_listed),
                RefitError::Primitive { .. } => {
                    assert!(aabb.is_some_and(|aabb| aabb.is_empty() || !aabb.is_finite()));
                    assert!(is_listed);
                }
                error => panic!("{error}"),
            }
        }
    }
}

fn primitives_are_right<N: Width>(
    bvh: &Boxes<N>,
    primitives: &dyn Primitives<Detail = ()>,
    count: usize,
    rays: &[Ray],
) {
    let truth = of_boxes(primitives, count, rays);
    let answers = N::ask_primitives(bvh.as_borrowed(), primitives, rays);
    assert_all(&answers, rays, &truth);
}
