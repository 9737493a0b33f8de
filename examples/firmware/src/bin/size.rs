//! Nothing but what its features say, for sizes to be compared. Not to be run: the hierarchy that is asked is none, or
//! the opening of one would be counted with the queries.

#![no_std]
#![no_main]

use cortex_m_rt::entry;
use panic_halt as _;

#[entry]
fn main() -> ! {
    #[cfg(feature = "open")]
    core::hint::black_box(wide_bvh_firmware::open());
    #[cfg(feature = "queries")]
    queries();
    loop {
        core::hint::spin_loop();
    }
}

#[cfg(feature = "queries")]
fn queries() {
    use core::hint::black_box;
    use wide_bvh::{geometry::Ray, layout::OrderedMeshBvh4};

    // SAFETY: never run.
    let (bvh, ray) = unsafe {
        (
            &*black_box(0x2000_0000 as *const OrderedMeshBvh4),
            &*black_box(0x2000_1000 as *const Ray),
        )
    };
    black_box(bvh.closest_hit(ray));
    black_box(bvh.any_hit(ray));
}
