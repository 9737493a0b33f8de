//! By edge functions after a shear.

use super::{Hits, NO_HITS, TriangleTest, Vectors, WIDTH, mask, vectors};
use glam::Vec3;
use wide_bvh::geometry::Ray;

/// Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (JCGT 2013). With `F64` an edge function that comes out
/// zero is worked out again in `f64`, as published; without, it counts as zero.
pub struct Woop<const F64: bool>;

/// What Woop's test needs of a ray.
#[derive(Clone, Copy)]
pub struct ShearedRay {
    origin: [f32; 3],
    axes: [usize; 3],
    shear: [f32; 3],
}

impl<const F64: bool> TriangleTest for Woop<F64> {
    type Triangles = [Vectors; 3];
    type Ray = ShearedRay;

    fn triangles(corners: &[[Vec3; 3]; WIDTH]) -> [Vectors; 3] {
        [0, 1, 2].map(|corner| vectors(corners, |corners| corners[corner]))
    }

    #[inline(always)]
    fn ray(ray: &Ray) -> ShearedRay {
        let size = ray.direction.abs();
        let kz = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
        if ray.direction[kz] < 0.0 {
            (kx, ky) = (ky, kx);
        }
        let d = ray.direction;
        ShearedRay {
            origin: ray.origin.to_array(),
            axes: [kx, ky, kz],
            shear: [d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]],
        }
    }

    #[inline(always)]
    fn test(corners: &[Vectors; 3], ray: &ShearedRay, range: [f32; 2]) -> (u32, Hits) {
        let [kx, ky, kz] = ray.axes.map(|axis| axis % 3);
        let [sx, sy, sz] = ray.shear;
        let [ox, oy, oz] = [ray.origin[kx], ray.origin[ky], ray.origin[kz]];
        let mut hits = NO_HITS;
        let mut hit = [false; WIDTH];
        let mut zero = [false; WIDTH];
        let mut sheared = [[[0.0; WIDTH]; 3]; 3];
        for (corner, sheared) in corners.iter().zip(&mut sheared) {
            let (xs, ys, zs) = (&corner[kx], &corner[ky], &corner[kz]);
            for i in 0..WIDTH {
                let z = zs[i] - oz;
                sheared[0][i] = xs[i] - ox - sx * z;
                sheared[1][i] = ys[i] - oy - sy * z;
                sheared[2][i] = sz * z;
            }
        }
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = &sheared;
        for i in 0..WIDTH {
            let wa = cx[i] * by[i] - cy[i] * bx[i];
            let wb = ax[i] * cy[i] - ay[i] * cx[i];
            let wc = bx[i] * ay[i] - by[i] * ax[i];
            let (inside, t, u, v) = weigh([wa, wb, wc], [az[i], bz[i], cz[i]]);
            (hits.t[i], hits.u[i], hits.v[i]) = (t, u, v);
            hit[i] = inside & (t >= range[0]) & (t <= range[1]);
            zero[i] = (wa == 0.0) | (wb == 0.0) | (wc == 0.0);
        }
        let mut hit = mask(hit);
        if F64 {
            let mut again = mask(zero);
            while again != 0 {
                let i = again.trailing_zeros() as usize % WIDTH;
                again &= again - 1;
                let edge = |px: f32, qy: f32, py: f32, qx: f32| {
                    (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
                };
                let weights = [
                    edge(cx[i], by[i], cy[i], bx[i]),
                    edge(ax[i], cy[i], ay[i], cx[i]),
                    edge(bx[i], ay[i], by[i], ax[i]),
                ];
                let (inside, t, u, v) = weigh(weights, [az[i], bz[i], cz[i]]);
                (hits.t[i], hits.u[i], hits.v[i]) = (t, u, v);
                let in_range = (t >= range[0]) & (t <= range[1]);
                hit = hit & !(1 << i) | u32::from(inside & in_range) << i;
            }
        }
        (hit, hits)
    }
}

/// Whether the weights have one sign, and `t`, `u` and `v` by them.
#[inline(always)]
fn weigh([wa, wb, wc]: [f32; 3], [az, bz, cz]: [f32; 3]) -> (bool, f32, f32, f32) {
    let outside = ((wa < 0.0) | (wb < 0.0) | (wc < 0.0)) & ((wa > 0.0) | (wb > 0.0) | (wc > 0.0));
    let determinant = wa + wb + wc;
    let inverse = 1.0 / determinant;
    let t = (wa * az + wb * bz + wc * cz) * inverse;
    (
        !outside & (determinant != 0.0),
        t,
        wb * inverse,
        wc * inverse,
    )
}
