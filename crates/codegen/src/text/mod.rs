//! Writes programs as text. This module contains the code that all languages have in common.

mod c;
mod casadi;
mod cuda;
mod rust;

use crate::function::{Array, Function, places};
use crate::graph::{Id, Node};
use crate::partitions::split;
use crate::program::{Place, Program};
use crate::step::{Angle, Entries, Step, Term};
use core::fmt::Write;

/// File of generated code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// File name, without a folder.
    pub name: String,
    /// Content of the file.
    pub text: String,
}

/// Language of generated code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Language {
    /// C99 with `double`: a header and a source. They need only `math.h`.
    #[default]
    C,
    /// C99 with `float`.
    CFloat,
    /// C99 with vectors of GCC and clang. Each call computes four states in `double` precision.
    CFour,
    /// C99 with vectors of GCC and clang. Each call computes eight states in `double` precision.
    CEight,
    /// C99 with vectors of GCC and clang. Each call computes four states in `float` precision.
    CFloatFour,
    /// C99 with vectors of GCC and clang. Each call computes eight states in `float` precision.
    CFloatEight,
    /// C99 as [`C`](Self::C), with a third file in which each function has the interface of CasADi's `external`:
    /// `robot_aba_casadi` for `robot_aba`. The interface has the Jacobian under two conditions. `robot_aba_derivatives`
    /// is also generated. No position coordinates of the robot are a quaternion or a pair (cos, sin). For impacts, the
    /// Jacobian also has columns for the restitution; the generated functions of derivatives have no such columns.
    CCasadi,
    /// A module of Rust with `f64`, without `std`.
    Rust,
    /// A module of Rust with `f32`, without `std`.
    RustFloat,
    /// CUDA with `double`. Each thread computes one state, or one partition of a state ([`Function::partitions`]). An
    /// array contains the first number of every state, then the second number of every state, and so on.
    Cuda,
    /// CUDA with `float`.
    CudaFloat,
}

impl Language {
    /// Names of the languages. [`named`](Self::named) converts a name to a language.
    pub const NAMES: [&str; 11] = [
        "c",
        "c-float",
        "c-4",
        "c-8",
        "c-float-4",
        "c-float-8",
        "c-casadi",
        "rust",
        "rust-float",
        "cuda",
        "cuda-float",
    ];

    /// Returns the language with this name.
    pub fn named(name: &str) -> Option<Self> {
        let all = [
            Self::C,
            Self::CFloat,
            Self::CFour,
            Self::CEight,
            Self::CFloatFour,
            Self::CFloatEight,
            Self::CCasadi,
            Self::Rust,
            Self::RustFloat,
            Self::Cuda,
            Self::CudaFloat,
        ];
        Self::NAMES.iter().position(|&known| known == name).map(|k| all[k])
    }

    /// Returns the number of GPU registers that one number occupies; `None` if the language is not CUDA.
    pub(crate) fn registers_of_number(self) -> Option<usize> {
        match self {
            Self::Cuda => Some(2),
            Self::CudaFloat => Some(1),
            _ => None,
        }
    }

    /// Returns the files with the code of these functions. The same functions give the same text.
    ///
    /// ```
    /// use condyle_codegen::{Language, record};
    /// let square = record("square", "x².", |r| {
    ///     let x = r.input("x", 1, "a number");
    ///     r.output("y", &[x[0] * x[0]], "its square");
    /// });
    /// let files = Language::C.text("numbers", &[square]);
    /// assert_eq!(files.iter().map(|f| &*f.name).collect::<Vec<_>>(), ["numbers.h", "numbers.c"]);
    /// assert!(files[1].text.contains("void numbers_square(const double *restrict x, double *restrict y)"));
    /// ```
    ///
    /// # Panics
    /// If `name` is not an identifier (ASCII letters, digits and `_`).
    pub fn text(self, name: &str, functions: &[Function]) -> Vec<SourceFile> {
        assert!(crate::function::is_identifier(name), "name: `{name}` is not made of ASCII letters, digits and `_`");
        let programs: Vec<Program> = functions.iter().map(Program::new).collect();
        let name = &self.stem(name);
        let registers = self.registers_of_number().unwrap_or(1);
        match self {
            Self::C => c::files(name, &programs, "double", 1),
            Self::CFloat => c::files(name, &programs, "float", 1),
            Self::CFour => c::files(name, &programs, "double", 4),
            Self::CEight => c::files(name, &programs, "double", 8),
            Self::CFloatFour => c::files(name, &programs, "float", 4),
            Self::CFloatEight => c::files(name, &programs, "float", 8),
            Self::CCasadi => {
                let mut files = c::files(name, &programs, "double", 1);
                files.push(casadi::file(name, &programs));
                files
            }
            Self::Rust => rust::files(name, &programs, "f64"),
            Self::RustFloat => rust::files(name, &programs, "f32"),
            Self::Cuda => cuda::files(name, &programs, "double", registers),
            Self::CudaFloat => cuda::files(name, &programs, "float", registers),
        }
    }

    /// Returns the name of the files: the robot's name, then `_float`, then `_x4` or `_x8`. In C and CUDA it is also
    /// the prefix of the functions. So one folder can contain the files of several languages, and one program can
    /// contain their functions.
    ///
    /// ```
    /// use condyle_codegen::Language;
    /// assert_eq!(Language::C.stem("arm7"), "arm7");
    /// assert_eq!(Language::CFloatEight.stem("arm7"), "arm7_float_x8");
    /// ```
    pub fn stem(self, name: &str) -> String {
        let suffix = match self {
            Self::C | Self::CCasadi | Self::Rust | Self::Cuda => "",
            Self::CFloat | Self::RustFloat | Self::CudaFloat => "_float",
            Self::CFour => "_x4",
            Self::CEight => "_x8",
            Self::CFloatFour => "_float_x4",
            Self::CFloatEight => "_float_x8",
        };
        format!("{name}{suffix}")
    }
}

impl Function {
    /// Returns the number of threads that can compute one state together in the function's kernel. It is 1 if the
    /// language is not CUDA.
    ///
    /// A robot's function is split by limbs if two conditions hold. One thread would need to hold more values than fit
    /// into its registers. And the split must save time: the whole function divided by the largest partition must
    /// exceed the sum of all partitions divided by the whole function (in operations).
    /// [`Settings::partitions`](crate::Settings::partitions) can set the number. If a kernel is launched with this
    /// number of rows of blocks (`blockIdx.y`), each row computes one partition. With one row, each thread computes a
    /// whole state.
    ///
    /// ```
    /// use condyle_codegen::{Language, Settings, functions};
    /// use condyle_dynamics::robots;
    /// let all = functions(&robots::quadruped(), &["rnea", "rnea_derivatives"], &Settings::default())?;
    /// assert_eq!(all[0].partitions(Language::Cuda), 1); // the trunk's efforts need what all limbs do
    /// assert!(all[1].partitions(Language::Cuda) > 1);
    /// # Ok::<(), condyle_codegen::Error>(())
    /// ```
    pub fn partitions(&self, language: Language) -> usize {
        let partitions = language.registers_of_number().map(|registers| split(&Program::new(self), registers));
        partitions.map_or(1, |partitions| partitions.len().max(1))
    }
}

/// Syntax of a language. Each function returns text in this language.
pub(crate) trait Dialect {
    /// Returns the code of a constant.
    fn number(&self, x: f64) -> String;
    /// Returns the code of an element of an array.
    fn element(&self, array: &str, index: &str) -> String {
        format!("{array}[{index}]")
    }
    /// Returns the code of an element of the work space `w`, the array for intermediate values.
    fn work(&self, slot: &str) -> String {
        format!("w[{slot}]")
    }
    /// Returns the code of a loop over k = 0, 1, …, n − 1, whose body is one line that uses this name for k.
    fn repeat(&self, k: &str, n: usize, line: &str) -> String {
        format!("for (int {k} = 0; {k} < {n}; {k}++) {line}")
    }
    /// Converts the code of a constant to the code of a vector of equal numbers. Languages whose operators accept
    /// constants return the code unchanged.
    fn whole(&self, value: String) -> String {
        value
    }
    /// Returns a line across which compilers do not move memory accesses; `None` if the language does not have such a
    /// line.
    fn fence(&self) -> Option<&'static str> {
        None
    }
    /// Returns the definition of a new variable for a mask or a number.
    fn variable(&self, name: &str, expression: &str, is_mask: bool) -> String;
    /// Returns the definition of variables for the sine and the cosine of an angle.
    fn sin_cos(&self, sin: &str, cos: &str, angle: &str) -> String;
    /// Returns the code of ± a b ± c with these signs.
    fn mul_add(&self, neg_product: bool, a: &str, b: &str, minus: bool, c: &str) -> String {
        match (neg_product, minus) {
            (false, false) => format!("{a} * {b} + {c}"),
            (false, true) => format!("{a} * {b} - {c}"),
            _ => format!("{c} - {a} * {b}"),
        }
    }
    /// Returns the code of a selection: a if the mask is true, otherwise b.
    fn select(&self, mask: &str, a: &str, b: &str) -> String;
    /// Returns the code that calls `sqrt` or `abs` with one number.
    fn call(&self, function: &str, a: &str) -> String;
    /// Returns the code of the angle of the point (x, y).
    fn atan2(&self, y: &str, x: &str) -> String;
    /// Returns the code that converts a mask to a number, which the work space can store.
    fn mask_to_work(&self, mask: &str) -> String;
    /// Returns the code that converts a number of the work space to a mask.
    fn mask_from_work(&self, number: &str) -> String;
    /// Returns the code of a constant mask: true or false.
    fn truth(&self, holds: bool) -> &'static str;
}

/// Number of steps between two fences. Without fences, LLVM's scheduler moves loads far ahead of their uses, which
/// spills registers. With fences, the vectorised derivatives of the robot Talos take 0.72 of their time without fences.
/// The gain is the same for distances of 20 to 200 steps.
const FENCED: usize = 50;

/// Writer of the code of a program's parts.
pub(crate) struct Writer<'p, D> {
    pub program: &'p Program<'p>,
    pub dialect: D,
    inputs: Vec<(usize, usize)>,
    /// For each value, the indices of the results that are equal to the value.
    goes_to: Vec<Vec<usize>>,
    outputs: &'p [(usize, usize)],
}

impl<'p, D: Dialect> Writer<'p, D> {
    pub(crate) fn new(program: &'p Program<'p>, dialect: D) -> Self {
        let mut goes_to = vec![Vec::new(); program.steps.values];
        program.steps.results.iter().enumerate().for_each(|(k, &id)| goes_to[id as usize].push(k));
        let function = program.function;
        Self { program, dialect, inputs: places(&function.inputs), goes_to, outputs: &function.places }
    }

    /// Returns the code by which part p refers to a value.
    fn value(&self, p: usize, id: Id, is_mask: bool) -> String {
        match self.program.steps.nodes[id as usize] {
            Node::Constant(bits) if is_mask => self.dialect.truth(f64::from_bits(bits) != 0.0).to_owned(),
            Node::Constant(bits) => self.dialect.number(f64::from_bits(bits)),
            Node::Input(place) => {
                let (array, index) = self.inputs[place as usize];
                self.dialect.element(&self.program.function.inputs[array].name, &index.to_string())
            }
            _ => match self.program.places[id as usize] {
                Place::Work(slot) if self.program.part_of[id as usize] != p => {
                    let number = self.dialect.work(&slot.to_string());
                    if is_mask { self.dialect.mask_from_work(&number) } else { number }
                }
                _ => format!("t{id}"),
            },
        }
    }

    /// Returns the code by which part p computes a value.
    fn expression(&self, p: usize, node: Node) -> String {
        let d = &self.dialect;
        let number = |id| self.value(p, id, false);
        let mask = |id| self.value(p, id, true);
        match node {
            Node::Constant(_) | Node::Input(_) | Node::Sin(_) | Node::Cos(_) => String::new(), // no step computes these
            Node::Add(a, b) => format!("{} + {}", number(a), number(b)),
            Node::Sub(a, b) => format!("{} - {}", number(a), number(b)),
            Node::Mul(a, b) => format!("{} * {}", number(a), number(b)),
            Node::Div(a, b) => format!("{} / {}", number(a), number(b)),
            Node::Neg(a) | Node::Minus(a) => format!("-{}", number(a)),
            Node::Sqrt(a) => d.call("sqrt", &number(a)),
            Node::Abs(a) => d.call("abs", &number(a)),
            Node::Atan2(y, x) => d.atan2(&number(y), &number(x)),
            Node::Less(a, b) => format!("{} < {}", number(a), number(b)),
            Node::And(a, b) => format!("{} & {}", mask(a), mask(b)),
            Node::Or(a, b) => format!("{} | {}", mask(a), mask(b)),
            Node::Select(m, a, b) => d.select(&mask(m), &number(a), &number(b)),
        }
    }

    /// Returns the lines of code of part p.
    pub(crate) fn lines(&self, p: usize) -> Vec<String> {
        let mut lines = Vec::new();
        for (k, step) in self.program.steps.all[self.program.parts[p].clone()].iter().enumerate() {
            if k > 0 && k % FENCED == 0 {
                lines.extend(self.dialect.fence().map(str::to_owned));
            }
            let number = |id| self.value(p, id, false);
            let fused = |[a, b, c]: [Id; 3], neg_product, minus| {
                self.dialect.mul_add(neg_product, &number(a), &number(b), minus, &number(c))
            };
            let (id, text, is_mask) = match *step {
                Step::Plain(id, node) => (id, self.expression(p, node), node.is_mask()),
                Step::MulAdd(id, abc) => (id, fused(abc, false, false), false),
                Step::MulSub(id, abc) => (id, fused(abc, false, true), false),
                Step::SubMul(id, abc) => (id, fused(abc, true, false), false),
                Step::Entries(ref entries) => {
                    lines.extend(self.entries(p, entries));
                    continue;
                }
                Step::SinCos(Angle { angle, sin, cos }) => {
                    let name =
                        |half: Option<Id>, other| half.map_or(format!("unused_{angle}_{other}"), |id| format!("t{id}"));
                    lines.push(self.dialect.sin_cos(&name(sin, "s"), &name(cos, "c"), &number(angle)));
                    sin.into_iter().chain(cos).for_each(|id| self.hand_on(&mut lines, id, false));
                    continue;
                }
            };
            // If no later step uses the value, write it to the result without a variable.
            let used_later = self.program.places[id as usize] != Place::Local || self.is_taken(id);
            if let ([only], false) = (&self.goes_to[id as usize][..], used_later) {
                lines.push(format!("{} = {text};", self.output(*only)));
                continue;
            }
            lines.push(self.dialect.variable(&format!("t{id}"), &text, is_mask));
            self.hand_on(&mut lines, id, is_mask);
        }
        lines
    }

    /// Returns whether any step uses a value.
    fn is_taken(&self, id: Id) -> bool {
        self.program.taken[id as usize]
    }

    /// Adds the lines that copy a value to the work space and to results.
    fn hand_on(&self, lines: &mut Vec<String>, id: Id, is_mask: bool) {
        if let Place::Work(slot) = self.program.places[id as usize] {
            let name = format!("t{id}");
            let number = if is_mask { self.dialect.mask_to_work(&name) } else { name };
            lines.push(format!("{} = {number};", self.dialect.work(&slot.to_string())));
        }
        for &k in &self.goes_to[id as usize] {
            lines.push(format!("{} = t{id};", self.output(k)));
        }
    }

    /// Returns the code of the output number with index k among the numbers of all outputs.
    fn output(&self, k: usize) -> String {
        let (array, index) = self.outputs[k];
        self.dialect.element(&self.program.function.outputs[array].name, &index.to_string())
    }

    /// Returns the loop that computes several entries, and the lines that copy these entries to other results.
    fn entries(&self, p: usize, entries: &Entries) -> Vec<String> {
        let k = self.counter();
        let n = entries.ids.len();
        let sum = entries.terms.iter().enumerate().map(|(at, Term { minus, each, common })| {
            let Place::Work(slot) = self.program.places[each[0] as usize] else { unreachable!("it was given a place") };
            let value = self.dialect.work(&format!("{slot} + {k}"));
            let sign = if *minus {
                " - "
            } else if at > 0 {
                " + "
            } else {
                ""
            };
            match common {
                Some(common) => format!("{sign}{value} * {}", self.value(p, *common, false)),
                None => value,
            }
        });
        let sum: String = sum.collect();
        let to = |k: usize| {
            let (array, index) = self.outputs[k];
            (&*self.program.function.outputs[array].name, index)
        };
        let (array, first) = to(entries.first);
        let entry = self.dialect.element(array, &format!("{first} + {k}"));
        let mut lines = vec![self.dialect.repeat(&k, n, &format!("{entry} = {sum};"))];
        for (at, &id) in entries.ids.iter().enumerate() {
            let entry = self.dialect.element(array, &(first + at).to_string());
            let others = self.goes_to[id as usize].iter().filter(|&&k| to(k) != (array, first + at));
            lines.extend(others.map(|&k| format!("{} = {entry};", self.output(k))));
        }
        lines
    }

    /// Returns a variable name that no array has.
    fn counter(&self) -> String {
        let arrays = || self.program.function.inputs.iter().chain(&self.program.function.outputs);
        let mut name = "k".to_owned();
        while arrays().any(|array| array.name == name) {
            name.push('_');
        }
        name
    }

    /// Returns the lines that write results that no part computes. Such results are constants, inputs, and sines and
    /// cosines of early angles.
    pub(crate) fn given_results(&self) -> Vec<String> {
        let part_of = &self.program.part_of;
        let given =
            self.program.steps.results.iter().enumerate().filter(|&(_, &id)| part_of[id as usize] == usize::MAX);
        let value = |id| self.dialect.whole(self.value(usize::MAX - 1, id, false));
        given.map(|(k, &id)| format!("{} = {};", self.output(k), value(id))).collect()
    }

    /// Returns the names of arrays that a function does not use: inputs that no result depends on, and results of
    /// length 0.
    pub(crate) fn unused_arrays(&self) -> Vec<&'p str> {
        let inputs = &self.program.function.inputs;
        let mut unused = vec![true; inputs.len()];
        for node in self.program.steps.nodes {
            if let Node::Input(place) = node {
                unused[self.inputs[*place as usize].0] = false;
            }
        }
        let unread = inputs.iter().zip(unused).filter(|(_, unused)| *unused).map(|(array, _)| array);
        let empty = self.program.function.outputs.iter().filter(|array| array.len() == 0);
        unread.chain(empty).map(|array| &*array.name).collect()
    }

    /// Returns the code of an early angle as one expression. (The sine and cosine of an early angle are computed before
    /// all steps.)
    pub(crate) fn angle(&self, id: Id) -> String {
        let inside = |id| self.angle(id);
        match self.program.steps.nodes[id as usize] {
            Node::Add(a, b) => format!("({} + {})", inside(a), inside(b)),
            Node::Sub(a, b) => format!("({} - {})", inside(a), inside(b)),
            Node::Mul(a, b) => format!("({} * {})", inside(a), inside(b)),
            Node::Neg(a) => format!("(-{})", inside(a)),
            _ => self.value(usize::MAX - 1, id, false),
        }
    }

    /// Returns the arrays that part p reads and writes.
    pub(crate) fn arrays(&self, p: usize) -> (Vec<&'p Array>, Vec<&'p Array>) {
        let steps = &self.program.steps.all[self.program.parts[p].clone()];
        let function = self.program.function;
        let (mut reads, mut writes) = (vec![false; function.inputs.len()], vec![false; function.outputs.len()]);
        for step in steps {
            for id in step.takes() {
                if let Node::Input(place) = self.program.steps.nodes[id as usize] {
                    reads[self.inputs[place as usize].0] = true;
                }
            }
            for id in step.makes() {
                self.goes_to[id as usize].iter().for_each(|&k| writes[self.outputs[k].0] = true);
            }
        }
        let pick = |arrays: &'p [Array], which: &[bool]| -> Vec<&'p Array> {
            arrays.iter().zip(which).filter(|(_, used)| **used).map(|(array, _)| array).collect()
        };
        (pick(&function.inputs, &reads), pick(&function.outputs, &writes))
    }
}

/// Returns the description of a function as lines of text: arguments, results, and numbers of operations.
pub(crate) fn description(program: &Program) -> Vec<String> {
    let mut lines = interface(program.function);
    lines.push(format!("Operations: {}.", program.steps.operations()));
    if program.work > 0 {
        lines.push(format!("Stack: {} numbers beside the variables.", program.work));
    }
    lines
}

/// Returns the description of a function's arguments and results, as lines.
pub(crate) fn interface(function: &Function) -> Vec<String> {
    let mut lines = vec![function.about.clone(), String::new()];
    for array in function.inputs.iter().chain(&function.outputs) {
        let shape = match array.columns {
            1 => format!("{}", array.rows),
            columns => format!("{} x {columns}, column by column", array.rows),
        };
        lines.push(format!("{}: {} ({shape})", array.name, array.about));
    }
    lines.push(String::new());
    lines
}

/// Returns the heading that every file has.
pub(crate) fn heading(name: &str, programs: &[Program]) -> Vec<String> {
    let functions: Vec<&str> = programs.iter().map(|p| &*p.function.name).collect();
    vec![
        format!("{name}: {}, as straight-line code.", functions.join(", ")),
        String::new(),
        format!("Written by condyle-codegen {}; not to be edited.", env!("CARGO_PKG_VERSION")),
        String::new(),
        "Units are SI and radians, frames right-handed. Of velocities, forces and Jacobians the linear part comes first, then".to_owned(),
        "the angular one; quaternions are x, y, z, w. A free-flyer has the position, then the quaternion in q, and its velocity".to_owned(),
        "in its own frame in v; an unbounded revolute joint has (cos, sin) in q. Matrices stand column by column. Derivatives by".to_owned(),
        "q are in the tangent space: nv columns. No array may overlap one that is written.".to_owned(),
    ]
}

/// Returns the lines, each after a prefix and without spaces at its end.
pub(crate) fn prefixed(prefix: &str, lines: &[String]) -> String {
    let mut text = String::new();
    for line in lines {
        let _ = writeln!(text, "{}", format!("{prefix}{line}").trim_end());
    }
    text
}

/// Returns the decimal digits of a number. Parsing these digits gives exactly the same number.
pub(crate) fn digits(x: f64) -> String {
    format!("{x:?}")
}
