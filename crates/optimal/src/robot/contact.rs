//! Contacts of a knot, by name, and what makes a set of them singular.

use crate::Error;
use condyle_dynamics::{ConstraintSet, ContactConstraint, Model, Proximal};
use condyle_spatial::Scalar;
use core::ops::Range;

/// Contact of a frame with the world, and the name by which residuals call it.
///
/// The constraint says which frame, whether its origin ([`ContactConstraint::point`]) or all of it
/// ([`ContactConstraint::rigid`]) is held, along which axes its rows and its force are, and the gains of its
/// stabilisation. Crocoddyl's `ContactModel3D` and `ContactModel6D` are these with `gains = [kp, kd]`; its `WORLD` is
/// `LocalWorldAligned` here. Its `ContactModel1D` and `ContactModel2D` are [`ContactConstraint::line`] and
/// [`ContactConstraint::plane`].
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
    /// Name by which residuals call it.
    pub name: String,
    /// Constraint that it imposes.
    pub constraint: ContactConstraint,
}

impl Contact {
    /// Returns a contact called `name`.
    pub fn new(name: &str, constraint: ContactConstraint) -> Self {
        Self { name: name.to_owned(), constraint }
    }
}

/// Damping for contacts whose forces are given, which may share them as they like: it is not used.
pub(super) const SHARED: f64 = 1.0;

/// Returns the constraints of some contacts, with the damping μ of J M⁻¹ Jᵀ + μ 1.
pub(super) fn constraint_set<S: Scalar>(
    model: &Model,
    contacts: &[Contact],
    damping: f64,
) -> Result<ConstraintSet<S>, Error> {
    check_together(model, contacts, damping)?;
    let constraints: Vec<_> = contacts.iter().map(|c| c.constraint).collect();
    let mut set = ConstraintSet::new(model, &constraints).map_err(|error| named(contacts, error))?;
    set.proximal = Proximal { mu: damping, iterations: 1 };
    Ok(set)
}

/// Returns an error of the constraints of some contacts, with the contact's name.
fn named(contacts: &[Contact], error: condyle_dynamics::Error) -> Error {
    match error {
        condyle_dynamics::Error::Constraint { constraint, what } => {
            Error::Contact { name: contacts[constraint].name.clone(), what }
        }
        other => Error::Contact { name: String::new(), what: other.to_string() },
    }
}

/// Refuses contacts of which there can be no set.
pub(super) fn check_contacts(model: &Model, contacts: &[Contact], damping: f64) -> Result<(), Error> {
    check_together(model, contacts, damping)?;
    let constraints: Vec<_> = contacts.iter().map(|c| c.constraint).collect();
    ConstraintSet::<f64>::check_all(model, &constraints).map_err(|error| named(contacts, error))
}

/// Refuses contacts that are named twice or are singular together, and damping that is no number of at least 0.
fn check_together(model: &Model, contacts: &[Contact], damping: f64) -> Result<(), Error> {
    if !(damping >= 0.0 && damping.is_finite()) {
        return Err(Error::Contact { name: "damping".to_owned(), what: format!("μ is {damping}, not at least 0") });
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
        if c.other.is_some() {
            continue; // a loop
        }
        // Two contacts on one body are singular: even two points leave only five rows of six that say something, and
        // points on a line never hold the turn about it. Damping shares the forces. Single directions may fit together.
        let directions = |c: &ContactConstraint| c.kind.rows() < 3;
        let same = |other: &&Contact| {
            other.constraint.other.is_none()
                && !(directions(c) || directions(&other.constraint))
                && model.frames().get(other.constraint.frame).is_some_and(|f| f.body == frame.body)
        };
        if let Some(twin) = before.iter().find(same).filter(|_| damping == 0.0) {
            let what = format!(
                "it is on body `{}`, as contact `{}`: together they are singular without damping",
                model.bodies()[frame.body].name,
                twin.name
            );
            return wrong(what);
        }
    }
    Ok(())
}

/// Returns the names of contacts, and the rows of each in λ.
pub(super) fn rows_of(contacts: &[Contact]) -> Vec<(String, Range<usize>)> {
    let mut row = 0;
    let rows = contacts.iter().map(|Contact { name, constraint }| {
        row += constraint.kind.rows();
        (name.clone(), row - constraint.kind.rows()..row)
    });
    rows.collect()
}

/// Returns the coordinates that move each row of all contacts.
pub(super) fn moved_by(model: &Model, contacts: &[Contact]) -> Vec<Vec<usize>> {
    let rows = contacts.iter().flat_map(|Contact { constraint, .. }| {
        let frames = [Some(constraint.frame), constraint.other].into_iter().flatten();
        vec![coordinates_of(model, frames); constraint.kind.rows()]
    });
    rows.collect()
}

/// Returns the coordinates that move some frames, in order.
pub(super) fn coordinates_of(model: &Model, frames: impl IntoIterator<Item = usize>) -> Vec<usize> {
    let mut coordinates = Vec::new();
    for frame in frames {
        coordinates.extend(path(model, model.frames()[frame].body));
    }
    coordinates.sort_unstable();
    coordinates.dedup();
    coordinates
}

/// Returns the coordinates of a body's joint and of those before it, up to the world.
pub(super) fn path(model: &Model, body: usize) -> Vec<usize> {
    let (mut path, mut body) = (Vec::new(), body);
    while body > 0 {
        let joint = &model.bodies()[body];
        path.extend(joint.idx_v..joint.idx_v + joint.joint.nv());
        body = joint.parent;
    }
    path
}
