"""Named tuples: results of functions that return more than one array, and some arguments. One module for each topic."""

from . import constraints, dynamics, model, optimal, simulation
from .constraints import (
    Constrained,
    ConstrainedDerivatives,
    ConstrainedEquations,
    ContactConstraint,
    Coupling,
    Impulse,
    ImpulseDerivatives,
)
from .dynamics import (
    AbaDerivatives,
    AbaHessian,
    AllTerms,
    CentroidalDerivatives,
    CentroidalMap,
    CentroidalMapRate,
    CoriolisDerivatives,
    EnergyDerivatives,
    PassiveDerivatives,
    RneaDerivatives,
    RneaHessian,
    RneaSecondDerivatives,
)
from .model import (
    Actuator,
    AssemblySize,
    Frame,
    GravityCompensation,
    Limits,
    Mimic,
    ModelWarning,
    ReadOnly,
    Spring,
)
from .optimal import (
    BoundGradients,
    ConstraintRows,
    Difference,
    Evaluation,
    Iteration,
    LqKnot,
    ManyRollouts,
    Outcome,
    PlanPoint,
    RecordedTick,
    SensitivityReport,
    Solution,
    Sphere,
    SweepResult,
    Timings,
    Violation,
)
from .printing import short
from .simulation import (
    Control,
    Ground,
    GroundContacts,
)

__all__ = [
    "AbaDerivatives",
    "AbaHessian",
    "Actuator",
    "AllTerms",
    "AssemblySize",
    "BoundGradients",
    "CentroidalDerivatives",
    "CentroidalMap",
    "CentroidalMapRate",
    "Constrained",
    "ConstrainedDerivatives",
    "ConstrainedEquations",
    "ConstraintRows",
    "ContactConstraint",
    "Control",
    "CoriolisDerivatives",
    "Coupling",
    "Difference",
    "EnergyDerivatives",
    "Evaluation",
    "Frame",
    "GravityCompensation",
    "Ground",
    "GroundContacts",
    "Impulse",
    "ImpulseDerivatives",
    "Iteration",
    "Limits",
    "LqKnot",
    "ManyRollouts",
    "Mimic",
    "ModelWarning",
    "Outcome",
    "PassiveDerivatives",
    "PlanPoint",
    "ReadOnly",
    "RecordedTick",
    "RneaDerivatives",
    "RneaHessian",
    "RneaSecondDerivatives",
    "SensitivityReport",
    "Solution",
    "Sphere",
    "Spring",
    "SweepResult",
    "Timings",
    "Violation",
    "short",
]

# public modules of these classes, for users and for pickle
for _topic, _public in (
    (model, "condyle"),
    (dynamics, "condyle"),
    (constraints, "condyle"),
    (optimal, "condyle.optimal"),
    (simulation, "condyle.simulation"),
):
    for _class in [_item for _item in vars(_topic).values() if isinstance(_item, type)]:
        if issubclass(_class, tuple) and _class.__module__ == _topic.__name__:
            setattr(_class, "__repr__", short)  # noqa: B010 - type checkers do not allow a method to be replaced
            _class.__module__ = _public
ModelWarning.__module__ = "condyle"
