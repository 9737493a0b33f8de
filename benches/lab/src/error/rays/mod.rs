//! The rays that variants are judged by: those of the race, and those aimed where tests fail.

mod aim;

use crate::workloads::{self, Query};
use aim::Aim;
use fastrand::Rng;
use glam::Vec3;
use wide_bvh::{geometry::Ray, layout::Bvh8};
use wide_bvh_scenes::{Mesh, shapes};

/// Rays of one kind.
pub struct RaySet {
    /// In tables and JSON.
    pub name: &'static str,
    pub rays: Vec<Ray>,
}

/// Aimed at corners of triangles that are seen from where the ray starts, a random point about the scene.
pub const VERTICES: &str = "vertices";
/// The same, at points of their edges.
pub const EDGES: &str = "edges";
/// At points of edges that are part of an outline: of one triangle alone, or with both triangles on one side.
pub const SILHOUETTES: &str = "silhouettes";
/// From a point of one triangle at a corner or edge of another, all hits nearer than 10^-4 of the scene left out.
pub const SURFACE: &str = "from surface";
/// From inside a closed mesh at its corners, edges and faces.
pub const INSIDE: &str = "from inside";

/// At needles.
pub const NEEDLES: &str = "needles";

/// The rays of one scene, about `size` of each kind. `bvh` is of the same mesh.
pub fn of_scene<'a>(mesh: &'a Mesh, bvh: &'a Bvh8, size: usize) -> Vec<RaySet> {
    let of_race = workloads::workloads(mesh, bvh, size);
    let mut sets: Vec<RaySet> = of_race
        .into_iter()
        .filter(|workload| workload.query == Query::Closest)
        .map(|workload| RaySet {
            name: workload.name,
            rays: workload.rays,
        })
        .collect();
    let mut aim = Aim::new(mesh, bvh);
    type Shoot<'a> = fn(&mut Aim<'a>) -> Option<Ray>;
    let aimed: [(_, Shoot<'a>); 4] = [
        (VERTICES, Aim::at_vertex),
        (EDGES, Aim::at_edge),
        (SILHOUETTES, Aim::at_silhouette),
        (SURFACE, Aim::off_surface),
    ];
    for (name, shoot) in aimed {
        // A scene may have no outline to be found, so the tries are limited.
        let rays = (0..4 * size).filter_map(|_| shoot(&mut aim)).take(size);
        sets.push(RaySet {
            name,
            rays: rays.collect(),
        });
    }
    sets.retain(|set| !set.rays.is_empty());
    sets
}

/// Closed meshes, and how far below a face of each, against its normal, one is inside for certain.
pub fn closed_meshes() -> [(Mesh, [f32; 2]); 3] {
    let named = |name: &str, mesh: Mesh| Mesh {
        name: name.to_owned(),
        ..mesh
    };
    [
        (shapes::icosphere(4), [0.05, 1.0]),
        (shapes::torus_knot(2, 3, 0.15, 400, 24), [0.03, 0.2]),
        (
            named(
                "quantised sphere",
                shapes::quantised(shapes::icosphere(4), 64),
            ),
            [3.0, 40.0],
        ),
    ]
}

/// Needles across one another in a ball, as hair is made of: about as long as the ball is wide, 10^-5 to 10^-3 of that
/// across.
pub fn needles() -> Mesh {
    let mut rng = Rng::with_seed(3);
    let mut point = || loop {
        let point = Vec3::from([(); 3].map(|()| 2.0 * rng.f32() - 1.0));
        if point.length() < 1.0 {
            break point;
        }
    };
    let mut positions = Vec::new();
    for needle in 0..3000 {
        let (a, b) = (point(), point());
        let width = 10f32.powf(-3.0 - (needle % 3) as f32);
        let c = b + point().normalize() * width * a.distance(b);
        positions.extend([a, b, c].map(|corner| corner.to_array()));
    }
    let count = positions.len() as u32;
    Mesh {
        name: NEEDLES.to_owned(),
        positions,
        indices: (0..count).step_by(3).map(|i| [i, i + 1, i + 2]).collect(),
    }
}

/// Rays at points of needles, from as far away as the mesh is wide.
pub fn at_needles(mesh: &Mesh, size: usize) -> RaySet {
    let mut rng = Rng::with_seed(4);
    let (min, max) = mesh.bounds();
    let (min, max) = (Vec3::from(min), Vec3::from(max));
    let mut ray = || {
        let [a, b, c] = corners(mesh, rng.usize(..mesh.indices.len()));
        let (s, t) = (rng.f32(), rng.f32());
        let target = a.lerp(b.lerp(c, s), t.sqrt());
        let away = Vec3::from([(); 3].map(|()| rng.f32() - 0.5)).normalize_or(Vec3::X);
        let origin = (min + max) * 0.5 + away * min.distance(max);
        Ray::new(origin, target - origin)
    };
    RaySet {
        name: NEEDLES,
        rays: (0..size).map(|_| ray()).collect(),
    }
}

/// Rays from inside a closed mesh: from `depths` below a face's middle, a third of them from whole numbers, at corners,
/// edges and faces, and along axes.
pub fn from_inside(mesh: &Mesh, depths: [f32; 2], size: usize) -> RaySet {
    let mut rng = Rng::with_seed(2);
    let mut rays = Vec::with_capacity(size);
    while rays.len() < size {
        let [from, to] = [(); 2].map(|()| corners(mesh, rng.usize(..mesh.indices.len())));
        let [a, b, c] = from;
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            continue;
        };
        let depth = depths[0] + rng.f32() * (depths[1] - depths[0]);
        let origin = (a + b + c) / 3.0 - depth * normal;
        let whole = depths[0] > 1.0 && rng.usize(..3) == 0;
        let origin = if whole { origin.round() } else { origin };
        let [a, b, c] = to;
        let target = match rng.usize(..8) {
            0..3 => a,
            3..6 => a + rng.f32() * (b - a),
            6 => a + rng.f32() * 0.5 * (b - a) + rng.f32() * 0.5 * (c - a),
            _ => {
                let axis = Vec3::AXES[rng.usize(..3)];
                origin + if rng.bool() { axis } else { -axis }
            }
        };
        if target != origin {
            rays.push(Ray::new(origin, target - origin));
        }
    }
    RaySet { name: INSIDE, rays }
}

fn corners(mesh: &Mesh, triangle: usize) -> [Vec3; 3] {
    mesh.indices[triangle].map(|i| mesh.positions[i as usize].into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::truth::{ExactRay, Truth};
    use wide_bvh::{build::Builder, geometry::TriangleMesh};

    fn build(mesh: &Mesh) -> (TriangleMesh<'_>, Bvh8) {
        let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        (view, Builder::new().build(&view).unwrap())
    }

    #[test]
    fn no_ray_from_inside_gets_out_in_truth() {
        for (mesh, depths) in closed_meshes() {
            let (view, bvh) = build(&mesh);
            let truth = Truth::new(view, &bvh);
            for ray in from_inside(&mesh, depths, 2000).rays {
                let ray = ExactRay::from(&ray);
                assert!(truth.first(&ray).is_some(), "{}: {ray:?}", mesh.name);
            }
        }
    }

    #[test]
    fn rays_at_silhouettes_pass_close_to_what_they_are_aimed_at() {
        let mesh = shapes::icosphere(3);
        let (_, bvh) = build(&mesh);
        let sets = of_scene(&mesh, &bvh, 300);
        let rays = |name| &sets.iter().find(|set| set.name == name).unwrap().rays;
        for ray in rays(SILHOUETTES) {
            // Inside the sphere there is no outline, and outside the nearest point to the centre is on it.
            assert!(ray.origin.length() > 0.9);
            let along = ray.direction.normalize();
            let nearest = ray.origin - ray.origin.dot(along) * along;
            assert!((0.95..1.001).contains(&nearest.length()), "{nearest}");
        }
        for ray in rays(VERTICES) {
            assert!((ray.at(1.0).length() - 1.0).abs() < 1e-5);
        }
        assert_eq!(rays(EDGES).len(), 300);
        assert!(rays(SURFACE).iter().all(|ray| ray.t_min > 0.0));
    }
}
