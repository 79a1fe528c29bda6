//! Files in files.

use crate::error::Error;
use crate::io::xml::{self, Element};
use std::path::{Path, PathBuf};

/// How deep bodies may be nested once the included files are in their places.
const MAX_DEPTH: usize = 256;

/// Puts what is in included files in place of the `<include>`s.
pub(super) fn resolve(
    element: &mut Element,
    folder: Option<&Path>,
    seen: &mut Vec<PathBuf>,
    depth: usize,
) -> Result<(), Error> {
    if depth == MAX_DEPTH {
        return Err(element.wrong(format!("is nested more than {MAX_DEPTH} levels deep")));
    }
    for mut child in std::mem::take(&mut element.children) {
        if child.tag != "include" {
            resolve(&mut child, folder, seen, depth + 1)?;
            element.children.push(child);
            continue;
        }
        let file = child.attribute("file").ok_or_else(|| child.wrong("has no file"))?;
        let folder = folder.ok_or_else(|| child.wrong(format!("a string has no folder to find `{file}` in")))?;
        let path = folder.join(file);
        if seen.contains(&path) {
            return Err(child.wrong(format!("`{file}` is already part of the model")));
        }
        seen.push(path.clone());
        let text = xml::read(&path).map_err(|e| child.wrong(e.to_string()))?;
        let mut included = Element::parse(&text, &path.display().to_string())?;
        resolve(&mut included, Some(folder), seen, depth + 1)?;
        element.children.append(&mut included.children);
    }
    Ok(())
}
