//! Names and poses of an SDF. Each model is a scope. Names in a scope are relative to its model, for example
//! `inner::link` for a link of a nested model. Poses in a scope are relative to the frame of its model.

use super::convert::MODEL;
use super::values::{flag, text};
use crate::error::Error;
use crate::io::xml::Element;
use crate::names::{near, nearest};
use condyle_spatial::Se3;
use std::collections::HashMap;

/// Name with which each scope refers to the world.
pub(super) const WORLD_LINK: &str = "world";
/// Attribute that marks a model included with `<include merge="true">`. The elements of such a model belong to the
/// enclosing scope.
pub(super) const MERGED: &str = "__merge__";
/// Maximum size of all full names together (bytes). The full name of an item contains the names of all models around
/// the item.
const MAX_NAMES: usize = 64 << 20;
/// Index of the scope of the world.
pub(super) const WORLD_SCOPE: usize = 0;

/// Scope: a model, or the world.
pub(super) struct Scope<'a> {
    element: &'a Element,
    /// Prefix of the names in the scope, for example `robot::arm::`.
    prefix: String,
    /// Index of the item that is the model of this scope; `None` for the world.
    pub(super) own: Option<usize>,
    /// Index of the enclosing scope.
    pub(super) parent: usize,
    /// Number of scopes around this scope.
    pub(super) depth: usize,
    /// Whether the links of the scope are fixed to the world, because the model or a model around it is static.
    is_static: bool,
    /// First link and first model of the scope, as indices of items.
    first: [Option<usize>; 2],
}

/// Item of an SDF: link, joint, frame or model.
pub(super) struct Item<'a> {
    pub(super) element: &'a Element,
    /// Scope that contains the item.
    pub(super) scope: usize,
    /// Full name, which begins with the names of the models around the item.
    name: String,
    /// Index of the scope of the item itself, if the item is a model.
    pub(super) inside: Option<usize>,
    /// Pose of the item in the frame of its scope.
    pub(super) pose: Se3<f64>,
}

/// Names and poses of a robot.
pub(super) struct Scopes<'a> {
    pub(super) scopes: Vec<Scope<'a>>,
    pub(super) items: Vec<Item<'a>>,
    names: HashMap<String, usize>,
    joints: HashMap<String, usize>,
    bytes: usize,
    /// Prefix that is removed from all names: the name of the model, if a file has only one model.
    single: String,
    /// Links to which items are attached, by index of the item; `None` is the world. Entries are computed when they are
    /// first needed.
    attached: HashMap<usize, Option<usize>>,
}

/// Index of an item with a pose; `None` is the world.
pub(super) type Place = Option<usize>;

impl<'a> Scopes<'a> {
    /// Collects the names in models and in the world around these models, and computes the poses.
    pub(super) fn new(world: &'a Element, models: &[&'a Element]) -> Result<Self, Error> {
        let mut scopes = Self {
            scopes: Vec::new(),
            items: Vec::new(),
            names: HashMap::new(),
            joints: HashMap::new(),
            bytes: 0,
            single: String::new(),
            attached: HashMap::new(),
        };
        let scope = Scope {
            element: world,
            prefix: String::new(),
            own: None,
            parent: 0,
            depth: 0,
            is_static: false,
            first: [None; 2],
        };
        scopes.scopes.push(scope);
        for model in models {
            scopes.model(model, WORLD_SCOPE)?;
        }
        for child in world.children.iter().filter(|c| matches!(&*c.tag, "joint" | "frame")) {
            scopes.insert(child, WORLD_SCOPE)?;
        }
        if let [model] = models {
            let single = format!("{}::", model.attribute("name").unwrap_or_default());
            // Keeps the prefix if a name without the prefix would equal the name of an item of the world.
            let mut in_world = scopes.items.iter().filter(|item| item.scope == WORLD_SCOPE && item.inside.is_none());
            if !in_world.any(|item| scopes.names.contains_key(&format!("{single}{}", item.name))) {
                scopes.single = single;
            }
        }
        scopes.resolve()?;
        Ok(scopes)
    }

    /// Adds a model and everything in it.
    fn model(&mut self, element: &'a Element, parent: usize) -> Result<(), Error> {
        let own = self.insert(element, parent)?;
        let is_merged = element.attribute(MERGED).is_some();
        let around = &self.scopes[parent];
        let prefix = if is_merged { around.prefix.clone() } else { format!("{}::", self.items[own].name) };
        let is_static = flag(element, "static", false)? && !is_merged || around.is_static;
        let (scope, depth) = (self.scopes.len(), around.depth + 1);
        self.items[own].inside = Some(scope);
        self.scopes.push(Scope { element, prefix, own: Some(own), parent, depth, is_static, first: [None; 2] });
        for child in &element.children {
            match &*child.tag {
                "model" => self.model(child, scope)?,
                "link" | "joint" | "frame" => drop(self.insert(child, scope)?),
                "drake:joint" => {
                    let kind = child.attribute("type").unwrap_or_default();
                    return Err(child.wrong(format!("joints of Drake's own are not supported: `{kind}`")));
                }
                _ => {}
            }
        }
        if self.scopes[scope].first == [None; 2] && !is_static {
            return Err(element.wrong("has no links"));
        }
        Ok(())
    }

    /// Adds an item to a scope.
    fn insert(&mut self, element: &'a Element, scope: usize) -> Result<usize, Error> {
        let name = element.attribute("name").filter(|n| !n.is_empty()).ok_or_else(|| element.lacks("name"))?;
        if [WORLD_LINK, MODEL].contains(&name) {
            return Err(element.wrong("the name belongs to SDF"));
        }
        let prefix = &self.scopes[scope].prefix;
        let full = match element.attribute(MERGED) {
            Some(_) => format!("{prefix}_merged__{name}{MODEL}"),
            None => format!("{prefix}{name}"),
        };
        self.bytes += full.len();
        if self.bytes > MAX_NAMES {
            let what =
                format!("names of nested models have {} bytes so far, at most {MAX_NAMES} are allowed", self.bytes);
            return Err(element.wrong(what));
        }
        let index = self.items.len();
        let tag = &*element.tag;
        if let Some(&other) = self.names.get(&full) {
            // Up to SDF 1.6, a link and a joint may have the same name. The name then refers to the link.
            let found = self.items[other].element;
            if found.tag == tag || ![tag, &found.tag].iter().any(|t| matches!(*t, "link" | "joint")) {
                let what = format!("the name is taken by the {} on line {}", found.tag, found.line);
                return Err(element.wrong(what));
            }
            if tag == "link" {
                self.names.insert(full.clone(), index);
            }
        } else {
            self.names.insert(full.clone(), index);
        }
        if tag == "joint" && self.joints.insert(full.clone(), index).is_some() {
            return Err(element.wrong("the name is taken by another joint"));
        }
        let first = &mut self.scopes[scope].first;
        match tag {
            "link" => first[0] = first[0].or(Some(index)),
            "model" => first[1] = first[1].or(Some(index)),
            _ => {}
        }
        self.items.push(Item { element, scope, name: full, inside: None, pose: Se3::identity() });
        Ok(index)
    }

    /// Returns the name that an item has in the resulting model.
    pub(super) fn name(&self, item: usize) -> &str {
        let name = &*self.items[item].name;
        name.strip_prefix(&self.single).unwrap_or(name)
    }

    /// Returns the indices of all items with a given tag, in the order of the file.
    pub(super) fn all(&self, tag: &'static str) -> impl Iterator<Item = usize> + '_ {
        self.items.iter().enumerate().filter(move |(_, item)| item.element.tag == tag).map(|(i, _)| i)
    }

    /// Returns whether an item is the frame of a merged model, or the frame of the only model of a file.
    pub(super) fn is_hidden(&self, item: usize) -> bool {
        self.items[item].element.attribute(MERGED).is_some()
            || self.single.strip_suffix("::") == Some(&self.items[item].name)
    }

    /// Returns whether the links in the scope of an item are fixed to the world.
    pub(super) fn is_static(&self, item: usize) -> bool {
        self.scopes[self.items[item].scope].is_static
    }

    /// Finds the item to which a name refers in the scope of another item.
    pub(super) fn find(&self, beside: usize, name: &str) -> Option<Place> {
        self.find_in(self.items[beside].scope, name)
    }

    /// Finds the joint to which a name refers in the scope of another item.
    pub(super) fn joint(&self, beside: usize, name: &str) -> Option<usize> {
        self.joints.get(&format!("{}{name}", self.scopes[self.items[beside].scope].prefix)).copied()
    }

    /// Returns the message that no joint has a given name in the scope of an item.
    pub(super) fn no_joint(&self, beside: usize, name: &str) -> String {
        format!("no joint is named `{name}`{}", self.near(self.items[beside].scope, name, "joint"))
    }

    pub(super) fn find_in(&self, scope: usize, name: &str) -> Option<Place> {
        match name {
            WORLD_LINK => return Some(None),
            MODEL => return Some(self.scopes[scope].own),
            _ => {}
        }
        let full = format!("{}{name}", self.scopes[scope].prefix);
        let get = |name: &str| self.names.get(name).copied();
        // The name may refer to the frame of a nested model: older files write `inner::__model__`.
        let inner = || full.strip_suffix(MODEL).and_then(|n| n.strip_suffix("::")).and_then(get);
        get(&full).or_else(inner).or_else(|| get(&format!("{full}::{MODEL}"))).map(Some)
    }

    /// Returns the end of a message about an unknown name: the nearest name among the items in a scope that have a
    /// given tag.
    pub(super) fn near(&self, scope: usize, name: &str, tag: &str) -> String {
        let prefix = &self.scopes[scope].prefix;
        let fits = |item: &&Item| tag.is_empty() || item.element.tag == tag;
        let mut names: Vec<&str> =
            self.items.iter().filter(fits).filter_map(|item| item.name.strip_prefix(prefix)).collect();
        names.sort_unstable();
        near(&nearest(name, names.into_iter()))
    }

    pub(super) fn missing(&self, beside: usize, name: &str) -> String {
        let near = self.near(self.items[beside].scope, name, "");
        format!("no link, joint or frame is named `{name}`{near}")
    }

    /// Returns the parent link or child link of a joint, which the file names directly or through frames; `None` is the
    /// world.
    pub(super) fn link(&mut self, joint: usize, tag: &str) -> Result<Place, Error> {
        let Item { element, scope, .. } = self.items[joint];
        let name = text(element, tag).ok_or_else(|| element.lacks(tag))?;
        match self.find_in(scope, name) {
            Some(at) => self.attached(at, element),
            None => Err(element.wrong(format!("no link is named `{name}`{}", self.near(scope, name, "link")))),
        }
    }

    /// Returns the link to which an item is attached; `None` is the world. Error messages name the element `of`.
    pub(super) fn attached(&mut self, at: Place, of: &Element) -> Result<Place, Error> {
        let (mut at, mut path) = (at, Vec::new());
        let link = loop {
            let Some(item) = at else { break None };
            if let Some(&known) = self.attached.get(&item) {
                break known;
            }
            if path.len() == self.items.len() {
                return Err(of.wrong("is attached to itself"));
            }
            path.push(item);
            let Item { element, scope, inside, .. } = self.items[item];
            let name = match (&*element.tag, inside) {
                ("link", _) => break Some(item),
                (_, Some(inside)) => {
                    let Scope { is_static, first: [link, model], element, .. } = self.scopes[inside];
                    match element.attribute("canonical_link").filter(|n| !n.is_empty()) {
                        _ if is_static => break None,
                        Some(name) => {
                            let found = self.find_in(inside, name);
                            let what = || {
                                format!("canonical_link: no link is named `{name}`{}", self.near(inside, name, "link"))
                            };
                            at = found.ok_or_else(|| element.wrong(what()))?;
                        }
                        None => at = link.or(model),
                    }
                    continue;
                }
                ("joint", _) => text(element, "child").unwrap_or_default(),
                _ => element.attribute("attached_to").filter(|a| !a.is_empty()).unwrap_or(MODEL),
            };
            at = self.find_in(scope, name).ok_or_else(|| {
                let near = self.near(scope, name, "");
                element.wrong(format!("attached to `{name}`, which is not there{near}"))
            })?;
        };
        self.attached.extend(path.into_iter().map(|item| (item, link)));
        Ok(link)
    }
}
