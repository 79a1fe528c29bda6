//! Describes the status of the last command in words.

use crate::command::Command;
use crate::controller::WholeBodyController;
use crate::error::{InvalidRotation, Status};

impl WholeBodyController {
    /// Returns the status of the last command in words, with the name of the invalid joint or frame.
    ///
    /// ```
    /// # use condyle_dynamics::{neutral, robots};
    /// # use condyle_wholebody::{Settings, Task, WholeBodyController};
    /// # let robot = robots::quadruped();
    /// let mut controller = WholeBodyController::new(&robot, &[], &[Task::posture()], Settings::default())?;
    /// let mut q = neutral(&robot);
    /// let references = controller.hold(&q)?;
    /// q[6] = 2.0;
    /// controller.step(&q, &[0.0; 18], &references);
    /// assert_eq!(controller.reason(), "joint `root_joint`: its rotation, q[3..7], has the length 2, expected 1");
    /// # Ok::<(), condyle_wholebody::Error>(())
    /// ```
    pub fn reason(&self) -> String {
        let Self { command: Command { status, .. }, equations, objective, .. } = self;
        let whose = match *status {
            Status::InvalidState(InvalidRotation::Joint { body, .. }) => {
                equations.model().bodies().get(body).map(|body| format!("joint `{}`", body.joint_name))
            }
            Status::InvalidState(InvalidRotation::Pose { name: "contacts", index, .. }) => {
                equations.contacts.get(index).map(|contact| format!("frame `{}`", contact.description.frame))
            }
            Status::InvalidState(InvalidRotation::Pose { index, .. }) => {
                let mut frames = objective.tasks.iter().filter(|task| task.frame.is_some());
                let task = frames.nth(index).and_then(|task| task.task.kind.frame());
                task.map(|frame| format!("frame `{frame}`"))
            }
            _ => None,
        };
        match (whose, status) {
            (Some(whose), Status::InvalidState(rotation)) => format!("{whose}: {}", rotation.fault()),
            _ => status.to_string(),
        }
    }
}
