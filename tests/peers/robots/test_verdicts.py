"""Tests verdicts on small robots that are equal, different or refused, on files that are only a part of a robot, and on
files that a reader never finishes."""

import os
import signal
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import comparison
import files
import judge
import report
from mujoco import MjModel
from mujoco_actuators import efforts
from processes import run

import condyle

BODY = """<body name="a" pos="0 0 1"><joint name="hinge" axis="0 1 0" range="-1 2" limited="true"/>
  <inertial pos="0.1 0 -0.2" mass="2" diaginertia="0.1 0.2 0.15"/><site name="tip" pos="0 0 -0.4"/></body>"""
MJCF = f"<mujoco><worldbody>{BODY}</worldbody></mujoco>"
LINK = """<link name="{}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
  <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
URDF = f"""<robot name="r">{LINK.format("a")}{LINK.format("b")}<joint name="j" type="revolute"><parent link="a"/>
  <child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="3" velocity="2"/></joint></robot>"""


def judged(folder: Path, name: str, text: str) -> judge.Verdict:
    """Writes a robot file and computes its verdict in the test's own process."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")
    (robot,) = files.find(folder, name)
    return judge.Trial(robot, folder).verdict()


@pytest.mark.parametrize(("name", "text", "peer"), [("r.xml", MJCF, "MuJoCo"), ("r.urdf", URDF, "Pinocchio")])
def test_equal(tmp_path: Path, name: str, text: str, peer: str) -> None:
    verdict = judged(tmp_path, name, text)
    assert verdict.verdict == "equal" and verdict.peers[peer] == "equal"
    assert {"M", "bias", "total mass", "limits: position"} <= set(verdict.compared)


@pytest.mark.parametrize("wrong", ["crba", "nonlinear_effects", "frame_placement"])
def test_different(tmp_path: Path, wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = getattr(condyle, wrong)
    monkeypatch.setattr(comparison.condyle, wrong, lambda *args: right(*args) + 1e-6)
    for name, text in (("r.xml", MJCF), ("r.urdf", URDF)):
        verdict = judged(tmp_path / wrong, name, text)
        assert verdict.verdict == "different" and verdict.differences, name


def test_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> condyle.Model:
        raise condyle.ParseError(f"{path}:3: body `a`: is odd")

    monkeypatch.setattr(
        judge, "condyle", type("Broken", (), {"Model": type("M", (), {"from_mjcf": refuse}), "Error": condyle.Error})
    )
    verdict = judged(tmp_path, "r.xml", MJCF)
    assert verdict.verdict == "refused" and report.kind(verdict.error) == "<body>: is odd"
    assert judged(tmp_path / "both", "r.xml", MJCF.replace("axis", "type='odd' axis")).verdict == "nobody"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("r.xml", f"<mujocoinclude>{BODY}</mujocoinclude>"),
        ("r.xml", "<mujoco><option gravity='0 0 0'/></mujoco>"),
        ("r.urdf", "<robot name='r' xmlns:xacro='x'><xacro:arm/><link name='a'/></robot>"),
        ("r.sdf", "<sdf version='1.7'><light name='sun'/></sdf>"),
    ],
)
def test_part(tmp_path: Path, name: str, text: str) -> None:
    verdict = judged(tmp_path, name, text)
    assert verdict.verdict == "fragment" and verdict.error


def test_files(tmp_path: Path) -> None:
    """Tests that the root element of a file determines its format, and its folders determine its collection."""
    here = tmp_path / "owner+repository" / "models"
    here.mkdir(parents=True)
    (here / "a.xml").write_text("<!-- <sdf> --><robot name='r'><link name='a'/></robot>")
    (here / "b.world").write_text("<?xml version='1.0'?><gazebo version='1.0'><model name='m'/></gazebo>", "utf-16")
    (here / "package.xml").write_text("<package/>")
    found = files.find(tmp_path)
    assert [(robot.format, robot.collection) for robot in found] == [
        ("urdf", "owner/repository"),
        ("sdf", "owner/repository"),
    ]


def test_crash_and_time_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "r.xml").write_text(MJCF)
    robots = files.find(tmp_path)
    for action, text in (
        (lambda _: os.kill(os.getpid(), signal.SIGSEGV), "SIGSEGV"),
        (lambda _: time.sleep(60), "no result"),
        (lambda _: 1 / 0, "ZeroDivisionError"),
    ):
        monkeypatch.setattr(judge.Trial, "verdict", action)
        ((_, verdict),) = run(robots, tmp_path, 1, 2.0)
        assert verdict.verdict == "crash" and text in verdict.error


def test_efforts() -> None:
    """Tests that the effort limit of a joint is the sum over its actuators, clipped to the joint's range. The range of
    the control limits a motor, and `forcerange` limits a servo."""
    text = """<mujoco><worldbody><body>
        <joint name="x" type="slide" axis="1 0 0" actuatorfrcrange="-30 8"/><joint name="y" type="slide" axis="0 1 0"/>
        <joint name="z" type="slide" axis="0 0 1"/><geom size="1"/></body></worldbody><actuator>
        <motor joint="x" ctrlrange="-1 2" gear="-10"/><position joint="x" kp="5" forcerange="-3 4" gear="2"/>
        <motor joint="y" ctrlrange="-1 2" forcerange="-9 1"/><velocity joint="z"/></actuator></mujoco>"""
    found = efforts(MjModel.from_xml_string(text))
    # Effort range of joint x: −10 · [−1, 2] + 2 · [−3, 4] = [−26, 18], clipped to [−30, 8].
    assert found.tolist() == [[-26.0, 8.0], [-1.0, 1.0], [-float("inf"), float("inf")]]


def test_efforts_of_a_plugin() -> None:
    """Tests that `forcerange` limits the force of a plugin, whatever the control is."""
    text = """<mujoco><extension><plugin plugin="mujoco.pid"><instance name="p"><config key="kp" value="9"/></instance>
        </plugin></extension><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody><actuator>
        <plugin joint="j" plugin="mujoco.pid" instance="p" ctrlrange="-1 1" forcerange="-5 3"/></actuator></mujoco>"""
    assert efforts(MjModel.from_xml_string(text)).tolist() == [[-5.0, 3.0]]


@pytest.mark.parametrize(
    "flag",
    [
        *["gravity", "equality", "limit", "frictionloss", "constraint"],
        *["spring", "damper", "actuation", "clampctrl", "contact"],
    ],
)
def test_flags(tmp_path: Path, flag: str) -> None:
    """Tests that a model lacks the features that a flag disables, as in MuJoCo."""
    joint = "<joint name='{0}' axis='0 1 0' range='-10 20' frictionloss='1' damping='2' stiffness='3' springref='9'/>"
    bodies = "".join(f"<body pos='{k} 0 0' gravcomp='1'>{joint.format(k)}<geom size='.1'/></body>" for k in (1, 2))
    text = f"""<mujoco><option><flag {flag}="disable"/></option><worldbody>{bodies}</worldbody>
        <equality><joint name="e" joint1="1" joint2="2"/></equality>
        <actuator><motor name="m" joint="1" ctrlrange="-1 2"/></actuator>
        <keyframe><key name="k" qpos="0.1 0.2" ctrl="0.3"/></keyframe></mujoco>"""
    verdict = judged(tmp_path, "r.xml", text)
    assert verdict.verdict == "equal", verdict.differences
    model = condyle.Model.from_mjcf_str(text)
    assert bool(model.constraints()) == (flag not in ("equality", "constraint"))


def test_section_of_a_file(tmp_path: Path) -> None:
    """Tests that a section is appended to a file, or replaces an existing section."""
    path = tmp_path / "V.md"
    path.write_text("# Title\n")
    report.put(path, f"{report.BEGIN}\none\n{report.END}\n")
    path.write_text(path.read_text() + "after\n")
    report.put(path, f"{report.BEGIN}\ntwo\n{report.END}\n")
    assert path.read_text() == f"# Title\n\n{report.BEGIN}\ntwo\n{report.END}\nafter\n"
