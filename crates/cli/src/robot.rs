//! Loads the robot of a command, from a file in any supported format or from the built-in robots.

use crate::error::{Error, nearest};
use condyle::distances::Collisions;
use condyle::{Joint, MjcfOptions, Model, ModelError, SdfOptions, UrdfOptions, robots};
use condyle_meshes::Places;
use std::path::{Path, PathBuf};

/// Names of the built-in robots.
pub(crate) const EMBEDDED: [&str; 3] = ["arm7", "quadruped", "humanoid"];

/// Robot, and how its file is read.
#[derive(clap::Args, Clone)]
pub(crate) struct RobotArguments {
    /// Robot: a URDF, MJCF or SDF file, or a built-in robot: arm7, quadruped, humanoid
    #[arg(value_name = "ROBOT")]
    pub robot: String,
    #[command(flatten)]
    pub options: ReadingOptions,
}

/// Options for reading a robot's file.
#[derive(clap::Args, Clone, Default)]
pub(crate) struct ReadingOptions {
    /// Joint between the world and the root link of a URDF or SDF. Default: fixed; free for `condyle walk`,
    /// and for the built-in quadruped and humanoid
    #[arg(long, value_name = "JOINT", value_enum)]
    pub root: Option<Root>,
    /// Make joints with a <mimic> (MJCF: <equality>) follow another joint; otherwise each has its own coordinate
    #[arg(long)]
    pub mimic: bool,
    /// Folder that contains packages, for package:// addresses; can be given several times
    #[arg(long, value_name = "FOLDER")]
    pub packages: Vec<PathBuf>,
    /// Value of an argument of a .xacro file, which the installed program xacro expands; can be given several times
    #[arg(long = "argument", value_name = "NAME=VALUE", value_parser = argument)]
    pub arguments: Vec<(String, String)>,
    /// Model of an SDF to read. Default: all models
    #[arg(long, value_name = "MODEL")]
    pub model: Option<String>,
}

impl ReadingOptions {
    /// Converts the options to the library's options for a URDF.
    fn urdf(&self) -> UrdfOptions {
        let (root_joint, mimic) = (self.root.and_then(Root::joint), self.mimic);
        let (packages, arguments) = (self.packages.clone(), self.arguments.clone());
        UrdfOptions { root_joint, mimic, packages, arguments, ..UrdfOptions::default() }
    }
}

/// Parses an argument for xacro: `name=value`, or xacro's own syntax `name:=value`.
fn argument(text: &str) -> Result<(String, String), &'static str> {
    let (name, value) = text.split_once(":=").or_else(|| text.split_once('=')).ok_or("expected NAME=VALUE")?;
    Ok((name.to_owned(), value.to_owned()))
}

/// Type of the joint between the world and a root link.
#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
pub(crate) enum Root {
    Fixed,
    Free,
    Planar,
    Spherical,
    Translation,
}

impl Root {
    fn joint(self) -> Option<Joint> {
        match self {
            Self::Fixed => None,
            Self::Free => Some(Joint::FreeFlyer),
            Self::Planar => Some(Joint::Planar),
            Self::Spherical => Some(Joint::Spherical),
            Self::Translation => Some(Joint::Translation),
        }
    }
}

/// Format of a robot's file.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Format {
    Urdf,
    Mjcf,
    Sdf,
}

impl Format {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Urdf => "URDF",
            Self::Mjcf => "MJCF",
            Self::Sdf => "SDF",
        }
    }
}

/// Robot with its source: file, format and text.
pub(crate) struct Robot {
    pub model: Model,
    /// Path of the file, or name of the built-in robot.
    pub source: String,
    pub format: Format,
    /// Text of the file.
    pub text: String,
    /// Folders in which the program searches for the robot's meshes.
    pub places: Places,
    options: ReadingOptions,
}

impl Robot {
    /// Reads the collision shapes from the robot's file.
    pub(crate) fn collisions(&self) -> Result<Collisions, ModelError> {
        let packages = self.options.packages.clone();
        match self.format {
            Format::Urdf => Collisions::from_urdf_str(&self.text, &UrdfOptions { packages, ..UrdfOptions::default() }),
            Format::Mjcf => Collisions::from_mjcf(&self.source, &MjcfOptions { packages, ..MjcfOptions::default() }),
            Format::Sdf => {
                let model = self.options.model.clone();
                Collisions::from_sdf(&self.source, &SdfOptions { packages, model, ..SdfOptions::default() })
            }
        }
    }
}

/// Loads a robot from a file, or a built-in robot.
pub(crate) fn load(name: &str, options: &ReadingOptions) -> Result<Robot, Error> {
    let places = |path: &Path| Places { folder: path.parent().map(Path::to_owned), packages: options.packages.clone() };
    let Some(path) = locate(name) else {
        return embedded(name, options);
    };
    let found = if name.starts_with("package://") { places(Path::new("")).find(name).unwrap_or(path) } else { path };
    let (format, mut text) = sniff(&found)?;
    let model = if format == Format::Urdf && found.extension().is_some_and(|extension| extension == "xacro") {
        let urdf = options.urdf();
        text = Model::expand_xacro(&found, &urdf)?;
        Model::from_urdf_text(&text, &format!("{name} (expanded)"), &urdf)?
    } else {
        read(name, format, options)?
    };
    let places = places(&found);
    Ok(Robot { model, source: name.to_owned(), format, text, places, options: options.clone() })
}

/// Returns the path of the robot's file, or `None` for a built-in robot. A package:// address is resolved later.
fn locate(name: &str) -> Option<PathBuf> {
    let path = Path::new(name);
    let plain = !EMBEDDED.contains(&name) || path.is_file();
    (plain && (path.exists() || name.starts_with("package://"))).then(|| path.to_owned())
}

/// Reads the model from a file whose format is known.
pub(crate) fn read(path: &str, format: Format, options: &ReadingOptions) -> Result<Model, Error> {
    let (root_joint, mimic, packages) = (options.root.and_then(Root::joint), options.mimic, options.packages.clone());
    Ok(match format {
        Format::Urdf => Model::from_urdf(path, &options.urdf())?,
        Format::Sdf => {
            let model = options.model.clone();
            Model::from_sdf(path, &SdfOptions { root_joint, mimic, packages, model, ..SdfOptions::default() })?
        }
        Format::Mjcf => {
            if options.root.is_some() {
                let what = "not for an MJCF, which defines the joints of its bodies to the world".to_owned();
                return Err(Error::Option { option: "root", what });
            }
            Model::from_mjcf(path, &MjcfOptions { mimic, packages, ..MjcfOptions::default() })?
        }
    })
}

/// Loads a built-in robot. The robot has its usual root joint unless the options request another root joint.
fn embedded(name: &str, options: &ReadingOptions) -> Result<Robot, Error> {
    let (text, free) = match name {
        "arm7" => (robots::ARM7, false),
        "quadruped" => (robots::QUADRUPED, true),
        "humanoid" => (robots::HUMANOID, true),
        _ => return Err(unknown(name)),
    };
    let root_joint = match options.root {
        Some(root) => root.joint(),
        None => free.then_some(Joint::FreeFlyer),
    };
    let model =
        Model::from_urdf_str(text, &UrdfOptions { root_joint, mimic: options.mimic, ..UrdfOptions::default() })?;
    let (text, places) = (text.to_owned(), Places::default());
    Ok(Robot { model, source: name.to_owned(), format: Format::Urdf, text, places, options: options.clone() })
}

/// Returns an error for a name that is neither a file nor a built-in robot. The message suggests the most similar name.
fn unknown(name: &str) -> Error {
    let kinds = ["urdf", "xacro", "xml", "mjcf", "sdf"];
    if name.contains(['.', '/', '\\']) {
        return no_such_file(name, &kinds);
    }
    let files = files_beside(name, &kinds);
    Error::Robot {
        name: name.to_owned(),
        nearest: nearest(name, EMBEDDED.into_iter().chain(files.iter().map(|x| &**x))),
    }
}

/// Returns an error for a missing file. The message suggests the most similar file name with one of the given
/// extensions.
pub(crate) fn no_such_file(name: &str, kinds: &[&str]) -> Error {
    let files = files_beside(name, kinds);
    let nearest = nearest(name, files.iter().map(|file| &**file));
    Error::File { file: name.to_owned(), what: format!("No such file{nearest}") }
}

/// Returns the names of files with the given extensions in the folder of `name`.
fn files_beside(name: &str, kinds: &[&str]) -> Vec<String> {
    let folder = Path::new(name).parent().map_or("", |parent| parent.to_str().unwrap_or_default());
    let look_in = if folder.is_empty() { "." } else { folder };
    let files = std::fs::read_dir(look_in).into_iter().flatten().flatten().filter_map(|entry| {
        let file = entry.file_name().to_str()?.to_owned();
        let kind = Path::new(&file).extension()?.to_str()?.to_lowercase();
        let path = Path::new(folder).join(&file).to_str()?.to_owned();
        kinds.contains(&&*kind).then_some(path)
    });
    files.take(1000).collect()
}

/// Returns the format and the text of a file. The first element of the text determines the format.
fn sniff(path: &Path) -> Result<(Format, String), Error> {
    let wrong = |what: String| Error::File { file: path.display().to_string(), what };
    if path.to_str().is_some_and(|name| name.starts_with("package://")) {
        return Ok((Format::Urdf, String::new()));
    }
    let text = Model::file_text(path)?;
    let format = match first_tag(&text) {
        Some("robot") => Format::Urdf,
        Some("mujoco") => Format::Mjcf,
        Some("sdf") => Format::Sdf,
        Some(tag) => {
            let near = nearest(tag, ["robot", "mujoco", "sdf"]);
            return Err(wrong(format!("begins with <{tag}>, expected <robot> (URDF), <mujoco> (MJCF) or <sdf>{near}")));
        }
        None => return Err(wrong("has no XML element: expected a URDF, MJCF or SDF".to_owned())),
    };
    Ok((format, text))
}

/// Returns the name of the first element of an XML text; declarations and comments before it are skipped.
fn first_tag(mut text: &str) -> Option<&str> {
    loop {
        let (_, rest) = text.split_once('<')?;
        text = match rest.as_bytes().first()? {
            b'?' => rest.split_once("?>")?.1,
            b'!' if rest.starts_with("!--") => rest.split_once("-->")?.1,
            b'!' => rest.split_once('>')?.1,
            _ => {
                return rest
                    .split(|c: char| c.is_whitespace() || matches!(c, '>' | '/'))
                    .next()
                    .filter(|t| !t.is_empty());
            }
        };
    }
}

/// Returns the indices of the frames with these names.
pub(crate) fn frames(model: &Model, names: &[String]) -> Result<Vec<usize>, Error> {
    names.iter().map(|name| Ok(model.frame(name)?)).collect()
}

/// Adds armature (kg m², kg) to the joints that move no inertia, so that forward dynamics has a solution. Returns the
/// robot and the names of these joints.
pub(crate) fn regular(model: Model, armature: f64) -> Result<(Model, Vec<String>), Error> {
    let joints: Vec<String> = model.singular_joints().iter().map(|&i| model.bodies()[i].joint_name.clone()).collect();
    if joints.is_empty() {
        return Ok((model, joints));
    }
    let mut added = model.armature().to_vec();
    for &i in model.singular_joints() {
        let body = &model.bodies()[i];
        (body.idx_v..body.idx_v + body.joint.nv()).for_each(|v| added[v] += armature);
    }
    Ok((model.with_armature(&added)?, joints))
}
