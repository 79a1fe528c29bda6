//! Poses in an SDF: each pose is relative to an item with a name.

use super::convert::MODEL;
use super::scopes::{Item, Place, Scopes, WORLD_SCOPE};
use super::values::{pose, relative_to, text, three};
use crate::error::Error;
use condyle_spatial::{Se3, Vec3};

impl Scopes<'_> {
    /// Returns the item to which the pose of an item is relative.
    fn reference(&self, item: usize) -> Result<Place, Error> {
        let Item { element, scope, .. } = self.items[item];
        let otherwise = match &*element.tag {
            "joint" => text(element, "child").ok_or_else(|| element.wrong("has no child"))?,
            "frame" => element.attribute("attached_to").filter(|a| !a.is_empty()).unwrap_or(MODEL),
            _ => MODEL,
        };
        let name = relative_to(element).unwrap_or(otherwise);
        self.find_in(scope, name).ok_or_else(|| element.wrong(self.missing(item, name)))
    }

    /// Returns the frame that `placement_frame` names, and the scope of this frame; `None` if the attribute is missing.
    /// The pose in the file is then the pose of this frame, not the pose of the model's own frame.
    fn placement(&self, item: usize) -> Result<Option<(usize, usize)>, Error> {
        let Item { element, inside, .. } = self.items[item];
        let name = element.attribute("placement_frame").filter(|n| !n.is_empty());
        let (Some(name), Some(inside)) = (name, inside) else { return Ok(None) };
        match self.find_in(inside, name) {
            Some(Some(at)) => Ok(Some((at, inside))),
            _ => {
                let near = self.near(inside, name, "");
                Err(element.wrong(format!("placement_frame: no link, joint or frame is named `{name}`{near}")))
            }
        }
    }

    /// Computes all poses. Each pose is computed after the poses on which it depends.
    pub(super) fn resolve(&mut self) -> Result<(), Error> {
        // States of items: 0, not visited; 1, being visited; 2, the pose is known.
        let mut state = vec![0u8; self.items.len()];
        for first in 0..self.items.len() {
            let mut path = if state[first] == 0 { vec![(first, self.begin(first, &mut state)?)] } else { Vec::new() };
            while let Some((item, waits_for)) = path.last_mut() {
                let item = *item;
                match waits_for.pop() {
                    Some(next) if state[next] == 1 => {
                        return Err(self.items[item].element.wrong("its pose depends on itself"));
                    }
                    Some(next) if state[next] == 0 => {
                        let waits_for = self.begin(next, &mut state)?;
                        path.push((next, waits_for));
                    }
                    Some(_) => {}
                    None => {
                        self.items[item].pose = self.pose_of(item)?;
                        state[item] = 2;
                        path.pop();
                    }
                }
            }
        }
        Ok(())
    }

    /// Marks an item as being visited. Returns the items whose poses are needed to compute the pose of this item.
    fn begin(&self, item: usize, state: &mut [u8]) -> Result<Vec<usize>, Error> {
        state[item] = 1;
        let mut found = Vec::new();
        self.chain(self.reference(item)?, self.items[item].scope, &mut found);
        if let Some((at, inside)) = self.placement(item)? {
            self.chain(Some(at), inside, &mut found);
        }
        Ok(found)
    }

    fn pose_of(&self, item: usize) -> Result<Se3<f64>, Error> {
        let Item { element, scope, .. } = self.items[item];
        let own = pose(element, element)?;
        let placed = match self.reference(item)? {
            at if at == self.scopes[scope].own => own,
            at => self.in_scope(at, scope) * own,
        };
        Ok(match self.placement(item)? {
            Some((at, inside)) => placed * self.in_scope(Some(at), inside).inverse(), // sXm = sXp (mXp)⁻¹
            None => placed,
        })
    }

    /// Adds to `found` the items whose poses are needed to compute the pose of item `at` in the frame of a scope.
    fn chain(&self, at: Place, scope: usize, found: &mut Vec<usize>) {
        if at == self.scopes[scope].own {
            return;
        }
        found.extend(at);
        let up = |scope: usize, _: bool| found.extend(self.scopes[scope].own);
        self.climb(at, scope, up);
    }

    /// Visits the scopes on the path between the scope of an item and another scope, except their common ancestor.
    /// `visit` receives the index of a scope, and whether this scope contains the item.
    fn climb(&self, at: Place, scope: usize, mut visit: impl FnMut(usize, bool)) {
        let (mut a, mut b) = (at.map_or(WORLD_SCOPE, |item| self.items[item].scope), scope);
        while a != b {
            let is_items = self.scopes[a].depth >= self.scopes[b].depth;
            let next = if is_items { &mut a } else { &mut b };
            visit(*next, is_items);
            *next = self.scopes[*next].parent;
        }
    }

    /// Returns the pose of an item, or of the world, in the frame of a scope.
    pub(super) fn in_scope(&self, at: Place, scope: usize) -> Se3<f64> {
        if at == self.scopes[scope].own {
            return Se3::identity();
        }
        let mut X = at.map_or(Se3::identity(), |item| self.items[item].pose);
        let mut down: Option<Se3<f64>> = None;
        self.climb(at, scope, |around, is_items| {
            let own = self.scopes[around].own.map_or(Se3::identity(), |item| self.items[item].pose);
            if is_items {
                X = own * X;
            } else {
                down = Some(down.map_or(own, |Y| own * Y));
            }
        });
        down.map_or(X, |Y| Y.inverse() * X)
    }

    /// Returns the pose of an item in the world.
    pub(super) fn in_world(&self, item: usize) -> Se3<f64> {
        self.in_scope(Some(item), WORLD_SCOPE)
    }

    /// Returns cXj: the pose of a joint in its child link. If the file specifies this pose, the result has no rounding
    /// errors.
    pub(super) fn joint_in_child(&self, joint: usize, child: usize) -> Result<Se3<f64>, Error> {
        let Item { element, scope, pose: mXj, .. } = self.items[joint];
        match self.reference(joint)? {
            Some(at) if at == child => pose(element, element),
            _ => Ok(self.in_scope(Some(child), scope).inverse() * mXj),
        }
    }

    /// Reads the axis of a joint, in the joint's frame.
    pub(super) fn axis(&self, joint: usize, tag: &str) -> Result<Vec3<f64>, Error> {
        let Item { element, scope, pose: mXj, .. } = self.items[joint];
        let axis = element.child(tag).ok_or_else(|| element.wrong(format!("has no <{tag}>")))?;
        let Some(xyz) = axis.child("xyz") else { return Ok(Vec3::new(0.0, 0.0, 1.0)) };
        let v = if xyz.text.trim().is_empty() { Vec3::new(0.0, 0.0, 1.0) } else { three(element, xyz)? };
        let Some(frame) = xyz.attribute("expressed_in").filter(|f| !f.is_empty()) else { return Ok(v) };
        let Some(at) = self.find_in(scope, frame) else {
            let near = self.near(scope, frame, "");
            return Err(element.wrong(format!("{tag}: expressed in `{frame}`, which is not there{near}")));
        };
        Ok(mXj.rotation.transpose_mul(self.in_scope(at, scope).rotation * v))
    }
}
