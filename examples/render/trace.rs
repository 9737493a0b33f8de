//! All pixels of a picture on all cores, with a bar that shows how far it is.

use crate::{
    args::Args,
    say::say,
    world::{Tracer, World},
};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use std::time::Instant;

/// What `pixel` says for each `x` and `y`, row by row from the top. Prints how fast that was.
pub fn pixels<T: Send>(
    world: &World<'_>,
    args: &Args,
    pixel: impl Fn(&mut Tracer<'_>, u32, u32) -> T + Sync,
) -> Vec<T> {
    let bar = ProgressBar::new(args.height.into()).with_message("tracing");
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent}% {eta}") {
        bar.set_style(style);
    }
    let start = Instant::now();
    let row = |y| {
        let mut tracer = Tracer { world, rays: 0 };
        let row: Vec<T> = (0..args.width).map(|x| pixel(&mut tracer, x, y)).collect();
        bar.inc(1);
        (row, tracer.rays)
    };
    let rows: Vec<(Vec<T>, u64)> = (0..args.height).into_par_iter().map(row).collect();
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();

    let rays: u64 = rows.iter().map(|(_, rays)| rays).sum();
    let millions = rays as f64 * 1e-6;
    let rate = millions / seconds;
    let threads = rayon::current_num_threads();
    say(format_args!(
        "rays        {millions:.2} million in {seconds:.2} s: {rate:.2} million a second on {threads} threads"
    ));
    rows.into_iter().flat_map(|(row, _)| row).collect()
}
