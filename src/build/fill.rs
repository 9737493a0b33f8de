//! A leaf of triangles while it is filled: which vertices it has so far.

use crate::{
    geometry::{Aabb, TriangleMesh},
    layout::TriangleLeaf,
};
use glam::Vec3;
use wide::{f32x4, f32x8, u32x8};

const MOST: usize = TriangleLeaf::MAX_VERTICES;

/// A triangle's vertices, by number and place.
#[derive(Clone, Copy)]
pub(super) struct Corners {
    numbers: [u32; 3],
    positions: [[f32; 3]; 3],
}

impl Corners {
    pub const NONE: Self = Self {
        numbers: [0; 3],
        positions: [[0.0; 3]; 3],
    };

    #[inline(always)]
    pub fn new(mesh: &TriangleMesh, id: u32) -> Self {
        let numbers = mesh.indices()[id as usize];
        let [a, b, c] = numbers;
        let at = |number: u32| mesh.positions()[number as usize];
        Self {
            numbers,
            positions: [at(a), at(b), at(c)],
        }
    }
}

/// The distinct vertices of a few triangles. As in the leaf, lanes past the last vertex, and corners past the last
/// triangle, repeat the first.
///
/// They are kept as vectors, and changed as such: to write one lane and read all would stall.
#[derive(Clone, Copy)]
pub(super) struct Filling {
    /// By number: most that are shared are seen by it. Past the last vertex they are of no meaning.
    numbers: u32x8,
    positions: [f32x8; 3],
    vertices: usize,
    corners: [[u8; TriangleLeaf::MAX_TRIANGLES]; 3],
    triangles: usize,
}

/// All bits of one lane.
const ONE_LANE: [u32x8; MOST] = {
    let mut masks = [u32x8::ZERO; MOST];
    let mut lane = 0;
    while lane < MOST {
        let mut mask = [0; MOST];
        mask[lane] = u32::MAX;
        masks[lane] = u32x8::new(mask);
        lane += 1;
    }
    masks
};

impl Filling {
    pub const EMPTY: Self = Self {
        numbers: u32x8::ZERO,
        positions: [f32x8::ZERO; 3],
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
    pub fn add(&mut self, corners: &Corners) -> bool {
        if self.triangles == TriangleLeaf::MAX_TRIANGLES {
            return false;
        }
        let before = self.vertices;
        let mut lanes = [0; 3];
        for (corner, lane) in lanes.iter_mut().enumerate() {
            let number = corners.numbers[corner];
            let known = self.lane(number);
            match known.or_else(|| self.lane_or_new(number, corners.positions[corner])) {
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
    pub fn add_none(&mut self, corners: &Corners) {
        if self.triangles == TriangleLeaf::MAX_TRIANGLES {
            return;
        }
        if self.vertices == 0 {
            self.lane_or_new(corners.numbers[0], corners.positions[0]);
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
        let same = self.numbers.simd_eq(u32x8::splat(number));
        let same = same.to_bitmask() & self.used();
        (same != 0).then_some(same.trailing_zeros() as usize)
    }

    /// Where a vertex is by its place, or is now, if there is room.
    #[inline(always)]
    fn lane_or_new(&mut self, number: u32, position: [f32; 3]) -> Option<usize> {
        let [x, y, z] = position.map(f32x8::splat);
        let [xs, ys, zs] = &mut self.positions;
        let same = xs.simd_eq(x) & ys.simd_eq(y) & zs.simd_eq(z);
        let same = same.to_bitmask() & ((1 << self.vertices) - 1);
        if same != 0 {
            return Some(same.trailing_zeros() as usize);
        }
        let lane = self.vertices;
        let &mask = ONE_LANE.get(lane)?;
        self.numbers = mask.bitselect(u32x8::splat(number), self.numbers);
        // The first is repeated in all lanes.
        let mask = if lane == 0 {
            u32x8::splat(u32::MAX)
        } else {
            mask
        };
        let mask: f32x8 = bytemuck::cast(mask);
        *xs = mask.bitselect(x, *xs);
        *ys = mask.bitselect(y, *ys);
        *zs = mask.bitselect(z, *zs);
        self.vertices += 1;
        Some(lane)
    }

    /// Forgets the vertices from one on.
    fn forget(&mut self, vertices: usize) {
        self.vertices = vertices;
        for lanes in &mut self.positions {
            let mut array = lanes.to_array();
            let first = array[0];
            array[vertices..].fill(first);
            *lanes = f32x8::new(array);
        }
    }

    /// The box around all, of which there are some.
    #[inline(always)]
    pub fn aabb(&self) -> Aabb {
        let [xs, ys, zs] = &self.positions;
        let [x, y, z] = [range(*xs), range(*ys), range(*zs)];
        Aabb::new(Vec3::new(x[0], y[0], z[0]), Vec3::new(x[1], y[1], z[1]))
    }

    /// The leaf, unless it is empty. Its primitive numbers begin at `first`.
    #[inline(always)]
    pub fn leaf(&self, first: u32) -> Option<TriangleLeaf> {
        (self.triangles > 0).then(|| {
            let [xs, ys, zs] = self.positions;
            let vertices = [xs.to_array(), ys.to_array(), zs.to_array()];
            TriangleLeaf::from_lanes(vertices, self.corners, first, self.triangles)
        })
    }
}

/// The least and the greatest of a few numbers, none of which is NaN. The sum turns -0.0 into 0.0, so that the order
/// of joins never shows.
#[inline(always)]
fn range(lanes: f32x8) -> [f32; 2] {
    let [a, b, c, d, e, f, g, h] = lanes.to_array();
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
