//! Builders.

use crate::Float;
use arbitrary::Arbitrary;
use core::{
    ops::ControlFlow,
    sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed},
};
use wide_bvh::build::{Builder, Monitor, Preset};

/// All that can be set of a builder but its monitor.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub struct Settings {
    preset: u8,
    pub drop_non_finite: bool,
    splits: Option<Splits>,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Splits {
    /// In tenths: so many that there are some.
    Some(u8),
    Any(Float),
}

impl Settings {
    pub fn builder<'m>(&self) -> Builder<'m> {
        let preset = [Preset::Best, Preset::Balanced, Preset::Fast];
        let builder = Builder::new().preset(preset[usize::from(self.preset % 3)]);
        let builder = builder.drop_non_finite(self.drop_non_finite);
        match self.splits {
            None => builder,
            Some(Splits::Some(tenths)) => builder.splits(f32::from(tenths) / 10.0),
            Some(Splits::Any(Float(fraction))) => builder.splits(fraction),
        }
    }
}

/// A monitor that stops a build after so many calls, if any; it looks at what it is told.
#[derive(Debug)]
pub struct Cancel {
    after: Option<u32>,
    calls: AtomicU32,
    /// The bits of what was told last; floats of no sign are in the order of their bits.
    told: AtomicU32,
    cancelled: AtomicBool,
}

impl Cancel {
    pub fn after(calls: Option<u8>) -> Self {
        Self {
            after: calls.map(u32::from),
            calls: AtomicU32::new(0),
            told: AtomicU32::new(0),
            cancelled: AtomicBool::new(false),
        }
    }

    /// Another build begins.
    pub fn begin(&self) {
        self.told.store(0, Relaxed);
    }

    /// Whether it has said to stop.
    pub fn has_cancelled(&self) -> bool {
        self.cancelled.load(Relaxed)
    }
}

impl Monitor for Cancel {
    fn progress(&self, fraction: f32) -> ControlFlow<()> {
        assert!((0.0..=1.0).contains(&fraction), "told {fraction}");
        let told = self.told.swap(fraction.to_bits(), Relaxed);
        assert!(told <= fraction.to_bits(), "told less than before");
        let call = self.calls.fetch_add(1, Relaxed);
        if self.after.is_some_and(|after| call >= after) {
            self.cancelled.store(true, Relaxed);
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }
}
