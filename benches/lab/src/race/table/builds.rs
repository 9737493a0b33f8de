//! How builders did.

use super::{Record, YARDSTICK, engines, find};
use crate::{
    race::builds::THREADS,
    stats::geometric_mean,
    text::{absent, align},
};

/// The table of one scene, of the `records` about building over it.
pub fn of_scene(records: &[Record]) -> String {
    let Some(first) = records.first() else {
        return String::new();
    };
    let mut rows = vec![header(["ms", "ns/tri", "bounce", "bytes/tri", "wrong"])];
    for engine in engines(records) {
        for (threads, workload) in THREADS {
            let Some(record) = find(records, engine, workload) else {
                continue;
            };
            let times = over_yardstick(records, record)
                .map_or_else(String::new, |times| format!(" ({times:.2})"));
            rows.push(vec![
                engine.to_owned(),
                threads.to_string(),
                format!("{:.1}", record.build_ms),
                format!("{:.0}", per_triangle(record)),
                format!("{:.2}{times}", record.mrays_per_s),
                format!("{:.1}", record.bytes_per_triangle),
                record.disagreements.to_string(),
            ]);
        }
    }
    format!(
        "{}: builds over {} triangles, wrong answers of {} sampled\n{}",
        first.scene,
        first.triangles,
        first.sample,
        align(&rows)
    )
}

/// The geometric means over all scenes, of the `records` about building. Empty where there are none.
pub fn means(records: &[Record]) -> String {
    if records.is_empty() {
        return String::new();
    }
    let mut rows = vec![header(["ns/tri", "bounce"])];
    for engine in engines(records) {
        for (threads, workload) in THREADS {
            let of_kind = || {
                let is = |r: &&Record| r.engine == engine && r.workload == workload;
                records.iter().filter(is)
            };
            let nanoseconds = geometric_mean(of_kind().map(per_triangle));
            let bounce = geometric_mean(of_kind().filter_map(|r| over_yardstick(records, r)));
            rows.push(vec![
                engine.to_owned(),
                threads.to_string(),
                nanoseconds.map_or_else(absent, |mean| format!("{mean:.0}")),
                bounce.map_or_else(absent, |mean| format!("{mean:.2}")),
            ]);
        }
    }
    format!(
        "\ngeometric means of builds, bounce over {YARDSTICK}\n{}",
        align(&rows)
    )
}

fn header<const N: usize>(more: [&str; N]) -> Vec<String> {
    let names = ["", "threads"].into_iter().chain(more);
    names.map(str::to_owned).collect()
}

fn per_triangle(record: &Record) -> f64 {
    record.build_ms * 1e6 / record.triangles as f64
}

/// How fast the tree's rays are against those of the yardstick's tree in that scene, built by one thread.
fn over_yardstick(records: &[Record], record: &Record) -> Option<f64> {
    let [(_, workload), _] = THREADS;
    let yardstick = records.iter().find(|other| {
        other.scene == record.scene && other.workload == workload && other.engine == YARDSTICK
    })?;
    Some(record.mrays_per_s / yardstick.mrays_per_s)
}

#[cfg(test)]
mod tests {
    use super::{super::record, *};

    #[test]
    fn threads_are_rows_and_ratios_are_over_one_thread() {
        let [(_, one), (_, two)] = THREADS;
        let records = [
            record("a", "wide-bvh 8", one, 4.0),
            record("a", "wide-bvh 8", two, 4.4),
            record("a", YARDSTICK, one, 2.0),
            record("a", YARDSTICK, two, 3.0),
        ];
        let table = of_scene(&records);
        let cells = |text: &str, row: usize| -> Vec<String> {
            let line = text.trim_start().lines().nth(row).unwrap();
            line.split_whitespace().map(str::to_owned).collect()
        };
        assert_eq!(
            cells(&table, 3).join(" "),
            "wide-bvh 8 2 3.4 283333 4.40 (2.20) 50.0 1"
        );
        assert_eq!(cells(&table, 5)[6..].join(" "), "(1.50) 50.0 1");
        assert_eq!(
            cells(&means(&records), 2).join(" "),
            "wide-bvh 8 1 283333 2.00"
        );
        assert!(means(&[]).is_empty());
    }
}
