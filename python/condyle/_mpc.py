"""Settings and reports of controllers at a rate: named tuples."""

from typing import Literal, NamedTuple


class Weights(NamedTuple):
    """Weights of the costs of a `WholeBodyMpc`. Errors are squared: a weight w costs ½ w e² per second."""

    place: float = 50.0
    """Weight of the trunk's horizontal position (m)."""
    height: float = 2000.0
    """Weight of the trunk's height (m)."""
    tilt: float = 400.0
    """Weight of the trunk's roll and pitch (rad)."""
    heading: float = 100.0
    """Weight of the trunk's heading (rad)."""
    forwards: float = 100.0
    """Weight of the velocity forwards (m/s)."""
    sideways: float = 100.0
    """Weight of the velocity to the left (m/s)."""
    vertical: float = 50.0
    """Weight of the vertical velocity (m/s)."""
    rotation: float = 3.0
    """Weight of the trunk's rates of rotation (rad/s)."""
    legs: tuple[float, float] = (2.0, 0.02)
    """Weights of the joints of legs: position (rad) and velocity (rad/s)."""
    upper_body: tuple[float, float] = (20.0, 0.3)
    """Weights of the other joints: position (rad) and velocity (rad/s)."""
    effort: float = 1.5
    """Weight of an effort, relative to its limit."""
    swing: tuple[float, float] = (300.0, 3e4)
    """Weights of the position of a swinging foot: horizontal and vertical (m)."""
    level: float = 1e3
    """Weight of the tilt of a swinging sole (sine)."""
    end: float = 0.1
    """Weight of the state at the end of the horizon, in seconds of a knot's cost."""


class ArmWeights(NamedTuple):
    """Weights of the costs of an `ArmMpc`. Errors are squared: a weight w costs ½ w e² per second."""

    position: float = 1e5
    """Weight of the frame's position (m)."""
    rotation: float = 1e3
    """Weight of the frame's rotation (rad)."""
    posture: float = 0.1
    """Weight of the deviation from the posture (rad)."""
    velocity: float = 0.1
    """Weight of the velocities of the joints (rad/s)."""
    effort: float = 1.0
    """Weight of the effort beyond gravity, relative to its limit."""


class PlanLimits(NamedTuple):
    """Limits of the robot that the plan keeps. Friction cones are always kept."""

    efforts: bool = True
    """Whether the efforts of the joints are limited."""
    positions: bool = True
    """Whether the positions of the joints are limited. They may give way at a high cost, because a measured position
    can be outside."""
    velocities: bool = True
    """Whether the velocities of the joints are limited. They may give way like limits of positions."""


class Report(NamedTuple):
    """Report of a tick of a controller."""

    status: Literal["no_plan", "planned", "fallback", "invalid_state", "restarted", "failed"]
    """Result of the tick.

    - 'no_plan': the controller has no plan yet;
    - 'planned': the plan is new;
    - 'fallback': the sweep failed; the new plan is the last one, simulated from the measured state;
    - 'invalid_state': the measured state was not finite, so the last plan remains in use;
    - 'restarted': the horizon began anew from the measured state;
    - 'failed': no finite plan was found, so the last plan remains in use.
    """
    time: float
    """The time at which knot 0 of the plan begins (s)."""
    solver: str | None
    """The status of the solver; None before the first tick."""
    iterations: int
    """The number of linearisations of the tick."""
    gap: float
    """The largest gap of the plan before the tick."""
    cost: float
    """The cost of the plan before the tick."""
    references: float
    """The duration of references and of the shift of the horizon (s)."""
    solve: float
    """The duration of the solver's work (s)."""
    stands: tuple[bool, ...]
    """Whether each foot should be on the ground now."""
    command: tuple[float, float, float]
    """The commanded velocity now: forwards, to the left (m/s), and turning (rad/s)."""

    @property
    def is_new(self) -> bool:
        """Whether the tick made a new plan."""
        return self.status in ("planned", "fallback", "restarted")
