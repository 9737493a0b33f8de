//! What the shapes promise: their sizes, that they are closed where they say so, and that they never change.

use std::collections::HashMap;
use wide_bvh_scenes::{
    Mesh,
    shapes::{crowd, cuboid, icosphere, plane, quantised, soup, terrain, torus_knot},
};

/// Closed and consistently wound: each edge is used once in each direction.
fn is_closed(mesh: &Mesh) -> bool {
    let mut edges = HashMap::new();
    for &[a, b, c] in &mesh.indices {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_insert(0) += 1;
        }
    }
    edges
        .iter()
        .all(|(&(a, b), &uses)| uses == 1 && edges.get(&(b, a)) == Some(&1))
}

/// Six times the volume within, positive if triangles are counter-clockwise from outside.
fn volume(mesh: &Mesh) -> f32 {
    let corner = |i: u32| glam::Vec3::from(mesh.positions[i as usize]);
    let signed = |t: &[u32; 3]| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])));
    mesh.indices.iter().map(signed).sum()
}

#[test]
fn closed_shapes_are_closed_and_wound_outwards() {
    let shapes = [
        icosphere(0),
        icosphere(3),
        cuboid([0.0; 3], [1.0, 2.0, 3.0]),
        torus_knot(2, 3, 0.2, 200, 12),
    ];
    for shape in shapes {
        assert!(is_closed(&shape), "{}", shape.name);
        assert!(volume(&shape) > 0.0, "{}", shape.name);
    }
    assert!(!is_closed(&plane(4)));
}

#[test]
fn sizes_are_as_documented() {
    assert_eq!(icosphere(4).indices.len(), 20 * 256);
    assert_eq!(icosphere(4).positions.len(), 10 * 256 + 2);
    assert_eq!(torus_knot(3, 2, 0.1, 50, 8).indices.len(), 2 * 50 * 8);
    assert_eq!(plane(7).indices.len(), 2 * 7 * 7);
    assert_eq!(plane(7).bounds(), ([-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]));
    assert_eq!(soup(100, 3).indices.len(), 100);
}

#[test]
fn seeds_decide() {
    assert_eq!(soup(50, 1), soup(50, 1));
    assert_ne!(soup(50, 1), soup(50, 2));
    assert_eq!(terrain(20, 1.0, 1), terrain(20, 1.0, 1));
    assert_ne!(terrain(20, 1.0, 1), terrain(20, 1.0, 2));
}

#[test]
fn soups_and_hills_stay_within_their_bounds() {
    let (min, max) = soup(1000, 7).bounds();
    assert!(min.iter().all(|&x| x >= 0.0) && max.iter().all(|&x| x <= 1.0));
    let (min, max) = terrain(64, 2.0, 7).bounds();
    assert!(min[1] >= 0.0 && max[1] <= 2.0 && max[1] - min[1] > 0.5);
}

#[test]
fn quantised_coordinates_are_whole_numbers() {
    let sphere = icosphere(3);
    let rounded = quantised(sphere.clone(), 32);
    assert!(rounded.positions.iter().flatten().all(|x| x.fract() == 0.0));
    let (min, max) = rounded.bounds();
    assert_eq!(min.map(|x| x as i32), [0; 3]);
    assert_eq!(max.into_iter().fold(0.0, f32::max), 32.0);
    assert_eq!(rounded.indices, sphere.indices);
    // A mesh that is one point has no longest side to divide by.
    let point = quantised(cuboid([1.0; 3], [1.0; 3]), 8);
    assert!(point.positions.iter().flatten().all(|&x| x == 0.0));
}

#[test]
fn a_crowd_is_whole_copies_in_their_cells() {
    let one = cuboid([3.0; 3], [4.0, 5.0, 6.0]);
    let many = crowd(&one, 12, 5);
    assert_eq!(many.indices.len(), 12 * one.indices.len());
    assert_eq!(many, crowd(&one, 12, 5));
    assert_ne!(many, crowd(&one, 12, 6));
    assert!(is_closed(&many));
    assert!(volume(&many) > 0.0);
    let corners: Vec<_> = many
        .positions
        .iter()
        .map(|&p| glam::Vec3::from(p))
        .collect();
    let copies: Vec<_> = corners.chunks(one.positions.len()).collect();
    assert_eq!(copies.len(), 12);
    for (number, copy) in copies.iter().enumerate() {
        let cell = [number % 3, number / 3 % 3, number / 9].map(|i| i as f32 + 0.5);
        let centre = copy.iter().sum::<glam::Vec3>() / copy.len() as f32;
        assert!((centre - glam::Vec3::from(cell)).abs().max_element() < 0.2001);
        for corner in *copy {
            let radius = corner.distance(centre);
            assert!((0.3999..0.6001).contains(&radius), "{radius}");
        }
    }
    // Turned, not merely moved: no edge of the first copy is along an axis.
    let edge = copies[0][1] - copies[0][0];
    assert!(edge.abs().max_element() < 0.999 * edge.length());
    // A point has no size to scale to.
    assert_eq!(crowd(&cuboid([1.0; 3], [1.0; 3]), 2, 1).indices.len(), 24);
    assert!(crowd(&one, 0, 1).indices.is_empty());
}
