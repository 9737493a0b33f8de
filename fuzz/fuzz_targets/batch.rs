//! Many rays a call: any of them next to any others, in batches and packets of any length, some inactive, over one of a
//! few meshes; held to the reference.
#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use wide_bvh::{
    build::Builder,
    geometry::{Hit, Ray},
    layout::{Node4, Node8},
};
use wide_bvh_fuzz::{
    Found, Mesh, MeshBytes, RayBytes, Triangles, Width, assert_all, found, of_mesh, rays,
};

#[derive(Arbitrary, Debug)]
struct Input {
    scene: Scene,
    active: u64,
    /// Answers that are there beyond the rays, or are missing.
    answers: i8,
    rays: Vec<RayBytes>,
}

#[derive(Arbitrary, Debug)]
enum Scene {
    /// Fine and closed: a ball of 512 triangles.
    Ball,
    /// Coarse and along the axes, with rays' ends on the planes.
    Steps,
    Own(MeshBytes),
}

/// A hierarchy of each width.
struct Both {
    mesh: Mesh,
    wide: Triangles<Node8>,
    narrow: Triangles<Node4>,
}

impl Both {
    fn new(mesh: Mesh) -> Self {
        let builder = Builder::new().drop_non_finite(true);
        Self {
            wide: Node8::build(&builder, &mesh.view()).expect("a build"),
            narrow: Node4::build(&builder, &mesh.view()).expect("a build"),
            mesh,
        }
    }
}

thread_local! {
    static BALL: Both = Both::new(ball());
    static STEPS: Both = Both::new(steps());
}

/// Points of a grid of 32 by 16, from pole to pole.
fn ball() -> Mesh {
    let (across, down) = (32, 8);
    let positions = (0..=down).flat_map(|row| {
        let (sin, cos) = (row as f32 / down as f32 * core::f32::consts::PI).sin_cos();
        (0..across).map(move |column| {
            let turn = column as f32 / across as f32 * core::f32::consts::TAU;
            [sin * turn.cos() * 2.0, cos * 2.0, sin * turn.sin() * 2.0]
        })
    });
    let indices = (0..down).flat_map(|row| {
        (0..across).flat_map(move |column| {
            let at = |row: u32, column: u32| row * across + column % across;
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            [[a, b, c], [b, d, c]]
        })
    });
    Mesh {
        positions: positions.collect(),
        indices: indices.collect(),
    }
}

/// Squares over one another, each a step up.
fn steps() -> Mesh {
    let mut mesh = Mesh::default();
    for step in 0..40 {
        let (height, first) = ((step % 8) as f32 * 0.5, mesh.positions.len() as u32);
        let x = (step / 8) as f32 - 2.0;
        for [dx, dz] in [[0.0, -2.0], [1.0, -2.0], [0.0, 2.0], [1.0, 2.0]] {
            mesh.positions.push([x + dx, height, dz]);
        }
        mesh.indices
            .extend([[0, 1, 2], [1, 3, 2]].map(|triangle| triangle.map(|corner| first + corner)));
    }
    mesh
}

fuzz_target!(|input: Input| {
    match &input.scene {
        Scene::Ball => BALL.with(|both| check(both, &input)),
        Scene::Steps => STEPS.with(|both| check(both, &input)),
        Scene::Own(bytes) => check(&Both::new(bytes.mesh()), &input),
    }
});

fn check(both: &Both, input: &Input) {
    let Both { mesh, wide, narrow } = both;
    let most = if mesh.is_large() { 80 } else { 300 };
    let rays = rays(&input.rays, &mesh.corners(), most);
    let truth = of_mesh(&mesh.view(), &rays);
    assert_all(
        &Node8::ask(wide.as_borrowed(), &rays, input.active),
        &rays,
        &truth,
    );
    assert_all(
        &Node4::ask(narrow.as_borrowed(), &rays, input.active),
        &rays,
        &truth,
    );
    uneven(wide, &rays, &truth, input.answers.into());
}

/// Where there are more answers than rays, or fewer, the rest is left alone.
fn uneven(bvh: &Triangles<Node8>, rays: &[Ray], truth: &[Found], more: isize) {
    let before = Some(Hit {
        t: -1.0,
        u: 0.5,
        v: 0.25,
        primitive: 77,
    });
    let mut hits = vec![before; rays.len().saturating_add_signed(more)];
    bvh.closest_hits(rays, &mut hits);
    for (place, &hit) in hits.iter().enumerate() {
        let expected = truth.get(place).copied().unwrap_or(found(before));
        assert_eq!(found(hit), expected, "ray {place} of {}", rays.len());
    }
}
