//! Leaves that are nothing but runs of the list of primitive numbers, said by the links that lead to them.

use super::{
    Borrowed, Bvh, LayoutError, Leaves, Listed, Storage, Triangles, WideNode, leaves::OneRay,
};
use crate::{
    geometry::TriangleMesh,
    primitive::triangle::{Exact, Look, Precision, RayShear, TriangleHits},
    simd::{Lanes, RUN_FIRST_BITS, Simd, packed_run},
};
use core::{error::Error, fmt, ops::Range};

/// The most primitives of a run.
pub(crate) const MAX_RUN: usize = 4;
/// The bits of a place that say where a run begins.
const FIRST: u32 = (1 << RUN_FIRST_BITS) - 1;

/// The run at a place.
#[inline(always)]
pub(crate) const fn of_place(place: usize) -> Range<usize> {
    let first = place & FIRST as usize;
    first..first + (place >> RUN_FIRST_BITS & 3) + 1
}

/// Leaves of up to 4 primitives, which are read from an `M`.
#[derive(Clone, Copy, Debug)]
pub struct Runs<M>(M);

/// Leaves of up to 4 primitives, of which the hierarchy knows the numbers alone. What they are is told to each query
/// ([`Primitives`](crate::primitive::Primitives)); or, if they are triangles, to the hierarchy: [`Bvh::over`].
pub type RunLeaf = Runs<()>;
/// Leaves of up to 4 triangles of a mesh, which are read where the mesh has them.
pub type MeshLeaf<'m> = Runs<TriangleMesh<'m>>;

/// A leaf of a run.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct Run<'a, M> {
    of: M,
    primitives: &'a [u32],
    place: u32,
}

/// What leaves' primitives are read from.
#[doc(hidden)]
pub trait Numbered {
    /// Whether a number is where something is to be read.
    const READ: bool;
    /// How many there are, if that is known.
    fn count(&self) -> Option<usize>;
    /// Has it fetched, if so.
    fn fetch<T: Simd>(&self, token: T, number: u32);
}

impl Numbered for () {
    const READ: bool = false;

    fn count(&self) -> Option<usize> {
        None
    }

    fn fetch<T: Simd>(&self, _: T, _: u32) {}
}

impl Numbered for TriangleMesh<'_> {
    const READ: bool = true;

    fn count(&self) -> Option<usize> {
        Some(self.len())
    }

    #[inline(always)]
    fn fetch<T: Simd>(&self, token: T, number: u32) {
        let triangle = self.indices().as_ptr().wrapping_add(number as usize);
        token.prefetch_line(triangle.cast());
    }
}

impl<M: Copy + Numbered> Leaves for Runs<M> {
    type Store<S: Storage> = M;
    type Ref<'a> = Run<'a, M>;

    #[inline(always)]
    fn span(place: usize) -> Range<usize> {
        of_place(place)
    }

    fn only(count: usize) -> Option<u32> {
        (1..=MAX_RUN)
            .contains(&count)
            .then(|| packed_run(0, count as u32))
    }

    fn count<S: Storage>(_: &M, primitives: &[u32]) -> Result<usize, LayoutError> {
        match primitives.len() {
            count if count < FIRST as usize => Ok(count),
            _ => Err(LayoutError::TooLarge),
        }
    }

    fn numbers(primitives: &[u32]) -> u64 {
        let greatest = primitives.iter().max();
        greatest.map_or(0, |&number| u64::from(number) + 1)
    }

    fn known<S: Storage>(of: &M) -> Option<usize> {
        of.count()
    }

    fn borrowed<S: Storage>(of: &M) -> M {
        *of
    }

    #[cfg(feature = "alloc")]
    fn owned<S: Storage>(of: &M) -> M {
        *of
    }

    fn bytes<S: Storage>(_: &M) -> usize {
        0
    }

    #[inline(always)]
    unsafe fn at<'a, S: Storage>(of: &'a M, primitives: &'a [u32], place: usize) -> Run<'a, M> {
        Run {
            of: *of,
            primitives,
            place: place as u32,
        }
    }

    #[inline(always)]
    fn address<S: Storage>(_: &M, primitives: &[u32], place: usize) -> *const u8 {
        let first = place & FIRST as usize;
        primitives.as_ptr().wrapping_add(first).cast()
    }

    const LEADS_ON: bool = M::READ;

    #[inline(always)]
    unsafe fn fetch_next<T: Simd, S: Storage>(token: T, of: &M, primitives: &[u32], place: usize) {
        for place in of_place(place) {
            // SAFETY: the caller's promise: the run is within the list.
            of.fetch(token, unsafe { *primitives.get_unchecked(place) });
        }
    }

    #[inline(always)]
    fn primitives(leaf: Run<M>) -> usize {
        leaf.range().len()
    }
}

impl<M> Run<'_, M> {
    /// Its places in the list.
    #[inline(always)]
    pub(crate) fn range(&self) -> Range<usize> {
        of_place(self.place as usize)
    }
}

impl Listed for Run<'_, ()> {
    #[inline(always)]
    fn places(self) -> Range<usize> {
        self.range()
    }
}

impl Triangles for Run<'_, TriangleMesh<'_>> {
    type Precision = Exact;
    type Lanes<S: Simd> = S::F32x4;

    #[inline(always)]
    fn first(self) -> usize {
        self.range().start
    }

    #[inline(always)]
    fn count(self) -> usize {
        self.range().len()
    }

    #[inline(always)]
    fn look<S: Simd>(self, token: S, ray: &RayShear) -> Look<S::F32x4> {
        let (indices, positions) = (self.of.indices(), self.of.positions());
        let Range { start, end } = self.range();
        let mut triangles = [&[0; 3]; MAX_RUN];
        for (lane, triangle) in triangles.iter_mut().enumerate() {
            // SAFETY: the layout's check saw that the run is within the list, and, as `over` has, that every number of the
            // list is within the mesh.
            *triangle = unsafe {
                let number = *self.primitives.get_unchecked((start + lane).min(end - 1));
                indices.get_unchecked(number as usize)
            };
        }
        // No closure: it would not inherit the target's features.
        let nowhere = [S::F32x4::splat(token, 0.0); 3];
        let mut corners = [nowhere; 3];
        for corner in 0..3 {
            let mut vertices = [&[0.0; 3]; MAX_RUN];
            for (vertex, triangle) in vertices.iter_mut().zip(triangles) {
                // SAFETY: a mesh's indices are within its positions.
                *vertex = unsafe { positions.get_unchecked(triangle[corner] as usize) };
            }
            corners[corner] = token.coordinates(vertices);
        }
        let [a, b, c] = corners;
        let corners = [
            ray.shear(token, a),
            ray.shear(token, b),
            ray.shear(token, c),
        ];
        Look::new(token, corners, self.lanes())
    }

    #[inline(always)]
    fn finish<S: Simd, P: Precision, const NEED_T: bool>(
        self,
        token: S,
        ray: &RayShear,
        look: Look<S::F32x4>,
        t_max: f32,
    ) -> Option<TriangleHits<S::F32x4>> {
        look.finish::<4, NEED_T, P, _>(token, ray, t_max, OneRay(self, ray))
    }

    #[inline(always)]
    fn triangle(self, lane: usize) -> [[f32; 3]; 3] {
        let (indices, positions) = (self.of.indices(), self.of.positions());
        let Range { start, end } = self.range();
        // SAFETY: as above.
        unsafe {
            let number = *self.primitives.get_unchecked((start + lane).min(end - 1));
            let [a, b, c] = *indices.get_unchecked(number as usize);
            [
                *positions.get_unchecked(a as usize),
                *positions.get_unchecked(b as usize),
                *positions.get_unchecked(c as usize),
            ]
        }
    }
}

impl<N: WideNode, S: Storage> Bvh<N, RunLeaf, S> {
    /// The hierarchy over the triangles of `mesh`, which is the one that it was built on.
    ///
    /// Of another mesh, queries find what they find: some of its triangles, no more.
    ///
    /// # Errors
    /// The mesh has no triangle of some number that is in a leaf.
    pub fn over<'a>(
        &'a self,
        mesh: &TriangleMesh<'a>,
    ) -> Result<Bvh<N, MeshLeaf<'a>, Borrowed<'a>>, MeshTooSmall> {
        if self.numbers > mesh.len() as u64 {
            return Err(MeshTooSmall {
                triangles: mesh.len(),
                needed: self.numbers,
            });
        }
        Ok(self.with_leaves(*mesh))
    }
}

impl<'m, N: WideNode, S: Storage> Bvh<N, MeshLeaf<'m>, S> {
    /// The mesh whose triangles these are.
    pub fn mesh(&self) -> &TriangleMesh<'m> {
        self.leaf_store()
    }
}

/// A mesh has fewer triangles than a hierarchy that was to be put over it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshTooSmall {
    /// How many triangles the mesh has.
    pub triangles: usize,
    /// How many it must have at least.
    pub needed: u64,
}

impl fmt::Display for MeshTooSmall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { triangles, needed } = self;
        match triangles {
            0 => write!(f, "no mesh, where one of {needed} triangles is needed"),
            _ => write!(
                f,
                "a mesh of {triangles} triangles, where {needed} are needed"
            ),
        }
    }
}

impl Error for MeshTooSmall {}
