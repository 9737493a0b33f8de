//! Traces a scene in flash: rays whose hits have to be the host's, bit for bit, and a picture in letters.

#![no_std]
#![no_main]

mod picture;
mod stack;

use cortex_m_rt::entry;
use semihosting::{println, process};
use wide_bvh_firmware::{hits, mesh, open, rays};

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(wrong) = run() else {
        println!("what was baked is no hierarchy");
        process::exit(2)
    };
    println!("{} bytes of stack at most", stack::used());
    process::exit(i32::from(wrong > 0))
}

/// How many rays are answered in another way than on the host. `None` if there is no scene.
fn run() -> Option<usize> {
    let (mesh, bvh) = (mesh()?, open()?);
    let bvh = bvh.over(&mesh).ok()?;
    picture::draw(&bvh);

    let (mut wrong, mut found) = (0, 0);
    for (ray, &expected) in rays().iter().zip(hits()) {
        let hit = bvh.closest_hit(ray);
        let bits = hit.map_or([u32::MAX; 4], |hit| {
            found += 1;
            [
                hit.t.to_bits(),
                hit.u.to_bits(),
                hit.v.to_bits(),
                hit.primitive,
            ]
        });
        if bits != expected || bvh.any_hit(ray) != hit.is_some() {
            println!("{bits:08x?}, not {expected:08x?}, for {ray:?}");
            wrong += 1;
        }
    }
    println!(
        "{} triangles, {} rays, {found} hits, {wrong} other than the host's",
        mesh.len(),
        rays().len()
    );
    Some(wrong)
}
