//! Models from files, from text, and from other libraries.

use super::{Model, members_of};
use crate::arrays::Give;
use crate::exceptions::exception;
use crate::joint::root;
use condyle::{MjcfOptions, SdfOptions, UrdfOptions, tree::WarningKind};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use std::path::PathBuf;

/// The kinds of warnings that a strict reader accepts.
fn kinds(allow: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<WarningKind>> {
    let Some(allow) = allow else { return Ok(Vec::new()) };
    let kind = |word: &Bound<'_, PyAny>| {
        let word: &str = &word.extract::<String>()?;
        word.parse().map_err(|what: String| PyValueError::new_err(format!("allow: {what}")))
    };
    members_of("allow", "kinds of warnings", allow)?.iter().map(kind).collect()
}

/// The values of xacro's arguments, as xacro writes them.
fn values(arguments: &Bound<'_, PyDict>) -> PyResult<Vec<(String, String)>> {
    let value = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let text = value.str()?.to_str()?.to_owned();
        let is_bool = value.is_instance_of::<PyBool>();
        Ok((name.extract()?, if is_bool { text.to_lowercase() } else { text }))
    };
    arguments.iter().map(value).collect()
}

#[pymethods]
impl Model {
    /// A model from a URDF file.
    ///
    /// Fixed joints are merged into the body that they sit on and stay as frames. Meshes are never looked at. A file whose
    /// name ends in `.xacro` is expanded by the installed program `xacro` or `xacrodoc`, which evaluates expressions of
    /// the file: expand files of people that you trust only.
    ///
    /// path: a path, as text or `os.PathLike`, or `package://name/path/in/the/package`.
    /// root_joint: the joint between the world and the root link, named `root_joint`: 'free_flyer', 'planar',
    ///     'spherical' or 'translation'; None fixes the root link to the world.
    /// mimic: whether joints with a `<mimic>` share the coordinate of the joint that they follow, instead of having
    ///     their own.
    /// strict: whether a warning (`warnings`) is an error.
    /// packages: folders that contain packages, or are packages; before those that the environment names in
    ///     `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
    /// allow: kinds of warnings that are no errors, though `strict` is set: 'massless', 'negative', 'triangle',
    ///     'singular', 'unlikely', 'limit', 'unknown', 'left_out', 'assumed' or 'mimic'.
    /// arguments: values of xacro's `<xacro:arg>`s by name, for files that end in `.xacro`.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError`; `ValueError` for an unknown kind.
    #[staticmethod]
    #[pyo3(signature = (path, root_joint=None, mimic=false, strict=false, packages=None, *, allow=None, arguments=None))]
    fn from_urdf(
        path: PathBuf,
        root_joint: Option<&str>,
        mimic: bool,
        strict: bool,
        packages: Option<Vec<PathBuf>>,
        allow: Option<&Bound<'_, PyAny>>,
        arguments: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let (packages, allow, root_joint) = (packages.unwrap_or_default(), kinds(allow)?, root(root_joint)?);
        let arguments = arguments.map_or(Ok(Vec::new()), values)?;
        let options = UrdfOptions { root_joint, mimic, strict, packages, allow, arguments };
        Ok(condyle::Model::from_urdf(path, &options).map_err(exception)?.into())
    }

    /// A model from a URDF in a string; see `from_urdf`.
    ///
    /// >>> text = condyle.robots.QUADRUPED
    /// >>> condyle.Model.from_urdf_str(text, root_joint="free_flyer").nv
    /// 18
    #[staticmethod]
    #[pyo3(signature = (text, root_joint=None, mimic=false, strict=false, packages=None, *, allow=None))]
    fn from_urdf_str(
        text: &str,
        root_joint: Option<&str>,
        mimic: bool,
        strict: bool,
        packages: Option<Vec<PathBuf>>,
        allow: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (packages, allow, root_joint) = (packages.unwrap_or_default(), kinds(allow)?, root(root_joint)?);
        let options = UrdfOptions { root_joint, mimic, strict, packages, allow, ..UrdfOptions::default() };
        Ok(condyle::Model::from_urdf_str(text, &options).map_err(exception)?.into())
    }

    /// A model from an MJCF file (MuJoCo) and the files that it includes.
    ///
    /// q and v read as MuJoCo's `qpos` and `qvel`, but that quaternions are x, y, z, w and a free joint's velocity is
    /// in the body's frame (MuJoCo: linear velocity in the world's). Several joints on one body become a chain, with
    /// bodies without mass, `name#1`, `name#2`, …, between them. A thing that a model cannot hold is left out and
    /// reported in `warnings`.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// mimic: whether a `<joint>` of `<equality>` lets joint1 follow joint2, instead of being a constraint beside the
    ///     model; its `polycoef` must be linear.
    /// strict: whether a warning (`warnings`) is an error.
    /// weightless_meshes: whether a mesh with mass that cannot be read weighs nothing and is reported in `warnings`,
    ///     instead of being an error.
    /// packages, allow: as for `from_urdf`.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError`; `ValueError` for an unknown kind.
    #[staticmethod]
    #[pyo3(signature = (path, mimic=false, strict=false, weightless_meshes=false, packages=None, *, allow=None))]
    fn from_mjcf(
        path: PathBuf,
        mimic: bool,
        strict: bool,
        weightless_meshes: bool,
        packages: Option<Vec<PathBuf>>,
        allow: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (packages, allow) = (packages.unwrap_or_default(), kinds(allow)?);
        let options = MjcfOptions { strict, mimic, weightless_meshes, packages, allow };
        Ok(condyle::Model::from_mjcf(path, &options).map_err(exception)?.into())
    }

    /// A model from an MJCF in a string, which may not include files; see `from_mjcf`.
    ///
    /// >>> body = '<body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02" mass="2"/></body>'
    /// >>> condyle.Model.from_mjcf_str(f"<mujoco><worldbody>{body}</worldbody></mujoco>").total_mass
    /// 2.0
    #[staticmethod]
    #[pyo3(signature = (text, mimic=false, strict=false, weightless_meshes=false, packages=None, *, allow=None))]
    fn from_mjcf_str(
        text: &str,
        mimic: bool,
        strict: bool,
        weightless_meshes: bool,
        packages: Option<Vec<PathBuf>>,
        allow: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (packages, allow) = (packages.unwrap_or_default(), kinds(allow)?);
        let options = MjcfOptions { strict, mimic, weightless_meshes, packages, allow };
        Ok(condyle::Model::from_mjcf_str(text, &options).map_err(exception)?.into())
    }

    /// A model from an SDF file (Gazebo), with the models that it includes.
    ///
    /// All models of a file, or of its first world, become one robot, whose names then begin with the model's:
    /// `robot::arm`. Joints are walked breadth first from the root, in the order of the file; one that would give a link a
    /// second parent closes a loop. Universal joints become two revolute ones.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// root_joint: as for `from_urdf`.
    /// mimic: whether an axis with a `<mimic>` follows another one, instead of being free.
    /// strict: whether a warning (`warnings`) is an error.
    /// packages, allow: as for `from_urdf`; `model://` addresses are looked for in `packages` too.
    /// model: the name of the one model to read; None reads all models of the file.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError`; `ValueError` for an unknown kind.
    #[staticmethod]
    #[pyo3(signature = (path, root_joint=None, mimic=false, strict=false, packages=None, *, allow=None, model=None))]
    fn from_sdf(
        path: PathBuf,
        root_joint: Option<&str>,
        mimic: bool,
        strict: bool,
        packages: Option<Vec<PathBuf>>,
        allow: Option<&Bound<'_, PyAny>>,
        model: Option<String>,
    ) -> PyResult<Self> {
        let (packages, allow, root_joint) = (packages.unwrap_or_default(), kinds(allow)?, root(root_joint)?);
        let options = SdfOptions { root_joint, mimic, strict, packages, allow, model };
        Ok(condyle::Model::from_sdf(path, &options).map_err(exception)?.into())
    }

    /// A model from an SDF in a string; see `from_sdf`.
    ///
    /// >>> link = '<link name="ball"><inertial><mass>2</mass></inertial></link>'
    /// >>> text = f'<sdf version="1.7"><model name="ball">{link}</model></sdf>'
    /// >>> condyle.Model.from_sdf_str(text, root_joint="free_flyer").nv
    /// 6
    #[staticmethod]
    #[pyo3(signature = (text, root_joint=None, mimic=false, strict=false, packages=None, *, allow=None, model=None))]
    fn from_sdf_str(
        text: &str,
        root_joint: Option<&str>,
        mimic: bool,
        strict: bool,
        packages: Option<Vec<PathBuf>>,
        allow: Option<&Bound<'_, PyAny>>,
        model: Option<String>,
    ) -> PyResult<Self> {
        let (packages, allow, root_joint) = (packages.unwrap_or_default(), kinds(allow)?, root(root_joint)?);
        let options = SdfOptions { root_joint, mimic, strict, packages, allow, model };
        Ok(condyle::Model::from_sdf_str(text, &options).map_err(exception)?.into())
    }

    /// A model from MuJoCo's, a `mujoco.MjModel`: the robot that MuJoCo has compiled, number for number.
    ///
    /// The names, q and v are those of `from_mjcf`. All that MuJoCo's compiler does is done already: meshes, `replicate`,
    /// `attach`, composites, `settotalmass`. Numbers that were changed after compiling count too. What a model cannot hold
    /// is reported in `warnings` or refused as by `from_mjcf`. MuJoCo itself is not imported.
    ///
    /// mimic, strict, allow: as for `from_mjcf`.
    ///
    /// Raises `ParseError` or `ModelError`; `ValueError` for an unknown kind.
    #[staticmethod]
    #[pyo3(signature = (model, mimic=false, strict=false, *, allow=None))]
    fn from_mujoco(
        model: &Bound<'_, PyAny>,
        mimic: bool,
        strict: bool,
        allow: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let options = MjcfOptions { strict, mimic, allow: kinds(allow)?, ..MjcfOptions::default() };
        let written = model.py().import("condyle._mujoco_models")?.call_method1("mjcf", (model,))?;
        let text: String = written.extract()?;
        Ok(condyle::Model::from_mjcf_text(&text, "<MjModel>", &options).map_err(exception)?.into())
    }

    /// A model from Pinocchio's, a `pinocchio.Model`: the same joints, bodies, frames, limits and losses, so that numbers are
    /// equal; `to_pinocchio` is the way back.
    ///
    /// Composite, universal and spherical ZYX joints become several ones, with bodies without mass between them. Limits of
    /// quaternions, cosines and sines are left out, and so are geometry and reference configurations.
    ///
    /// Raises `ModelError` if its joints do not stand depth first, as Pinocchio's readers of files number them, or are of a
    /// kind that is not here.
    #[staticmethod]
    fn from_pinocchio<'py>(model: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        model.py().import("condyle._pinocchio_models")?.call_method1("from_pinocchio", (model,))
    }

    /// The named positions of an SRDF file, its `<group_state>`s: a dictionary of q by name, nq numbers each.
    ///
    /// Joints that a state does not mention stay as in `neutral`; a joint that turns without limits may have its angle. States
    /// of one name, of several groups, are one position. All else in the file is ignored.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// strict: whether joints that the robot does not have are errors; SRDFs are often shared by robots with fewer joints.
    ///
    /// Raises `ParseError`, with file, line and element.
    #[pyo3(signature = (path, strict=false))]
    fn reference_configurations<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        strict: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        positions(py, self.inner.reference_configurations(path, strict))
    }

    /// The named positions of an SRDF in a string; see `reference_configurations`.
    ///
    /// >>> joint = '<joint name="joint4" value="-1.2"/>'
    /// >>> srdf = f'<robot name="arm7"><group_state name="bent" group="arm">{joint}</group_state></robot>'
    /// >>> condyle.robots.arm7().reference_configurations_str(srdf)
    /// {'bent': array([ 0. ,  0. ,  0. , -1.2,  0. ,  0. ,  0. ])}
    #[pyo3(signature = (text, strict=false))]
    fn reference_configurations_str<'py>(
        &self,
        py: Python<'py>,
        text: &str,
        strict: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        positions(py, self.inner.reference_configurations_str(text, strict))
    }
}

/// Named positions as Python sees them.
fn positions(
    py: Python<'_>,
    read: Result<Vec<(String, Vec<f64>)>, condyle::ModelError>,
) -> PyResult<Bound<'_, PyDict>> {
    let positions = PyDict::new(py);
    for (name, q) in read.map_err(exception)? {
        positions.set_item(name, q.give(py, None)?)?;
    }
    Ok(positions)
}
