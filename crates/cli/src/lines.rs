//! The lines of a robot's file on which its links and joints stand.

use condyle::Model;
use std::collections::HashMap;

/// What has a name and a line in a robot's file.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Kind {
    Body,
    Joint,
}

/// The line of each link (body) and joint, by name, as far as the file itself has them: those of a file that it includes
/// are not there.
pub(crate) struct Lines(HashMap<(Kind, String), u32>);

impl Lines {
    /// Looks them up in the text of a URDF, MJCF or SDF.
    pub(crate) fn new(text: &str) -> Self {
        let Ok(text) = Model::well_formed(text) else { return Self(HashMap::new()) };
        let Ok(document) = roxmltree::Document::parse(&text) else { return Self(HashMap::new()) };
        let mut lines = HashMap::new();
        for node in document.descendants().filter(roxmltree::Node::is_element) {
            let kind = match node.tag_name().name() {
                "link" | "body" => Kind::Body,
                "joint" | "freejoint" => Kind::Joint,
                _ => continue,
            };
            if let Some(name) = node.attribute("name") {
                // The same tag names a link inside of a joint's <parent> in an SDF: the first one with a name counts.
                lines.entry((kind, name.to_owned())).or_insert_with(|| document.text_pos_at(node.range().start).row);
            }
        }
        Self(lines)
    }

    /// The line of one of them.
    pub(crate) fn of(&self, kind: Kind, name: &str) -> Option<u32> {
        self.0.get(&(kind, name.to_owned())).copied()
    }
}
