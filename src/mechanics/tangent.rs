//! The consistent tangent K(Δφ)·u, matrix-free: frozen at Δφ, applied, never stored (eqs. 30, 34, 38).

use crate::material::{FrozenTangent, Law, NonPositiveJacobian, admissible};
use crate::mechanics::point;
use crate::mechanics::residual::{Carry, Equilibrium, Inadmissible, compose};
use crate::mechanics::sweep::{ClosedTangents, Supports};
use crate::particles::Body;
use crate::pooled::Pooled;
use crate::scalar::Real;
use crate::solver::{DiagonalBlocks, LinearOperator, Linearization, NonlinearProblem, Precision};
use crate::tensor::{Deformation, Tensor, Vector, contract, identity, outer, scaled};
use num_dual::Dual64;

/// The terms of the tangent, one for each way Δφ enters the residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// α₁ M̃ u
    Inertia,
    /// Σ_p V₀ (δF S) ∇N_I
    Geometric,
    /// Σ_p V₀ F [ℂ : Fᵀ δF] ∇N_I
    Material,
    /// Σ p A δ(cof F) N N_I
    Pressure,
}

impl Term {
    /// All terms.
    pub const ALL: [Self; 4] = [Self::Inertia, Self::Geometric, Self::Material, Self::Pressure];

    /// The occurrences of Δφ that make this term.
    ///
    /// ```
    /// use bfree::mechanics::{residual::Carry, tangent::Term};
    ///
    /// // Each occurrence of Δφ belongs to one term, and together they are R's whole derivative.
    /// let bits = |carry: Carry| [carry.inertia, carry.left, carry.inside, carry.pressure];
    /// let terms = Term::ALL.map(|term| bits(term.carry()));
    /// assert!((0..4).all(|k| terms.iter().filter(|bits| bits[k]).count() == 1));
    /// assert_eq!(bits(Carry::ALL), [true; 4]);
    /// ```
    pub fn carry(self) -> Carry {
        match self {
            Self::Inertia => Carry { inertia: true, ..Carry::NONE },
            Self::Geometric => Carry { left: true, ..Carry::NONE },
            Self::Material => Carry { inside: true, ..Carry::NONE },
            Self::Pressure => Carry { pressure: true, ..Carry::NONE },
        }
    }
}

impl<const D: usize, L: Law> Equilibrium<'_, D, L> {
    /// One term of K(Δφ)·u by its formula, on every active node.
    ///
    /// Example: [`Self::dual_product`].
    ///
    /// # Errors
    /// The first particle with det F ≤ 0.
    pub fn product(
        &self,
        term: Term,
        dphi: &[Vector<f64, D>],
        u: &[Vector<f64, D>],
    ) -> Result<Vec<Vector<f64, D>>, Inadmissible> {
        let mut out = vec![Vector::zeros(); u.len()];
        match term {
            Term::Inertia => {
                self.add_lumped_inertia(u, &mut out);
                self.supports.assemble(u, &mut out, |p, u, _| {
                    Ok((u * (self.alphas.a1 * self.consistent_mass(p).unwrap_or(0.0)), Tensor::zeros()))
                })?;
            }
            Term::Geometric | Term::Material => {
                let states = self.states(dphi)?;
                self.supports.assemble(u, &mut out, |p, _, l| {
                    Ok((Vector::zeros(), self.particle_product(term, p, &states[p], &l)))
                })?;
            }
            Term::Pressure => {
                for point in self.frozen_pressures(dphi) {
                    point.add_product(self.supports, u, &mut out, 1.0);
                }
            }
        }
        Ok(out)
    }

    /// V₀ δP F_nᵀ of one particle for the geometric or the material term, δF = L F_n.
    pub(crate) fn particle_product(
        &self,
        term: Term,
        p: usize,
        at: &Deformation<f64, D>,
        l: &Tensor<f64, D>,
    ) -> Tensor<f64, D> {
        let (law, f_n) = (self.law(p), self.f_n(p));
        let delta_f = l * f_n;
        let delta_piola = match term {
            // δF S
            Term::Geometric => delta_f * law.stress(at),
            // F [ℂ : Fᵀ δF]
            Term::Material => at.f * law.elasticity(at, &(at.f.transpose() * delta_f)),
            Term::Inertia | Term::Pressure => Tensor::zeros(),
        };
        scaled(&(delta_piola * f_n.transpose()), self.particles.volume[p])
    }

    /// The same term by dual numbers through the residual: the derivative of R in the direction u.
    ///
    /// ```
    /// use bfree::mechanics::{check::direction, sweep::Supports, tangent::Term, transfer::Nodal};
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
    /// let (supports, nodes) = Supports::new(&simulation.approximation, grid, &particles.position)?;
    /// let nodal = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
    /// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], simulation.settings.newmark.alphas(dt), dt);
    /// let u = direction::<2>(nodes.len(), 2);
    /// let dphi: Vec<_> = direction::<2>(nodes.len(), 1).iter().map(|x| x * 0.01).collect();
    /// // Every term by its formula, and as a derivative that knows nothing of it.
    /// for term in [Term::Inertia, Term::Geometric, Term::Material] {
    ///     let (formula, dual) = (equilibrium.product(term, &dphi, &u)?, equilibrium.dual_product(term, &dphi, &u)?);
    ///     let error: f64 = formula.iter().zip(&dual).map(|(a, b)| (a - b).norm_squared()).sum();
    ///     assert!(error.sqrt() < 1e-13 * dual.iter().map(|b| b.norm_squared()).sum::<f64>().sqrt(), "{term:?}");
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The first particle with det F ≤ 0.
    pub fn dual_product(
        &self,
        term: Term,
        dphi: &[Vector<f64, D>],
        u: &[Vector<f64, D>],
    ) -> Result<Vec<Vector<f64, D>>, Inadmissible> {
        let seeded: Vec<_> = dphi.iter().zip(u).map(|(x, d)| x.zip_map(d, Dual64::new)).collect();
        Ok(self.residual(&seeded, term.carry())?.iter().map(|r| r.map(|x| x.eps)).collect())
    }

    /// F_n of particle `p`.
    #[inline(always)]
    fn f_n(&self, p: usize) -> Tensor<f64, D> {
        identity::<f64, D>() + self.particles.displacement_gradient[p]
    }

    /// The deformation of every particle at Δφ, gathered node after node as dual numbers are: a nearly incompressible law
    /// makes much of the last bit of F, and formula and derivative are to be compared at the same F.
    pub(crate) fn states(&self, dphi: &[Vector<f64, D>]) -> Result<Vec<Deformation<f64, D>>, Inadmissible> {
        let state = |p| {
            let g = self.supports.gradient_at(p, dphi);
            admissible(compose(&g, &self.particles.displacement_gradient[p])).map_err(self.inadmissible(p))
        };
        (0..self.supports.particles()).map(state).collect()
    }

    /// out += α₁ ε m_I u_I
    fn add_lumped_inertia(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for ((out, u), weight) in out.iter_mut().zip(u).zip(self.lumped_weights()) {
            *out += u * weight;
        }
    }

    /// The identity's row and column at prescribed degrees of freedom.
    pub(super) fn prescribe_blocks(&self, blocks: &mut [Tensor<f64, D>]) {
        for dof in self.prescribed {
            let (block, i) = (&mut blocks[dof.node], dof.component);
            for k in 0..D {
                block[(i, k)] = 0.0;
                block[(k, i)] = 0.0;
            }
            block[(i, i)] = 1.0;
        }
    }

    pub(super) fn frozen_pressures(&self, dphi: &[Vector<f64, D>]) -> Vec<FrozenPressure<D>> {
        self.pressures
            .iter()
            .map(|point| {
                let p = point.particle;
                let at = Deformation::new(compose(
                    &self.supports.gradient_at(p, dphi),
                    &self.particles.displacement_gradient[p],
                ));
                let f_inv_t = at.inverse_transpose();
                FrozenPressure {
                    particle: p,
                    df_inv_t: f_inv_t * self.f_n(p).transpose(),
                    force: f_inv_t * point.force * at.jacobian,
                }
            })
            .collect()
    }

    /// Freezes the tangent at Δφ.
    ///
    /// Example: [`Tangent`].
    ///
    /// # Errors
    /// The first particle with det F ≤ 0.
    pub fn tangent(&self, dphi: &[Vector<f64, D>]) -> Result<Tangent<'_, D, L>, Inadmissible> {
        Ok(Tangent { equilibrium: self, frozen: self.freeze(dphi)?, pressures: self.frozen_pressures(dphi) })
    }

    /// The law of particle `p` frozen at ∇u_p = `g`.
    fn freeze_at(&self, p: usize, g: &Tensor<f64, D>) -> Result<L::Frozen<f64, D>, Inadmissible> {
        let (h_n, volume) = (&self.particles.displacement_gradient[p], self.particles.volume[p]);
        let (frozen, det_f) = point::freeze(self.law(p), g, h_n, volume);
        NonPositiveJacobian::check(det_f).map_err(self.inadmissible(p))?;
        Ok(frozen)
    }

    fn freeze(&self, dphi: &[Vector<f64, D>]) -> Result<Frozen<D, L>, Inadmissible> {
        if let Some(both) = closed_form::<D, L>(self.bodies) {
            let weight = |p: usize| self.alphas.a1 * self.consistent_mass(p).unwrap_or(0.0);
            let inertia: Option<&(dyn Fn(usize) -> f64 + Sync)> = (self.lumping < 1.0).then_some(&weight);
            let closed = self.supports.closed_tangents(&self.laws(), dphi, both, inertia);
            match closed {
                Some(Ok(closed)) => return Ok(Frozen::Closed(closed)),
                Some(Err(Some(inadmissible))) => return Err(inadmissible),
                // No vector lanes, or a law that has its closed form at some states only.
                Some(Err(None)) | None => {}
            }
        }
        Ok(Frozen::Each(self.supports.interpolate(dphi, |p, _, g| self.freeze_at(p, &g))?))
    }
}

/// The point tangents of all particles.
enum Frozen<const D: usize, L: Law> {
    /// In vector lanes, for laws with a closed form.
    Closed(ClosedTangents<D>),
    /// One after the other.
    Each(Vec<L::Frozen<f64, D>>),
}

/// Whether all laws have a closed form, and if so, whether one of them has the term b L c. It does not depend on the state.
pub(super) fn closed_form<const D: usize, L: Law>(bodies: &[Body<L>]) -> Option<bool> {
    let at_rest = Deformation::new(Tensor::<f64, D>::zeros());
    let forms = bodies.iter().map(|body| body.law.freeze(&identity(), &at_rest, 1.0).closed());
    let forms: Option<Vec<_>> = forms.collect();
    forms.map(|forms| forms.iter().any(|form| form.both.is_some()))
}

/// Whether all laws have a closed form, which products in single precision need.
///
/// ```
/// use bfree::material::{Energy, FromEnergy};
/// use bfree::mechanics::tangent::has_closed_form;
/// use bfree::particles::Body;
/// use bfree::scalar::Real;
/// use bfree::tensor::{Tensor, contract};
///
/// struct Quadratic;
///
/// impl Energy for Quadratic {
///     fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
///         contract(e, e)
///     }
/// }
///
/// // The shipped laws have one; a law known by its energy alone has ℂ, entry by entry.
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// assert!(has_closed_form::<2, _>(&scene.build::<2>("scenes".as_ref())?.bodies));
/// assert!(!has_closed_form::<2, _>(&[Body { name: "mine".into(), law: FromEnergy(Quadratic), density: 1.0 }]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn has_closed_form<const D: usize, L: Law>(bodies: &[Body<L>]) -> bool {
    closed_form::<D, L>(bodies).is_some()
}

/// Bytes of the frozen tangent of all particles.
///
/// ```
/// use bfree::mechanics::{sweep::Supports, tangent::frozen_bytes};
/// use bfree::solver::Precision;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let simulation = scene.build::<2>("scenes".as_ref())?;
/// let (particles, bodies) = (&simulation.particles, &simulation.bodies);
/// let (shape, grid, positions) = (&simulation.approximation, &simulation.grid, &particles.position);
/// let (supports, _) = Supports::with_precision(shape, grid, positions, Precision::Mixed)?;
/// // A neo-Hookean particle in 2D needs A, the symmetric B, κ and q: 9 numbers; in single precision they take less.
/// let bytes = |precision| frozen_bytes(bodies, &supports, 1.0, precision);
/// assert!(bytes(Precision::Double) >= 9 * size_of::<f64>() * particles.len());
/// assert!(bytes(Precision::Mixed) < bytes(Precision::Double));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn frozen_bytes<const D: usize, L: Law>(
    bodies: &[Body<L>],
    supports: &Supports<D>,
    lumping: f64,
    precision: Precision,
) -> usize {
    closed_form::<D, L>(bodies)
        .and_then(|both| supports.closed_bytes(both, lumping < 1.0, precision))
        .unwrap_or(supports.particles() * size_of::<L::Frozen<f64, D>>())
}

/// Follower pressure frozen at one state: δ(p A cof(F) N) = (A:L) w − A Lᵀ w with A = ΔF⁻ᵀ, w = p A J F⁻ᵀ N.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrozenPressure<const D: usize> {
    particle: usize,
    df_inv_t: Tensor<f64, D>,
    force: Vector<f64, D>,
}

impl<const D: usize> FrozenPressure<D> {
    /// Adds the product over `scale`; at the particle itself it is formed in double precision.
    pub(super) fn add_product<T: Real>(
        &self,
        supports: &Supports<D>,
        u: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
        scale: f64,
    ) {
        let (a, w) = (&self.df_inv_t, &self.force);
        let l = supports.gradient_at(self.particle, u).map(T::value);
        let delta = (w * contract(a, &l) - a * (l.transpose() * w)) / scale;
        for (node, n, _) in supports.of(self.particle) {
            out[node] += (delta * n).map(T::lit);
        }
    }

    /// The diagonal block N_I (w ⊗ g − g ⊗ w), g = A ∇_n N_I
    pub(super) fn add_blocks(&self, supports: &Supports<D>, blocks: &mut [Tensor<f64, D>]) {
        for (node, n, grad_n) in supports.of(self.particle) {
            let g = self.df_inv_t * grad_n;
            blocks[node] += scaled(&(outer(&self.force, &g) - outer(&g, &self.force)), n);
        }
    }
}

/// K(Δφ), frozen: an operator, with the d×d blocks on its diagonal.
///
/// ```
/// use bfree::mechanics::{check::direction, sweep::Supports, transfer::Nodal};
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let simulation = scene.build::<2>("scenes".as_ref())?;
/// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
/// let (supports, nodes) = Supports::new(&simulation.approximation, grid, &particles.position)?;
/// let nodal = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
/// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], simulation.settings.newmark.alphas(dt), dt);
/// let dphi: Vec<_> = direction::<2>(nodes.len(), 1).iter().map(|x| x * 0.01).collect();
/// let tangent = equilibrium.tangent(&dphi)?;
/// let times = |u: &[Vector<f64, 2>]| {
///     let mut out = vec![Vector::zeros(); u.len()];
///     tangent.product(u, &mut out);
///     out
/// };
/// // All loads have a potential, so K is symmetric: w·Ku = u·Kw.
/// let dot = |a: &[Vector<f64, 2>], b: &[Vector<f64, 2>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
/// let (u, w) = (direction(nodes.len(), 2), direction(nodes.len(), 3));
/// let (ku, kw) = (times(&u), times(&w));
/// assert!((dot(&w, &ku) - dot(&u, &kw)).abs() < 1e-13 * (dot(&ku, &ku) * dot(&w, &w)).sqrt());
/// // K_II is what node I feels of its own motion.
/// let mut unit = vec![Vector::zeros(); nodes.len()];
/// unit[30] = Vector::from([1.0, 0.0]);
/// let column = tangent.diagonal_blocks()[30].column(0).into_owned();
/// assert!((times(&unit)[30] - column).norm() < 1e-13 * column.norm());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tangent<'a, const D: usize, L: Law> {
    equilibrium: &'a Equilibrium<'a, D, L>,
    frozen: Frozen<D, L>,
    pressures: Vec<FrozenPressure<D>>,
}

impl<const D: usize, L: Law> Tangent<'_, D, L> {
    /// K u on the free degrees of freedom (u is taken as zero on the prescribed ones).
    pub fn product(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        let eq = self.equilibrium;
        out.fill(Vector::zeros());
        eq.add_lumped_inertia(u, out);
        match &self.frozen {
            Frozen::Closed(tangents) => eq.supports.product(tangents, u, out),
            Frozen::Each(tangents) => {
                let never_fails = eq.supports.assemble(u, out, |p, u, l| {
                    let inertia = eq.consistent_mass(p).map_or_else(Vector::zeros, |m| u * (eq.alphas.a1 * m));
                    Ok::<_, std::convert::Infallible>((inertia, tangents[p].apply(&l)))
                });
                match never_fails {
                    Ok(()) => {}
                    Err(never) => match never {},
                }
            }
        }
        for point in &self.pressures {
            point.add_product(eq.supports, u, out, 1.0);
        }
        eq.clear_prescribed(out);
    }

    /// K_II of every active node; a prescribed degree of freedom has the identity's row and column.
    pub fn diagonal_blocks(&self) -> Pooled<Tensor<f64, D>> {
        let eq = self.equilibrium;
        let mut blocks: Pooled<Tensor<f64, D>> = eq.supports.field();
        for (block, weight) in blocks.iter_mut().zip(eq.lumped_weights()) {
            *block = scaled(&identity(), weight);
        }
        match &self.frozen {
            Frozen::Closed(tangents) => eq.supports.add_blocks(tangents, &mut blocks),
            Frozen::Each(tangents) => eq.supports.scatter_blocks(
                &mut blocks,
                |p, a, b| tangents[p].block(a, b),
                |p| eq.consistent_mass(p).map_or(0.0, |m| eq.alphas.a1 * m),
            ),
        }
        for point in &self.pressures {
            point.add_blocks(eq.supports, &mut blocks);
        }
        eq.prescribe_blocks(&mut blocks);
        blocks
    }
}

impl<const D: usize, L: Law> LinearOperator for Tangent<'_, D, L> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        self.product(bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
    }
}

impl<const D: usize, L: Law> DiagonalBlocks for Tangent<'_, D, L> {
    fn diagonal_blocks(&self) -> Pooled<f64> {
        Self::diagonal_blocks(self).into_numbers()
    }
}

impl<const D: usize, L: Law> NonlinearProblem for Equilibrium<'_, D, L> {
    type Inadmissible = Inadmissible;

    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Inadmissible> {
        let residual = bytemuck::cast_slice_mut(r);
        self.residual_into::<f64>(bytemuck::cast_slice(x), Carry::ALL, residual)?;
        self.clear_prescribed(residual);
        Ok(())
    }

    fn magnitude(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        Self::magnitude(self, bytemuck::cast_slice(x))
    }

    fn sensitivity(&self, x: &[f64]) -> Result<f64, Inadmissible> {
        Self::sensitivity(self, bytemuck::cast_slice(x))
    }

    fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Inadmissible>> {
        Self::potential::<f64>(self, bytemuck::cast_slice(x))
    }

    fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization + '_>, Inadmissible> {
        Ok(Box::new(self.tangent(bytemuck::cast_slice(x))?))
    }

    fn linearize_single(&self, x: &[f64]) -> Result<Option<Box<dyn Linearization<f32> + '_>>, Inadmissible> {
        let single = self.single_tangent(bytemuck::cast_slice(x))?;
        Ok(single.map(|single| Box::new(single) as Box<dyn Linearization<f32>>))
    }
}
