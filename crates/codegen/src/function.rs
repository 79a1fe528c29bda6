//! Functions from recordings: inputs, outputs, and the steps of the computation.

use crate::expression::{Expression, Open};
use crate::graph::{Id, Node};
use crate::sums::with_constants_gathered;
use condyle_spatial::{Dense, DenseMatrix, Scalar};
use core::fmt;
use core::num::NonZero;

/// Argument or result of a function: an array of numbers with a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Array {
    /// Name of the array in the code.
    pub name: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns; 1 for vectors. Numbers are stored column by column.
    pub columns: usize,
    /// Meaning of the numbers, with units, in a few words.
    pub about: String,
}

impl Array {
    /// Returns the length of the array: the count of its numbers.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.rows * self.columns
    }
}

/// Function of several arrays of numbers, stored as the steps of its computation, without branches, loops or memory.
///
/// [`record`] makes a function; [`Language::text`](crate::Language) writes its code.
#[derive(Clone, Debug)]
pub struct Function {
    /// Name of the function.
    pub name: String,
    /// Description of the result, as a sentence.
    pub about: String,
    /// Arguments.
    pub inputs: Vec<Array>,
    /// Results.
    pub outputs: Vec<Array>,
    /// Values that the outputs need. Each value follows the values from which it is computed.
    pub(crate) nodes: Vec<Node>,
    /// Indices, in `nodes`, of the values of all outputs, one array after the other. A partition has only its own
    /// results.
    pub(crate) results: Vec<Id>,
    /// For each result, its output array and its index in this array.
    pub(crate) places: Vec<(usize, usize)>,
    /// Limb of each result; 0 for the trunk. The list is empty if the limbs are unknown. Partitions divide the results
    /// by limbs (see `partitions.rs`).
    pub(crate) limbs: Vec<usize>,
    /// Number of partitions that the settings request.
    pub(crate) partitions: Option<NonZero<usize>>,
}

/// Numbers of arithmetic operations in a function, for each type of operation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// Number of sums and differences that are not fused with a product.
    pub sums: usize,
    /// Number of products that are not fused with a sum.
    pub products: usize,
    /// Number of products fused with a sum or difference. Each is one instruction on processors with fused
    /// multiply-add.
    pub fused: usize,
    /// Number of quotients and square roots.
    pub quotients: usize,
    /// Number of angles whose sine, cosine or both are computed, plus the number of calls of atan2.
    pub angles: usize,
    /// Number of changes of sign, absolute values, comparisons and selections.
    pub others: usize,
}

impl Operations {
    /// Returns the total number of operations. A fused product and sum counts as one operation.
    pub fn total(self) -> usize {
        self.sums + self.products + self.fused + self.quotients + self.angles + self.others
    }

    /// Returns the number of floating-point operations: sums, products, quotients and square roots. A product fused
    /// with a sum counts as two operations.
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

/// Arguments and results of a function during its recording.
#[derive(Debug)]
pub struct Recorder {
    inputs: Vec<Array>,
    outputs: Vec<Array>,
    places: u32,
    results: Vec<Expression>,
}

impl Recorder {
    /// Adds an argument with `len` numbers to the function.
    ///
    /// # Panics
    /// If the name is not an identifier (ASCII letters, digits and `_`), or if another array has this name.
    pub fn input(&mut self, name: &str, len: usize, about: &str) -> Vec<Expression> {
        self.check(name);
        let first = self.places;
        self.places += u32::try_from(len).expect("an argument has fewer than 2³² numbers");
        self.inputs.push(Array { name: name.to_owned(), rows: len, columns: 1, about: about.to_owned() });
        (first..self.places).map(Expression::input).collect()
    }

    /// Adds a vector to the results of the function.
    ///
    /// # Panics
    /// If the name is not an identifier (ASCII letters, digits and `_`), or if another array has this name.
    pub fn output(&mut self, name: &str, values: &[Expression], about: &str) {
        self.result(name, (values.len(), 1), values, about);
    }

    /// Adds a matrix to the results of the function. Its numbers are stored column by column.
    ///
    /// # Panics
    /// If the name is not an identifier (ASCII letters, digits and `_`), or if another array has this name.
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

/// Panics unless the name is a valid identifier in every language.
fn check_identifier(name: &str) {
    assert!(is_identifier(name), "name: `{name}` is not made of ASCII letters, digits and `_`, a letter first");
}

pub(crate) fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Records the function that a closure computes. The closure runs once, with [`Expression`]s as numbers. The function
/// keeps only the values that the outputs need.
///
/// The closure may call any code that is generic over [`Scalar`]: algorithms of this library, a user's own cost, and
/// dual numbers of expressions ([`jacobian`](crate::jacobian)). The closure must not branch on the values of its
/// inputs; [`Scalar::select`] selects between two values.
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
/// If a name is not an identifier, or a recording is in progress on this thread.
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
        partitions: None,
    }
}

/// Returns, for each value, whether one of the results needs it.
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

/// Returns the values that the results need, in recording order, and the indices of the results among these values.
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
    /// Computes the results for the given arguments, step by step. This is slow, but needs no compiler.
    ///
    /// # Panics
    /// If the number of arguments, or the length of an argument, differs from `inputs`.
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

/// Returns, for each number of the arrays, the index of its array and its index in this array.
pub(crate) fn places(arrays: &[Array]) -> Vec<(usize, usize)> {
    arrays.iter().enumerate().flat_map(|(k, array)| (0..array.len()).map(move |i| (k, i))).collect()
}
