//! Numbers of a model: inertias, limits, damping and friction, springs, actuators, keyframes.

use super::Model;
use crate::arrays::{class, read_only};
use crate::cached::Attribute;
use crate::inertial_parameters::model_inertia;
use condyle::regressors::inertial_parameters;
use condyle::tree::{Actuator, Transmission};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

impl Model {
    /// Returns numbers of the model in a read-only array.
    fn numbers<'py>(
        &self,
        py: Python<'py>,
        attribute: Attribute,
        instead: &str,
        numbers: impl FnOnce() -> Vec<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.cached.value(py, attribute, || read_only(py, &numbers()[..], instead))
    }

    /// Returns one vector of each keyframe, such as the velocity, in a new dictionary by name.
    fn keyframe_parts<'py>(
        &self,
        py: Python<'py>,
        part: impl Fn(&condyle::tree::Keyframe) -> &[f64],
    ) -> PyResult<Bound<'py, PyDict>> {
        let parts = PyDict::new(py);
        for keyframe in self.inner.keyframes() {
            parts.set_item(&keyframe.name, read_only(py, part(keyframe), "")?)?;
        }
        Ok(parts)
    }
}

#[pymethods]
impl Model {
    /// The pose of each joint's frame in the frame of the parent body, at joint position zero: (nbodies, 4, 4).
    #[getter]
    fn joint_placements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.cached.value(py, Attribute::JointPlacements, || read_only(py, &self.of_bodies(|b| b.placement)[..], ""))
    }

    /// The inertia of each body in the body's frame, as `Inertia`. The inertia includes the links that fixed joints
    /// attach to the body.
    #[getter]
    fn inertias<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Inertias, || {
            self.inner.bodies().iter().map(|b| model_inertia(py, b.inertia)).collect()
        })
    }

    /// The inertial parameters π, by which regressors are multiplied: ten numbers for each body except the world, 10
    /// (nbodies − 1) in all. The ten numbers are mass, mass times centre of mass, and xx, xy, yy, xz, yz, zz of the
    /// rotational inertia about the origin of the body's frame.
    #[getter]
    fn inertial_parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let bodies = || self.inner.bodies()[1..].iter();
        let pi = || bodies().flat_map(|b| inertial_parameters::from_inertia(b.inertia)).collect();
        self.numbers(py, Attribute::InertialParameters, "with_inertias", pi)
    }

    /// The limits of position, velocity and effort, as `Limits`; infinite where a limit is missing. `effort` is the
    /// greatest magnitude of `effort_lower` and `effort_upper`.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.cached.value(py, Attribute::Limits, || {
            let limits = self.inner.limits();
            let condyle::Limits { lower, upper, velocity, effort_lower, effort_upper } = limits;
            let give = |numbers: &[f64]| read_only(py, numbers, "with_limits");
            let effort = (give(&limits.effort())?, give(effort_lower)?, give(effort_upper)?);
            class!(py, "Limits")?.call1((give(lower)?, give(upper)?, give(velocity)?, effort.0, effort.1, effort.2))
        })
    }

    /// The coefficients d₁ and d₂ of speed-dependent damping, (nv, 2): the damping coefficient is d₀ + d₁|v| + d₂v²,
    /// with d₀ in `damping`. The functions that use `damping` also use these coefficients.
    #[getter]
    fn damping_polynomial<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let polynomial = || read_only(py, self.inner.damping_polynomial(), "with_damping");
        self.cached.value(py, Attribute::DampingPolynomial, polynomial)
    }

    /// The springs of joints, as `Spring(joint, stiffness, rest)`. Springs act only in `passive_torque` and in a
    /// `Simulation` with passive torques.
    #[getter]
    fn springs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Springs, || {
            let class = class!(py, "Spring")?;
            let spring = |s: &condyle::tree::Spring| {
                let joint = &*self.inner.bodies()[s.body].joint_name;
                class.call1((joint, read_only(py, &s.stiffness[..], "")?, read_only(py, &s.rest[..], "")?))
            };
            self.inner.springs().iter().map(spring).collect()
        })
    }

    /// The supported fractions of the weights of bodies, as `GravityCompensation(body, mass, mass_com, ratio)`:
    /// MuJoCo's `gravcomp`. The supporting forces act only in `passive_torque` and in a `Simulation` with passive
    /// torques.
    #[getter]
    fn gravity_compensation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::GravityCompensation, || {
            let class = class!(py, "GravityCompensation")?;
            let carried = |c: &condyle::tree::GravityCompensation| {
                let body = &self.inner.bodies()[c.body];
                let carried = c.carried(body.inertia);
                class.call1((&*body.name, carried.mass, read_only(py, &carried.mass_com.to_array()[..], "")?, c.ratio))
            };
            self.inner.gravity_compensation().iter().map(carried).collect()
        })
    }

    /// The actuators of the file, as `Actuator`, in the order of the file. `limits`, `armature` and `damping` of the
    /// joints already include the ranges, the armature and the damping of actuators.
    #[getter]
    fn actuators<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Actuators, || {
            let class = class!(py, "Actuator")?;
            let joint = |body: usize| &*self.inner.bodies()[body].joint_name;
            let actuator = |a: &Actuator| {
                let (mut driven, coefficients) = ([None; 3], PyDict::new(py));
                match &a.transmission {
                    Transmission::Joint { body } => driven[0] = Some(joint(*body)),
                    Transmission::Tendon { name, joints } => {
                        driven[1] = Some(name);
                        joints.iter().try_for_each(|&(body, by)| coefficients.set_item(joint(body), by))?;
                    }
                    Transmission::Frame { frame } => driven[2] = Some(&self.inner.frames()[*frame].name),
                    other => unreachable!("{other:?}: a transmission without words for it"),
                }
                let gear = read_only(py, &a.gear[..], "")?;
                let [joint, tendon, frame] = driven;
                let Actuator { name, gain, bias, kp, kv, control, force, .. } = a;
                class.call1((name, joint, tendon, frame, coefficients, gear, gain, bias, kp, kv, control, force))
            };
            self.inner.actuators().iter().map(actuator).collect()
        })
    }

    /// The named positions of the file: a dictionary from names to q, nq numbers each.
    #[getter]
    fn keyframes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.keyframe_parts(py, |keyframe| &keyframe.q)
    }

    /// The velocities of the `keyframes`: a dictionary from names to v, nv numbers each.
    #[getter]
    fn keyframe_velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.keyframe_parts(py, |keyframe| &keyframe.v)
    }

    /// The controls of the `keyframes`: a dictionary from names to arrays, with one number for each of `actuators`.
    #[getter]
    fn keyframe_controls<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.keyframe_parts(py, |keyframe| &keyframe.control)
    }

    /// The viscous damping of each degree of freedom, nv numbers (N m s/rad, N s/m). Damping acts only in
    /// `passive_torque` and in a `Simulation` with passive torques.
    #[getter]
    fn damping<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Damping, "with_damping", || self.inner.damping().to_vec())
    }

    /// The Coulomb friction of each degree of freedom, nv numbers (N m, N). Friction acts only in `passive_torque` and
    /// in a `Simulation` with passive torques.
    #[getter]
    fn friction<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Friction, "with_friction", || self.inner.friction().to_vec())
    }

    /// The inertia of the rotor as seen at each joint, nv numbers (kg m², kg). Every algorithm adds the armature to M.
    #[getter]
    fn armature<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Armature, "with_armature", || self.inner.armature().to_vec())
    }

    /// Returns the constraints in the robot's file that are not part of the tree, by name. Loops are
    /// `ContactConstraint`s without stabilisation; coupled joints are `Coupling`s. Inactive constraints are left out,
    /// and so is the `<mimic>` of a URDF or SDF.
    ///
    /// The algorithms for trees ignore loops and couplings. `constrained_dynamics` closes the loops that are in its
    /// `ConstraintSet`. No function enforces a `Coupling`. A linear coupling becomes a part of the tree if the file is
    /// read with `mimic=True`.
    ///
    /// >>> robot = condyle.robots.quadruped()
    /// >>> loops = [c for c in robot.constraints().values() if isinstance(c, condyle.ContactConstraint)]
    /// >>> stiff = [c._replace(kp=400.0, kd=40.0) for c in loops]  # an error of position decays within 0.1 s
    /// >>> condyle.ConstraintSet(robot, stiff, mu=1e-8, iterations=5)
    /// <condyle.ConstraintSet of 'quadruped': 0 constraints, 0 rows>
    fn constraints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        crate::constrained::of_model(py, &self.inner)
    }

    /// The acceleration of free fall, in the world's frame (m/s²), 3 numbers.
    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Gravity, "with_gravity", || self.inner.gravity().to_array().to_vec())
    }

    /// The mass of all bodies, including parts fixed to the world (kg).
    #[getter]
    fn total_mass(&self) -> f64 {
        self.inner.total_mass()
    }
}
