//! Collision shapes of an MJCF.

use super::attributes::{Attributes, MAIN};
use super::geometry::sized;
use super::include::Files;
use super::tree::Parts;
use super::{ELEMENTS, MjcfOptions, Reader, with_reader};
use crate::error::Error;
use crate::geometry::Shape;
use crate::io::collisions::{Collisions, Found};
use crate::io::known::Known;
use crate::io::xml::Element;
use condyle_spatial::{Se3, Vec3};
use std::path::Path;

impl Collisions {
    /// Reads the collision shapes of an MJCF file and of the files that it includes. `path` and `options` are as for
    /// [`Model::from_mjcf`](crate::Model::from_mjcf).
    ///
    /// Planes, spheres, capsules, ellipsoids, cylinders and boxes are read, except geoms whose `contype` and
    /// `conaffinity` are both 0. A plane is a half-space. `<exclude>` disables pairs of bodies. A mesh is listed in
    /// [`meshes`](Self::meshes). Height fields, SDFs and primitives that are fitted to meshes are left out with a
    /// warning. Pairs of `<pair>` are not read.
    ///
    /// # Errors
    /// Returns [`Error::File`], [`Error::Xml`] or [`Error::Element`].
    pub fn from_mjcf(path: impl AsRef<Path>, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.read(path.as_ref())?;
        Ok(with_reader(&files, options, read)?.of_file(path.as_ref()))
    }

    /// Reads the collision shapes of an MJCF from a string; see [`from_mjcf`](Self::from_mjcf).
    ///
    /// # Errors
    /// Returns the errors of [`from_mjcf`](Self::from_mjcf).
    pub fn from_mjcf_str(text: &str, options: &MjcfOptions) -> Result<Self, Error> {
        let mut files = Files::new(Known::new(ELEMENTS));
        files.parse(text, "<string>", None)?;
        with_reader(&files, options, read)
    }
}

fn read<'a>(mut reader: Reader<'a>, root: &'a Element) -> Result<Collisions, Error> {
    let mut all = Collisions::default();
    for world in root.all("worldbody") {
        let mut parts = Parts::default();
        reader.gather(world, Se3::identity(), MAIN, &mut parts)?;
        reader.solids_of(&parts, "world", Se3::identity(), &mut all)?;
        let mut waiting: Vec<_> = parts.bodies.iter().rev().map(|&(element, _, class)| (element, class)).collect();
        while let Some((element, class)) = waiting.pop() {
            let mut parts = Parts::default();
            reader.gather(element, Se3::identity(), class, &mut parts)?;
            let name = reader.next_body(element)?;
            let fXl = reader.link_in_frame(element, &parts)?;
            reader.solids_of(&parts, &name, fXl, &mut all)?;
            waiting.extend(parts.bodies.iter().rev().map(|&(element, _, class)| (element, class)));
        }
    }
    for exclude in root.all("contact").flat_map(|contact| contact.all("exclude")) {
        let body = |name: &str| exclude.attribute(name).ok_or_else(|| exclude.lacks(name));
        all.leave_apart(body("body1")?, body("body2")?);
    }
    Ok(all)
}

impl<'a> Reader<'a> {
    /// Adds the collision shapes of a body. fXl is the pose of the MJCF body in the frame with the body's name.
    fn solids_of(&self, parts: &Parts<'a>, link: &str, fXl: Se3<f64>, all: &mut Collisions) -> Result<(), Error> {
        for (a, X) in &parts.geoms {
            let mask = |name: &str| Ok::<_, Error>(a.number(name)?.unwrap_or(1.0) as u32);
            let masks = [mask("contype")?, mask("conaffinity")?];
            if masks == [0, 0] {
                continue; // the geom only shows the body
            }
            let kind = a.get("type").unwrap_or("sphere");
            match self.found(a, kind)? {
                Ok((pose, found)) => {
                    let name = all.add(a.element, link, fXl * *X * pose, found);
                    if masks != [1, 1] {
                        all.mask(name, masks);
                    }
                }
                Err(why) => all.leave_out(a.element, link, &why),
            }
        }
        Ok(())
    }

    /// Returns the pose and the shape of a geom, or why it is left out.
    fn found(&self, a: &Attributes<'a>, kind: &str) -> Result<Result<(Se3<f64>, Found), String>, Error> {
        let source = self.source(a.element);
        let mesh = source.assets.mesh(a)?;
        if let Some(mesh) = mesh {
            if kind != "mesh" {
                return Ok(Err(format!("the {kind} is fitted to a mesh")));
            }
            let mesh = source.defaults.of(mesh, MAIN)?;
            let Some(file) = mesh.get("file") else { return Ok(Err("the mesh has no file".to_owned())) };
            let scale = mesh.array("scale")?.unwrap_or([1.0; 3]);
            let file = Path::new(&source.compiler.mesh_folder).join(file).display().to_string();
            return Ok(Ok((source.compiler.pose(a)?, Found::Mesh(file, scale))));
        }
        if kind == "plane" {
            let shape = Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 0.0 };
            return Ok(Ok((source.compiler.pose(a)?, Found::Shape(shape))));
        }
        if !matches!(kind, "sphere" | "capsule" | "cylinder" | "box" | "ellipsoid") {
            return Ok(Err(format!("the type `{kind}` is not supported")));
        }
        let (pose, size) = sized(&source.compiler, a, kind)?;
        let shape = match kind {
            "sphere" => Shape::sphere([0.0; 3], size[0]),
            "capsule" => Shape::capsule([0.0, 0.0, -size[1]], [0.0, 0.0, size[1]], size[0]),
            "cylinder" => Shape::Cylinder { radius: size[0], half_length: size[1] },
            "box" => Shape::cuboid([size[0], size[1], size[2]]),
            _ => Shape::Ellipsoid { radii: Vec3::new(size[0], size[1], size[2]) },
        };
        Ok(Ok((pose, Found::Shape(shape))))
    }
}
