"""Tests of records: what they contain, files, replays with the same bits, and policies that are called meanwhile."""

import json
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_mpc import CONTACTS, COSTS, DT, KNOTS, QUADRUPED, STAND, guess, standing

import condyle
from condyle.optimal import (
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    InteriorPoint,
    Policy,
    Problem,
    ProblemError,
    Record,
    Residual,
)

TICKS = 6


def walk(problem: Problem, solver: Any, tick: Any) -> list[Any]:
    """Makes ticks of a quadruped that is pushed. Each kind of change occurs. Returns the plans."""
    plans = [solver.solve(*guess(problem))]
    model = ContactDynamics(QUADRUPED, CONTACTS, DT, COSTS)
    for k in range(TICKS):
        solver.shift(0)
        references = np.tile(STAND, (KNOTS + 1, 1))
        references[:, 0] += 0.01 * k
        problem.set_references("state", references)
        x = STAND.copy()
        x[19 + k] += 0.1
        problem.set_x0(x)
        if k == 0:
            problem.set_weight("effort", 3e-3)
        elif k == 1:
            problem.set_weight("state", np.linspace(1.0, 2.0, KNOTS + 1))
        elif k == 2:
            problem.set_entry_weights("state", np.full((KNOTS + 1, 36), 5.0))
        elif k == 3:
            problem.set_contact("LF_foot", kp=[0.0, 0.0, 10.0], velocity=np.zeros(6))
        elif k == 4:
            problem.set_knot(3, model)
            problem.set_duration(0, 0.5 * DT)
        elif k == 5:
            problem.set_costs(KNOTS, [Cost("state", 0.5, Residual.state(STAND))])
        plans.append(tick(solver))
    return plans


@pytest.mark.parametrize("name", ["tick", "full_step"])
def test_a_replay_has_the_same_bits(name: str, tmp_path: Path) -> None:
    problem = standing()
    solver = InteriorPoint(problem, tolerance=1e-4) if name == "tick" else Fddp(problem, max_iterations=20)
    record = Record(solver)
    plans = walk(problem, solver, (lambda s: s.tick(2)) if name == "tick" else lambda s: s.resume(stop="full_step"))
    record.stop()
    problem.set_x0(STAND)
    solver.resume()
    assert len(record) == 1 + TICKS and record.replay() is None
    record.save(tmp_path / "record.json")
    read = Record.load(tmp_path / "record.json")
    assert repr(read) == f"<condyle.optimal.Record: {1 + TICKS} ticks>" and read.replay() is None
    for k, plan in enumerate(plans):
        np.testing.assert_array_equal(read[k].xs, plan.xs)
        np.testing.assert_array_equal(read[k].us, plan.us)
        assert read[k].status == plan.status


def test_the_calls_of_a_record_can_be_made_again() -> None:
    problem = standing()
    solver = InteriorPoint(problem, tolerance=1e-4)
    record = Record(solver)
    walk(problem, solver, lambda s: s.tick(2))
    problem, solver = record.start()
    names = []
    for k in range(4):
        *before, (solve, arguments) = record[k].calls
        for name, given in before:
            getattr(solver if name == "shift" else problem, name)(**given)
            names.append(name)
        plan = getattr(solver, solve)(**arguments)
        np.testing.assert_array_equal(plan.xs, record[k].xs)
        np.testing.assert_array_equal(plan.us, record[k].us)
    changed = ["set_weight", "set_weight", "set_entry_weights"]
    assert names == [name for own in changed for name in ("shift", "set_references", "set_x0", own)]
    contact = dict(record[4].calls)["set_contact"]
    assert contact["contact"] == "LF_foot" and contact["placement"] is None and contact["kd"] is None
    np.testing.assert_array_equal(contact["kp"], [0, 0, 10, 0, 0, 0])
    knot = json.loads(dict(record[5].calls)["set_knot"]["model"])
    assert knot["dynamics"]["contact"]["dt"] in (DT, 0.5 * DT)
    assert [name for name, _ in record[-1].calls] == ["shift", "set_references", "set_x0", "set_costs", "tick"]
    with pytest.raises(IndexError, match="^tick 7: the record has 7$"):
        record[7]


def test_placements_have_their_shape() -> None:
    """Checks targets of poses and rotations: `set_references` takes the arrays of a record."""
    arm = condyle.robots.arm7()
    costs = [
        Cost("pose", 1.0, Residual.frame_placement(arm, "tool", np.eye(4))),
        Cost("turn", 1.0, Residual.frame_rotation(arm, "tool", np.eye(3))),
    ]
    problem = Problem(np.zeros(14), [FreeDynamics(arm, 0.02, costs)], [0] * 4, FreeDynamics(arm, None, costs))
    solver = Fddp(problem, max_iterations=3)
    record = Record(solver)
    problem.set_references("pose", np.tile(np.eye(4), (5, 1, 1)))
    problem.set_references("turn", np.tile(np.eye(3), (5, 1, 1)))
    solver.solve(np.zeros((5, 14)), np.zeros((4, 7)))
    assert [given["values"].shape for _, given in record[0].calls[:2]] == [(5, 4, 4), (5, 3, 3)]
    assert record.replay() is None


def test_settings_are_recorded() -> None:
    problem = standing()
    solver = Fddp(problem, max_iterations=20)
    record = Record(solver)
    solver.solve(*guess(problem))
    solver.settings = {"max_iterations": 1}
    solver.resume()
    names = [name for name, _ in record[1].calls]
    assert names == ["settings", "resume"] and record[1].calls[0][1]["settings"]["max_iterations"] == 1
    assert record.replay() is None
    assert record.start()[1].settings["max_iterations"] == 20


def test_only_the_recorded_solver_is_recorded() -> None:
    problem = standing()
    solver, other = InteriorPoint(problem, tolerance=1e-4), Fddp(problem, max_iterations=2)
    record = Record(solver)
    other.solve(*guess(problem))
    assert len(record) == 0
    solver.solve(*guess(problem))
    assert len(record) == 1 and record.replay() is None


def test_differences_and_damage_are_found(tmp_path: Path) -> None:
    problem = standing()
    solver = InteriorPoint(problem, tolerance=1e-4)
    record = Record(solver)
    walk(problem, solver, lambda s: s.tick(2))
    file = tmp_path / "record.json"
    record.save(file)
    text = json.loads(file.read_text())
    text["ticks"][3]["us"] = text["ticks"][2]["us"]
    file.write_text(json.dumps(text))
    found = Record.load(file).replay()
    assert found is not None and (found.tick, found.array) == (3, "us") and found.largest > 0.0
    file.write_text(json.dumps({**text, "version": 2}))
    with pytest.raises(ProblemError, match="no record: version: expected 1, found 2"):
        Record.load(file)
    with pytest.raises(FileNotFoundError):
        Record.load(tmp_path / "missing.json")
    late = Record(solver)
    solver.tick(2)
    with pytest.raises(ProblemError, match="^resume: there is no solution to go on from"):
        late.replay()
    with pytest.raises(TypeError):
        Record(problem)  # type: ignore[arg-type]


def test_a_policy_is_consistent_during_ticks() -> None:
    """Calls a policy at 1 kHz while another thread makes ticks. Each result must belong to one of the plans."""
    problem = standing()
    solver, policy = InteriorPoint(problem, tolerance=1e-4), Policy(problem)
    plans = [solver.solve(*guess(problem))]
    solver.publish(policy, 0.0)
    x, over, sent = STAND + 0.01, threading.Event(), []
    x[3:7] = STAND[3:7]

    def feedback() -> None:
        while not over.is_set():
            sent.append(policy(0.0, x))
            time.sleep(1e-3)

    thread = threading.Thread(target=feedback)
    thread.start()
    for k in range(40):
        pushed = STAND.copy()
        pushed[20] += 0.02 * (k % 7)
        problem.set_x0(pushed)
        plans.append(solver.tick(2))
        solver.publish(policy, 0.0)
    over.set()
    thread.join()
    expected = []
    for plan in plans:
        difference = np.r_[condyle.difference(QUADRUPED, plan.xs[0][:19], x[:19]), x[19:] - plan.xs[0][19:]]
        expected.append(plan.us[0] + plan.K[0] @ difference)
    distances = np.abs(np.array(sent)[:, None] - np.array(expected)).max(axis=2)
    assert len(sent) > 1 and distances.min(axis=1).max() < 1e-9
    assert len(set(distances.argmin(axis=1))) > 1  # the thread has seen several plans
