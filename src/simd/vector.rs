//! What a backend offers.
//!
//! A backend is a zero-sized token that exists only where its instructions do; vectors are made through a token, so
//! everything built on them is safe code. Operations that decide a hit (`+ - * /`, comparisons, `select`,
//! `permute`, `replace`) give the same bits on every backend. `mul_add`, `min` and `max` may differ in rounding,
//! NaN and the sign of zero; the box test uses them, and is conservative.

use super::PacketOperation;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Sub};

/// [`Simd::prefetch`] fetches nothing as many bytes after its address, or more.
pub(crate) const PREFETCHED: usize = 3 * 64;

/// A proof that the processor has a backend's instructions.
pub trait Simd: Copy {
    /// Four floats.
    type F32x4: Vector<4, Token = Self>;
    /// Eight floats.
    type F32x8: Vector<8, Token = Self>;

    /// Whether triangles are tested one by one, since the target has no vectors: faster there, and less code.
    const ONE_BY_ONE: bool = false;

    /// Whether [`prefetch_line`](Self::prefetch_line) does anything.
    const FETCHES: bool = false;

    /// Whether eight floats are two vectors of four: then triangles are tested four at a time, for most leaves have no more.
    const IN_FOURS: bool = false;

    /// Whether rays that go their own ways are faster interleaved than one after the other.
    const INTERLEAVES: bool;

    /// Does `operation` with the vectors that packets of rays are fastest in.
    #[inline(always)]
    fn in_packets<O: PacketOperation>(self, operation: O) -> O::Output {
        operation.run::<8, Self::F32x8>(self)
    }

    /// Eight rows of eight as columns.
    #[inline(always)]
    fn transpose(self, rows: [Self::F32x8; 8]) -> [Self::F32x8; 8] {
        let [a, b, c, d, e, f, g, h] = rows;
        let rows = [
            a.to_array(),
            b.to_array(),
            c.to_array(),
            d.to_array(),
            e.to_array(),
            f.to_array(),
            g.to_array(),
            h.to_array(),
        ];
        Self::F32x8::columns(self, rows.each_ref())
    }

    /// In lane `i` lane `lanes[i]` modulo 8.
    #[inline(always)]
    fn pick(self, from: Self::F32x8, lanes: &[u8; 4]) -> Self::F32x4 {
        let from = from.to_array();
        Self::F32x4::load(self, &lanes.map(|lane| from[lane as usize % 8]))
    }

    /// Four points' x, y and z.
    #[inline(always)]
    fn coordinates(self, points: [&[f32; 3]; 4]) -> [Self::F32x4; 3] {
        let mut axes = [[0.0; 4]; 3];
        for (lane, point) in points.into_iter().enumerate() {
            for (axis, &x) in axes.iter_mut().zip(point) {
                axis[lane] = x;
            }
        }
        let [x, y, z] = &axes;
        [
            Self::F32x4::load(self, x),
            Self::F32x4::load(self, y),
            Self::F32x4::load(self, z),
        ]
    }

    /// Has the [three](PREFETCHED) cache lines from `address` on fetched, if the backend can. Any address will do.
    #[inline(always)]
    fn prefetch(self, address: *const u8) {
        self.prefetch_bytes(address, PREFETCHED);
    }

    /// Has the cache lines of so many bytes from `address` on fetched.
    #[inline(always)]
    fn prefetch_bytes(self, address: *const u8, bytes: usize) {
        for offset in (0..bytes).step_by(64) {
            self.prefetch_line(address.wrapping_add(offset));
        }
    }

    /// Has one cache line fetched.
    fn prefetch_line(self, address: *const u8);
}

/// Some floats, one a lane. A comparison's outcome is a vector too: all bits of a lane set, or none.
pub trait Lanes: Copy {
    /// The backend it belongs to.
    type Token: Simd;
    /// As many floats.
    type Array: AsRef<[f32]>;

    /// `x` in every lane.
    fn splat(token: Self::Token, x: f32) -> Self;
    /// The lanes as an array.
    fn to_array(self) -> Self::Array;
    /// Bit `i` is the sign of lane `i`, so that a comparison's outcome has a bit for each lane that is set. The bits
    /// above are zero.
    fn bits(self) -> u32;

    /// The lane of the least number, or nearly, of those that `among`, a comparison's outcome, is set for; negative
    /// numbers are in no order. Any lane if it is set for none.
    fn least(self, among: Self) -> usize;

    /// Writes the lanes that `mask` has a bit for to `to` on, in their order. What follows them, up to as many
    /// floats as there are lanes, is overwritten with anything.
    ///
    /// # Safety
    /// There is room for as many floats as there are lanes.
    unsafe fn compress(self, mask: u32, to: *mut f32);
}

/// `N` floats.
pub trait Vector<const N: usize>:
    Lanes<Array = [f32; N]>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
{
    /// One lane from each element.
    fn load(token: Self::Token, lanes: &[f32; N]) -> Self;
    /// Eight vectors: the first of the first number of each row, and so on.
    #[inline(always)]
    fn columns(token: Self::Token, rows: [&[f32; 8]; N]) -> [Self; 8] {
        let mut columns = [[0.0; N]; 8];
        for (lane, row) in rows.into_iter().enumerate() {
            for (column, &number) in columns.iter_mut().zip(row) {
                column[lane] = number;
            }
        }
        load_all(token, columns.each_ref())
    }
    /// One lane from each integer.
    #[inline(always)]
    fn of_bytes(token: Self::Token, bytes: &[u8; N]) -> Self {
        let mut lanes = [0.0; N];
        for (lane, &byte) in lanes.iter_mut().zip(bytes) {
            *lane = f32::from(byte);
        }
        Self::load(token, &lanes)
    }

    /// `self * factor + addend`, rounded once or twice.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// The lesser; either where they are equal.
    fn min(self, other: Self) -> Self;
    /// The greater; either where they are equal.
    fn max(self, other: Self) -> Self;
    /// The greater; of two negative numbers either. Integers' where those are sooner: positive floats are in their order.
    #[inline(always)]
    fn max_from_zero(self, other: Self) -> Self {
        self.max(other)
    }
    /// The lesser; of two negative numbers either.
    #[inline(always)]
    fn min_from_zero(self, other: Self) -> Self {
        self.min(other)
    }
    /// Without the sign.
    fn abs(self) -> Self;

    /// Where `self < other`; not beside a NaN.
    fn lt(self, other: Self) -> Self;
    /// Where `self <= other`; not beside a NaN.
    fn le(self, other: Self) -> Self;
    /// Where `self == other`; not beside a NaN.
    fn eq(self, other: Self) -> Self;
    /// `self` is a comparison's outcome: `yes` where it is set, else `no`.
    fn select(self, yes: Self, no: Self) -> Self;
    /// The same but for lane `lane` modulo `N`, which becomes `x`.
    #[inline(always)]
    fn replace(self, token: Self::Token, lane: usize, x: f32) -> Self {
        // All bits of one lane. A load and a blend: to write a lane of an array and load the array would stall.
        static ONE_LANE: [f32; 31] = {
            let mut lanes = [0.0; 31];
            lanes[15] = f32::from_bits(u32::MAX);
            lanes
        };
        let start = 15 - lane % N;
        let mask: &[f32; N] = ONE_LANE[start..start + N].try_into().unwrap_or(&[0.0; N]);
        Self::load(token, mask).select(Self::splat(token, x), self)
    }

    /// A comparison's outcome that is set in the lanes that `bits` has a bit for.
    fn of_bits(token: Self::Token, bits: u32) -> Self;

    /// Bits, lane by lane: of lane `i` with `ends[i]` 0, `base + i · stride`; of others, with bit 31 set, the
    /// [packed run](packed_run) from `first` and the end before it to `first` and this end.
    #[inline(always)]
    fn links(token: Self::Token, ends: &[u8; N], base: u32, stride: u32, first: u32) -> Self {
        let mut links = [0.0; N];
        let mut start = 0;
        for (lane, &end) in (0..).zip(ends) {
            let end = u32::from(end);
            let link = match end {
                0 => base.wrapping_add(lane * stride),
                _ => 1 << 31 | packed_run(first.wrapping_add(start), end.wrapping_sub(start)),
            };
            links[lane as usize] = f32::from_bits(link);
            start = end;
        }
        Self::load(token, &links)
    }

    /// Lane `i` becomes lane `lanes[i]` modulo `N`.
    fn permute(self, lanes: &[u8; N]) -> Self;
}

/// How many bits of a run say where it begins; those above say how long it is, less 1.
pub(crate) const RUN_FIRST_BITS: u32 = 29;
/// The longest run.
pub(crate) const MAX_RUN: usize = 1 << (31 - RUN_FIRST_BITS);

/// A run of `count` things, 1 to [`MAX_RUN`], from number `first` on, in 31 bits.
#[inline(always)]
pub(crate) const fn packed_run(first: u32, count: u32) -> u32 {
    first & ((1 << RUN_FIRST_BITS) - 1)
        | (count.wrapping_sub(1) & (MAX_RUN as u32 - 1)) << RUN_FIRST_BITS
}

/// Eight vectors.
#[inline(always)]
pub(super) fn load_all<const N: usize, V: Vector<N>>(
    token: V::Token,
    [a, b, c, d, e, f, g, h]: [&[f32; N]; 8],
) -> [V; 8] {
    [
        V::load(token, a),
        V::load(token, b),
        V::load(token, c),
        V::load(token, d),
        V::load(token, e),
        V::load(token, f),
        V::load(token, g),
        V::load(token, h),
    ]
}

/// Three numbers, each in every lane of its vector.
//
// Not a closure given to `map`: closures do not inherit a backend's instructions and stay calls.
#[inline(always)]
pub fn splat3<const N: usize, V: Vector<N>>(token: V::Token, [x, y, z]: [f32; 3]) -> [V; 3] {
    [V::splat(token, x), V::splat(token, y), V::splat(token, z)]
}
