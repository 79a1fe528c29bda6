//! Line numbers of links and joints in a robot's file.

use std::collections::HashMap;

/// Type of an element that has a name and a line in a robot's file.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Kind {
    Body,
    Joint,
}

/// Line numbers of links (bodies) and joints, by type and name. Elements of included files are missing.
pub(crate) struct Lines(HashMap<(Kind, String), u32>);

impl Lines {
    /// Finds the elements in the text of a URDF, MJCF or SDF. The text need not be well-formed.
    pub(crate) fn new(text: &str) -> Self {
        let (mut lines, mut line, mut is_comment) = (HashMap::new(), 1, false);
        for piece in text.split('<') {
            is_comment |= piece.starts_with("!--");
            let tag = piece.split('>').next().unwrap_or(piece);
            let kind = match tag.split(|c: char| c.is_whitespace() || c == '/').next() {
                Some("link" | "body") => Some(Kind::Body),
                Some("joint" | "freejoint") => Some(Kind::Joint),
                _ => None,
            };
            if let (Some(kind), Some(name), false) = (kind, name(tag), is_comment) {
                // In an SDF, a tag with the same name can also occur inside a joint's <parent>. So keep the line of the
                // first tag with each name.
                lines.entry((kind, name.to_owned())).or_insert(line);
            }
            is_comment &= !piece.contains("-->");
            line += piece.matches('\n').count() as u32;
        }
        Self(lines)
    }

    /// Returns the line number of an element.
    pub(crate) fn of(&self, kind: Kind, name: &str) -> Option<u32> {
        self.0.get(&(kind, name.to_owned())).copied()
    }
}

/// Returns the value of the attribute `name` in a start tag.
fn name(tag: &str) -> Option<&str> {
    let value = tag.split("name").skip(1).zip(tag.split("name")).find_map(|(rest, before)| {
        let value = rest.trim_start().strip_prefix('=')?.trim_start();
        before.ends_with(char::is_whitespace).then_some(value)
    })?;
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    value[1..].split(quote).next()
}
