//! What each pixel's ray costs: nodes and triangles tested, as colours.

use crate::{args::Args, picture::Picture, say::say, trace, world::World};
use std::fmt::Write;
use wide_bvh::geometry::Ray;
use wide_bvh_scenes::Camera;

/// Names and sRGB values along "inferno" (Smith and van der Walt, matplotlib), whose lightness rises evenly,
/// so that equal steps of cost look equal, in greys too.
const COLOURS: [(&str, [u8; 3]); 9] = [
    ("black", [0, 0, 4]),
    ("", [31, 12, 72]),
    ("purple", [85, 15, 109]),
    ("", [136, 34, 106]),
    ("red", [186, 54, 85]),
    ("", [227, 89, 51]),
    ("orange", [249, 140, 10]),
    ("", [249, 201, 50]),
    ("pale yellow", [252, 255, 164]),
];

/// One ray through each pixel's centre. Prints what the colours mean.
pub fn render(world: &World<'_>, camera: &Camera, args: &Args) -> Picture {
    let (width, height) = (args.width, args.height);
    let costs = trace::pixels(world, args, |tracer, x, y| {
        let (origin, direction) = camera.ray(x, y, width, height);
        let counts = tracer.cost(&Ray::new(origin, direction));
        counts.nodes + counts.triangles
    });
    let mut sorted = costs.clone();
    sorted.sort_unstable();
    let at = |part: f64| sorted[(part * (sorted.len() - 1) as f64) as usize];
    // A few rays along edges cost many times the rest: the scale ends where 98 % do.
    let top = at(0.98).max(1);

    let (least, median, most) = (at(0.0), at(0.5), at(1.0));
    say(format_args!(
        "cost        nodes and triangles tested a pixel: least {least}, median {median}, most {most}"
    ));
    say(format_args!("colours     {}", legend(top)));
    Picture {
        width,
        height,
        colours: costs
            .iter()
            .map(|&cost| colour(cost as f32 / top as f32))
            .collect(),
    }
}

/// The named colours and the costs that they stand for, on a scale that ends at `top`.
fn legend(top: u32) -> String {
    let mut text = String::new();
    let last = COLOURS.len() - 1;
    for (stop, (name, _)) in COLOURS.iter().enumerate() {
        if !name.is_empty() {
            let cost = (top as usize * stop + last / 2) / last;
            let after = if stop == last { " and more" } else { ", " };
            // Writing to a string cannot fail.
            let _ = write!(text, "{name} {cost}{after}");
        }
    }
    text
}

/// The colour at `part` of the scale, the last one beyond its end.
fn colour(part: f32) -> [u8; 3] {
    let place = part.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f32;
    let below = (place as usize).min(COLOURS.len() - 2);
    let (_, from) = COLOURS[below];
    let (_, to) = COLOURS[below + 1];
    let share = place - below as f32;
    [0, 1, 2].map(|c| (f32::from(from[c]) * (1.0 - share) + f32::from(to[c]) * share).round() as u8)
}
