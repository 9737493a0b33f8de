//! What is hostile about numbers: their range.

use super::meshes;
use crate::stress::{
    aim::{ALL, Reach, log_uniform, rays, sign, unit},
    case::{Case, Flush},
};
use fastrand::Rng;
use glam::Vec3;
use wide_bvh::geometry::Ray;
use wide_bvh_scenes::Mesh;

const RAYS: usize = 200;

/// All kinds of meshes and rays.
pub fn any(rng: &mut Rng) -> Case {
    let mesh = meshes::any(rng);
    at(rng, mesh, Reach::NEAR)
}

fn at(rng: &mut Rng, mesh: Mesh, reach: Reach) -> Case {
    let rays = rays(rng, &mesh, ALL, reach, RAYS);
    Case::of(rng, mesh, rays)
}

/// From 1e-18 to 1e18.
pub fn scale(rng: &mut Rng) -> Case {
    let scale = log_uniform(rng, -18.0, 18.0);
    let mesh = meshes::any(rng).moved(|p| p * scale);
    at(rng, mesh, Reach::NEAR)
}

/// Moved by up to 1e8 extents, where little is left of the shape but the last bits.
pub fn offset(rng: &mut Rng) -> Case {
    let offset = unit(rng) * log_uniform(rng, 0.0, 8.0);
    // Along one axis alone, or all.
    let offset = if rng.bool() {
        offset
    } else {
        offset * Vec3::AXES[rng.usize(..3)]
    };
    let mesh = meshes::any(rng).moved(|p| p + offset);
    at(rng, mesh, Reach(-2.0, 2.0))
}

/// Rays from far away.
pub fn far(rng: &mut Rng) -> Case {
    let mesh = meshes::any(rng);
    at(rng, mesh, Reach(1.0, 8.0))
}

/// Directions of any length; components that differ by any ratio.
pub fn directions(rng: &mut Rng) -> Case {
    let mut case = any(rng);
    for ray in &mut case.rays {
        if rng.bool() {
            let axis = rng.usize(..3);
            ray.direction[axis] *= log_uniform(rng, -45.0, 0.0);
        }
        if rng.bool() {
            // Twice, for no float is large enough.
            let length = log_uniform(rng, -22.0, 19.0);
            ray.direction = ray.direction * length * length;
        }
    }
    case
}

fn any_float(rng: &mut Rng) -> f32 {
    const SPECIAL: [f32; 12] = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        f32::MAX,
        f32::MIN,
        f32::EPSILON,
    ];
    match rng.u32(..3) {
        0 => f32::from_bits(rng.u32(..)),
        1 => SPECIAL[rng.usize(..SPECIAL.len())],
        _ => 4.0 * rng.f32() - 2.0,
    }
}

/// Any bits at all, of vertices, or of one or all numbers of a ray.
pub fn bits(rng: &mut Rng) -> Case {
    let mut mesh = meshes::pool(rng);
    if rng.bool() {
        for x in mesh.positions.iter_mut().flatten() {
            if rng.u32(..4) == 0 {
                *x = any_float(rng);
            }
        }
    }
    let mut case = at(rng, mesh, Reach::NEAR);
    for ray in &mut case.rays {
        let numbers: &mut [f32; 8] = bytemuck::cast_mut(ray);
        match rng.u32(..3) {
            0 => numbers[rng.usize(..8)] = any_float(rng),
            1 => numbers.iter_mut().for_each(|x| *x = any_float(rng)),
            _ => {}
        }
    }
    case
}

/// Scenes so small, or rays so short, that much is denormal; the host flushes it to zero.
pub fn flush(rng: &mut Rng) -> Case {
    let mut case = match rng.u32(..4) {
        0 => any(rng),
        1 => directions(rng),
        2 => bits(rng),
        _ => {
            let scale = log_uniform(rng, -22.0, -8.0);
            let mesh = meshes::any(rng).moved(|p| p * scale * scale);
            at(rng, mesh, Reach::NEAR)
        }
    };
    let is_normal = |x: &f32| *x == 0.0 || x.is_normal();
    let all_normal = case.mesh.positions.iter().flatten().all(is_normal);
    case.flush = if all_normal && rng.bool() {
        Flush::Queries
    } else {
        Flush::Throughout
    };
    case
}

/// All at once.
pub fn mixed(rng: &mut Rng) -> Case {
    let (scale, away) = (
        log_uniform(rng, -12.0, 12.0),
        unit(rng) * log_uniform(rng, -2.0, 6.0),
    );
    let squash = Vec3::from([(); 3].map(|()| log_uniform(rng, -5.0, 0.0)));
    let mesh = meshes::any(rng).moved(|p| (p * squash + away) * scale);
    let far = 6.0 * rng.f32();
    let mut case = at(rng, mesh, Reach(-3.0, far));
    for Ray {
        direction,
        t_min,
        t_max,
        ..
    } in &mut case.rays
    {
        if rng.u32(..4) == 0 {
            let length = sign(rng) * log_uniform(rng, -20.0, 20.0);
            *direction *= length;
        }
        if rng.u32(..8) == 0 {
            *t_min = -log_uniform(rng, -3.0, 3.0);
            *t_max = log_uniform(rng, -3.0, 3.0);
        }
    }
    case
}
