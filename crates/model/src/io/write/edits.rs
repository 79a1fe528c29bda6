//! Edits of an XML text by byte ranges: all that is not edited stays byte for byte.

use condyle_spatial::{Inertia, Sym3, Vec3};
use roxmltree::Node;
use std::ops::Range;

/// The pieces of a text that are replaced, each a byte range with its new text.
pub(super) struct Edits<'a> {
    text: &'a str,
    pieces: Vec<(Range<usize>, String)>,
}

impl<'a> Edits<'a> {
    /// No edits of a text.
    pub(super) fn new(text: &'a str) -> Self {
        Self { text, pieces: Vec::new() }
    }

    /// Sets an attribute of an element to numbers, in as few digits as give each number back.
    pub(super) fn set(&mut self, node: Node, name: &str, numbers: &[f64]) {
        self.set_text(node, name, &words(numbers));
    }

    /// Sets an attribute of an element to a text without characters that XML escapes.
    pub(super) fn set_text(&mut self, node: Node, name: &str, value: &str) {
        match node.attribute_node(name) {
            // the attribute as a whole: its quotes and the spaces around its equals sign are found from both ends
            Some(old) => {
                let quotes = self.text[old.range()].find(['"', '\'']).map_or(0, |at| at + 1);
                let (start, end) = (old.range().start + quotes, old.range().end - 1);
                self.pieces.push((start..end, value.to_owned()));
            }
            None => {
                let (end, _) = self.start_tag(node);
                self.pieces.push((end..end, format!(" {name}=\"{value}\"")));
            }
        }
    }

    /// Removes an attribute of an element, with the white space before it.
    pub(super) fn remove(&mut self, node: Node, name: &str) {
        if let Some(old) = node.attribute_node(name) {
            let start = self.text[..old.range().start].trim_end().len();
            self.pieces.push((start..old.range().end, String::new()));
        }
    }

    /// Inserts an element as the first child of another one, on a line of its own where the other children have one.
    ///
    /// An element without an end tag gets one, so it takes one child only.
    pub(super) fn insert(&mut self, node: Node, xml: &str) {
        let (attributes, end) = self.start_tag(node);
        let own = self.indent(node);
        let child = node.first_element_child().map(|child| self.indent(child));
        let (before, after) = match (own, child) {
            (_, Some(None)) | (None, None) => (String::new(), String::new()),
            (own, Some(Some(child))) => (child.to_owned(), own.unwrap_or_default().to_owned()),
            (Some(own), None) => (format!("{own}  "), own.to_owned()),
        };
        if self.text[..end].ends_with("/>") {
            let tag = &self.text[node.range().start + 1..];
            let tag = &tag[..tag.find(|c: char| c.is_whitespace() || matches!(c, '/' | '>')).unwrap_or(0)];
            self.pieces.push((attributes..end, format!(">{before}{xml}{after}</{tag}>")));
        } else {
            self.pieces.push((end..end, format!("{before}{xml}")));
        }
    }

    /// The text with all edits.
    pub(super) fn apply(mut self) -> String {
        self.pieces.sort_by_key(|(range, _)| (range.start, range.end));
        let (mut new, mut end) = (String::with_capacity(self.text.len() + 1024), 0);
        for (range, piece) in &self.pieces {
            new += &self.text[end..range.start];
            new += piece;
            end = range.end;
        }
        new + &self.text[end..]
    }

    /// The byte indices after the last attribute of an element and after its start tag.
    fn start_tag(&self, node: Node) -> (usize, usize) {
        let (start, mut quote) = (node.range().start, None);
        let closes = |&(_, c): &(usize, char)| {
            match quote {
                None if c == '>' => return true,
                None if matches!(c, '"' | '\'') => quote = Some(c),
                Some(open) if open == c => quote = None,
                _ => {}
            }
            false
        };
        let end = self.text[start..].char_indices().find(closes).map_or(self.text.len(), |(i, _)| start + i + 1);
        let inside = self.text[..end].trim_end_matches('>');
        (inside.strip_suffix('/').unwrap_or(inside).trim_end().len(), end)
    }

    /// The line break and the white space before an element; none if something else stands before it on its line.
    fn indent(&self, node: Node) -> Option<&'a str> {
        let before = &self.text[..node.range().start];
        let spaces = &before[before.trim_end_matches([' ', '\t']).len()..];
        let line = &before[..before.len() - spaces.len()];
        let line_break = if line.ends_with("\r\n") { 2 } else { usize::from(line.ends_with('\n')) };
        (line_break > 0).then(|| &before[line.len() - line_break..])
    }
}

/// Numbers with spaces between them, each in as few digits as give it back.
pub(super) fn words(numbers: &[f64]) -> String {
    let word = |x: &f64| {
        let text = format!("{x:?}");
        text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
    };
    numbers.iter().map(word).collect::<Vec<_>>().join(" ")
}

/// The first child of an element that has a tag.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|n| n.is_element() && n.tag_name().name() == tag)
}

/// Mass (kg), centre of mass (m), and inertia about it (kg m²), as files have them.
pub(super) fn about_com(I: Inertia<f64>) -> Result<(f64, [f64; 3], Sym3<f64>), String> {
    if I.mass == 0.0 {
        return match I.mass_com == Vec3::zero() {
            true => Ok((0.0, [0.0; 3], I.rotational)),
            false => Err(format!("mass 0 and first moment {:?} kg m have no centre", I.mass_com.to_array())),
        };
    }
    let com = I.mass_com.scale(1.0 / I.mass);
    let parallel_axes = Inertia::from_com(I.mass, com, Sym3::zero()).rotational; // m (c·c 1 − c cᵀ)
    Ok((I.mass, com.to_array(), I.rotational - parallel_axes))
}

#[cfg(test)]
mod tests {
    use super::{Edits, words};
    use roxmltree::Document;

    fn edited(text: &str, edit: impl Fn(&mut Edits, roxmltree::Node)) -> String {
        let document = Document::parse(text).expect("is XML");
        let mut edits = Edits::new(text);
        edit(&mut edits, document.root_element());
        edits.apply()
    }

    #[test]
    fn attributes_are_replaced_added_and_removed() {
        let text = "<a  x = '1'\n y=\"2\" />";
        assert_eq!(edited(text, |e, n| e.set(n, "x", &[0.5, -2.0])), "<a  x = '0.5 -2'\n y=\"2\" />");
        assert_eq!(edited(text, |e, n| e.set(n, "z", &[1e-9])), "<a  x = '1'\n y=\"2\" z=\"1e-9\" />");
        assert_eq!(edited(text, |e, n| e.remove(n, "y")), "<a  x = '1' />");
        assert_eq!(edited("<a/>", |e, n| e.set(n, "x", &[3.0])), "<a x=\"3\"/>");
    }

    #[test]
    fn spaces_around_an_equals_sign_may_be_many() {
        let text = format!("<a x{}='1'/>", " ".repeat(400));
        assert_eq!(edited(&text, |e, n| e.set(n, "x", &[2.0])), text.replace('1', "2"));
    }

    #[test]
    fn children_stand_on_lines_of_their_own_where_others_do() {
        let insert = |text: &str| edited(text, |e, n| e.insert(n.first_element_child().expect("has a child"), "<b/>"));
        assert_eq!(insert("<r>\n\t<a/>\n</r>"), "<r>\n\t<a>\n\t  <b/>\n\t</a>\n</r>");
        assert_eq!(insert("<r>\r\n  <a>\r\n    <c/></a></r>"), "<r>\r\n  <a>\r\n    <b/>\r\n    <c/></a></r>");
        assert_eq!(insert("<r><a><c/></a></r>"), "<r><a><b/><c/></a></r>");
        assert_eq!(insert("<r><a k='>'/></r>"), "<r><a k='>'><b/></a></r>");
        assert_eq!(insert("<r><a xmlns:k='u' /></r>"), "<r><a xmlns:k='u'><b/></a></r>");
    }

    #[test]
    fn numbers_come_back() {
        for x in [0.1, 1.0 / 3.0, -2.0, 1e300, 5e-324, 123_456_789.123_456_78] {
            assert_eq!(words(&[x]).parse::<f64>(), Ok(x), "{x}");
        }
    }
}
