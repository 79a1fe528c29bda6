//! Attributes of MJCF elements, with the defaults of their classes, in SI units.

use crate::error::Error;
use crate::io::xml::{self, Element};
use crate::names::{near, nearest};
use condyle_spatial::{Mat3, Quaternion, Se3, Vec3, lie};
use std::collections::HashMap;

/// Attributes of a class, for each kind of element.
type Class<'a> = HashMap<&'a str, HashMap<&'a str, &'a str>>;

/// The most attributes that all classes may have together, what they inherit included.
const MAX_INHERITED: usize = 1 << 20;

/// The name of the class that elements have without being asked.
pub(super) const MAIN: &str = "main";

/// All default classes, each complete with what it inherits.
pub(super) struct Defaults<'a> {
    classes: HashMap<&'a str, Class<'a>>,
    /// The number of attributes, and of kinds of elements, of all classes.
    size: usize,
}

impl<'a> Defaults<'a> {
    pub(super) fn read(root: &'a Element) -> Result<Self, Error> {
        let mut defaults = Self { classes: HashMap::from([(MAIN, Class::new())]), size: 0 };
        for element in root.all("default") {
            let name = element.attribute("class").unwrap_or(MAIN);
            if name != MAIN {
                return Err(element.wrong(format!("the outermost class is `{MAIN}`, not `{name}`")));
            }
            let main = defaults.classes.remove(MAIN).unwrap_or_default();
            defaults.add(element, MAIN, main)?;
        }
        Ok(defaults)
    }

    /// Adds a class that begins as another one, and the classes inside it.
    fn add(&mut self, element: &'a Element, name: &'a str, mut class: Class<'a>) -> Result<(), Error> {
        for kind in element.children.iter().filter(|c| c.tag != "default") {
            class.entry(&kind.tag).or_default().extend(kind.attributes.iter().map(|(name, value)| (&**name, &**value)));
        }
        self.size += class.values().map(|attributes| 1 + attributes.len()).sum::<usize>();
        if self.size > MAX_INHERITED {
            let what = "attributes of default classes so far, what they inherit included";
            return Err(element.wrong(format!("{} {what}: at most {MAX_INHERITED} are allowed", self.size)));
        }
        if self.classes.insert(name, class.clone()).is_some() {
            return Err(element.wrong(format!("there are two classes `{name}`")));
        }
        for inner in element.all("default") {
            let name = inner.attribute("class").ok_or_else(|| inner.wrong("has no class"))?;
            self.add(inner, name, class.clone())?;
        }
        Ok(())
    }

    /// The element with the defaults of its class or, failing one, of the class around it.
    pub(super) fn of<'e>(&'e self, element: &'e Element, around: &'e str) -> Result<Attributes<'e>, Error> {
        let name = self.known(element, element.attribute("class").unwrap_or(around))?;
        Ok(Attributes { element, class: self.classes[name].get(element.tag.as_str()) })
    }

    /// Returns the element with the defaults that its class has for another kind of element.
    pub(super) fn of_kind<'e>(
        &'e self,
        element: &'e Element,
        kind: &str,
        around: &'e str,
    ) -> Result<Attributes<'e>, Error> {
        let name = self.known(element, element.attribute("class").unwrap_or(around))?;
        Ok(Attributes { element, class: self.classes[name].get(kind) })
    }

    /// The class's name, if there is such a class.
    pub(super) fn known<'e>(&self, element: &Element, name: &'e str) -> Result<&'e str, Error> {
        if self.classes.contains_key(name) {
            return Ok(name);
        }
        let mut names: Vec<&str> = self.classes.keys().copied().collect();
        names.sort_unstable();
        let near = near(&nearest(name, names.into_iter()));
        Err(element.wrong(format!("no default class is named `{name}`{near}")))
    }
}

/// The attributes of an element, those of its class where it has none of its own.
pub(super) struct Attributes<'a> {
    pub(super) element: &'a Element,
    class: Option<&'a HashMap<&'a str, &'a str>>,
}

impl<'a> Attributes<'a> {
    /// The attributes of an element that has no class.
    pub(super) fn plain(element: &'a Element) -> Self {
        Self { element, class: None }
    }

    pub(super) fn get(&self, name: &str) -> Option<&'a str> {
        self.element.attribute(name).or_else(|| self.class?.get(name).copied())
    }

    /// Returns the texts of an attribute, the class's first: an element may replace only the first numbers of a list.
    pub(super) fn layers(&self, name: &str) -> impl Iterator<Item = &'a str> + use<'a> {
        let class = self.class.and_then(|class| class.get(name).copied());
        class.into_iter().chain(self.element.attribute(name))
    }

    /// The value of an attribute, as a reader of text understands it, if it is there.
    fn read<T>(&self, name: &str, f: impl Fn(&str) -> Result<T, String>) -> Result<Option<T>, Error> {
        let read = |text| f(text).map_err(|what| self.element.wrong(format!("{name}: {what}")));
        self.get(name).map(read).transpose()
    }

    pub(super) fn array<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, Error> {
        self.read(name, xml::array)
    }

    pub(super) fn list(&self, name: &str) -> Result<Option<Vec<f64>>, Error> {
        self.read(name, xml::numbers)
    }

    pub(super) fn number(&self, name: &str) -> Result<Option<f64>, Error> {
        Ok(self.array(name)?.map(|[x]| x))
    }

    pub(super) fn vector(&self, name: &str) -> Result<Option<Vec3<f64>>, Error> {
        Ok(self.array(name)?.map(Vec3::from))
    }

    /// `true`, `false`, or a third word that means neither.
    pub(super) fn flag(&self, name: &str, third: Option<&str>) -> Result<Option<bool>, Error> {
        let flag = |text: &str| match text {
            "true" => Ok(Some(true)),
            "false" => Ok(Some(false)),
            _ if Some(text) == third => Ok(None),
            _ => Err(format!("`{text}` is neither true nor false")),
        };
        Ok(self.read(name, flag)?.flatten())
    }
}

/// Whether bodies get their inertia from their geoms.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum FromGeoms {
    Never,
    WithoutInertial,
    Always,
}

/// The settings of `<compiler>`.
pub(super) struct Compiler {
    /// Radians in a unit of angle.
    pub(super) angle: f64,
    eulerseq: Vec<u8>,
    pub(super) autolimits: bool,
    pub(super) from_geoms: FromGeoms,
    /// Geoms of these groups count for inertia.
    pub(super) groups: [f64; 2],
    /// No body has less mass (kg), no principal moment of inertia is less (kg m²).
    pub(super) bounds: [f64; 2],
    /// Whether principal moments that no body has are replaced by their mean.
    pub(super) balance: bool,
    /// The mass to which all masses are scaled (kg).
    pub(super) total_mass: Option<f64>,
}

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
        };
        for element in root.all("compiler") {
            let a = Attributes::plain(element);
            compiler.angle = match a.get("angle") {
                None => compiler.angle,
                Some("degree") => 1f64.to_radians(),
                Some("radian") => 1.0,
                Some(other) => return Err(element.wrong(format!("angle: `{other}` is neither degree nor radian"))),
            };
            if let Some(eulerseq) = a.get("eulerseq") {
                if eulerseq.len() != 3 || !eulerseq.bytes().all(|c| b"xyzXYZ".contains(&c)) {
                    return Err(element.wrong(format!("eulerseq: `{eulerseq}` is not three of xyzXYZ")));
                }
                compiler.eulerseq = eulerseq.as_bytes().to_vec();
            }
            compiler.autolimits = a.flag("autolimits", None)?.unwrap_or(compiler.autolimits);
            if a.get("inertiafromgeom").is_some() {
                compiler.from_geoms = match a.flag("inertiafromgeom", Some("auto"))? {
                    None => FromGeoms::WithoutInertial,
                    Some(true) => FromGeoms::Always,
                    Some(false) => FromGeoms::Never,
                };
            }
            compiler.groups = a.array("inertiagrouprange")?.unwrap_or(compiler.groups);
            // what would change masses or frames and is not done here
            if a.get("coordinate").is_some_and(|c| c != "local") {
                return Err(element.wrong("coordinate: only local coordinates are read"));
            }
            if a.flag("alignfree", None)? == Some(true) {
                return Err(element.wrong("alignfree is not supported"));
            }
            compiler.balance = a.flag("balanceinertia", None)?.unwrap_or(compiler.balance);
            for (name, bound) in ["boundmass", "boundinertia"].into_iter().zip(&mut compiler.bounds) {
                *bound = a.number(name)?.unwrap_or(*bound);
            }
            compiler.total_mass = a.number("settotalmass")?.filter(|&x| x > 0.0).or(compiler.total_mass);
        }
        Ok(compiler)
    }

    /// The pose that pos and quat, axisangle, euler, xyaxes or zaxis give.
    pub(super) fn pose(&self, a: &Attributes) -> Result<Se3<f64>, Error> {
        Ok(Se3::new(self.rotation(a)?, a.vector("pos")?.unwrap_or(Vec3::zero())))
    }

    fn rotation(&self, a: &Attributes) -> Result<Mat3<f64>, Error> {
        let wrong = |what: &str| a.element.wrong(what);
        let unit = |name: &str, v: Vec3<f64>| {
            let norm = v.norm_squared().sqrt();
            let ok = norm.is_finite() && norm > 1e-14;
            if ok { Ok(v.scale(1.0 / norm)) } else { Err(wrong(&format!("{name}: a vector has no direction"))) }
        };
        let names = ["axisangle", "xyaxes", "zaxis", "euler"];
        let own = names.iter().filter(|n| a.element.attribute(n).is_some()).count();
        if own > 1 {
            return Err(wrong("has more than one of axisangle, xyaxes, zaxis and euler"));
        }
        // an element's own quat goes before what its class says in another way
        let quat_only = own == 0 && a.element.attribute("quat").is_some();
        let name = names.into_iter().find(|n| if own > 0 { a.element.attribute(n) } else { a.get(n) }.is_some());
        match name.filter(|_| !quat_only) {
            None => {
                let [w, x, y, z] = a.array("quat")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
                let norm = (w * w + x * x + y * y + z * z).sqrt();
                if !(norm.is_finite() && norm > 1e-14) {
                    return Err(wrong("quat: has no direction"));
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
            Some(_) => {
                let angles: [f64; 3] = a.array("euler")?.unwrap_or_default();
                let mut R = Mat3::identity();
                for (axis, angle) in self.eulerseq.iter().zip(angles) {
                    let mut v = [0.0; 3];
                    v[usize::from(axis.to_ascii_lowercase() - b'x')] = 1.0;
                    let turn = turn(v.into(), angle * self.angle);
                    // lower case: about the axes that turn with it
                    R = if axis.is_ascii_lowercase() { R * turn } else { turn * R };
                }
                Ok(R)
            }
        }
    }
}

/// The rotation by an angle about a unit vector.
pub(super) fn turn(axis: Vec3<f64>, angle: f64) -> Mat3<f64> {
    lie::exp3(axis.scale(angle)).to_rotation()
}

/// The shortest rotation that takes z to a unit vector.
pub(super) fn z_to(v: Vec3<f64>) -> Mat3<f64> {
    let axis = Vec3::new(-v.y, v.x, 0.0);
    let sin = axis.norm_squared().sqrt();
    if sin < 1e-10 {
        return turn(Vec3::new(1.0, 0.0, 0.0), 0f64.atan2(v.z));
    }
    turn(axis.scale(1.0 / sin), sin.atan2(v.z))
}
