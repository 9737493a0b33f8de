//! Grids of points as surfaces: what knots, terrains and columns have in common.

use crate::Mesh;
use glam::Vec3;

/// Whether the last line of a grid joins its first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// It ends in a border.
    Open,
    /// It closes on itself, with shared vertices.
    Closed,
}

impl Wrap {
    fn cells(self, points: usize) -> usize {
        match self {
            Self::Open => points.saturating_sub(1),
            Self::Closed => points,
        }
    }
}

/// The surface through `columns` by `rows` points, `point(column, row)`, two triangles a cell. Seen from
/// where columns run to the right and rows run up, triangles are counter-clockwise.
///
/// # Panics
/// If there are more points than an index can name.
pub fn patch(
    name: &str,
    (columns, across): (usize, Wrap),
    (rows, up): (usize, Wrap),
    point: impl Fn(usize, usize) -> Vec3,
) -> Mesh {
    assert!(u32::try_from(columns * rows).is_ok());
    let index = |column, row| ((row % rows) * columns + column % columns) as u32;
    let mut mesh = Mesh {
        name: name.into(),
        positions: Vec::with_capacity(columns * rows),
        indices: Vec::with_capacity(2 * columns * rows),
    };
    for row in 0..rows {
        mesh.positions
            .extend((0..columns).map(|column| point(column, row).to_array()));
    }
    for row in 0..up.cells(rows) {
        for column in 0..across.cells(columns) {
            let (a, b) = (index(column, row), index(column + 1, row));
            let (c, d) = (index(column, row + 1), index(column + 1, row + 1));
            mesh.indices.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}
