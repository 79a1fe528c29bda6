//! Collection of the meshes that a web page shows.

use super::Format;
use super::find::Places;
use super::part::Part;
use super::simplify;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Maximum number of triangles of a page.
const MOST: usize = 60_000;
/// Maximum number of triangles of a part. A part then has at most 60 000 points, so 16 bits suffice for the index of a
/// point.
const MOST_OF_PART: usize = 20_000;
/// Smallest number of triangles to which a part is reduced.
const FEWEST: usize = 12;
/// Maximum number of parts of a page.
const MOST_PARTS: usize = MOST / FEWEST;
/// Maximum size of one file (bytes).
const LARGEST: u64 = 64 << 20;
/// Maximum size of all files together (bytes).
const LARGEST_SUM: u64 = 512 << 20;

/// Collection of meshes for a web page.
#[derive(Default)]
pub struct Meshes {
    places: Places,
    parts: Vec<Part>,
    /// Indices of the parts of each file. The range is empty if the file could not be read.
    files: HashMap<PathBuf, Range<usize>>,
    read: u64,
    wanted: usize,
    /// Reason why the first missing mesh is left out, and number of meshes that are left out.
    missing: Option<(String, usize)>,
}

/// Part of a mesh, with the colour that the file gives it.
pub struct Drawn {
    /// Index of the part in the [written](Meshes::written) list.
    pub part: usize,
    /// Red, green and blue, each from 0 to 1.
    pub color: Option<[f64; 3]>,
}

impl Meshes {
    /// Creates an empty collection. Files will be searched in `places`.
    pub fn new(places: Places) -> Self {
        Self { places, ..Self::default() }
    }

    /// Returns the parts to draw for a mesh. The list is empty if the file of the mesh is missing or invalid.
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

    /// Returns the parts to draw for a mesh in memory. `library` returns the text of a material file, given its name.
    ///
    /// # Errors
    /// Returns a description of the fault, with the line number for an OBJ or an STL in text form.
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

    /// Simplifies the parts of a mesh, and stores those parts that still have triangles.
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

    /// Returns one line about the meshes that are left out; `None` if no mesh is left out.
    pub fn note(&self) -> Option<String> {
        let (what, count) = self.missing.as_ref()?;
        Some(format!("{count} of {} meshes are left out: {what}", self.wanted))
    }

    /// Returns all parts, simplified for a page. Points and triangles are 16-bit numbers in base64. A number n of a
    /// point encodes the coordinate `low + side n / 65535`.
    pub fn written(self) -> Vec<Value> {
        let most = triangles_kept(self.parts.iter().map(|part| part.triangles.len()).collect());
        let small = |part: Part| {
            if part.triangles.len() > most { simplify::simplify(&part, most.max(FEWEST)) } else { part }
        };
        self.parts.into_iter().map(|part| encode(&small(part))).collect()
    }
}

/// Returns the largest limit on the triangles of each part for which all parts together have at most [`MOST`]
/// triangles.
fn triangles_kept(mut counts: Vec<usize>) -> usize {
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

fn encode(part: &Part) -> Value {
    let (low, high) = simplify::bounds(&part.points);
    let side = [0, 1, 2].map(|k| high[k] - low[k]);
    let number = |p: &[f64; 3], k: usize| {
        if side[k] > 0.0 { (65535.0 * (p[k] - low[k]) / side[k]).round() as u16 } else { 0 }
    };
    let points = part.points.iter().flat_map(|p| [0, 1, 2].map(|k| number(p, k)));
    // Corner indices are below 3 `MOST_OF_PART`, so they fit in 16 bits.
    let corners = part.triangles.iter().flatten().map(|&c| c as u16);
    json!({"low": low, "side": side, "points": base64(points), "triangles": base64(corners)})
}

/// Encodes 16-bit numbers in base64, with the low byte first.
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
    use super::{MOST, base64, triangles_kept};

    #[test]
    fn letters_as_everybody_writes_them() {
        let numbers = |text: &[u8]| text.chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect::<Vec<_>>();
        assert_eq!(base64(numbers(b"Manyha").into_iter()), "TWFueWhh");
        assert_eq!(base64(numbers(b"Many").into_iter()), "TWFueQ==");
        assert_eq!(base64(numbers(b"Ma").into_iter()), "TWE=");
    }

    #[test]
    fn small_parts_stay_whole() {
        assert_eq!(triangles_kept(vec![]), MOST);
        assert_eq!(triangles_kept(vec![100, 200]), MOST);
        let counts = vec![10, 50_000, 20_000, 50_000];
        let most = triangles_kept(counts.clone());
        assert!(most == 19_996 && counts.iter().map(|&n| n.min(most)).sum::<usize>() <= MOST);
    }
}
