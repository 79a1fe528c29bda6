//! Files in files.

use crate::error::Error;
use crate::io::xml::{Amount, Element, MAX_DEPTH};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The text of a robot with what is in included files in place of the `<include>`s.
pub(super) struct Includes<'a> {
    /// The folder from which files are included; a string has none.
    folder: Option<&'a Path>,
    /// The files so far, without links.
    seen: HashSet<PathBuf>,
    amount: Amount,
}

impl<'a> Includes<'a> {
    /// The root element of a file.
    pub(super) fn read(path: &'a Path) -> Result<Element, Error> {
        let text = Amount::default().read(path)?;
        Self::read_text(path, &text)
    }

    /// The root element of a text that stands in the place of a file.
    pub(super) fn read_text(path: &'a Path, text: &str) -> Result<Element, Error> {
        let mut includes = Self { folder: Some(path.parent().unwrap_or(Path::new(""))), ..Self::of_string() };
        includes.is_new(path);
        includes.root(text, &path.display().to_string())
    }

    /// The root element of a string, which includes no files.
    pub(super) fn parse(text: &str) -> Result<Element, Error> {
        Self::of_string().root(text, "<string>")
    }

    fn of_string() -> Self {
        Self { folder: None, seen: HashSet::new(), amount: Amount::default() }
    }

    fn root(&mut self, text: &str, file: &str) -> Result<Element, Error> {
        let mut root = Element::parse(text, file, &mut self.amount)?;
        self.resolve(&mut root, 1)?;
        Ok(root)
    }

    /// Remembers a file, and whether it is a new one.
    fn is_new(&mut self, path: &Path) -> bool {
        self.seen.insert(path.canonicalize().unwrap_or(path.to_owned()))
    }

    /// Puts what is included somewhere in an element, which stands at a level, in its place.
    fn resolve(&mut self, element: &mut Element, level: usize) -> Result<(), Error> {
        if level > MAX_DEPTH {
            let what = format!("stands at level {level}, files included: at most {MAX_DEPTH} are allowed");
            return Err(element.wrong(what));
        }
        for mut child in std::mem::take(&mut element.children) {
            if child.tag != "include" {
                self.resolve(&mut child, level + 1)?;
                element.children.push(child);
                continue;
            }
            let file = child.attribute("file").ok_or_else(|| child.wrong("has no file"))?;
            let Some(folder) = self.folder else {
                return Err(child.wrong(format!("a string has no folder to find `{file}` in")));
            };
            let path = folder.join(file);
            if !self.is_new(&path) {
                return Err(child.wrong(format!("`{file}` is already part of the model")));
            }
            let text = self.amount.read(&path).map_err(|e| child.wrong(e.to_string()))?;
            let mut included = Element::parse(&text, &path.display().to_string(), &mut self.amount)?;
            self.resolve(&mut included, level)?; // its children come to stand where it was included
            element.children.append(&mut included.children);
        }
        Ok(())
    }
}
