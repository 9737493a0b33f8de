//! Bytes that begin where a hierarchy of any kind can be opened.

/// Bytes that begin at a multiple of 64, as [`from_bytes`](crate::layout::Bvh::from_bytes) may want: around an
/// `include_bytes!`, say.
///
/// ```
/// use wide_bvh::layout::Aligned;
///
/// static SCENE: &Aligned<[u8]> = &Aligned(*b"what include_bytes! gives");
/// assert!(SCENE.0.as_ptr().cast::<[u128; 4]>().is_aligned());
/// ```
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Aligned<T: ?Sized>(pub T);

/// Bytes on the heap that begin at a multiple of 64: a file that was read, or came over a network.
///
/// ```
/// use wide_bvh::{Builder, TriangleMesh, layout::{AlignedBytes, Bvh8Ref}};
///
/// # let positions = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0_f32]];
/// # let mesh = TriangleMesh::new(&positions, &[[0, 1, 2_u32]])?;
/// let file: Vec<u8> = Builder::new().build(&mesh)?.to_bytes()?;
/// let bytes = AlignedBytes::new(&file);
/// let opened = Bvh8Ref::from_bytes(&bytes)?; // as long as `bytes` is there
/// let owned = opened.into_owned(); // on its own
/// # drop(bytes);
/// # assert_eq!(owned.primitives(), [0]);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[cfg(feature = "alloc")]
pub struct AlignedBytes {
    memory: alloc::vec::Vec<u8>,
    start: usize,
}

#[cfg(feature = "alloc")]
mod on_the_heap {
    use super::AlignedBytes;
    use crate::layout::bytes::ALIGN;
    use alloc::vec::Vec;
    use core::{
        fmt,
        ops::{Deref, DerefMut},
    };

    impl AlignedBytes {
        /// A copy.
        pub fn new(bytes: &[u8]) -> Self {
            let mut memory: Vec<u8> = Vec::with_capacity(bytes.len() + ALIGN);
            let start = memory.as_ptr().align_offset(ALIGN);
            memory.resize(start, 0);
            memory.extend_from_slice(bytes);
            Self { memory, start }
        }
    }

    impl Deref for AlignedBytes {
        type Target = [u8];

        fn deref(&self) -> &[u8] {
            &self.memory[self.start..]
        }
    }

    impl DerefMut for AlignedBytes {
        fn deref_mut(&mut self) -> &mut [u8] {
            &mut self.memory[self.start..]
        }
    }

    impl Clone for AlignedBytes {
        fn clone(&self) -> Self {
            Self::new(self)
        }
    }

    impl fmt::Debug for AlignedBytes {
        /// How many there are, not the bytes.
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.debug_struct("AlignedBytes")
                .field("len", &self.len())
                .finish()
        }
    }
}
