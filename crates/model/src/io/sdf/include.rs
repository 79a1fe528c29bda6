//! Files of an SDF. Includes are replaced by the included models, all models are converted to one version, and unknown
//! names are reported.

use super::convert::convert;
use super::schema::{HEAVY, KNOWN, LEFT_OUT};
use super::scopes::MERGED;
use super::tidy::tidy;
use super::values::{attribute, flag, text};
use crate::error::Error;
use crate::io::files::{Search, find_model};
use crate::io::known::{Known, OPEN};
use crate::io::xml::{Amount, Element, MAX_DEPTH};
use crate::warning::Warning;
use std::path::{Path, PathBuf};

/// Names of the file that lists the model files of its folder: the current name and an older name.
const CONFIGS: [&str; 2] = ["model.config", "manifest.xml"];

/// Maximum number of included files. Opening more files takes longer than a second.
const MAX_INCLUDES: usize = 16_384;

/// Reader of all files of a robot.
pub(super) struct Includes<'o> {
    amount: Amount,
    known: Known,
    packages: &'o [PathBuf],
    /// Files that are being read. Each file is included by the file before it.
    open: Vec<PathBuf>,
    /// Number of includes that have been read.
    count: usize,
    pub(super) warnings: Vec<Warning>,
    /// Error about the first model of a world that was left out because the file of this model was not found.
    pub(super) missing: Option<Error>,
}

impl<'o> Includes<'o> {
    pub(super) fn new(packages: &'o [PathBuf]) -> Self {
        let (amount, known) = (Amount::default(), Known::new(KNOWN));
        Self { amount, known, packages, open: Vec::new(), count: 0, warnings: Vec::new(), missing: None }
    }

    /// Reads a file and all files that it includes. The root element of the file is at the given depth.
    pub(super) fn file(&mut self, path: &Path, depth: usize) -> Result<Element, Error> {
        let text = self.amount.read(path)?;
        let root = Element::parse(&text, &path.display().to_string(), &mut self.amount)?;
        self.open.push(path.canonicalize().unwrap_or_else(|_| path.to_owned()));
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let root = self.expand(root, Some(folder), depth)?;
        self.open.pop();
        Ok(root)
    }

    /// Reads a string and all files that it includes.
    pub(super) fn string(&mut self, text: &str) -> Result<Element, Error> {
        let root = Element::parse(text, "<string>", &mut self.amount)?;
        self.expand(root, None, 1)
    }

    fn expand(&mut self, mut root: Element, folder: Option<&Path>, depth: usize) -> Result<Element, Error> {
        convert(&mut root)?;
        self.known.check(&root, LEFT_OUT, &mut self.warnings);
        self.check_collisions(&root);
        tidy(&mut root, &mut self.warnings);
        self.children(&mut root, folder, depth)?;
        Ok(root)
    }

    /// Adds warnings about unknown names in the collisions of all links inside an element. These names have an effect
    /// only if inertias are computed from collisions.
    fn check_collisions(&mut self, element: &Element) {
        for child in &element.children {
            match &*child.tag {
                "world" | "model" => self.check_collisions(child),
                "link" => {
                    let is_auto = |inertial: &Element| attribute(child, inertial, "auto").unwrap_or_default();
                    let kind = if child.child("inertial").is_some_and(is_auto) { HEAVY } else { OPEN };
                    for collision in child.all("collision") {
                        self.known.check_as(kind, collision, LEFT_OUT, &mut self.warnings);
                    }
                }
                _ => {}
            }
        }
    }

    /// Replaces the includes inside an element at the given depth by the included models.
    fn children(&mut self, element: &mut Element, folder: Option<&Path>, depth: usize) -> Result<(), Error> {
        if depth > MAX_DEPTH {
            let what = format!("is at depth {depth}, files included: at most {MAX_DEPTH} are allowed");
            return Err(element.wrong(what));
        }
        for mut child in std::mem::take(&mut element.children) {
            match &*child.tag {
                "include" => match self.include(&mut child, folder, depth + 1) {
                    Ok(model) => element.children.extend(model),
                    // A world is usable without included models such as sun and ground.
                    Err(Fault::Missing(what)) if element.tag != "model" => {
                        self.warnings.push(child.left_out(format!("the included model is left out: {what}")));
                        self.missing = self.missing.take().or_else(|| Some(child.wrong(what)));
                    }
                    Err(Fault::Missing(what)) => return Err(child.wrong(what)),
                    Err(Fault::Other(error)) => return Err(error),
                },
                "world" | "model" => {
                    self.children(&mut child, folder, depth + 1)?;
                    element.children.push(child);
                }
                _ => element.children.push(child),
            }
        }
        Ok(())
    }

    /// Returns the model that an `<include>` names, with the changes that the `<include>` specifies. Returns `None` if
    /// the file contains only lights or actors.
    fn include(
        &mut self,
        include: &mut Element,
        folder: Option<&Path>,
        depth: usize,
    ) -> Result<Option<Element>, Fault> {
        let wrong = |what: String| Fault::Other(include.wrong(what));
        self.count += 1;
        if self.count > MAX_INCLUDES {
            return Err(wrong(format!("{} files are included, at most {MAX_INCLUDES} are allowed", self.count)));
        }
        let uri = text(include, "uri").ok_or_else(|| wrong(include.missing("uri")))?;
        let found = find_model(uri, &Search { folder, packages: self.packages });
        let found = found.map_err(|e| Fault::Missing(e.to_string()))?;
        let path = if found.is_dir() { self.model_of(&found)? } else { found };
        if !path.is_file() {
            return Err(Fault::Missing(format!("{uri}: there is no file {}", path.display())));
        }
        if self.open.contains(&path.canonicalize().unwrap_or_else(|_| path.clone())) {
            return Err(wrong(format!("{} includes itself", path.display())));
        }
        let mut root = self.file(&path, depth)?;
        if let Some(second) = root.all("model").nth(1) {
            return Err(wrong(format!("expected one model in {}, found a second: {}", path.display(), second.label())));
        }
        let Some(at) = root.children.iter().position(|c| c.tag == "model") else {
            return match root.children.iter().any(|c| matches!(&*c.tag, "light" | "actor")) {
                true => Ok(None),
                false => Err(wrong(format!("{} has no model", path.display()))),
            };
        };
        let mut model = root.children.swap_remove(at);
        let mut set = |name: &str, value: &str| {
            model.attributes.retain(|(found, _)| found != name);
            model.attributes.push((name.to_owned(), value.to_owned()));
        };
        if let Some(name) = text(include, "name") {
            set("name", name);
        }
        if let Some(frame) = text(include, "placement_frame") {
            if include.child("pose").is_none() {
                return Err(wrong("has a placement_frame and no pose".to_owned()));
            }
            set("placement_frame", frame);
        }
        if attribute(include, include, "merge")? {
            set(MERGED, "true");
        }
        flag(include, "static", false)?;
        for tag in ["pose", "static"] {
            if let Some(at) = include.children.iter().position(|c| c.tag == tag) {
                model.children.retain(|c| c.tag != tag);
                model.children.push(include.children.swap_remove(at));
            }
        }
        Ok(Some(model))
    }

    /// Returns the model file in a folder: the file with the newest known version.
    fn model_of(&mut self, folder: &Path) -> Result<PathBuf, Fault> {
        let Some(config) = CONFIGS.iter().map(|name| folder.join(name)).find(|path| path.is_file()) else {
            let plain = folder.join("model.sdf");
            let what = || format!("{} has no {}", folder.display(), CONFIGS[0]);
            return if plain.is_file() { Ok(plain) } else { Err(Fault::Missing(what())) };
        };
        let text = self.amount.read(&config)?;
        let root = Element::parse(&text, &config.display().to_string(), &mut self.amount)?;
        let minor = |sdf: &Element| {
            let version = sdf.attribute("version")?.trim().strip_prefix("1.")?.parse::<u32>().ok()?;
            (version <= super::convert::NEWEST).then_some(version)
        };
        // If two files have the same version, the first one is used.
        let best = root.all("sdf").reduce(|best, sdf| if minor(sdf) > minor(best) { sdf } else { best });
        let name = best.map(|sdf| sdf.text.trim()).filter(|name| !name.is_empty());
        let name = name.ok_or_else(|| root.wrong("names no <sdf> file"))?;
        Ok(folder.join(name))
    }
}

/// Reason why an `<include>` fails.
enum Fault {
    /// The file was not found.
    Missing(String),
    Other(Error),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Self::Other(error)
    }
}
