//! Transmissions of a URDF: the inertia of a rotor, reflected to the joint that the rotor drives.

use crate::io::xml::{Element, array};
use crate::warning::Warning;
use std::collections::BTreeMap;

/// Tags of elements that contain a rotor's inertia about its axis (kg m²).
const ROTOR: [&str; 5] = ["drake:rotor_inertia", "rotorInertia", "rotor_inertia", "motorInertia", "motor_inertia"];
/// Tags of elements that contain the number of turns of a rotor per turn of its joint.
const RATIO: [&str; 5] = ["drake:gear_ratio", "mechanicalReduction", "mechanical_reduction", "gearRatio", "gear_ratio"];

/// Armature (kg m²) and `<transmission>` of each joint, by the name of the joint.
pub(super) type Armatures<'a> = BTreeMap<&'a str, (f64, &'a Element)>;

/// Returns the armature n² J of each joint whose transmission has both a reduction n and a rotor's inertia J. Adds
/// warnings about other transmissions, unless they have no rotor and their reduction is 1.
pub(super) fn armatures<'a>(robot: &'a Element, warnings: &mut Vec<Warning>) -> Armatures<'a> {
    let mut found = BTreeMap::new();
    for transmission in robot.all("transmission") {
        let (mut joints, mut actuators) = (transmission.all("joint"), transmission.all("actuator"));
        let (joint, actuator) = (joints.next(), actuators.next());
        let is_simple = joints.next().is_none() && actuators.next().is_none();
        let inside = [actuator, joint, Some(transmission)];
        let find = |tags: &[&str]| {
            // Drake reads its own elements only inside an `<actuator>`.
            let counts = |of: &Element, tag: &str| of.tag == "actuator" || !tag.starts_with("drake:");
            let mut elements = inside
                .iter()
                .flatten()
                .flat_map(|of| tags.iter().filter(|tag| counts(of, tag)).filter_map(|tag| of.child(tag)));
            elements.find_map(|element| Some((element, number(element)?)))
        };
        let (rotor, mut ratio) = (find(&ROTOR), find(&RATIO).map(|(_, n)| n));
        let name = joint.and_then(|joint| joint.attribute("name"));
        let left_out = match rotor {
            _ if !is_simple => match (rotor, ratio) {
                (None, None | Some(1.0)) => None,
                _ => Some("it couples joints: M has no inertia of its rotors".to_owned()),
            },
            None => ratio
                .filter(|n| n.abs() != 1.0)
                .map(|n| format!("has a reduction of {n} and no rotor inertia: M has no inertia of the rotor")),
            Some((element, inertia)) => {
                if element.tag == ROTOR[0] {
                    ratio = Some(find(&RATIO[..1]).map_or(1.0, |(_, n)| n)); // Drake reads only its own ratio
                }
                let why = match (ratio, name) {
                    _ if inertia < 0.0 => Some("which is below 0"),
                    (Some(n), Some(name)) => {
                        found.entry(name).or_insert((0.0, transmission)).0 += n * n * inertia;
                        None
                    }
                    (None, _) => Some("but no reduction"),
                    (_, None) => Some("but no joint"),
                };
                why.map(|why| format!("has a rotor inertia of {inertia} kg m², {why}: M does not have it"))
            }
        };
        warnings.extend(left_out.map(|what| transmission.left_out(what)));
    }
    found
}

/// Returns the number in an element: its attribute `value` or its text.
fn number(element: &Element) -> Option<f64> {
    let [x] = array(element.attribute("value").unwrap_or(&element.text)).ok()?;
    Some(x)
}
