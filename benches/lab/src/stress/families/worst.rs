//! Rays and triangles that were searched for what uses most of a bound.
//!
//! Hill climbing from a random start: change a number or two, by a few last bits or by a lot, and keep what is
//! worse. The proofs' constants add up every rounding at its worst; this finds how near one can get.

use super::meshes;
use crate::{
    exact::{Margins, margins},
    stress::{
        aim::{log_uniform, sign, unit},
        case::Case,
    },
};
use fastrand::Rng;
use glam::Vec3;
use wide_bvh::{
    geometry::{Ray, TriangleMesh},
    reference,
};

/// For the error of t.
pub fn t(rng: &mut Rng) -> Case {
    case(rng, |margins| margins.t)
}

/// For the error of sheared corners.
pub fn shear(rng: &mut Rng) -> Case {
    case(rng, |margins| margins.shear)
}

/// For the error of the box test: of one plane, or of two that have to disagree for a box to be lost.
pub fn slab(rng: &mut Rng) -> Case {
    if rng.bool() {
        case(rng, |margins| margins.slab)
    } else {
        case(rng, |margins| margins.gap + 1e-3 * margins.slab)
    }
}

fn case(rng: &mut Rng, objective: fn(&Margins) -> f64) -> Case {
    // Alone, mostly: a larger scene has a larger margin.
    let starts = if rng.u32(..4) > 0 { 1 } else { 12 };
    let found: Vec<Candidate> = (0..starts).map(|_| climb(rng, objective)).collect();
    let triangles: Vec<[Vec3; 3]> = found.iter().map(Candidate::corners).collect();
    let rays = found.iter().map(Candidate::ray).collect();
    Case {
        exact_every: 1,
        ..Case::of(rng, meshes::of_triangles("worst", &triangles), rays)
    }
}

/// Three corners, an origin and a direction, as 15 floats.
#[derive(Clone, Copy)]
struct Candidate([f32; 15]);

impl Candidate {
    fn random(rng: &mut Rng) -> Self {
        let mut numbers = [(); 15].map(|()| 2.0 * rng.f32() - 1.0);
        // Aimed at the triangle, from about as far as it is large.
        let distance = log_uniform(rng, -1.0, 1.0);
        let corners = Self(numbers).corners();
        let target = match rng.u32(..3) {
            0 => corners[0],
            1 => corners[0].lerp(corners[1], rng.f32()),
            _ => (corners[0] + corners[1] + corners[2]) / 3.0,
        };
        let direction = if rng.bool() {
            // Where two components are about as large, the shear loses most.
            Vec3::from([(); 3].map(|()| sign(rng) * (1.0 - 0.1 * rng.f32())))
        } else {
            unit(rng)
        };
        numbers[9..12].copy_from_slice(&(target - direction * distance).to_array());
        numbers[12..].copy_from_slice(&direction.to_array());
        Self(numbers)
    }

    fn corners(&self) -> [Vec3; 3] {
        [0, 3, 6].map(|at| Vec3::from_slice(&self.0[at..at + 3]))
    }

    fn ray(&self) -> Ray {
        Ray::new(
            Vec3::from_slice(&self.0[9..12]),
            Vec3::from_slice(&self.0[12..]),
        )
    }

    fn changed(mut self, rng: &mut Rng) -> Self {
        for _ in 0..rng.usize(1..4) {
            let x = &mut self.0[rng.usize(..15)];
            *x = match rng.u32(..4) {
                0 => *x + *x * 0.1 * (rng.f32() - 0.5),
                1 => *x * (1.0 + sign(rng) * log_uniform(rng, -7.0, -1.0)),
                2 => *x + sign(rng) * log_uniform(rng, -8.0, 0.0),
                _ => f32::from_bits(x.to_bits().wrapping_add_signed(rng.i32(-3..=3))),
            };
            if !x.is_finite() {
                *x = 1.0;
            }
        }
        self
    }

    fn score(&self, objective: fn(&Margins) -> f64) -> f64 {
        let corners = self.corners();
        let ray = self.ray().with_range(f32::NEG_INFINITY, f32::INFINITY);
        let mesh = TriangleMesh::new(&corners, &[[0, 1, 2_u32]]).expect("three corners");
        let hit = reference::closest_hit(&mesh, &ray);
        // A triangle that is missed decides nothing.
        hit.map_or(0.0, |hit| objective(&margins(&ray, corners, Some(&hit))))
    }
}

fn climb(rng: &mut Rng, objective: fn(&Margins) -> f64) -> Candidate {
    let mut best = Candidate::random(rng);
    let mut score = best.score(objective);
    for _ in 0..log_uniform(rng, 2.0, 4.5) as usize {
        let next = best.changed(rng);
        let next_score = next.score(objective);
        if next_score >= score {
            (best, score) = (next, next_score);
        }
    }
    best
}
