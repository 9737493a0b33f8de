//! A binary tree from the bottom up: neighbours along a curve that are best for each other become one, round by round.
//!
//! Meister and Bittner, "Parallel locally-ordered clustering for bounding volume hierarchy construction" (2018).

use super::{binary::BinaryNode, monitor::Watch};
use crate::geometry::Aabb;
use std::{vec, vec::Vec};
use wide::{f32x4, u32x4};

/// How far along the curve a cluster looks to either side. A multiple of 4.
const RADIUS: usize = 4;
const SLOTS: usize = 2 * RADIUS;
/// The bits that tell them apart.
const SLOT: u32 = SLOTS.next_power_of_two() as u32 - 1;
/// One of so many clusters of a part is left for those of other parts to be joined with.
const LEFT: usize = 16;

/// Clusters along the curve.
struct Clusters {
    /// Their boxes, by side and axis, scaled by the scene's measure. Before the first and after the last are
    /// [`RADIUS`] that are far too large for anyone.
    planes: [Vec<f32>; 6],
    nodes: Vec<BinaryNode>,
    scale: f32,
}

/// Beyond any scene, whose coordinates are less than 4; its area is still finite.
const FAR: f32 = 1e18;

impl Clusters {
    fn new(nodes: Vec<BinaryNode>, scale: f32) -> Self {
        let planes = [0; 6].map(|_| vec![0.0; nodes.len() + SLOTS]);
        let mut clusters = Self {
            planes,
            nodes,
            scale,
        };
        clusters.look();
        clusters
    }

    /// Makes the planes those of the nodes.
    fn look(&mut self) {
        let Self {
            planes,
            nodes,
            scale,
        } = self;
        let end = nodes.len() + RADIUS;
        for (side, planes) in planes.iter_mut().enumerate() {
            let far = if side < 3 { -FAR } else { FAR };
            planes.truncate(end + RADIUS);
            planes[..RADIUS].fill(far);
            planes[end..].fill(far);
        }
        let mut planes = planes
            .each_mut()
            .map(|planes| planes[RADIUS..end].iter_mut());
        for node in nodes {
            let Aabb { min, max } = node.aabb;
            let sides = [min.x, min.y, min.z, max.x, max.y, max.z];
            for (planes, x) in planes.iter_mut().zip(sides) {
                if let Some(plane) = planes.next() {
                    *plane = x * *scale;
                }
            }
        }
    }

    /// Joins clusters until there are no more than `until`. Each pair that is joined goes to the end of `pairs`; its
    /// place there, from `base` on, is the new node's `first`.
    fn join(&mut self, until: usize, pairs: &mut Vec<[BinaryNode; 2]>, base: u32, watch: &Watch) {
        let (mut nearest, mut kept) = (Vec::new(), Vec::new());
        while self.nodes.len() > until.max(1) {
            let count = self.nodes.len();
            self.search(&mut nearest);
            let left = self.join_pairs(&nearest, &mut kept, pairs, base);
            // Clusters that all like the one before better than the one after are joined one a round. Then it
            // is halves.
            if left > count - count / 16 {
                nearest.clear();
                nearest.extend((0..left as u32).map(|place| (place ^ 1).min(left as u32 - 1)));
                self.join_pairs(&nearest, &mut kept, pairs, base);
            }
            if !watch.advance(count - self.nodes.len()) {
                return;
            }
        }
    }

    /// The place of the best partner of each.
    fn search(&self, nearest: &mut Vec<u32>) {
        #[cfg(feature = "rayon")]
        if self.nodes.len() > 4 * super::parallel::TASK {
            use rayon::prelude::*;
            (0..self.nodes.len())
                .into_par_iter()
                .with_min_len(super::parallel::TASK)
                .map(|place| self.nearest(place))
                .collect_into_vec(nearest);
            return;
        }
        nearest.clear();
        nearest.extend((0..self.nodes.len()).map(|place| self.nearest(place)));
    }

    /// The cluster with which the box is least; of equals the first.
    ///
    /// Areas are compared together with the place, which takes the last bits. So the order is one of pairs, the same
    /// seen from both sides: the least pair is always joined.
    #[inline(always)]
    fn nearest(&self, place: usize) -> u32 {
        const AROUND: [f32; SLOTS + 1] = [0.0; _];
        let [x0, y0, z0, x1, y1, z1] = &self.planes;
        let at = |planes: &'_ Vec<f32>| *planes[place..].first_chunk().unwrap_or(&AROUND);
        let planes = [at(x0), at(y0), at(z0), at(x1), at(y1), at(z1)];
        let own = |side: usize| f32x4::splat(planes[side][RADIUS]);
        let [x0, y0, z0, x1, y1, z1] = [own(0), own(1), own(2), own(3), own(4), own(5)];
        // As integers, which are ordered as numbers that are not negative are: a denormal is not to be flushed to zero.
        let mut best = u32x4::splat(u32::MAX);
        for block in 0..SLOTS / 4 {
            // Its own place is left out.
            let start = 4 * block + usize::from(4 * block >= RADIUS);
            let load = |side: usize| {
                let lanes = &planes[side];
                f32x4::new([
                    lanes[start],
                    lanes[start + 1],
                    lanes[start + 2],
                    lanes[start + 3],
                ])
            };
            let x = x1.fast_max(load(3)) - x0.fast_min(load(0));
            let y = y1.fast_max(load(4)) - y0.fast_min(load(1));
            let z = z1.fast_max(load(5)) - z0.fast_min(load(2));
            let area = x * y + (x + y) * z;
            let first = 4 * block as u32;
            let slots = u32x4::new([first, first + 1, first + 2, first + 3]);
            let area: u32x4 = bytemuck::cast(area);
            best = best.min((area & u32x4::splat(!SLOT)) | slots);
        }
        let [a, b, c, d] = best.to_array();
        let slot = (a.min(b).min(c.min(d)) & SLOT) as usize;
        (place + slot + usize::from(slot >= RADIUS) - RADIUS) as u32
    }

    /// Joins those that are each other's nearest: how many are left.
    fn join_pairs(
        &mut self,
        nearest: &[u32],
        kept: &mut Vec<[u32; 2]>,
        pairs: &mut Vec<[BinaryNode; 2]>,
        base: u32,
    ) -> usize {
        kept.clear();
        for (place, &other) in nearest.iter().enumerate() {
            let place = place as u32;
            let mutual = nearest[other as usize] == place;
            if mutual && other < place {
                continue;
            }
            kept.push([place, if mutual { other } else { place }]);
        }
        for (end, &[place, other]) in kept.iter().enumerate() {
            let mut node = self.nodes[place as usize];
            if other != place {
                let pair = [node, self.nodes[other as usize]];
                node = BinaryNode {
                    aabb: pair[0].aabb.join(pair[1].aabb),
                    first: base + pairs.len() as u32,
                    count: 0,
                };
                pairs.push(pair);
            }
            self.nodes[end] = node;
        }
        self.nodes.truncate(kept.len());
        self.look();
        kept.len()
    }
}

/// What is joined apart from the rest, so that it is on one core, and in its cache.
pub(super) struct Part {
    pairs: Vec<[BinaryNode; 2]>,
    roots: Vec<BinaryNode>,
}

impl Part {
    /// Joins all but one of so many.
    pub fn new(leaves: Vec<BinaryNode>, scale: f32, watch: &Watch) -> Self {
        let until = leaves.len() / LEFT;
        let mut pairs = Vec::with_capacity(leaves.len());
        let mut clusters = Clusters::new(leaves, scale);
        clusters.join(until, &mut pairs, 0, watch);
        Self {
            pairs,
            roots: clusters.nodes,
        }
    }

    fn leaves(&self) -> usize {
        self.pairs.len() + self.roots.len()
    }
}

/// The tree over parts, with all children after their parents.
pub(super) fn tree(parts: &[Part], scale: f32, watch: &Watch) -> Vec<BinaryNode> {
    let leaves: usize = parts.iter().map(Part::leaves).sum();
    if leaves == 0 {
        return Vec::new();
    }
    let mut bases = Vec::with_capacity(parts.len());
    let mut pairs = 0;
    let mut roots = Vec::new();
    for part in parts {
        let base = Base(pairs);
        roots.extend(part.roots.iter().map(|&root| base.raise(root)));
        bases.push(base);
        pairs += part.pairs.len() as u32;
    }
    let mut top = Vec::with_capacity(roots.len());
    let mut clusters = Clusters::new(roots, scale);
    clusters.join(1, &mut top, pairs, watch);

    // The later a pair was made, the closer it is to the root.
    let mut nodes = Vec::with_capacity(2 * leaves - 1);
    let place = |node: BinaryNode| match node.is_leaf() {
        true => node,
        false => BinaryNode {
            first: 2 * (leaves as u32 - 2 - node.first) + 1,
            ..node
        },
    };
    nodes.extend(clusters.nodes.into_iter().take(1).map(place));
    nodes.extend(top.into_iter().rev().flatten().map(place));
    for (part, base) in parts.iter().zip(&bases).rev() {
        let pairs = part.pairs.iter().rev().flatten();
        nodes.extend(pairs.map(|&node| place(base.raise(node))));
    }
    nodes
}

/// How many pairs come before those of a part.
struct Base(u32);

impl Base {
    #[inline]
    fn raise(&self, node: BinaryNode) -> BinaryNode {
        match node.is_leaf() {
            true => node,
            false => BinaryNode {
                first: self.0 + node.first,
                ..node
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::BinaryTree;
    use glam::Vec3;

    fn leaf(number: u32, aabb: Aabb) -> BinaryNode {
        BinaryNode {
            aabb,
            first: number,
            count: 1,
        }
    }

    /// Has a tree of all in parts of so many.
    fn check(boxes: &[Aabb], part: usize) -> Vec<BinaryNode> {
        let watch = Watch::none();
        let leaves: Vec<_> = boxes.iter().zip(0..).map(|(&b, i)| leaf(i, b)).collect();
        let parts: Vec<_> = leaves
            .chunks(part)
            .map(|leaves| Part::new(leaves.to_vec(), 1.0, &watch))
            .collect();
        let nodes = tree(&parts, 1.0, &watch);
        assert_eq!(nodes.len(), 2 * boxes.len() - 1);
        for (index, node) in nodes.iter().enumerate() {
            let aabb = if node.is_leaf() {
                boxes[node.first as usize]
            } else {
                let [left, right] = node.children();
                assert!(left > index);
                nodes[left].aabb.join(nodes[right].aabb)
            };
            assert_eq!(node.aabb, aabb);
        }
        // Every leaf is there, once.
        let order = (0..boxes.len() as u32).collect();
        assert!(BinaryTree::new(nodes.clone(), order).is_ok());
        nodes
    }

    #[test]
    fn trees() {
        let at = |x: f32| Aabb::new(Vec3::splat(x), Vec3::splat(x + 0.001));
        for count in [1, 2, 3, 7, 100, 1000] {
            let row: Vec<_> = (0..count).map(|i| at(i as f32 / 1000.0)).collect();
            for part in [1, 3, 64, 1000] {
                check(&row, part);
            }
            check(&vec![at(0.0); count], 64);
        }
        // Pairs that are close are joined first.
        let pairs = [0.0, 0.002, 1.0, 1.002, 2.0, 2.002].map(at);
        let nodes = check(&pairs, 6);
        let lowest = |node: &&BinaryNode| {
            !node.is_leaf() && node.children().iter().all(|&child| nodes[child].is_leaf())
        };
        assert_eq!(nodes.iter().filter(lowest).count(), 3);
    }

    /// Each is best joined with the one before: as many rounds as there are, but for the halving.
    #[test]
    fn rounds_are_few() {
        let boxes: Vec<_> = (0..20_000)
            .map(|i| {
                let x = 1.0 - 0.9998f32.powi(i);
                Aabb::new(Vec3::splat(x), Vec3::splat(x))
            })
            .collect();
        let nodes = check(&boxes, boxes.len());
        let mut depths = vec![0; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            if !node.is_leaf() {
                for child in node.children() {
                    depths[child] = depths[index] + 1;
                }
            }
        }
        assert!(depths.into_iter().max() < Some(300));
    }
}
