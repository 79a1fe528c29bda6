//! The meshes that a page shows: found, read, made small, and written for it.
//!
//! A page has at most 60 000 triangles, whatever its robot's files have: edges collapse in the largest parts first. Their
//! points have 16 bits along each side of their box. What cannot be found or read is left out with a note: nothing needs it.
//!
//! ```
//! use condyle_meshes::{Meshes, Places};
//!
//! let mut meshes = Meshes::new(Places { folder: Some("robot/urdf".into()), packages: vec![] });
//! let drawn = meshes.get("package://robot/meshes/hip.dae"); // its parts, with the colours of their materials
//! assert!(drawn.is_empty() && meshes.note().unwrap().starts_with("1 of 1 meshes are left out: no `package://"));
//! assert!(meshes.written().is_empty()); // what goes into a page, by the parts' numbers
//! ```

mod dae;
mod find;
mod hull;
pub mod mjcf;
mod obj;
mod part;
mod simplify;
mod stl;

pub use find::Places;
pub use hull::hull;
use part::Part;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The most triangles of a page, and of one of its parts, whose corners have numbers of 16 bits.
const MOST: usize = 60_000;
const MOST_OF_PART: usize = 20_000;
/// The fewest triangles that are left of a part, and the most parts.
const FEWEST: usize = 12;
const MOST_PARTS: usize = MOST / FEWEST;
/// The largest file that is read, and all of them together (bytes).
const LARGEST: u64 = 64 << 20;
const LARGEST_SUM: u64 = 512 << 20;

/// Meshes on their way into a page.
#[derive(Default)]
pub struct Meshes {
    places: Places,
    parts: Vec<Part>,
    /// The numbers of a file's parts; nothing where it could not be read.
    files: HashMap<PathBuf, Range<usize>>,
    read: u64,
    wanted: usize,
    /// Why meshes are left out: the first of the reasons, and how many they are.
    missing: Option<(String, usize)>,
}

/// A part of a mesh, by its number; with the colour that its file gives it.
pub struct Drawn {
    /// Its number in what is [written](Meshes::written).
    pub part: usize,
    /// Red, green and blue from 0 to 1.
    pub color: Option<[f64; 3]>,
}

impl Meshes {
    /// None yet; their files are looked for in these places.
    pub fn new(places: Places) -> Self {
        Self { places, ..Self::default() }
    }

    /// What is to be drawn for a mesh; nothing where its file is missing or wrong.
    pub fn get(&mut self, address: &str) -> Vec<Drawn> {
        self.wanted += 1;
        let parts = match self.load(address) {
            Ok(parts) => parts,
            Err(what) => {
                self.missing.get_or_insert((what, 0)).1 += 1;
                0..0
            }
        };
        self.drawn(parts)
    }

    /// What is to be drawn for a mesh that is in memory; `library` gives the text of a file of materials by its name.
    ///
    /// # Errors
    /// What is wrong with it, with the line if it is an OBJ or an STL of text.
    pub fn add(
        &mut self,
        format: Format,
        bytes: &[u8],
        library: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Vec<Drawn>, String> {
        let parts = self.keep(format, bytes, library)?;
        Ok(self.drawn(parts))
    }

    fn drawn(&self, parts: Range<usize>) -> Vec<Drawn> {
        parts.map(|part| Drawn { part, color: self.parts[part].color }).collect()
    }

    fn load(&mut self, address: &str) -> Result<Range<usize>, String> {
        let found = self.places.find(address)?;
        let path = found.canonicalize().unwrap_or(found);
        if let Some(parts) = self.files.get(&path) {
            return if parts.is_empty() { Err(format!("`{address}` shows nothing")) } else { Ok(parts.clone()) };
        }
        self.files.insert(path.clone(), 0..0);
        let parts = self.load_from(&path).map_err(|what| format!("`{}`: {what}", path.display()))?;
        self.files.insert(path, parts.clone());
        Ok(parts)
    }

    fn load_from(&mut self, path: &Path) -> Result<Range<usize>, String> {
        let about = std::fs::metadata(path).map_err(|error| error.to_string())?;
        if !about.is_file() || about.len() > LARGEST {
            return Err(format!("is no regular file of at most {LARGEST} bytes"));
        }
        self.read += about.len();
        if self.read > LARGEST_SUM {
            return Err(format!("all meshes together have more than {LARGEST_SUM} bytes"));
        }
        let format = Format::of(path).ok_or("is no STL, DAE or OBJ")?;
        let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
        self.keep(format, &bytes, &|name| {
            let file = path.parent()?.join(name);
            let about = std::fs::metadata(&file).ok()?;
            (about.is_file() && about.len() < LARGEST)
                .then(|| std::fs::read(file).ok())?
                .map(|b| String::from_utf8_lossy(&b).into_owned())
        })
    }

    /// Keeps the parts of a mesh that have triangles, made small.
    fn keep(
        &mut self,
        format: Format,
        bytes: &[u8],
        library: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Range<usize>, String> {
        let parts = format.read(bytes, library)?;
        let first = self.parts.len();
        if first + parts.len() > MOST_PARTS {
            return Err(format!("all meshes together have more than {MOST_PARTS} parts"));
        }
        let parts = parts.iter().map(|part| simplify::simplify(part, MOST_OF_PART));
        self.parts.extend(parts.filter(|part| !part.triangles.is_empty()));
        if self.parts.len() == first {
            return Err("has no triangle".to_owned());
        }
        Ok(first..self.parts.len())
    }

    /// One line on what is left out, if anything is.
    pub fn note(&self) -> Option<String> {
        let (what, count) = self.missing.as_ref()?;
        Some(format!("{count} of {} meshes are left out: {what}", self.wanted))
    }

    /// All parts, small enough for a page: points and triangles as base64 of 16-bit numbers; a point is
    /// `low + side n / 65535`.
    pub fn written(self) -> Vec<Value> {
        let most = level(self.parts.iter().map(|part| part.triangles.len()).collect());
        let small = |part: Part| {
            if part.triangles.len() > most { simplify::simplify(&part, most.max(FEWEST)) } else { part }
        };
        self.parts.into_iter().map(|part| encode(&small(part))).collect()
    }
}

/// The most triangles that each part may have, so that all together have no more than [`MOST`].
fn level(mut counts: Vec<usize>) -> usize {
    counts.sort_unstable();
    let mut left = MOST;
    for (k, &count) in counts.iter().enumerate() {
        let share = left / (counts.len() - k);
        if count > share {
            return share;
        }
        left -= count;
    }
    MOST
}

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Triangles, binary or as text.
    Stl,
    /// Wavefront's, with its files of materials.
    Obj,
    /// COLLADA.
    Dae,
}

/// The points of a mesh, and its triangles by the points' indices, counter-clockwise from outside; nothing is made smaller. Of
/// an OBJ with several objects or groups, triangles of the first one and points of all: as MuJoCo reads it.
///
/// # Errors
/// The fault of the file, with the line if it is an OBJ or an STL of text.
pub fn triangles(format: Format, bytes: &[u8]) -> Result<Triangles, String> {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    if format == Format::Obj {
        (points, triangles) = obj::first(&text(bytes))?;
    } else {
        for part in format.read(bytes, &|_| None)? {
            let first = points.len() as u32;
            points.extend(part.points);
            triangles.extend(part.triangles.into_iter().map(|t| t.map(|corner| first + corner)));
        }
    }
    Ok((points, triangles))
}

/// A text without the mark of byte order that some editors put first.
fn text(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes))
}

/// Corners, and triangles by the corners' indices.
pub type Triangles = (Vec<[f64; 3]>, Vec<[u32; 3]>);

impl Format {
    /// The format that a file's ending says it has.
    pub fn of(path: &Path) -> Option<Self> {
        match &*path.extension()?.to_str()?.to_lowercase() {
            "stl" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            "dae" => Some(Self::Dae),
            _ => None,
        }
    }

    /// The parts of a file, whose points are numbers.
    fn read(self, bytes: &[u8], library: &dyn Fn(&str) -> Option<String>) -> Result<Vec<Part>, String> {
        let parts = match self {
            Self::Stl => stl::read(bytes)?,
            Self::Obj => obj::read(&text(bytes), library)?,
            Self::Dae => dae::read(&text(bytes))?,
        };
        match parts.iter().flat_map(|part| &part.points).flatten().all(|x| x.abs() < 1e30) {
            true => Ok(parts),
            false => Err("has a coordinate that is not finite".to_owned()),
        }
    }
}

fn encode(part: &Part) -> Value {
    let (low, high) = simplify::bounds(&part.points);
    let side = [0, 1, 2].map(|k| high[k] - low[k]);
    let number = |p: &[f64; 3], k: usize| {
        if side[k] > 0.0 { (65535.0 * (p[k] - low[k]) / side[k]).round() as u16 } else { 0 }
    };
    let points = part.points.iter().flat_map(|p| [0, 1, 2].map(|k| number(p, k)));
    // Corners have numbers below 3 MOST_OF_PART, which 16 bits hold.
    let corners = part.triangles.iter().flatten().map(|&c| c as u16);
    json!({"low": low, "side": side, "points": base64(points), "triangles": base64(corners)})
}

/// Numbers in base64, each with its lower byte first.
fn base64(numbers: impl Iterator<Item = u16>) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let bytes: Vec<u8> = numbers.flat_map(u16::to_le_bytes).collect();
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let at = |k: usize| u32::from(three.get(k).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        for k in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * k)) as usize & 63];
            text.push(if k > three.len() { '=' } else { char::from(letter) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{MOST, base64, level};

    #[test]
    fn letters_as_everybody_writes_them() {
        let numbers = |text: &[u8]| text.chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect::<Vec<_>>();
        assert_eq!(base64(numbers(b"Manyha").into_iter()), "TWFueWhh");
        assert_eq!(base64(numbers(b"Many").into_iter()), "TWFueQ==");
        assert_eq!(base64(numbers(b"Ma").into_iter()), "TWE=");
    }

    #[test]
    fn small_parts_stay_whole() {
        assert_eq!(level(vec![]), MOST);
        assert_eq!(level(vec![100, 200]), MOST);
        let counts = vec![10, 50_000, 20_000, 50_000];
        let most = level(counts.clone());
        assert!(most == 19_996 && counts.iter().map(|&n| n.min(most)).sum::<usize>() <= MOST);
    }
}
