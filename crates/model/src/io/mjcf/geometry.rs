//! Inertias of bodies, given or from their geoms.

use super::attributes::{Attributes, Compiler};
use crate::error::Error;
use crate::io::xml::{Element, words};
use condyle_spatial::{Act, Inertia, Se3, Sym3, Vec3};
use core::f64::consts::PI;
use nalgebra::Matrix3;

/// Density of a geom that says neither mass nor density (kg/m³).
const DENSITY: f64 = 1000.0;

/// An `<inertial>`, in the body's frame.
pub(super) fn inertial(compiler: &Compiler, a: &Attributes) -> Result<Inertia<f64>, Error> {
    let needed = |name: &str| a.element.wrong(format!("has no {name}"));
    a.get("pos").ok_or_else(|| needed("pos"))?;
    let mass = a.number("mass")?.ok_or_else(|| needed("mass"))?;
    let full = a.array::<6>("fullinertia")?;
    let oriented = ["quat", "axisangle", "xyaxes", "zaxis", "euler"].iter().any(|n| a.get(n).is_some());
    if full.is_some() && (oriented || a.get("diaginertia").is_some()) {
        return Err(a.element.wrong("fullinertia goes with neither diaginertia nor an orientation"));
    }
    let I = match (full, a.array("diaginertia")?) {
        (Some([xx, yy, zz, xy, xz, yz]), _) => Sym3 { xx, xy, yy, xz, yz, zz },
        (None, diagonal) => principal(diagonal.unwrap_or_default()),
    };
    if mass < 0.0 {
        return Err(a.element.wrong(format!("mass is {mass} kg")));
    }
    Ok(compiler.pose(a)?.act(Inertia::from_com(mass, Vec3::zero(), I)))
}

/// A body's inertia as the compiler corrects it: mass and principal moments not below their bounds, and moments that no
/// distribution of mass has balanced.
pub(super) fn corrected(compiler: &Compiler, body: &Element, I: Inertia<f64>) -> Result<Inertia<f64>, Error> {
    let ([least_mass, least_moment], balance) = (compiler.bounds, compiler.balance);
    if least_mass <= 0.0 && least_moment <= 0.0 && !balance {
        return Ok(I);
    }
    let com = if I.mass > 0.0 { I.mass_com.scale(1.0 / I.mass) } else { Vec3::zero() };
    let about = I.rotational - Inertia::from_com(I.mass, com, Sym3::zero()).rotational;
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

/// Mass (kg) if it is given, and density (kg/m³) if not, of a geom that counts; none if it weighs nothing.
fn weight(compiler: &Compiler, a: &Attributes) -> Result<Option<(Option<f64>, f64)>, Error> {
    let group = a.number("group")?.unwrap_or(0.0);
    let (mass, density) = (a.number("mass")?, a.number("density")?.unwrap_or(DENSITY));
    let counts = (compiler.groups[0]..=compiler.groups[1]).contains(&group);
    Ok((counts && mass.unwrap_or(density) != 0.0).then_some((mass, density)))
}

fn is_mesh(a: &Attributes) -> bool {
    a.get("mesh").is_some() || matches!(a.get("type"), Some("mesh" | "sdf"))
}

/// Whether a geom is a mesh that has mass.
pub(super) fn is_heavy_mesh(compiler: &Compiler, a: &Attributes) -> Result<bool, Error> {
    Ok(is_mesh(a) && weight(compiler, a)?.is_some())
}

/// A geom's inertia, in the frame in which the geom's pose is.
pub(super) fn geom(compiler: &Compiler, a: &Attributes) -> Result<Inertia<f64>, Error> {
    let wrong = |what: String| a.element.wrong(what);
    let Some((mass, density)) = weight(compiler, a)? else { return Ok(Inertia::zero()) };
    if mass.unwrap_or(density) < 0.0 {
        return Err(wrong(format!("mass {} kg or density {density} kg/m³ is negative", mass.unwrap_or(0.0))));
    }
    if a.flag("shellinertia", None)? == Some(true) {
        return Err(wrong("shellinertia is not supported".to_owned()));
    }
    let kind = a.get("type").unwrap_or("sphere");
    if is_mesh(a) {
        let what = "has mass, and meshes are not read: give the body an <inertial>, or the geom mass=\"0\"";
        return Err(wrong(what.to_owned()));
    }
    let length = match kind {
        "sphere" => 1,
        "capsule" | "cylinder" => 2,
        "box" | "ellipsoid" => 3,
        _ => return Err(wrong(format!("a moving body has no geom of type `{kind}` with mass"))),
    };
    let mut size = a.list("size")?.unwrap_or_default();
    let X = match a.array::<6>("fromto")? {
        None => compiler.pose(a)?,
        Some(_) if kind == "sphere" => return Err(wrong("a sphere has no fromto".to_owned())),
        Some([x0, y0, z0, x1, y1, z1]) => {
            let (from, to) = (Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1));
            let axis = to - from;
            let half = axis.norm_squared().sqrt() / 2.0;
            if !(half.is_finite() && half > 1e-14) {
                return Err(wrong("fromto: the points are too close".to_owned()));
            }
            size.truncate(1);
            size.resize(length - 1, size.first().copied().unwrap_or(0.0));
            size.push(half);
            Se3::new(super::attributes::z_to(axis.scale(0.5 / half)), (from + to).scale(0.5))
        }
    };
    if size.len() < length || size[..length].iter().any(|&x| x <= 0.0) {
        return Err(wrong(format!("size: a {kind} needs {length} positive numbers, found {}", words(&size))));
    }
    let (volume, unit) = shape(kind, &size);
    let mass = mass.unwrap_or(density * volume);
    Ok(X.act(Inertia::from_com(mass, Vec3::zero(), principal(unit.map(|x| mass * x)))))
}

/// Volume (m³), and principal moments for each kilogram (m²).
fn shape(kind: &str, size: &[f64]) -> (f64, [f64; 3]) {
    let a = size[0];
    match kind {
        "sphere" => (4.0 / 3.0 * PI * a * a * a, [0.4 * a * a; 3]),
        "box" | "ellipsoid" => {
            let (b, c) = (size[1], size[2]);
            let (filled, part) = if kind == "box" { (8.0, 3.0) } else { (4.0 / 3.0 * PI, 5.0) };
            let moments = [(b * b + c * c) / part, (a * a + c * c) / part, (a * a + b * b) / part];
            (filled * a * b * c, moments)
        }
        "cylinder" => {
            let h = 2.0 * size[1];
            let across = a * a / 4.0 + h * h / 12.0;
            (PI * a * a * h, [across, across, a * a / 2.0])
        }
        // capsule: a cylinder of height h between two half balls, whose centres of mass are 3a/8 beyond its ends
        _ => {
            let h = 2.0 * size[1];
            let (tube, ball) = (PI * a * a * h, 4.0 / 3.0 * PI * a * a * a);
            let (t, b) = (tube / (tube + ball), ball / (tube + ball));
            let across = t * (a * a / 4.0 + h * h / 12.0) + b * (0.4 * a * a + h * h / 4.0 + 3.0 / 8.0 * a * h);
            (tube + ball, [across, across, t * a * a / 2.0 + b * 0.4 * a * a])
        }
    }
}

fn principal([xx, yy, zz]: [f64; 3]) -> Sym3<f64> {
    Sym3 { xx, xy: 0.0, yy, xz: 0.0, yz: 0.0, zz }
}
