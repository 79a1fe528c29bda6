//! Collision shapes of a URDF.

use super::elements::{array, needed, text};
use super::origin::Origins;
use super::{UrdfOptions, check_arguments, xacro};
use crate::error::Error;
use crate::geometry::Shape;
use crate::io::collisions::{Collisions, Found};
use crate::io::files;
use crate::io::xml::{Amount, Element};
use crate::model::Model;
use condyle_spatial::Vec3;
use std::path::Path;

impl Collisions {
    /// Reads the collision shapes of a URDF file. `path` and `options` are as for [`Model::from_urdf`].
    ///
    /// Boxes, spheres, cylinders and capsules are read, and Drake's `drake:capsule` and `drake:ellipsoid`. A mesh is
    /// listed in [`meshes`](Self::meshes). A shape that is left out causes a warning with the reason.
    ///
    /// # Errors
    /// Returns [`Error::File`], [`Error::Package`], [`Error::Xml`] or [`Error::Element`].
    pub fn from_urdf(path: impl AsRef<Path>, options: &UrdfOptions) -> Result<Self, Error> {
        let path = files::locate(path.as_ref(), &options.packages)?;
        let name = path.display().to_string();
        if xacro::is_xacro(&path) {
            return Ok(read(&Model::expand_xacro(&path, options)?, &format!("{name} (expanded)"))?.of_file(&path));
        }
        check_arguments(&name, options)?;
        Ok(read(&Amount::default().read(&path)?, &name)?.of_file(&path))
    }

    /// Reads the collision shapes of a URDF from a string; see [`from_urdf`](Self::from_urdf).
    ///
    /// # Errors
    /// Returns the errors of [`from_urdf`](Self::from_urdf).
    pub fn from_urdf_str(urdf: &str, options: &UrdfOptions) -> Result<Self, Error> {
        check_arguments("<string>", options)?;
        read(urdf, "<string>")
    }
}

fn read(urdf: &str, file: &str) -> Result<Collisions, Error> {
    let robot = Element::parse(urdf, file, &mut Amount::default())?;
    if robot.tag != "robot" {
        return Err(robot.wrong("the root element of a URDF is <robot>"));
    }
    let (origins, mut all) = (Origins::of(&robot)?, Collisions::default());
    for link in robot.all("link") {
        let name = text(link, link, "name")?;
        for collision in link.all("collision") {
            let placement = origins.pose(collision, collision)?;
            match needed(collision, "geometry")?.children.first() {
                None => all.leave_out(collision, name, "its <geometry> is empty"),
                Some(shape) => match found(collision, shape)? {
                    Some(found) => _ = all.add(collision, name, placement, found),
                    None => all.leave_out(collision, name, &format!("the shape <{}> is not supported", shape.tag)),
                },
            }
        }
    }
    Ok(all)
}

/// Returns the shape that an element in `<geometry>` describes; `None` for an unknown shape.
fn found(collision: &Element, shape: &Element) -> Result<Option<Found>, Error> {
    let number = |name: &str| {
        let [x] = array(collision, shape, name)?.ok_or_else(|| shape.lacks(name))?;
        Ok::<f64, Error>(x)
    };
    Ok(Some(match &*shape.tag {
        "box" => {
            let size: [f64; 3] = array(collision, shape, "size")?.ok_or_else(|| shape.lacks("size"))?;
            Found::Shape(Shape::cuboid(size.map(|x| 0.5 * x)))
        }
        "sphere" => Found::Shape(Shape::sphere([0.0; 3], number("radius")?)),
        "cylinder" => Found::Shape(Shape::Cylinder { radius: number("radius")?, half_length: 0.5 * number("length")? }),
        "capsule" | "drake:capsule" => {
            let (radius, half) = (number("radius")?, 0.5 * number("length")?);
            Found::Shape(Shape::capsule([0.0, 0.0, -half], [0.0, 0.0, half], radius))
        }
        "drake:ellipsoid" => {
            Found::Shape(Shape::Ellipsoid { radii: Vec3::new(number("a")?, number("b")?, number("c")?) })
        }
        "mesh" => {
            let scale = array(collision, shape, "scale")?.unwrap_or([1.0; 3]);
            Found::Mesh(text(collision, shape, "filename")?.to_owned(), scale)
        }
        _ => return Ok(None),
    }))
}
