//! Triangles brought together for many rays, wherever they are kept.

use super::{TriangleLeaf, Triangles};
use core::mem::MaybeUninit;

/// Triangles of a leaf whose vertices are in a [`TriangleLeaf`].
#[doc(hidden)]
pub trait Gathered: Triangles {
    /// It.
    fn stored<'a>(self) -> &'a TriangleLeaf
    where
        Self: 'a;
}

/// A leaf whose triangles can be brought together.
#[doc(hidden)]
pub trait Gather: Triangles {
    /// Some of them, tested as they are.
    type Gathered<'a>: Gathered<Precision = Self::Precision>;

    /// The triangles from number `from` on, which there is, or as many of them as share no more vertices than there is
    /// room for: one at least. They are put into `room`, if they are not together where they are.
    fn gather(self, from: usize, room: &mut MaybeUninit<TriangleLeaf>) -> Self::Gathered<'_>;
}

/// Triangles on their way into a leaf.
pub(super) struct Gathering {
    vertices: [[f32; 8]; 3],
    corners: [[u8; 8]; 3],
    /// The numbers of the vertices, those below `distinct`.
    numbers: [u32; TriangleLeaf::MAX_VERTICES],
    distinct: usize,
    count: usize,
}

impl Gathering {
    /// None so far.
    pub(super) const NONE: Self = Self {
        vertices: [[0.0; 8]; 3],
        corners: [[0; 8]; 3],
        numbers: [0; TriangleLeaf::MAX_VERTICES],
        distinct: 0,
        count: 0,
    };

    /// Adds a triangle, by the numbers of its vertices and where those are; or says that there is no room.
    #[inline(always)]
    pub(super) fn add(&mut self, vertices: [(u32, &[f32; 3]); 3]) -> bool {
        let lane = self.count % TriangleLeaf::MAX_TRIANGLES;
        let mut distinct = self.distinct;
        for (corner, (number, position)) in vertices.into_iter().enumerate() {
            let known = self.numbers.iter().take(distinct);
            let place = known.take_while(|&&known| known != number).count();
            if place == TriangleLeaf::MAX_VERTICES {
                return false;
            }
            if place == distinct {
                self.numbers[place] = number;
                for (lanes, &x) in self.vertices.iter_mut().zip(position) {
                    lanes[place] = x;
                }
                distinct += 1;
            }
            self.corners[corner][lane] = place as u8;
        }
        self.distinct = distinct;
        self.count += 1;
        true
    }

    /// The leaf of those that were added, whose numbers begin at `first` in the hierarchy's list. Nothing is in its other
    /// lanes.
    #[inline(always)]
    pub(super) fn leaf(self, first: usize) -> TriangleLeaf {
        TriangleLeaf::from_lanes(self.vertices, self.corners, first as u32, self.count)
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use crate::{
        geometry::TriangleMesh,
        layout::{Borrowed, Leaves, MeshLeaf},
        simd::{MAX_RUN, packed_run},
    };
    use fastrand::Rng;
    use std::vec::Vec;

    /// Four triangles share all vertices, or none, or anything between.
    #[test]
    fn all_triangles_are_gathered_as_they_are() {
        let mut rng = Rng::with_seed(6);
        let positions: Vec<_> = (0..12).map(|_| [(); 3].map(|()| rng.f32())).collect();
        let mut in_parts = 0;
        for _ in 0..10_000 {
            let vertices = rng.u32(1..=12);
            let indices: Vec<_> = (0..MAX_RUN)
                .map(|_| [(); 3].map(|()| rng.u32(..vertices)))
                .collect();
            let mesh = TriangleMesh::new(&positions, &indices).unwrap();
            let mut numbers: Vec<_> = (0..MAX_RUN as u32).collect();
            rng.shuffle(&mut numbers);
            let place = packed_run(0, rng.u32(1..=MAX_RUN as u32)) as usize;
            // SAFETY: the run is within the list, whose numbers are the mesh's.
            let leaf = unsafe { MeshLeaf::at::<Borrowed>(&mesh, &numbers, place) };
            let (mut from, mut room) = (0, MaybeUninit::uninit());
            while from < leaf.count() {
                let part = leaf.gather(from, &mut room);
                assert!(part.count() > 0);
                assert_eq!(part.first(), leaf.first() + from);
                for lane in 0..part.count() {
                    assert_eq!(part.triangle(lane), leaf.triangle(from + lane));
                }
                from += part.count();
                in_parts += usize::from(from < leaf.count());
            }
            assert_eq!(from, leaf.count());
        }
        assert!(
            in_parts > 0,
            "no leaf had more vertices than there is room for"
        );
    }
}
