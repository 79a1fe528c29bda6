//! Attributes of MJCF elements, with the defaults of their classes.

use super::compiler::ORIENTATIONS;
use crate::error::Error;
use crate::io::xml::{self, Element};
use crate::names::{near, nearest};
use condyle_spatial::Vec3;
use std::collections::HashMap;
use std::rc::Rc;

/// Attributes of one kind of element in a class. Each attribute has one or more texts; the text of the innermost class
/// is the last. If a text has fewer numbers than the texts before it, only the first numbers are replaced.
type Inherited<'a> = HashMap<&'a str, Rc<[&'a str]>>;

/// Attributes of a class, by kind of element.
type Class<'a> = HashMap<&'a str, Inherited<'a>>;

/// Maximum number of attributes of all classes together, including inherited ones.
const MAX_INHERITED: usize = 1 << 20;

/// Name of the default class of elements without a class.
pub(super) const MAIN: &str = "main";

/// Default classes, each with the attributes that it inherits.
pub(super) struct Defaults<'a> {
    classes: HashMap<&'a str, Class<'a>>,
    /// Size of all classes: the number of their attribute texts plus the number of their kinds of elements.
    size: usize,
}

impl<'a> Defaults<'a> {
    pub(super) fn read(root: &'a Element) -> Result<Self, Error> {
        let mut defaults = Self { classes: HashMap::from([(MAIN, Class::new())]), size: 0 };
        for element in root.all("default") {
            let name = element.attribute("class").unwrap_or(MAIN);
            if name != MAIN {
                return Err(element.wrong(format!("the outermost class is `{MAIN}`, not `{name}`")));
            }
            let main = defaults.classes.remove(MAIN).unwrap_or_default();
            defaults.add(element, MAIN, main)?;
        }
        Ok(defaults)
    }

    /// Adds a class and its nested classes. `class` contains the attributes that the class inherits.
    fn add(&mut self, element: &'a Element, name: &'a str, mut class: Class<'a>) -> Result<(), Error> {
        for kind in element.children.iter().filter(|c| c.tag != "default") {
            let inherited = class.entry(&kind.tag).or_default();
            if ORIENTATIONS.iter().any(|name| kind.attribute(name).is_some()) {
                // A new orientation replaces all inherited orientations.
                inherited.retain(|name, _| !ORIENTATIONS.contains(name));
            }
            for (name, value) in &kind.attributes {
                let count = value.split_whitespace().count();
                let before = inherited.get(&**name).into_iter().flat_map(|texts| texts.iter().copied());
                let longer = before.filter(|text| text.split_whitespace().nth(count).is_some());
                let texts = longer.chain([&**value]).collect();
                inherited.insert(name, texts);
            }
        }
        let size = |inherited: &Inherited| 1 + inherited.values().map(|texts| texts.len()).sum::<usize>();
        self.size += class.values().map(size).sum::<usize>();
        if self.size > MAX_INHERITED {
            let what = "attributes of default classes so far, what they inherit included";
            return Err(element.wrong(format!("{} {what}: at most {MAX_INHERITED} are allowed", self.size)));
        }
        if self.classes.insert(name, class.clone()).is_some() {
            return Err(element.wrong(format!("there are two classes `{name}`")));
        }
        for inner in element.all("default") {
            let name = inner.attribute("class").ok_or_else(|| inner.lacks("class"))?;
            self.add(inner, name, class.clone())?;
        }
        Ok(())
    }

    /// Returns the element with the defaults of its class. If the element names no class, the class of the surrounding
    /// element is used.
    pub(super) fn of<'e>(&'e self, element: &'e Element, around: &'e str) -> Result<Attributes<'e>, Error> {
        let name = self.known(element, element.attribute("class").unwrap_or(around))?;
        Ok(Attributes { element, class: self.classes[name].get(element.tag.as_str()) })
    }

    /// Returns the attributes of an element, with the defaults that its class has for another kind of element.
    pub(super) fn of_kind<'e>(
        &'e self,
        element: &'e Element,
        kind: &str,
        around: &'e str,
    ) -> Result<Attributes<'e>, Error> {
        let name = self.known(element, element.attribute("class").unwrap_or(around))?;
        Ok(Attributes { element, class: self.classes[name].get(kind) })
    }

    /// Returns the name of a class if this class exists, otherwise an error.
    pub(super) fn known<'e>(&self, element: &Element, name: &'e str) -> Result<&'e str, Error> {
        if self.classes.contains_key(name) {
            return Ok(name);
        }
        let mut names: Vec<&str> = self.classes.keys().copied().collect();
        names.sort_unstable();
        let near = near(&nearest(name, names.into_iter()));
        Err(element.wrong(format!("no default class is named `{name}`{near}")))
    }
}

/// Attributes of an element. An attribute that the element does not have is taken from its class.
pub(super) struct Attributes<'a> {
    pub(super) element: &'a Element,
    class: Option<&'a Inherited<'a>>,
}

impl<'a> Attributes<'a> {
    /// Returns the attributes of an element without a class.
    pub(super) fn plain(element: &'a Element) -> Self {
        Self { element, class: None }
    }

    pub(super) fn get(&self, name: &str) -> Option<&'a str> {
        self.element.attribute(name).or_else(|| self.class?.get(name)?.last().copied())
    }

    /// Returns the texts of an attribute; the texts of the class come first. Each text may replace only the first
    /// numbers of a list.
    pub(super) fn layers(&self, name: &str) -> impl Iterator<Item = &'a str> + use<'a> {
        let class = self.class.and_then(|class| class.get(name));
        class.into_iter().flat_map(|texts| texts.iter().copied()).chain(self.element.attribute(name))
    }

    /// Converts the value of an attribute with `f`. Returns `None` if the attribute is missing.
    fn read<T>(&self, name: &str, f: impl Fn(&str) -> Result<T, String>) -> Result<Option<T>, Error> {
        let read = |text| f(text).map_err(|what| self.element.wrong(format!("{name}: {what}")));
        self.get(name).map(read).transpose()
    }

    pub(super) fn array<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, Error> {
        self.read(name, xml::array)
    }

    pub(super) fn list(&self, name: &str) -> Result<Option<Vec<f64>>, Error> {
        self.read(name, xml::numbers)
    }

    pub(super) fn number(&self, name: &str) -> Result<Option<f64>, Error> {
        Ok(self.array(name)?.map(|[x]| x))
    }

    pub(super) fn vector(&self, name: &str) -> Result<Option<Vec3<f64>>, Error> {
        Ok(self.array(name)?.map(Vec3::from))
    }

    /// Returns `true` or `false`; `None` if the attribute is missing or has the value `third`.
    pub(super) fn flag(&self, name: &str, third: Option<&str>) -> Result<Option<bool>, Error> {
        let flag = |text: &str| match text {
            "true" => Ok(Some(true)),
            "false" => Ok(Some(false)),
            _ if Some(text) == third => Ok(None),
            _ => Err(format!("`{text}` is neither true nor false")),
        };
        Ok(self.read(name, flag)?.flatten())
    }
}
