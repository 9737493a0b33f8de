//! The rays that are raced over: as a renderer would make them, seeded, the same for every engine.

use fastrand::Rng;
use glam::{DVec3, Vec3};
use wide_bvh::{
    geometry::{Aabb, Hit, Ray},
    layout::Bvh8,
};
use wide_bvh_scenes::{Camera, Mesh, cameras_for};

/// Rays of one kind.
pub struct Workload {
    /// In tables and JSON.
    pub name: &'static str,
    /// What is asked of them.
    pub query: Query,
    /// In the order in which they are traced.
    pub rays: Vec<Ray>,
}

/// What is asked of a ray.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Query {
    /// The first hit.
    Closest,
    /// Whether anything is in the way.
    Any,
}

/// The names of the workloads, in the order in which [`workloads`] makes them.
pub const NAMES: [&str; 4] = ["primary", "bounce", "random", "shadow"];

/// Pixels of a tile's side: a camera's rays come tile by tile.
const TILE: u32 = 8;

/// How far a ray starts off the surface that it leaves, relative to the diagonal of the scene's
/// bounds: some hundred times the rounding of a position, so that no engine meets the surface again.
const OFFSET: f32 = 1e-5;

/// The four workloads over `mesh`, of about `size` rays each; bounce and shadow rays leave the primary
/// hits, so they are fewer where a camera sees past the mesh. `bvh` is of the same mesh.
pub fn workloads(mesh: &Mesh, bvh: &Bvh8, size: usize) -> [Workload; 4] {
    let mut rng = Rng::with_seed(1);
    let (min, max) = mesh.bounds();
    let bounds = Aabb::new(min.into(), max.into());
    let surface = Surface {
        mesh,
        offset: OFFSET * bounds.size().length(),
    };
    let mut primary = Vec::with_capacity(size);
    let mut bounce = Vec::with_capacity(size);
    let mut shadow = Vec::with_capacity(size);
    let cameras = cameras_for(mesh);
    for camera in &cameras {
        let light = light_for(camera, bounds);
        for ray in camera_rays(camera, size / cameras.len()) {
            primary.push(ray);
            if let Some(hit) = bvh.closest_hit(&ray) {
                let (point, normal) = surface.leave(&ray, &hit);
                bounce.push(Ray::new(point, cosine_weighted(normal, &mut rng)));
                shadow.push(Ray::segment(point, light));
            }
        }
    }
    let random = (0..size)
        .map(|_| {
            let [from, to] = [(); 2].map(|()| point_within(bounds, &mut rng));
            Ray::new(from, (to - from).normalize_or(Vec3::X))
        })
        .collect();
    let [p, b, r, s] = NAMES;
    [
        (p, Query::Closest, primary),
        (b, Query::Closest, bounce),
        (r, Query::Closest, random),
        (s, Query::Any, shadow),
    ]
    .map(|(name, query, rays)| Workload { name, query, rays })
}

/// About `count` rays through the pixels of a square picture, tile by tile.
fn camera_rays(camera: &Camera, count: usize) -> impl Iterator<Item = Ray> + '_ {
    let tiles = ((count as f64).sqrt() as u32 / TILE).max(1);
    let side = tiles * TILE;
    let grid = |n| (0..n).flat_map(move |y| (0..n).map(move |x| (x, y)));
    grid(tiles)
        .flat_map(move |(tile_x, tile_y)| {
            grid(TILE).map(move |(x, y)| (tile_x * TILE + x, tile_y * TILE + y))
        })
        .map(move |(x, y)| {
            let (origin, direction) = camera.ray(x, y, side, side);
            Ray::new(origin, direction)
        })
}

/// Where the light is: for a camera outside the scene, above and beside it; for one inside, in the
/// middle, three quarters up.
fn light_for(camera: &Camera, bounds: Aabb) -> Vec3 {
    let eye = Vec3::from(camera.eye());
    let inside = (bounds.min.cmple(eye) & eye.cmple(bounds.max)).all();
    if inside {
        bounds.min + bounds.size() * Vec3::new(0.5, 0.75, 0.5)
    } else {
        bounds.center() + bounds.size().length() * Vec3::new(0.5, 1.0, 0.25)
    }
}

/// What rays leave from.
struct Surface<'a> {
    mesh: &'a Mesh,
    offset: f32,
}

impl Surface<'_> {
    /// The point of `hit`, moved off the surface on the side that `ray` comes from, and that side's
    /// unit normal.
    fn leave(&self, ray: &Ray, hit: &Hit) -> (Vec3, Vec3) {
        let corners = self.mesh.indices[hit.primitive as usize]
            .map(|i| Vec3::from(self.mesh.positions[i as usize]).as_dvec3());
        let [a, b, c] = corners;
        let direction = ray.direction.as_dvec3();
        let normal = (b - a).cross(c - a).normalize_or(-direction);
        let normal = if normal.dot(direction) > 0.0 {
            -normal
        } else {
            normal
        };
        let point = a + (b - a) * f64::from(hit.u) + (c - a) * f64::from(hit.v);
        let off = point + normal * f64::from(self.offset);
        (off.as_vec3(), normal.as_vec3())
    }
}

/// A unit direction about `normal`, more likely the steeper: a point of the unit sphere around its tip.
fn cosine_weighted(normal: Vec3, rng: &mut Rng) -> Vec3 {
    let z = rng.f64() * 2.0 - 1.0;
    let (sin, cos) = (rng.f64() * std::f64::consts::TAU).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    let around = DVec3::new(radius * cos, radius * sin, z);
    (normal.as_dvec3() + around).as_vec3().normalize_or(normal)
}

fn point_within(bounds: Aabb, rng: &mut Rng) -> Vec3 {
    let part = Vec3::new(rng.f32(), rng.f32(), rng.f32());
    bounds.min + bounds.size() * part
}

#[cfg(test)]
mod tests {
    use super::*;
    use wide_bvh::{build::Builder, geometry::TriangleMesh};
    use wide_bvh_scenes::shapes::cuboid;

    fn of_cuboid(size: usize) -> [Workload; 4] {
        let mesh = cuboid([-1.0; 3], [1.0, 2.0, 3.0]);
        let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        workloads(&mesh, &Builder::new().build(&view).unwrap(), size)
    }

    #[test]
    fn the_same_rays_come_each_time() {
        for (first, second) in of_cuboid(1000).iter().zip(&of_cuboid(1000)) {
            assert_eq!(first.rays, second.rays);
            assert!(!first.rays.is_empty(), "no {} rays", first.name);
        }
    }

    #[test]
    fn rays_leave_the_outside_of_a_box_outwards() {
        let [primary, bounce, random, shadow] = of_cuboid(4096);
        assert_eq!((primary.rays.len(), random.rays.len()), (4096, 4096));
        assert_eq!(bounce.rays.len(), shadow.rays.len());
        assert!(bounce.rays.len() < primary.rays.len());
        let inside = |p: Vec3| (p.cmpge(Vec3::NEG_ONE) & p.cmple(Vec3::new(1.0, 2.0, 3.0))).all();
        for (bounce, shadow) in bounce.rays.iter().zip(&shadow.rays) {
            assert_eq!(bounce.origin, shadow.origin);
            assert!(!inside(bounce.origin) && !inside(bounce.at(0.01)));
            assert!((bounce.direction.length() - 1.0).abs() < 1e-5);
            assert_eq!((shadow.t_min, shadow.t_max), (0.0, 1.0));
        }
    }
}
