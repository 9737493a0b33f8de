//! Logarithmic axes: of time, and of errors with a line for zero.

use super::Dot;
use plotters::{
    coord::ranged1d::{DefaultFormatting, KeyPointHint},
    prelude::*,
};
use std::ops::Range;

/// An axis of decimal logarithms, labelled where we say.
pub struct Axis {
    pub range: Range<f64>,
    pub keys: Vec<f64>,
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let part = (value - self.range.start) / (self.range.end - self.range.start);
        from + (part * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.keys.clone()
        }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

/// The axis of time: labelled at 1, 2 and 5 times powers of ten.
pub fn time_axis(dots: &[Dot]) -> Axis {
    let (least, most) = extent(dots.iter().map(|dot| dot.time));
    let (least, most) = ((least * 0.8).log10(), (most * 1.25).log10());
    let keys = (0..8).flat_map(|power| [1.0, 2.0, 5.0].map(|x: f64| x.log10() + f64::from(power)));
    Axis {
        keys: keys.filter(|key| (least..most).contains(key)).collect(),
        range: least..most,
    }
}

fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, 0.0), |(least, most), value| {
        (value.min(least), value.max(most))
    })
}

/// Where errors are drawn.
pub struct ErrorScale {
    range: Range<f64>,
    keys: Vec<f64>,
    /// The line of zero, if a variant is on it.
    pub zero: Option<f64>,
}

impl ErrorScale {
    pub fn new(dots: &[Dot]) -> Self {
        let (least, most) = extent(dots.iter().map(|dot| dot.error).filter(|&e| e > 0.0));
        let (least, most) = if least > most {
            (1.0, 1.0)
        } else {
            (least, most)
        };
        let (least, most) = (least.log10().floor(), most.log10());
        let mut keys: Vec<f64> = (least as i32..=most as i32).map(f64::from).collect();
        let has_zero = dots.iter().any(|dot| dot.error == 0.0);
        let zero = has_zero.then_some(least - 0.9);
        keys.extend(zero);
        let span = (most - least).max(1.0);
        // Below zero there is room for the labels of those that are on its line.
        let low = zero.map_or(least.min(most - 1.0), |zero| zero - 0.2 * span - 0.4);
        Self {
            range: low..most + 0.12 * span,
            keys,
            zero,
        }
    }

    /// The axis.
    pub fn axis(&self) -> Axis {
        Axis {
            range: self.range.clone(),
            keys: self.keys.clone(),
        }
    }

    /// Where an error is on the axis.
    pub fn y(&self, error: f64) -> f64 {
        match self.zero {
            Some(zero) if error == 0.0 => zero,
            _ => error.log10(),
        }
    }
}

/// A logarithm's number written out.
pub fn plain(log: f64) -> String {
    let number = 10_f64.powf(log);
    if number < 0.999 {
        format!("{number:.*}", (-log).ceil() as usize)
    } else if number < 999.0 {
        format!("{number:.0}")
    } else {
        format!("{:.0},000", number / 1e3)
    }
}

/// A logarithm's number as a power of ten.
pub fn power(log: f64) -> String {
    format!("1e{log:.0}")
}
