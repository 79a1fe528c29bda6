//! Copies of a robot in which one property is changed.

use crate::body::Limits;
use crate::error::Error;
use crate::limbs::Plan;
use crate::magnitude::check_gravity;
use crate::model::Model;
use crate::real::{real_inertia, real_vector};
use alloc::vec::Vec;
use condyle_linalg::check;
use condyle_spatial::{Act, Constant, Inertia, Mat3, Scalar, Se3, Sym3, Vec3};
use core::any::Any;

/// Largest number that is treated as a rounding error: a few units in the last place of 1.
const RESIDUE: f64 = 1e-15;

impl<R: Scalar> Model<R> {
    /// Returns the same robot with another gravity (m/s², in the world's frame).
    ///
    /// # Errors
    /// Returns [`Error::Gravity`] if the gravity is not finite. A gravity with several lanes is not checked.
    pub fn with_gravity(mut self, gravity: Vec3<R>) -> Result<Self, Error> {
        if R::LANES == 1 {
            check_gravity(real_vector(gravity))?;
        }
        self.gravity = gravity;
        Ok(self)
    }

    /// Returns the same robot with another armature, whose entries have the type of the robot's constants. The armature
    /// is not checked, because its entries may be the symbolic arguments of generated code.
    ///
    /// # Panics
    /// If `armature` does not have nv numbers.
    #[doc(hidden)]
    #[track_caller]
    pub fn with_scalar_armature(mut self, armature: &[R]) -> Self {
        check("armature", armature.len(), self.nv());
        self.armature.copy_from_slice(armature);
        self.free_armature = self.tree.free_joints().collect();
        self
    }
}

impl Model {
    /// Returns the same robot with another armature, one number for each degree of freedom (kg m², kg).
    ///
    /// An armature adds armature · q̈ to the efforts. Along the linear coordinates of a free joint, the armature acts
    /// as a mass without weight, as in MuJoCo. This mass resists the acceleration v̇ + ω × v of the body's origin,
    /// along the axes of the joint's parent.
    ///
    /// # Errors
    /// Returns [`Error::Joint`] if a number is negative or not finite, or if the three numbers along the linear
    /// coordinates of a free joint differ.
    ///
    /// # Panics
    /// If `armature` does not have nv numbers.
    #[track_caller]
    pub fn with_armature(mut self, armature: &[f64]) -> Result<Self, Error> {
        check("armature", armature.len(), self.nv());
        self.armature.copy_from_slice(armature);
        self.validate()?;
        Ok(self)
    }

    /// Returns the same robot with another viscous damping, one number for each degree of freedom (N m s/rad, N s/m).
    /// The [coefficients](Self::damping_polynomial) of damping that depends on the speed are kept.
    ///
    /// # Errors
    /// Returns [`Error::Joint`] if a number is negative or not finite.
    ///
    /// # Panics
    /// If `damping` does not have nv numbers.
    #[track_caller]
    pub fn with_damping(mut self, damping: &[f64]) -> Result<Self, Error> {
        check("damping", damping.len(), self.nv());
        self.damping.copy_from_slice(damping);
        self.validate()?;
        Ok(self)
    }

    /// Returns the same robot with other coefficients d₁ and d₂ of the damping d(v) = d₀ + d₁|v| + d₂v².
    ///
    /// # Errors
    /// Returns [`Error::Joint`] if a number is not finite.
    ///
    /// # Panics
    /// If `polynomial` does not have nv pairs.
    #[track_caller]
    pub fn with_damping_polynomial(mut self, polynomial: &[[f64; 2]]) -> Result<Self, Error> {
        check("polynomial", polynomial.len(), self.nv());
        self.damping_polynomial.copy_from_slice(polynomial);
        self.validate()?;
        Ok(self)
    }

    /// Returns the same robot with another Coulomb friction, one number for each degree of freedom (N m, N).
    ///
    /// # Errors
    /// Returns [`Error::Joint`] if a number is negative or not finite.
    ///
    /// # Panics
    /// If `friction` does not have nv numbers.
    #[track_caller]
    pub fn with_friction(mut self, friction: &[f64]) -> Result<Self, Error> {
        check("friction", friction.len(), self.nv());
        self.friction.copy_from_slice(friction);
        self.validate()?;
        Ok(self)
    }

    /// Returns the same robot with other limits of position, velocity and effort.
    ///
    /// ```
    /// let arm = condyle_model::robots::arm7();
    /// let mut limits = arm.limits().clone();
    /// limits.effort_upper.iter_mut().for_each(|effort| *effort *= 0.5);
    /// assert_eq!(arm.clone().with_limits(limits)?.limits().effort_upper[0], 0.5 * arm.limits().effort_upper[0]);
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::Length`] if there are not nq limits of position, or not nv of each other limit. Returns
    /// [`Error::Joint`] if a lower limit is above an upper limit, or if a limit of velocity is negative.
    pub fn with_limits(mut self, limits: Limits) -> Result<Self, Error> {
        for (name, found, expected) in [
            ("limits.lower", limits.lower.len(), self.nq()),
            ("limits.upper", limits.upper.len(), self.nq()),
            ("limits.velocity", limits.velocity.len(), self.nv()),
            ("limits.effort_lower", limits.effort_lower.len(), self.nv()),
            ("limits.effort_upper", limits.effort_upper.len(), self.nv()),
        ] {
            if found != expected {
                return Err(Error::Length { name, expected, found });
            }
        }
        self.limits = limits;
        self.validate()?;
        Ok(self)
    }

    /// Returns the same robot with constants of another type. A function of (body, inertia) returns the new inertia of
    /// each body.
    ///
    /// If the new type is a dual number, every algorithm computes derivatives with respect to inertial parameters.
    /// [`Body::inertia`](crate::Body::inertia) contains the real parts of the new inertias, which are checked.
    /// [`warnings`](Self::warnings) and [`singular_joints`](Self::singular_joints) refer to the new inertias. Inertias
    /// with several lanes are not checked. The model then keeps the warnings for the previous inertias.
    ///
    /// ```
    /// use condyle_model::{Inertia, robots};
    /// use num_dual::Dual64;
    /// // ∂/∂(mass of the last body): seed that one number
    /// let arm = robots::arm7();
    /// let dual = arm.with_inertias(|body, I| Inertia::<Dual64> {
    ///     mass: Dual64::new(I.mass, if body == 7 { 1.0 } else { 0.0 }),
    ///     ..I.lift()
    /// })?;
    /// assert_eq!(dual.nv(), arm.nv()); // rnea(&dual, …) gives ∂τ/∂m with τ
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::Body`] if a mass is negative or a number is not finite.
    pub fn with_inertias<T: Scalar + Constant<T>>(
        &self,
        mut inertia: impl FnMut(usize, Inertia<f64>) -> Inertia<T>,
    ) -> Result<Model<T>, Error> {
        let mut plain = self.clone();
        let inertias: Vec<Inertia<T>> = self.bodies.iter().enumerate().map(|(i, b)| inertia(i, b.inertia)).collect();
        if T::LANES == 1 {
            for ((body, node), &I) in plain.bodies.iter_mut().zip(&mut plain.tree.nodes).zip(&inertias) {
                body.inertia = real_inertia(I);
                node.inertia = Se3::new(node.axis_rotation, Vec3::zero()).act_inv(body.inertia);
            }
            plain.validate()?;
        }
        // Returns bXz: the pose, in body i, of the frame whose z axis is the joint's axis.
        let turned = |i: usize| Se3::new(self.tree.nodes[i].axis_rotation, Vec3::zero()).lift();
        let tree = plain.tree.map(|X| X.lift(), |i| turned(i).act_inv(inertias[i]));
        let mut model = Model {
            tree,
            armature: plain.armature.iter().map(|&a| T::of(a)).collect(),
            free_armature: plain.free_armature,
            gravity: plain.gravity.lift(),
            name: plain.name,
            bodies: plain.bodies,
            frames: plain.frames,
            limits: plain.limits,
            damping: plain.damping,
            friction: plain.friction,
            damping_polynomial: plain.damping_polynomial,
            springs: plain.springs,
            gravity_compensation: plain.gravity_compensation,
            actuators: plain.actuators,
            keyframes: plain.keyframes,
            constraints: plain.constraints,
            limbs: None,
            geometry: plain.geometry,
            between: plain.between,
            warnings: plain.warnings,
            singular: plain.singular,
        };
        if let Some(plain) = (&mut model as &mut dyn Any).downcast_mut::<Model>() {
            plain.limbs = self.limbs.as_ref().and_then(|_| Plan::new(&plain.tree));
        }
        Ok(model)
    }

    /// Returns the same robot without rounding errors: numbers next to 0, 1 and −1 in its poses, and numbers next to 0
    /// in its inertias, become exact. Without this function, generated code would compute with the rounding errors of
    /// right angles.
    #[doc(hidden)]
    #[must_use]
    pub fn without_residues(mut self) -> Self {
        let whole = |x: f64| [0.0, 1.0, -1.0].into_iter().find(|whole| (x - whole).abs() < RESIDUE).unwrap_or(x);
        let small = |x: f64, scale: f64| if x.abs() < RESIDUE * scale { 0.0 } else { x };
        let vector = |v: Vec3<f64>, scale: f64| Vec3::from(v.to_array().map(|x| small(x, scale)));
        let rotation = |R: Mat3<f64>| {
            let axis = |v: Vec3<f64>| Vec3::from(v.to_array().map(whole));
            Mat3 { x: axis(R.x), y: axis(R.y), z: axis(R.z) }
        };
        let pose = |X: Se3<f64>| Se3::new(rotation(X.rotation), vector(X.translation, 1.0));
        for node in &mut self.tree.nodes {
            (node.placement, node.axis_rotation) = (pose(node.placement), rotation(node.axis_rotation));
        }
        for body in &mut self.bodies {
            let Inertia { mass, mass_com, rotational: J } = body.inertia;
            let scale = [J.xx, J.yy, J.zz].map(f64::abs).into_iter().fold(0.0, f64::max);
            let [xy, xz, yz] = [J.xy, J.xz, J.yz].map(|x| small(x, scale));
            body.inertia = Inertia { mass, mass_com: vector(mass_com, mass), rotational: Sym3 { xy, xz, yz, ..J } };
        }
        self.frames.iter_mut().for_each(|frame| frame.placement = pose(frame.placement));
        self
    }

    /// Returns the same robot with a setting for calls with a single state: they compute the limbs of the robot in
    /// parallel lanes, or the bodies one after another.
    ///
    /// With enough limbs (four legs, two legs and two arms, fingers), some functions compute four bodies of one state
    /// at a time, if the processor has AVX2 or NEON. These functions are `rnea`, `aba`, `crba`, `minv`, the derivatives
    /// of `rnea` and `aba`, and `constrained_dynamics`. With lanes, they are two to three times as fast. A `Batch`
    /// never computes limbs in lanes, because its lanes contain states. With and without lanes, sums have different
    /// orders, so results differ in the last digits. Without limbs in lanes, a call with a single state returns the
    /// same bits as a batch.
    ///
    /// ```
    /// let quadruped = condyle_model::robots::quadruped();
    /// let serial = quadruped.clone().with_limbs(false); // rnea(&serial, …) is rnea(&quadruped, …) but for rounding
    /// assert_eq!(serial.nv(), quadruped.nv());
    /// ```
    #[must_use]
    pub fn with_limbs(mut self, side_by_side: bool) -> Self {
        self.limbs = if side_by_side { Plan::new(&self.tree) } else { None };
        self
    }
}
