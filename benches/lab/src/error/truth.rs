//! The true first hit of a ray: the triangles and the ray as the floats say, without rounding.
//!
//! Signs and comparisons come from `f64` where its error bound leaves no doubt, and from whole numbers of any length
//! where it does. A tree finds the candidates: this crate's boxes, widened a hundred times more than any
//! of its arithmetic could be off, so that no mistake of the tree's own margins can hide a triangle.

use glam::{DVec3, Vec3};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, float::FloatCore};
use std::cmp::Ordering;
use wide_bvh::{
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{Bvh8, Child, ChildKind, Leaf, WideNode},
};

/// A ray in `f64`: those of `f32` exactly, and others a little beside them.
#[derive(Clone, Copy, Debug)]
pub struct ExactRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// Least and greatest `t`.
    pub range: [f64; 2],
}

impl From<&Ray> for ExactRay {
    fn from(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.as_dvec3(),
            direction: ray.direction.as_dvec3(),
            range: [ray.t_min, ray.t_max].map(f64::from),
        }
    }
}

/// Where a ray meets a triangle, each number off by at most 2^-40: `t` of itself, `u` and `v` of 1.
#[derive(Clone, Copy, Debug)]
pub struct Exact {
    pub t: f64,
    pub u: f64,
    pub v: f64,
}

/// The first hit.
#[derive(Clone, Debug)]
pub struct First {
    pub t: f64,
    /// The triangles hit there: several where the ray meets a shared edge exactly, or one thing lies in another.
    pub triangles: Vec<u32>,
}

/// Where `ray` meets the triangle within its range. Edges and corners belong to it; a triangle seen exactly edge-on
/// is not met.
pub fn intersect(ray: &ExactRay, corners: [Vec3; 3]) -> Option<Exact> {
    match estimate(ray, corners) {
        Estimate::Hit(hit) => Some(hit),
        Estimate::Miss => None,
        Estimate::Unsure => Whole::new(ray, corners).hit_within(ray.range),
    }
}

enum Estimate {
    Hit(Exact),
    Miss,
    Unsure,
}

/// More than what a product of three numbers, two of them rounded, and a sum of six such can be off, relative to
/// the sum of their magnitudes: 9 roundings.
const VOLUME_ERROR: f64 = f64::EPSILON * 8.0;
/// How far, relative to it, `t` and the weights' sum may be off for `f64` to be good enough.
const GOOD: f64 = f64::EPSILON * 2048.0;

/// In `f64`, if that is certain.
fn estimate(ray: &ExactRay, corners: [Vec3; 3]) -> Estimate {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - ray.origin);
    let (wa, wa_error) = volume(ray.direction, b, c);
    let (wb, wb_error) = volume(ray.direction, c, a);
    let (wc, wc_error) = volume(ray.direction, a, b);
    let weights = [(wa, wa_error), (wb, wb_error), (wc, wc_error)];
    if weights.iter().any(|&(w, error)| w > error) && weights.iter().any(|&(w, error)| w < -error) {
        return Estimate::Miss;
    }
    let (height, height_error) = volume(a, b, c);
    let determinant = wa + wb + wc;
    let sum_error = wa_error + wb_error + wc_error;
    let sure = weights.iter().all(|&(w, error)| w.abs() > error)
        && height_error <= GOOD * height.abs()
        && sum_error <= GOOD * determinant.abs();
    let t = height / determinant;
    let clear_of = |end: f64| (t - end).abs() > 4.0 * GOOD * t.abs();
    if !sure || !ray.range.into_iter().all(clear_of) {
        return Estimate::Unsure;
    }
    if t < ray.range[0] || t > ray.range[1] {
        return Estimate::Miss;
    }
    Estimate::Hit(Exact {
        t,
        u: wb / determinant,
        v: wc / determinant,
    })
}

/// The triple product, and a bound of its error.
fn volume(p: DVec3, q: DVec3, r: DVec3) -> (f64, f64) {
    let magnitude = DVec3::new(
        (q.y * r.z).abs() + (q.z * r.y).abs(),
        (q.z * r.x).abs() + (q.x * r.z).abs(),
        (q.x * r.y).abs() + (q.y * r.x).abs(),
    );
    (
        p.dot(q.cross(r)),
        VOLUME_ERROR * p.abs().dot(magnitude) + f64::MIN_POSITIVE,
    )
}

/// The same without rounding, in whole numbers: all coordinates are multiples of one power of two, and all
/// components of the direction of another.
struct Whole {
    /// How much each corner counts, times the determinant.
    weights: [BigInt; 3],
    determinant: BigInt,
    /// `None` for a miss.
    t: Option<BigRational>,
}

type WholeVector = [BigInt; 3];

impl Whole {
    fn new(ray: &ExactRay, corners: [Vec3; 3]) -> Self {
        let corners = corners.map(|corner| corner.as_dvec3());
        let [a, b, c] = corners;
        let unit = lowest_bit(&[a, b, c, ray.origin]);
        let direction_unit = lowest_bit(&[ray.direction]);
        let origin = whole(ray.origin, unit);
        let [a, b, c] = corners.map(|corner| {
            let corner = whole(corner, unit);
            [0, 1, 2].map(|axis| &corner[axis] - &origin[axis])
        });
        let direction = whole(ray.direction, direction_unit);
        let mut weights =
            [(&b, &c), (&c, &a), (&a, &b)].map(|(p, q)| dot(&direction, &cross(p, q)));
        let mut determinant: BigInt = weights.iter().sum();
        let mut height = dot(&a, &cross(&b, &c));
        if determinant.is_negative() {
            weights = weights.map(|w| -w);
            determinant = -determinant;
            height = -height;
        }
        let inside = determinant.is_positive() && !weights.iter().any(Signed::is_negative);
        let t = inside.then(|| {
            let shift = (unit - direction_unit).unsigned_abs();
            if unit >= direction_unit {
                height <<= shift;
                BigRational::new_raw(height, determinant.clone())
            } else {
                BigRational::new_raw(height, &determinant << shift)
            }
        });
        Self {
            weights,
            determinant,
            t,
        }
    }

    fn hit_within(&self, [least, most]: [f64; 2]) -> Option<Exact> {
        let t = self.t.as_ref()?;
        let beyond = BigRational::from_float(most).is_some_and(|most| *t > most);
        let before = BigRational::from_float(least).is_some_and(|least| *t < least);
        if beyond || before {
            return None;
        }
        let float = |x: &BigRational| x.to_f64().expect("as large as floats, or rounded");
        let weight = |w: &BigInt| float(&BigRational::new_raw(w.clone(), self.determinant.clone()));
        Some(Exact {
            t: float(t),
            u: weight(&self.weights[1]),
            v: weight(&self.weights[2]),
        })
    }
}

/// The power of two that all components of all vectors are multiples of.
fn lowest_bit(vectors: &[DVec3]) -> i32 {
    let of_float = |x: f64| {
        let (mantissa, exponent, _) = x.integer_decode();
        i32::from(exponent) + mantissa.trailing_zeros() as i32
    };
    let components = vectors.iter().flat_map(|v| v.to_array());
    let bits = components.filter(|&x| x != 0.0).map(of_float);
    bits.min().unwrap_or(0)
}

/// A vector in multiples of 2^`unit`, which divides it.
fn whole(v: DVec3, unit: i32) -> WholeVector {
    v.to_array().map(|x| {
        let (mantissa, exponent, sign) = x.integer_decode();
        let shift = i32::from(exponent) - unit;
        let size = if shift >= 0 {
            BigInt::from(mantissa) << shift
        } else {
            BigInt::from(mantissa) >> -shift
        };
        size * sign
    })
}

fn dot(p: &WholeVector, q: &WholeVector) -> BigInt {
    p.iter().zip(q).map(|(p, q)| p * q).sum()
}

fn cross(p: &WholeVector, q: &WholeVector) -> WholeVector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &p[i] * &q[j] - &p[j] * &q[i])
}

/// The truth about one mesh.
pub struct Truth<'a> {
    mesh: TriangleMesh<'a>,
    bvh: &'a Bvh8,
    /// The triangles at each position, in order.
    at: Vec<(Position, u32)>,
}

/// A position's bits.
type Position = [u32; 3];

fn position(corner: Vec3) -> Position {
    // Adding 0 turns -0 into 0.
    corner.to_array().map(|x| (x + 0.0).to_bits())
}

/// By how much boxes are widened, relative to the largest coordinate that there is.
const WIDENED: f64 = 1e-5;

impl<'a> Truth<'a> {
    /// Of `mesh`, which `bvh` was built on.
    pub fn new(mesh: TriangleMesh<'a>, bvh: &'a Bvh8) -> Self {
        let triangles = (0..mesh.len()).filter_map(|triangle| mesh.triangle(triangle));
        let corners = triangles
            .zip(0..)
            .flat_map(|(corners, triangle)| corners.map(|corner| (position(corner), triangle)));
        let mut at: Vec<_> = corners.collect();
        at.sort_unstable();
        Self { mesh, bvh, at }
    }

    /// Where the ray meets triangle number `triangle`.
    pub fn hit(&self, ray: &ExactRay, triangle: u32) -> Option<Exact> {
        intersect(ray, self.corners(triangle))
    }

    /// The corners of triangle number `triangle`.
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.mesh
            .triangle(triangle as usize)
            .expect("a triangle of the mesh")
    }

    /// The triangles that have a corner where `corner` is.
    pub fn triangles_at(&self, corner: Vec3) -> impl Iterator<Item = u32> {
        let position = position(corner);
        let start = self.at.partition_point(|&(other, _)| other < position);
        let there = move |entry: &&(Position, u32)| entry.0 == position;
        self.at[start..]
            .iter()
            .take_while(there)
            .map(|&(_, triangle)| triangle)
    }

    /// The first hit within the ray's range.
    pub fn first(&self, ray: &ExactRay) -> Option<First> {
        self.first_without(ray, &[])
    }

    /// The first hit within the ray's range if some triangles were not there.
    pub fn first_without(&self, ray: &ExactRay, left_out: &[u32]) -> Option<First> {
        let mut first = None;
        let mut stack = vec![(f64::NEG_INFINITY, self.bvh.root())];
        let slabs = Slabs::new(ray, self.bvh.bounds());
        while let Some((near, child)) = stack.pop() {
            let past = |first: &First| near > first.t;
            if first.as_ref().is_some_and(past) {
                continue;
            }
            match child.kind() {
                ChildKind::Empty => {}
                ChildKind::Node(index) => {
                    let node = &self.bvh.nodes()[index];
                    let from = stack.len();
                    for lane in 0..8 {
                        if node.child(lane) == Child::EMPTY {
                            break;
                        }
                        if let Some(near) = slabs.enter(&node.child_aabb(lane)) {
                            stack.push((near, node.child(lane)));
                        }
                    }
                    stack[from..].sort_by(|(a, _), (b, _)| b.total_cmp(a));
                }
                ChildKind::Leaf(index) => {
                    let places = self.bvh.leaves()[index].primitives();
                    for place in places {
                        let triangle = self.bvh.primitives()[place as usize];
                        if !left_out.contains(&triangle) {
                            self.meet(ray, triangle, &mut first);
                        }
                    }
                }
            }
        }
        first
    }

    /// Takes a triangle into account.
    fn meet(&self, ray: &ExactRay, triangle: u32, first: &mut Option<First>) {
        let Some(hit) = self.hit(ray, triangle) else {
            return;
        };
        let order = match &*first {
            None => Ordering::Less,
            Some(first) => self.compare(ray, (hit.t, triangle), (first.t, first.triangles[0])),
        };
        match (order, &mut *first) {
            // A tree may hold parts of one triangle in several leaves.
            (Ordering::Equal, Some(first)) if !first.triangles.contains(&triangle) => {
                first.triangles.push(triangle);
            }
            (Ordering::Less, _) => {
                *first = Some(First {
                    t: hit.t,
                    triangles: vec![triangle],
                });
            }
            _ => {}
        }
    }

    /// Which of two triangles that are hit is hit first.
    fn compare(&self, ray: &ExactRay, a: (f64, u32), b: (f64, u32)) -> Ordering {
        if (a.0 - b.0).abs() > 4.0 * GOOD * a.0.abs().max(b.0.abs()) {
            return a.0.total_cmp(&b.0);
        }
        let [a, b] = [a, b].map(|(_, triangle)| Whole::new(ray, self.corners(triangle)).t);
        a.cmp(&b)
    }
}

/// Ray against widened boxes.
struct Slabs<'a> {
    ray: &'a ExactRay,
    widened: f64,
}

impl<'a> Slabs<'a> {
    fn new(ray: &'a ExactRay, bounds: &Aabb) -> Self {
        let largest = bounds.min.abs().max(bounds.max.abs()).as_dvec3() + ray.origin.abs();
        Self {
            ray,
            widened: WIDENED * largest.max_element(),
        }
    }

    /// From which `t` on the ray is in the box, if it is within its range.
    fn enter(&self, aabb: &Aabb) -> Option<f64> {
        let [mut near, mut far] = self.ray.range;
        let low = aabb.min.as_dvec3() - self.widened - self.ray.origin;
        let high = aabb.max.as_dvec3() + self.widened - self.ray.origin;
        for axis in 0..3 {
            let (low, high, direction) = (low[axis], high[axis], self.ray.direction[axis]);
            if direction == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (low / direction, high / direction);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some(near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;
    use num_traits::Zero;
    use wide_bvh::build::Builder;
    use wide_bvh_scenes::{Mesh, shapes};

    /// The definition, in rational numbers.
    struct Rational {
        /// How much each corner counts, times the determinant.
        weights: [BigRational; 3],
        determinant: BigRational,
        /// `t` times the determinant.
        height: BigRational,
    }

    type RationalVector = [BigRational; 3];

    impl Rational {
        fn new(ray: &ExactRay, corners: [Vec3; 3]) -> Self {
            let origin = rational(ray.origin);
            let [a, b, c] = corners.map(|corner| {
                let corner = rational(corner.as_dvec3());
                [0, 1, 2].map(|axis| &corner[axis] - &origin[axis])
            });
            let direction = rational(ray.direction);
            let weights =
                [(&b, &c), (&c, &a), (&a, &b)].map(|(p, q)| dot(&direction, &cross(p, q)));
            Self {
                determinant: weights.iter().sum(),
                height: dot(&a, &cross(&b, &c)),
                weights,
            }
        }

        fn t(&self) -> Option<BigRational> {
            let zero = BigRational::zero();
            let one_side =
                self.weights.iter().all(|w| *w >= zero) || self.weights.iter().all(|w| *w <= zero);
            (one_side && !self.determinant.is_zero()).then(|| &self.height / &self.determinant)
        }

        fn hit_within(&self, [least, most]: [f64; 2]) -> Option<Exact> {
            let t = self.t()?;
            let beyond = BigRational::from_float(most).is_some_and(|most| t > most);
            let before = BigRational::from_float(least).is_some_and(|least| t < least);
            if beyond || before {
                return None;
            }
            let float = |x: &BigRational| x.to_f64().expect("as large as floats, or rounded");
            let [_, u, v] = self
                .weights
                .each_ref()
                .map(|w| float(&(w / &self.determinant)));
            Some(Exact { t: float(&t), u, v })
        }
    }

    fn rational(v: DVec3) -> RationalVector {
        v.to_array()
            .map(|x| BigRational::from_float(x).expect("finite"))
    }

    fn dot(p: &RationalVector, q: &RationalVector) -> BigRational {
        p.iter().zip(q).map(|(p, q)| p * q).sum()
    }

    fn cross(p: &RationalVector, q: &RationalVector) -> RationalVector {
        [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &p[i] * &q[j] - &p[j] * &q[i])
    }

    /// By rational numbers alone, each triangle in turn.
    fn brute_force(mesh: &TriangleMesh<'_>, ray: &ExactRay) -> Option<(BigRational, Vec<u32>)> {
        let mut first: Option<(BigRational, Vec<u32>)> = None;
        for triangle in 0..mesh.len() {
            let exact = Rational::new(ray, mesh.triangle(triangle).unwrap());
            if exact.hit_within(ray.range).is_none() {
                continue;
            }
            let t = exact.t().unwrap();
            match &mut first {
                Some((least, triangles)) if t == *least => triangles.push(triangle as u32),
                Some((least, _)) if t > *least => {}
                _ => first = Some((t, vec![triangle as u32])),
            }
        }
        first
    }

    /// Rays between random points, at corners, at points of edges and along axes; from corners, too.
    fn rays(mesh: &Mesh, count: usize) -> Vec<Ray> {
        let mut rng = Rng::with_seed(3);
        let (min, max) = mesh.bounds();
        let (min, size) = (Vec3::from(min), Vec3::from(max) - Vec3::from(min));
        let corner = |rng: &mut Rng| -> Vec3 {
            let triangle = mesh.indices[rng.usize(..mesh.indices.len())];
            mesh.positions[triangle[rng.usize(..3)] as usize].into()
        };
        (0..count)
            .map(|i| {
                let point = |rng: &mut Rng| {
                    min + size * Vec3::from([(); 3].map(|()| rng.f32() * 1.4 - 0.2))
                };
                let from = if i % 3 == 0 {
                    corner(&mut rng)
                } else {
                    point(&mut rng)
                };
                let to = match i % 4 {
                    0 => point(&mut rng),
                    1 => corner(&mut rng),
                    2 => corner(&mut rng).midpoint(corner(&mut rng)),
                    _ => from.with_z(from.z + 1.0),
                };
                Ray::new(from, to - from).with_range(if i % 5 == 0 { 1e-3 } else { 0.0 }, 10.0)
            })
            .filter(|ray| ray.direction != Vec3::ZERO)
            .collect()
    }

    #[test]
    fn tree_and_filter_find_what_rational_brute_force_finds() {
        let (mut hits, mut ties) = (0, 0);
        for mesh in [
            shapes::soup(30, 7),
            shapes::quantised(shapes::icosphere(1), 8),
            shapes::cuboid([-1.0; 3], [1.0; 3]),
        ] {
            let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
            let bvh = Builder::new().build(&view).unwrap();
            let truth = Truth::new(view, &bvh);
            for ray in rays(&mesh, 200) {
                let ray = ExactRay::from(&ray);
                let found = truth.first(&ray);
                let expected = brute_force(&view, &ray);
                assert_eq!(found.is_some(), expected.is_some(), "{ray:?}");
                let Some((mut found, (t, triangles))) = found.zip(expected) else {
                    continue;
                };
                let t = t.to_f64().unwrap();
                assert!((found.t - t).abs() <= t.abs() * GOOD * 2.0, "{ray:?}");
                found.triangles.sort_unstable();
                assert_eq!(found.triangles, triangles, "{ray:?}");
                hits += 1;
                ties += usize::from(triangles.len() > 1);
            }
        }
        assert!(hits > 200 && ties > 30, "{hits} hits, {ties} ties");
    }

    #[test]
    fn what_the_filter_decides_is_right_and_it_decides_most() {
        let mesh = shapes::soup(400, 11);
        let view = TriangleMesh::new(&mesh.positions, &mesh.indices).unwrap();
        let (mut decided, mut all) = (0, 0);
        for (ray, triangle) in rays(&mesh, 2000).iter().zip((0..view.len()).cycle()) {
            let ray = ExactRay::from(ray);
            let corners = view.triangle(triangle).unwrap();
            let exact = Rational::new(&ray, corners).hit_within(ray.range);
            all += 1;
            match (estimate(&ray, corners), exact) {
                (Estimate::Unsure, _) => {
                    let whole = Whole::new(&ray, corners).hit_within(ray.range);
                    assert_eq!(whole.is_some(), exact.is_some(), "{ray:?}, {corners:?}");
                    continue;
                }
                (Estimate::Miss, None) => {}
                (Estimate::Hit(hit), Some(exact)) => {
                    assert!((hit.t - exact.t).abs() <= exact.t.abs() * GOOD * 2.0);
                    assert!((hit.u - exact.u).abs() <= GOOD * 2.0);
                    assert!((hit.v - exact.v).abs() <= GOOD * 2.0);
                }
                (_, exact) => panic!("{ray:?}, {corners:?}: {exact:?}"),
            }
            decided += 1;
        }
        assert!(decided * 10 > all * 8, "{decided} of {all}");
    }
}
