#!/usr/bin/env python3
"""Writes condyle/_condyle.pyi, which describes the extension module for editors and type checkers.

    python3 python/stubs.py [--check]        with --check, writes nothing; fails if the file is out of date

Names, signatures and docstrings are read from the installed module; their source is the Rust code. The module does not
contain types: the tables below define types by the names of arguments and functions. A name without a type is an error,
and so is an unused entry of a table.

The file is kept in the repository for two reasons. A wheel is packed before its module can be imported. And type
checkers read editable installations and source folders, in which the module may not be built.
"""

import ast
import inspect
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, WrapperDescriptorType
from typing import Any

FILE = Path(__file__).parent / "condyle" / "_condyle.pyi"
WIDTH = 120
DERIVABLE = 1 << 10  # Python's flag Py_TPFLAGS_BASETYPE of classes that can be subclassed

ALIASES = {
    "_Array": "NDArray[np.float64]",
    "_Number": "HyperDual | float",
    "_Path": "str | os.PathLike[str]",
    "_Size": "tuple[float, float] | Sequence[float]",
    "_Controls": "ArrayLike | Sequence[ArrayLike]",
    "_Joints": "Sequence[tuple[Joint, ArrayLike | None]]",
    "_RootJoint": 'Literal["free_flyer", "planar", "spherical", "translation"]',
    "_Kind": 'Literal["massless", "negative", "triangle", "singular", "unlikely", "limit"]'
    ' | Literal["unknown", "left_out", "assumed", "mimic"]',
    "_Reference": 'Literal["local", "world", "local_world_aligned"]',
    "_Input": 'Literal["gravity", "armature", "damping"]'
    ' | tuple[Literal["force", "inertia"], str | int] | tuple[Literal["friction"], float]',
    "_Method": 'Literal["aba", "dense", "sparse"]',
    "_Integrator": 'Literal["semi_implicit_euler", "runge_kutta_4", "variational"]',
    "_Status": 'Literal["done", "not_converged", "contacts_not_converged", "not_finite"]',
    "_OfTwo": "Callable[[NDArray[Any], NDArray[Any]], Any]",
    "_Shapes": "list[tuple[str, int, int]]",
    "_Space": "Model | tuple[int, _OfTwo, _OfTwo]",
    "_Scheme": 'Literal["semi_implicit_euler", "runge_kutta_2", "runge_kutta_3", "runge_kutta_4"]',
    "_Polynomial": 'Literal["constant", "linear", "quadratic"]',
    "_Axes": 'Literal["world", "local"] | tuple[Literal["frame"], str]',
    "_Action": "FreeDynamics | ContactDynamics | ImpulseDynamics | FreeInverseDynamics | ContactInverseDynamics"
    " | Lqr | Unicycle | Action | DifferentialAction | ConstrainedAction | ControlRate",
}

# The functions of `condyle.pinocchio`.
SPELLED = [  # the first two functions do not take `data`
    "_spelled_difference",
    "_spelled_integrate",
    "_spelled_crba",
    "centerOfMass",
    "computeCentroidalMomentum",
    "computeCoriolisMatrix",
    "computeFrameJacobian",
    "computeGeneralizedGravity",
    "computeMinverse",
    "forwardKinematics",
    "framesForwardKinematics",
    "getAcceleration",
    "getClassicalAcceleration",
    "getFrameAcceleration",
    "getFrameClassicalAcceleration",
    "getFrameJacobian",
    "getFrameVelocity",
    "getJointJacobian",
    "getVelocity",
    "jacobianCenterOfMass",
    "nonLinearEffects",
    "updateFramePlacements",
]

# Types of arguments, by `Class.name`, `function.name` or the argument's name. Arguments with default None may be None.
ARGUMENTS = {
    "ArrayLike": """
        _DifferentialIk._converge.frames _DifferentialIk._step.frames
        _DifferentialIk._converge.com _DifferentialIk._converge.posture _DifferentialIk._step.com
        _DifferentialIk._step.posture _GlobalIk._solve.targets _GlobalIk._solve.posture
        Model.with_damping.damping Model.with_damping.polynomial Model.with_friction.friction
        Sensitivity._at.K
        A B M Q R S X a acceleration actuation armature axis b d effort_lower effort_upper f f_ext gear gravity lambda_
        lower pi placement point rest stiffness
        q q0 q1 r rotation target tau theta up upper v velocity w x x0 x1 xs Residual.reference Model.effort
        Plan.controls corners durations normal states times touches FrictionContact.size Plan.gains Task.joints
        _check_pose.pose _controller_from_numbers.numbers AugmentedLagrangian.set_multipliers.values
        InteriorPoint.set_multipliers.values Problem.set_parameter.values Problem.set_references.values
        Problem.set_placements.placements
        rollout_many.us
        Problem.set_contact.kp Problem.set_entry_weights.weights ControlRate.weights by_xs""",
    "float | ArrayLike": "Problem.set_weight.weight",
    'Literal["full_step"]': "stop",
    "int | None": "_casadi_hold_knot.t",
    "ArrayLike | None": """
        _DifferentialIk._step.v0 _DifferentialIk._place.velocity Model.append.placement
        ModelBuilder.append.placement ModelBuilder.merge.placement""",
    "Sequence[Sensitivity]": "sensitivities",
    "Sequence[str]": "parameters Sensitivities.gradients.by_knot Sensitivity.gradients.by_knot",
    "tuple[Any, Any] | None": "_solve_many.start",
    "Mapping[str, ArrayLike]": "Problem.set_parameters.values",
    "tuple[Callable[..., object], list[Any]] | None": "_solve_many.vary",
    "Callable[[int], object] | None": "_solve_many.report",
    "Model": "model",
    "Data": "data",
    "_SpelledModel": " ".join(f"{name}.model" for name in ("_SpelledData", *SPELLED)),
    "_SpelledData": " ".join(
        f"{name}.data" for name in SPELLED if name not in ("_spelled_difference", "_spelled_integrate")
    ),
    "ReferenceFrame": " ".join(f"{name}.frame" for name in SPELLED if name.startswith("get") or "FrameJ" in name),
    "_Array": "_SpelledData._leave.com",
    "Force": "_SpelledData._leave.hg",
    "ConstraintSet": "constraints",
    "Sequence[ContactConstraint]": "ConstraintSet.constraints _casadi_hold.constraints",
    "tuple[str, float, float, float, float] | None": "_DifferentialIk.distances",
    "list[float]": "_DifferentialIk._converge.tolerance _GlobalIk.tolerance",
    "str": """
        _DifferentialIk._describe.kind _GlobalIk._describe.kind _GlobalIk.rank _GlobalIk.pairs
        ArmMpc.frame Foot.point.frame Foot.sole.frame
        _Collisions.kind _Collisions._disable.first _Collisions._disable.second _Collisions._fit.kind
        _generate.language Model.from_sdf.model Model.from_sdf_str.model contact function joint_name name prefix tendon
        text FrictionContact.frame Task.frame parameter""",
    "str | int": """
        body frame Model.with_mimic.follower Model.with_mimic.leader getVelocity.joint getAcceleration.joint
        getClassicalAcceleration.joint getJointJacobian.joint""",
    "str | int | None": "Model.append.frame Model.with_frame.parent",
    "Ground": "Simulation.ground",
    "tuple[float, list[float], list[float], list[float]]": "Simulation.__setstate__.state",
    'Literal["link", "joint", "user"]': "ModelBuilder.frame.kind",
    "int": """
        _DifferentialIk._describe.index _GlobalIk._describe.index _GlobalIk._solve.count
        _DistancePairs._evaluate.states _DistancePairs._place.geometry
        Schedule.model Schedule.switch.model
        count facets frame_id grain iterations k knot last max_iterations most moved n nu nv nx priority seed size steps
        sweeps threads Plan.contact _generate.partitions _lend.address _lend.bits _lend.device _casadi_hold.states
        Record.__getitem__.key""",
    "float": """
        _GlobalIk.orientation_weight _GlobalIk.minimum Residual.distances.within
        ArmMpc.clearance ArmMpc.knot WholeBodyMpc.knot
        Foot.point.friction Foot.sole.friction ArmMpc.horizon ArmMpc.latency Foot.point.radius Gait.bound.swing
        Gait.bound.double Gait.pace.swing Gait.pace.double Gait.step.swing Gait.step.double Gait.table.period
        Gait.trot.swing Gait.trot.double Gait.walk.swing Gait.walk.double WholeBodyMpc.horizon
        WholeBodyMpc.latency WholeBodyMpc.swing_height WholeBodyMpc.command.vx WholeBodyMpc.command.vy
        WholeBodyMpc.command.wz WholeBodyMpc.terrain.height
        bias damping delta dt elapsed
        eps1 eps1eps2 eps2 epsilon gain greatest kd kp kv least mu offset passive pitch ratio re
        regularisation
        restitution s smoothing spacing start t tolerance weight AugmentedLagrangian.settings ModelBuilder.armature
        ModelBuilder.friction ModelBuilder.velocity
        fade max_force min_force now then yaw_friction FrictionContact.friction step strictness""",
    "float | None": """
        DifferentialAction.dt FreeDynamics.dt InteriorPoint.settings ArmMpc.budget WholeBodyMpc.budget
        WholeBodyMpc.command.height WholeBodyMpc.prepare.t""",
    "Weights | None": "WholeBodyMpc.weights",
    "ArmWeights | None": "ArmMpc.weights",
    'Literal["model"] | PlanLimits | None': "ArmMpc.limits WholeBodyMpc.limits",
    "tuple[int, int]": "ArmMpc.iterations WholeBodyMpc.iterations",
    "Sequence[str] | ArrayLike": "WholeBodyMpc.touch.feet",
    'Literal["next"] | float': "WholeBodyMpc.set_gait.at",
    "Sequence[Foot]": "WholeBodyMpc.feet",
    "Gait": "WholeBodyMpc.gait WholeBodyMpc.set_gait.gait",
    "Sequence[tuple[str, float, float]]": "Gait.table.swings",
    "tuple[float, float, float]": "WholeBodyMpc.max_acceleration",
    "ArrayLike | Callable[[float], ArrayLike]": "ArmMpc.reset.path ArmMpc.update.path",
    "bool": """
        _solve_many.whole
        _DistancePairs._evaluate.gradients _generate.external_forces batch frames mimic progress strict verbose
        weightless_meshes by_knot FrictionCone.inner Unicycle.terminal _lend.versioned rollout_many.gradients
        rollout_many.states""",
    "list[tuple[int, Residual]]": " ".join(
        f"{kind}Dynamics._from_parts.written"
        for kind in ("Contact", "ContactInverse", "Free", "Impulse", "FreeInverse")
    ),
    "list[int]": "_lend.shape _lend.strides _GlobalIk.counts",
    "Sequence[int]": """
        AugmentedLagrangian.retime.knot_models Fddp.retime.knot_models InteriorPoint.retime.knot_models
        Problem.set_knots.knot_models""",
    "bytes": "_model_from_bytes.data",
    "object": "memo HyperDual.__eq__.value HyperDual.__ne__.value",
    "_Reference": "reference",
    "_Input": "wrt",
    "_Method": "method",
    'Literal["position", "velocity"]': "integrate_jacobian.argument",
    'Literal["from", "to"]': "difference_jacobian.argument",
    "_Path": "path original",
    "_Path | None": "_Collisions.path _Collisions._srdf.path",
    "str | None": "_Collisions.text _Collisions._srdf.text",
    "Sequence[_Kind]": "allow",
    "Sequence[_Path]": "packages",
    "_RootJoint": "root_joint",
    "BodyId": "follower leader parent ModelBuilder.body",
    "dict[str, str | float | bool]": "arguments",
    "BodyId | Sequence[tuple[BodyId, float]]": "ModelBuilder.actuator.joint",
    "Joint": "joint",
    "_Joints": "ModelBuilder.joints",
    "Sequence[str | int]": "Model.joints",
    "Inertia": "inertia part",
    "Sequence[Inertia]": "inertias",
    "tuple[float, float]": """
        damping_polynomial position Unicycle.weights ModelBuilder.actuator.control ModelBuilder.actuator.force
        Limit.soft""",
    "float | tuple[float, float]": "ModelBuilder.body.effort",
    "_Integrator": "Simulation.integrator",
    "Callable[[Control], None]": "control",
    "_Number": "value HyperDual.other HyperDual.x",
    "None": "mod",
    "FrictionCone": "friction Residual.friction_cone.cone",
    "WrenchCone": "Residual.wrench_cone.cone",
    "_Size": "Foot.sole.size WrenchCone.size Residual.center_of_pressure.size",
    "Activation": "activation",
    "Residual": "residual",
    "Sequence[tuple[Sphere | Geometry, Sphere | Geometry]]": "ArmMpc.obstacles Residual.distances.pairs",
    "Sequence[Cost]": "costs",
    "Sequence[Limit]": "limits",
    "dict[int, Sequence[Cost]]": "costs_at",
    "dict[int, Sequence[Limit]]": "limits_at",
    "dict[str, ContactConstraint]": "contacts",
    "_Scheme": "integrator",
    "_Polynomial": "controls",
    "_Action": "action Problem.set_knot.model Problem.terminal",
    "Sequence[_Action]": "models",
    "Sequence[int] | None": "knot_models",
    "_Controls": "us by_us",
    "Problem": "problem",
    "Policy": "policy",
    "AugmentedLagrangian | Fddp | InteriorPoint": "Record.solver Sensitivity.solver _solve_many.solver",
    'Literal["exact", "dynamics", "gauss_newton"]': "Sensitivity.curvature",
    "Callable[[_Array], Problem]": "Sensitivity.define.build",
    # functions whose arguments are arrays of floats, or arrays of numbers that carry their derivatives
    "Callable[[Any, NDArray[Any], NDArray[Any]], tuple[Any, Any]]": "Action.calc DifferentialAction.calc",
    "Callable[[Any, _Array, _Array], dict[str, ArrayLike]]": """
        Action.calc_diff DifferentialAction.calc_diff Residual.own_cost.calc_diff""",
    "_Space": "space",
    "Callable[[Iteration], object]": "callback",
    "Sequence[LqKnot]": "knots",
    "Callable[[int, _Array, _Array], ArrayLike]": "ConstrainedAction.calc",
    "Callable[[Any, NDArray[Any], NDArray[Any]], Any]": "Residual.own.calc Residual.own_cost.calc",
    "Callable[[int, _Array, _Array], tuple[ArrayLike, ArrayLike]]": """
        ConstrainedAction.calc_diff Residual.own.calc_diff""",
    "dict[str, Any]": """
        _solve_many.data
        AugmentedLagrangian.inner AugmentedLagrangian._make.settings Fddp._make.settings
        InteriorPoint._make.settings""",
    "dict[str, Any] | None": "Fddp._make.inner AugmentedLagrangian._make.inner InteriorPoint._make.inner",
    "Sequence[Any]": "parts _DifferentialIk.tasks",
    "float | str | None": "Fddp.settings",
    'Literal["world", "frame"]': "FrictionContact.axes",
    'Literal["wrench", "corners"]': "forces",
    "_Axes | None": "Task.axes",
    "Gains": "Task.gains",
    "Sequence[bool]": "mask",
    "Sequence[FrictionContact]": "WholeBodyController.contacts _controller_from_numbers.contacts",
    "Sequence[Task]": "tasks",
    "Settings": "WholeBodyController.settings _controller_from_numbers.settings",
    "Sequence[tuple[str, int, int]]": "rotations",
    "Plan": "plan",
    "References": "references",
    "Any": """
        _DifferentialIk.limits _GlobalIk.limits
        _borrowed.capsule _casadi_hold_knot.of _lend.owner Model.from_pinocchio.model
        Model.from_mujoco.model""",
    "list[str]": "names _generate.frames inputs _GlobalIk.frames _solve_many.keep",
    "list[ContactConstraint]": "_generate.constraints",
}

# Types of results and properties, by `Class.name` or the function's name. An entry for a class holds for the methods of
# this class. Without an entry, a function that takes `out` returns an array, and a static method returns its class.
SETTABLE = {  # properties that can be assigned, with the type of the value
    "_DistancePairs.cutoff": "float",
    "AugmentedLagrangian.inner": "Mapping[str, Any]",
    "AugmentedLagrangian.settings": "Mapping[str, Any]",
    "Fddp.settings": "Mapping[str, Any]",
}

SIGNATURES = dict.fromkeys(
    ["JointPolicy.__call__", "Policy.__call__"], "($self, t, x)"
)  # of methods whose signatures the interpreter does not report

RESULTS = {
    "tuple[str, list[tuple[str, str]], list[tuple[str, _Shapes, _Shapes, int, int]]]": "_generate",
    "tuple[int, tuple[int, int, int], list[int], list[int] | None, tuple[int, int], int]": "_borrowed",
    "_Array": """
        JointPolicy.__call__ Sensitivity.first_control_by_x0 Sensitivity.gradient WholeBodyMpc.forces
        ContactDynamics.quasi_static FreeDynamics.quasi_static ImpulseDynamics.quasi_static
        FreeInverseDynamics.quasi_static ContactInverseDynamics.quasi_static FrictionCone.rows WrenchCone.rows
        Policy.__call__ Problem._between Problem.parameter Problem.references
        AugmentedLagrangian.predict Fddp.predict InteriorPoint.predict Problem.rollout Problem.x0
        Cholesky.lower Ltdl.diagonal Model.armature Model.damping Model.damping_polynomial
        Model.friction
        Model.gravity Model.inertial_parameters Model.joint_placements Simulation.q Simulation.v
        from_inertia log_cholesky log_cholesky_jacobian neutral pseudo_inertia random_configuration
        FrictionContact.normal Task.joints
        _SpelledData._frame_poses _SpelledData._poses _spelled_crba _spelled_difference _spelled_integrate centerOfMass
        computeCoriolisMatrix computeFrameJacobian computeGeneralizedGravity computeMinverse getFrameJacobian
        getJointJacobian jacobianCenterOfMass nonLinearEffects""",
    "Motion": """
        getAcceleration getClassicalAcceleration getFrameAcceleration getFrameClassicalAcceleration getFrameVelocity
        getVelocity""",
    "Force": "computeCentroidalMomentum _SpelledData.hg",
    "list[_Array]": """
        Sensitivities.gradients Sensitivity.gradients _rnea_pull _DistancePairs._evaluate _SpelledData.com""",
    "tuple[_Array, _Array, _Array]": "_SpelledData._state _DifferentialIk._hold",
    "_Array | None": "Joint.axis FrictionContact.corners",
    "_Array | list[_Array]": "Problem.quasi_static",
    "tuple[_Array, _Array]": """
        FrictionCone.bounds WrenchCone.bounds body_acceleration_derivatives frame_acceleration_derivatives
        frame_classical_acceleration_derivatives""",
    "float": """
        _DistancePairs.cutoff
        HyperDual.eps1 HyperDual.eps1eps2 HyperDual.eps2 HyperDual.re Model.total_mass Simulation.time
        distance kinetic_energy mechanical_energy potential_energy
        FrictionContact.friction FrictionContact.max_force FrictionContact.min_force Plan.activation
        Schedule.spacing Task.weight""",
    "float | None": "FrictionContact.yaw_friction Joint.pitch JointPolicy.end Policy.end",
    "tuple[float, float]": "Plan.span",
    "Data": "_SpelledData._ours",
    "int": """
        _Collisions._fit _DistancePairs.__len__ Sensitivities.__len__ Sensitivities.in_lanes
        _SpelledData._given ConstraintSet.__len__ ConstraintSet.rows Joint.nq Joint.nv Ltdl.nonzeros Model.frame
        Model.joint Model.nbodies Model.nq Model.nv Problem.horizon Problem.ndx Problem.nx Task.priority
        AugmentedLagrangian.retime Fddp.retime InteriorPoint.retime Record.__len__ Schedule.model""",
    "bool": """
        _DifferentialIk._place _GlobalIk._place
        HyperDual.__bool__ HyperDual.__eq__ HyperDual.__ge__ HyperDual.__gt__ HyperDual.__le__
        HyperDual.__lt__ HyperDual.__ne__""",
    "str": """
        _DifferentialIk._describe _GlobalIk._describe
        _Collisions._geometries _Collisions._pairs
        Foot.frame
        Model.name Model.to_json Model.tree Problem.to_json _casadi_hold _casadi_hold_knot FrictionContact.frame
        Task.kind""",
    "str | None": "Task.frame",
    'Literal["world", "frame"]': "FrictionContact.axes",
    'Literal["wrench", "corners"] | None': "FrictionContact.forces",
    "_Axes": "Task.axes",
    "list[bool]": "Task.mask",
    "Gains": "Task.gains",
    "Settings": "WholeBodyController.settings",
    "References": "WholeBodyController.hold",
    "Command": "WholeBodyController.command WholeBodyController.step",
    "KktResiduals": "WholeBodyController.kkt_residuals",
    "None": """
        ArmMpc.place Problem.set_placements WholeBodyController.place
        _Collisions._disable _Collisions._srdf _DistancePairs._place
        ArmMpc.reset JointPolicy.release JointPolicy.stop WholeBodyMpc.command WholeBodyMpc.prepare WholeBodyMpc.reset
        WholeBodyMpc.set_gait WholeBodyMpc.terrain WholeBodyMpc.touch
        _SpelledData._leave _casadi_release forwardKinematics framesForwardKinematics updateFramePlacements
        Simulation.__setstate__
        AugmentedLagrangian.configure AugmentedLagrangian.publish AugmentedLagrangian.reset
        AugmentedLagrangian.set_multipliers AugmentedLagrangian.shift
        Cholesky.factorize ConstraintSet.set_target Fddp.configure Fddp.prepare Fddp.publish Fddp.reset Fddp.shift
        InteriorPoint.configure InteriorPoint.prepare InteriorPoint.publish InteriorPoint.reset
        InteriorPoint.set_multipliers InteriorPoint.shift Ltdl.factorize
        Model.write_mjcf Model.write_urdf ModelBuilder.actuator ModelBuilder.append ModelBuilder.compensate_gravity
        ModelBuilder.frame ModelBuilder.gravity ModelBuilder.merge ModelBuilder.mimic ModelBuilder.spring
        Problem.set_contact Problem.set_costs Problem.set_duration Problem.set_entry_weights Problem.set_knot
        Problem.set_knots Problem.set_parameter Problem.set_parameters Problem.set_references Problem.set_weight
        Problem.set_x0 Record.save Record.stop
        Schedule.forget Schedule.switch Sensitivity.define Simulation.set_state WholeBodyController.track
        _check_pose _check_rotations check""",
    "Plan": "WholeBodyMpc.plan",
    'tuple[_Array, Literal["solved", "relaxed", "stopped"], _Array, list[tuple[str, int]]]': "_DifferentialIk._step",
    "tuple[_Array, int, _Array]": "_DifferentialIk._converge",
    "tuple[int, float] | None": "_DifferentialIk._nearest",
    "tuple[_Array, list[bool], _Array, list[int], list[list[tuple[str, int]]]]": "_GlobalIk._solve",
    "Report": "ArmMpc.report WholeBodyMpc.report",
    "JointPolicy": "ArmMpc.policy ArmMpc.update WholeBodyMpc.policy WholeBodyMpc.update",
    'Literal["plan", "open_loop", "damping"]': "JointPolicy.source",
    "WholeBodyController": "_controller_from_numbers",
    "slice": "ConstraintSet.range",
    "list[int]": "Ltdl.order Model.idx_qs Model.idx_vs Model.nqs Model.nvs Model.parents Model.singular_joints",
    "int | None": "_DistancePairs._find",
    "list[tuple[int, int, str]]": "_DistancePairs._replacements",
    "list[tuple[str, str, str]]": "_Collisions._meshes",
    "list[str]": "_Collisions._warnings Model.body_names Model.joint_types Model.names",
    "list[ModelWarning]": "Model.warnings",
    "list[Spring]": "Model.springs",
    "list[GravityCompensation]": "Model.gravity_compensation",
    "list[Actuator]": "Model.actuators",
    "list[tuple[int, float]]": "Ltdl.row",
    "list[tuple[float, int]]": "Schedule.switches",
    "tuple[list[int], _Array]": "Schedule.knots",
    "tuple[Any, ...]": "HyperDual.__reduce__ Model.__reduce__ Simulation.__reduce__",
    "HyperDual": "HyperDual",
    "Model": """
        ArmMpc.model WholeBodyMpc.model
        _SpelledModel.ours Model.__copy__ Model.__deepcopy__ Model.append Model.from_pinocchio Model.lock
        Model.with_armature Model.with_damping Model.with_frame Model.with_friction Model.with_gravity
        Model.with_inertias Model.with_limits Model.with_mimic
        ModelBuilder.build _model_from_bytes arm7 humanoid quadruped""",
    "Limits": "Model.limits",
    "Any": "Model.to_pinocchio _lend",
    "dict[str, _Array]": """
        Problem.parameter_values Model.keyframes Model.keyframe_velocities Model.keyframe_controls
        Model.reference_configurations Model.reference_configurations_str""",
    "list[Frame]": "Model.frames",
    "list[Inertia]": "Model.inertias",
    "list[Joint | None]": "Model.joints",
    "list[Mimic | None]": "Model.mimics",
    "BodyId": "ModelBuilder.body ModelBuilder.chain ModelBuilder.spherical_zyx",
    "Inertia": "from_log_cholesky to_inertia",
    "AssemblySize": "DivideConquer.size",
    "_Status": "Simulation.run Simulation.step",
    "Ground | None": "Simulation.ground",
    "GroundContacts": "Simulation.contacts",
    "Solution": """
        AugmentedLagrangian.resume AugmentedLagrangian.solve Fddp.feedback Fddp.resume Fddp.solve
        InteriorPoint.feedback InteriorPoint.resume InteriorPoint.solve InteriorPoint.tick""",
    "RecordedTick": "Record.__getitem__",
    "Difference | None": "Record.replay",
    "tuple[Problem, Fddp | InteriorPoint | AugmentedLagrangian]": "Record.start",
    "tuple[dict[str, Any], list[tuple[int, BaseException]]]": "_solve_many",
    "Evaluation": "Problem.evaluate Problem._evaluate",
    "dict[str, int]": "Problem.parameters",
    "list[LqKnot]": "Problem.derivatives",
    "ManyRollouts": "rollout_many",
    "SweepResult": "Sweep.run",
    "Sensitivity": "Sensitivity.prepare",
    "SensitivityReport": "Sensitivity.report",
    "BoundGradients": "Sensitivity.bounds",
    "tuple[_Array, _Array | list[_Array]]": "Sensitivity.jacobian",
    "Solution | None": "AugmentedLagrangian.solution Fddp.solution InteriorPoint.solution",
    "Outcome": "AugmentedLagrangian.outcome InteriorPoint.outcome",
    "Mapping[str, Any]": """
        AugmentedLagrangian.inner AugmentedLagrangian.settings Fddp.settings InteriorPoint.settings""",
    "AllTerms": "compute_all_terms",
    "CentroidalMap": "centroidal_map",
    "CentroidalMapRate": "centroidal_map_rate",
    "RneaDerivatives": "rnea_derivatives",
    "AbaDerivatives": "aba_derivatives",
    "RneaHessian": "rnea_hessian",
    "AbaHessian": "aba_hessian",
    "RneaSecondDerivatives": "rnea_second_derivatives",
    "CentroidalDerivatives": "centroidal_derivatives",
    "EnergyDerivatives": "energy_derivatives",
    "CoriolisDerivatives": "coriolis_derivatives",
    "PassiveDerivatives": "passive_torque_derivatives",
    "dict[str, ContactConstraint | Coupling]": "Model.constraints",
    "Constrained": "constrained_dynamics",
    "ConstrainedDerivatives": "constrained_dynamics_derivatives",
    "ConstrainedEquations": "constrained_dynamics_equations",
    "Impulse": "impulse_dynamics",
    "ImpulseDerivatives": "impulse_dynamics_derivatives",
}


class Table:
    """A table from names to types. The object records names that are missing in the table, and names that were not
    used.
    """

    def __init__(self, names_by_type: dict[str, str]) -> None:
        self.types = {name: kind for kind, names in names_by_type.items() for name in names.split()}
        self.unused = set(self.types)
        self.missing: list[str] = []

    def find(self, *names: str, otherwise: str | None = None) -> str:
        """Returns the type of the first of these names that the table contains."""
        for name in names:
            if name in self.types:
                self.unused.discard(name)
                return self.types[name]
        if otherwise is None:
            self.missing.append(names[0])
        return otherwise or "object"


def wrapped(head: str, parts: list[str], tail: str, indent: str = "") -> str:
    """Formats a definition or a list as Ruff does: in one line if the text fits, else with all parts in a second line,
    else with each part in its own line.
    """
    inside = ", ".join(parts)
    if len(indent + head + inside + tail) <= WIDTH:
        return indent + head + inside + tail
    if len(indent + "    " + inside) > WIDTH:
        inside = f",\n{indent}    ".join(parts) + ","
    return f"{indent}{head}\n{indent}    {inside}\n{indent}{tail}"


def docstring(item: Any, indent: str) -> str:
    """Returns the Python code of an item's docstring."""
    text = (inspect.getdoc(item) or "").replace("\\", "\\\\")
    lines = [f"{indent}{line}".rstrip() for line in text.splitlines()]
    return f'{indent}"""' + "\n".join(lines).lstrip() + ('"""' if len(lines) == 1 else f'\n{indent}"""')


class Writer:
    """A writer of a module's items. The named tuples that occur in types are defined in another module."""

    def __init__(self, module: ModuleType, types: ModuleType) -> None:
        self.module, self.types = module, types
        self.arguments, self.results = Table(ARGUMENTS), Table(RESULTS)

    def out(self, result: str) -> str:
        """Returns the type of the argument `out` for a function with this result: arrays that the function fills, such
        as an earlier result.
        """
        if result == "_Array":
            return result
        members = re.findall("_Array", result)
        if hasattr(self.types, result):
            members = [str(member) for member in getattr(self.types, result).__annotations__.values()]
        if all("array" in member.lower() for member in members):
            return f"tuple[{', '.join('_Array' for _ in members)}] | list[_Array]"
        return f"{result} | Sequence[_Array]"

    def function(self, item: Any, name: str, owner: str = "", indent: str = "") -> str:
        """Writes a function, a method of the class `owner`, or the constructor of this class."""
        constructor = name == "__new__"
        full = owner if constructor else f"{owner}.{name}".lstrip(".")
        signature = SIGNATURES.get(full, item.__text_signature__)
        arguments = ast.parse(f"def f{signature.replace('$self', 'self')}: ...").body[0].args
        positional = arguments.posonlyargs + arguments.args
        names = [argument.arg for argument in positional]
        static = owner != "" and not constructor and names[:1] != ["self"]
        if constructor:
            result = owner
        elif static:
            result = self.results.find(full, otherwise=owner)
        else:
            result = self.results.find(full, owner, otherwise="_Array" if "out" in names else None)

        def parameter(argument: ast.arg, default: ast.expr | None = None) -> str:
            name = argument.arg
            if name == "self":
                return name
            usual = self.out(result) if name == "out" else None
            kind = self.arguments.find(f"{full}.{name}", f"{owner}.{name}", name, otherwise=usual)
            if default is None:
                return f"{name}: {kind}"
            value = ast.unparse(default)
            if isinstance(default, ast.Constant) and isinstance(default.value, str):
                value = json.dumps(default.value)
            return f"{name}: {kind}{' | None' if value == 'None' != kind else ''} = {value}"

        defaults = [None] * (len(positional) - len(arguments.defaults)) + arguments.defaults
        parts = ["cls"] * constructor + [parameter(*pair) for pair in zip(positional, defaults, strict=True)]
        if arguments.posonlyargs:
            parts.insert(len(arguments.posonlyargs), "/")
        if arguments.kwonlyargs:
            parts.append("*")
        parts += [parameter(*pair) for pair in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)]
        if arguments.kwarg:
            parts.append(f"**{parameter(arguments.kwarg)}")

        decorator = f"{indent}@staticmethod\n" if static else ""
        if constructor or not item.__doc__ or isinstance(item, WrapperDescriptorType):
            return decorator + wrapped(f"def {name}(", parts, f") -> {result}: ...", indent)
        head = wrapped(f"def {name}(", parts, f") -> {result}:", indent)
        return f"{decorator}{head}\n{docstring(item, indent + '    ')}"

    def klass(self, item: type, name: str) -> str:
        """Writes a class with its members: constructor, properties, methods."""
        members, known = vars(item), self.results.types
        final = "@disjoint_base\n" if item.__flags__ & DERIVABLE else "@final\n"
        text = f"{final}class {name}:\n{docstring(item, '    ')}\n\n"
        if item.__text_signature__ is not None:
            text += self.function(item, "__new__", name, "    ") + "\n"
        for member in sorted(k for k, v in members.items() if inspect.isdatadescriptor(v)):
            head = f"    @property\n    def {member}(self) -> {self.results.find(f'{name}.{member}')}:\n"
            text += head + docstring(members[member], "        ") + "\n\n"
            if kind := SETTABLE.get(f"{name}.{member}"):
                text += f"    @{member}.setter\n    def {member}(self, {member}: {kind}) -> None: ...\n"
        for member, value in sorted(members.items()):  # sorted, because otherwise the linker determines the order
            special = member.startswith("__") and name not in known and f"{name}.{member}" not in known
            if callable(value) and not special and member not in ("__new__", "__repr__"):
                method = self.function(getattr(item, member), member, name, "    ")
                text += method + ("\n" if method.endswith(" ...") else "\n\n")
        return text.rstrip()

    def items(self) -> Iterator[str]:
        """Yields constants, exceptions, and then classes and functions in the order of the module."""
        items = {name: getattr(self.module, name) for name in self.module.__all__}
        yield "\n".join(f"{name}: {type(item).__name__}" for name, item in items.items() if not callable(item))
        for name, item in items.items():
            if inspect.isclass(item) and issubclass(item, Exception):
                yield f"class {name}({item.__base__.__name__}):\n{docstring(item, '    ')}"
        for name, item in items.items():
            if inspect.isclass(item) and not issubclass(item, Exception):
                yield self.klass(item, name)
            elif inspect.isbuiltin(item):
                yield self.function(item, name)


def alias(name: str, value: str) -> str:
    """Returns the definition of a type alias."""
    line = f"{name}: TypeAlias = {value}"
    if len(line) > WIDTH:
        inside = value if len(value) + 4 <= WIDTH else re.sub(r" \| (?![^\[]*\])", "\n    | ", value)
        line = f"{name}: TypeAlias = (\n    {inside}\n)"
    return line


def stub(module: ModuleType, types: ModuleType, others: list[ModuleType]) -> str:
    """Returns the text of the file. `types` defines the named tuples, `others` define other Python classes."""
    writer = Writer(module, types)
    body = "\n\n".join(writer.items())
    aliases = "\n".join(alias(name, value) for name, value in ALIASES.items())
    for table, name in (writer.arguments, "ARGUMENTS"), (writer.results, "RESULTS"):
        if table.missing or table.unused:
            raise SystemExit(f"{name}: missing are {table.missing}, and nothing needs {sorted(table.unused)}")
    words = set(re.findall(r"\w+", re.sub(r'"""(.|\n)*?"""', "", body + aliases)))
    exported = set(module.__all__)
    imports = []
    for part in sorted((types, *others), key=lambda part: part.__name__):
        own = [name for name, item in sorted(vars(part).items()) if type(item) is type and name in words - exported]
        head = f"from .{part.__name__.split('.')[-1]} import "
        line = head + ", ".join(own)
        imports.append(line if len(line) <= WIDTH else wrapped(f"{head}(", own, ")"))
    # `_spelling` is not in `others`, because most of its classes (`SE3`, `Model`) have the names of Condyle's classes.
    imports = sorted([*imports, "from ._spelling import Force, Motion, ReferenceFrame"])
    names = sorted(module.__all__, key=lambda name: (not name.isupper(), not name[0].isupper(), name))
    return f'''\
"""{inspect.getdoc(module)}"""

# Written by python/stubs.py from the extension module. Do not edit.

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

{chr(10).join(imports)}

{wrapped("__all__ = [", [f'"{name}"' for name in names], "]")}

{aliases}

{body}
'''


def main() -> None:
    """Writes the stub file, or compares the text with the existing file."""
    sys.path.pop(0)  # the folder of the sources, where the module is not built
    from condyle import _condyle, _inertia, _mpc, _types, _wholebody, distances

    text = stub(_condyle, _types, [_inertia, _mpc, _wholebody, distances])
    if sys.argv[1:] != ["--check"]:
        FILE.write_text(text, encoding="utf-8")
    elif FILE.read_text(encoding="utf-8") != text:
        raise SystemExit(f"{FILE} is out of date: run `python {__file__}`")


if __name__ == "__main__":
    main()
