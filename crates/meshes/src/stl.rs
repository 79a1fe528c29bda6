//! Reader of STL: triangles, binary or as text.

use super::part::{Part, Words, full};

/// Number of bytes before the triangles of a binary file.
const HEAD: usize = 84;
/// Number of bytes of a triangle in a binary file: a normal, three corners, and two bytes of attributes.
const TRIANGLE: usize = 50;

/// Reads the triangles of an STL.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Part>, String> {
    let mut part = Part::default();
    // A binary file may also begin with `solid`. A file is binary if its length matches the number of triangles in its
    // head.
    let count = bytes.get(80..HEAD).and_then(|n| <[u8; 4]>::try_from(n).ok()).map(u32::from_le_bytes);
    let length = count.and_then(|n| usize::try_from(n).ok()?.checked_mul(TRIANGLE)?.checked_add(HEAD));
    if let (Some(count), Some(length)) = (count, length)
        && (bytes.len() == length || !bytes.starts_with(b"solid"))
    {
        if bytes.len() < length {
            return Err(format!("{count} triangles need {length} bytes, there are {}", bytes.len()));
        }
        full(count as usize)?;
        for triangle in bytes[HEAD..length].chunks_exact(TRIANGLE) {
            for corner in triangle[12..48].chunks_exact(12) {
                let number = |k: usize| f32::from_le_bytes([corner[k], corner[k + 1], corner[k + 2], corner[k + 3]]);
                part.points.push([number(0), number(4), number(8)].map(f64::from));
            }
        }
    } else {
        let text = core::str::from_utf8(bytes).map_err(|_| "is neither a binary STL nor text".to_owned())?;
        if !text.trim_start().starts_with("solid") {
            return Err("is no STL: it has no `solid`, and is too short for a binary one".to_owned());
        }
        for (number, line) in text.lines().enumerate() {
            let mut words = Words::new(line);
            if words.next() == Some("vertex") {
                let point =
                    words.numbers().ok_or_else(|| format!("line {}: a vertex has three numbers", number + 1))?;
                part.points.push(point);
                full(part.points.len() / 3)?;
            }
        }
        if part.points.len() % 3 != 0 {
            return Err(format!("{} vertices are no whole number of triangles", part.points.len()));
        }
    }
    part.triangles = (0..part.points.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Ok(vec![part])
}

#[cfg(test)]
mod tests {
    use super::read;

    const TEXT: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\nendsolid";

    fn binary(count: u32, triangles: usize) -> Vec<u8> {
        let mut bytes = b"solid, but binary".to_vec();
        bytes.resize(80, 0);
        bytes.extend(count.to_le_bytes());
        for _ in 0..triangles {
            for x in [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
                bytes.extend(x.to_le_bytes());
            }
            bytes.extend([0, 0]);
        }
        bytes
    }

    #[test]
    fn text_and_binary_are_the_same() {
        let (a, b) = (read(TEXT.as_bytes()).unwrap(), read(&binary(1, 1)).unwrap());
        assert_eq!((&a[0].points, &a[0].triangles), (&b[0].points, &b[0].triangles));
        assert_eq!(a[0].points[2], [0.0, 1.0, 0.0]);
    }

    #[test]
    fn invalid_files_are_reported_at_once() {
        let mut lying = binary(u32::MAX, 1);
        lying[..5].copy_from_slice(b"other");
        assert!(read(&lying).unwrap_err().contains("4294967295 triangles need"));
        assert!(read(TEXT.replace("vertex 1 0 0\n", "").as_bytes()).unwrap_err().contains("whole number"));
        assert!(read(TEXT.replace("1e0", "x").as_bytes()).unwrap_err().contains("line 6"));
        for bad in [&b""[..], b"solid \xff", b"facet"] {
            assert!(read(bad).is_err());
        }
        // Reading any prefix of a file returns a result or an error, but never panics.
        let whole = binary(2, 2);
        for end in 0..whole.len() {
            let _ = read(&whole[..end]);
        }
    }
}
