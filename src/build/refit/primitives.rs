//! Leaves of a caller's primitives.

use super::{around, listed, map_all, none_is_missing, places, put_somewhere, update_nodes};
use crate::{
    build::{error::RefitError, input::Boxes},
    geometry::Aabb,
    layout::{Bvh, Owned, PrimitiveLeaf, WideNode},
};

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
            let ids = primitives[places(leaf)].iter().copied();
            around(&input, ids, |_| Ok(Aabb::EMPTY))
        };
        let mut boxes = map_all(self.leaves(), moved)?;
        none_is_missing(&input, listed(self))?;
        put_somewhere(&mut boxes);
        update_nodes(self, |leaf| boxes[leaf]);
        Ok(())
    }
}
