//! Whether the core is ours alone.
//!
//! On a rented machine another's program may run on the core's other thread, for seconds at a time. What keeps a core's units
//! busy slows down more then than what waits for its own results, so figures of two such times do not compare. Quiet
//! is as good as it has been: a core that was shared from the beginning is not told from a slow one.

use crate::stats::median;
use std::{
    hint::black_box,
    time::{Duration, Instant},
};

/// So much more than the least time seen is a disturbance.
const MORE: f64 = 1.25;

/// With fewer undisturbed turns than this all count.
const LEAST_TURNS: usize = 3;

/// Times things while nothing else is on the core, as far as it has the patience.
pub struct Quiet {
    /// What [`pace`] has taken at least.
    least: Duration,
    /// For how long to wait, all in all.
    patience: Duration,
    turns: usize,
    disturbed: usize,
}

/// How long something took.
pub struct Turn {
    seconds: f64,
    quiet: bool,
}

impl Quiet {
    pub fn new(patience: Duration) -> Self {
        Self {
            least: Duration::MAX,
            patience,
            turns: 0,
            disturbed: 0,
        }
    }

    /// Times something once the core is quiet, or patience is at an end. Not again where it did not stay so: what was done
    /// just before is in the caches.
    pub fn time(&mut self, run: impl FnOnce()) -> Turn {
        let start = Instant::now();
        let mut quiet = self.is_quiet();
        while !quiet && start.elapsed() < self.patience {
            quiet = self.is_quiet();
        }
        self.patience = self.patience.saturating_sub(start.elapsed());
        let start = Instant::now();
        run();
        let seconds = start.elapsed().as_secs_f64();
        quiet &= self.is_quiet();
        self.turns += 1;
        self.disturbed += usize::from(!quiet);
        Turn { seconds, quiet }
    }

    /// For now.
    fn is_quiet(&mut self) -> bool {
        let pace = pace();
        self.least = self.least.min(pace);
        pace <= self.least.mul_f64(MORE)
    }

    /// How many turns there were, and how many of them were disturbed.
    pub fn turns(&self) -> (usize, usize) {
        (self.turns, self.disturbed)
    }
}

/// The median of undisturbed turns, if there are at least [`LEAST_TURNS`], else of all, in seconds.
///
/// # Panics
/// Without turns.
pub fn median_seconds(turns: &[Turn]) -> f64 {
    let quiet = turns.iter().filter(|turn| turn.quiet);
    let quiet: Vec<f64> = quiet.map(|turn| turn.seconds).collect();
    median(if quiet.len() >= LEAST_TURNS {
        quiet
    } else {
        turns.iter().map(|turn| turn.seconds).collect()
    })
}

/// How long a little work takes that keeps the units for integers busy and touches no memory.
fn pace() -> Duration {
    let start = Instant::now();
    let mut numbers = black_box([1u64, 2, 3, 4]);
    for _ in 0..20_000 {
        for x in &mut numbers {
            *x ^= *x << 13;
            *x ^= *x >> 7;
            *x ^= *x << 17;
        }
    }
    black_box(numbers);
    start.elapsed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_that_is_never_quiet_is_waited_for_but_not_forever() {
        let mut quiet = Quiet::new(Duration::from_millis(20));
        quiet.least = Duration::ZERO;
        let (start, mut runs) = (Instant::now(), 0);
        let turns: Vec<_> = (0..5).map(|_| quiet.time(|| runs += 1)).collect();
        let all = start.elapsed();
        assert!(all >= Duration::from_millis(20));
        assert_eq!((runs, quiet.turns()), (5, (5, 5)));
        assert!(turns.iter().all(|turn| !turn.quiet));
        // What was waited for is no part of them, however slow the machine is.
        let timed: f64 = turns.iter().map(|turn| turn.seconds).sum();
        assert!(timed + 0.02 <= all.as_secs_f64(), "{timed} of {all:?}");
    }

    #[test]
    fn undisturbed_turns_count_if_there_are_some() {
        let turn = |(seconds, quiet)| Turn { seconds, quiet };
        let median = |turns: &[(f64, bool)]| {
            median_seconds(&turns.iter().copied().map(turn).collect::<Vec<_>>())
        };
        let mut turns = [
            (9.0, false),
            (1.0, true),
            (2.0, true),
            (8.0, false),
            (7.0, false),
        ];
        assert_eq!(median(&turns), 7.0);
        turns[4] = (3.0, true);
        assert_eq!(median(&turns), 2.0);
    }
}
