//! Writes CUDA code. Each thread computes one state, or one partition of a state. An array contains the first number of
//! every state, then the second number of every state, and so on.

use super::{Dialect, SourceFile, Writer, description, heading, interface, prefixed};
use crate::function::{Array, Function};
use crate::partitions::split;
use crate::program::Program;
use crate::text::c::C;
use core::fmt::Write;

/// Syntax of CUDA: the syntax of C, with arrays that contain all states.
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

/// Returns the parameters of a function that follow the number of states.
fn parameters(real: &str, reads: &[&Array], work: bool, writes: &[&Array]) -> String {
    let reads = reads.iter().map(|a| format!(", const {real} *__restrict__ {}", a.name));
    let work = work.then(|| format!(", {real} *__restrict__ w"));
    let writes = writes.iter().map(|a| format!(", {real} *__restrict__ {}", a.name));
    reads.chain(work).chain(writes).collect()
}

/// Returns the file that contains the kernels.
pub(crate) fn files(name: &str, programs: &[Program], real: &'static str, registers: usize) -> Vec<SourceFile> {
    let partitions: Vec<Vec<Function>> = programs.iter().map(|program| split(program, registers)).collect();
    let mut lines = heading(name, programs);
    lines.extend([
        String::new(),
        "A thread computes one of n states. Number k of an array of state i stands at [k * n + i].".to_owned(),
        "Launch with at least n threads: name<<<(n + 127) / 128, 128>>>(n, ...).".to_owned(),
    ]);
    if partitions.iter().any(|partitions| !partitions.is_empty()) {
        lines.extend([
            String::new(),
            "Where a kernel says that it has partitions, as many threads may compute a state, each some of the results, and what".to_owned(),
            "several of them need each for itself: name<<<dim3((n + 127) / 128, partitions), 128>>>(n, ...). That is for few states.".to_owned(),
        ]);
    }
    let mut text = format!("{}\n", prefixed("// ", &lines));
    for (program, partitions) in programs.iter().zip(&partitions) {
        let partitions: Vec<Program> = partitions.iter().map(Program::new).collect();
        let writer = |program| Writer::new(program, Cuda(C { real, lanes: 1, name: name.to_owned() }));
        text += &kernel(&writer(program), &partitions.iter().map(writer).collect::<Vec<_>>(), name);
    }
    vec![SourceFile { name: format!("{name}.cu"), text }]
}

/// Returns a kernel and its parts, or a kernel and the functions of its partitions.
fn kernel(whole: &Writer<Cuda>, partitions: &[Writer<Cuda>], name: &str) -> String {
    let (real, function) = (whole.dialect.0.real, whole.program.function);
    let (inputs, outputs): (Vec<&Array>, Vec<&Array>) =
        (function.inputs.iter().collect(), function.outputs.iter().collect());
    let parameters = parameters(real, &inputs, false, &outputs);
    let symbol = format!("{name}_{}", function.name);
    let mut body =
        ["const int i = blockIdx.x * blockDim.x + threadIdx.x;", "if (i >= n) return;"].map(str::to_owned).to_vec();
    let (mut text, about) = if partitions.is_empty() {
        let (parts, lines) = computation(whole, name);
        body.extend(lines);
        (parts, description(whole.program))
    } else {
        let names: String = inputs.iter().chain(&outputs).map(|a| format!(", {}", a.name)).collect();
        let device_function = |text: &mut String, writer: &Writer<Cuda>, symbol: &str| {
            let (parts, lines) = computation(writer, name);
            let head = format!("static __device__ __noinline__ void {symbol}(int n, int i{parameters})");
            let _ = write!(text, "{parts}{head} {{\n{}}}\n\n", prefixed("    ", &lines));
            format!("{symbol}(n, i{names});")
        };
        let mut text = String::new();
        if function.partitions.is_none() {
            let call = device_function(&mut text, whole, &format!("{symbol}_whole"));
            body.push(format!("if (gridDim.y == 1) return {call}"));
        }
        // If the launch has fewer rows of blocks than partitions, each row computes several partitions in turn.
        let count = partitions.len();
        body.push(format!(
            "for (int partition = blockIdx.y; partition < {count}; partition += gridDim.y) switch (partition) {{"
        ));
        for (k, partition) in partitions.iter().enumerate() {
            let call = device_function(&mut text, partition, &format!("{symbol}_partition{k}"));
            body.push(format!("case {k}: {call} break;"));
        }
        body.push("}".to_owned());
        let operations = |program: &Program| program.steps.operations().total().to_string();
        let each: Vec<String> = partitions.iter().map(|partition| operations(partition.program)).collect();
        let mut about = interface(function);
        let all = operations(whole.program);
        about.push(format!("Partitions: {count}, of {} operations; all results together take {all}.", each.join(", ")));
        (text, about)
    };
    let head = format!("extern \"C\" __global__ void {symbol}(int n{parameters})");
    let _ = write!(text, "{}{head} {{\n{}}}\n\n", prefixed("// ", &about), prefixed("    ", &body));
    text
}

/// Returns the parts of a program as functions, and the lines that call these functions. For a program with only one
/// part, returns no functions, and the lines that compute this part.
fn computation(writer: &Writer<Cuda>, name: &str) -> (String, Vec<String>) {
    let program = writer.program;
    let (real, function) = (writer.dialect.0.real, program.function);
    let (mut text, mut body) = (String::new(), Vec::new());
    let n = program.angles().len();
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
    (text, body)
}
