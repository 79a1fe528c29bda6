"""Tests the program `condyle` for all robots of example-robot-data: `inspect` compared with Pinocchio, `check`,
`budget`, and meshes of `plan`.

The tests run the program that cargo builds, or the program that the environment variable CONDYLE_PROGRAM names.
"""

import base64
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from example_robot_data.robots_loader import ROBOTS
from test_cassie import path as cassie_path
from test_robots import NO_URDF, SINGULAR, root_joint, urdf_path

ROOT = Path(__file__).resolve().parents[3]
ROUNDING = 1e-10


def find_program() -> str | None:
    if given := os.environ.get("CONDYLE_PROGRAM"):
        return given
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    built = [target / kind / "condyle" for kind in ("release", "debug") if (target / kind / "condyle").is_file()]
    return str(max(built, key=lambda path: path.stat().st_mtime)) if built else None


PROGRAM = find_program()
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="the program is not built: cargo build -p condyle-cli")


QUADRUPEDS = {
    "anymal": ("FOOT", ["LF", "RF", "LH", "RH"], "{}_HFE", "{}_KFE", (0.7, -1.0), True),
    "solo12": ("FOOT", ["FL", "FR", "HL", "HR"], "{}_HFE", "{}_KFE", (0.7, -1.4), True),
    "a1": ("foot", ["FL", "FR", "RL", "RR"], "{}_thigh_joint", "{}_calf_joint", (0.8, -1.6), False),
    "go1": ("foot", ["FL", "FR", "RL", "RR"], "{}_thigh_joint", "{}_calf_joint", (0.8, -1.6), False),
    "hyq": ("foot", ["lf", "rf", "lh", "rh"], "{}_hfe_joint", "{}_kfe_joint", (0.7, -1.4), True),
}
"""Data of quadrupeds by name: the suffix of the feet's names, names of the legs, joints of thigh and shank, angles of
these joints, and whether the hind knees bend forwards."""


def phase(kind: str, knots: int, **numbers: object) -> str:
    lines = [f"{key} = {json.dumps(value)}" for key, value in {"kind": kind, "knots": knots, **numbers}.items()]
    return "\n".join(["[[phase]]", *lines, ""])


def gait(name: str, feet: str, posture: dict[str, float], phases: list[str], dt: float) -> str:
    joints = "\n".join(f"{json.dumps(joint)} = {angle}" for joint, angle in posture.items())
    head = f"robot = {json.dumps(urdf_path(name))}\nroot = 'free'\ndt = {dt}\n[feet]\n{feet}\n[posture]\n{joints}\n"
    return head + "".join(phases)


def plan(task: str, folder: Path) -> dict:
    (folder / "task.toml").write_text(task)
    files = ["--out", str(folder / "plan.html"), "--record", str(folder / "motion.npz")]
    line = [str(PROGRAM), "plan", str(folder / "task.toml"), *files, "--json"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(np.load(folder / "motion.npz"))


def check_motion(name: str, motion: dict, ahead: float) -> None:
    """Checks that a planned motion reaches its goal within Pinocchio's limits, and that each position is q ⊕ v Δt of
    the previous position q."""
    model = pin.buildModelFromUrdf(urdf_path(name), pin.JointModelFreeFlyer())
    q, v, tau = motion["q"], motion["v"], motion["tau"]
    assert abs(q[-1, 0] - q[0, 0] - ahead) < 0.03
    room = 1e-4
    assert (q[:, 7:] >= model.lowerPositionLimit[7:] - room).all()
    assert (q[:, 7:] <= model.upperPositionLimit[7:] + room).all()
    assert (np.abs(v[:, 6:]) <= model.velocityLimit[6:] + room).all()
    assert (np.abs(tau[:, 6:]) <= model.effortLimit[6:] + room).all()
    for k, dt in enumerate(np.diff(motion["times"])):
        assert np.abs(pin.difference(model, q[k], q[k + 1]) - dt * v[k + 1]).max() < 1e-6


@pytest.mark.parametrize("name", list(QUADRUPEDS))
@pytest.mark.parametrize("kind", ["trot", "jump"])
def test_gaits(name: str, kind: str, tmp_path: Path) -> None:
    end, legs, thigh, shank, angles, forwards = QUADRUPEDS[name]
    feet = [f"{leg}_{end}" for leg in legs]
    posture = {}
    for number, leg in enumerate(legs):
        sign = -1 if forwards and number >= 2 else 1
        posture |= {thigh.format(leg): sign * angles[0], shank.format(leg): sign * angles[1]}
    ahead = 0.06
    if kind == "trot":
        one, other = [feet[1], feet[2]], [feet[0], feet[3]]
        step = {"length": ahead / 2, "height": 0.04}
        phases = [phase("stand", 10), phase("step", 25, feet=one, **step), phase("stand", 5)]
        phases += [phase("step", 25, feet=other, length=ahead, height=0.04), phase("stand", 5)]
        phases += [phase("step", 25, feet=one, **step), phase("stand", 15)]
    else:
        phases = [phase("stand", 30), phase("jump", 26, length=ahead, height=0.08), phase("stand", 40)]
    check_motion(name, plan(gait(name, f"points = {json.dumps(feet)}", posture, phases, 0.01), tmp_path), ahead)


def test_walk(tmp_path: Path) -> None:
    feet = ["left_sole_link", "right_sole_link"]
    angles = {3: -0.4, 4: 0.8, 5: -0.4}
    posture = {f"leg_{side}_{k}_joint": angle for side in ("left", "right") for k, angle in angles.items()}
    phases = [phase("stand", 10)]
    for foot, length in ((feet[1], 0.15), (feet[0], 0.3), (feet[1], 0.15)):
        phases += [phase("step", 20, feet=[foot], length=length, height=0.06), phase("stand", 9)]
    soles = f"soles = {json.dumps(feet)}\nsize = [0.2, 0.1]"
    check_motion("talos", plan(gait("talos", soles, posture, phases, 0.03), tmp_path), 0.3)


def run(command: str, name: str, *flags: str) -> dict:
    path = cassie_path() if name in NO_URDF else urdf_path(name)
    root = ["--root", "free"] if root_joint(name) else []
    line = [str(PROGRAM), command, path, *root, "--json", *flags]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (name, done.stderr)
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in NO_URDF])
def test_inspect(name: str) -> None:
    root = [pin.JointModelFreeFlyer()] if root_joint(name) else []
    model = pin.buildModelFromUrdf(urdf_path(name), *root)
    report = run("inspect", name)
    assert (report["nq"], report["nv"]) == (model.nq, model.nv)
    assert [body["joint"] for body in report["bodies"]] == list(model.names)[1:]
    masses = np.array([body["mass"] for body in report["bodies"]])
    theirs = np.array([inertia.mass for inertia in list(model.inertias)[1:]])
    assert np.abs(masses - theirs).max() < ROUNDING
    assert abs(report["mass"] - theirs.sum()) < ROUNDING * (1 + theirs.sum())
    for body, inertia in zip(report["bodies"], list(model.inertias)[1:], strict=True):
        if inertia.mass > 0:
            assert np.abs(np.array(body["com"]) - inertia.lever).max() < ROUNDING
            moments = np.sort(np.linalg.eigvalsh(inertia.inertia))
            assert np.abs(np.array(body["moments"]) - moments).max() < ROUNDING
    com = pin.centerOfMass(model, model.createData(), pin.neutral(model))
    assert np.abs(np.array(report["com"]) - com).max() < ROUNDING


@pytest.mark.parametrize("name", list(ROBOTS))
def test_check(name: str) -> None:
    report = run("check", name, "--states", "20")
    assert report["pass"]
    assert len(report["rows"]) >= 32


@pytest.mark.parametrize("name", list(ROBOTS))
def test_budget(name: str) -> None:
    report = run("budget", name, "--knots", "4", "--repetitions", "1", "--cores", "2")
    assert len(report["algorithms"]) == 6
    assert {row["name"] for row in report["iterations"]} == {"free"}
    assert all(row["finite"] for row in report["iterations"])


@pytest.mark.parametrize("name", list(ROBOTS))
def test_budget_in_contact(name: str) -> None:
    last = run("inspect", name)["bodies"][-1]["name"]
    for kind in ("--contacts", "--rigid-contacts"):
        report = run("budget", name, "--knots", "4", "--repetitions", "1", kind, last)
        assert last in str(report["contacts"])
        assert {row["name"] for row in report["iterations"]} == {"free", "in contact"}
        assert all(row["finite"] for row in report["iterations"])


def on_terminal(*line: str) -> str:
    """Runs the program on a pseudo-terminal and returns its output."""
    leader, follower = os.openpty()
    environment = {**os.environ, "TERM": "xterm-256color"}
    with subprocess.Popen([str(PROGRAM), *line], stdout=follower, stderr=follower, env=environment) as process:
        os.close(follower)
        shown = b""
        while True:
            try:
                part = os.read(leader, 4096)
            except OSError:  # on Linux, this error means that the program has closed the terminal
                part = b""
            if not part:
                break
            shown += part
    assert process.returncode == 0, shown.decode()
    os.close(leader)
    return shown.decode()


@pytest.mark.parametrize("command", ["inspect", "check", "budget"])
def test_colours_and_progress_are_for_terminals(command: str) -> None:
    line = [command, "quadruped", *(["--knots", "60"] if command == "budget" else [])]
    shown = on_terminal(*line)
    assert "\x1b[1mquadruped" in shown
    assert ("measuring" in shown) == (command == "budget")
    piped = subprocess.run([str(PROGRAM), *line], capture_output=True, text=True, check=True)
    assert "\x1b" not in piped.stdout
    assert piped.stderr == ""


MOST_TRIANGLES = 60_000
"""Maximum number of triangles on a page, as `condyle plan --help` states."""
MESH_ROUNDING = 0.02
"""Maximum difference between the bounding boxes of a body's meshes in the page and in the files, relative to the box's
largest side.

The program simplifies meshes by collapsing edges, and stores them with a resolution of 16 bits along a side.
"""


def scene_of(name: str, folder: Path) -> dict:
    page = folder / "plan.html"
    line = [str(PROGRAM), "plan", "--robot", urdf_path(name), "--target", "0,0,0", "--knots", "1"]
    done = subprocess.run(
        [*line, "--max-iterations", "1", "--out", str(page)], capture_output=True, text=True, check=False
    )
    assert done.returncode in (0, 1), (name, done.stderr)
    data = page.read_text().split('type="application/json" id="data">')[1].split("</script>")[0]
    return dict(json.loads(data)["scene"], notes=[line for line in done.stderr.splitlines() if "meshes" in line])


def box_of_meshes(scene: dict, shapes: list[dict]) -> np.ndarray | None:
    """Returns the smallest and the largest coordinates of a body's meshes, in the body's frame."""
    points = []
    for shape in (shape for shape in shapes if shape["kind"] == "mesh"):
        mesh = scene["meshes"][shape["part"]]
        numbers = np.frombuffer(base64.b64decode(mesh["points"]), "<u2").reshape(-1, 3)
        corners = np.frombuffer(base64.b64decode(mesh["triangles"]), "<u2")
        assert corners.size % 3 == 0 and corners.max() < len(numbers)
        local = np.array(mesh["low"]) + np.array(mesh["side"]) * numbers / 65535
        pose = pin.SE3(pin.Quaternion(np.array(shape["quaternion"])).normalized(), np.array(shape["position"]))
        points.append(local * shape["size"] @ pose.rotation.T + pose.translation)
    return np.array([np.vstack(points).min(0), np.vstack(points).max(0)]) if points else None


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in {*NO_URDF, *SINGULAR}])
def test_meshes(name: str, tmp_path: Path) -> None:
    """Tests that the page contains all meshes, with the same bounding box of each body as in Pinocchio, which reads the
    meshes by assimp."""
    model = pin.buildModelFromUrdf(urdf_path(name))
    if model.nv == 0:
        pytest.skip("on a fixed root nothing moves")
    packages = [str(parent) for parent in Path(urdf_path(name)).parents]
    theirs = pin.buildGeomFromUrdf(model, urdf_path(name), pin.GeometryType.VISUAL, package_dirs=packages)
    scene = scene_of(name, tmp_path)
    assert scene["notes"] == []
    triangles = sum(len(base64.b64decode(mesh["triangles"])) // 6 for mesh in scene["meshes"])
    assert triangles <= MOST_TRIANGLES
    boxes: dict[int, list[np.ndarray]] = {}
    for shape in theirs.geometryObjects:
        if Path(shape.meshPath).suffix.lower() in (".stl", ".dae", ".obj"):
            points = shape.geometry.vertices() if hasattr(shape.geometry, "vertices") else None
            if points is not None and len(points):
                points = np.array(points) @ shape.placement.rotation.T + shape.placement.translation
                boxes.setdefault(shape.parentJoint, []).append(np.array([points.min(0), points.max(0)]))
    for body, found in boxes.items():
        expected = np.array([np.min([box[0] for box in found], 0), np.max([box[1] for box in found], 0)])
        ours = box_of_meshes(scene, scene["bodies"][body]["shapes"])
        assert ours is not None, (name, model.names[body])
        side = (expected[1] - expected[0]).max()
        assert np.abs(ours - expected).max() < MESH_ROUNDING * side, (name, model.names[body], ours, expected)
