//! Relation between forces and accelerations of a piece of a robot. A piece is a group of connected bodies and has two
//! handles. The upper handle is the body to which the piece is attached; the lower handle is the last body of the
//! piece.
//!
//! Source: Featherstone (1999), part 1, describes an articulated body with two handles by inverse inertias, so that
//! forces determine accelerations. Here the inputs are the acceleration a of the upper handle and the force f on the
//! lower handle. The outputs are the force f' at the upper handle and the acceleration a' of the lower handle:
//!
//! ```text
//! f' = K a + p − Lᵀ f      force through the joint above: K and p are Iᵃ and pᵃ of the articulated-body algorithm
//! a' = L a + b + Y f       acceleration of the body below
//! ```
//!
//! These relations need only the inverses of the articulated-body algorithm and no inverse of an inertia, so bodies may
//! be massless. (In scattering theory, Redheffer's star product joins two such pieces.) If piece 2 is attached to the
//! last body of piece 1, f₁ = −f'₂ and a₂ = a'₁, so a₂ = L₁ a + b₁ − Y₁ (K₂ a₂ + p₂ − L₂ᵀ f). Piece 1 acts on piece 2
//! like a joint of compliance Y₁. Hence, with E = (1 + Y₁ K₂)⁻¹ and the symmetric matrix G = E Y₁,
//!
//! ```text
//! a₂ = N a + e + G L₂ᵀ f,      N = E L₁,              e = E (b₁ − Y₁ p₂)
//! K = K₁ + L₁ᵀ K₂ N,           p = p₁ + L₁ᵀ (p₂ + K₂ e)
//! L = L₂ N,                    b = b₂ + L₂ e,         Y = Y₂ + L₂ G L₂ᵀ
//! ```
//!
//! The matrix 1 + Y₁ K₂, with the compliance Y₁ of piece 1 and the inertia K₂ of piece 2, has no eigenvalue below 1,
//! because Y₁ and K₂ have no negative eigenvalues. Gaussian elimination is applied to this unsymmetric matrix. A
//! symmetric form would need a square root of Y₁. But the rank of Y₁ is at most the number of degrees of freedom of
//! piece 1, so some pivots of the square root may be zero up to rounding. These rounding errors would falsify the
//! result.
//!
//! Forces and accelerations of a handle are expressed at the handle's own origin, along the world's axes. So the lever
//! arms in the compliance Y of a piece are distances within the piece, not distances from the world's origin.

use condyle_spatial::{ArticulatedInertia, Force, Mat3, Motion, Scalar, Se3, Sym3, Vec3};

/// 6 × 6 matrix, stored by columns. The linear part of each column comes first.
type Matrix<S> = [[S; 6]; 6];

/// Number of columns of the matrix [1 + Y₁ K₂, L₁, b₁ − Y₁ p₂, Y₁], which is eliminated when two pieces are joined.
const WIDTH: usize = 6 + 6 + 1 + 6;

/// Relation between the two handles of a piece.
#[derive(Clone, Debug)]
pub(crate) struct ArticulatedPair<S> {
    /// Pose of the lower body in the frame of the upper body.
    pub X: Se3<S>,
    /// Velocity of the lower body relative to the upper body, in the frame of the upper body.
    pub w: Motion<S>,
    /// Matrix K that maps the acceleration of the upper handle to the force at the upper handle.
    pub K: ArticulatedInertia<S>,
    /// Force p at the upper handle when the upper handle has no acceleration.
    pub p: Force<S>,
    /// Matrix L that maps the acceleration of the upper handle to the acceleration of the lower handle.
    L: Matrix<S>,
    /// Matrix Y that maps the force on the lower handle to the acceleration of the lower handle.
    Y: Matrix<S>,
    /// Acceleration b of the lower handle when the upper handle has no acceleration.
    b: Motion<S>,
    /// Matrix N that maps the acceleration of the upper handle to the acceleration of the body at which the two parts
    /// of a joined piece meet.
    N: Matrix<S>,
    /// Matrix G that maps the force on the body at which the two parts of a joined piece meet to the acceleration of
    /// this body.
    G: Matrix<S>,
    /// Acceleration e of the body at which the two parts of a joined piece meet, when the upper handle has no
    /// acceleration.
    e: Motion<S>,
}

impl<S: Scalar> ArticulatedPair<S> {
    /// Returns an empty piece, whose handles are the same body.
    pub(crate) fn nothing() -> Self {
        Self {
            X: Se3::identity(),
            w: Motion::zero(),
            K: ArticulatedInertia::zero(),
            p: Force::zero(),
            L: identity(),
            Y: zero(),
            b: Motion::zero(),
            N: zero(),
            G: zero(),
            e: Motion::zero(),
        }
    }

    /// Makes this the relation of a piece that has no joints between its two handles. The compliance Y and the bias
    /// acceleration b are then 0, and L converts a motion at the origin to the motion at the point r of the lower
    /// handle.
    #[inline(always)]
    pub(crate) fn begin(&mut self, r: Vec3<S>) {
        let skew = r.skew(); // a' = [v + ω × r; ω]
        self.L = identity();
        for (j, column) in skew.columns().into_iter().enumerate() {
            self.L[3 + j][..3].copy_from_slice(&(-column).to_array());
        }
        self.Y = zero();
        self.b = Motion::zero();
    }

    /// Adds a degree of freedom above the piece, with joint column S (`axis`) and the quantities U = Iᴬ S, 1/D and u of
    /// the articulated-body algorithm. x = u/D is the acceleration of the degree of freedom when the upper handle has
    /// no acceleration.
    #[inline(always)]
    pub(crate) fn extend(&mut self, axis: Motion<S>, U: Force<S>, D_inv: S, x: S) {
        let s = times(&self.L, &axis.to_array()); // s = L S
        let U = U.scale(-D_inv).to_array();
        for j in 0..6 {
            add(&mut self.L[j], U[j], &s); // L ← L (1 − S D⁻¹ Uᵀ)
            add(&mut self.Y[j], D_inv * s[j], &s); // Y ← Y + s D⁻¹ sᵀ
        }
        self.b = Motion::from(s).scale_add(x, self.b); // b ← b + s x
    }

    /// Moves the upper handle past a joint with the velocity-dependent acceleration c.
    #[inline(always)]
    pub(crate) fn shift(&mut self, c: Motion<S>) {
        self.b += Motion::from(times(&self.L, &c.to_array())); // b ← b + L c
    }

    /// Joins `upper` and `lower`; `lower` is attached to the last body of `upper`. The quantities L, b and Y of the
    /// lower handle are computed only if the joined piece is `open`, which means that it has a lower handle.
    #[inline(always)]
    pub(crate) fn join(&mut self, upper: &Self, lower: &Self, open: bool) {
        let (L1, Y1, K2, p2) = (&upper.L, &upper.Y, full(lower.K), lower.p);
        let x = (upper.b - Motion::from(times(Y1, &p2.to_array()))).to_array();
        let mut A = product(Y1, &K2);
        for j in 0..6 {
            A[j][j] += S::one();
        }
        let mut rows = [[S::zero(); WIDTH]; 6]; // [1 + Y₁ K₂, L₁, b₁ − Y₁ p₂, Y₁]
        for i in 0..6 {
            for j in 0..6 {
                (rows[i][j], rows[i][6 + j], rows[i][13 + j]) = (A[j][i], L1[j][i], Y1[j][i]);
            }
            rows[i][12] = x[i];
        }
        eliminate(&mut rows); // E = (1 + Y₁ K₂)⁻¹
        let (mut e, mut G) = (x, zero());
        for i in 0..6 {
            for j in 0..6 {
                (self.N[j][i], G[j][i]) = (rows[i][6 + j], rows[i][13 + j]); // N = E L₁, G = E Y₁
            }
            e[i] = rows[i][12]; // e = E (b₁ − Y₁ p₂)
        }
        self.e = e.into();
        self.K = upper.K + symmetric(&transpose_product(L1, &product(&K2, &self.N))); // K = K₁ + L₁ᵀ K₂ N
        let push = (p2 + lower.K * self.e).to_array();
        self.p = upper.p + Force::from(transpose_times(L1, &push)); // p = p₁ + L₁ᵀ (p₂ + K₂ e)
        if open {
            self.L = product(&lower.L, &self.N); // L = L₂ N
            self.b = lower.b + Motion::from(times(&lower.L, &self.e.to_array())); // b = b₂ + L₂ e
            self.Y = lower.Y; // Y = Y₂ + L₂ G L₂ᵀ
            let L2G = product(&lower.L, &G);
            for k in 0..6 {
                for j in 0..6 {
                    add(&mut self.Y[j], lower.L[k][j], &L2G[k]);
                }
            }
        }
        self.G = G;
    }

    /// Returns the acceleration a₂ of the body at which the upper and the lower part of this piece meet, and the force
    /// f₁ on the upper part at this body.
    #[inline(always)]
    pub(crate) fn between(&self, lower: &Self, a: Motion<S>, f: Option<Force<S>>) -> (Motion<S>, Force<S>) {
        let mut a2 = self.e + Motion::from(times(&self.N, &a.to_array()));
        let mut p2 = lower.p;
        if let Some(f) = f {
            let push = transpose_times(&lower.L, &f.to_array());
            a2 += times(&self.G, &push).into(); // a₂ = N a + e + G L₂ᵀ f
            p2 -= push.into();
        }
        (a2, -(lower.K * a2 + p2)) // f₁ = −(K₂ a₂ + p₂ − L₂ᵀ f)
    }
}

/// Replaces B by A⁻¹ B in the rows of [A, B], by Gaussian elimination with row pivoting: each pivot is the largest
/// entry of its column in the remaining rows.
#[inline(always)]
fn eliminate<S: Scalar>(rows: &mut [[S; WIDTH]; 6]) {
    for k in 0..6 {
        let mut pivot = rows[k];
        for i in k + 1..6 {
            let larger = pivot[k].abs().lt(rows[i][k].abs());
            for j in k..WIDTH {
                let (a, b) = (pivot[j], rows[i][j]);
                (pivot[j], rows[i][j]) = (S::select(larger, b, a), S::select(larger, a, b));
            }
        }
        let r = pivot[k].recip();
        for j in k + 1..WIDTH {
            pivot[j] = pivot[j] * r;
        }
        for i in k + 1..6 {
            let factor = -rows[i][k];
            for j in k + 1..WIDTH {
                rows[i][j] = pivot[j].mul_add(factor, rows[i][j]);
            }
        }
        rows[k] = pivot;
    }
    for k in (1..6).rev() {
        let solved = rows[k];
        for i in 0..k {
            let factor = -rows[i][k];
            for j in 6..WIDTH {
                rows[i][j] = solved[j].mul_add(factor, rows[i][j]);
            }
        }
    }
}

#[inline(always)]
fn zero<S: Scalar>() -> Matrix<S> {
    [[S::zero(); 6]; 6]
}

#[inline(always)]
fn identity<S: Scalar>() -> Matrix<S> {
    let mut one = zero();
    for j in 0..6 {
        one[j][j] = S::one();
    }
    one
}

/// Computes y += x s for a number s.
#[inline(always)]
fn add<S: Scalar>(y: &mut [S; 6], s: S, x: &[S; 6]) {
    for i in 0..6 {
        y[i] = x[i].mul_add(s, y[i]);
    }
}

/// Returns the product A x.
#[inline(always)]
fn times<S: Scalar>(A: &Matrix<S>, x: &[S; 6]) -> [S; 6] {
    let mut y = [S::zero(); 6];
    for j in 0..6 {
        add(&mut y, x[j], &A[j]);
    }
    y
}

/// Returns the product Aᵀ x.
#[inline(always)]
fn transpose_times<S: Scalar>(A: &Matrix<S>, x: &[S; 6]) -> [S; 6] {
    let mut y = [S::zero(); 6];
    for j in 0..6 {
        for i in 0..6 {
            y[j] = A[j][i].mul_add(x[i], y[j]);
        }
    }
    y
}

/// Returns the product A B.
#[inline(always)]
fn product<S: Scalar>(A: &Matrix<S>, B: &Matrix<S>) -> Matrix<S> {
    let mut C = zero();
    for j in 0..6 {
        C[j] = times(A, &B[j]);
    }
    C
}

/// Returns the product Aᵀ B.
#[inline(always)]
fn transpose_product<S: Scalar>(A: &Matrix<S>, B: &Matrix<S>) -> Matrix<S> {
    let mut T = zero();
    for j in 0..6 {
        for i in 0..6 {
            T[j][i] = A[i][j];
        }
    }
    product(&T, B)
}

/// Returns the 6 × 6 matrix of an articulated inertia.
#[inline(always)]
fn full<S: Scalar>(K: ArticulatedInertia<S>) -> Matrix<S> {
    let (linear, coupling, rotational) = (K.linear.full(), K.coupling, K.rotational.full());
    let column = |a: Vec3<S>, b: Vec3<S>| Force::new(a, b).to_array();
    let across = coupling.transpose();
    [
        column(linear.x, across.x),
        column(linear.y, across.y),
        column(linear.z, across.z),
        column(coupling.x, rotational.x),
        column(coupling.y, rotational.y),
        column(coupling.z, rotational.z),
    ]
}

/// Returns the symmetric part of a matrix as an articulated inertia.
#[inline(always)]
fn symmetric<S: Scalar>(A: &Matrix<S>) -> ArticulatedInertia<S> {
    let half = S::splat(0.5);
    let at = |i: usize, j: usize| (A[j][i] + A[i][j]) * half;
    let block = |o: usize| Sym3 {
        xx: at(o, o),
        xy: at(o, o + 1),
        yy: at(o + 1, o + 1),
        xz: at(o, o + 2),
        yz: at(o + 1, o + 2),
        zz: at(o + 2, o + 2),
    };
    let column = |j: usize| Vec3::new(at(0, j), at(1, j), at(2, j));
    ArticulatedInertia {
        linear: block(0),
        coupling: Mat3 { x: column(3), y: column(4), z: column(5) },
        rotational: block(3),
    }
}
