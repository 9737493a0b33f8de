//! Triangles in pieces, as what a tree is built over: numbers past those of the primitives are pieces of them.

use super::{
    input::{Input, Verdict},
    refs::Bounds,
};
use crate::{geometry::Aabb, simd::Simd};
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

    #[inline]
    fn piece(&self, number: u32) -> Option<&Piece> {
        self.pieces
            .get((number as usize).checked_sub(self.input.len())?)
    }
}

/// Pieces that were cut at a node of the tree and above it, of which those below it may be made.
#[derive(Clone, Copy)]
pub(super) struct Known<'k> {
    /// The number of the first that was cut here.
    pub first: u32,
    pub pieces: &'k [Piece],
    pub above: Option<&'k Self>,
}

impl Known<'_> {
    /// No piece.
    pub const NONE: Self = Self {
        first: 0,
        pieces: &[],
        above: None,
    };

    /// The piece of a number, if it is one's.
    pub fn piece(&self, number: u32) -> Option<&Piece> {
        let mut known = self;
        loop {
            if let Some(place) = number.checked_sub(known.first)
                && let Some(piece) = known.pieces.get(place as usize)
            {
                return Some(piece);
            }
            known = known.above?;
        }
    }
}

impl<I: Input> Input for Pieces<'_, I> {
    type Leaf = I::Leaf;
    type Filling<S: Simd> = I::Filling<S>;
    type Place = I::Place;
    type Loaded = I::Loaded;
    const UNLOADED: I::Loaded = I::UNLOADED;
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

    fn around(&self) -> Bounds {
        self.input.around()
    }

    #[inline(always)]
    fn place(&self, number: u32) -> I::Place {
        self.input.place(self.primitive(number))
    }

    #[inline(always)]
    fn fetch_place<S: Simd>(&self, token: S, number: u32) {
        self.input.fetch_place(token, self.primitive(number));
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, token: S, place: I::Place) {
        self.input.fetch(token, place);
    }

    #[inline(always)]
    fn load_from(&self, place: I::Place) -> I::Loaded {
        self.input.load_from(place)
    }

    #[inline(always)]
    fn bounds(loaded: &I::Loaded) -> Bounds {
        I::bounds(loaded)
    }

    #[inline(always)]
    fn begin<S: Simd>(token: S, loaded: &I::Loaded) -> I::Filling<S> {
        I::begin(token, loaded)
    }

    #[inline(always)]
    fn add<S: Simd>(token: S, filling: &mut I::Filling<S>, loaded: &I::Loaded) -> bool {
        I::add(token, filling, loaded)
    }

    fn leaf_cost(count: usize) -> f32 {
        I::leaf_cost(count)
    }

    #[inline(always)]
    fn leaf<S: Simd>(filling: &I::Filling<S>, first: u32) -> I::Leaf {
        I::leaf(filling, first)
    }
}
