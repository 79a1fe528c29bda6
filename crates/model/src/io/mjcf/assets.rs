//! Meshes and height fields in `<asset>`.

use super::attributes::Attributes;
use super::mesh::Solid;
use crate::error::Error;
use crate::io::xml::Element;
use std::collections::HashMap;

#[cfg(feature = "meshes")]
use {
    super::Source,
    super::attributes::MAIN,
    super::mesh::Rule,
    crate::io::files,
    condyle_meshes::Format,
    condyle_spatial::{Quaternion, Vec3},
    std::path::{Path, PathBuf},
};

/// Maximum size of all mesh files of a robot together (bytes).
#[cfg(feature = "meshes")]
const MAX_MESHES: u64 = 512 << 20;

/// Assets of a file, by name.
pub(super) struct Assets<'a> {
    meshes: HashMap<String, &'a Element>,
    fields: HashMap<String, &'a Element>,
}

impl<'a> Assets<'a> {
    /// Collects the assets of a file. An asset without a name gets the name of its file, without folder and extension.
    pub(super) fn read(root: &'a Element) -> Result<Self, Error> {
        let all = |tag: &'static str| root.all("asset").flat_map(move |section| section.all(tag));
        for tag in ["mesh", "hfield"] {
            super::names(all(tag))?;
        }
        let of = |tag: &'static str| {
            all(tag).filter_map(|e| {
                Some((e.attribute("name").map(str::to_owned).or_else(|| stem(e.attribute("file")?))?, e))
            })
        };
        Ok(Self { meshes: of("mesh").collect(), fields: of("hfield").collect() })
    }

    /// Returns the `<mesh>` that a geom names; `None` if the geom names no mesh.
    pub(super) fn mesh(&self, a: &Attributes) -> Result<Option<&'a Element>, Error> {
        Self::find(&self.meshes, a, "mesh")
    }

    /// Returns half the side lengths (m) of the box that has the mass of a height field. The box contains the base of
    /// the field and half of its height.
    pub(super) fn field(&self, a: &Attributes) -> Result<Option<[f64; 3]>, Error> {
        let Some(field) = Self::find(&self.fields, a, "hfield")? else { return Ok(None) };
        let size = Attributes::plain(field).array("size")?;
        let [x, y, height, base]: [f64; 4] = size.ok_or_else(|| field.lacks("size"))?;
        Ok(Some([x, y, 0.25 * height + 0.5 * base]))
    }

    fn find(all: &HashMap<String, &'a Element>, a: &Attributes, kind: &str) -> Result<Option<&'a Element>, Error> {
        let Some(name) = a.get(kind) else { return Ok(None) };
        let found = all.get(name).copied();
        found.map(Some).ok_or_else(|| a.element.wrong(format!("{kind}: no <{kind}> of <asset> is named `{name}`")))
    }
}

/// Returns the name of a file without folder and extension.
fn stem(file: &str) -> Option<String> {
    let name = file.rsplit(['/', '\\']).next()?;
    Some(name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned())
}

/// Inertias of meshes that have been read, and the size of their files together (bytes).
#[derive(Default)]
pub(super) struct Solids {
    #[cfg(feature = "meshes")]
    known: HashMap<*const Element, Result<Solid, String>>,
    #[cfg(feature = "meshes")]
    bytes: u64,
}

#[cfg(not(feature = "meshes"))]
impl Solids {
    /// Returns an error, because this build cannot read meshes.
    pub(super) fn get<T, U>(&mut self, _: &T, _: &Element, _: &[U]) -> Result<Solid, String> {
        Err("this build reads no meshes (feature `meshes`)".to_owned())
    }
}

#[cfg(feature = "meshes")]
impl Solids {
    /// Returns the inertia of a `<mesh>`, or a description of its fault.
    pub(super) fn get(&mut self, source: &Source, mesh: &Element, packages: &[PathBuf]) -> Result<Solid, String> {
        let key = std::ptr::from_ref(mesh);
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let found = self.read(source, mesh, packages);
        self.known.insert(key, found.clone());
        found
    }

    fn read(&mut self, source: &Source, mesh: &Element, packages: &[PathBuf]) -> Result<Solid, String> {
        let said = |e: Error| e.to_string();
        let a = source.defaults.of(mesh, MAIN).map_err(said)?;
        if mesh.child("plugin").is_some() {
            return Err("plugin: meshes of plugins are not supported".to_owned());
        }
        let list = |name: &str| a.list(name).map(Option::unwrap_or_default).map_err(said);
        let builtin = a.get("builtin").filter(|kind| *kind != "none");
        if builtin.is_some() && (a.get("file").is_some() || a.get("vertex").is_some()) {
            return Err("builtin goes with neither file nor vertex".to_owned());
        }
        let ((mut points, mut triangles), lost) = match (builtin, a.get("file")) {
            (Some(kind), _) => (super::builtin::shape(kind, &list("params")?)?, 0),
            (None, Some(file)) => self.file(source, &a, file, packages)?,
            (None, None) => Default::default(),
        };
        if points.is_empty() {
            let numbers = list("vertex")?;
            points = numbers.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        }
        if triangles.is_empty() {
            let corner = |x: f64| if x.fract() == 0.0 && x >= 0.0 { x as u32 } else { u32::MAX };
            triangles = list("face")?.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(corner)).collect();
        }
        if let Some(t) = triangles.iter().flatten().find(|&&k| k as usize >= points.len()) {
            return Err(format!("face: there is no vertex {t}, of {}", points.len()));
        }
        let at = |name: &str| a.vector(name).map_err(said);
        let (scale, origin) = (at("scale")?.unwrap_or(Vec3::new(1.0, 1.0, 1.0)), at("refpos")?.unwrap_or(Vec3::zero()));
        let [w, x, y, z] = a.array("refquat").map_err(said)?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let R = Quaternion::new(x, y, z, w).normalize().to_rotation();
        let placed = |p: &[f64; 3]| {
            // MuJoCo reads the coordinates in single precision.
            let p = R.transpose_mul(Vec3::from(p.map(|x| f64::from(x as f32))) - origin);
            Vec3::new(p.x * scale.x, p.y * scale.y, p.z * scale.z)
        };
        let points: Vec<_> = points.iter().map(placed).collect();
        if scale.x * scale.y * scale.z < 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2)); // mirroring turns triangles inside out
        }
        let exact = if source.compiler.exact_meshes { "exact" } else { "legacy" };
        let rule = if builtin == Some("plate") { "shell" } else { a.get("inertia").unwrap_or(exact) };
        let rule = Rule::of(rule).ok_or_else(|| format!("inertia: no rule is named `{rule}`"))?;
        Ok(Solid { lost, ..Solid::new(&points, triangles, rule)? })
    }

    /// Returns the points and triangles in the file of a mesh, and the number of faces from which triangles are left
    /// out.
    fn file(
        &mut self,
        source: &Source,
        a: &Attributes,
        file: &str,
        packages: &[PathBuf],
    ) -> Result<(condyle_meshes::Triangles, usize), String> {
        let folder = source.folder.ok_or_else(|| format!("a string has no folder to find `{file}` in"))?;
        let name = if source.compiler.strip_path { file.rsplit(['/', '\\']).next().unwrap_or(file) } else { file };
        // Searches in the same folders as MuJoCo: first in the folder of meshes, then in the folder of the file that
        // contains the element.
        let beside = Path::new(&*a.element.file).parent().unwrap_or(folder);
        let meshes = &source.compiler.mesh_folder;
        let mut paths = Vec::new();
        for folder in [folder.join(meshes), beside.to_owned(), beside.join(meshes)] {
            paths.push(files::resolve(name, &folder, packages).map_err(|e| e.to_string())?);
        }
        let path = paths.iter().find(|path| path.is_file()).unwrap_or(&paths[0]);
        let said = |what: String| format!("`{}`: {what}", path.display());
        let about = std::fs::metadata(path).map_err(|e| said(e.to_string()))?;
        self.bytes += about.len();
        if !about.is_file() || self.bytes > MAX_MESHES {
            let what = format!("is no file, or the meshes of the robot have more than {MAX_MESHES} bytes");
            return Err(said(what));
        }
        let bytes = std::fs::read(path).map_err(|e| said(e.to_string()))?;
        let format = match a.get("content_type").and_then(|kind| kind.rsplit_once('/')) {
            Some((_, "obj")) => Some(Format::Obj),
            Some((_, "stl")) => Some(Format::Stl),
            Some((_, "vnd.mujoco.msh")) => None,
            _ if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("msh")) => None,
            _ => {
                // Accepts only OBJ and STL here: MuJoCo cannot read COLLADA, and Condyle reads COLLADA only for web
                // pages.
                let known = Format::of(path).filter(|format| [Format::Obj, Format::Stl].contains(format));
                Some(known.ok_or_else(|| said("is no STL, OBJ or MSH".to_owned()))?)
            }
        };
        match format {
            Some(format) => condyle_meshes::cut_triangles(format, &bytes),
            None => msh(&bytes).map(|triangles| (triangles, 0)),
        }
        .map_err(said)
    }
}

/// Returns the points and triangles in a file of MuJoCo's own format. The file contains the numbers of points, normals,
/// coordinates of textures and triangles, and then these items.
#[cfg(feature = "meshes")]
fn msh(bytes: &[u8]) -> Result<condyle_meshes::Triangles, String> {
    let words: Vec<[u8; 4]> = bytes.chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect();
    let count = |k: usize| words.get(k).map_or(0, |w| u64::from(u32::from_le_bytes(*w)));
    let [points, normals, textures, triangles] = [0, 1, 2, 3].map(count);
    let length = 4 + 3 * (points + normals + triangles) + 2 * textures;
    if bytes.len() as u64 != 4 * length {
        return Err(format!("is no MSH: {length} words are needed, there are {} bytes", bytes.len()));
    }
    let number = |w: &[u8; 4]| f64::from(f32::from_le_bytes(*w));
    let (points, triangles) = (points as usize, triangles as usize);
    let corners = words[words.len() - 3 * triangles..].chunks_exact(3);
    Ok((
        words[4..4 + 3 * points].chunks_exact(3).map(|p| [number(&p[0]), number(&p[1]), number(&p[2])]).collect(),
        corners.map(|t| [0, 1, 2].map(|k| u32::from_le_bytes(t[k]))).collect(),
    ))
}
