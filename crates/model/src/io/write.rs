//! Writing of a robot's inertias, limits, damping, friction and armature into a copy of the robot's file. All other
//! bytes are copied.
//!
//! The original text is edited at the elements that differ. Then the new text is read again and compared with the
//! model. A number of a body or joint may be a sum over several elements, for example over links that fixed joints
//! merge, or over a joint and its actuators. The contribution of the other elements is the difference between the
//! number read and the number written. This difference is subtracted once. If the new text still does not reproduce the
//! model, the file is not written.

mod changes;
mod differences;
mod edits;
mod mjcf;
mod urdf;

use super::mjcf::MjcfOptions;
use super::urdf::UrdfOptions;
use super::xml::{Amount, Element};
use crate::error::Error;
use crate::model::Model;
use changes::{Changes, NO_SHARE, ROUNDING};
use differences::{Difference, difference};
use edits::Edits;
use std::collections::HashMap;
use std::path::Path;

/// File format: its reader, and the elements of the format that contain the numbers of a robot.
trait Format {
    /// Reads a text as if it were the original file.
    fn read(&self, text: &str) -> Result<Model, Error>;
    /// Returns the mass (kg) of each link for which the file specifies an inertia, by name.
    fn masses(&self, root: &Element) -> HashMap<String, f64>;
    /// Edits the elements in a text according to the changes.
    fn edit(&self, edits: &mut Edits, root: &Element, changes: &Changes) -> Result<(), String>;
}

impl Model {
    /// Writes the inertias, limits, damping, friction and armature of this robot into a copy of the URDF `original`.
    /// The rest of the file is copied.
    ///
    /// Only numbers that differ from the original are edited, so an unchanged robot results in the same bytes. `path`
    /// may be the same as `original`. Reading the new file reproduces this model, up to rounding.
    ///
    /// The inertia of a body is the sum of the inertias of its links, which fixed joints merge. The whole difference is
    /// written to one link: the link that the body's joint carries or, if that link has no mass, the heaviest link. The
    /// new inertia of this link must be physical, with at least a thousandth of the body's mass. If it is not, the
    /// whole inertia of the body is written to this link, and the inertia of the other links becomes zero.
    ///
    /// ```
    /// use condyle_model::{Model, UrdfOptions, robots};
    /// # let folder = std::env::temp_dir().join("condyle_write_urdf");
    /// # std::fs::create_dir_all(&folder)?;
    /// # let (original, path) = (folder.join("arm7.urdf"), folder.join("identified.urdf"));
    /// std::fs::write(&original, robots::ARM7)?;
    /// let arm = Model::from_urdf(&original, &UrdfOptions::default())?;
    /// let identified = arm.with_inertias(|_, I| I.scale(1.1))?;
    /// identified.write_urdf(&path, &original)?;
    /// let written = Model::from_urdf(&path, &UrdfOptions::default())?;
    /// assert!((written.total_mass() - 1.1 * arm.total_mass()).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// An armature is written as the rotor inertia in the joint's `<transmission>`, with Drake's tags.
    ///
    /// # Errors
    /// Returns [`Error::File`] if the file cannot represent a number, or if the robots differ in any other quantity.
    /// The message contains the quantity and both values. Joints, frames and gravity must be the same as in the
    /// original. A URDF has one number for the efforts in both directions, and no infinite limits. The file must be in
    /// UTF-8, and must not be a xacro file. Also returns the errors of [`from_urdf`](Self::from_urdf).
    pub fn write_urdf(&self, path: impl AsRef<Path>, original: impl AsRef<Path>) -> Result<(), Error> {
        let original = Original::read(original.as_ref())?;
        let root = urdf::root(&original.root).and_then(|root| self.bodies.iter().skip(1).find(|b| b.name == root));
        let mimic = self.bodies.iter().any(|b| b.mimic.is_some());
        let options = UrdfOptions { root_joint: root.map(|b| b.joint), mimic, ..UrdfOptions::default() };
        write(self, path.as_ref(), &original, &urdf::Urdf { options })
    }

    /// Writes the inertias, limits, damping, friction and armature of this robot into a copy of the MJCF `original`.
    /// The rest of the file is copied; see [`write_urdf`](Self::write_urdf).
    ///
    /// Attributes of elements override the attributes of their classes, so default classes stay unchanged. A changed
    /// inertia is written as an `<inertial>`, even if geoms determined the inertia before. Limits of effort are written
    /// as `actuatorfrcrange` of the joint. The weight that `gravcomp` compensates is proportional to the mass, so the
    /// compensated weight changes with the mass.
    ///
    /// # Errors
    /// Returns the errors of [`write_urdf`](Self::write_urdf). The file itself must contain the bodies and joints that
    /// differ. Bodies and joints from an included file, from `replicate` or from `attach` cannot be edited. An MJCF has
    /// no speed limits. The `<compiler>` must not replace inertias (`inertiafromgeom`) or scale them (`settotalmass`).
    /// Also returns the errors of [`from_mjcf`](Self::from_mjcf).
    pub fn write_mjcf(&self, path: impl AsRef<Path>, original: impl AsRef<Path>) -> Result<(), Error> {
        let original = Original::read(original.as_ref())?;
        let mimic = self.bodies.iter().any(|b| b.mimic.is_some());
        let mut format = mjcf::Mjcf { path: original.path, options: MjcfOptions { mimic, ..MjcfOptions::default() } };
        // If the original can only be read with missing mesh files, these meshes have no mass.
        format.options.weightless_meshes = format.read(&original.text).is_err();
        write(self, path.as_ref(), &original, &format)
    }
}

/// Original file; the edits are made in a copy of its text.
struct Original<'a> {
    path: &'a Path,
    text: String,
    root: Element,
}

impl<'a> Original<'a> {
    fn read(path: &'a Path) -> Result<Self, Error> {
        let mut amount = Amount::default();
        let text = amount.read(path)?;
        let root = Element::parse(&text, &path.display().to_string(), &mut amount)?;
        let original = Self { path, text, root };
        match std::fs::read(path) {
            Ok(bytes) if bytes == original.text.as_bytes() => Ok(original),
            Ok(_) => Err(original.wrong("is not in UTF-8, so a copy of it cannot keep all else as it is".to_owned())),
            Err(error) => Err(original.wrong(error.to_string())),
        }
    }

    fn wrong(&self, what: String) -> Error {
        Error::File { file: self.path.display().to_string(), what }
    }

    /// Returns the original text with the changed numbers.
    fn edited(&self, format: &impl Format, changes: &Changes) -> Result<String, Error> {
        let mut edits = Edits::new(&self.text);
        format.edit(&mut edits, &self.root, changes).map_err(|what| self.wrong(what))?;
        Ok(edits.apply())
    }
}

/// Writes a model into a copy of a file.
fn write(model: &Model, path: &Path, original: &Original, format: &impl Format) -> Result<(), Error> {
    let mut now = format.read(&original.text)?;
    let masses = format.masses(&original.root);
    let refused = |difference: Difference| original.wrong(difference.text(&original.root));
    let mut changes = Changes::new(model, &now, &masses).map_err(refused)?;
    let mut new = original.text.clone();
    if !changes.is_empty() {
        new = original.edited(format, &changes)?;
        now = format.read(&new)?;
    }
    if difference(model, &now, NO_SHARE).is_some() && changes.take_shares_off(model, &now) {
        new = original.edited(format, &changes)?;
        now = format.read(&new)?;
    }
    match difference(model, &now, ROUNDING) {
        Some(difference) => Err(refused(difference)),
        None => std::fs::write(path, new).map_err(|e| {
            Error::File { file: path.display().to_string(), what: e.to_string() } //
        }),
    }
}
