//! Collision shapes of a robot's file, and the pairs of them that can collide.

use super::xml::Element;
use crate::body::FrameKind;
use crate::error::Error;
use crate::frame_name::FrameName;
use crate::geometry::{Geometry, GeometryPair, Shape};
use crate::model::Model;
use crate::names::nearest;
use crate::warning::Warning;
use condyle_spatial::Se3;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
#[cfg(feature = "meshes")]
use {super::files, super::fit::Fit, condyle_spatial::Vec3};

/// Mesh that a robot's file uses as a collision shape. Distances need a [`Shape`] in its place.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CollisionMesh {
    /// Name of the geometry.
    pub name: String,
    /// Link to which the mesh is fixed.
    pub frame: FrameName,
    /// Pose of the mesh in the frame of the link.
    pub placement: Se3<f64>,
    /// Address of the mesh file, as the robot's file gives it.
    pub file: String,
    /// Scale along the axes of the mesh.
    pub scale: [f64; 3],
}

/// Collision shapes of a robot: spheres, capsules, boxes, cylinders, ellipsoids and half-spaces, and its meshes.
///
/// ```
/// use condyle_model::{Collisions, Model, UrdfOptions};
/// let urdf = r#"<robot name="two"><link name="base"/>
///   <link name="arm"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
///   <link name="hand"><collision><origin xyz="0 0 1"/><geometry><mesh filename="hand.stl"/></geometry></collision>
///     <collision name="palm"><geometry><capsule radius="0.05" length="0.2"/></geometry></collision></link>
///   <joint name="a" type="continuous"><parent link="base"/><child link="arm"/></joint>
///   <joint name="b" type="continuous"><parent link="arm"/><child link="hand"/></joint></robot>"#;
/// let model = Model::from_urdf_str(urdf, &UrdfOptions::default())?;
/// let collisions = Collisions::from_urdf_str(urdf, &UrdfOptions::default())?;
/// let names: Vec<_> = collisions.geometries.iter().map(|geometry| &*geometry.name).collect();
/// assert_eq!(names, ["arm_0", "palm"]);
/// assert_eq!((&*collisions.meshes().next().unwrap().file, collisions.warnings().count()), ("hand.stl", 1));
/// assert!(collisions.pairs(&model)?.is_empty()); // arm and hand are parent and child
/// # Ok::<(), condyle_model::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Collisions {
    /// Shapes in the order of the file, with different names. A shape without a name, or with the name of an earlier
    /// shape, is named `link_k`, where k counts the shapes of its link.
    pub geometries: Vec<Geometry>,
    /// Meshes with their warnings, in the order of the file.
    meshes: Vec<(CollisionMesh, Warning)>,
    /// Warnings about shapes that are left out, other than meshes.
    warnings: Vec<Warning>,
    /// Folder of the robot's file; `None` for a string.
    folder: Option<PathBuf>,
    /// Pairs of links that cannot collide, with sorted names.
    disabled: HashSet<[String; 2]>,
    /// Names of geometries with MuJoCo's masks `contype` and `conaffinity`, where these are not 1.
    masks: Vec<(String, [u32; 2])>,
}

/// Shape of a file: a primitive or a mesh.
pub(crate) enum Found {
    /// Primitive.
    Shape(Shape),
    /// Address and scale of a mesh.
    Mesh(String, [f64; 3]),
}

impl Collisions {
    /// Adds a shape of a link. A shape with invalid numbers is left out with a warning, and so is a mesh. Returns the
    /// name of the shape, which no earlier shape has.
    pub(crate) fn add(&mut self, element: &Element, link: &str, placement: Se3<f64>, found: Found) -> String {
        let of = |frame: &Option<FrameName>| frame.as_ref().is_some_and(|frame| frame.name == link);
        let count = self.geometries.iter().filter(|geometry| of(&geometry.frame)).count();
        let meshes = self.meshes.iter().filter(|(mesh, _)| mesh.frame.name == link).count();
        let own = element.attribute("name").filter(|name| !name.is_empty()).map(str::to_owned);
        let numbered = (count + meshes..).map(|k| format!("{link}_{k}"));
        let is_new = |name: &String| {
            let mut all = self.geometries.iter().map(|geometry| &geometry.name);
            !all.any(|other| other == name) && !self.meshes.iter().any(|(mesh, _)| mesh.name == *name)
        };
        let name = own.into_iter().chain(numbered).find(is_new).unwrap_or_default();
        let frame = FrameName { name: link.to_owned(), kind: Some(FrameKind::Link) };
        match found {
            Found::Shape(shape) => match shape.check() {
                Ok(()) => {
                    self.geometries.push(Geometry { name: name.clone(), frame: Some(frame), placement, shape });
                }
                Err(what) => self.leave_out(element, link, &format!("the {}: {what}", shape.kind())),
            },
            Found::Mesh(file, scale) => {
                let what = format!("the mesh `{file}`: distances need a sphere, a capsule or a box in its place");
                let mesh = CollisionMesh { name: name.clone(), frame, placement, file, scale };
                self.meshes.push((mesh, left_out(element, link, &what)));
            }
        }
        name
    }

    /// Sets the path of the robot's file, in whose folder meshes are searched.
    pub(crate) fn of_file(self, path: &Path) -> Self {
        Self { folder: path.parent().map(Path::to_owned), ..self }
    }

    /// Adds a warning that a shape of a link is left out.
    pub(crate) fn leave_out(&mut self, element: &Element, link: &str, what: &str) {
        self.warnings.push(left_out(element, link, what));
    }

    /// Returns the meshes that no shape replaces, in the order of the file.
    pub fn meshes(&self) -> impl Iterator<Item = &CollisionMesh> {
        self.meshes.iter().map(|(mesh, _)| mesh)
    }

    /// Returns a warning for each shape of the file that is left out, with the reason. Meshes come last.
    pub fn warnings(&self) -> impl Iterator<Item = &Warning> {
        self.warnings.iter().chain(self.meshes.iter().map(|(_, warning)| warning))
    }

    /// Replaces each mesh that can be read (STL, OBJ) by a shape that contains all its points. A mesh that cannot be
    /// read remains, and its warning gives the reason. Returns the number of meshes that were replaced.
    ///
    /// packages: folders that contain packages, as for the readers.
    #[cfg(feature = "meshes")]
    pub fn fit_meshes(&mut self, fit: Fit, packages: &[PathBuf]) -> usize {
        let before = self.meshes.len();
        for (mesh, warning) in std::mem::take(&mut self.meshes) {
            let points = self.folder.as_deref().map_or_else(
                || Err("its folder is unknown, because the robot was read from a string".to_owned()),
                |folder| points(&mesh, folder, packages),
            );
            match points {
                Ok(points) => {
                    let CollisionMesh { name, frame, placement, .. } = mesh;
                    self.geometries.push(Geometry { name, frame: Some(frame), placement, shape: fit.shape(&points) });
                }
                Err(why) => self.meshes.push((mesh, warning.because(&why))),
            }
        }
        before - self.meshes.len()
    }

    /// Sets the masks of a geometry.
    pub(crate) fn mask(&mut self, name: String, masks: [u32; 2]) {
        self.masks.push((name, masks));
    }

    /// Removes all pairs of geometries on two links; `world` is the link of the world.
    ///
    /// # Errors
    /// Returns [`Error::Geometry`] for a link that has neither a shape nor a mesh.
    pub fn disable(&mut self, first: &str, second: &str) -> Result<(), Error> {
        let of = |frame: &Option<FrameName>| frame.as_ref().map_or_else(|| WORLD.to_owned(), |f| f.name.clone());
        let shapes = self.geometries.iter().map(|geometry| of(&geometry.frame));
        let links: Vec<String> = shapes.chain(self.meshes().map(|mesh| mesh.frame.name.clone())).collect();
        for link in [first, second] {
            if link != WORLD && !links.iter().any(|other| other == link) {
                let near = nearest(link, links.iter().map(String::as_str));
                let near =
                    if near.is_empty() { near } else { format!("; the most similar link with shapes is `{near}`") };
                let what = format!("has no collision shapes{near}");
                return Err(Error::Geometry { geometry: format!("link `{link}`"), what });
            }
        }
        self.leave_apart(first, second);
        Ok(())
    }

    /// Removes all pairs of geometries on two links, which need not have shapes.
    pub(crate) fn leave_apart(&mut self, first: &str, second: &str) {
        let mut links = [first.to_owned(), second.to_owned()];
        links.sort_unstable();
        self.disabled.insert(links);
    }

    /// Returns the pairs of links that were disabled, in alphabetical order.
    pub fn disabled(&self) -> Vec<[&str; 2]> {
        let mut all: Vec<_> = self.disabled.iter().map(|[a, b]| [&**a, &**b]).collect();
        all.sort_unstable();
        all
    }

    /// Returns all pairs of geometries that can collide. The list omits:
    /// - geometries of the same body, and of bodies that one joint connects. A link that a fixed joint merges belongs
    ///   to the body of its parent;
    /// - two geometries that are fixed to the world. A link that is fixed to the world still forms no pair with the
    ///   first link that moves, but the world's own geometries, such as the ground, do;
    /// - disabled pairs of links, from SRDF or `<exclude>` of an MJCF;
    /// - geometries whose masks `contype` and `conaffinity` exclude each other: both contype₁ & conaffinity₂ and
    ///   contype₂ & conaffinity₁ are 0;
    /// - pairs of half-spaces.
    ///
    /// # Errors
    /// Returns [`Error::Geometry`] if the model lacks a frame of a geometry.
    pub fn pairs(&self, model: &Model) -> Result<Vec<GeometryPair>, Error> {
        let mut all = Vec::new();
        for geometry in &self.geometries {
            let (body, _) = geometry.resolve(model)?;
            let link = geometry.frame.as_ref().map_or(WORLD, |frame| &*frame.name);
            let masks = self.masks.iter().find(|(name, _)| *name == geometry.name).map_or([1, 1], |&(_, masks)| masks);
            all.push((geometry, body, link, masks));
        }
        let is_part = |body: usize| {
            let mut frames = model.frames().iter();
            body == 0 || frames.any(|frame| frame.body == body && frame.kind == FrameKind::Link)
        };
        // the body that carries a body, without intermediate bodies of joints with several axes
        let parent = |body: usize| {
            let mut up = model.bodies()[body].parent;
            while !is_part(up) {
                up = model.bodies()[up].parent;
            }
            up
        };
        let parents: Vec<_> = all.iter().map(|&(_, body, ..)| if body == 0 { 0 } else { parent(body) }).collect();
        let mut pairs = Vec::new();
        for (i, &(a, first, link, [type_1, affinity_1])) in all.iter().enumerate() {
            for (j, &(b, second, other, [type_2, affinity_2])) in all.iter().enumerate().skip(i + 1) {
                let fixed_to_world = |body: usize, link: &str| body == 0 && link != WORLD;
                let adjacent = first == second
                    || parents[i] == second && (second > 0 || fixed_to_world(second, other))
                    || parents[j] == first && (first > 0 || fixed_to_world(first, link));
                let masked = type_1 & affinity_2 == 0 && type_2 & affinity_1 == 0;
                let flat = [a, b].iter().all(|geometry| matches!(geometry.shape, Shape::HalfSpace { .. }));
                let mut links = [link.to_owned(), other.to_owned()];
                links.sort_unstable();
                if !adjacent && !masked && !flat && !self.disabled.contains(&links) {
                    pairs.push(GeometryPair::new(a.clone(), b.clone()));
                }
            }
        }
        Ok(pairs)
    }
}

/// Link of geometries that are fixed to the world.
const WORLD: &str = "world";

/// Returns the warning that a shape of a link is left out.
fn left_out(element: &Element, link: &str, what: &str) -> Warning {
    element.left_out(format!("its shape on link `{link}` is left out: {what}"))
}

/// Returns the points of a mesh file, scaled.
#[cfg(feature = "meshes")]
fn points(mesh: &CollisionMesh, folder: &Path, packages: &[PathBuf]) -> Result<Vec<Vec3<f64>>, String> {
    let path = files::resolve(&mesh.file, folder, packages).map_err(|error| error.to_string())?;
    let format = condyle_meshes::Format::of(&path).ok_or("its format is neither STL nor OBJ")?;
    let bytes = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let (points, _) = condyle_meshes::triangles(format, &bytes)?;
    if points.is_empty() {
        return Err("it has no points".to_owned());
    }
    let [x, y, z] = mesh.scale;
    Ok(points.into_iter().map(|p| Vec3::new(x * p[0], y * p[1], z * p[2])).collect())
}
