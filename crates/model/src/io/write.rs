//! Robots written into a copy of their file: inertias, limits, losses and armature. All else stays byte for byte.
//!
//! A format edits the text of the original at the elements that differ. The new text is then read again: the reader is the
//! judge of what a file says. Where other elements have a share (links that fixed joints merge, the armature of an
//! actuator), the share is the difference between the number written and the number read. It is taken off once. A file that
//! then does not give the model back is not written.

mod changes;
mod edits;
mod mjcf;
mod urdf;

use super::mjcf::MjcfOptions;
use super::urdf::UrdfOptions;
use super::xml::Amount;
use crate::error::Error;
use crate::model::Model;
use changes::{Changes, NO_SHARE, ROUNDING};
use std::collections::HashMap;
use std::path::Path;

/// Files of one kind: how they are read, and where their numbers stand.
trait Format {
    /// Reads a text that stands in the place of the original.
    fn read(&self, text: &str) -> Result<Model, Error>;
    /// Returns the mass of each link that the file gives an inertia (kg), by the link's name.
    fn masses(&self, text: &str) -> Result<HashMap<String, f64>, String>;
    /// Returns the text with other numbers.
    fn edit(&self, text: &str, changes: &Changes) -> Result<String, String>;
}

impl Model {
    /// Writes this robot's inertias, limits, damping and friction into a copy of the URDF `original`, and all else of the
    /// file as it is there.
    ///
    /// Only what differs from the original is edited, so an unchanged robot gives the same bytes. `original` may be `path`.
    /// Reading the new file gives this model back, up to rounding.
    ///
    /// A body of several links, merged by fixed joints, has their sum. The link that its joint carries takes all of the
    /// difference; if that link has no mass, the heaviest one does. If a link would be left with less than a thousandth of
    /// the body's mass, it takes the whole inertia and the others get none.
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
    /// # Errors
    /// [`Error::File`], with the thing and both numbers, if the file cannot say it or the two are different robots: joints,
    /// frames and gravity must be those of the original. A URDF has one number for the efforts in both directions, no
    /// infinite limits, and no armature. Errors of [`from_urdf`](Self::from_urdf).
    pub fn write_urdf(&self, path: impl AsRef<Path>, original: impl AsRef<Path>) -> Result<(), Error> {
        let options = UrdfOptions { mimic: self.bodies.iter().any(|b| b.mimic.is_some()), ..UrdfOptions::default() };
        let original = original.as_ref();
        let text = Amount::default().read(original)?;
        let root_joint = urdf::root(&text).and_then(|root| self.bodies.iter().skip(1).find(|b| b.name == root));
        let options = UrdfOptions { root_joint: root_joint.map(|b| b.joint), ..options };
        write(self, path.as_ref(), original, &text, &urdf::Urdf { options })
    }

    /// Writes this robot's inertias, limits, damping, friction and armature into a copy of the MJCF `original`, and all else
    /// of the file as it is there; see [`write_urdf`](Self::write_urdf).
    ///
    /// Attributes of elements go before those of their classes, so defaults stay as they are. A changed inertia is written
    /// as an `<inertial>`, also where geoms gave it before. Limits of effort are written as `actuatorfrcrange` of the joint.
    ///
    /// # Errors
    /// As [`write_urdf`](Self::write_urdf). The file itself must have the bodies and joints that differ: those of an
    /// included file, or made by `replicate` or `attach`, have no element to edit. An MJCF has no speed limits, and its
    /// compiler must not replace inertias (`inertiafromgeom`) or scale them (`settotalmass`). Errors of
    /// [`from_mjcf`](Self::from_mjcf).
    pub fn write_mjcf(&self, path: impl AsRef<Path>, original: impl AsRef<Path>) -> Result<(), Error> {
        let original = original.as_ref();
        let text = Amount::default().read(original)?;
        let mimic = self.bodies.iter().any(|b| b.mimic.is_some());
        let mut format = mjcf::Mjcf { path: original, options: MjcfOptions { mimic, ..MjcfOptions::default() } };
        // a mesh without a file has no mass
        format.options.weightless_meshes = format.read(&text).is_err();
        write(self, path.as_ref(), original, &text, &format)
    }
}

/// Writes a model into a copy of a file.
fn write(model: &Model, path: &Path, original: &Path, text: &str, format: &impl Format) -> Result<(), Error> {
    let wrong = |file: &Path, what: String| Error::File { file: file.display().to_string(), what };
    let not = |what: String| wrong(original, what);
    let was = format.read(text)?;
    let mut changes = Changes::new(model, &was, &format.masses(text).map_err(not)?).map_err(not)?;
    let mut new = text.to_owned();
    let mut now = was;
    if !changes.is_empty() {
        new = format.edit(text, &changes).map_err(not)?;
        now = format.read(&new)?;
    }
    if changes::difference(model, &now, NO_SHARE).is_some() && changes.take_shares_off(model, &now) {
        new = format.edit(text, &changes).map_err(not)?;
        now = format.read(&new)?;
    }
    match changes::difference(model, &now, ROUNDING) {
        Some(what) => Err(not(what)),
        None => std::fs::write(path, new).map_err(|e| wrong(path, e.to_string())),
    }
}
