//! Force laws of actuators: the force as a function of control, length and velocity. All kinds of actuators have the
//! same general force law, and each kind sets other parameters of this law. In a default class, each kind has its own
//! defaults.

use super::attributes::Attributes;
use crate::error::Error;
use crate::io::xml::{Element, numbers};
use core::f64::consts::PI;
use std::rc::Rc;

/// Number of parameters in each of `dynprm`, `gainprm` and `biasprm`.
const PARAMETERS: usize = 10;

/// Kinds of actuators: the tags of elements in `<actuator>` and in a default class.
pub(super) const KINDS: [&str; 13] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
];

/// Attributes of a DC motor that a model cannot represent, and the consequence of each omission.
const EXTRAS: [(&str, &str); 5] = [
    ("inductance", "inductance: its current follows the voltage at once"),
    ("thermal", "thermal: its resistance does not change with the temperature"),
    ("controller", "controller: the control is a voltage, not a setpoint"),
    ("lugre", "lugre: it has no friction by the LuGre law"),
    ("cogging", "cogging: it has no cogging torque"),
];

/// Force law of an actuator with length l and activation a. The activation follows the control u:
///
/// ```text
/// f = gain(l, l̇) · a + bias(l, l̇)
/// ```
#[derive(Clone, Copy, Debug)]
pub(super) struct Law<'a> {
    pub(super) dynamics: &'a str,
    pub(super) gain: &'a str,
    pub(super) bias: &'a str,
    pub(super) dynprm: [f64; PARAMETERS],
    pub(super) gainprm: [f64; PARAMETERS],
    /// Coefficients b of the affine bias b₀ + b₁ l + b₂ l̇, with the length l. A positive b₂ of a servo is a damping
    /// ratio.
    pub(super) biasprm: [f64; PARAMETERS],
    /// Ratio of the control range to the range of the driven joint or tendon; 0 if the control range does not depend on
    /// the range of the joint or tendon.
    pub(super) inherit: f64,
    /// Selected inputs, for a kind of actuator that has several inputs.
    pub(super) input: Option<&'a str>,
    /// Attribute of a DC motor that a model cannot represent, and the consequence of the omission.
    pub(super) extra: &'static str,
}

impl Default for Law<'_> {
    fn default() -> Self {
        let first = |x| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let (dynprm, gainprm, biasprm) = (first(1.0), first(1.0), first(0.0));
        let (dynamics, gain, bias) = ("none", "fixed", "none");
        Self { dynamics, gain, bias, dynprm, gainprm, biasprm, inherit: 0.0, input: None, extra: "" }
    }
}

/// Force law of a default class: the force law of the last actuator element in the class.
struct ClassLaw<'a> {
    kind: &'a str,
    law: Law<'a>,
    /// Force law of the enclosing class.
    outer: Option<Rc<Self>>,
}

/// Force laws of a default class and of the classes that enclose it.
#[derive(Clone, Default)]
pub(super) struct Laws<'a> {
    outer: Option<Rc<ClassLaw<'a>>>,
    own: Option<Rc<ClassLaw<'a>>>,
}

impl<'a> Laws<'a> {
    /// Returns the initial force laws of a nested class, before the elements of the class are read.
    pub(super) fn inner(&self) -> Self {
        Self { outer: self.own.clone().or_else(|| self.outer.clone()), own: None }
    }

    /// Returns the force law of an element of `<actuator>`. Its parameters are inherited from the innermost class whose
    /// last element has the same kind or is a `<general>`. A `<general>` inherits from any class.
    pub(super) fn of(&self, e: &'a Element, viscous: f64) -> Result<Law<'a>, Error> {
        let kind = e.tag.as_str();
        let mut class = self.own.as_ref().or(self.outer.as_ref());
        while let Some(found) = class.filter(|class| kind != "general" && class.kind != kind && class.kind != "general")
        {
            class = found.outer.as_ref();
        }
        let mut law = match class {
            Some(class) if kind == "general" || class.kind == kind => class.law,
            Some(class) => class.law.begin(kind),
            None => Law::default().begin(kind),
        };
        law.read(kind, e, viscous)?;
        Ok(law)
    }

    /// Adds an element of a default class, and returns its force law.
    pub(super) fn add(&mut self, e: &'a Element, viscous: f64) -> Result<Law<'a>, Error> {
        let law = self.of(e, viscous)?;
        self.own = Some(Rc::new(ClassLaw { kind: &e.tag, law, outer: self.outer.clone() }));
        Ok(law)
    }
}

impl<'a> Law<'a> {
    /// Returns the initial force law of an actuator of one kind that inherits from the general law `self`.
    fn begin(&self, kind: &str) -> Self {
        let mut law = Self::default();
        let [fixed, affine] = ["fixed", "affine"].map(|gain| self.gain == gain);
        match kind {
            "position" | "intvelocity" if fixed => {
                (law.gainprm[0], law.biasprm[2], law.inherit) = (self.gainprm[0], self.biasprm[2], self.inherit);
                if self.dynamics == "filterexact" {
                    (law.dynamics, law.dynprm) = (self.dynamics, self.dynprm);
                }
            }
            "velocity" | "adhesion" if fixed => law.gainprm[0] = self.gainprm[0],
            "cylinder" if fixed => {
                law.gainprm[0] = self.gainprm[0];
                law.biasprm[..3].copy_from_slice(&self.biasprm[..3]);
                law.dynprm[0] = self.dynprm[0];
            }
            "damper" => law.gainprm = if affine { self.gainprm } else { [0.0; PARAMETERS] },
            "pid" if self.gain == "pid" => law = *self,
            "pid" => law.biasprm[1] = -1.0,
            "dcmotor" if self.gain == "dcmotor" => law = *self,
            "dcmotor" => law.gainprm = [0.0; PARAMETERS],
            "orientation" if self.gain == "so3" => law = *self,
            _ => {}
        }
        law
    }

    /// Reads the attributes of an element of one kind.
    fn read(&mut self, kind: &str, e: &'a Element, viscous: f64) -> Result<(), Error> {
        let a = Attributes::plain(e);
        let number = |name: &str, or: f64| a.number(name).map(|x| x.unwrap_or(or));
        self.inherit = number("inheritrange", self.inherit)?;
        self.input = e.attribute("input").or(self.input);
        let set = |law: &mut Self, dynamics, gain, bias| (law.dynamics, law.gain, law.bias) = (dynamics, gain, bias);
        match kind {
            "general" | "plugin" => {
                for (name, to) in
                    [("dyntype", &mut self.dynamics), ("gaintype", &mut self.gain), ("biastype", &mut self.bias)]
                {
                    *to = e.attribute(name).unwrap_or(*to);
                }
                fill(&a, "dynprm", &mut self.dynprm)?;
                fill(&a, "gainprm", &mut self.gainprm)?;
                fill(&a, "biasprm", &mut self.biasprm)?;
                if kind == "plugin" {
                    self.gain = "plugin";
                }
            }
            "motor" => *self = Self::default(),
            "position" | "intvelocity" | "orientation" => {
                self.gainprm[0] = number("kp", self.gainprm[0])?;
                self.servo(&a, self.gainprm[0])?;
                if let Some(constant) = a.number("timeconst")? {
                    self.dynprm[0] = constant;
                    self.dynamics = if constant > 0.0 { "filterexact" } else { "none" };
                }
                match kind {
                    "position" => set(self, self.dynamics, "fixed", "affine"),
                    "intvelocity" => set(self, "integrator", "fixed", "affine"),
                    _ => set(self, "none", "so3", "so3"),
                }
            }
            "pid" => {
                self.servo(&a, number("kp", -self.biasprm[1])?)?;
                self.gainprm[0] = number("ki", if self.gain == "pid" { self.gainprm[0] } else { 0.0 })?;
                self.dynprm[1] = number("slewmax", if self.dynamics == "pid" { self.dynprm[1] } else { 0.0 })?;
                let acts = self.gainprm[0] != 0.0 || self.dynprm[1] != 0.0;
                set(self, if acts { "pid" } else { "none" }, "pid", "affine");
            }
            "velocity" => {
                let kv = number("kv", self.gainprm[0])?;
                (self.gainprm[0], self.biasprm) = (kv, [0.0; PARAMETERS]);
                self.biasprm[2] = -kv;
                set(self, "none", "fixed", "affine");
            }
            "damper" => {
                let kv = number("kv", -self.gainprm[2])?;
                if kv < 0.0 {
                    return Err(e.wrong(format!("kv {kv} is negative")));
                }
                self.gainprm = [0.0; PARAMETERS];
                self.gainprm[2] = -kv;
                set(self, "none", "affine", "none");
            }
            "cylinder" => {
                self.dynprm[0] = number("timeconst", self.dynprm[0])?;
                self.gainprm[0] = number("area", self.gainprm[0])?;
                if let Some(diameter) = a.number("diameter")?.filter(|d| *d >= 0.0) {
                    self.gainprm[0] = PI / 4.0 * diameter * diameter;
                }
                if let Some(bias) = a.array::<3>("bias")? {
                    self.biasprm[..3].copy_from_slice(&bias);
                }
                set(self, "filter", "fixed", "affine");
            }
            "adhesion" => {
                self.gainprm[0] = number("gain", self.gainprm[0])?;
                set(self, "none", "fixed", "none");
            }
            "dcmotor" => self.dc_motor(&a, viscous)?,
            _ => set(self, "muscle", "muscle", "muscle"),
        }
        Ok(())
    }

    /// Reads the gains of a servo from its attributes.
    fn servo(&mut self, a: &Attributes<'a>, kp: f64) -> Result<(), Error> {
        let wrong = |what: String| Err(a.element.wrong(what));
        self.biasprm[1] = -kp;
        match (a.number("kv")?, a.number("dampratio")?) {
            (Some(_), Some(_)) => return wrong("has kv and dampratio, which contradict each other".to_owned()),
            (Some(x), None) | (None, Some(x)) if x < 0.0 => return wrong(format!("kv or dampratio {x} is negative")),
            (Some(kv), None) => self.biasprm[2] = -kv,
            (None, Some(ratio)) => self.biasprm[2] = ratio,
            (None, None) => {}
        }
        Ok(())
    }

    /// Reads a DC motor with the resistance R and the motor constant K. Its force is f = K/R (u − K l̇), with the
    /// voltage u and the speed l̇.
    fn dc_motor(&mut self, a: &Attributes<'a>, viscous: f64) -> Result<(), Error> {
        let some = |name: &str, count: usize| -> Result<[f64; 6], Error> {
            let mut x = [0.0; 6];
            fill(a, name, &mut x[..count])?;
            Ok(x)
        };
        let [mut R, mut K] = [self.gainprm[0], self.gainprm[1]];
        R = a.number("resistance")?.unwrap_or(R);
        let [volts, stall, free, ..] = some("nominal", 3)?;
        let [mut torque, mut emf, ..] = some("motorconst", 2)?;
        if a.get("motorconst").is_none() {
            torque = K;
        }
        if volts > 0.0 && emf <= 0.0 && free > 0.0 {
            // The motor constant emf follows from the no-load speed: free = volts emf / (emf² + R viscous).
            let root = volts * volts - 4.0 * R * viscous * free * free;
            let less = volts / free - if stall > 0.0 { volts * viscous / stall } else { 0.0 };
            emf = match viscous > 0.0 {
                true if R > 0.0 && root > 0.0 => (volts + root.sqrt()) / (2.0 * free),
                true if R <= 0.0 && less > 0.0 => less,
                _ => volts / free,
            };
        }
        K = match (torque > 0.0, emf > 0.0) {
            (true, true) => (torque * emf).sqrt(),
            (true, false) => torque,
            _ => emf,
        };
        if R == 0.0 && volts > 0.0 && stall > 0.0 {
            R = K * volts / stall;
        }
        if !(K > 0.0 && R > 0.0) {
            return Err(a.element.wrong(format!("motor constant {K} or resistance {R} is not positive")));
        }
        (self.gainprm[0], self.gainprm[1]) = (R, K);
        for (name, what) in EXTRAS {
            if a.get(name).is_some() {
                self.extra = what;
            }
        }
        (self.dynamics, self.gain, self.bias) = ("none", "dcmotor", "dcmotor");
        Ok(())
    }

    /// Returns the torque limit that `saturation` sets for a DC motor.
    pub(super) fn saturation(&self, a: &Attributes<'a>) -> Result<Option<f64>, Error> {
        let mut given = [0.0; 3];
        fill(a, "saturation", &mut given)?;
        let [torque, current, _] = given;
        Ok(match self.gain == "dcmotor" {
            true if torque > 0.0 => Some(torque),
            true if current > 0.0 => Some(self.gainprm[1] * current),
            _ => None,
        })
    }
}

/// Overwrites the first entries of an array with the numbers of an attribute. As in MuJoCo, the attribute may have
/// fewer numbers than the array.
pub(super) fn fill(a: &Attributes, name: &str, to: &mut [f64]) -> Result<(), Error> {
    for text in a.layers(name) {
        let wrong = |what: String| a.element.wrong(format!("{name}: {what}"));
        let numbers = numbers(text).map_err(wrong)?;
        if numbers.len() > to.len() {
            return Err(wrong(format!("expected at most {} numbers, found {}", to.len(), numbers.len())));
        }
        to[..numbers.len()].copy_from_slice(&numbers);
    }
    Ok(())
}
