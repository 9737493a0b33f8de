//! One figure of the race, as it stands in the JSON.

use crate::engines::Takes;
use serde::Serialize;

/// How an engine did on one workload over one scene; or a builder, whose tree is judged by bounce rays.
#[derive(Clone, Debug, Serialize)]
pub struct Record {
    /// The scene's name.
    pub scene: String,
    /// How many triangles it has.
    pub triangles: usize,
    /// `primary`, `bounce`, `random` or `shadow`; of builders, how many threads built.
    pub workload: &'static str,
    /// The engine's name: `wide-bvh …` for this crate's, `embree …` for Embree's.
    pub engine: String,
    /// Known from the name.
    #[serde(skip)]
    pub takes: Takes,
    /// Million rays a second, the median of the rounds.
    pub mrays_per_s: f64,
    /// Milliseconds to build, by one thread unless the workload tells otherwise.
    pub build_ms: f64,
    /// Bytes that the engine keeps for each triangle, besides the vertex and index buffers.
    pub bytes_per_triangle: f64,
    /// How many rays were compared to brute force.
    pub sample: usize,
    /// How many of those were answered otherwise.
    pub disagreements: usize,
}
