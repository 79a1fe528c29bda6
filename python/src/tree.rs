//! The tree of a robot as text.

use crate::joint::kind;
use condyle::{Model, tree::FrameKind};
use std::fmt::Write;

/// Returns the tree of bodies as text, each body with its joint, coordinates and mass. With `frames`, adds the names of
/// the link and user frames of each body, except frames with the name of the body.
pub(crate) fn tree(model: &Model, frames: bool) -> String {
    let bodies = model.bodies();
    let mut children = vec![Vec::new(); bodies.len()];
    for (i, body) in bodies.iter().enumerate().skip(1) {
        children[body.parent].push(i);
    }
    let mut text = String::from("universe");
    let of_body = |text: &mut String, body: usize, indent: &str| {
        let own =
            |f: &&condyle::tree::Frame| f.body == body && (f.kind == FrameKind::Link || f.kind == FrameKind::User);
        let named = |f: &&condyle::tree::Frame| body == 0 || f.name != bodies[body].name;
        let names: Vec<_> = model.frames().iter().filter(own).filter(named).map(|f| f.name.as_str()).collect();
        if frames && !names.is_empty() {
            let _ = write!(text, "\n{indent}· {}", names.join(", "));
        }
    };
    // stack of bodies that are not yet written: body, indentation, whether the body is the last child of its parent
    let begin = |below: &[usize], indent: &str| -> Vec<(usize, String, bool)> {
        below.iter().enumerate().rev().map(|(k, &i)| (i, indent.to_owned(), k + 1 == below.len())).collect()
    };
    of_body(&mut text, 0, if children[0].is_empty() { "  " } else { "│ " });
    let mut waiting = begin(&children[0], "");
    while let Some((i, indent, last)) = waiting.pop() {
        let body = &bodies[i];
        let branch = if last { "└─" } else { "├─" };
        let _ = write!(text, "\n{indent}{branch} {}: {}", body.joint_name, kind(body.joint));
        match body.mimic {
            Some(mimic) => {
                let _ = write!(text, ", {} q[{}] + {}", mimic.ratio, body.idx_q, mimic.offset);
            }
            None => {
                let range = |start: usize, n: usize| match n {
                    1 => format!("[{start}]"),
                    _ => format!("[{start}:{}]", start + n),
                };
                let (q, v) = (range(body.idx_q, body.joint.nq()), range(body.idx_v, body.joint.nv()));
                let _ = write!(text, ", q{q}, v{v}");
            }
        }
        let _ = write!(text, " → {}, {:.3} kg", body.name, body.inertia.mass);
        let indent = format!("{indent}{}", if last { "   " } else { "│  " });
        of_body(&mut text, i, &format!("{indent}{}", if children[i].is_empty() { "  " } else { "│ " }));
        waiting.extend(begin(&children[i], &indent));
    }
    text
}
