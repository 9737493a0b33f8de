//! How much time a build may take.

/// What a hierarchy is built for: once and traced for long, or anew for every picture.
///
/// The answers are the same. On one thread of an Intel Xeon (Sapphire Rapids or later), over a scan of 70,000 triangles, one
/// of 870,000, a kitchen and three game levels:
///
/// | | build, ns a triangle | bounce rays, of [`Best`](Self::Best)'s |
/// | --- | --- | --- |
/// | [`Fast`](Self::Fast) | 67 to 88 | 0.77 |
/// | [`Balanced`](Self::Balanced) | 283 to 456 | 0.97 |
/// | [`Best`](Self::Best) | 608 to 1,187 | 1 |
///
/// A Zen 4 (AMD EPYC) takes about as long, one of the first Zen generation up to twice that. What moves without
/// changing can be [refitted](crate::layout::Bvh::refit), in 40 to 100 ns a triangle on that one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// For what changes all the time: leaves of neighbours along a space-filling curve (Morton), and a tree over them
    /// from the bottom up (Meister and Bittner, "Parallel locally-ordered clustering", 2018).
    Fast,
    /// For what is loaded while somebody waits: a tree from the top down by the surface area heuristic, without cuts
    /// through triangles, and some rounds of moving subtrees to where they cost less.
    Balanced,
    /// For what is built once: cuts through large triangles, and subtrees moved for as long as it gains.
    #[default]
    Best,
}

impl Preset {
    /// The [splits](super::Builder::splits) it comes with. Room enough: game levels and a kitchen use 0.05 to 0.12. With 0.1, a
    /// level that uses 0.12 loses half its gain.
    pub(super) const fn splits(self) -> f32 {
        match self {
            Self::Best => 0.3,
            Self::Balanced | Self::Fast => 0.0,
        }
    }
}
