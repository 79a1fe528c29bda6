"""Rigid-body dynamics with exact derivatives, for MPC and DDP.

A `Model` is a robot and never changes; a `Data` is scratch memory for one thread; an algorithm is a function of both:

>>> import condyle
>>> quadruped = condyle.robots.quadruped()
>>> data = condyle.Data(quadruped)
>>> q = condyle.neutral(quadruped)
>>> a = condyle.aba(quadruped, data, q, v=[0.0] * 18, tau=[0.0] * 18)
>>> round(float(a[2]), 6)  # it falls
-9.81

Numbers and layout are the same as in Pinocchio: linear parts before angular parts, quaternions x, y, z, w, and joints
in the same order. Functions return new arrays, or fill the arrays given as `out`. An argument may be any object that
NumPy can convert to an array of real numbers; float64 C-contiguous arrays are read without a copy. A wrong shape is a
`ValueError`.

One call can compute many states: positions, velocities, efforts and forces may have an additional first axis. The
results then have this axis, too. Dynamics and their derivatives are computed in SIMD lanes for several states at once.
The call releases the interpreter's lock and uses the number of threads for which the `Data` was made:

>>> arm = condyle.robots.arm7()
>>> data = condyle.Data(arm, threads=2)
>>> condyle.crba(arm, data, np.zeros((100, 7))).shape
(100, 7, 7)

`out` may be an input, or share memory with an input. Two arrays of `out` may not share memory. Batches and solves
release the interpreter's lock while they compute. During this time no other thread may write to the arrays of the call,
since the call would read a mix of old and new numbers.

A forked process may use all objects that it has inherited, and starts its own threads. Signals are checked during a
call, every 10 ms in batches and every 25 ms in solves and simulations. An exception of a signal handler, such as
KeyboardInterrupt for Ctrl-C, ends the call. Then the `solution` of a solver is the best iterate, a simulation has the
state after its last step, and `out` contains the results that were computed before.

The environment variable `CONDYLE_LEVEL` chooses the SIMD level: "baseline", "neon", "avx2" or "avx512". If the
processor does not support this level, or the name is unknown, the import fails. `LEVEL` is the level in use.

Functions of the state that you write are differentiated exactly, with `HyperDual` numbers in arrays of objects:

>>> def effort(x):
...     return (condyle.rnea(arm, data, x[:7], x[7:], np.zeros(7)) ** 2).sum()
>>> value, by_q_and_v = condyle.gradient(arm, np.full(14, 0.3), effort)

The names by topic; for details of a name see for example `help(condyle.rnea)`:

Robots: `Model` (from URDF, MJCF, SDF), `ModelBuilder`, `Joint`, `Inertia`, `Mimic`, `Coupling`, `BodyId`, `WORLD`,
    `Frame`, `Limits`, `Spring`, `GravityCompensation`, `Actuator`, `ModelWarning`, `load` (by a robot's name),
    `robots`, `inertial_parameters`; `Data`, scratch memory
Dynamics: `rnea`, `aba`, `crba`, `minv`, `nonlinear_effects`, `gravity`, `static_torque`, `coriolis_matrix`,
    `forward_dynamics`, `compute_all_terms` (`AllTerms`), `passive_torque`; `DivideConquer` (`AssemblySize`)
Derivatives of dynamics: `rnea_derivatives` (`RneaDerivatives`), `aba_derivatives` (`AbaDerivatives`),
    `static_torque_derivative`, `coriolis_derivatives` (`CoriolisDerivatives`),
    `passive_torque_derivatives` (`PassiveDerivatives`), `rnea_input_derivative`, `aba_input_derivative`
Second derivatives: `rnea_hessian` (`RneaHessian`), `aba_hessian` (`AbaHessian`), `rnea_second_derivatives`
    (`RneaSecondDerivatives`)
Derivatives of your own functions: `gradient`, `jacobian`, `hessian`, `HyperDual`
Bodies and frames: `forward_kinematics`, `frame_placement`, `frame_jacobian`, `frame_velocity`, `frame_acceleration`,
    `frame_classical_acceleration`, `frame_jacobian_rate`, `body_jacobian`, `body_velocity`, `body_acceleration`,
    `body_classical_acceleration`, `body_jacobian_rate`; of points: `frame_point_jacobian`, `frame_point_velocity`,
    `body_point_jacobian`, `body_point_velocity`; derivatives: `frame_velocity_derivative`,
    `frame_acceleration_derivatives`, `frame_classical_acceleration_derivatives`, `body_velocity_derivative`,
    `body_acceleration_derivatives`
Positions: `neutral`, `random_configuration`, `integrate`, `difference`, `interpolate`, `distance`, `normalize`,
    `integrate_jacobian`, `difference_jacobian`, `transport`
Centre of mass, momentum, energy: `com`, `com_velocity`, `com_acceleration`, `com_jacobian`, `centroidal_map`
    (`CentroidalMap`), `centroidal_map_rate` (`CentroidalMapRate`), `centroidal_momentum`, `centroidal_momentum_rate`,
    `centroidal_derivatives` (`CentroidalDerivatives`), `kinetic_energy`, `potential_energy`, `mechanical_energy`,
    `energy_derivatives` (`EnergyDerivatives`)
Contacts, loops, impacts: `ContactConstraint`, `ConstraintSet`, `constrained_dynamics` (`Constrained`),
    `constrained_dynamics_derivatives` (`ConstrainedDerivatives`), `constrained_dynamics_equations`
    (`ConstrainedEquations`), `impulse_dynamics` (`Impulse`), `impulse_dynamics_derivatives` (`ImpulseDerivatives`)
Poses, motions, forces: `SE3`, `Motion`, `Force`, `exp3`, `log3`, `exp6`, `log6`, `Jexp6`, `Jlog6`; more in `algebra`
Regressors: `joint_torque_regressor`, `kinetic_energy_regressor`, `potential_energy_regressor`
Factors of the inertia matrix: `Ltdl`, `Cholesky`
Errors: `Error`, `ParseError`, `ModelError`, `NotPhysicalError`
Many solves: `sweep`, `sweep_chunks` (`Variations`), in this process or on a Ray cluster; `LEVEL`, the SIMD level
Modules: `optimal` (FDDP, DDP and their problems), `distances` (between shapes), `ik` (inverse kinematics), `mpc`
    (controllers at a rate), `wholebody` (control), `simulation`, `algebra` (poses, motions, forces), `conventions`
    (other libraries' numbers). Further modules must be imported by name: `casadi`, `pinocchio` (Pinocchio's names of
    functions), `crocoddyl` (Crocoddyl's problems), `codegen` (straight-line C), `cuda` (kernels), `torch` and `jax`
    (dynamics and solutions of problems as differentiable operations of PyTorch and JAX) and `viz` (pictures)
"""

from . import algebra, conventions, distances, ik, inertial_parameters, mpc, optimal, robots, simulation, wholebody
from ._condyle import (
    LEVEL,
    WORLD,
    BodyId,
    Cholesky,
    ConstraintSet,
    Data,
    DivideConquer,
    Error,
    HyperDual,
    Joint,
    Ltdl,
    Model,
    ModelBuilder,
    ModelError,
    NotPhysicalError,
    ParseError,
    __version__,
    aba,
    aba_derivatives,
    aba_hessian,
    aba_input_derivative,
    body_acceleration,
    body_acceleration_derivatives,
    body_classical_acceleration,
    body_jacobian,
    body_jacobian_rate,
    body_point_jacobian,
    body_point_velocity,
    body_velocity,
    body_velocity_derivative,
    centroidal_derivatives,
    centroidal_map,
    centroidal_map_rate,
    centroidal_momentum,
    centroidal_momentum_rate,
    com,
    com_acceleration,
    com_jacobian,
    com_velocity,
    compute_all_terms,
    constrained_dynamics,
    constrained_dynamics_derivatives,
    constrained_dynamics_equations,
    coriolis_derivatives,
    coriolis_matrix,
    crba,
    difference,
    difference_jacobian,
    distance,
    energy_derivatives,
    forward_dynamics,
    forward_kinematics,
    frame_acceleration,
    frame_acceleration_derivatives,
    frame_classical_acceleration,
    frame_classical_acceleration_derivatives,
    frame_jacobian,
    frame_jacobian_rate,
    frame_placement,
    frame_point_jacobian,
    frame_point_velocity,
    frame_velocity,
    frame_velocity_derivative,
    gravity,
    impulse_dynamics,
    impulse_dynamics_derivatives,
    integrate,
    integrate_jacobian,
    interpolate,
    joint_torque_regressor,
    kinetic_energy,
    kinetic_energy_regressor,
    mechanical_energy,
    minv,
    neutral,
    nonlinear_effects,
    normalize,
    passive_torque,
    passive_torque_derivatives,
    potential_energy,
    potential_energy_regressor,
    random_configuration,
    rnea,
    rnea_derivatives,
    rnea_hessian,
    rnea_input_derivative,
    rnea_second_derivatives,
    static_torque,
    static_torque_derivative,
    transport,
)
from ._differentiate import gradient, hessian, jacobian
from ._inertia import Inertia
from ._load import load
from ._sweep import sweep, sweep_chunks
from ._types import (
    AbaDerivatives,
    AbaHessian,
    Actuator,
    AllTerms,
    AssemblySize,
    CentroidalDerivatives,
    CentroidalMap,
    CentroidalMapRate,
    Constrained,
    ConstrainedDerivatives,
    ConstrainedEquations,
    ContactConstraint,
    CoriolisDerivatives,
    Coupling,
    EnergyDerivatives,
    Frame,
    GravityCompensation,
    Impulse,
    ImpulseDerivatives,
    Limits,
    Mimic,
    ModelWarning,
    PassiveDerivatives,
    RneaDerivatives,
    RneaHessian,
    RneaSecondDerivatives,
    Spring,
)
from ._variations import Variations
from .algebra import SE3, Force, Jexp6, Jlog6, Motion, exp3, exp6, log3, log6

__all__ = [
    "LEVEL",
    "SE3",
    "WORLD",
    "AbaDerivatives",
    "AbaHessian",
    "Actuator",
    "AllTerms",
    "AssemblySize",
    "BodyId",
    "CentroidalDerivatives",
    "CentroidalMap",
    "CentroidalMapRate",
    "Cholesky",
    "Constrained",
    "ConstrainedDerivatives",
    "ConstrainedEquations",
    "ConstraintSet",
    "ContactConstraint",
    "CoriolisDerivatives",
    "Coupling",
    "Data",
    "DivideConquer",
    "EnergyDerivatives",
    "Error",
    "Force",
    "Frame",
    "GravityCompensation",
    "HyperDual",
    "Impulse",
    "ImpulseDerivatives",
    "Inertia",
    "Jexp6",
    "Jlog6",
    "Joint",
    "Limits",
    "Ltdl",
    "Mimic",
    "Model",
    "ModelBuilder",
    "ModelError",
    "ModelWarning",
    "Motion",
    "NotPhysicalError",
    "ParseError",
    "PassiveDerivatives",
    "RneaDerivatives",
    "RneaHessian",
    "RneaSecondDerivatives",
    "Spring",
    "Variations",
    "__version__",
    "aba",
    "aba_derivatives",
    "aba_hessian",
    "aba_input_derivative",
    "algebra",
    "body_acceleration",
    "body_acceleration_derivatives",
    "body_classical_acceleration",
    "body_jacobian",
    "body_jacobian_rate",
    "body_point_jacobian",
    "body_point_velocity",
    "body_velocity",
    "body_velocity_derivative",
    "centroidal_derivatives",
    "centroidal_map",
    "centroidal_map_rate",
    "centroidal_momentum",
    "centroidal_momentum_rate",
    "com",
    "com_acceleration",
    "com_jacobian",
    "com_velocity",
    "compute_all_terms",
    "constrained_dynamics",
    "constrained_dynamics_derivatives",
    "constrained_dynamics_equations",
    "conventions",
    "coriolis_derivatives",
    "coriolis_matrix",
    "crba",
    "difference",
    "difference_jacobian",
    "distance",
    "distances",
    "energy_derivatives",
    "exp3",
    "exp6",
    "forward_dynamics",
    "forward_kinematics",
    "frame_acceleration",
    "frame_acceleration_derivatives",
    "frame_classical_acceleration",
    "frame_classical_acceleration_derivatives",
    "frame_jacobian",
    "frame_jacobian_rate",
    "frame_placement",
    "frame_point_jacobian",
    "frame_point_velocity",
    "frame_velocity",
    "frame_velocity_derivative",
    "gradient",
    "gravity",
    "hessian",
    "ik",
    "impulse_dynamics",
    "impulse_dynamics_derivatives",
    "inertial_parameters",
    "integrate",
    "integrate_jacobian",
    "interpolate",
    "jacobian",
    "joint_torque_regressor",
    "kinetic_energy",
    "kinetic_energy_regressor",
    "load",
    "log3",
    "log6",
    "mechanical_energy",
    "minv",
    "mpc",
    "neutral",
    "nonlinear_effects",
    "normalize",
    "optimal",
    "passive_torque",
    "passive_torque_derivatives",
    "potential_energy",
    "potential_energy_regressor",
    "random_configuration",
    "rnea",
    "rnea_derivatives",
    "rnea_hessian",
    "rnea_input_derivative",
    "rnea_second_derivatives",
    "robots",
    "simulation",
    "static_torque",
    "static_torque_derivative",
    "sweep",
    "sweep_chunks",
    "transport",
    "wholebody",
]
