//! The mixed form for nearly incompressible bodies: the dilatation Θ of each averaged cell is an unknown of its own, beside the motion.
//!
//! [`Simulation::is_mixed`](crate::simulation::Simulation) says when a step has this form: long steps of a nearly incompressible body.
//!
//! Where the volumetric stiffness κ is much larger than G, Newton's method in the displacements takes many short steps, and the iterations of
//! its linear solver grow with κ/G. The mixed form has neither defect. Its residuals are
//!
//! ```text
//! r_u = R(Δφ, π(Θ)),  r_v = v(Δφ) − Θ V_c,
//! ```
//!
//! with the pressure π of [mean dilatation](crate::mechanics::terms). Where r_v = 0, the solution is that of the displacement form, which has the
//! motion alone. With δp = π' δΘ the linear system is
//!
//! ```text
//! [A  Bᵀ] [δu]     [r_u]
//! [B  −C] [δp] = − [r_v],   B = ∂v/∂u,  C = 1/k,  k = ∂π/∂v.
//! ```
//!
//! A contains π, but no volumetric stiffness. The unknown of a cell is the length κ h/G (Θ − 1), and its residual is the force G/h r_v. So the
//! norm of the residual weighs both equations alike, and loose solves do not spoil the pressures.

use crate::mechanics::linearized::MixedCell;
use crate::mechanics::tangent::Tangent;
use crate::pooled::Pooled;
use crate::solver::{LinearOperator, Linearization, PressureCells, SaddlePoint};
use crate::tensor::{Tensor, Vector, inverse};

/// The tangent in the motion of the nodes and the dilatation of the cells.
pub(crate) struct MixedTangent<'a, const D: usize> {
    /// Its product is (A + Bᵀ γ B) u, and with given pressures A u + Bᵀ p.
    pub tangent: Tangent<'a, D>,
}

impl<const D: usize> MixedTangent<'_, D> {
    fn cells(&self) -> &[MixedCell<D>] {
        self.tangent.mixed_cells().and_then(|rows| rows.mixed.as_deref()).unwrap_or_default()
    }

    /// The number of entries of a nodal field.
    fn nodal(&self) -> usize {
        self.tangent.space.entries()
    }

    /// δp of every cell per unit of its unknown.
    fn pressures(&self) -> impl Iterator<Item = f64> {
        self.cells().iter().map(|cell| cell.stiffness * cell.reference_volume * cell.scale.dilatation)
    }
}

impl<const D: usize> LinearOperator for MixedTangent<'_, D> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (u, unknowns) = x.split_at(self.nodal());
        let (forces, residuals) = y.split_at_mut(self.nodal());
        let pressures: Vec<f64> = unknowns.iter().zip(self.pressures()).map(|(unknown, p)| unknown * p).collect();
        self.forces_of(u, &pressures, forces);
        self.volume_changes(u, residuals);
        for ((residual, unknown), cell) in residuals.iter_mut().zip(unknowns).zip(self.cells()) {
            *residual -= cell.reference_volume * cell.scale.dilatation * unknown;
            mutant!("mixed: the product lacks the compressibility": { *residual += cell.reference_volume * cell.scale.dilatation * unknown; });
            *residual *= cell.scale.force;
        }
    }
}

impl<const D: usize> MixedTangent<'_, D> {
    /// B_c K_II⁻¹ B_cᵀ of every cell, with the diagonal blocks K_II.
    fn compliance(&self) -> Vec<f64> {
        let (space, connectivity) = (&self.tangent.space, self.tangent.connectivity());
        let held = space.prescribed_mask();
        let mut blocks = self.tangent.diagonal_blocks();
        for (node, block) in blocks.iter_mut().enumerate() {
            let inverted = inverse(block);
            let free = |i: usize| !held[node * D + i];
            let finite = inverted.iter().all(|x| x.is_finite());
            *block = Tensor::from_fn(|i, k| if finite && free(i) && free(k) { inverted[(i, k)] } else { 0.0 });
        }
        let functions = |particle| space.functions(connectivity, particle);
        self.tangent.mixed_cells().map_or_else(Vec::new, |rows| rows.compliance(&functions, &blocks))
    }

    /// A u + Bᵀ p
    fn forces_of(&self, u: &[f64], pressures: &[f64], out: &mut [f64]) {
        self.tangent.product_under(bytemuck::cast_slice(u), Some(pressures), bytemuck::cast_slice_mut(out));
    }
}

/// The diagonal blocks are those of A + Bᵀ γ B.
impl<const D: usize> Linearization for MixedTangent<'_, D> {
    fn diagonal_blocks(&self) -> Pooled<f64> {
        Linearization::diagonal_blocks(&self.tangent)
    }

    fn saddle_point(&self) -> Option<&dyn SaddlePoint> {
        Some(self)
    }
}

impl<const D: usize> SaddlePoint for MixedTangent<'_, D> {
    fn augmented(&self) -> &dyn Linearization {
        &self.tangent
    }

    fn volume_changes(&self, u: &[f64], v: &mut [f64]) {
        let u: &[Vector<f64, D>] = bytemuck::cast_slice(u);
        let extended = self.tangent.space.extended_in_pool(u);
        match self.tangent.mixed_cells() {
            Some(rows) => {
                v.copy_from_slice(&rows.volume_changes(self.tangent.connectivity(), extended.as_deref().unwrap_or(u)));
            }
            None => v.fill(0.0),
        }
    }

    fn forces(&self, p: &[f64], f: &mut [f64]) {
        self.forces_of(&vec![0.0; self.nodal()], p, f);
    }

    fn cells(&self) -> PressureCells {
        let (connectivity, grid) = (self.tangent.connectivity(), self.tangent.connectivity().grid());
        let mut all = PressureCells {
            occupied: self.tangent.occupied_cells().0,
            compliance: self.compliance(),
            inertia: self.tangent.has_inertia,
            ..PressureCells::default()
        };
        for cell in self.cells() {
            let index = connectivity.in_lattice(cell.field, cell.index);
            let local = |k: usize| (cell.centroid[k] - grid.origin[k]) / grid.spacing;
            let shift = |k: usize| f64::from(index[k] - cell.index[k]);
            all.index.push(index);
            all.centroid.push(std::array::from_fn(|k| if k < D { local(k) + shift(k) } else { 0.0 }));
            // The form takes gradients in units of 1/h.
            all.volume_gradient.extend((cell.volume_gradient / grid.spacing).iter());
            all.volume.push(cell.volume);
            all.shear.push(cell.scale.shear);
            all.stiffness.push(cell.stiffness);
            all.augmentation.push(cell.augmentation);
            all.unit.push(cell.reference_volume * cell.scale.dilatation);
            all.weight.push(cell.scale.force);
        }
        all
    }
}
