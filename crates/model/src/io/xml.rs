//! XML elements for the readers. Each element knows its file and its line number.
//!
//! The size of a text is checked before it is parsed. So a text cannot exhaust memory, time or the stack.

mod encoding;
mod parse;
mod write;

use crate::error::Error;
use crate::model::Model;
use crate::names::{near, nearest};
use crate::warning::{Place, Warning, WarningKind};
use parse::count;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::rc::Rc;

/// Maximum number of bytes of all files of one robot together.
const MAX_BYTES: usize = 64 << 20;
/// Maximum number of tags in all files together. Comments and end tags count, too.
const MAX_TAGS: usize = 1 << 20;
/// Maximum number of equals signs in all files together. It limits the number of attributes and their memory.
const MAX_EQUALS: usize = 1 << 22;
/// Maximum number of attributes of an element.
const MAX_ATTRIBUTES: usize = 256;
/// Maximum depth of nested elements. The limit is high enough for an MJCF of a chain, in which every body is nested in
/// its parent.
pub(crate) const MAX_DEPTH: usize = 256;

/// XML element with its content. A prefix is part of a name (`gz:note`). Declarations of prefixes are dropped.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub(crate) tag: String,
    pub(crate) attributes: Vec<(String, String)>,
    pub(crate) text: String,
    pub(crate) children: Vec<Element>,
    /// Path of the file, or `<string>`.
    pub(crate) file: Rc<str>,
    /// Line number, counted from 1; 0 if the user does not know the text.
    pub(crate) line: u32,
    /// Byte index of the element's `<` in the text of the file.
    pub(crate) at: usize,
    /// Index of the element's file among the files with their own settings. Index 0 is the main file.
    pub(crate) source: usize,
    /// Line number and description of the first item outside of a root element. Such items have no effect.
    pub(crate) stray: Option<Box<(u32, String)>>,
}

/// Amount of text that has been read for one robot.
#[derive(Default)]
pub(crate) struct Amount {
    bytes: usize,
    tags: usize,
    equals: usize,
}

impl Amount {
    /// Reads the text of a file. Returns an error if the file is not a regular file or is too large.
    pub(crate) fn read(&self, path: &Path) -> Result<String, Error> {
        let wrong = |what: String| Error::File { file: path.display().to_string(), what };
        if let Some(text) = path.to_str().map(str::trim_start).filter(|text| text.starts_with('<')) {
            let file = format!("`{}…`", text.chars().take_while(|c| *c != '\n').take(32).collect::<String>());
            let what =
                "is the text of a file, where its path is expected: the function whose name ends in `_str` reads it";
            return Err(Error::File { file, what: what.to_owned() });
        }
        let said = |e: std::io::Error| wrong(e.to_string());
        // Checks the type of the file before opening it, because opening a pipe waits for a writer.
        let kind = std::fs::metadata(path).map_err(said)?;
        if !kind.is_file() {
            let found = if kind.is_dir() { "a folder" } else { "a device, pipe or socket" };
            return Err(wrong(format!("expected a file, found {found}")));
        }
        let mut bytes = Vec::new();
        let left = MAX_BYTES.saturating_sub(self.bytes);
        if kind.len() <= left as u64 {
            let file = File::open(path).map_err(said)?;
            file.take(left as u64 + 1).read_to_end(&mut bytes).map_err(said)?;
        }
        let found = kind.len().max(bytes.len() as u64);
        if found > left as u64 {
            return Err(wrong(too_many(self.bytes as u64 + found, "bytes", MAX_BYTES)));
        }
        Ok(encoding::decode(bytes))
    }

    /// Adds copies of an element to the amount of text that has been read. A file that requests copies is treated as if
    /// it contained them.
    pub(crate) fn add_copies(&mut self, element: &Element, count: usize) -> Result<(), Error> {
        let (mut tags, mut equals, mut waiting) = (0usize, 0usize, vec![element]);
        while let Some(e) = waiting.pop() {
            (tags, equals) = (tags + 1, equals + e.attributes.len());
            waiting.extend(&e.children);
        }
        self.tags = self.tags.saturating_add(tags.saturating_mul(count));
        self.equals = self.equals.saturating_add(equals.saturating_mul(count));
        for (found, what, limit) in [(self.tags, "tags", MAX_TAGS), (self.equals, "equals signs", MAX_EQUALS)] {
            if found > limit {
                return Err(element.wrong(format!("{}, copies counted", too_many(found as u64, what, limit))));
            }
        }
        Ok(())
    }

    /// Adds the bytes, tags and equals signs of a text to the amount that has been read. The error names the limit that
    /// is exceeded.
    fn add(&mut self, text: &str) -> Result<(), String> {
        let (bytes, count) = (text.as_bytes(), |byte| count(text.as_bytes(), byte));
        (self.bytes, self.tags, self.equals) =
            (self.bytes + bytes.len(), self.tags + count(b'<'), self.equals + count(b'='));
        for (found, what, limit) in
            [(self.bytes, "bytes", MAX_BYTES), (self.tags, "tags", MAX_TAGS), (self.equals, "equals signs", MAX_EQUALS)]
        {
            if found > limit {
                return Err(too_many(found as u64, what, limit));
            }
        }
        Ok(())
    }
}

fn too_many(found: u64, what: &str, limit: usize) -> String {
    format!("{found} {what}, at most {limit} are allowed in the files of a robot")
}

impl Model {
    /// Reads the text of a robot's file, in any encoding that the readers support.
    ///
    /// # Errors
    /// Returns [`Error::File`].
    #[doc(hidden)]
    pub fn file_text(path: &Path) -> Result<String, Error> {
        Amount::default().read(path)
    }
}

impl Element {
    /// Parses the root element of a text.
    pub(crate) fn parse(text: &str, file: &str, amount: &mut Amount) -> Result<Self, Error> {
        amount.add(text).map_err(|what| Error::File { file: file.to_owned(), what })?;
        if is_path(text) {
            let what = "this is a path: the function whose name does not end in `_str` reads the file".to_owned();
            return Err(Error::Xml { file: file.to_owned(), line: 1, what });
        }
        parse::parse(text, file)
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

    /// Returns the name of the element for messages, for example ``joint `elbow` ``.
    pub(crate) fn label(&self) -> String {
        match self.attribute("name").filter(|n| !n.is_empty()) {
            Some(name) => format!("{} `{name}`", self.tag),
            None => format!("<{}>", self.tag),
        }
    }

    /// Returns the message that an attribute or child of the element is missing. The message suggests the most similar
    /// name among the element's attributes and children.
    pub(crate) fn missing(&self, name: &str) -> String {
        let attributes = self.attributes.iter().map(|(name, _)| &**name);
        let names = attributes.chain(self.children.iter().map(|child| &*child.tag));
        // Excludes `name` itself, which may exist with an empty value.
        let near = near(&nearest(name, names.filter(|found| *found != name)));
        format!("has no {name}{near}")
    }

    /// Returns an error that an attribute or child of this element is missing.
    pub(crate) fn lacks(&self, name: &str) -> Error {
        self.wrong(self.missing(name))
    }

    /// Returns an error that names this element.
    pub(crate) fn wrong(&self, what: impl Into<String>) -> Error {
        self.wrong_inside(self, what)
    }

    /// Returns the model that was read from this root element. Returns an error if the reader is strict and there is a
    /// warning that is not allowed.
    pub(crate) fn accepted(&self, model: Model, is_strict: bool, allow: &[WarningKind]) -> Result<Model, Error> {
        match model.warnings.iter().find(|warning| !allow.contains(&warning.kind())) {
            Some(warning) if is_strict => Err(Error::Strict { file: self.file.to_string(), warning: warning.clone() }),
            _ => Ok(model),
        }
    }

    /// Returns the file and line number of this element; `None` if the user does not know the text.
    pub(crate) fn place(&self) -> Option<Place> {
        (self.line > 0).then(|| Place { file: self.file.to_string(), line: self.line })
    }

    /// Removes the line numbers of this element and of its content, for a text that the user does not know.
    pub(crate) fn forget_lines(&mut self) {
        self.line = 0;
        self.children.iter_mut().for_each(Self::forget_lines);
    }

    /// Returns a warning about an unknown, misspelt or misplaced name in this element.
    pub(crate) fn unknown(&self, what: impl Into<String>) -> Warning {
        Warning::Unknown { place: self.place(), element: self.label(), what: what.into() }
    }

    /// Returns the warning about the first item outside of this root element, if there is such an item.
    pub(crate) fn outside(&self) -> Option<Warning> {
        let (line, what) = &**self.stray.as_ref()?;
        let place = self.place().map(|place| Place { line: *line, ..place });
        Some(Warning::Unknown { place, element: self.label(), what: what.clone() })
    }

    /// Returns a warning about a feature of this element that a model cannot represent.
    pub(crate) fn left_out(&self, what: impl Into<String>) -> Warning {
        Warning::LeftOut { place: self.place(), element: self.label(), what: what.into() }
    }

    /// Returns the same warning as [`left_out`](Self::left_out), but with the line number of an element inside this
    /// element.
    pub(crate) fn left_out_inside(&self, inside: &Self, what: impl Into<String>) -> Warning {
        Warning::LeftOut { place: inside.place(), element: self.label(), what: what.into() }
    }

    /// Returns a warning about a default value that is used because this element specifies no value.
    pub(crate) fn assumed(&self, what: impl Into<String>) -> Warning {
        Warning::Assumed { place: self.place(), element: self.label(), what: what.into() }
    }

    /// Returns a warning about a joint that could follow another joint but moves freely.
    pub(crate) fn mimic(&self, what: impl Into<String>) -> Warning {
        Warning::Mimic { place: self.place(), element: self.label(), what: what.into() }
    }

    /// Returns an error that names this element, with the line number of an element inside it.
    pub(crate) fn wrong_inside(&self, inside: &Self, what: impl Into<String>) -> Error {
        Error::Element { file: inside.file.to_string(), line: inside.line, element: self.label(), what: what.into() }
    }
}

/// Advice in the error message for files with macros of xacro, which no reader expands.
const EXPAND: &str = "expand the file first (`xacro robot.urdf.xacro > robot.urdf`)";

/// Returns whether a text is a path, given by mistake instead of the text of a robot's file.
fn is_path(text: &str) -> bool {
    let known = |extension: &OsStr| ["urdf", "xml", "mjcf", "sdf", "xacro"].iter().any(|known| extension == *known);
    !text.contains('<') && Path::new(text.trim()).extension().is_some_and(known)
}

/// Parses finite numbers that are separated by spaces.
pub(crate) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| word.parse().ok().filter(|x: &f64| x.is_finite());
    let wrong = |word: &str| match word.contains("${") {
        false => format!("`{word}` is no finite number"),
        true => format!("`{word}` is an expression of xacro: {EXPAND}"),
    };
    text.split_whitespace().map(|w| number(w).ok_or_else(|| wrong(w))).collect()
}

/// Parses exactly N finite numbers.
pub(crate) fn array<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let x = numbers(text)?;
    <[f64; N]>::try_from(x).map_err(|x| {
        let s = if N == 1 { "" } else { "s" };
        format!("expected {N} number{s}, found {}", x.len())
    })
}

/// Parses a number that may be infinite but not NaN.
pub(crate) fn bound(text: &str) -> Result<f64, String> {
    let x: Option<f64> = text.trim().parse().ok().filter(|x: &f64| !x.is_nan());
    x.ok_or_else(|| format!("`{}` is no number", text.trim()))
}

/// Writes numbers that are separated by spaces, as in a file.
pub(crate) fn words(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}
