//! Tests of robots with `package://` addresses. Packages are searched in given folders and in folders of environment
//! variables. A package that no folder contains is an error.

use condyle_model::{Error, Model, UrdfOptions, robots};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folder that contains packages, for one test.
struct Workspace(PathBuf);

impl Workspace {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("condyle-{name}-{}", std::process::id()));
        for (file, text) in [
            ("src/arm_description/urdf/arm.urdf", robots::ARM7),
            ("src/dog_description/dog.urdf", robots::QUADRUPED),
            ("install/share/dog_description/dog.urdf", robots::HUMANOID),
        ] {
            let file = folder.join(file);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        }
        Self(folder)
    }
}

impl Drop for Workspace {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn load(address: &str, packages: &[&Path]) -> Result<Model, Error> {
    let packages = packages.iter().map(|p| p.to_path_buf()).collect();
    Model::from_urdf(address, &UrdfOptions { packages, ..UrdfOptions::default() })
}

#[test]
fn folders_that_are_given() {
    let workspace = Workspace::new("given");
    let (src, share) = (workspace.0.join("src"), workspace.0.join("install/share"));
    let arm = "package://arm_description/urdf/arm.urdf";
    assert_eq!(load(arm, &[&share, &src]).unwrap().nv(), 7);
    assert_eq!(load(arm, &[&src.join("arm_description")]).unwrap().nv(), 7); // the given folder is the package itself
    // the first folder that contains the package is used
    let dog = "package://dog_description/dog.urdf";
    assert_eq!(load(dog, &[&src, &share]).unwrap().nv(), 12);
    assert_eq!(load(dog, &[&share, &src]).unwrap().nv(), 32);
    // a plain path is not an address
    let file = workspace.0.join("src/arm_description/urdf/arm.urdf");
    assert_eq!(load(file.to_str().unwrap(), &[]).unwrap().nv(), 7);
}

#[test]
fn a_missing_package_is_named() {
    let workspace = Workspace::new("missing");
    let src = workspace.0.join("src");
    for (address, package, end) in [
        ("package://nowhere/a.urdf", "nowhere", "nowhere/a.urdf"),
        ("package://arm_description/b.urdf", "arm_description", "arm_description/b.urdf"),
        // the address of a folder instead of a file
        ("package://arm_description/urdf", "arm_description", "arm_description/urdf"),
        ("package://arm_description", "arm_description", "arm_description/"),
    ] {
        let error = load(address, &[&src]).unwrap_err();
        let looked_for = src.join(end).display().to_string();
        let Error::Package { package: named, looked, .. } = &error else { panic!("{error}") };
        assert_eq!((named.as_str(), &looked[0]), (package, &looked_for));
        assert!(
            error.to_string().starts_with(&format!("{address}: no such file in a package `{package}`; looked for "))
        );
    }
    assert!(matches!(load("package://", &[&src]), Err(Error::Package { .. })));
}

/// Checks that an address cannot name a file outside of its package, whether this file exists or not.
#[test]
fn addresses_stay_in_their_package() {
    let workspace = Workspace::new("inside");
    let (src, dog) = (workspace.0.join("src"), workspace.0.join("src/dog_description/dog.urdf"));
    for (address, package) in [
        ("package://arm_description/../dog_description/dog.urdf".to_owned(), "arm_description"),
        ("package://arm_description/urdf/../../dog_description/dog.urdf".to_owned(), "arm_description"),
        ("package://arm_description/../../x".to_owned(), "arm_description"),
        ("package://arm_description//etc/passwd".to_owned(), "arm_description"),
        (format!("package://arm_description/{}", dog.display()), "arm_description"),
        ("package://../src/dog_description/dog.urdf".to_owned(), ".."),
        ("package://./dog_description/dog.urdf".to_owned(), "."),
    ] {
        let error = load(&address, &[&src, &src.join("arm_description")]).unwrap_err();
        assert_eq!(error.to_string(), format!("{address}: its path leads out of the package `{package}`"));
    }
    assert!(load("package://arm_description/./urdf//arm.urdf", &[&src]).is_ok());
}

/// Checks that ROS_PACKAGE_PATH is searched before AMENT_PREFIX_PATH. The search runs in a separate process with its
/// own environment.
#[test]
fn folders_of_the_environment() {
    const CHILD: &str = "CONDYLE_CHILD";
    let dog = "package://dog_description/dog.urdf";
    if let Some(expected) = std::env::var_os(CHILD) {
        let found = load(dog, &[]).map_or_else(|e| e.to_string(), |model| model.nv().to_string());
        assert_eq!(found, expected.to_str().unwrap());
        return;
    }
    let workspace = Workspace::new("environment");
    let run = |ros: Option<PathBuf>, ament: Option<PathBuf>, expected: &str| {
        let mut child = Command::new(std::env::current_exe().unwrap());
        child.args(["--exact", "folders_of_the_environment"]).env(CHILD, expected);
        child.env_remove("ROS_PACKAGE_PATH").env_remove("AMENT_PREFIX_PATH");
        child.envs(ros.map(|p| ("ROS_PACKAGE_PATH", p))).envs(ament.map(|p| ("AMENT_PREFIX_PATH", p)));
        let output = child.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    };
    let (src, install) = (workspace.0.join("src"), workspace.0.join("install"));
    run(Some(src.clone()), None, "12");
    run(None, Some(install.clone()), "32");
    run(Some(src.clone()), Some(install.clone()), "12");
    // the variable contains several folders and some empty names
    let empty = workspace.0.join("nothing");
    let several =
        |first: &Path, second: &Path| Some(std::env::join_paths([first, Path::new(""), second]).unwrap().into());
    run(several(&src, &install.join("share")), None, "12");
    run(several(&install.join("share"), &src), None, "32");
    run(several(&empty, &empty), several(&empty, &install), "32");
    let nowhere = "there are no folders to look in (`packages`, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH)";
    run(None, None, &format!("{dog}: no such file in a package `dog_description`; {nowhere}"));
}

/// Checks that mesh files of shapes are never read.
#[test]
fn meshes_are_not_needed() {
    let mesh = |tag: &str| format!(r#"<{tag}><geometry><mesh filename="package://nowhere/a.stl"/></geometry></{tag}>"#);
    let text = robots::ARM7.replacen("</link>", &format!("{}{}</link>", mesh("visual"), mesh("collision")), 1);
    assert!(text.contains("package://nowhere/a.stl"));
    let model = Model::from_urdf_str(&text, &UrdfOptions::default()).unwrap();
    assert_eq!(model.to_string(), robots::arm7().to_string());
}
