//! A leaf of triangles while it is filled: which vertices it has so far.

use crate::{
    geometry::TriangleMesh,
    layout::TriangleLeaf,
    simd::{Lanes, Simd, Vector, splat3},
};

const MOST: u32 = TriangleLeaf::MAX_VERTICES as u32;

/// Where a triangle's vertices are. The fourth of each is 0.
#[derive(Clone, Copy)]
pub(super) struct Corners(pub [[f32; 4]; 3]);

impl Corners {
    pub const NONE: Self = Self([[0.0; 4]; 3]);

    #[inline(always)]
    pub fn new(mesh: &TriangleMesh, [a, b, c]: [u32; 3]) -> Self {
        let positions = mesh.positions();
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = [
            positions[a as usize],
            positions[b as usize],
            positions[c as usize],
        ];
        Self([[ax, ay, az, 0.0], [bx, by, bz, 0.0], [cx, cy, cz, 0.0]])
    }
}

/// The distinct vertices of a few triangles, one at least. As in the leaf, lanes past the last vertex repeat the first,
/// and so do corners past the last triangle.
///
/// They are kept as vectors, and changed as such: to write one lane and read all would stall. Nor is there a branch on
/// whether a vertex is known, which nobody foresees.
#[derive(Clone, Copy)]
pub(super) struct Filling<S: Simd> {
    positions: [S::F32x8; 3],
    vertices: u32,
    /// A byte a triangle, the first the lowest.
    corners: [u64; 3],
    triangles: usize,
}

impl<S: Simd> Filling<S> {
    /// Of one triangle, whose corners are three vertices.
    #[inline(always)]
    pub fn of(token: S, corners: &Corners) -> Self {
        let mut filling = Self::of_none(token, corners);
        filling.put(token, &corners.0[1], 1 << 1);
        filling.put(token, &corners.0[2], 1 << 2);
        filling.corners = [0, 1, 2];
        filling.vertices = 3;
        filling
    }

    /// Of one triangle that is never hit: all its corners are one vertex.
    #[inline(always)]
    pub fn of_none(token: S, corners: &Corners) -> Self {
        let [x, y, z, _] = corners.0[0];
        Self {
            positions: splat3(token, [x, y, z]),
            vertices: 1,
            corners: [0; 3],
            triangles: 1,
        }
    }

    /// Adds a triangle, whose corners are three vertices, if there is room for it.
    #[inline(always)]
    pub fn add(&mut self, token: S, corners: &Corners) -> bool {
        let [a, b, c] = &corners.0;
        let known = [
            self.same(token, a),
            self.same(token, b),
            self.same(token, c),
        ];
        let is_new = [known[0] == 0, known[1] == 0, known[2] == 0];
        let at_b = self.vertices + u32::from(is_new[0]);
        let at_c = at_b + u32::from(is_new[1]);
        let vertices = at_c + u32::from(is_new[2]);
        if vertices > MOST || self.triangles == TriangleLeaf::MAX_TRIANGLES {
            return false;
        }
        let new = [
            u32::from(is_new[0]) << self.vertices,
            u32::from(is_new[1]) << at_b,
            u32::from(is_new[2]) << at_c,
        ];
        self.put(token, a, new[0]);
        self.put(token, b, new[1]);
        self.put(token, c, new[2]);
        let shift = 8 * self.triangles as u32;
        for (corner, corners) in self.corners.iter_mut().enumerate() {
            let lane = (known[corner] | new[corner]).trailing_zeros();
            *corners |= u64::from(lane) << shift;
        }
        self.vertices = vertices;
        self.triangles += 1;
        true
    }

    /// Adds a triangle that is never hit, if there is room for another: all its corners are the first vertex.
    pub fn add_none(&mut self) {
        self.triangles = (self.triangles + 1).min(TriangleLeaf::MAX_TRIANGLES);
    }

    /// The lanes that a vertex is in: one, or none. Those past the last repeat the first, whose lane is the lowest.
    #[inline(always)]
    fn same(&self, token: S, &[x, y, z, _]: &[f32; 4]) -> u32 {
        let [xs, ys, zs] = self.positions;
        let [x, y, z] = splat3(token, [x, y, z]);
        (xs.eq(x) & ys.eq(y) & zs.eq(z)).bits()
    }

    /// Puts a vertex in the lanes that there is a bit for.
    #[inline(always)]
    fn put(&mut self, token: S, &[x, y, z, _]: &[f32; 4], lanes: u32) {
        let mask = S::F32x8::of_bits(token, lanes);
        let [x, y, z] = splat3(token, [x, y, z]);
        let [xs, ys, zs] = self.positions;
        self.positions = [mask.select(x, xs), mask.select(y, ys), mask.select(z, zs)];
    }

    /// The leaf. Its primitive numbers begin at `first`.
    #[inline(always)]
    pub fn leaf(&self, first: u32) -> TriangleLeaf {
        let [xs, ys, zs] = self.positions;
        let vertices = [xs.to_array(), ys.to_array(), zs.to_array()];
        let [a, b, c] = self.corners;
        let corners = [a.to_le_bytes(), b.to_le_bytes(), c.to_le_bytes()];
        TriangleLeaf::from_lanes(vertices, corners, first, self.triangles)
    }
}
