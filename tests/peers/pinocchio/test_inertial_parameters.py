"""Compares the inertial parameters of random bodies with Pinocchio 4.1."""

import numpy as np
import pinocchio as pin
from comparison import TOLERANCE, records

import condyle
from condyle import inertial_parameters

BODIES = 100


def expect(what: str, ours: np.ndarray, theirs: np.ndarray) -> None:
    """Checks that results of Condyle and Pinocchio are equal, and records their difference."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    assert ours.shape == theirs.shape
    difference = float(np.abs(ours - theirs).max() / (1 + np.abs(theirs).max()))
    records[f"inertial_parameters: {what}"].add(difference, TOLERANCE, "random bodies")
    assert difference <= TOLERANCE


def test_bodies() -> None:
    rng = np.random.default_rng(0)
    for _ in range(BODIES):
        theta = rng.standard_normal(10)
        theirs = pin.LogCholeskyParameters(theta)
        ours, inertia = inertial_parameters.from_log_cholesky(theta), theirs.toInertia()
        pi = theirs.toDynamicParameters()
        expect("from_log_cholesky, from_inertia", inertial_parameters.from_inertia(ours), pi)
        expect("log_cholesky_jacobian", inertial_parameters.log_cholesky_jacobian(theta), theirs.calculateJacobian())
        expect("pseudo_inertia", inertial_parameters.pseudo_inertia(ours), inertia.toPseudoInertia().toMatrix())
        again = inertial_parameters.to_inertia(pi)
        expect("to_inertia: mass", again.mass, inertia.mass)
        expect("to_inertia: com", again.com, inertia.lever)
        expect("to_inertia: about_com", again.about_com, inertia.inertia)
        made = condyle.Inertia.from_com(inertia.mass, inertia.lever, inertia.inertia)
        expect("Inertia.from_com", inertial_parameters.from_inertia(made), inertia.toDynamicParameters())
        expect("log_cholesky", inertial_parameters.log_cholesky(made), theta)
