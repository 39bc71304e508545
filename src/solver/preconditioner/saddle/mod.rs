//! A preconditioner for systems in motions and pressures, [A Bᵀ; B −C]. The iterations of GMRES depend neither on C nor much on the grid.
//!
//! With γ of the cells, the system is equivalent to
//!
//! ```text
//! [A + Bᵀ γ B  Bᵀ ] [u]   [r_u + Bᵀ γ r_v]
//! [B           −C′] [q] = [r_v           ],   q = (1 − γ C) p,  C′ = C/(1 − γ C).
//! ```
//!
//! Its lower triangle is solved with approximate inverses: multigrid for A + Bᵀ γ B, and a Schur complement S for B (A + Bᵀ γ B)⁻¹ Bᵀ + C′:
//!
//! ```text
//! u = M⁻¹ (r_u + Bᵀ γ r_v),  q = −S⁻¹ (r_v − B u)
//! ```

mod cells;
mod schur;

pub use cells::PressureCells;
pub(crate) use schur::bytes;

use super::Preconditioner;
use crate::solver::{LinearOperator, Linearization, SaddlePoint};
use schur::Schur;

/// The block-triangular preconditioner over a preconditioner of A + Bᵀ γ B. For systems without pressures it is that preconditioner.
pub struct Saddle<const D: usize> {
    motions: Box<dyn Preconditioner>,
    schur: Option<Schur<D>>,
}

impl<const D: usize> Saddle<D> {
    /// The preconditioner over one of A + Bᵀ γ B.
    pub(crate) fn over(motions: Box<dyn Preconditioner>) -> Self {
        Self { motions, schur: None }
    }
}

impl<const D: usize> Preconditioner for Saddle<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        let Some(system) = tangent.saddle_point() else { return self.motions.prepare(tangent) };
        let schur = self.schur.get_or_insert_with(|| Schur::new(system.cells()));
        Box::new(Triangle { system, schur, motions: self.motions.prepare(system.augmented()) })
    }
}

/// The solve with the lower triangle.
struct Triangle<'a, const D: usize> {
    system: &'a dyn SaddlePoint,
    schur: &'a Schur<D>,
    motions: Box<dyn LinearOperator + 'a>,
}

impl<const D: usize> LinearOperator for Triangle<'_, D> {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        let cells = &self.schur.cells;
        let nodal = r.len() - cells.volume.len();
        let ((r_u, r_c), (u, y)) = (r.split_at(nodal), z.split_at_mut(nodal));
        let volumes: Vec<f64> = r_c.iter().zip(&cells.weight).map(|(r, weight)| r / weight).collect();
        let pressures: Vec<f64> = volumes.iter().zip(&cells.augmentation).map(|(v, gamma)| v * gamma).collect();
        let mut f = vec![0.0; nodal];
        self.system.forces(&pressures, &mut f);
        f.iter_mut().zip(r_u).for_each(|(f, r)| *f += r);
        self.motions.apply(&f, u);
        let mut left = vec![0.0; volumes.len()];
        self.system.volume_changes(u, &mut left);
        left.iter_mut().zip(&volumes).for_each(|(left, v)| *left -= v);
        self.schur.solve(&left, y);
        mutant!("saddle: the pressures have the other sign": { y.iter_mut().for_each(|y| *y = -*y); });
        for (c, y) in y.iter_mut().enumerate() {
            // δp = q/(1 − γ/k) = k unit y
            *y /= (self.schur.stiffness(c) - cells.augmentation[c]) * cells.unit[c];
        }
    }
}
