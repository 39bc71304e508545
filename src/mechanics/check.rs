//! A run checks its own tangent: every term's formula against dual numbers through the residual, particle by particle.

use crate::material::{FrozenTangent, Law};
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::tangent::Term;
use crate::tensor::{Tensor, Vector, identity, inverse};
use num_dual::Dual64;

/// The largest relative difference accepted: min(64 eps κ(F)², 1e-10), with κ(F) = ‖F‖ ‖F⁻¹‖.
///
/// ```
/// use bfree::mechanics::check::tangent_bound;
/// use bfree::tensor::{Tensor, Vector, identity};
///
/// // κ = ‖F‖ ‖F⁻¹‖ is 2 for F = I in 2D, and the same for any multiple of it; a flat particle is allowed more, but not anything.
/// let bound = tangent_bound(&identity::<f64, 2>());
/// assert!((bound / (64.0 * 4.0 * f64::EPSILON) - 1.0).abs() < 1e-14);
/// assert_eq!(tangent_bound(&Tensor::<f64, 2>::from_diagonal(&Vector::from([8.0, 8.0]))), bound);
/// assert_eq!(tangent_bound(&Tensor::<f64, 2>::from_diagonal(&Vector::from([1.0, 1e-6]))), 1e-10);
/// ```
pub fn tangent_bound<const D: usize>(f: &Tensor<f64, D>) -> f64 {
    let condition = f.norm() * inverse(f).norm();
    (64.0 * f64::EPSILON * condition * condition).min(1e-10)
}

/// What was compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// One term's formula.
    Term(Term),
    /// The frozen product that the solver applies, geometric and material together.
    Frozen,
}

/// Where a part of the tangent was found wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// At a particle.
    Particle(usize),
    /// At a node, by its active number.
    Node(usize),
}

/// The tangent's formula and the derivative of the residual part.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the {compared:?} part of the tangent is wrong at {site:?}: component ({row}, {column}) is {analytic:e} by its formula and \
     {dual:e} by dual numbers; allowed is a difference of {bound:e} relative to {scale:e}"
)]
pub struct TangentMismatch {
    /// What was compared.
    pub compared: Compared,
    /// Where.
    pub site: Site,
    /// Row of the component that differs most.
    pub row: usize,
    /// Its column (0 for a force on a node).
    pub column: usize,
    /// By the formula.
    pub analytic: f64,
    /// By dual numbers.
    pub dual: f64,
    /// The relative difference allowed.
    pub bound: f64,
    /// What it is relative to.
    pub scale: f64,
}

/// What a check found.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// The tangent is wrong.
    #[error(transparent)]
    Mismatch(#[from] Box<TangentMismatch>),
    /// The state cannot be evaluated.
    #[error(transparent)]
    Inadmissible(#[from] Inadmissible),
}

/// A direction without pattern, entries in (−1, 1): the golden-ratio sequence from a start that differs with `seed`.
///
/// ```
/// use bfree::mechanics::check::direction;
/// use bfree::tensor::Vector;
///
/// // No two seeds give the same, and the entries fill (−1, 1) evenly: mean 0, mean square ⅓.
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
    /// Compares, at Δφ and in the direction `u`, every term's formula and the solver's frozen product with dual numbers.
    ///
    /// ```
    /// use bfree::mechanics::{check::{CheckError, direction}, sweep::Supports, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (supports, nodes) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], simulation.settings.newmark.alphas(dt), dt);
    /// let u = direction::<2>(nodes.len(), 2);
    /// let dphi: Vec<_> = direction::<2>(nodes.len(), 1).iter().map(|x| x * 0.01).collect();
    /// equilibrium.check_tangent(&dphi, &u)?;
    /// // Where a particle is turned inside out there is nothing to compare.
    /// let far: Vec<_> = dphi.iter().map(|x| x * 1000.0).collect();
    /// assert!(matches!(equilibrium.check_tangent(&far, &u), Err(CheckError::Inadmissible(_))));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The first mismatch, by particle for the geometric and the material term, by node for inertia and pressure.
    pub fn check_tangent(&self, dphi: &[Vector<f64, D>], u: &[Vector<f64, D>]) -> Result<(), CheckError> {
        self.check_particles(dphi, u)?;
        let pressure = self.pressure_magnitude(u);
        for term in [Term::Inertia, Term::Pressure] {
            let (analytic, dual) = (self.product(term, dphi, u)?, self.dual_product(term, dphi, u)?);
            for (node, (a, d)) in analytic.iter().zip(&dual).enumerate() {
                let (a, d) = (Tensor::<f64, D>::from_fn(|i, k| if k == 0 { a[i] } else { 0.0 }), {
                    Tensor::<f64, D>::from_fn(|i, k| if k == 0 { d[i] } else { 0.0 })
                });
                let scale = d.norm() + if term == Term::Pressure { pressure[node] } else { 0.0 };
                compare(Compared::Term(term), Site::Node(node), &a, &d, 1e-10, scale)?;
            }
        }
        Ok(())
    }

    /// Σ p A ‖L‖ N_I: the size of the two parts of the pressure's tangent, which cancel in 1D, where cof F = 1.
    fn pressure_magnitude(&self, u: &[Vector<f64, D>]) -> Vec<f64> {
        let mut magnitude = vec![0.0; u.len()];
        for point in &self.pressures {
            let l = self.supports.gradient_at(point.particle, u);
            for (node, n, _) in self.supports.of(point.particle) {
                magnitude[node] += point.force.norm() * l.norm() * n.abs();
            }
        }
        magnitude
    }

    fn check_particles(&self, dphi: &[Vector<f64, D>], u: &[Vector<f64, D>]) -> Result<(), CheckError> {
        let seeded: Vec<_> = dphi.iter().zip(u).map(|(x, d)| x.zip_map(d, Dual64::new)).collect();
        let states = self.states(dphi)?;
        let by_dual = |term: Term| {
            self.supports.interpolate(&seeded, |p, _, g| {
                Ok::<_, Inadmissible>(self.internal(p, &g, term.carry())?.map(|x| x.eps))
            })
        };
        let (geometric, material) = (by_dual(Term::Geometric)?, by_dual(Term::Material)?);
        self.supports.interpolate(u, |p, _, l| {
            let scale = geometric[p].norm() + material[p].norm();
            let bound = tangent_bound(&states[p].f);
            let site = Site::Particle(self.particles.id[p] as usize);
            for (term, dual) in [(Term::Geometric, &geometric[p]), (Term::Material, &material[p])] {
                let analytic = self.particle_product(term, p, &states[p], &l);
                compare(Compared::Term(term), site, &analytic, dual, bound, scale)?;
            }
            let f_n = identity::<f64, D>() + self.particles.displacement_gradient[p];
            let frozen = self.law(p).freeze(&f_n, &states[p], self.particles.volume[p]).apply(&l);
            compare(Compared::Frozen, site, &frozen, &(geometric[p] + material[p]), bound, scale)
        })?;
        Ok(())
    }
}

fn compare<const D: usize>(
    compared: Compared,
    site: Site,
    analytic: &Tensor<f64, D>,
    dual: &Tensor<f64, D>,
    bound: f64,
    scale: f64,
) -> Result<(), CheckError> {
    let difference = analytic - dual;
    // Written so that NaN is a mismatch.
    if difference.norm() <= bound * scale {
        return Ok(());
    }
    let (row, column) = difference.abs().iamax_full();
    let (analytic, dual) = (analytic[(row, column)], dual[(row, column)]);
    Err(Box::new(TangentMismatch { compared, site, row, column, analytic, dual, bound, scale }).into())
}
