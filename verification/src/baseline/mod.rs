//! The tangent as an assembled matrix, as in most programs, for comparison with the matrix-free product.
//!
//! Two assemblies of the same blocks from the same shape-function values: [`assemble`] with `b_free` (eqs. 34, 38) or `voigt` (BᵀDB).

mod b_free;
mod blocks;
mod problem;
mod voigt;

pub use b_free::BFree;
pub use blocks::{BlockMatrix, Pattern, TooManyBlocks};
pub use problem::Assembled;
pub use voigt::Voigt;

use bfree::material::{Law, MaterialState};
use bfree::mechanics::residual::{Equilibrium, Inadmissible, compose};
use bfree::tensor::{Tensor, Vector, identity, scaled};

/// A formula for the D×D block of two nodes at one particle, geometric and material stiffness together.
pub trait Stiffness<const D: usize> {
    /// The blocks of all pairs of nodes of one particle. `volume` is its reference volume and `at` its current state. `gradients` holds the nodal gradients in the reference configuration. The result goes to `add(I, J, K_IJ)`, where I and J
    /// index `gradients`.
    fn blocks<L: Law>(
        &self,
        law: &L,
        at: &MaterialState<f64, D>,
        volume: f64,
        gradients: &[Vector<f64, D>],
        add: impl FnMut(usize, usize, Tensor<f64, D>),
    );
}

/// K(Δφ) = α₁ M̃ + Σ_p V₀ {…}, with every row and column, prescribed ones included; without follower pressure and damping.
///
/// # Errors
/// The first particle with det F ≤ 0.
pub fn assemble<'p, const D: usize, L: Law, S: Stiffness<D>>(
    equilibrium: &Equilibrium<'_, D, L>,
    dphi: &[Vector<f64, D>],
    pattern: &'p Pattern,
    stiffness: &S,
) -> Result<BlockMatrix<'p, D>, Inadmissible> {
    let eq = equilibrium.step;
    let mut matrix = BlockMatrix::zeros(pattern);
    for (node, &m) in eq.nodal.mass.iter().enumerate() {
        matrix.add(node, node, &scaled(&identity(), eq.alphas.a1 * eq.lumping * m));
    }
    let (mut nodes, mut values, mut gradients) = (Vec::new(), Vec::new(), Vec::new());
    for p in 0..eq.supports.particles() {
        let at_n = eq.particles.state(p, eq.dt);
        let at = at_n
            .deformed(compose(&eq.supports.gradient_at(p, dphi), &at_n.h))
            .admissible()
            .map_err(|source| Inadmissible { particle: eq.particles.id[p] as usize, source })?;
        let f_n_t = at_n.f.transpose();
        nodes.clear();
        values.clear();
        gradients.clear();
        for (node, n, grad_n) in eq.supports.of(p) {
            nodes.push(node);
            values.push(n);
            // ∇N = F_nᵀ ∇_n N
            gradients.push(f_n_t * grad_n);
        }
        let mass = eq.alphas.a1 * (1.0 - eq.lumping) * eq.particles.mass[p];
        stiffness.blocks(eq.law(p), &at, eq.particles.volume[p], &gradients, |i, j, block| {
            let inertia = mass * values[i] * values[j];
            matrix.add(nodes[i], nodes[j], &(block + scaled(&identity(), inertia)));
        });
    }
    Ok(matrix)
}
