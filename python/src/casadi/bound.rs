//! A function in the form in which CasADi calls it: the sparsity of results and derivatives, and the values of their
//! entries. Derivatives with respect to tangent coordinates are converted to CasADi's coordinates.

use super::chart::{Chart, Position};
use super::computation::{Calls, Computation};
use condyle::ModelError as Error;
use core::ops::Range;
use nalgebra::DMatrix;
use std::ffi::CString;
use std::sync::{Mutex, PoisonError};

/// Indices of a slot's four functions: the value, the Jacobian J, the product Jᵀλ with multipliers λ, and the Jacobian
/// of this product.
pub(super) const VALUE: usize = 0;
pub(super) const JACOBIAN: usize = 1;
pub(super) const REVERSE: usize = 2;
pub(super) const HESSIAN: usize = 3;

/// CasADi's description of an argument or a result of a function.
pub(super) struct Port {
    pub(super) name: CString,
    /// CasADi's description of a sparse matrix: number of rows, number of columns, index of the first entry of each
    /// column, row of each entry.
    pub(super) sparsity: Vec<i64>,
}

impl Port {
    /// Returns a matrix with entries where `present` is true, and the indices of these entries in the dense matrix,
    /// column by column.
    fn new(name: &str, rows: usize, columns: usize, present: impl Fn(usize, usize) -> bool) -> (Self, Vec<usize>) {
        let number = |n: usize| i64::try_from(n).expect("robots are smaller");
        let (mut starts, mut entries, mut places) = (vec![0], Vec::new(), Vec::new());
        for j in 0..columns {
            for i in (0..rows).filter(|&i| present(i, j)) {
                entries.push(number(i));
                places.push(j * rows + i);
            }
            starts.push(number(entries.len()));
        }
        let sparsity = [number(rows), number(columns)].into_iter().chain(starts).chain(entries).collect();
        (Self { name: CString::new(name).expect("names have no zeros"), sparsity }, places)
    }

    /// Repeats the matrix for a number of states. The columns of the states follow each other. All states use the same
    /// rows, or, with `own_rows`, each state has its own rows.
    fn repeat(&mut self, states: usize, own_rows: bool) {
        let number = |n: usize| i64::try_from(n).expect("CasADi counts that far");
        let (rows, columns) = (self.sparsity[0], self.sparsity[1] as usize);
        let (starts, entries) = self.sparsity[2..].split_at(columns + 1);
        let mut all = vec![if own_rows { rows * number(states) } else { rows }, number(columns * states)];
        for state in 0..states {
            all.extend(starts[..columns].iter().map(|start| start + number(state * entries.len())));
        }
        all.push(number(states * entries.len()));
        for state in 0..states {
            let down = if own_rows { rows * number(state) } else { 0 };
            all.extend(entries.iter().map(|row| row + down));
        }
        self.sparsity = all;
    }

    fn full(name: &str, rows: usize, columns: usize) -> Self {
        Self::new(name, rows, columns, |_, _| true).0
    }

    fn empty(name: &str, rows: usize, columns: usize) -> Self {
        Self::new(name, rows, columns, |_, _| false).0
    }
}

/// The matrix from which the numbers of a result are copied.
#[derive(Clone, Copy)]
enum Source {
    Value,
    Jacobian,
    Gradient,
    Hessian,
    TransposedJacobian,
    Nothing,
}

pub(super) struct Output {
    pub(super) port: Port,
    source: Source,
    /// For each entry of one state's result, the index of the entry's number in the source.
    from: Vec<usize>,
}

/// The description of one of a slot's functions for CasADi.
#[derive(Default)]
pub(super) struct Description {
    pub(super) inputs: Vec<Port>,
    pub(super) outputs: Vec<Output>,
}

impl Description {
    /// Repeats the inputs and outputs for a number of states. Jacobians become block-diagonal.
    fn of_many(mut self, states: usize, is_jacobian: bool) -> Self {
        self.inputs.iter_mut().for_each(|port| port.repeat(states, false));
        self.outputs.iter_mut().for_each(|output| output.port.repeat(states, is_jacobian));
        self
    }
}

/// A function that is bound to a slot.
pub(super) struct Bound {
    computation: Box<dyn Computation>,
    /// Bytes that identify the function.
    pub(super) key: Vec<u8>,
    /// Number of states per call. Arguments and results contain the columns of all states, one state after the other.
    states: usize,
    chart: Chart,
    /// Size of each argument for one state; `ny` is the total size of the results for one state.
    sizes: Vec<usize>,
    ny: usize,
    /// For each result, the index of the result's first number among the numbers of all results. Further, the indices
    /// of the result's entries relative to this number.
    results: Vec<(usize, Vec<usize>)>,
    pub(super) descriptions: [Description; 4],
    /// Work spaces that no call uses at present. Each call takes a work space and returns it at the end. So the list
    /// grows to the largest number of simultaneous calls.
    free: Mutex<Vec<Work>>,
}

/// Work space of a call, with one position, one Jacobian J and one Hessian H for each state that is computed at the
/// same time.
struct Work {
    calls: Box<dyn Calls>,
    positions: Vec<Position>,
    x: Vec<Vec<f64>>,
    lambda: Vec<f64>,
    y: Vec<f64>,
    /// `J`, `g` and `H` are derivatives of the function f with respect to tangent coordinates: J, Jᵀλ and the Hessian
    /// of λᵀf, with multipliers λ.
    J: Vec<DMatrix<f64>>,
    g: Vec<f64>,
    H: Vec<DMatrix<f64>>,
    /// `Jx`, `gx` and `Hx` are the same derivatives with respect to CasADi's coordinates.
    Jx: DMatrix<f64>,
    gx: Vec<f64>,
    Hx: DMatrix<f64>,
    /// `half` is the product H T, and `turned` is the transpose of this product. H is the Hessian with respect to
    /// tangent coordinates, and T maps changes of CasADi's coordinates to tangent vectors.
    half: DMatrix<f64>,
    turned: DMatrix<f64>,
}

impl Bound {
    pub(super) fn new(computation: Box<dyn Computation>, states: usize, key: Vec<u8>) -> Result<Self, Error> {
        let (chart, outputs) = (computation.chart(), computation.outputs());
        let (arguments, sizes): (Vec<_>, Vec<_>) = computation.arguments().into_iter().unzip();
        let size = |argument: usize| sizes[argument];
        let x_start = |argument: usize| sizes[..argument].iter().sum::<usize>();
        let nx = x_start(arguments.len());
        let y_start: Vec<usize> = outputs
            .iter()
            .scan(0, |sum, o| {
                *sum += o.rows * o.columns;
                Some(*sum - o.rows * o.columns)
            })
            .collect();
        let ny = outputs.iter().map(|o| o.rows * o.columns).sum::<usize>();

        let tangent = |argument: usize, k: usize| chart.moved_by(x_start(argument) + k);
        let depends = |y: usize, argument: usize, k: usize| tangent(argument, k).any(|j| computation.depends(y, j));
        let in_result = |o: usize, i: usize, j: usize| computation.present(o, i, j);
        let second = |(a, i): (usize, usize), (b, j): (usize, usize)| {
            tangent(a, i).any(|i| tangent(b, j).any(|j| computation.curves(i, j)))
        };

        let inputs = || arguments.iter().enumerate().map(|(k, name)| Port::full(name, size(k), 1));
        let unread = || outputs.iter().map(|o| Port::empty(&format!("out_{}", o.name), o.rows, o.columns));
        let seeds = || {
            let seed = |(k, o): (usize, &super::computation::Output)| {
                Port::new(&format!("adj_{}", o.name), o.rows, o.columns, |i, j| in_result(k, i, j)).0
            };
            outputs.iter().enumerate().map(seed)
        };

        let mut value = Description { inputs: inputs().collect(), ..Description::default() };
        let mut results = Vec::new();
        for (k, o) in outputs.iter().enumerate() {
            let (port, places) = Port::new(o.name, o.rows, o.columns, |i, j| in_result(k, i, j));
            let from = places.iter().map(|place| y_start[k] + place).collect();
            value.outputs.push(Output { port, source: Source::Value, from });
            results.push((y_start[k], places));
        }

        let mut jacobian = Description { inputs: inputs().chain(unread()).collect(), ..Description::default() };
        for (k, o) in outputs.iter().enumerate() {
            for (a, argument) in arguments.iter().enumerate() {
                let count = o.rows * o.columns;
                let present =
                    |i: usize, j: usize| in_result(k, i % o.rows, i / o.rows) && depends(y_start[k] + i, a, j);
                let (port, places) = Port::new(&format!("jac_{}_{argument}", o.name), count, size(a), present);
                let number = |place: usize| (x_start(a) + place / count) * ny + y_start[k] + place % count;
                let from = places.into_iter().map(number).collect();
                jacobian.outputs.push(Output { port, source: Source::Jacobian, from });
            }
        }

        let mut reverse =
            Description { inputs: inputs().chain(unread()).chain(seeds()).collect(), ..Description::default() };
        for (a, argument) in arguments.iter().enumerate() {
            let port = Port::full(&format!("adj_{argument}"), size(a), 1);
            let from = (x_start(a)..x_start(a) + size(a)).collect();
            reverse.outputs.push(Output { port, source: Source::Gradient, from });
        }

        let unread_gradient =
            arguments.iter().enumerate().map(|(a, name)| Port::empty(&format!("out_adj_{name}"), size(a), 1));
        let inputs_of_hessian = inputs().chain(unread()).chain(seeds()).chain(unread_gradient);
        let mut hessian = Description { inputs: inputs_of_hessian.collect(), ..Description::default() };
        for (a, argument) in arguments.iter().enumerate() {
            for (b, by) in arguments.iter().enumerate() {
                let present = |i: usize, j: usize| second((a, i), (b, j));
                let (port, places) = Port::new(&format!("jac_adj_{argument}_{by}"), size(a), size(b), present);
                let number = |place: usize| (x_start(b) + place / size(a)) * nx + x_start(a) + place % size(a);
                let from = places.into_iter().map(number).collect();
                hessian.outputs.push(Output { port, source: Source::Hessian, from });
            }
            for o in &outputs {
                let port = Port::empty(&format!("jac_adj_{argument}_out_{}", o.name), size(a), o.rows * o.columns);
                hessian.outputs.push(Output { port, source: Source::Nothing, from: Vec::new() });
            }
            for (k, o) in outputs.iter().enumerate() {
                let name = format!("jac_adj_{argument}_adj_{}", o.name);
                let present =
                    |j: usize, i: usize| in_result(k, i % o.rows, i / o.rows) && depends(y_start[k] + i, a, j);
                let (port, places) = Port::new(&name, size(a), o.rows * o.columns, present);
                let number = |place: usize| (x_start(a) + place % size(a)) * ny + y_start[k] + place / size(a);
                let from = places.into_iter().map(number).collect();
                hessian.outputs.push(Output { port, source: Source::TransposedJacobian, from });
            }
        }
        let [value, reverse] = [value, reverse].map(|of| of.of_many(states, false));
        let [jacobian, hessian] = [jacobian, hessian].map(|of| of.of_many(states, true));
        let descriptions = [value, jacobian, reverse, hessian];
        let free = Mutex::new(Vec::new());
        let bound = Self { computation, key, states, chart, sizes, ny, results, descriptions, free };
        let work = bound.work()?;
        bound.give_back(work);
        Ok(bound)
    }

    fn work(&self) -> Result<Work, Error> {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop();
        if let Some(work) = free {
            return Ok(work);
        }
        let (nx, ny) = (self.sizes.iter().sum::<usize>(), self.ny);
        let tangents = nx - self.chart.nq + self.chart.nv;
        let calls = self.computation.calls(self.states)?;
        let most = calls.most();
        Ok(Work {
            calls,
            positions: vec![self.chart.position(); most],
            x: self.sizes.iter().map(|&size| vec![0.0; most * size]).collect(),
            lambda: vec![0.0; most * ny],
            y: vec![0.0; most * ny],
            J: vec![DMatrix::zeros(ny, tangents); most],
            g: vec![0.0; tangents],
            H: vec![DMatrix::zeros(tangents, tangents); most],
            Jx: DMatrix::zeros(ny, nx),
            gx: vec![0.0; nx],
            Hx: DMatrix::zeros(nx, nx),
            half: DMatrix::zeros(tangents, nx),
            turned: DMatrix::zeros(nx, tangents),
        })
    }

    fn give_back(&self, work: Work) {
        self.free.lock().unwrap_or_else(PoisonError::into_inner).push(work);
    }

    /// Evaluates a function of the slot.
    ///
    /// # Safety
    /// `arg` has a pointer for each input, and `res` for each output. Each pointer is null or points to as many numbers
    /// as the input or output has entries.
    #[allow(unsafe_code)]
    pub(super) unsafe fn evaluate(
        &self,
        function: usize,
        arg: *const *const f64,
        res: *const *mut f64,
    ) -> Result<(), Error> {
        let mut work = self.work()?;
        let most = work.J.len();
        for first in (0..self.states).step_by(most) {
            let some = first..self.states.min(first + most);
            // SAFETY: the caller promises valid pointers in `arg` and `res`.
            unsafe { self.evaluate_some(function, some, &mut work, arg, res)? };
        }
        self.give_back(work);
        Ok(())
    }

    /// Evaluates a function for the states in the range `some`, in one call of the computation. The range may not
    /// contain more states than such a call allows.
    ///
    /// # Safety
    /// `arg` and `res` must satisfy the conditions of `evaluate`.
    #[allow(unsafe_code)]
    unsafe fn evaluate_some(
        &self,
        function: usize,
        some: Range<usize>,
        w: &mut Work,
        arg: *const *const f64,
        res: *const *mut f64,
    ) -> Result<(), Error> {
        let (n, all) = (some.len(), self.states);
        // SAFETY: the caller promises valid pointers in `arg` and `res`.
        let input = |k: usize, count: usize| unsafe {
            let given = *arg.add(k);
            (!given.is_null())
                .then(|| &core::slice::from_raw_parts(given, all * count)[some.start * count..][..n * count])
        };
        for (k, (x, &size)) in w.x.iter_mut().zip(&self.sizes).enumerate() {
            x.resize(n * size, 0.0);
            match input(k, size) {
                Some(given) => x.copy_from_slice(given),
                None => x.fill(0.0),
            }
        }
        let x = &mut w.x;
        let Chart { nq, nv, .. } = self.chart;
        let (size, arguments, is_flat) = (self.sizes[0], x.len(), self.chart.is_flat());
        if !is_flat {
            for (position, q) in w.positions.iter_mut().zip(x[0].chunks_exact_mut(size)) {
                self.chart.update(&q[..nq], position);
                q[..nq].copy_from_slice(&position.q);
            }
        }
        let (ny, lambda) = (self.ny, &mut w.lambda[..n * self.ny]);
        if function >= REVERSE {
            lambda.fill(0.0);
            for (k, (start, places)) in self.results.iter().enumerate() {
                let count = places.len();
                let Some(seeds) = input(arguments + self.results.len() + k, count) else { continue };
                for s in 0..n {
                    let (lambda, seeds) = (&mut lambda[s * ny..][..ny], &seeds[s * count..][..count]);
                    places.iter().zip(seeds).for_each(|(place, &seed)| lambda[start + place] = seed);
                }
            }
        }
        // SAFETY: the caller promises valid pointers in `arg` and `res`.
        let is_wanted = |k: usize| unsafe { !(*res.add(k)).is_null() };
        let mut outputs = self.descriptions[function].outputs.iter().enumerate();
        let wants_jacobian = outputs.any(|(k, o)| matches!(o.source, Source::TransposedJacobian) && is_wanted(k));
        match function {
            VALUE => w.calls.value(x, &mut w.y[..n * ny]),
            HESSIAN => {
                let J = (wants_jacobian || !is_flat).then_some(&mut w.J[..n]);
                w.calls.hessian(x, lambda, J, &mut w.H[..n])?;
            }
            _ => w.calls.jacobian(x, &mut w.J[..n]),
        }
        for s in 0..n {
            let (lambda, J, H) = (&w.lambda[s * ny..][..ny], &w.J[s], &w.H[s]);
            let times_lambda = |J: &DMatrix<f64>, g: &mut [f64]| {
                for (g, column) in g.iter_mut().zip(J.column_iter()) {
                    *g = column.iter().zip(lambda).map(|(x, l)| x * l).sum(); // Jᵀλ
                }
            };
            if function != VALUE && !is_flat {
                self.by_coordinates(&w.positions[s], J, &mut w.Jx);
            }
            let Jx = if is_flat { J } else { &w.Jx };
            if function == REVERSE {
                times_lambda(Jx, &mut w.gx);
            }
            if function == HESSIAN && !is_flat {
                times_lambda(J, &mut w.g);
                self.by_coordinates(&w.positions[s], H, &mut w.half);
                w.half.transpose_to(&mut w.turned); // (H T)ᵀ
                self.by_coordinates(&w.positions[s], &w.turned, &mut w.Hx); // Tᵀ H T, which is symmetric
                self.chart.add_curvature(&w.positions[s], &w.g[..nv], &mut w.Hx, 0);
            }
            let Hx = if is_flat { H } else { &w.Hx };
            for (k, output) in self.descriptions[function].outputs.iter().enumerate() {
                let count = output.from.len();
                // SAFETY: the caller promises valid pointers in `arg` and `res`.
                let to = unsafe {
                    let to = *res.add(k);
                    if to.is_null() {
                        continue;
                    }
                    core::slice::from_raw_parts_mut(to.add((some.start + s) * count), count)
                };
                let source = match output.source {
                    Source::Value => &w.y[s * ny..],
                    Source::Jacobian | Source::TransposedJacobian => Jx.as_slice(),
                    Source::Gradient => &w.gx,
                    Source::Hessian => Hx.as_slice(),
                    Source::Nothing => &[],
                };
                to.iter_mut().zip(&output.from).for_each(|(to, &from)| *to = source[from]);
            }
        }
        Ok(())
    }

    /// Converts a matrix with a column for each tangent coordinate to a matrix with a column for each of CasADi's
    /// coordinates.
    fn by_coordinates(&self, at: &Position, from: &DMatrix<f64>, to: &mut DMatrix<f64>) {
        let Chart { nq, nv, .. } = self.chart;
        self.chart.multiply(at, from, 0, to, 0);
        let rest = from.ncols() - nv;
        to.columns_mut(nq, rest).copy_from(&from.columns(nv, rest));
    }
}
