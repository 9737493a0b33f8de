//! Telling a caller how far a build has got, and being told to stop.

use super::BuildError;
use core::{
    fmt,
    ops::ControlFlow,
    sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed},
};
use std::sync::Mutex;

/// Who is told how far a build has got, and may stop it: a closure will do. See
/// [`Builder::monitor`](super::Builder::monitor).
pub trait Monitor: Sync {
    /// The build has done about this share of its work, in 0 to 1, never less than it said before.
    ///
    /// Called from one thread at a time, every few milliseconds or more often. With feature `rayon` it may be
    /// any thread.
    /// The last is 1. [`ControlFlow::Break`] has the build end with [`BuildError::Cancelled`], at any time.
    fn progress(&self, fraction: f32) -> ControlFlow<()>;
}

impl<F: Fn(f32) -> ControlFlow<()> + Sync> Monitor for F {
    fn progress(&self, fraction: f32) -> ControlFlow<()> {
        self(fraction)
    }
}

/// A monitor, if there is one, as a builder keeps it.
#[derive(Clone, Copy, Default)]
pub(super) struct Monitored<'m>(pub Option<&'m dyn Monitor>);

impl fmt::Debug for Monitored<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Some" } else { "None" })
    }
}

/// A monitor is told every so many units of work, primitives or nodes: after some 100 µs.
pub(super) const STRIDE: usize = 1 << 10;

/// One build's progress. Its phases share the way from 0 to 1; each counts its own units of work.
pub(super) struct Watch<'m> {
    monitor: Option<&'m dyn Monitor>,
    cancelled: AtomicBool,
    /// Units done of the phase.
    done: AtomicUsize,
    phase: Mutex<Phase>,
}

struct Phase {
    start: f32,
    end: f32,
    units: usize,
    /// What was told last.
    told: f32,
}

impl<'m> Watch<'m> {
    pub fn new(monitored: Monitored<'m>) -> Self {
        Self {
            monitor: monitored.0,
            cancelled: AtomicBool::new(false),
            done: AtomicUsize::new(0),
            phase: Mutex::new(Phase {
                start: 0.0,
                end: 0.0,
                units: 0,
                told: 0.0,
            }),
        }
    }

    /// Nobody's.
    #[cfg(test)]
    pub fn none() -> Self {
        Self::new(Monitored(None))
    }

    /// Begins the phase that goes from where the last one ended up to `end`, in so many units.
    ///
    /// # Errors
    /// The build was cancelled.
    pub fn phase(&self, end: f32, units: usize) -> Result<(), BuildError> {
        if self.monitor.is_none() {
            return Ok(());
        }
        if let Ok(mut phase) = self.phase.lock() {
            phase.start = phase.end;
            phase.end = end.max(phase.start);
            phase.units = units.max(1);
            self.done.store(0, Relaxed);
        }
        self.advance(0);
        self.check()
    }

    /// Everything is done.
    ///
    /// # Errors
    /// The build was cancelled, right at the end.
    pub fn finish(&self) -> Result<(), BuildError> {
        if let Ok(mut phase) = self.phase.lock() {
            phase.end = 1.0;
        }
        self.phase(1.0, 1)
    }

    /// Notes that so many units more are done; none is a sign of life. Whether to go on: what is left undone for it is
    /// looked at by nobody.
    #[inline]
    pub fn advance(&self, units: usize) -> bool {
        match self.monitor {
            Some(monitor) => self.tell(monitor, units),
            None => true,
        }
    }

    #[cold]
    fn tell(&self, monitor: &dyn Monitor, units: usize) -> bool {
        let done = self.done.fetch_add(units, Relaxed) + units;
        if self.cancelled.load(Relaxed) {
            return false;
        }
        if units > 0 && done / STRIDE == (done - units) / STRIDE {
            return true;
        }
        // If another thread is telling, that is news enough.
        if let Ok(mut phase) = self.phase.try_lock() {
            let share = (done as f64 / phase.units as f64).min(1.0) as f32;
            let fraction = phase.start + (phase.end - phase.start) * share;
            phase.told = fraction.clamp(phase.told, 1.0);
            if monitor.progress(phase.told).is_break() {
                self.cancelled.store(true, Relaxed);
            }
        }
        !self.cancelled.load(Relaxed)
    }

    /// # Errors
    /// The build was cancelled.
    pub fn check(&self) -> Result<(), BuildError> {
        match self.cancelled.load(Relaxed) {
            true => Err(BuildError::Cancelled),
            false => Ok(()),
        }
    }
}
