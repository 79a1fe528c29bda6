//! Shapes that MuJoCo itself creates (`builtin` of `<mesh>`), with the same points as in MuJoCo.

use condyle_meshes::Triangles;
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use std::collections::HashMap;

/// Maximum number of points of a shape.
const MAX_POINTS: f64 = (1 << 20) as f64;

/// Returns the points and triangles of a shape. The list of triangles is empty if the shape is the convex hull of its
/// points.
pub(super) fn shape(kind: &str, params: &[f64]) -> Result<Triangles, String> {
    let wrong = || format!("builtin: a {kind} with params {} cannot be", crate::io::xml::words(params));
    // Converts a number of steps to an integer and drops its decimals.
    let steps = |x: f64, least: f64, most: f64| {
        let x = x.trunc();
        if x >= least && x <= most { Ok(x as usize) } else { Err(wrong()) }
    };
    let most = MAX_POINTS.sqrt();
    match (kind, params) {
        ("sphere", &[n]) => Ok(sphere(steps(n, 0.0, 4.0)?)),
        ("hemisphere", &[n]) => Ok(hemisphere(steps(n, 0.0, 10.0)?)),
        ("supersphere", &[n, e, m]) if e >= 0.0 && m >= 0.0 => Ok(supersphere(steps(n, 3.0, most)?, e, m)),
        ("supertorus", &[n, r, s, t]) if r > 0.0 && r <= 1.0 && s > 0.0 && t > 0.0 => {
            Ok(supertorus(steps(n, 3.0, most)?, r, s, t))
        }
        ("wedge", &[x, y, across, up, gamma])
            if across > 0.0 && across <= 180.0 && up > 0.0 && up <= 90.0 && (0.0..=1.0).contains(&gamma) =>
        {
            Ok((wedge([steps(x, 1.0, most)?, steps(y, 1.0, most)?], [across, up], gamma), Vec::new()))
        }
        ("plate", &[x, y]) => Ok(plate([steps(x, 1.0, most)?, steps(y, 1.0, most)?])),
        ("cone", &[n, radius]) => Ok((cone(steps(n, 3.0, MAX_POINTS / 2.0)?, radius), Vec::new())),
        _ => Err(wrong()),
    }
}

/// Returns an icosahedron on the unit sphere. Each triangle is divided into four triangles, `divisions` times.
fn sphere(divisions: usize) -> Triangles {
    // The numbers are rounded to single precision, as in MuJoCo.
    let phi = ((1.0 + 5f64.sqrt()) / 2.0) as f32;
    let norm = (1.0 + f64::from(phi * phi)).sqrt();
    let corner = |p: [f32; 3]| p.map(|x| (f64::from(x) / norm) as f32);
    let (o, i) = (0.0, 1.0);
    let mut points: Vec<[f32; 3]> = [
        [[-i, phi, o], [i, phi, o], [-i, -phi, o], [i, -phi, o]],
        [[o, -i, phi], [o, i, phi], [o, -i, -phi], [o, i, -phi]],
        [[phi, o, -i], [phi, o, i], [-phi, o, -i], [-phi, o, i]],
    ]
    .into_iter()
    .flatten()
    .map(corner)
    .collect();
    let mut triangles: Vec<[u32; 3]> = [
        [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11]],
        [[1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8]],
        [[3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9]],
        [[4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]],
    ]
    .into_iter()
    .flatten()
    .collect();
    for _ in 0..divisions {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let [a, b] = [a, b].map(|k| points[k as usize]);
                let m = [0, 1, 2].map(|k| (a[k] + b[k]) / 2.0);
                let norm = (m[0] * m[0] + m[1] * m[1] + m[2] * m[2]).sqrt();
                points.push(m.map(|x| x / norm));
                points.len() as u32 - 1
            })
        };
        let four = |[a, b, c]: [u32; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(four).collect();
    }
    (points.into_iter().map(|p| p.map(f64::from)).collect(), triangles)
}

/// Returns a unit hemisphere that is closed by a disc. Its points are rings of 4, 8, 12, … points, and the centre of
/// the disc.
fn hemisphere(rings: usize) -> Triangles {
    let equator = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    let (mut points, mut triangles) = (vec![[0.0, 0.0, 1.0]], Vec::new());
    for row in 0..=rings {
        let down = (row + 1) as f64 / (rings + 1) as f64;
        for side in 0..4 {
            let (from, to) = (equator[side], equator[(side + 1) % 4]);
            for i in 0..=row {
                let along = i as f64 / (row + 1) as f64;
                let [x, y] = [0, 1].map(|k| down * (from[k] + along * (to[k] - from[k])));
                let p = [x, y, 1.0 - down];
                let norm = p.iter().map(|x| x * x).sum::<f64>().sqrt();
                points.push(p.map(|x| x / norm));
            }
        }
    }
    points.push([0.0; 3]);
    let ring = |row: usize, i: usize| (1 + 2 * row * (row + 1) + i % (4 * (row + 1))) as u32;
    for i in 0..4 {
        triangles.push([0, ring(0, i), ring(0, i + 1)]);
    }
    for row in 0..rings {
        for side in 0..4 {
            for i in 0..row + 2 {
                let (here, next) = (i + (row + 1) * side, i + (row + 2) * side);
                triangles.push([ring(row, here), ring(row + 1, next), ring(row + 1, next + 1)]);
                if i <= row {
                    triangles.push([ring(row, here), ring(row + 1, next + 1), ring(row, here + 1)]);
                }
            }
        }
    }
    let middle = points.len() as u32 - 1;
    triangles.extend((0..4 * (rings + 1)).map(|i| [ring(rings, i), middle, ring(rings, i + 1)]));
    (points, triangles)
}

/// Returns |cos ω|ᵐ and |sin ω|ᵐ, with the signs of cos ω and sin ω.
fn powers(omega: f64, m: f64) -> [f64; 2] {
    [omega.cos(), omega.sin()].map(|x| x.abs().powf(m).copysign(x))
}

/// Returns a superellipsoid: rings of points from pole to pole.
fn supersphere(n: usize, e: f64, m: f64) -> Triangles {
    let (mut points, mut triangles) = (vec![[0.0, 0.0, -1.0]], Vec::new());
    for i in 1..n {
        let [c, s] = powers(-FRAC_PI_2 + i as f64 * PI / n as f64, m);
        points.extend((0..n).map(|j| {
            let [x, y] = powers(-PI + j as f64 * TAU / n as f64, e);
            [c * x, c * y, s]
        }));
    }
    points.push([0.0, 0.0, 1.0]);
    let at = |i: usize, j: usize| (1 + i * n + j % n) as u32;
    triangles.extend((0..n).map(|j| [0, at(0, j + 1), at(0, j)]));
    for i in 0..n - 2 {
        triangles.extend((0..n).flat_map(|j| {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            [[a, b, d], [b, c, d]]
        }));
    }
    let pole = points.len() as u32 - 1;
    triangles.extend((0..n).map(|j| [at(n - 2, j), at(n - 2, j + 1), pole]));
    (points, triangles)
}

/// Returns a supertoroid.
fn supertorus(n: usize, radius: f64, s: f64, t: f64) -> Triangles {
    let angle = |k: usize| TAU * k as f64 / n as f64;
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..n {
        let [x, y] = powers(angle(i), t);
        points.extend((0..n).map(|j| {
            let [c, s] = powers(angle(j), s);
            [(1.0 + radius * c) * x, (1.0 + radius * c) * y, radius * s]
        }));
        triangles.extend((0..n).flat_map(|j| {
            let at = |i: usize, j: usize| (i % n * n + j % n) as u32;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, d], [b, c, d]]
        }));
    }
    (points, triangles)
}

/// Returns directions inside a field of view (degrees). The directions are denser in the middle of the field.
fn wedge(count: [usize; 2], view: [f64; 2], gamma: f64) -> Vec<[f64; 3]> {
    let edge = |axis: usize, i: usize| {
        let x = -1.0 + 2.0 * i as f64 / count[axis] as f64;
        (gamma * x.powi(5) + (1.0 - gamma) * x) * view[axis].to_radians()
    };
    let middle = |axis: usize, i: usize| 0.5 * (edge(axis, i) + edge(axis, i + 1));
    let point = |i: usize, j: usize| {
        let [(sa, ca), (se, ce)] = [middle(0, i), middle(1, j)].map(f64::sin_cos);
        [ce * sa, se, -ce * ca]
    };
    (0..count[0]).flat_map(|i| (0..count[1]).map(move |j| (i, j))).map(|(i, j)| point(i, j)).collect()
}

/// Returns a square plate of points at z = −1.
fn plate([x, y]: [usize; 2]) -> Triangles {
    let along = |i: usize, count: usize| -1.0 + (i as f64 + 0.5) * (2.0 / count as f64);
    let points = (0..x).flat_map(|i| (0..y).map(move |j| [along(i, x), along(j, y), -1.0])).collect();
    let at = |i: usize, j: usize| (i * y + j) as u32;
    let cells = (1..x).flat_map(|i| (1..y).map(move |j| (i, j)));
    let triangles = cells
        .flat_map(|(i, j)| [[at(i - 1, j - 1), at(i, j - 1), at(i - 1, j)], [at(i, j), at(i - 1, j), at(i, j - 1)]]);
    (points, triangles.collect())
}

/// Returns the points of a cone: a polygon at z = −1, and a scaled polygon or a tip at z = 1.
fn cone(edges: usize, radius: f64) -> Vec<[f64; 3]> {
    let ring = |r: f64, z: f64| {
        (0..edges).map(move |i| {
            let (s, c) = (TAU * i as f64 / edges as f64).sin_cos();
            [r * c, r * s, z]
        })
    };
    let mut points: Vec<_> = ring(1.0, -1.0).collect();
    if radius > 0.0 {
        points.extend(ring(radius, 1.0));
    } else {
        points.push([0.0, 0.0, 1.0]);
    }
    points
}
