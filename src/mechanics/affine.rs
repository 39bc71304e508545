//! Projection by affine fits. A mean over the particles that a node sees is the field where their centre of mass is; near a free face that is
//! not the place of the node, and a body that spins seems to spin more slowly there. With a gradient G for each particle it is the field
//! at the node:
//!
//! u_I = ⟨u_p + G_p (x_I − x_p)⟩_I,  ⟨·⟩_I = Σ_p N m (·) / m_I,
//!
//! G_p = Σ_I N_I B_I,  B_I = (⟨u ⊗ x⟩ − ū ⊗ x̄) (⟨x ⊗ x⟩ − x̄ ⊗ x̄ + δ h² 1)⁻¹.
//!
//! B is the slope of the least squares, weighted with N m. As Σ_I N_I (x_I − x_p) = 0, momentum is that of the particles for any G. Affine
//! fields are met to O(δ).

use crate::mechanics::mass::is_light;
use crate::mechanics::sweep::Supports;
use crate::particles::Particles;
use crate::pooled::Pooled;
use crate::tensor::{Tensor, Vector, identity, inverse, scaled};

/// δ: across directions in which a node sees particles in less than this of h², the field is taken as constant. Two rows of particles in
/// a cell have 1/16.
const FLAT: f64 = 1e-3;

/// u_I of two fields of the particles; `mass` is the lumped one of the active nodes. Nodes that have next to none get zero.
pub(super) fn affine<const D: usize>(
    particles: &Particles<D>,
    supports: &Supports<D>,
    mass: &[f64],
    fields: [&[Vector<f64, D>]; 2],
) -> [Pooled<Vector<f64, D>>; 2] {
    let (grid, is_light) = (supports.grid(), is_light(particles));
    // Seen from a particle, squares of places keep more digits.
    let origin = particles.position.first().copied().unwrap_or_else(Vector::zeros);
    let x = |p: usize| particles.position[p] - origin;
    let mean = |value: &(dyn Fn(usize) -> Vector<f64, D> + Sync)| {
        let mut mean: Pooled<Vector<f64, D>> = supports.field();
        supports.spread(&mut mean, |p| value(p) * particles.mass[p]);
        mean.iter_mut().zip(mass).for_each(|(mean, &m)| *mean = if is_light(m) { Vector::zeros() } else { *mean / m });
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
            let column = supports.pool().collect(slopes.iter().map(|slope| slope.column(k).into_owned()));
            supports.each_value(&column, |p, column| gradient[p].set_column(k, &column));
        }
        // ⟨u − G x⟩ + ⟨G⟩ x_I
        let mut fitted = mean(&|p| field[p] - gradient[p] * x(p));
        for k in 0..D {
            let slope = mean(&|p| gradient[p].column(k).into_owned());
            let places = supports.active().positions(grid).map(|(_, place)| place[k] - origin[k]);
            fitted.iter_mut().zip(&slope).zip(places).for_each(|((fitted, slope), x)| *fitted += slope * x);
        }
        fitted
    })
}
