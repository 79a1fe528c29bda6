//! Distances between shapes, and collision shapes of files: the compiled part of the module `condyle.distances`.

use crate::arrays::{matrix, output, pose};
use crate::data::{Data, Holds, take};
use crate::exceptions::exception;
use crate::made_for::MadeFor;
use crate::model::Model;
use condyle::distances::{Collisions, DistancePairs, Distances, Fit, GeometryPair};
use condyle::{MjcfOptions, SdfOptions, Se3, UrdfOptions};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Pairs of geometries, prepared for one robot; see `condyle.distances.DistancePairs`.
///
/// model: the robot; text: a list of pairs in JSON.
#[pyclass(name = "_DistancePairs", module = "condyle._condyle")]
pub(crate) struct PreparedPairs {
    pairs: DistancePairs,
    results: Distances,
    made_for: MadeFor,
}

/// Returns the JSON of a value.
fn json(value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| PyValueError::new_err(error.to_string()))
}

#[pymethods]
impl PreparedPairs {
    #[new]
    fn new(model: &Bound<'_, Model>, text: &str) -> PyResult<Self> {
        let wrong = |error: serde_json::Error| PyValueError::new_err(format!("pairs: {error}"));
        let list: Vec<GeometryPair> = serde_json::from_str(text).map_err(wrong)?;
        let pairs = DistancePairs::new(&model.get().inner, &list).map_err(exception)?;
        Ok(Self { results: Distances::new(&pairs), pairs, made_for: MadeFor::with_geometry(model.get()) })
    }

    /// Returns the number of pairs.
    fn __len__(&self) -> usize {
        self.pairs.len()
    }

    /// Returns (pair, side, kind) of each geometry that a capsule replaces.
    fn _replacements(&self) -> Vec<(usize, usize, &'static str)> {
        self.pairs.replacements().iter().map(|r| (r.pair, r.side, r.shape.kind())).collect()
    }

    /// Returns the index of the geometry with a name, or None.
    fn _find(&self, name: &str) -> Option<usize> {
        self.pairs.find(name)
    }

    /// Sets the placement of a geometry.
    fn _place(&mut self, geometry: usize, placement: &Bound<'_, PyAny>) -> PyResult<()> {
        let count = self.pairs.geometry_count();
        if geometry >= count {
            return Err(PyIndexError::new_err(format!("geometry: expected an index below {count}, found {geometry}")));
        }
        self.pairs.place(geometry, valid_placement(placement)?);
        Ok(())
    }

    /// The largest distance of interest (m).
    #[getter]
    fn cutoff(&self) -> f64 {
        self.pairs.cutoff()
    }

    #[setter]
    fn set_cutoff(&mut self, distance: f64) -> PyResult<()> {
        if distance.is_nan() {
            return Err(PyValueError::new_err("cutoff: expected a number, found NaN"));
        }
        self.pairs.set_cutoff(distance);
        Ok(())
    }

    /// Computes distances (N, n), points (N, n, 2, 3), normals (N, n, 3) and, if `gradients`, gradients (N, n, nv) of n
    /// pairs at N positions.
    fn _evaluate<'py>(
        &mut self,
        model: &Bound<'py, Model>,
        data: &Bound<'py, Data>,
        q: &Bound<'py, PyAny>,
        states: usize,
        gradients: bool,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let (py, robot) = (q.py(), model.get());
        self.made_for.check("pairs", robot)?;
        let (nq, n, nv) = (robot.inner.nq(), self.pairs.len(), self.pairs.nv());
        let q = matrix("q", q, [states, nq])?.to_vec();
        let mut data = take(robot, data)?;
        let rows = if gradients { states } else { 0 };
        let (mut d, mut points) = (vec![0.0; states * n], vec![0.0; 6 * states * n]);
        let (mut normals, mut slopes) = (vec![0.0; 3 * states * n], vec![0.0; rows * n * nv]);
        let (Self { pairs, results, .. }, scratch) = (self, Holds::<f64>::held(&mut *data, &robot.inner)?);
        for (state, q) in q.chunks_exact(nq.max(1)).take(states).enumerate() {
            let placements = condyle::forward_kinematics(&robot.inner, scratch, q);
            if gradients {
                pairs.gradients(placements, results);
                slopes[state * n * nv..][..n * nv].copy_from_slice(results.gradients());
            } else {
                pairs.values(placements, results);
            }
            d[state * n..][..n].copy_from_slice(results.distances());
            for k in 0..n {
                let at = state * n + k;
                for (side, p) in results.points(k).into_iter().enumerate() {
                    points[6 * at + 3 * side..][..3].copy_from_slice(&p.to_array());
                }
                normals[3 * at..][..3].copy_from_slice(&results.normal(k).to_array());
            }
        }
        let array = |shape: &[usize], from: &[f64]| output(py, None, shape, |to| to.copy_from_slice(from));
        let mut all =
            vec![array(&[states, n], &d)?, array(&[states, n, 2, 3], &points)?, array(&[states, n, 3], &normals)?];
        if gradients {
            all.push(array(&[states, n, nv], &slopes)?);
        }
        Ok(all)
    }
}

/// Collision shapes of a robot's file; see `condyle.distances.Collisions`.
///
/// kind: 'urdf', 'mjcf' or 'sdf'; path or text: the file, or its text.
#[pyclass(name = "_Collisions", module = "condyle._condyle")]
pub(crate) struct FileCollisions {
    inner: Collisions,
    packages: Vec<PathBuf>,
}

#[pymethods]
impl FileCollisions {
    #[new]
    #[pyo3(signature = (kind, path, text, packages))]
    fn new(kind: &str, path: Option<PathBuf>, text: Option<&str>, packages: Vec<PathBuf>) -> PyResult<Self> {
        let urdf = UrdfOptions { packages: packages.clone(), ..UrdfOptions::default() };
        let mjcf = MjcfOptions { packages: packages.clone(), ..MjcfOptions::default() };
        let sdf = SdfOptions { packages: packages.clone(), ..SdfOptions::default() };
        let inner = match (kind, path, text) {
            ("urdf", Some(path), _) => Collisions::from_urdf(path, &urdf),
            ("urdf", None, Some(text)) => Collisions::from_urdf_str(text, &urdf),
            ("mjcf", Some(path), _) => Collisions::from_mjcf(path, &mjcf),
            ("mjcf", None, Some(text)) => Collisions::from_mjcf_str(text, &mjcf),
            ("sdf", Some(path), _) => Collisions::from_sdf(path, &sdf),
            ("sdf", None, Some(text)) => Collisions::from_sdf_str(text, &sdf),
            _ => return Err(PyValueError::new_err(format!("format: expected urdf, mjcf or sdf, found {kind}"))),
        };
        Ok(Self { inner: inner.map_err(exception)?, packages })
    }

    /// Returns the geometries in JSON.
    fn _geometries(&self) -> PyResult<String> {
        json(&self.inner.geometries)
    }

    /// Returns name, link and file of each mesh.
    fn _meshes(&self) -> Vec<(&str, &str, &str)> {
        self.inner.meshes().map(|mesh| (&*mesh.name, &*mesh.frame.name, &*mesh.file)).collect()
    }

    /// Returns the warnings as text.
    fn _warnings(&self) -> Vec<String> {
        self.inner.warnings().map(ToString::to_string).collect()
    }

    /// Replaces meshes by shapes. Returns their number.
    fn _fit(&mut self, kind: &str) -> PyResult<usize> {
        let fit = match kind {
            "capsule" => Fit::Capsule,
            "sphere" => Fit::Sphere,
            _ => return Err(PyValueError::new_err(format!("shape: expected capsule or sphere, found {kind}"))),
        };
        Ok(self.inner.fit_meshes(fit, &self.packages))
    }

    /// Disables the pairs of two links.
    fn _disable(&mut self, first: &str, second: &str) -> PyResult<()> {
        self.inner.disable(first, second).map_err(exception)
    }

    /// Disables the pairs of links that an SRDF lists.
    #[pyo3(signature = (path, text))]
    fn _srdf(&mut self, path: Option<PathBuf>, text: Option<&str>) -> PyResult<()> {
        match (path, text) {
            (Some(path), _) => self.inner.read_srdf(path).map_err(exception),
            (None, text) => self.inner.read_srdf_str(text.unwrap_or_default()).map_err(exception),
        }
    }

    /// Returns the pairs that can collide, in JSON.
    fn _pairs(&self, model: &Bound<'_, Model>) -> PyResult<String> {
        json(&self.inner.pairs(&model.get().inner).map_err(exception)?)
    }
}

/// Reads the placement of a geometry: a rotation and a finite translation.
pub(crate) fn valid_placement(given: &Bound<'_, PyAny>) -> PyResult<Se3<f64>> {
    let placement = pose("placement", given)?;
    let is_finite = placement.translation.to_array().iter().all(|x| x.is_finite());
    match placement.rotation.is_rotation() && is_finite {
        true => Ok(placement),
        false => Err(PyValueError::new_err("placement: expected a rotation and a finite translation")),
    }
}
