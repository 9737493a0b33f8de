//! Queries: methods of [`Bvh`](crate::layout::Bvh), for every layout and backend the same bits.
//!
//! | over triangles | asked of | besides |
//! | --- | --- | --- |
//! | [`closest_hit`](crate::layout::Bvh#method.closest_hit), [`any_hit`](crate::layout::Bvh#method.any_hit) | a ray | 8 KiB of stack |
//! | [`closest_hits`](crate::layout::Bvh::closest_hits), [`any_hits`](crate::layout::Bvh::any_hits) | any number of rays, in any order: faster | 96 KiB of stack |
//! | [`closest_hits_in`](crate::layout::Bvh::closest_hits_in), [`any_hits_in`](crate::layout::Bvh::any_hits_in) | the same | a [`Scratch`] of yours, 9 KiB of stack |
//! | `par_closest_hits`, `par_any_hits` | the same, on all cores | the feature `rayon` |
//! | [`closest_hit_packet`](crate::layout::Bvh::closest_hit_packet), [`any_hit_packet`](crate::layout::Bvh::any_hit_packet) | up to 64 rays, some of them inactive | 36 KiB of stack |
//! | [`closest_hit_counted`](crate::layout::Bvh::closest_hit_counted), [`any_hit_counted`](crate::layout::Bvh::any_hit_counted) | a ray, and what it cost | |
//!
//! A hierarchy over [primitives of your own](crate::primitive::Primitives) has `closest_hit` and `any_hit`, which are given
//! the primitives. A compact one over a mesh is asked once it is put [`over`](crate::layout::Bvh::over) it.
//!
//! Stack is as measured in optimised builds; in ones that are not, a batch takes 0.9 MiB.
//!
//! # Debug builds
//!
//! `opt-level = 3` under `[profile.dev.package.wide-bvh]` has Cargo optimise this crate whatever else it does not: builds, and of
//! a [`Bvh8`](crate::layout::Bvh8) the four queries that come first above. All other queries are compiled with what asks
//! them, and as that is: 15 to 45 times as slow where nothing is optimised. Put those into a crate of their own, and have that
//! optimised likewise.

// Each is written once for every node, leaf and backend. `single` is the walk of one ray; `wave` interleaves many, that
// `feed` gives it; a `bundle` goes side by side. `batch` chooses between them, by the `classes` of the rays and by
// the backend. What a leaf's triangles answer is the same code in all of them, so the answers are the same bits. `compiled` has
// of them what most ask, not generic any more.

mod batch;
mod boxes;
mod bundle;
mod classes;
#[cfg(feature = "std")]
mod compiled;
mod count;
mod feed;
mod guess;
mod one_by_one;
mod primitives;
mod query;
mod ray_lanes;
mod single;
pub mod sweep;
mod triangles;
mod wave;

pub use batch::Scratch;
pub use count::Counts;
