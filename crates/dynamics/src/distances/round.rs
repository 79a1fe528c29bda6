//! Distance of spheres and capsules: closest points of two segments, for any scalar.
//!
//! A segment consists of the points p(s) = c + s h with −1 ≤ s ≤ 1; h = 0 is a point. With w = c₁ − c₂, the squared
//! distance is a convex quadratic of (s, t):
//!
//! ```text
//! |w + s h₁ − t h₂|²
//! ```
//!
//! Its minimum over the square is in the interior, or on one of four sides. On a side, one parameter is ±1, and the
//! other follows from a division and a clamp. In the interior, w + s h₁ − t h₂ is parallel to n = h₁ × h₂. So
//!
//! ```text
//! s = (h₂ × w)·n / |n|²     t = (h₁ × w)·n / |n|²
//! ```
//!
//! All five candidates are computed, and the smallest is the result. This is exact for parallel and degenerate
//! segments, for which the sides contain a minimum. Source: Ericson, *Real-Time Collision Detection* (2005), section
//! 5.1.9, for the parameters on a side.

use condyle_spatial::{Act, Scalar, Se3, Vec3};

/// Segment with a radius, in the world: a sphere or a capsule.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Round<S> {
    /// Middle of the segment (m).
    pub center: Vec3<S>,
    /// Vector from the middle to an end; 0 for a sphere (m).
    pub half: Vec3<S>,
    /// Radius (m).
    pub radius: S,
}

/// Distance, both witness points and the normal from the second to the first shape, in one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Witness<S> {
    /// Signed distance (m).
    pub distance: S,
    /// Witness point on each shape: points[0] − points[1] = distance · normal.
    pub points: [Vec3<S>; 2],
    /// Unit vector along which the first shape leaves the second shape.
    pub normal: Vec3<S>,
}

impl<S: Scalar> Round<S> {
    /// Returns the shape after a change of coordinates.
    #[inline(always)]
    pub(crate) fn moved(&self, X: &Se3<S>) -> Self {
        Self { center: X.act(self.center), half: X.rotation * self.half, radius: self.radius }
    }
}

impl<S: Scalar> Witness<S> {
    /// Returns the result for the two shapes in reverse order.
    #[inline(always)]
    pub(crate) fn swapped(self) -> Self {
        let [a, b] = self.points;
        Self { points: [b, a], normal: -self.normal, ..self }
    }

    /// Returns the result after the first and the second shape are enlarged by radii.
    #[inline(always)]
    pub(crate) fn enlarged(self, first: S, second: S) -> Self {
        let ([a, b], n) = (self.points, self.normal);
        let points = [a - n.scale(first), b + n.scale(second)];
        Self { distance: self.distance - first - second, points, normal: n }
    }
}

/// Square of the distance below which two points coincide (m²). Above it, the square of a distance has full precision.
const COINCIDENT: f64 = 1e-300;
/// Square of the ratio of distance and size below which two segments touch. Below it, the direction of the difference
/// consists of rounding errors.
const TOUCHING: f64 = 1e-26;
/// Square of the sine of an angle below which two segments count as parallel. Then a minimum is on a side, up to
/// rounding errors.
const PARALLEL: f64 = 1e-30;

/// Returns x, limited to [−1, 1].
#[inline(always)]
fn clamp<S: Scalar>(x: S) -> S {
    let (low, high) = (S::splat(-1.0), S::one());
    let x = S::select(x.lt(low), low, x);
    S::select(high.lt(x), high, x)
}

/// Returns 1 / x, or 0 if x is 0.
#[inline(always)]
fn inverse<S: Scalar>(x: S) -> S {
    let zero = x.lt(S::splat(COINCIDENT));
    S::select(zero, S::zero(), S::select(zero, S::one(), x).recip())
}

/// Returns a where the mask holds, and b elsewhere.
#[inline(always)]
fn choose<S: Scalar>(mask: S::Mask, a: Vec3<S>, b: Vec3<S>) -> Vec3<S> {
    Vec3::new(S::select(mask, a.x, b.x), S::select(mask, a.y, b.y), S::select(mask, a.z, b.z))
}

/// Returns a vector that is perpendicular to h: its product with the axis on which h has the smallest entry. Returns
/// (0, 0, 1) for h = 0.
#[inline(always)]
fn perpendicular<S: Scalar>(h: Vec3<S>) -> Vec3<S> {
    let (o, i) = (S::zero(), S::one());
    let (x, y, z) = (h.x.abs(), h.y.abs(), h.z.abs());
    let x_least = S::and(x.lt(y), x.lt(z));
    let e = choose::<S>(x_least, Vec3::new(i, o, o), choose::<S>(y.lt(z), Vec3::new(o, i, o), Vec3::new(o, o, i)));
    let point = h.norm_squared().lt(S::splat(COINCIDENT));
    choose::<S>(point, Vec3::new(o, o, i), h.cross(e))
}

/// Returns the distance of two spheres.
#[inline(always)]
pub(crate) fn spheres<S: Scalar>(first: &Round<S>, second: &Round<S>) -> Witness<S> {
    let d = first.center - second.center;
    let square = d.norm_squared();
    let coincident = square.lt(S::splat(COINCIDENT));
    let distance = S::select(coincident, S::zero(), square).sqrt();
    let inverse = S::select(coincident, S::one(), distance).recip();
    let normal = choose::<S>(coincident, Vec3::new(S::zero(), S::zero(), S::one()), d.scale(inverse));
    let points = [first.center, second.center];
    Witness { distance, points, normal }.enlarged(first.radius, second.radius)
}

/// Nearest pair of points so far: their parameters, difference and squared distance.
#[derive(Clone, Copy)]
struct Nearest<S> {
    s: S,
    t: S,
    d: Vec3<S>,
    least: S,
}

impl<S: Scalar> Nearest<S> {
    /// Replaces the pair by the pair with the parameters (s, t), if the latter is nearer.
    #[inline(always)]
    fn consider(&mut self, [w, h1, h2]: [Vec3<S>; 3], s: S, t: S) {
        let d = w + h1.scale(s) - h2.scale(t);
        let found = d.norm_squared();
        let better = found.lt(self.least);
        self.s = S::select(better, s, self.s);
        self.t = S::select(better, t, self.t);
        self.d = choose::<S>(better, d, self.d);
        self.least = S::select(better, found, self.least);
    }
}

/// Returns the distance of a capsule and a sphere. The nearest point of the segment to the sphere's centre has the
/// parameter s = −h·w / |h|², limited to [−1, 1].
#[inline(always)]
pub(crate) fn capsule_and_sphere<S: Scalar>(capsule: &Round<S>, sphere: &Round<S>) -> Witness<S> {
    let (h, w) = (capsule.half, capsule.center - sphere.center);
    let a = h.norm_squared();
    let s = clamp(-h.dot(w) * inverse(a));
    let d = w + h.scale(s);
    let least = d.norm_squared();
    let touch = least.lt((a + w.norm_squared()) * S::splat(TOUCHING) + S::splat(COINCIDENT));
    let points = [capsule.center + h.scale(s), sphere.center];
    witness(points, d, least, touch, perpendicular(h)).enlarged(capsule.radius, sphere.radius)
}

/// Returns the result for the nearest points of two segments, with their difference d and its square. Segments that
/// touch have the normal `across`, up to its sign and length.
#[inline(always)]
fn witness<S: Scalar>(points: [Vec3<S>; 2], d: Vec3<S>, least: S, touch: S::Mask, across: Vec3<S>) -> Witness<S> {
    let across = choose::<S>(across.dot(d).lt(S::zero()), -across, across);
    let length = S::select(touch, across.norm_squared(), least).sqrt();
    let normal = choose::<S>(touch, across, d).scale(length.recip());
    Witness { distance: S::select(touch, S::zero(), length), points, normal }
}

/// Returns the distance of two capsules.
///
/// The distance is exact, also if the capsules overlap: the difference of two segments is a parallelogram, which has no
/// interior. So the penetration is the sum of the radii less the distance of the segments. If the segments cross, the
/// normal is perpendicular to both.
#[inline(always)]
pub(crate) fn capsules<S: Scalar>(first: &Round<S>, second: &Round<S>) -> Witness<S> {
    let (h1, h2, w) = (first.half, second.half, first.center - second.center);
    let (a, e, b) = (h1.norm_squared(), h2.norm_squared(), h1.dot(h2));
    let (c, f) = (h1.dot(w), h2.dot(w));
    let n = h1.cross(h2);
    let square = n.norm_squared();

    let (one, by_a, by_e) = (S::one(), inverse(a), inverse(e));
    let t = clamp((b + f) * by_e);
    let d = w + h1 - h2.scale(t);
    let mut best = Nearest { s: one, t, d, least: d.norm_squared() }; // the side s = 1
    best.consider([w, h1, h2], -one, clamp((f - b) * by_e)); // the side s = −1
    best.consider([w, h1, h2], clamp((b - c) * by_a), one); // the side t = 1
    best.consider([w, h1, h2], clamp((-b - c) * by_a), -one); // the side t = −1
    let parallel = square.lt(a * e * S::splat(PARALLEL) + S::splat(COINCIDENT));
    let inverse = S::select(parallel, one, square).recip();
    let u = h2.cross(w).dot(n) * inverse;
    let v = h1.cross(w).dot(n) * inverse;
    // a point outside of the segments is replaced by a point of a side, which changes nothing
    let outside = S::or(parallel, S::or(one.lt(u.abs()), one.lt(v.abs())));
    best.consider([w, h1, h2], S::select(outside, best.s, u), S::select(outside, best.t, v)); // the interior
    let Nearest { s, t, d, least } = best;

    let size = a + e + w.norm_squared();
    let touch = least.lt(size * S::splat(TOUCHING) + S::splat(COINCIDENT));
    let across = choose::<S>(parallel, perpendicular(choose::<S>(a.lt(e), h2, h1)), n);
    let points = [first.center + h1.scale(s), second.center + h2.scale(t)];
    witness(points, d, least, touch, across).enlarged(first.radius, second.radius)
}

/// Returns the square root of a number. It is a method of [`Scalar`], because `core` has no square root.
#[inline(always)]
pub(super) fn root(x: f64) -> f64 {
    Scalar::sqrt(x)
}

/// Returns the length of a vector.
#[inline(always)]
pub(super) fn norm(x: Vec3<f64>) -> f64 {
    root(x.norm_squared())
}
