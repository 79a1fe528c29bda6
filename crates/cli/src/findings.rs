//! What is odd about a robot: the model's own warnings, and what makes its numbers hard to work with.

use crate::lines::{Kind, Lines};
use condyle::{Inertia, Model, neutral, tree::Body, tree::Warning};
use nalgebra::Matrix3;
use serde::Serialize;

/// Something odd, and where the file says it.
#[derive(Serialize)]
pub(crate) struct Finding {
    /// `massless`, `negative_moment`, `triangle`, `singular`, `unlikely`, `limit`, `unknown`, `left_out`, `assumed`, `mimic`,
    /// `mass_ratio`, `moment_ratio` or `neutral`.
    pub kind: &'static str,
    /// The body, joint or element.
    pub name: String,
    pub line: Option<u32>,
    pub what: String,
}

/// Masses, or moments of inertia, of a body and its parent so many times apart are suspicious: a wrong unit, or a tip that
/// makes M badly conditioned.
const APART: f64 = 1e3;
/// Beyond a limit by less than this is rounding.
const ROUNDING: f64 = 1e-9;

/// All that is odd, in the order of the file.
pub(crate) fn of(model: &Model, lines: &Lines) -> Vec<Finding> {
    let mut found: Vec<Finding> = model.warnings().iter().map(|warning| own(model, warning, lines)).collect();
    for (i, b) in model.bodies().iter().enumerate().skip(1) {
        found.extend(neighbours(model, i).map(|(kind, what)| Finding {
            kind,
            name: b.name.clone(),
            line: lines.of(Kind::Body, &b.name),
            what,
        }));
        found.extend(neutral_outside(model, b).map(|what| Finding {
            kind: "neutral",
            name: b.joint_name.clone(),
            line: lines.of(Kind::Joint, &b.joint_name),
            what,
        }));
    }
    found.sort_by_key(|finding| finding.line.unwrap_or(u32::MAX));
    found
}

/// A warning of the model, with its line.
fn own(model: &Model, warning: &Warning, lines: &Lines) -> Finding {
    let mut what = warning.to_string();
    let (kind, sort, name) = match warning {
        Warning::Massless { body } => {
            let number = model.bodies().iter().position(|b| b.name == *body);
            if number.is_some_and(|i| model.bodies().iter().all(|b| b.parent != i)) {
                what += ", at the tip of its limb";
            }
            ("massless", Kind::Body, body)
        }
        Warning::Negative { body, .. } => ("negative_moment", Kind::Body, body),
        Warning::Triangle { body, .. } => ("triangle", Kind::Body, body),
        Warning::Unlikely { body, .. } => ("unlikely", Kind::Body, body),
        Warning::Singular { joint } => ("singular", Kind::Joint, joint),
        Warning::Limit { joint, .. } => ("limit", Kind::Joint, joint),
        _ if warning.place().is_some() => {
            let name = warning.subject().split('`').nth(1).unwrap_or(warning.subject()).to_owned();
            let line = warning.place().map(|place| place.line);
            return Finding { kind: warning.kind().name(), name, line, what };
        }
        _ => return Finding { kind: "other", name: String::new(), line: None, what },
    };
    // ``joint `loop` `` names its element; other warnings have the name alone
    let bare = name.split('`').nth(1).unwrap_or(name);
    let line = lines.of(sort, bare).or_else(|| lines.of(Kind::Body, bare));
    Finding { kind, name: bare.to_owned(), line, what }
}

/// Whether a body's mass, or else its greatest moment of inertia, is far from its parent's.
fn neighbours(model: &Model, i: usize) -> Option<(&'static str, String)> {
    let (b, parent) = (&model.bodies()[i], &model.bodies()[model.bodies()[i].parent]);
    if b.parent == 0 {
        return None;
    }
    let apart = |x: f64, y: f64| (x > 0.0 && y > 0.0).then(|| (x / y).max(y / x)).filter(|&ratio| ratio >= APART);
    let greatest = |b: &Body| moments(b.inertia).1[2];
    let say = |ratio: f64, what: &str, x: f64, y: f64, unit: &str| {
        let which = if x < y { "less" } else { "more" };
        let (own, on) = (&b.name, &parent.name);
        format!(
            "body `{own}`: its {what}, {x:.3e} {unit}, is {ratio:.1e} times {which} than the {y:.3e} of `{on}`, on which it sits"
        )
    };
    let (m, n) = (b.inertia.mass, parent.inertia.mass);
    if let Some(ratio) = apart(m, n) {
        return Some(("mass_ratio", say(ratio, "mass", m, n, "kg")));
    }
    let (m, n) = (greatest(b), greatest(parent));
    apart(m, n).map(|ratio| ("moment_ratio", say(ratio, "greatest moment of inertia", m, n, "kg m²")))
}

/// Whether the neutral position of a joint with one coordinate is outside of its limits.
fn neutral_outside(model: &Model, b: &Body) -> Option<String> {
    if b.mimic.is_some() || b.joint.nq() != 1 {
        return None;
    }
    let (limits, joint) = (model.limits(), &b.joint_name);
    let (lower, upper, q) = (limits.lower[b.idx_q], limits.upper[b.idx_q], neutral(model)[b.idx_q]);
    let is_outside = lower < upper && (q < lower - ROUNDING || q > upper + ROUNDING);
    is_outside.then(|| format!("joint `{joint}`: the neutral position {q} is outside of its limits [{lower}, {upper}]"))
}

/// The centre of mass (m), and the principal moments of inertia about it, least first (kg m²).
pub(crate) fn moments(I: Inertia<f64>) -> ([f64; 3], [f64; 3]) {
    if I.mass <= 0.0 {
        return ([0.0; 3], [0.0; 3]);
    }
    let com = I.mass_com.scale(1.0 / I.mass);
    let shift = Inertia::from_com(I.mass, com, condyle::Sym3::zero()).rotational; // I = I_c + m c×ᵀ c×
    let c = I.rotational - shift;
    let values = Matrix3::new(c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz).symmetric_eigenvalues();
    let mut moments = [values[0], values[1], values[2]];
    moments.sort_by(f64::total_cmp);
    (com.to_array(), moments)
}
