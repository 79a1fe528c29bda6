//! Test of the number of function calls between a public function and the recursion that computes its result.
//!
//! The test uses a scalar whose arithmetic captures backtraces, which show the calls. The calls with `f64` are the
//! same, with one exception: instead of `Scalar::enter`, a kernel runs the function that is compiled for the SIMD
//! level. A backtrace shows inlined functions only with debug information.
#![allow(non_snake_case)]

mod common;

use condyle_dynamics::{
    Data, Model, Scalar, aba, aba_derivatives, aba_hessian, crba, minv, rnea, rnea_derivatives, rnea_hessian,
};
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use std::backtrace::Backtrace;
use std::cell::{Cell, RefCell};

/// Maximum number of calls between a public function and its recursion.
const MOST_CALLS: usize = 6;

/// Number of operations from one backtrace to the next. It is prime, so that backtraces are captured in every loop of a
/// pass.
const PERIOD: u64 = 61;

/// Functions that are recursions over bodies, columns or entries. Each is given by its file and its name.
const RECURSIONS: [&str; 17] = [
    "aba::factorize",
    "aba::inward",
    "aba::outward",
    "aba_hessian::run",
    "crba::pass",
    "gauss_jordan::gauss_jordan",
    "kinematics::place_turned",
    "kinematics::sin_cos",
    "ltdl::factorize",
    "ltdl::inverse",
    "minv::sweep",
    "rnea::pass",
    "rnea_derivatives::pass",
    "rnea_hessian::pass",
    "tree_product::neg_product",
    "tree_product::run_serially",
    "tree_solve::sweep",
];

/// Names of the files that contain the public functions.
const CALLS: [&str; 5] = ["derivatives", "forward_dynamics", "inertia", "inverse_dynamics", "second_derivatives"];

thread_local! {
    static OPERATIONS: Cell<u64> = const { Cell::new(0) };
    static TRACES: RefCell<Vec<Backtrace>> = const { RefCell::new(Vec::new()) };
}

/// Counts an operation, and captures a backtrace at every `PERIOD`-th operation.
#[inline(never)]
fn trace(value: f64) -> Traced {
    OPERATIONS.set(OPERATIONS.get() + 1);
    if OPERATIONS.get().is_multiple_of(PERIOD) {
        TRACES.with_borrow_mut(|traces| traces.push(Backtrace::force_capture()));
    }
    Traced(value)
}

/// Scalar whose operations are counted and traced.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Traced(f64);

macro_rules! operators {
    ($($trait:ident $name:ident),*) => {$(
        impl $trait for Traced {
            type Output = Self;
            fn $name(self, o: Self) -> Self {
                trace(self.0.$name(o.0))
            }
        }
    )*};
}
operators!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Traced {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
impl AddAssign for Traced {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl SubAssign for Traced {
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}
impl Scalar for Traced {
    type Mask = bool;
    const LANES: usize = 1;

    fn splat(x: f64) -> Self {
        Self(x)
    }
    fn mul_add(self, b: Self, c: Self) -> Self {
        trace(self.0 * b.0 + c.0)
    }
    fn recip(self) -> Self {
        trace(self.0.recip())
    }
    fn sqrt(self) -> Self {
        trace(self.0.sqrt())
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (trace(sin), Self(cos))
    }
    fn atan2(self, x: Self) -> Self {
        trace(self.0.atan2(x.0))
    }
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    fn lt(self, o: Self) -> bool {
        self.0 < o.0
    }
    fn select(mask: bool, a: Self, b: Self) -> Self {
        if mask { a } else { b }
    }
    fn and(a: bool, b: bool) -> bool {
        a && b
    }
    fn or(a: bool, b: bool) -> bool {
        a || b
    }
}

/// Returns the functions of a backtrace, each with the name of its file. The innermost function comes first. The file
/// is needed because inlined functions have no module path.
fn functions(trace: &Backtrace) -> Vec<String> {
    let text = trace.to_string();
    let mut found: Vec<String> = Vec::new();
    for line in text.lines().map(str::trim) {
        if let (Some(place), Some(function)) = (line.strip_prefix("at "), found.last_mut()) {
            let path = place.split(".rs:").next().unwrap_or(place);
            let mut folders = path.rsplit('/').filter(|&part| part != "mod");
            *function = format!("{}::{function}", folders.next().unwrap_or(path));
        } else {
            found.push(base(line).to_owned());
        }
    }
    found
}

/// Returns a function's name without its hash, its module path and its generic parameters.
fn base(name: &str) -> &str {
    let (mut depth, mut start) = (0, 0);
    for (at, c) in name.char_indices() {
        match c {
            '<' => {
                if depth == 0 && at > start {
                    return &name[start..at];
                }
                depth += 1;
            }
            '>' => depth -= 1,
            ' ' | ':' if depth == 0 => start = at + 1,
            _ => {}
        }
    }
    &name[start..]
}

/// Returns the functions from the public function to the recursion, both included. They are from the backtrace with the
/// largest number of such functions.
fn deepest(public: &str, work: impl FnOnce()) -> Vec<String> {
    TRACES.take();
    work();
    let mut deepest = Vec::new();
    for trace in TRACES.take() {
        let functions = functions(&trace);
        let is_public = |function: &String| CALLS.iter().any(|file| *function == format!("{file}::{public}"));
        let Some(outer) = functions.iter().rposition(is_public) else { continue };
        let is_recursion = |function: &String| RECURSIONS.contains(&function.as_str());
        let Some(inner) = functions[..outer].iter().rposition(is_recursion) else { continue };
        if outer - inner + 1 > deepest.len() {
            deepest = functions[inner..=outer].iter().rev().cloned().collect();
        }
    }
    deepest
}

#[test]
fn a_recursion_is_near_its_public_function() {
    let robots: [(&str, Model); 3] = [
        ("arm", condyle_dynamics::robots::arm7()),
        ("quadruped", condyle_dynamics::robots::quadruped()),
        ("chain of 60", common::tree(60, false, |i| i - 1)),
    ];
    let mut most = 0;
    for (robot, m) in &robots {
        let data = &mut Data::<Traced>::new(m);
        let q: Vec<Traced> = condyle_dynamics::neutral(m).into_iter().map(Traced).collect();
        let (v, x) = (vec![Traced(0.1); m.nv()], vec![Traced(0.2); m.nv()]);
        let mut show = |name: &str, calls: Vec<String>| {
            let between = calls.len().saturating_sub(2);
            println!("{robot}: {between} calls between `{name}` and its recursion: {}", calls.join(" > "));
            assert!(between <= MOST_CALLS, "{robot}, {name}: {calls:#?}");
            most = most.max(between);
        };
        show("rnea", deepest("rnea", || _ = rnea(m, data, &q, &v, &x, &[])));
        show("aba", deepest("aba", || _ = aba(m, data, &q, &v, &x, &[])));
        show("crba", deepest("crba", || _ = crba(m, data, &q)));
        show("minv", deepest("minv", || _ = minv(m, data, &q)));
        show("rnea_derivatives", deepest("rnea_derivatives", || _ = rnea_derivatives(m, data, &q, &v, &x, &[])));
        show("aba_derivatives", deepest("aba_derivatives", || _ = aba_derivatives(m, data, &q, &v, &x, &[])));
        show("rnea_hessian", deepest("rnea_hessian", || _ = rnea_hessian(m, data, &q, &v, &x, &[], &v)));
        show("aba_hessian", deepest("aba_hessian", || _ = aba_hessian(m, data, &q, &v, &x, &[], &v)));
    }
    match most {
        0 => println!("NOT RUN: there is no debug information to name the recursions"),
        _ => println!("at most {most} calls"),
    }
}
