//! Search for the file of a mesh: next to the robot's file, in a package, or in the folder that an MJCF names.

use std::path::{Component, Path, PathBuf};

/// Folders in which mesh files are searched.
#[derive(Clone, Default)]
pub struct Places {
    /// Folder of the robot's file; `None` for a built-in robot.
    pub folder: Option<PathBuf>,
    /// Folders that contain packages.
    pub packages: Vec<PathBuf>,
}

impl Places {
    /// Returns the file of a path, or of a `package://`, `model://` or `file://` address. A package is searched in
    /// `packages`, ROS_PACKAGE_PATH and AMENT_PREFIX_PATH. Each folder above the robot's file may also be the package
    /// or contain the package.
    pub fn find(&self, address: &str) -> Result<PathBuf, String> {
        let inside = ["package://", "model://"].iter().find_map(|scheme| address.strip_prefix(scheme));
        let Some(inside) = inside else { return self.plain(address.strip_prefix("file://").unwrap_or(address)) };
        let (package, path) = inside.split_once('/').unwrap_or((inside, ""));
        let down = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
        if package.starts_with('.') || path.starts_with('/') || !Path::new(path).components().all(down) {
            return Err(format!("`{address}` leads out of its package"));
        }
        let split = |name| std::env::var_os(name).unwrap_or_default();
        let listed =
            |name| std::env::split_paths(&split(name)).filter(|p| !p.as_os_str().is_empty()).collect::<Vec<_>>();
        let mut folders = self.packages.clone();
        folders.extend(listed("ROS_PACKAGE_PATH"));
        folders.extend(listed("AMENT_PREFIX_PATH").into_iter().map(|prefix| prefix.join("share")));
        let folder = self.folder.as_deref().and_then(|folder| folder.canonicalize().ok());
        folders.extend(folder.iter().flat_map(|folder| folder.ancestors()).map(Path::to_owned));
        for folder in folders {
            let itself = folder.file_name().is_some_and(|name| name == package).then(|| folder.join(path));
            // If an address names no package, such as `package:///meshes/a.stl`, its path is relative to this folder.
            for file in [itself, Some(folder.join(package).join(path))].into_iter().flatten() {
                if file.is_file() {
                    return Ok(file);
                }
            }
        }
        Err(format!("no `{address}` is found"))
    }

    fn plain(&self, path: &str) -> Result<PathBuf, String> {
        let file = self.folder.as_deref().unwrap_or(Path::new("")).join(path);
        if file.is_file() { Ok(file) } else { Err(format!("there is no file `{}`", file.display())) }
    }
}
