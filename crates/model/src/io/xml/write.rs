//! Conversion of a robot's file to a text that other XML parsers accept.

use super::{Amount, Element};
use crate::error::Error;
use crate::model::Model;

impl Model {
    /// Decodes the bytes of a file.
    #[doc(hidden)]
    pub fn decoded(bytes: Vec<u8>) -> String {
        super::encoding::decode(bytes)
    }

    /// Returns a text that every XML parser can read: without a document type, comments and prefixes. The elements are
    /// the same, on the same lines.
    #[doc(hidden)]
    pub fn well_formed(text: &str) -> Result<String, Error> {
        let mut written = Written { text: String::with_capacity(text.len()), line: 1 };
        written.element(&Element::parse(text, "<string>", &mut Amount::default())?);
        Ok(written.text)
    }
}

struct Written {
    text: String,
    line: u32,
}

impl Written {
    /// Writes an element on its line, or on the first later line that is free.
    fn element(&mut self, element: &Element) {
        let name = |name: &str| match name.strip_prefix(':') {
            Some(rest) => format!("_{}", rest.replace(':', "-")), // a name must not begin with a dash
            None => name.replace(':', "-"),
        };
        while self.line < element.line {
            self.text.push('\n');
            self.line += 1;
        }
        self.text.push('<');
        self.text += &name(&element.tag);
        for (attribute, value) in &element.attributes {
            self.text.push(' ');
            self.text += &name(attribute);
            self.text += "=\"";
            self.escaped(value);
            self.text.push('"');
        }
        self.text.push('>');
        self.escaped(element.text.trim());
        element.children.iter().for_each(|child| self.element(child));
        self.text += "</";
        self.text += &name(&element.tag);
        self.text.push('>');
    }

    fn escaped(&mut self, text: &str) {
        for c in text.chars() {
            match c {
                '&' => self.text += "&amp;",
                '<' => self.text += "&lt;",
                '"' => self.text += "&quot;",
                '\n' => self.text += "&#10;", // adds no line break
                '\t' => self.text += "&#9;",
                c if c.is_control() => {}
                c => self.text.push(c),
            }
        }
    }
}
