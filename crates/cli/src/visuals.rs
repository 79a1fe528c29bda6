//! Visuals of a URDF: the shapes that show what each link looks like.

use condyle::{Model, Se3};
use roxmltree::{Document, Node};

/// Visual of a URDF: a shape on a link, the shape's pose in the link's frame, and its colour.
#[derive(Debug, PartialEq)]
pub(crate) struct Visual {
    pub(crate) link: String,
    pub(crate) origin: Se3<f64>,
    pub(crate) geometry: Geometry,
    /// Red, green, blue and opacity, from 0 to 1.
    pub(crate) color: Option<[f64; 4]>,
}

/// Shape of a visual, with lengths in m.
#[derive(Debug, PartialEq)]
pub(crate) enum Geometry {
    Box([f64; 3]),
    Cylinder {
        radius: f64,
        length: f64,
    },
    Capsule {
        radius: f64,
        length: f64,
    },
    Sphere(f64),
    /// Mesh file, as named in the URDF. Its lengths are multiplied by a scale for each axis.
    Mesh {
        file: String,
        scale: [f64; 3],
    },
}

/// Returns the visuals of all links, in the order of the file. A visual that cannot be read is skipped, because a robot
/// without this visual can still be used.
pub(crate) fn read(urdf: &str) -> Vec<Visual> {
    let Ok(urdf) = Model::well_formed(urdf) else { return Vec::new() };
    let Ok(document) = Document::parse(&urdf) else { return Vec::new() };
    let robot = document.root_element();
    let mut visuals = Vec::new();
    for link in children(robot, "link") {
        let Some(name) = link.attribute("name") else { continue };
        for visual in children(link, "visual") {
            let Some(geometry) = child(visual, "geometry").and_then(geometry) else { continue };
            let color = child(visual, "material").and_then(|material| color(material, robot));
            visuals.push(Visual { link: name.to_owned(), origin: origin(visual), geometry, color });
        }
    }
    visuals
}

fn children<'a, 'i>(node: Node<'a, 'i>, tag: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |c| c.has_tag_name(tag))
}

fn child<'a, 'i>(node: Node<'a, 'i>, tag: &'static str) -> Option<Node<'a, 'i>> {
    children(node, tag).next()
}

/// Returns the numbers of an attribute; `None` unless there are exactly N numbers and all are finite.
fn numbers<const N: usize>(node: Node<'_, '_>, attribute: &str) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    let mut words = node.attribute(attribute)?.split_whitespace();
    for number in &mut numbers {
        *number = words.next()?.parse().ok().filter(|x: &f64| x.is_finite())?;
    }
    words.next().is_none().then_some(numbers)
}

fn geometry(node: Node<'_, '_>) -> Option<Geometry> {
    let shape = node.children().find(Node::is_element)?;
    let number = |attribute| numbers(shape, attribute).map(|[x]| x);
    match shape.tag_name().name() {
        "box" => numbers(shape, "size").map(Geometry::Box),
        "cylinder" => Some(Geometry::Cylinder { radius: number("radius")?, length: number("length")? }),
        "capsule" => Some(Geometry::Capsule { radius: number("radius")?, length: number("length")? }),
        "sphere" => number("radius").map(Geometry::Sphere),
        "mesh" => {
            let scale = if shape.has_attribute("scale") { numbers(shape, "scale")? } else { [1.0; 3] };
            Some(Geometry::Mesh { file: shape.attribute("filename")?.to_owned(), scale })
        }
        _ => None,
    }
}

/// Returns the pose of a visual, from `xyz` and from `rpy`, which are angles about the fixed axes x, y, z in that
/// order.
fn origin(visual: Node<'_, '_>) -> Se3<f64> {
    let origin = child(visual, "origin");
    let read = |attribute| origin.and_then(|o| numbers(o, attribute)).unwrap_or([0.0; 3]);
    let ([roll, pitch, yaw], xyz) = (read("rpy"), read("xyz"));
    let rotation = nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    nalgebra::Isometry3::from_parts(xyz.into(), rotation).into()
}

/// Returns the colour of a material. If the material has no colour, returns the colour of the robot's material with the
/// same name.
fn color(material: Node<'_, '_>, robot: Node<'_, '_>) -> Option<[f64; 4]> {
    let own = |material| child(material, "color").and_then(|c| numbers(c, "rgba"));
    let name = material.attribute("name");
    own(material).or_else(|| children(robot, "material").filter(|m| m.attribute("name") == name).find_map(own))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: &str = r#"<robot name="r">
        <material name="steel"><color rgba="0.5 0.5 0.6 1"/></material>
        <link name="a">
            <visual><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><geometry><box size="1 2 3"/></geometry>
                <material name="steel"/></visual>
            <visual><geometry><sphere radius="0.5"/></geometry><material name="red"><color rgba="1 0 0 1"/></material></visual>
            <visual><geometry><cylinder radius="0.1"/></geometry></visual>
            <visual><geometry><mesh filename="a.stl"/></geometry></visual>
        </link>
        <link name="b"><visual><geometry><cylinder radius="0.1" length="2"/></geometry></visual></link>
    </robot>"#;

    /// Checks the link, pose and colour of each visual that can be read.
    #[test]
    fn visuals_of_each_link() {
        let visuals = read(ROBOT);
        let of: Vec<_> = visuals.iter().map(|v| (v.link.as_str(), &v.geometry, v.color)).collect();
        assert_eq!(
            of,
            [
                ("a", &Geometry::Box([1.0, 2.0, 3.0]), Some([0.5, 0.5, 0.6, 1.0])),
                ("a", &Geometry::Sphere(0.5), Some([1.0, 0.0, 0.0, 1.0])),
                ("a", &Geometry::Mesh { file: "a.stl".to_owned(), scale: [1.0; 3] }, None),
                ("b", &Geometry::Cylinder { radius: 0.1, length: 2.0 }, None),
            ]
        );
        let turned = visuals[0].origin.rotation.columns()[0];
        assert!((turned.y - 1.0).abs() < 1e-15, "yaw turns x to y");
        assert_eq!(visuals[0].origin.translation.to_array(), [1.0, 2.0, 3.0]);
    }

    /// Checks that the visuals of a robot are read even if its text is not strict XML.
    #[test]
    fn visuals_of_robots_that_are_not_strict_xml() {
        let prolog = "<!------ a ------>\n<?xml version='1.0'?><!DOCTYPE robot>";
        let text = format!("{prolog}{}", ROBOT.replace("<link name=\"b\">", "<gz:a/><link name=\"b\">"));
        assert_eq!(read(&text), read(ROBOT));
    }

    /// Checks that a text without a robot, or a robot without shapes, has no visuals.
    #[test]
    fn visuals_of_invalid_texts() {
        assert_eq!(read("<robot"), []);
        assert_eq!(read("<robot name='r'><link name='a'><visual><geometry/></visual></link></robot>"), []);
    }
}
