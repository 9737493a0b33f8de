//! The race's figures as text for a terminal.

use super::{record::Record, workloads};
use crate::reference::TOLERANCE;
use std::fmt::Write;

/// The engine that others are measured by.
const YARDSTICK: &str = "embree HIGH";

/// How this crate's engines are told from others.
const OURS: &str = "wide-bvh ";

/// What the columns mean.
pub fn legend() -> String {
    format!(
        "\
Figures: million rays a second, the median of the rounds; one thread. In brackets: times {YARDSTICK}.
Build: by one thread. Bytes a triangle: what is kept besides the vertex and index buffers.
Wrong: of a sample of the rays ({}), those answered otherwise than by brute force.
For {OURS}engines one bit of t, u, v or the triangle's number is enough; for others, a hit for a miss
or the reverse, or another triangle with t off by more than {TOLERANCE:e} of it.",
        workloads::NAMES.join("/"),
    )
}

/// The table of one scene, of the `records` about it.
pub fn of_scene(records: &[Record]) -> String {
    let Some(first) = records.first() else {
        return String::new();
    };
    let mut rows = vec![header(["build ms", "bytes/tri", "wrong"])];
    for engine in engines(records) {
        let of_engine = |workload: &str| find(records, engine, workload);
        let mut row = vec![engine.to_owned()];
        for workload in workloads::NAMES {
            row.push(of_engine(workload).map_or_else(absent, |record| {
                let times = find(records, YARDSTICK, workload)
                    .map_or_else(String::new, |yardstick| {
                        format!(" ({:.2})", record.mrays_per_s / yardstick.mrays_per_s)
                    });
                format!("{:.2}{times}", record.mrays_per_s)
            }));
        }
        if let Some(record) = records.iter().find(|record| record.engine == engine) {
            row.push(format!("{:.0}", record.build_ms));
            row.push(format!("{:.1}", record.bytes_per_triangle));
        }
        row.push(per_workload(|workload| {
            of_engine(workload).map(|record| record.disagreements)
        }));
        rows.push(row);
    }
    let sampled = per_workload(|workload| find(records, &first.engine, workload).map(|r| r.sample));
    format!(
        "{}: {} triangles, wrong answers of {sampled} sampled\n{}",
        first.scene,
        first.triangles,
        align(&rows)
    )
}

/// The geometric mean, over all scenes, of each of this crate's engines' speed against the yardstick's.
/// Empty where that does not race.
pub fn means(records: &[Record]) -> String {
    if !engines(records).contains(&YARDSTICK) {
        return String::new();
    }
    let mut rows = vec![header([])];
    for engine in engines(records)
        .into_iter()
        .filter(|engine| engine.starts_with(OURS))
    {
        let mut row = vec![engine.to_owned()];
        for workload in workloads::NAMES {
            let of = |name: &str| -> Vec<&Record> {
                let is = |r: &&Record| r.engine == name && r.workload == workload;
                records.iter().filter(is).collect()
            };
            let ratios = of(engine)
                .into_iter()
                .zip(of(YARDSTICK))
                .map(|(ours, yardstick)| ours.mrays_per_s / yardstick.mrays_per_s);
            row.push(geometric_mean(ratios).map_or_else(absent, |mean| format!("{mean:.2}")));
        }
        rows.push(row);
    }
    format!("\ngeometric means over {YARDSTICK}\n{}", align(&rows))
}

fn header<const N: usize>(more: [&str; N]) -> Vec<String> {
    let names = workloads::NAMES.iter().chain(&more);
    std::iter::once("")
        .chain(names.copied())
        .map(str::to_owned)
        .collect()
}

/// Every engine's name, in the order of the race.
fn engines(records: &[Record]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for record in records {
        if !names.contains(&record.engine.as_str()) {
            names.push(&record.engine);
        }
    }
    names
}

fn find<'a>(records: &'a [Record], engine: &str, workload: &str) -> Option<&'a Record> {
    let is = |record: &&Record| record.engine == engine && record.workload == workload;
    records.iter().find(is)
}

/// Where there is no figure.
fn absent() -> String {
    "-".to_owned()
}

/// A count for each workload, with a slash between.
fn per_workload(count: impl Fn(&str) -> Option<usize>) -> String {
    workloads::NAMES
        .map(|workload| count(workload).map_or_else(absent, |count| count.to_string()))
        .join("/")
}

/// `None` without values.
fn geometric_mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| {
        (sum + value.ln(), count + 1)
    });
    (count > 0).then(|| (sum / f64::from(count)).exp())
}

/// Columns as wide as their widest cell; the first to the left, the others to the right.
pub fn align(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns)
        .map(|column| {
            let cells = rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        })
        .collect();
    let mut text = String::new();
    for row in rows {
        for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let outcome = if column == 0 {
                write!(text, "{cell:<width$}")
            } else {
                write!(text, "  {cell:>width$}")
            };
            outcome.expect("a string takes all text");
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(scene: &str, engine: &str, workload: &'static str, mrays_per_s: f64) -> Record {
        Record {
            scene: scene.to_owned(),
            triangles: 12,
            workload,
            engine: engine.to_owned(),
            mrays_per_s,
            build_ms: 3.4,
            bytes_per_triangle: 50.0,
            sample: 9,
            disagreements: 1,
        }
    }

    #[test]
    fn a_row_holds_the_figures_and_their_ratios() {
        let records = [
            record("cube", "wide-bvh 8 avx2", "primary", 3.0),
            record("cube", YARDSTICK, "primary", 2.0),
        ];
        let table = of_scene(&records);
        let row = table.lines().find(|line| line.starts_with(OURS)).unwrap();
        let cells: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(
            cells.join(" "),
            "wide-bvh 8 avx2 3.00 (1.50) - - - 3 50.0 1/-/-/-"
        );
        assert!(table.starts_with("cube: 12 triangles"));
    }

    #[test]
    fn means_are_geometric_and_over_scenes() {
        let records = [
            record("a", "wide-bvh 8 avx2", "bounce", 1.0),
            record("a", YARDSTICK, "bounce", 2.0),
            record("b", "wide-bvh 8 avx2", "bounce", 8.0),
            record("b", YARDSTICK, "bounce", 1.0),
        ];
        let means = means(&records);
        let row = means.lines().find(|line| line.starts_with(OURS)).unwrap();
        let cells: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(cells.join(" "), "wide-bvh 8 avx2 - 2.00 - -");
        assert!(!means.contains("\nembree"));
        assert!(super::means(&records[..1]).is_empty());
    }
}
