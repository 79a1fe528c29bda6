//! Robots as straight-line code, for `condyle.codegen`: the text of the code, and arguments and results of the
//! generated functions.

use crate::constrained::constraint;
use crate::exceptions::{exception, wrong_word};
use crate::functions::regular;
use crate::model::Model;
use condyle_codegen::{Array, Error, FUNCTIONS, Function, Language, Settings, functions, identifier};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::num::NonZero;

/// Arrays of a function: their names, numbers of rows and numbers of columns.
type Arrays = Vec<(String, usize, usize)>;

/// The name of the code, its files as (name, text), and its functions as (name, arguments, results, operations,
/// partitions).
type Generated = (String, Vec<(String, String)>, Vec<(String, Arrays, Arrays, usize, usize)>);

fn arrays(arrays: &[Array]) -> Arrays {
    arrays.iter().map(|a| (a.name.clone(), a.rows, a.columns)).collect()
}

/// Generates the code of functions of a robot. Returns the name of the code, the files, and the functions with their
/// arguments and results.
#[pyfunction]
#[pyo3(
    name = "_generate",
    signature = (
        model, names, language, *, frames=vec![], constraints=vec![], external_forces=false, inputs=vec![],
        partitions=None
    )
)]
pub(crate) fn generate(
    py: Python<'_>,
    model: &Bound<'_, Model>,
    names: Vec<String>,
    language: &str,
    frames: Vec<String>,
    constraints: Vec<Bound<'_, PyAny>>,
    external_forces: bool,
    inputs: Vec<String>,
    partitions: Option<usize>,
) -> PyResult<Generated> {
    let robot = &model.get().inner;
    let known = |name: &&String| !["inertia", "armature", "gravity"].contains(&&***name);
    if let Some(other) = inputs.iter().find(known) {
        return Err(wrong_word("inputs", "'inertia', 'armature' or 'gravity'", other));
    }
    let is_input = |name: &str| inputs.iter().any(|other| other == name);
    let expected = || Language::NAMES.map(|name| format!("'{name}'")).join(", ");
    let written = Language::named(language).ok_or_else(|| wrong_word("language", &expected(), language))?;
    if let Some(number) = partitions {
        let has_partitions = matches!(written, Language::Cuda | Language::CudaFloat);
        let expected = if has_partitions { "None or at least 1" } else { "None" };
        if number == 0 || !has_partitions {
            let said = format!("partitions: expected {expected} for '{language}', found {number}");
            return Err(PyValueError::new_err(said));
        }
    }
    let settings = Settings {
        frames,
        constraints: constraints.iter().map(|given| constraint(robot, given)).collect::<PyResult<_>>()?,
        external_forces,
        inertia_is_input: is_input("inertia"),
        armature_is_input: is_input("armature"),
        gravity_is_input: is_input("gravity"),
        partitions: partitions.and_then(NonZero::new),
    };
    let names: Vec<&str> = names.iter().map(|name| &**name).collect();
    if let Some(other) = names.iter().find(|name| !FUNCTIONS.contains(name)) {
        return Err(wrong_word("functions", &FUNCTIONS.map(|name| format!("'{name}'")).join(", "), other));
    }
    let made = py.detach(|| {
        let all = functions(robot, &names, &settings)?;
        let name = identifier(robot.name());
        let files = written.text(&name, &all);
        Ok((written.stem(&name), files, all))
    });
    let (name, files, all) = match made {
        Ok(made) => made,
        Err(Error::Model(error)) => return Err(exception(error)),
        Err(Error::Singular { .. }) => {
            return Err(regular(robot).err().unwrap_or_else(|| PyValueError::new_err("model")));
        }
        Err(other) => return Err(PyValueError::new_err(other.to_string())),
    };
    let files = files.into_iter().map(|file| (file.name, file.text)).collect();
    let about = |f: &Function| {
        (f.name.clone(), arrays(&f.inputs), arrays(&f.outputs), f.operations().total(), f.partitions(written))
    };
    Ok((name, files, all.iter().map(about).collect()))
}
