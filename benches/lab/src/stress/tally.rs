//! What was checked, family by family: counts, and the table and JSON of them.

use crate::{exact::Margins, text::align};
use serde::Serialize;

/// How much was checked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    pub meshes: u64,
    pub triangles: u64,
    pub rays: u64,
    /// Answers compared with brute force's.
    pub checks: u64,
    /// Rays that hit something.
    pub hits: u64,
    /// Pairs of a ray and a triangle checked in exact arithmetic.
    pub exact: u64,
    pub worst: Margins,
}

impl Tally {
    /// Both together.
    pub fn add(self, other: Self) -> Self {
        Self {
            meshes: self.meshes + other.meshes,
            triangles: self.triangles + other.triangles,
            rays: self.rays + other.rays,
            checks: self.checks + other.checks,
            hits: self.hits + other.hits,
            exact: self.exact + other.exact,
            worst: self.worst.max(other.worst),
        }
    }
}

/// A row of the table.
#[derive(Serialize)]
pub struct Row {
    pub family: &'static str,
    pub meshes: u64,
    pub triangles: u64,
    pub rays: u64,
    pub ray_checks: u64,
    pub hits: u64,
    pub exact_checks: u64,
    /// Fractions of the documented bounds.
    pub worst_t: f64,
    pub worst_shear: f64,
    pub worst_slab: f64,
    pub worst_gap: f64,
}

impl Row {
    pub fn new(family: &'static str, tally: &Tally) -> Self {
        Self {
            family,
            meshes: tally.meshes,
            triangles: tally.triangles,
            rays: tally.rays,
            ray_checks: tally.checks,
            hits: tally.hits,
            exact_checks: tally.exact,
            worst_t: tally.worst.t,
            worst_shear: tally.worst.shear,
            worst_slab: tally.worst.slab,
            worst_gap: tally.worst.gap,
        }
    }
}

/// The rows as text for a terminal.
pub fn table(rows: &[Row]) -> String {
    let header = [
        "family",
        "meshes",
        "triangles",
        "rays",
        "answers",
        "hits",
        "exact",
        "t",
        "shear",
        "slab",
        "gap",
    ];
    let cells = |row: &Row| {
        let counts = [
            row.meshes,
            row.triangles,
            row.rays,
            row.ray_checks,
            row.hits,
            row.exact_checks,
        ];
        let worst = [row.worst_t, row.worst_shear, row.worst_slab, row.worst_gap];
        std::iter::once(row.family.to_owned())
            .chain(counts.map(|count| count.to_string()))
            .chain(worst.map(|worst| format!("{worst:.3}")))
            .collect()
    };
    let header = header.map(str::to_owned).to_vec();
    let rows: Vec<Vec<String>> = std::iter::once(header)
        .chain(rows.iter().map(cells))
        .collect();
    format!(
        "{}\
answers: compared with brute force's, bit for bit. exact: rays and triangles checked in rationals.
t, shear, slab: the largest error of t, of a sheared corner, of a box's plane, as a fraction of its bound;
gap: the share of the box test's margin that a box could not have done without.
",
        align(&rows)
    )
}
