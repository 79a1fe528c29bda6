//! Memory that is made when it is first needed.

/// The memory in which something computes, made when it is first needed, so that an action costs little to make and to
/// merge with others. A copy makes its own: what was computed in it is not part of what is copied.
#[derive(Debug)]
pub(crate) struct OnDemand<T>(Option<Box<T>>);

impl<T> OnDemand<T> {
    /// The memory; `make` makes it where it is not there.
    pub(crate) fn get(&mut self, make: impl FnOnce() -> T) -> &mut T {
        self.0.get_or_insert_with(|| Box::new(make()))
    }

    /// The memory, if it is there.
    pub(crate) fn made(&self) -> Option<&T> {
        self.0.as_deref()
    }
}

impl<T> Default for OnDemand<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T> Clone for OnDemand<T> {
    fn clone(&self) -> Self {
        Self::default()
    }
}
