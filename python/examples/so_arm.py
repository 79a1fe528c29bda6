"""Kinematics of a position-controlled arm in degrees, with the calls of LeRobot's `RobotKinematics`.

    python python/examples/so_arm.py [ROBOT.urdf FRAME]

`Kinematics` takes the path of a URDF, so that it can replace LeRobot's class. Without arguments, the example uses a
small arm with five joints, which it writes to the current folder. Such an arm cannot reach every rotation: the answer
is the best compromise under the given weights.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import condyle
from condyle.ik import DifferentialIk, JointLimits, Task

ARM = """<robot name="five_joints">
  <link name="base"/>
  <joint name="shoulder_pan" type="revolute">
    <parent link="base"/><child link="shoulder"/><origin xyz="0 0 0.06"/><axis xyz="0 0 1"/>
    <limit lower="-1.9" upper="1.9" velocity="6" effort="3"/></joint>
  <link name="shoulder"/>
  <joint name="shoulder_lift" type="revolute">
    <parent link="shoulder"/><child link="upper_arm"/><origin xyz="0.03 0 0.06"/><axis xyz="0 1 0"/>
    <limit lower="-1.7" upper="1.7" velocity="6" effort="3"/></joint>
  <link name="upper_arm"/>
  <joint name="elbow_flex" type="revolute">
    <parent link="upper_arm"/><child link="lower_arm"/><origin xyz="0.02 0 0.115"/><axis xyz="0 1 0"/>
    <limit lower="-1.7" upper="1.7" velocity="6" effort="3"/></joint>
  <link name="lower_arm"/>
  <joint name="wrist_flex" type="revolute">
    <parent link="lower_arm"/><child link="wrist"/><origin xyz="0.135 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1.7" upper="1.7" velocity="6" effort="3"/></joint>
  <link name="wrist"/>
  <joint name="wrist_roll" type="revolute">
    <parent link="wrist"/><child link="gripper"/><origin xyz="0.06 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-2.8" upper="2.8" velocity="6" effort="3"/></joint>
  <link name="gripper"/>
  <joint name="gripper_frame_joint" type="fixed">
    <parent link="gripper"/><child link="gripper_frame"/><origin xyz="0.09 0 0"/></joint>
  <link name="gripper_frame"/>
</robot>
"""

Array = NDArray[np.float64]


class Kinematics:
    """Forward and inverse kinematics of a robot, with joint positions in degrees."""

    def __init__(
        self, urdf_path: str | Path, target_frame_name: str = "gripper_frame", joint_names: Sequence[str] | None = None
    ) -> None:
        """Reads the robot. `joint_names` lists the joints in the order of the arrays; None for the model's order."""
        self.model = condyle.Model.from_urdf(urdf_path)
        self.data = condyle.Data(self.model)
        self.frame = target_frame_name
        bodies = range(1, self.model.nbodies)
        names = list(joint_names) if joint_names is not None else [self.model.names[body] for body in bodies]
        self.joint_names = names
        self.indices = [self.model.idx_qs[self.model.joint(name)] for name in names]
        self.solvers: dict[tuple[float, float], DifferentialIk] = {}

    def forward_kinematics(self, joint_pos_deg: Array) -> Array:
        """Returns the pose (4, 4) of the frame. Further numbers, such as the position of a gripper, have no effect."""
        return condyle.frame_placement(self.model, self.data, self.position(joint_pos_deg), self.frame)

    def inverse_kinematics(
        self,
        current_joint_pos: Array,
        desired_ee_pose: Array,
        position_weight: float = 1.0,
        orientation_weight: float = 0.01,
    ) -> Array:
        """Returns joint positions in degrees at which the frame is as near to the pose as the weights and the limits
        allow. Numbers after the joints are copied from `current_joint_pos`.
        """
        key = (position_weight, orientation_weight)
        if key not in self.solvers:
            factors = [position_weight] * 3 + [orientation_weight] * 3
            task = Task.pose(self.frame, factors=factors, damping=0.1)
            # The steps are iterations and not motions, so only the limits of positions matter.
            limits = JointLimits(gain=1.0, velocity=np.full(self.model.nv, np.inf))
            self.solvers[key] = DifferentialIk(self.model, [task, Task.posture(weight=1e-9)], limits=limits)
        ik, q = self.solvers[key], self.position(current_joint_pos)
        targets = ik.hold(q)
        targets.frames[0] = desired_ee_pose
        q, _, _ = ik.converge(q, targets, steps=50)
        answer = np.array(current_joint_pos, dtype=float)
        answer[: len(self.indices)] = np.rad2deg(q[self.indices])
        return answer

    def position(self, joint_pos_deg: Array) -> Array:
        """Returns the position q of the model."""
        q = condyle.neutral(self.model)
        q[self.indices] = np.deg2rad(np.asarray(joint_pos_deg, dtype=float)[: len(self.indices)])
        return q


def main() -> None:
    """Moves the frame along a line, and prints how near it comes."""
    if len(sys.argv) > 2:
        path, frame = Path(sys.argv[1]), sys.argv[2]
    else:
        path, frame = Path("five_joints.urdf"), "gripper_frame"
        path.write_text(ARM)
    arm = Kinematics(path, frame)
    joints = np.array([10.0, -20.0, 30.0, 40.0, 5.0])
    pose = arm.forward_kinematics(joints)
    print(f"joints: {', '.join(arm.joint_names)}; {frame} at {pose[:3, 3].round(3)} m")
    for step in range(1, 6):
        target = pose.copy()
        target[2, 3] += 0.01 * step  # up, 1 cm at a time
        joints = arm.inverse_kinematics(joints, target)
        miss = np.linalg.norm(arm.forward_kinematics(joints)[:3, 3] - target[:3, 3])
        print(f"{step} cm up: {joints.round(1)}°, {1000 * miss:.2f} mm off")


if __name__ == "__main__":
    main()
