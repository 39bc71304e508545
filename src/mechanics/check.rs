//! The tangent check of a run. Each piece of the tangent, through the products that the solver applies, is compared with the derivative of
//! the residual by dual numbers.

use crate::material::{Law, MaterialState};
use crate::mechanics::constitutive::Part;
use crate::mechanics::kinematics::Kinematics;
use crate::mechanics::mixed::MixedTangent;
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::tangent::Tangent;
use crate::mechanics::terms::{Piece, Role};
use crate::mechanics::trial::Trial;
use crate::solver::LinearOperator;
use crate::tensor::{Tensor, Vector, identity, inverse};
use num_dual::Dual64;

/// The largest accepted relative difference: min(64 eps κ(F)², 1e-10), with κ(F) = ‖F‖ ‖F⁻¹‖.
///
/// ```
/// use bfree::mechanics::check::tangent_bound;
/// use bfree::tensor::{Tensor, Vector, identity};
///
/// // κ = ‖F‖ ‖F⁻¹‖ is 2 for F = I in 2D, and for any multiple of I. A flat particle is allowed more, up to 1e-10.
/// let bound = tangent_bound(&identity::<f64, 2>());
/// assert!((bound / (64.0 * 4.0 * f64::EPSILON) - 1.0).abs() < 1e-14);
/// assert_eq!(tangent_bound(&Tensor::<f64, 2>::from_diagonal(&Vector::from([8.0, 8.0]))), bound);
/// assert_eq!(tangent_bound(&Tensor::<f64, 2>::from_diagonal(&Vector::from([1.0, 1e-6]))), 1e-10);
/// ```
pub fn tangent_bound<const D: usize>(f: &Tensor<f64, D>) -> f64 {
    let condition = f.norm() * inverse(f).norm();
    (64.0 * f64::EPSILON * condition * condition).min(LARGEST)
}

/// The largest relative difference that is ever accepted. The mean stress of a step divides the round-off of energies by the square of the strain
/// in the step, and always has this bound; metals that yield strongly may exceed it (`docs/src/limits.md`).
const LARGEST: f64 = 1e-10;

/// A difference between the product with the tangent and the derivative of the residual.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the tangent is wrong ({compared}): the force on node {node} along axis {axis} is {analytic:e} by the product and {dual:e} by dual \
     numbers; allowed is a difference of {bound:e} relative to {scale:e}"
)]
pub struct TangentMismatch {
    /// The compared quantity: a term, a part of a term, the whole product, or the diagonal blocks.
    pub compared: &'static str,
    /// Number of the active node with the largest difference.
    pub node: usize,
    /// The component.
    pub axis: usize,
    /// The value by the product; for blocks, the value of the block.
    pub analytic: f64,
    /// The value by dual numbers; for blocks, the value by the product.
    pub dual: f64,
    /// The relative difference allowed.
    pub bound: f64,
    /// The size that the error is relative to.
    pub scale: f64,
}

/// A failed check.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// The tangent is wrong.
    #[error(transparent)]
    Mismatch(#[from] TangentMismatch),
    /// The tangent that a law from a shared library claims is not the derivative of its stress.
    #[error(
        "the law of particle {particle} claims a tangent that is not the derivative of its stress in this step: {sentence}; check the law \
         (tangent-check), also whether its stress turns with the body"
    )]
    Claim {
        /// Id of the particle.
        particle: usize,
        /// The component that is wrong.
        sentence: String,
    },
    /// The state cannot be evaluated.
    #[error(transparent)]
    Inadmissible(#[from] Inadmissible),
}

/// A quasi-random direction with entries in (−1, 1): the golden-ratio sequence, from a start that depends on `seed`.
///
/// ```
/// use bfree::mechanics::check::direction;
/// use bfree::tensor::Vector;
///
/// // Two seeds give different entries, and the entries fill (−1, 1) evenly: mean 0, mean square ⅓.
/// let (u, w) = (direction::<1>(1000, 1), direction::<1>(1000, 2));
/// assert!(u.iter().zip(&w).all(|(u, w)| u != w));
/// assert!(u.iter().sum::<Vector<f64, 1>>().norm() < 2.0);
/// assert!((u.iter().map(|u| u.norm_squared()).sum::<f64>() / 1000.0 - 1.0 / 3.0).abs() < 0.01);
/// ```
pub fn direction<const D: usize>(nodes: usize, seed: u64) -> Vec<Vector<f64, D>> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let start = (seed as f64 * 0.754_877_666_246_692_7).fract();
    let entry = |k: usize| 2.0 * (start + k as f64 * GOLDEN).fract() - 1.0;
    (0..nodes).map(|node| Vector::from_fn(|i, _| entry(node * D + i))).collect()
}

impl<const D: usize, L: Law> Equilibrium<'_, D, L> {
    /// Compares the tangent at φ in the direction `u`, each piece and the whole, with dual numbers through the same transfer loop. The
    /// tangent acts through the products that the solver applies. Then the diagonal blocks of the preconditioner are compared with the
    /// product. Laws from shared libraries compare their claims with differences, at a few particles.
    ///
    /// ```
    /// use bfree::mechanics::check::{CheckError, direction};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let coming = simulation.next_step()?;
    /// let (equilibrium, count) = (coming.equilibrium(), coming.nodes().len());
    /// let u = direction::<2>(count, 2);
    /// let phi: Vec<_> = direction::<2>(count, 1).iter().map(|x| x * 0.01).collect();
    /// equilibrium.check_tangent(&phi, &u)?;
    /// // Where a particle is turned inside out there is nothing to compare.
    /// let far: Vec<_> = phi.iter().map(|x| x * 1000.0).collect();
    /// assert!(matches!(equilibrium.check_tangent(&far, &u), Err(CheckError::Inadmissible(_))));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The first mismatch, or a particle with det F ≤ 0.
    pub fn check_tangent(&self, phi: &[Vector<f64, D>], u: &[Vector<f64, D>]) -> Result<(), CheckError> {
        self.check_along(Trial::motion(phi), Trial::motion(u))
    }

    /// [`Self::check_tangent`] at a trial state, in a direction that depends on `seed`. In the mixed form, the residuals and unknowns of
    /// cells belong to the product.
    pub(crate) fn check_tangent_at(&self, at: Trial<'_, f64, D>, seed: u64) -> Result<(), CheckError> {
        let of_cells: Vec<f64> = direction::<1>(at.dilatation.len(), seed + 1).iter().map(|x| x[0]).collect();
        self.check_along(at, Trial { phi: &direction(at.phi.len(), seed), dilatation: &of_cells })
    }

    fn check_along(&self, at: Trial<'_, f64, D>, along: Trial<'_, f64, D>) -> Result<(), CheckError> {
        let mut u = along.phi.to_vec();
        self.space.clear_prescribed(&mut u);
        let (u, phi) = (&u, &*self.space.extended(at.phi));
        let (at, along) = (Trial { phi, ..at }, Trial { phi: u, ..along });
        let bound = self.worst_bound(phi)?;
        self.check_claims(phi)?;
        let (mut whole, mut of_term, mut largest) = (Rows::zeros(along), 0.0, 0.0_f64);
        for piece in self.terms.pieces() {
            let dual = self.dual_rows(piece, at, along)?;
            let analytic = Rows::product(self.tangent_at(Some(piece), at)?, along);
            // The contributions of a piece may cancel, like those of pressure in 1D. Their size is then the scale of round-off.
            let mut scale = norm(&dual.nodes).max(self.size_of(piece, phi, u)?);
            if piece.part == Part::Whole {
                of_term = scale;
            }
            // A part may be the small difference of two larger numbers, the whole term and the other part.
            scale = scale.max(of_term);
            compare(piece.name, &analytic.nodes, &dual.nodes, bound, scale)?;
            compare(CELLS, &analytic.cells, &dual.cells, bound, norm(&dual.cells))?;
            if piece.part == Part::Whole {
                largest = largest.max(norm(&dual.nodes));
                whole.nodes.iter_mut().zip(&dual.nodes).for_each(|(sum, x)| *sum += x);
                whole.cells.iter_mut().zip(&dual.cells).for_each(|(sum, x)| *sum += x);
            }
        }
        let product = Rows::product(self.tangent_at(None, at)?, along);
        // Terms may cancel: mean dilatation takes the volumetric stiffness of the law away.
        compare("whole product", &product.nodes, &whole.nodes, bound, largest.max(norm(&whole.nodes)))?;
        compare(CELLS, &product.cells, &whole.cells, bound, norm(&whole.cells))?;
        self.check_blocks(&self.tangent_at(None, at)?, bound)
    }

    /// A piece of K u by dual numbers: the derivative of the same piece of the residual, through the same transfer loop.
    ///
    /// ```
    /// use bfree::mechanics::check::direction;
    /// use bfree::tensor::Vector;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let coming = simulation.next_step()?;
    /// let (equilibrium, count) = (coming.equilibrium(), coming.nodes().len());
    /// let phi: Vec<_> = direction::<2>(count, 1).iter().map(|x| x * 0.01).collect();
    /// let u = direction::<2>(count, 2);
    /// for piece in equilibrium.terms.pieces() {
    ///     let (mut product, dual) = (vec![Vector::zeros(); count], equilibrium.derivative(piece, &phi, &u)?);
    ///     equilibrium.tangent(piece, &phi)?.product(&u, &mut product);
    ///     let apart = product.iter().zip(&dual).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    ///     assert!(apart < 1e-12, "{}: {apart}", piece.name);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// See [`Self::tangent`].
    pub fn derivative(
        &self,
        piece: Piece,
        phi: &[Vector<f64, D>],
        u: &[Vector<f64, D>],
    ) -> Result<Vec<Vector<f64, D>>, Inadmissible> {
        let seeded: Vec<_> = phi.iter().zip(u).map(|(x, d)| x.zip_map(d, Dual64::new)).collect();
        Ok(self.residual_of(piece, &seeded)?.iter().map(|r| r.map(|x| x.eps)).collect())
    }

    /// [`Self::derivative`] with the cells of the mixed form, and without entries at prescribed values.
    fn dual_rows(
        &self,
        piece: Piece,
        at: Trial<'_, f64, D>,
        along: Trial<'_, f64, D>,
    ) -> Result<Rows<D>, Inadmissible> {
        let phi: Vec<_> = at.phi.iter().zip(along.phi).map(|(x, d)| x.zip_map(d, Dual64::new)).collect();
        let own: Vec<_> = at.dilatation.iter().zip(along.dilatation).map(|(&x, &d)| Dual64::new(x, d)).collect();
        let (nodes, cells) = self.residual_at(piece, Trial { phi: &phi, dilatation: &own })?;
        let mut nodes: Vec<_> = nodes.iter().map(|r| r.map(|x| x.eps)).collect();
        self.space.clear_prescribed(&mut nodes);
        let mut rows = Rows { nodes, cells: cells.iter().map(|x| Vector::from([x.eps])).collect() };
        rows.cells.resize(along.dilatation.len(), Vector::zeros());
        Ok(rows)
    }

    /// Lets the laws of a few particles compare what they claim with differences.
    fn check_claims(&self, phi: &[Vector<f64, D>]) -> Result<(), CheckError> {
        let (particles, connectivity) = (self.step.particles, self.step.connectivity);
        let some = || (0..particles.len()).step_by(particles.len().div_ceil(CLAIMS).max(1));
        let state = |p| {
            let h = Kinematics(particles).displacement_gradient(p, &connectivity.gradient_at(p, phi));
            (h, particles.state(p, self.step.dt).internal.to_vec())
        };
        // Every process needs all states, so that all of them see the same failure.
        let states = particles.parts.of_some(connectivity.processes(), some(), state);
        for (p, (h, internal)) in some().zip(&states) {
            let at = MaterialState::new(*h).in_step(self.step.dt, internal);
            let law = &self.step.bodies[particles.body[p] as usize].law;
            let particle = particles.id[p] as usize;
            law.check_claim(&at).map_err(|sentence| CheckError::Claim { particle, sentence })?;
        }
        Ok(())
    }

    /// The largest [`tangent_bound`] of all particles.
    fn worst_bound(&self, phi: &[Vector<f64, D>]) -> Result<f64, Inadmissible> {
        if self.step.alphas.discrete_gradient {
            return Ok(LARGEST);
        }
        let particles = self.step.particles;
        let bounds = self
            .step
            .connectivity
            .interpolate(phi, |p, _, g| Ok(tangent_bound(&Kinematics(particles).state(p, &g, 0.0)?.f)))?;
        Ok(bounds.into_iter().fold(tangent_bound(&identity::<f64, D>()), f64::max))
    }

    /// The size of a piece's contributions to K u where they may cancel: for loads, the force times |u|/h.
    fn size_of(&self, piece: Piece, phi: &[Vector<f64, D>], u: &[Vector<f64, D>]) -> Result<f64, Inadmissible> {
        let nodes = self.step.connectivity.of(0).map(|(_, _, grad_n)| grad_n.norm()).fold(0.0, f64::max);
        let is_load = piece.role == Role::Loads;
        Ok(if is_load { norm(&self.residual_of::<f64>(piece, phi)?) * norm(u) * nodes } else { 0.0 })
    }

    /// Compares the diagonal blocks of a few nodes with the products of unit vectors at these nodes.
    fn check_blocks(&self, tangent: &Tangent<'_, D>, bound: f64) -> Result<(), CheckError> {
        let blocks = tangent.diagonal_blocks();
        let prescribed = self.space.prescribed_mask();
        let follows = self.space.following_mask();
        let held = |node: usize, i: usize| prescribed[node * D + i] || follows[node * D + i];
        let uncoupled = self.space.uncoupled();
        let spread = (0..blocks.len()).step_by(blocks.len().div_ceil(BLOCKS).max(1));
        let leaders: Vec<usize> =
            self.space.followers().rows().filter_map(|(_, _, mut leaders)| Some(leaders.next()?.0)).collect();
        let followed = leaders.iter().copied().step_by(leaders.len().div_ceil(BLOCKS).max(1));
        for node in spread.chain(followed) {
            for i in (0..D).filter(|&i| !held(node, i)) {
                let (mut unit, mut out) = (vec![Vector::zeros(); blocks.len()], vec![Vector::zeros(); blocks.len()]);
                unit[node][i] = 1.0;
                tangent.product(&unit, &mut out);
                let (mut column, scale) = (blocks[node].column(i).into_owned(), blocks[node].norm());
                // Rows of values that are no unknowns are those of the identity, and blocks of uncoupled nodes are diagonal. Neither is
                // compared.
                let apart = |k: usize| k != i && uncoupled.contains(&node);
                (0..D).filter(|&k| held(node, k) || apart(k)).for_each(|k| (column[k], out[node][k]) = (0.0, 0.0));
                let found = compare("diagonal blocks", &[column], &[out[node]], bound, scale);
                found.map_err(|error| TangentMismatch { node, ..error })?;
            }
        }
        Ok(())
    }
}

/// The name of the residuals of cells in messages.
const CELLS: &str = "mean dilatation, volumes of cells; the node stands for the cell";

/// Entries of a residual: at the nodes, and at the cells in the mixed form.
struct Rows<const D: usize> {
    nodes: Vec<Vector<f64, D>>,
    cells: Vec<Vector<f64, 1>>,
}

impl<const D: usize> Rows<D> {
    fn zeros(like: Trial<'_, f64, D>) -> Self {
        Self { nodes: vec![Vector::zeros(); like.phi.len()], cells: vec![Vector::zeros(); like.dilatation.len()] }
    }

    /// The product that the solver applies.
    fn product(tangent: Tangent<'_, D>, along: Trial<'_, f64, D>) -> Self {
        let mut rows = Self::zeros(along);
        if along.dilatation.is_empty() {
            tangent.solver_product(along.phi, &mut rows.nodes);
            return rows;
        }
        let x = [bytemuck::cast_slice(along.phi), along.dilatation].concat();
        let mut y = vec![0.0; x.len()];
        MixedTangent { tangent }.apply(&x, &mut y);
        let (nodes, cells) = y.split_at(D * rows.nodes.len());
        rows.nodes.copy_from_slice(bytemuck::cast_slice(nodes));
        rows.cells.copy_from_slice(bytemuck::cast_slice(cells));
        rows
    }
}

/// Number of particles whose laws compare what they claim.
const CLAIMS: usize = 16;

/// Number of nodes whose blocks are compared, and of inner nodes with followers that are compared in addition.
const BLOCKS: usize = 4;

fn norm<const D: usize>(a: &[Vector<f64, D>]) -> f64 {
    a.iter().map(Vector::norm_squared).sum::<f64>().sqrt()
}

fn compare<const D: usize>(
    compared: &'static str,
    analytic: &[Vector<f64, D>],
    dual: &[Vector<f64, D>],
    bound: f64,
    scale: f64,
) -> Result<(), TangentMismatch> {
    let apart: Vec<_> = analytic.iter().zip(dual).map(|(a, b)| a - b).collect();
    // Written so that NaN is a mismatch.
    if norm(&apart) <= bound * scale {
        return Ok(());
    }
    let worst = |a: &Vector<f64, D>| a.amax();
    let node = (0..apart.len()).max_by(|&a, &b| worst(&apart[a]).total_cmp(&worst(&apart[b]))).unwrap_or(0);
    let axis = apart[node].iamax();
    let (analytic, dual) = (analytic[node][axis], dual[node][axis]);
    Err(TangentMismatch { compared, node, axis, analytic, dual, bound, scale })
}
