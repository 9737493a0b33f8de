//! Hierarchies whose primitives have moved: the same tree, its boxes made anew from the leaves up.

use super::{
    error::{BuildError, RefitError},
    fill::{Corners, Filling},
    input::{Boxes, Input, Triangles, Verdict},
};
use crate::{
    geometry::{Aabb, TriangleMesh},
    layout::{Bvh, ChildKind, Leaf, Owned, PrimitiveLeaf, TriangleLeaf, WideNode, tested_bounds},
    simd::{Backend, Operation, Simd},
};
use bytemuck::Zeroable;
use core::ops::Range;
use glam::Vec3;
use std::{vec, vec::Vec};

impl<N: WideNode> Bvh<N, TriangleLeaf, Owned> {
    /// Follows a mesh whose vertices have moved: afterwards queries answer as those of a hierarchy built on it. The
    /// triangles must be those that this one was built on, by number.
    ///
    /// The time is linear, and less than that of any build. But the tree stays what it was, so queries get slower the
    /// further what was close together moves apart, or what was apart through each other: by about as much as
    /// [`BuildReport::sah_cost`](super::BuildReport::sah_cost) grows. When that is more than a build is worth, build
    /// again. Pieces of triangles that the builder cut get the box of the whole triangle, so for what moves
    /// [`Preset::Balanced`](super::Preset::Balanced) or [`splits(0.0)`](super::Builder::splits) is the better start.
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
        none_is_missing(&Triangles(mesh), self.leaves(), primitives)?;
        let (leaves, boxes) = leaves.into_iter().unzip();
        self.update(leaves, boxes);
        Ok(())
    }
}

impl<N: WideNode> Bvh<N, PrimitiveLeaf, Owned> {
    /// Follows primitives that have moved: `aabbs` are their boxes now, in the same order as when the hierarchy was
    /// built. The tree stays what it was, so queries get slower as for triangles.
    ///
    /// A box that is [`Aabb::EMPTY`] stands for a primitive that is never hit.
    ///
    /// # Errors
    /// The hierarchy is then as it was.
    /// - A primitive has no box, or one that is not finite or has `min` above `max`.
    /// - A primitive that was left out, for being empty or not finite, or that was not there, is neither.
    ///
    /// Of several, the primitive of the least number.
    pub fn refit(&mut self, aabbs: &[Aabb]) -> Result<(), RefitError> {
        let input = Boxes(aabbs);
        let primitives = self.primitives();
        let moved = |leaf: &PrimitiveLeaf| {
            let ids = &primitives[places(leaf)];
            let aabb = ids.iter().try_fold(Aabb::EMPTY, |aabb, &id| {
                match in_range(id, aabbs.len()).map(|id| input.verdict(id))? {
                    Verdict::Keep(own) => Ok(aabb.join(own.aabb())),
                    Verdict::Unhittable => Ok(aabb),
                    Verdict::NonFinite(error) | Verdict::Invalid(error) => Err(at(id, error)),
                }
            })?;
            Ok((*leaf, aabb))
        };
        let leaves = map_all(self.leaves(), moved)?;
        none_is_missing(&input, self.leaves(), primitives)?;
        let (leaves, mut boxes): (_, Vec<Aabb>) = leaves.into_iter().unzip();
        // A leaf of nothing is still a leaf, and has a place.
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, &aabb| all.join(aabb));
        let place = if bounds.is_empty() {
            Vec3::ZERO
        } else {
            bounds.min
        };
        for aabb in boxes.iter_mut().filter(|aabb| aabb.is_empty()) {
            *aabb = Aabb::new(place, place);
        }
        self.update(leaves, boxes);
        Ok(())
    }
}

impl<N: WideNode, L: Leaf> Bvh<N, L, Owned> {
    /// Puts moved leaves in the place of what they were, with their boxes.
    fn update(&mut self, leaves: Vec<L>, boxes: Vec<Aabb>) {
        let root = self.root().kind();
        let (old_leaves, nodes, bounds) = self.moving_parts();
        *old_leaves = leaves;
        // Each node comes before those below it.
        let mut node_boxes = vec![Aabb::EMPTY; nodes.len()];
        let of = |child: ChildKind, node_boxes: &[Aabb]| match child {
            ChildKind::Empty => Aabb::EMPTY,
            ChildKind::Node(node) => node_boxes[node],
            ChildKind::Leaf(leaf) => boxes[leaf],
        };
        for (index, node) in nodes.iter_mut().enumerate().rev() {
            let mut all = Aabb::EMPTY;
            let lanes = (0..N::WIDTH).map_while(|lane| {
                let child = node.child(lane);
                let aabb = of(child.kind(), &node_boxes);
                all = all.join(aabb);
                (child.kind() != ChildKind::Empty).then_some((aabb, child))
            });
            *node = N::from_children(lanes);
            node_boxes[index] = all;
        }
        *bounds = match N::NODES_FIRST {
            true => tested_bounds(nodes, of(root, &node_boxes)),
            false => of(root, &node_boxes),
        };
    }
}

fn places<L: Leaf>(leaf: &L) -> Range<usize> {
    let Range { start, end } = leaf.primitives();
    start as usize..end as usize
}

fn at(primitive: u32, error: BuildError) -> RefitError {
    RefitError::Primitive {
        primitive: primitive as usize,
        error,
    }
}

fn in_range(primitive: u32, count: usize) -> Result<u32, RefitError> {
    match (primitive as usize) < count {
        true => Ok(primitive),
        false => Err(RefitError::PrimitiveGone {
            primitive: primitive as usize,
        }),
    }
}

/// Every leaf moved, and its box.
///
/// # Errors
/// Of all errors that of the least primitive.
fn map_all<L: Leaf + Sync + Send>(
    leaves: &[L],
    moved: impl Fn(&L) -> Result<(L, Aabb), RefitError> + Sync,
) -> Result<Vec<(L, Aabb)>, RefitError> {
    #[cfg(feature = "rayon")]
    let all = {
        use rayon::prelude::*;
        leaves.par_iter().map(&moved).collect::<Result<_, _>>()
    };
    #[cfg(not(feature = "rayon"))]
    let all = leaves.iter().map(&moved).collect::<Result<_, _>>();
    all.map_err(|error| {
        let errors = leaves.iter().filter_map(|leaf| moved(leaf).err());
        errors.min_by_key(RefitError::primitive).unwrap_or(error)
    })
}

/// What is in no leaf cannot be hit. Parts that were put together may list what is in none.
fn none_is_missing<I: Input>(
    input: &I,
    leaves: &[I::Leaf],
    primitives: &[u32],
) -> Result<(), RefitError> {
    let mut listed = vec![0u64; input.len().div_ceil(64)];
    for &id in leaves.iter().flat_map(|leaf| &primitives[places(leaf)]) {
        if let Some(word) = listed.get_mut(id as usize / 64) {
            *word |= 1 << (id % 64);
        }
    }
    for (word, &listed) in listed.iter().enumerate() {
        let mut missing = !listed;
        while missing != 0 {
            let primitive = 64 * word + missing.trailing_zeros() as usize;
            missing &= missing - 1;
            if primitive < input.len()
                && matches!(input.verdict(primitive as u32), Verdict::Keep(_))
            {
                return Err(RefitError::PrimitiveLeftOut { primitive });
            }
        }
    }
    Ok(())
}

/// A leaf's triangles where they are now, and the box around them.
fn move_leaf(
    mesh: &TriangleMesh,
    leaf: &TriangleLeaf,
    ids: &[u32],
) -> Result<(TriangleLeaf, Aabb), RefitError> {
    let triangles = Triangles(mesh);
    let mut bounds = Aabb::EMPTY;
    // Whether each can be hit.
    let mut have_area = 0u32;
    for (triangle, &id) in ids.iter().enumerate() {
        let id = in_range(id, mesh.len())?;
        match triangles.verdict(id) {
            Verdict::Keep(own) => {
                bounds = bounds.join(own.aabb());
                have_area |= 1 << triangle;
            }
            // Its box keeps the leaf's from being none.
            Verdict::Unhittable => bounds = bounds.join(triangles.aabb(id)),
            Verdict::NonFinite(error) | Verdict::Invalid(error) => return Err(at(id, error)),
        }
    }
    let all = (1 << ids.len()) - 1;
    let first = leaf.primitives().start as u32;
    let moved = match have_area == all {
        true => same_corners(mesh, leaf, ids),
        false => None,
    };
    let leaf = match moved {
        Some(vertices) => TriangleLeaf::from_lanes(vertices, leaf.corners, first, ids.len()),
        None => Backend::detect().run(Refill {
            mesh,
            ids,
            have_area,
            first,
        })?,
    };
    Ok((leaf, bounds))
}

/// A leaf filled anew.
struct Refill<'a> {
    mesh: &'a TriangleMesh<'a>,
    /// Some.
    ids: &'a [u32],
    have_area: u32,
    first: u32,
}

impl Operation for Refill<'_> {
    type Output = Result<TriangleLeaf, RefitError>;

    #[inline(always)]
    fn run<S: Simd>(self, token: S) -> Self::Output {
        let mut filling: Option<Filling<S>> = None;
        for (triangle, &id) in self.ids.iter().enumerate() {
            let corners = Corners::new(self.mesh, self.mesh.indices()[id as usize]);
            let has_area = self.have_area & 1 << triangle != 0;
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
