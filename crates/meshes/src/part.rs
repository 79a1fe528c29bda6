//! Parts of meshes, which are triangles of one colour, and helpers of the mesh readers.

use std::collections::HashMap;

/// Maximum number of triangles that are read from one file.
const MOST: usize = 4_000_000;

/// Indices of a triangle's three corners.
pub(super) type Triangle = [u32; 3];

/// Triangles of one colour.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// Points (m), before a scale in the robot's file is applied.
    pub points: Vec<[f64; 3]>,
    /// Triangles as indices of points, counter-clockwise if seen from outside.
    pub triangles: Vec<Triangle>,
    /// Red, green and blue, each from 0 to 1; `None` if the file has no colour.
    #[cfg_attr(not(feature = "page"), allow(dead_code))]
    pub color: Option<[f64; 3]>,
}

impl Part {
    /// Creates a part that contains only those points that its triangles use.
    pub(super) fn of(points: &[[f64; 3]], mut triangles: Vec<Triangle>, color: Option<[f64; 3]>) -> Self {
        let (mut numbers, mut own) = (HashMap::new(), Vec::new());
        for corner in triangles.iter_mut().flatten() {
            *corner = *numbers.entry(*corner).or_insert_with(|| {
                own.push(points[*corner as usize]);
                own.len() as u32 - 1
            });
        }
        Self { points: own, triangles, color }
    }
}

/// Returns an error if a file has more triangles than `MOST`.
pub(super) fn full(triangles: usize) -> Result<(), String> {
    if triangles <= MOST { Ok(()) } else { Err(format!("has more than {MOST} triangles")) }
}

/// Iterator over the words of a line or a list.
pub(super) struct Words<'a>(&'a str);

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self(text)
    }

    /// Returns the next word.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        let text = self.0.trim_start();
        let end = text.find(char::is_whitespace).unwrap_or(text.len());
        let (word, rest) = text.split_at(end);
        self.0 = rest;
        (!word.is_empty()).then_some(word)
    }

    /// Returns the next word as a finite number.
    pub(super) fn number(&mut self) -> Option<f64> {
        self.next()?.parse().ok().filter(|x: &f64| x.is_finite())
    }

    /// Returns the next three numbers.
    pub(super) fn numbers(&mut self) -> Option<[f64; 3]> {
        Some([self.number()?, self.number()?, self.number()?])
    }

    /// Returns the remaining text without surrounding spaces; `None` if it is empty.
    pub(super) fn rest(&self) -> Option<&'a str> {
        Some(self.0.trim()).filter(|text| !text.is_empty())
    }
}
