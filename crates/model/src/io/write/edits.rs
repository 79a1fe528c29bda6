//! Edits of an XML text. Byte ranges are replaced, and all other bytes are kept.

use crate::io::xml::Element;
use condyle_spatial::{Inertia, Sym3, Vec3};
use std::ops::Range;

/// Edits of a text: byte ranges, and the new text for each range.
pub(super) struct Edits<'a> {
    text: &'a str,
    pieces: Vec<(Range<usize>, String)>,
}

impl<'a> Edits<'a> {
    /// Creates an empty list of edits of a text.
    pub(super) fn new(text: &'a str) -> Self {
        Self { text, pieces: Vec::new() }
    }

    /// Sets an attribute of an element to numbers. Each number has the fewest digits with which the same number is read
    /// again.
    pub(super) fn set(&mut self, element: &Element, name: &str, numbers: &[f64]) {
        self.set_text(element, name, &words(numbers));
    }

    /// Sets an attribute of an element to a text. The text must not contain characters that XML escapes.
    pub(super) fn set_text(&mut self, element: &Element, name: &str, value: &str) {
        let tag = StartTag::new(self.text, element);
        match tag.attribute(name) {
            Some(old) => {
                let quotes = self.text[old.clone()].find(['"', '\'']).map_or(0, |at| at + 1);
                self.pieces.push((old.start + quotes..old.end - 1, value.to_owned()));
            }
            None => self.pieces.push((tag.content_end..tag.content_end, format!(" {name}=\"{value}\""))),
        }
    }

    /// Removes an attribute of an element, and the white space before the attribute.
    pub(super) fn remove(&mut self, element: &Element, name: &str) {
        if let Some(old) = StartTag::new(self.text, element).attribute(name) {
            let start = self.text[..old.start].trim_end().len();
            self.pieces.push((start..old.end, String::new()));
        }
    }

    /// Inserts an element as the first child of another element. The new element is on its own line if the other
    /// children are on their own lines.
    ///
    /// If an element has no end tag, an end tag is added. Only one child can be inserted into such an element.
    pub(super) fn insert(&mut self, element: &Element, xml: &str) {
        let (tag, own) = (StartTag::new(self.text, element), self.indent(element));
        let child = element.children.first().map(|child| self.indent(child));
        let (before, after) = match (own, child) {
            (_, Some(None)) | (None, None) => (String::new(), String::new()),
            (own, Some(Some(child))) => (child.to_owned(), own.unwrap_or_default().to_owned()),
            (Some(own), None) => (format!("{own}  "), own.to_owned()),
        };
        if self.text[..tag.end].ends_with("/>") {
            let name = &element.tag;
            self.pieces.push((tag.content_end..tag.end, format!(">{before}{xml}{after}</{name}>")));
        } else {
            self.pieces.push((tag.end..tag.end, format!("{before}{xml}")));
        }
    }

    /// Returns the text with all edits.
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

    /// Returns the line break and the white space before an element. Returns `None` if other text precedes the element
    /// on its line.
    fn indent(&self, element: &Element) -> Option<&'a str> {
        let before = &self.text[..element.at];
        let line = before.trim_end_matches([' ', '\t']);
        let line_break = if line.ends_with("\r\n") { 2 } else { usize::from(line.ends_with('\n')) };
        (line_break > 0).then(|| &before[line.len() - line_break..])
    }
}

/// Start tag of an element in its text.
struct StartTag {
    /// Name of each attribute, and the byte range from this name to the closing quote.
    attributes: Vec<(String, Range<usize>)>,
    /// Byte index of the end of the last attribute, or of the end of the tag's name if there are no attributes.
    content_end: usize,
    /// Byte index after the `>`.
    end: usize,
}

impl StartTag {
    /// Finds the attributes and the end of a start tag. The parser must have accepted this tag before.
    fn new(text: &str, element: &Element) -> Self {
        let (mut at, mut attributes) = (element.at + 1 + element.tag.len(), Vec::new());
        let mut content_end = at;
        let blanks = |at: usize| text[at..].len() - text[at..].trim_start().len();
        loop {
            at += blanks(at);
            let rest = &text[at..];
            let length = rest.find(|c: char| c.is_whitespace() || matches!(c, '=' | '>' | '/')).unwrap_or(rest.len());
            if length == 0 {
                break;
            }
            let value = at + length + rest[length..].find(['"', '\'']).unwrap_or(0);
            let quote = &text[value..value + 1];
            let end = value + 2 + text[value + 1..].find(quote).unwrap_or(0);
            attributes.push((rest[..length].to_owned(), at..end));
            (at, content_end) = (end, end);
        }
        let end = at + text[at..].find('>').map_or(0, |end| end + 1);
        Self { attributes, content_end, end }
    }

    fn attribute(&self, name: &str) -> Option<Range<usize>> {
        self.attributes.iter().find(|(own, _)| own == name).map(|(_, range)| range.clone())
    }
}

/// Writes numbers separated by spaces. Each number has the fewest digits with which the same number is read again.
pub(super) fn words(numbers: &[f64]) -> String {
    let word = |x: &f64| {
        let text = format!("{x:?}");
        text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
    };
    numbers.iter().map(word).collect::<Vec<_>>().join(" ")
}

/// Returns the mass (kg), the centre of mass (m), and the inertia about the centre of mass (kg m²). Files contain an
/// inertia in this form.
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
    use crate::io::xml::{Amount, Element};

    fn edited(text: &str, edit: impl Fn(&mut Edits, &Element)) -> String {
        let root = Element::parse(text, "text", &mut Amount::default()).expect("is XML");
        let mut edits = Edits::new(text);
        edit(&mut edits, &root);
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
    fn inserted_children_follow_the_line_breaks_of_others() {
        let insert = |text: &str| edited(text, |e, n| e.insert(&n.children[0], "<b/>"));
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
