//! Numbers that record how they are computed.

use crate::graph::{Graph, Id, ONE, ZERO};
use condyle_spatial::{Constant, Scalar};
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use std::cell::{Cell, RefCell};

/// A number that records how it is computed. An algorithm that is generic over [`Scalar`] runs once with such numbers
/// and leaves a graph of all its operations. [`record`](crate::record) makes a [`Function`](crate::Function) from this
/// graph.
///
/// An expression belongs to the recording in which it was made. Using the expression in another recording panics. Two
/// expressions are equal if they are computed in the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Expression {
    /// Ordinal of the recording; 0 for the constants 0 and 1, which are valid in every recording.
    session: u32,
    id: Id,
}

/// Recorded result of a comparison of two [`Expression`]s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mask(Expression);

/// A recording in progress on a thread.
struct Session {
    number: u32,
    graph: Graph,
}

thread_local! {
    static SESSION: RefCell<Option<Session>> = const { RefCell::new(None) };
    /// Number of recordings begun so far.
    static COUNT: Cell<u32> = const { Cell::new(0) };
}

/// Guard of the recording in progress. Dropping the guard ends the recording, also after a panic.
pub(crate) struct Open(());

impl Open {
    /// Begins a recording on this thread.
    pub(crate) fn new() -> Self {
        SESSION.with_borrow_mut(|session| {
            assert!(session.is_none(), "a recording is under way on this thread: they do not nest");
            let number = COUNT.get() + 1;
            COUNT.set(number);
            *session = Some(Session { number, graph: Graph::new() });
        });
        Self(())
    }

    /// Ends the recording and returns the graph of all operations.
    pub(crate) fn finish(self) -> Graph {
        SESSION.with_borrow_mut(Option::take).map_or_else(Graph::new, |session| session.graph)
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        SESSION.with_borrow_mut(|session| *session = None);
    }
}

/// Panics with the message that an expression is used outside of its recording. The function is not inlined, to keep
/// its callers small.
#[cold]
#[inline(never)]
fn outside() -> ! {
    panic!("an Expression is a number of one recording: use it inside of the closure that was given to `record`");
}

/// Adds a value to the graph of the recording.
#[inline(never)]
fn graph<const N: usize>(operands: [Expression; N], compute: fn(&mut Graph, [Id; N]) -> Id) -> Expression {
    SESSION.with_borrow_mut(|session| {
        let Some(Session { number, graph }) = session else { outside() };
        let ids = operands.map(|x| if x.session == 0 || x.session == *number { x.id } else { outside() });
        Expression::of(*number, compute(graph, ids))
    })
}

impl Expression {
    fn of(session: u32, id: Id) -> Self {
        Self { session: if id <= ONE { 0 } else { session }, id }
    }

    /// Records an input number. `place` is the number's index among the numbers of all arguments.
    pub(crate) fn input(place: u32) -> Self {
        SESSION.with_borrow_mut(|session| {
            let Some(Session { number, graph }) = session else { outside() };
            Self::of(*number, graph.input(place))
        })
    }

    /// Returns the index of this expression in the graph of the recording.
    pub(crate) fn id(self) -> Id {
        graph([self], |_, [x]| x).id
    }
}

macro_rules! operator {
    ($($trait:ident $function:ident $compute:ident),*) => {$(
        impl $trait for Expression {
            type Output = Self;
            #[inline(never)]
            fn $function(self, other: Self) -> Self {
                graph([self, other], |graph, [a, b]| graph.$compute(a, b))
            }
        }
    )*};
}
operator!(Add add add, Sub sub sub, Mul mul mul, Div div div);

impl Neg for Expression {
    type Output = Self;
    #[inline(never)]
    fn neg(self) -> Self {
        graph([self], |graph, [a]| graph.neg(a))
    }
}

impl AddAssign for Expression {
    #[inline(never)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Expression {
    #[inline(never)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Scalar for Expression {
    type Mask = Mask;
    /// Number of lanes. It is at least 2, because an expression does not have a single value: generated code computes a
    /// different value in each call.
    const LANES: usize = 2;

    #[inline(never)]
    fn splat(x: f64) -> Self {
        if x == 0.0 || x == 1.0 {
            return Self { session: 0, id: if x == 0.0 { ZERO } else { ONE } };
        }
        SESSION.with_borrow_mut(|session| {
            let Some(Session { number, graph }) = session else { outside() };
            Self::of(*number, graph.constant(x))
        })
    }
    #[inline(never)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(never)]
    fn recip(self) -> Self {
        Self::one() / self
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        graph([self], |graph, [a]| graph.sqrt(a))
    }
    #[inline(never)]
    fn sin_cos(self) -> (Self, Self) {
        (graph([self], |graph, [a]| graph.sin_cos(a).0), graph([self], |graph, [a]| graph.sin_cos(a).1))
    }
    #[inline(never)]
    fn atan2(self, x: Self) -> Self {
        graph([self, x], |graph, [y, x]| graph.atan2(y, x))
    }
    #[inline(never)]
    fn abs(self) -> Self {
        graph([self], |graph, [a]| graph.abs(a))
    }
    #[inline(never)]
    fn kept(self) -> Self {
        graph([self], |graph, [a]| graph.kept(a))
    }
    #[inline(never)]
    fn lt(self, other: Self) -> Mask {
        Mask(graph([self, other], |graph, [a, b]| graph.less(a, b)))
    }
    #[inline(never)]
    fn select(mask: Mask, a: Self, b: Self) -> Self {
        graph([mask.0, a, b], |graph, [mask, a, b]| graph.select(mask, a, b))
    }
    #[inline(never)]
    fn and(a: Mask, b: Mask) -> Mask {
        Mask(graph([a.0, b.0], |graph, [a, b]| graph.and(a, b)))
    }
    #[inline(never)]
    fn or(a: Mask, b: Mask) -> Mask {
        Mask(graph([a.0, b.0], |graph, [a, b]| graph.or(a, b)))
    }
}

impl Constant<Expression> for Expression {
    #[inline]
    fn lift(self) -> Self {
        self
    }
    #[inline]
    fn of(x: f64) -> Self {
        Self::splat(x)
    }
}
