//! Rays that have something to do with a mesh.

use fastrand::Rng;
use glam::Vec3;
use wide_bvh::geometry::Ray;
use wide_bvh_scenes::Mesh;

/// What a ray is aimed at, or how.
#[derive(Clone, Copy, Debug)]
pub enum Aim {
    /// From anywhere to anywhere.
    Anywhere,
    /// At a corner of a triangle.
    Vertex,
    /// At a point of an edge.
    Edge,
    /// At the inside of a triangle.
    Face,
    /// From a corner, an edge or the inside, anywhere or to another triangle.
    FromSurface,
    /// Along an axis, through a point of a triangle.
    AlongAxis,
    /// In the plane of two axes, through a point of a triangle.
    InAxesPlane,
    /// In a triangle's plane, as far as floats go.
    InPlane,
    /// At a triangle, at an angle of 1e-7 to 1 to its plane.
    Grazing,
    /// At or along corners, edges and faces of the box of a triangle or of the mesh, along its diagonals too.
    Box,
}

/// Every aim as often.
pub const ALL: &[Aim] = &[
    Aim::Anywhere,
    Aim::Vertex,
    Aim::Edge,
    Aim::Face,
    Aim::FromSurface,
    Aim::AlongAxis,
    Aim::InAxesPlane,
    Aim::InPlane,
    Aim::Grazing,
    Aim::Box,
];

/// Where rays start: this far from the mesh, in its extents, as a power of ten.
#[derive(Clone, Copy)]
pub struct Reach(pub f32, pub f32);

impl Reach {
    /// From next to a triangle to well outside.
    pub const NEAR: Self = Self(-3.0, 1.5);
}

/// `count` rays at a mesh, each with one of the `aims`.
pub fn rays(rng: &mut Rng, mesh: &Mesh, aims: &[Aim], reach: Reach, count: usize) -> Vec<Ray> {
    let (min, max) = mesh.bounds();
    let (min, max) = (Vec3::from(min), Vec3::from(max));
    let mut aimer = Aimer {
        rng,
        mesh,
        min,
        max,
        reach,
    };
    (0..count)
        .map(|i| aimer.ray(aims[i % aims.len()]))
        .collect()
}

struct Aimer<'a> {
    rng: &'a mut Rng,
    mesh: &'a Mesh,
    min: Vec3,
    max: Vec3,
    reach: Reach,
}

impl Aimer<'_> {
    fn ray(&mut self, aim: Aim) -> Ray {
        let triangle = self.triangle();
        match aim {
            Aim::Anywhere => {
                let target = self.within();
                self.at(target)
            }
            Aim::Vertex => self.at(triangle[0]),
            Aim::Edge => {
                let target = self.on_edge(triangle);
                self.at(target)
            }
            Aim::Face => {
                let target = inside(self.rng, triangle);
                self.at(target)
            }
            Aim::FromSurface => {
                let origin = self.somewhere_on(triangle);
                let direction = if self.rng.bool() {
                    unit(self.rng)
                } else {
                    let other = self.triangle();
                    self.somewhere_on(other) - origin
                };
                Ray::new(origin, direction)
            }
            Aim::AlongAxis => {
                let mut origin = self.somewhere_on(triangle);
                let axis = self.rng.usize(..3);
                let mut direction = Vec3::splat(if self.rng.bool() { 0.0 } else { -0.0 });
                direction[axis] = sign(self.rng) * self.length();
                origin[axis] -= self.distance() * direction[axis].signum();
                Ray::new(origin, direction)
            }
            Aim::InAxesPlane => {
                let target = self.somewhere_on(triangle);
                let mut ray = self.at(target);
                let axis = self.rng.usize(..3);
                ray.origin[axis] = target[axis];
                ray.direction[axis] = if self.rng.bool() { 0.0 } else { -0.0 };
                ray
            }
            Aim::InPlane => {
                let (from, to) = (self.somewhere_on(triangle), self.somewhere_on(triangle));
                let back = 4.0 * self.rng.f32() - 2.0;
                Ray::new(from + back * (from - to), to - from)
            }
            Aim::Grazing => {
                let target = self.somewhere_on(triangle);
                let [a, b, c] = triangle;
                let normal = (b - a).cross(c - a).normalize_or_zero();
                let along = (b - a) + (c - b) * self.rng.f32();
                let angle = log_uniform(self.rng, -7.0, 0.0) * sign(self.rng);
                let direction = along.normalize_or_zero() + angle * normal;
                Ray::new(target - direction * self.distance(), direction)
            }
            Aim::Box => self.at_box(triangle),
        }
    }

    /// From somewhere at `target`; one in four exactly so, for all differences are whole steps of a coarse grid.
    fn at(&mut self, target: Vec3) -> Ray {
        let offset = unit(self.rng) * self.distance();
        if self.rng.u32(..4) > 0 {
            let origin = target - offset;
            return Ray::new(origin, (target - origin) * self.length());
        }
        // Powers of two, no smaller than a step of the target's.
        let step = target.abs().max_element() * f32::EPSILON * 2.0;
        let power =
            |x: f32| x.signum() * 2f32.powi(x.abs().max(step).max(1e-30).log2().floor() as i32);
        let direction = Vec3::from(offset.to_array().map(power));
        Ray::new(target - direction, direction)
    }

    fn at_box(&mut self, triangle: [Vec3; 3]) -> Ray {
        let (min, max) = if self.rng.bool() {
            let [a, b, c] = triangle;
            (a.min(b).min(c), a.max(b).max(c))
        } else {
            (self.min, self.max)
        };
        let rng = &mut *self.rng;
        let mut pick = || [min, max, min.lerp(max, rng.f32())][rng.usize(..3)];
        let corner = Vec3::new(pick().x, pick().y, pick().z);
        match self.rng.u32(..3) {
            0 => self.at(corner),
            1 => {
                // Along a diagonal of a cube.
                let direction = Vec3::from([(); 3].map(|()| sign(self.rng)));
                Ray::new(corner - direction * self.distance(), direction)
            }
            _ => {
                let axis = self.rng.usize(..3);
                let direction = Vec3::AXES[axis] * sign(self.rng);
                Ray::new(corner - direction * self.distance(), direction)
            }
        }
    }

    fn triangle(&mut self) -> [Vec3; 3] {
        if self.mesh.indices.is_empty() {
            return [Vec3::ZERO; 3];
        }
        let corners = self.mesh.indices[self.rng.usize(..self.mesh.indices.len())];
        let mut corners = corners.map(|index| Vec3::from(self.mesh.positions[index as usize]));
        corners.rotate_left(self.rng.usize(..3));
        corners
    }

    /// On a corner, an edge or inside.
    fn somewhere_on(&mut self, triangle: [Vec3; 3]) -> Vec3 {
        match self.rng.u32(..3) {
            0 => triangle[0],
            1 => self.on_edge(triangle),
            _ => inside(self.rng, triangle),
        }
    }

    fn on_edge(&mut self, [a, b, _]: [Vec3; 3]) -> Vec3 {
        let along = [0.5, 0.25, self.rng.f32()][self.rng.usize(..3)];
        a.lerp(b, along)
    }

    fn within(&mut self) -> Vec3 {
        let [x, y, z] = [(); 3].map(|()| self.rng.f32());
        self.min + (self.max - self.min) * Vec3::new(x, y, z)
    }

    fn distance(&mut self) -> f32 {
        let extent = (self.max - self.min).max_element();
        extent * log_uniform(self.rng, self.reach.0, self.reach.1)
    }

    /// Of a direction: one, mostly.
    fn length(&mut self) -> f32 {
        if self.rng.u32(..4) > 0 {
            1.0
        } else {
            log_uniform(self.rng, -3.0, 3.0)
        }
    }
}

fn inside(rng: &mut Rng, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let (mut u, mut v) = (rng.f32(), rng.f32());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    a + u * (b - a) + v * (c - a)
}

/// A point of a cube of side 2 around the origin, for directions and offsets.
pub fn unit(rng: &mut Rng) -> Vec3 {
    Vec3::from([(); 3].map(|()| 2.0 * rng.f32() - 1.0))
}

/// 1 or -1.
pub fn sign(rng: &mut Rng) -> f32 {
    if rng.bool() { 1.0 } else { -1.0 }
}

/// 10 to a power from `low` to `high`.
pub fn log_uniform(rng: &mut Rng, low: f32, high: f32) -> f32 {
    10f32.powf(low + (high - low) * rng.f32())
}
