//! Numbers.

use arbitrary::{Arbitrary, Result, Unstructured};

/// A float of any bits; or, as often, one of few, so that some are equal and triangles meet.
#[derive(Clone, Copy, Debug)]
pub struct Float(pub f32);

impl<'a> Arbitrary<'a> for Float {
    fn arbitrary(bytes: &mut Unstructured<'a>) -> Result<Self> {
        Ok(Self(match bytes.arbitrary::<u8>()? % 8 {
            0..=3 => f32::from(bytes.arbitrary::<i8>()?) / 8.0,
            4 => f32::from(bytes.arbitrary::<i16>()?) / 300.0,
            _ => f32::from_bits(bytes.arbitrary()?),
        }))
    }

    fn size_hint(_: usize) -> (usize, Option<usize>) {
        (2, Some(5))
    }
}

/// The numbers themselves.
pub fn floats<const N: usize>(floats: [Float; N]) -> [f32; N] {
    floats.map(|float| float.0)
}
