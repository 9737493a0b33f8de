//! What holds beside the contract and its committed vectors. One program: what is generic is compiled once, not for each file.

#[path = "../common/mod.rs"]
mod common;

mod accuracy;
mod approximate;
mod batch;
mod bytes;
mod parts;
mod presets;
mod primitives;
mod refit;
mod refit_boxes;
mod refit_runs;
mod regressions;
mod reorder;
mod watertight;
