//! A program that does nothing but what its features say, for its size to be compared.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use panic_halt as _;

#[entry]
fn main() -> ! {
    #[cfg(feature = "open")]
    run();
    loop {}
}

#[cfg(feature = "open")]
fn run() -> Option<()> {
    use core::hint::black_box;
    use wide_bvh_firmware::{mesh, open};

    let (mesh, bvh) = (mesh()?, open()?);
    let bvh = bvh.over(&mesh).ok()?;
    black_box(&bvh);
    #[cfg(feature = "queries")]
    {
        let ray = wide_bvh_firmware::rays().first()?;
        black_box(bvh.closest_hit(black_box(ray)));
        black_box(bvh.any_hit(black_box(ray)));
    }
    Some(())
}
