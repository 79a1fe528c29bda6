//! Parser of XML that reads a text in one pass. The parser accepts the same files as tinyxml2, on which most readers of
//! robot files are based. For example, it accepts prefixes without a declaration, dashes in comments, and an XML
//! declaration that is not at the beginning.
//!
//! Elements inside a document type have no effect. Entities that a document type defines are not expanded, so a text
//! cannot grow.

use super::encoding::{INVALID, declared};
use super::{EXPAND, Element, MAX_ATTRIBUTES, MAX_DEPTH};
use crate::error::Error;
use std::rc::Rc;

/// Maximum length of an entity's name.
const MAX_ENTITY: usize = 64;

/// Parser state: the position in a text, and the open elements.
struct Parser<'a> {
    text: &'a str,
    /// Number of bytes that have been read.
    at: usize,
    /// Line number of the byte at index `counted`.
    line: u32,
    counted: usize,
    file: Rc<str>,
    /// Tag and line number of each open element.
    tags: Vec<(&'a str, u32)>,
    /// Open elements, at most [`MAX_DEPTH`].
    open: Vec<Element>,
    root: Option<Element>,
    /// Line number and description of the first item outside of the root element.
    stray: Option<Box<(u32, String)>>,
    /// First element that is nested too deeply, and its depth.
    too_deep: Option<(Element, usize)>,
    /// Prefixes whose elements are xacro macros.
    macros: Vec<&'a str>,
    /// Whether a byte of the file was invalid in its encoding.
    is_damaged: bool,
}

/// Parses the root element of a text.
pub(super) fn parse(text: &str, file: &str) -> Result<Element, Error> {
    let text = text.trim_end_matches('\0'); // removes the terminating zero of a C string
    let mut parser = Parser {
        text,
        at: if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 },
        line: 1,
        counted: 0,
        file: file.into(),
        tags: Vec::new(),
        open: Vec::new(),
        root: None,
        stray: None,
        too_deep: None,
        macros: vec!["xacro"],
        is_damaged: text.contains(INVALID),
    };
    while parser.step()? {}
    if let Some((first, depth)) = parser.too_deep {
        let what = format!("elements are nested {depth} deep, at most {MAX_DEPTH} are allowed");
        return Err(first.wrong(what));
    }
    match (parser.tags.last(), parser.root.take()) {
        (Some(&(tag, line)), _) => Err(parser.wrong(format!("<{tag}> of line {line} is never closed"))),
        (None, None) => Err(parser.wrong("there is no element")),
        (None, Some(root)) => Ok(Element { stray: parser.stray, ..root }),
    }
}

impl<'a> Parser<'a> {
    /// Reads text and the tag that follows it. Returns whether there was a tag.
    fn step(&mut self) -> Result<bool, Error> {
        let rest = &self.text[self.at..];
        let length = rest.find('<').unwrap_or(rest.len());
        let text = &rest[..length];
        if self.tags.is_empty() {
            let blank = text.len() - text.trim_start().len();
            if blank < text.len() {
                self.at += blank;
                if length == rest.len() {
                    return Err(self.wrong("text outside of the root element"));
                }
                self.stray("text outside of the root element has no effect".to_owned());
                self.at -= blank;
            }
        } else if self.open.last().is_some_and(|open| !open.text.is_empty()) || !text.trim_start().is_empty() {
            let text = self.decoded(text, false)?;
            self.add_text(&text);
        }
        self.at += length;
        let tag = &rest[length..];
        if let Some(comment) = tag.strip_prefix("<!--") {
            self.skip(4, comment, "-->", "a comment")?;
        } else if let Some(text) = tag.strip_prefix("<![CDATA[") {
            if self.tags.is_empty() {
                self.stray("text outside of the root element has no effect".to_owned());
            }
            let text = self.skip(9, text, "]]>", "<![CDATA[")?;
            self.check_encoding(text)?;
            self.add_text(text);
        } else if let Some(instruction) = tag.strip_prefix("<?") {
            self.skip(2, instruction, "?>", "<?")?;
        } else if let Some(document_type) = tag.strip_prefix("<!") {
            let Some(length) = end_of_type(document_type) else { return Err(self.wrong("<! is never closed")) };
            self.at += 2 + length;
        } else if let Some(tag) = tag.strip_prefix("</") {
            if self.tags.is_empty() && self.root.is_some() {
                self.stray(
                    "the text of the file ends before a tag that closes nothing: the rest has no effect".to_owned(),
                );
                return Ok(false);
            }
            let name = self.skip(2, tag, ">", "</")?.trim_end();
            self.close(name)?;
        } else {
            if let Some(tag) = tag.strip_prefix('<') {
                self.at += 1;
                self.open(tag)?;
            }
            return Ok(!tag.is_empty());
        }
        Ok(true)
    }

    /// Moves past an end marker, and returns the text before this marker.
    fn skip(&mut self, begin: usize, rest: &'a str, end: &str, what: &str) -> Result<&'a str, Error> {
        let Some(length) = rest.find(end) else { return Err(self.wrong(format!("{what} is never closed"))) };
        self.at += begin + length + end.len();
        Ok(&rest[..length])
    }

    /// Reads a tag that opens an element. `rest` begins with the tag's name.
    fn open(&mut self, rest: &'a str) -> Result<(), Error> {
        let name = self.name(rest)?;
        if self.root.is_some() && self.tags.is_empty() {
            self.stray(format!("<{name}> is a second root element, and has no effect"));
        }
        let line = self.count_lines();
        let mut element = Element {
            tag: name.to_owned(),
            attributes: Vec::new(),
            text: String::new(),
            children: Vec::new(),
            file: self.file.clone(),
            line,
            at: self.at - 1,
            source: 0,
            stray: None,
        };
        self.at += name.len();
        let is_empty = self.attributes(name, &mut element)?;
        if name.split_once(':').is_some_and(|(prefix, _)| self.macros.contains(&prefix)) {
            return Err(element.wrong(format!("belongs to xacro: {EXPAND}")));
        }
        self.tags.push((name, line));
        let depth = self.tags.len();
        if depth <= MAX_DEPTH {
            self.open.push(element);
        } else {
            let deepest = self.too_deep.as_ref().map_or(0, |(_, deepest)| *deepest).max(depth);
            self.too_deep = Some((self.too_deep.take().map_or(element, |(first, _)| first), deepest));
        }
        if is_empty { self.close(name) } else { Ok(()) }
    }

    /// Reads the attributes of an element and the end of its tag. Returns whether the element is empty.
    fn attributes(&mut self, tag: &str, element: &mut Element) -> Result<bool, Error> {
        let mut others = 0; // declarations of namespaces, and attributes beyond the limit
        loop {
            let rest = self.text[self.at..].trim_start();
            self.at = self.text.len() - rest.len();
            if rest.starts_with("/>") || rest.starts_with('>') {
                let is_empty = rest.starts_with('/');
                self.at += 1 + usize::from(is_empty);
                let found = element.attributes.len() + others;
                if found > MAX_ATTRIBUTES {
                    let (file, line) = (self.file.to_string(), element.line);
                    let what = format!(
                        "the element on line {line} has {found} attributes, at most {MAX_ATTRIBUTES} are allowed"
                    );
                    return Err(Error::File { file, what });
                }
                return Ok(is_empty);
            }
            if rest.is_empty() {
                return Err(self.wrong(format!("<{tag}> of line {} is never closed", element.line)));
            }
            let name = self.name(rest)?;
            let value = rest[name.len()..].trim_start().strip_prefix('=').map(str::trim_start);
            let quoted = value.and_then(|value| Some((value, value.chars().next().filter(|c| "\"'".contains(*c))?)));
            let Some((value_from, quote)) = quoted else {
                return Err(self.wrong(format!("attribute `{name}` of <{tag}> has no value in quotation marks")));
            };
            let Some(length) = value_from[1..].find(quote) else {
                return Err(self.wrong(format!("attribute `{name}` of <{tag}> has a value without an end")));
            };
            let inside = &value_from[1..=length];
            if element.attributes.len() + others < MAX_ATTRIBUTES && element.attribute(name).is_some() {
                return Err(self.wrong(format!("<{tag}> has a second attribute `{name}`")));
            }
            let value = self.decoded(inside, true)?;
            self.at = self.text.len() - value_from.len() + length + 2;
            match name.strip_prefix("xmlns") {
                Some(prefix) if prefix.is_empty() || prefix.starts_with(':') => {
                    others += 1;
                    let prefix = prefix.trim_start_matches(':');
                    if value.contains("xacro") && !self.macros.contains(&prefix) && self.macros.len() < MAX_ATTRIBUTES {
                        self.macros.push(prefix);
                    }
                }
                _ if element.attributes.len() + others < MAX_ATTRIBUTES => {
                    element.attributes.push((name.to_owned(), value));
                }
                _ => others += 1,
            }
        }
    }

    /// Closes the innermost open element, whose tag must be `name`.
    fn close(&mut self, name: &str) -> Result<(), Error> {
        match self.tags.pop() {
            Some((tag, _)) if tag == name => {}
            Some((tag, line)) => {
                return Err(self.wrong(format!("</{name}> where <{tag}> of line {line} is open")));
            }
            None => return Err(self.wrong(format!("</{name}> closes nothing"))),
        }
        if self.tags.len() < MAX_DEPTH {
            let element = self.open.pop();
            match self.open.last_mut() {
                Some(parent) => parent.children.extend(element),
                None => self.root = self.root.take().or(element),
            }
        }
        Ok(())
    }

    /// Stores the description of an item outside of the root element. Such an item is not an error, because other
    /// readers of robot files accept it.
    fn stray(&mut self, what: String) {
        if self.stray.is_none() {
            self.stray = Some(Box::new((self.count_lines(), what)));
        }
    }

    fn add_text(&mut self, text: &str) {
        if let Some(open) = self.open.last_mut().filter(|_| self.tags.len() <= MAX_DEPTH) {
            open.text.push_str(text);
        }
    }

    /// Returns the name at the beginning of a text.
    fn name(&self, rest: &'a str) -> Result<&'a str, Error> {
        let own = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | ':' | '-' | '.') || c as u32 >= 128;
        let name = &rest[..rest.find(|c| !own(c)).unwrap_or(rest.len())];
        match rest.chars().next() {
            Some(c) if !own(c) || c.is_ascii_digit() || matches!(c, '-' | '.') => {
                Err(self.wrong(format!("`{}` where a name is expected", c.escape_default())))
            }
            None => Err(self.wrong("the end, where a name is expected")),
            _ => self.check_encoding(name).map(|()| name),
        }
    }

    /// Decodes character references and the five entities in a text. In an attribute, line breaks and tabs become
    /// spaces.
    fn decoded(&self, text: &str, is_attribute: bool) -> Result<String, Error> {
        let special = |b: &u8| *b == b'&' || *b == b'\r' || is_attribute && matches!(*b, b'\n' | b'\t');
        self.check_encoding(text)?;
        if !text.as_bytes().iter().any(&special) {
            return Ok(text.to_owned());
        }
        let mut decoded = String::with_capacity(text.len());
        let text = text.replace("\r\n", "\n");
        let mut rest = &*text;
        while let Some(at) = rest.as_bytes().iter().position(&special) {
            decoded.push_str(&rest[..at]);
            let from = &rest[at + 1..];
            let name = from.bytes().take(MAX_ENTITY).position(|b| b == b';').map(|end| &from[..end]);
            rest = match name.filter(|name| is_entity(name) && rest.as_bytes()[at] == b'&') {
                Some(name) => {
                    decoded.push(character(name).map_err(|what| self.wrong(what))?);
                    &from[name.len() + 1..]
                }
                None => {
                    let other = if is_attribute { ' ' } else { '\n' };
                    decoded.push(if rest.as_bytes()[at] == b'&' { '&' } else { other });
                    from
                }
            };
        }
        decoded.push_str(rest);
        Ok(decoded)
    }

    /// Returns an error if a text contains a byte that is invalid in the encoding of its file.
    fn check_encoding(&self, text: &str) -> Result<(), Error> {
        if !self.is_damaged || !text.contains(INVALID) {
            return Ok(());
        }
        let known = "UTF-8, UTF-16, US-ASCII, ISO-8859-1 or windows-1252";
        Err(self.wrong(match declared(self.text.as_bytes()).and_then(|name| std::str::from_utf8(name).ok()) {
            Some(name) => format!("a byte cannot be read in the encoding `{name}`: expected {known}"),
            None => format!("a byte is not UTF-8, and no encoding is declared: expected {known}"),
        }))
    }

    /// Returns the current line.
    fn count_lines(&mut self) -> u32 {
        let between = &self.text.as_bytes()[self.counted..self.at];
        (self.line, self.counted) = (self.line + count(between, b'\n') as u32, self.at);
        self.line
    }

    /// Returns an error about a text that is not XML.
    fn wrong(&self, what: impl Into<String>) -> Error {
        let line = 1 + count(&self.text.as_bytes()[..self.at], b'\n') as u32;
        Error::Xml { file: self.file.to_string(), line, what: what.into() }
    }
}

/// Returns the length of a document type, including its `>`. Returns `None` if its end is missing.
fn end_of_type(text: &str) -> Option<usize> {
    let (mut at, mut is_subset) = (0, false);
    loop {
        let rest = &text[at..];
        let begin = rest.find(['"', '\'', '[', ']', '<', '>'])?;
        let (sign, behind) = (rest.as_bytes()[begin], &rest[begin + 1..]);
        at += begin + 1;
        match sign {
            b'[' => is_subset = true,
            b']' => is_subset = false,
            b'>' if !is_subset => return Some(at),
            b'"' | b'\'' => at += behind.find(sign as char)? + 1,
            b'<' if behind.starts_with("!--") => at += behind.find("-->")? + 3,
            _ => {}
        }
    }
}

/// Counts the occurrences of a byte.
pub(super) fn count(bytes: &[u8], byte: u8) -> usize {
    bytes.iter().filter(|&&b| b == byte).count()
}

/// Returns whether the text between `&` and `;` is the name of an entity or the number of a character. If the text is
/// neither, the `&` is a literal character.
fn is_entity(name: &str) -> bool {
    let name = name.strip_prefix('#').unwrap_or(name);
    !name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(&b))
}

/// Returns the character of an entity.
fn character(name: &str) -> Result<char, String> {
    let number = |digits: &str| match digits.strip_prefix(['x', 'X']) {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => digits.parse().ok(),
    };
    match name {
        "amp" => Ok('&'),
        "lt" => Ok('<'),
        "gt" => Ok('>'),
        "quot" => Ok('"'),
        "apos" => Ok('\''),
        _ => match name.strip_prefix('#') {
            Some(digits) => {
                let found = number(digits).and_then(char::from_u32).filter(|c| *c != '\0');
                found.ok_or_else(|| format!("`&{name};` is no character"))
            }
            None => Err(format!("entity `&{name};` is not expanded: write its text instead")),
        },
    }
}
