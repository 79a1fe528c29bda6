//! Writes C code for CasADi's `external`.

use super::c::comment;
use super::{SourceFile, description, heading};
use crate::function::{Array, Function};
use crate::program::Program;
use core::fmt::Write;

/// Types and macros of CasADi's interface, as in CasADi's own generated code.
const HEAD: &str = include_str!("casadi.c");

/// Returns the file that implements CasADi's interface for each of the functions.
pub(crate) fn file(name: &str, programs: &[Program]) -> SourceFile {
    let mut lines = heading(name, programs);
    lines.extend([
        String::new(),
        format!("For casadi.external(\"{name}_..._casadi\", library), of a shared library of this file and {name}.c."),
    ]);
    let mut text = format!("{}#include \"{name}.h\"\n\n{HEAD}", comment(&lines));
    for program in programs {
        let function = program.function;
        let casadi = format!("{name}_{}_casadi", function.name);
        let [inputs, outputs] = [&function.inputs, &function.outputs]
            .map(|arrays| arrays.iter().map(|array| (array.name.clone(), array.clone())).collect::<Vec<_>>());
        let results = outputs.iter().map(|(o, array)| (o.clone(), Output::Result(array.clone()))).collect::<Vec<_>>();
        text += &format!("\n{}", comment(&description(program)));
        text += &interface(&casadi, &inputs, &results, name, function);
        if let Some((derivatives, blocks)) = jacobian(function, programs) {
            let given = outputs.into_iter().map(|(o, array)| (format!("out_{o}"), array));
            text += &format!("\n{}", comment(&[format!("The Jacobian of {casadi}: each output by each input.")]));
            let inputs = [inputs, given.collect()].concat();
            text += &interface(&format!("jac_{casadi}"), &inputs, &blocks, name, derivatives);
        }
    }
    SourceFile { name: format!("{name}_casadi.c"), text }
}

/// Result that CasADi requests.
enum Output {
    /// Result of the called function.
    Result(Array),
    /// Derivative of a result y with respect to the restitution e of an impact. y is affine in e. At e = -1, the value
    /// of y is known, because the impact then has no effect: `v_after` is v, and impulses are 0. So dy/de = (y - y(-1))
    /// / (1 + e).
    ByRestitution(Array),
}

impl Output {
    /// Returns the numbers of rows and columns.
    fn shape(&self) -> (usize, usize) {
        match self {
            Self::Result(array) => (array.rows, array.columns),
            Self::ByRestitution(y) => (y.len(), 1),
        }
    }
}

/// Returns the name of a result y in the names `dy_dx` of its derivatives. For example, the name is `v` for the result
/// `v_after`, which is the new value of `v`.
fn differentiated(y: &Array) -> &str {
    y.name.strip_suffix("_after").unwrap_or(&y.name)
}

/// Returns the function that computes the derivatives of a function, if it exists. Positions with quaternions are
/// excluded, because CasADi needs derivatives with respect to each number of an argument. The results are `dy_dx` of
/// `f_derivatives` for each output y (or `y_after`) and each input x of `f`, in CasADi's names and order. Derivatives
/// with respect to the restitution of an impact do not need a result of `f_derivatives`.
fn jacobian<'f>(function: &Function, programs: &[Program<'f>]) -> Option<(&'f Function, Vec<(String, Output)>)> {
    let name = format!("{}_derivatives", function.name);
    let derivatives = programs.iter().map(|program| program.function).find(|f| f.name == name)?;
    let mut blocks = Vec::new();
    for (y, x) in function.outputs.iter().flat_map(|y| function.inputs.iter().map(move |x| (y, x))) {
        let name = format!("d{}_d{}", differentiated(y), x.name);
        let block = match derivatives.outputs.iter().find(|d| d.name == name) {
            Some(block) => Output::Result(block.clone()),
            None if function.name == "impulse_dynamics" && x.name == "restitution" => Output::ByRestitution(y.clone()),
            None => return None,
        };
        let fits = block.shape() == (y.len(), x.len());
        blocks.push(fits.then(|| (format!("jac_{}_{}", y.name, x.name), block))?);
    }
    (derivatives.inputs == function.inputs).then_some((derivatives, blocks))
}

/// Returns CasADi's interface of one function. `inputs` and `outputs` contain the arrays and the names that CasADi
/// gives them. The interface calls the generated function `function`, which can have fewer inputs: only the first of
/// `inputs`.
fn interface(
    name: &str,
    inputs: &[(String, Array)],
    outputs: &[(String, Output)],
    file: &str,
    function: &Function,
) -> String {
    let largest = function.inputs.iter().map(Array::len).max().unwrap_or(0);
    let mut text = String::new();
    let _ = write!(
        text,
        "EXPORT int {name}(const casadi_real **arg, casadi_real **res, casadi_int *iw, casadi_real *w, int mem) {{\n    \
         (void)iw; (void)mem;\n    for (int k = 0; k < {largest}; k++) w[k] = 0; /* what an argument that is left out is */\n"
    );
    let mut next = largest;
    let mut names: Vec<String> = (0..function.inputs.len()).map(|k| format!("arg[{k}] ? arg[{k}] : w")).collect();
    for result in &function.outputs {
        let at = outputs.iter().position(|(_, o)| matches!(o, Output::Result(array) if array.name == result.name));
        names.push(at.map_or(format!("w + {next}"), |k| format!("res[{k}] ? res[{k}] : w + {next}")));
        next += result.len();
    }
    let (n_in, n_out) = (inputs.len(), outputs.len());
    let _ = writeln!(text, "    {file}_{}({});", function.name, names.join(", "));
    let arrays = || function.inputs.iter().chain(&function.outputs);
    let place = |name: &str| arrays().position(|array| array.name == name).map(|k| format!("({})", names[k]));
    for (at, (_, output)) in outputs.iter().enumerate() {
        let Output::ByRestitution(y) = output else { continue };
        let (Some(after), Some(e)) = (place(&y.name), place("restitution")) else { continue };
        let change = match y.name.strip_suffix("_after").and_then(place) {
            Some(before) => format!("({after}[k] - {before}[k])"),
            None => format!("{after}[k]"),
        };
        let n = y.len();
        let _ = writeln!(text, "    for (int k = 0; res[{at}] && k < {n}; k++) res[{at}][k] = {change} / (1 + *{e});");
    }
    let _ = write!(
        text,
        "    return 0;\n}}\nEXPORT casadi_int {name}_n_in(void) {{ return {n_in}; }}\n\
         EXPORT casadi_int {name}_n_out(void) {{ return {n_out}; }}\n"
    );
    let ins = inputs.iter().map(|(name, array)| (name, (array.rows, array.columns))).collect::<Vec<_>>();
    let outs = outputs.iter().map(|(name, output)| (name, output.shape())).collect();
    for (which, arrays) in [("in", ins), ("out", outs)] {
        let names: Vec<String> = arrays.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let shapes: Vec<String> = arrays.iter().map(|(_, (rows, cols))| format!("{{{rows}, {cols}, 1}}")).collect();
        let n = arrays.len();
        // An array of size 0 is invalid in C, so each array gets an additional entry.
        let _ = write!(
            text,
            "EXPORT const char *{name}_name_{which}(casadi_int i) {{\n    \
             static const char *const names[] = {{{}}};\n    return 0 <= i && i < {n} ? names[i] : 0;\n}}\n\
             EXPORT const casadi_int *{name}_sparsity_{which}(casadi_int i) {{\n    \
             static const casadi_int shapes[][3] = {{{}}};\n    return 0 <= i && i < {n} ? shapes[i] : 0;\n}}\n",
            names.iter().map(|s| &**s).chain(["0"]).collect::<Vec<_>>().join(", "),
            shapes.iter().map(|s| &**s).chain(["{0, 0, 1}"]).collect::<Vec<_>>().join(", "),
        );
    }
    let _ = write!(
        text,
        "EXPORT int {name}_work(casadi_int *sz_arg, casadi_int *sz_res, casadi_int *sz_iw, casadi_int *sz_w) {{\n    \
         if (sz_arg) *sz_arg = {n_in};\n    if (sz_res) *sz_res = {n_out};\n    if (sz_iw) *sz_iw = 0;\n    \
         if (sz_w) *sz_w = {};\n    return 0;\n}}\n",
        next
    );
    text
}
