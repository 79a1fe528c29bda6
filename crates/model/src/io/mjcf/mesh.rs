//! Volumes, centres of mass and inertias of meshes, by MuJoCo's rules (`inertia` of `<mesh>`).

#[cfg(feature = "meshes")]
use super::principal::principal;
#[cfg(feature = "meshes")]
use condyle_spatial::Sym3;
use condyle_spatial::{Se3, Vec3};

/// Minimum volume (m³) and area (m²) of a valid mesh, as in MuJoCo.
#[cfg(feature = "meshes")]
const LEAST: f64 = 1e-15;

/// Inertia of a mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    /// Volume (m³), or the area (m²) if the mesh is a shell.
    pub(super) volume: f64,
    /// Centre of mass and principal axes, in the frame of the mesh's points.
    pub(super) pose: Se3<f64>,
    /// Principal moments per kilogram (m²), the largest first.
    pub(super) moments: [f64; 3],
    /// Minimum and maximum coordinates of the points along the principal axes (m).
    pub(super) bounds: [[f64; 3]; 2],
    /// Number of corners of the convex hull, if the inertia is computed from the hull; otherwise `None`.
    pub(super) corners: Option<usize>,
    /// Number of faces in the mesh's file from which triangles are left out.
    pub(super) lost: usize,
}

impl Solid {
    /// Returns half the sides (m) of the box that has the same inertia as the mesh: Iₓ = m (y² + z²)/3, with the mass m
    /// and half the sides x, y, z.
    pub(super) fn inertia_box(&self) -> [f64; 3] {
        let [x, y, z] = self.moments;
        [y + z - x, x + z - y, x + y - z].map(|sum| 0.5 * (6.0 * sum).max(0.0).sqrt())
    }

    /// Returns the centre and half the sides of the bounding box along the principal axes (m).
    pub(super) fn bounding_box(&self) -> (Vec3<f64>, [f64; 3]) {
        let [low, high] = self.bounds;
        let center = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
        (center.into(), [0, 1, 2].map(|k| high[k] - center[k]))
    }
}

/// Rule that selects the part of a mesh that has mass.
#[cfg(feature = "meshes")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rule {
    /// Volume inside the convex hull.
    Convex,
    /// Volume inside the surface.
    Exact,
    /// Pyramids from the centroid of the surface to each triangle; the volume of every pyramid counts as positive.
    Legacy,
    /// Surface with mass per area.
    Shell,
}

#[cfg(feature = "meshes")]
impl Rule {
    pub(super) fn of(name: &str) -> Option<Self> {
        let rules =
            [("convex", Self::Convex), ("exact", Self::Exact), ("legacy", Self::Legacy), ("shell", Self::Shell)];
        rules.into_iter().find(|(known, _)| *known == name).map(|(_, rule)| rule)
    }
}

#[cfg(feature = "meshes")]
impl Solid {
    /// Computes the inertia of a mesh. Corners of triangles are counter-clockwise if seen from outside. Without
    /// triangles, the result is the inertia of the convex hull of the points.
    pub(super) fn new(points: &[Vec3<f64>], mut triangles: Vec<[u32; 3]>, rule: Rule) -> Result<Self, String> {
        let is_hull = triangles.is_empty() || rule == Rule::Convex;
        if is_hull {
            let plain: Vec<_> = points.iter().map(|p| p.to_array()).collect();
            triangles = condyle_meshes::hull(&plain).ok_or("its points lie in a plane")?;
        }
        let corners = |t: &[u32; 3], from: Vec3<f64>| t.map(|k| points[k as usize] - from);
        // Computes the centroid of the surface.
        let (mut area, mut centroid) = (0.0, Vec3::zero());
        for t in &triangles {
            let [a, b, c] = corners(t, Vec3::zero());
            let part = (b - a).cross(c - a).norm_squared().sqrt() / 2.0;
            (area, centroid) = (area + part, centroid + (a + b + c).scale(part / 3.0));
        }
        if !(area.is_finite() && area >= LEAST) {
            return Err(format!("its surface of {area} m² is too small"));
        }
        centroid = centroid.scale(1.0 / area);
        // Computes the volume of a pyramid, or the area of a triangle.
        let part = |[a, b, c]: [Vec3<f64>; 3]| match rule {
            Rule::Shell => (b - a).cross(c - a).norm_squared().sqrt() / 2.0,
            Rule::Legacy => (a.dot(b.cross(c)) / 6.0).abs(),
            _ => a.dot(b.cross(c)) / 6.0,
        };
        let (mut volume, mut com) = (0.0, Vec3::zero());
        for t in &triangles {
            let t = corners(t, centroid);
            let v = part(t);
            // Adds the centre of mass of a pyramid, relative to its tip. For a triangle of a shell, MuJoCo uses the
            // same point as for a pyramid.
            (volume, com) = (volume + v, com + (t[0] + t[1] + t[2]).scale(v / 4.0));
        }
        if volume < LEAST {
            let what = if volume < 0.0 { "negative: its triangles are inside out" } else { "too small for a solid" };
            return Err(format!("its volume of {volume} m³ is {what}"));
        }
        let com = centroid + com.scale(1.0 / volume);
        // Computes ∫ x xᵀ over pyramids from the centre of mass, or over triangles. Source: Tonon (2004).
        let (mut volume, mut P) = (0.0, Sym3::zero());
        for t in &triangles {
            let [a, b, c] = corners(t, com);
            let v = part([a, b, c]);
            volume += v;
            let scale = v / if rule == Rule::Shell { 12.0 } else { 20.0 };
            for p in [a, b, c, a + b + c] {
                P = P.add_outer(scale, p);
            }
        }
        let trace = P.xx + P.yy + P.zz;
        let I = Sym3 { xx: trace - P.xx, xy: -P.xy, yy: trace - P.yy, xz: -P.xz, yz: -P.yz, zz: trace - P.zz };
        let (moments, R) = principal(I);
        if !(moments[2] > 0.0 && moments.iter().all(|x| x.is_finite())) {
            return Err(format!("its least moment of inertia, {} m⁵, is not positive", moments[2]));
        }
        let corners = is_hull.then(|| triangles.len() / 2 + 2); // Euler's formula: C = T/2 + 2
        let pose = Se3::new(R, com);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in points {
            let p = R.transpose_mul(*p - com).to_array();
            for k in 0..3 {
                (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
            }
        }
        Ok(Self { volume, pose, moments: moments.map(|x| x / volume), bounds: [low, high], corners, lost: 0 })
    }
}
