//! Expansion of `<replicate>` and `<attach>`: each element is replaced by copies of a part of the tree, with new names.
//! Elements of other sections are copied, too, if they refer only to the copied part. MuJoCo does the same.

use super::attributes::Attributes;
use super::compiler::Compiler;
use super::include::Files;
use super::sections::{Name, Sections, kind_of};
use crate::error::Error;
use crate::io::xml::{Element, MAX_DEPTH, words};
use condyle_spatial::Vec3;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Maximum number of `<attach>` elements of a robot. The number is limited because each element needs a search of the
/// attached file.
const MAX_ATTACHMENTS: usize = 256;

/// Replaces each `<replicate>` and `<attach>` of a file by copies. `folder` is the folder of the file.
pub(super) fn expand(files: &mut Files, root: &mut Element, folder: Option<&Path>) -> Result<(), Error> {
    let mut attached = HashSet::new();
    if !looks_for(root, &mut attached) {
        return Ok(());
    }
    let compiler = Compiler::read(root)?;
    let models = if attached.contains(&None) { models(files, root, folder)? } else { Vec::new() };
    let sections = Sections::take(root);
    let wanted = attached.into_iter().flatten().collect();
    let mut expansion = Expansion { files, compiler, models, sections, wanted, found: HashMap::new() };
    for world in root.children.iter_mut().filter(|c| c.tag == "worldbody") {
        expansion.inside(world, None, 2)?;
    }
    expansion.sections.put_back(root);
    Ok(())
}

/// Returns whether an element contains `<replicate>` or `<attach>`. For each `<attach>`, adds the name of the attached
/// part to `attached`, or `None` if the part is in another file.
fn looks_for(element: &Element, attached: &mut HashSet<Option<Name>>) -> bool {
    let mut any = element.tag == "replicate";
    if element.tag == "attach" {
        any = true;
        let own = element.attribute("model").is_none();
        attached.insert(part(element).filter(|_| own).map(|(kind, name)| (kind, name.to_owned())));
    }
    element.children.iter().fold(any, |any, child| looks_for(child, attached) || any)
}

/// Returns the kind and name of the part that an `<attach>` names; `None` if the `<attach>` copies everything in the
/// world of the attached file.
fn part(attach: &Element) -> Option<(&'static str, &str)> {
    ["body", "frame"].into_iter().find_map(|kind| Some((kind, attach.attribute(kind)?)))
}

/// Reads the files that may be attached. Returns their names and indices.
fn models(files: &mut Files, root: &Element, folder: Option<&Path>) -> Result<Vec<(String, usize)>, Error> {
    let mut models = Vec::new();
    for asset in root.all("asset").flat_map(|section| section.all("model")) {
        let file = asset.attribute("file").ok_or_else(|| asset.lacks("file"))?;
        let Some(folder) = folder else {
            return Err(asset.wrong(format!("a string has no folder to find `{file}` in")));
        };
        let index = files.read(&folder.join(file)).map_err(|e| match e {
            Error::File { .. } => asset.wrong(e.to_string()),
            _ => e,
        })?;
        let own = files.files[index].as_ref().and_then(|f| f.root.attribute("model"));
        let name = asset.attribute("name").or(own).unwrap_or("MuJoCo Model").to_owned();
        models.push((name, index));
    }
    Ok(models)
}

struct Expansion<'f> {
    files: &'f mut Files,
    compiler: Compiler,
    models: Vec<(String, usize)>,
    sections: Sections,
    /// Names of the bodies and frames of this file that `<attach>` elements in the same file copy.
    wanted: HashSet<Name>,
    /// Elements whose names are in `wanted`, each with the default class of its parent element.
    found: HashMap<Name, (Element, Option<String>)>,
}

impl Expansion<'_> {
    /// Expands the content of an element at the given depth. `class` is the default class of its parent element.
    fn inside(&mut self, element: &mut Element, class: Option<&str>, depth: usize) -> Result<(), Error> {
        let own = element.attribute("childclass").map(str::to_owned);
        let class = own.as_deref().or(class);
        for mut child in std::mem::take(&mut element.children) {
            match &*child.tag {
                "replicate" => {
                    self.inside(&mut child, class, depth + 1)?;
                    self.replicate(&child, &mut element.children, class, depth)?;
                }
                "attach" => self.attach(&child, &mut element.children, class, depth)?,
                "body" | "frame" => {
                    self.inside(&mut child, class, depth + 1)?;
                    self.remember(&child, class)?;
                    element.children.push(child);
                }
                _ => element.children.push(child),
            }
        }
        Ok(())
    }

    /// Stores a copy of an element if an `<attach>` of the same file copies it. Also stores the default class of its
    /// parent element.
    fn remember(&mut self, element: &Element, class: Option<&str>) -> Result<(), Error> {
        let kind = if element.tag == "body" { "body" } else { "frame" };
        let name = element.attribute("name").map(|name| (kind, name.to_owned()));
        if let Some(name) = name.filter(|name| self.wanted.contains(name)) {
            self.files.amount.add_copies(element, 1)?;
            self.found.entry(name).or_insert((element.clone(), class.map(str::to_owned)));
        }
        Ok(())
    }

    /// Applies [`remember`](Self::remember) to a copy and to all bodies and frames inside it.
    fn remember_inside(&mut self, copy: &Element, class: Option<&str>) -> Result<(), Error> {
        if self.wanted.is_empty() || !matches!(&*copy.tag, "body" | "frame") {
            return Ok(());
        }
        self.remember(copy, class)?;
        let class = copy.attribute("childclass").or(class);
        copy.children.iter().try_for_each(|child| self.remember_inside(child, class))
    }

    /// Adds the copies of a `<replicate>`, each inside a frame.
    fn replicate(
        &mut self,
        element: &Element,
        to: &mut Vec<Element>,
        class: Option<&str>,
        depth: usize,
    ) -> Result<(), Error> {
        if let Some(child) = element.children.iter().find(|c| matches!(&*c.tag, "joint" | "freejoint" | "inertial")) {
            return Err(child.wrong("cannot be in a <replicate>"));
        }
        let a = Attributes::plain(element);
        let count = a.number("count")?.ok_or_else(|| element.lacks("count"))?;
        if count.fract() != 0.0 {
            return Err(element.wrong(format!("count: {count} is no whole number")));
        }
        let count = count.max(0.0) as usize;
        self.files.amount.add_copies(element, count)?;
        let (offset, euler) = (a.vector("offset")?.unwrap_or(Vec3::zero()), a.array("euler")?.unwrap_or([0.0; 3]));
        let (separator, digits) = (a.get("sep").unwrap_or(""), count.to_string().len());
        let own = element.attribute("childclass").or(class);
        let referring = self.sections.of(names(&element.children));
        let mut position = Vec3::zero();
        for i in 0..count {
            let R = self.compiler.euler(euler.map(|angle| i as f64 * angle));
            let rename = |name: &str| format!("{name}{separator}{i:0digits$}");
            let mut frame = wrapper(element, own);
            frame.attributes.push(("pos".to_owned(), words(&position.to_array())));
            frame.attributes.push(("xyaxes".to_owned(), words(&[R.x.to_array(), R.y.to_array()].concat())));
            for child in &element.children {
                let copy = copied(child, &rename, depth + 1)?;
                self.remember_inside(&copy, own)?;
                frame.children.push(copy);
            }
            to.push(frame);
            self.copy_referring(&referring, &rename)?;
            position = R * offset + position; // p_i+1 = p_i + R_i offset
        }
        referring.into_iter().for_each(|at| self.sections.remove(at));
        Ok(())
    }

    /// Copies elements of the sections. `referring` lists the elements that refer to a copied part of the tree.
    fn copy_referring(&mut self, referring: &[(usize, usize)], rename: &dyn Fn(&str) -> String) -> Result<(), Error> {
        for &at in referring {
            if let Some(copy) = self.sections.get(at).map(|e| copied(e, rename, 3)).transpose()? {
                self.files.amount.add_copies(&copy, 1)?;
                self.sections.push(at.0, copy);
            }
        }
        Ok(())
    }

    /// Adds a copy of the part that an `<attach>` names. The part is in this file or in another file.
    fn attach(
        &mut self,
        element: &Element,
        to: &mut Vec<Element>,
        class: Option<&str>,
        depth: usize,
    ) -> Result<(), Error> {
        self.files.attachments += 1;
        if self.files.attachments > MAX_ATTACHMENTS {
            return Err(element.wrong(format!("there are more than {MAX_ATTACHMENTS} <attach> elements")));
        }
        let prefix = element.attribute("prefix").ok_or_else(|| element.lacks("prefix"))?;
        if element.attribute("body").is_some() && element.attribute("frame").is_some() {
            return Err(element.wrong("has both body and frame"));
        }
        let rename = |name: &str| format!("{prefix}{name}");
        let Some(model) = element.attribute("model") else {
            let (kind, name) = part(element).ok_or_else(|| element.wrong("has neither model, body nor frame"))?;
            let found = self.found.get(&(kind, name.to_owned())).cloned();
            let none = || element.wrong(format!("{kind}: no {kind} before this element is named `{name}`"));
            let (found, around) = found.ok_or_else(none)?;
            self.files.amount.add_copies(&found, 1)?;
            let copy = with_class(copied(&found, &rename, depth)?, around.as_deref());
            self.remember_inside(&copy, class)?;
            to.push(copy);
            let referring = self.sections.of(names(std::slice::from_ref(&found)));
            return self.copy_referring(&referring, &rename);
        };
        let index = self.models.iter().find(|(name, _)| name == model).map(|(_, index)| *index);
        let index = index.ok_or_else(|| element.wrong(format!("model: no <model> of <asset> is named `{model}`")))?;
        let Some(mut file) = self.files.files[index].take() else { return Ok(()) };
        let sections = file.sections.get_or_insert_with(|| Sections::take(&mut file.root));
        let mut copy = wrapper(element, None);
        copy.source = index;
        let found = match part(element) {
            None => file.root.all("worldbody").flat_map(|world| &world.children).map(|e| (e, None)).collect(),
            Some((kind, name)) => {
                let worlds = file.root.all("worldbody");
                let found = worlds.into_iter().find_map(|world| find(world, kind, name, None));
                let none = || element.wrong(format!("{kind}: no {kind} of the model `{model}` is named `{name}`"));
                vec![found.ok_or_else(none)?]
            }
        };
        for &(part, around) in &found {
            self.files.amount.add_copies(part, 1)?;
            copy.children.push(with_class(copied(part, &rename, depth + 1)?, around));
        }
        to.push(copy);
        let all = found.iter().flat_map(|(part, _)| names(std::slice::from_ref(*part))).collect();
        for at in sections.of(all) {
            if let Some(copy) = sections.get(at).map(|e| copied(e, &rename, 3)).transpose()? {
                self.files.amount.add_copies(&copy, 1)?;
                self.sections.push(at.0, copy);
            }
        }
        let has = |section: &str, names: &[&str]| {
            let all = file.root.all(section).flat_map(|e| std::iter::once(e).chain(&e.children));
            all.into_iter().any(|e| names.contains(&&*e.tag) || names.iter().any(|name| e.attribute(name).is_some()))
        };
        for (what, found) in [
            ("keyframes", has("keyframe", &["key"])),
            ("gravity, medium and flags", has("option", &["gravity", "density", "viscosity", "flag"])),
        ] {
            if found {
                self.files.warnings.push(element.left_out(format!("the {what} of the model `{model}` are left out")));
            }
        }
        self.files.files[index] = Some(file);
        Ok(())
    }
}

/// Returns an empty frame that replaces an `<attach>` or `<replicate>`.
fn wrapper(element: &Element, class: Option<&str>) -> Element {
    let (file, line, source) = (element.file.clone(), element.line, element.source);
    let attributes = class.map(|class| ("childclass".to_owned(), class.to_owned())).into_iter().collect();
    Element {
        tag: "frame".to_owned(),
        attributes,
        text: String::new(),
        children: Vec::new(),
        file,
        line,
        at: element.at,
        source,
        stray: None,
    }
}

/// Returns a body or frame with the class `class`, unless it specifies another class.
fn with_class(mut element: Element, class: Option<&str>) -> Element {
    if let Some(class) = class.filter(|_| element.attribute("childclass").is_none()) {
        element.attributes.push(("childclass".to_owned(), class.to_owned()));
    }
    element
}

/// Finds a body or frame inside an element, and returns it with the default class of its parent element.
fn find<'e>(
    element: &'e Element,
    kind: &str,
    name: &str,
    class: Option<&'e str>,
) -> Option<(&'e Element, Option<&'e str>)> {
    let class = element.attribute("childclass").or(class);
    element.children.iter().filter(|c| matches!(&*c.tag, "body" | "frame")).find_map(|child| {
        let is_it = child.tag == kind && child.attribute("name") == Some(name);
        if is_it { Some((child, class)) } else { find(child, kind, name, class) }
    })
}

/// Returns all names of elements in a part of the tree.
fn names(elements: &[Element]) -> Vec<Name> {
    let (mut names, mut waiting) = (Vec::new(), elements.iter().collect::<Vec<_>>());
    while let Some(e) = waiting.pop() {
        let kind = if e.tag == "freejoint" { Some("joint") } else { kind_of(&e.tag) };
        if let (Some(kind), Some(name)) = (kind, e.attribute("name").filter(|n| !n.is_empty())) {
            names.push((kind, name.to_owned()));
        }
        waiting.extend(&e.children);
    }
    names
}

/// Returns a copy of an element for the given depth. `rename` changes the names in the copy and the references to
/// names.
fn copied(element: &Element, rename: &dyn Fn(&str) -> String, depth: usize) -> Result<Element, Error> {
    if depth > MAX_DEPTH {
        let what = format!("is at depth {depth}, copies counted: at most {MAX_DEPTH} are allowed");
        return Err(element.wrong(what));
    }
    let children = element.children.iter().map(|child| copied(child, rename, depth + 1)).collect::<Result<_, _>>()?;
    let renamed = |(name, value): &(String, String)| {
        let refers = kind_of(name).is_some() && value != "world";
        let is_name = (name == "name" || refers) && !value.is_empty();
        (name.clone(), if is_name { rename(value) } else { value.clone() })
    };
    let attributes = element.attributes.iter().map(renamed).collect();
    let (tag, text, file) = (element.tag.clone(), element.text.clone(), element.file.clone());
    let (line, at, source) = (element.line, element.at, element.source);
    Ok(Element { tag, attributes, text, children, file, line, at, source, stray: None })
}
