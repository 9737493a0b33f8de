//! Leaves that are runs of primitive numbers, under compact nodes.

use super::{around, map_all, none_is_missing, put_somewhere, update_nodes};
use crate::{
    build::{
        error::RefitError,
        input::{Boxes, Input, TrianglesInRuns},
    },
    geometry::{Aabb, TriangleMesh},
    layout::{Bvh, Order, Owned, Runs, WideNode, number_at, of_child, of_place},
};
use core::ops::Range;
use std::{vec, vec::Vec};

impl<N: WideNode, O: Order> Bvh<N, Runs<(), O>, Owned> {
    /// Follows a mesh whose vertices have moved, as a full hierarchy does: afterwards queries [over](Self::over) it answer as
    /// those of a hierarchy built on it. Of a hierarchy that was [reordered](Bvh::reorder) it is the mesh in that order.
    ///
    /// ```
    /// use wide_bvh::{Builder, Preset, Ray, TriangleMesh, layout::CompactBvh8};
    ///
    /// let mut positions = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0_f32]];
    /// let indices = [[0, 1, 2_u32]];
    /// let builder = Builder::new().preset(Preset::Balanced);
    /// let mut bvh: CompactBvh8 = builder.build_compact(&TriangleMesh::new(&positions, &indices)?)?;
    /// positions.iter_mut().for_each(|[_, _, z]| *z += 1.0);
    /// let mesh = TriangleMesh::new(&positions, &indices)?;
    /// bvh.refit(&mesh)?;
    /// let hit = bvh.over(&mesh)?.closest_hit(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).unwrap();
    /// assert_eq!(hit.t, 6.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The hierarchy is then as it was.
    /// - A triangle is not in the mesh, or has a corner that is NaN or infinite.
    /// - A triangle has lost its area: its leaf would read it from the mesh as any other. Build again.
    /// - A triangle that was left out, for having no area or not being finite, or that was not there, can be hit.
    ///
    /// Of several, the triangle of the least number; those that were left out are looked at last.
    pub fn refit(&mut self, mesh: &TriangleMesh) -> Result<(), RefitError> {
        self.follow(&TrianglesInRuns(mesh), |primitive| {
            let primitive = primitive as usize;
            Err(RefitError::AreaLost { primitive })
        })
    }

    /// Follows a caller's primitives that have moved: `aabbs` are their boxes now, in the same order as when the hierarchy was
    /// built. A box that is [`Aabb::EMPTY`] stands for a primitive that is never hit.
    ///
    /// # Errors
    /// The hierarchy is then as it was.
    /// - A primitive has no box, or one that is not finite or has `min` above `max`.
    /// - A primitive that was left out, for being empty or not finite, or that was not there, is neither.
    ///
    /// Of several, the primitive of the least number; those that were left out are looked at last.
    pub fn refit_primitives(&mut self, aabbs: &[Aabb]) -> Result<(), RefitError> {
        self.follow(&Boxes(aabbs), |_| Ok(Aabb::EMPTY))
    }

    /// Makes all boxes anew; of a primitive that cannot be hit it is what `unhittable` says.
    fn follow<I: Input>(
        &mut self,
        input: &I,
        unhittable: impl Fn(u32) -> Result<Aabb, RefitError> + Sync,
    ) -> Result<(), RefitError> {
        let (primitives, count) = (self.primitives(), self.primitive_count());
        let numbers = |run: Range<usize>| run.map(|place| number_at(primitives, place));
        let runs = self.runs();
        let own = |run: &Range<usize>| around(input, numbers(run.clone()), &unhittable);
        let mut boxes = map_all(&runs, own)?;
        none_is_missing(input, numbers(0..count))?;
        put_somewhere(&mut boxes);
        // By where a run begins.
        let mut order = vec![0; count];
        for (run, index) in runs.iter().zip(0u32..) {
            order[run.start] = index;
        }
        update_nodes(self, |leaf| boxes[order[of_place(leaf).start] as usize]);
        Ok(())
    }

    /// All leaves.
    fn runs(&self) -> Vec<Range<usize>> {
        let nodes = self.nodes().iter();
        let below = nodes.flat_map(|node| (0..N::WIDTH).map(|lane| node.child(lane)));
        below.chain([self.root()]).filter_map(of_child).collect()
    }
}
