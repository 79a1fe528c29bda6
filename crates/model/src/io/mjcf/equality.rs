//! Equality constraints of MJCF: loops, and joints that follow others.

use super::Source;
use super::attributes::{Attributes, MAIN};
use super::spring::{Joints, Switches};
use crate::body::FrameKind;
use crate::builder::{BodyId, ModelBuilder};
use crate::error::Error;
use crate::io::xml::{Element, words};
use crate::joint::Mimic;
use crate::warning::Warning;
use condyle_spatial::{Quaternion, Se3, Vec3};
use std::collections::{HashMap, HashSet};

/// Body of the builder, and a pose in the frame of this body.
type At = (BodyId, Se3<f64>);

/// Bodies and sites of a file by name, and the poses of bodies in the initial configuration of the file.
struct Places<'p> {
    named: HashMap<(bool, String), At>,
    /// Pose of each body of the builder in the world.
    poses: &'p [Se3<f64>],
}

impl<'p> Places<'p> {
    fn new(builder: &ModelBuilder, poses: &'p [Se3<f64>]) -> Self {
        let bodies = builder.frames.iter().filter(|f| matches!(f.kind, FrameKind::Link | FrameKind::User));
        let at = |f: &crate::body::Frame| ((f.kind == FrameKind::Link, f.name.clone()), (BodyId(f.body), f.placement));
        Self { named: bodies.map(at).collect(), poses }
    }

    /// Returns the body or site that an attribute names.
    fn find(&self, e: &Element, attribute: &str) -> Result<Option<At>, Error> {
        let Some(name) = e.attribute(attribute) else { return Ok(None) };
        match self.named.get(&(attribute.starts_with("body"), name.to_owned())) {
            Some(&at) => Ok(Some(at)),
            None => Err(e.wrong(format!("{attribute}: no {} is named `{name}`", &attribute[..4]))),
        }
    }

    /// Converts a pose in a body's frame to a pose in the world, in the initial configuration of the file.
    fn drawn(&self, (BodyId(body), X): At) -> Se3<f64> {
        self.poses[body] * X
    }
}

/// Adds the constraints of a file to a builder, and returns warnings about constraints that are left out.
pub(super) fn add(
    builder: &mut ModelBuilder,
    root: &Element,
    sources: &[Source],
    joints: &Joints,
    poses: &[Se3<f64>],
    mimic: bool,
) -> Result<Vec<Warning>, Error> {
    let (mut warnings, mut followers) = (Vec::new(), Followers::default());
    let elements: Vec<_> = root.all("equality").flat_map(|section| &section.children).collect();
    if !Switches::read(root)?.equality {
        return Ok(warnings);
    }
    let places = Places::new(builder, poses);
    let mut names: HashSet<String> = super::names(elements.iter().copied())?.into_keys().map(str::to_owned).collect();
    let mut counts = HashMap::new();
    for e in elements {
        let a = sources[e.source].defaults.of_kind(e, "equality", MAIN)?;
        let count: &mut usize = counts.entry(&*e.tag).or_default();
        *count += 1;
        if a.flag("active", None)? == Some(false) {
            continue;
        }
        let mut name = e.attribute("name").map_or_else(|| format!("{}{count}", e.tag), str::to_owned);
        while e.attribute("name").is_none() && !names.insert(name.clone()) {
            name.push('_');
        }
        match e.tag.as_str() {
            "connect" | "weld" => {
                let ([first, second], rigid) = loop_ends(e, &places)?;
                if first.0 == second.0 {
                    warnings.push(e.left_out("both ends are fixed to one body, which no constraint can move"));
                } else if rigid {
                    builder.constraint_rigid(&name, [first, second]);
                } else {
                    builder.constraint_point(&name, [first, second]);
                }
            }
            "joint" => {
                let joint = |attribute: &str| {
                    let named = e.attribute(attribute).map(|name| joints.scalar(e, attribute, name));
                    Ok::<_, Error>(named.transpose()?.map(|j| (j, BodyId(joints.all[j].body), joints.all[j].reference)))
                };
                let (follower, leader) = (joint("joint1")?, joint("joint2")?);
                let Some((index, follower, y0)) = follower else { return Err(e.wrong("has no joint1")) };
                if leader.is_some_and(|(leader, ..)| leader == index) {
                    return Err(e.wrong("joint1 and joint2 are the same"));
                }
                let mut p = [0.0, 1.0, 0.0, 0.0, 0.0];
                super::law::fill(&Attributes::plain(e), "polycoef", &mut p)?;
                match (leader, p) {
                    (Some((leader, leads, x0)), [a0, a1, 0.0, 0.0, 0.0]) if mimic && followers.add(index, leader) => {
                        // y − y₀ = a₀ + a₁ (x − x₀)
                        builder.mimic(follower, leads, Mimic { ratio: a1, offset: y0 + a0 - a1 * x0 });
                        continue;
                    }
                    (Some(_), [_, _, 0.0, 0.0, 0.0]) if !mimic => {
                        let what = "a joint that follows another one is left free unless `mimic` is asked for";
                        warnings.push(e.mimic(format!("{what}; nothing enforces the coupling `{name}`")));
                    }
                    (Some(_), _) => {
                        let why = match p[2..] == [0.0; 3] {
                            true => "joint1 follows another joint, or joint2 follows joint1".to_owned(),
                            false => format!("polycoef {} is not linear", words(&p)),
                        };
                        let what = "the joint is left free, and nothing enforces the coupling";
                        warnings.push(e.mimic(format!("{why}: {what} `{name}`")));
                    }
                    (None, _) => {
                        let what = "the joint is left free: nothing enforces its constant position";
                        warnings.push(e.left_out(what));
                    }
                }
                let x0 = leader.map_or(0.0, |(.., x0)| x0);
                let coefficients = if leader.is_some() { shifted(p, x0, y0) } else { [y0 + p[0], 0.0, 0.0, 0.0, 0.0] };
                builder.constraint_coupling(&name, follower, leader.map(|(_, leader, _)| leader), coefficients);
            }
            _ => warnings.push(e.left_out("it is not held: the model's constraints have bodies and joints alone")),
        }
    }
    Ok(warnings)
}

/// Joints that follow other joints. A leader may be a follower, too.
#[derive(Default)]
struct Followers {
    leaders: HashMap<usize, usize>,
    refused: HashSet<usize>,
}

impl Followers {
    /// Lets a joint follow another joint. Returns `false` if the follower already follows a joint, or if the leader
    /// follows this follower.
    fn add(&mut self, follower: usize, leader: usize) -> bool {
        if self.leaders.contains_key(&follower) || self.refused.contains(&follower) {
            return false;
        }
        let mut root = leader;
        while let Some(&next) = self.leaders.get(&root) {
            root = next;
        }
        if root == follower {
            self.refused.insert(follower);
            return false;
        }
        self.leaders.insert(follower, leader);
        true
    }
}

/// Returns the two frames that a loop constraint connects, and whether the constraint also fixes their relative
/// orientation.
fn loop_ends(e: &Element, places: &Places) -> Result<([At; 2], bool), Error> {
    let a = Attributes::plain(e);
    let rigid = e.tag == "weld" && a.number("torquescale")? != Some(0.0);
    let point = |p: Vec3<f64>| Se3 { translation: p, ..Se3::identity() };
    let anchor = a.vector("anchor")?;
    let Some((b1, X1)) = places.find(e, "body1")? else {
        let both = places.find(e, "site1")?.zip(places.find(e, "site2")?);
        let (first, second) = both.ok_or_else(|| e.wrong("has neither body1 nor site1 and site2"))?;
        return Ok(([first, second], rigid));
    };
    if e.attribute("site1").or(e.attribute("site2")).is_some() {
        return Err(e.wrong("has both bodies and sites: expected one of them"));
    }
    let world = (crate::builder::WORLD, Se3::identity());
    let (b2, X2) = places.find(e, "body2")?.unwrap_or(world);
    let [W1, W2] = [places.drawn((b1, X1)), places.drawn((b2, X2))];
    if e.tag == "connect" {
        // The anchor is a point of body1. The corresponding point of body2 coincides with the anchor in the initial
        // configuration.
        let anchor = point(anchor.ok_or_else(|| e.lacks("anchor"))?);
        return Ok(([(b1, X1 * anchor), (b2, X2 * (W2.inverse() * W1 * anchor))], rigid));
    }
    // The anchor is a point of body2.
    let anchor = point(anchor.unwrap_or(Vec3::zero()));
    let relative = match a.array::<7>("relpose")? {
        Some([x, y, z, w, qx, qy, qz]) if [w, qx, qy, qz] != [0.0; 4] => {
            let norm = (w * w + qx * qx + qy * qy + qz * qz).sqrt();
            let [qx, qy, qz, w] = [qx, qy, qz, w].map(|part| part / norm);
            Se3::new(Quaternion::new(qx, qy, qz, w).to_rotation(), Vec3::new(x, y, z))
        }
        _ => W1.inverse() * W2 * anchor,
    };
    Ok(([(b1, X1 * relative), (b2, X2 * anchor)], rigid))
}

/// Returns the coefficients of the polynomial y(x) with y − y₀ = Σ pᵢ (x − x₀)ⁱ in powers of x, by Horner's rule.
fn shifted(p: [f64; 5], x0: f64, y0: f64) -> [f64; 5] {
    let mut c = [0.0; 5];
    for &coefficient in p.iter().rev() {
        // Computes c ← c · (x − x₀) + coefficient.
        for k in (1..5).rev() {
            c[k] = c[k - 1] - x0 * c[k];
        }
        c[0] = coefficient - x0 * c[0];
    }
    c[0] += y0;
    c
}
