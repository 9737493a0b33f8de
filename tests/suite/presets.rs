//! Every preset gives the reference's answer, bit for bit, on shapes and soups.

use crate::common::{Variants, config, part, point, point_on, soup, target};
use glam::Vec3;
use proptest::prelude::*;
use wide_bvh::geometry::Ray;
use wide_bvh_scenes::{Mesh, shapes};

/// Rays at vertices, edges and insides of a mesh's triangles, from all around and from within.
fn rays(mesh: &Mesh, count: usize) -> impl Iterator<Item = Ray> + '_ {
    let mut rng = fastrand::Rng::with_seed(crate::common::SEED);
    let (min, max) = mesh.bounds();
    let (min, max) = (Vec3::from(min), Vec3::from(max));
    (0..count).map(move |ray| {
        let mut share = || Vec3::new(rng.f32(), rng.f32(), rng.f32());
        let origin = min + (max - min) * (share() * 2.0 - 0.5);
        let corners = mesh.indices[rng.usize(..mesh.indices.len())];
        let triangle = corners.map(|i| Vec3::from(mesh.positions[i as usize]));
        let at = match ray % 4 {
            0 => (0.0, 0.0),
            1 => (0.5, 0.0),
            _ => (rng.f32() * 0.5, rng.f32() * 0.5),
        };
        Ray::new(origin, point_on(triangle, at) - origin)
    })
}

#[test]
fn shapes_of_all_kinds() {
    let shapes = [
        shapes::icosphere(4),
        shapes::torus_knot(2, 3, 0.3, 200, 12),
        shapes::terrain(40, 0.3, 5),
        shapes::quantised(shapes::terrain(30, 0.3, 7), 16),
        shapes::soup(3000, 11),
        wide_bvh_scenes::default_scene(),
    ];
    // The largest take an emulated processor minutes.
    for mesh in shapes
        .into_iter()
        .filter(|mesh| mesh.indices.len() <= part(1_000_000))
    {
        let variants = Variants::new(mesh.positions.clone(), mesh.indices.clone());
        let count = part(2_000_000 / (mesh.indices.len() + 5000));
        let mut hits = 0;
        for ray in rays(&mesh, count) {
            hits += usize::from(variants.check(&ray).unwrap().is_some());
        }
        assert!(2 * hits > count, "{}: {hits} of {count}", mesh.name);
    }
}

proptest! {
    #![proptest_config(config(150))]

    #[test]
    fn larger_soups(
        (positions, indices) in soup(60..400),
        rays in prop::collection::vec((point(), any::<prop::sample::Index>(), target()), 30),
    ) {
        let variants = Variants::new(positions, indices.clone());
        for (origin, pick, at) in rays {
            let triangle = variants.mesh().triangle(pick.index(indices.len())).unwrap();
            let direction = point_on(triangle, at) - Vec3::from(origin);
            let answer = variants.check(&Ray::new(origin, direction));
            prop_assert!(answer.is_ok(), "{}", answer.unwrap_err());
        }
    }
}
