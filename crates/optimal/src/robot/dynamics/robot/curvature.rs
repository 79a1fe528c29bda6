//! Second derivatives of a robot's accelerations and of its steps.

use super::{Parts, RobotDynamics, Work};
use crate::lq::Hessian;
use crate::robot::continuous::{Derivatives, KnotInput};
use crate::robot::dynamics::batch::{KnotBatch, Pass};
use condyle_dynamics::aba_hessian;

impl RobotDynamics {
    /// Computes the second derivatives of [`ContinuousModel::hessian`](crate::robot::ContinuousModel::hessian).
    pub(crate) fn hessian(
        &mut self,
        KnotInput { x, u, .. }: KnotInput<'_>,
        mu: &[f64],
        hessian: &mut Hessian,
    ) -> Option<Derivatives<'_>> {
        let Parts { model, actuation, work, .. } = self.parts();
        let Work { single: KnotBatch { data, pass, .. }, data: knots, da_du, .. } = work;
        let knot = &mut knots[0];
        match pass {
            Pass::Free => {
                actuation.effort(u, &mut knot.tau);
                let (nv, (q, v)) = (model.nv(), x.split_at(model.nq()));
                let data = &mut *data.get();
                let d = aba_hessian(model, data, q, v, &knot.tau, &[], mu);
                for c in 0..nv {
                    for r in 0..nv {
                        hessian.xx[(r, c)] = d.dqdq[(r, c)];
                        hessian.xx[(nv + r, c)] = d.dvdq[(r, c)];
                        hessian.xx[(c, nv + r)] = d.dvdq[(r, c)];
                        hessian.xx[(nv + r, nv + c)] = d.dvdv[(r, c)];
                    }
                    let column = &d.dtaudq.as_slice()[c * nv..][..nv];
                    for k in 0..u.len() {
                        hessian.xu[(c, k)] = actuation.along(k, column); // Sᵀ ∂²ψ/∂τ∂q
                        hessian.xu[(nv + c, k)] = 0.0;
                    }
                }
                hessian.uu.fill(0.0);
                let [da_dq, da_dv, da_dtau] = &mut knot.da;
                da_dq.copy_from(d.first.da_dq);
                da_dv.copy_from(d.first.da_dv);
                da_dtau.copy_from(d.first.da_dtau);
                knot.a.copy_from_slice(d.first.a);
                Some(Derivatives { a: &knot.a, da_dq, da_dv, da_du: actuation.columns(da_dtau, da_du) })
            }
            Pass::Inverse | Pass::ContactInverse(..) => {
                knot.a.copy_from_slice(&u[..model.nv()]);
                for part in [&mut hessian.xx, &mut hessian.xu, &mut hessian.uu] {
                    part.fill(0.0); // accelerations that are controls have no second derivatives
                }
                let [da_dq, da_dv, da_du] = &knot.da;
                Some(Derivatives { a: &knot.a, da_dq, da_dv, da_du: da_du.as_slice() })
            }
            _ => None,
        }
    }

    /// Computes the second derivatives of λᵀ(q ⊕ δq) with respect to q and δq.
    pub(crate) fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) {
        let Parts { model, groups, work, .. } = self.parts();
        work.group_hessian.run(model, groups, dq, lambda, hessian);
    }
}
