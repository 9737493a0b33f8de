//! A caller's own primitives.

use crate::{
    geometry::{Aabb, Ray},
    simd::Portable,
    slab::{PreparedRay, primitive_interval},
};

/// Primitives that the caller keeps and intersects: spheres, curves, voxels, whole objects.
///
/// The contract (the same answer as brute force, bit for bit) holds for these too, whatever the
/// rounding of [`intersect`](Self::intersect): a hit counts if the ray passes the primitive's own
/// box, and its `t` is put into the interval in which it does so. The boxes must be those that the
/// hierarchy was built on; if they are not, hits may be lost, and nothing worse.
///
/// Copies of a mesh, each in a place of its own, are primitives whose intersection is the mesh's:
///
/// ```
/// use wide_bvh::{
///     Aabb, Builder, Bvh8, Hit, Ray, TriangleMesh,
///     glam::{Affine3A, Vec3},
///     layout::PrimitiveBvh8,
///     primitive::Primitives,
/// };
///
/// struct Copies<'a> {
///     mesh: &'a Bvh8,
///     /// From the world to where the mesh is as it was built.
///     inverses: Vec<Affine3A>,
///     aabbs: Vec<Aabb>,
/// }
///
/// impl Primitives for Copies<'_> {
///     /// Of the mesh: which triangle of the copy, and where.
///     type Detail = Hit;
///
///     fn aabb(&self, copy: u32) -> Aabb {
///         self.aabbs[copy as usize]
///     }
///
///     fn intersect(&self, copy: u32, ray: &Ray) -> Option<(f32, Hit)> {
///         let inverse = &self.inverses[copy as usize];
///         // Not normalised: `t` is then the same there and here.
///         let ray = Ray {
///             origin: inverse.transform_point3(ray.origin),
///             direction: inverse.transform_vector3(ray.direction),
///             ..*ray
///         };
///         self.mesh.closest_hit(&ray).map(|hit| (hit.t, hit))
///     }
/// }
///
/// let positions = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0_f32]];
/// let mesh = Builder::new().build(&TriangleMesh::new(&positions, &[[0, 1, 2_u32]])?)?;
/// let places = [0.0, 2.0, 4.0].map(|x| Affine3A::from_translation(Vec3::new(x, 0.0, -x)));
/// let corners = |place: Affine3A| positions.map(|corner| place.transform_point3(corner.into()));
/// let copies = Copies {
///     mesh: &mesh,
///     inverses: places.iter().map(Affine3A::inverse).collect(),
///     aabbs: places.iter().map(|&place| Aabb::from_points(corners(place))).collect(),
/// };
/// let scene: PrimitiveBvh8 = Builder::new().build_primitives(&copies.aabbs)?;
///
/// let hit = scene.closest_hit(&copies, &Ray::new([2.2, 0.2, 0.0], [0.0, 0.0, 1.0])).unwrap();
/// assert_eq!((hit.primitive, hit.t, hit.detail.primitive), (1, 3.0, 0));
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub trait Primitives {
    /// What the caller wants to know of a hit beyond `t`: coordinates, a normal, a part's number.
    type Detail: Copy;

    /// The bounds of primitive number `primitive`. What has bounds that are empty or not finite is never hit.
    fn aabb(&self, primitive: u32) -> Aabb;

    /// The least `t` within the ray's range at which it meets primitive number `primitive`.
    ///
    /// The ray is the caller's own, whatever has been found already: the answer must depend on
    /// the arguments alone.
    fn intersect(&self, primitive: u32, ray: &Ray) -> Option<(f32, Self::Detail)>;
}

/// The closest intersection of a ray with a caller's primitives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveHit<D> {
    /// Where along the ray, in multiples of its direction. Within the ray's range.
    pub t: f32,
    /// Which primitive.
    pub primitive: u32,
    /// What [`Primitives::intersect`] said of it.
    pub detail: D,
}

/// The scaled `t` at which a primitive is hit, if it counts: the one definition of a hit on a
/// caller's primitive.
#[inline]
pub(crate) fn intersect<P: Primitives + ?Sized>(
    primitives: &P,
    primitive: u32,
    ray: &Ray,
    prepared: &PreparedRay,
) -> Option<(f32, P::Detail)> {
    let aabb = primitives.aabb(primitive);
    if aabb.is_empty() || !aabb.is_finite() {
        return None;
    }
    let (lo, hi) = (aabb.min.to_array(), aabb.max.to_array());
    let relative = |bound: [f32; 3]| {
        [0, 1, 2].map(|axis| wide::f32x4::splat(bound[axis] - prepared.ray.origin[axis]))
    };
    let reciprocals = prepared.reciprocals(Portable);
    let interval = primitive_interval(Portable, reciprocals, relative(lo), relative(hi));
    let (near, far) = (interval.0.to_array()[0], interval.1.to_array()[0]);
    if !(near <= far && near <= prepared.ray.t_max && prepared.ray.t_min <= far) {
        return None;
    }
    let (t, detail) = primitives.intersect(primitive, ray)?;
    if !t.is_finite() {
        return None;
    }
    // Adding 0 turns -0 into 0, for ties to be ties.
    let t = prepared.scaled(t).max(near).min(far) + 0.0;
    (t.is_finite() && prepared.ray.t_min <= t && t <= prepared.ray.t_max).then_some((t, detail))
}
