//! Known elements and attributes of a format, by parent element. All other names in a file are misspelt or misplaced,
//! and have no effect. Each such name causes a warning with the file, the line and the nearest known name.
//!
//! A name with a prefix (`prefix:name`) belongs to another program and is not checked. It is checked if the format's
//! table contains the same prefix or a similar prefix. If the table contains no prefixes, the format has no extensions,
//! and every name with a prefix is unknown.

use super::xml::Element;
use crate::names::{near, nearest};
use crate::warning::Warning;
use std::collections::HashMap;

/// Known elements and attributes of a format.
///
/// The names are written as a text with one line for each type of element:
///
/// ```text
/// type: attribute attribute … ; child child=type child* …
/// ```
///
/// The type of a child is its tag, unless `=type` names another type. A child whose type has no line has neither
/// attributes nor children. `*` marks a known child without effect on a robot. The content of such a child is not
/// checked, but elements of a robot cause a warning there, because they are misplaced. The line of the type `*` lists
/// these elements as its children. `**` marks a child whose content is not checked at all.
pub(crate) struct Known {
    types: HashMap<&'static str, Type>,
    /// XML prefixes (before `:`) of the attributes and children in `types`.
    prefixes: Vec<&'static str>,
}

/// Type of element: its allowed attributes and children.
#[derive(Default)]
struct Type {
    attributes: Vec<&'static str>,
    /// Tag and type of each child.
    children: Vec<(&'static str, &'static str)>,
}

/// Maximum number of warnings about one file. The number is limited because each warning needs a search for the nearest
/// name.
const MAX_WARNINGS: usize = 1000;

/// Type of a child without effect on a robot. Its content is not checked, but elements of a robot cause a warning
/// there. The line of this type lists these elements.
pub(crate) const OPEN: &str = "*";
/// Type of a child whose content is not checked.
const FREE: &str = "**";
/// Prefixes of attributes that XML itself uses.
const XML: [&str; 2] = ["xml", "xsi"];

/// Features of a format that a model cannot represent: the type of an element, its attribute or child, and the
/// consequence of the omission.
pub(crate) type LeftOut = [(&'static str, &'static str, &'static str)];

impl Known {
    /// Reads the text of a table, as described at [`Known`].
    pub(crate) fn new(text: &'static str) -> Self {
        let (mut types, mut prefixes) = (HashMap::new(), Vec::new());
        for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
            let (name, rest) = line.split_once(':').expect("a type, then a colon");
            let (attributes, children) = rest.split_once(';').unwrap_or((rest, ""));
            let child = |word: &'static str| match word.split_once('=') {
                Some(child) => child,
                None => {
                    [FREE, OPEN].into_iter().find_map(|of| Some((word.strip_suffix(of)?, of))).unwrap_or((word, word))
                }
            };
            let found: &mut Type = types.entry(name.trim()).or_default();
            found.attributes.extend(attributes.split_whitespace());
            found.children.extend(children.split_whitespace().map(child));
            let tags = found.children.iter().map(|(tag, _)| *tag);
            prefixes
                .extend(found.attributes.iter().copied().chain(tags).filter_map(|name| Some(name.split_once(':')?.0)));
        }
        prefixes.sort_unstable();
        prefixes.dedup();
        Self { types, prefixes }
    }

    /// Adds warnings about unknown attributes and children of an element, whose type is its tag. Also adds warnings
    /// about features that a model cannot represent.
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

    /// Adds the warnings of [`check`](Self::check) about an element, given the type of the element.
    pub(crate) fn check_as(&self, name: &str, element: &Element, left_out: &LeftOut, warnings: &mut Vec<Warning>) {
        match name {
            FREE => return,
            OPEN => return self.check_open(element, warnings),
            _ => {}
        }
        let none = Type::default();
        let known = self.types.get(name).unwrap_or(&none);
        let said = |what: &str| left_out.iter().find(|(of, inside, _)| *of == name && *inside == what);
        for (attribute, _) in &element.attributes {
            if is_full(warnings) {
                return;
            }
            let is_xmls = || attribute.split_once(':').is_some_and(|(prefix, _)| XML.contains(&prefix));
            if let Some((.., what)) = said(attribute) {
                warnings.push(element.left_out(format!("{attribute}: {what}")));
            } else if !known.attributes.contains(&attribute.as_str()) && !self.is_extension(attribute) && !is_xmls() {
                let near = near(&similar(attribute, &known.attributes));
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
                Some(&(_, of)) => self.check_as(of, child, left_out, warnings),
                None if self.is_extension(tag) => {}
                None => warnings.push(child.unknown(self.misplaced(known, element, tag))),
            }
        }
    }

    /// Adds warnings about elements of a robot that are inside an element without effect on a robot.
    fn check_open(&self, element: &Element, warnings: &mut Vec<Warning>) {
        let Some(robots) = self.types.get(OPEN) else { return };
        let is_free = |tag: &str| self.types.values().any(|t| t.children.contains(&(tag, FREE)));
        for child in &element.children {
            if is_full(warnings) {
                return;
            }
            if robots.children.iter().any(|(tag, _)| *tag == child.tag) {
                warnings.push(child.unknown(format!("misplaced element <{}> in <{}>", child.tag, element.tag)));
            } else if !self.is_extension(&child.tag) && !is_free(&child.tag) {
                self.check_open(child, warnings);
            }
        }
    }

    /// Returns whether a name has the prefix of another program.
    fn is_extension(&self, name: &str) -> bool {
        let prefix = name.split_once(':').map(|(prefix, _)| prefix).filter(|_| !self.prefixes.is_empty());
        prefix.is_some_and(|prefix| nearest(prefix, self.prefixes.iter().copied()).is_empty())
    }

    /// Returns the message about an element that is unknown, or misplaced in its parent.
    fn misplaced(&self, known: &Type, parent: &Element, tag: &str) -> String {
        let near = near(&similar(tag, &known.children.iter().map(|(tag, _)| *tag).collect::<Vec<_>>()));
        let elsewhere = self.types.values().any(|t| t.children.iter().any(|(known, _)| *known == tag));
        let what = if elsewhere { "misplaced element" } else { "unknown element" };
        format!("{what} <{tag}> in <{}>{near}", parent.tag)
    }
}

/// Returns whether the maximum number of warnings is reached, so that no more warnings are added.
fn is_full(warnings: &[Warning]) -> bool {
    warnings.len() >= MAX_WARNINGS
}

/// Returns the nearest known name. If no known name is similar, returns the name that is nearest to the given name
/// without its prefix.
fn similar(name: &str, known: &[&str]) -> String {
    let of = |name: &str| nearest(name, known.iter().copied());
    let found = of(name);
    match name.split_once(':') {
        Some((_, local)) if found.is_empty() => of(local),
        _ => found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::xml::Amount;

    /// Returns the warnings about a text.
    fn said(known: &Known, left_out: &LeftOut, text: &str) -> String {
        let mut warnings = Vec::new();
        let root = Element::parse(text, "<string>", &mut Amount::default()).unwrap();
        known.check(&root, left_out, &mut warnings);
        warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn unknown_names_warn_with_the_nearest_name() {
        let known =
            Known::new("robot: name ; link joint\n link: name ; mass drawn*\n joint: name type ; axis\n axis: xyz");
        let left_out: &LeftOut = &[("joint", "type", "is not held")];
        let said = |text: &str| said(&known, left_out, text);
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

    #[test]
    fn elements_of_a_robot_are_misplaced_in_others() {
        let known = Known::new("robot: ; link drawn* tool**\n link: ; mass\n *: ; link mass");
        let said = |text: &str| said(&known, &[], text);
        assert_eq!(said("<robot><drawn><x><color/></x></drawn><tool><link/></tool></robot>"), "");
        assert_eq!(said("<robot><drawn><tool><link/></tool></drawn></robot>"), "");
        let inside = "<robot><drawn><x>\n<mass/></x></drawn></robot>";
        assert_eq!(said(inside), "<string>:2: <mass>: misplaced element <mass> in <x>");
    }

    #[test]
    fn prefixes() {
        let extended = Known::new("robot: p:size ; p:link link");
        let plain = Known::new("robot: size ; link");
        let said = |known: &Known, text: &str| said(known, &[], text);
        assert_eq!(said(&extended, "<robot p:size='1' other:x='1'><p:link/><other:y/></robot>"), "");
        let near = "<string>:1: <p:lnk>: unknown element <p:lnk> in <robot>; nearest is `p:link`";
        assert_eq!(said(&extended, "<robot><p:lnk/></robot>"), near);
        let near = "<string>:1: <robot>: unknown attribute `p:siz`; nearest is `p:size`";
        assert_eq!(said(&extended, "<robot p:siz='1'/>"), near);
        let local = "<string>:1: <other:link>: unknown element <other:link> in <robot>; nearest is `link`";
        assert_eq!(said(&plain, "<robot><other:link/></robot>"), local);
        assert_eq!(said(&plain, "<robot xsi:schemaLocation='x'/>"), "");
    }
}
