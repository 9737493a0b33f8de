//! How engines did.

use super::{Record, YARDSTICK, engines, find};
use crate::{
    engines::Takes,
    stats::geometric_mean,
    text::{absent, align},
    workloads,
};

/// The table of one scene, of the `records` about tracing it: engines that take one ray a call, then those that
/// take batches.
pub fn of_scene(records: &[Record]) -> String {
    let Some(first) = records.first() else {
        return String::new();
    };
    let mut rows = vec![header("one ray a call", ["build ms", "bytes/tri", "wrong"])];
    let [single, batches] = grouped(records);
    rows.extend(single.into_iter().map(|engine| row(records, engine)));
    if !batches.is_empty() {
        rows.push(vec!["batches".to_owned()]);
        rows.extend(batches.into_iter().map(|engine| row(records, engine)));
    }
    let sampled = per_workload(|workload| find(records, &first.engine, workload).map(|r| r.sample));
    format!(
        "{}: {} triangles, wrong answers of {sampled} sampled\n{}",
        first.scene,
        first.triangles,
        align(&rows)
    )
}

fn row(records: &[Record], engine: &str) -> Vec<String> {
    let of_engine = |workload: &str| find(records, engine, workload);
    let mut row = vec![engine.to_owned()];
    for workload in workloads::NAMES {
        row.push(of_engine(workload).map_or_else(absent, |record| {
            let times = find(records, YARDSTICK, workload).map_or_else(String::new, |yardstick| {
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
    row
}

/// The geometric means, over all scenes, of each engine's speed against the yardstick's, and against the best of
/// Embree's calls of its kind. Empty where the yardstick does not race.
pub fn means(records: &[Record]) -> String {
    if !engines(records).contains(&YARDSTICK) {
        return String::new();
    }
    let mut rows = vec![header("one ray a call", [])];
    let [single, batches] = grouped(records);
    rows.extend(single.into_iter().map(|engine| mean_row(records, engine)));
    if !batches.is_empty() {
        rows.push(vec!["batches".to_owned()]);
        rows.extend(batches.into_iter().map(|engine| mean_row(records, engine)));
    }
    format!(
        "\ngeometric means over {YARDSTICK}, and over the best of Embree's calls\n{}",
        align(&rows)
    )
}

fn mean_row(records: &[Record], engine: &str) -> Vec<String> {
    let mut row = vec![engine.to_owned()];
    for workload in workloads::NAMES {
        let own = || {
            let is = |r: &&Record| r.engine == engine && r.workload == workload;
            records.iter().filter(is)
        };
        let mean = |rival: &dyn Fn(&Record) -> Option<f64>| {
            geometric_mean(own().filter_map(|own| Some(own.mrays_per_s / rival(own)?)))
        };
        let over_yardstick = mean(&|own| {
            let is = |r: &&Record| r.engine == YARDSTICK && same_race(r, own);
            records.iter().find(is).map(|r| r.mrays_per_s)
        });
        let over_best = mean(&|own| {
            let is = |r: &&Record| may_be_best(r, own.takes) && same_race(r, own);
            let speeds = records.iter().filter(is).map(|r| r.mrays_per_s);
            speeds.max_by(f64::total_cmp)
        });
        row.push(match (over_yardstick, over_best) {
            (Some(yardstick), Some(best)) => format!("{yardstick:.2}, {best:.2}"),
            _ => absent(),
        });
    }
    row
}

fn same_race(a: &Record, b: &Record) -> bool {
    a.scene == b.scene && a.workload == b.workload
}

/// Whether an engine that `takes` rays so is held to this one.
fn may_be_best(record: &Record, takes: Takes) -> bool {
    let of_embree = record.engine.starts_with("embree ") && !record.engine.contains("robust");
    of_embree && (takes == Takes::Batches || record.takes == Takes::OneRay)
}

/// The names of those that take one ray, and of those that take batches.
fn grouped<'a>(records: impl IntoIterator<Item = &'a Record>) -> [Vec<&'a str>; 2] {
    let (single, batches): (Vec<_>, Vec<_>) = records
        .into_iter()
        .partition(|record| record.takes == Takes::OneRay);
    [engines(single), engines(batches)]
}

fn header<const N: usize>(first: &str, more: [&str; N]) -> Vec<String> {
    let names = workloads::NAMES.iter().chain(&more);
    std::iter::once(first)
        .chain(names.copied())
        .map(str::to_owned)
        .collect()
}

/// A count for each workload, with a slash between.
fn per_workload(count: impl Fn(&str) -> Option<usize>) -> String {
    workloads::NAMES
        .map(|workload| count(workload).map_or_else(absent, |count| count.to_string()))
        .join("/")
}

#[cfg(test)]
mod tests {
    use super::{
        super::{OURS, record},
        *,
    };

    fn row_of(table: &str, engine: &str) -> String {
        let row = table.lines().find(|line| line.starts_with(engine)).unwrap();
        row.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_row_holds_the_figures_and_their_ratios() {
        let records = [
            record("cube", "wide-bvh 8 avx2", "primary", 3.0),
            record("cube", YARDSTICK, "primary", 2.0),
        ];
        let table = of_scene(&records);
        assert_eq!(
            row_of(&table, OURS),
            "wide-bvh 8 avx2 3.00 (1.50) - - - 3 50.0 1/-/-/-"
        );
        assert!(table.starts_with("cube: 12 triangles"));
        assert!(!table.contains("batches"));
    }

    #[test]
    fn means_are_geometric_and_over_scenes() {
        let records = [
            record("a", "wide-bvh 8 avx2", "bounce", 1.0),
            record("a", YARDSTICK, "bounce", 2.0),
            record("b", "wide-bvh 8 avx2", "bounce", 8.0),
            record("b", YARDSTICK, "bounce", 1.0),
        ];
        assert_eq!(
            row_of(&means(&records), OURS),
            "wide-bvh 8 avx2 - 2.00, 2.00 - -"
        );
        assert!(means(&records[..1]).is_empty());
    }

    #[test]
    fn the_best_is_of_each_scene_and_of_the_kind() {
        let batch = |record| Record {
            takes: Takes::Batches,
            ..record
        };
        let records = [
            record("a", "wide-bvh 8 avx2", "bounce", 4.0),
            batch(record("a", "wide-bvh 8 avx2 batch", "bounce", 4.0)),
            record("a", YARDSTICK, "bounce", 2.0),
            record("a", "embree MEDIUM", "bounce", 4.0),
            record("a", "embree HIGH robust", "bounce", 100.0),
            batch(record("a", "embree HIGH 8", "bounce", 16.0)),
            record("b", "wide-bvh 8 avx2", "bounce", 1.0),
            batch(record("b", "wide-bvh 8 avx2 batch", "bounce", 4.0)),
            record("b", YARDSTICK, "bounce", 4.0),
            batch(record("b", "embree HIGH 8", "bounce", 1.0)),
        ];
        let means = means(&records);
        // Roots of 1 by 1/4, and of 1/4 by 1.
        assert_eq!(
            row_of(&means, "wide-bvh 8 avx2 batch"),
            "wide-bvh 8 avx2 batch - 1.41, 0.50 - -"
        );
        assert_eq!(row_of(&means, OURS), "wide-bvh 8 avx2 - 0.71, 0.50 - -");
        let batches = means.find("\nbatches").unwrap();
        assert!(batches > means.find("embree MEDIUM").unwrap());
        assert!(batches < means.find("embree HIGH 8").unwrap());
    }
}
