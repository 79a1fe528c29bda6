"""A robot for tests, with one random state."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import condyle


class Robot(NamedTuple):
    """A model, its scratch memory, and one random state of the robot."""

    model: condyle.Model
    data: condyle.Data
    q: NDArray[np.float64]
    v: NDArray[np.float64]
    a: NDArray[np.float64]
    tau: NDArray[np.float64]
    f_ext: NDArray[np.float64]


def make(model: condyle.Model) -> Robot:
    rng = np.random.default_rng(1)
    q = condyle.random_configuration(model, seed=1)
    v, a, tau = rng.standard_normal((3, model.nv))
    return Robot(model, condyle.Data(model), q, v, a, tau, rng.standard_normal((model.nbodies, 6)))
