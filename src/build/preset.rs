//! How much time a build may take.

/// What a hierarchy is built for: once and traced for long, or anew for every picture.
///
/// The answers are the same. On one thread of an AMD EPYC (Zen 5) server, over a scan of 70,000 triangles, one of 870,000,
/// a kitchen and three game levels:
///
/// | | build, ns a triangle | closest and any hits, of [`Best`](Self::Best)'s |
/// | --- | --- | --- |
/// | [`Fast`](Self::Fast) | 120 to 180, the large scan 260 | 0.77 |
/// | [`Balanced`](Self::Balanced) | 390 to 510 | 0.94 |
/// | [`Best`](Self::Best) | 1,070 to 1,490 | 1 |
///
/// What moves without changing can be [refitted](crate::layout::Bvh::refit), in 40 to 80.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// For what changes all the time: leaves of neighbours along a space-filling curve (Morton), and a tree over them
    /// from the bottom up (Meister and Bittner, "Parallel locally-ordered clustering", 2018).
    Fast,
    /// For what is loaded while somebody waits: a tree from the top down by the surface area heuristic, without cuts
    /// through triangles, and a few rounds of moving subtrees to where they cost less.
    Balanced,
    /// For what is built once: cuts through large triangles, and subtrees moved for as long as it gains.
    #[default]
    Best,
}
