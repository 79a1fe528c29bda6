//! Meshes that an MJCF shows; attributes may come from the defaults of classes.

use super::part::Words;
use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};
use std::collections::HashMap;
use std::path::Path;

/// Mesh that is shown in the frame of a body.
pub struct Visual {
    /// Name of the body; `None` for the world.
    pub body: Option<String>,
    /// Address of the mesh file, in the form that [`crate::Meshes::get`] accepts.
    pub file: String,
    /// Scale along the axes of the mesh.
    pub scale: [f64; 3],
    /// Pose of the mesh in the body (m).
    pub pose: Isometry3<f64>,
    /// Red, green, blue and opacity, each from 0 to 1.
    pub color: Option<[f64; 4]>,
}

/// First group of collision geometries. By convention, groups from this number on are for collisions.
const COLLISION: u32 = 3;
/// Maximum depth of nested bodies or classes.
const DEEPEST: usize = 256;

type Attributes<'a> = HashMap<(&'a str, &'a str), &'a str>;

struct File<'a> {
    classes: HashMap<&'a str, Attributes<'a>>,
    /// File and scale of each mesh, by name of the mesh.
    meshes: HashMap<String, (String, [f64; 3])>,
    /// Colour of each material, by name of the material.
    materials: HashMap<&'a str, [f64; 4]>,
    degrees: bool,
    order: &'a str,
    found: Vec<Visual>,
}

/// Returns the meshes of an MJCF. Files that the MJCF includes are not read.
pub fn visuals(text: &str) -> Vec<Visual> {
    let Ok(document) = Document::parse(text) else { return Vec::new() };
    let root = document.root_element();
    let all = |section, tag| {
        let sections = root.children().filter(move |node| node.has_tag_name(section));
        sections.flat_map(move |node| node.children().filter(move |node| node.has_tag_name(tag)))
    };
    let compiler =
        |name| root.children().filter(|n| n.has_tag_name("compiler")).filter_map(|n| n.attribute(name)).next_back();
    let mut file = File {
        classes: HashMap::from([("main", HashMap::new())]),
        meshes: HashMap::new(),
        materials: HashMap::new(),
        degrees: compiler("angle") != Some("radian"),
        order: compiler("eulerseq").unwrap_or("xyz"),
        found: Vec::new(),
    };
    for node in root.children().filter(|node| node.has_tag_name("default")) {
        let main = file.classes["main"].clone();
        file.class(node, "main", main, 0);
    }
    let folder = compiler("meshdir").or(compiler("assetdir")).unwrap_or_default();
    for mesh in all("asset", "mesh") {
        let Some(path) = mesh.attribute("file") else { continue };
        let stem = Path::new(path).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let name = mesh.attribute("name").unwrap_or(stem).to_owned();
        let scale = file.attribute(mesh, "scale", "main").and_then(|text| Words::new(text).numbers());
        let path = Path::new(folder).join(path).to_str().unwrap_or_default().to_owned();
        file.meshes.insert(name, (path, scale.unwrap_or([1.0; 3])));
    }
    for material in all("asset", "material") {
        if let (Some(name), Some(color)) = (material.attribute("name"), material.attribute("rgba").and_then(four)) {
            file.materials.insert(name, color);
        }
    }
    for world in root.children().filter(|node| node.has_tag_name("worldbody")) {
        file.body(world, None, "main", Isometry3::identity(), 0);
    }
    file.found
}

fn four(text: &str) -> Option<[f64; 4]> {
    let mut words = Words::new(text);
    Some([words.number()?, words.number()?, words.number()?, words.number()?])
}

impl<'a> File<'a> {
    /// Stores the attributes of a class and of the classes nested in it, which inherit the attributes of the outer
    /// class.
    fn class(&mut self, node: Node<'a, '_>, name: &'a str, mut class: Attributes<'a>, depth: usize) {
        for kind in node.children().filter(|kind| kind.is_element() && !kind.has_tag_name("default")) {
            if let Some(tag) = ["geom", "mesh"].into_iter().find(|tag| kind.has_tag_name(*tag)) {
                class.extend(kind.attributes().map(|a| ((tag, a.name()), a.value())));
            }
        }
        for inner in node.children().filter(|inner| inner.has_tag_name("default") && depth < DEEPEST) {
            self.class(inner, inner.attribute("class").unwrap_or_default(), class.clone(), depth + 1);
        }
        self.classes.insert(name, class);
    }

    /// Returns an attribute of an element, or the default from the class of the element.
    fn attribute(&self, node: Node<'a, '_>, name: &'a str, around: &'a str) -> Option<&'a str> {
        let tag = if node.has_tag_name("mesh") { "mesh" } else { "geom" };
        let class = self.classes.get(node.attribute("class").unwrap_or(around));
        node.attribute(name).or_else(|| class?.get(&(tag, name)).copied())
    }

    /// Adds the meshes of a body and of the bodies below it. `pose` is the pose in the body of the <frame> around the
    /// elements.
    fn body(&mut self, node: Node<'a, '_>, name: Option<&'a str>, around: &'a str, pose: Isometry3<f64>, depth: usize) {
        if depth > DEEPEST {
            return;
        }
        let around = node.attribute("childclass").unwrap_or(around);
        for inner in node.children().filter(Node::is_element) {
            match inner.tag_name().name() {
                "body" => self.body(
                    inner,
                    Some(inner.attribute("name").unwrap_or("")),
                    around,
                    Isometry3::identity(),
                    depth + 1,
                ),
                "frame" => {
                    let own = self.pose(&|key| inner.attribute(key));
                    self.body(inner, name, around, pose * own, depth + 1);
                }
                "geom" => self.geom(inner, name, around, pose),
                _ => {}
            }
        }
    }

    fn geom(&mut self, geom: Node<'a, '_>, body: Option<&'a str>, around: &'a str, pose: Isometry3<f64>) {
        let get = |key| self.attribute(geom, key, around);
        let Some((file, scale)) = get("mesh").and_then(|mesh| self.meshes.get(mesh)) else { return };
        let group = get("group").and_then(|group| group.trim().parse::<u32>().ok()).unwrap_or(0);
        // If an element with a mesh has the type of a simple shape, the mesh only defines the size of that shape.
        if group >= COLLISION || get("type").is_some_and(|kind| kind != "mesh") {
            return;
        }
        let color = get("rgba").and_then(four).or_else(|| self.materials.get(get("material")?).copied());
        let pose = pose * self.pose(&|key| self.attribute(geom, key, around));
        let (file, scale) = (file.clone(), *scale);
        self.found.push(Visual { body: body.map(str::to_owned), file, scale, pose, color });
    }

    /// Returns the pose that the attributes of an element describe.
    fn pose<'b>(&self, get: &dyn Fn(&'static str) -> Option<&'b str>) -> Isometry3<f64> {
        let words = |key| get(key).map(Words::new);
        let three = |key| words(key).and_then(|mut words| words.numbers());
        let angle = |x: f64| if self.degrees { x.to_radians() } else { x };
        let rotation = if let Some([w, x, y, z]) = get("quat").and_then(four) {
            UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-12)
        } else if let Some(angles) = three("euler") {
            let mut turned = UnitQuaternion::identity();
            for (letter, x) in self.order.chars().zip(angles.map(angle)) {
                let axis = match letter.to_ascii_lowercase() {
                    'x' => Vector3::x_axis(),
                    'y' => Vector3::y_axis(),
                    _ => Vector3::z_axis(),
                };
                let turn = UnitQuaternion::from_axis_angle(&axis, x);
                // A capital letter is a rotation about a fixed axis, so it is applied after all earlier rotations.
                turned = if letter.is_ascii_uppercase() { turn * turned } else { turned * turn };
            }
            Some(turned)
        } else if let Some([x, y, z, a]) = get("axisangle").and_then(four) {
            Unit::try_new(Vector3::new(x, y, z), 1e-12).map(|axis| UnitQuaternion::from_axis_angle(&axis, angle(a)))
        } else if let Some(mut words) = words("xyaxes") {
            words.numbers().zip(words.numbers()).and_then(|(x, y)| {
                let x = Vector3::from(x).try_normalize(1e-12)?;
                let y = Vector3::from(y);
                let y = (y - x * x.dot(&y)).try_normalize(1e-12)?;
                let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
                Some(UnitQuaternion::from_rotation_matrix(&rotation))
            })
        } else {
            three("zaxis").and_then(|z| UnitQuaternion::rotation_between(&Vector3::z(), &Vector3::from(z)))
        };
        let [x, y, z] = three("pos").unwrap_or_default();
        Isometry3::from_parts(Translation3::new(x, y, z), rotation.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::visuals;

    #[test]
    fn classes_frames_and_materials() {
        let found = visuals(
            r#"<mujoco><compiler meshdir="assets" angle="radian"/>
            <default><default class="v"><geom type="mesh" group="2" material="m"/><mesh scale="2 2 2"/></default>
            <default class="c"><geom group="3" type="mesh"/></default></default>
            <asset><mesh file="a.stl" class="v"/><mesh name="b" file="sub/b.obj"/><material name="m" rgba="1 0 0 1"/></asset>
            <worldbody><geom mesh="b"/><body name="one" childclass="v" pos="9 9 9"><geom mesh="a" pos="1 2 3" euler="0 0 1.5707963267948966"/>
            <frame pos="0 0 1"><geom mesh="b" rgba="0 1 0 0.5"/></frame>
            <geom class="c" mesh="a"/><geom type="box" mesh="a"/><geom mesh="unknown"/></body></worldbody></mujoco>"#,
        );
        let seen: Vec<_> =
            found.iter().map(|v| (v.body.as_deref(), &*v.file, v.scale[0], v.color.map(|c| c[0]))).collect();
        let expected = [
            (None, "assets/sub/b.obj", 1.0, None),
            (Some("one"), "assets/a.stl", 2.0, Some(1.0)),
            (Some("one"), "assets/sub/b.obj", 1.0, Some(0.0)),
        ];
        assert_eq!(seen, expected);
        let p = found[1].pose * nalgebra::Point3::new(1.0, 0.0, 0.0);
        assert!((p - nalgebra::Point3::new(1.0, 3.0, 3.0)).norm() < 1e-12, "{p}");
        assert_eq!(found[2].pose.translation.vector.z, 1.0);
        assert!(visuals("<mujoco><worldbody>").is_empty());
    }
}
