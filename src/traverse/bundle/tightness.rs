//! How far the rays of bundles keep together.

/// A bundle is loose if fewer rays, in eighths, pass a box for each test of a packet of eight: of those that are tested at
/// once hardly one goes on.
const LEAST_PASSES: usize = 9;
/// Bundles on the whole are, if fewer do.
const LEAST_PASSES_ON_THE_WHOLE: usize = 14;
/// From so many tests on the older ones count less and less.
const MANY: usize = 1 << 12;
/// Parts that a test of a packet of eight is counted in.
const PARTS: usize = 4;

/// How many parts a test of a packet is: 4 of eight rays, 7 of sixteen. With as many as 8 bundles are given up that are
/// worth it, with 6 others are not.
const fn parts(lanes: usize) -> usize {
    PARTS * (3 * lanes + 8) / 32
}

/// What tests of boxes have come to, of one bundle or of some.
#[derive(Clone, Copy, Default)]
pub(in crate::traverse) struct Tightness {
    /// How many boxes packets were tested against, in [parts](PARTS).
    tests: usize,
    /// How many boxes of those each ray passed, in all.
    passes: usize,
}

impl Tightness {
    /// How many boxes packets were tested against, as if they all were of eight.
    #[inline(always)]
    pub(super) fn tests(self) -> usize {
        self.tests / PARTS
    }

    /// Adds tests of packets of so many rays.
    #[inline(always)]
    pub(super) fn add<const LANES: usize>(&mut self, tests: u32, passes: u32) {
        self.tests += tests as usize * parts(LANES);
        self.passes += passes as usize;
    }

    /// With another bundle's, after these.
    #[inline(always)]
    pub(super) fn with(mut self, other: Self) -> Self {
        if self.tests() > MANY {
            self.tests /= 2;
            self.passes /= 2;
        }
        self.tests += other.tests;
        self.passes += other.passes;
        self
    }

    /// Of one bundle.
    #[inline(always)]
    pub(super) fn is_loose(self) -> bool {
        self.is_below(LEAST_PASSES)
    }

    /// Of many.
    #[inline(always)]
    pub(super) fn is_loose_on_the_whole(self) -> bool {
        self.is_below(LEAST_PASSES_ON_THE_WHOLE)
    }

    #[inline(always)]
    fn is_below(self, eighths: usize) -> bool {
        8 * PARTS * self.passes < eighths * self.tests
    }
}
