//! Expansion of xacro files by an external program, without a shell and with a time limit.

use crate::error::Error;
use std::ffi::{OsStr, OsString};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Programs that expand xacro files, in the order in which they are tried. The first one is part of ROS. The second one
/// is on PyPI and does not need ROS.
const PROGRAMS: [&str; 2] = ["xacro", "xacrodoc"];
/// Words in error messages of `xacro`. A message with such a word shows that `xacro` did not find a package because ROS
/// is missing.
const ROS: [&str; 4] = ["ament_index_python", "rospkg", "PackageNotFoundError", "$(find"];
/// Advice in the error message for a file that refers to packages.
const ADVICE: &str = "\nThe program `xacro` resolves `$(find …)` by ROS only. `pip install xacrodoc` installs a program \
    that finds packages in the folders of `packages`.";
/// Maximum running time of a program. The expansion of large robots takes a few seconds.
const MAX_TIME: Duration = Duration::from_secs(60);
/// Maximum length of a program's output that is read (bytes): one more than the limit for a robot's files, so that a
/// longer output is detected.
const MAX_BYTES: u64 = (64 << 20) + 1;
/// Maximum number of bytes of a program's message that an error contains.
const MESSAGE: usize = 2000;

/// Returns whether the name of a file ends in `.xacro`.
pub(super) fn is_xacro(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "xacro")
}

/// Returns the URDF to which a xacro file expands.
pub(super) fn expand(path: &Path, arguments: &[(String, String)], packages: &[PathBuf]) -> Result<String, Error> {
    let wrong = |what: String| Error::File { file: path.display().to_string(), what };
    for (name, _) in arguments {
        let is_name = |name: &str| name.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | '.'));
        if name.is_empty() || name.starts_with('-') || !is_name(name) {
            return Err(wrong(format!("`{name}` is no name of an argument of xacro")));
        }
    }
    let mut said = None;
    for program in PROGRAMS {
        match run(program, path, arguments, packages) {
            Ok(text) => return Ok(text),
            Err(Failure::Missing) => {}
            Err(Failure::Said(what)) => {
                let needs_ros = program == PROGRAMS[0] && ROS.iter().any(|name| what.contains(name));
                let advice = if needs_ros { ADVICE } else { "" };
                said = Some(format!("cannot be expanded: {program}: {what}{advice}"));
            }
        }
    }
    let missing = || {
        let how = "install one of them (`pip install xacrodoc`), or expand the file first";
        format!("is of xacro, and the programs `xacro` and `xacrodoc` are not found: {how}")
    };
    Err(wrong(said.unwrap_or_else(missing)))
}

/// Reason why a program did not expand a file.
enum Failure {
    Missing,
    Said(String),
}

/// Runs a program, and returns its output.
fn run(program: &str, path: &Path, arguments: &[(String, String)], packages: &[PathBuf]) -> Result<String, Failure> {
    let failed = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => Failure::Missing,
        _ => Failure::Said(e.to_string()),
    };
    let mut command = Command::new(program);
    // Adds `./` to a relative path, because a path that begins with a dash would be parsed as an option.
    command.arg(if path.is_absolute() { path.to_owned() } else { Path::new(".").join(path) });
    if program == PROGRAMS[1] {
        command.args(packages.iter().flat_map(|folder| [OsStr::new("--pkg-dir"), folder.as_os_str()]));
    }
    command.args(arguments.iter().map(|(name, value)| format!("{name}:={value}")));
    command.env("ROS_PACKAGE_PATH", search_path(packages));
    let mut child =
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().map_err(failed)?;
    let (output, errors) = (read(child.stdout.take()), read(child.stderr.take()));
    let end = Instant::now() + MAX_TIME;
    let status = loop {
        match child.try_wait().map_err(failed)? {
            Some(status) => break Some(status),
            None if Instant::now() < end => thread::sleep(Duration::from_millis(2)),
            None => break None,
        }
    };
    let Some(status) = status else {
        let _ = child.kill();
        let _ = child.wait();
        return Err(Failure::Said(format!("is not done after {} s", MAX_TIME.as_secs())));
    };
    // Waits at most one second, because a pipe stays open as long as another process holds it.
    let text = |from: Receiver<Vec<u8>>| from.recv_timeout(Duration::from_secs(1)).unwrap_or_default();
    if status.success() {
        return String::from_utf8(text(output)).map_err(|e| Failure::Said(e.to_string()));
    }
    let message = text(errors);
    let message = String::from_utf8_lossy(&message[message.len().saturating_sub(MESSAGE)..]).trim().to_owned();
    Err(Failure::Said(if message.is_empty() { status.to_string() } else { message }))
}

/// Reads a pipe on a separate thread, up to [`MAX_BYTES`] bytes.
fn read(pipe: Option<impl Read + Send + 'static>) -> Receiver<Vec<u8>> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.by_ref().take(MAX_BYTES).read_to_end(&mut bytes);
        }
        let _ = sender.send(bytes);
    });
    receiver
}

/// Returns the search path of packages: first the folders in `packages`, then the folders in the environment variable.
fn search_path(packages: &[PathBuf]) -> OsString {
    let ros = std::env::var_os("ROS_PACKAGE_PATH").unwrap_or_default();
    let folders = packages.iter().cloned().chain(std::env::split_paths(&ros));
    std::env::join_paths(folders).unwrap_or_default()
}
