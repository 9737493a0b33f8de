//! The one mesh type: shared vertices and three corners a triangle.

use glam::Vec3;

/// An indexed triangle mesh with a name.
///
/// The loaders and shapes here keep every index within the positions. A position may be NaN or infinite if
/// the file said so.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// What it is called: the file name without its extension, or the shape's own name.
    pub name: String,
    /// The vertices, in the scene's own unit, y up.
    pub positions: Vec<[f32; 3]>,
    /// The corners of each triangle, as places in `positions`.
    pub indices: Vec<[u32; 3]>,
}

impl Mesh {
    /// The least and the greatest corner of the box around every finite vertex that a triangle uses;
    /// both are the origin if there is none.
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        bounds(&self.positions, &self.indices)
    }

    /// Adds the triangles of `other`, with its vertices kept apart from those already here.
    ///
    /// # Panics
    /// If there would be more vertices than an index can name.
    pub fn append(&mut self, other: &Self) {
        let base = self.positions.len();
        assert!(u32::try_from(base + other.positions.len()).is_ok());
        let base = base as u32;
        self.positions.extend_from_slice(&other.positions);
        self.indices
            .extend(other.indices.iter().map(|t| t.map(|index| index + base)));
    }

    /// The same triangles with every vertex moved by `motion`.
    #[must_use]
    pub fn moved(mut self, motion: impl Fn(Vec3) -> Vec3) -> Self {
        for position in &mut self.positions {
            *position = motion(Vec3::from_array(*position)).to_array();
        }
        self
    }
}

/// [`Mesh::bounds`], of a mesh's buffers.
pub fn bounds(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> ([f32; 3], [f32; 3]) {
    let mut used = indices
        .iter()
        .flatten()
        .filter_map(|&index| positions.get(index as usize))
        .map(|&position| Vec3::from_array(position))
        .filter(|position| position.is_finite());
    let Some(first) = used.next() else {
        return Default::default();
    };
    let (min, max) = used.fold((first, first), |(min, max), p| (min.min(p), max.max(p)));
    (min.to_array(), max.to_array())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_of_used_finite_vertices() {
        let mesh = Mesh {
            name: "bounds".into(),
            positions: vec![
                [0.0, 1.0, 2.0],
                [3.0, -1.0, 2.0],
                [f32::NAN, 100.0, 0.0],
                [50.0; 3],
            ],
            indices: vec![[0, 1, 2]],
        };
        assert_eq!(mesh.bounds(), ([0.0, -1.0, 2.0], [3.0, 1.0, 2.0]));
        assert_eq!(Mesh::default().bounds(), ([0.0; 3], [0.0; 3]));
    }

    #[test]
    fn append_keeps_triangles() {
        let triangle = Mesh {
            name: "triangle".into(),
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            indices: vec![[0, 1, 2]],
        };
        let mut both = triangle.clone();
        both.append(&triangle.moved(|p| p + Vec3::Z));
        assert_eq!(both.indices, [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(both.positions[3], [0.0, 0.0, 1.0]);
    }
}
