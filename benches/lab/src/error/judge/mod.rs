//! Whether an answer is right.
//!
//! An answer is compared with the exact one:
//!
//! - *right*: both miss, or it names the triangle that is hit first, or one of several that are hit there together;
//! - *other triangle*: it names another at the same distance, give or take [`T_ROUNDING`]: what happens at shared
//!   edges, and where surfaces touch;
//! - *lost*: it misses, or names something behind;
//! - *phantom*: it hits where there is nothing, or names something nearer than what is there.
//!
//! Whether a ray that passes an outline within rounding hits is decided by the least rounding anywhere, and no float test
//! can do better. Such answers are counted apart, *at the edge*, by one measure for all variants:
//!
//! - a lost ray, if every triangle in front of the answer can be got past: a shift of the ray, sideways and by at most
//!   [`SHIFT`], takes it off that triangle and off those that go on from it there. And what is named behind is there;
//! - a phantom, if it is there: the ray's point at its `t` is on the triangle named, but for such a shift.
//!
//! Also where what is overlooked, or named, is at an end of the ray's range, give or take [`T_ROUNDING`]. At an edge
//! that two triangles share and that is no outline every shifted ray hits one of them, so a ray lost there is lost.

mod beside;

use super::truth::{First, Truth};
use beside::{is_there, may_overlook};
use serde::Serialize;
use std::ops::AddAssign;
use wide_bvh::geometry::{Hit, Ray};

/// How far a ray may be shifted, relative to the largest distance, along an axis, of a corner of the
/// triangles in question from the ray's origin.
///
/// A test in `f32` that moves corners to the ray's origin rounds each coordinate by u = 2^-24 of that. Woop's
/// test rounds each of the two sheared coordinates seven times (shown in the crate's `src/slab`), √2·7 u together; and a hair
/// for the shifts that are tried are not all there are.
const SHIFT: f64 = 10.2 / 16_777_216.0;

/// How far `t` may be off for an answer to be about the same place: 2^-17 of the same distance, over the
/// largest component of the direction. A few times what tests in `f32` are off by.
const T_ROUNDING: f64 = 1.0 / 131_072.0;

/// What an answer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Right,
    OtherTriangle,
    Lost { at_edge: bool },
    Phantom { at_edge: bool },
}

/// How many answers are what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// All rays.
    pub rays: usize,
    /// The exact answer hits, and the variant misses or names something behind.
    pub lost: usize,
    /// Further lost rays, that pass an outline within rounding.
    pub lost_at_edge: usize,
    /// The variant hits where there is nothing.
    pub phantoms: usize,
    /// Further phantoms, at an outline that passes the ray within rounding.
    pub phantoms_at_edge: usize,
    /// Another triangle than that hit first, at the same distance.
    pub other_triangle: usize,
}

impl Counts {
    pub fn add(&mut self, verdict: Verdict) {
        self.rays += 1;
        *match verdict {
            Verdict::Right => return,
            Verdict::OtherTriangle => &mut self.other_triangle,
            Verdict::Lost { at_edge: false } => &mut self.lost,
            Verdict::Lost { at_edge: true } => &mut self.lost_at_edge,
            Verdict::Phantom { at_edge: false } => &mut self.phantoms,
            Verdict::Phantom { at_edge: true } => &mut self.phantoms_at_edge,
        } += 1;
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.lost += other.lost;
        self.lost_at_edge += other.lost_at_edge;
        self.phantoms += other.phantoms;
        self.phantoms_at_edge += other.phantoms_at_edge;
        self.other_triangle += other.other_triangle;
    }
}

/// What `answer` is, `first` being the exact one.
pub fn judge(truth: &Truth<'_>, ray: &Ray, first: Option<&First>, answer: Option<&Hit>) -> Verdict {
    let lost = match (first, answer) {
        (None, None) => return Verdict::Right,
        (Some(first), Some(hit)) if first.triangles.contains(&hit.primitive) => {
            return Verdict::Right;
        }
        (Some(_), None) => true,
        (None, Some(_)) => false,
        (Some(first), Some(hit)) => {
            let triangles = [first.triangles[0], hit.primitive].map(Some);
            let scale = Scale::new(truth, ray, triangles);
            let behind = f64::from(hit.t) - first.t;
            if behind.abs() <= scale.t_rounding {
                return Verdict::OtherTriangle;
            }
            behind > 0.0
        }
    };
    if lost {
        let at_edge =
            answer.is_none_or(|hit| is_there(truth, ray, hit)) && may_overlook(truth, ray, answer);
        Verdict::Lost { at_edge }
    } else {
        let at_edge = answer.is_some_and(|hit| is_there(truth, ray, hit));
        Verdict::Phantom { at_edge }
    }
}

/// What rounding comes to.
struct Scale {
    shift: f64,
    t_rounding: f64,
}

impl Scale {
    fn new(truth: &Truth<'_>, ray: &Ray, triangles: [Option<u32>; 2]) -> Self {
        let origin = ray.origin.as_dvec3();
        let largest = triangles
            .into_iter()
            .flatten()
            .flat_map(|triangle| truth.corners(triangle))
            .map(|corner| (corner.as_dvec3() - origin).abs().max_element())
            .fold(0.0, f64::max);
        Self {
            shift: SHIFT * largest,
            t_rounding: T_ROUNDING * largest / f64::from(ray.direction.abs().max_element()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::truth::ExactRay;
    use wide_bvh::{build::Builder, geometry::TriangleMesh};

    /// Two squares, one behind the other: at z = 1 from 0 to 1, at z = 2 from -1 to 2.
    const POSITIONS: [[f32; 3]; 8] = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
        [-1.0, -1.0, 2.0],
        [2.0, -1.0, 2.0],
        [2.0, 2.0, 2.0],
        [-1.0, 2.0, 2.0],
    ];
    const INDICES: [[u32; 3]; 4] = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];

    fn verdict(x: f32, y: f32, answer: Option<(f32, u32)>) -> Verdict {
        let mesh = TriangleMesh::new(&POSITIONS, &INDICES).unwrap();
        let bvh = Builder::new().build(&mesh).unwrap();
        let truth = Truth::new(mesh, &bvh);
        let ray = Ray::new([x, y, 0.0], [0.0, 0.0, 1.0]);
        let first = truth.first(&ExactRay::from(&ray));
        let answer = answer.map(|(t, primitive)| Hit {
            t,
            u: 0.0,
            v: 0.0,
            primitive,
        });
        judge(&truth, &ray, first.as_ref(), answer.as_ref())
    }

    const LOST: Verdict = Verdict::Lost { at_edge: false };
    const PHANTOM: Verdict = Verdict::Phantom { at_edge: false };

    #[test]
    fn in_the_open_there_is_no_mercy() {
        assert_eq!(verdict(0.75, 0.25, Some((1.0, 0))), Verdict::Right);
        assert_eq!(verdict(0.75, 0.25, None), LOST);
        assert_eq!(verdict(0.75, 0.25, Some((2.0, 2))), LOST);
        assert_eq!(verdict(0.75, 0.25, Some((0.5, 1))), PHANTOM);
        assert_eq!(verdict(5.0, 5.0, Some((2.0, 2))), PHANTOM);
        assert_eq!(verdict(5.0, 5.0, None), Verdict::Right);
    }

    #[test]
    fn at_the_diagonal_either_will_do_but_none_will_not() {
        for triangle in [0, 1] {
            assert_eq!(verdict(0.5, 0.5, Some((1.0, triangle))), Verdict::Right);
        }
        assert_eq!(
            verdict(0.500_000_1, 0.5, Some((1.0, 1))),
            Verdict::OtherTriangle
        );
        assert_eq!(verdict(0.5, 0.5, Some((2.0, 2))), LOST);
    }

    #[test]
    fn at_the_outline_within_rounding_is_counted_apart() {
        let at_edge = true;
        assert_eq!(
            verdict(1e-8, 0.3, Some((2.0, 3))),
            Verdict::Lost { at_edge }
        );
        assert_eq!(
            verdict(-1e-8, 0.3, Some((1.0, 1))),
            Verdict::Phantom { at_edge }
        );
        assert_eq!(verdict(1e-5, 0.3, Some((2.0, 3))), LOST);
        assert_eq!(verdict(-1e-5, 0.3, Some((1.0, 1))), PHANTOM);
    }

    /// Two squares side by side that share no corner, as scenes have them where an edge meets the middle of another.
    #[test]
    fn where_triangles_only_touch_a_ray_may_slip_through() {
        let positions = [
            [0.0, -1.0, 1.0],
            [0.0, 3.0, 1.0],
            [-4.0, 0.0, 1.0],
            [0.0, -2.0, 1.0],
            [0.0, 4.0, 1.0],
            [4.0, 0.0, 1.0_f32],
        ];
        let mesh = TriangleMesh::new(&positions, &[[0, 1, 2], [3, 4, 5_u32]]).unwrap();
        let bvh = Builder::new().build(&mesh).unwrap();
        let truth = Truth::new(mesh, &bvh);
        let miss = |x: f32| {
            let ray = Ray::new([x, 0.5, 0.0], [0.0, 0.0, 1.0]);
            judge(
                &truth,
                &ray,
                truth.first(&ExactRay::from(&ray)).as_ref(),
                None,
            )
        };
        for x in [-1e-8, 0.0, 1e-8] {
            assert_eq!(miss(x), Verdict::Lost { at_edge: true });
        }
        assert_eq!(miss(1e-5), LOST);
    }

    #[test]
    fn counts_add_up() {
        let mut counts = Counts::default();
        counts.add(LOST);
        counts.add(Verdict::Right);
        counts += counts;
        assert_eq!((counts.rays, counts.lost, counts.phantoms), (4, 2, 0));
    }
}
