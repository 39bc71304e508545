//! Projection by affine fits. The mean over the particles around a node is the value of the field at their centre of mass. Near a free
//! surface this centre is not at the node, and a spinning body seems to spin more slowly there. A gradient G for each particle gives the
//! field at the node:
//!
//! u_I = ⟨u_p + G_p (x_I − x_p)⟩_I,  ⟨·⟩_I = Σ_p N m (·) / m_I,
//!
//! G_p = Σ_I N_I B_I,  B_I = (⟨u ⊗ x⟩ − ū ⊗ x̄) (⟨x ⊗ x⟩ − x̄ ⊗ x̄ + δ h² 1)⁻¹.
//!
//! B is the slope of the least-squares fit, weighted with N m. Because Σ_I N_I (x_I − x_p) = 0, momentum is conserved for any G. Affine
//! fields are reproduced to O(δ).

use crate::mechanics::mass::is_light;
use crate::mechanics::sweep::Connectivity;
use crate::parallel;
use crate::particles::Particles;
use crate::pooled::Pooled;
use crate::tensor::{Tensor, Vector, identity, inverse, scaled};

/// δ: along directions in which the variance of the particle positions is below δ h², the field is taken as constant. Two rows of particles
/// in a cell have the variance h²/16.
const FLAT: f64 = 1e-3;

/// u_I of two particle fields. `mass` is the lumped mass of the active nodes. Light nodes get zero.
pub(super) fn affine<const D: usize>(
    particles: &Particles<D>,
    connectivity: &Connectivity<D>,
    mass: &[f64],
    fields: [&[Vector<f64, D>]; 2],
) -> [Pooled<Vector<f64, D>>; 2] {
    let (grid, is_light) = (connectivity.grid(), is_light(particles));
    // Relative to the first particle, squares of positions keep more digits.
    let position = particles.reference().position;
    let origin = position.first().copied().unwrap_or_else(Vector::zeros);
    let x = |p: usize| position[p] - origin;
    let mean = |value: &(dyn Fn(usize) -> Vector<f64, D> + Sync)| {
        let mut mean: Pooled<Vector<f64, D>> = connectivity.field();
        connectivity.spread(&mut mean, |p| value(p) * particles.mass[p]);
        parallel::zip(&mut mean, mass, |mean, &m| *mean = if is_light(m) { Vector::zeros() } else { *mean / m });
        mean
    };
    let centre = mean(&x);
    // ⟨u ⊗ x⟩ − ū ⊗ x̄ of every node.
    let covariance = |u: &(dyn Fn(usize) -> Vector<f64, D> + Sync)| -> Vec<Tensor<f64, D>> {
        let (of_u, columns) = (mean(u), std::array::from_fn::<_, D, _>(|k| mean(&|p| u(p) * x(p)[k])));
        let of_node = |node: usize| Tensor::from_fn(|i, k| columns[k][node][i] - of_u[node][i] * centre[node][k]);
        (0..mass.len()).map(of_node).collect()
    };
    let firm = scaled(&identity(), FLAT * grid.spacing * grid.spacing);
    let inverses: Vec<Tensor<f64, D>> = covariance(&x).iter().map(|spread| inverse(&(spread + firm))).collect();
    fields.map(|field| {
        let slopes: Vec<_> =
            covariance(&|p| field[p]).iter().zip(&inverses).map(|(with, inverse)| with * inverse).collect();
        let mut gradient = vec![Tensor::<f64, D>::zeros(); particles.len()];
        for k in 0..D {
            let column = connectivity.pool().made(slopes.len(), |node| slopes[node].column(k).into_owned());
            let columns = connectivity.values(&column);
            parallel::zip(&mut gradient, &columns, |gradient, column| gradient.set_column(k, column));
        }
        // ⟨u − G x⟩ + ⟨G⟩ x_I
        let mut fitted = mean(&|p| field[p] - gradient[p] * x(p));
        for k in 0..D {
            let slope = mean(&|p| gradient[p].column(k).into_owned());
            mutant!("transfer: affine fits lack their slope": { continue; });
            let places = connectivity.active().positions(grid).map(|(_, place)| place[k] - origin[k]);
            fitted.iter_mut().zip(&slope).zip(places).for_each(|((fitted, slope), x)| *fitted += slope * x);
        }
        fitted
    })
}
