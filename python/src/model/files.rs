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

/// Reads the argument `allow`: the kinds of warnings that a strict reader accepts.
fn kinds(allow: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<WarningKind>> {
    let Some(allow) = allow else { return Ok(Vec::new()) };
    let kind = |word: &Bound<'_, PyAny>| {
        let word: &str = &word.extract::<String>()?;
        word.parse().map_err(|what: String| PyValueError::new_err(format!("allow: {what}")))
    };
    members_of("allow", "kinds of warnings", allow)?.iter().map(kind).collect()
}

/// Converts the values of xacro's arguments to text, as xacro writes them.
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
    /// Reads a model from a URDF file.
    ///
    /// Fixed joints are merged into their parent body and remain as frames. Meshes are never read. A file whose name
    /// ends in `.xacro` is expanded by the installed program `xacro` or `xacrodoc`. That program evaluates expressions
    /// in the file, so read only files from sources that you trust.
    ///
    /// path: a path, as text or `os.PathLike`, or `package://name/path/in/the/package`.
    /// root_joint: the joint between the world and the root link, named `root_joint`: 'free_flyer', 'planar',
    ///     'spherical' or 'translation'; None fixes the root link to the world.
    /// mimic: whether joints with a `<mimic>` share the coordinate of the joint that they follow. Otherwise they have
    ///     their own coordinates.
    /// strict: whether a warning (`warnings`) is an error.
    /// packages: folders that contain packages, or are packages. They are searched before the folders in the
    ///     environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
    /// allow: kinds of warnings that are not errors even if `strict` is set: 'massless', 'negative', 'triangle',
    ///     'singular', 'unlikely', 'limit', 'unknown', 'left_out', 'assumed' or 'mimic'.
    /// arguments: values of xacro's `<xacro:arg>`s by name, for files that end in `.xacro`.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError` for an invalid robot, and `ValueError` for an
    /// unknown kind of warning.
    #[staticmethod]
    #[pyo3(signature = (
        path, root_joint=None, mimic=false, strict=false, packages=None, *, allow=None, arguments=None
    ))]
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

    /// Reads a model from a URDF in a string; see `from_urdf`.
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

    /// Reads a model from an MJCF file (MuJoCo) and the files that it includes.
    ///
    /// q and v have the layout of MuJoCo's `qpos` and `qvel`, with two exceptions: quaternions are x, y, z, w, and a
    /// free joint's velocity is in the body's frame (MuJoCo: linear velocity in the world's frame). Several joints on
    /// one body become a chain of joints, connected by bodies without mass, `name#1`, `name#2`, and so on. Contents
    /// that a model cannot represent are left out and reported in `warnings`.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// mimic: whether a `<joint>` of `<equality>` makes joint1 follow joint2; its `polycoef` must then be linear.
    ///     Otherwise the coupling is one of the `constraints`, which are not part of the tree.
    /// strict: whether a warning (`warnings`) is an error.
    /// weightless_meshes: whether a mesh with mass that cannot be read counts as massless and is reported in
    ///     `warnings`. Otherwise it is an error.
    /// packages, allow: as for `from_urdf`.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError` for an invalid robot, and `ValueError` for an
    /// unknown kind of warning.
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

    /// Reads a model from an MJCF in a string, which may not include files; see `from_mjcf`.
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

    /// Reads a model from an SDF file (Gazebo), and the models that the file includes.
    ///
    /// All models of a file, or of its first world, become one robot. Each name then begins with the name of its model:
    /// `robot::arm`. Joints are visited breadth first from the root, in the order of the file. A joint that would give
    /// a link a second parent closes a loop. A universal joint becomes two revolute joints.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// root_joint: as for `from_urdf`.
    /// mimic: whether an axis with a `<mimic>` follows another axis. Otherwise the axis moves freely.
    /// strict: whether a warning (`warnings`) is an error.
    /// packages, allow: as for `from_urdf`; `packages` are also searched for `model://` addresses.
    /// model: the name of the one model to read; None reads all models of the file.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError` for an invalid robot, and `ValueError` for an
    /// unknown kind of warning.
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

    /// Reads a model from an SDF in a string; see `from_sdf`.
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

    /// Converts a `mujoco.MjModel`, which is a robot compiled by MuJoCo. The numbers stay the same.
    ///
    /// The names, q and v are the same as with `from_mjcf`. Named `<frame>`s are missing, because MuJoCo does not keep
    /// them. The results of MuJoCo's compiler are included: meshes, `replicate`, `attach`, composites, `settotalmass`.
    /// If numbers were changed after compilation, the changed numbers are used. Contents that a model cannot represent
    /// are reported in `warnings`, or are an error, in the same cases as for `from_mjcf`. MuJoCo itself is not
    /// imported.
    ///
    /// mimic, strict, allow: as for `from_mjcf`.
    ///
    /// Raises `TypeError` if the argument is not an `MjModel`, `ParseError` or `ModelError` if its contents are
    /// invalid, and `ValueError` for an unknown kind of warning.
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
        Ok(condyle::Model::from_compiled_mjcf(&text, &options).map_err(exception)?.into())
    }

    /// Converts a `pinocchio.Model`. The result has the same joints, bodies, frames, limits, damping and friction, so
    /// algorithms give equal results. `to_pinocchio` is the inverse.
    ///
    /// Composite, universal and spherical ZYX joints become several joints, connected by bodies without mass. Limits of
    /// quaternions, cosines and sines, geometry, and reference configurations are left out.
    ///
    /// Raises `ModelError` if a joint has an unsupported kind, or if the joints are not in depth-first order.
    /// Pinocchio's file readers number joints in this order.
    #[staticmethod]
    fn from_pinocchio<'py>(model: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        model.py().import("condyle._pinocchio_models")?.call_method1("from_pinocchio", (model,))
    }

    /// Reads the named positions of an SRDF file, which are its `<group_state>`s. Returns a dictionary from names to q,
    /// nq numbers each.
    ///
    /// Joints that a state does not mention stay as in `neutral`. For a joint that turns without limits, the state may
    /// give the angle. States of several groups with the same name form one position. All other contents of the file
    /// are ignored.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// strict: whether a joint that the robot does not have is an error. Without `strict` such a joint is ignored,
    /// since robots with fewer joints often share an SRDF.
    ///
    /// Raises `ParseError` for an invalid file; the error contains file, line and element.
    #[pyo3(signature = (path, strict=false))]
    fn reference_configurations<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        strict: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        positions(py, self.inner.reference_configurations(path, strict))
    }

    /// Reads the named positions of an SRDF in a string; see `reference_configurations`.
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

/// Converts named positions to a Python dictionary.
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
