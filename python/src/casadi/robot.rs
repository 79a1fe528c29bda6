//! The computations of slots for the functions of a robot.

use super::chart::Chart;
use super::computation::{Calls, Computation, Output};
use super::function::{DualScratch, Kind, Pattern, Scratch};
use super::lanes::Lanes;
use condyle::{ConstraintSet, Model, ModelError as Error};
use nalgebra::DMatrix;
use std::sync::Arc;

/// A function of a robot as the computation of a slot.
pub(super) struct RobotFunction {
    of: Arc<(Model, Kind)>,
    /// Number of rows of the constraints. `results` is the total number of entries of the results.
    rows: usize,
    results: usize,
    /// For each pair of coordinates, whether the two coordinates move a common body; nv × nv.
    relation: Vec<bool>,
    /// For each of the nv coordinates, whether the coordinate moves a whole tree. M and the Coriolis forces do not
    /// depend on such a coordinate.
    moves_a_tree: Vec<bool>,
}

impl RobotFunction {
    pub(super) fn new(model: &Model, kind: Kind) -> Result<Self, Error> {
        let nv = model.nv();
        let rows = match &kind {
            Kind::ConstrainedDynamics { constraints } => ConstraintSet::<f64>::new(model, constraints)?.rows(),
            _ => 0,
        };
        let results = kind.outputs(nv, rows).iter().map(|o| o.rows * o.columns).sum();
        let mut relation = vec![false; nv * nv];
        for (j, rows) in model.nonzero_rows().iter().enumerate() {
            rows.rows.iter().for_each(|&i| (relation[i * nv + j], relation[j * nv + i]) = (true, true));
        }
        let mut moves_a_tree = vec![false; nv];
        if model.bodies().iter().all(|body| body.mimic.is_none()) {
            for body in model.bodies().iter().skip(1).filter(|body| body.parent == 0) {
                moves_a_tree[body.idx_v..body.idx_v + body.joint.nv()].fill(true);
            }
        }
        Ok(Self { of: Arc::new((model.clone(), kind)), rows, results, relation, moves_a_tree })
    }

    fn related(&self, i: usize, j: usize) -> bool {
        self.relation[i * self.of.0.nv() + j]
    }
}

impl Computation for RobotFunction {
    fn arguments(&self) -> Vec<(&'static str, usize)> {
        let (model, kind) = &*self.of;
        let size = |k: usize| if k == 0 { model.nq() } else { model.nv() };
        kind.arguments().iter().enumerate().map(|(k, name)| (*name, size(k))).collect()
    }

    fn outputs(&self) -> Vec<Output> {
        self.of.1.outputs(self.of.0.nv(), self.rows)
    }

    fn chart(&self) -> Chart {
        Chart::new(&self.of.0)
    }

    fn present(&self, _: usize, i: usize, j: usize) -> bool {
        !matches!(self.of.1, Kind::Crba) || self.related(i, j) // M has zeros for unrelated coordinates
    }

    fn depends(&self, row: usize, j: usize) -> bool {
        let nv = self.of.0.nv();
        let is_inertia = matches!(self.of.1, Kind::Crba);
        !(is_inertia && self.moves_a_tree[j]) && self.of.1.depends(row, j % nv, nv, |i, j| self.related(i, j))
    }

    fn curves(&self, i: usize, j: usize) -> bool {
        let nv = self.of.0.nv();
        // in τ = M(q) a + C(q, v) v + g(q), only the gravity efforts g depend on the position and rotation of a whole
        // tree
        let stands = |i: usize| i < nv && self.moves_a_tree[i];
        let other_than_gravity = match self.of.1 {
            Kind::Rnea | Kind::Aba => i >= nv || j >= nv,
            Kind::Crba => true,
            _ => false,
        };
        if other_than_gravity && (stands(i) || stands(j)) {
            return false;
        }
        match self.of.1.second_derivatives(i / nv, j / nv) {
            Pattern::Zero => false,
            Pattern::Full => true,
            Pattern::Related => self.related(i % nv, j % nv),
        }
    }

    fn calls(&self, states: usize) -> Result<Box<dyn Calls>, Error> {
        let (model, kind) = &*self.of;
        let scratch = kind.scratch(model)?;
        let lanes = Lanes::new(model, kind, states);
        Ok(Box::new(RobotCalls { of: self.of.clone(), results: self.results, scratch, dual: None, lanes }))
    }
}

/// Work space for calls of a robot's function.
struct RobotCalls {
    of: Arc<(Model, Kind)>,
    results: usize,
    scratch: Scratch<f64>,
    dual: Option<Box<DualScratch>>,
    /// Work space for several states at a time; `None` if the function computes one state at a time.
    lanes: Option<Lanes>,
}

impl Calls for RobotCalls {
    fn most(&self) -> usize {
        self.lanes.as_ref().map_or(1, Lanes::most)
    }

    fn value(&mut self, x: &[Vec<f64>], y: &mut [f64]) {
        if let Some(lanes) = &mut self.lanes {
            return lanes.value(&self.of.0, x, y);
        }
        self.of.1.value(&self.of.0, &mut self.scratch, x, y);
    }

    fn jacobian(&mut self, x: &[Vec<f64>], J: &mut [DMatrix<f64>]) {
        if let Some(lanes) = &mut self.lanes {
            return lanes.jacobian(&self.of.0, x, J);
        }
        self.of.1.jacobian(&self.of.0, &mut self.scratch, x, &mut J[0]);
    }

    fn hessian(
        &mut self,
        x: &[Vec<f64>],
        lambda: &[f64],
        J: Option<&mut [DMatrix<f64>]>,
        H: &mut [DMatrix<f64>],
    ) -> Result<(), Error> {
        let Self { of, results, scratch, dual, lanes } = self;
        let (model, kind) = &**of;
        if let Some(lanes) = lanes {
            lanes.hessian(model, x, lambda, J, H);
            return Ok(());
        }
        let (mut J, H) = (J.map(|J| &mut J[0]), &mut H[0]);
        if kind.closed_hessian(model, scratch, x, lambda, J.as_deref_mut(), H) {
            return Ok(());
        }
        if let Some(J) = J {
            kind.jacobian(model, scratch, x, J);
        }
        let dual = match dual {
            Some(dual) => dual,
            None => dual.insert(Box::new(kind.dual_scratch(model, *results)?)),
        };
        kind.hessian(model, dual, x, lambda, H);
        Ok(())
    }
}
