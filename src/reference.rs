//! The contract in plain code: what every query must answer, bit for bit.
//!
//! No tree, no vectors: each primitive in turn. Slow, and the specification that the kernels are
//! tested against.

use crate::{
    geometry::{Hit, Ray, TriangleMesh, is_degenerate},
    primitive::{PrimitiveHit, Primitives, custom, exact::reciprocal64},
    slab::{PreparedRay, pow2},
};
use glam::{DVec3, Vec3, dvec3};

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
fn intersect_triangle(ray: &PreparedRay, vertices: [Vec3; 3]) -> Option<[f32; 3]> {
    if !vertices.iter().all(|vertex| vertex.is_finite()) {
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
    let [a, b, c] = vertices.map(|vertex| vertex - origin);
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

    // The signs of the edge functions are exact.
    let dz = f64::from(direction[kz]);
    let widen = |p: [f32; 2], z: f32| dvec3(p[0].into(), p[1].into(), z.into());
    let corners = [
        widen([ax, ay], a[kz]),
        widen([bx, by], b[kz]),
        widen([cx, cy], c[kz]),
    ];
    let sheared = solve(corners, dz, 0.0)?;

    // `f32`, where it is well-conditioned, and nothing vanishes, overflows or gets near to either.
    let unit = pow2(-24);
    let cross32 = |px: f32, py: f32, qx: f32, qy: f32| px * qy - py * qx;
    let [xa, xb, xc] = [
        cross32(cx, cy, bx, by),
        cross32(ax, ay, cx, cy),
        cross32(bx, by, ax, ay),
    ];
    let sum = xa + xb + xc;
    let size = sum.abs();
    let (ab, ac) = (b[kz] - a[kz], c[kz] - a[kz]);
    let extent_x = ax.abs().max(bx.abs()).max(cx.abs());
    let extent_y = ay.abs().max(by.abs()).max(cy.abs());
    let [u, v] = [xb / sum, xc / sum];
    let z = a[kz] + u * ab + v * ac;
    let depth = ab.abs().max(ac.abs());
    let spread = extent_x * extent_y + extent_x.max(extent_y) * (a[kz].abs() * 0.5);
    let doubt = (spread / size + 1.0) * depth;
    let ordinary = size > pow2(-100) && size < pow2(126);
    let sound = xa != 0.0 && xb != 0.0 && xc != 0.0 && ordinary;
    let precise = ordinary && doubt <= z.abs() * 16.0;
    let [t, u, v] = if precise {
        // But for the signs.
        if sound {
            [z * reciprocal, u, v]
        } else {
            sheared
        }
    } else {
        // In `f64`: of the triangle as given, if the ray meets it, and about there; else of the sheared one.
        let error = (doubt + a[kz].abs()) * (reciprocal.abs() * (32.0 * unit));
        let is_there = |t: f32| !sound || (t - z * reciprocal).abs() <= error;
        let [o, d] = [origin, direction].map(Vec3::as_dvec3);
        let exactly = vertices.map(|vertex| {
            let p = vertex.as_dvec3() - o;
            dvec3(
                p[kx] * dz - d[kx] * p[kz],
                p[ky] * dz - d[ky] * p[kz],
                p[kz],
            )
        });
        solve(exactly, dz, unit.into())
            .filter(|&[t, ..]| is_there(t))
            .unwrap_or(sheared)
    };

    let t = t + 0.0;
    (t.is_finite() && t_min <= t && t <= t_max).then_some([t, u + 0.0, v + 0.0])
}

/// `t`, `u` and `v` where 0 is in a sheared triangle, if it is, and the triangle's area is not less than `least` of what it
/// is the difference of.
fn solve([a, b, c]: [DVec3; 3], dz: f64, least: f64) -> Option<[f32; 3]> {
    let products = [
        [c.x * b.y, c.y * b.x],
        [a.x * c.y, a.y * c.x],
        [b.x * a.y, b.y * a.x],
    ];
    let [wa, wb, wc] = products.map(|[p, q]| p - q);
    let largest = products
        .as_flattened()
        .iter()
        .fold(0.0_f64, |most, p| most.max(p.abs()));
    let area = wa + wb + wc;
    let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
    if !inside || area == 0.0 || !area.is_finite() || area.abs() < largest * least {
        return None;
    }
    let z = wa * a.z + wb * b.z + wc * c.z;
    let scale = reciprocal64(area * dz);
    let [t, u, v] = [z * scale, wb * (scale * dz), wc * (scale * dz)];
    Some([t as f32, u as f32, v as f32])
}
