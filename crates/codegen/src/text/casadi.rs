//! C for CasADi's `external`.

use super::c::comment;
use super::{SourceFile, description, heading};
use crate::function::Array;
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
        text += &function(name, program);
    }
    SourceFile { name: format!("{name}_casadi.c"), text }
}

/// All that CasADi asks of one function.
fn function(file: &str, program: &Program) -> String {
    let function = program.function;
    let (inputs, outputs) = (&function.inputs, &function.outputs);
    let own = format!("{file}_{}", function.name);
    let name = format!("{own}_casadi");
    let sizes = |arrays: &[Array]| arrays.iter().map(Array::len).sum::<usize>();
    let largest = inputs.iter().map(Array::len).max().unwrap_or(0);
    let mut text = format!("\n{}", comment(&description(program)));
    let _ = write!(
        text,
        "EXPORT int {name}(const casadi_real **arg, casadi_real **res, casadi_int *iw, casadi_real *w, int mem) {{\n    \
         (void)iw; (void)mem;\n    for (int k = 0; k < {largest}; k++) w[k] = 0; /* what an argument that is left out is */\n"
    );
    let mut next = largest;
    let mut names: Vec<String> = (0..inputs.len()).map(|k| format!("arg[{k}] ? arg[{k}] : w")).collect();
    for (k, array) in outputs.iter().enumerate() {
        names.push(format!("res[{k}] ? res[{k}] : w + {next}"));
        next += array.len();
    }
    let (n_in, n_out) = (inputs.len(), outputs.len());
    let _ = write!(
        text,
        "    {own}({});\n    return 0;\n}}\nEXPORT casadi_int {name}_n_in(void) {{ return {n_in}; }}\n\
         EXPORT casadi_int {name}_n_out(void) {{ return {n_out}; }}\n",
        names.join(", ")
    );
    for (which, arrays) in [("in", inputs), ("out", outputs)] {
        let names: Vec<String> = arrays.iter().map(|a| format!("\"{}\"", a.name)).collect();
        let shapes: Vec<String> = arrays.iter().map(|a| format!("{{{}, {}, 1}}", a.rows, a.columns)).collect();
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
        largest + sizes(outputs)
    );
    text
}
