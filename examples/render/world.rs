//! The mesh with its hierarchy: what rays meet, seen as points and normals.

use glam::Vec3;
use wide_bvh::{
    geometry::{Hit, Ray, TriangleMesh},
    layout::{Bvh, Storage, TriangleLeaves, WideNode},
    traverse::Counts,
};
use wide_bvh_scenes::bounds;

/// A hierarchy over triangles, of whatever nodes and leaves.
pub trait Hierarchy: Sync {
    /// The nearest triangle.
    fn closest_hit(&self, ray: &Ray) -> Option<Hit>;
    /// Whether there is one.
    fn any_hit(&self, ray: &Ray) -> bool;
    /// What it takes to find the nearest.
    fn cost(&self, ray: &Ray) -> Counts;
}

impl<N: WideNode, L: TriangleLeaves, S: Storage> Hierarchy for Bvh<N, L, S>
where
    Self: Sync,
{
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_hit(ray)
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.any_hit(ray)
    }

    fn cost(&self, ray: &Ray) -> Counts {
        self.closest_hit_counted(ray).1
    }
}

/// All there is to trace.
pub struct World<'m> {
    mesh: TriangleMesh<'m>,
    bvh: Box<dyn Hierarchy + 'm>,
    bounds: [Vec3; 2],
    /// The diagonal of the bounds: what "near" and "far" are measured by.
    pub size: f32,
    /// How far off a surface a ray starts: more than the rounding of a point on it.
    offset: f32,
}

/// A point that was hit.
pub struct Surface {
    /// A little off the surface, on the side that the ray came from.
    pub point: Vec3,
    /// The triangle's own normal, on that side.
    pub normal: Vec3,
    /// How far the ray went, in multiples of its direction.
    pub distance: f32,
}

impl<'m> World<'m> {
    /// Joins a mesh and the hierarchy over its triangles.
    pub fn new(mesh: TriangleMesh<'m>, bvh: Box<dyn Hierarchy + 'm>) -> Self {
        let (min, max) = bounds(mesh.positions(), mesh.indices());
        let (min, max) = (Vec3::from(min), Vec3::from(max));
        // Interpolated points are off by some 2^-23 of the largest coordinate; this is 80 times that.
        let largest = min.abs().max(max.abs()).max_element();
        Self {
            mesh,
            bvh,
            bounds: [min, max],
            size: (max - min).length(),
            offset: 1e-5 * largest,
        }
    }

    /// How much of `distance` along a ray is within the bounds, if the ray begins outside them.
    pub fn depth(&self, ray: &Ray, distance: f32) -> f32 {
        let [min, max] = self.bounds;
        let outside = ray.origin.distance(ray.origin.clamp(min, max));
        (distance - outside).max(0.0)
    }

    fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let corners = self.mesh.indices()[hit.primitive as usize];
        let [a, b, c] = corners.map(|index| Vec3::from(self.mesh.positions()[index as usize]));
        let across = (b - a).cross(c - a).normalize_or(-ray.direction);
        let normal = across * -across.dot(ray.direction).signum();
        // Exact to the rounding of the corners, where origin + t * direction loses more with distance.
        let point = (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
        Surface {
            point: point + self.offset * normal,
            normal,
            distance: hit.t,
        }
    }
}

/// Traces and counts rays. Each thread has its own.
pub struct Tracer<'w> {
    /// What it traces in.
    pub world: &'w World<'w>,
    /// How many rays it traced.
    pub rays: u64,
}

impl Tracer<'_> {
    /// The nearest surface along `ray`.
    pub fn closest(&mut self, ray: &Ray) -> Option<Surface> {
        self.rays += 1;
        let hit = self.world.bvh.closest_hit(ray)?;
        Some(self.world.surface(ray, &hit))
    }

    /// Whether anything is in the way.
    pub fn blocked(&mut self, ray: &Ray) -> bool {
        self.rays += 1;
        self.world.bvh.any_hit(ray)
    }

    /// The work that it takes to find the nearest surface.
    pub fn cost(&mut self, ray: &Ray) -> Counts {
        self.rays += 1;
        self.world.bvh.cost(ray)
    }
}
