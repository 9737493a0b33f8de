//! Who owns a hierarchy's memory.

use core::{marker::PhantomData, ops::Deref};

/// Where the parts of a hierarchy lie: in vectors of its own, or in somebody else's memory. There are no others: that a slice
/// stays what it was when it was checked is what walks rely on.
pub trait Storage: sealed::Sealed {
    /// Whether it is [`Owned`].
    #[doc(hidden)]
    const IS_OWNED: bool = false;

    /// A run of `T`.
    type Slice<T: 'static + Clone>: Deref<Target = [T]> + Clone;
}

mod sealed {
    pub trait Sealed {}
    #[cfg(feature = "alloc")]
    impl Sealed for super::Owned {}
    impl Sealed for super::Borrowed<'_> {}
}

/// In vectors of its own.
#[cfg(feature = "alloc")]
#[derive(Clone, Copy, Debug)]
pub struct Owned;

#[cfg(feature = "alloc")]
impl Storage for Owned {
    const IS_OWNED: bool = true;
    type Slice<T: 'static + Clone> = alloc::vec::Vec<T>;
}

/// In memory that is borrowed: flash, a mapped file, another hierarchy.
#[derive(Clone, Copy, Debug)]
pub struct Borrowed<'a>(PhantomData<&'a ()>);

impl<'a> Storage for Borrowed<'a> {
    type Slice<T: 'static + Clone> = &'a [T];
}
