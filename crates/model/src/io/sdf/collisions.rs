//! Collision shapes of an SDF.

use super::SdfOptions;
use super::include::Includes;
use super::scopes::Scopes;
use super::values::{number, pose, relative_to, text, three};
use crate::error::Error;
use crate::geometry::Shape;
use crate::io::collisions::{Collisions, Found};
use crate::io::xml::Element;
use condyle_spatial::{Se3, Vec3};
use std::path::Path;

impl Collisions {
    /// Reads the collision shapes of an SDF file. `path` and `options` are as for
    /// [`Model::from_sdf`](crate::Model::from_sdf).
    ///
    /// Boxes, spheres, cylinders, capsules, ellipsoids and planes are read. A plane is a half-space, although it is
    /// finite for drawing. A mesh is listed in [`meshes`](Self::meshes). A shape that is left out causes a warning with
    /// the reason.
    ///
    /// # Errors
    /// Returns [`Error::File`], [`Error::Xml`] or [`Error::Element`].
    pub fn from_sdf(path: impl AsRef<Path>, options: &SdfOptions) -> Result<Self, Error> {
        Ok(read(&Includes::new(&options.packages).file(path.as_ref(), 1)?, options)?.of_file(path.as_ref()))
    }

    /// Reads the collision shapes of an SDF from a string; see [`from_sdf`](Self::from_sdf).
    ///
    /// # Errors
    /// Returns the errors of [`from_sdf`](Self::from_sdf).
    pub fn from_sdf_str(sdf: &str, options: &SdfOptions) -> Result<Self, Error> {
        read(&Includes::new(&options.packages).string(sdf)?, options)
    }
}

fn read(root: &Element, options: &SdfOptions) -> Result<Collisions, Error> {
    let world = root.child("world");
    let mut models: Vec<&Element> = root.all("model").chain(world.into_iter().flat_map(|w| w.all("model"))).collect();
    let mut around = world.unwrap_or(root);
    if let Some(wanted) = &options.model {
        models.retain(|model| model.attribute("name") == Some(wanted));
        around = root;
    }
    if models.is_empty() {
        return Err(root.wrong("has no model"));
    }
    let (scopes, mut all) = (Scopes::new(around, &models)?, Collisions::default());
    for item in scopes.all("link") {
        let (link, scope) = (scopes.items[item].element, scopes.items[item].scope);
        for collision in link.all("collision") {
            let lXr = match relative_to(collision) {
                None => Se3::identity(),
                Some(name) => {
                    let at = scopes.find(item, name);
                    let at = at.ok_or_else(|| collision.wrong(format!("no link, joint or frame is named `{name}`")))?;
                    scopes.in_scope(Some(item), scope).inverse() * scopes.in_scope(at, scope)
                }
            };
            let placement = lXr * pose(collision, collision)?;
            let name = scopes.name(item);
            match collision.child("geometry").and_then(|geometry| geometry.children.first()) {
                None => all.leave_out(collision, name, "it has no geometry"),
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
    let length = |tag: &str| number(collision, Some(shape), tag, f64::NAN);
    let lengths = |tag: &str, otherwise: Option<Vec3<f64>>| match shape.child(tag) {
        Some(e) => three(collision, e),
        None => otherwise.ok_or_else(|| collision.wrong(format!("{}: has no {tag}", shape.tag))),
    };
    Ok(Some(match &*shape.tag {
        "box" => Found::Shape(Shape::cuboid(lengths("size", None)?.scale(0.5))),
        "sphere" => Found::Shape(Shape::sphere([0.0; 3], length("radius")?)),
        "ellipsoid" => Found::Shape(Shape::Ellipsoid { radii: lengths("radii", None)? }),
        "cylinder" => Found::Shape(Shape::Cylinder { radius: length("radius")?, half_length: 0.5 * length("length")? }),
        "capsule" => {
            let half = 0.5 * length("length")?;
            Found::Shape(Shape::capsule([0.0, 0.0, -half], [0.0, 0.0, half], length("radius")?))
        }
        "plane" => {
            let normal = lengths("normal", Some(Vec3::new(0.0, 0.0, 1.0)))?;
            let length = normal.norm_squared().sqrt();
            Found::Shape(Shape::HalfSpace { normal: normal.scale(1.0 / length), offset: 0.0 })
        }
        "mesh" => {
            let scale = lengths("scale", Some(Vec3::new(1.0, 1.0, 1.0)))?.to_array();
            let file = text(shape, "uri").ok_or_else(|| collision.wrong("mesh: has no uri"))?;
            Found::Mesh(file.to_owned(), scale)
        }
        _ => return Ok(None),
    }))
}
