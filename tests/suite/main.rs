//! The contract, its committed vectors, and what holds beside it. One program: what is generic is compiled once, not for each
//! file.

mod common;

mod accuracy;
mod approximate;
mod batch;
mod bytes;
mod contract;
mod deep;
mod parts;
mod presets;
mod primitives;
mod refit;
mod refit_boxes;
mod refit_runs;
mod regressions;
mod reorder;
mod vectors;
mod watertight;
