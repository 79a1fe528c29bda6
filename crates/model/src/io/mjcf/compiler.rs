//! Settings of `<compiler>`, and the conversion of poses with these settings.

use super::attributes::Attributes;
use crate::error::Error;
use crate::io::xml::Element;
use condyle_spatial::{Mat3, Quaternion, Se3, Vec3, lie};

/// Rule for when the inertia of a body is computed from its geoms.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum FromGeoms {
    Never,
    WithoutInertial,
    Always,
}

/// Settings of `<compiler>`.
pub(super) struct Compiler {
    /// Unit of angle, in radians.
    pub(super) angle: f64,
    eulerseq: Vec<u8>,
    pub(super) autolimits: bool,
    pub(super) from_geoms: FromGeoms,
    /// First and last group of the geoms that contribute to inertia.
    pub(super) groups: [f64; 2],
    /// Minimum mass of a body (kg) and minimum principal moment of inertia (kg m²).
    pub(super) bounds: [f64; 2],
    /// Whether invalid principal moments are replaced by their mean.
    pub(super) balance: bool,
    /// Total mass to which all masses are scaled (kg).
    pub(super) total_mass: Option<f64>,
    /// Whether a free joint is placed at the frame of inertia of its body.
    pub(super) align_free: bool,
    /// Folder of mesh files.
    pub(super) mesh_folder: String,
    /// Whether only the names of mesh files are used, without the folders in their addresses.
    pub(super) strip_path: bool,
    /// Whether a primitive is fitted to the bounding box of a mesh. Otherwise, it is fitted to a box with the inertia
    /// of the mesh.
    pub(super) fit_box: bool,
    /// Whether a mesh without its own inertia rule uses the rule `exact` instead of `legacy`. Only MuJoCo before
    /// version 3.2.4 has this attribute.
    pub(super) exact_meshes: bool,
}

/// Attributes that specify an orientation.
pub(super) const ORIENTATIONS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];

impl Compiler {
    pub(super) fn read(root: &Element) -> Result<Self, Error> {
        let mut compiler = Self {
            angle: 1f64.to_radians(),
            eulerseq: b"xyz".to_vec(),
            autolimits: true,
            from_geoms: FromGeoms::WithoutInertial,
            groups: [0.0, 5.0],
            bounds: [0.0, 0.0],
            balance: false,
            total_mass: None,
            align_free: false,
            mesh_folder: String::new(),
            strip_path: false,
            fit_box: false,
            exact_meshes: false,
        };
        for element in root.all("compiler") {
            compiler.merge(element)?;
        }
        Ok(compiler)
    }

    /// Applies the attributes of a `<compiler>` element to these settings.
    fn merge(&mut self, element: &Element) -> Result<(), Error> {
        let a = Attributes::plain(element);
        self.angle = match a.get("angle") {
            None => self.angle,
            Some("degree") => 1f64.to_radians(),
            Some("radian") => 1.0,
            Some(other) => return Err(element.wrong(format!("angle: `{other}` is neither degree nor radian"))),
        };
        if let Some(eulerseq) = a.get("eulerseq") {
            if eulerseq.len() != 3 || !eulerseq.bytes().all(|c| b"xyzXYZ".contains(&c)) {
                return Err(element.wrong(format!("eulerseq: `{eulerseq}` is not three of xyzXYZ")));
            }
            self.eulerseq = eulerseq.as_bytes().to_vec();
        }
        if a.get("inertiafromgeom").is_some() {
            self.from_geoms = match a.flag("inertiafromgeom", Some("auto"))? {
                None => FromGeoms::WithoutInertial,
                Some(true) => FromGeoms::Always,
                Some(false) => FromGeoms::Never,
            };
        }
        self.groups = a.array("inertiagrouprange")?.unwrap_or(self.groups);
        if a.get("coordinate").is_some_and(|c| c != "local") {
            return Err(element.wrong("coordinate: only local coordinates are read"));
        }
        for (name, flag) in [
            ("autolimits", &mut self.autolimits),
            ("balanceinertia", &mut self.balance),
            ("alignfree", &mut self.align_free),
            ("strippath", &mut self.strip_path),
            ("fitaabb", &mut self.fit_box),
            ("exactmeshinertia", &mut self.exact_meshes),
        ] {
            *flag = a.flag(name, None)?.unwrap_or(*flag);
        }
        for (name, bound) in ["boundmass", "boundinertia"].into_iter().zip(&mut self.bounds) {
            *bound = a.number(name)?.unwrap_or(*bound);
        }
        for folder in ["assetdir", "meshdir"].iter().filter_map(|name| a.get(name)) {
            self.mesh_folder = folder.to_owned();
        }
        self.total_mass = a.number("settotalmass")?.filter(|&x| x > 0.0).or(self.total_mass);
        Ok(())
    }

    /// Returns the pose given by the attribute pos and one of the attributes quat, axisangle, euler, xyaxes and zaxis.
    pub(super) fn pose(&self, a: &Attributes) -> Result<Se3<f64>, Error> {
        Ok(Se3::new(self.rotation(a)?, a.vector("pos")?.unwrap_or(Vec3::zero())))
    }

    fn rotation(&self, a: &Attributes) -> Result<Mat3<f64>, Error> {
        let unit = |name: &str, v: Vec3<f64>| {
            let norm = v.norm_squared().sqrt();
            let ok = norm.is_finite() && norm > 1e-14;
            if ok {
                Ok(v.scale(1.0 / norm))
            } else {
                Err(a.element.wrong(format!("{name}: a vector has no direction")))
            }
        };
        let own: Vec<&str> = ORIENTATIONS.into_iter().filter(|n| a.element.attribute(n).is_some()).collect();
        if own.len() > 1 {
            return Err(a.element.wrong(format!("has {} orientations: {}", own.len(), own.join(", "))));
        }
        // The orientation of an element has priority over the orientation in its class. Within a class, `quat` has the
        // lowest priority.
        let inherited = || ORIENTATIONS.into_iter().rev().find(|n| a.get(n).is_some());
        match own.first().copied().or_else(inherited) {
            None | Some("quat") => {
                let [w, x, y, z] = a.array("quat")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
                let norm = (w * w + x * x + y * y + z * z).sqrt();
                if !(norm.is_finite() && norm > 1e-14) {
                    return Err(a.element.wrong("quat: has no direction"));
                }
                let s = 1.0 / norm;
                Ok(Quaternion::new(x * s, y * s, z * s, w * s).to_rotation())
            }
            Some("axisangle") => {
                let [x, y, z, angle] = a.array("axisangle")?.unwrap_or_default();
                Ok(turn(unit("axisangle", Vec3::new(x, y, z))?, angle * self.angle))
            }
            Some("xyaxes") => {
                let [x0, x1, x2, y0, y1, y2] = a.array("xyaxes")?.unwrap_or_default();
                let (x, y) = (unit("xyaxes", Vec3::new(x0, x1, x2))?, Vec3::new(y0, y1, y2));
                let y = unit("xyaxes", y - x.scale(x.dot(y)))?;
                Ok(Mat3 { x, y, z: x.cross(y) })
            }
            Some("zaxis") => Ok(z_to(unit("zaxis", a.vector("zaxis")?.unwrap_or(Vec3::zero()))?)),
            Some(_) => Ok(self.euler(a.array("euler")?.unwrap_or_default())),
        }
    }

    /// Returns the rotation by three angles about the axes that `eulerseq` lists.
    pub(super) fn euler(&self, angles: [f64; 3]) -> Mat3<f64> {
        let mut R = Mat3::identity();
        for (axis, angle) in self.eulerseq.iter().zip(angles) {
            let mut v = [0.0; 3];
            v[usize::from(axis.to_ascii_lowercase() - b'x')] = 1.0;
            let turn = turn(v.into(), angle * self.angle);
            // A lower-case letter stands for a rotation about the moving axis, which the earlier rotations have turned.
            R = if axis.is_ascii_lowercase() { R * turn } else { turn * R };
        }
        R
    }
}

/// Returns the rotation by an angle about a unit vector.
pub(super) fn turn(axis: Vec3<f64>, angle: f64) -> Mat3<f64> {
    lie::exp3(axis.scale(angle)).to_rotation()
}

/// Returns the shortest rotation that maps z to a unit vector.
pub(super) fn z_to(v: Vec3<f64>) -> Mat3<f64> {
    let axis = Vec3::new(-v.y, v.x, 0.0);
    let sin = axis.norm_squared().sqrt();
    if sin < 1e-10 {
        return turn(Vec3::new(1.0, 0.0, 0.0), 0f64.atan2(v.z));
    }
    turn(axis.scale(1.0 / sin), sin.atan2(v.z))
}

/// Returns the pose of a geom that extends between two points, and half the distance between them (m). The z axis of
/// the geom points to the first point.
pub(super) fn from_to(a: &Attributes, kind: &str) -> Result<Option<(Se3<f64>, f64)>, Error> {
    let Some([x0, y0, z0, x1, y1, z1]) = a.array("fromto")? else { return Ok(None) };
    if !matches!(kind, "capsule" | "cylinder" | "ellipsoid" | "box") {
        return Err(a.element.wrong(format!("a {kind} has no fromto")));
    }
    if a.vector("pos")?.is_some_and(|pos| pos != Vec3::zero()) {
        return Err(a.element.wrong("has both pos and fromto"));
    }
    let (from, to) = (Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1));
    let axis = from - to;
    let half = axis.norm_squared().sqrt() / 2.0;
    if !(half.is_finite() && half > 1e-14) {
        return Err(a.element.wrong("fromto: the points are too close"));
    }
    Ok(Some((Se3::new(z_to(axis.scale(0.5 / half)), (from + to).scale(0.5)), half)))
}
