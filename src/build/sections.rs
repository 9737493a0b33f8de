//! Leaves along a curve and the tree over them, section by section.

use super::{
    BuildError,
    cost::Measure,
    cuts::{Cuts, Forest},
    input::Input,
    leaf_collapse::solve,
    monitor::Watch,
    morton::Curve,
    pages, parallel,
    ploc::{self, Node},
    runs::{self, Runs},
};
use core::mem::take;
use std::vec::Vec;

/// So many primitives are one part of a section: what is joined of them is on one core, and in its cache.
const PART: usize = 1 << 12;
/// One of so many clusters of a part is left for those of other parts to be joined with.
const LEFT: usize = 16;
/// With threads, so many sections are for each.
const SECTIONS: usize = 16;

/// All sections, of as many primitives each, but for the last.
pub(super) struct Sections<L> {
    all: Vec<Section<L>>,
    primitives: usize,
}

/// What comes of a section by itself.
struct Section<L> {
    leaves: Vec<L>,
    /// Trees over the leaves, as far as they go. Leaves and children count from the first here.
    nodes: Vec<Node>,
    /// How those are collapsed.
    cuts: Vec<Cuts>,
    /// What is not joined yet.
    roots: Vec<u32>,
    /// The roots'.
    forests: Vec<Forest>,
}

impl<L: Copy + Send + Sync> Sections<L> {
    /// Grows leaves and trees on their own. Without threads all is one section.
    ///
    /// # Errors
    /// The build was cancelled.
    pub fn grow<I: Input<Leaf = L>, const W: usize>(
        input: &I,
        curve: &Curve,
        watch: &Watch,
    ) -> Result<Self, BuildError> {
        let order = &curve.order[..];
        watch.phase(0.85, 2 * order.len())?;
        let primitives = match parallel::threads() {
            1 => order.len() + 1,
            threads => (order.len() / (SECTIONS * threads) + 1).next_multiple_of(PART),
        };
        let grow = |(section, ids): (usize, &[u32])| {
            Section::grow::<I, W>(input, ids, section * primitives, curve.measure, watch)
        };
        let all = parallel::map(order.chunks(primitives).enumerate(), grow);
        watch.check()?;
        Ok(Self { all, primitives })
    }

    /// Joins what is left, and takes what there is of the tree: its nodes, the root last, and how they are collapsed.
    ///
    /// # Errors
    /// The build was cancelled.
    pub fn join<I: Input, const W: usize>(
        &mut self,
        measure: Measure,
        watch: &Watch,
    ) -> Result<(Vec<Node>, Vec<Cuts>), BuildError> {
        // By itself: first the roots, and where they are in the whole tree.
        let (mut top, mut places, mut forests) = (Vec::new(), Vec::new(), Vec::new());
        let mut before = 0;
        for section in &self.all {
            let roots = section.roots.iter();
            top.extend(roots.clone().map(|&root| section.nodes[root as usize]));
            places.extend(roots.map(|root| before + root));
            forests.extend_from_slice(&section.forests);
            before += section.nodes.len() as u32;
        }
        let roots = top.len();
        watch.phase(0.9, roots)?;
        let clusters = (0..roots as u32).collect();
        ploc::join(&mut top, clusters, 1, measure.scale(), watch);
        watch.check()?;
        let (_, top_cuts) = solve::<I, W>(&top, forests, measure);
        places.extend((before..).take(top_cuts.len()));

        let (mut nodes, mut cuts) = match &mut self.all[..] {
            [all] => (take(&mut all.nodes), take(&mut all.cuts)),
            _ => self.one_after_the_other(),
        };
        let place = |child: u32| places[child as usize];
        nodes.extend(top[roots..].iter().map(|node| node.moved(0, place)));
        cuts.extend(top_cuts);
        Ok((nodes, cuts))
    }

    /// The nodes of all sections and how they are collapsed. Leaves have the numbers that [`leaf`](Self::leaf) takes.
    fn one_after_the_other(&self) -> (Vec<Node>, Vec<Cuts>) {
        let len = self.all.iter().map(|section| section.nodes.len()).sum();
        let mut nodes = pages::filled(Node::NONE, len);
        let mut cuts = pages::filled(Cuts::NONE, len);
        let (mut later_nodes, mut later_cuts) = (&mut nodes[..], &mut cuts[..]);
        let (mut leaves_before, mut before) = (0, 0);
        let mut copies = Vec::with_capacity(self.all.len());
        for section in &self.all {
            let count = section.nodes.len();
            let nodes = later_nodes.split_off_mut(..count).unwrap_or_default();
            let cuts = later_cuts.split_off_mut(..count).unwrap_or_default();
            copies.push((section, leaves_before, before, nodes, cuts));
            leaves_before += self.primitives as u32;
            before += count as u32;
        }
        let copy = |(section, leaves_before, before, nodes, cuts): (&Section<L>, _, _, _, _)| {
            let nodes: &mut [Node] = nodes;
            for (to, node) in nodes.iter_mut().zip(&section.nodes) {
                *to = node.moved(leaves_before, |child| before + child);
            }
            <[_]>::copy_from_slice(cuts, &section.cuts);
        };
        parallel::map(copies, copy);
        (nodes, cuts)
    }
}

impl<L> Sections<L> {
    /// The leaf of a number. Those of a section begin where its primitives do along the curve.
    #[inline(always)]
    pub fn leaf(&self, number: u32) -> &L {
        let number = number as usize;
        match &self.all[..] {
            [all] => &all.leaves[number],
            all => &all[number / self.primitives].leaves[number % self.primitives],
        }
    }
}

impl<L: Copy> Section<L> {
    /// Of primitives that begin at `first` along the curve. In a build that was cancelled there are fewer.
    fn grow<I: Input<Leaf = L>, const W: usize>(
        input: &I,
        ids: &[u32],
        first: usize,
        measure: Measure,
        watch: &Watch,
    ) -> Self {
        let scale = measure.scale();
        // Seldom there are more. What is not used is not touched.
        let most = ids.len() / 8 * 3 + 1;
        let mut leaves = pages::with_capacity(most);
        let mut nodes = pages::with_capacity(2 * most);
        let mut roots = Vec::new();
        for (ids, first) in ids.chunks(PART).zip((first..).step_by(PART)) {
            if !watch.advance(ids.len()) {
                break;
            }
            let start = nodes.len() as u32;
            let runs = Runs {
                leaves: &mut leaves,
                nodes: &mut nodes,
            };
            runs::cut(input, ids, first, scale, runs);
            let clusters: Vec<_> = (start..nodes.len() as u32).collect();
            let until = clusters.len() / LEFT;
            roots.extend(ploc::join(&mut nodes, clusters, until, scale, watch));
        }
        let (forests, cuts) = solve::<I, W>(&nodes, pages::with_capacity(nodes.len()), measure);
        let forests = roots.iter().map(|&root| forests[root as usize]).collect();
        Self {
            leaves,
            nodes,
            cuts,
            roots,
            forests,
        }
    }
}
