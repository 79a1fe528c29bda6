//! Position, velocity and acceleration of the centre of mass, as sums over the moving bodies.
//!
//! In the world's frame, a body has mass m and first moment h = m c about the world's origin:
//!
//! ```text
//! m ċ = m v + ω × h     m c̈ = m a + α × h + ω × (m v + ω × h)
//! ```
//!
//! where (v, ω) and (a, α) are the spatial velocity and acceleration of the body. Bodies fixed to the world are
//! ignored. The Jacobian of the centre of mass is a result of [`centroidal_map`](crate::centroidal_map).

use crate::passes::answers::answers;
use crate::passes::frames::{Accelerations, Placements, Velocities};
use condyle_model::layout::{Layout, Single};
use condyle_spatial::{Constant, Scalar, Vec3};

impl<S: Scalar, R: Constant<S>> Placements<'_, S, R> {
    /// Returns the mass m of a body and its first moment h = m c about the world's origin.
    #[inline(always)]
    fn first_moment(&self, l: &Single<'_, S, R>, i: usize) -> (S, Vec3<S>) {
        let (I, oX) = (l.inertia(i), &self.world.oX[i]);
        (I.mass, oX.translation.scale_add(I.mass, oX.rotation * I.mass_com))
    }

    /// Returns the total mass Σ m and the total first moment Σ m c of the moving bodies.
    #[inline(always)]
    pub(crate) fn mass_and_moment(&self) -> (S, Vec3<S>) {
        let l = Single::<S, R>::new(self.model);
        let (mut mass, mut moment) = (S::zero(), Vec3::zero());
        for i in l.bodies() {
            let (m, h) = self.first_moment(&l, i);
            mass += m;
            moment += h;
        }
        (mass, moment)
    }
}

answers! {
    /// Returns c = Σ m_i c_i / Σ m_i, the centre of mass of the moving bodies in the world's frame (m). Costs O(n) for
    /// n bodies.
    ///
    /// Returns NaN if no moving body has mass. Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::{Data, forward_kinematics, neutral, robots};
    /// let quadruped = robots::quadruped();
    /// let mut data = Data::new(&quadruped);
    /// let com = forward_kinematics(&quadruped, &mut data, &neutral(&quadruped)).com();
    /// assert!(f64::abs(com.y) < 1e-12); // left and right weigh the same
    /// ```
    fn com(of: Placements) -> Vec3 = Vec3::zero(); {
        let (mass, moment) = of.mass_and_moment();
        moment.scale(mass.recip())
    }

    /// Returns ċ, the velocity of the centre of mass of the moving bodies in the world's frame (m/s). Costs O(n) for n
    /// bodies.
    ///
    /// Returns NaN if no moving body has mass. Allocates nothing.
    fn com_velocity(of: Velocities) -> Vec3 = Vec3::zero(); {
        let l = Single::<S, R>::new(of.model);
        let (mut mass, mut momentum) = (S::zero(), Vec3::zero());
        for i in l.bodies() {
            let ((m, h), v) = (of.first_moment(&l, i), of.moving.v[i]);
            mass += m;
            momentum += v.linear.scale_add(m, v.angular.cross(h)); // m ċ = m v + ω × h
        }
        momentum.scale(mass.recip())
    }

    /// Returns c̈, the acceleration of the centre of mass of the moving bodies in the world's frame (m/s²), without
    /// gravity. Costs O(n) for n bodies.
    ///
    /// Returns NaN if no moving body has mass. Allocates nothing.
    fn com_acceleration(of: Accelerations) -> Vec3 = Vec3::zero(); {
        let l = Single::<S, R>::new(of.model);
        let (mut mass, mut force) = (S::zero(), Vec3::zero());
        for i in l.bodies() {
            let ((m, h), v, a) = (of.first_moment(&l, i), of.moving.v[i], of.moving.a[i]);
            let momentum = v.linear.scale_add(m, v.angular.cross(h));
            mass += m;
            force += a.linear.scale_add(m, a.angular.cross(h)) + v.angular.cross(momentum); // m a + α × h + ω × m ċ
        }
        force.scale(mass.recip())
    }
}
