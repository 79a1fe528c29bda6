//! Reader of DAE files (COLLADA 1.4 and 1.5). The reader returns the triangles of a scene. It applies the poses of the
//! scene's nodes and the diffuse colours of the materials.
//!
//! The unit of length of the file is applied, but the upward axis of the file is ignored. RViz and Pinocchio do the
//! same, and mesh files of robots are made for these programs.

use super::part::{Part, Triangle, Words, full};
use nalgebra::{Matrix4, Point3, Rotation3, Translation3, Unit, Vector3};
use roxmltree::{Document, Node};
use std::collections::HashMap;

/// Maximum depth of nested nodes.
const DEEPEST: usize = 64;
/// Maximum number of visited nodes.
const MOST_NODES: usize = 100_000;

/// Reads the triangles of a DAE: one part for each material of each geometry that the scene shows.
pub(super) fn read(text: &str) -> Result<Vec<Part>, String> {
    let document = Document::parse(text).map_err(|error| error.to_string())?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(format!("begins with <{}>, expected <COLLADA>", root.tag_name().name()));
    }
    let ids = root.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect();
    let unit = child(root, "asset").and_then(|asset| child(asset, "unit")?.attribute("meter")?.parse::<f64>().ok());
    let unit = unit.filter(|unit| *unit > 0.0 && unit.is_finite()).unwrap_or(1.0);
    let mut scene = Scene { ids, parts: Vec::new(), triangles: 0, nodes: 0 };
    let shown = child(root, "scene").and_then(|s| scene.named(child(s, "instance_visual_scene")?.attribute("url")?));
    match shown {
        Some(shown) => scene.visit(shown, Matrix4::new_scaling(unit), 0)?,
        None => {
            for geometry in root.descendants().filter(|node| node.tag_name().name() == "geometry") {
                scene.geometry(geometry, None, Matrix4::new_scaling(unit))?;
            }
        }
    }
    Ok(scene.parts)
}

/// Returns the first child element with a name.
fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.tag_name().name() == name)
}

/// Points, and triangles as indices of points.
type Soup = (Vec<[f64; 3]>, Vec<Triangle>);

struct Scene<'a, 'i> {
    ids: HashMap<&'a str, Node<'a, 'i>>,
    parts: Vec<Part>,
    triangles: usize,
    nodes: usize,
}

impl<'a, 'i> Scene<'a, 'i> {
    /// Returns the element whose address in the file is `url`.
    fn named(&self, url: &str) -> Option<Node<'a, 'i>> {
        self.ids.get(url.strip_prefix('#')?).copied()
    }

    /// Adds the geometries of a node and of all nodes below it. `to_world` is the pose of the parent node.
    fn visit(&mut self, node: Node<'a, 'i>, mut to_world: Matrix4<f64>, depth: usize) -> Result<(), String> {
        self.nodes += 1;
        if depth > DEEPEST || self.nodes > MOST_NODES {
            return Err(format!("is nested deeper than {DEEPEST}, or has more than {MOST_NODES} instances of nodes"));
        }
        for inner in node.children() {
            if let Some(transform) = transform(inner)? {
                to_world *= transform;
            }
        }
        for inner in node.children() {
            let target = || inner.attribute("url").and_then(|url| self.named(url));
            match inner.tag_name().name() {
                "node" => self.visit(inner, to_world, depth + 1)?,
                "instance_node" => target().map_or(Ok(()), |node| self.visit(node, to_world, depth + 1))?,
                "instance_geometry" => {
                    target().map_or(Ok(()), |geometry| self.geometry(geometry, Some(inner), to_world))?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Adds the triangles of a geometry. `instance` maps the symbols of materials to materials.
    fn geometry(
        &mut self,
        geometry: Node<'a, 'i>,
        instance: Option<Node<'a, 'i>>,
        to_world: Matrix4<f64>,
    ) -> Result<(), String> {
        let Some(mesh) = child(geometry, "mesh") else { return Ok(()) };
        for primitive in mesh.children() {
            if !matches!(primitive.tag_name().name(), "triangles" | "polylist" | "polygons") {
                continue; // this element has lines, not triangles
            }
            let Some((points, triangles)) = self.primitive(primitive)? else { continue };
            let color = primitive.attribute("material").and_then(|symbol| self.color(instance, symbol));
            self.triangles += triangles.len();
            full(self.triangles)?;
            let place = |p: &[f64; 3]| -> [f64; 3] { to_world.transform_point(&Point3::from(*p)).coords.into() };
            let mut part = Part::of(&points, triangles, color);
            part.points = part.points.iter().map(place).collect();
            self.parts.push(part);
        }
        Ok(())
    }

    /// Returns the points and triangles of a primitive. Polygons are split into fans of triangles. Returns `None` if
    /// the primitive has no vertices.
    fn primitive(&self, primitive: Node<'a, 'i>) -> Result<Option<Soup>, String> {
        let (mut stride, mut offset, mut vertices) = (1, 0, None);
        for input in primitive.children().filter(|node| node.tag_name().name() == "input") {
            let at = input.attribute("offset").and_then(|n| n.parse::<usize>().ok()).unwrap_or(0);
            if at > 64 {
                return Err(format!("an input has the offset {at}"));
            }
            stride = stride.max(at + 1);
            if input.attribute("semantic") == Some("VERTEX") {
                (offset, vertices) = (at, input.attribute("source").and_then(|source| self.named(source)));
            }
        }
        let position = vertices.and_then(|vertices| {
            let mut inputs = vertices.children().filter(|node| node.tag_name().name() == "input");
            self.named(inputs.find(|input| input.attribute("semantic") == Some("POSITION"))?.attribute("source")?)
        });
        let Some(array) = position.and_then(|source| child(source, "float_array")?.text()) else { return Ok(None) };
        let mut points = Vec::new();
        let mut words = Words::new(array);
        while words.rest().is_some() {
            points.push(words.numbers().ok_or("a position is no three finite numbers")?);
        }
        let mut counts = child(primitive, "vcount").and_then(|node| node.text()).map(Words::new);
        let polygons = primitive.tag_name().name() == "polygons";
        let mut triangles = Vec::new();
        for list in primitive.children().filter(|node| node.tag_name().name() == "p") {
            let mut words = Words::new(list.text().unwrap_or_default());
            let mut corner = || -> Result<Option<u32>, String> {
                let mut found = None;
                for k in 0..stride {
                    let Some(word) = words.next() else { return Ok(None) };
                    if k == offset {
                        let index = word.parse::<u32>().ok().filter(|i| (*i as usize) < points.len());
                        found = Some(index.ok_or_else(|| format!("no vertex is `{word}`"))?);
                    }
                }
                Ok(found)
            };
            loop {
                let sides = match &mut counts {
                    Some(counts) => match counts.next().map(str::parse::<usize>) {
                        Some(Ok(sides)) => sides,
                        Some(Err(_)) => return Err("a <vcount> is no number".to_owned()),
                        None => break,
                    },
                    None if polygons => usize::MAX,
                    None => 3,
                };
                let Some(first) = corner()? else { break };
                let mut before = None;
                for _ in 1..sides {
                    let Some(next) = corner()? else { break };
                    if let Some(before) = before {
                        triangles.push([first, before, next]);
                        full(self.triangles + triangles.len())?;
                    }
                    before = Some(next);
                }
            }
        }
        Ok(Some((points, triangles)))
    }

    /// Returns the diffuse colour of the material that is bound to a symbol.
    fn color(&self, instance: Option<Node<'a, 'i>>, symbol: &str) -> Option<[f64; 3]> {
        let bound = instance.and_then(|instance| {
            instance.descendants().find(|n| n.attribute("symbol") == Some(symbol))?.attribute("target")
        });
        let material = bound.map_or_else(|| self.ids.get(symbol).copied(), |target| self.named(target))?;
        let effect = self.named(child(material, "instance_effect")?.attribute("url")?)?;
        let diffuse = effect.descendants().find(|node| node.tag_name().name() == "diffuse")?;
        Words::new(child(diffuse, "color")?.text()?).numbers()
    }
}

/// Returns the transform that a child element of a node describes; `None` if this element is not a transform.
fn transform(node: Node) -> Result<Option<Matrix4<f64>>, String> {
    let name = node.tag_name().name();
    if !matches!(name, "matrix" | "translate" | "rotate" | "scale") {
        return Ok(None);
    }
    let mut words = Words::new(node.text().unwrap_or_default());
    let mut numbers = Vec::new();
    while let Some(x) = words.number().filter(|_| numbers.len() < 16) {
        numbers.push(x);
    }
    Ok(Some(match (name, &*numbers) {
        ("matrix", n) if n.len() == 16 => Matrix4::from_row_slice(n),
        ("translate", &[x, y, z]) => Translation3::new(x, y, z).to_homogeneous(),
        ("scale", &[x, y, z]) => Matrix4::new_nonuniform_scaling(&Vector3::new(x, y, z)),
        ("rotate", &[x, y, z, degrees]) => match Unit::try_new(Vector3::new(x, y, z), 1e-12) {
            Some(axis) => Rotation3::from_axis_angle(&axis, degrees.to_radians()).to_homogeneous(),
            None => Matrix4::identity(),
        },
        _ => return Err(format!("a <{name}> has {} numbers", numbers.len())),
    }))
}

#[cfg(test)]
mod tests {
    use super::read;

    const TEXT: &str = r##"<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<asset><unit meter="0.5"/><up_axis>Y_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique><phong><diffuse><color>0.1 0.2 0.3 1</color></diffuse></phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<polylist material="sym" count="1"><input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/><vcount>4</vcount><p>0 9 1 9 2 9 3 9</p></polylist>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node id="n1"><translate>0 0 2</translate><rotate>0 0 1 90</rotate><scale>2 2 2</scale>
<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="sym" target="#m"/></technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>"##;

    #[test]
    fn polygons_are_moved_scaled_and_coloured() {
        let parts = read(TEXT).unwrap();
        assert_eq!(parts.len(), 2);
        assert_eq!((parts[0].triangles.len(), parts[0].color), (2, Some([0.1, 0.2, 0.3])));
        assert_eq!((parts[1].triangles.len(), parts[1].color), (1, None));
        // The point (1, 0, 0) is scaled by 2, rotated to the y axis and raised by 2. Then all coordinates are
        // multiplied by the unit 0.5.
        let p = parts[1].points[1];
        assert!(p.iter().zip([0.0, 1.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{p:?}");
    }

    #[test]
    fn faults_are_reported() {
        let node = r##"<node id="n1">"##;
        for (from, to, said) in [
            ("<p>0 1 2</p>", "<p>0 1 7</p>", "no vertex is `7`"),
            ("0 1 0</float", "0 1</float", "three finite numbers"),
            ("<vcount>4", "<vcount>x", "<vcount>"),
            ("90</rotate>", "</rotate>", "<rotate> has 3"),
            (r##"#v" offset="0"/><p>"##, r##"#v" offset="99999999"/><p>"##, "offset"),
            (node, &(node.to_owned() + r##"<instance_node url="#n1"/>"##), "deeper"),
            ("</COLLADA>", "", "never closed"),
        ] {
            let text = TEXT.replace(from, to);
            match read(&text) {
                Err(error) => assert!(error.contains(said), "{error}"),
                Ok(_) => assert_eq!(text, TEXT, "{from}"),
            }
        }
        assert!(read("<robot/>").unwrap_err().contains("<COLLADA>"));
    }
}
