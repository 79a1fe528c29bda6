//! Costs of a robot's state and control: weighted sums of activations of residuals.

use super::state::{groups, state_difference};
use crate::Error;
use crate::lq::LqNode;
use condyle_dynamics::{
    Data, DifferenceArgument, Model, Motion, Quaternion, ReferenceFrame, Se3, Vec3, difference_jacobian,
    forward_kinematics, lie,
};
use core::ops::Range;
use nalgebra::DMatrix;
use std::sync::Arc;

/// What a cost looks at: a vector r(x, u) that should be small.
#[derive(Clone, Debug, PartialEq)]
pub enum Residual {
    /// x ⊖ x_ref, 2 nv numbers.
    State {
        /// x_ref = (q, v).
        reference: Vec<f64>,
    },
    /// u − u_ref, nu numbers; zero at a terminal knot.
    Control {
        /// u_ref.
        reference: Vec<f64>,
    },
    /// log(refXo oXf), the twist from the target to the frame, in the target's frame: 6 numbers, linear first.
    FramePlacement {
        /// The frame.
        frame: usize,
        /// Its wanted pose in the world.
        target: Se3<f64>,
    },
    /// p − p_ref, 3 numbers, in the world.
    FrameTranslation {
        /// The frame.
        frame: usize,
        /// The wanted position of its origin in the world (m).
        target: Vec3<f64>,
    },
}

/// How much a residual costs.
#[derive(Clone, Debug, PartialEq)]
pub enum Activation {
    /// ½ Σ rᵢ².
    Quadratic,
    /// ½ Σ wᵢ rᵢ².
    Weighted(
        /// w, a number for each entry of the residual.
        Vec<f64>,
    ),
    /// ½ Σ (excess of rᵢ over its bounds)²: nothing inside them.
    Barrier {
        /// Least values; −∞ for none.
        lower: Vec<f64>,
        /// Greatest values; ∞ for none.
        upper: Vec<f64>,
    },
}

impl Activation {
    /// Value, first and second derivative of the i-th entry's part.
    #[inline]
    fn at(&self, i: usize, r: f64) -> (f64, f64, f64) {
        match self {
            Self::Quadratic => (0.5 * r * r, r, 1.0),
            Self::Weighted(w) => (0.5 * w[i] * r * r, w[i] * r, w[i]),
            Self::Barrier { lower, upper } => {
                let excess = (r - lower[i]).min(0.0) + (r - upper[i]).max(0.0);
                (0.5 * excess * excess, excess, f64::from(u8::from(excess != 0.0)))
            }
        }
    }
}

/// A term w · a(r(x, u)) of a cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// How it is called.
    pub name: String,
    /// w.
    pub weight: f64,
    /// r.
    pub residual: Residual,
    /// a.
    pub activation: Activation,
}

impl Cost {
    /// The term `weight` · activation(residual), called `name`.
    pub fn new(name: &str, weight: f64, residual: Residual, activation: Activation) -> Self {
        Self { name: name.to_owned(), weight, residual, activation }
    }
}

/// A sum of terms, with the scratch to compute it.
///
/// Derivatives are exact; second derivatives are Gauss–Newton's, w (∂r)ᵀ a″ ∂r.
#[derive(Clone, Debug)]
pub struct Costs {
    model: Arc<Model>,
    terms: Vec<Cost>,
    groups: Vec<Range<usize>>,
    data: Data<f64>,
    /// The residual.
    r: Vec<f64>,
    /// Its Jacobian with respect to q, of frames.
    J: DMatrix<f64>,
    /// The Jacobian of the difference of configurations.
    D: DMatrix<f64>,
}

impl Costs {
    /// The sum of some terms for a robot with nu controls.
    ///
    /// # Errors
    /// [`Error::Cost`] if a frame does not exist, or a reference, weight or bound has a wrong length or is not a
    /// number.
    pub fn new(model: Arc<Model>, nu: usize, terms: Vec<Cost>) -> Result<Self, Error> {
        let (nx, nv) = (model.nq() + model.nv(), model.nv());
        for term in &terms {
            let wrong = |what: String| Err(Error::Cost { name: term.name.clone(), what });
            let length = |name: &str, numbers: &[f64], expected: usize| match numbers.len() == expected {
                true if numbers.iter().any(|x| x.is_nan()) => wrong(format!("its {name} holds a NaN")),
                true => Ok(()),
                false => wrong(format!("its {name} has {} numbers, expected {expected}", numbers.len())),
            };
            let nr = match &term.residual {
                Residual::State { reference } => {
                    length("reference", reference, nx)?;
                    2 * nv
                }
                Residual::Control { reference } => {
                    length("reference", reference, nu)?;
                    nu
                }
                Residual::FramePlacement { frame, target } => {
                    let p = target.translation.to_array();
                    let R = target.rotation.columns().map(|c| c.to_array()).concat();
                    length("target", &[&p[..], &R].concat(), 12)?;
                    frame_exists(&model, *frame, &wrong)?;
                    6
                }
                Residual::FrameTranslation { frame, target } => {
                    length("target", &target.to_array(), 3)?;
                    frame_exists(&model, *frame, &wrong)?;
                    3
                }
            };
            if !term.weight.is_finite() {
                wrong(format!("its weight is {}", term.weight))?;
            }
            match &term.activation {
                Activation::Quadratic => {}
                Activation::Weighted(w) => length("weighting", w, nr)?,
                Activation::Barrier { lower, upper } => {
                    length("lower bound", lower, nr)?;
                    length("upper bound", upper, nr)?;
                }
            }
        }
        Ok(Self {
            groups: groups(&model),
            data: Data::new(&model),
            r: vec![0.0; (2 * nv).max(6)],
            J: DMatrix::zeros(6, nv),
            D: DMatrix::zeros(nv, nv),
            model,
            terms,
        })
    }

    /// The terms.
    pub fn terms(&self) -> &[Cost] {
        &self.terms
    }

    /// Changes the weight of the term called `name`, between solves; says whether there is one.
    pub fn set_weight(&mut self, name: &str, weight: f64) -> bool {
        let term = self.terms.iter_mut().find(|t| t.name == name);
        term.map(|t| t.weight = weight).is_some()
    }

    /// Σ w a(r(x, u)); u is empty at a terminal knot.
    pub fn calc(&mut self, x: &[f64], u: &[f64]) -> f64 {
        let mut sum = 0.0;
        for term in 0..self.terms.len() {
            let nr = self.residual(term, x, u);
            let Cost { weight, activation, .. } = &self.terms[term];
            for i in 0..nr {
                sum += weight * activation.at(i, self.r[i]).0;
            }
        }
        sum
    }

    /// Writes gradient and Hessian of `scale` · Σ w a(r(x, u)) into q, r, Q, S, R of the node; u is empty at a terminal
    /// knot.
    pub fn calc_diff(&mut self, x: &[f64], u: &[f64], scale: f64, node: &mut LqNode) {
        node.q.fill(0.0);
        node.r.fill(0.0);
        node.Q.fill(0.0);
        node.S.fill(0.0);
        node.R.fill(0.0);
        for term in 0..self.terms.len() {
            let nr = self.residual(term, x, u);
            let weight = scale * self.terms[term].weight;
            match self.terms[term].residual {
                Residual::State { .. } => self.add_state(term, weight, node),
                Residual::Control { .. } => {
                    for i in 0..nr {
                        let (_, d, dd) = self.terms[term].activation.at(i, self.r[i]);
                        node.r[i] += weight * d;
                        node.R[(i, i)] += weight * dd;
                    }
                }
                Residual::FramePlacement { frame, .. } | Residual::FrameTranslation { frame, .. } => {
                    self.add_frame(term, frame, x, weight, node);
                }
            }
        }
    }

    /// r of one term, in `self.r`; returns how many numbers it has.
    fn residual(&mut self, term: usize, x: &[f64], u: &[f64]) -> usize {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        match &self.terms[term].residual {
            Residual::State { reference } => {
                state_difference(&self.model, reference, x, &mut self.r[..2 * nv]); // x ⊖ x_ref
                2 * nv
            }
            Residual::Control { reference } => {
                for ((r, u), reference) in self.r.iter_mut().zip(u).zip(reference) {
                    *r = u - reference;
                }
                u.len()
            }
            Residual::FramePlacement { frame, target } => {
                let oXf = forward_kinematics(&self.model, &mut self.data, &x[..nq]).frame(*frame);
                let X = target.inverse() * oXf;
                let r = lie::log6(Quaternion::from_rotation(X.rotation), X.translation); // log(refXo oXf)
                self.r[..6].copy_from_slice(&r.to_array());
                6
            }
            Residual::FrameTranslation { frame, target } => {
                let oXf = forward_kinematics(&self.model, &mut self.data, &x[..nq]).frame(*frame);
                self.r[..3].copy_from_slice(&(oXf.translation - *target).to_array());
                3
            }
        }
    }

    /// Gradient and Hessian of a state's term: ∂r/∂x is the identity but for the groups' blocks of q.
    fn add_state(&mut self, term: usize, weight: f64, node: &mut LqNode) {
        let nv = self.model.nv();
        let activation = &self.terms[term].activation;
        let in_group = |i: usize| self.groups.iter().any(|g| g.contains(&i));
        for i in (0..2 * nv).filter(|&i| !in_group(i)) {
            let (_, d, dd) = activation.at(i, self.r[i]);
            node.q[i] += weight * d;
            node.Q[(i, i)] += weight * dd;
        }
        if self.groups.is_empty() {
            return;
        }
        difference_jacobian(&self.model, &self.r[..nv], DifferenceArgument::To, &mut self.D);
        for group in &self.groups {
            for i in group.clone() {
                let (_, d, dd) = activation.at(i, self.r[i]);
                for a in group.clone() {
                    let da = weight * self.D[(i, a)];
                    node.q[a] += da * d; // Dᵀ a′
                    for b in group.clone() {
                        node.Q[(a, b)] += da * dd * self.D[(i, b)]; // Dᵀ a″ D
                    }
                }
            }
        }
    }

    /// Gradient and Hessian of a frame's term, whose r was just computed: ∂r/∂q from the frame's Jacobian.
    fn add_frame(&mut self, term: usize, frame: usize, x: &[f64], weight: f64, node: &mut LqNode) {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        let placements = forward_kinematics(&self.model, &mut self.data, &x[..nq]);
        let Cost { residual, activation, .. } = &self.terms[term];
        let nr = match residual {
            Residual::FramePlacement { .. } => {
                placements.frame_jacobian(frame, ReferenceFrame::Local, &mut self.J);
                let r = [self.r[0], self.r[1], self.r[2], self.r[3], self.r[4], self.r[5]];
                let Jlog = lie::jlog6(Motion::from(r));
                for mut column in self.J.column_iter_mut() {
                    let m = [column[0], column[1], column[2], column[3], column[4], column[5]];
                    column.as_mut_slice().copy_from_slice(&(Jlog * Motion::from(m)).to_array()); // Jlog J
                }
                6
            }
            _ => {
                placements.frame_jacobian(frame, ReferenceFrame::LocalWorldAligned, &mut self.J);
                3
            }
        };
        for i in 0..nr {
            let (_, d, dd) = activation.at(i, self.r[i]);
            for a in 0..nv {
                let da = weight * self.J[(i, a)];
                node.q[a] += da * d; // Jᵀ a′
                for b in 0..nv {
                    node.Q[(b, a)] += da * dd * self.J[(i, b)]; // Jᵀ a″ J
                }
            }
        }
    }
}

fn frame_exists(model: &Model, frame: usize, wrong: &impl Fn(String) -> Result<(), Error>) -> Result<(), Error> {
    match model.frames().len() {
        frames if frame >= frames => wrong(format!("there is no frame {frame}; the robot has {frames}")),
        _ => Ok(()),
    }
}
