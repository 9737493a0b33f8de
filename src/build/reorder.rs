//! A mesh in the order in which rays read it.

use super::{ReorderError, pages};
use crate::{
    geometry::TriangleMesh,
    layout::{Bvh, OrderedLeaf, Owned, RunLeaf, VERTICES, WideNode, of_child},
};
use std::{vec, vec::Vec};

/// A mesh whose triangles are in the order of a compact hierarchy's leaves, and its vertices in that of their first use:
/// see [`Bvh::reorder`].
#[derive(Clone, Debug, PartialEq)]
pub struct ReorderedMesh {
    /// The vertices that triangles use.
    pub positions: Vec<[f32; 3]>,
    /// All triangles; those that are in no leaf come last.
    pub indices: Vec<[u32; 3]>,
    /// The number that each vertex had: what else is known of vertices goes by it into the new order.
    pub vertices: Vec<u32>,
    /// The number that each triangle had.
    pub triangles: Vec<u32>,
}

impl<N: WideNode> Bvh<N, RunLeaf, Owned> {
    /// The mesh that this was built on in the order in which rays read it, and the same hierarchy over that: it needs no list of
    /// numbers, less than half of the bytes.
    ///
    /// A compact hierarchy's leaves read the mesh where it is. If what is close together in space is far apart there, each
    /// triangle is in cache lines of its own, which are found by its number, and that in the list. Where the mesh is much
    /// larger than the caches rays are the faster for it, and for the large pages that the new buffers are on: twice as fast over
    /// ten million triangles that were in no good order, 5 to 13 % over those of a hundred thousand (Intel).
    ///
    /// It has to be built with [`splits(0.0)`](super::Builder::splits), for each triangle to be in one leaf and have one number.
    ///
    /// ```
    /// # use wide_bvh::{build::Builder, geometry::{Ray, TriangleMesh}, layout::CompactBvh8};
    /// # let positions = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0_f32]];
    /// # let indices = [[0, 1, 2_u32]];
    /// let mesh = TriangleMesh::new(&positions, &indices)?;
    /// let compact: CompactBvh8 = Builder::new().splits(0.0).build_compact(&mesh)?;
    /// let (ordered, reordered) = compact.reorder(&mesh)?;
    /// let mesh = TriangleMesh::new(&reordered.positions, &reordered.indices)?;
    /// let hit = ordered.over(&mesh)?.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).unwrap();
    /// assert_eq!(reordered.triangles[hit.primitive as usize], 0); // as it was called before
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The mesh has no triangle of some number that is in a leaf; the first triangle that is in a second one.
    pub fn reorder(
        &self,
        mesh: &TriangleMesh,
    ) -> Result<(Bvh<N, OrderedLeaf, Owned>, ReorderedMesh), ReorderError> {
        self.over(mesh)?;
        let mut is_listed = vec![false; mesh.len()];
        for &number in self.primitives() {
            let primitive = number as usize;
            if core::mem::replace(&mut is_listed[primitive], true) {
                return Err(ReorderError::Repeated { primitive });
            }
        }
        let mut triangles = self.primitives().to_vec();
        triangles.extend((0..mesh.len() as u32).filter(|&number| !is_listed[number as usize]));
        let corners = |&triangle: &u32| mesh.indices()[triangle as usize];
        let used = triangles.iter().flat_map(corners);
        let vertices = Order::of_first_use(mesh.positions().len(), used);
        let position = |&vertex: &u32| mesh.positions()[vertex as usize];
        let place = |vertex: u32| vertices.places[vertex as usize];
        let indices = triangles.iter().map(corners);
        let reordered = ReorderedMesh {
            positions: pages::collected(vertices.all.iter().map(position)),
            indices: pages::collected(indices.map(|corners| corners.map(place))),
            vertices: vertices.all,
            triangles,
        };
        let mut used = Vec::new();
        let told = self.nodes().iter().map(|node| {
            used.clear();
            for run in (0..N::WIDTH).filter_map(|lane| of_child(node.child(lane))) {
                used.extend(reordered.indices[run].as_flattened());
            }
            node.with_first_vertex(first_of_most(&mut used))
        });
        let nodes = pages::collected(told);
        Ok((self.in_order(nodes), reordered))
    }
}

/// Of these numbers the one from which on most of them are among the next [`VERTICES`]; 0 of none.
fn first_of_most(numbers: &mut [u32]) -> u32 {
    numbers.sort_unstable();
    let (mut most, mut first, mut end) = (0, 0, 0);
    for (start, &number) in numbers.iter().enumerate() {
        let among = |other: &u32| other - number < VERTICES as u32;
        end += numbers[end..]
            .iter()
            .take_while(|other| among(other))
            .count();
        if end - start > most {
            (most, first) = (end - start, number);
        }
    }
    first
}

/// Numbers in a new order.
struct Order {
    /// In it.
    all: Vec<u32>,
    /// Where in it each number is, if it is.
    places: Vec<u32>,
}

impl Order {
    /// Of numbers below `count`, as they are first met.
    fn of_first_use(count: usize, uses: impl Iterator<Item = u32>) -> Self {
        let mut order = Self {
            all: Vec::with_capacity(count),
            places: vec![u32::MAX; count],
        };
        for number in uses {
            let place = &mut order.places[number as usize];
            if *place == u32::MAX {
                *place = order.all.len() as u32;
                order.all.push(number);
            }
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        build::Builder,
        layout::{ChildKind, CompactNode4, CompactNode8},
    };
    use fastrand::Rng;

    #[test]
    fn most_are_among_the_next() {
        assert_eq!(first_of_most(&mut []), 0);
        assert_eq!(first_of_most(&mut [7]), 7);
        assert_eq!(first_of_most(&mut [3, 56, 41, 40, 41]), 40);
        assert_eq!(
            first_of_most(&mut [u32::MAX, 1, u32::MAX - 15]),
            u32::MAX - 15
        );
    }

    /// Nodes of leaves alone say where vertices are, and say it again when they have moved.
    fn check<N: WideNode>() {
        let mut rng = Rng::with_seed(17);
        let corner = |_| [rng.f32(), rng.f32(), rng.f32()];
        let positions: Vec<_> = (0..3000).map(corner).collect();
        let indices: Vec<_> = (0..998)
            .map(|first| [first, first + 1, first + 2])
            .collect();
        let mesh = TriangleMesh::new(&positions, &indices).unwrap();
        let built = Builder::new().splits(0.0).build_compact::<N>(&mesh);
        let (mut tree, mesh) = built.unwrap().reorder(&mesh).unwrap();
        let said = |node: &N| node.first_vertex();
        let before: Vec<_> = tree.nodes().iter().map(said).collect();
        for (node, &said) in tree.nodes().iter().zip(&before) {
            let children = (0..N::WIDTH).map(|lane| node.child(lane));
            let leaves_alone = !children
                .clone()
                .any(|child| matches!(child.kind(), ChildKind::Node(_)));
            let runs = children.filter_map(of_child);
            let mut read = runs.flat_map(|run| mesh.indices[run].as_flattened());
            assert!(if leaves_alone {
                read.any(|&vertex| vertex as usize == said)
            } else {
                said == 0
            });
        }
        let moved = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        tree.refit(&moved).unwrap();
        assert!(tree.nodes().iter().map(said).eq(before));
    }

    #[test]
    fn nodes_say_where_vertices_are() {
        check::<CompactNode4>();
        check::<CompactNode8>();
    }
}
