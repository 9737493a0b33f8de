//! What the reference says, and that all answers say the same.

use crate::{Answers, Found, ask::Primitive, found};
use glam::Vec3;
use wide_bvh::{
    geometry::{Ray, TriangleMesh},
    primitive::Primitives,
    reference,
};

/// What each ray hits of a mesh.
pub fn of_mesh(mesh: &TriangleMesh, rays: &[Ray]) -> Vec<Found> {
    let answer = |ray: &Ray| {
        let hit = reference::closest_hit(mesh, ray);
        assert_eq!(reference::any_hit(mesh, ray), hit.is_some(), "{ray:?}");
        found(hit)
    };
    rays.iter().map(answer).collect()
}

/// What each ray hits of a caller's primitives.
pub fn of_boxes(
    primitives: &dyn Primitives<Detail = ()>,
    count: usize,
    rays: &[Ray],
) -> Vec<Found> {
    let hit = |ray| reference::closest_primitive(primitives, count as u32, ray);
    rays.iter().map(|ray| Primitive(hit(ray)).into()).collect()
}

/// Holds answers to what is true.
#[track_caller]
pub fn assert_all(answers: &[Answers], rays: &[Ray], truth: &[Found]) {
    for Answers { how, closest, any } in answers {
        assert_eq!((closest.len(), any.len()), (truth.len(), truth.len()));
        for (((ray, truth), closest), any) in rays.iter().zip(truth).zip(closest).zip(any) {
            assert_eq!(closest, truth, "{how}: {ray:?}");
            assert_eq!(*any, truth.is_some(), "any hit, {how}: {ray:?}");
        }
    }
}

/// The first corner that is NaN or infinite: its triangle, and its place in that.
pub fn first_not_finite(triangles: &[[Vec3; 3]]) -> Option<(usize, usize)> {
    triangles
        .iter()
        .enumerate()
        .find_map(|(triangle, corners)| {
            let corner = corners.iter().position(|corner| !corner.is_finite())?;
            Some((triangle, corner))
        })
}
