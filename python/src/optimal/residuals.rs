//! Residuals of robots, which costs minimise or limits bound.

use super::cones::{FrictionCone, WrenchCone, surface};
use super::own::{Fault, Functions, MOST_SIZE, OwnFunction, Space, Way};
use crate::arrays::{array, class, found_type, numbers, pose, rotation, three};
use crate::exceptions::{ProblemError, within};
use crate::functions::{Argument, Reference};
use crate::model::{Model, frame_index, members_of};
use condyle::optimal::robot;
use condyle::{Force, Motion};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::sync::Arc;

/// A residual: a vector r(x, u) of a robot, which a `Cost` minimises or a `Limit` bounds.
///
/// A frame is given by its name or index in a model. A contact is given by its name in `ContactDynamics`,
/// `ContactInverseDynamics` or `ImpulseDynamics`. A residual stores the name of its frame. In a problem of another
/// robot, the residual uses the frame with the same name. A robot without such a frame is an error. A target that is
/// not given is zero; a target rotation is the identity.
///
/// >>> from condyle.optimal import Residual
/// >>> Residual.center_of_mass([0.4, 0.2, 0.5])
/// <condyle.optimal.Residual {"center_of_mass":{"target":{"x":0.4,"y":0.2,"z":0.5}}}>
#[pyclass(frozen, eq, module = "condyle.optimal")]
#[derive(Clone, PartialEq)]
pub(crate) struct Residual(Kind);

#[derive(Clone, PartialEq, Serialize, Deserialize)]
enum Kind {
    Given(robot::Residual),
    /// A Python function that returns a vector, with the number of entries of this vector.
    #[serde(skip)]
    Own(usize, Functions),
    /// A scalar cost, written in Python.
    #[serde(skip)]
    Number(Functions),
}

impl From<&OwnFunction> for Residual {
    fn from(own: &OwnFunction) -> Self {
        let functions = own.functions.clone();
        Self(if own.number { Kind::Number(functions) } else { Kind::Own(own.size, functions) })
    }
}

impl From<robot::Residual> for Residual {
    fn from(inner: robot::Residual) -> Self {
        Self(Kind::Given(inner))
    }
}

#[pymethods]
impl Residual {
    /// Returns the deviation of the state from a reference, r = x ⊖ reference, 2 nv numbers; reference = (q, v).
    #[staticmethod]
    fn state(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::State { reference: numbers("reference", reference)? }))
    }

    /// Returns the deviation of the controls from a reference, r = u − reference, nu numbers.
    #[staticmethod]
    fn control(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::Control { reference: numbers("reference", reference)? }))
    }

    /// Returns r = τ − g(q) + Jᵀλ, nv numbers, with joint efforts τ, gravity efforts g, contact forces λ and their
    /// Jacobian J. r is zero if efforts and contact forces hold the robot still.
    #[staticmethod]
    fn control_gravity() -> Self {
        Self::from(robot::Residual::ControlGravity)
    }

    /// Returns the deviation of the efforts of all joints from a reference, r = τ − reference, nv numbers.
    #[staticmethod]
    fn joint_effort(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::JointEffort { reference: numbers("reference", reference)? }))
    }

    /// Returns the efforts of inverse dynamics in the directions without actuators: r = Nᵀτ, where Nᵀ S = 0 with the
    /// actuation matrix S. For a floating base, these are 6 numbers, the force on the base. The efforts are 0 in a
    /// feasible motion.
    #[staticmethod]
    fn undriven_effort() -> Self {
        Self::from(robot::Residual::UndrivenEffort)
    }

    /// Returns the acceleration of a contact, r = J q̈ + γ as in `constrained_dynamics`: 1, 2, 3 or 6 numbers along the
    /// axes of the contact's rows. Only actions whose controls include the accelerations have this residual. The
    /// acceleration is 0 while the contact holds.
    #[staticmethod]
    fn contact_acceleration(contact: String) -> Self {
        Self::from(robot::Residual::ContactAcceleration { contact })
    }

    /// Returns the deviation of the joint accelerations from a reference, r = q̈ − reference, nv numbers.
    #[staticmethod]
    fn joint_acceleration(reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::JointAcceleration { reference: numbers("reference", reference)? }))
    }

    /// Returns the deviation of the centre of mass from a target, r = c − target, 3 numbers in the world (m).
    #[staticmethod]
    fn center_of_mass(target: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::CenterOfMass { target: three("target", target)? }))
    }

    /// Returns the deviation of the momentum about the centre of mass from a target, r = h − target, 6 numbers along
    /// the world's axes, linear first.
    #[staticmethod]
    #[pyo3(signature = (target=None))]
    fn centroidal_momentum(target: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::CentroidalMomentum { target: Force::from(six(target)?) }))
    }

    /// Returns the deviation of a frame's pose from a target, r = log(target⁻¹ oMf) with the pose oMf of the frame in
    /// the world, 6 numbers, linear first; target is a homogeneous 4 × 4 matrix.
    #[staticmethod]
    fn frame_placement(
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (frame, target) = (frame_name(model, frame)?, pose("target", target)?);
        Ok(Self::from(robot::Residual::FramePlacement { frame, target }))
    }

    /// Returns the deviation of a frame's origin from a target, r = p − target, 3 numbers in the world (m).
    #[staticmethod]
    fn frame_translation(
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (frame, target) = (frame_name(model, frame)?, three("target", target)?);
        Ok(Self::from(robot::Residual::FrameTranslation { frame, target }))
    }

    /// Returns the deviation of a frame's rotation R from a target, r = log(targetᵀ R), 3 numbers; target is a 3 × 3
    /// matrix.
    #[staticmethod]
    fn frame_rotation(model: &Bound<'_, Model>, frame: &Bound<'_, PyAny>, target: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (frame, target) = (frame_name(model, frame)?, rotation("target", target)?);
        Ok(Self::from(robot::Residual::FrameRotation { frame, target }))
    }

    /// Returns the deviation of a frame's velocity from a target in the frame's heading frame, r = Rz(ψ)ᵀ v − target, 6
    /// numbers: forwards, to the left and up, then the rates about these axes. ψ is the heading of the frame's x axis,
    /// and the z axis of the heading frame is vertical.
    ///
    /// With `tilt`, and `frame_translation` with the weights (0, 0, w) for the height, this describes a walk that does
    /// not depend on the place and the heading of the robot.
    #[staticmethod]
    #[pyo3(signature = (model, frame, target=None))]
    fn heading_velocity(
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (frame, target) = (frame_name(model, frame)?, Motion::from(six(target)?));
        Ok(Self::from(robot::Residual::HeadingVelocity { frame, target }))
    }

    /// Returns the tilt of a frame, r = Rᵀ e_z − up, 3 numbers: the vertical of the world along the frame's axes, minus
    /// its desired value, a unit vector. None is (0, 0, 1), an upright frame. r does not depend on the heading.
    #[staticmethod]
    #[pyo3(signature = (model, frame, up=None))]
    fn tilt(model: &Bound<'_, Model>, frame: &Bound<'_, PyAny>, up: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let up = up.map_or(Ok([0.0, 0.0, 1.0].into()), |up| three("up", up))?;
        Ok(Self::from(robot::Residual::Tilt { frame: frame_name(model, frame)?, up }))
    }

    /// Returns the deviation of a frame's velocity from a target, r = v − target, 6 numbers, linear first; reference:
    /// 'local', 'world' or 'local_world_aligned'.
    #[staticmethod]
    #[pyo3(signature = (model, frame, target=None, reference="local"))]
    fn frame_velocity(
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: Option<&Bound<'_, PyAny>>,
        reference: &str,
    ) -> PyResult<Self> {
        let (frame, target) = (frame_name(model, frame)?, Motion::from(six(target)?));
        let reference = Reference::read("reference", reference, &model.get().inner)?;
        Ok(Self::from(robot::Residual::FrameVelocity { frame, target, reference }))
    }

    /// Returns the signed distances between pairs of geometries, r = n·(p₁ − p₂) with the nearest points p₁ and p₂ and
    /// the unit normal n, one number for each pair (m). A distance is negative while the geometries overlap.
    ///
    /// pairs: a list of pairs of `Sphere`s or `condyle.distances.Geometry`s. At least one geometry of a pair is fixed
    ///     to a frame of the robot; the other one is fixed to the world, or to a frame of the same robot.
    ///
    /// within: a range r (m), above 0, or None for none: an entry is min(d, r). Pairs that are farther away cost
    ///     little, and have no derivatives. Give a range well above the bounds and the margin of an activation.
    ///
    /// A `Limit` or a `Cost` of this residual keeps the geometries apart: if no bounds or activation are given, all
    /// distances have the lower bound 0. For a margin, give `lower`. Limits apply only at knots. If the centres of a
    /// pair coincide, the direction from p₂ to p₁ is undefined, and the derivatives use the world's z axis instead.
    ///
    /// >>> from condyle.optimal import Limit, Residual, Sphere
    /// >>> tool, ball = Sphere([0.0, 0.0, 0.0], 0.05, "tool"), Sphere([0.4, 0.2, 0.5], 0.1)
    /// >>> clear = Limit("clear", Residual.distances(condyle.robots.arm7(), [(tool, ball)]), lower=[0.01])
    #[staticmethod]
    #[pyo3(signature = (model, pairs, within=None))]
    fn distances(model: &Bound<'_, Model>, pairs: &Bound<'_, PyAny>, within: Option<f64>) -> PyResult<Self> {
        let range = within.unwrap_or(f64::INFINITY);
        Ok(Self::from(robot::Residual::Distances { pairs: geometry_pairs(model, pairs)?, range }))
    }

    /// Returns the deviation of a contact's force or impulse from a target, r = λ − target, along the axes of the
    /// contact's rows: 1, 2, 3 or 6 numbers; target always has 6.
    #[staticmethod]
    #[pyo3(signature = (contact, target=None))]
    fn contact_force(contact: String, target: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::ContactForce { contact, target: Force::from(six(target)?) }))
    }

    /// Returns the rows r = A f of a friction cone, for a contact's force f.
    #[staticmethod]
    fn friction_cone(contact: String, cone: &Bound<'_, FrictionCone>) -> Self {
        Self::from(robot::Residual::FrictionCone { contact, cone: cone.get().0.clone() })
    }

    /// Returns the rows r = A w of a wrench cone, for a rigid contact's wrench w.
    #[staticmethod]
    fn wrench_cone(contact: String, cone: &Bound<'_, WrenchCone>) -> Self {
        Self::from(robot::Residual::WrenchCone { contact, cone: cone.get().0.clone() })
    }

    /// Returns the position of a rigid contact's centre of pressure relative to a rectangle: four numbers, all at most
    /// 0 while the centre of pressure is inside.
    ///
    /// size: the rectangle's sides along the surface's x and y (m); rotation: the surface's axes in the contact's axes,
    /// (3, 3).
    #[staticmethod]
    #[pyo3(signature = (contact, size, rotation=None))]
    fn center_of_pressure(contact: String, size: [f64; 2], rotation: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        Ok(Self::from(robot::Residual::CenterOfPressure { contact, rotation: surface(rotation)?, size }))
    }

    /// Returns the jump of the centre of mass's velocity at an impact: r = J_c (v⁺ − v), 3 numbers (m/s), with the
    /// Jacobian J_c of the centre of mass and the velocity v⁺ after the impact.
    #[staticmethod]
    fn impulse_center_of_mass() -> Self {
        Self::from(robot::Residual::ImpulseCenterOfMass)
    }

    /// Returns a residual r(t, x, u) that is written in Python; t is the index of the knot.
    ///
    /// size: the number of entries, at most 4096.
    /// calc: a function of (t, x, u) that returns r; x = (q, v); u is empty at the terminal knot.
    /// calc_diff: a function of (t, x, u) that returns (∂r/∂x, ∂r/∂u) of shapes (size, 2 nv) and (size, nu), in the
    ///     tangent space of the state. Without calc_diff, calc is differentiated as for `Action`.
    ///
    /// >>> from condyle.optimal import Residual
    /// >>> power = Residual.own(7, lambda t, x, u: x[7:] * u)
    #[staticmethod]
    #[pyo3(signature = (size, calc, calc_diff=None))]
    fn own(size: usize, calc: Py<PyAny>, calc_diff: Option<Py<PyAny>>) -> PyResult<Self> {
        Ok(Self(Kind::Own(within("size", size, 0, MOST_SIZE)?, Functions::new(calc, calc_diff)?)))
    }

    /// Returns a cost that is written in Python, as a residual of one entry: a number ℓ(t, x, u) with its own Hessian,
    /// where t is the index of the knot. The default activation of a `Cost` with this residual is `Activation.sum()`,
    /// so the term is weight · ℓ.
    ///
    /// calc: a function of (t, x, u) that returns ℓ; x = (q, v); u is empty at the terminal knot.
    /// calc_diff: a function of (t, x, u) that returns a dict of the nonzero arrays among q, r, Q, S, R: gradient and
    ///     Hessian of ℓ with respect to x, in the tangent space of the state, and to u. Without calc_diff, calc is
    ///     differentiated as for `Action`.
    ///
    /// For knots with such a cost, the sweep of `Fddp` does not use the inverse-dynamics form.
    ///
    /// >>> from condyle.optimal import Cost, Residual
    /// >>> swing = Cost("swing", 2.0, Residual.own_cost(lambda t, x, u: 1.0 - np.cos(x[0])))
    #[staticmethod]
    #[pyo3(signature = (calc, calc_diff=None))]
    fn own_cost(calc: Py<PyAny>, calc_diff: Option<Py<PyAny>>) -> PyResult<Self> {
        Ok(Self(Kind::Number(Functions::new(calc, calc_diff)?)))
    }

    /// Returns the residual as JSON, in the form in which the JSON of a problem contains it.
    fn __repr__(&self) -> String {
        match &self.0 {
            Kind::Given(inner) => {
                let json = serde_json::to_string(inner).expect("is made of numbers and words");
                format!("<condyle.optimal.Residual {json}>")
            }
            Kind::Own(size, _) => format!("<condyle.optimal.Residual of one's own, {size} numbers>"),
            Kind::Number(_) => "<condyle.optimal.Residual of one's own, a cost>".to_owned(),
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, class) = (slf.py(), slf.get_type());
        let make = |name: &str| class.getattr(name);
        Ok(match &slf.get().0 {
            Kind::Own(size, functions) => {
                let [calc, calc_diff] = functions.clones(py);
                (make("own")?, (*size, calc, calc_diff)).into_pyobject(py)?.into_any()
            }
            Kind::Number(functions) => {
                let [calc, calc_diff] = functions.clones(py);
                (make("own_cost")?, (calc, calc_diff)).into_pyobject(py)?.into_any()
            }
            given => {
                let text = serde_json::to_string(given).expect("is made of numbers and words");
                (make("_from_json")?, (text,)).into_pyobject(py)?.into_any()
            }
        })
    }

    #[staticmethod]
    fn _from_json(text: &str) -> PyResult<Self> {
        let wrong = |error| ProblemError::new_err(format!("no residual: {error}"));
        serde_json::from_str(text).map(Self).map_err(wrong)
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        match &self.0 {
            Kind::Own(_, functions) | Kind::Number(functions) => functions.traverse(&visit),
            Kind::Given(_) => Ok(()),
        }
    }

    fn __clear__(&self) {
        if let Kind::Own(_, functions) | Kind::Number(functions) = &self.0 {
            functions.clear();
        }
    }
}

impl Residual {
    /// Converts the residual to the library's type, for a robot.
    pub(super) fn of(&self, model: &Arc<condyle::Model>) -> robot::Residual {
        let (size, functions, number) = match &self.0 {
            Kind::Given(inner) => return inner.clone(),
            Kind::Own(size, functions) => (*size, functions.clone(), false),
            Kind::Number(functions) => (1, functions.clone(), true),
        };
        let (space, way, fault) = (Space::Robot(model.clone()), Way::default(), Fault::default());
        robot::Residual::Own(robot::OwnResidual::new(OwnFunction { size, number, functions, space, way, fault }))
    }

    /// Returns whether the residual is written in Python.
    pub(super) fn is_own(&self) -> bool {
        matches!(self.0, Kind::Own(..) | Kind::Number(_))
    }

    /// Returns whether the residual is a scalar cost.
    pub(super) fn is_number(&self) -> bool {
        matches!(self.0, Kind::Number(_))
    }

    /// Returns the residual's own bounds, which a cone, a centre of pressure and distances have.
    pub(super) fn bounds(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let Kind::Given(inner) = &self.0 else { return None };
        match inner {
            robot::Residual::FrictionCone { cone, .. } => Some(cone.bounds()),
            robot::Residual::WrenchCone { cone, .. } => Some(cone.bounds()),
            robot::Residual::CenterOfPressure { .. } => Some((vec![f64::NEG_INFINITY; 4], vec![0.0; 4])),
            robot::Residual::Distances { pairs, .. } => {
                Some((vec![0.0; pairs.len()], vec![f64::INFINITY; pairs.len()]))
            }
            _ => None,
        }
    }
}

/// Iterates over the residuals of a knot's costs and limits, always in the same order.
fn residuals_mut(knot: &mut robot::Knot) -> impl Iterator<Item = &mut robot::Residual> {
    let costs = knot.costs.iter_mut().chain(knot.costs_at.values_mut().flatten());
    let limits = knot.limits.iter_mut().chain(knot.limits_at.values_mut().flatten());
    costs.map(|robot::Cost { residual, .. }| residual).chain(limits.map(|robot::Limit { residual, .. }| residual))
}

/// Takes the residuals that are written in Python out of a knot, and returns these residuals with their indices. Then
/// the knot can be written as JSON.
pub(super) fn take_written(knot: &mut robot::Knot) -> Vec<(usize, Residual)> {
    let take = |(place, residual): (usize, &mut robot::Residual)| {
        let robot::Residual::Own(own) = residual else { return None };
        let own: &dyn Any = &**own;
        let written = Residual::from(own.downcast_ref::<OwnFunction>()?);
        *residual = robot::Residual::ImpulseCenterOfMass; // `put_written` replaces this placeholder
        Some((place, written))
    };
    residuals_mut(knot).enumerate().filter_map(take).collect()
}

/// Puts residuals that are written in Python back into a knot, at their indices.
pub(super) fn put_written(
    knot: &mut robot::Knot,
    model: &Arc<condyle::Model>,
    written: &[(usize, Bound<'_, Residual>)],
) -> PyResult<()> {
    let mut all: Vec<_> = residuals_mut(knot).collect();
    for (place, residual) in written {
        let to = all.get_mut(*place).ok_or_else(|| PyValueError::new_err("written: expected a residual's place"))?;
        **to = residual.get().of(model);
    }
    Ok(())
}

/// Returns the name of a frame in the form that a residual stores; the frame is given by name or by its index in the
/// model.
fn frame_name(model: &Bound<'_, Model>, frame: &Bound<'_, PyAny>) -> PyResult<robot::FrameName> {
    let model = &model.get().inner;
    Ok((&model.frames()[frame_index(model, frame)?]).into())
}

/// Reads a list of pairs of spheres or geometries.
pub(crate) fn geometry_pairs(model: &Bound<'_, Model>, pairs: &Bound<'_, PyAny>) -> PyResult<Vec<robot::GeometryPair>> {
    let pairs = members_of("pairs", "pairs of spheres", pairs)?;
    pairs.iter().enumerate().map(|(k, pair)| geometry_pair(model, k, pair)).collect()
}

/// Reads pair k of spheres or geometries.
fn geometry_pair(model: &Bound<'_, Model>, k: usize, pair: &Bound<'_, PyAny>) -> PyResult<robot::GeometryPair> {
    let wrong =
        || PyTypeError::new_err(format!("pairs[{k}]: expected a pair of geometries, found {}", found_type(pair)));
    let pair = pair.cast::<PyTuple>().map_err(|_| wrong())?;
    if pair.len() != 2 {
        return Err(PyTypeError::new_err(format!(
            "pairs[{k}]: expected two geometries, found a tuple of {}",
            pair.len()
        )));
    }
    let [first, second] = [0, 1].map(|side| geometry(model, &format!("pairs[{k}][{side}]"), &pair.get_item(side)?));
    Ok(robot::GeometryPair::new(first?, second?))
}

/// Reads a `Geometry` of `condyle.distances` or a `Sphere`; `name` names it in error messages.
fn geometry(model: &Bound<'_, Model>, name: &str, given: &Bound<'_, PyAny>) -> PyResult<robot::Geometry> {
    let module = given.py().import("condyle.distances")?;
    if !given.is_instance(&module.getattr("Geometry")?)? {
        return sphere(model, name, given);
    }
    let text: String = module.call_method1("_text", (model, given))?.extract()?;
    serde_json::from_str(&text).map_err(|error| PyValueError::new_err(format!("{name}: {error}")))
}

/// Reads a `Sphere` of `condyle._types`; `name` names the sphere in error messages.
fn sphere(model: &Bound<'_, Model>, name: &str, given: &Bound<'_, PyAny>) -> PyResult<robot::Geometry> {
    if !given.is_instance(class!(given.py(), "Sphere")?)? {
        return Err(PyTypeError::new_err(format!("{name}: expected a `Sphere`, found {}", found_type(given))));
    }
    let center = three(&format!("{name}.center"), &given.getattr("center")?)?;
    let (radius, frame) = (given.getattr("radius")?, given.getattr("frame")?);
    let wrong = |_| PyTypeError::new_err(format!("{name}.radius: expected a number, found {}", found_type(&radius)));
    let radius = radius.extract().map_err(wrong)?;
    let shape = robot::Shape::sphere(center, radius);
    Ok(if frame.is_none() {
        robot::Geometry::in_world(shape)
    } else {
        robot::Geometry::on(frame_name(model, &frame)?, shape)
    })
}

/// Reads six numbers, linear first; returns zeros if no numbers are given.
fn six(target: Option<&Bound<'_, PyAny>>) -> PyResult<[f64; 6]> {
    target.map_or(Ok([0.0; 6]), |given| array("target", given))
}
