//! Check that the contacts of one body are not singular together.

use condyle_dynamics::lie;
use condyle_dynamics::{ConstraintKind, ContactConstraint, Force, Model, ReferenceFrame, Vec3};

/// Returns the names of earlier contacts on the same body if the rows of `contact` depend on the rows of these contacts
/// in every state; otherwise `None`.
///
/// A row is the wrench (d, p × d) of a unit force along the direction d at the point p of the body. The rows of two
/// points are dependent, because points on a line do not prevent the rotation about this line. Directions of the world
/// are turned into the body by a rotation that has no special property. So rows that depend on each other only in
/// special states are not found. A loop between two moving bodies is not checked.
pub(super) fn dependent<'c>(
    model: &Model,
    before: impl Iterator<Item = (&'c str, &'c ContactConstraint)>,
    contact: &ContactConstraint,
) -> Option<String> {
    let body = |c: &ContactConstraint| {
        let on_world = c.other.is_none_or(|other| model.frames().get(other).is_some_and(|f| f.body == 0));
        model.frames().get(c.frame).filter(|_| on_world).map(|frame| frame.body)
    };
    let here = body(contact)?;
    let others: Vec<_> = before.filter(|(_, other)| body(other) == Some(here)).collect();
    let holds = |set: &[(&str, &ContactConstraint)]| {
        let mut rows = Vec::new();
        for (_, other) in set {
            add_wrenches(model, other, &mut rows);
        }
        add_wrenches(model, contact, &mut rows)
    };
    if others.is_empty() || !holds(&others) {
        return None;
    }
    if let Some(one) = others.iter().find(|other| holds(&[**other])) {
        return Some(format!("contact `{}`", one.0));
    }
    let names: Vec<_> = others.iter().map(|other| format!("`{}`", other.0)).collect();
    Some(format!("contacts {}", names.join(", ")))
}

/// Smallest part of a wrench that is not a sum of earlier wrenches, relative to the wrench. Smaller parts are rounding.
const INDEPENDENT: f64 = 1e-7;

/// Adds the part of each wrench of a constraint that is orthogonal to the wrenches before it, as a unit vector. Returns
/// whether a wrench had no such part. Units: N, N m.
fn add_wrenches(model: &Model, constraint: &ContactConstraint, basis: &mut Vec<[f64; 6]>) -> bool {
    let placement = &model.frames()[constraint.frame].placement;
    let turn = match constraint.reference {
        ReferenceFrame::Local => placement.rotation,
        _ => lie::exp3(Vec3::new(0.3, -0.7, 0.5)).to_rotation(), // any rotation without a special property
    };
    let (o, axes) = (Vec3::zero(), turn * constraint.axes);
    let force = |d: Vec3<f64>| (d, placement.translation.cross(d));
    let all = [force(axes.x), force(axes.y), force(axes.z), (o, axes.x), (o, axes.y), (o, axes.z)];
    let rows: &[usize] = match constraint.kind {
        ConstraintKind::Line => &[2],
        ConstraintKind::Plane => &[0, 2],
        ConstraintKind::Point => &[0, 1, 2],
        _ => &[0, 1, 2, 3, 4, 5],
    };
    let dot = |a: &[f64; 6], b: &[f64; 6]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut dependent = false;
    for &row in rows {
        let (force, moment) = all[row];
        let mut rest: [f64; 6] = Force { linear: force, angular: moment }.to_array();
        let size = dot(&rest, &rest).sqrt();
        for unit in basis.iter().chain(&basis[..]) {
            let along = dot(&rest, unit);
            rest.iter_mut().zip(unit).for_each(|(r, u)| *r -= along * u); // twice, against rounding
        }
        let left = dot(&rest, &rest).sqrt();
        if left > INDEPENDENT * size {
            basis.push(rest.map(|r| r / left));
        } else {
            dependent = true;
        }
    }
    dependent
}
