//! A binary tree from the bottom up: neighbours along a curve that are best for each other become one, round by round.
//!
//! Meister and Bittner, "Parallel locally-ordered clustering for bounding volume hierarchy construction" (2018).

use super::monitor::Watch;
use crate::{
    geometry::Aabb,
    simd::{Backend, Lanes, Operation, Simd, Vector, splat3},
};
use std::{vec, vec::Vec};

/// How far along the curve a cluster looks to either side: as far as eight lanes go, in the middle of which it is
/// itself.
const RADIUS: usize = 3;
const SLOTS: usize = 8;
/// The bits that tell them apart.
const SLOT: u32 = SLOTS as u32 - 1;
/// All but its own and the last, which has no partner on the other side.
const OTHERS: u32 = 0b0111_0111;

/// A node of the tree, after those below it. It is never in two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct Node {
    pub aabb: Aabb,
    /// A leaf's number, or the place of the first child.
    first: u32,
    /// How many primitives a leaf has, or the place of the second child and [`Self::INNER`].
    second: u32,
}

impl Node {
    const INNER: u32 = 1 << 31;

    #[inline(always)]
    pub const fn leaf(aabb: Aabb, number: u32, count: u32) -> Self {
        Self {
            aabb,
            first: number,
            second: count,
        }
    }

    #[inline(always)]
    pub const fn is_leaf(&self) -> bool {
        self.second & Self::INNER == 0
    }

    /// A leaf's number.
    #[inline(always)]
    pub const fn number(&self) -> usize {
        self.first as usize
    }

    /// How many primitives a leaf has.
    #[inline(always)]
    pub const fn count(&self) -> usize {
        self.second as usize
    }

    /// The two children, if it is no leaf.
    #[inline(always)]
    pub const fn children(&self) -> [usize; 2] {
        [self.first as usize, (self.second & !Self::INNER) as usize]
    }

    /// The same after so many other leaves and nodes.
    #[cfg(feature = "rayon")]
    #[inline(always)]
    pub const fn after(&self, leaves: u32, nodes: u32) -> Self {
        match self.is_leaf() {
            true => Self {
                first: self.first + leaves,
                ..*self
            },
            false => Self {
                first: self.first + nodes,
                second: self.second + nodes,
                ..*self
            },
        }
    }
}

/// Beyond any scene, whose coordinates are less than 4; its area is still finite.
const FAR: f32 = 1e18;

/// Joins clusters, which are nodes that follow each other along the curve, until there are no more than `until`: those
/// that are left. New nodes go to the end.
pub(super) fn join(
    nodes: &mut Vec<Node>,
    clusters: Vec<u32>,
    until: usize,
    scale: f32,
    watch: &Watch,
) -> Vec<u32> {
    let backend = Backend::detect();
    let mut nearest = vec![0; clusters.len()];
    let mut clusters = Clusters::new(nodes, clusters, scale);
    while clusters.places.len() > until.max(1) {
        let count = clusters.places.len();
        clusters.search(backend, &mut nearest[..count]);
        let left = backend.run(JoinPairs {
            clusters: &mut clusters,
            nodes,
            nearest: &nearest[..count],
        });
        // Clusters that all like the one before better than the one after are joined one a round. Then it
        // is halves.
        if left > count - count / 16 {
            let halves = &mut nearest[..left];
            for (other, place) in halves.iter_mut().zip(0u32..) {
                *other = (place ^ 1).min(left as u32 - 1);
            }
            backend.run(JoinPairs {
                clusters: &mut clusters,
                nodes,
                nearest: halves,
            });
        }
        if !watch.advance(count - clusters.places.len()) {
            break;
        }
    }
    clusters.places
}

/// Clusters along the curve.
struct Clusters {
    /// Their boxes, by side and axis, scaled by the scene's measure. Around each are [`SLOTS`], of which those before the
    /// first and after the last are far too large for anyone.
    planes: [Vec<f32>; 6],
    /// Their places among the nodes.
    places: Vec<u32>,
    scale: f32,
}

impl Clusters {
    fn new(nodes: &[Node], places: Vec<u32>, scale: f32) -> Self {
        let count = places.len();
        let mut planes = [-FAR, -FAR, -FAR, FAR, FAR, FAR].map(|far| vec![far; count + SLOTS]);
        {
            let [x0, y0, z0, x1, y1, z1] = planes
                .each_mut()
                .map(|planes| &mut planes[RADIUS..RADIUS + count]);
            for (index, &place) in places.iter().enumerate() {
                let sides = sides(&nodes[place as usize].aabb, scale);
                [
                    x0[index], y0[index], z0[index], x1[index], y1[index], z1[index],
                ] = sides;
            }
        }
        Self {
            planes,
            places,
            scale,
        }
    }

    /// Puts what is far after the last.
    fn end(&mut self) {
        let end = self.places.len() + RADIUS;
        for (side, planes) in self.planes.iter_mut().enumerate() {
            planes.truncate(end);
            planes.resize(end + SLOTS - RADIUS, if side < 3 { -FAR } else { FAR });
        }
    }

    /// The best partner of each.
    fn search(&self, backend: Backend, nearest: &mut [u32]) {
        let search = |(first, nearest): (usize, &mut [u32])| {
            backend.run(Search {
                planes: self.planes.each_ref().map(|planes| &planes[first..]),
                first: first as u32,
                nearest,
            });
        };
        #[cfg(feature = "rayon")]
        if nearest.len() > 4 * super::parallel::TASK {
            use super::parallel::TASK;
            use rayon::prelude::*;
            let chunks = nearest.par_chunks_mut(TASK).enumerate();
            chunks.for_each(|(chunk, nearest)| search((chunk * TASK, nearest)));
            return;
        }
        search((0, nearest));
    }

    /// Joins those that are each other's nearest: how many are left.
    #[inline(always)]
    fn join_pairs(&mut self, nodes: &mut Vec<Node>, nearest: &[u32]) -> usize {
        let Self {
            planes,
            places,
            scale,
        } = self;
        // What is left moves up: it never comes after where it was.
        let mut left = 0;
        let count = nearest.len();
        let places_now = &mut places[..count];
        let [x0, y0, z0, x1, y1, z1] = planes.each_mut().map(|planes| &mut planes[RADIUS..]);
        let (x0, y0, z0) = (&mut x0[..count], &mut y0[..count], &mut z0[..count]);
        let (x1, y1, z1) = (&mut x1[..count], &mut y1[..count], &mut z1[..count]);
        for (index, &other) in nearest.iter().enumerate() {
            let other = other as usize;
            if left >= count || other >= count {
                break;
            }
            let mutual = nearest[other] as usize == index;
            if mutual && other < index {
                continue;
            }
            let mut place = places_now[index];
            if mutual && other != index {
                let second = places_now[other];
                let [a, b] = [place, second].map(|place| nodes[place as usize].aabb);
                let aabb = a.join(b);
                let node = Node {
                    aabb,
                    first: place,
                    second: second | Node::INNER,
                };
                place = nodes.len() as u32;
                nodes.push(node);
                [x0[left], y0[left], z0[left], x1[left], y1[left], z1[left]] = sides(&aabb, *scale);
            } else {
                (x0[left], y0[left], z0[left]) = (x0[index], y0[index], z0[index]);
                (x1[left], y1[left], z1[left]) = (x1[index], y1[index], z1[index]);
            }
            places_now[left] = place;
            left += 1;
        }
        places.truncate(left);
        self.end();
        left
    }
}

struct JoinPairs<'a> {
    clusters: &'a mut Clusters,
    nodes: &'a mut Vec<Node>,
    nearest: &'a [u32],
}

impl Operation for JoinPairs<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> usize {
        self.clusters.join_pairs(self.nodes, self.nearest)
    }
}

/// The planes of a box.
#[inline(always)]
fn sides(&Aabb { min, max }: &Aabb, scale: f32) -> [f32; 6] {
    let (min, max) = (min * scale, max * scale);
    [min.x, min.y, min.z, max.x, max.y, max.z]
}

/// For each of a run of clusters the one with which the box is least; of equals the first.
///
/// Areas are compared together with the place, which takes the last bits. So the order is one of pairs, the same
/// seen from both sides: the least pair is always joined.
struct Search<'a> {
    /// From what is before the first on.
    planes: [&'a [f32]; 6],
    first: u32,
    nearest: &'a mut [u32],
}

impl Operation for Search<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, token: S) {
        let [x0, y0, z0, x1, y1, z1] = self.planes.map(|planes| planes.windows(SLOTS));
        let around = x0.zip(y0).zip(z0).zip(x1).zip(y1).zip(z1);
        let others = S::F32x8::of_bits(token, OTHERS);
        let area_bits = S::F32x8::splat(token, f32::from_bits(!SLOT));
        let slots = S::F32x8::load(token, &[0, 1, 2, 3, 4, 5, 6, 7].map(f32::from_bits));
        let places = self.nearest.iter_mut().zip(self.first..);
        for ((nearest, place), (((((x0, y0), z0), x1), y1), z1)) in places.zip(around) {
            let min = [load(token, x0), load(token, y0), load(token, z0)];
            let max = [load(token, x1), load(token, y1), load(token, z1)];
            let own_min: [S::F32x8; 3] = splat3(token, [x0[RADIUS], y0[RADIUS], z0[RADIUS]]);
            let own_max: [S::F32x8; 3] = splat3(token, [x1[RADIUS], y1[RADIUS], z1[RADIUS]]);
            let x = own_max[0].max(max[0]) - own_min[0].min(min[0]);
            let y = own_max[1].max(max[1]) - own_min[1].min(min[1]);
            let z = own_max[2].max(max[2]) - own_min[2].min(min[2]);
            let area = x * y + (x + y) * z;
            let slot = ((area & area_bits) | slots).least(others);
            *nearest = (place + slot as u32).wrapping_sub(RADIUS as u32);
        }
    }
}

#[inline(always)]
fn load<S: Simd>(token: S, window: &[f32]) -> S::F32x8 {
    S::F32x8::load(token, window.first_chunk().unwrap_or(&[0.0; SLOTS]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Has a tree of all in parts of so many.
    fn check(boxes: &[Aabb], part: usize) -> Vec<Node> {
        let watch = Watch::none();
        let mut nodes = Vec::new();
        let mut roots = Vec::new();
        for (part, number) in boxes.chunks(part).zip((0..).step_by(part)) {
            let start = nodes.len() as u32;
            nodes.extend(part.iter().zip(number..).map(|(&b, i)| Node::leaf(b, i, 1)));
            let clusters = (start..nodes.len() as u32).collect();
            roots.extend(join(&mut nodes, clusters, part.len() / 4, 1.0, &watch));
        }
        let root = join(&mut nodes, roots, 1, 1.0, &watch);
        assert_eq!(root, [nodes.len() as u32 - 1]);
        assert_eq!(nodes.len(), 2 * boxes.len() - 1);
        // Every node but the root is another's child, once.
        let mut led_to = vec![0; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            let aabb = if node.is_leaf() {
                boxes[node.number()]
            } else {
                let [left, right] = node.children();
                assert!(left < index && right < index);
                led_to[left] += 1;
                led_to[right] += 1;
                nodes[left].aabb.join(nodes[right].aabb)
            };
            assert_eq!(node.aabb, aabb);
        }
        assert!(led_to[..nodes.len() - 1].iter().all(|&times| times == 1));
        let leaves = nodes.iter().filter(|node| node.is_leaf());
        assert!(leaves.map(Node::number).eq(0..boxes.len()));
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
        let lowest = |node: &&Node| {
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
        for (index, node) in nodes.iter().enumerate().rev() {
            if !node.is_leaf() {
                for child in node.children() {
                    depths[child] = depths[index] + 1;
                }
            }
        }
        assert!(depths.into_iter().max() < Some(300));
    }
}
