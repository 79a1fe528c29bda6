//! A function out of a recording: what it takes, what it gives, and how the one is computed from the other.

use crate::expression::{Expression, Open};
use crate::graph::{Id, Node};
use crate::sums::with_constants_gathered;
use condyle_spatial::{Dense, DenseMatrix, Scalar};
use core::fmt;
use core::num::NonZero;

/// An argument or a result of a function: some numbers with a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Array {
    /// The name, which is that of the argument in the code.
    pub name: String,
    /// The number of rows.
    pub rows: usize,
    /// The number of columns; 1 for vectors. Numbers stand column by column.
    pub columns: usize,
    /// What the numbers are, with units, in a few words.
    pub about: String,
}

impl Array {
    /// The number of numbers.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.rows * self.columns
    }
}

/// A function of some arrays of numbers, as the steps by which it is computed: without branches, loops or memory.
///
/// [`record`] makes one; [`Language::text`](crate::Language) writes it down.
#[derive(Clone, Debug)]
pub struct Function {
    /// The name.
    pub name: String,
    /// What it computes, in a sentence.
    pub about: String,
    /// What it takes.
    pub inputs: Vec<Array>,
    /// What it gives.
    pub outputs: Vec<Array>,
    /// The values that the outputs need, each after those that it is computed from.
    pub(crate) nodes: Vec<Node>,
    /// The values of all outputs, one array after the other; of a share those that it has.
    pub(crate) results: Vec<Id>,
    /// The output and the place in it to which each of them goes.
    pub(crate) places: Vec<(usize, usize)>,
    /// The limb to which each of them belongs, 0 being the trunk; empty if that is not known. They are shared out by limbs.
    pub(crate) limbs: Vec<usize>,
    /// The number of shares that was asked for.
    pub(crate) shares: Option<NonZero<usize>>,
}

/// What a function computes with, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// Sums and differences, those that are fused with a product not counted.
    pub sums: usize,
    /// Products, those that are fused with a sum not counted.
    pub products: usize,
    /// Products with a sum or difference: one instruction where the processor has it.
    pub fused: usize,
    /// Quotients and square roots.
    pub quotients: usize,
    /// Angles of which the sine, the cosine or both are computed; angles of points.
    pub angles: usize,
    /// Signs, magnitudes, comparisons and choices.
    pub others: usize,
}

impl Operations {
    /// All, each counted as one.
    pub fn total(self) -> usize {
        self.sums + self.products + self.fused + self.quotients + self.angles + self.others
    }

    /// Additions and multiplications: a fused pair counts as two.
    pub fn flops(self) -> usize {
        self.sums + self.products + 2 * self.fused + self.quotients
    }
}

impl fmt::Display for Operations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { sums, products, fused, quotients, angles, others } = self;
        write!(
            f,
            "{fused} products with a sum, {products} products, {sums} sums, {quotients} quotients, {angles} angles, \
             {others} others"
        )
    }
}

/// The arguments and results of a function that is being recorded.
#[derive(Debug)]
pub struct Recorder {
    inputs: Vec<Array>,
    outputs: Vec<Array>,
    places: u32,
    results: Vec<Expression>,
}

impl Recorder {
    /// An argument of the function: `len` numbers.
    ///
    /// # Panics
    /// If the name is no identifier (ASCII letters, digits and `_`), or taken.
    pub fn input(&mut self, name: &str, len: usize, about: &str) -> Vec<Expression> {
        self.check(name);
        let first = self.places;
        self.places += u32::try_from(len).expect("an argument has fewer than 2³² numbers");
        self.inputs.push(Array { name: name.to_owned(), rows: len, columns: 1, about: about.to_owned() });
        (first..self.places).map(Expression::input).collect()
    }

    /// A result of the function: a vector.
    ///
    /// # Panics
    /// If the name is no identifier (ASCII letters, digits and `_`), or taken.
    pub fn output(&mut self, name: &str, values: &[Expression], about: &str) {
        self.result(name, (values.len(), 1), values, about);
    }

    /// A result of the function: a matrix. Its numbers stand column by column.
    ///
    /// # Panics
    /// If the name is no identifier (ASCII letters, digits and `_`), or taken.
    pub fn matrix(&mut self, name: &str, values: &DenseMatrix<Expression, impl Dense<Expression>>, about: &str) {
        self.result(name, values.shape(), values.as_slice(), about);
    }

    fn result(&mut self, name: &str, (rows, columns): (usize, usize), values: &[Expression], about: &str) {
        self.check(name);
        self.outputs.push(Array { name: name.to_owned(), rows, columns, about: about.to_owned() });
        self.results.extend(values);
    }

    fn check(&self, name: &str) {
        check_identifier(name);
        let mut names = self.inputs.iter().chain(&self.outputs).map(|a| &a.name);
        assert!(names.all(|other| other != name), "name: there is an array `{name}` already");
    }
}

/// Panics unless a name can be one in every language.
fn check_identifier(name: &str) {
    assert!(is_identifier(name), "name: `{name}` is not made of ASCII letters, digits and `_`, a letter first");
}

pub(crate) fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// The function that a closure computes: it runs once, on [`Expression`]s, and what its outputs need is kept.
///
/// The closure may call whatever is generic over [`Scalar`]: algorithms of this library, a user's own cost, and dual numbers of
/// expressions ([`jacobian`](crate::jacobian)). It must not depend on the values of its inputs but by [`Scalar::select`].
///
/// ```
/// use condyle_codegen::{Language, record};
/// use condyle_dynamics::{Data, forward_kinematics, robots};
/// let arm = robots::arm7();
/// let tool = arm.frame("tool")?;
/// let height = record("tool_height", "The height of the tool.", |r| {
///     let q = r.input("q", 7, "position (rad)");
///     let p = forward_kinematics(&arm, &mut Data::new(&arm), &q).frame(tool).translation;
///     r.output("z", &[p.z], "height (m)");
/// });
/// assert!(height.evaluate(&[&[0.0; 7]])[0][0] > 0.5); // stretched upwards
/// assert!(Language::C.text("arm7", &[height])[0].text.contains("tool_height"));
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If a name is no identifier, or a recording is under way on this thread.
pub fn record(name: &str, about: &str, f: impl FnOnce(&mut Recorder)) -> Function {
    check_identifier(name);
    let open = Open::new();
    let mut recorder = Recorder { inputs: Vec::new(), outputs: Vec::new(), places: 0, results: Vec::new() };
    f(&mut recorder);
    let Recorder { inputs, outputs, results, .. } = recorder;
    let results: Vec<Id> = results.into_iter().map(Expression::id).collect();
    let (nodes, results) = needed(&open.finish().nodes, &results);
    let (nodes, results) = with_constants_gathered(&nodes, &results);
    let (nodes, results) = needed(&nodes, &results);
    Function {
        name: name.to_owned(),
        about: about.to_owned(),
        places: places(&outputs),
        inputs,
        outputs,
        nodes,
        results,
        limbs: Vec::new(),
        shares: None,
    }
}

/// Of each value whether some results need it.
pub(crate) fn is_needed(all: &[Node], results: impl Iterator<Item = Id>) -> Vec<bool> {
    let mut is_needed = vec![false; all.len()];
    results.for_each(|id| is_needed[id as usize] = true);
    for (id, node) in all.iter().enumerate().rev() {
        if is_needed[id] {
            node.operands().for_each(|id| is_needed[id as usize] = true);
        }
    }
    is_needed
}

/// The values that some results need, in the order in which they were recorded, and the results among them.
pub(crate) fn needed(all: &[Node], results: &[Id]) -> (Vec<Node>, Vec<Id>) {
    let is_needed = is_needed(all, results.iter().copied());
    let (mut nodes, mut new) = (Vec::new(), vec![Id::MAX; all.len()]);
    for (id, node) in all.iter().enumerate() {
        if is_needed[id] {
            new[id] = nodes.len() as Id;
            nodes.push(node.renamed(|id| new[id as usize]));
        }
    }
    (nodes, results.iter().map(|&id| new[id as usize]).collect())
}

impl Function {
    /// The results for some arguments, computed step by step: slowly, without a compiler.
    ///
    /// # Panics
    /// If there are not as many arguments, or one has not as many numbers, as `inputs` says.
    pub fn evaluate(&self, inputs: &[&[f64]]) -> Vec<Vec<f64>> {
        assert!(inputs.len() == self.inputs.len(), "inputs: expected {}, found {}", self.inputs.len(), inputs.len());
        for (array, given) in self.inputs.iter().zip(inputs) {
            assert!(given.len() == array.len(), "{}: expected {}, found {}", array.name, array.len(), given.len());
        }
        let inputs = inputs.concat();
        let mut x: Vec<f64> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let at = |id: Id| x[id as usize];
            let holds = |id: Id| at(id) != 0.0;
            let value = match *node {
                Node::Constant(bits) => f64::from_bits(bits),
                Node::Input(place) => inputs[place as usize],
                Node::Add(a, b) => at(a) + at(b),
                Node::Sub(a, b) => at(a) - at(b),
                Node::Mul(a, b) => at(a) * at(b),
                Node::Div(a, b) => at(a) / at(b),
                Node::Neg(a) | Node::Minus(a) => -at(a),
                Node::Sqrt(a) => at(a).sqrt(),
                Node::Sin(a) => Scalar::sin_cos(at(a)).0,
                Node::Cos(a) => Scalar::sin_cos(at(a)).1,
                Node::Atan2(y, x) => at(y).atan2(at(x)),
                Node::Abs(a) => at(a).abs(),
                Node::Less(a, b) => f64::from(at(a) < at(b)),
                Node::And(a, b) => f64::from(holds(a) && holds(b)),
                Node::Or(a, b) => f64::from(holds(a) || holds(b)),
                Node::Select(mask, a, b) => {
                    if holds(mask) {
                        at(a)
                    } else {
                        at(b)
                    }
                }
            };
            x.push(value);
        }
        let mut results = self.results.iter().map(|&id| x[id as usize]);
        self.outputs.iter().map(|array| results.by_ref().take(array.len()).collect()).collect()
    }
}

/// The array and the place in it of each number of all of some arrays.
pub(crate) fn places(arrays: &[Array]) -> Vec<(usize, usize)> {
    arrays.iter().enumerate().flat_map(|(k, array)| (0..array.len()).map(move |i| (k, i))).collect()
}
