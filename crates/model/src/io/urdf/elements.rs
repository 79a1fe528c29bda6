//! Children and attributes of elements. Error messages name the link or joint (`of`), and the line number of the
//! element inside it. If a tag occurs several times, the first element counts, as in urdfdom; [`check_repeated`] adds
//! warnings about the other elements.

use crate::error::Error;
use crate::io::xml::{self, Element};
use crate::warning::Warning;
use condyle_spatial::Vec3;

/// Adds a warning if an element has a second child with the same tag, unless both children are equal.
pub(super) fn check_repeated(of: &Element, element: &Element, warnings: &mut Vec<Warning>) {
    for tag in REPEATED {
        let mut all = element.all(tag);
        if let Some(first) = all.next()
            && let Some(other) = all.find(|other| !is_equal(first, other))
        {
            warnings.push(of.left_out_inside(other, format!("a second <{tag}> is left out")));
        }
    }
}

/// Tags of elements that occur only once in a link, joint or inertia.
const REPEATED: [&str; 12] = [
    "inertial",
    "origin",
    "mass",
    "inertia",
    "parent",
    "child",
    "axis",
    "limit",
    "dynamics",
    "mimic",
    "safety_controller",
    "calibration",
];

/// Returns whether two elements have the same tag, attributes and children.
fn is_equal(a: &Element, b: &Element) -> bool {
    let children = || a.children.iter().zip(&b.children).all(|(a, b)| is_equal(a, b));
    (&a.tag, &a.attributes) == (&b.tag, &b.attributes) && a.children.len() == b.children.len() && children()
}

/// Returns the child with a given tag, or an error if it is missing.
pub(super) fn needed<'a>(of: &'a Element, tag: &str) -> Result<&'a Element, Error> {
    of.child(tag).ok_or_else(|| of.lacks(tag))
}

/// Returns the text of an attribute, or an error if the attribute is missing.
pub(super) fn text<'a>(of: &Element, inside: &'a Element, name: &str) -> Result<&'a str, Error> {
    inside.attribute(name).ok_or_else(|| lacks(of, inside, name))
}

/// Returns the error that an attribute is missing.
pub(super) fn lacks(of: &Element, inside: &Element, name: &str) -> Error {
    of.wrong_inside(inside, format!("{} {}", inside.tag, inside.missing(name)))
}

/// Converts the value of an attribute with `f`. Returns `None` if the attribute is missing. Error messages name the
/// attribute and its value.
pub(super) fn read<T>(
    of: &Element,
    inside: &Element,
    name: &str,
    f: impl Fn(&str) -> Result<T, String>,
) -> Result<Option<T>, Error> {
    let wrong = |what| of.wrong_inside(inside, format!("{} {name}: {what}", inside.tag));
    inside.attribute(name).map(f).transpose().map_err(wrong)
}

/// Returns the numbers of an attribute; `None` if the attribute is missing.
pub(super) fn array<const N: usize>(of: &Element, inside: &Element, name: &str) -> Result<Option<[f64; N]>, Error> {
    read(of, inside, name, xml::array)
}

/// Returns the vector of an attribute; `None` if the attribute is missing.
pub(super) fn vector(of: &Element, inside: &Element, name: &str) -> Result<Option<Vec3<f64>>, Error> {
    Ok(array(of, inside, name)?.map(Vec3::from))
}
