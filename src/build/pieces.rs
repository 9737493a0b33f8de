//! Triangles in pieces, as what a tree is built over: numbers past those of the primitives are pieces of them.

use super::input::{Input, Verdict};
use crate::geometry::Aabb;
use glam::Vec3;
use std::vec::Vec;

/// A part of a primitive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Around the part.
    pub aabb: Aabb,
    /// The primitive's number.
    pub id: u32,
}

/// Primitives, some of which are in pieces. The pieces of one cover it.
pub(super) struct Pieces<'a, I> {
    pub input: &'a I,
    pub pieces: Vec<Piece>,
}

impl<'a, I: Input> Pieces<'a, I> {
    /// All in one piece.
    pub fn whole(input: &'a I) -> Self {
        Self {
            input,
            pieces: Vec::new(),
        }
    }

    /// Puts a piece in another's place, or after all others: its number.
    pub fn put(&mut self, number: Option<u32>, piece: Piece) -> u32 {
        let primitives = self.input.len();
        let place = number.and_then(|number| (number as usize).checked_sub(primitives));
        match place.and_then(|place| self.pieces.get_mut(place)) {
            Some(old) => *old = piece,
            None => self.pieces.push(piece),
        }
        match place {
            Some(place) => (primitives + place) as u32,
            None => (primitives + self.pieces.len() - 1) as u32,
        }
    }

    #[inline]
    fn piece(&self, number: u32) -> Option<&Piece> {
        self.pieces
            .get((number as usize).checked_sub(self.input.len())?)
    }
}

impl<I: Input> Input for Pieces<'_, I> {
    type Leaf = I::Leaf;
    const MAX_LEAF: usize = I::MAX_LEAF;
    const JOINED: f32 = I::JOINED;
    const CAN_SPLIT: bool = false;

    fn len(&self) -> usize {
        self.input.len()
    }

    fn verdict(&self, id: u32) -> Verdict {
        self.input.verdict(id)
    }

    #[inline]
    fn aabb(&self, number: u32) -> Aabb {
        match self.piece(number) {
            Some(piece) => piece.aabb,
            None => self.input.aabb(number),
        }
    }

    fn triangle(&self, id: u32) -> Option<[Vec3; 3]> {
        self.input.triangle(id)
    }

    #[inline]
    fn primitive(&self, number: u32) -> u32 {
        self.piece(number).map_or(number, |piece| piece.id)
    }

    #[inline]
    fn fits(&self, numbers: &[u32]) -> bool {
        if self.pieces.is_empty() {
            return self.input.fits(numbers);
        }
        let mut ids = [0; 8];
        let ids = &mut ids[..numbers.len()];
        for (id, &number) in ids.iter_mut().zip(numbers) {
            *id = self.primitive(number);
        }
        self.input.fits(ids)
    }

    fn leaf_cost(count: usize) -> f32 {
        I::leaf_cost(count)
    }

    fn leaf(&self, ids: &[u32], first: u32) -> Option<I::Leaf> {
        self.input.leaf(ids, first)
    }
}
