//! Tendons of MJCF whose length is a sum of joint positions. If this length depends on a single coordinate, the tendon
//! acts on this coordinate.

use super::Source;
use super::actuator::Range;
use super::attributes::{Attributes, MAIN};
use super::law::fill;
use super::spring::{Joints, Line, Switches};
use crate::error::Error;
use crate::io::xml::Element;
use crate::model::Model;
use crate::warning::Warning;
use std::collections::HashMap;

/// Tendon of a file.
pub(super) struct Tendon<'a> {
    pub(super) element: &'a Element,
    pub(super) name: String,
    /// Joints of a fixed tendon, each with its coefficient. The list is empty for a spatial tendon.
    pub(super) joints: Vec<(usize, f64)>,
    stiffness: [f64; 3],
    /// Minimum and maximum length at which the spring is slack.
    rest: [f64; 2],
    pub(super) damping: [f64; 3],
    friction: f64,
    pub(super) armature: f64,
    /// Whether the spring is plastic, so that its rest length changes.
    is_plastic: bool,
    pub(super) range: [f64; 2],
    limits: Option<[f64; 2]>,
    /// Minimum and maximum force of all actuators together.
    pub(super) effort: Option<[f64; 2]>,
}

/// Tendons of a file.
#[derive(Default)]
pub(super) struct Tendons<'a> {
    pub(super) all: Vec<Tendon<'a>>,
    pub(super) named: HashMap<&'a str, usize>,
}

impl<'a> Tendons<'a> {
    pub(super) fn read(root: &'a Element, sources: &'a [Source<'a>], joints: &Joints) -> Result<Self, Error> {
        let mut tendons = Self::default();
        // Other elements are skipped here. The check against `elements.txt` reports them.
        let elements = root.all("tendon").flat_map(|section| &section.children);
        let elements: Vec<_> = elements.filter(|e| matches!(&*e.tag, "fixed" | "spatial")).collect();
        super::names(elements.iter().copied())?;
        for e in elements {
            tendons.named.extend(e.attribute("name").map(|name| (name, tendons.all.len())));
            tendons.all.push(Tendon::read(e, sources, joints)?);
        }
        Ok(tendons)
    }
}

impl<'a> Tendon<'a> {
    fn read(e: &'a Element, sources: &'a [Source<'a>], joints: &Joints) -> Result<Self, Error> {
        let Source { defaults, compiler, .. } = &sources[e.source];
        let autolimits = compiler.autolimits;
        let a = defaults.of_kind(e, "tendon", MAIN)?;
        let number = |name: &str| a.number(name).map(|x| x.unwrap_or(0.0));
        let mut over = Vec::new();
        for inside in e.all("joint").filter(|_| e.tag == "fixed") {
            let name = inside.attribute("joint").ok_or_else(|| inside.lacks("joint"))?;
            let joint = joints.scalar(inside, "joint", name)?;
            let coefficient = Attributes::plain(inside).number("coef")?.ok_or_else(|| inside.lacks("coef"))?;
            over.push((joint, coefficient));
        }
        let mut sorted: Vec<usize> = over.iter().map(|(joint, _)| *joint).collect();
        sorted.sort_unstable();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(e.wrong("has a joint twice"));
        }
        if e.tag == "fixed" && over.is_empty() {
            return Err(e.wrong("has no joint"));
        }
        let [mut stiffness, mut damping] = [[0.0; 3]; 2];
        fill(&a, "stiffness", &mut stiffness)?;
        fill(&a, "damping", &mut damping)?;
        let mut rest = match a.list("springlength")?.as_deref() {
            None => [-1.0; 2],
            Some(&[length]) => [length; 2],
            Some(&[lower, upper]) if lower <= upper => [lower, upper],
            Some(found) => {
                let what = format!("springlength: expected one number or two in order, found {found:?}");
                return Err(e.wrong(what));
            }
        };
        if rest == [-1.0; 2] {
            rest = [over.iter().map(|&(joint, c)| c * joints.all[joint].rest()).sum(); 2];
        }
        let armature = number("armature")?;
        if armature < 0.0 {
            return Err(e.wrong(format!("armature {armature} is negative")));
        }
        let range = Range::default().read(&a, "range", "limited")?;
        let effort = Range::default().read(&a, "actuatorfrcrange", "actuatorfrclimited")?;
        Ok(Self {
            element: e,
            name: e.attribute("name").unwrap_or_default().to_owned(),
            joints: over,
            stiffness,
            rest,
            damping,
            friction: number("frictionloss")?,
            armature,
            is_plastic: number("springyield")? > 0.0,
            range: range.numbers,
            limits: range.bounds(e, "range", autolimits)?,
            effort: effort.bounds(e, "actuatorfrcrange", autolimits)?,
        })
    }

    /// Returns the tendon's length as a [`Line`], if the length depends on a single coordinate.
    pub(super) fn line(&self, lines: &[Line]) -> Option<Line> {
        let over: Vec<_> = self.joints.iter().map(|&(joint, coefficient)| (lines[joint], coefficient)).collect();
        Line::sum(&over)
    }

    /// Adds the effects of the tendon to its coordinate. Effects that are left out cause warnings. Also adds the
    /// armature of the tendon to the armature of the columns.
    pub(super) fn add_to(
        &self,
        model: &mut Model,
        joints: &Joints,
        lines: &[Line],
        on: &Switches,
        armature: &mut [f64],
        warnings: &mut Vec<Warning>,
    ) {
        let damping = if on.damper { self.damping } else { [0.0; 3] };
        let friction = if on.friction { self.friction } else { 0.0 };
        let limits = self.limits.filter(|_| on.limit);
        let springs = on.spring && self.stiffness != [0.0; 3];
        let slack = self.rest[0] < self.rest[1];
        let line = self.line(lines);
        // The armature of the tendon adds the matrix armature · c cᵀ to the inertia matrix M, where c contains the
        // coefficients of the joints. MuJoCo's M has no entries between joints on different branches.
        let coupled = line.is_none() && self.armature != 0.0 && self.is_coupled(model, joints);
        if !coupled {
            for &(joint, coefficient) in &self.joints {
                let added = coefficient * coefficient * self.armature;
                armature[joints.all[joint].columns(model)].iter_mut().for_each(|sum| *sum += added);
                if line.is_none() {
                    lines[joint].inertia(model, added);
                }
            }
        }
        let mut excluded = false;
        if let Some(line) = line {
            line.inertia(model, self.armature);
            line.resist(model, damping, friction);
            if springs && !slack {
                line.spring(model, self.stiffness, self.rest[0]);
            }
            excluded = limits.is_some_and(|limits| !line.limit(model, limits));
        }
        let spatial = self.element.tag == "spatial";
        let left = [
            (coupled || spatial && self.armature != 0.0, "armature", "it is missing in M"),
            (springs && (line.is_none() || slack), "stiffness", "its spring does not act"),
            (line.is_none() && damping != [0.0; 3], "damping", "it does not act"),
            (line.is_none() && friction != 0.0, "frictionloss", "it does not act"),
            (excluded || line.is_none() && limits.is_some(), "range", "its length has no limits"),
        ];
        let why = match (spatial, line, excluded) {
            (true, ..) => "a spatial tendon is left out",
            (_, None, _) => "the tendon runs over several joints",
            (.., true) => "they exclude those of its joint",
            _ => "its spring is slack between two lengths",
        };
        if springs && self.is_plastic {
            warnings.push(self.element.left_out("springyield: the spring does not yield, however far it is stretched"));
        }
        for (_, what, effect) in left.into_iter().filter(|(is_left, ..)| *is_left) {
            warnings.push(self.element.left_out(format!("{what}: {effect}, for {why}")));
        }
    }

    /// Returns whether one joint of the tendon carries another joint of the tendon.
    fn is_coupled(&self, model: &Model, joints: &Joints) -> bool {
        let mut over = vec![false; model.bodies.len()];
        self.joints.iter().for_each(|(joint, _)| over[joints.all[*joint].body] = true);
        let mut carried = vec![false; model.bodies.len()];
        (1..over.len()).any(|i| {
            let parent = model.bodies[i].parent;
            carried[i] = carried[parent] || over[parent];
            over[i] && carried[i]
        })
    }
}
