//! Kinetic and potential energy: sums over the moving bodies.

use crate::frames::{Placements, Velocities};
use crate::layout::{Layout, Single};
use condyle_spatial::{Act, Constant, Scalar};

impl<S: Scalar, R: Constant<S>> Placements<'_, S, R> {
    /// V = −Σ m_i gᵀ c_i, the potential energy of the moving bodies under the model's gravity (J), 0 at the world's
    /// origin, in O(n).
    ///
    /// Allocates nothing.
    pub fn potential_energy(&self) -> S {
        let (_, moment) = self.mass_and_moment();
        Single::<S, R>::new(self.model).minus_gravity().dot(moment) // −gᵀ Σ m c
    }
}

impl<S: Scalar, R: Constant<S>> Velocities<'_, S, R> {
    /// T = ½ Σ v_iᵀ I_i v_i + ½ Σ armature q̇², the kinetic energy of the moving bodies and the rotors (J), in O(n). It
    /// is ½ q̇ᵀ M q̇.
    ///
    /// Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::{Data, crba, forward_velocities, robots};
    /// use nalgebra::DVector;
    /// let arm = robots::arm7();
    /// let (mut data, v) = (Data::new(&arm), DVector::from_element(7, 0.5));
    /// let energy = forward_velocities(&arm, &mut data, &[0.3; 7], v.as_slice()).kinetic_energy();
    /// let M = crba(&arm, &mut data, &[0.3; 7]);
    /// assert!(f64::abs(energy - 0.5 * v.dot(&(M * &v))) < 1e-14);
    /// ```
    pub fn kinetic_energy(&self) -> S {
        let l = Single::<S, R>::new(self.model);
        let mut twice = self.rotors();
        for i in l.bodies() {
            let v = self.world.oX[i].act_inv(self.moving.v[i]); // in the body
            twice += v.dot(l.inertia(i) * v);
        }
        twice * S::splat(0.5)
    }

    /// Σ armature q̇², twice the kinetic energy of the rotors.
    #[inline(always)]
    pub(crate) fn rotors(&self) -> S {
        let mut twice = S::zero();
        for (&armature, &qd) in self.model.armature.iter().zip(&self.moving.qd) {
            twice += armature.lift() * qd * qd;
        }
        twice
    }

    /// E = T + V, the mechanical energy (J), in O(n): its rate is the power of the efforts and the external forces.
    ///
    /// Allocates nothing.
    pub fn mechanical_energy(&self) -> S {
        self.kinetic_energy() + self.potential_energy()
    }
}
