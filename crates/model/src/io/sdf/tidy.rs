//! Small faults of an SDF that the format's own library ignores. This reader also ignores them, but with a warning.

use crate::io::xml::{self, Element};
use crate::warning::Warning;

/// Tags of the elements that are searched for small faults, because a fault in them can change the robot.
const PARENTS: &str = " sdf world model include link inertial inertia joint axis axis2 dynamics limit mimic ";

/// Tags of elements that contain one number.
const NUMBERS: &str = " mass density ixx ixy ixz iyy iyz izz lower upper effort velocity damping friction spring_stiffness \
  spring_reference multiplier offset reference screw_thread_pitch thread_pitch gearbox_ratio ";

/// Tags of elements without a number that may occur only once in their parent.
const SINGLE: &str = " pose static gravity kinematic self_collide enable_wind inertial inertia parent child axis axis2 xyz dynamics \
  limit mimic uri name placement_frame gearbox_reference_body ";

/// Maximum number of characters of a number, if other text follows the number.
const MAX_NUMBER: usize = 32;

/// Adds warnings about repeated elements, of which only the first has an effect, and about gravity in the `<physics>`
/// of a world. If other text follows the number in an element, removes this text and adds a warning.
pub(super) fn tidy(element: &mut Element, warnings: &mut Vec<Warning>) {
    let is_in = |tag: &str, tags: &str| tags.contains(&format!(" {tag} "));
    let mut seen: Vec<String> = Vec::new();
    for child in &mut element.children {
        let is_number = is_in(&child.tag, NUMBERS);
        if is_number || is_in(&child.tag, SINGLE) {
            if seen.contains(&child.tag) {
                warnings.push(child.left_out(format!("is the second <{}> here, and is left out", child.tag)));
            } else {
                seen.push(child.tag.clone());
            }
        }
        if is_in(&child.tag, PARENTS) {
            tidy(child, warnings);
        }
        if let Some(gravity) = child.child("gravity").filter(|_| child.tag == "physics") {
            warnings.push(gravity.unknown("is misplaced in <physics>: it is the world's since version 1.6"));
        }
        if !is_number || xml::bound(&child.text).is_ok() {
            continue;
        }
        let text = child.text.trim();
        let is_end = |&(at, _): &(usize, char)| xml::numbers(&text[..at]).is_ok_and(|x| x.len() == 1);
        if let Some((end, _)) = text.char_indices().take(MAX_NUMBER).filter(is_end).last() {
            let number = text[..end].trim_end().to_owned();
            warnings.push(child.unknown(format!("`{text}` is no number; it is read as {number}")));
            child.text = number;
        }
    }
}
