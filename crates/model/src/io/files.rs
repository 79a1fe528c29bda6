//! Files that a robot's file names: paths, and `package://name/path` addresses as ROS writes them.

use crate::error::Error;
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

/// The beginning of the address of a file in a package.
const SCHEME: &str = "package://";

/// Returns the file that a path or a `package://` address names.
pub(crate) fn locate(path: &Path, packages: &[PathBuf]) -> Result<PathBuf, Error> {
    match path.to_str().and_then(|p| p.strip_prefix(SCHEME)) {
        None => Ok(path.to_owned()),
        Some(address) => {
            let [ros, ament] = ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"].map(std::env::var_os);
            find(address, &folders(packages, ros, ament))
        }
    }
}

/// Returns the file that an address in a robot's file names: a `package://` or `file://` address, an absolute path, or a path
/// relative to the folder of the file that has the address.
#[allow(dead_code)]
pub(crate) fn resolve(address: &str, folder: &Path, packages: &[PathBuf]) -> Result<PathBuf, Error> {
    let path = address.strip_prefix("file://").unwrap_or(address);
    Ok(folder.join(locate(Path::new(path), packages)?)) // an absolute path stays as it is
}

/// All folders in which packages may be, the most particular first.
fn folders(packages: &[PathBuf], ros: Option<OsString>, ament: Option<OsString>) -> Vec<PathBuf> {
    let split = |paths: Option<OsString>| -> Vec<PathBuf> {
        let paths = paths.unwrap_or_default();
        std::env::split_paths(&paths).filter(|p| !p.as_os_str().is_empty()).collect()
    };
    let installed = split(ament).into_iter().map(|prefix| prefix.join("share"));
    packages.iter().cloned().chain(split(ros)).chain(installed).collect()
}

/// The first such file: of a package in a folder, or of a folder that is the package itself. The path stays in the
/// package, but for links that are in it.
fn find(address: &str, folders: &[PathBuf]) -> Result<PathBuf, Error> {
    let (package, path) = address.split_once('/').unwrap_or((address, ""));
    let down = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if package.starts_with('.') || ![package, path].into_iter().flat_map(|p| Path::new(p).components()).all(down) {
        let what = format!("its path leads out of the package `{package}`");
        return Err(Error::File { file: format!("{SCHEME}{address}"), what });
    }
    let mut looked = Vec::new();
    for folder in folders {
        let itself = folder.file_name().is_some_and(|name| name == package).then(|| folder.join(path));
        for file in [Some(folder.join(package).join(path)), itself].into_iter().flatten() {
            if !package.is_empty() && file.is_file() {
                return Ok(file);
            }
            looked.push(file.display().to_string());
        }
    }
    Err(Error::Package { address: format!("{SCHEME}{address}"), package: package.to_owned(), looked })
}
