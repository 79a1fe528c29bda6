//! Where the file of a mesh is: beside its robot's file, in a package, in the folder that an MJCF names.

use std::path::{Component, Path, PathBuf};

/// Where files are looked for.
#[derive(Clone, Default)]
pub struct Places {
    /// The folder of the robot's file; none for a robot that comes along.
    pub folder: Option<PathBuf>,
    /// Folders with packages in them.
    pub packages: Vec<PathBuf>,
}

impl Places {
    /// The file of a path, a `package://`, `model://` or `file://` address. A package may be in `packages`, ROS_PACKAGE_PATH,
    /// AMENT_PREFIX_PATH, or be a folder around the robot's file or beside such a folder.
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
            // an address without a package, as `package:///meshes/a.stl`: from the folder itself
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
