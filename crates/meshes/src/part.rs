//! Triangles of one colour, and what readers of meshes share.

use std::collections::HashMap;

/// The most triangles that are read of one file.
const MOST: usize = 4_000_000;

/// The corners' numbers of a triangle.
pub(super) type Triangle = [u32; 3];

/// Triangles of one colour.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// m, but for the scale of who shows it.
    pub points: Vec<[f64; 3]>,
    /// By their corners' numbers, counter-clockwise from outside.
    pub triangles: Vec<Triangle>,
    /// Red, green and blue from 0 to 1, where the file has a colour.
    #[cfg_attr(not(feature = "page"), allow(dead_code))]
    pub color: Option<[f64; 3]>,
}

impl Part {
    /// A part with those of many points that its triangles name.
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

/// Refuses more triangles than a file may have.
pub(super) fn full(triangles: usize) -> Result<(), String> {
    if triangles <= MOST { Ok(()) } else { Err(format!("has more than {MOST} triangles")) }
}

/// The words of a line or of a list.
pub(super) struct Words<'a>(&'a str);

impl<'a> Words<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self(text)
    }

    /// The next word.
    pub(super) fn next(&mut self) -> Option<&'a str> {
        let text = self.0.trim_start();
        let end = text.find(char::is_whitespace).unwrap_or(text.len());
        let (word, rest) = text.split_at(end);
        self.0 = rest;
        (!word.is_empty()).then_some(word)
    }

    /// The next word as a finite number.
    pub(super) fn number(&mut self) -> Option<f64> {
        self.next()?.parse().ok().filter(|x: &f64| x.is_finite())
    }

    /// The next three numbers.
    pub(super) fn numbers(&mut self) -> Option<[f64; 3]> {
        Some([self.number()?, self.number()?, self.number()?])
    }

    /// All that is left.
    pub(super) fn rest(&self) -> Option<&'a str> {
        Some(self.0.trim()).filter(|text| !text.is_empty())
    }
}
