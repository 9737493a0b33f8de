//! A host program that has the processor flush denormal numbers to zero.
//!
//! Audio and game programs set this for a whole thread; code that they call runs under it. Rust as a language knows no
//! such mode, so it is entered and left within one block of assembly, which calls the code in between as a
//! host would.

/// Whether there is such a mode here.
pub const AVAILABLE: bool = cfg!(target_arch = "x86_64");

/// Runs `work` with denormal operands taken as zero and denormal results made zero.
#[cfg(target_arch = "x86_64")]
pub fn flushed<R>(work: impl FnOnce() -> R) -> R {
    use std::{
        arch::asm,
        panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
        thread,
    };

    struct Call<F, R> {
        work: Option<F>,
        result: Option<thread::Result<R>>,
    }

    extern "sysv64" fn run<F: FnOnce() -> R, R>(call: &mut Call<F, R>) {
        if let Some(work) = call.work.take() {
            call.result = Some(catch_unwind(AssertUnwindSafe(work)));
        }
    }

    /// The bits of MXCSR: denormals are zero, flush to zero.
    const FLUSH: u32 = 1 << 6 | 1 << 15;

    fn enter<F: FnOnce() -> R, R>(call: &mut Call<F, R>) {
        let mut before = 0_u32;
        let mut during = 0_u32;
        // SAFETY: MXCSR is as before when the block ends, for `run` does not unwind; the stack is aligned for a call,
        // and `clobber_abi` names what a call changes. r12 and r13 are the callee's to keep.
        unsafe {
            asm!(
                "stmxcsr [r12]",
                "mov eax, [r12]",
                "or eax, {flush}",
                "mov [r13], eax",
                "ldmxcsr [r13]",
                "call {run}",
                "ldmxcsr [r12]",
                flush = const FLUSH,
                run = sym run::<F, R>,
                in("r12") &raw mut before,
                in("r13") &raw mut during,
                inout("rdi") std::ptr::from_mut(call) => _,
                clobber_abi("sysv64"),
            );
        }
    }

    let mut call = Call {
        work: Some(work),
        result: None,
    };
    enter(&mut call);
    match call.result {
        Some(Ok(result)) => result,
        Some(Err(panic)) => resume_unwind(panic),
        None => unreachable!("the call was made"),
    }
}

/// Runs `work` as it is: there is no such mode here.
#[cfg(not(target_arch = "x86_64"))]
pub fn flushed<R>(work: impl FnOnce() -> R) -> R {
    work()
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use std::hint::black_box;

    #[test]
    fn denormals_are_zero_within_and_not_after() {
        let half = || black_box(f32::MIN_POSITIVE) * black_box(0.5);
        let doubled = || black_box(f32::from_bits(1 << 22)) * black_box(4.0);
        assert!(half() > 0.0 && doubled() > 0.0);
        assert_eq!(flushed(|| (half(), doubled())), (0.0, 0.0));
        assert!(half() > 0.0 && doubled() > 0.0);
        assert!(std::panic::catch_unwind(|| flushed(|| panic!("out of it"))).is_err());
        assert!(half() > 0.0);
    }
}
