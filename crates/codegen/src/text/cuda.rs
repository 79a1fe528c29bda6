//! CUDA: a thread for each state, the numbers of one kind side by side in memory.

use super::{Dialect, SourceFile, Writer, description, heading, prefixed};
use crate::function::Array;
use crate::program::Program;
use crate::text::c::C;
use core::fmt::Write;

/// C with arrays of all states.
struct Cuda(C);

impl Dialect for Cuda {
    fn number(&self, x: f64) -> String {
        self.0.number(x)
    }
    fn element(&self, array: &str, index: &str) -> String {
        if index.contains(' ') { format!("{array}[({index}) * n + i]") } else { format!("{array}[{index} * n + i]") }
    }
    fn variable(&self, name: &str, expression: &str, is_mask: bool) -> String {
        self.0.variable(name, expression, is_mask)
    }
    fn sin_cos(&self, sin: &str, cos: &str, angle: &str) -> String {
        let function = if self.0.real == "float" { "sincosf" } else { "sincos" };
        format!("{} {sin}, {cos}; {function}({angle}, &{sin}, &{cos});", self.0.real)
    }
    fn select(&self, mask: &str, a: &str, b: &str) -> String {
        self.0.select(mask, a, b)
    }
    fn call(&self, function: &str, a: &str) -> String {
        self.0.call(function, a)
    }
    fn atan2(&self, y: &str, x: &str) -> String {
        self.0.atan2(y, x)
    }
    fn mask_to_work(&self, mask: &str) -> String {
        self.0.mask_to_work(mask)
    }
    fn mask_from_work(&self, number: &str) -> String {
        self.0.mask_from_work(number)
    }
    fn truth(&self, holds: bool) -> &'static str {
        self.0.truth(holds)
    }
}

/// The parameters behind the number of states.
fn parameters(real: &str, reads: &[&Array], work: bool, writes: &[&Array]) -> String {
    let reads = reads.iter().map(|a| format!(", const {real} *__restrict__ {}", a.name));
    let work = work.then(|| format!(", {real} *__restrict__ w"));
    let writes = writes.iter().map(|a| format!(", {real} *__restrict__ {}", a.name));
    reads.chain(work).chain(writes).collect()
}

/// The file.
pub(crate) fn files(name: &str, programs: &[Program], real: &'static str) -> Vec<SourceFile> {
    let mut lines = heading(name, programs);
    lines.extend([
        String::new(),
        "A thread computes one of n states. Number k of an array of state i stands at [k * n + i].".to_owned(),
        "Launch with at least n threads: name<<<(n + 127) / 128, 128>>>(n, ...).".to_owned(),
    ]);
    let mut text = format!("{}\n", prefixed("// ", &lines));
    for program in programs {
        text += &function(&Writer::new(program, Cuda(C { real, lanes: 1, name: name.to_owned() })), name);
    }
    vec![SourceFile { name: format!("{name}.cu"), text }]
}

/// A kernel with its parts.
fn function(writer: &Writer<Cuda>, name: &str) -> String {
    let program = writer.program;
    let (real, function) = (writer.dialect.0.real, program.function);
    let (mut text, mut body) = (String::new(), Vec::new());
    let n = program.angles().len();
    body.push("const int i = blockIdx.x * blockDim.x + threadIdx.x;".to_owned());
    body.push("if (i >= n) return;".to_owned());
    if program.work > 0 {
        body.push(format!("{real} w[{}];", program.work));
    }
    let sin_cos = if real == "float" { "sincosf" } else { "sincos" };
    for (k, angle) in program.angles().iter().enumerate() {
        body.push(format!("{sin_cos}({}, &w[{k}], &w[{}]);", writer.angle(angle.angle), n + k));
    }
    if let [_] = program.parts[..] {
        body.extend(writer.lines(0));
    } else {
        for p in 0..program.parts.len() {
            let (reads, writes) = writer.arrays(p);
            let names = reads.iter().map(|a| &*a.name).chain(["w"]).chain(writes.iter().map(|a| &*a.name));
            body.push(format!("{name}_{}_{p}(n, i, {});", function.name, names.collect::<Vec<_>>().join(", ")));
            let parameters = parameters(real, &reads, true, &writes);
            let head =
                format!("static __device__ __noinline__ void {name}_{}_{p}(int n, int i{parameters})", function.name);
            let _ = write!(text, "{head} {{\n{}}}\n\n", prefixed("    ", &writer.lines(p)));
        }
    }
    body.extend(writer.given_results());
    let inputs: Vec<&Array> = function.inputs.iter().collect();
    let outputs: Vec<&Array> = function.outputs.iter().collect();
    let head = format!(
        "extern \"C\" __global__ void {name}_{}(int n{})",
        function.name,
        parameters(real, &inputs, false, &outputs)
    );
    let about = prefixed("// ", &description(program));
    format!("{text}{about}{head} {{\n{}}}\n\n", prefixed("    ", &body))
}
