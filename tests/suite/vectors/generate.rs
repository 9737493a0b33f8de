//! Where the files come from: meshes of four kinds, rays of every kind, and the reference's answers.

use super::file::Vectors;
use fastrand::Rng;
use glam::Vec3;
use wide_bvh::{
    geometry::{Ray, TriangleMesh},
    reference,
};
use wide_bvh_scenes::{Mesh, shapes};

const SEED: u64 = 0x5eed_0b0e;

/// The vectors of this name.
///
/// # Panics
/// If there are none of this name.
pub fn generate(name: &str) -> Vectors {
    let mut rng = Rng::with_seed(SEED);
    let (mesh, count) = match name {
        "knot" => (shapes::torus_knot(2, 3, 0.25, 48, 6), 800),
        "soup" => (soup(&mut rng), 600),
        "grid" => (shapes::quantised(shapes::terrain(9, 0.5, SEED), 18), 500),
        "range" => (range(&mut rng), 400),
        _ => panic!("no vectors of the name {name}"),
    };
    let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
    let rays = rays(&mesh, &view, count, &mut rng);
    let hits = rays
        .iter()
        .map(|ray| reference::closest_hit(&view, ray))
        .collect();
    Vectors {
        rays,
        hits,
        positions: mesh.positions,
        indices: mesh.indices,
    }
}

/// Triangles of all sizes, some of them twice over, for equal `t`; needles; and some without an area.
fn soup(rng: &mut Rng) -> Mesh {
    let mut mesh = shapes::soup(90, SEED);
    for _ in 0..20 {
        let twice = mesh.indices[rng.usize(..mesh.indices.len())];
        mesh.indices.insert(rng.usize(..mesh.indices.len()), twice);
        let [a, b] = [point(rng), point(rng)];
        let beside = a.lerp(b, rng.f32()) + point(rng) * 1e-6;
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([a, b, beside].map(|p| p.to_array()));
        mesh.indices.push([first, first + 1, first + 2]);
        mesh.indices.push([first, first, first + 1]);
    }
    mesh
}

/// Triangles from 2^-140, which is denormal, to 2^100 in size, around the origin.
fn range(rng: &mut Rng) -> Mesh {
    let sizes = (-140..=100).step_by(4).map(|e| f64::exp2(e.into()) as f32);
    let corners = sizes.flat_map(|size| [(); 3].map(|()| (point(rng) * size).to_array()));
    let positions: Vec<_> = corners.collect();
    Mesh {
        name: "range".into(),
        indices: (0..positions.len() as u32 / 3)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect(),
        positions,
    }
}

fn rays(mesh: &Mesh, view: &TriangleMesh, count: usize, rng: &mut Rng) -> Vec<Ray> {
    let mut rays = Vec::new();
    while rays.len() < count {
        let ray = ray(mesh, rays.len(), rng);
        rays.push(ray);
        // A range that ends, or begins, at the hit, or next to it.
        if let Some(hit) = reference::closest_hit(view, &ray)
            && rng.u32(0..4) == 0
        {
            let t = hit.t;
            let ranges = [
                (ray.t_min, t),
                (t, t),
                (ray.t_min, t.next_down()),
                (t.next_up(), ray.t_max),
            ];
            let (t_min, t_max) = ranges[rng.usize(..4)];
            rays.push(ray.with_range(t_min, t_max));
        }
    }
    rays.truncate(count);
    rays
}

fn ray(mesh: &Mesh, number: usize, rng: &mut Rng) -> Ray {
    let (min, max) = mesh.bounds();
    let (centre, half) = (
        (Vec3::from(min) + Vec3::from(max)) * 0.5,
        (Vec3::from(max) - Vec3::from(min)) * 0.5,
    );
    let corners = mesh.indices[rng.usize(..mesh.indices.len())];
    let [a, b, c] = corners.map(|i| Vec3::from(mesh.positions[i as usize]));
    let (s, t) = (rng.f32(), rng.f32());
    let (on_edge, on_face) = (a + s * (b - a), a + s * (b - a) + (1.0 - s) * t * (c - a));
    let mut around = |scale: f32| centre + half * scale * point(rng);
    let (eye, other) = (around(2.5), around(1.0));
    match number % 14 {
        0 => Ray::new(eye, other - eye),
        1 | 2 => Ray::new(eye, a - eye),
        3 => Ray::new(eye, on_edge - eye),
        4 | 5 => Ray::new(eye, on_face - eye),
        // From on a triangle, and between two points of triangles.
        6 => Ray::new(on_face, other - on_face),
        7 => Ray::segment(eye, on_face),
        // Along an axis, through a vertex or an edge.
        8 | 9 => {
            let axis = rng.usize(..3);
            let mut origin = if rng.bool() { a } else { on_edge };
            let mut direction = Vec3::splat([0.0, -0.0][rng.usize(..2)]);
            origin[axis] = eye[axis];
            direction[axis] = [1.0, -1.0][rng.usize(..2)];
            Ray::new(origin, direction)
        }
        // In the plane of a triangle.
        10 => Ray::new(a + s * (a - on_face), on_edge - a),
        // Long and short directions.
        11 => {
            let stretch = f64::exp2(rng.i32(-130..120).into()) as f32;
            Ray::new(eye, (on_face - eye).normalize_or_zero() * stretch)
        }
        // One number of any bits at all.
        12 => {
            let mut ray = Ray::new(eye, on_face - eye);
            match rng.usize(..8) {
                field @ 0..3 => ray.origin[field] = any_float(rng),
                field @ 3..6 => ray.direction[field - 3] = any_float(rng),
                6 => ray.t_min = any_float(rng),
                _ => ray.t_max = any_float(rng),
            }
            ray
        }
        _ => {
            let mut three = || [any_float(rng), any_float(rng), any_float(rng)];
            let ray = Ray::new(three(), three());
            ray.with_range(any_float(rng), any_float(rng))
        }
    }
}

fn point(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 2.0 - 1.0
}

fn any_float(rng: &mut Rng) -> f32 {
    let odd = [
        0.0,
        -0.0,
        f32::NAN,
        -f32::NAN,
        // A signalling one.
        f32::from_bits(0x7f80_0001),
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        -f32::from_bits(1),
        f32::MAX,
        f32::MIN,
    ];
    match rng.u32(..3) {
        0 => odd[rng.usize(..odd.len())],
        1 => f32::from_bits(rng.u32(..)),
        _ => rng.f32() * 2.0 - 1.0,
    }
}
