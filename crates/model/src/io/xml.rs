//! XML as the readers want it: elements that know their file and line.

use crate::error::Error;
use roxmltree::{Document, Node};
use std::path::Path;
use std::rc::Rc;

/// How deep elements may be nested: one level for each body of a chain in MJCF, and then some.
const MAX_DEPTH: usize = 256;

/// An element, with all that is in it.
#[derive(Debug)]
pub(crate) struct Element {
    pub(crate) tag: String,
    pub(crate) attributes: Vec<(String, String)>,
    pub(crate) text: String,
    pub(crate) children: Vec<Element>,
    /// Path, or `<string>`.
    pub(crate) file: Rc<str>,
    /// Counted from 1.
    pub(crate) line: u32,
}

/// The text of a file.
pub(crate) fn read(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|e| Error::File { file: path.display().to_string(), what: e.to_string() })
}

impl Element {
    /// The root element of a text.
    pub(crate) fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let document = Document::parse(text).map_err(|e| Error::Xml {
            file: file.to_owned(),
            line: e.pos().row,
            what: e.to_string(),
        })?;
        let ends: Vec<usize> = text.match_indices('\n').map(|(i, _)| i).collect();
        Self::own(document.root_element(), &ends, &file.into(), 0)
    }

    /// An element without its document; `ends` are the places at which lines end.
    fn own(node: Node, ends: &[usize], file: &Rc<str>, depth: usize) -> Result<Self, Error> {
        let line = 1 + ends.partition_point(|&end| end < node.range().start) as u32;
        let plain = node.attributes().filter(|a| a.namespace().is_none());
        let mut element = Self {
            tag: node.tag_name().name().to_owned(),
            attributes: plain.map(|a| (a.name().to_owned(), a.value().to_owned())).collect(),
            text: node.children().filter(Node::is_text).filter_map(|n| n.text()).collect(),
            children: Vec::new(),
            file: file.clone(),
            line,
        };
        if depth == MAX_DEPTH {
            return Err(element.wrong(format!("is nested more than {MAX_DEPTH} levels deep")));
        }
        let ours = |n: &Node| n.is_element() && n.tag_name().namespace() == node.tag_name().namespace();
        for child in node.children().filter(ours) {
            element.children.push(Self::own(child, ends, file, depth + 1)?);
        }
        Ok(element)
    }

    pub(crate) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str())
    }

    pub(crate) fn child(&self, tag: &str) -> Option<&Self> {
        self.children.iter().find(|c| c.tag == tag)
    }

    pub(crate) fn all<'a>(&'a self, tag: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |c| c.tag == tag)
    }

    /// For example ``joint `elbow` ``.
    pub(crate) fn label(&self) -> String {
        match self.attribute("name") {
            Some(name) => format!("{} `{name}`", self.tag),
            None => format!("<{}>", self.tag),
        }
    }

    /// An error that names this element.
    pub(crate) fn wrong(&self, what: impl Into<String>) -> Error {
        Error::Element { file: self.file.to_string(), line: self.line, element: self.label(), what: what.into() }
    }
}

/// Finite numbers with spaces between them.
pub(crate) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| word.parse().ok().filter(|x: &f64| x.is_finite());
    text.split_whitespace().map(|w| number(w).ok_or_else(|| format!("`{w}` is no finite number"))).collect()
}

/// As many finite numbers as there must be.
pub(crate) fn array<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let x = numbers(text)?;
    <[f64; N]>::try_from(x).map_err(|x| {
        let s = if N == 1 { "" } else { "s" };
        format!("expected {N} number{s}, found {}", x.len())
    })
}
