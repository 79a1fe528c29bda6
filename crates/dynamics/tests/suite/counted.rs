//! Scalar that counts operations.

use condyle_dynamics::Scalar;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use std::cell::Cell;

/// Numbers of operations by kind. A fused multiply-add counts as a product and a sum. A change of sign and a selection
/// are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Operations {
    /// Products.
    pub(crate) products: u64,
    /// Sums and differences.
    pub(crate) sums: u64,
    /// Quotients and roots.
    pub(crate) quotients: u64,
    /// Trigonometric functions: each is a sine and cosine of an angle, or the angle of a point.
    pub(crate) angles: u64,
    /// Fused multiply-adds, which are also counted as products and sums.
    pub(crate) fused: u64,
}

impl Operations {
    /// Returns the number of all operations. A fused multiply-add counts as one operation.
    pub(crate) fn all(self) -> u64 {
        self.flops() + self.angles - self.fused
    }

    /// Returns the number of all operations except trigonometric functions. A fused multiply-add counts as two
    /// operations.
    pub(crate) fn flops(self) -> u64 {
        self.products + self.sums + self.quotients
    }
}

thread_local! {
    static OPERATIONS: Cell<Operations> = const {
        Cell::new(Operations { products: 0, sums: 0, quotients: 0, angles: 0, fused: 0 })
    };
}

/// Number that counts all operations. It also stores the length of the longest chain of dependent operations that led
/// to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Counted {
    value: f64,
    steps: u32,
}

impl Counted {
    fn after(value: f64, of: &[Self], count: impl FnOnce(&mut Operations)) -> Self {
        let mut operations = OPERATIONS.get();
        count(&mut operations);
        OPERATIONS.set(operations);
        Self { value, steps: 1 + of.iter().map(|x| x.steps).max().unwrap_or(0) }
    }
}

macro_rules! operators {
    ($($trait:ident $name:ident $kind:ident),*) => {$(
        impl $trait for Counted {
            type Output = Self;
            fn $name(self, o: Self) -> Self {
                Self::after(self.value.$name(o.value), &[self, o], |n| n.$kind += 1)
            }
        }
    )*};
}
operators!(Add add sums, Sub sub sums, Mul mul products, Div div quotients);

impl Neg for Counted {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, ..self }
    }
}
impl AddAssign for Counted {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl SubAssign for Counted {
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}
impl Scalar for Counted {
    type Mask = bool;
    const LANES: usize = 1;

    fn splat(value: f64) -> Self {
        Self { value, steps: 0 }
    }
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self::after(self.value * b.value + c.value, &[self, b, c], |n| {
            n.products += 1;
            n.sums += 1;
            n.fused += 1;
        })
    }
    fn recip(self) -> Self {
        Self::after(self.value.recip(), &[self], |n| n.quotients += 1)
    }
    fn sqrt(self) -> Self {
        Self::after(self.value.sqrt(), &[self], |n| n.quotients += 1)
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        let sin = Self::after(sin, &[self], |n| n.angles += 1);
        (sin, Self { value: cos, ..sin })
    }
    fn atan2(self, x: Self) -> Self {
        Self::after(self.value.atan2(x.value), &[self, x], |n| n.angles += 1)
    }
    fn abs(self) -> Self {
        Self { value: self.value.abs(), ..self }
    }
    fn lt(self, o: Self) -> bool {
        self.value < o.value
    }
    fn select(mask: bool, a: Self, b: Self) -> Self {
        Self { value: if mask { a.value } else { b.value }, steps: a.steps.max(b.steps) }
    }
    fn and(a: bool, b: bool) -> bool {
        a && b
    }
    fn or(a: bool, b: bool) -> bool {
        a || b
    }
}

/// Returns the number of all operations of f. Also returns the length of the longest chain of operations in which each
/// operation needs the result of the previous operation.
pub(crate) fn counted<'a>(f: impl FnOnce() -> &'a [Counted]) -> (Operations, u32) {
    OPERATIONS.set(Operations::default());
    let steps = f().iter().map(|x| x.steps).max().unwrap_or(0);
    (OPERATIONS.get(), steps)
}
