//! Writes Rust code that does not need `std`.

use super::{Dialect, SourceFile, Writer, description, digits, heading, prefixed};
use crate::function::Array;
use crate::graph::Node;
use crate::program::Program;
use crate::step::Step;
use core::fmt::Write;

/// Code of functions that `core` lacks, for each type of numbers.
const MATHEMATICS: &str = include_str!("mathematics.rs.txt");

/// Syntax of Rust, with `f64` or `f32`.
struct Rust {
    real: &'static str,
}

impl Dialect for Rust {
    fn number(&self, x: f64) -> String {
        match x {
            _ if x.is_nan() => format!("{}::NAN", self.real),
            _ if x.is_infinite() && x > 0.0 => format!("{}::INFINITY", self.real),
            _ if x.is_infinite() => format!("{}::NEG_INFINITY", self.real),
            _ if x < 0.0 => format!("({})", digits(x)),
            _ => digits(x),
        }
    }
    fn fence(&self) -> Option<&'static str> {
        Some("core::sync::atomic::compiler_fence(core::sync::atomic::Ordering::SeqCst);")
    }
    fn repeat(&self, k: &str, n: usize, line: &str) -> String {
        format!("for {k} in 0..{n} {{ {line} }}")
    }
    fn variable(&self, name: &str, expression: &str, _: bool) -> String {
        format!("let {name} = {expression};")
    }
    fn sin_cos(&self, sin: &str, cos: &str, angle: &str) -> String {
        let name = |name: &str| if name.starts_with("unused") { "_".to_owned() } else { name.to_owned() };
        format!("let ({}, {}) = sin_cos({angle});", name(sin), name(cos))
    }
    fn select(&self, mask: &str, a: &str, b: &str) -> String {
        format!("if {mask} {{ {a} }} else {{ {b} }}")
    }
    fn call(&self, function: &str, a: &str) -> String {
        match function {
            "abs" => format!("{}::abs({a})", self.real),
            _ => format!("{function}({a})"),
        }
    }
    fn atan2(&self, y: &str, x: &str) -> String {
        format!("atan2({y}, {x})")
    }
    fn mask_to_work(&self, mask: &str) -> String {
        format!("if {mask} {{ 1.0 }} else {{ 0.0 }}")
    }
    fn mask_from_work(&self, number: &str) -> String {
        format!("({number} != 0.0)")
    }
    fn truth(&self, holds: bool) -> &'static str {
        if holds { "true" } else { "false" }
    }
}

/// Returns the parameters of a function: inputs, then the work space, then outputs.
fn parameters(real: &str, reads: &[&Array], work: Option<usize>, writes: &[&Array]) -> String {
    let reads = reads.iter().map(|a| format!("{}: &[{real}; {}]", a.name, a.len()));
    let work = work.map(|n| format!("w: &mut [{real}; {n}]"));
    let writes = writes.iter().map(|a| format!("{}: &mut [{real}; {}]", a.name, a.len()));
    reads.chain(work).chain(writes).collect::<Vec<_>>().join(", ")
}

/// Returns the file that contains the module.
pub(crate) fn files(name: &str, programs: &[Program], real: &'static str) -> Vec<SourceFile> {
    let mut text = prefixed("// ", &heading(name, programs));
    let uses = |wanted: fn(&Step) -> bool| programs.iter().any(|p| p.steps.all.iter().any(wanted));
    text += "\n";
    let mut functions = String::new();
    for program in programs {
        let _ = write!(functions, "\n{}", function(&Writer::new(program, Rust { real })));
    }
    text += functions.trim_start_matches('\n');
    if programs.iter().any(|p| !p.angles().is_empty()) || uses(|s| matches!(s, Step::SinCos(_))) {
        text += &section(&format!("sin_cos {real}"));
    }
    if uses(|s| matches!(s, Step::Plain(_, Node::Sqrt(_)))) {
        text += &section(&format!("sqrt {real}"));
    }
    if uses(|s| matches!(s, Step::Plain(_, Node::Atan2(..)))) {
        text += &section("atan2").replace("REAL", real);
    }
    vec![SourceFile { name: format!("{name}.rs"), text }]
}

fn section(of: &str) -> String {
    let (_, rest) = MATHEMATICS.split_once(&format!("// section {of}\n")).unwrap_or_default();
    format!("\n{}", rest.split("// end\n").next().unwrap_or_default())
}

/// Attribute that silences lints in generated code. A module may use only some of its functions, and may be private.
const ALLOWED: &str = "#[allow(clippy::all, clippy::pedantic, clippy::nursery, dead_code, non_snake_case, \
                       unreachable_pub, unused_parens)]\n";

/// Returns the code of a function and of its parts.
fn function(writer: &Writer<Rust>) -> String {
    let program = writer.program;
    let (real, function) = (writer.dialect.real, program.function);
    let (mut parts, mut body) = (String::new(), Vec::new());
    let n = program.angles().len();
    if program.work > 0 {
        body.push(format!("let w = &mut [0.0; {}];", program.work));
    }
    for (k, angle) in program.angles().iter().enumerate() {
        body.push(format!("(w[{k}], w[{}]) = sin_cos({});", n + k, writer.angle(angle.angle)));
    }
    if let [_] = program.parts[..] {
        body.extend(writer.lines(0));
    } else {
        for p in 0..program.parts.len() {
            let (reads, writes) = writer.arrays(p);
            let names = reads.iter().map(|a| &*a.name).chain(["w"]).chain(writes.iter().map(|a| &*a.name));
            body.push(format!("{}_{p}({});", function.name, names.collect::<Vec<_>>().join(", ")));
            let parameters = parameters(real, &reads, Some(program.work), &writes);
            let lines = prefixed("    ", &writer.lines(p));
            let _ =
                write!(parts, "\n{ALLOWED}#[inline(never)]\nfn {}_{p}({parameters}) {{\n{lines}}}\n", function.name);
        }
    }
    body.extend(writer.given_results());
    body.extend(writer.unused_arrays().iter().map(|name| format!("let _ = {name};")));
    let parameters = parameters(
        real,
        &function.inputs.iter().collect::<Vec<_>>(),
        None,
        &function.outputs.iter().collect::<Vec<_>>(),
    );
    let about = prefixed("/// ", &description(program).iter().map(|line| line.replace('[', "\\[")).collect::<Vec<_>>());
    format!("{about}{ALLOWED}pub fn {}({parameters}) {{\n{}}}\n{parts}", function.name, prefixed("    ", &body))
}
