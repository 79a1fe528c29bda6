//! Known elements and attributes of a format, by parent. All others in a file are misspelt or misplaced, and have no
//! effect. Each causes a warning with file, line and the nearest known name.

use super::xml::Element;
use crate::names::{near, nearest};
use crate::warning::Warning;
use std::collections::HashMap;

/// Known elements and attributes of a format.
///
/// They are written as a text with one line for each type of element:
///
/// ```text
/// type: attribute attribute … ; child child=type child* …
/// ```
///
/// The type of a child is its tag, unless `=type` names another type. `*` marks a known child whose content is not
/// checked. A child whose type has no line has neither attributes nor children.
pub(crate) struct Known {
    types: HashMap<&'static str, Type>,
}

/// Type of element: its allowed attributes and children.
#[derive(Default)]
struct Type {
    attributes: Vec<&'static str>,
    /// Tag and type of each child; the type is empty if the content of the child is not checked.
    children: Vec<(&'static str, &'static str)>,
}

/// Maximum number of warnings about one file; chosen because each one searches for the nearest name.
const MAX_WARNINGS: usize = 1000;

/// Type of a child whose content is not checked.
const OPEN: &str = "";

/// Features that a format has and a model cannot represent: the type of an element, its attribute or child, and the
/// effect of its absence.
pub(crate) type LeftOut = [(&'static str, &'static str, &'static str)];

impl Known {
    /// Reads the text of a table.
    pub(crate) fn new(text: &'static str) -> Self {
        let mut types = HashMap::new();
        for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
            let (name, rest) = line.split_once(':').expect("a type, then a colon");
            let (attributes, children) = rest.split_once(';').unwrap_or((rest, ""));
            let child = |word: &'static str| match (word.strip_suffix('*'), word.split_once('=')) {
                (Some(tag), _) => (tag, OPEN),
                (None, Some(child)) => child,
                (None, None) => (word, word),
            };
            let found: &mut Type = types.entry(name.trim()).or_default();
            found.attributes.extend(attributes.split_whitespace());
            found.children.extend(children.split_whitespace().map(child));
        }
        Self { types }
    }

    /// Adds warnings about unknown parts of an element, whose type is its tag, and about features that a model cannot
    /// represent.
    pub(crate) fn check(&self, root: &Element, left_out: &LeftOut, warnings: &mut Vec<Warning>) {
        warnings.extend(root.outside());
        if let Some((&name, _)) = self.types.get_key_value(root.tag.as_str()) {
            self.check_as(name, root, left_out, warnings);
            if warnings.len() >= MAX_WARNINGS {
                warnings.push(root.unknown(format!(
                    "more than {MAX_WARNINGS} names are unknown or left out: the rest is not listed"
                )));
            }
        }
    }

    /// Adds warnings about an element of a given type.
    fn check_as(&self, name: &'static str, element: &Element, left_out: &LeftOut, warnings: &mut Vec<Warning>) {
        let (none, is_full) = (Type::default(), |warnings: &[Warning]| warnings.len() >= MAX_WARNINGS);
        let known = self.types.get(name).unwrap_or(&none);
        let said = |what: &str| left_out.iter().find(|(of, inside, _)| *of == name && *inside == what);
        for (attribute, _) in &element.attributes {
            if is_full(warnings) {
                return;
            }
            if let Some((.., what)) = said(attribute) {
                warnings.push(element.left_out(format!("{attribute}: {what}")));
            } else if !known.attributes.contains(&attribute.as_str()) && !attribute.contains(':') {
                let near = near(&nearest(attribute, known.attributes.iter().copied()));
                warnings.push(element.unknown(format!("unknown attribute `{attribute}`{near}")));
            }
        }
        for child in &element.children {
            if is_full(warnings) {
                return;
            }
            let tag = child.tag.as_str();
            if let Some((.., what)) = said(tag) {
                warnings.push(child.left_out(*what));
            }
            match known.children.iter().find(|(known, _)| *known == tag) {
                Some(&(_, OPEN)) => {}
                Some(&(_, of)) => self.check_as(of, child, left_out, warnings),
                None if tag.contains(':') => {}
                None => warnings.push(child.unknown(self.misplaced(known, element, tag))),
            }
        }
    }

    /// Returns the message that an element is unknown, or misplaced in its parent.
    fn misplaced(&self, known: &Type, parent: &Element, tag: &str) -> String {
        let near = near(&nearest(tag, known.children.iter().map(|(tag, _)| *tag)));
        let elsewhere = self.types.values().any(|t| t.children.iter().any(|(known, _)| *known == tag));
        let what = if elsewhere { "misplaced element" } else { "unknown element" };
        format!("{what} <{tag}> in <{}>{near}", parent.tag)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::xml::Amount;

    #[test]
    fn unknown_names_warn_with_the_nearest_name() {
        let known =
            Known::new("robot: name ; link joint\n link: name ; mass drawn*\n joint: name type ; axis\n axis: xyz");
        let left_out: &LeftOut = &[("joint", "type", "is not held")];
        let said = |text: &str| {
            let mut warnings = Vec::new();
            let root = Element::parse(text, "<string>", &mut Amount::default()).unwrap();
            known.check(&root, left_out, &mut warnings);
            warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        };
        let fine = "<robot name='r'><link name='a'><mass>1</mass><drawn x='1'><y/></drawn></link></robot>";
        assert_eq!(said(fine), "");
        let attribute = "<robot>\n<joint><axis xzy='1 0 0'/></joint></robot>";
        assert_eq!(said(attribute), "<string>:2: <axis>: unknown attribute `xzy`; nearest is `xyz`");
        let element = "<robot>\n<lnk/></robot>";
        assert_eq!(said(element), "<string>:2: <lnk>: unknown element <lnk> in <robot>; nearest is `link`");
        let misplaced = "<robot><link><axis/></link></robot>";
        assert!(said(misplaced).starts_with("<string>:1: <axis>: misplaced element <axis> in <link>"));
        assert_eq!(said("<robot><joint type='x'/></robot>"), "<string>:1: <joint>: type: is not held");
    }
}
