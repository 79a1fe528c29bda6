//! Contacts of a robot with its environment, and the forces that act there.

use crate::error::Error;
use condyle_spatial::{Mat3, Vec3};

/// Direction in which the environment pushes the robot: a vector of any length except 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Normal {
    /// Direction along the world's axes. It stays the same when the foot turns. It suits point contacts.
    World(Vec3<f64>),
    /// Direction along the axes of the contact's frame. It turns with the frame.
    Frame(Vec3<f64>),
}

impl Normal {
    /// Returns the direction, along the world's axes or the frame's axes as given.
    pub fn direction(self) -> Vec3<f64> {
        let (Self::World(n) | Self::Frame(n)) = self;
        n
    }
}

/// Unknowns that describe the force on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SurfaceForces {
    /// A force with a friction cone at each corner.
    Corners,
    /// A force with one friction cone, a centre of pressure within the polygon, and a bounded moment about the normal.
    Wrench,
}

/// Shape of the contact.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Shape {
    /// Point: the contact holds the origin of its frame, and the frame may turn about the origin.
    Point,
    /// Surface in the contact's frame: an edge or a convex polygon. An edge has two corners, and the frame may turn
    /// about the edge. A polygon has three or more corners, and the contact holds the whole frame.
    Surface {
        /// Corners in the contact's frame (m), in order around the polygon. All corners lie in one plane perpendicular
        /// to the normal.
        corners: Vec<Vec3<f64>>,
        /// Unknowns that describe the force.
        forces: SurfaceForces,
    },
}

/// Contact with friction. The contact holds its point or surface, and each contact force f lies in the cone ‖f_t‖ ≤ μ
/// f_n. Here f_t is the tangential force, f_n the normal force, and μ the friction coefficient.
///
/// [`ContactTarget::activation`](crate::ContactTarget) sets at each tick whether the contact touches. An activation
/// below 1 also limits the normal force.
///
/// ```
/// use condyle_wholebody::{FrictionContact, Normal};
/// let icy = FrictionContact { friction: 0.05, ..FrictionContact::point("LF_foot", 0.7) };
/// let sole = FrictionContact::sole("left_sole", 0.7, [0.2, 0.1]);
/// assert_eq!((icy.min_force, sole.max_force), (0.0, f64::INFINITY));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionContact {
    /// Name of the contact's frame.
    pub frame: String,
    /// Shape of the contact.
    pub shape: Shape,
    /// The direction in which the environment pushes.
    pub normal: Normal,
    /// Coulomb's friction coefficient μ; above 0.
    pub friction: f64,
    /// Length γ (m) in the bound |yaw moment| ≤ γ f_n of a [wrench](SurfaceForces::Wrench) with the normal force f_n.
    /// For a polygon, `None` means ⅔ μ r, with the friction coefficient μ. This value is exact for a uniformly loaded
    /// disc. Here r is the radius of the largest circle inside the polygon about the mean of the corners. For an edge
    /// of length 2 l, `None` means ½ μ l.
    pub yaw_friction: Option<f64>,
    /// Minimum normal force of the whole contact (N); at least 0.
    pub min_force: f64,
    /// Maximum normal force of the whole contact (N); may be infinite.
    pub max_force: f64,
}

impl FrictionContact {
    /// Creates a point contact on level ground.
    pub fn point(frame: &str, friction: f64) -> Self {
        let normal = Normal::World(Vec3::new(0.0, 0.0, 1.0));
        let (frame, shape) = (frame.to_owned(), Shape::Point);
        Self { frame, shape, normal, friction, yaw_friction: None, min_force: 0.0, max_force: f64::INFINITY }
    }

    /// Creates a surface contact from the corners of a convex polygon or of an edge, given in the contact's frame. The
    /// normal is the frame's z axis, and the unknown force is a wrench.
    pub fn surface(frame: &str, friction: f64, corners: &[Vec3<f64>]) -> Self {
        let shape = Shape::Surface { corners: corners.to_vec(), forces: SurfaceForces::Wrench };
        Self { shape, normal: Normal::Frame(Vec3::new(0.0, 0.0, 1.0)), ..Self::point(frame, friction) }
    }

    /// Creates a contact whose surface is a rectangle about the frame's origin, with sides along the frame's x and y
    /// (m).
    pub fn sole(frame: &str, friction: f64, [length, width]: [f64; 2]) -> Self {
        let (x, y) = (0.5 * length, 0.5 * width);
        let corners = [[x, y], [-x, y], [-x, -y], [x, -y]].map(|[x, y]| Vec3::new(x, y, 0.0));
        Self::surface(frame, friction, &corners)
    }

    /// Returns the same contact with a force at each corner.
    #[must_use]
    pub fn by_corners(mut self) -> Self {
        if let Shape::Surface { forces, .. } = &mut self.shape {
            *forces = SurfaceForces::Corners;
        }
        self
    }

    fn wrong(&self, name: &'static str, value: f64, allowed: &'static str) -> Error {
        Error::Contact { frame: self.frame.clone(), name, value, allowed }
    }

    pub(crate) fn check(&self) -> Result<Geometry, Error> {
        let n = self.normal.direction();
        let length = norm(n);
        let yaw = self.yaw_friction.unwrap_or(0.0);
        for (name, value, good, allowed) in [
            ("friction", self.friction, self.friction > 0.0 && self.friction.is_finite(), "above 0"),
            ("yaw_friction", yaw, yaw >= 0.0 && yaw.is_finite(), "at least 0"),
            ("normal (its length)", length, length > 0.0 && length.is_finite(), "above 0"),
            ("min_force", self.min_force, self.min_force >= 0.0 && self.min_force.is_finite(), "at least 0"),
            (
                "max_force",
                self.max_force,
                self.max_force >= self.min_force && self.max_force > 0.0,
                "at least min_force, above 0",
            ),
        ] {
            if !good {
                return Err(self.wrong(name, value, allowed));
            }
        }
        let n = n.scale(1.0 / length);
        match &self.shape {
            Shape::Point => {
                let (centre, axes) = (Vec3::zero(), axes(n));
                Ok(Geometry { centre, axes, corners: Vec::new(), by_corners: false, motion: &[0, 1, 2], yaw: 0.0 })
            }
            Shape::Surface { corners, forces } => self.surface_geometry(n, corners, *forces),
        }
    }

    fn surface_geometry(&self, n: Vec3<f64>, corners: &[Vec3<f64>], forces: SurfaceForces) -> Result<Geometry, Error> {
        let count = corners.len() as f64;
        if matches!(self.normal, Normal::World(_)) {
            return Err(self.wrong("corners", count, "those of a point where the normal is the world's"));
        }
        let sum = corners.iter().fold(Vec3::zero(), |sum, &c| sum + c);
        let centre = sum.scale(1.0 / count);
        if corners.len() < 2 || !norm(centre).is_finite() {
            return Err(self.wrong("corners", count, "at least 2, and finite"));
        }
        let size = corners.iter().map(|&c| norm(c - centre)).fold(0.0, f64::max);
        if corners.iter().any(|&c| (c - centre).dot(n).abs() > 1e-6 * size) {
            return Err(self.wrong("corners", count, "in one plane across the normal"));
        }
        let axes = match corners {
            [a, b] if norm(*b - *a) > 0.0 => {
                let t = (*b - *a).scale(1.0 / norm(*b - *a));
                Mat3 { x: t, y: n.cross(t), z: n }
            }
            _ => axes(n),
        };
        let mut flat: Vec<[f64; 2]> =
            corners.iter().map(|&c| [axes.x.dot(c - centre), axes.y.dot(c - centre)]).collect();
        let turn = |k: usize| {
            let [a, b, c] = [0, 1, 2].map(|i| flat[(k + i) % flat.len()]);
            (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        };
        let turns: Vec<f64> = (0..flat.len()).map(turn).collect();
        let edge = flat.len() == 2;
        // A polygon is convex if all its turns are to the left and add up to one revolution. (The turns of a star add
        // up to more.) The centre is then to the left of each edge, which is checked below.
        let left = turns.iter().all(|&t| t > 0.0);
        if !edge && !left {
            if !turns.iter().all(|&t| t < 0.0) {
                return Err(self.wrong("corners", count, "in their order around a convex polygon"));
            }
            flat.reverse();
        }
        if edge && size <= 0.0 {
            return Err(self.wrong("corners", count, "apart from each other"));
        }
        let radius =
            (0..flat.len()).map(|k| inside(flat[k], flat[(k + 1) % flat.len()])[2]).fold(f64::INFINITY, f64::min);
        if !edge && radius <= 0.0 {
            return Err(self.wrong("corners", count, "in their order around a convex polygon"));
        }
        let even = if edge { 0.5 * size } else { 2.0 / 3.0 * radius };
        let yaw = self.yaw_friction.unwrap_or(self.friction * even);
        // An edge does not hold the rotation about the edge (about t₁).
        let motion: &[usize] = if edge { &[0, 1, 2, 4, 5] } else { &[0, 1, 2, 3, 4, 5] };
        Ok(Geometry { centre, axes, corners: flat, by_corners: forces == SurfaceForces::Corners, motion, yaw })
    }
}

/// Constant geometry of a contact.
#[derive(Clone, Debug)]
pub(crate) struct Geometry {
    /// Mean of the corners, in the frame.
    pub centre: Vec3<f64>,
    /// Contact axes (t₁, t₂, n), right-handed. If the normal is given along the world's axes, they are vectors in the
    /// world, otherwise in the contact's frame.
    pub axes: Mat3<f64>,
    /// Corners: coordinates along the tangential axes t₁ and t₂ from the centre, counterclockwise about the normal n.
    /// Empty for a point.
    pub corners: Vec<[f64; 2]>,
    pub by_corners: bool,
    /// Indices of the components of the frame's six-dimensional motion that the contact holds. The contact's wrench has
    /// the components with the same indices.
    pub motion: &'static [usize],
    /// Length γ (m) in the bound |yaw moment| ≤ γ f_n, with the normal force f_n.
    pub yaw: f64,
}

impl Geometry {
    /// Returns the number of unknowns of the force.
    pub(crate) fn unknowns(&self) -> usize {
        if self.by_corners { 3 * self.corners.len() } else { self.motion.len() }
    }

    /// Returns the number of friction cones. Cone k limits unknowns 3 k to 3 k + 2, which are forces along the
    /// tangential axes t₁, t₂ and the normal n.
    pub(crate) fn cones(&self) -> usize {
        if self.by_corners { self.corners.len() } else { 1 }
    }

    /// Returns the weight of the square of unknown j, relative to the weight of a force. The weight of a moment is 1 /
    /// r², where r is the root mean square of the corners' distances from the moment's axis. A moment then costs as
    /// much as the corner forces that cause it.
    pub(crate) fn weight(&self, j: usize) -> f64 {
        let (row, count) = (self.motion[j % self.motion.len()], self.corners.len() as f64);
        let mean = |square: &dyn Fn(&[f64; 2]) -> f64| self.corners.iter().map(square).sum::<f64>() / count;
        match row {
            _ if self.by_corners => 1.0,
            3 => 1.0 / mean(&|[_, y]| y * y),
            4 => 1.0 / mean(&|[x, _]| x * x),
            5 => 1.0 / mean(&|[x, y]| x * x + y * y),
            _ => 1.0,
        }
    }

    /// Returns the half-planes that contain the centre of pressure (x, y) of a wrench. Each (a, b, c) requires a x + b
    /// y + c ≥ 0.
    pub(crate) fn edges(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let count = if self.by_corners { 0 } else { self.corners.len() };
        (0..count).map(move |k| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % count]);
            if count == 2 { [b[0].signum(), 0.0, b[0].abs()] } else { inside(a, b) }
        })
    }

    /// Returns entry r of the wrench caused by a unit of unknown j, along the contact's axes and about the contact's
    /// centre.
    pub(crate) fn wrench(&self, r: usize, j: usize) -> f64 {
        if !self.by_corners {
            return f64::from(u8::from(self.motion[j] == r));
        }
        let ([x, y], axis) = (self.corners[j / 3], j % 3);
        match (r, axis) {
            (0, 0) | (1, 1) | (2, 2) => 1.0,
            (3, 2) => y, // wrench of (x, y, 0) × f = (y f_n, −x f_n, x f₂ − y f₁)
            (4, 2) => -x,
            (5, 0) => -y,
            (5, 1) => x,
            _ => 0.0,
        }
    }
}

/// Returns (a, b, c) of the line through two corners. The signed distance of (x, y) from the line is a x + b y + c,
/// which is positive to the left of the line.
fn inside(from: [f64; 2], to: [f64; 2]) -> [f64; 3] {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let length = x.hypot(y);
    let (a, b) = (-y / length, x / length);
    [a, b, -(a * from[0] + b * from[1])]
}

/// Returns unit vectors (t₁, t₂, n), right-handed, for a unit vector n.
fn axes(n: Vec3<f64>) -> Mat3<f64> {
    // Take the tangential axis t₁ perpendicular to the normal n and to x or y, whichever of x and y makes the larger
    // angle with n.
    let (x, y) = (Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
    let t = if n.x.abs() < n.y.abs() { n.cross(x) } else { y.cross(n) };
    let t1 = t.scale(1.0 / norm(t));
    Mat3 { x: t1, y: n.cross(t1), z: n }
}

pub(crate) fn norm(x: Vec3<f64>) -> f64 {
    x.norm_squared().sqrt()
}
