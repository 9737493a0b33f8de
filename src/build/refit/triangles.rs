//! Leaves that have copies of triangles.

use super::{around, listed, map_all, none_is_missing, places, update_nodes};
use crate::{
    build::{
        error::RefitError,
        fill::{Corners, Filling},
        input::{Input, Triangles, Verdict},
    },
    geometry::{Aabb, TriangleMesh},
    layout::{Bvh, Leaf, Owned, TriangleLeaf, WideNode},
    simd::{Backend, Operation, Simd},
};
use bytemuck::Zeroable;
use core::cell::Cell;
use std::vec::Vec;

impl<N: WideNode> Bvh<N, TriangleLeaf, Owned> {
    /// Follows a mesh whose vertices have moved: afterwards queries answer as those of a hierarchy built on it. The
    /// triangles must be those that this one was built on, by number.
    ///
    /// The time is linear, and less than that of any build. But the tree stays what it was, so queries get slower the
    /// further what was close together moves apart, or what was apart through each other: by about as much as
    /// [`BuildReport::sah_cost`](crate::build::BuildReport::sah_cost) grows. When that is more than a build is worth, build
    /// again. Pieces of triangles that the builder cut get the box of the whole triangle, so for what moves
    /// [`Preset::Balanced`](crate::build::Preset::Balanced) or [`splits(0.0)`](crate::build::Builder::splits) is the better start.
    ///
    /// Triangles that lose their area are not hit, and are again when they regain it. Corners of several triangles that were
    /// at one place when this was built may part only as long as each leaf has no more than 8 places. Meshes in which each
    /// triangle has vertices of its own come apart so when pieces of them move by themselves: these are to be built again.
    ///
    /// ```
    /// use wide_bvh::{Builder, Preset, Ray, TriangleMesh};
    ///
    /// let mut positions = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0_f32]];
    /// let indices = [[0, 1, 2_u32]];
    /// let mut bvh = Builder::new().preset(Preset::Balanced).build(&TriangleMesh::new(&positions, &indices)?)?;
    /// positions.iter_mut().for_each(|[_, _, z]| *z += 1.0);
    /// bvh.refit(&TriangleMesh::new(&positions, &indices)?)?;
    /// let hit = bvh.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).unwrap();
    /// assert_eq!(hit.t, 6.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The hierarchy is then as it was.
    /// - A triangle is not in the mesh, or has a corner that is NaN or infinite.
    /// - A triangle that was left out, for having no area or not being finite, or that was not there, can be hit.
    /// - Vertices at one place have parted, and the leaf that they are in has no room for them. Build again.
    ///
    /// Of several, the triangle of the least number.
    pub fn refit(&mut self, mesh: &TriangleMesh) -> Result<(), RefitError> {
        let primitives = self.primitives();
        let moved = |leaf: &TriangleLeaf| move_leaf(mesh, leaf, &primitives[places(leaf)]);
        let leaves = map_all(self.leaves(), moved)?;
        none_is_missing(&Triangles(mesh), listed(self))?;
        let (leaves, boxes): (_, Vec<Aabb>) = leaves.into_iter().unzip();
        *self.moving_parts().0 = leaves;
        update_nodes(self, |leaf| boxes[leaf]);
        Ok(())
    }
}

/// A leaf's triangles where they are now, and the box around them.
fn move_leaf(
    mesh: &TriangleMesh,
    leaf: &TriangleLeaf,
    ids: &[u32],
) -> Result<(TriangleLeaf, Aabb), RefitError> {
    let triangles = Triangles(mesh);
    let all_have_area = Cell::new(true);
    // The box of one that cannot be hit keeps the leaf's from being none.
    let bounds = around(&triangles, ids.iter().copied(), |id| {
        all_have_area.set(false);
        Ok(triangles.aabb(id))
    })?;
    let first = leaf.primitives().start as u32;
    let moved = match all_have_area.get() {
        true => same_corners(mesh, leaf, ids),
        false => None,
    };
    let leaf = match moved {
        Some(vertices) => TriangleLeaf::from_lanes(vertices, leaf.corners, first, ids.len()),
        None => Backend::detect().run(Refill { mesh, ids, first })?,
    };
    Ok((leaf, bounds))
}

/// A leaf filled anew.
struct Refill<'a> {
    mesh: &'a TriangleMesh<'a>,
    /// Some.
    ids: &'a [u32],
    first: u32,
}

impl Operation for Refill<'_> {
    type Output = Result<TriangleLeaf, RefitError>;

    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Self::Output {
        let mut filling: Option<Filling<S>> = None;
        for &id in self.ids {
            let corners = Corners::new(self.mesh, self.mesh.indices()[id as usize]);
            let has_area = matches!(Triangles(self.mesh).verdict(id), Verdict::Keep(_));
            match &mut filling {
                None if has_area => filling = Some(Filling::of(token, &corners)),
                None => filling = Some(Filling::of_none(token, &corners)),
                Some(filling) if !has_area => filling.add_none(),
                Some(filling) => {
                    if !filling.add(token, &corners) {
                        let primitive = id as usize;
                        return Err(RefitError::VerticesParted { primitive });
                    }
                }
            }
        }
        Ok(filling.map_or(TriangleLeaf::zeroed(), |filling| filling.leaf(self.first)))
    }
}

/// The vertices, if the lanes that triangles have for corners are still right: all corners that share one are at one
/// place, and no triangle's are the same one, as those of a triangle without area are.
#[inline(always)]
fn same_corners(mesh: &TriangleMesh, leaf: &TriangleLeaf, ids: &[u32]) -> Option<[[f32; 8]; 3]> {
    let mut vertices = [[0.0; 8]; 3];
    let mut known = 0u32;
    for (triangle, &id) in ids.iter().enumerate() {
        let lanes = [0, 1, 2].map(|corner| leaf.corners[corner][triangle] as usize & 7);
        if lanes[0] == lanes[1] {
            return None;
        }
        for (lane, vertex) in lanes.into_iter().zip(mesh.indices()[id as usize]) {
            let position = mesh.positions()[vertex as usize];
            let [x, y, z] = &mut vertices;
            if known & 1 << lane == 0 {
                known |= 1 << lane;
                [x[lane], y[lane], z[lane]] = position;
            } else if [x[lane], y[lane], z[lane]] != position {
                return None;
            }
        }
    }
    for lanes in &mut vertices {
        let first = lanes[0];
        for (lane, x) in lanes.iter_mut().enumerate() {
            *x = if known & 1 << lane == 0 { first } else { *x };
        }
    }
    Some(vertices)
}
