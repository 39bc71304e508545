//! Blocks as BᵀDB in Voigt's notation, plus the geometric term: the textbook way (Belytschko, Liu, Moran, section 4.9).

use super::Stiffness;
use bfree::material::{Law, MaterialState};
use bfree::tensor::{Tensor, Vector, identity, scaled};
use nalgebra::SMatrix;

/// The number of components of a symmetric tensor in Voigt's order, in three dimensions.
const MOST: usize = 6;

/// The pairs of Voigt's order, 11, 22, 33, 23, 13, 12, that exist in this dimension.
const fn pairs(dimension: usize) -> &'static [(usize, usize)] {
    match dimension {
        1 => &[(0, 0)],
        2 => &[(0, 0), (1, 1), (0, 1)],
        _ => &[(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)],
    }
}

/// K_IJ = V₀ { B_Iᵀ D B_J + (∇N_I · S ∇N_J) I } with B from F and ∇N, and D from ℂ on the unit strains.
#[derive(Clone, Copy, Debug, Default)]
pub struct Voigt;

/// B_I: the strains E₁₁ …, 2E₁₂ … of a unit displacement of the node.
fn strain_matrix<const D: usize>(f: &Tensor<f64, D>, grad: &Vector<f64, D>) -> SMatrix<f64, MOST, D> {
    let mut b = SMatrix::zeros();
    for (row, &(a, c)) in pairs(D).iter().enumerate() {
        for i in 0..D {
            b[(row, i)] = if a == c { f[(i, a)] * grad[a] } else { f[(i, a)] * grad[c] + f[(i, c)] * grad[a] };
        }
    }
    b
}

/// V₀ D. Rows and columns beyond the dimension are zero and are never read.
fn moduli<L: Law, const D: usize>(law: &L, at: &MaterialState<f64, D>, volume: f64) -> SMatrix<f64, MOST, MOST> {
    let mut moduli = SMatrix::zeros();
    for (column, &(a, c)) in pairs(D).iter().enumerate() {
        // A unit of the engineering shear is half a unit in each of E_ac and E_ca.
        let mut strain = Tensor::<f64, D>::zeros();
        strain[(a, c)] += 0.5;
        strain[(c, a)] += 0.5;
        let stress = law.elasticity(at, &strain);
        for (row, &(i, k)) in pairs(D).iter().enumerate() {
            moduli[(row, column)] = volume * stress[(i, k)];
        }
    }
    moduli
}

impl<const D: usize> Stiffness<D> for Voigt {
    /// D B_J is formed once per node, not once per pair.
    fn blocks<L: Law>(
        &self,
        law: &L,
        at: &MaterialState<f64, D>,
        volume: f64,
        gradients: &[Vector<f64, D>],
        mut add: impl FnMut(usize, usize, Tensor<f64, D>),
    ) {
        let count = pairs(D).len();
        let (moduli, stress) = (moduli(law, at, volume), scaled(&law.stress(at), volume));
        let b: Vec<_> = gradients.iter().map(|grad| strain_matrix(&at.f, grad)).collect();
        let d_b: Vec<_> = (b.iter())
            .map(|b| SMatrix::<f64, MOST, D>::from_fn(|row, i| (0..count).map(|k| moduli[(row, k)] * b[(k, i)]).sum()))
            .collect();
        let s_grad: Vec<_> = gradients.iter().map(|grad| stress * grad).collect();
        for (i, grad_i) in gradients.iter().enumerate() {
            for j in 0..gradients.len() {
                // Only the rows that exist enter the product.
                let material =
                    Tensor::<f64, D>::from_fn(|a, c| (0..count).map(|row| b[i][(row, a)] * d_b[j][(row, c)]).sum());
                add(i, j, material + scaled(&identity(), grad_i.dot(&s_grad[j])));
            }
        }
    }
}
