//! Dynamics under constraints: one Python type or function for each type or function of the library.

use crate::arrays::{Give, array, class, found_type, named_tuples, numbers, pose, rotation};
use crate::data::{Holds, Scratch};
use crate::exceptions::{ModelError, exception, within, wrong_word};
use crate::functions::{Argument, Reference, functions, regular};
use crate::hyper_dual::Hyper;
use crate::made_for::MadeFor;
use crate::model::{Model, frame_index, members_of};
use condyle::{
    ContactConstraint, Motion, Scalar,
    constraints::{ConstraintKind, ProximalSettings, Target},
    tree::ModelConstraintKind,
};
use nalgebra::DMatrix;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice, PyTuple};
use std::sync::Arc;

named_tuples! {
    Constrained<'_> { a, lambda as lambda_, residual, redundant }
    ConstrainedDerivatives<'_> {
        a, lambda as lambda_, residual, redundant, da_dq, da_dv, da_dtau, dlambda_dq, dlambda_dv, dlambda_dtau, inertia
    }
    ConstrainedEquations<'_> {
        a, lambda as lambda_, residual, redundant, M, dtau_dq, dtau_dv, dgamma_dq, dgamma_dv
    }
    Impulse<'_> { v, lambda as lambda_, residual, redundant }
    ImpulseDerivatives<'_> {
        v, lambda as lambda_, residual, redundant, dv_dq, dv_dv, dlambda_dq, dlambda_dv, inertia
    }
}

/// Converts a `ContactConstraint` of `condyle._types` to the library's type.
pub(crate) fn constraint(model: &condyle::Model, given: &Bound<'_, PyAny>) -> PyResult<condyle::ContactConstraint> {
    if !given.is_instance(class!(given.py(), "ContactConstraint")?)? {
        let (found, coupling) = (found_type(given), class!(given.py(), "Coupling")?);
        let why = match given.is_instance(coupling)? {
            true => ": no constraint holds it; if it is linear, read the file with mimic=True",
            false => "",
        };
        return Err(PyTypeError::new_err(format!("constraints: expected `ContactConstraint`s, found {found}{why}")));
    }
    let optional = |name: &str| given.getattr(name).map(|x| (!x.is_none()).then_some(x));
    let frame = frame_index(model, &given.getattr("frame")?)?;
    let mut constraint = match given.getattr("kind")?.extract()? {
        "point" => condyle::ContactConstraint::point(frame),
        "rigid" => condyle::ContactConstraint::rigid(frame),
        "line" => condyle::ContactConstraint::line(frame),
        "plane" => condyle::ContactConstraint::plane(frame),
        other => return Err(wrong_word("kind", "'point', 'line', 'plane' or 'rigid'", other)),
    };
    if let Some(axes) = optional("axes")? {
        constraint.axes = rotation("axes", &axes)?;
    }
    constraint.other = optional("other")?.map(|other| frame_index(model, &other)).transpose()?;
    constraint.reference = Reference::read("reference", given.getattr("reference")?.extract()?, model)?;
    (constraint.kp, constraint.kp_axes) = gains(&given.getattr("kp")?)?;
    constraint.kd = given.getattr("kd")?.extract()?;
    let (placement, velocity) = (optional("placement")?, optional("velocity")?);
    aim(&mut constraint.target, placement.as_ref(), velocity.as_ref(), optional("acceleration")?.as_ref())?;
    Ok(constraint)
}

/// Reads the gain of the position error: a number, three linear gains, or three linear and three angular gains.
pub(crate) fn gains(kp: &Bound<'_, PyAny>) -> PyResult<(f64, Option<[f64; 6]>)> {
    if let Ok(kp) = kp.extract() {
        return Ok((kp, None));
    }
    let each = numbers("kp", kp)?;
    match *each.as_slice() {
        [x, y, z] => Ok((0.0, Some([x, y, z, 0.0, 0.0, 0.0]))),
        [x, y, z, a, b, c] => Ok((0.0, Some([x, y, z, a, b, c]))),
        _ => Err(PyValueError::new_err(format!("kp: expected a number, or 3 or 6 numbers, found {}", each.len()))),
    }
}

/// Returns the constraints of a model by name: `ContactConstraint`s and `Coupling`s of `condyle._types`.
pub(crate) fn of_model<'py>(py: Python<'py>, model: &condyle::Model) -> PyResult<Bound<'py, PyDict>> {
    let constraints = PyDict::new(py);
    let joint = |body: usize| &*model.bodies()[body].joint_name;
    // a frame is given by its index, not its name, if another frame has the same name
    let frame = |index: usize| -> PyResult<Bound<'py, PyAny>> {
        let name = &*model.frames()[index].name;
        if model.frame(name) == Ok(index) { name.into_bound_py_any(py) } else { index.into_bound_py_any(py) }
    };
    for constraint in model.constraints() {
        let given = match (ContactConstraint::of(constraint), &constraint.kind) {
            (Some(ContactConstraint { frame: one, other, kind, .. }), _) => {
                let kind = if kind == ConstraintKind::Rigid { "rigid" } else { "point" };
                class!(py, "ContactConstraint")?.call1((frame(one)?, kind, other.map(frame).transpose()?))?
            }
            (None, &ModelConstraintKind::Coupling { follower, leader, coefficients }) => {
                let coefficients = PyTuple::new(py, coefficients)?;
                class!(py, "Coupling")?.call1((joint(follower), leader.map(joint), coefficients))?
            }
            (None, _) => continue,
        };
        constraints.set_item(&constraint.name, given)?;
    }
    Ok(constraints)
}

/// Changes those members of a target that are given.
pub(crate) fn aim(
    target: &mut Target<f64>,
    placement: Option<&Bound<'_, PyAny>>,
    velocity: Option<&Bound<'_, PyAny>>,
    acceleration: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    if let Some(placement) = placement {
        target.placement = pose("placement", placement)?;
    }
    for (name, given, motion) in
        [("velocity", velocity, &mut target.velocity), ("acceleration", acceleration, &mut target.acceleration)]
    {
        if let Some(given) = given {
            *motion = Motion::from(array(name, given)?);
        }
    }
    Ok(())
}

/// Constraints of one model, contacts and loops, and the scratch memory of `constrained_dynamics` and similar
/// functions.
///
/// Make one set for each combination of contacts; all sets may share one `Data`. Only one thread at a time may use a
/// set.
///
/// With a regularisation μ > 0, the constraint forces λ solve (J M⁻¹ Jᵀ + μ 1) λ = b + μ λ'. J is the Jacobian of the
/// constraints, M the inertia matrix, and b the right-hand side without regularisation. In the first iteration λ' is 0;
/// in each later iteration λ' is the previous λ. Redundant constraints then share the forces, with the smallest norm of
/// λ. Choose μ small compared with J M⁻¹ Jᵀ, such as 1e-8. With μ = 0 one iteration is exact, and rows that depend on
/// earlier rows get no force. Source: Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of constrained
/// dynamic equations (2021).
///
/// model: the robot; constraints: a list of `ContactConstraint`s; mu: μ (1/kg); iterations: the number of iterations, 1
/// to 10000; all of them are computed.
///
/// Raises `ModelError` if a frame does not exist, two frames do not move relative to each other, or two constraints are
/// the same. Also raises `ModelError` if a reference frame is 'world', a gain is negative or not finite, a target is
/// not finite, or the placement of a target is not a homogeneous matrix.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> feet = [condyle.ContactConstraint(foot, "point") for foot in ("LF_foot", "RH_foot")]
/// >>> trot = condyle.ConstraintSet(quadruped, feet)
/// >>> len(trot), trot.rows, trot.range(1)
/// (2, 6, slice(3, 6, 1))
#[pyclass(module = "condyle")]
pub(crate) struct ConstraintSet {
    inner: condyle::ConstraintSet<f64>,
    /// The set of constraints for hyper-dual numbers. The set is made on first use, and again on first use after a
    /// change of the targets.
    dual: Option<Box<condyle::ConstraintSet<Hyper>>>,
    /// The constraints for many states in SIMD lanes, made on first use.
    lanes: Option<Box<condyle::batch::BatchConstraints>>,
    /// The constraints with their current targets.
    constraints: Vec<ContactConstraint>,
    nv: usize,
    made_for: MadeFor,
    /// The model for which the set was made.
    robot: Arc<condyle::Model>,
}

impl ConstraintSet {
    fn make(
        model: &Bound<'_, Model>,
        constraints: Vec<ContactConstraint>,
        proximal: ProximalSettings,
    ) -> PyResult<Self> {
        let (made_for, robot) = (MadeFor::with_geometry(model.get()), model.get().inner.clone());
        let mut inner = condyle::ConstraintSet::new(&robot, &constraints).map_err(exception)?;
        inner.proximal = proximal;
        Ok(Self { inner, dual: None, lanes: None, constraints, nv: robot.nv(), made_for, robot })
    }

    /// Returns the scratch memory of these constraints for many states in SIMD lanes. The memory has the size of the
    /// batch.
    pub(crate) fn side_by_side(
        &mut self,
        batch: &condyle::Batch,
        model: &condyle::Model,
    ) -> PyResult<&mut condyle::batch::BatchConstraints> {
        let fitting = self.lanes.take().filter(|lanes| lanes.fits(batch));
        let lanes = match fitting {
            Some(lanes) => lanes,
            None => Box::new(batch.constraints(model, &self.constraints, self.inner.proximal).map_err(exception)?),
        };
        Ok(self.lanes.insert(lanes))
    }

    fn checked(&self, k: usize) -> PyResult<usize> {
        let n = self.inner.len();
        let error = || PyIndexError::new_err(format!("k: expected less than {n}, found {k}"));
        (k < n).then_some(k).ok_or_else(error)
    }
}

impl Scratch for ConstraintSet {
    const ARGUMENT: &'static str = "constraints";
    fn made_for(&self) -> &MadeFor {
        &self.made_for
    }
}

impl Holds<f64> for ConstraintSet {
    type Held = condyle::ConstraintSet<f64>;
    fn held(&mut self, _: &condyle::Model) -> PyResult<&mut condyle::ConstraintSet<f64>> {
        Ok(&mut self.inner)
    }
}

impl Holds<Hyper> for ConstraintSet {
    type Held = condyle::ConstraintSet<Hyper>;
    fn held(&mut self, model: &condyle::Model) -> PyResult<&mut condyle::ConstraintSet<Hyper>> {
        if self.dual.is_none() {
            let mut dual = condyle::ConstraintSet::new(model, &self.constraints).map_err(exception)?;
            dual.proximal = self.inner.proximal;
            self.dual = Some(Box::new(dual));
        }
        Ok(self.dual.as_mut().expect("was just made"))
    }
}

#[pymethods]
impl ConstraintSet {
    #[new]
    #[pyo3(signature = (model, constraints, mu=0.0, iterations=1))]
    fn new(model: &Bound<'_, Model>, constraints: &Bound<'_, PyAny>, mu: f64, iterations: usize) -> PyResult<Self> {
        if !(mu.is_finite() && mu >= 0.0) {
            return Err(PyValueError::new_err(format!("mu: expected a number of at least 0, found {mu}")));
        }
        within("iterations", iterations, 1, 10_000)?;
        let constraints = members_of("constraints", "`ContactConstraint`s", constraints)?;
        let robot = &model.get().inner;
        let constraints = constraints.iter().map(|c| constraint(robot, c)).collect::<PyResult<Vec<_>>>()?;
        Self::make(model, constraints, ProximalSettings { mu, iterations })
    }

    /// Returns the function and the arguments from which `pickle` makes an equal set. The current targets are included.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let this = slf.borrow();
        let ProximalSettings { mu, iterations } = this.inner.proximal;
        let text = serde_json::to_string(&this.constraints)
            .map_err(|error| ModelError::new_err(format!("these constraints cannot be pickled: {error}")))?;
        let arguments = (Model::from((*this.robot).clone()), text, mu, iterations);
        Ok((slf.get_type().getattr("_from_json")?, arguments).into_pyobject(slf.py())?.into_any())
    }

    #[staticmethod]
    fn _from_json(model: &Bound<'_, Model>, text: &str, mu: f64, iterations: usize) -> PyResult<Self> {
        let wrong = |error| ModelError::new_err(format!("no constraints: {error}"));
        let constraints = serde_json::from_str(text).map_err(wrong)?;
        Self::make(model, constraints, ProximalSettings { mu, iterations })
    }

    /// Returns the robot's name, and the numbers of constraints and rows.
    fn __repr__(&self) -> String {
        let (robot, n, rows) = (&self.made_for.name, self.inner.len(), self.inner.rows());
        format!("<condyle.ConstraintSet of '{robot}': {n} constraints, {rows} rows>")
    }

    /// Returns the number of constraints.
    fn __len__(&self) -> usize {
        self.inner.len()
    }

    /// The number of rows of J, which is also the length of λ.
    #[getter]
    fn rows(&self) -> usize {
        self.inner.rows()
    }

    /// Returns the rows of constraint k, as a slice.
    fn range<'py>(&self, py: Python<'py>, k: usize) -> PyResult<Bound<'py, PySlice>> {
        let range = self.inner.range(self.checked(k)?);
        Ok(PySlice::new(py, range.start as isize, range.end as isize, 1))
    }

    /// Changes the target of constraint k: placement, velocity and acceleration of the constraint's frame. Members that
    /// are not given do not change.
    ///
    /// Raises `ModelError` for numbers that are not finite and for an invalid placement; then the old target is kept.
    #[pyo3(signature = (k, placement=None, velocity=None, acceleration=None))]
    fn set_target(
        &mut self,
        k: usize,
        placement: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        acceleration: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let k = self.checked(k)?;
        let mut target = self.inner.target(k);
        aim(&mut target, placement, velocity, acceleration)?;
        self.inner.set_target(k, target).map_err(exception)?;
        if let Some(lanes) = &mut self.lanes {
            lanes.set_target(k, target).map_err(exception)?;
        }
        self.constraints[k].target = target;
        self.dual = None;
        Ok(())
    }

    /// Returns the Jacobian J of the constraints, (rows, nv), at the state of the last call for a single state.
    #[pyo3(signature = (out=None))]
    fn jacobian<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let mut J = DMatrix::zeros(self.inner.rows(), self.nv);
        self.inner.jacobian(&mut J);
        J.give(py, out)
    }
}

functions! {
/// Computes the acceleration q̈ = M⁻¹ (τ − h + Jᵀ λ + Σ Jᵢᵀ f_ext,i) and the forces λ that make J q̈ + γ = 0 (forward
/// dynamics under constraints), as `Constrained(a, lambda_, residual, redundant)`. J is the Jacobian of the
/// constraints. γ contains J̇ v, the stabilisation, and the constraints' target accelerations with a minus sign.
///
/// constraints: a `ConstraintSet`; q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as
/// for `rnea`. If constraints contradict each other, or a constraint cannot be satisfied at a singular posture, the
/// results are finite and `residual` is above zero.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), np.zeros(18)
/// >>> feet = [condyle.ContactConstraint(foot, "point", kd=10.0) for foot in ("LF_foot", "RH_foot")]
/// >>> stance = condyle.ConstraintSet(quadruped, feet)
/// >>> a, forces, residual, redundant = condyle.constrained_dynamics(quadruped, data, stance, q, zero, zero)
/// >>> bool(residual < 1e-9), redundant, np.allclose(stance.jacobian() @ a, 0.0)
/// (True, 0.0, True)
fn constrained_dynamics(model, data, constraints: ConstraintSet;
    q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    regular(model)?;
    condyle::constrained_dynamics(model, data, constraints, &q, &v, &tau, &f_ext)
}
batch b, constraints: regular(q: Position, v: Tangent, tau: Tangent, f_ext: Forces) -> Named("Constrained") {
    b.constrained_dynamics(model, constraints, q, v, tau, f_ext)
}

/// Computes the result of `constrained_dynamics` and its exact derivatives with respect to q, v and τ, as
/// `ConstrainedDerivatives`.
///
/// constraints: a `ConstraintSet`, whose targets are fixed; q: position, nq numbers; v, tau: velocity and efforts, nv
/// numbers each; f_ext: as for `rnea`, constant in the bodies' frames. ∂/∂q is taken in the tangent space. out: one
/// array for each member, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> touch = condyle.ConstraintSet(arm, [condyle.ContactConstraint("tool", "point")])
/// >>> d = condyle.constrained_dynamics_derivatives(arm, condyle.Data(arm), touch, [0.3] * 7, [0.1] * 7, [1.0] * 7)
/// >>> np.allclose(touch.jacobian() @ d.da_dtau, 0.0)  # no effort moves the point
/// True
fn constrained_dynamics_derivatives(model, data, constraints: ConstraintSet;
    q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    regular(model)?;
    condyle::constrained_dynamics_derivatives(model, data, constraints, &q, &v, &tau, &f_ext)
}
batch b, constraints: regular(q: Position, v: Tangent, tau: Tangent, f_ext: Forces) -> Named("ConstrainedDerivatives") {
    b.constrained_dynamics_derivatives(model, constraints, q, v, tau, f_ext)
}

/// Computes the result of `constrained_dynamics` and the linear equations that relate changes of q, v and τ to the
/// changes of q̈ and λ, as `ConstrainedEquations`:
///
///     M δq̈ − Jᵀ δλ + ∂τ/∂q δq + ∂τ/∂v δv = δτ,    J δq̈ + ∂γ/∂q δq + ∂γ/∂v δv = 0
///
/// Symbols are as for `constrained_dynamics`. `constrained_dynamics_derivatives` solves these equations; this function
/// does not solve them. constraints: a `ConstraintSet`, whose targets are fixed and whose `jacobian` is J; q: position,
/// nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`, constant in the bodies' frames.
/// ∂/∂q is taken in the tangent space.
/// out: one array for each member, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, touch = condyle.Data(arm), condyle.ConstraintSet(arm, [condyle.ContactConstraint("tool", "point")])
/// >>> d = condyle.constrained_dynamics_equations(arm, data, touch, [0.3] * 7, [0.1] * 7, [1.0] * 7)
/// >>> np.allclose(d.M, condyle.crba(arm, data, [0.3] * 7))
/// True
fn constrained_dynamics_equations(model, data, constraints: ConstraintSet;
    q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    regular(model)?;
    condyle::constraints::constrained_dynamics_equations(model, data, constraints, &q, &v, &tau, &f_ext)
}
batch b, constraints: regular(q: Position, v: Tangent, tau: Tangent, f_ext: Forces) -> Named("ConstrainedEquations") {
    b.constrained_dynamics_equations(model, constraints, q, v, tau, f_ext)
}

/// Computes the velocity v⁺ = v + M⁻¹ Jᵀ Λ after an impact, with the impulses Λ that make J v⁺ = −ε J v, as `Impulse(v,
/// lambda_, residual, redundant)`. J is the Jacobian of the constraints, and M the inertia matrix.
///
/// constraints: a `ConstraintSet`, whose gains and targets of velocity and acceleration are ignored; q: position, nq
/// numbers; v: velocity, nv numbers; restitution: ε, 0 for frames that stick, 1 for an impact that loses no energy.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> touchdown = condyle.ConstraintSet(quadruped, [condyle.ContactConstraint("LF_foot", "point")])
/// >>> q, falling = condyle.neutral(quadruped), np.eye(18)[2] * -1.0
/// >>> after = condyle.impulse_dynamics(quadruped, condyle.Data(quadruped), touchdown, q, falling)
/// >>> bool(after.lambda_[2] > 0.0)  # the ground pushes upwards
/// True
fn impulse_dynamics(model, data, constraints: ConstraintSet;
    q: Position, v: Tangent, restitution: Coefficient = 0.0; out) {
    regular(model)?;
    condyle::constraints::impulse_dynamics(model, data, constraints, &q, &v, Scalar::splat(restitution))
}
batch b, constraints: regular(q: Position, v: Tangent; restitution: Coefficient) -> Named("Impulse") {
    b.impulse_dynamics(model, constraints, q, v, restitution)
}

/// Computes the result of `impulse_dynamics` and its exact derivatives with respect to q and the velocity before the
/// impact, as `ImpulseDerivatives`.
///
/// constraints, q, v, restitution: as for `impulse_dynamics`. ∂/∂q is taken in the tangent space. out: one array for
/// each member, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> hit = condyle.ConstraintSet(arm, [condyle.ContactConstraint("tool", "point")])
/// >>> d = condyle.impulse_dynamics_derivatives(arm, condyle.Data(arm), hit, [0.3] * 7, [0.1] * 7)
/// >>> np.allclose(d.dv_dv @ d.dv_dv, d.dv_dv)  # an impact that sticks is a projection
/// True
fn impulse_dynamics_derivatives(model, data, constraints: ConstraintSet;
    q: Position, v: Tangent, restitution: Coefficient = 0.0; out) {
    regular(model)?;
    condyle::constraints::impulse_dynamics_derivatives(model, data, constraints, &q, &v, Scalar::splat(restitution))
}
batch b, constraints: regular(q: Position, v: Tangent; restitution: Coefficient) -> Named("ImpulseDerivatives") {
    b.impulse_dynamics_derivatives(model, constraints, q, v, restitution)
}
}
