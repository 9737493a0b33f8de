//! How far the rays of bundles keep together.

/// A bundle is loose if fewer rays, in eighths, pass a box for each test of a packet: of the eight or sixteen that are tested
/// at once hardly one goes on.
const LEAST_PASSES: usize = 9;
/// Bundles on the whole are, if fewer do.
const LEAST_PASSES_ON_THE_WHOLE: usize = 14;
/// From so many tests on the older ones count less and less.
const MANY: usize = 1 << 12;

/// What tests of boxes have come to, of one bundle or of some.
#[derive(Clone, Copy, Default)]
pub(in crate::traverse) struct Tightness {
    /// How many boxes packets were tested against.
    tests: usize,
    /// How many boxes of those each ray passed, in all.
    passes: usize,
}

impl Tightness {
    #[inline(always)]
    pub(super) fn tests(self) -> usize {
        self.tests
    }

    #[inline(always)]
    pub(super) fn add(&mut self, tests: usize, passes: usize) {
        self.tests += tests;
        self.passes += passes;
    }

    /// With another bundle's, after these.
    #[inline(always)]
    pub(super) fn with(mut self, other: Self) -> Self {
        if self.tests > MANY {
            self.tests /= 2;
            self.passes /= 2;
        }
        self.add(other.tests, other.passes);
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
        8 * self.passes < eighths * self.tests
    }
}
