//! Reader of named positions in SRDF, the format in which MoveIt describes the semantics of a robot.

use super::known::Known;
use super::xml::{Amount, Element, numbers};
use crate::body::Body;
use crate::configuration::neutral;
use crate::error::Error;
use crate::io::collisions::Collisions;
use crate::joint::Joint;
use crate::model::Model;
use std::collections::HashMap;
use std::path::Path;

/// Table of [`Known`] elements: elements of MoveIt, Pinocchio and HPP.
const KNOWN: &str = "\
robot: name version ; group* group_state end_effector* virtual_joint* passive_joint* disable_collisions* enable_collisions* \
    disable_default_collisions* link_sphere_approximation* joint_property* chain_property* rotor_params* gripper* handle* \
    specificities*
group_state: name group ; joint
joint: name value
";

/// Maximum number of `<group_state>`s in a file. The number is limited because each state is stored as a complete
/// position of the robot.
const MAX_STATES: usize = 4096;

impl Model {
    /// Reads the named positions of an SRDF file, which are its `<group_state>`s. Returns (name, q) in the order of the
    /// file.
    ///
    /// In a state, a `<joint>` lists all coordinates of its joint in q, or one angle if the joint is continuous. Joints
    /// that are not mentioned are at their [`neutral`] positions. States with the same name, such as `home` of an arm
    /// and `home` of its hand, form one position. An SRDF is often shared by several robots. Joints that this robot
    /// does not have are ignored, or are errors if `strict` is set. Joints that follow other joints have no coordinate
    /// of their own. All other elements of the file (groups, pairs that cannot collide, …) are ignored. Unknown,
    /// misspelt or misplaced names are ignored, too, unless `strict` is set.
    ///
    /// # Errors
    /// Returns [`Error::File`], [`Error::Xml`] or [`Error::Element`], with file, line and element. Examples of errors
    /// are invalid numbers, a wrong number of coordinates for a joint, and quaternions or (cos, sin) pairs whose length
    /// is not 1. Returns [`Error::Strict`] for an unknown name if `strict` is set. The limits of files are listed in
    /// the [crate documentation](crate#limits-of-files).
    pub fn reference_configurations(
        &self,
        path: impl AsRef<Path>,
        strict: bool,
    ) -> Result<Vec<(String, Vec<f64>)>, Error> {
        let (path, mut amount) = (path.as_ref(), Amount::default());
        let text = amount.read(path)?;
        self.group_states(&Element::parse(&text, &path.display().to_string(), &mut amount)?, strict)
    }

    /// Reads the named positions of an SRDF from a string; see
    /// [`reference_configurations`](Self::reference_configurations).
    ///
    /// ```
    /// let arm = condyle_model::robots::arm7();
    /// let srdf = r#"<robot name="arm7"><group_state name="bent" group="arm">
    ///   <joint name="joint2" value="0.5"/><joint name="joint4" value="-1.2"/>
    /// </group_state></robot>"#;
    /// let positions = arm.reference_configurations_str(srdf, true)?;
    /// assert_eq!(positions, [("bent".to_owned(), vec![0.0, 0.5, 0.0, -1.2, 0.0, 0.0, 0.0])]);
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`reference_configurations`](Self::reference_configurations).
    pub fn reference_configurations_str(&self, text: &str, strict: bool) -> Result<Vec<(String, Vec<f64>)>, Error> {
        self.group_states(&Element::parse(text, "<string>", &mut Amount::default())?, strict)
    }

    fn group_states(&self, root: &Element, strict: bool) -> Result<Vec<(String, Vec<f64>)>, Error> {
        if root.tag != "robot" {
            return Err(root.wrong("expected <robot>, the root of an SRDF"));
        }
        if strict {
            let mut warnings = Vec::new();
            Known::new(KNOWN).check(root, &[], &mut warnings);
            if let Some(warning) = warnings.into_iter().next() {
                return Err(Error::Strict { file: root.file.to_string(), warning });
            }
        }
        let bodies: HashMap<&str, &Body> = self.bodies[1..].iter().map(|b| (b.joint_name.as_str(), b)).collect();
        let (mut states, mut places) = (Vec::<(String, Vec<f64>)>::new(), HashMap::new());
        for (k, state) in root.all("group_state").enumerate() {
            if k == MAX_STATES {
                return Err(state.wrong(format!("more than {MAX_STATES} positions")));
            }
            let name = text(state, "name")?;
            let place = *places.entry(name).or_insert_with(|| {
                states.push((name.to_owned(), neutral(self)));
                states.len() - 1
            });
            let q = &mut states[place].1;
            for joint in state.all("joint") {
                let name = text(joint, "name")?;
                match bodies.get(name) {
                    Some(body) => set(body, joint, q)?,
                    None if strict => self.joint(name).map(drop).map_err(|unknown| joint.wrong(unknown.to_string()))?,
                    None => {}
                }
            }
            self.check_position(q).map_err(|e| match &e {
                Error::Position { joint: name, what } => {
                    let at = state.all("joint").find(|joint| joint.attribute("name") == Some(name));
                    at.unwrap_or(state).wrong(what.clone())
                }
                _ => e,
            })?;
        }
        Ok(states)
    }
}

impl Collisions {
    /// Disables the pairs of links that an SRDF file lists as `<disable_collisions>`. Links of other robots have no
    /// effect. All other elements are ignored, except `<enable_collisions>` and `<disable_default_collisions>`, which
    /// are errors because they are not supported.
    ///
    /// # Errors
    /// Returns [`Error::File`], [`Error::Xml`] or [`Error::Element`].
    pub fn read_srdf(&mut self, path: impl AsRef<Path>) -> Result<(), Error> {
        let (path, mut amount) = (path.as_ref(), Amount::default());
        let text = amount.read(path)?;
        self.disable_all(&Element::parse(&text, &path.display().to_string(), &mut amount)?)
    }

    /// Disables the pairs of links that an SRDF string lists; see [`read_srdf`](Self::read_srdf).
    ///
    /// ```
    /// use condyle_model::Collisions;
    /// let mut collisions = Collisions::default();
    /// let srdf = r#"<robot name="r"><disable_collisions link1="hand" link2="arm" reason="Never"/></robot>"#;
    /// collisions.read_srdf_str(srdf)?;
    /// assert_eq!(collisions.disabled(), [["arm", "hand"]]);
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`read_srdf`](Self::read_srdf).
    pub fn read_srdf_str(&mut self, text: &str) -> Result<(), Error> {
        self.disable_all(&Element::parse(text, "<string>", &mut Amount::default())?)
    }

    fn disable_all(&mut self, root: &Element) -> Result<(), Error> {
        if root.tag != "robot" {
            return Err(root.wrong("expected <robot>, the root of an SRDF"));
        }
        let refused =
            root.children.iter().find(|e| matches!(&*e.tag, "enable_collisions" | "disable_default_collisions"));
        if let Some(element) = refused {
            return Err(element.wrong("is not supported: only <disable_collisions> is"));
        }
        for element in root.all("disable_collisions") {
            self.leave_apart(text(element, "link1")?, text(element, "link2")?);
        }
        Ok(())
    }
}

/// Sets the position of a joint from a `<joint>` of a state, unless the joint follows another joint.
fn set(body: &Body, element: &Element, q: &mut [f64]) -> Result<(), Error> {
    let x = numbers(text(element, "value")?).map_err(|what| element.wrong(format!("value: {what}")))?;
    if body.mimic.is_some() {
        return Ok(());
    }
    let to = &mut q[body.idx_q..][..body.joint.nq()];
    match (body.joint, &x[..]) {
        (Joint::Continuous { .. }, &[angle]) => to.copy_from_slice(&[angle.cos(), angle.sin()]),
        (_, x) if x.len() == to.len() => to.copy_from_slice(x),
        _ => {
            let s = if to.len() == 1 { "" } else { "s" };
            return Err(element.wrong(format!("value: expected {} number{s}, found {}", to.len(), x.len())));
        }
    }
    Ok(())
}

/// Returns the text of a required attribute.
fn text<'a>(element: &'a Element, attribute: &str) -> Result<&'a str, Error> {
    let text = element.attribute(attribute).filter(|text| !text.trim().is_empty());
    text.ok_or_else(|| element.wrong(format!("has no {attribute}")))
}
