//! Copies of a robot with an additional frame.

use crate::body::{Frame, FrameKind, FrameParent};
use crate::error::Error;
use crate::model::Model;
use crate::validate::check_frame;
use alloc::borrow::ToOwned;
use alloc::string::String;
use condyle_spatial::Se3;

impl Model {
    /// Returns the same robot with an additional frame of the user. The new frame is the last frame in
    /// [`frames`](Self::frames).
    ///
    /// `parent` is the body or frame to which the new frame is attached, or its name. `placement` is pXf, the pose of
    /// the new frame in the parent's frame. All indices of bodies, frames and coordinates are kept, so scratch memory
    /// for this robot also fits the new robot. Objects that were created from frames, such as a constraint set, do not
    /// fit the new robot.
    ///
    /// ```
    /// use condyle_model::{FrameParent, Se3, Vec3, robots};
    /// let at = Se3 { translation: Vec3::new(0.0, 0.0, 0.1), ..Se3::identity() };
    /// let arm = robots::arm7().with_frame("tip", "tool", at)?.with_frame("elbow", FrameParent::Body(4), at)?;
    /// let (tip, tool) = (&arm.frames()[arm.frame("tip")?], &arm.frames()[arm.frame("tool")?]);
    /// assert_eq!((tip.body, tip.placement), (tool.body, tool.placement * at));
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::UnknownFrame`] if the parent is a name that neither a frame nor a body has. Returns
    /// [`Error::Frame`] if the parent's index is too large, the name is empty, or the placement is invalid or not
    /// finite. Returns [`Error::Duplicate`] if a frame already has this name, because [`frame`](Self::frame) would not
    /// find the new frame.
    pub fn with_frame<'a>(
        &self,
        name: &str,
        parent: impl Into<FrameParent<'a>>,
        placement: Se3<f64>,
    ) -> Result<Self, Error> {
        let wrong = |what: String| Error::Frame { frame: name.to_owned(), what };
        let (body, bXp) = self.frame_parent(parent.into(), wrong)?;
        let mut frame = Frame { name: name.to_owned(), kind: FrameKind::User, body, placement };
        check_frame(&frame)?;
        if name.is_empty() {
            return Err(wrong("a frame without a name cannot be found".to_owned()));
        }
        if self.frames.iter().any(|f| f.name == name) {
            return Err(Error::Duplicate { kind: "frame", name: name.to_owned() });
        }
        frame.placement = bXp * placement;
        let mut model = self.clone();
        model.frames.push(frame);
        model.validate()?;
        model.geometry = model.hash_geometry();
        Ok(model)
    }

    /// Returns the body to which a parent belongs, and the pose of the parent's frame in the body's frame.
    fn frame_parent(
        &self,
        parent: FrameParent<'_>,
        wrong: impl Fn(String) -> Error,
    ) -> Result<(usize, Se3<f64>), Error> {
        let on = |frame: usize| (self.frames[frame].body, self.frames[frame].placement);
        let (bodies, frames) = (self.bodies.len(), self.frames.len());
        match parent {
            FrameParent::Body(body) if body < bodies => Ok((body, Se3::identity())),
            FrameParent::Body(body) => Err(wrong(format!("there is no body {body}: the model has {bodies}"))),
            FrameParent::Frame(frame) if frame < frames => Ok(on(frame)),
            FrameParent::Frame(frame) => Err(wrong(format!("there is no frame {frame}: the model has {frames}"))),
            FrameParent::Named(name) => self.frame(name).map(on).or_else(|unknown| {
                let body = self.bodies.iter().position(|body| body.name == name);
                body.map(|body| (body, Se3::identity())).ok_or(unknown)
            }),
        }
    }
}
