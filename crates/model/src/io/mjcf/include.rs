//! Files that are used by other files: included files, and attached files with their own settings.

use super::expand;
use super::keywords;
use super::sections::Sections;
use crate::error::Error;
use crate::io::known::{Known, LeftOut};
use crate::io::xml::{Amount, Element, MAX_DEPTH};
use crate::warning::Warning;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Known attributes and elements that a model cannot represent, and the consequence of each omission.
const LEFT_OUT: &LeftOut = &[];

/// File with its own settings, in which all `<include>`, `<replicate>` and `<attach>` elements have been replaced.
pub(super) struct File {
    pub(super) root: Element,
    /// Folder of the file; `None` for a string.
    pub(super) folder: Option<PathBuf>,
    /// Elements of the sections of the file; `None` until the file is attached.
    pub(super) sections: Option<Sections>,
}

/// Files of a robot.
pub(super) struct Files {
    known: Known,
    /// Files, the main file first. A file that is still being read is `None`.
    pub(super) files: Vec<Option<File>>,
    /// Files that are being read, outermost first.
    open: Vec<PathBuf>,
    pub(super) amount: Amount,
    /// Number of `<attach>` elements that have been read.
    pub(super) attachments: usize,
    pub(super) warnings: Vec<Warning>,
}

impl Files {
    pub(super) fn new(known: Known) -> Self {
        let amount = Amount::default();
        Self { known, files: Vec::new(), open: Vec::new(), amount, attachments: 0, warnings: Vec::new() }
    }

    /// Reads a file that has its own settings, and returns the index of the file.
    pub(super) fn read(&mut self, path: &Path) -> Result<usize, Error> {
        let text = self.amount.read(path)?;
        self.read_text(path, &text)
    }

    /// Reads a text instead of the file at `path`, in the same way as [`read`](Self::read).
    pub(super) fn read_text(&mut self, path: &Path, text: &str) -> Result<usize, Error> {
        let own = path.canonicalize().unwrap_or(path.to_owned());
        if self.open.contains(&own) {
            let what = "is attached inside of itself".to_owned();
            return Err(Error::File { file: path.display().to_string(), what });
        }
        self.open.push(own);
        let index = self.parse(text, &path.display().to_string(), Some(path.parent().unwrap_or(Path::new(""))))?;
        self.open.pop();
        Ok(index)
    }

    /// Reads a text in the same way as [`read`](Self::read) reads a file. If `folder` is `None`, the text cannot refer
    /// to files.
    pub(super) fn parse(&mut self, text: &str, file: &str, folder: Option<&Path>) -> Result<usize, Error> {
        let root = Element::parse(text, file, &mut self.amount)?;
        self.add(root, folder)
    }

    /// Reads a text without a folder, as [`parse`](Self::parse) does, and removes the line numbers of its elements.
    pub(super) fn parse_without_lines(&mut self, text: &str, file: &str) -> Result<usize, Error> {
        let mut root = Element::parse(text, file, &mut self.amount)?;
        root.forget_lines();
        self.add(root, None)
    }

    /// Adds a file with its own settings, given its root element, and returns the index of the file.
    fn add(&mut self, mut root: Element, folder: Option<&Path>) -> Result<usize, Error> {
        let seen = self.open.last().cloned().into_iter().collect();
        Includes { top: folder, seen, amount: &mut self.amount, warnings: &mut self.warnings }
            .resolve(&mut root, folder, 1)?;
        if root.tag == "robot" {
            return Err(root.wrong(match self.files.is_empty() {
                true => "is a URDF: `from_urdf` reads it",
                false => "is a URDF, which cannot be attached here (MuJoCo can): save it as an MJCF first",
            }));
        }
        if root.tag != "mujoco" {
            return Err(root.wrong("the root element of an MJCF is <mujoco>"));
        }
        self.known.check(&root, LEFT_OUT, &mut self.warnings);
        keywords::check(&root)?;
        let index = self.files.len();
        belongs_to(&mut root, index);
        self.files.push(None);
        let folder = folder.map(Path::to_owned);
        expand::expand(self, &mut root, folder.as_deref())?;
        self.files[index] = Some(File { root, folder, sections: None });
        Ok(index)
    }
}

/// Attributes whose values may be empty.
const EMPTY: [&str; 8] = ["class", "childclass", "prefix", "sep", "file", "assetdir", "meshdir", "texturedir"];

/// Marks an element and its content as part of the file with index `source`. Removes numbers and names with an empty
/// value, because in MuJoCo they do not override a default.
fn belongs_to(element: &mut Element, source: usize) {
    element.source = source;
    element.attributes.retain(|(name, value)| !value.trim().is_empty() || EMPTY.contains(&&**name));
    for child in &mut element.children {
        belongs_to(child, source);
    }
}

/// Replacement of `<include>` elements by the content of the included files.
struct Includes<'a> {
    /// Folder of the main file.
    top: Option<&'a Path>,
    /// Paths of all files that have been read, with links resolved.
    seen: HashSet<PathBuf>,
    amount: &'a mut Amount,
    /// Warnings about elements outside of the root elements.
    warnings: &'a mut Vec<Warning>,
}

impl Includes<'_> {
    /// Replaces all `<include>` elements inside an element at the given depth. The file of the element is in `folder`.
    fn resolve(&mut self, element: &mut Element, folder: Option<&Path>, depth: usize) -> Result<(), Error> {
        if depth > MAX_DEPTH {
            let what = format!("is at depth {depth}, files included: at most {MAX_DEPTH} are allowed");
            return Err(element.wrong(what));
        }
        for mut child in std::mem::take(&mut element.children) {
            if child.tag != "include" {
                self.resolve(&mut child, folder, depth + 1)?;
                element.children.push(child);
                continue;
            }
            let file = child.attribute("file").ok_or_else(|| child.lacks("file"))?;
            let (Some(top), Some(folder)) = (self.top, folder) else {
                return Err(child.wrong(format!("a string has no folder to find `{file}` in")));
            };
            // The file is searched in the same folders as in MuJoCo: in the main file's folder, then in the folder of
            // the including file.
            let path = Some(top.join(file)).filter(|path| path.exists()).unwrap_or_else(|| folder.join(file));
            if !self.seen.insert(path.canonicalize().unwrap_or(path.clone())) {
                return Err(child.wrong(format!("`{file}` is already part of the model")));
            }
            let text = self.amount.read(&path).map_err(|e| child.wrong(e.to_string()))?;
            let mut included = Element::parse(&text, &path.display().to_string(), self.amount)?;
            self.warnings.extend(included.outside());
            // The children of the included file replace the `<include>` element.
            self.resolve(&mut included, Some(path.parent().unwrap_or(Path::new(""))), depth)?;
            element.children.append(&mut included.children);
        }
        Ok(())
    }
}
