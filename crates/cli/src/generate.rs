//! `condyle generate`: writes code that computes a robot's dynamics.

use crate::error::{Error, nearest};
use crate::robot::{self, RobotArguments, frames};
use crate::terminal::say;
use condyle::ContactConstraint;
use condyle_codegen::{FUNCTIONS, Language, Settings, generate};
use std::num::NonZero;
use std::path::PathBuf;

/// Write a robot's dynamics as straight-line code: C, Rust or CUDA, without branches or dependencies
#[derive(clap::Args)]
#[command(after_help = "Examples:
  condyle generate panda.urdf --functions aba,aba_derivatives --out panda/
  condyle generate quadruped --functions rnea --language rust --out src/
  condyle generate quadruped --functions constrained_dynamics --contacts LF_foot,RH_foot --out .
  condyle generate quadruped --functions rnea_derivatives --language cuda --partitions 5 --out .
  condyle generate arm7 --functions rnea,frames --frames tool --inputs inertia,gravity --out .")]
pub(crate) struct Arguments {
    #[command(flatten)]
    robot: RobotArguments,
    /// Functions to generate: rnea, aba, crba, minv, gravity, nonlinear_effects, rnea_derivatives, aba_derivatives,
    /// rnea_hessian, aba_hessian, frames, centroidal, constrained_dynamics, constrained_dynamics_derivatives,
    /// impulse_dynamics, impulse_dynamics_derivatives
    #[arg(long, value_name = "NAMES", value_delimiter = ',', required = true)]
    functions: Vec<String>,
    /// Language: c, c-float, c-4, c-8, c-float-4, c-float-8, c-casadi, rust, rust-float, cuda or cuda-float
    #[arg(long, value_name = "NAME", default_value = "c")]
    language: String,
    /// Folder for the generated files
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Frames for the function `frames`
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    frames: Vec<String>,
    /// Frames with point contacts, for constrained dynamics and impulses
    #[arg(long, value_name = "FRAMES", value_delimiter = ',')]
    contacts: Vec<String>,
    /// Frames with rigid contacts, for constrained dynamics and impulses
    #[arg(long, value_name = "FRAMES", value_delimiter = ',')]
    rigid_contacts: Vec<String>,
    /// Add external forces on the bodies to the arguments of the dynamics
    #[arg(long)]
    external_forces: bool,
    /// Quantities that become arguments instead of constants: inertia, armature, gravity
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    inputs: Vec<String>,
    /// CUDA only: number of threads per state, each for a part of the results; at most one per limb and one for the
    /// trunk [default: several if one thread has too few registers and there are few states]
    #[arg(long, value_name = "N")]
    partitions: Option<NonZero<usize>>,
}

/// Returns the name if it is in the list of valid names.
fn known<'a>(option: &'static str, name: &str, names: &[&'a str]) -> Result<&'a str, Error> {
    let what = || format!("`{name}` is none of {}{}", names.join(", "), nearest(name, names.iter().copied()));
    names.iter().copied().find(|&other| other == name).ok_or_else(|| Error::Option { option, what: what() })
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    let names = arguments.functions.iter().map(|name| known("functions", name, &FUNCTIONS));
    let names: Vec<&str> = names.collect::<Result<_, _>>()?;
    for input in &arguments.inputs {
        known("inputs", input, &["inertia", "armature", "gravity"])?;
    }
    let language = Language::named(known("language", &arguments.language, &Language::NAMES)?).unwrap_or_default();
    if arguments.partitions.is_some() && !matches!(language, Language::Cuda | Language::CudaFloat) {
        let what = format!("only cuda and cuda-float have them, not {}", arguments.language);
        return Err(Error::Option { option: "partitions", what });
    }
    let model = robot::load(&arguments.robot.robot, &arguments.robot.options)?.model;
    let points = frames(&model, &arguments.contacts)?.into_iter().map(ContactConstraint::point);
    let rigid = frames(&model, &arguments.rigid_contacts)?.into_iter().map(ContactConstraint::rigid);
    let is_input = |name: &str| arguments.inputs.iter().any(|input| input == name);
    let settings = Settings {
        frames: arguments.frames.clone(),
        constraints: points.chain(rigid).collect(),
        external_forces: arguments.external_forces,
        inertia_is_input: is_input("inertia"),
        armature_is_input: is_input("armature"),
        gravity_is_input: is_input("gravity"),
        partitions: arguments.partitions,
    };
    let paths = generate(&model, &names, &settings, language, &arguments.out).map_err(|error| match error {
        condyle_codegen::Error::Model(error) => Error::Model(error),
        condyle_codegen::Error::Write { file, source } => Error::Write { file, source },
        other => Error::Option { option: "functions", what: other.to_string() },
    })?;
    paths.iter().for_each(|path| say(&format!("{}\n", path.display())));
    Ok(())
}
