//! Bytes spoilt a word of four at a time. Places are taken round: any number is one, where there are any bytes.

/// A word's bytes, by its number.
fn word(bytes: &mut [u8], at: u16) -> Option<&mut [u8; 4]> {
    let words = (bytes.len() / 4).max(1);
    bytes
        .get_mut(usize::from(at) % words * 4..)?
        .first_chunk_mut()
}

/// Puts what `change` makes of a word in its place.
pub fn change(bytes: &mut [u8], at: u16, change: impl Fn(u32) -> u32) {
    if let Some(word) = word(bytes, at) {
        *word = change(u32::from_ne_bytes(*word)).to_ne_bytes();
    }
}

/// Copies so many words, one after the other.
pub fn copy(bytes: &mut [u8], from: u16, to: u16, count: u8) {
    for i in 0..u16::from(count) {
        if let Some(&mut value) = word(bytes, from.wrapping_add(i)) {
            change(bytes, to.wrapping_add(i), |_| u32::from_ne_bytes(value));
        }
    }
}
