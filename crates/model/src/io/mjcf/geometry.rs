//! Inertias of bodies, given explicitly or computed from geoms.

use super::attributes::Attributes;
use super::compiler::{Compiler, ORIENTATIONS, from_to};
use super::mesh::Solid;
use super::principal::principal;
use crate::error::Error;
use crate::io::xml::{Element, words};
use condyle_spatial::{Act, Inertia, Mat3, Se3, Sym3, Vec3};
use core::f64::consts::PI;
use nalgebra::Matrix3;

/// Density of a geom for which neither mass nor density is given (kg/m³).
const DENSITY: f64 = 1000.0;
/// Minimum volume (m³), area (m²) and mass (kg) of a geom that contributes to inertia, as in MuJoCo.
const LEAST_VOLUME: f64 = 1e-14;

/// Inertia, given by its principal axes and moments.
#[derive(Clone, Copy)]
pub(super) struct Weight {
    /// Mass (kg).
    pub(super) mass: f64,
    /// Centre of mass and principal axes.
    pub(super) pose: Se3<f64>,
    /// Principal moments (kg m²).
    pub(super) moments: [f64; 3],
}

impl Weight {
    pub(super) fn inertia(&self) -> Inertia<f64> {
        self.pose.act(Inertia::from_com(self.mass, Vec3::zero(), diagonal(self.moments)))
    }

    /// Returns the same inertia in another frame, in which the current frame has the pose X.
    pub(super) fn seen_from(self, X: Se3<f64>) -> Self {
        Self { pose: X * self.pose, ..self }
    }

    /// Returns the sum of inertias and the principal axes of the sum. A single inertia keeps its axes. The axes of a
    /// sum are computed by MuJoCo's method.
    pub(super) fn sum(weights: &[Self]) -> Option<(Inertia<f64>, Se3<f64>)> {
        let sum = weights.iter().fold(Inertia::zero(), |sum, w| sum + w.inertia());
        match weights {
            [] => None,
            [one] => Some((sum, one.pose)),
            _ => Some((sum, axes(sum))),
        }
    }
}

/// Returns the centre of mass and the principal axes of an inertia.
fn axes(I: Inertia<f64>) -> Se3<f64> {
    let (com, about) = central(I);
    Se3::new(principal(about).1, com)
}

/// Returns the centre of mass, and the rotational inertia about the centre of mass.
fn central(I: Inertia<f64>) -> (Vec3<f64>, Sym3<f64>) {
    let com = if I.mass > 0.0 { I.mass_com.scale(1.0 / I.mass) } else { Vec3::zero() };
    (com, I.rotational - Inertia::from_com(I.mass, com, Sym3::zero()).rotational)
}

/// Returns the inertia of an `<inertial>` in the body's frame, and the pose of the principal axes of this inertia.
pub(super) fn inertial(compiler: &Compiler, a: &Attributes) -> Result<(Inertia<f64>, Se3<f64>), Error> {
    let needed = |name: &str| a.element.lacks(name);
    a.get("pos").ok_or_else(|| needed("pos"))?;
    let mass = a.number("mass")?.ok_or_else(|| needed("mass"))?;
    let full = a.array::<6>("fullinertia")?;
    let given = a.array("diaginertia")?;
    if full.is_some() && (ORIENTATIONS.iter().any(|n| a.get(n).is_some()) || given.is_some_and(|d| d != [0.0; 3])) {
        return Err(a.element.wrong("fullinertia goes with neither diaginertia nor an orientation"));
    }
    if mass < 0.0 {
        return Err(a.element.wrong(format!("mass is {mass} kg")));
    }
    let X = compiler.pose(a)?;
    let (I, R) = match full {
        Some([xx, yy, zz, xy, xz, yz]) => {
            let I = Sym3 { xx, xy, yy, xz, yz, zz };
            (I, principal(I).1)
        }
        None => (diagonal(given.unwrap_or_default()), Mat3::identity()),
    };
    Ok((X.act(Inertia::from_com(mass, Vec3::zero(), I)), X * Se3::new(R, Vec3::zero())))
}

/// Returns a body's inertia with the corrections that `<compiler>` sets. Mass and principal moments are raised to their
/// minimum, and physically impossible moments are balanced.
pub(super) fn corrected(compiler: &Compiler, body: &Element, I: Inertia<f64>) -> Result<Inertia<f64>, Error> {
    let ([least_mass, least_moment], balance) = (compiler.bounds, compiler.balance);
    if least_mass <= 0.0 && least_moment <= 0.0 && !balance {
        return Ok(I);
    }
    let (com, about) = central(I);
    let matrix = Matrix3::new(about.xx, about.xy, about.xz, about.xy, about.yy, about.yz, about.xz, about.yz, about.zz);
    if !matrix.sum().is_finite() {
        return Err(body.wrong("its inertia is not finite"));
    }
    let eigen = matrix.symmetric_eigen();
    let mut moments = eigen.eigenvalues.map(|x| x.max(least_moment));
    let largest = moments.max();
    if balance && largest > moments.sum() - largest {
        moments.fill(moments.mean());
    }
    let m = eigen.eigenvectors * Matrix3::from_diagonal(&moments) * eigen.eigenvectors.transpose();
    let about = Sym3 { xx: m.m11, xy: m.m12, yy: m.m22, xz: m.m13, yz: m.m23, zz: m.m33 };
    Ok(Inertia::from_com(I.mass.max(least_mass), com, about))
}

/// Returns whether a geom has mass and contributes to the inertia of its body.
pub(super) fn is_heavy(compiler: &Compiler, a: &Attributes) -> Result<bool, Error> {
    let group = a.number("group")?.unwrap_or(0.0);
    let (mass, density) = (a.number("mass")?, a.number("density")?.unwrap_or(DENSITY));
    let heavy = mass.unwrap_or(density) != 0.0 && a.get("type") != Some("plane");
    Ok(heavy && (compiler.groups[0]..=compiler.groups[1]).contains(&group))
}

/// Returns the inertia of a geom that has mass, in the frame in which the pose of the geom is given. `mesh` is the mesh
/// of the geom. `field` contains half the side lengths of the box that replaces the geom's height field.
pub(super) fn geom(
    compiler: &Compiler,
    a: &Attributes,
    mesh: Option<&Solid>,
    field: Option<[f64; 3]>,
) -> Result<Option<Weight>, Error> {
    let wrong = |what: String| a.element.wrong(what);
    let (mass, density) = (a.number("mass")?, a.number("density")?.unwrap_or(DENSITY));
    if mass.unwrap_or(density) < 0.0 {
        return Err(wrong(format!("mass {} kg or density {density} kg/m³ is negative", mass.unwrap_or(0.0))));
    }
    let shell = a.flag("shellinertia", None)? == Some(true);
    let kind = a.get("type").unwrap_or("sphere");
    let (X, volume, unit) = match (kind, mesh) {
        ("mesh" | "sdf", None) => return Err(wrong(format!("a geom of type {kind} has no mesh"))),
        ("mesh" | "sdf", Some(_)) if shell => {
            return Err(wrong("shellinertia: a mesh has an attribute `inertia` for it".to_owned()));
        }
        ("mesh" | "sdf", Some(mesh)) => (compiler.pose(a)? * mesh.pose, mesh.volume, mesh.moments),
        _ => {
            let (X, size) = match (mesh, field) {
                (Some(mesh), _) => fitted(compiler, a, kind, mesh)?,
                (_, Some(field)) => (compiler.pose(a)?, field.to_vec()),
                _ => sized(compiler, a, kind)?,
            };
            let (volume, unit) = if shell { hollow(kind, &size) } else { solid(kind, &size) };
            (X, volume, unit)
        }
    };
    let mass = if volume > LEAST_VOLUME { mass.unwrap_or(density * volume) } else { 0.0 };
    Ok((mass > LEAST_VOLUME).then(|| Weight { mass, pose: X, moments: unit.map(|x| mass * x) }))
}

/// Returns the pose and the size of a primitive.
pub(super) fn sized(compiler: &Compiler, a: &Attributes, kind: &str) -> Result<(Se3<f64>, Vec<f64>), Error> {
    let length = match kind {
        "sphere" => 1,
        "capsule" | "cylinder" => 2,
        "box" | "ellipsoid" => 3,
        _ => return Err(a.element.wrong(format!("type: no geom has the type `{kind}`"))),
    };
    let mut size = a.list("size")?.unwrap_or_default();
    let X = match from_to(a, kind)? {
        None => compiler.pose(a)?,
        Some((X, half)) => {
            size.truncate(1);
            size.resize(length - 1, size.first().copied().unwrap_or(0.0));
            size.push(half);
            X
        }
    };
    if size.len() < length || size[..length].iter().any(|&x| x <= 0.0) {
        let what = format!("size: a {kind} needs {length} positive numbers, found {}", words(&size));
        return Err(a.element.wrong(what));
    }
    Ok((X, size))
}

/// Returns the pose and the size of a primitive that is fitted to a mesh: either to the box with the inertia of the
/// mesh, or to the bounding box of the mesh.
fn fitted(compiler: &Compiler, a: &Attributes, kind: &str, mesh: &Solid) -> Result<(Se3<f64>, Vec<f64>), Error> {
    let (center, [x, y, z]) = if compiler.fit_box { mesh.bounding_box() } else { (Vec3::zero(), mesh.inertia_box()) };
    let round = if compiler.fit_box { x.max(y) } else { (x + y) / 2.0 };
    let size = match (kind, compiler.fit_box) {
        ("sphere", true) => vec![x.max(y).max(z)],
        ("sphere", false) => vec![(x + y + z) / 3.0],
        ("cylinder", _) => vec![round, z],
        ("capsule", true) => vec![round, z - round],
        ("capsule", false) => vec![round, (z - round / 2.0).max(0.0)],
        ("box" | "ellipsoid", _) => vec![x, y, z],
        _ => return Err(a.element.wrong(format!("type: no geom of type `{kind}` is fitted to a mesh"))),
    };
    let scale = a.number("fitscale")?.unwrap_or(1.0);
    let X = compiler.pose(a)? * mesh.pose * Se3::new(Mat3::identity(), center);
    Ok((X, size.into_iter().map(|x| scale * x).collect()))
}

/// Returns the volume (m³) and the principal moments per kilogram (m²) of a solid primitive.
fn solid(kind: &str, size: &[f64]) -> (f64, [f64; 3]) {
    let a = size[0];
    match kind {
        "sphere" => (4.0 / 3.0 * PI * a * a * a, [0.4 * a * a; 3]),
        "cylinder" => {
            let h = 2.0 * size[1];
            let across = a * a / 4.0 + h * h / 12.0;
            (PI * a * a * h, [across, across, a * a / 2.0])
        }
        // A capsule is a cylinder of height h between two half balls of radius a, whose centres of mass are 3a/8 beyond
        // the ends of the cylinder.
        "capsule" => {
            let h = 2.0 * size[1];
            let (tube, ball) = (PI * a * a * h, 4.0 / 3.0 * PI * a * a * a);
            let (t, b) = (tube / (tube + ball), ball / (tube + ball));
            let across = t * (a * a / 4.0 + h * h / 12.0) + b * (0.4 * a * a + h * h / 4.0 + 3.0 / 8.0 * a * h);
            (tube + ball, [across, across, t * a * a / 2.0 + b * 0.4 * a * a])
        }
        _ => {
            let (b, c) = (size[1], size[2]);
            let (filled, part) = if kind == "ellipsoid" { (4.0 / 3.0 * PI, 5.0) } else { (8.0, 3.0) };
            let moments = [(b * b + c * c) / part, (a * a + c * c) / part, (a * a + b * b) / part];
            (filled * a * b * c, moments)
        }
    }
}

/// Returns the area (m²) and the principal moments per kilogram (m²) of the surface of a primitive.
fn hollow(kind: &str, size: &[f64]) -> (f64, [f64; 3]) {
    let a = size[0];
    match kind {
        "sphere" => (4.0 * PI * a * a, [2.0 / 3.0 * a * a; 3]),
        "cylinder" => {
            let h = 2.0 * size[1];
            let (disc, tube) = (PI * a * a, 2.0 * PI * a * h);
            let (d, t) = (2.0 * disc / (2.0 * disc + tube), tube / (2.0 * disc + tube));
            let across = t * (a * a / 2.0 + h * h / 12.0) + d * (a * a / 4.0 + h * h / 4.0);
            (2.0 * disc + tube, [across, across, t * a * a + d * a * a / 2.0])
        }
        "capsule" => {
            let h = 2.0 * size[1];
            let (tube, ball) = (2.0 * PI * a * h, 4.0 * PI * a * a);
            let (t, b) = (tube / (tube + ball), ball / (tube + ball));
            // The centre of mass of a half shell of radius a is at a/2.
            let (center, far) = (a / 2.0, h / 2.0 + a / 2.0);
            let ends = 2.0 / 3.0 * a * a + far * far - center * center;
            let across = t * (a * a / 2.0 + h * h / 12.0) + b * ends;
            (tube + ball, [across, across, t * a * a + b * 2.0 / 3.0 * a * a])
        }
        // The area is computed by Thomsen's formula. The moments are the moments of a layer of 1 µm, as in MuJoCo.
        "ellipsoid" => {
            let (b, c, p) = (size[1], size[2], 1.6075);
            let area = 4.0 * PI * (((a * b).powf(p) + (b * c).powf(p) + (c * a).powf(p)) / 3.0).powf(1.0 / p);
            let [outer, inner] = [1e-6, 0.0].map(|e| solid(kind, &[a + e, b + e, c + e]));
            let moment = |k: usize| (outer.0 * outer.1[k] - inner.0 * inner.1[k]) / (outer.0 - inner.0);
            (area, [moment(0), moment(1), moment(2)])
        }
        _ => {
            let [x, y, z] = [a, size[1], size[2]];
            // Areas of both faces that are normal to each axis.
            let areas = [y * z, z * x, x * y].map(|area| 8.0 * area);
            let total: f64 = areas.iter().sum();
            let [across_x, across_y, across_z] = areas.map(|area| area / total);
            // With the half length x, the mean of the squared coordinate is x² over the two faces perpendicular to the
            // x axis, and x²/3 over the other faces.
            let square = |half: f64, across: f64| half * half * (across + (1.0 - across) / 3.0);
            let [xx, yy, zz] = [square(x, across_x), square(y, across_y), square(z, across_z)];
            (total, [yy + zz, xx + zz, xx + yy])
        }
    }
}

fn diagonal([xx, yy, zz]: [f64; 3]) -> Sym3<f64> {
    Sym3 { xx, xy: 0.0, yy, xz: 0.0, yz: 0.0, zz }
}
