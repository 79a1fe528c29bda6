//! What the dynamics of a knot offer to its residuals, and what residuals share.

use super::quadratic::{Row, Rows};
use super::sight::{Eyes, Known, Seen, Stack};
use super::state::groups;
use super::terms::{Room, View};
use condyle_dynamics::{Data, Model, centroidal_derivatives, forward_kinematics, forward_velocities};
use core::ops::Range;
use nalgebra::DMatrix;

/// A vector that the dynamics of a knot give beside the next state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Signal {
    /// q̈, or v⁺ − v at an impact.
    Acceleration,
    /// τ of all joints.
    Effort,
    /// λ, the forces or impulses of all contacts.
    Force,
}

/// What the dynamics of a knot can tell, known when it is made.
#[derive(Clone, Debug, Default)]
pub(super) struct Offer {
    pub nu: usize,
    /// Whether there are accelerations and efforts.
    pub effort: bool,
    /// Whether it is an impact.
    pub impulse: bool,
    /// The contacts' names and rows of λ.
    pub contacts: Vec<(String, Range<usize>)>,
}

impl Offer {
    /// The rows of a contact.
    pub(super) fn contact(&self, name: &str) -> Result<Range<usize>, String> {
        match self.contacts.iter().find(|(n, _)| n == name) {
            Some((_, rows)) => Ok(rows.clone()),
            None => {
                let names: Vec<_> = self.contacts.iter().map(|(n, _)| format!("`{n}`")).collect();
                let there = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                Err(format!("there is no contact `{name}` at this knot; there is {there}"))
            }
        }
    }
}

/// A knot as its residuals see it.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub x: &'a [f64],
    pub u: &'a [f64],
    /// q̈, or v⁺ − v at an impact.
    pub a: &'a [f64],
    pub tau: &'a [f64],
    pub lambda: &'a [f64],
}

/// How the signals of a knot change with x and u.
pub(super) trait Slopes {
    /// g += c · ∂s_row/∂(u, v, q) for entry `row` of a signal s.
    fn add_row(&self, signal: Signal, row: usize, c: f64, g: &mut Row<'_>);
}

/// Of a knot without dynamics.
pub(super) struct NoSlopes;

impl Slopes for NoSlopes {
    fn add_row(&self, _: Signal, _: usize, _: f64, _: &mut Row<'_>) {}
}

/// g += c X[row, :] for a matrix with as many columns as g has numbers.
pub(super) fn add_matrix_row(X: &DMatrix<f64>, row: usize, c: f64, g: &mut [f64]) {
    for (g, column) in g.iter_mut().zip(X.as_slice().chunks_exact(X.nrows())) {
        *g += c * column[row];
    }
}

/// What the residuals of a knot look at, so that each is computed once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Needs {
    pub placements: bool,
    pub velocities: bool,
    /// The Jacobian of the centre of mass.
    pub com: bool,
    pub momentum: bool,
    /// g, the efforts that hold the robot still.
    pub gravity: bool,
    /// M q̈ + h, the efforts of joints and contacts.
    pub inertia: bool,
    pub impulse_com: bool,
}

impl Needs {
    /// Whether there is anything to see.
    pub(super) fn eyes(self) -> bool {
        self.placements || self.velocities || self.gravity
    }
}

impl core::ops::BitOr for Needs {
    type Output = Self;
    fn bitor(self, o: Self) -> Self {
        Self {
            placements: self.placements | o.placements,
            velocities: self.velocities | o.velocities,
            com: self.com | o.com,
            momentum: self.momentum | o.momentum,
            gravity: self.gravity | o.gravity,
            inertia: self.inertia | o.inertia,
            impulse_com: self.impulse_com | o.impulse_com,
        }
    }
}

/// The robot's kinematics at a knot, and the scratch of its residuals.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    data: Data<f64>,
    eyes: Eyes<f64>,
    seen: Seen,
    pub scratch: Scratch,
}

/// What residuals write, and the quantities of the whole robot.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    /// The residual, its activation's gradient and the diagonal of the Hessian.
    pub r: Vec<f64>,
    pub d: Vec<f64>,
    pub dd: Vec<f64>,
    /// The rows of all Jacobians.
    pub rows: Rows,
    /// The Jacobian of the difference of configurations. Shape: nv × nv.
    pub D: DMatrix<f64>,
    /// At an impact ∂c/∂q, and ∂ċ/∂q for the change of velocity there. Shape: 3 × nv.
    pub com: [DMatrix<f64>; 2],
    /// J_c (v⁺ − v).
    pub com_change: [f64; 3],
    /// The coordinates of each group of positions that is no vector space.
    pub groups: Vec<Range<usize>>,
    /// Zeros. Shape: nv.
    zero: Vec<f64>,
}

impl Watch {
    /// For a robot with nu controls and some residuals.
    pub(super) fn new(model: &Model, nu: usize, room: Room) -> Self {
        let nv = model.nv();
        let rows = |n| DMatrix::zeros(n, nv);
        let scratch = Scratch {
            r: vec![0.0; room.longest],
            d: vec![0.0; room.longest],
            dd: vec![0.0; room.longest],
            rows: Rows::new(nv, nu, room.rows),
            D: rows(nv),
            com: [rows(3), rows(3)],
            com_change: [0.0; 3],
            groups: groups(model),
            zero: vec![0.0; nv],
        };
        let mut seen = Seen::default();
        seen.make_room(nv, room);
        Self { data: Data::new(model), eyes: Eyes::new(model), seen, scratch }
    }

    /// Makes room for other residuals.
    pub(super) fn resize(&mut self, nu: usize, room: Room) {
        let (nv, s) = (self.scratch.zero.len(), &mut self.scratch);
        self.seen.make_room(nv, room);
        for numbers in [&mut s.r, &mut s.d, &mut s.dd] {
            numbers.resize(room.longest, 0.0);
        }
        s.rows = Rows::new(nv, nu, room.rows);
    }

    /// Computes what the residuals of a knot need of a scene, with its slopes if they are asked for; what they see of its
    /// kinematics only if it is not known.
    pub(super) fn look<'a>(
        &'a mut self,
        model: &'a Model,
        stack: Stack<'_>,
        scene: &'a Scene<'a>,
        slopes: bool,
        known: Known<'a>,
    ) -> View<'a> {
        let (Self { data, eyes, seen: own, scratch }, needs) = (self, stack.needs());
        let (q, v) = scene.x.split_at(model.nq());
        if needs.impulse_com {
            let change = forward_velocities(model, data, q, scene.a).com_velocity();
            scratch.com_change = change.to_array();
        }
        if slopes && needs.impulse_com {
            let d = centroidal_derivatives(model, data, q, scene.a, &scratch.zero);
            scratch.com[0].as_mut_slice().copy_from_slice(d.dcom_dq.as_slice());
            scratch.com[1].as_mut_slice().copy_from_slice(d.dvcom_dq.as_slice());
        }
        let mut look = |data: &mut Data<f64>| {
            data.placements(model); // of limbs side by side, too
            eyes.look(model, data, [q, v, scene.a], slopes, &[stack], core::slice::from_mut(own));
        };
        let sight = match known {
            Known::Seen(seen) => seen.all(),
            Known::Placed(data) => {
                look(data);
                own.all()
            }
            Known::Nothing => {
                if needs.placements && !needs.velocities {
                    forward_kinematics(model, data, q);
                }
                look(data);
                own.all()
            }
        };
        View { model, scene, sight, scratch }
    }
}
