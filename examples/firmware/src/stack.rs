//! How much stack was used: all of it is painted, and what lost its paint was used.

use core::{arch::asm, ptr};

/// Nothing that is likely to be written.
const PAINT: u32 = 0xc0de_d00d;
/// What is left unpainted for the function that paints.
const OWN: usize = 128;

unsafe extern "C" {
    /// The end of what is static: the stack grows down to here.
    static mut __sheap: u32;
    /// Where the stack begins.
    static _stack_start: u32;
}

fn pointer() -> usize {
    let pointer: usize;
    // SAFETY: reads a register.
    unsafe { asm!("mov {}, sp", out(reg) pointer, options(nomem, nostack)) };
    pointer
}

/// Paints the stack from its end to where it is used now.
#[inline(never)]
pub fn paint() {
    let (mut place, end) = (&raw mut __sheap, pointer() - OWN);
    while (place as usize) < end {
        // SAFETY: between what is static and what is used of the stack, nothing else is kept.
        unsafe {
            place.write_volatile(PAINT);
            place = place.add(1);
        }
    }
}

/// How many bytes were used since [`paint`], or before.
pub fn used() -> usize {
    let start = ptr::addr_of!(_stack_start) as usize;
    let mut place = (&raw const __sheap).cast::<u32>();
    // SAFETY: between the two the stack lies.
    while (place as usize) < start && unsafe { place.read_volatile() } == PAINT {
        place = place.wrapping_add(1);
    }
    start - place as usize
}
