//! The contract in plain code: what every query must answer, bit for bit.
//!
//! No tree, no vectors: each primitive in turn. Slow, and the specification that the kernels are
//! tested against.

use crate::{
    geometry::{Hit, Ray, TriangleMesh, is_degenerate},
    primitive::{PrimitiveHit, Primitives, custom},
    slab::{PreparedRay, pow2},
};
use glam::Vec3;

/// The closest hit on a mesh: of all triangles that are hit within the ray's range the one of least `t`,
/// of equal ones the one of least number. Triangles with a corner that is NaN or infinite are never hit, nor
/// those whose corners lie on one line.
pub fn closest_hit(mesh: &TriangleMesh, ray: &Ray) -> Option<Hit> {
    let mut room = PreparedRay::ROOM;
    let prepared = PreparedRay::new(ray, &mut room)?;
    let mut best: Option<Hit> = None;
    for (corners, primitive) in triangles(mesh).zip(0..) {
        if let Some([t, u, v]) = intersect_triangle(&prepared, corners)
            && best.is_none_or(|best| t < best.t)
            && !is_degenerate(corners)
        {
            best = Some(Hit { t, u, v, primitive });
        }
    }
    best.map(|hit| Hit {
        t: prepared.unscaled(hit.t, ray),
        ..hit
    })
}

/// Whether the ray hits any triangle of a mesh within its range.
pub fn any_hit(mesh: &TriangleMesh, ray: &Ray) -> bool {
    PreparedRay::new(ray, &mut PreparedRay::ROOM.clone()).is_some_and(|prepared| {
        triangles(mesh).any(|corners| {
            intersect_triangle(&prepared, corners).is_some() && !is_degenerate(corners)
        })
    })
}

/// The closest hit on `count` primitives of a caller's own. Those with a box that is empty or not finite are never hit.
pub fn closest_primitive<P: Primitives + ?Sized>(
    primitives: &P,
    count: u32,
    ray: &Ray,
) -> Option<PrimitiveHit<P::Detail>> {
    let mut room = PreparedRay::ROOM;
    let prepared = PreparedRay::new(ray, &mut room)?;
    let mut best: Option<PrimitiveHit<P::Detail>> = None;
    for primitive in 0..count {
        if let Some((t, detail)) = custom::intersect(primitives, primitive, ray, &prepared)
            && best.is_none_or(|best| t < best.t)
        {
            best = Some(PrimitiveHit {
                t,
                primitive,
                detail,
            });
        }
    }
    best.map(|hit| PrimitiveHit {
        t: prepared.unscaled(hit.t, ray),
        ..hit
    })
}

fn triangles(mesh: &TriangleMesh) -> impl Iterator<Item = [Vec3; 3]> {
    let corner = |i: u32| Vec3::from_array(mesh.positions()[i as usize]);
    mesh.indices().iter().map(move |t| t.map(corner))
}

/// Scaled `t`, `u` and `v` at which a triangle is hit, if it is within the ray's range.
///
/// The formulas are those of the triangle test, a number at a time; the signs of the edge functions are
/// found in `f64` without exception.
fn intersect_triangle(ray: &PreparedRay, corners: [Vec3; 3]) -> Option<[f32; 3]> {
    if !corners.iter().all(|corner| corner.is_finite()) {
        return None;
    }
    let [kx, ky, kz] = *ray.axes;
    let Ray {
        origin,
        direction,
        t_min,
        t_max,
    } = *ray.ray;
    let reciprocal = 1.0 / direction[kz];
    let [a, b, c] = corners.map(|corner| corner - origin);
    let shear = [direction[kx] * reciprocal, direction[ky] * reciprocal];
    let shear = |p: Vec3| [p[kx] - shear[0] * p[kz], p[ky] - shear[1] * p[kz]];
    let ([ax, ay], [bx, by], [cx, cy]) = (shear(a), shear(b), shear(c));

    // Not if it is all behind where the ray begins.
    let last = (a[kz] * reciprocal)
        .max(b[kz] * reciprocal)
        .max(c[kz] * reciprocal);
    if t_min > last {
        return None;
    }

    let cross64 = |px: f32, py: f32, qx: f32, qy: f32| {
        f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)
    };
    let [wa, wb, wc] = [
        cross64(cx, cy, bx, by),
        cross64(ax, ay, cx, cy),
        cross64(bx, by, ax, ay),
    ];
    let determinant = wa + wb + wc;
    let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
    if !inside || determinant == 0.0 || !determinant.is_finite() {
        return None;
    }
    let exact = [(wb / determinant) as f32, (wc / determinant) as f32];

    // The weights of `f32`, where they are well-conditioned, and nothing vanishes, overflows or gets near to either.
    let cross32 = |px: f32, py: f32, qx: f32, qy: f32| px * qy - py * qx;
    let [wa, wb, wc] = [
        cross32(cx, cy, bx, by),
        cross32(ax, ay, cx, cy),
        cross32(bx, by, ax, ay),
    ];
    let determinant = wa + wb + wc;
    let size = determinant.abs();
    let (ab, ac) = (b[kz] - a[kz], c[kz] - a[kz]);
    let extent_x = ax.abs().max(bx.abs()).max(cx.abs());
    let extent_y = ay.abs().max(by.abs()).max(cy.abs());
    let ordinary = wa != 0.0
        && wb != 0.0
        && wc != 0.0
        && size > pow2(-100)
        && size < pow2(126)
        && extent_x / size * extent_y * ab.abs().max(ac.abs()) <= a[kz].abs() * 2.0;
    let [u, v] = if ordinary {
        [wb / determinant, wc / determinant]
    } else {
        exact
    };

    let z = a[kz] + u * ab + v * ac;
    let t = z * reciprocal + 0.0;
    (t.is_finite() && t_min <= t && t <= t_max).then_some([t, u + 0.0, v + 0.0])
}
