//! C for CasADi's `external`.

use super::c::comment;
use super::{SourceFile, description, heading};
use crate::function::{Array, Function};
use crate::program::Program;
use core::fmt::Write;

/// The types and marks of the interface, as CasADi's own generated code has them.
const HEAD: &str = include_str!("casadi.c");

/// The file with a function of CasADi's interface for each function.
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
        text += &format!("\n{}", comment(&description(program)));
        text += &interface(&casadi, &inputs, &outputs, name, function);
        if let Some((derivatives, blocks)) = jacobian(function, programs) {
            let given = outputs.into_iter().map(|(o, array)| (format!("out_{o}"), array));
            text += &format!("\n{}", comment(&[format!("The Jacobian of {casadi}: each output by each input.")]));
            text +=
                &interface(&format!("jac_{casadi}"), &[inputs, given.collect()].concat(), &blocks, name, derivatives);
        }
    }
    SourceFile { name: format!("{name}_casadi.c"), text }
}

/// The function that computes a function's derivatives, if it is there, and they are by the numbers of each argument (not so of
/// positions with quaternions): `dy_dx` of `f_derivatives` for each output y and input x of `f`, as CasADi names and orders
/// them.
fn jacobian<'f>(function: &Function, programs: &[Program<'f>]) -> Option<(&'f Function, Vec<(String, Array)>)> {
    let name = format!("{}_derivatives", function.name);
    let derivatives = programs.iter().map(|program| program.function).find(|f| f.name == name)?;
    let mut blocks = Vec::new();
    for (y, x) in function.outputs.iter().flat_map(|y| function.inputs.iter().map(move |x| (y, x))) {
        let block = derivatives.outputs.iter().find(|d| d.name == format!("d{}_d{}", y.name, x.name))?;
        let fits = (block.rows, block.columns) == (y.len(), x.len());
        blocks.push(fits.then(|| (format!("jac_{}_{}", y.name, x.name), block.clone()))?);
    }
    (derivatives.inputs == function.inputs).then_some((derivatives, blocks))
}

/// All that CasADi asks of one function, with such names of arrays; computed by a function that takes the first inputs, and of
/// which the outputs are some results.
fn interface(
    name: &str,
    inputs: &[(String, Array)],
    outputs: &[(String, Array)],
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
        let at = outputs.iter().position(|(_, array)| array.name == result.name);
        names.push(at.map_or(format!("w + {next}"), |k| format!("res[{k}] ? res[{k}] : w + {next}")));
        next += result.len();
    }
    let (n_in, n_out) = (inputs.len(), outputs.len());
    let _ = write!(
        text,
        "    {file}_{}({});\n    return 0;\n}}\nEXPORT casadi_int {name}_n_in(void) {{ return {n_in}; }}\n\
         EXPORT casadi_int {name}_n_out(void) {{ return {n_out}; }}\n",
        function.name,
        names.join(", ")
    );
    for (which, arrays) in [("in", inputs), ("out", outputs)] {
        let names: Vec<String> = arrays.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let shapes: Vec<String> = arrays.iter().map(|(_, a)| format!("{{{}, {}, 1}}", a.rows, a.columns)).collect();
        let n = arrays.len();
        // an array of size 0 is no C: there is one more than is asked for
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
