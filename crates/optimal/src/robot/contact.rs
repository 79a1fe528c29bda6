//! Contacts of a knot, each with a name, and the check that the contacts are not singular together.

use super::dependent_contacts::dependent;
use crate::Error;
use condyle_dynamics::{ConstraintSet, ContactConstraint, Model, ProximalSettings};
use condyle_spatial::Scalar;
use core::ops::Range;

/// Contact of a frame with the world. Residuals refer to the contact by its name.
///
/// The constraint holds the origin of a frame ([`ContactConstraint::point`]) or the whole frame
/// ([`ContactConstraint::rigid`]). It also contains the axes of its rows and its force, and the gains of the
/// stabilisation. Crocoddyl's `ContactModel3D` and `ContactModel6D` are these two constraints with `gains = [kp, kd]`.
/// Crocoddyl's reference frame `WORLD` is called `LocalWorldAligned` here. Crocoddyl's `ContactModel1D` and
/// `ContactModel2D` are [`ContactConstraint::line`] and [`ContactConstraint::plane`].
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ReferenceFrame, robots};
/// use condyle_optimal::robot::Contact;
/// let quadruped = robots::quadruped();
/// let foot = ContactConstraint::point(quadruped.frame("LF_foot")?);
/// let foot = ContactConstraint { kd: 50.0, reference: ReferenceFrame::LocalWorldAligned, ..foot };
/// let contact = Contact::new("left front", foot);
/// assert_eq!(contact.constraint.kind.rows(), 3);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Contact {
    /// Name by which residuals refer to the contact.
    pub name: String,
    /// Constraint that the contact imposes.
    pub constraint: ContactConstraint,
}

impl Contact {
    /// Returns a contact called `name`.
    pub fn new(name: &str, constraint: ContactConstraint) -> Self {
        Self { name: name.to_owned(), constraint }
    }
}

/// Damping that is passed to the check of contacts whose forces are controls. A damping above 0 allows several contacts
/// on one body. No result depends on this value.
pub(super) const SHARED: f64 = 1.0;

/// Returns the constraints of `contacts` as one set, with the damping μ in J M⁻¹ Jᵀ + μ 1.
pub(super) fn constraint_set<S: Scalar>(
    model: &Model,
    contacts: &[Contact],
    damping: f64,
) -> Result<ConstraintSet<S>, Error> {
    check_together(model, contacts, damping)?;
    let constraints: Vec<_> = contacts.iter().map(|c| c.constraint).collect();
    let mut set = ConstraintSet::new(model, &constraints).map_err(|error| named(contacts, error))?;
    set.proximal = ProximalSettings { mu: damping, iterations: 1 };
    Ok(set)
}

/// Converts an error about a constraint into an error that names the contact.
fn named(contacts: &[Contact], error: condyle_dynamics::Error) -> Error {
    match error {
        condyle_dynamics::Error::Constraint { constraint, what } => {
            Error::Contact { name: contacts[constraint].name.clone(), what }
        }
        other => Error::Contact { name: String::new(), what: other.to_string() },
    }
}

/// Returns an error if the contacts cannot form a set of constraints for the robot.
pub(super) fn check_contacts(model: &Model, contacts: &[Contact], damping: f64) -> Result<(), Error> {
    check_together(model, contacts, damping)?;
    let constraints: Vec<_> = contacts.iter().map(|c| c.constraint).collect();
    ConstraintSet::<f64>::check_all(model, &constraints).map_err(|error| named(contacts, error))
}

/// Returns an error if two contacts have the same name, hold a frame in the same way, or are singular together. Also if
/// the damping is negative or not finite.
fn check_together(model: &Model, contacts: &[Contact], damping: f64) -> Result<(), Error> {
    if !(damping >= 0.0 && damping.is_finite()) {
        return Err(Error::Setting { name: "damping", value: damping, allowed: "at least 0" });
    }
    for (k, contact) in contacts.iter().enumerate() {
        let wrong = |what: String| Err(Error::Contact { name: contact.name.clone(), what });
        let (before, c) = (&contacts[..k], &contact.constraint);
        if before.iter().any(|other| other.name == contact.name) {
            return wrong("another contact has this name".to_owned());
        }
        let Some(frame) = model.frames().get(c.frame) else {
            return wrong(format!("there is no frame {}; the robot has {}", c.frame, model.frames().len()));
        };
        if let Some(twin) = before.iter().find(|other| other.constraint.repeats(c)) {
            return wrong(format!("it holds frame `{}` as contact `{}` does already", frame.name, twin.name));
        }
        if let Some(others) =
            dependent(model, before.iter().map(|other| (&*other.name, &other.constraint)), c).filter(|_| damping == 0.0)
        {
            let what = format!(
                "it is on body `{}`, as {others}: together they are singular without damping",
                model.bodies()[frame.body].name,
            );
            return wrong(what);
        }
    }
    Ok(())
}

/// Returns the name of each contact, and the range of its rows in λ.
pub(super) fn rows_of(contacts: &[Contact]) -> Vec<(String, Range<usize>)> {
    let mut row = 0;
    let rows = contacts.iter().map(|Contact { name, constraint }| {
        row += constraint.kind.rows();
        (name.clone(), row - constraint.kind.rows()..row)
    });
    rows.collect()
}

/// Returns, for each row of all contacts, the coordinates that move the frames of the row's contact.
pub(super) fn moved_by(model: &Model, contacts: &[Contact]) -> Vec<Vec<usize>> {
    let rows = contacts.iter().flat_map(|Contact { constraint, .. }| {
        let frames = [Some(constraint.frame), constraint.other].into_iter().flatten();
        vec![coordinates_of(model, frames); constraint.kind.rows()]
    });
    rows.collect()
}

/// Returns the coordinates that move at least one of the frames, in increasing order.
pub(super) fn coordinates_of(model: &Model, frames: impl IntoIterator<Item = usize>) -> Vec<usize> {
    let mut coordinates = Vec::new();
    for frame in frames {
        coordinates.extend(path(model, model.frames()[frame].body));
    }
    coordinates.sort_unstable();
    coordinates.dedup();
    coordinates
}

/// Returns the coordinates of all joints between a body and the world.
pub(super) fn path(model: &Model, body: usize) -> Vec<usize> {
    let (mut path, mut body) = (Vec::new(), body);
    while body > 0 {
        let joint = &model.bodies()[body];
        path.extend(joint.idx_v..joint.idx_v + joint.joint.nv());
        body = joint.parent;
    }
    path
}
