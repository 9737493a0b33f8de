//! How long to measure.

use std::time::Duration;

/// How much to measure.
pub struct Effort {
    /// Rays of a workload.
    pub rays: usize,
    /// Timed rounds over them.
    pub rounds: usize,
    /// Triangle tests by brute force for a workload's sample: about a nanosecond each.
    pub tests: usize,
    /// Rays of a sample however many tests they take.
    pub least_sample: usize,
    /// How long builders take turns over a scene; they finish the round.
    pub builds: Duration,
    /// How long to wait for the core to be quiet, all in all.
    pub patience: Duration,
}

impl Effort {
    const FULL: Self = Self {
        rays: 1 << 18,
        rounds: 9,
        tests: 200_000_000,
        least_sample: 100,
        builds: Duration::from_secs(15),
        patience: Duration::from_secs(1200),
    };
    const QUICK: Self = Self {
        rays: 1 << 14,
        rounds: 7,
        tests: 20_000_000,
        least_sample: 10,
        builds: Duration::from_secs(1),
        patience: Duration::from_secs(10),
    };
}

/// The options for it.
#[derive(clap::Args)]
#[group(skip)]
pub struct Args {
    /// Few rays and rounds: minutes become seconds, and the figures rough. So few rays meet so little of a
    /// tree that it stays in the caches, which flatters the engines that need most of it
    #[arg(long)]
    quick: bool,
}

impl Args {
    /// How much that is.
    pub fn effort(&self) -> Effort {
        if self.quick {
            Effort::QUICK
        } else {
            Effort::FULL
        }
    }
}
