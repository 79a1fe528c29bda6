//! Simulation of a robot on level ground by constrained dynamics. A foot on the ground stays at its position as long as
//! the ground pushes the foot. An impact stops a foot that lands. The friction force has no limit, so callers must
//! check the forces.

use condyle::{
    ConstraintSet, ContactConstraint, Data, Force, Model, ReferenceFrame, Vec3, constrained_dynamics,
    constraints::impulse_dynamics, forward_kinematics, integrate,
};

/// Rate at which the drift of a held foot decays (1/s).
const HOLD: f64 = 50.0;

/// A robot, its feet, and its state.
pub(crate) struct Ground<'m> {
    model: &'m Model,
    data: Data<f64>,
    pub(crate) q: Vec<f64>,
    pub(crate) v: Vec<f64>,
    contacts: Vec<ContactConstraint>,
    /// Position at which each foot is held; `None` if the foot is in the air.
    standing: Vec<Option<Vec3<f64>>>,
}

impl<'m> Ground<'m> {
    /// Creates a robot whose feet are all held at their present positions.
    pub(crate) fn new(model: &'m Model, q: &[f64], contacts: Vec<ContactConstraint>) -> Self {
        let mut data = Data::new(model);
        let placements = forward_kinematics(model, &mut data, q);
        let standing = contacts.iter().map(|c| Some(placements.frame(c.frame).translation)).collect();
        Self { model, data, q: q.to_vec(), v: vec![0.0; model.nv()], contacts, standing }
    }

    fn set(&self, feet: &[usize]) -> ConstraintSet<f64> {
        let constraint = |&k: &usize| {
            let mut contact = self.contacts[k];
            (contact.kd, contact.reference) = (HOLD, ReferenceFrame::LocalWorldAligned);
            contact
        };
        ConstraintSet::new(self.model, &feet.iter().map(constraint).collect::<Vec<_>>()).expect("feet differ")
    }

    /// Simulates a step of dt with efforts τ and forces on the bodies. Returns the force on each foot.
    pub(crate) fn step(&mut self, tau: &[f64], f_ext: &[Force<f64>], dt: f64) -> Vec<Vec3<f64>> {
        let mut forces = vec![Vec3::zero(); self.contacts.len()];
        loop {
            let feet: Vec<usize> = (0..self.contacts.len()).filter(|&k| self.standing[k].is_some()).collect();
            let mut set = self.set(&feet);
            let (q, v) = (&self.q, &self.v);
            let found = constrained_dynamics(self.model, &mut self.data, &mut set, q, v, tau, f_ext);
            let (a, lambda) = (found.a.to_vec(), found.lambda.to_vec());
            let force = |i: usize| {
                let row = set.range(i).start;
                Vec3::new(lambda[row], lambda[row + 1], lambda[row + 2])
            };
            // The ground cannot pull. Release the foot with the largest pulling force, and compute the forces again.
            let pulled =
                (0..feet.len()).filter(|&i| force(i).z < 0.0).min_by(|&i, &j| force(i).z.total_cmp(&force(j).z));
            if let Some(i) = pulled {
                self.standing[feet[i]] = None;
                continue;
            }
            feet.iter().enumerate().for_each(|(i, &k)| forces[k] = force(i));
            self.v.iter_mut().zip(&a).for_each(|(v, a)| *v += dt * a); // v⁺ = v + Δt q̈
            break;
        }
        let moved: Vec<f64> = self.v.iter().map(|v| dt * v).collect();
        let mut next = self.q.clone();
        integrate(self.model, &self.q, &moved, &mut next); // q⁺ = q ⊕ Δt v⁺
        self.q = next;
        // Find the feet that have landed.
        let placements = forward_kinematics(self.model, &mut self.data, &self.q);
        let mut landed = false;
        for (standing, contact) in self.standing.iter_mut().zip(&self.contacts) {
            let p = placements.frame(contact.frame).translation;
            if standing.is_none() && p.z < 0.0 {
                (*standing, landed) = (Some(p), true);
            }
        }
        if landed {
            let feet: Vec<usize> = (0..self.contacts.len()).filter(|&k| self.standing[k].is_some()).collect();
            let mut set = self.set(&feet);
            self.v = impulse_dynamics(self.model, &mut self.data, &mut set, &self.q, &self.v, 0.0).v.to_vec();
        }
        forces
    }
}
