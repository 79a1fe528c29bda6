"""The class `Inertia`: inertias from numbers or of simple shapes, transformations of inertias to other frames, and sums
of inertias.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._types import short

_Array = NDArray[np.float64]


def parallel_axes(mass: ArrayLike, com: _Array) -> _Array:
    """Returns m (c·c 1 − c cᵀ), the contribution of a mass m at c to the rotational inertia about the origin, (…, 3,
    3).
    """
    square = (com * com).sum(-1)[..., None, None] * np.eye(3)
    out: _Array = np.asarray(mass)[..., None, None] * (square - com[..., :, None] * com[..., None, :])
    return out


class Inertia(NamedTuple):
    """The inertia of a body, in the axes of its frame.

    For an inertia I, I * v is the momentum at velocity v, a `condyle.algebra.Motion`. X * I, where X is an `SE3`, is
    the inertia in another frame. I + J is the inertia of two connected bodies; both inertias are given in the same
    frame.

    >>> from condyle.algebra import SE3, Motion
    >>> rod = condyle.Inertia.from_cylinder(2.0, radius=0.05, length=1.0)
    >>> at = SE3(np.eye(3), [0.0, 0.0, 0.5])
    >>> hammer = at * rod + SE3(np.eye(3), [0.0, 0.0, 1.0]) * condyle.Inertia.from_box(3.0, [0.2, 0.1, 0.1])
    >>> hammer.mass, hammer.com.tolist()
    (5.0, [0.0, 0.0, 0.8])
    >>> (hammer * Motion([1.0, 0.0, 0.0], [0.0, 0.0, 0.0])).linear.tolist()
    [5.0, 0.0, 0.0]
    """

    mass: float
    """The mass of the body (kg)."""
    com: _Array
    """The centre of mass in the body's frame (m), 3 numbers; zeros if the mass is zero."""
    about_com: _Array
    """The rotational inertia about the centre of mass (kg m²), (3, 3), as in a URDF."""
    rotational: _Array
    """The rotational inertia about the origin of the body's frame (kg m²), (3, 3). Functions that take an inertia read
    `rotational` and ignore `about_com`.
    """

    @classmethod
    def from_com(cls, mass: float, com: ArrayLike, about_com: ArrayLike) -> "Inertia":
        """Returns the inertia of a body with this mass (kg), centre of mass (m), and rotational inertia about the
        centre of mass (kg m²).

        >>> condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3)).rotational[0, 0].item()
        0.6
        """
        com, about_com = np.array(com, np.float64), np.array(about_com, np.float64)
        if com.shape != (3,):
            raise ValueError(f"com: expected shape (3,), found {com.shape}")
        if about_com.shape != (3, 3):
            raise ValueError(f"about_com: expected shape (3, 3), found {about_com.shape}")
        return cls(mass, com, about_com, about_com + parallel_axes(mass, com))  # Ī = I_c + m (c·c 1 − c cᵀ)

    @classmethod
    def from_sphere(cls, mass: float, radius: float) -> "Inertia":
        """Returns the inertia of a solid ball about its centre: 2/5 m r²."""
        r = _lengths("radius", radius, 1)
        return _solid(mass, 0.4 * r * r * np.ones(3))

    @classmethod
    def from_ellipsoid(cls, mass: float, radii: ArrayLike) -> "Inertia":
        """Returns the inertia of a solid ellipsoid with half axes `radii` about its centre. The moment about a half
        axis is m/5 (b² + c²), where b and c are the other two."""
        return _solid(mass, _others(_lengths("radii", radii, 3) ** 2) / 5.0)

    @classmethod
    def from_box(cls, mass: float, size: ArrayLike) -> "Inertia":
        """Returns the inertia of a solid box with edges `size` about its centre. The moment about the axis along an
        edge is m/12 (b² + c²), where b and c are the other two edges."""
        return _solid(mass, _others(_lengths("size", size, 3) ** 2) / 12.0)

    @classmethod
    def from_cylinder(cls, mass: float, radius: float, length: float) -> "Inertia":
        """Returns the inertia of a solid cylinder along z about its centre. With radius r and length l, the moments are
        m/12 (3 r² + l²) about x and y, and m/2 r² about z."""
        r, l = _lengths("radius", radius, 1), _lengths("length", length, 1)  # noqa: E741
        across = (3.0 * r * r + l * l) / 12.0
        return _solid(mass, np.array([across, across, 0.5 * r * r]))

    @classmethod
    def from_capsule(cls, mass: float, radius: float, length: float) -> "Inertia":
        """Returns the inertia of a solid capsule along z about its centre: a cylinder of `length` between two half
        balls.
        """
        r, l = _lengths("radius", radius, 1), _lengths("length", length, 1)  # noqa: E741
        ball = 4.0 * r / (4.0 * r + 3.0 * l)  # fraction of the mass in the half balls: 4/3 π r³ of 4/3 π r³ + π r² l
        # a half ball's centre of mass is 3/8 r from the cylinder, so its inertia per mass is 2/5 r² + l²/4 + 3/8 l r
        across = ball * (0.4 * r * r + 0.25 * l * l + 0.375 * l * r) + (1.0 - ball) * (3.0 * r * r + l * l) / 12.0
        along = ball * 0.4 * r * r + (1.0 - ball) * 0.5 * r * r
        return _solid(mass, np.array([across, across, along]))

    @property
    def matrix(self) -> _Array:
        """The matrix [m 1, −m ĉ; m ĉ, Ī], (6, 6), which maps a motion to the momentum, linear parts first. m is the
        mass, c the centre of mass, and Ī the rotational inertia about the origin."""
        x, y, z = self.mass * self.com
        h = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.block([[self.mass * np.eye(3), -h], [h, self.rotational]])

    def __add__(self, other: object) -> "Inertia":
        """Returns the inertia of two connected bodies, given in the same frame."""
        if not isinstance(other, Inertia):
            return NotImplemented
        mass, rotational = self.mass + other.mass, self.rotational + other.rotational
        com = (self.mass * self.com + other.mass * other.com) / (mass or 1.0)
        return type(self)(mass, com, rotational - parallel_axes(mass, com), rotational)


setattr(Inertia, "__repr__", short)  # noqa: B010 - type checkers do not allow a method to be replaced
Inertia.__module__ = "condyle"


def _solid(mass: float, moments: _Array) -> Inertia:
    """Returns an inertia with the centre of mass at the origin, from its principal moments per kilogram."""
    if not (np.isfinite(mass) and mass >= 0.0):
        raise ValueError(f"mass: expected at least 0 kg, found {mass}")
    return Inertia.from_com(mass, np.zeros(3), np.diag(mass * moments))


def _others(squares: _Array) -> _Array:
    """Returns (b² + c², a² + c², a² + b²), given (a², b², c²)."""
    out: _Array = squares.sum() - squares
    return out


def _lengths(name: str, given: ArrayLike, count: int) -> _Array:
    """Reads one or several lengths; each length must be finite and not negative."""
    found = np.array(given, np.float64)
    shape = () if count == 1 else (count,)
    if found.shape != shape:
        raise ValueError(f"{name}: expected {'a number' if count == 1 else f'shape {shape}'}, found {given!r}")
    if not (np.isfinite(found) & (found >= 0.0)).all():
        raise ValueError(f"{name}: expected at least 0 m, found {given!r}")
    return found
