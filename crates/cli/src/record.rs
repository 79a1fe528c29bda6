//! Writes a planned trajectory to a file for other programs: CSV, NPZ or JSON. Columns are named after the robot's
//! joints.

use crate::error::{Error, nearest};
use crate::motion::Plan;
use condyle::{Joint, Model};
use serde_json::json;
use std::io::{Cursor, Write};
use std::path::Path;

/// File format.
#[derive(Clone, Copy)]
pub(crate) enum Format {
    Csv,
    Npz,
    Json,
}

/// Returns the format of a file, from the extension of its name.
pub(crate) fn format(path: &Path) -> Result<Format, Error> {
    match path.extension().and_then(|end| end.to_str()) {
        Some("csv") => Ok(Format::Csv),
        Some("npz") => Ok(Format::Npz),
        Some("json") => Ok(Format::Json),
        other => {
            let near = nearest(other.unwrap_or_default(), ["csv", "npz", "json"]);
            let what = format!("`{}` does not end in .csv, .npz or .json{near}", path.display());
            Err(Error::Option { option: "record", what })
        }
    }
}

/// Returns suffixes for the columns of a joint: one for each position component, and one for each velocity component.
fn parts(joint: Joint) -> (&'static [&'static str], &'static [&'static str]) {
    match joint {
        Joint::FreeFlyer => (&["x", "y", "z", "qx", "qy", "qz", "qw"], &["vx", "vy", "vz", "wx", "wy", "wz"]),
        Joint::Spherical => (&["qx", "qy", "qz", "qw"], &["wx", "wy", "wz"]),
        Joint::Planar => (&["x", "y", "cos", "sin"], &["vx", "vy", "w"]),
        Joint::Translation => (&["x", "y", "z"], &["vx", "vy", "vz"]),
        Joint::Continuous { .. } => (&["cos", "sin"], &[""]),
        _ => (&[""], &[""]),
    }
}

/// Returns the names of the entries of q, and the names of the entries of v and τ.
fn columns(model: &Model) -> (Vec<String>, Vec<String>) {
    let (mut q, mut v) = (Vec::new(), Vec::new());
    for body in model.bodies()[1..].iter().filter(|b| b.mimic.is_none()) {
        let (of_q, of_v) = parts(body.joint);
        let name = |part: &&str| match *part {
            "" => body.joint_name.clone(),
            part => format!("{}.{part}", body.joint_name),
        };
        q.extend(of_q.iter().map(name));
        v.extend(of_v.iter().map(name));
    }
    (q, v)
}

/// Numbers of a trajectory: N + 1 states and N efforts.
struct Table<'a> {
    plan: &'a Plan,
    q: Vec<f64>,
    v: Vec<f64>,
    tau: Vec<f64>,
    knots: usize,
}

impl<'a> Table<'a> {
    fn new(plan: &'a Plan) -> Self {
        let (nq, knots) = (plan.model.nq(), plan.knots());
        let states = || (0..=knots).map(|t| plan.solution.x(t));
        Self {
            q: states().flat_map(|x| x[..nq].to_vec()).collect(),
            v: states().flat_map(|x| x[nq..].to_vec()).collect(),
            tau: (0..knots).flat_map(|t| plan.effort(t)).collect(),
            plan,
            knots,
        }
    }
}

/// Writes the trajectory to a file.
pub(crate) fn write(path: &Path, format: Format, plan: &Plan) -> std::io::Result<()> {
    let table = Table::new(plan);
    let bytes = match format {
        Format::Csv => csv(&table).into_bytes(),
        Format::Json => json(&table).into_bytes(),
        Format::Npz => npz(&table)?,
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(path, bytes)
}

/// Escapes a text as a CSV field (RFC 4180).
fn field(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

/// Writes one line per knot; the last line has no efforts.
fn csv(table: &Table) -> String {
    let Table { plan, q, v, tau, knots } = table;
    let (of_q, of_v) = columns(&plan.model);
    let (nq, nv) = (of_q.len(), of_v.len());
    let feet = plan.feet.iter().map(|&f| plan.model.frames()[f].name.clone());
    let named =
        |kind: &str, names: &[String]| names.iter().map(|name| field(&format!("{kind}:{name}"))).collect::<Vec<_>>();
    let touches: Vec<String> = feet.map(|name| field(&format!("touches:{name}"))).collect();
    let head = [vec!["time".to_owned()], named("q", &of_q), named("v", &of_v), named("tau", &of_v), touches].concat();
    let mut text = head.join(",") + "\n";
    for t in 0..=*knots {
        let mut line = vec![format!("{:?}", plan.times[t])];
        let numbers = |x: &[f64]| x.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>();
        line.extend(numbers(&q[t * nq..(t + 1) * nq]));
        line.extend(numbers(&v[t * nv..(t + 1) * nv]));
        match t < *knots {
            true => line.extend(numbers(&tau[t * nv..(t + 1) * nv])),
            false => line.extend(vec![String::new(); nv]),
        }
        let last = plan.touches.get(t).or(plan.touches.last());
        line.extend(last.into_iter().flatten().map(|&touches| u8::from(touches).to_string()));
        text += &(line.join(",") + "\n");
    }
    text
}

fn json(table: &Table) -> String {
    let Table { plan, q, v, tau, knots } = table;
    let (of_q, of_v) = columns(&plan.model);
    let rows =
        |x: &[f64], count: usize| x.chunks(x.len().max(1) / count.max(1)).map(<[f64]>::to_vec).collect::<Vec<_>>();
    let feet: Vec<&str> = plan.feet.iter().map(|&f| &*plan.model.frames()[f].name).collect();
    let value = json!({
        "robot": plan.model.name(), "status": plan.solution.status, "cost": plan.solution.cost,
        "times": plan.times, "q_names": of_q, "v_names": of_v,
        "q": rows(q, knots + 1), "v": rows(v, knots + 1), "tau": rows(tau, *knots),
        "feet": feet, "touches": plan.touches,
    });
    value.to_string() + "\n"
}

/// Writes NumPy arrays: times, q, v, tau, touches, q_names, v_names, feet.
fn npz(table: &Table) -> std::io::Result<Vec<u8>> {
    let Table { plan, q, v, tau, knots } = table;
    let (of_q, of_v) = columns(&plan.model);
    let feet: Vec<String> = plan.feet.iter().map(|&f| plan.model.frames()[f].name.clone()).collect();
    let touches: Vec<u8> = plan.touches.iter().flatten().map(|&touches| u8::from(touches)).collect();
    let floats = |x: &[f64]| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let mut add = |name: &str, kind: &str, shape: &[usize], bytes: &[u8]| {
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        zip.start_file(format!("{name}.npy"), options)?;
        zip.write_all(&npy_header(kind, shape))?;
        zip.write_all(bytes)
    };
    add("times", "<f8", &[knots + 1], &floats(&plan.times))?;
    add("q", "<f8", &[knots + 1, of_q.len()], &floats(q))?;
    add("v", "<f8", &[knots + 1, of_v.len()], &floats(v))?;
    add("tau", "<f8", &[*knots, of_v.len()], &floats(tau))?;
    add("touches", "|b1", &[plan.touches.len(), feet.len()], &touches)?;
    for (name, texts) in [("q_names", &of_q), ("v_names", &of_v), ("feet", &feet)] {
        // NumPy stores an array of texts as UTF-32 with equal lengths. So pad the texts with zeros.
        let length = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let text = |text: &String| {
            let mut codes: Vec<u32> = text.chars().map(u32::from).collect();
            codes.resize(length, 0);
            codes.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<u8>>()
        };
        add(name, &format!("<U{length}"), &[texts.len()], &texts.iter().flat_map(text).collect::<Vec<u8>>())?;
    }
    Ok(zip.finish()?.into_inner())
}

/// Returns the header of a NumPy array file (format 1.0), padded to a multiple of 64 bytes.
fn npy_header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({sizes}), }}");
    while (10 + text.len() + 1) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.into_bytes());
    bytes
}
