//! Dynamics under constraints: the library's types and functions one to one.

use crate::arrays::{Give, Number, members, named_tuple, pose, vector};
use crate::data::{Data, scratch};
use crate::exceptions::exception;
use crate::functions::{Argument, Coefficient, Forces, Position, Reference, Tangent, regular, wrong_word};
use crate::hyper_dual::Hyper;
use crate::model::{Model, frame_index};
use condyle::{Constraint, Error, Motion, Proximal, Scalar, Target};
use nalgebra::DMatrix;
use pyo3::exceptions::{PyIndexError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PySlice, PyTuple, PyType};

/// A struct of the library as the named tuple of `condyle._types` with the same name and members, but that λ is
/// `lambda_`.
macro_rules! results {
    ($($type:ident { $($member:ident),* })*) => {$(
        impl<S: Number + Give> Give for condyle::$type<'_, S> {
            fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
                static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
                let names = [$(stringify!($member)),*].map(|name| if name == "lambda" { "lambda_" } else { name });
                let mut out = members(out, &names)?.into_iter();
                let members = [$(self.$member.give(py, out.next().flatten().as_ref())?),*];
                named_tuple(py, &CLASS, stringify!($type))?.call1(PyTuple::new(py, members)?)
            }
        }
    )*};
}
results! {
    Constrained { a, lambda, residual, redundant }
    ConstrainedDerivatives {
        a, lambda, residual, redundant, da_dq, da_dv, da_dtau, dlambda_dq, dlambda_dv, dlambda_dtau, inertia
    }
    ConstrainedEquations { a, lambda, residual, redundant, M, dtau_dq, dtau_dv, dgamma_dq, dgamma_dv }
    Impulse { v, lambda, residual, redundant }
    ImpulseDerivatives { v, lambda, residual, redundant, dv_dq, dv_dv, dlambda_dq, dlambda_dv, inertia }
}

/// A `Constraint` of `condyle._types`.
pub(crate) fn constraint(model: &condyle::Model, given: &Bound<'_, PyAny>) -> PyResult<condyle::Constraint> {
    let optional = |name: &str| given.getattr(name).map(|x| (!x.is_none()).then_some(x));
    let frame = frame_index(model, &given.getattr("frame")?)?;
    let mut constraint = match given.getattr("kind")?.extract()? {
        "point" => condyle::Constraint::point(frame),
        "rigid" => condyle::Constraint::rigid(frame),
        other => return Err(wrong_word("kind", "'point' or 'rigid'", other)),
    };
    constraint.other = optional("other")?.map(|other| frame_index(model, &other)).transpose()?;
    constraint.reference = Reference::read("reference", given.getattr("reference")?.extract()?, model)?;
    constraint.kp = given.getattr("kp")?.extract()?;
    constraint.kd = given.getattr("kd")?.extract()?;
    let (placement, velocity) = (optional("placement")?, optional("velocity")?);
    aim(&mut constraint.target, placement.as_ref(), velocity.as_ref(), optional("acceleration")?.as_ref())?;
    Ok(constraint)
}

/// Changes what is given of a target.
fn aim(
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
            let x = vector(name, given, 6)?;
            *motion = Motion::from(core::array::from_fn(|k| x[k]));
        }
    }
    Ok(())
}

/// Constraints of one model: contacts and loops, and the scratch of `constrained_dynamics` and its like.
///
/// Make one set for each combination of contacts; the `Data` can be the same for all sets. As a `Data`, a set serves
/// one thread at a time.
///
/// With μ > 0 the forces solve (J M⁻¹ Jᵀ + μ 1) λ = b + μ λ', first with λ' = 0, then again with the λ just found, so
/// that redundant constraints share the smallest forces; μ is small beside J M⁻¹ Jᵀ, as 1e-8. With μ = 0 one iteration
/// is exact, and rows that depend on earlier ones get no force. Source: Carpentier, Budhiraja, Mansard, Proximal and
/// sparse resolution of constrained dynamic equations (2021).
///
/// model: the robot; constraints: a list of `Constraint`s; mu: μ (1/kg); iterations: how many there are, always.
///
/// Raises `ModelError` if a frame does not exist, two frames do not move relative to each other, a reference frame is
/// 'world', a gain is negative or not finite, or two constraints are the same.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> trot = condyle.ConstraintSet(quadruped, [condyle.Constraint(foot, "point") for foot in ("LF_foot", "RH_foot")])
/// >>> len(trot), trot.rows, trot.range(1)
/// (2, 6, slice(3, 6, 1))
#[pyclass(module = "condyle")]
pub(crate) struct ConstraintSet {
    inner: condyle::ConstraintSet<f64>,
    /// For hyper-dual numbers, once they were asked for since the targets last changed.
    dual: Option<Box<condyle::ConstraintSet<Hyper>>>,
    /// With their present targets.
    constraints: Vec<Constraint>,
    nv: usize,
    structure: u64,
}

impl ConstraintSet {
    fn checked(&self, k: usize) -> PyResult<usize> {
        let n = self.inner.len();
        let error = || PyIndexError::new_err(format!("k: expected less than {n}, found {k}"));
        (k < n).then_some(k).ok_or_else(error)
    }
}

/// The set for one kind of number.
trait Constrain: Number {
    fn set<'s>(
        set: &'s mut ConstraintSet,
        model: &condyle::Model,
    ) -> Result<&'s mut condyle::ConstraintSet<Self>, Error>;
}

impl Constrain for f64 {
    fn set<'s>(set: &'s mut ConstraintSet, _: &condyle::Model) -> Result<&'s mut condyle::ConstraintSet<Self>, Error> {
        Ok(&mut set.inner)
    }
}

impl Constrain for Hyper {
    fn set<'s>(
        set: &'s mut ConstraintSet,
        model: &condyle::Model,
    ) -> Result<&'s mut condyle::ConstraintSet<Self>, Error> {
        if set.dual.is_none() {
            let mut dual = condyle::ConstraintSet::new(model, &set.constraints)?;
            dual.proximal = set.inner.proximal;
            set.dual = Some(Box::new(dual));
        }
        Ok(set.dual.as_mut().expect("was just made"))
    }
}

#[pymethods]
impl ConstraintSet {
    #[new]
    #[pyo3(signature = (model, constraints, mu=0.0, iterations=1))]
    fn new(model: &Bound<'_, Model>, constraints: Vec<Bound<'_, PyAny>>, mu: f64, iterations: usize) -> PyResult<Self> {
        if !(mu.is_finite() && mu >= 0.0) {
            return Err(PyValueError::new_err(format!("mu: expected a number of at least 0, found {mu}")));
        }
        let Model { inner: model, structure } = model.get();
        let constraints = constraints.iter().map(|c| constraint(model, c)).collect::<PyResult<Vec<_>>>()?;
        let mut inner = condyle::ConstraintSet::new(model, &constraints).map_err(exception)?;
        inner.proximal = Proximal { mu, iterations };
        Ok(Self { inner, dual: None, constraints, nv: model.nv(), structure: *structure })
    }

    /// How many constraints there are.
    fn __len__(&self) -> usize {
        self.inner.len()
    }

    /// How many rows J has, and λ numbers.
    #[getter]
    fn rows(&self) -> usize {
        self.inner.rows()
    }

    /// The rows of constraint k, as a slice.
    fn range<'py>(&self, py: Python<'py>, k: usize) -> PyResult<Bound<'py, PySlice>> {
        let range = self.inner.range(self.checked(k)?);
        Ok(PySlice::new(py, range.start as isize, range.end as isize, 1))
    }

    /// Changes where constraint k wants its frame to be, and how it should move there: what is given, as in
    /// `Constraint`.
    #[pyo3(signature = (k, placement=None, velocity=None, acceleration=None))]
    fn set_target(
        &mut self,
        k: usize,
        placement: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        acceleration: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let k = self.checked(k)?;
        aim(self.inner.target_mut(k), placement, velocity, acceleration)?;
        self.constraints[k].target = *self.inner.target_mut(k);
        self.dual = None;
        Ok(())
    }

    /// J, (rows, nv), as the last call left it.
    #[pyo3(signature = (out=None))]
    fn jacobian<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let mut J = DMatrix::zeros(self.inner.rows(), self.nv);
        self.inner.jacobian(&mut J);
        J.give(py, out)
    }
}

/// The set for a call, if it is this model's and free.
fn set<'py>(model: &Model, constraints: &Bound<'py, ConstraintSet>) -> PyResult<PyRefMut<'py, ConstraintSet>> {
    let busy = "constraints: in use by another call; give each thread a ConstraintSet of its own";
    let set = constraints.try_borrow_mut().map_err(|_| PyRuntimeError::new_err(busy))?;
    if set.structure != model.structure {
        let name = model.inner.name();
        return Err(PyValueError::new_err(format!("constraints: made for another model, not for this '{name}'")));
    }
    Ok(set)
}

/// Declares functions of a model, a `Data` and a set of constraints.
macro_rules! constrained {
    ($(
        $(#[$doc:meta])*
        fn $name:ident($model:ident, $data:ident, $constraints:ident;
            $($arg:ident: $kind:ident $(= $default:tt)?),*; $out:ident) $body:block
    )*) => {$(
        $(#[$doc])*
        #[pyfunction]
        #[pyo3(signature = ($model, $data, $constraints, $($arg $(= $default)?,)* $out=None))]
        pub(crate) fn $name<'a, 'py: 'a>(
            $model: &'a Bound<'py, Model>,
            $data: &'a Bound<'py, Data>,
            $constraints: &'a Bound<'py, ConstraintSet>,
            $($arg: <$kind as Argument<'a, 'py>>::Given,)*
            $out: Option<&'a Bound<'py, PyAny>>,
        ) -> PyResult<Bound<'py, PyAny>> {
            let (py, robot) = ($model.py(), $model.get());
            let (mut scratch, mut set) = (scratch(robot, $data)?, set(robot, $constraints)?);
            let $model = &robot.inner;
            regular($model)?;
            let dual = [$(<$kind as Argument<'_, '_>>::is_dual(&$arg)),*].contains(&true);
            // the same source for doubles and for hyper-dual numbers
            macro_rules! call {
                ($S:ty) => {{
                    let $data = <$S>::scratch(&mut scratch, $model);
                    let $constraints = <$S>::set(&mut set, $model).map_err(exception)?;
                    let result = {
                        $(let $arg = <$kind as Argument<'_, '_>>::read_at::<$S>(
                            stringify!($arg), &$arg, $model, None,
                        )?;)*
                        $body
                    };
                    result.give(py, $out)
                }};
            }
            if dual { call!(Hyper) } else { call!(f64) }
        }
    )*};
}

constrained! {
/// q̈ = M⁻¹ (τ − h + Jᵀ λ + Σ Jᵢᵀ f_ext,i) with the forces λ that make J q̈ + γ = 0: forward dynamics under
/// constraints, as `Constrained(a, lambda_, residual, redundant)`.
///
/// constraints: a `ConstraintSet`; q: nq numbers; v, tau: nv; f_ext: as for `rnea`. Constraints that contradict each
/// other, or themselves at a singular posture, give finite numbers and a residual.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), np.zeros(18)
/// >>> feet = [condyle.Constraint(foot, "point", kd=10.0) for foot in ("LF_foot", "RH_foot")]
/// >>> stance = condyle.ConstraintSet(quadruped, feet)
/// >>> a, forces, residual, redundant = condyle.constrained_dynamics(quadruped, data, stance, q, zero, zero)
/// >>> bool(residual < 1e-9), redundant, np.allclose(stance.jacobian() @ a, 0.0)
/// (True, 0.0, True)
fn constrained_dynamics(model, data, constraints;
    q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    condyle::constrained_dynamics(model, data, constraints, &q, &v, &tau, &f_ext)
}

/// `constrained_dynamics` and its derivatives with respect to q, v and τ, exact, as `ConstrainedDerivatives`.
///
/// constraints: a `ConstraintSet`, whose targets are fixed; q: nq numbers; v, tau: nv; f_ext: as for `rnea`, moving
/// with the bodies. ∂/∂q is taken in the tangent space. out: as many arrays as there are members, such as an earlier
/// result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> touch = condyle.ConstraintSet(arm, [condyle.Constraint("tool", "point")])
/// >>> d = condyle.constrained_dynamics_derivatives(arm, condyle.Data(arm), touch, [0.3] * 7, [0.1] * 7, [1.0] * 7)
/// >>> np.allclose(touch.jacobian() @ d.da_dtau, 0.0)  # no effort moves the point
/// True
fn constrained_dynamics_derivatives(model, data, constraints;
    q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    condyle::constrained_dynamics_derivatives(model, data, constraints, &q, &v, &tau, &f_ext)
}

/// `constrained_dynamics` and the linear equations between changes of q, v, τ and of the q̈ and λ that follow, as
/// `ConstrainedEquations`:
///
///     M δq̈ − Jᵀ δλ + ∂τ/∂q δq + ∂τ/∂v δv = δτ,    J δq̈ + ∂γ/∂q δq + ∂γ/∂v δv = 0
///
/// What `constrained_dynamics_derivatives` solves; nothing is inverted here. constraints: a `ConstraintSet`, whose
/// targets are fixed and whose `jacobian` is J; q: nq numbers; v, tau: nv; f_ext: as for `rnea`, moving with the
/// bodies. ∂/∂q is taken in the tangent space. out: as many arrays as there are members, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, touch = condyle.Data(arm), condyle.ConstraintSet(arm, [condyle.Constraint("tool", "point")])
/// >>> d = condyle.constrained_dynamics_equations(arm, data, touch, [0.3] * 7, [0.1] * 7, [1.0] * 7)
/// >>> np.allclose(d.M, condyle.crba(arm, data, [0.3] * 7))
/// True
fn constrained_dynamics_equations(model, data, constraints;
    q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    condyle::constrained_dynamics_equations(model, data, constraints, &q, &v, &tau, &f_ext)
}

/// v⁺ = v + M⁻¹ Jᵀ Λ with the impulses Λ that make J v⁺ = −ε J v: the velocity after an impact, as
/// `Impulse(v, lambda_, residual, redundant)`.
///
/// constraints: a `ConstraintSet`, of which gains, velocities and accelerations do not count; q: nq numbers; v: nv;
/// restitution: ε, 0 for frames that stick, 1 for an impact that loses no energy.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> touchdown = condyle.ConstraintSet(quadruped, [condyle.Constraint("LF_foot", "point")])
/// >>> q, falling = condyle.neutral(quadruped), np.eye(18)[2] * -1.0
/// >>> after = condyle.impulse_dynamics(quadruped, condyle.Data(quadruped), touchdown, q, falling)
/// >>> bool(after.lambda_[2] > 0.0)  # the ground pushes upwards
/// True
fn impulse_dynamics(model, data, constraints; q: Position, v: Tangent, restitution: Coefficient = 0.0; out) {
    condyle::impulse_dynamics(model, data, constraints, &q, &v, Scalar::splat(restitution))
}

/// `impulse_dynamics` and its derivatives with respect to q and the velocity before the impact, exact, as
/// `ImpulseDerivatives`.
///
/// constraints, q, v, restitution: as for `impulse_dynamics`. ∂/∂q is taken in the tangent space. out: as many arrays
/// as there are members, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> hit = condyle.ConstraintSet(arm, [condyle.Constraint("tool", "point")])
/// >>> d = condyle.impulse_dynamics_derivatives(arm, condyle.Data(arm), hit, [0.3] * 7, [0.1] * 7)
/// >>> np.allclose(d.dv_dv @ d.dv_dv, d.dv_dv)  # an impact that sticks is a projection
/// True
fn impulse_dynamics_derivatives(model, data, constraints;
    q: Position, v: Tangent, restitution: Coefficient = 0.0; out) {
    condyle::impulse_dynamics_derivatives(model, data, constraints, &q, &v, Scalar::splat(restitution))
}
}
