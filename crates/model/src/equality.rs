//! Equality of models.

use crate::model::Model;

/// Two models are equal if they describe the same robot with equal values. Compared are names, bodies, joints, frames,
/// limits, damping, friction, springs, armature, gravity, inertias, actuators, keyframes and constraints. All other
/// fields are computed from these values.
///
/// A clone is equal to its model. A model that is written and read again is equal to its original, if the format keeps
/// all digits. Warnings of the loader are not compared. The setting of [`with_limbs`](Model::with_limbs) is not
/// compared either, although the last digits of results depend on it. No model contains NaN.
impl<R: PartialEq> PartialEq for Model<R> {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
            && self.bodies == other.bodies
            && self.frames == other.frames
            && self.limits == other.limits
            && self.damping == other.damping
            && self.friction == other.friction
            && self.damping_polynomial == other.damping_polynomial
            && self.springs == other.springs
            && self.gravity_compensation == other.gravity_compensation
            && self.actuators == other.actuators
            && self.keyframes == other.keyframes
            && self.constraints == other.constraints
            && self.armature == other.armature
            && self.gravity == other.gravity
            && self.tree.nodes.iter().zip(&other.tree.nodes).all(|(a, b)| a.inertia == b.inertia)
    }
}
