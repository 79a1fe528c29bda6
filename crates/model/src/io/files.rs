//! Search for files that a robot's file names by a path, or by a `package://name/path` address of ROS.

use crate::error::Error;
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

/// Beginning of the address of a file in a package.
const SCHEME: &str = "package://";

/// Returns the path of the file that a path or a `package://` address names.
pub(crate) fn locate(path: &Path, packages: &[PathBuf]) -> Result<PathBuf, Error> {
    match path.to_str().and_then(|p| p.strip_prefix(SCHEME)) {
        None => Ok(path.to_owned()),
        Some(address) => {
            let [ros, ament] = ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"].map(std::env::var_os);
            find(SCHEME, address, &folders(packages, ros, ament), Path::is_file)
        }
    }
}

/// Returns the path of the file at an address in a robot's file. The address is a `package://` or `file://` address, an
/// absolute path, or a path relative to the folder of the file that contains the address.
#[allow(dead_code)]
pub(crate) fn resolve(address: &str, folder: &Path, packages: &[PathBuf]) -> Result<PathBuf, Error> {
    let path = address.strip_prefix("file://").unwrap_or(address);
    Ok(folder.join(locate(Path::new(path), packages)?)) // an absolute path is not changed
}

/// Returns all folders in which packages may be, in order of priority.
fn folders(packages: &[PathBuf], ros: Option<OsString>, ament: Option<OsString>) -> Vec<PathBuf> {
    let split = |paths: Option<OsString>| -> Vec<PathBuf> {
        let paths = paths.unwrap_or_default();
        std::env::split_paths(&paths).filter(|p| !p.as_os_str().is_empty()).collect()
    };
    let installed = split(ament).into_iter().map(|prefix| prefix.join("share"));
    packages.iter().cloned().chain(split(ros)).chain(installed).collect()
}

/// Folders in which the models that an SDF includes are searched.
pub(crate) struct Search<'a> {
    /// Folder of the file that includes the models; `None` for a string.
    pub(crate) folder: Option<&'a Path>,
    /// Folders that contain packages or models, or that are a package or model themselves.
    pub(crate) packages: &'a [PathBuf],
}

/// Environment variables that list folders with models.
const MODEL_PATHS: [&str; 4] = ["GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "SDF_PATH", "GAZEBO_MODEL_PATH"];

/// Returns the file, or the folder with a `model.config`, at the address of a model: `model://`, `package://`,
/// `file://`, or a path.
///
/// A path may be relative to the folder of the file that contains the address. Otherwise, the address is searched in
/// `packages`. The next folders are the folder of that file, the parent of that folder, and the `models` folder in each
/// of them. The last folders are those listed in environment variables of Gazebo and ROS.
pub(crate) fn find_model(address: &str, search: &Search) -> Result<PathBuf, Error> {
    let (scheme, path) = address.split_once("://").map_or(("", address), |(scheme, path)| (scheme, path));
    let missing = |what: &str| Error::File { file: address.to_owned(), what: what.to_owned() };
    match scheme {
        "http" | "https" => return Err(missing("models of the network are not fetched")),
        "" | "file" => {
            let at = search.folder.map_or_else(|| PathBuf::from(path), |folder| folder.join(path));
            if at.exists() && (search.folder.is_some() || at.is_absolute()) {
                return Ok(at);
            }
            if Path::new(path).is_absolute() {
                return Err(missing("no such file or folder"));
            }
        }
        _ => {}
    }
    let absolute = search.folder.and_then(|folder| folder.canonicalize().ok());
    let around = absolute.iter().flat_map(|folder| folder.ancestors().take(2));
    let around = around.flat_map(|folder| [folder.to_owned(), folder.join("models")]);
    let near: Vec<PathBuf> = search.packages.iter().cloned().chain(around).collect();
    let [ros, ament] = ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"].map(std::env::var_os);
    let mut all = folders(&near, None, None);
    for name in MODEL_PATHS {
        all.extend(folders(&[], std::env::var_os(name), None));
    }
    all.extend(folders(&[], ros, ament));
    let prefix = if scheme.is_empty() { String::new() } else { format!("{scheme}://") };
    find(&prefix, path, &all, |path| path.exists())
}

/// Returns the first existing file: in a package within one of the folders, or in a folder that is the package itself.
/// The path cannot leave the package, except through links in the package.
fn find(scheme: &str, address: &str, folders: &[PathBuf], fits: fn(&Path) -> bool) -> Result<PathBuf, Error> {
    let (package, path) = address.split_once('/').unwrap_or((address, ""));
    let down = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if package.starts_with('.') || ![package, path].into_iter().flat_map(|p| Path::new(p).components()).all(down) {
        let what = format!("its path leads out of the package `{package}`");
        return Err(Error::File { file: format!("{scheme}{address}"), what });
    }
    let mut looked = Vec::new();
    for folder in folders {
        let itself = folder.file_name().is_some_and(|name| name == package).then(|| folder.join(path));
        for file in [Some(folder.join(package).join(path)), itself].into_iter().flatten() {
            if !package.is_empty() && fits(&file) {
                return Ok(file);
            }
            let file = file.display().to_string();
            if !looked.contains(&file) {
                looked.push(file);
            }
        }
    }
    Err(Error::Package { address: format!("{scheme}{address}"), package: package.to_owned(), looked })
}
