"""Compares the spanning tree of Cassie, an SDF with closed loops, with a tree that the test builds in Pinocchio.
Pinocchio's own SDF reader is not used.

The test reads the file by the rules of SDF 1.6. Poses of links are relative to the model, and poses of joints are
relative to the child link. Axes are in the joint's frame, or in the model's frame with `use_parent_model_frame`.
"""

import os
from xml.etree import ElementTree

import checks
import numpy as np
import pinocchio as pin
import pytest
from comparison import Pair
from example_robot_data.robots_loader import ROBOTS, getModelPath

import condyle

STATES = 3


def path() -> str:
    loader = ROBOTS["cassie"]
    relative = os.path.join(loader.path, loader.sdf_subpath, loader.sdf_filename)
    return os.path.join(getModelPath(relative), relative)


def pose(element: ElementTree.Element) -> pin.SE3:
    numbers = np.array((element.findtext("pose") or "0 0 0 0 0 0").split(), float)
    return pin.SE3(pin.rpy.rpyToMatrix(numbers[3:]), numbers[:3])


def inertia(link: ElementTree.Element) -> pin.Inertia:
    inertial = link.find("inertial")
    assert inertial is not None
    entries = inertial.find("inertia")
    about_com = np.zeros((3, 3))
    for i, j, name in ((0, 0, "ixx"), (1, 1, "iyy"), (2, 2, "izz"), (0, 1, "ixy"), (0, 2, "ixz"), (1, 2, "iyz")):
        about_com[i, j] = about_com[j, i] = float(entries.findtext(name))
    return pose(inertial).act(pin.Inertia(float(inertial.findtext("mass")), np.zeros(3), about_com))


def tree() -> pin.Model:
    """Builds the tree from the pelvis, breadth first. At each link, joints are added in the order of the file. Joints
    that close a loop are omitted.

    Pinocchio numbers the joints of the tree depth first.
    """
    robot = ElementTree.parse(path()).getroot().find("model")
    links = {link.get("name"): link for link in robot.findall("link")}
    joints = robot.findall("joint")
    children: dict[str, list[ElementTree.Element]] = {name: [] for name in links}
    reached, queue = {"pelvis"}, ["pelvis"]
    while queue:
        parent = queue.pop(0)
        for joint in joints:
            child = joint.findtext("child")
            if joint.findtext("parent") == parent and child not in reached:
                children[parent].append(joint)
                reached.add(child)
                queue.append(child)
    model = pin.Model()
    model.name = "cassie"

    def add(link: str, body: int, oXb: pin.SE3) -> None:
        for joint in children[link]:
            name = joint.findtext("child")
            oXl = pose(links[name])
            oXj = oXl * pose(joint)
            axis = np.zeros(3)
            if joint.find("axis") is not None:
                axis = np.array(joint.findtext("axis/xyz").split(), float)
                if joint.findtext("axis/use_parent_model_frame") == "1":
                    axis = oXj.rotation.T @ axis
                axis /= np.linalg.norm(axis)
            kinds = {
                "revolute": lambda axis=axis: pin.JointModelRevoluteUnaligned(axis),
                "prismatic": lambda axis=axis: pin.JointModelPrismaticUnaligned(axis),
                "ball": pin.JointModelSpherical,
            }
            i = model.addJoint(body, kinds[joint.get("type")](), oXb.actInv(oXj), joint.get("name"))
            model.appendBodyToJoint(i, inertia(links[name]), oXj.actInv(oXl))
            add(name, i, oXj)

    root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    model.appendBodyToJoint(root, inertia(links["pelvis"]), pin.SE3.Identity())
    add("pelvis", root, pose(links["pelvis"]))
    return model


@pytest.fixture(scope="module")
def pair() -> Pair:
    pair = Pair("cassie", tree(), condyle.Model.from_sdf(path(), root_joint="free_flyer"), "free_flyer")
    pair.record_size()
    return pair


def test_tree(pair: Pair) -> None:
    ours, theirs = pair.ours, pair.theirs
    assert ours.names == list(theirs.names)
    assert ours.parents == list(theirs.parents)
    assert (ours.nq, ours.nv) == (theirs.nq, theirs.nv)
    pair.expect("joint placements", ours.joint_placements[1:], checks.poses(theirs.jointPlacements)[1:])
    parameters = [i.toDynamicParameters() for i in theirs.inertias[1:]]
    pair.expect("inertial parameters", ours.inertial_parameters, np.concatenate(parameters))


def test_dynamics(pair: Pair) -> None:
    for state in pair.states(STATES):
        placements = condyle.forward_kinematics(pair.ours, pair.data, state.q)
        pin.forwardKinematics(pair.theirs, pair.their_data, state.q)
        pair.expect("forward_kinematics", placements, checks.poses(pair.their_data.oMi))
        checks.check_centroidal(state)
        checks.check_energy(state)
        checks.check_equations_of_motion(state)
        checks.check_inverse_dynamics(state)
        checks.check_crba(state)
        checks.check_gravity(state)
        checks.check_rnea_derivatives(state)
        checks.check_effort_derivatives(state)
        assert checks.check_forward_dynamics(state)
        checks.check_configuration(state)
