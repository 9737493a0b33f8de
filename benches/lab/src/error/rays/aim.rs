//! Rays aimed at what a scene's triangles have in common.

use super::corners;
use fastrand::Rng;
use glam::Vec3;
use std::collections::HashMap;
use wide_bvh::{
    geometry::{Aabb, Hit, Ray},
    layout::Bvh8,
};
use wide_bvh_scenes::Mesh;

/// Finds what to aim at in a scene.
pub struct Aim<'a> {
    mesh: &'a Mesh,
    bvh: &'a Bvh8,
    bounds: Aabb,
    edges: HashMap<[[u32; 3]; 2], Faces>,
    rng: Rng,
}

/// How many triangles have an edge, and two of them.
#[derive(Clone, Copy, Default)]
struct Faces {
    count: u32,
    triangles: [u32; 2],
}

/// Two ends of an edge by their bits, so that vertices that are stored twice are one.
fn edge_key(a: Vec3, b: Vec3) -> [[u32; 3]; 2] {
    // Adding 0 turns -0 into 0.
    let key = |v: Vec3| v.to_array().map(|x| (x + 0.0).to_bits());
    let (a, b) = (key(a), key(b));
    [a.min(b), a.max(b)]
}

impl<'a> Aim<'a> {
    pub fn new(mesh: &'a Mesh, bvh: &'a Bvh8) -> Self {
        let mut edges = HashMap::<_, Faces>::new();
        for triangle in 0..mesh.indices.len() {
            let [a, b, c] = corners(mesh, triangle);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let faces = edges.entry(edge_key(from, to)).or_default();
                if let Some(place) = faces.triangles.get_mut(faces.count as usize) {
                    *place = triangle as u32;
                }
                faces.count += 1;
            }
        }
        let (min, max) = mesh.bounds();
        Self {
            mesh,
            bvh,
            bounds: Aabb::new(min.into(), max.into()),
            edges,
            rng: Rng::with_seed(1),
        }
    }

    /// A point in the scene's bounds, half as large again.
    fn point(&mut self) -> Vec3 {
        let part = Vec3::from([(); 3].map(|()| self.rng.f32() * 1.5 - 0.25));
        self.bounds.min + self.bounds.size() * part
    }

    /// Anything that is seen from `origin`, as the hit of a ray.
    fn seen_from(&mut self, origin: Vec3) -> Option<(Ray, Hit)> {
        let ray = Ray::new(origin, (self.point() - origin).try_normalize()?);
        Some((ray, self.bvh.closest_hit(&ray)?))
    }

    /// A point of an edge of a triangle, and the edge.
    fn on_edge(&mut self, triangle: u32) -> (Vec3, [Vec3; 2]) {
        let corners = corners(self.mesh, triangle as usize);
        let first = self.rng.usize(..3);
        let (a, b) = (corners[first], corners[(first + 1) % 3]);
        (a + self.rng.f32() * (b - a), [a, b])
    }

    pub fn at_vertex(&mut self) -> Option<Ray> {
        let origin = self.point();
        let (_, hit) = self.seen_from(origin)?;
        let corner = self.rng.usize(..3);
        let target = corners(self.mesh, hit.primitive as usize)[corner];
        towards(origin, target)
    }

    pub fn at_edge(&mut self) -> Option<Ray> {
        let origin = self.point();
        let (_, hit) = self.seen_from(origin)?;
        let (target, _) = self.on_edge(hit.primitive);
        towards(origin, target)
    }

    pub fn at_silhouette(&mut self) -> Option<Ray> {
        // Few triangles are at an outline: several are tried from one point.
        const TRIES: usize = 64;
        let origin = self.point();
        for _ in 0..TRIES {
            let triangle = self.rng.u32(..self.mesh.indices.len() as u32);
            let (target, edge) = self.on_edge(triangle);
            let Some(ray) = towards(origin, target) else {
                continue;
            };
            let seen = !self.bvh.any_hit(&ray.with_range(0.0, 0.9999));
            if seen && self.is_silhouette(origin, edge) {
                return Some(ray);
            }
        }
        None
    }

    /// Whether the triangles at an edge, seen from `origin`, are all on one side of it.
    fn is_silhouette(&self, origin: Vec3, [a, b]: [Vec3; 2]) -> bool {
        let Some(faces) = self.edges.get(&edge_key(a, b)) else {
            return false;
        };
        if faces.count != 2 {
            return faces.count == 1;
        }
        let (a, b, origin) = (a.as_dvec3(), b.as_dvec3(), origin.as_dvec3());
        let across = (a - origin).cross(b - origin);
        let [first, second] = faces.triangles.map(|triangle| {
            let corners = corners(self.mesh, triangle as usize).map(|corner| corner.as_dvec3());
            // The two corners on the edge add nothing.
            let sum: f64 = corners.iter().map(|&corner| (corner - a).dot(across)).sum();
            sum > 0.0
        });
        first == second
    }

    pub fn off_surface(&mut self) -> Option<Ray> {
        let from = self.point();
        let (ray, hit) = self.seen_from(from)?;
        let origin = ray.at(hit.t);
        // Back to the side that it was seen from.
        let near = ray.at(hit.t * 0.999);
        let (_, hit) = self.seen_from(near)?;
        let corner = self.rng.usize(..3);
        let target = if self.rng.bool() {
            corners(self.mesh, hit.primitive as usize)[corner]
        } else {
            self.on_edge(hit.primitive).0
        };
        let ray = towards(origin, target)?;
        let t_min = 1e-4 * self.bounds.size().length() / ray.direction.length();
        Some(ray.with_range(t_min, f32::INFINITY))
    }
}

/// The ray from `origin` that is at `target` for `t` of 1, or nearly.
fn towards(origin: Vec3, target: Vec3) -> Option<Ray> {
    let ray = Ray::new(origin, target - origin);
    (ray.direction != Vec3::ZERO).then_some(ray)
}
