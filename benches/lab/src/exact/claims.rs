//! What the crate's documents claim of one ray and one triangle, checked without rounding.
//!
//! Let u = 2^-24, M the largest distance of a corner from the ray's origin on any axis, Z the largest along the axis of
//! the shear (both no less than 2^-70), and x', y', z the corners after the shear, as computed. Brute force over the one
//! triangle, t without bounds, is held to these:
//!
//! 1. x' and y' are within 7uM of the exact shear X - Z·(d.x / d.z), corner by corner.
//! 2. It hits just when 0 is in the closed triangle of x' and y', which is not degenerate, nor is that of the mesh.
//! 3. It differs from the definition in space ([`intersect`]) only where the line passes an edge that near: some edge
//!    function p × q of exact shears p and q is no larger than what corners moved by δ = 7uM on each axis can
//!    change it by, δ·(|p.x| + |p.y| + |q.x| + |q.y|) + 2δ².
//! 4. t is within B = uZ / |d.z| + 272·u|t| of t* = Σ w·z / d.z, with the exact weights w of 0 in the triangle of x' and
//!    y', and u and v are within 8u·X·Y / |det| + 5u of those weights, where X and Y are the largest |x'| and |y'|;
//! 5. or else the ray at t is within 4uM, on each axis, of the point that u and v are the weights of, which are none below
//!    0 and not above 1, nor is their sum, but for a rounding.
//! 6. t is within B + δ·(|n.x| + |n.y|) / |n·d| of the t of the definition, where both hit and n is the triangle's normal: a
//!    point δ beside the ray leaves the plane by no more.
//! 7. The box test passes the least box of floats around P = Σ w·corner, in a scene of the triangle alone, w being the
//!    weights of 4 or those of 5, for t as far as computed and no farther: on every backend, in nodes of either width. And
//!    it passes the triangle's own box wherever the ray, by definition, meets it.
//! 8. It passes every box that the ray comes within 7uD of on the axes x and y of the shear where it is at the box's
//!    place along z, D being the largest of |scene bound| + |o| on any axis; and it still does where the range of t ends, or
//!    begins, uD / |d.z| + 264·u|t| from there. That is no less than what the proof in `src/slab` has of the triangle
//!    test, and uses up what roundings of the box test itself leave of K_BOX and K_RELATIVE: they are no larger than they
//!    have to be for it.
//! 9. The test of a bundle, of this ray and one whose origin, which planes are taken from, is on the other side of the
//!    scene, passes such a box, too; and one within 12uD, for its margin has more room for roundings than they take
//!    where no reciprocal is cut off.
//!
//! 1 to 3 leave no room: which triangles are hit is decided by rounding within δ of an edge alone, and
//! then as the rounded corners say. Where scenes are beyond 2^76 the crate promises less, and nothing is checked.

use super::{
    cuboid,
    number::{Number, Point, abs, between_floats, cross, dot, exact, point, sub},
    sheared::Sheared,
    triangle::{ExactHit, intersect, is_degenerate},
};
use glam::Vec3;
use wide_bvh::{
    geometry::{Aabb, Hit, Ray, TriangleMesh},
    layout::{Child, Node4, Node8, WideNode},
    reference,
    simd::Backend,
    traverse::sweep::{count_boxes, count_boxes_of_bundle},
};

/// The unit roundoff.
const U: f32 = 1.0 / (1 << 24) as f32;
/// No distance counts for less when errors are bounded: what a result that is denormal may lose.
pub const MIN_EXTENT: f32 = 1.0 / (1_u128 << 70) as f32;
/// How far corners are moved by rounding: claim 1.
pub const K_SHEAR: f32 = 7.0;
/// How far t is off, of t itself: claim 4.
pub const K_RELATIVE: f32 = 272.0;
/// What claim 8 uses of it: the rest is for the box test's own roundings.
const K_RELATIVE_USED: f32 = 264.0;
/// How far the ray at t is from where u and v say: claim 5.
pub const K_PLACE: f32 = 4.0;
/// What claim 9 uses of the bundle's margin of 24, of which roundings take less than 12.
const K_BUNDLE_USED: f32 = 12.0;
/// Directions' components are not cut off from here.
const MIN_DIRECTION: f32 = 1.0 / (1_u64 << 47) as f32;

/// What brute force says of a triangle by itself, whatever t.
///
/// # Errors
/// The first claim that does not hold, with figures.
pub fn check(ray: &Ray, corners: [Vec3; 3]) -> Result<Option<Hit>, String> {
    let ray = ray.with_range(f32::NEG_INFINITY, f32::INFINITY);
    let hit = brute_force(&ray, corners);
    let Some(sheared) = Sheared::new(&ray, corners) else {
        return match hit {
            None => Ok(None),
            Some(_) => Err(format!("a ray that makes no sense: {hit:?}")),
        };
    };
    if !corners.iter().all(|corner| corner.is_finite()) || !sheared.is_ordinary(&ray) {
        return Ok(hit);
    }

    let claims = Claims {
        ray: &ray,
        corners,
        exact_corners: corners.map(point),
        exact_direction: point(ray.direction),
        exact_origin: point(ray.origin),
        delta: exact(K_SHEAR) * exact(U) * exact(sheared.distance().max(MIN_EXTENT)),
        sheared: &sheared,
    };
    claims.shear()?;
    let weights = claims.weights();
    if hit.is_some() != weights.is_some() {
        return Err(format!(
            "claim 2: {hit:?}, but by the exact signs of {:?}: {}",
            sheared.corners,
            if weights.is_some() { "a hit" } else { "a miss" }
        ));
    }
    let defined = intersect(
        &claims.exact_origin,
        &claims.exact_direction,
        &claims.exact_corners,
    );
    if hit.is_some() != defined.is_some() && !claims.is_near_an_edge() {
        return Err(format!(
            "claim 3: {hit:?}, by definition {}",
            show(defined.as_ref())
        ));
    }
    if let (Some(hit), Some(weights)) = (&hit, &weights) {
        let weights = claims.place(hit, weights)?;
        claims.t(hit, defined.as_ref())?;
        claims.least_box(hit, &weights)?;
        claims.boxes_beside(hit, &weights)?;
    }
    claims.own_box()?;
    Ok(hit)
}

fn brute_force(ray: &Ray, corners: [Vec3; 3]) -> Option<Hit> {
    let mesh = TriangleMesh::new(&corners, &[[0, 1, 2_u32]]).expect("three corners");
    reference::closest_hit(&mesh, ray)
}

fn show(hit: Option<&ExactHit>) -> String {
    hit.map_or("a miss".into(), |hit| {
        let [t, u, v] = [&hit.t, &hit.u, &hit.v].map(|x| x.to_f64_fast());
        format!("a hit, t about {t:e}, u {u:e}, v {v:e}")
    })
}

struct Claims<'a> {
    ray: &'a Ray,
    corners: [Vec3; 3],
    sheared: &'a Sheared,
    exact_origin: Point,
    exact_direction: Point,
    exact_corners: [Point; 3],
    delta: Number,
}

impl Claims<'_> {
    /// The corners' exact shear, in multiples of d.z.
    fn exact_shear(&self) -> [[Number; 2]; 3] {
        let [x, y, z] = self.sheared.axes;
        let d = &self.exact_direction;
        self.exact_corners.each_ref().map(|corner| {
            let moved = sub(corner, &self.exact_origin);
            [x, y].map(|axis| &moved[axis] * &d[z] - &moved[z] * &d[axis])
        })
    }

    /// The magnitude of d.z.
    fn length(&self) -> Number {
        abs(&self.exact_direction[self.sheared.axes[2]])
    }

    fn shear(&self) -> Result<(), String> {
        let dz = &self.exact_direction[self.sheared.axes[2]];
        let most = &self.delta * self.length();
        for (computed, exactly) in self.sheared.corners.iter().zip(self.exact_shear()) {
            for (computed, exactly) in [computed.x, computed.y].into_iter().zip(exactly) {
                let off = abs(&(exact(computed) * dz - exactly));
                if off > most {
                    let bounds = (off / &most).to_f64_fast();
                    return Err(format!(
                        "claim 1: {computed} is off by {bounds} times the bound"
                    ));
                }
            }
        }
        Ok(())
    }

    /// The weights of the corners, of sum 1, at which the computed triangle has 0; `None` for a miss.
    fn weights(&self) -> Option<[Number; 3]> {
        let [a, b, c] = self
            .sheared
            .corners
            .map(|corner| [exact(corner.x), exact(corner.y)]);
        let edge = |p: &[Number; 2], q: &[Number; 2]| &p[0] * &q[1] - &p[1] * &q[0];
        let weights = [edge(&b, &c), edge(&c, &a), edge(&a, &b)];
        let zero = Number::ZERO;
        let inside = weights.iter().all(|w| *w >= zero) || weights.iter().all(|w| *w <= zero);
        let sum = &weights[0] + &weights[1] + &weights[2];
        let hit = inside && sum != zero && !is_degenerate(&self.exact_corners);
        hit.then(|| weights.map(|w| w / &sum))
    }

    fn is_near_an_edge(&self) -> bool {
        // All in multiples of d.z.
        let [a, b, c] = self.exact_shear();
        let delta = &self.delta * self.length();
        let is_near = |p: &[Number; 2], q: &[Number; 2]| {
            let size = abs(&p[0]) + abs(&p[1]) + abs(&q[0]) + abs(&q[1]);
            let edge = abs(&(&p[0] * &q[1] - &p[1] * &q[0]));
            edge <= &delta * (size + exact(2.0) * &delta)
        };
        is_near(&a, &b) || is_near(&b, &c) || is_near(&c, &a)
    }

    /// Σ w·z / d.z
    fn t_star(&self, weights: &[Number; 3]) -> Number {
        let [a, b, c] = self.sheared.corners.map(|corner| exact(corner.z));
        let z = &weights[0] * a + &weights[1] * b + &weights[2] * c;
        z / &self.exact_direction[self.sheared.axes[2]]
    }

    /// How far t may be off t*. Besides the bound, what is lost where t is denormal in the caller's unit.
    fn t_bound(&self, t: f32) -> Number {
        let z = exact(self.sheared.depth().max(MIN_EXTENT));
        exact(U) * z / self.length()
            + exact(K_RELATIVE) * exact(U) * abs(&exact(t))
            + exact(f32::from_bits(1))
    }

    /// Whether t is more than a float holds in the caller's unit.
    fn is_far(hit: &Hit) -> bool {
        !hit.t.is_finite() || hit.t.abs() == f32::MAX
    }

    /// The weights of P: those of claim 4, or else of claim 5.
    fn place(&self, hit: &Hit, weights: &[Number; 3]) -> Result<[Number; 3], String> {
        let (t_star, bound) = (self.t_star(weights), self.t_bound(hit.t));
        let off = abs(&(exact(hit.t) - &t_star));
        let of_t = (off / bound).to_f64_fast();
        let of_weights = self.weights_off(hit, weights);
        if (Self::is_far(hit) || of_t <= 1.0) && of_weights <= 1.0 {
            return Ok(weights.clone());
        }
        let (u, v) = (exact(hit.u), exact(hit.v));
        let first = exact(1.0) - &u - &v;
        let given = [first, u, v];
        let most = exact(K_PLACE) * exact(U) * exact(self.sheared.distance().max(MIN_EXTENT));
        let is_there = (0..3).all(|axis| {
            let at_t = &self.exact_origin[axis] + &self.exact_direction[axis] * exact(hit.t);
            let [a, b, c] = self.exact_corners.each_ref().map(|corner| &corner[axis]);
            let at_uv = &given[0] * a + &given[1] * b + &given[2] * c;
            // In the caller's unit t may be denormal.
            let direction = abs(&self.exact_direction[axis]);
            let most = &most + direction * exact(f32::from_bits(1));
            Self::is_far(hit) || abs(&(at_t - at_uv)) <= most
        });
        let is_inside = given[0] >= exact(-2.0 * U) && hit.u >= 0.0 && hit.v >= 0.0;
        if is_there && is_inside {
            return Ok(given);
        }
        let t = t_star.to_f64_fast();
        Err(format!(
            "claims 4 and 5: {hit:?}, t* = {t:e}: off by {of_t} times the bound, a weight by {of_weights} times, and not \
             where they say: there: {is_there}, inside: {is_inside}"
        ))
    }

    /// How far u and v are off, in bounds of claim 4.
    fn weights_off(&self, hit: &Hit, weights: &[Number; 3]) -> f64 {
        let corners = self
            .sheared
            .corners
            .map(|corner| [exact(corner.x), exact(corner.y)]);
        let [a, b, c] = &corners;
        let [ab, ac] = [b, c].map(|p| [&p[0] - &a[0], &p[1] - &a[1]]);
        let determinant = abs(&(&ab[0] * &ac[1] - &ab[1] * &ac[0]));
        let largest = |axis: usize| {
            let [a, b, c] = corners.each_ref().map(|corner| abs(&corner[axis]));
            a.max(b).max(c)
        };
        let bound = exact(U) * (exact(8.0) * largest(0) * largest(1) / determinant + exact(5.0));
        let off = |computed: f32, exactly: &Number| {
            (abs(&(exact(computed) - exactly)) / &bound).to_f64_fast()
        };
        off(hit.u, &weights[1]).max(off(hit.v, &weights[2]))
    }

    /// Claim 6.
    fn t(&self, hit: &Hit, defined: Option<&ExactHit>) -> Result<(), String> {
        let Some(defined) = defined.filter(|_| !Self::is_far(hit)) else {
            return Ok(());
        };
        let [a, b, c] = &self.exact_corners;
        let normal = cross(&sub(b, a), &sub(c, a));
        let [x, y, _] = self.sheared.axes;
        let slope = (abs(&normal[x]) + abs(&normal[y])) / abs(&dot(&normal, &self.exact_direction));
        let bound = self.t_bound(hit.t) + &self.delta * slope;
        let off = abs(&(exact(hit.t) - &defined.t));
        if off > bound {
            let (defined, bounds) = (show(Some(defined)), (off / bound).to_f64_fast());
            return Err(format!(
                "claim 6: {hit:?}, by definition {defined}: off by {bounds} bounds"
            ));
        }
        Ok(())
    }

    /// Claim 7 for the least box around P.
    fn least_box(&self, hit: &Hit, weights: &[Number; 3]) -> Result<(), String> {
        // Beyond, t in the caller's unit is not what the box test compares with.
        let scaled = self.sheared.scale != 1.0;
        if !hit.t.is_finite() || scaled && !(1e-30..1e30).contains(&hit.t.abs()) && hit.t != 0.0 {
            return Ok(());
        }
        let (low, high) = self.least_box_around(weights);
        let ray = self.ray.with_range(hit.t, hit.t);
        self.passes(&Aabb::new(low, high), &Aabb::EMPTY, &ray)
            .map_err(|backend| format!("claim 7: {hit:?} is lost in {low}, {high} by {backend}"))
    }

    fn least_box_around(&self, weights: &[Number; 3]) -> (Vec3, Vec3) {
        let [a, b, c] = &self.exact_corners;
        let ends = [0, 1, 2].map(|axis| {
            let [wa, wb, wc] = weights;
            between_floats(&(wa * &a[axis] + wb * &b[axis] + wc * &c[axis]))
        });
        (ends.map(|end| end.0).into(), ends.map(|end| end.1).into())
    }

    /// Claim 7 for the triangle's box, by definition.
    fn own_box(&self) -> Result<(), String> {
        let aabb = Aabb::from_points(self.corners);
        let Some(interval) = cuboid::interval(&self.exact_origin, &self.exact_direction, &aabb)
        else {
            return Ok(());
        };
        if interval
            .iter()
            .any(|t| abs(t) > exact(1e30) || abs(t) < exact(1e-30) && *t != Number::ZERO)
        {
            return Ok(());
        }
        let [(from, _), (_, to)] = interval.each_ref().map(between_floats);
        self.passes(&aabb, &Aabb::EMPTY, &self.ray.with_range(from, to))
            .map_err(|backend| {
                format!("claim 7: the box that is met from {from} to {to} is lost by {backend}")
            })
    }

    /// Claims 8 and 9, for boxes of one point each.
    fn boxes_beside(&self, hit: &Hit, weights: &[Number; 3]) -> Result<(), String> {
        let (scene, origin) = (Aabb::from_points(self.corners), self.ray.origin);
        let extent = (scene.min.abs().max(scene.max.abs()) + origin.abs()).max_element();
        let scaled = self.sheared.scale != 1.0;
        if scaled || !(1e-15..1e15).contains(&extent) {
            return Ok(());
        }
        let choice = (hit.t.to_bits() ^ hit.u.to_bits()) as usize;
        let t_star = self.t_star(weights);
        let extent = exact(extent.next_down());
        let early =
            exact(U) * &extent / self.length() + exact(K_RELATIVE_USED) * exact(U) * abs(&t_star);
        let infinity = f32::INFINITY;
        let (t_min, t_max) = match choice / 2 % 3 {
            0 => (-infinity, infinity),
            1 => (-infinity, between_floats(&(&t_star - early)).1),
            _ => (between_floats(&(&t_star + early)).0, infinity),
        };
        let ray = self.ray.with_range(t_min, t_max);
        let unit = exact(U) * extent;
        let lost = |claim, Aabb { min, max }, by| {
            format!("claim {claim}: {min}, {max} from {t_min} to {t_max} is lost by {by}")
        };
        if let Some(aabb) = self.box_beside(&t_star, &(exact(K_SHEAR) * &unit), choice) {
            self.passes(&aabb, &aabb, &ray)
                .map_err(|backend| lost(8, aabb, backend))?;
        }
        if let Some(aabb) = self.box_beside(&t_star, &(exact(K_BUNDLE_USED) * &unit), choice) {
            self.bundle_passes(&aabb, &ray)
                .map_err(|backend| lost(9, aabb, backend))?;
        }
        Ok(())
    }

    /// A box of one point that is met as late along one axis, for being so far beside the ray, as it is left early along
    /// the other; `choice` says which. `None` where floats are too far apart.
    fn box_beside(&self, t: &Number, beside: &Number, choice: usize) -> Option<Aabb> {
        let [x, y, z] = self.sheared.axes;
        let [late, soon] = [[x, y], [y, x]][choice % 2];
        let mut aabb = Aabb::EMPTY;
        for (axis, sign) in [(late, 1.0), (soon, -1.0), (z, 0.0)] {
            let place = &self.exact_origin[axis] + &self.exact_direction[axis] * t;
            let sign = sign * self.ray.direction[axis].signum();
            let (low, high) = between_floats(&(&place + exact(sign) * beside));
            // Beside the ray, the float on its side.
            (aabb.min[axis], aabb.max[axis]) = match sign {
                1.0 => (low, low),
                -1.0 => (high, high),
                _ => (low, high),
            };
            if sign != 0.0 && abs(&(exact(aabb.min[axis]) - place)) > *beside {
                return None;
            }
        }
        Some(aabb)
    }

    /// Whether every box test passes `aabb` in a scene of this triangle and `more`; else which does not.
    fn passes(&self, aabb: &Aabb, more: &Aabb, ray: &Ray) -> Result<(), String> {
        let scene = Aabb::from_points(self.corners).join(*more);
        for backend in Backend::available() {
            for (width, passed) in [
                (4, count::<Node4>(backend, aabb, &scene, ray)),
                (8, count::<Node8>(backend, aabb, &scene, ray)),
            ] {
                if passed != 1 {
                    return Err(format!("{width}-wide, {}", backend.name()));
                }
            }
        }
        Ok(())
    }

    /// The same of the test of a bundle, in a scene of this triangle and the box.
    fn bundle_passes(&self, aabb: &Aabb, ray: &Ray) -> Result<(), String> {
        if ray.direction.abs().min_element() < MIN_DIRECTION {
            return Ok(());
        }
        let scene = Aabb::from_points(self.corners).join(*aabb);
        let mut first = *ray;
        first.origin = -ray.origin;
        let node = Node8::from_children([(*aabb, Child::leaf(0))]);
        for backend in Backend::available() {
            let rays = [first, *ray];
            let passed = count_boxes_of_bundle(backend, &[node], &scene, &rays);
            if passed == Some(0) {
                return Err(format!("a bundle, {}", backend.name()));
            }
        }
        Ok(())
    }
}

fn count<N: WideNode>(backend: Backend, aabb: &Aabb, scene: &Aabb, ray: &Ray) -> u32 {
    let node = N::from_children([(*aabb, Child::leaf(0))]);
    count_boxes(backend, &[node], scene, ray)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claims_hold_for_random_triangles() {
        let mut random = fastrand::Rng::with_seed(3);
        let (mut hits, mut misses) = (0, 0);
        for i in 0..1000 {
            let mut any = || Vec3::from([(); 3].map(|()| random.f32() - 0.5));
            let corners = [any(), any(), any()];
            let origin = any() * 10.0;
            let target = if i % 2 == 0 {
                corners[0]
            } else {
                corners[0].lerp(any(), 0.5)
            };
            match check(&Ray::new(origin, target - origin), corners) {
                Ok(Some(_)) => hits += 1,
                Ok(None) => misses += 1,
                Err(broken) => panic!("{broken}"),
            }
        }
        assert!(hits > 200 && misses > 200, "{hits} {misses}");
    }

    #[test]
    fn rays_and_triangles_that_make_no_sense_are_missed() {
        let corners = [Vec3::X, Vec3::Y, Vec3::Z];
        for ray in [
            Ray::new([0.0; 3], [0.0; 3]),
            Ray::new([0.0; 3], [f32::NAN, 1.0, 1.0]),
            Ray::new([f32::INFINITY; 3], [1.0; 3]),
        ] {
            assert_eq!(check(&ray, corners), Ok(None));
        }
        let ray = Ray::new([0.0; 3], [1.0; 3]);
        assert!(check(&ray, corners).unwrap().is_some());
        assert_eq!(
            check(&ray, [Vec3::X, Vec3::Y, Vec3::splat(f32::NAN)]),
            Ok(None)
        );
        assert_eq!(
            check(&ray, [Vec3::ZERO, Vec3::ONE, Vec3::ONE * 2.0]),
            Ok(None)
        );
    }

    /// A claim that is broken is seen: answers for a triangle are held against another's.
    #[test]
    fn broken_claims_are_seen() {
        let ray = Ray::new([0.0, 0.0, -1.0], [0.1, 0.2, 1.0]);
        let corners = [
            Vec3::new(-1.0, -1.0, 0.5),
            Vec3::new(2.0, -1.0, 0.7),
            Vec3::new(0.0, 2.0, 0.1),
        ];
        let sheared = Sheared::new(&ray, corners).unwrap();
        let claims = Claims {
            ray: &ray,
            corners,
            exact_corners: corners.map(point),
            exact_direction: point(ray.direction),
            exact_origin: point(ray.origin),
            delta: exact(K_SHEAR) * exact(U) * exact(sheared.distance()),
            sheared: &sheared,
        };
        let weights = claims.weights().unwrap();
        let defined = intersect(
            &claims.exact_origin,
            &claims.exact_direction,
            &claims.exact_corners,
        );
        let hit = brute_force(&ray, corners).unwrap();
        assert!(claims.shear().is_ok() && !claims.is_near_an_edge());
        assert_eq!(claims.place(&hit, &weights).as_ref(), Ok(&weights));
        assert!(claims.t(&hit, defined.as_ref()).is_ok());
        assert!(claims.least_box(&hit, &weights).is_ok());

        let off = Hit {
            t: hit.t * (1.0 + 1e-4),
            ..hit
        };
        let error = claims.t(&off, defined.as_ref()).unwrap_err();
        assert!(error.starts_with("claim 6"), "{error}");
        let aside = Hit {
            v: hit.v + 1e-5,
            ..hit
        };
        for hit in [off, aside] {
            let error = claims.place(&hit, &weights).unwrap_err();
            assert!(error.starts_with("claims 4 and 5"), "{error}");
        }
        let far = Hit {
            t: hit.t + 0.1,
            ..hit
        };
        assert!(
            claims
                .least_box(&far, &weights)
                .unwrap_err()
                .starts_with("claim 7")
        );

        let mut moved = sheared;
        moved.corners[1].x += 1e-5;
        let claims = Claims {
            sheared: &moved,
            ..claims
        };
        assert!(claims.shear().unwrap_err().starts_with("claim 1"));
    }
}
