//! Meshes for the web pages that show robots. Mesh files are found, read, simplified and written into the page.
//!
//! A page has at most 60 000 triangles, for any size of the mesh files. If the files contain more triangles, the
//! largest parts are simplified first. The coordinates of a point are 16-bit numbers relative to the bounding box of
//! its part. Meshes that cannot be found or read are left out with a note, because a page is useful without them.
//!
//! Without the feature `page`, the crate only reads triangles (STL, OBJ) and computes convex hulls.
//!
#![cfg_attr(feature = "page", doc = "```")]
#![cfg_attr(not(feature = "page"), doc = "```ignore")]
//! use condyle_meshes::{Meshes, Places};
//!
//! let mut meshes = Meshes::new(Places { folder: Some("robot/urdf".into()), packages: vec![] });
//! let drawn = meshes.get("package://robot/meshes/hip.dae"); // its parts, with the colours of their materials
//! assert!(drawn.is_empty() && meshes.note().unwrap().starts_with("1 of 1 meshes are left out: no `package://"));
//! assert!(meshes.written().is_empty()); // what goes into a page, by the parts' numbers
//! ```
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(feature = "page")]
mod dae;
mod ears;
#[cfg(feature = "page")]
mod find;
mod hull;
#[cfg(feature = "page")]
pub mod mjcf;
mod obj;
#[cfg(feature = "page")]
mod page;
mod part;
#[cfg(feature = "page")]
mod simplify;
mod stl;

#[cfg(feature = "page")]
pub use find::Places;
pub use hull::hull;
#[cfg(feature = "page")]
pub use page::{Drawn, Meshes};
use part::Part;
use std::path::Path;

/// Format of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// STL: triangles, binary or as text.
    Stl,
    /// Wavefront OBJ, with its material files.
    Obj,
    /// COLLADA.
    #[cfg(feature = "page")]
    Dae,
}

/// Returns the points of a mesh, and its triangles as indices of points, counter-clockwise if seen from outside. The
/// mesh is not simplified. For an OBJ with several objects or groups, returns the triangles of the first object or
/// group and all points, as MuJoCo does. As in MuJoCo, faces with more than 100 corners are left out, and so are parts
/// of faces from which no ear can be cut.
///
/// # Errors
/// Returns a description of the fault, with the line number for an OBJ or an STL in text form.
pub fn triangles(format: Format, bytes: &[u8]) -> Result<Triangles, String> {
    cut_triangles(format, bytes).map(|(triangles, _)| triangles)
}

/// Returns the result of [`triangles`], and the number of OBJ faces from which triangles are left out.
///
/// # Errors
/// Returns the same errors as [`triangles`].
#[doc(hidden)]
pub fn cut_triangles(format: Format, bytes: &[u8]) -> Result<(Triangles, usize), String> {
    let (mut points, mut triangles, mut lost) = (Vec::new(), Vec::new(), 0);
    if format == Format::Obj {
        ((points, triangles), lost) = obj::first(&text(bytes))?;
    } else {
        for part in format.read(bytes, &|_| None)? {
            let first = points.len() as u32;
            points.extend(part.points);
            triangles.extend(part.triangles.into_iter().map(|t| t.map(|corner| first + corner)));
        }
    }
    Ok(((points, triangles), lost))
}

/// Decodes a text, and removes the byte order mark that some editors write at its start.
fn text(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes))
}

/// Points, and triangles as indices of points.
pub type Triangles = (Vec<[f64; 3]>, Vec<[u32; 3]>);

impl Format {
    /// Returns the format that belongs to the extension of a path.
    pub fn of(path: &Path) -> Option<Self> {
        match &*path.extension()?.to_str()?.to_lowercase() {
            "stl" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            #[cfg(feature = "page")]
            "dae" => Some(Self::Dae),
            _ => None,
        }
    }

    /// Reads the parts of a file, and checks that all coordinates are finite.
    pub(crate) fn read(self, bytes: &[u8], library: &dyn Fn(&str) -> Option<String>) -> Result<Vec<Part>, String> {
        let parts = match self {
            Self::Stl => stl::read(bytes)?,
            Self::Obj => obj::read(&text(bytes), library)?,
            #[cfg(feature = "page")]
            Self::Dae => dae::read(&text(bytes))?,
        };
        match parts.iter().flat_map(|part| &part.points).flatten().all(|x| x.abs() < 1e30) {
            true => Ok(parts),
            false => Err("has a coordinate that is not finite".to_owned()),
        }
    }
}

/// Code block of the README, run as a doctest.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
