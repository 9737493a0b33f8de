//! A bundle at a leaf: packets against its triangles, or, where rays are few, a ray against all of them. To find any hit, rays
//! that are scattered over packets are put into new ones.

use super::{
    Bundle, first_packet, packet_mask, packets_of,
    shears::{Asked, Shears},
};
use crate::{
    layout::{Gather, Gathered, Triangles},
    primitive::triangle::bits,
    simd::Vector,
    slab::{PreparedRay, most},
    traverse::query::Query,
};
use core::{array, mem::MaybeUninit};

/// No more rays than this at a leaf are tested one by one, against its triangles where they are.
const FEW_AT_LEAF: u32 = 3;
/// No more rays than this of a packet there are tested one by one, against its triangles brought together.
const FEW_IN_PACKET: u32 = 2;

impl<'a, const LANES: usize, V: Vector<LANES>> Bundle<'a, LANES, V> {
    /// Tests the leaf's triangles for some of the rays.
    #[inline(always)]
    pub(super) fn test_leaf<Q: Query>(
        &mut self,
        token: V::Token,
        leaf: impl Gather,
        primitives: &[u32],
        rays: u64,
    ) {
        if rays.count_ones() <= FEW_AT_LEAF {
            let (mut new, mut left) = (0, rays);
            while let Some(index) = first_packet::<LANES>(&mut left) {
                let asked = self.asked(index, rays);
                let packet = self.packet(index);
                let of_packet = packet.test_by_ray::<Q>(token, leaf, primitives, asked);
                new |= u64::from(of_packet) << (LANES * index);
            }
            return self.note::<Q>(token, new);
        }
        let scattered =
            !Q::CLOSEST && packets_of::<LANES>(rays) > rays.count_ones().div_ceil(LANES as u32);
        let (mut from, mut room) = (0, MaybeUninit::uninit());
        while from < leaf.count() {
            let triangles = leaf.gather(from, &mut room);
            from += triangles.count();
            let rays = rays & self.looking;
            let new = if scattered {
                self.test_scattered::<Q>(token, triangles, primitives, rays)
            } else {
                self.test_by_packet::<Q>(token, triangles, primitives, rays)
            };
            self.note::<Q>(token, new);
        }
    }

    /// Tests triangles that are brought together, for each packet as it is. The rays that have a new best hit.
    #[inline(always)]
    fn test_by_packet<Q: Query>(
        &mut self,
        token: V::Token,
        triangles: impl Gathered,
        primitives: &[u32],
        rays: u64,
    ) -> u64 {
        let (mut new, mut left) = (0, rays);
        while let Some(index) = first_packet::<LANES>(&mut left) {
            let asked = self.asked(index, rays);
            let packet = self.packet(index);
            let of_packet = if asked.lanes.count_ones() <= FEW_IN_PACKET {
                packet.test_by_ray::<Q>(token, triangles, primitives, asked)
            } else {
                packet.test_leaf::<Q, _>(token, triangles, primitives, asked)
            };
            new |= u64::from(of_packet) << (LANES * index);
        }
        new
    }

    /// The same for rays that are spread over more packets than they would fill: as many at a time as fill one, whatever
    /// packets they are of. Whether there is a hit is all that is found out.
    #[inline(always)]
    fn test_scattered<Q: Query>(
        &self,
        token: V::Token,
        triangles: impl Gathered,
        primitives: &[u32],
        rays: u64,
    ) -> u64 {
        let (mut new, mut left) = (0, rays);
        while left != 0 {
            let count = left.count_ones().min(LANES as u32);
            // Lanes past the last ray repeat it.
            let (mut numbers, mut number) = ([0; LANES], 0);
            let group = array::from_fn(|lane| {
                if left != 0 {
                    number = left.trailing_zeros() as usize;
                    left &= left - 1;
                }
                numbers[lane % LANES] = number as u8;
                self.rays.get(number).unwrap_or(&PreparedRay::ROOM)
            });
            let asked = Asked {
                lanes: u32::MAX >> (32 - count),
                found: 0,
                rays: self.rays,
                numbers: &numbers,
                axes: self.axes,
            };
            let mut shears = Shears::<LANES, V>::of(token, group, *self.axes);
            for lane in bits(shears.test::<Q, _>(token, triangles, primitives, asked)) {
                new |= 1 << numbers[lane % LANES];
            }
        }
        new
    }

    /// What a packet is asked of some of the rays.
    #[inline(always)]
    fn asked(&self, index: usize, rays: u64) -> Asked<'a, LANES> {
        let first = LANES * index;
        let of_packet = |rays: u64| (rays >> first & packet_mask::<LANES>()) as u32;
        Asked {
            lanes: of_packet(rays),
            found: of_packet(self.found),
            rays: &self.rays[first..],
            numbers: const { &in_order() },
            axes: self.axes,
        }
    }

    /// Takes note of rays that have a new best hit, and how far the others still look.
    #[inline(always)]
    fn note<Q: Query>(&mut self, token: V::Token, new: u64) {
        self.found |= new;
        if !Q::CLOSEST {
            self.looking &= !new;
        } else if new != 0 {
            let mut far = V::splat(token, f32::NEG_INFINITY);
            for index in 0..self.count {
                far = far.max(self.packet(index).far);
            }
            self.far = most(far);
        }
    }
}

/// Each lane's own number.
const fn in_order<const LANES: usize>() -> [u8; LANES] {
    let (mut numbers, mut lane) = ([0; LANES], 0);
    while lane < LANES {
        numbers[lane] = lane as u8;
        lane += 1;
    }
    numbers
}
