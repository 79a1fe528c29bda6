//! Feet of a robot: found from the shape of the robot, or named by the user.

use super::solids::Solid;
use crate::error::Error;
use condyle::mpc::{Foot, FootShape};
use condyle::tree::FrameParent;
use condyle::{Data, Model, Se3, Vec3, forward_kinematics, spatial::Act};

/// Height up to which the outermost body of a limb counts as a foot, relative to the height of the trunk.
const LOW: f64 = 0.15;
/// Distance from the lowest point within which a point of a shape touches the ground (m).
const FLAT: f64 = 1.5e-3;
/// Smallest side lengths of a sole (m). A smaller contact area counts as a ball.
const SOLE: [f64; 2] = [0.03, 0.02];
/// Distance within which an existing frame is used as the centre of a foot (m).
const NEAR: f64 = 1.5e-3;
/// Smallest and largest number of feet.
const NUMBERS: std::ops::RangeInclusive<usize> = 2..=16;

/// Shape that the user gives to all feet.
#[derive(Clone, Copy)]
pub(crate) enum Given {
    /// None: the shape comes from the robot's file.
    Nothing,
    Radius(f64),
    Sole([f64; 2]),
}

/// Foot of a robot, and the origin of its description.
pub(crate) struct FoundFoot {
    pub foot: Foot,
    /// Index of the foot's frame.
    pub frame: usize,
    /// Source of the foot's shape, for the report.
    pub source: String,
}

impl FoundFoot {
    /// Returns the height of the frame's origin above the ground, while the foot stands (m).
    pub(crate) fn height(&self) -> f64 {
        match self.foot.shape {
            FootShape::Point { radius } => radius,
            FootShape::Sole { .. } => 0.0,
        }
    }

    /// Returns the side lengths of a sole (m); `None` for a ball.
    pub(crate) fn sole(&self) -> Option<[f64; 2]> {
        match self.foot.shape {
            FootShape::Point { .. } => None,
            FootShape::Sole { size } => Some(size),
        }
    }

    /// Returns a description of the shape.
    pub(crate) fn shape(&self) -> String {
        let mm = |x: f64| format!("{:.0}", 1e3 * x);
        match self.foot.shape {
            FootShape::Point { radius } => format!("ball of radius {} mm", mm(radius)),
            FootShape::Sole { size: [x, y] } => format!("sole of {} × {} mm", mm(x), mm(y)),
        }
    }
}

/// Outermost body of a limb.
struct Leaf {
    body: usize,
    /// Height of the lowest point of the shapes and frames of the body (m).
    lowest: f64,
}

/// Returns the outermost bodies of all limbs, the lowest first, and the height of the trunk. `q` is the stand.
fn leaves(model: &Model, solids: &[Solid], q: &[f64]) -> (Vec<Leaf>, f64) {
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let bodies = model.bodies();
    let mut is_leaf = vec![true; bodies.len()];
    bodies[1..].iter().for_each(|body| is_leaf[body.parent] = false);
    let lowest = |body: usize| {
        let solids = solids.iter().filter(|solid| solid.body == body).map(|solid| solid.lowest(placements.body(body)));
        let frames = (0..model.frames().len()).filter(|&f| model.frames()[f].body == body);
        let frames = frames.map(|frame| placements.frame(frame).translation.z);
        solids.chain(frames).fold(placements.body(body).translation.z, f64::min)
    };
    let mut leaves: Vec<Leaf> =
        (2..bodies.len()).filter(|&b| is_leaf[b]).map(|body| Leaf { body, lowest: lowest(body) }).collect();
    leaves.sort_by(|a, b| a.lowest.total_cmp(&b.lowest));
    (leaves, placements.body(1).translation.z)
}

/// Finds the feet: the outermost bodies of limbs that are lowest in the stand q. Returns the robot, with a frame in the
/// centre of each foot, and the feet in the order of the robot's bodies.
pub(crate) fn find(
    model: &Model,
    solids: &[Solid],
    q: &[f64],
    given: Given,
    friction: f64,
) -> Result<(Model, Vec<FoundFoot>), Error> {
    let (leaves, trunk) = leaves(model, solids, q);
    let lowest = leaves.first().map_or(trunk, |leaf| leaf.lowest);
    let low = lowest + LOW * (trunk - lowest).max(0.0);
    let mut bodies: Vec<usize> = leaves.iter().filter(|leaf| leaf.lowest <= low).map(|leaf| leaf.body).collect();
    bodies.sort_unstable();
    if !NUMBERS.contains(&bodies.len()) {
        let list = |leaf: &Leaf| format!("`{}` at {:+.2} m", frame_of(model, solids, leaf.body), leaf.lowest - trunk);
        let list: Vec<String> = leaves.iter().take(12).map(list).collect();
        let list = if list.is_empty() { "none".to_owned() } else { list.join(", ") };
        let what = match bodies.len() {
            1 => "only one limb ends at the height of the ground".to_owned(),
            0 => "the robot has no limbs".to_owned(),
            n => format!("{n} limbs end at the height of the ground"),
        };
        return Err(Error::Option {
            option: "feet",
            what: format!("missing, because {what}; ends of limbs, relative to the trunk: {list}"),
        });
    }
    let (mut model, mut feet) = (model.clone(), Vec::new());
    for body in bodies {
        let link = frame_of(&model, solids, body);
        let (next, foot) = describe(model, solids, q, &link, given, friction)?;
        model = next;
        feet.push(foot);
    }
    Ok((model, feet))
}

/// Returns the feet with the given frames. The robot may get new frames in the centres of the feet.
pub(crate) fn named(
    model: &Model,
    solids: &[Solid],
    q: &[f64],
    names: &[String],
    given: Given,
    friction: f64,
) -> Result<(Model, Vec<FoundFoot>), Error> {
    let (mut model, mut feet) = (model.clone(), Vec::new());
    for name in names {
        let (next, foot) = describe(model, solids, q, name.trim(), given, friction)?;
        model = next;
        feet.push(foot);
    }
    Ok((model, feet))
}

/// Returns the name of the link with the lowest shape of a body. Without shapes, returns the lowest frame of the body.
fn frame_of(model: &Model, solids: &[Solid], body: usize) -> String {
    let q = condyle::neutral(model);
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, &q);
    let own = solids.iter().filter(|solid| solid.body == body);
    let lowest = own.min_by(|a, b| {
        let [a, b] = [a, b].map(|solid| solid.lowest(placements.body(body)));
        a.total_cmp(&b)
    });
    if let Some(solid) = lowest {
        return solid.link.clone();
    }
    let frames = (0..model.frames().len()).filter(|&f| model.frames()[f].body == body);
    let height = |&f: &usize| placements.frame(f).translation.z;
    let lowest = frames.rev().min_by(|a, b| height(a).total_cmp(&height(b)));
    lowest.map_or_else(|| model.bodies()[body].name.clone(), |f| model.frames()[f].name.clone())
}

/// Area of a body that touches the ground.
struct Patch {
    /// Middle of the area, or the centre of a ball.
    centre: Vec3<f64>,
    shape: FootShape,
}

/// Returns the area of a body's shapes that touches the ground in the pose `at` of the body. `origin` is the origin of
/// the foot's frame in the world.
fn patch(solids: &[&Solid], at: Se3<f64>, origin: Vec3<f64>) -> Option<Patch> {
    let low = solids.iter().map(|solid| solid.lowest(at)).min_by(f64::total_cmp)?;
    let touching = solids.iter().flat_map(|solid| solid.points.iter().map(|&point| (at.act(point), solid.radius)));
    let touching: Vec<_> = touching.filter(|(point, radius)| point.z - radius <= low + FLAT).collect();
    let fold = |f: fn(f64, f64) -> f64, of: fn(&Vec3<f64>) -> f64, start| {
        touching.iter().map(|(point, _)| of(point)).fold(start, f)
    };
    let [x, y] = [(|p: &Vec3<f64>| p.x) as fn(&Vec3<f64>) -> f64, |p| p.y]
        .map(|of| [fold(f64::min, of, f64::INFINITY), fold(f64::max, of, f64::NEG_INFINITY)]);
    let (size, middle) = ([x[1] - x[0], y[1] - y[0]], [0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])]);
    if size[0] >= SOLE[0] && size[1] >= SOLE[1] {
        return Some(Patch { centre: Vec3::new(middle[0], middle[1], low), shape: FootShape::Sole { size } });
    }
    // The centre of a sphere is known. The centre of a mesh is assumed in the frame, if the frame is above the point
    // that touches.
    let radius = touching[0].1;
    let is_above = (origin.x - middle[0]).abs() + (origin.y - middle[1]).abs() < 0.3 * (origin.z - low);
    let (z, radius) = match radius > 0.0 {
        true => (low + radius, radius),
        false if is_above => return Some(Patch { centre: origin, shape: FootShape::Point { radius: origin.z - low } }),
        false => (low, 0.0),
    };
    Some(Patch { centre: Vec3::new(middle[0], middle[1], z), shape: FootShape::Point { radius } })
}

/// Returns the foot at a frame. The shape is the given one, or comes from the collision shapes of the frame's body.
fn describe(
    model: Model,
    solids: &[Solid],
    q: &[f64],
    name: &str,
    given: Given,
    friction: f64,
) -> Result<(Model, FoundFoot), Error> {
    let index = model.frame(name)?;
    let body = model.frames()[index].body;
    if body < 2 {
        let what = format!("`{name}` belongs to the trunk or to the world, so it cannot swing");
        return Err(Error::Option { option: "feet", what });
    }
    let mut data = Data::new(&model);
    let placements = forward_kinematics(&model, &mut data, q);
    let (at, origin) = (placements.body(body), placements.frame(index).translation);
    let own: Vec<&Solid> = solids.iter().filter(|solid| solid.body == body).collect();
    let of_link: Vec<&Solid> = own.iter().copied().filter(|solid| solid.link == name).collect();
    let found = patch(if of_link.is_empty() { &own } else { &of_link }, at, origin);
    let level = Patch { centre: origin, shape: FootShape::Point { radius: 0.0 } };
    let (patch, source) = match (given, found) {
        (Given::Radius(radius), _) => {
            (Patch { shape: FootShape::Point { radius }, ..level }, "given by --radius".to_owned())
        }
        (Given::Sole(size), Some(Patch { centre, shape: FootShape::Sole { .. } })) => {
            (Patch { centre, shape: FootShape::Sole { size } }, "given by --sole".to_owned())
        }
        (Given::Sole(size), _) => (Patch { shape: FootShape::Sole { size }, ..level }, "given by --sole".to_owned()),
        (Given::Nothing, Some(patch)) => (patch, "from the collision shapes".to_owned()),
        (Given::Nothing, None) => (level, "no collision shape; --radius or --sole gives another".to_owned()),
    };
    // In the stand, a sole has the axes of the trunk.
    let is_sole = matches!(patch.shape, FootShape::Sole { .. });
    let rotation = if is_sole { at.rotation.transpose() } else { condyle::spatial::Mat3::identity() };
    let placement = Se3 { rotation, translation: at.act_inv(patch.centre) };
    let fits = |f: &usize| {
        let frame = &model.frames()[*f];
        let far = (frame.placement.translation - placement.translation).norm();
        let turned = frame.placement.inverse() * placement;
        let is_turned = is_sole && (turned.rotation.z.z < 0.9999 || turned.rotation.x.x < 0.9999);
        frame.body == body && far <= NEAR && !is_turned
    };
    let existing = core::iter::once(index).chain(0..model.frames().len()).find(fits);
    let (model, frame) = match existing {
        Some(frame) => (model, frame),
        None => {
            let wanted = format!("{name}_centre");
            let free = (0..).map(|k| if k == 0 { wanted.clone() } else { format!("{wanted}_{k}") });
            let free = free.into_iter().find(|name| model.frame(name).is_err()).unwrap_or(wanted);
            let model = model.with_frame(&free, FrameParent::Body(body), placement)?;
            let frame = model.frames().len() - 1;
            (model, frame)
        }
    };
    let foot = Foot { frame: model.frames()[frame].name.clone(), friction, shape: patch.shape };
    Ok((model, FoundFoot { foot, frame, source }))
}
