"""Dynamics of a robot in twenty lines.

    python python/examples/dynamics.py

A `Model` is the robot and never changes. A `Data` is the scratch memory of calls. All algorithms are functions of a
`Model`, a `Data`, the state (position q, velocity v), and further arguments such as accelerations or efforts.
"""

import numpy as np

import condyle

robot = condyle.robots.quadruped()  # or condyle.Model.from_urdf("robot.urdf", root_joint="free_flyer")
data = condyle.Data(robot)
print(robot)  # prints a table of joints; print(robot.tree()) prints the tree of bodies

# q has nq numbers: the base's position and quaternion (x, y, z, w), then a number for each joint. v has nv numbers.
q, v = condyle.neutral(robot), np.zeros(robot.nv)
q[2], q[7:] = 0.5, np.tile([0.0, 0.7, -1.4], 4)  # the base is half a metre up, and the knees are bent

# Inverse dynamics: the efforts τ = M a + h that hold the robot still. The base has no motor: its effort is the weight.
tau = condyle.rnea(robot, data, q, v, np.zeros(robot.nv))
print(f"the ground must carry {tau[2]:.1f} N, and {robot.total_mass * 9.81:.1f} N is the robot's weight")

# Forward dynamics: without efforts the robot falls.
a = condyle.aba(robot, data, q, v, np.zeros(robot.nv))
print(f"the base falls with {a[2]:.2f} m/s²")

# The results of inverse and forward dynamics satisfy the equation of motion M a + h = τ.
M, h = condyle.crba(robot, data, q), condyle.nonlinear_effects(robot, data, q, v)
assert np.allclose(M @ a + h, 0.0)

# Kinematics: the position of a foot, and its velocity for given joint velocities.
foot = condyle.frame_placement(robot, data, q, "LF_foot")[:3, 3]
J = condyle.frame_jacobian(robot, data, q, "LF_foot", "local_world_aligned")
print(f"a foot is at {foot.round(3)}, and its Jacobian has the shape {J.shape}")

# Contacts: forces λ hold the feet. With a quarter of the weight on each foot, the joints need g − Jᵀ λ.
feet = ("LF_foot", "RF_foot", "LH_foot", "RH_foot")
stance = condyle.ConstraintSet(
    robot, [condyle.ContactConstraint(foot, "point", reference="local_world_aligned") for foot in feet]
)
weight = np.tile([0.0, 0.0, robot.total_mass * 9.81 / 4], 4)
tau = condyle.gravity(robot, data, q)
for foot, force in zip(feet, weight.reshape(4, 3), strict=True):
    tau -= condyle.frame_jacobian(robot, data, q, foot, "local_world_aligned")[:3].T @ force
tau[:6] = 0.0  # the base has no motors
contact = condyle.constrained_dynamics(robot, data, stance, q, v, tau)
print(f"on its feet it falls with {abs(contact.a[2]):.2f} m/s²; they are pushed by {contact.lambda_[2::3].round(1)} N")

# Many states in one call: arrays have an additional first axis. SIMD registers compute several states at a time.
states = np.stack([condyle.random_configuration(robot, seed=k) for k in range(1000)])
masses = condyle.crba(robot, data, states)
print(f"{len(masses)} inertia matrices: {masses.shape}")
