//! How much time a build may take.

/// What a hierarchy is built for: once and traced for long, or anew for every picture.
///
/// The answers are the same.
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
