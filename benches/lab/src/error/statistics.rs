//! Numbers about numbers: quantiles, means, the Pareto front.

use serde::Serialize;

/// How errors are spread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    pub median: f64,
    /// The 99.9th percentile.
    pub p99_9: f64,
    pub worst: f64,
}

impl Spread {
    /// Of `errors`, which are reordered. `None` if there are none.
    pub fn of(errors: &mut [f32]) -> Option<Self> {
        let at = |errors: &mut [f32], part| quantile(errors, part).map(f64::from);
        Some(Self {
            median: at(errors, 0.5)?,
            p99_9: at(errors, 0.999)?,
            worst: at(errors, 1.0)?,
        })
    }
}

/// The least value that at least this part of all values are not above. Reorders the values; a NaN counts as
/// above all others.
pub fn quantile(values: &mut [f32], part: f64) -> Option<f32> {
    let rank = (part * values.len() as f64).ceil() as usize;
    let place = rank.clamp(1, values.len().max(1)) - 1;
    if values.is_empty() {
        return None;
    }
    Some(*values.select_nth_unstable_by(place, f32::total_cmp).1)
}

/// `None` without values.
pub fn geometric_mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for value in values {
        sum += value.ln();
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)).exp())
}

/// Which points no other beats: none is as good in both coordinates and better in one. Less is better. By ascending
/// first coordinate.
pub fn pareto_front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        let [a, b] = [points[a], points[b]];
        a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
    });
    let mut front: Vec<usize> = Vec::new();
    for point in order {
        let beaten = |&last: &usize| {
            points[last][1] < points[point][1]
                || points[last][1] == points[point][1] && points[last][0] < points[point][0]
        };
        if !front.last().is_some_and(beaten) {
            front.push(point);
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_by_rank() {
        let mut values: Vec<f32> = (1..=1000).rev().map(|i| i as f32).collect();
        assert_eq!(quantile(&mut values, 0.5), Some(500.0));
        assert_eq!(quantile(&mut values, 0.999), Some(999.0));
        assert_eq!(quantile(&mut values, 1.0), Some(1000.0));
        assert_eq!(quantile(&mut values, 0.0), Some(1.0));
        assert_eq!(quantile(&mut [3.0], 0.999), Some(3.0));
        assert_eq!(quantile(&mut [], 0.5), None);
        let spread = Spread::of(&mut [2.0, 1.0, f32::INFINITY, 0.0]).unwrap();
        assert_eq!((spread.median, spread.worst), (1.0, f64::INFINITY));
    }

    #[test]
    fn the_mean_is_geometric() {
        assert_eq!(geometric_mean([]), None);
        assert!((geometric_mean([1.0, 4.0, 2.0]).unwrap() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_front_is_what_nothing_beats() {
        // Fast and wrong, slower and better, slower and worse, slow and right, as slow and right, slowest and right.
        let points = [
            [4.0, 0.0],
            [1.0, 9.0],
            [2.0, 3.0],
            [3.0, 5.0],
            [4.0, 0.0],
            [5.0, 0.0],
        ];
        assert_eq!(pareto_front(&points), [1, 2, 0, 4]);
        assert_eq!(pareto_front(&[]), [0; 0]);
        assert_eq!(pareto_front(&[[1.0, 0.0]]), [0]);
    }
}
