//! Children and attributes of elements. Errors name the link or joint (`of`), and the line inside it.

use crate::error::Error;
use crate::io::xml::{self, Element};
use condyle_spatial::Vec3;

/// Returns the child with a tag. There is at most one, or others are equal to it.
pub(super) fn only<'a>(of: &'a Element, tag: &str) -> Result<Option<&'a Element>, Error> {
    only_inside(of, of, tag)
}

/// As [`only`], of something inside the link or joint that errors name.
pub(super) fn only_inside<'a>(of: &Element, inside: &'a Element, tag: &str) -> Result<Option<&'a Element>, Error> {
    let mut found = inside.children.iter().filter(|c| c.tag == tag);
    let first = found.next();
    match first.and_then(|first| found.find(|other| !is_equal(first, other))) {
        Some(second) => Err(of.wrong_inside(second, format!("has a second <{tag}>"))),
        None => Ok(first),
    }
}

/// Whether two elements say the same.
fn is_equal(a: &Element, b: &Element) -> bool {
    let children = || a.children.iter().zip(&b.children).all(|(a, b)| is_equal(a, b));
    (&a.tag, &a.attributes) == (&b.tag, &b.attributes) && a.children.len() == b.children.len() && children()
}

/// Returns the child with a tag, of which there is one.
pub(super) fn needed<'a>(of: &'a Element, tag: &str) -> Result<&'a Element, Error> {
    only(of, tag)?.ok_or_else(|| of.wrong(format!("has no <{tag}>")))
}

/// Returns the attribute, which must be there.
pub(super) fn text<'a>(of: &Element, inside: &'a Element, name: &str) -> Result<&'a str, Error> {
    inside.attribute(name).ok_or_else(|| of.wrong_inside(inside, format!("{} has no {name}", inside.tag)))
}

/// Returns the attribute as a reader of text understands it, if it is there. Errors name the attribute and its value.
pub(super) fn read<T>(
    of: &Element,
    inside: &Element,
    name: &str,
    f: impl Fn(&str) -> Result<T, String>,
) -> Result<Option<T>, Error> {
    let wrong = |what| of.wrong_inside(inside, format!("{} {name}: {what}", inside.tag));
    inside.attribute(name).map(f).transpose().map_err(wrong)
}

/// Returns the numbers of an attribute, if it is there.
pub(super) fn array<const N: usize>(of: &Element, inside: &Element, name: &str) -> Result<Option<[f64; N]>, Error> {
    read(of, inside, name, xml::array)
}

/// Returns the vector of an attribute, if it is there.
pub(super) fn vector(of: &Element, inside: &Element, name: &str) -> Result<Option<Vec3<f64>>, Error> {
    Ok(array(of, inside, name)?.map(Vec3::from))
}
