//! Tendons, equality constraints and actuators, which are copied together with the part of the tree to which they
//! refer.

use crate::io::xml::Element;
use std::collections::{HashMap, HashSet};

/// Tags of the sections, in an order in which elements refer only to the same section, to earlier sections, or to the
/// tree.
const SECTIONS: [&str; 3] = ["tendon", "equality", "actuator"];

/// Kind and name of an element.
pub(super) type Name = (&'static str, String);

/// Elements of the three `SECTIONS` of a file.
pub(super) struct Sections {
    /// Elements of each section, or `None` for an element that was replaced by copies.
    elements: [Vec<Option<Element>>; 3],
    /// Indices of the elements of each section, by the first name to which the element refers.
    by_reference: [HashMap<Name, Vec<usize>>; 3],
}

impl Sections {
    /// Takes the elements of the sections out of a file.
    pub(super) fn take(root: &mut Element) -> Self {
        let mut sections = Self { elements: Default::default(), by_reference: Default::default() };
        for child in &mut root.children {
            if let Some(k) = SECTIONS.iter().position(|tag| child.tag == *tag) {
                for element in std::mem::take(&mut child.children) {
                    sections.push(k, element);
                }
            }
        }
        sections
    }

    /// Puts the elements back into the file: each kind of element into one section at the end.
    pub(super) fn put_back(self, root: &mut Element) {
        root.children.retain(|child| !SECTIONS.contains(&&*child.tag));
        for (tag, elements) in SECTIONS.into_iter().zip(self.elements) {
            let children = elements.into_iter().flatten().collect();
            let (file, line, source) = (root.file.clone(), root.line, root.source);
            let (attributes, text) = (Vec::new(), String::new());
            let (tag, at, stray) = (tag.to_owned(), 0, None);
            root.children.push(Element { tag, attributes, text, children, file, line, at, source, stray });
        }
    }

    /// Adds an element to a section.
    pub(super) fn push(&mut self, section: usize, element: Element) {
        if let Some(first) = references(&element).into_iter().next() {
            self.by_reference[section].entry(first).or_default().push(self.elements[section].len());
        }
        self.elements[section].push(Some(element));
    }

    /// Returns the (section, index) of each element that refers to `names` and to nothing else. The names of tendons
    /// that are found are added to `names`.
    pub(super) fn of(&self, mut names: Vec<Name>) -> Vec<(usize, usize)> {
        let mut known: HashSet<Name> = names.iter().cloned().collect();
        let mut found = Vec::new();
        for section in 0..SECTIONS.len() {
            let by_reference = &self.by_reference[section];
            let mut own: Vec<usize> =
                names.iter().filter_map(|name| by_reference.get(name)).flatten().copied().collect();
            own.sort_unstable();
            for index in own {
                let Some(element) = &self.elements[section][index] else { continue };
                if references(element).iter().all(|name| known.contains(name)) {
                    found.push((section, index));
                    if let Some(name) = element.attribute("name").filter(|_| section == 0) {
                        let name = ("tendon", name.to_owned());
                        known.insert(name.clone());
                        names.push(name);
                    }
                }
            }
        }
        found
    }

    /// Returns an element of a section.
    pub(super) fn get(&self, (section, index): (usize, usize)) -> Option<&Element> {
        self.elements[section][index].as_ref()
    }

    /// Removes an element that was replaced by copies.
    pub(super) fn remove(&mut self, (section, index): (usize, usize)) {
        self.elements[section][index] = None;
    }
}

/// Returns the kind of element to which an attribute refers; `None` if it refers to neither an element of the tree nor
/// a tendon.
pub(super) fn kind_of(attribute: &str) -> Option<&'static str> {
    match attribute {
        "joint" | "jointinparent" | "joint1" | "joint2" => Some("joint"),
        "site" | "refsite" | "slidersite" | "cranksite" | "site1" | "site2" | "sidesite" => Some("site"),
        "body" | "body1" | "body2" => Some("body"),
        "tendon" | "tendon1" | "tendon2" => Some("tendon"),
        "geom" => Some("geom"),
        _ => None,
    }
}

/// Returns the names to which an element refers, except the world.
fn references(element: &Element) -> Vec<Name> {
    let all = std::iter::once(element).chain(&element.children).flat_map(|e| &e.attributes);
    let named = all.filter_map(|(attribute, value)| Some((kind_of(attribute)?, value.clone())));
    named.filter(|name| name.1 != "world").collect()
}
