//! A finished binary tree made better: subtrees are taken out and put where they cost least.
//!
//! Meister and Bittner, "Parallel reinsertion for bounding volume hierarchy optimization" (2018). Many subtrees
//! look for their best place at once, in a tree that stands still; then those moves that do not touch each other
//! are made, the best first. Unlike there, moves are made one after the other: it takes little of the time, and
//! the outcome is the same on any number of threads.

mod candidates;

use super::{
    BuildError,
    assembly::Assembly,
    binary::{BinaryNode, BinaryTree},
    cost::Measure,
    lay_out::{Part, lay_out},
    monitor::Watch,
    pages,
    parallel::{self, join},
    refs::Bounds,
};
use candidates::Candidates;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use glam::Vec3;
use std::{vec, vec::Vec};
use wide::f32x4;

/// How hard to look.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    /// How often places are looked for at most.
    pub rounds: usize,
    /// One of so many nodes looks for a better place in a round: those of the largest area.
    pub share: usize,
    /// The least gain of a round, of the whole tree's cost, for which there is another one.
    pub least_gain: f64,
}

/// After so many looks for each node of the tree there is no other round. Six scenes took 4 to 60; a million
/// triangles that all overlap would take thousands.
const LOOKS_PER_NODE: usize = 100;
/// How many nodes a subtree may look below. In six scenes it is 20 on average and never more than 64.
const MOST_LOOKS: usize = 128;

/// So many nodes are one task where little is done with each.
const CHUNK: usize = 1 << 14;

/// With threads, so many levels of the changed tree are above parts that are put in order at once.
const LEVELS: u32 = 6;

/// A node while the tree changes.
#[derive(Clone, Copy)]
struct Spot {
    /// Scaled by the scene's measure.
    bounds: Bounds,
    area: f32,
    parent: u32,
    /// The first child; what number a leaf had when it all began.
    first: u32,
    count: u32,
}

/// What looking for a better place came to.
#[derive(Clone, Copy)]
struct Search {
    best: Option<Move>,
    looks: usize,
}

impl Search {
    const NONE: Self = Self {
        best: None,
        looks: 0,
    };
}

/// Where a subtree is best put: next to the node `to`, under a new parent.
#[derive(Clone, Copy)]
struct Move {
    from: u32,
    to: u32,
    gain: f32,
}

/// A tree over the same leaves, of no more cost. Both are in our order. `end` is where in the build this is done.
///
/// # Errors
/// The build was cancelled.
pub(super) fn optimize(
    tree: BinaryTree,
    effort: Effort,
    end: f32,
    watch: &Watch,
) -> Result<BinaryTree, BuildError> {
    let Some(root) = tree.nodes().first() else {
        return Ok(tree);
    };
    watch.phase(end, effort.rounds * (tree.nodes().len() / effort.share + 1))?;
    let measure = Measure::of_bounds(&root.aabb);
    let mut spots = spots(tree.nodes(), &measure);
    let mut touched = vec![false; spots.len()];
    let mut candidates = Candidates::new(spots.len());
    let least_gain = effort.least_gain * spots.iter().map(|spot| f64::from(spot.area)).sum::<f64>();
    let mut looks = 0;
    for _ in 0..effort.rounds {
        let looking = candidates.next(&spots, spots.len() / effort.share + 1);
        let find = |&from: &u32| match watch.advance(1) {
            true => find(&spots, from),
            false => Search::NONE,
        };
        let searches = parallel::map(&looking, find);
        for (&from, search) in looking.iter().zip(&searches) {
            candidates.note(from, search.best.is_some());
            looks += search.looks;
        }
        let mut moves: Vec<_> = searches.iter().filter_map(|search| search.best).collect();
        moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));
        touched.fill(false);
        let mut gain = 0.0;
        for m in &moves {
            if apply(&mut spots, m, &mut touched) {
                gain += f64::from(m.gain);
            }
        }
        if gain < least_gain || looks > LOOKS_PER_NODE * spots.len() {
            break;
        }
    }
    watch.check()?;
    Ok(changed(&tree, &spots))
}

fn spots(nodes: &[BinaryNode], measure: &Measure) -> Vec<Spot> {
    let parents = parents(nodes);
    let vector = |v: Vec3| f32x4::new([v.x, v.y, v.z, 0.0]) * measure.scale();
    pages::made(nodes.len(), CHUNK, |first, spots| {
        for index in first..first + spots.left() {
            let node = &nodes[index];
            let bounds = Bounds {
                min: vector(node.aabb.min),
                max: vector(node.aabb.max),
            };
            spots.push(Spot {
                bounds,
                area: bounds.half_area(),
                parent: parents[index].load(Relaxed),
                first: match node.is_leaf() {
                    true => index as u32,
                    false => node.first,
                },
                count: node.count,
            });
        }
    })
}

/// The parent of every node; 0 of the root. Atomic as threads write them, each child's once.
fn parents(nodes: &[BinaryNode]) -> Vec<AtomicU32> {
    let parents: Vec<_> = nodes.iter().map(|_| AtomicU32::new(0)).collect();
    parallel::map(nodes.chunks(CHUNK).enumerate(), |(chunk, nodes)| {
        for (node, index) in nodes.iter().zip(chunk * CHUNK..) {
            if !node.is_leaf() {
                for child in node.children() {
                    parents[child].store(index as u32, Relaxed);
                }
            }
        }
    });
    parents
}

/// The other child of a node's parent. Children are neighbours, and only the root comes before them.
const fn sibling(node: u32) -> u32 {
    ((node - 1) ^ 1) + 1
}

/// The best place for the subtree at `from`, if there is a better one than its own.
fn find(spots: &[Spot], from: u32) -> Search {
    let at = |index: u32| &spots[index as usize];
    let subtree = at(from);
    let parent = subtree.parent;
    let mut best = Move {
        from,
        to: 0,
        gain: 0.0,
    };
    // What is gained by taking the subtree away, by and by for nodes further up: their area, of which the box
    // without the subtree is less.
    let mut gain = at(parent).area;
    let mut looks = 0;
    // Nodes to go on below, each with what would be gained there if adding the box took no area at all.
    let mut todo: Vec<(f32, u32)> = Vec::with_capacity(64);
    let mut beside = sibling(from);
    let mut pivot = parent;
    let mut bounds = at(beside).bounds;
    loop {
        let look = |gain: f32, to: u32, best: &mut Move| {
            let place = at(to);
            let here = gain - place.bounds.join(subtree.bounds).half_area();
            if here > best.gain {
                best.gain = here;
                best.to = to;
            }
            // Further down, this node grows instead; and a box around the subtree is added.
            match place.count {
                0 => here + place.area - subtree.area,
                _ => f32::NEG_INFINITY,
            }
        };
        let below = look(gain, beside, &mut best);
        if below > best.gain {
            todo.push((below, beside));
        }
        while let Some((below, to)) = todo.pop() {
            if below <= best.gain {
                continue;
            }
            looks += 1;
            if looks > MOST_LOOKS {
                break;
            }
            let gain = below + subtree.area;
            let [a, b] = [at(to).first, at(to).first + 1];
            let mut sides = [(look(gain, a, &mut best), a), (look(gain, b, &mut best), b)];
            if sides[0].0 > sides[1].0 {
                sides.swap(0, 1);
            }
            // The better side first, to see early that others are worse.
            for side in sides {
                if side.0 > best.gain {
                    todo.push(side);
                }
            }
        }
        looks += 1;
        if pivot == 0 || looks > MOST_LOOKS {
            break;
        }
        if pivot != parent {
            bounds = bounds.join(at(beside).bounds);
            gain += at(pivot).area - bounds.half_area();
        }
        beside = sibling(pivot);
        pivot = at(pivot).parent;
    }
    let stays = best.to == 0 || best.to == sibling(from) || best.to == parent;
    Search {
        best: (!stays).then_some(best),
        looks,
    }
}

/// Makes a move, unless nodes that it changes were changed in this round.
fn apply(spots: &mut [Spot], m: &Move, touched: &mut [bool]) -> bool {
    let Move { from, to, .. } = *m;
    let parent = spots[from as usize].parent;
    let beside = sibling(from);
    let changed = [from, to, beside, parent, spots[to as usize].parent];
    if changed.iter().any(|&node| touched[node as usize]) {
        return false;
    }
    for node in changed {
        touched[node as usize] = true;
    }

    // The sibling takes the parent's place; the pair becomes children of a new node in the place of `to`.
    let place = spots[to as usize];
    put(spots, parent, spots[beside as usize]);
    put(spots, beside, place);
    let to_spot = &mut spots[to as usize];
    (to_spot.first, to_spot.count) = (from.min(beside), 0);
    spots[beside as usize].parent = to;
    spots[from as usize].parent = to;
    refit_up(spots, to);
    // The parent has its new box already.
    refit_up(spots, spots[parent as usize].parent);
    true
}

/// Puts a node where another was; only that one's parent stays.
fn put(spots: &mut [Spot], index: u32, spot: Spot) {
    let parent = spots[index as usize].parent;
    spots[index as usize] = Spot { parent, ..spot };
    if spot.count == 0 {
        for child in [spot.first, spot.first + 1] {
            spots[child as usize].parent = index;
        }
    }
}

/// Makes the boxes of a node and those above it anew, as far as they change.
fn refit_up(spots: &mut [Spot], mut index: u32) {
    loop {
        let spot = spots[index as usize];
        if spot.count == 0 {
            let child = |child: u32| spots[child as usize].bounds;
            let bounds = child(spot.first).join(child(spot.first + 1));
            if bounds.min == spot.bounds.min && bounds.max == spot.bounds.max {
                return;
            }
            let spot = &mut spots[index as usize];
            spot.bounds = bounds;
            spot.area = bounds.half_area();
        }
        if index == 0 {
            return;
        }
        index = spots[index as usize].parent;
    }
}

/// The changed tree, in our order.
fn changed(tree: &BinaryTree, spots: &[Spot]) -> BinaryTree {
    let levels = if parallel::threads() == 1 { 0 } else { LEVELS };
    // As if all parts were as large.
    let leaves = tree.nodes().len() >> (levels + 1);
    below(tree, spots, 0, levels, leaves).tree()
}

/// What is below a node, so many levels of it in parts, of about so many leaves.
fn below(tree: &BinaryTree, spots: &[Spot], index: u32, levels: u32, leaves: usize) -> Assembly {
    let spot = &spots[index as usize];
    if levels > 0 && spot.count == 0 {
        let (left, right) = join(
            true,
            || below(tree, spots, spot.first, levels - 1, leaves),
            || below(tree, spots, spot.first + 1, levels - 1, leaves),
        );
        return Assembly::two(left, right);
    }
    Assembly::Whole(lay_out(leaves, index, |index| {
        let spot = &spots[index as usize];
        if spot.count == 0 {
            return Part::Inner([spot.first, spot.first + 1]);
        }
        // The old one, which has the exact box.
        let leaf = &tree.nodes()[spot.first as usize];
        let places = leaf.first as usize..(leaf.first + leaf.count) as usize;
        Part::Leaf(leaf.aabb, &tree.order()[places])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        build::{Builder, binned, input::Boxes, refs::Refs, sweep::Leaves},
        geometry::Aabb,
    };

    /// Boxes of many sizes, in no order.
    fn boxes(count: u32) -> Vec<Aabb> {
        let unit = |n: u32| f32::from(n.wrapping_mul(0x9e37_79b9).rotate_left(13) as u16) / 65536.0;
        (0..count)
            .map(|i| {
                let min = Vec3::new(unit(7 * i), unit(7 * i + 1), unit(7 * i + 2));
                let size = Vec3::new(unit(7 * i + 3), unit(7 * i + 4), unit(7 * i + 5));
                Aabb::new(min, min + 0.5 * size * unit(7 * i + 6))
            })
            .collect()
    }

    fn binned(boxes: &[Aabb]) -> BinaryTree {
        let input = Boxes(boxes);
        let watch = Watch::none();
        binned::build(
            &input,
            Refs::gather(&input, false, &watch).unwrap(),
            Leaves::SINGLE,
            &watch,
        )
        .unwrap()
    }

    fn cost(nodes: &[BinaryNode]) -> f64 {
        let inner = nodes.iter().filter(|node| !node.is_leaf());
        inner.map(|node| f64::from(node.aabb.half_area())).sum()
    }

    #[test]
    fn the_gain_is_what_was_promised() {
        let boxes = boxes(300);
        let tree = binned(&boxes);
        let measure = Measure::of_bounds(&tree.nodes()[0].aabb);
        let spots = spots(tree.nodes(), &measure);
        let total = |spots: &[Spot]| spots.iter().map(|s| f64::from(s.area)).sum::<f64>();
        let mut moves = 0;
        for from in 1..spots.len() as u32 {
            let Some(found) = find(&spots, from).best else {
                continue;
            };
            let mut moved = spots.clone();
            let mut touched = vec![false; spots.len()];
            assert!(apply(&mut moved, &found, &mut touched));
            let gain = total(&spots) - total(&moved);
            let difference = (gain - f64::from(found.gain)).abs();
            assert!(difference < 1e-4, "{gain} for {}", found.gain);
            moves += 1;
        }
        assert!(moves > 20, "{moves}");
    }

    #[test]
    fn a_tree_of_less_cost() {
        let boxes = boxes(2000);
        let before = binned(&boxes);
        let effort = Effort {
            rounds: 10,
            share: 4,
            least_gain: 0.0,
        };
        let after = optimize(before.clone(), effort, 1.0, &Watch::none()).unwrap();
        assert!(cost(after.nodes()) < 0.99 * cost(before.nodes()));

        let mut order = after.order().to_vec();
        order.sort_unstable();
        assert!(order.into_iter().eq(0..2000));
        let (nodes, order) = after.into_parts();
        for node in &nodes {
            let aabb = if node.is_leaf() {
                boxes[order[node.first as usize] as usize]
            } else {
                let [left, right] = node.children();
                nodes[left].aabb.join(nodes[right].aabb)
            };
            assert_eq!(node.aabb, aabb);
        }
        assert!(BinaryTree::new(nodes, order).is_ok());
    }

    #[test]
    fn next_to_nothing() {
        for count in 0..5 {
            let boxes = boxes(count);
            let tree = Builder::new().build_primitives_binary(&boxes).unwrap();
            assert_eq!(tree.order().len(), boxes.len());
        }
    }
}
