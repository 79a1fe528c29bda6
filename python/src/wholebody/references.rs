//! Reads and writes `References` of `condyle._wholebody`, whose members are views of one array.
//!
//! The array contains the centre of mass (3 × 3 numbers), the angular momentum (2 × 3) and the posture (q, v, a). Then
//! it has 28 numbers for each frame (pose 4 × 4, velocity, acceleration) and 23 for each contact (activation, pose 4 ×
//! 4, force).

use crate::arrays::{Array, class, matrix, numbers, output, writable};
use condyle::dynamics::{ROTATION_ROUNDING, unit_fault};
use condyle::spatial::Mat3;
use condyle::wholebody::References;
use condyle::{Force, Model, Motion, Se3, Vec3};
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// The sizes nq and nv, the number of frames and the number of contacts.
pub(super) type Sizes = (usize, usize, usize, usize);

pub(super) fn sizes(references: &References) -> Sizes {
    let posture = &references.posture;
    (posture.q.len(), posture.v.len(), references.frames.len(), references.contacts.len())
}

fn count((nq, nv, frames, contacts): Sizes) -> usize {
    15 + nq + 2 * nv + 28 * frames + 23 * contacts
}

/// A reader that takes numbers from the front of a slice.
struct Reader<'a>(&'a [f64]);

impl Reader<'_> {
    fn array<const N: usize>(&mut self) -> [f64; N] {
        let (first, rest) = self.0.split_first_chunk().expect("has as many numbers as its sizes say");
        self.0 = rest;
        *first
    }

    fn three(&mut self) -> Vec3<f64> {
        self.array::<3>().into()
    }

    fn fill(&mut self, to: &mut [f64]) {
        let (first, rest) = self.0.split_at(to.len());
        to.copy_from_slice(first);
        self.0 = rest;
    }

    fn pose(&mut self) -> Se3<f64> {
        let m = self.array::<16>();
        let column = |c: usize| [m[c], m[4 + c], m[8 + c]].into();
        Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3))
    }
}

/// A writer that puts numbers at the front of a slice.
struct Writer<'a>(&'a mut [f64]);

impl<'a> Writer<'a> {
    fn front(&mut self, count: usize) -> &'a mut [f64] {
        let (first, rest) = std::mem::take(&mut self.0).split_at_mut(count);
        self.0 = rest;
        first
    }

    fn put(&mut self, numbers: &[f64]) {
        self.front(numbers.len()).copy_from_slice(numbers);
    }

    fn pose(&mut self, pose: &Se3<f64>) {
        pose.write(self.front(16));
    }
}

fn read_numbers(numbers: &[f64], out: &mut References) {
    let mut from = Reader(numbers);
    let com = &mut out.com;
    (com.position, com.velocity, com.acceleration) = (from.three(), from.three(), from.three());
    (out.momentum.momentum, out.momentum.rate) = (from.three(), from.three());
    from.fill(&mut out.posture.q);
    from.fill(&mut out.posture.v);
    from.fill(&mut out.posture.a);
    for frame in &mut out.frames {
        frame.pose = from.pose();
        (frame.velocity, frame.acceleration) = (Motion::from(from.array()), Motion::from(from.array()));
    }
    for contact in &mut out.contacts {
        [contact.activation] = from.array();
        (contact.pose, contact.force) = (from.pose(), Force::from(from.array()));
    }
}

fn write_numbers(references: &References, numbers: &mut [f64]) {
    let mut to = Writer(numbers);
    let (com, momentum, posture) = (&references.com, &references.momentum, &references.posture);
    for vector in [com.position, com.velocity, com.acceleration, momentum.momentum, momentum.rate] {
        to.put(&vector.to_array());
    }
    for numbers in [&posture.q, &posture.v, &posture.a] {
        to.put(numbers);
    }
    for frame in &references.frames {
        to.pose(&frame.pose);
        to.put(&frame.velocity.to_array());
        to.put(&frame.acceleration.to_array());
    }
    for contact in &references.contacts {
        to.put(&[contact.activation]);
        to.pose(&contact.pose);
        to.put(&contact.force.to_array());
    }
}

/// Returns the array of `References`, after a check that the references were made for these sizes.
fn its_numbers<'py>(given: &Bound<'py, PyAny>, expected: Sizes) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let py = given.py();
    if !given.is_exact_instance(class!(py, "condyle._wholebody", "References")?) {
        let found = given.get_type().name()?;
        return Err(PyTypeError::new_err(format!("references: expected References, found '{found}'")));
    }
    let found: Sizes = given.getattr("_sizes")?.extract()?;
    if found != expected {
        let text = |(nq, nv, frames, contacts)| format!("nq = {nq}, nv = {nv}, {frames} frames, {contacts} contacts");
        let message = format!("references: expected those of {}, found those of {}", text(expected), text(found));
        return Err(PyValueError::new_err(message));
    }
    let numbers = given.getattr("_numbers")?.cast_into::<PyArrayDyn<f64>>()?;
    let (n, m) = (count(expected), numbers.len()?);
    if m == n {
        return Ok(numbers);
    }
    let message = format!("references: expected {n} numbers, found {m}; create them with controller.hold(q)");
    Err(PyValueError::new_err(message))
}

/// Reads references that were made for the same robot, frames and contacts.
pub(super) fn read(given: &Bound<'_, PyAny>, out: &mut References) -> PyResult<()> {
    let numbers = its_numbers(given, sizes(out))?.try_readonly()?;
    read_numbers(numbers.as_slice()?, out);
    Ok(())
}

/// Overwrites references that were made for the same robot, frames and contacts.
pub(super) fn write(references: &References, given: &Bound<'_, PyAny>) -> PyResult<()> {
    let array = its_numbers(given, sizes(references))?;
    write_numbers(references, writable(&array)?.as_slice_mut()?);
    Ok(())
}

/// Converts references of a robot to a Python object.
pub(super) fn give<'py>(py: Python<'py>, model: &Model, references: &References) -> PyResult<Bound<'py, PyAny>> {
    let rotations: Vec<_> = model.rotations().map(|(joint, range)| (joint, range.start, range.end)).collect();
    let rotations = PyTuple::new(py, rotations)?;
    let sizes = sizes(references);
    let numbers = output(py, None, &[count(sizes)], |out| write_numbers(references, out))?;
    class!(py, "condyle._wholebody", "References")?.call1((sizes, numbers, rotations))
}

/// Raises `ValueError` if the rotation in a pose, which is a (4, 4) matrix, is not valid.
#[pyfunction]
#[pyo3(name = "_check_pose")]
pub(crate) fn check_pose(name: &str, pose: &Bound<'_, PyAny>) -> PyResult<()> {
    let error = Reader(&matrix(name, pose, [4, 4])?).pose().rotation.rotation_error();
    if error <= ROTATION_ROUNDING {
        return Ok(());
    }
    let message = format!("{name}: no rotation: off by {error}, at most {ROTATION_ROUNDING} is allowed");
    Err(PyValueError::new_err(message))
}

/// Raises `ValueError` if a quaternion or a pair (cos, sin) in a position does not have length 1. The caller gives the
/// joint of each quaternion or pair, and its range in q.
#[pyfunction]
#[pyo3(name = "_check_rotations")]
pub(crate) fn check_rotations(
    name: &str,
    q: &Bound<'_, PyAny>,
    rotations: Vec<(String, usize, usize)>,
) -> PyResult<()> {
    let q = numbers(name, q)?;
    for (joint, first, end) in rotations {
        let range = if first <= end && end <= q.len() { first..end } else { 0..0 };
        if let Some(fault) = unit_fault(0, range, &q) {
            return Err(PyValueError::new_err(format!("{name}: joint `{joint}`: {fault}")));
        }
    }
    Ok(())
}
