//! Inverse M⁻¹ of a robot with limbs, computed without M.
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 7.1. U = Iᴬ S and D = Sᵀ U + armature are
//! quantities of the articulated-body algorithm. Column e gets a unit acceleration, and no effort acts at the other
//! columns. The bodies that the joint of e carries then move by motions T, which start with T = S_e. Column d moves by
//! Z_de = −D_d⁻¹ U_dᵀ T, and the next body moves by T + S_d Z_de. The matrix Z of these numbers is the inverse of L in
//! M = Lᵀ D L. The diagonal of Z is 1, and Z has the zeros of the tree. With Z = L⁻¹, the inverse is the product
//!
//! ```text
//! M⁻¹ = Z D⁻¹ Zᵀ
//! ```
//!
//! For each pair of columns, the product has one term for each column e whose joint carries the bodies of both columns.
//! These terms are independent of each other.
#![allow(unsafe_code)]

use super::lanes::{Four, Limbs};
use super::{LANES, Plan};
use crate::passes::aba;
use crate::passes::kinematics::World;
use alloc::vec::Vec;
use condyle_model::layout::Layout;
use condyle_model::limbs::column_map::{ColumnBlock, Sizes};
use condyle_spatial::block::Block;
use condyle_spatial::gate::FusedF64;
use condyle_spatial::{Motion, Scalar};

/// Number of vector registers per row that are accumulated at the same time.
const SIDE: usize = 3;

#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    sizes: Sizes,
    /// Motions T, one per pair of a step and a column of the step's support (the columns on the paths from the root to
    /// the step's joints). Shape: sum of the support sizes of all steps. Written by: `carry`.
    T: Vec<Motion<Four>>,
    /// Matrix Z D⁻¹, with Z = L⁻¹ and M = Lᵀ D L, stored by rows. Each row contains only the columns on the path from
    /// the root, in this order. Shape: see `Sizes`, plus one entry. Written by: `carry`.
    ZD: Vec<f64>,
    /// Matrix Zᵀ, with Z = L⁻¹ and M = Lᵀ D L, stored by rows, including zeros and the ones on the diagonal. Shape: see
    /// `Sizes`, plus one entry. Written by: `carry`, `new`.
    Zt: Vec<f64>,
    /// Lower triangle of M⁻¹, stored by rows. Shape: same as `Zt`. Written by: `multiply`.
    rows: Vec<f64>,
}

impl Scratch {
    pub(crate) fn new(nv: usize, plan: &Plan) -> Self {
        let sizes = plan.columns.sizes;
        let mut Zt = vec![0.0; sizes.end_of_Zt() + 1];
        (0..nv).for_each(|k| Zt[k * (sizes.Zt + 1)] = 1.0);
        Self {
            sizes,
            T: vec![Motion::zero(); plan.columns.support.len()],
            ZD: vec![0.0; sizes.end_of_ZD() + 1],
            Zt,
            rows: vec![0.0; sizes.end_of_Zt()],
        }
    }

    /// Returns whether the scratch was made for this plan, or for a plan with the same sizes.
    pub(crate) fn fits(&self, plan: &Plan) -> bool {
        self.T.len() == plan.columns.support.len() && self.sizes == plan.columns.sizes
    }

    /// Computes M⁻¹ from the results of `aba::factorize` or `aba::pass`. `broadcast` must already have copied `D_inv`
    /// to the shared columns.
    #[inline(always)]
    pub(crate) fn inverse<V: Block<Number = f64>>(
        &mut self,
        l: &Limbs<'_>,
        w: &World<Four>,
        aba: &aba::Workspace<Four>,
        blocks: &[ColumnBlock],
        Minv: &mut [FusedF64],
    ) {
        self.carry(l, w, aba);
        for block in blocks {
            match block.count {
                1 => self.multiply::<V, 1>(block),
                2 => self.multiply::<V, 2>(block),
                3 => self.multiply::<V, 3>(block),
                _ => self.multiply::<V, 4>(block),
            }
        }
        mirror(&self.rows, self.sizes, Minv);
    }

    /// Computes Z D⁻¹ and Zᵀ, with Z = L⁻¹ and M = Lᵀ D L, in one pass from the root to the tips.
    #[inline(always)]
    fn carry(&mut self, l: &Limbs<'_>, w: &World<Four>, aba: &aba::Workspace<Four>) {
        let Self { T, ZD, Zt, .. } = self;
        let (T, ZD, Zt, D_inv) = (&mut T[..], &mut ZD[..], &mut Zt[..], &aba.D_inv[..]);
        for i in l.bodies() {
            let (first, end) = l.steps[i].support;
            let nv = l.joint(i).nv();
            for k in 0..nv {
                let (s, own) = (l.column(i) + k, end - nv + k);
                let (S, U) = (w.S[s], -aba.U[s].scale(D_inv[s]));
                for entry in first..own {
                    let felt = if k == 0 { l.predecessor(T, entry) } else { T[entry] };
                    let e = l.support[entry];
                    let Z = felt.dot(U); // Z_de = −D_d⁻¹ U_dᵀ T
                    let pair = l.pair(e, k);
                    put(Zt, &pair.in_Zt, Z);
                    put(ZD, &pair.in_ZD, Z * D_inv[e.column]);
                    if !l.steps[i].tip || nv > 1 {
                        T[entry] = S.scale_add(Z, felt); // T + S_d Z_de
                    }
                }
                T[own] = S;
                put(ZD, &l.pair(l.support[own], k).in_ZD, D_inv[s]);
            }
        }
    }

    /// Computes a block of rows of the inverse inertia matrix, up to the end of the vector that contains the last
    /// diagonal entry. The constant parameter M is the number of rows.
    #[inline(always)]
    fn multiply<V: Block<Number = f64>, const M: usize>(&mut self, block: &ColumnBlock) {
        let (mut start, end) = (0, block.first + M);
        while start < end {
            let many = (end - start).div_ceil(V::LANES);
            match many {
                1 => self.part::<V, M, 1>(block, start),
                2 => self.part::<V, M, 2>(block, start),
                _ => self.part::<V, M, SIDE>(block, start),
            }
            start += many.min(SIDE) * V::LANES;
        }
    }

    /// Computes entries of the inverse inertia matrix: N vectors of entries in each of M rows, beginning with column
    /// `start`. M and N are constant parameters.
    #[inline(always)]
    fn part<V: Block<Number = f64>, const M: usize, const N: usize>(&mut self, block: &ColumnBlock, start: usize) {
        let Self { ZD, Zt, rows, sizes: Sizes { ZD: depth, Zt: width, rows: n }, .. } = self;
        let (depth, width, many) = (*depth, *width, N * V::LANES);
        assert!(start + many <= width && Zt.len() >= *n * width);
        let path = &block.path[..depth.min(block.path.len())];
        let mut ZD_of = [&ZD[..0]; M];
        for m in 0..M {
            ZD_of[m] = &ZD[(block.first + m) * depth..][..path.len()];
        }
        let mut sums = [[V::zero(); N]; M];
        for (p, &e) in path.iter().enumerate() {
            if e >= start + many {
                break; // columns below e have no term of e
            }
            debug_assert!(e < *n);
            // SAFETY: the plan's paths consist of columns, and Zt has one row per column.
            let Zt = unsafe { Zt.get_unchecked(e * width + start..e * width + start + many) };
            let mut Z = [V::zero(); N];
            for x in 0..N {
                Z[x] = V::load(&Zt[x * V::LANES..]);
            }
            for m in 0..M {
                // SAFETY: `ZD_of` has a number for each column of the path.
                let s = V::splat(unsafe { *ZD_of[m].get_unchecked(p) });
                for x in 0..N {
                    sums[m][x] = Z[x].mul_add(s, sums[m][x]); // M⁻¹_dj = Σ Z_de D_e⁻¹ Z_je
                }
            }
        }
        for m in 0..M {
            let row = &mut rows[(block.first + m) * width + start..][..many];
            for x in 0..N {
                sums[m][x].store(&mut row[x * V::LANES..]);
            }
        }
    }
}

/// Writes the number in each lane of x to entry `at[lane]`.
#[inline(always)]
fn put(to: &mut [f64], at: &[u32; LANES], x: Four) {
    let x = x.to_array();
    for lane in 0..LANES {
        debug_assert!((at[lane] as usize) < to.len());
        // SAFETY: the plan's indices are below the sizes for which the matrices were made; `fits` compares these sizes.
        unsafe { *to.get_unchecked_mut(at[lane] as usize) = x[lane] };
    }
}

/// Computes a symmetric matrix X from its lower triangle, which `rows` contains.
#[inline(always)]
fn mirror(rows: &[f64], Sizes { rows: n, Zt: width, .. }: Sizes, X: &mut [FusedF64]) {
    assert!(n <= width && rows.len() >= n * width && X.len() >= n * n);
    let whole = n - n % LANES;
    for k in (0..whole).step_by(LANES) {
        for j in (0..=k).step_by(LANES) {
            let mut block = [Four::zero(); LANES];
            for r in 0..LANES {
                // SAFETY: row k + r and the columns from j are inside the n rows of `rows`: k + r < n, and j + LANES ≤
                // n ≤ width.
                block[r] = Four::load(unsafe { rows.get_unchecked((k + r) * width + j..(k + r) * width + j + LANES) });
            }
            // SAFETY: the block's rows are inside X, by the same inequalities.
            unsafe { write(X, k * n + j, n, &block) };
            Four::transpose(&mut block);
            if j < k {
                // SAFETY: row j + r and the columns from k are inside the n × n matrix X: j + r < n, and k + LANES ≤ n.
                unsafe { write(X, j * n + k, n, &block) };
            }
        }
        for r in 1..LANES {
            for j in 0..r {
                X[(k + j) * n + k + r] = FusedF64(rows[(k + r) * width + k + j]);
            }
        }
    }
    for r in whole..n {
        for j in 0..=r {
            let x = FusedF64(rows[r * width + j]);
            (X[r * n + j], X[j * n + r]) = (x, x);
        }
    }
}

/// Writes the rows of a block to X. The first row begins at entry `at`, and each row begins n entries after the
/// previous row.
///
/// # Safety
/// The block's last row must end inside X.
#[inline(always)]
unsafe fn write(X: &mut [FusedF64], at: usize, n: usize, block: &[Four; LANES]) {
    for r in 0..LANES {
        debug_assert!(at + r * n + LANES <= X.len());
        // SAFETY: the caller guarantees that the rows are inside X.
        let to = unsafe { X.get_unchecked_mut(at + r * n..at + r * n + LANES) };
        to.copy_from_slice(&block[r].to_fused());
    }
}
