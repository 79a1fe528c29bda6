//! Writes code in C99.

use super::{Dialect, SourceFile, Writer, description, digits, heading, prefixed};
use crate::function::Array;
use crate::program::Program;
use core::fmt::Write;

/// Code of sines and cosines, without branches except for angles out of range. The code computes the same sums and
/// products as the library (`condyle_spatial::Scalar::sin_cos`), and compilers vectorise it.
const SIN_COS: &str = include_str!("sin_cos.c");

/// Code of vector types and functions. It uses GCC's extensions, which clang also has.
const VECTORS: &str = include_str!("vectors.c");

/// Syntax of C, with `double` or `float`.
pub(crate) struct C {
    /// Type of numbers.
    pub real: &'static str,
    /// Number of states that a call computes at the same time, as lanes of vectors.
    pub lanes: usize,
    /// Name of all files, which is also the prefix of the functions.
    pub name: String,
}

impl C {
    fn is_vector(&self) -> bool {
        self.lanes > 1
    }

    fn is_float(&self) -> bool {
        self.real == "float"
    }

    /// Returns the name that a function of `math.h` has for this type of numbers.
    fn function(&self, name: &str) -> String {
        format!("{name}{}", if self.is_float() { "f" } else { "" })
    }
}

impl Dialect for C {
    fn number(&self, x: f64) -> String {
        let suffix = if self.is_float() { "f" } else { "" };
        match x {
            _ if x.is_nan() => "NAN".to_owned(),
            _ if x.is_infinite() => format!("({}INFINITY)", if x < 0.0 { "-" } else { "" }),
            _ if x < 0.0 => format!("({}{suffix})", digits(x)),
            _ => format!("{}{suffix}", digits(x)),
        }
    }
    fn element(&self, array: &str, index: &str) -> String {
        if self.is_vector() { format!("AT({array}, {index})") } else { format!("{array}[{index}]") }
    }
    fn work(&self, slot: &str) -> String {
        self.element("w", slot)
    }
    fn whole(&self, value: String) -> String {
        let is_number = value.starts_with(|c: char| c.is_ascii_digit() || c == '(');
        if self.is_vector() && is_number { format!("WHOLE({value})") } else { value }
    }
    fn fence(&self) -> Option<&'static str> {
        Some("FENCE;")
    }
    fn variable(&self, name: &str, expression: &str, is_mask: bool) -> String {
        let Self { real, name: file, .. } = self;
        match (self.is_vector(), is_mask) {
            (false, true) => format!("const int {name} = {expression};"),
            (false, false) => format!("const {real} {name} = {expression};"),
            (true, true) => format!("const {file}_mask {name} = ({file}_mask)({expression});"),
            (true, false) => format!("const {file}_real {name} = {expression};"),
        }
    }
    fn sin_cos(&self, sin: &str, cos: &str, angle: &str) -> String {
        let Self { real, name, lanes } = self;
        let (kind, cast) = if self.is_vector() {
            (format!("{name}_real"), format!("({real} *)"))
        } else {
            (real.to_string(), String::new())
        };
        format!(
            "{kind} {sin} = {angle}, {cos}; {name}_sin_cos({lanes}, {cast}&{sin}, {cast}&{cos}); (void){sin}; (void){cos};"
        )
    }
    fn select(&self, mask: &str, a: &str, b: &str) -> String {
        match self.is_vector() {
            false => format!("{mask} ? {a} : {b}"),
            true => format!("SELECT({mask}, {}, {})", self.whole(a.to_owned()), self.whole(b.to_owned())),
        }
    }
    fn call(&self, function: &str, a: &str) -> String {
        match (self.is_vector(), function) {
            (false, "abs") => format!("{}({a})", self.function("fabs")),
            (false, _) => format!("{}({a})", self.function(function)),
            (true, "abs") => format!("ABS({a})"),
            (true, _) => format!("{}({a})", function.to_uppercase()),
        }
    }
    fn atan2(&self, y: &str, x: &str) -> String {
        match self.is_vector() {
            false => format!("{}({y}, {x})", self.function("atan2")),
            true => format!("ATAN2({}, {})", self.whole(y.to_owned()), self.whole(x.to_owned())),
        }
    }
    fn mask_to_work(&self, mask: &str) -> String {
        if self.is_vector() { format!("({}_memory){mask}", self.name) } else { format!("{mask} ? 1 : 0") }
    }
    fn mask_from_work(&self, number: &str) -> String {
        if self.is_vector() { format!("(({}_mask){number})", self.name) } else { format!("({number} != 0)") }
    }
    fn truth(&self, holds: bool) -> &'static str {
        if holds { "1" } else { "0" }
    }
}

/// Returns the parameters of a function: inputs, then the work space, then outputs.
fn parameters(real: &str, reads: &[&Array], work: bool, writes: &[&Array]) -> String {
    let reads = reads.iter().map(|a| format!("const {real} *restrict {}", a.name));
    let work = work.then(|| format!("{real} *restrict w"));
    let writes = writes.iter().map(|a| format!("{real} *restrict {}", a.name));
    let all: Vec<String> = reads.chain(work).chain(writes).collect();
    if all.is_empty() { "void".to_owned() } else { all.join(", ") }
}

/// Returns the signature of a function: `void name(…)`.
pub(crate) fn signature(real: &str, name: &str, program: &Program) -> String {
    let (reads, writes): (Vec<&Array>, Vec<&Array>) =
        (program.function.inputs.iter().collect(), program.function.outputs.iter().collect());
    format!("void {name}_{}({})", program.function.name, parameters(real, &reads, false, &writes))
}

/// Returns the header and the source of functions that compute `lanes` states in a call.
pub(crate) fn files(name: &str, programs: &[Program], real: &'static str, lanes: usize) -> Vec<SourceFile> {
    let guard = format!("{}_H", name.to_uppercase());
    let mut lines = heading(name, programs);
    if lanes > 1 {
        lines.push(String::new());
        lines.push(format!(
            "A call computes {lanes} states. Number k of an array of state i stands at [{lanes} * k + i]."
        ));
    }
    let mut header = comment(&lines);
    let _ = write!(
        header,
        "#ifndef {guard}\n#define {guard}\n\n#ifdef __cplusplus\n#define restrict\nextern \"C\" {{\n#endif\n"
    );
    for program in programs {
        let _ = write!(header, "\n{}{};\n", comment(&description(program)), signature(real, name, program));
    }
    let _ = write!(header, "\n#ifdef __cplusplus\n}}\n#undef restrict\n#endif\n\n#endif\n");

    let mut source = comment(&lines);
    let _ = write!(source, "#include \"{name}.h\"\n\n#include <math.h>\n\n");
    source += "/* The parts of a function are compiled one by one. */\n\
               #ifdef __GNUC__\n#define PART static __attribute__((noinline))\n#else\n#define PART static\n#endif\n\n";
    source += "/* Without fences clang loads numbers long before they are needed. */\n\
               #ifdef __clang__\n#define FENCE __asm__ volatile(\"\" ::: \"memory\")\n#else\n#define FENCE\n#endif\n\n";
    let is_wide = vector_bytes(real, lanes) > 32;
    if is_wide {
        source += WIDE;
    }
    if programs.iter().any(|p| p.steps.operations().angles > 0) {
        source += &sin_cos(name, real);
    }
    if lanes > 1 {
        source += &vectors(name, real, lanes);
    }
    for program in programs {
        let writer = Writer::new(program, C { real, lanes, name: name.to_owned() });
        source += &function(&writer, name);
    }
    if is_wide {
        source += WIDE_END;
    }
    vec![SourceFile { name: format!("{name}.h"), text: header }, SourceFile { name: format!("{name}.c"), text: source }]
}

/// Beginning of functions with vectors of 64 bytes. For many processors with AVX-512, clang halves such vectors unless
/// an option or this attribute asks for whole ones. RNEA of Talos for eight states then takes 2.5 times as long.
const WIDE: &str = "/* clang keeps vectors of 64 bytes whole. */\n#ifdef __clang__\n\
                    #pragma clang attribute push(__attribute__((min_vector_width(512))), apply_to = function)\n\
                    #endif\n\n";

const WIDE_END: &str = "#ifdef __clang__\n#pragma clang attribute pop\n#endif\n";

/// Returns the size of a vector (bytes).
fn vector_bytes(real: &str, lanes: usize) -> usize {
    lanes * if real == "float" { 4 } else { 8 }
}

/// Returns the code of sines and cosines, with the names that a file uses.
fn sin_cos(name: &str, real: &str) -> String {
    let section = |from: &str| {
        let (_, rest) = SIN_COS.split_once(&format!("/* {from} */\n")).unwrap_or_default();
        rest.split("/* end */\n").next().unwrap_or_default().to_owned()
    };
    section(real).replace("NAME", name)
}

/// Returns the code of vectors, with the names that a file uses.
fn vectors(name: &str, real: &str, lanes: usize) -> String {
    let is_float = real == "float";
    let (size, suffix) = if is_float { (4, "f") } else { (8, "") };
    let (integer, largest) = if is_float { ("int", "0x7fffffff") } else { ("long long", "0x7fffffffffffffffLL") };
    let mut text = VECTORS.replace("LARGEST", largest);
    for (word, value) in [
        ("NAME", name),
        ("REAL", real),
        ("INTEGER", integer),
        ("BYTES", &vector_bytes(real, lanes).to_string()),
        ("SIZE", &size.to_string()),
        ("WIDTH", &lanes.to_string()),
        ("ROOT_OF", &format!("sqrt{suffix}")),
        ("ANGLE_OF", &format!("atan2{suffix}")),
    ] {
        text = text.replace(word, value);
    }
    text
}

/// Returns a comment that contains these lines.
pub(crate) fn comment(lines: &[String]) -> String {
    let body = prefixed(" * ", lines);
    format!("/*\n{body} */\n")
}

/// Returns the code of a function and of its parts.
fn function(writer: &Writer<C>, name: &str) -> String {
    let program = writer.program;
    let (real, function) = (writer.dialect.real, &program.function.name);
    let (mut text, mut body) = (String::new(), Vec::new());
    let n = program.angles().len();
    let lanes = writer.dialect.lanes;
    if program.work > 0 {
        body.push(match lanes {
            1 => format!("{real} w[{}];", program.work),
            _ => format!("{real} w[{}] __attribute__((aligned(sizeof({name}_real))));", lanes * program.work),
        });
    }
    for (k, angle) in program.angles().iter().enumerate() {
        body.push(format!("{} = {};", writer.dialect.element("w", &k.to_string()), writer.angle(angle.angle)));
    }
    if n > 0 {
        body.push(format!("{name}_sin_cos({0}, w, w + {0});", lanes * n));
    }
    if let [_] = program.parts[..] {
        body.extend(writer.lines(0));
    } else {
        for p in 0..program.parts.len() {
            let (reads, writes) = writer.arrays(p);
            let names = reads.iter().map(|a| &*a.name).chain(["w"]).chain(writes.iter().map(|a| &*a.name));
            body.push(format!("{name}_{function}_{p}({});", names.collect::<Vec<_>>().join(", ")));
            let parameters = parameters(real, &reads, true, &writes);
            let lines = prefixed("    ", &writer.lines(p));
            let _ = write!(text, "PART void {name}_{function}_{p}({parameters}) {{\n{lines}}}\n\n");
        }
    }
    body.extend(writer.given_results());
    body.extend(writer.unused_arrays().iter().map(|name| format!("(void){name};")));
    let _ = write!(text, "{} {{\n{}}}\n\n", signature(real, name, program), prefixed("    ", &body));
    text
}
