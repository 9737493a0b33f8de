//! Traces a scene in flash: rays whose hits have to be the host's, bit for bit, and a picture in letters.

#![no_std]
#![no_main]

mod picture;
mod stack;

use cortex_m_rt::entry;
use semihosting::{println, process};
use wide_bvh::layout::OrderedMeshBvh4;
use wide_bvh_firmware::{hits, open, rays};

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(bvh) = open() else {
        println!("what was baked is no hierarchy");
        process::exit(2)
    };
    let opening = stack::used();
    stack::paint();
    let wrong = trace(&bvh);
    let tracing = stack::used();
    picture::draw(&bvh);
    println!(
        "{} triangles, {} rays, {wrong} answers other than the host's",
        bvh.primitive_count(),
        rays().len()
    );
    println!("{opening} bytes of stack to open the hierarchy, {tracing} to trace; no others");
    process::exit(i32::from(wrong > 0))
}

/// How many rays are answered in another way than on the host.
#[inline(never)]
fn trace(bvh: &OrderedMeshBvh4) -> usize {
    let mut wrong = 0;
    for (ray, &expected) in rays().iter().zip(hits()) {
        let hit = bvh.closest_hit(ray);
        let bits = hit.map_or([u32::MAX; 4], |hit| {
            [
                hit.t.to_bits(),
                hit.u.to_bits(),
                hit.v.to_bits(),
                hit.primitive,
            ]
        });
        if bits != expected || bvh.any_hit(ray) != hit.is_some() {
            wrong += 1;
        }
    }
    wrong
}
