//! Attributes of MJCF whose values are keywords.

use crate::error::Error;
use crate::io::xml::Element;

/// Tags of elements, one of their attributes, and the keywords that this attribute may have, as in MuJoCo 4.0. Other
/// modules check the keywords of `<compiler>`, `<flag>` and joints, and attributes that are `true` or `false`.
const KEYWORDS: [(&str, &str, &str); 16] = [
    ("option", "integrator", "Euler RK4 implicit implicitfast"),
    ("option", "cone", "pyramidal elliptic"),
    ("option", "jacobian", "dense sparse auto"),
    ("option", "solver", "PGS CG Newton"),
    ("compiler", "conflict", "warning merge error"),
    ("mesh", "inertia", "convex exact legacy shell"),
    ("body", "sleep", "auto never allowed init"),
    ("body", "simple", "false auto"),
    ("geom site", "type", "plane hfield sphere capsule ellipsoid cylinder box mesh sdf"),
    ("geom", "fluidshape", "none ellipsoid"),
    ("camera", "mode", "fixed track trackcom targetbody targetbodycom"),
    ("camera", "projection", "perspective orthographic"),
    ("general plugin", "dyntype", "none integrator filter filterexact muscle dcmotor pid user"),
    ("general", "gaintype", "fixed affine muscle dcmotor so3 pid user"),
    ("general", "biastype", "none affine muscle dcmotor so3 user"),
    (ACTUATORS, "interp", "zoh linear cubic"),
];

/// Tags of actuators.
const ACTUATORS: &str =
    "general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor plugin";

/// Keywords of the attribute `input`, which may contain several keywords.
const INPUTS: [&str; 7] = ["none", "expmap", "quat", "pos", "vel", "ff", "voltage"];

/// Checks the keywords of an element and of its content.
pub(super) fn check(element: &Element) -> Result<(), Error> {
    let wrong = |name: &str, word: &str, known: &[&str]| {
        let (last, others) = known.split_last().expect("a keyword");
        element.wrong(format!("{name}: `{word}` is none of {} and {last}", others.join(", ")))
    };
    for (name, value) in &element.attributes {
        let is_of = |tags: &str| tags.split(' ').any(|tag| tag == element.tag);
        let found = KEYWORDS.iter().find(|(tags, attribute, _)| attribute == name && is_of(tags));
        if let Some((.., words)) = found {
            let words: Vec<&str> = words.split(' ').collect();
            if !words.contains(&&**value) {
                return Err(wrong(name, value, &words));
            }
        }
        if name == "input"
            && is_of(ACTUATORS)
            && let Some(word) = value.split_whitespace().find(|word| !INPUTS.contains(word))
        {
            return Err(wrong(name, word, &INPUTS));
        }
    }
    element.children.iter().try_for_each(check)
}
