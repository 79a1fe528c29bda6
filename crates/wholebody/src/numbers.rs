//! Reads numbers from a list, one by one, with checks.

/// Reader of numbers from the front of a slice. Its methods return `None` if too few numbers are left, or if the next
/// number is invalid.
pub(crate) struct Reader<'a>(&'a [f64]);

impl<'a> Reader<'a> {
    pub(crate) fn new(numbers: &'a [f64]) -> Self {
        Self(numbers)
    }

    /// Returns whether all numbers were read.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Reads a number that may be infinite or NaN.
    pub(crate) fn any(&mut self) -> Option<f64> {
        let (&first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(first)
    }

    pub(crate) fn number(&mut self) -> Option<f64> {
        self.any().filter(|x| x.is_finite())
    }

    /// Reads an integer below a limit.
    pub(crate) fn index(&mut self, limit: usize) -> Option<usize> {
        let x = self.number()?;
        (x >= 0.0 && x < limit as f64 && x.fract() == 0.0).then_some(x as usize)
    }

    pub(crate) fn flag(&mut self) -> Option<bool> {
        self.index(2).map(|x| x == 1)
    }

    pub(crate) fn fill(&mut self, to: &mut [f64]) -> Option<()> {
        to.iter_mut().try_for_each(|to| self.number().map(|x| *to = x))
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut array = [0.0; N];
        self.fill(&mut array).map(|()| array)
    }
}

/// Returns a flag as the number 0 or 1.
pub(crate) fn flag(x: bool) -> f64 {
    f64::from(u8::from(x))
}
