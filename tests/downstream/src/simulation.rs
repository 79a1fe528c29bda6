//! Tests a simulation of a robot that lands on the ground and stands there.

use condyle::simulation::{Control, Ground, Settings, Simulation, Status};
use condyle::{Error, Model};
use std::sync::Arc;

/// Simulation of a robot that falls onto its feet while springs and dampers hold its joints.
pub struct Standing {
    simulation: Simulation,
    pose: Vec<f64>,
}

impl Standing {
    /// Creates a simulation of a robot above the ground. The frames `feet` may touch the ground.
    pub fn new(robot: Arc<Model>, feet: &[&str], pose: &[f64]) -> Result<Self, Error> {
        let feet = feet.iter().map(|foot| robot.frame(foot)).collect::<Result<Vec<_>, _>>()?;
        let mut simulation = Simulation::new(robot, Settings::default());
        simulation.set_ground(Ground { friction: 0.8, ..Ground::at_frames(feet) })?;
        simulation.set_state(pose, &vec![0.0; simulation.v().len()])?;
        Ok(Self { simulation, pose: pose.to_vec() })
    }

    /// Simulates `steps` time steps, and returns the status of the simulation.
    pub fn run(&mut self, steps: usize) -> Status {
        let Self { simulation, pose } = self;
        simulation.run(steps, |now: &mut Control<'_, f64>| {
            for k in 6..now.tau.len() {
                now.tau[k] = 300.0 * (pose[k + 1] - now.q[k + 1]) - 8.0 * now.v[k];
            }
        })
    }

    /// Returns the vertical component of the sum of all ground forces (N).
    pub fn lift(&self) -> f64 {
        self.simulation.contacts().iter().map(|contact| contact.force.z).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use condyle::robots;

    #[test]
    fn a_quadruped_lands_and_stands() -> Result<(), Error> {
        let robot = Arc::new(robots::quadruped());
        let pose = [&[0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 1.0][..], &[0.0, 0.7, -1.4, 0.0, -0.7, 1.4].repeat(2)].concat();
        let mut standing = Standing::new(robot.clone(), &["LF_foot", "LH_foot", "RF_foot", "RH_foot"], &pose)?;
        assert_eq!(standing.lift(), 0.0);
        let status = standing.run(3000);
        assert!(status.is_done(), "{status}");
        let weight = 9.81 * robot.total_mass();
        assert!((standing.lift() / weight - 1.0).abs() < 0.01, "{} of {weight}", standing.lift());
        Ok(())
    }

    #[test]
    fn states_that_are_none_are_refused() -> Result<(), Error> {
        let robot = robots::quadruped();
        let mut q = condyle::neutral(&robot);
        q[6] = 2.0;
        let mut simulation = Simulation::new(robot, Settings::default());
        let error = simulation.set_state(&q, &[0.0; 18]).unwrap_err().to_string();
        assert!(error.contains("root_joint") && error.contains('2'), "{error}");
        Ok(())
    }
}
