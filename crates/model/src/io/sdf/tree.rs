//! Spanning tree of the graph of links and joints of an SDF.

use super::scopes::{Place, Scopes};
use crate::error::Error;
use crate::io::xml::Element;
use std::collections::{HashMap, HashSet, VecDeque};

/// Types of joints that connect two links. A gearbox only couples two other joints, so it is not in this list.
const KINDS: [&str; 8] = ["fixed", "revolute", "continuous", "prismatic", "screw", "ball", "universal", "revolute2"];
/// Type of joint that only couples two other joints.
pub(super) const GEARBOX: &str = "gearbox";

/// Joint, and the two links that it connects. `None` stands for the world.
#[derive(Clone)]
pub(super) struct Edge<'a> {
    pub(super) element: &'a Element,
    pub(super) item: usize,
    /// Type of the joint in lower case.
    pub(super) kind: String,
    pub(super) parent: Place,
    pub(super) child: usize,
}

impl<'a> Edge<'a> {
    /// Reads a joint of the file.
    pub(super) fn new(scopes: &mut Scopes<'a>, item: usize) -> Result<Self, Error> {
        let element = scopes.items[item].element;
        let kind = element.attribute("type").ok_or_else(|| element.wrong("has no type"));
        let (parent, child) = (scopes.link(item, "parent")?, scopes.link(item, "child")?);
        let kind = kind?.trim().to_ascii_lowercase();
        if kind != GEARBOX && !KINDS.contains(&&*kind) {
            let known = KINDS.join(", ");
            return Err(
                element.wrong(format!("joints of type `{kind}` are not supported; known are {known} and {GEARBOX}"))
            );
        }
        let Some(child) = child else { return Err(element.wrong("its child is the world")) };
        if parent == Some(child) {
            let what = format!("its parent and its child are one link, `{}`", scopes.name(child));
            return Err(element.wrong(what));
        }
        Ok(Self { element, item, kind, parent, child })
    }
}

/// Spanning tree, and the joints that close loops.
#[derive(Default)]
pub(super) struct Tree {
    /// Root links, which no joint carries. Each root link is the root of its own tree.
    pub(super) roots: Vec<usize>,
    /// Joints that each link or the world carries, and whether each joint is reversed. A reversed joint is carried by
    /// its child link and carries its parent link.
    pub(super) on: HashMap<Place, Vec<(usize, bool)>>,
    /// Joints that close loops.
    pub(super) loops: Vec<usize>,
}

impl Tree {
    /// Visits the joints breadth first, in the order of the file: first from the world and the links fixed to it, then
    /// from each link that is not the child of a joint. A joint is visited from its child link only if its parent link
    /// cannot be reached in another way.
    pub(super) fn new(edges: &[Edge], links: &[usize], fixed: &[usize]) -> Self {
        let (mut below, mut above): (HashMap<Place, Vec<usize>>, HashMap<usize, Vec<usize>>) = Default::default();
        for (i, edge) in edges.iter().enumerate() {
            below.entry(edge.parent).or_default().push(i);
            above.entry(edge.child).or_default().push(i);
        }
        let mut tree = Self::default();
        let mut line: VecDeque<Place> = [None].into_iter().chain(fixed.iter().map(|&link| Some(link))).collect();
        let mut reached: HashSet<Place> = line.iter().copied().collect();
        let (mut walked, mut backwards) = (vec![false; edges.len()], VecDeque::new());
        let (mut heads, mut rest) = (links.iter().filter(|l| !above.contains_key(l)), links.iter());
        loop {
            while let Some(at) = line.pop_front() {
                for &i in below.get(&at).into_iter().flatten().filter(|&&i| !walked[i]) {
                    if !reached.insert(Some(edges[i].child)) {
                        tree.loops.push(i);
                        continue;
                    }
                    line.push_back(Some(edges[i].child));
                    tree.on.entry(at).or_default().push((i, false));
                }
                backwards.extend(at.and_then(|link| above.get(&link)).into_iter().flatten());
            }
            let found = std::iter::from_fn(|| backwards.pop_front()).find(|&&i| !reached.contains(&edges[i].parent));
            if let Some(&i) = found {
                let Edge { parent, child, .. } = edges[i];
                walked[i] = true;
                reached.insert(parent);
                line.push_back(parent);
                tree.on.entry(Some(child)).or_default().push((i, true));
                continue;
            }
            let mut new = |l: &&usize| !reached.contains(&Some(**l));
            let Some(&root) = heads.find(&mut new).or_else(|| rest.find(&mut new)) else { return tree };
            reached.insert(Some(root));
            tree.roots.push(root);
            line.push_back(Some(root));
        }
    }
}
