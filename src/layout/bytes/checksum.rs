//! What tells harmed bytes from whole ones.

use super::{BytesError, header::Header};
use core::mem::offset_of;

/// Writes the checksum of a file into its header: the last step of whatever writes files of this format. Does nothing to
/// what is shorter than a header.
///
/// A checksum is no signature: it finds accidents, all of those that change one byte. What somebody means to be wrong is
/// for the rest of [`from_bytes`](crate::layout::Bvh::from_bytes)' check to find.
pub fn seal(bytes: &mut [u8]) {
    let sum = sum(bytes);
    if let Some(field) = bytes.get_mut(FIELD..FIELD + 4) {
        field.copy_from_slice(&sum.to_ne_bytes());
    }
}

/// Whether bytes are what was sealed.
///
/// # Errors
/// They are not.
pub(super) fn check(bytes: &[u8]) -> Result<(), BytesError> {
    let found = sum(bytes);
    let field = bytes.get(FIELD..).and_then(|field| field.first_chunk());
    let expected = u32::from_ne_bytes(*field.unwrap_or(&[0; 4]));
    match found == expected {
        true => Ok(()),
        false => Err(BytesError::Checksum { expected, found }),
    }
}

const FIELD: usize = offset_of!(Header, checksum);
const LANES: usize = 8;

/// The FNV-1a hash (Fowler, Noll, Vo 1991) of every eighth word, eight at a time, and of those: each step is
/// one-to-one in the word and in what came before, so no single word changes unseen. The checksum's own counts as 0.
fn sum(bytes: &[u8]) -> u32 {
    let mut lanes = [0x811c_9dc5; LANES];
    let (before, after) = bytes.split_at(FIELD.min(bytes.len()));
    let after = after.get(4..).unwrap_or(&[]);
    for block in before.chunks(4 * LANES).chain(after.chunks(4 * LANES)) {
        for (lane, word) in lanes.iter_mut().zip(block.as_chunks().0) {
            *lane = step(*lane, *word);
        }
    }
    lanes
        .into_iter()
        .fold(0x811c_9dc5, |sum, lane| step(sum, lane.to_ne_bytes()))
}

#[inline(always)]
fn step(sum: u32, word: [u8; 4]) -> u32 {
    (sum ^ u32::from_ne_bytes(word)).wrapping_mul(0x0100_0193)
}
