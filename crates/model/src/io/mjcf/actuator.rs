//! Actuators of MJCF: their parameters, with the defaults of their classes.

use super::attributes::{Attributes, MAIN};
use super::law::{KINDS, Law, Laws, fill};
use crate::error::Error;
use crate::io::xml::Element;
use std::collections::HashMap;
use std::rc::Rc;

/// Interval of all real numbers.
pub(super) const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Range, with a flag that says whether the range is a limit. Without a flag, the range is a limit if its lower bound
/// is below its upper bound.
#[derive(Clone, Copy, Default)]
pub(super) struct Range {
    pub(super) numbers: [f64; 2],
    limited: Option<bool>,
}

impl Range {
    /// Reads the attributes of a range. Missing attributes keep the values of the class.
    pub(super) fn read(mut self, a: &Attributes, range: &str, limited: &str) -> Result<Self, Error> {
        self.numbers = a.array(range)?.unwrap_or(self.numbers);
        if a.get(limited).is_some() {
            self.limited = a.flag(limited, Some("auto"))?;
        }
        Ok(self)
    }

    /// Returns the range if it is a limit. `name` is the name of the range's attribute.
    pub(super) fn bounds(&self, e: &Element, name: &str, autolimits: bool) -> Result<Option<[f64; 2]>, Error> {
        let [lower, upper] = self.numbers;
        if self.limited == Some(true) && lower >= upper {
            return Err(e.wrong(format!("{name}: {lower} is not less than {upper}")));
        }
        if self.limited.is_none() && !autolimits && self.numbers != [0.0; 2] {
            let limited = name.replace("range", "limited");
            return Err(e.wrong(format!("{name}: without autolimits, {limited} must say whether it limits")));
        }
        Ok((self.limited.unwrap_or(true) && lower < upper).then_some(self.numbers))
    }
}

/// Parameters that all kinds of actuators have.
#[derive(Clone)]
pub(super) struct Mechanics {
    pub(super) gear: [f64; 6],
    /// Coefficients of viscous damping d₀, d₁ and d₂.
    pub(super) damping: [f64; 3],
    pub(super) armature: f64,
    pub(super) control: Range,
    pub(super) force: Range,
    pub(super) activation: Range,
    pub(super) delay: f64,
    pub(super) group: f64,
}

impl Default for Mechanics {
    fn default() -> Self {
        let [control, force, activation] = [Range::default(); 3];
        let gear = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        Self { gear, damping: [0.0; 3], armature: 0.0, control, force, activation, delay: 0.0, group: 0.0 }
    }
}

impl Mechanics {
    /// Reads the attributes of an element.
    fn read(&mut self, e: &Element) -> Result<(), Error> {
        let a = Attributes::plain(e);
        fill(&a, "gear", &mut self.gear)?;
        fill(&a, "damping", &mut self.damping)?;
        for (name, to) in [("armature", &mut self.armature), ("delay", &mut self.delay), ("group", &mut self.group)] {
            *to = a.number(name)?.unwrap_or(*to);
        }
        let control = if e.tag == "pid" && a.get("posrange").is_some() { "posrange" } else { "ctrlrange" };
        self.control = self.control.read(&a, control, "ctrllimited")?;
        self.force = self.force.read(&a, "forcerange", "forcelimited")?;
        self.activation = self.activation.read(&a, "actrange", "actlimited")?;
        if matches!(&*e.tag, "damper" | "adhesion") {
            self.control.limited = Some(true);
        }
        Ok(())
    }

    /// Returns armature and damping coefficients at the driven joint or tendon: the actuator's values times gear².
    pub(super) fn at_joint(&self) -> [f64; 4] {
        let [gear, ..] = self.gear;
        let [d0, d1, d2] = self.damping;
        [self.armature, d0, d1, d2].map(|x| if x == 0.0 { 0.0 } else { gear * gear * x })
    }

    /// Checks that armature and damping are finite at the driven joint or tendon.
    pub(super) fn check(&self, e: &Element) -> Result<(), Error> {
        match self.at_joint().iter().all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(e.wrong(format!("gear {:e}: gear² times armature or damping is not finite", self.gear[0]))),
        }
    }

    /// Sets the torque limit that follows from the parameters of a DC motor.
    fn saturate(&mut self, e: &Element, law: &Law) -> Result<(), Error> {
        if let Some(torque) = law.saturation(&Attributes::plain(e))? {
            self.force = Range { numbers: [-torque, torque], limited: Some(true) };
        }
        Ok(())
    }
}

/// Default class of actuators: the parameters of an actuator that does not specify them.
#[derive(Clone, Default)]
struct Class<'a> {
    mechanics: Rc<Mechanics>,
    laws: Laws<'a>,
}

/// Default classes of actuators.
pub(super) struct Classes<'a> {
    classes: HashMap<&'a str, Class<'a>>,
}

impl<'a> Classes<'a> {
    /// Reads the default classes of a file.
    pub(super) fn read(root: &'a Element) -> Result<Self, Error> {
        let mut classes = Self { classes: HashMap::from([(MAIN, Class::default())]) };
        for element in root.all("default") {
            let main = classes.classes[MAIN].clone();
            classes.add(element, MAIN, main)?;
        }
        Ok(classes)
    }

    /// Adds a class and its nested classes. A nested class inherits the parameters of the class around it.
    fn add(&mut self, element: &'a Element, name: &'a str, mut class: Class<'a>) -> Result<(), Error> {
        for e in element.children.iter().filter(|e| KINDS.contains(&&*e.tag)) {
            let mechanics = Rc::make_mut(&mut class.mechanics);
            mechanics.read(e)?;
            let law = class.laws.add(e, mechanics.damping[0])?;
            mechanics.saturate(e, &law)?;
        }
        for inner in element.all("default") {
            let begun = Class { mechanics: class.mechanics.clone(), laws: class.laws.inner() };
            self.add(inner, inner.attribute("class").unwrap_or(MAIN), begun)?;
        }
        self.classes.insert(name, class);
        Ok(())
    }

    /// Returns the parameters of an element of `<actuator>`.
    pub(super) fn of(&self, e: &'a Element) -> Result<(Mechanics, Law<'a>), Error> {
        let name = e.attribute("class").unwrap_or(MAIN);
        let class = self.classes.get(name).ok_or_else(|| e.wrong(format!("no default class is named `{name}`")))?;
        let mut mechanics = (*class.mechanics).clone();
        mechanics.read(e)?;
        let law = class.laws.of(e, mechanics.damping[0])?;
        mechanics.saturate(e, &law)?;
        Ok((mechanics, law))
    }
}

/// Returns an interval multiplied by a number.
pub(super) fn scaled([lower, upper]: [f64; 2], by: f64) -> [f64; 2] {
    match by {
        0.0 => [0.0; 2],
        _ if by > 0.0 => [lower * by, upper * by],
        _ => [upper * by, lower * by],
    }
}

/// Clips the bounds of an interval to another interval.
pub(super) fn clipped(of: [f64; 2], [lower, upper]: [f64; 2]) -> [f64; 2] {
    of.map(|x| x.clamp(lower, upper))
}

impl Law<'_> {
    /// Returns the interval of the activation, given the interval of the control and the limit of the activation.
    pub(super) fn activation(&self, control: [f64; 2], limit: [f64; 2]) -> [f64; 2] {
        match self.dynamics {
            "none" => control,
            // The activation begins at 0 and approaches the control.
            "filter" | "filterexact" => clipped([control[0].min(0.0), control[1].max(0.0)], limit),
            "muscle" => [0.0, 1.0],
            _ => limit,
        }
    }

    /// Returns the interval of forces for an interval of activations. The interval of forces is finite if the force
    /// depends on neither length nor velocity.
    pub(super) fn force(&self, activation: [f64; 2]) -> [f64; 2] {
        let bias = if self.bias == "affine" { &self.biasprm[..3] } else { &[0.0; 3] };
        if self.gain != "fixed" || !matches!(self.bias, "none" | "affine") || bias[1] != 0.0 || bias[2] != 0.0 {
            return ALL;
        }
        scaled(activation, self.gainprm[0]).map(|f| f + bias[0])
    }

    /// Returns gain, bias, kp and kv of the force f = gain u + bias − kp l − kv l̇, with the control u and the length
    /// l. If the actuator's force does not have this form, returns the reason.
    pub(super) fn affine(&self) -> Result<[f64; 4], &'static str> {
        let [g, ..] = self.gainprm;
        let [b0, b1, b2, ..] = self.biasprm;
        match (self.gain, self.bias) {
            ("fixed", "none") => Ok([g, 0.0, 0.0, 0.0]),
            ("fixed", "affine") => Ok([g, b0, -b1, -b2]),
            ("pid", _) => Ok([-b1, b0, -b1, -b2]),
            // With the resistance R and the motor constant K in `gainprm`, the force is f = K/R (u − K l̇), with the
            // voltage u and the speed l̇.
            ("dcmotor", _) => Ok([self.gainprm[1] / g, 0.0, 0.0, self.gainprm[1] * self.gainprm[1] / g]),
            ("affine", _) => Err("its gain depends on length or velocity"),
            ("muscle", _) | (_, "muscle") => Err("it is a muscle"),
            ("plugin", _) => Err("it is a plugin"),
            ("so3", _) => Err("it drives three directions at once"),
            _ => Err("its law is the user's own"),
        }
    }
}
