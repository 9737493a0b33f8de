//! A leaf of triangles while it is filled: which vertices it has so far.

use crate::{
    geometry::{Aabb, TriangleMesh},
    layout::TriangleLeaf,
};
use glam::Vec3;
use wide::{f32x4, f32x8, u32x8};

const MOST: usize = TriangleLeaf::MAX_VERTICES;

/// The distinct vertices of a few triangles. As in the leaf, lanes past the last vertex, and corners past the last
/// triangle, repeat the first.
#[derive(Clone, Copy)]
pub(super) struct Filling {
    /// By number: most that are shared are seen by it. Past the last vertex they are of no meaning.
    numbers: [u32; MOST],
    positions: [[f32; MOST]; 3],
    vertices: usize,
    corners: [[u8; TriangleLeaf::MAX_TRIANGLES]; 3],
    triangles: usize,
}

impl Filling {
    pub const EMPTY: Self = Self {
        numbers: [0; _],
        positions: [[0.0; _]; 3],
        vertices: 0,
        corners: [[0; _]; 3],
        triangles: 0,
    };

    /// Forgets all.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.vertices = 0;
        self.triangles = 0;
        self.corners = [[0; _]; 3];
    }

    /// Adds a triangle, if there is room for it.
    #[inline(always)]
    pub fn add(&mut self, mesh: &TriangleMesh, id: u32) -> bool {
        if self.triangles == TriangleLeaf::MAX_TRIANGLES {
            return false;
        }
        let before = self.vertices;
        let mut lanes = [0; 3];
        for (lane, number) in lanes.iter_mut().zip(mesh.indices()[id as usize]) {
            let known = self.lane(number);
            match known.or_else(|| self.lane_or_new(number, mesh.positions()[number as usize])) {
                Some(known) => *lane = known as u8,
                None => {
                    self.forget(before);
                    return false;
                }
            }
        }
        for (corners, lane) in self.corners.iter_mut().zip(lanes) {
            corners[self.triangles] = lane;
        }
        self.triangles += 1;
        true
    }

    /// Adds a triangle that is never hit, if there is room for another: all its corners are one vertex.
    pub fn add_none(&mut self, mesh: &TriangleMesh, id: u32) {
        if self.triangles == TriangleLeaf::MAX_TRIANGLES {
            return;
        }
        if self.vertices == 0 {
            let [number, ..] = mesh.indices()[id as usize];
            self.lane_or_new(number, mesh.positions()[number as usize]);
        }
        for corners in &mut self.corners {
            corners[self.triangles] = 0;
        }
        self.triangles += 1;
    }

    /// The lanes that are in use.
    #[inline(always)]
    fn used(&self) -> u32 {
        (1 << self.vertices) - 1
    }

    /// Where a vertex is, by its number.
    #[inline(always)]
    fn lane(&self, number: u32) -> Option<usize> {
        let same = u32x8::new(self.numbers).simd_eq(u32x8::splat(number));
        let same = same.to_bitmask() & self.used();
        (same != 0).then_some(same.trailing_zeros() as usize)
    }

    /// Where a vertex is by its place, or is now, if there is room.
    #[inline(always)]
    fn lane_or_new(&mut self, number: u32, position: [f32; 3]) -> Option<usize> {
        let [x, y, z] = position;
        let [xs, ys, zs] = self.positions.map(f32x8::new);
        let same =
            xs.simd_eq(f32x8::splat(x)) & ys.simd_eq(f32x8::splat(y)) & zs.simd_eq(f32x8::splat(z));
        let same = same.to_bitmask() & self.used();
        if same != 0 {
            return Some(same.trailing_zeros() as usize);
        }
        let lane = self.vertices;
        if lane == MOST {
            return None;
        }
        if lane == 0 {
            self.positions = [[x; MOST], [y; MOST], [z; MOST]];
        }
        self.numbers[lane] = number;
        for (lanes, x) in self.positions.iter_mut().zip(position) {
            lanes[lane] = x;
        }
        self.vertices += 1;
        Some(lane)
    }

    /// Forgets the vertices from one on.
    fn forget(&mut self, vertices: usize) {
        self.vertices = vertices;
        for lanes in &mut self.positions {
            let first = lanes[0];
            lanes[vertices..].fill(first);
        }
    }

    /// The box around all, of which there are some.
    #[inline(always)]
    pub fn aabb(&self) -> Aabb {
        let [xs, ys, zs] = &self.positions;
        let [x, y, z] = [range(xs), range(ys), range(zs)];
        Aabb::new(Vec3::new(x[0], y[0], z[0]), Vec3::new(x[1], y[1], z[1]))
    }

    /// The leaf, unless it is empty. Its primitive numbers begin at `first`.
    #[inline(always)]
    pub fn leaf(&self, first: u32) -> Option<TriangleLeaf> {
        (self.triangles > 0)
            .then(|| TriangleLeaf::from_lanes(self.positions, self.corners, first, self.triangles))
    }
}

/// The least and the greatest of a few numbers, none of which is NaN. The sum turns -0.0 into 0.0, so that the order
/// of joins never shows.
#[inline(always)]
fn range(&[a, b, c, d, e, f, g, h]: &[f32; 8]) -> [f32; 2] {
    let (low, high) = (f32x4::new([a, b, c, d]), f32x4::new([e, f, g, h]));
    let [a, b, c, d] = low.fast_min(high).to_array();
    let [e, f, g, h] = low.fast_max(high).to_array();
    let least = |a: f32, b: f32| if b < a { b } else { a };
    let greatest = |a: f32, b: f32| if b > a { b } else { a };
    [
        least(least(a, b), least(c, d)) + 0.0,
        greatest(greatest(e, f), greatest(g, h)) + 0.0,
    ]
}
