//! Equality of models.

use crate::model::Model;

/// Two models are equal if they are the same robot, number by number: names, bodies, joints, frames, limits, losses,
/// springs, armature, gravity, inertias, actuators, keyframes and constraints. All else follows from these.
///
/// A clone is equal to its model, and so is a model that was written and read again by a format that keeps all digits. The
/// warnings of the loader do not count, nor whether single calls compute limbs side by side
/// ([`with_limbs`](Model::with_limbs)), on which last digits depend. No model with a number that is not a number exists.
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
