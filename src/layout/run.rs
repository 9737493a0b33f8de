//! Leaves that are nothing but runs of primitives, said by the links that lead to them.

use super::{
    Borrowed, Bvh, ByList, Gather, InOrder, LayoutError, Leaves, Listed, Order, Storage,
    TriangleLeaf, Triangles, WideNode, gather::Gathering, leaves::in_lanes, order::Part,
};
#[cfg(feature = "std")]
use super::{Child, ChildKind};
use crate::{
    geometry::TriangleMesh,
    primitive::triangle::{Exact, Look, RayShear, Sheared},
    simd::{MAX_RUN, RUN_FIRST_BITS, Simd, packed_run},
};
use core::{error::Error, fmt, marker::PhantomData, mem::MaybeUninit, ops::Range, ptr};

/// The bits of a place that say where a run begins.
const FIRST: u32 = (1 << RUN_FIRST_BITS) - 1;

/// How many vertices are fetched at once for the leaves of a node.
pub(crate) const VERTICES: usize = 16;
/// The bytes of their cache lines, wherever in one they begin.
const VERTEX_LINES: usize = size_of::<[[f32; 3]; VERTICES]>() + 64;

/// The run at a place.
#[inline(always)]
pub(crate) const fn of_place(place: usize) -> Range<usize> {
    let first = place & FIRST as usize;
    first..first + (place >> RUN_FIRST_BITS & (MAX_RUN - 1)) + 1
}

/// The run that a child is, if it is a leaf.
#[cfg(feature = "std")]
pub(crate) fn of_child(child: Child) -> Option<Range<usize>> {
    match child.kind() {
        ChildKind::Leaf(place) => Some(of_place(place)),
        _ => None,
    }
}

/// Leaves of up to 4 primitives, which are read from an `M`, and known by a list of numbers or by their order.
#[derive(Clone, Copy, Debug)]
pub struct Runs<M, O = ByList>(PhantomData<(M, O)>);

/// Leaves of up to 4 primitives, of which the hierarchy knows the numbers alone. What they are is told to each query
/// ([`Primitives`](crate::primitive::Primitives)); or, if they are triangles, to the hierarchy: [`Bvh::over`].
pub type RunLeaf = Runs<()>;
/// Leaves of up to 4 triangles of a mesh, which are read where the mesh has them.
pub type MeshLeaf<'m> = Runs<TriangleMesh<'m>>;
/// As [`RunLeaf`], of primitives that are in the order of leaves: so there are no numbers to be known. [`Bvh::reorder`]
/// makes such.
pub type OrderedLeaf = Runs<(), InOrder>;
/// As [`MeshLeaf`], of triangles that are in the order of leaves.
pub type OrderedMeshLeaf<'m> = Runs<TriangleMesh<'m>, InOrder>;

/// A leaf of a run.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct Run<'a, M, O> {
    of: M,
    primitives: &'a [u32],
    place: u32,
    order: PhantomData<O>,
}

/// What leaves' primitives are read from.
#[doc(hidden)]
pub trait Numbered {
    /// How many there are, if that is known.
    fn count(&self) -> Option<usize>;
    /// Where one is, if it is to be read here.
    fn address(&self, number: u32) -> *const u8;
    /// Has fetched what one is made of.
    ///
    /// # Safety
    /// There is such a one.
    unsafe fn fetch_parts<T: Simd>(&self, token: T, number: usize);
    /// Has fetched [as many](VERTICES) parts that several are made of, from one on, which need not be there.
    fn fetch_from<T: Simd>(&self, token: T, part: usize);
}

impl Numbered for () {
    fn count(&self) -> Option<usize> {
        None
    }

    #[inline(always)]
    fn address(&self, _: u32) -> *const u8 {
        ptr::null()
    }

    #[inline(always)]
    unsafe fn fetch_parts<T: Simd>(&self, _: T, _: usize) {}

    #[inline(always)]
    fn fetch_from<T: Simd>(&self, _: T, _: usize) {}
}

impl Numbered for TriangleMesh<'_> {
    fn count(&self) -> Option<usize> {
        Some(self.len())
    }

    #[inline(always)]
    fn address(&self, number: u32) -> *const u8 {
        let indices = self.indices().as_ptr();
        indices.wrapping_add(number as usize).cast()
    }

    #[inline(always)]
    unsafe fn fetch_parts<T: Simd>(&self, token: T, number: usize) {
        // SAFETY: the caller's promise.
        let vertices = unsafe { self.indices().get_unchecked(number) };
        for &vertex in vertices {
            let positions = self.positions().as_ptr();
            token.prefetch_line(positions.wrapping_add(vertex as usize).cast());
        }
    }

    #[inline(always)]
    fn fetch_from<T: Simd>(&self, token: T, vertex: usize) {
        let first = self.positions().as_ptr().wrapping_add(vertex);
        token.prefetch_bytes(first.cast(), VERTEX_LINES);
    }
}

impl<M: Part + Numbered, O: Order> super::leaves::sealed::Sealed for Runs<M, O> {}

impl<M: Part + Numbered, O: Order> Leaves for Runs<M, O> {
    type Store<S: Storage> = O::Over<M>;
    type Ref<'a> = Run<'a, M, O>;
    const LISTED: bool = O::LISTED;

    #[inline(always)]
    fn span(place: usize) -> Range<usize> {
        of_place(place)
    }

    fn only(count: usize) -> Option<u32> {
        (1..=MAX_RUN)
            .contains(&count)
            .then(|| packed_run(0, count as u32))
    }

    #[inline(always)]
    fn len<S: Storage>(over: &O::Over<M>, primitives: &[u32]) -> usize {
        O::len(over, primitives)
    }

    fn count<S: Storage>(over: &O::Over<M>, primitives: &[u32]) -> Result<usize, LayoutError> {
        match O::len(over, primitives) {
            count if count < FIRST as usize => Ok(count),
            _ => Err(LayoutError::TooLarge),
        }
    }

    fn numbers<S: Storage>(over: &O::Over<M>, primitives: &[u32]) -> u64 {
        if !O::LISTED {
            return O::len(over, primitives) as u64;
        }
        let greatest = primitives.iter().max();
        greatest.map_or(0, |&number| u64::from(number) + 1)
    }

    fn known<S: Storage>(over: &O::Over<M>) -> Option<usize> {
        O::of(over).count()
    }

    fn unknown<S: Storage>(over: &O::Over<M>, primitives: &[u32]) -> Option<usize> {
        let known = O::of(over).count()?;
        if O::LISTED {
            return primitives.iter().position(|&id| id as usize >= known);
        }
        (O::len(over, primitives) > known).then_some(known)
    }

    fn borrowed<S: Storage>(over: &O::Over<M>) -> O::Over<M> {
        *over
    }

    #[cfg(feature = "alloc")]
    fn owned<S: Storage>(over: &O::Over<M>) -> O::Over<M> {
        *over
    }

    fn bytes<S: Storage>(_: &O::Over<M>) -> usize {
        0
    }

    #[inline(always)]
    unsafe fn at<'a, S: Storage>(
        over: &'a O::Over<M>,
        primitives: &'a [u32],
        place: usize,
    ) -> Run<'a, M, O> {
        Run {
            of: *O::of(over),
            primitives,
            place: place as u32,
            order: PhantomData,
        }
    }

    #[inline(always)]
    fn address<S: Storage>(over: &O::Over<M>, primitives: &[u32], place: usize) -> *const u8 {
        let first = place as u32 & FIRST;
        if O::LISTED {
            primitives.as_ptr().wrapping_add(first as usize).cast()
        } else {
            O::of(over).address(first)
        }
    }

    #[inline(always)]
    unsafe fn fetch_next<T: Simd, S: Storage>(
        token: T,
        over: &O::Over<M>,
        primitives: &[u32],
        place: usize,
    ) {
        for place in of_place(place) {
            // SAFETY: the caller's promise: the run is within the list, or of primitives that are there.
            unsafe {
                if O::LISTED {
                    let number = *primitives.get_unchecked(place);
                    token.prefetch_line(O::of(over).address(number));
                } else {
                    O::of(over).fetch_parts(token, place);
                }
            }
        }
    }

    #[inline(always)]
    fn fetch_vertices<T: Simd, S: Storage>(token: T, over: &O::Over<M>, first: usize) {
        if !O::LISTED {
            O::of(over).fetch_from(token, first);
        }
    }

    #[inline(always)]
    fn primitives(leaf: Run<M, O>) -> usize {
        leaf.range().len()
    }
}

impl<M, O> Run<'_, M, O> {
    /// The places of its primitives.
    #[inline(always)]
    pub(crate) fn range(&self) -> Range<usize> {
        of_place(self.place as usize)
    }
}

impl Listed for Run<'_, (), ByList> {
    #[inline(always)]
    fn places(self) -> Range<usize> {
        self.range()
    }
}

impl<O: Order> Triangles for Run<'_, TriangleMesh<'_>, O> {
    type Precision = Exact;
    in_lanes!(four);

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
        let triangles = [
            self.vertices(0),
            self.vertices(1),
            self.vertices(2),
            self.vertices(3),
        ];
        // SAFETY: triangles of the mesh.
        let corners = unsafe {
            [
                self.shear(token, ray, triangles, 0),
                self.shear(token, ray, triangles, 1),
                self.shear(token, ray, triangles, 2),
            ]
        };
        Look::new(token, corners, self.lanes())
    }

    #[inline(always)]
    fn triangle(self, lane: usize) -> [[f32; 3]; 3] {
        // SAFETY: vertices of a triangle of the mesh.
        self.vertices(lane)
            .map(|vertex| unsafe { *self.position(vertex) })
    }
}

impl<O: Order> Gather for Run<'_, TriangleMesh<'_>, O> {
    type Gathered<'a> = &'a TriangleLeaf;

    #[inline(always)]
    fn gather(self, from: usize, room: &mut MaybeUninit<TriangleLeaf>) -> &TriangleLeaf {
        let mut gathering = Gathering::NONE;
        for lane in from..self.count() {
            // SAFETY: vertices of a triangle of the mesh.
            let vertex = |number| (number, unsafe { self.position(number) });
            if !gathering.add(self.vertices(lane).map(vertex)) {
                break;
            }
        }
        room.write(gathering.leaf(self.first() + from))
    }
}

impl<'a, O: Order> Run<'a, TriangleMesh<'a>, O> {
    /// The vertices of the triangle in a lane; past the last, its.
    #[inline(always)]
    fn vertices(&self, lane: usize) -> &'a [u32; 3] {
        let Range { start, end } = self.range();
        let place = (start + lane).min(end - 1);
        // SAFETY: the layout's check saw that the run is within the list, if there is one, and, as `over` has, that every
        // number is within the mesh.
        unsafe {
            let number = match O::LISTED {
                true => *self.primitives.get_unchecked(place) as usize,
                false => place,
            };
            self.of.indices().get_unchecked(number)
        }
    }

    /// Where a vertex is.
    ///
    /// # Safety
    /// It is one of a triangle of the mesh.
    #[inline(always)]
    unsafe fn position(&self, vertex: u32) -> &'a [f32; 3] {
        // SAFETY: the caller's promise: a mesh's indices are within its positions.
        unsafe { self.of.positions().get_unchecked(vertex as usize) }
    }

    /// The same corner of all triangles as the ray sees it.
    ///
    /// # Safety
    /// The triangles are the mesh's.
    #[inline(always)]
    unsafe fn shear<S: Simd>(
        &self,
        token: S,
        ray: &RayShear,
        [a, b, c, d]: [&[u32; 3]; MAX_RUN],
        corner: usize,
    ) -> Sheared<S::F32x4> {
        // SAFETY: the caller's promise.
        let points = unsafe {
            [
                self.position(a[corner]),
                self.position(b[corner]),
                self.position(c[corner]),
                self.position(d[corner]),
            ]
        };
        ray.shear(token, token.coordinates(points))
    }
}

impl<N: WideNode, O: Order, S: Storage> Bvh<N, Runs<(), O>, S> {
    /// The hierarchy over the triangles of `mesh`, which is the one that it was built on.
    ///
    /// Of another mesh, queries find what they find: some of its triangles, no more.
    ///
    /// # Errors
    /// The mesh has no triangle of some number that is in a leaf.
    pub fn over<'a>(
        &'a self,
        mesh: &TriangleMesh<'a>,
    ) -> Result<Bvh<N, Runs<TriangleMesh<'a>, O>, Borrowed<'a>>, MeshTooSmall> {
        if self.numbers > mesh.len() as u64 {
            return Err(MeshTooSmall {
                triangles: mesh.len(),
                needed: self.numbers,
            });
        }
        Ok(self.with_leaves(O::counted(*mesh, self.primitive_count())))
    }
}

impl<'m, N: WideNode, O: Order, S: Storage> Bvh<N, Runs<TriangleMesh<'m>, O>, S> {
    /// The mesh whose triangles these are.
    pub fn mesh(&self) -> &TriangleMesh<'m> {
        O::of(self.leaf_store())
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
