//! The walk of one ray through a hierarchy.

use crate::{
    geometry::Ray,
    layout::{Bvh, Child, Leaf, STACK, Storage, WideNode},
    simd::Simd,
};
use core::{mem::MaybeUninit, ops::ControlFlow};

/// What is done on the way.
pub(crate) trait Visitor<L> {
    /// Whether children are wanted the nearest first. Any order will do to find out that something is
    /// in the way.
    const NEAREST_FIRST: bool;

    /// A node is tested.
    #[inline(always)]
    fn node(&mut self) {}

    /// A leaf is reached. The `t` up to which to look on, or `Break` if enough is known.
    fn leaf(&mut self, leaf: &L) -> ControlFlow<(), f32>;
}

/// A child to come back to, and the `t` from which on the ray is in its box.
#[derive(Clone, Copy)]
struct Entry {
    near: f32,
    child: Child,
}

/// Takes `visitor` to every leaf whose box the ray passes within its range, which shrinks on the way. The ray is a
/// prepared one's, and so are the reciprocals of its direction.
#[inline(always)]
pub(crate) fn walk<T: Simd, N: WideNode, L: Leaf, S: Storage, V: Visitor<L>>(
    token: T,
    bvh: &Bvh<N, L, S>,
    ray: &Ray,
    reciprocal: [T::F32x8; 3],
    visitor: &mut V,
) {
    if bvh.root() == Child::EMPTY {
        return;
    }
    let (nodes, leaves) = (bvh.nodes(), bvh.leaves());
    let slabs = N::slabs(token, ray, reciprocal, bvh.bounds());
    let mut t_max = ray.t_max;
    let mut stack = [MaybeUninit::<Entry>::uninit(); STACK];
    let mut len = 0;
    let mut current = bvh.root();
    loop {
        if current.is_leaf() {
            // SAFETY: the layout's check saw that all leaves led to are there.
            let leaf = unsafe { leaves.get_unchecked(current.index()) };
            match visitor.leaf(leaf) {
                ControlFlow::Break(()) => return,
                ControlFlow::Continue(t) => t_max = t,
            }
        } else {
            visitor.node();
            // SAFETY: the layout's check saw that all nodes led to are there.
            let node = unsafe { nodes.get_unchecked(current.index()) };
            let (mut mask, near) = node.test(token, &slabs, N::splat(token, t_max));
            // SAFETY: `mask` has bits for the node's lanes alone.
            let child = |lane: u32| unsafe { *node.children().get_unchecked(lane as usize) };
            if mask != 0 {
                let first = mask.trailing_zeros();
                mask &= mask - 1;
                current = child(first);
                if mask == 0 {
                    continue;
                }
                // Insertion from the top of the stack down, the nearest left in hand.
                let base = len;
                let mut best = N::lane(&near, first as usize);
                while mask != 0 {
                    let lane = mask.trailing_zeros();
                    mask &= mask - 1;
                    let mut entry = Entry {
                        near: N::lane(&near, lane as usize),
                        child: child(lane),
                    };
                    if V::NEAREST_FIRST && entry.near < best {
                        (entry, current, best) = (
                            Entry {
                                near: best,
                                child: current,
                            },
                            entry.child,
                            entry.near,
                        );
                    }
                    let mut place = len;
                    // SAFETY: the layout's check saw that a walk never has more than `STACK`
                    // entries; those below `len` were written.
                    unsafe {
                        while V::NEAREST_FIRST && place > base {
                            let below = stack.get_unchecked(place - 1).assume_init();
                            if below.near >= entry.near {
                                break;
                            }
                            *stack.get_unchecked_mut(place) = MaybeUninit::new(below);
                            place -= 1;
                        }
                        *stack.get_unchecked_mut(place) = MaybeUninit::new(entry);
                    }
                    len += 1;
                }
                continue;
            }
        }
        // Back to the last child left behind that is still near enough.
        loop {
            if len == 0 {
                return;
            }
            len -= 1;
            // SAFETY: entries below `len` were written.
            let entry = unsafe { stack.get_unchecked(len).assume_init() };
            if entry.near <= t_max {
                current = entry.child;
                break;
            }
        }
    }
}
