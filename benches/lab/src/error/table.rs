//! The figures as text for a terminal.

use super::{record::Figures, statistics::Spread};
use crate::text::align;

/// What the columns mean.
pub const LEGEND: &str = "\
ns: nanoseconds a ray, in the quickest of the rounds; over several scenes their geometric mean. One thread.
lost: the exact answer hits, the variant misses or names something behind. phantom: it hits what is not there.
edge: further ones, where an outline passes the ray closer than what rounding a triangle to the ray comes to, 6e-7 of
  its distance: float tests may decide either way. other: another triangle than the first, at the same distance.
leaks: rays from inside a closed mesh that hit nothing.
t ulp, t rel, uv: errors of right answers: median / 99.9th percentile / worst.
slab …, triangle …: one traversal of the lab's own, over wide-bvh's tree, that differs in this test alone; comparable
  among themselves. Their other test is Woop's with its f64 step, or this crate's slab with fma.";

/// The table of one set of rays.
pub fn of_set(set: &str, rows: &[(String, Figures)]) -> String {
    let Some((_, first)) = rows.first() else {
        return String::new();
    };
    let has_leaks = first.leaks.is_some();
    let mut header = vec!["", "ns", "lost", "edge", "phantom", "edge", "other"];
    header.extend(has_leaks.then_some("leaks"));
    header.extend(["t ulp", "t rel", "uv"]);
    let mut cells = vec![header.into_iter().map(str::to_owned).collect()];
    for (variant, figures) in rows {
        let counts = &figures.counts;
        let mut row = vec![variant.clone(), format!("{:.0}", figures.ns_per_ray)];
        row.extend(
            [
                counts.lost,
                counts.lost_at_edge,
                counts.phantoms,
                counts.phantoms_at_edge,
                counts.other_triangle,
            ]
            .map(|count| count.to_string()),
        );
        if has_leaks {
            row.push(figures.leaks.map_or_else(absent, |leaks| leaks.to_string()));
        }
        row.push(figures.t_ulps.map_or_else(absent, ulps));
        row.extend([figures.t_relative, figures.weights].map(|s| s.map_or_else(absent, powers)));
        cells.push(row);
    }
    format!("{set}: {} rays\n{}", first.counts.rays, align(&cells))
}

/// Where there is no figure.
fn absent() -> String {
    "-".to_owned()
}

fn ulps(spread: Spread) -> String {
    let number = |x: f64| {
        if x < 1e4 {
            format!("{x:.1}")
        } else {
            format!("{x:.0e}")
        }
    };
    slashed(spread, number)
}

fn powers(spread: Spread) -> String {
    slashed(spread, |x| format!("{x:.0e}"))
}

fn slashed(spread: Spread, number: impl Fn(f64) -> String) -> String {
    [spread.median, spread.p99_9, spread.worst]
        .map(number)
        .join(" / ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::judge::Counts;

    #[test]
    fn a_row_holds_the_figures() {
        let figures = Figures {
            ns_per_ray: 123.4,
            counts: Counts {
                rays: 9,
                lost: 1,
                lost_at_edge: 2,
                phantoms: 3,
                phantoms_at_edge: 4,
                other_triangle: 5,
            },
            leaks: Some(6),
            t_ulps: Some(Spread {
                median: 0.25,
                p99_9: 3.0,
                worst: 2e5,
            }),
            t_relative: None,
            weights: Some(Spread {
                median: 0.0,
                p99_9: 1e-6,
                worst: 0.5,
            }),
        };
        let table = of_set("from inside", &[("a variant".to_owned(), figures)]);
        let row = table.lines().last().unwrap();
        let cells: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(
            cells.join(" "),
            "a variant 123 1 2 3 4 5 6 0.2 / 3.0 / 2e5 - 0e0 / 1e-6 / 5e-1"
        );
        assert!(table.starts_with("from inside: 9 rays\n"));
    }
}
