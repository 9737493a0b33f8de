//! The limits as text for a terminal.

use super::Record;
use crate::{stats::geometric_mean, text::align};

const HEADER: [&str; 9] = [
    "scene", "rays", "ns/ray", "nodes", "leaves", "ns/node", "ns/leaf", "floor ns", "of time",
];

/// A row for each of `records`, and what the columns mean.
pub fn of(records: &[Record]) -> String {
    let Some(first) = records.first() else {
        return String::new();
    };
    let mut rows = vec![HEADER.map(str::to_owned).to_vec()];
    rows.extend(records.iter().map(|record| {
        vec![
            record.scene.clone(),
            record.workload.to_owned(),
            format!("{:.0}", record.ns_per_ray),
            format!("{:.1}", record.nodes_per_ray),
            format!("{:.1}", record.leaves_per_ray),
            format!("{:.2}", record.ns_per_node),
            format!("{:.2}", record.ns_per_leaf),
            format!("{:.0}", record.floor()),
            percent(share(record)),
        ]
    }));
    let mean = geometric_mean(records.iter().map(share)).unwrap_or(0.0);
    let setup = geometric_mean(records.iter().map(|r| r.ns_of_setup.max(0.1))).unwrap_or(0.0);
    format!(
        "{}
Single rays, one thread, 8-wide nodes, {}. Nodes and leaves: tested by a ray. Nanoseconds of a node and
a leaf: of the test alone, at full throughput out of the first-level cache. Floor: nodes and leaves of a
ray by these. Of time: the floor over what a ray takes; geometric mean {}.
Setting up a ray takes another {setup:.0} ns; it is in the time and not in the floor.
",
        align(&rows),
        first.backend,
        percent(mean)
    )
}

fn share(record: &Record) -> f64 {
    record.floor() / record.ns_per_ray
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_is_a_share_of_the_time() {
        let record = Record {
            scene: "cube".into(),
            triangles: 12,
            workload: "bounce",
            backend: "avx2",
            ns_per_ray: 100.0,
            nodes_per_ray: 6.0,
            leaves_per_ray: 2.0,
            ns_per_node: 2.5,
            ns_per_leaf: 5.0,
            ns_of_setup: 9.0,
        };
        let table = of(&[record]);
        let row: Vec<&str> = table.lines().nth(1).unwrap().split_whitespace().collect();
        assert_eq!(row.join(" "), "cube bounce 100 6.0 2.0 2.50 5.00 25 25.0 %");
        assert!(table.contains("mean 25.0 %") && table.contains("another 9 ns"));
        assert!(of(&[]).is_empty());
    }
}
