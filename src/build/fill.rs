//! A leaf of triangles while it is filled: which vertices it has so far.

use crate::{
    geometry::TriangleMesh,
    layout::TriangleLeaf,
    simd::{Lanes, Simd, Vector, splat3},
};

const MOST: usize = TriangleLeaf::MAX_VERTICES;

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
    vertices: usize,
    /// A byte a triangle, the first the lowest.
    corners: [u64; 3],
    triangles: usize,
}

/// From `8 + 7 - lane` on, all bits of that lane; of lane 8, none.
static ONE_LANE: [f32; 2 * MOST + 7] = {
    let mut lanes = [0.0; _];
    lanes[2 * MOST - 1] = f32::from_bits(u32::MAX);
    lanes
};

impl<S: Simd> Filling<S> {
    /// Of one triangle, whose corners are three vertices.
    #[inline(always)]
    pub fn of(token: S, corners: &Corners) -> Self {
        let mut filling = Self::of_none(token, corners);
        filling.put(token, &corners.0[1], 1);
        filling.put(token, &corners.0[2], 2);
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
        let same = [
            self.same(token, a),
            self.same(token, b),
            self.same(token, c),
        ];
        let [is_new_a, is_new_b, is_new_c] = [same[0] == 0, same[1] == 0, same[2] == 0];
        let vertices = self.vertices;
        let at_b = vertices + usize::from(is_new_a);
        let at_c = at_b + usize::from(is_new_b);
        let all = at_c + usize::from(is_new_c);
        if all > MOST || self.triangles == TriangleLeaf::MAX_TRIANGLES {
            return false;
        }
        self.put(token, a, if is_new_a { vertices } else { MOST });
        self.put(token, b, if is_new_b { at_b } else { MOST });
        self.put(token, c, if is_new_c { at_c } else { MOST });
        let lane = |same: u32, new: usize| match same {
            0 => new as u64,
            _ => u64::from(same.trailing_zeros()),
        };
        let shift = 8 * self.triangles as u32;
        self.corners[0] |= lane(same[0], vertices) << shift;
        self.corners[1] |= lane(same[1], at_b) << shift;
        self.corners[2] |= lane(same[2], at_c) << shift;
        self.vertices = all;
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

    /// Puts a vertex in a lane, or in none if that is [`MOST`].
    #[inline(always)]
    fn put(&mut self, token: S, &[x, y, z, _]: &[f32; 4], lane: usize) {
        let mask = &ONE_LANE[2 * MOST - 1 - lane..];
        let mask = S::F32x8::load(token, mask.first_chunk().unwrap_or(&[0.0; MOST]));
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
