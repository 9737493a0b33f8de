//! Which of some rays pass the boxes of a node, a child a lane.

use crate::simd::{Lanes, Vector};

/// The most rays: as many as a lane has bits.
pub(crate) const RAYS: usize = 32;

/// What rays, no more than [`RAYS`], come to that are tested one after the other.
#[derive(Clone, Copy)]
pub struct Passing<V> {
    /// For each child a bit for each ray.
    rays: V,
    /// From which `t` on any of them may meet it.
    near: V,
    /// A bit for each child that any of them passes.
    children: u32,
}

impl<V: Lanes> Passing<V> {
    /// None so far.
    #[inline(always)]
    pub(crate) fn none(token: V::Token) -> Self {
        Self {
            rays: V::splat(token, 0.0),
            near: V::splat(token, f32::INFINITY),
            children: 0,
        }
    }

    /// Adds a ray, numbered modulo [`RAYS`]: which boxes it passes, a comparison's outcome, and from which `t` on.
    #[inline(always)]
    pub(crate) fn add<const N: usize>(&mut self, token: V::Token, ray: usize, hit: V, near: V)
    where
        V: Vector<N>,
    {
        let bit = V::splat(token, f32::from_bits(1 << (ray % RAYS)));
        self.rays = self.rays | (hit & bit);
        self.near = hit.select(near.min(self.near), self.near);
        self.children |= hit.bits();
    }

    /// A bit for each child that any of the rays passes.
    #[inline(always)]
    pub(crate) fn children(&self) -> u32 {
        self.children
    }

    /// For each child the rays that pass, as bits.
    #[inline(always)]
    pub(crate) fn rays(&self) -> V::Array {
        self.rays.to_array()
    }

    /// For each child that is passed from which `t` on.
    #[inline(always)]
    pub(crate) fn near(&self) -> V::Array {
        self.near.to_array()
    }
}
