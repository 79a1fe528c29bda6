//! Reader of OBJ (Wavefront): faces with any number of corners, and the diffuse colours of their material files.

use super::ears::Ears;
use super::part::{Part, Triangle, Words, full};
use std::collections::HashMap;

/// Colour, and the triangles that have this colour.
type Group = (Option<[f64; 3]>, Vec<Triangle>);

/// Contents of an OBJ.
struct Mesh {
    points: Vec<[f64; 3]>,
    /// Triangles by material.
    groups: Vec<Group>,
    /// Number of faces from which triangles are left out.
    lost: usize,
}

/// Returns the triangles of an OBJ, in one part for each material. `library` returns the text of a material file, given
/// its name.
pub(super) fn read(text: &str, library: &dyn Fn(&str) -> Option<String>) -> Result<Vec<Part>, String> {
    let Mesh { points, groups, .. } = parse(text, library, false)?;
    let part = |(color, triangles): Group| Part::of(&points, triangles, color);
    Ok(groups.into_iter().filter(|group| !group.1.is_empty()).map(part).collect())
}

/// Returns all points of an OBJ, the triangles of its first object or group, and the number of faces from which
/// triangles are left out.
pub(super) fn first(text: &str) -> Result<(super::Triangles, usize), String> {
    let Mesh { points, groups, lost } = parse(text, &|_| None, true)?;
    Ok(((points, groups.into_iter().flat_map(|group| group.1).collect()), lost))
}

/// Reads all objects and groups of an OBJ, or only the first one.
fn parse(text: &str, library: &dyn Fn(&str) -> Option<String>, only_first: bool) -> Result<Mesh, String> {
    let (mut points, mut colours) = (Vec::new(), HashMap::new());
    let mut groups: Vec<Group> = vec![(None, Vec::new())];
    let (mut of_material, mut group, mut count, mut skipped) = (HashMap::new(), 0, 0, false);
    let mut ears = Ears::default();
    for (number, line) in text.lines().enumerate() {
        let wrong = |what: &str| format!("line {}: {what}", number + 1);
        let mut words = Words::new(line);
        match words.next() {
            Some("v") => points.push(words.numbers().ok_or_else(|| wrong("a vertex has three numbers"))?),
            Some("mtllib") => colours.extend(words.rest().and_then(library).map(|t| materials(&t)).unwrap_or_default()),
            Some("usemtl") => {
                let name = words.rest().unwrap_or_default();
                group = *of_material.entry(name.to_owned()).or_insert_with(|| {
                    groups.push((colours.get(name).copied(), Vec::new()));
                    groups.len() - 1
                });
            }
            Some("o" | "g") => skipped |= only_first && count > 0,
            Some("f") if !skipped => {
                let mut corner = || -> Option<Result<u32, String>> {
                    let word = words.next()?;
                    let index = word.split('/').next().and_then(|i| i.parse::<i64>().ok()).unwrap_or(0);
                    // Positive indices count from 1 at the first point, and negative indices count back from the last
                    // point.
                    let from_zero = if index > 0 { index - 1 } else { points.len() as i64 + index };
                    let known = index != 0 && (0..points.len() as i64).contains(&from_zero);
                    Some(if known { Ok(from_zero as u32) } else { Err(wrong(&format!("no vertex is `{word}`"))) })
                };
                let mut corners = Vec::new();
                while let Some(next) = corner().transpose()? {
                    corners.push(next);
                    full(count + corners.len())?;
                }
                if corners.len() < 2 {
                    return Err(wrong("a face has at least three corners"));
                }
                count += corners.len() - 2;
                full(count)?;
                if only_first {
                    groups[group].1.extend(ears.cut(&points, corners).map_err(|what| wrong(&what))?);
                } else {
                    groups[group].1.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
                }
            }
            _ => {}
        }
    }
    Ok(Mesh { points, groups, lost: ears.lost })
}

/// Returns the diffuse colours of a material file, by the name of the material.
fn materials(text: &str) -> HashMap<String, [f64; 3]> {
    let (mut found, mut name) = (HashMap::new(), String::new());
    for line in text.lines() {
        let mut words = Words::new(line);
        match words.next() {
            Some("newmtl") => name = words.rest().unwrap_or_default().to_owned(),
            Some("Kd") => found.extend(words.numbers().map(|colour| (name.clone(), colour))),
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{first, read};

    const TEXT: &str =
        "mtllib a b.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1/1/1 2//3 3 -1\nusemtl none\nf 1 2 3\n";

    #[test]
    fn polygons_and_colours() {
        let library = |name: &str| (name == "a b.mtl").then(|| "newmtl red\nKd 1 0 0.5\n".to_owned());
        let parts = read(TEXT, &library).unwrap();
        assert_eq!(parts.len(), 2);
        assert_eq!((parts[0].triangles.len(), parts[0].color), (2, Some([1.0, 0.0, 0.5])));
        assert_eq!((parts[1].points.len(), parts[1].color), (3, None));
    }

    #[test]
    fn first_object_with_the_points_of_all() {
        let text = TEXT.replace("usemtl none", "o second\nv 5 5 5");
        let ((points, triangles), lost) = first(&text).unwrap();
        assert_eq!((points.len(), triangles), (5, vec![[0, 1, 3], [1, 2, 3]])); // both diagonals have the same length
        assert_eq!(lost, 0);
        let long = first(&TEXT.replace("v 0 1 0", "v -9 9 0")).unwrap();
        assert_eq!(long.0.1[..2], [[0, 1, 2], [0, 2, 3]]); // cut along the shorter diagonal
        assert_eq!(first(TEXT).unwrap().0.1.len(), 3); // a material does not begin an object
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (from, to, said) in [
            ("v 1 0 0", "v 1 0", "line 3: a vertex"),
            ("v 1 0 0", "v 1 0 nan", "line 3: a vertex"),
            ("f 1 2 3", "f 1 2 9", "no vertex is `9`"),
            ("f 1 2 3", "f 1 2 -9", "no vertex is `-9`"),
            ("f 1 2 3", "f 0 2 3", "no vertex is `0`"),
            ("f 1 2 3", "f 1", "line 9: a face"),
            ("f 1 2 3", "f 1 2 99999999999999999999", "no vertex"),
        ] {
            let error = read(&TEXT.replace(from, to), &|_| None).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
        assert!(read("", &|_| None).unwrap().is_empty());
    }
}
