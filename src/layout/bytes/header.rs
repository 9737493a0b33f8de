//! The first bytes: what follows, and how much of it.

use super::{ALIGN, BytesError};
#[cfg(feature = "alloc")]
use crate::layout::{Bvh, Storage};
use crate::{
    geometry::Aabb,
    layout::{WideNode, bytes::InBytes},
};
use bytemuck::{Pod, Zeroable};
use core::ops::Range;

/// Leaves of [`TriangleLeaf`](crate::layout::TriangleLeaf).
pub(in crate::layout) const TRIANGLE_LEAVES: u32 = 1;
/// Leaves of [`PrimitiveLeaf`](crate::layout::PrimitiveLeaf).
pub(in crate::layout) const PRIMITIVE_LEAVES: u32 = 2;
/// Leaves that are runs of the list of primitive numbers.
pub(in crate::layout) const RUNS: u32 = 3;
/// Leaves that are runs of primitives in their order: there is no list.
pub(in crate::layout) const ORDERED_RUNS: u32 = 4;

/// The first 128 bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Header {
    magic: [u8; 8],
    /// 0x01020304, in the byte order of the machine that wrote it.
    byte_order: u32,
    version: u32,
    /// 1 to 4: of 4 children, of 8, compact of 4, compact of 8.
    pub node_kind: u32,
    /// 1 to 4: of triangles, of a caller's primitives, runs of the list of numbers, runs of primitives in their order.
    pub leaf_kind: u32,
    nodes: u32,
    leaves: u32,
    pub(super) primitives: u32,
    positions: u32,
    triangles: u32,
    pub(super) dropped: u32,
    /// x, y, z of the least corner, then of the greatest.
    bounds: [f32; 6],
    pub(super) checksum: u32,
    reserved: [u32; 13],
}

const _: () = assert!(size_of::<Header>() == 128);

const MAGIC: [u8; 8] = *b"wide-bvh";
const BYTE_ORDER: u32 = 0x0102_0304;

impl Header {
    /// The version of the format that is written and read.
    pub const VERSION: u32 = 2;

    /// That of a hierarchy with so many leaves, positions and triangles.
    ///
    /// # Errors
    /// More positions than can be counted.
    #[cfg(feature = "alloc")]
    pub(super) fn new<N: WideNode, L: InBytes>(
        bvh: &Bvh<N, L, impl Storage>,
        leaves: usize,
        positions: usize,
        triangles: usize,
    ) -> Result<Self, BytesError> {
        let Aabb { min, max } = *bvh.bounds();
        Ok(Self {
            magic: MAGIC,
            byte_order: BYTE_ORDER,
            version: Self::VERSION,
            node_kind: N::KIND,
            leaf_kind: L::KIND,
            nodes: bvh.nodes().len() as u32,
            leaves: leaves as u32,
            primitives: bvh.primitive_count() as u32,
            positions: u32::try_from(positions).map_err(|_| BytesError::TooMany("positions"))?,
            triangles: triangles as u32,
            dropped: bvh.dropped() as u32,
            bounds: [min.x, min.y, min.z, max.x, max.y, max.z],
            ..Self::zeroed()
        })
    }

    /// The header of a file: the kinds tell which hierarchy to open it as.
    ///
    /// # Errors
    /// There is none, or none that is known here.
    pub fn read(bytes: &[u8]) -> Result<Self, BytesError> {
        let first = bytes.get(..size_of::<Self>());
        let first = first.ok_or(BytesError::NoHeader(bytes.len()))?;
        let header: Self = bytemuck::pod_read_unaligned(first);
        if header.magic != MAGIC {
            return Err(BytesError::NotAHierarchy);
        }
        if header.byte_order != BYTE_ORDER {
            return Err(BytesError::ByteOrder);
        }
        if header.version != Self::VERSION {
            return Err(BytesError::Version(header.version));
        }
        Ok(header)
    }

    /// # Errors
    /// Other nodes or leaves.
    pub(super) fn expect(&self, nodes: u32, leaves: u32) -> Result<(), BytesError> {
        let (found, expected) = (self.node_kind, nodes);
        if found != expected {
            return Err(BytesError::Nodes { expected, found });
        }
        let (found, expected) = (self.leaf_kind, leaves);
        if found != expected {
            return Err(BytesError::Leaves { expected, found });
        }
        Ok(())
    }

    /// Where nodes, leaves, primitives, positions and indices are, all within the bytes.
    ///
    /// # Errors
    /// What such hierarchies have none of is counted, or there are more bytes or fewer than for those.
    pub(super) fn sections<N: WideNode, L: InBytes>(
        &self,
        bytes: &[u8],
    ) -> Result<[Range<usize>; 5], BytesError> {
        let none = [
            ("leaves", self.leaves, L::SIZE == 0),
            ("positions", self.positions, !L::MESH),
            ("triangles", self.triangles, !L::MESH),
            ("reserved", self.reserved.iter().fold(0, |a, b| a | b), true),
        ];
        for (field, value, is_none) in none {
            if is_none && value != 0 {
                return Err(BytesError::NotZero(field));
            }
        }
        let (_, end) = self.ends::<N, L>();
        if end != bytes.len() as u64 {
            return Err(BytesError::Length {
                expected: end,
                found: bytes.len(),
            });
        }
        Ok(self.places::<N, L>())
    }

    /// The sections' places, none of which is past what a `usize` counts.
    pub(super) fn places<N: WideNode, L: InBytes>(&self) -> [Range<usize>; 5] {
        let place = |Range { start, end }: Range<u64>| start as usize..end as usize;
        self.ends::<N, L>().0.map(place)
    }

    /// How many bytes there are in all.
    #[cfg(feature = "alloc")]
    pub(super) fn len<N: WideNode, L: InBytes>(&self) -> usize {
        self.ends::<N, L>().1 as usize
    }

    /// The sections' places, and where the last one's padding ends.
    fn ends<N: WideNode, L: InBytes>(&self) -> ([Range<u64>; 5], u64) {
        let lengths = [
            u64::from(self.nodes) * size_of::<N>() as u64,
            u64::from(self.leaves) * L::SIZE as u64,
            u64::from(self.primitives) * if L::LISTED { 4 } else { 0 },
            u64::from(self.positions) * 12,
            u64::from(self.triangles) * 12,
        ];
        // 2^32 of the largest of each are far below 2^64.
        let mut at = size_of::<Self>() as u64;
        let sections = lengths.map(|length| {
            let start = at;
            at = (at + length).next_multiple_of(ALIGN as u64);
            start..start + length
        });
        (sections, at)
    }

    /// The bounds of all primitives.
    pub(super) fn bounds(&self) -> Aabb {
        let [ax, ay, az, bx, by, bz] = self.bounds;
        Aabb::new([ax, ay, az].into(), [bx, by, bz].into())
    }
}
