//! Writes files of generated code for a robot.

use crate::error::Error;
use crate::identifiers::identifier;
use crate::robot::{Settings, functions};
use crate::text::Language;
use condyle_model::Model;
use std::path::{Path, PathBuf};

/// Writes functions of a robot into files of a folder. The folder is created if it does not exist. Programs and build
/// scripts can call this function.
///
/// Names of files and functions begin with the robot's name, as an identifier, and the language's suffix
/// ([`Language::stem`]). Examples: `panda.h` and `panda.c` with `panda_aba` and other functions, `panda_float_x8.h` and
/// `panda_float_x8.c` with `panda_float_x8_aba`, or `panda.rs` with `aba`. Returns the paths of the files. The same
/// robot gives the same text, and an unchanged file is not written again.
///
/// ```no_run
/// use condyle_codegen::{Language, Settings, generate};
/// use condyle_model::{Model, UrdfOptions};
/// // build.rs
/// let panda = Model::from_urdf("panda.urdf", &UrdfOptions::default())?;
/// let folder = std::env::var("OUT_DIR").unwrap();
/// generate(&panda, &["aba", "aba_derivatives"], &Settings::default(), Language::Rust, folder.as_ref())?;
/// // lib.rs: mod panda { include!(concat!(env!("OUT_DIR"), "/panda.rs")); }
/// # Ok::<(), condyle_codegen::Error>(())
/// ```
///
/// # Errors
/// The errors of [`functions`], and [`Error::Write`].
pub fn generate(
    model: &Model,
    names: &[&str],
    settings: &Settings,
    language: Language,
    folder: &Path,
) -> Result<Vec<PathBuf>, Error> {
    let functions = functions(model, names, settings)?;
    let failed = |path: &Path, source| Error::Write { file: path.display().to_string(), source };
    std::fs::create_dir_all(folder).map_err(|source| failed(folder, source))?;
    let mut paths = Vec::new();
    for file in language.text(&identifier(model.name()), &functions) {
        let path = folder.join(file.name);
        if !std::fs::read(&path).is_ok_and(|old| old == file.text.as_bytes()) {
            std::fs::write(&path, file.text).map_err(|source| failed(&path, source))?;
        }
        paths.push(path);
    }
    Ok(paths)
}
