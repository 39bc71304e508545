//! The residual R(φ) of one step: the sum of its terms, coded once, generic over the number type (eqs. 17, 33, with the signs corrected).
//!
//! Everywhere in the terms, φ is the nodal motion since the last grid reset: φ = φ_n + Δφ, with the motion Δφ since t_n. With a reset in every
//! step, as in the paper, φ_n = 0. φ̂ is the motion that ends without acceleration, φ_n + [Δφ̂](crate::mechanics::schemes::Alphas::predicted).

use crate::material::Law;
use crate::mechanics::constitutive::Part;
use crate::mechanics::loads::PrescribedDof;
use crate::mechanics::sweep::{Mode, Number, Weights};
use crate::mechanics::symmetry::Unsymmetric;
use crate::mechanics::terms::{Piece, Role, Step, Terms};
use crate::mechanics::trial::Trial;
use crate::parallel::{self, First};
use crate::pooled::Pooled;
use crate::solver::Stop;
use crate::space::{Space, vector};
use crate::tensor::Vector;
use std::sync::Arc;

pub use crate::mechanics::kinematics::{Inadmissible, compose};

/// The equilibrium of one step: all data of R(φ) except φ. Evaluating R never changes the particles.
///
/// R_I = Σ_J M̃_IJ a_J + Σ_p V₀ F S ∇N_I − Σ_p m b N_I − Σ_Γ T N_I A − R₀,  a = α₁ (φ − φ̂) = α₁ Δφ − α₂ v_n − α₃ a_n
///
/// Where outer nodes follow inner nodes ([`aggregation`](crate::aggregation)), the residual is Eᵀ R(E φ). Values of outer nodes are not
/// read, and the residual there is zero.
///
/// ```
/// use bfree::mechanics::loads::{Curve, Gravity};
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// // Free fall from rest with β = ¼: φ = ¼ Δt² g gives a = α₁ φ = g, and all forces are in balance.
/// let (dt, g) = (simulation.clock.step(), Vector::from([0.0, -10.0]));
/// simulation.loads.gravity = Some(Gravity { acceleration: g, curve: Curve::constant(1.0) });
/// simulation.particles.velocity.fill(Vector::zeros());
/// let coming = simulation.next_step()?;
/// let (equilibrium, phi) = (coming.equilibrium(), vec![g * (0.25 * dt * dt); coming.nodes().len()]);
/// let residual = equilibrium.residual(&phi)?;
/// let largest = residual.iter().map(|r| r.norm()).fold(0.0, f64::max);
/// assert!(largest < 1e-14 * equilibrium.magnitude(&phi)?);
/// // Terms that a scene does not need are absent.
/// assert_eq!(equilibrium.terms.pieces().iter().map(|piece| piece.name).collect::<Vec<_>>(),
///     ["inertia", "stress", "geometric", "material", "body force"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Equilibrium<'a, const D: usize, L> {
    /// The data of the terms.
    pub step: Step<'a, D, L>,
    /// The terms.
    pub terms: Terms<'a, D, L>,
    /// The prescribed degrees of freedom, which are not solved for.
    pub prescribed: &'a [PrescribedDof],
    /// The space of the nodal fields.
    pub(crate) space: Arc<Space<D>>,
    /// Whether the dilatations of averaged cells are unknowns of their own: the mixed form.
    pub mixed: bool,
    /// A callback that can stop the solution.
    pub stop: Option<&'a Stop>,
}

impl<'a, const D: usize, L: Law> Equilibrium<'a, D, L> {
    /// The equilibrium of a step with these prescribed degrees of freedom.
    pub fn new(step: Step<'a, D, L>, prescribed: &'a [PrescribedDof]) -> Self {
        let space = step.connectivity.space(prescribed.iter().map(PrescribedDof::place));
        Self { step, terms: Terms::of(&step), prescribed, space: space.into(), mixed: false, stop: None }
    }

    /// R(φ) at every active node. At prescribed degrees of freedom, R is the reaction.
    ///
    /// # Errors
    /// det F ≤ 0. The error names the particle with the smallest id.
    pub fn residual<T: Number>(&self, phi: &[Vector<T, D>]) -> Result<Vec<Vector<T, D>>, Inadmissible> {
        let mut out = vec![Vector::zeros(); phi.len()];
        self.residual_into(Trial::motion(phi), &mut out)?;
        Ok(out)
    }

    pub(crate) fn residual_into<T: Number>(
        &self,
        at: Trial<'_, T, D>,
        out: &mut [Vector<T, D>],
    ) -> Result<(), Inadmissible> {
        self.sum_into(|_, _| true, Part::Whole, Weights::Signed, at, out)
    }

    /// One piece of R(φ). Only the occurrences of φ in this piece carry derivatives.
    ///
    /// # Errors
    /// See [`Self::residual`].
    pub fn residual_of<T: Number>(
        &self,
        piece: Piece,
        phi: &[Vector<T, D>],
    ) -> Result<Vec<Vector<T, D>>, Inadmissible> {
        let mut out = vec![Vector::zeros(); phi.len()];
        self.sum_into(|name, _| name == piece.term, piece.part, Weights::Signed, Trial::motion(phi), &mut out)?;
        Ok(out)
    }

    /// One piece of R at a trial state: at the nodes, and in the mixed form at the cells.
    pub(crate) fn residual_at<T: Number>(
        &self,
        piece: Piece,
        at: Trial<'_, T, D>,
    ) -> Result<(Vec<Vector<T, D>>, Vec<T>), Inadmissible> {
        let mut out = vec![Vector::zeros(); at.phi.len()];
        let picked = |name: &str, _| name == piece.term;
        self.sum_into(picked, piece.part, Weights::Signed, at, &mut out)?;
        Ok((out, self.cell_residuals(picked, at)))
    }

    /// The residuals of the averaged cells in the mixed form; empty in the displacement form.
    pub(crate) fn cell_residuals<T: Number>(&self, picked: impl Fn(&str, Role) -> bool, at: Trial<'_, T, D>) -> Vec<T> {
        let phi = &*self.space.extended(at.phi);
        self.terms.cell_residuals(picked, Trial { phi, ..at })
    }

    /// The sum of the terms that `picked` selects: contributions at nodes, then contributions at particles in one pass.
    fn sum_into<T: Number>(
        &self,
        picked: impl Fn(&str, Role) -> bool,
        part: Part,
        weights: Weights,
        at: Trial<'_, T, D>,
        out: &mut [Vector<T, D>],
    ) -> Result<(), Inadmissible> {
        let magnitude = weights == Weights::Magnitude;
        let phi = &*self.space.extended(at.phi);
        if !magnitude {
            parallel::fill(out, Vector::zeros());
            self.terms.add_at_nodes(&picked, phi, out);
        }
        let mut points = self.terms.at_points::<T>(&picked, part, Trial { phi, ..at });
        // Terms that use values alone add their magnitudes at the nodes.
        points.retain(|(mode, _)| !magnitude || mode.gradient);
        let (modes, all): (Vec<_>, Vec<_>) = points.into_iter().unzip();
        if let Some(mode) = modes.into_iter().reduce(Mode::and) {
            if part == Part::Whole && self.add_on_device(&picked, magnitude, phi, out) {
                self.restrict(magnitude, out);
                return Ok(());
            }
            let (connectivity, failure) = (self.step.connectivity, First::none());
            connectivity.sweep(Some(phi), Mode { weights, ..mode }, out, |group, at, sums| {
                let added = all.iter().try_for_each(|add| add(group, at, sums));
                if let Err(error) = added {
                    failure.keep(error.particle, error);
                }
                if magnitude {
                    sums.gradient.as_flattened_mut().as_flattened_mut().iter_mut().for_each(|x| *x = x.abs());
                }
            });
            failure.check(connectivity.processes())?;
        }
        self.restrict(magnitude, out);
        Ok(())
    }

    /// Adds the contributions at the particles, or their magnitudes, on the device. Returns whether they were added. Otherwise `out` is unchanged.
    fn add_on_device<T: Number>(
        &self,
        picked: impl Fn(&str, Role) -> bool,
        magnitudes: bool,
        phi: &[Vector<T, D>],
        out: &mut [Vector<T, D>],
    ) -> bool {
        let mut is_added = false;
        // Dual numbers have two fields.
        if T::FIELDS == 1 && self.step.connectivity.on_device().is_some() {
            T::add_flat(out, |out| is_added = self.terms.add_on_device(picked, magnitudes, &T::flat(phi), out));
        }
        is_added
    }

    /// R̂ = Eᵀ R, or its magnitudes.
    fn restrict<T: Number>(&self, magnitudes: bool, out: &mut [Vector<T, D>]) {
        match magnitudes {
            true => self.space.followers().restrict_magnitudes(out),
            false => self.space.followers().restrict(out),
        }
    }

    /// The external nodal forces at φ.
    ///
    /// # Errors
    /// See [`Self::residual`].
    pub fn external_force(&self, phi: &[Vector<f64, D>]) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let mut force = self.forces(Role::Loads, phi)?;
        parallel::each(&mut force, |_, force| *force = -*force);
        Ok(force)
    }

    /// The external nodal forces at φ, zero at prescribed degrees of freedom.
    pub(crate) fn free_external_force(&self, phi: &[Vector<f64, D>]) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let mut force = self.external_force(phi)?;
        self.space.clear_prescribed(&mut force);
        Ok(force)
    }

    /// The sum of the terms of one role.
    pub(crate) fn forces(&self, role: Role, phi: &[Vector<f64, D>]) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let mut force = self.step.connectivity.pool().unspecified(phi.len());
        self.sum_into(|_, of| of == role, Part::Whole, Weights::Signed, Trial::motion(phi), &mut force)?;
        Ok(force)
    }

    /// The size that round-off of R is relative to: in each free entry of R the magnitudes of all contributions are summed. Returns the
    /// norm of these sums.
    ///
    /// # Errors
    /// See [`Self::residual`].
    pub fn magnitude(&self, phi: &[Vector<f64, D>]) -> Result<f64, Inadmissible> {
        self.magnitude_at(Trial::motion(phi))
    }

    pub(crate) fn magnitude_at(&self, at: Trial<'_, f64, D>) -> Result<f64, Inadmissible> {
        Ok(self.free_norm(self.magnitudes(at)?, at))
    }

    /// The round-off bound: like [`Self::magnitude`], plus the change of R when φ and F_r are rounded.
    ///
    /// # Errors
    /// See [`Self::residual`].
    pub(crate) fn sensitivity_at(&self, at: Trial<'_, f64, D>) -> Result<f64, Inadmissible> {
        let mut out = self.magnitudes(at)?;
        self.terms.add_sensitivity(&self.space.extended(at.phi), &mut out)?;
        self.space.followers().restrict_magnitudes(&mut out);
        Ok(self.free_norm(out, at))
    }

    /// The norm of magnitudes over the unknowns of a trial state.
    fn free_norm(&self, mut field: Pooled<Vector<f64, D>>, at: Trial<'_, f64, D>) -> f64 {
        self.space.clear_prescribed(&mut field);
        let nodes = vector::norm(bytemuck::cast_slice(&field));
        let cells = if at.dilatation.is_empty() { 0.0 } else { vector::norm(&self.terms.cell_magnitudes()) };
        nodes.hypot(cells)
    }

    fn magnitudes(&self, at: Trial<'_, f64, D>) -> Result<Pooled<Vector<f64, D>>, Inadmissible> {
        let mut out = self.step.connectivity.field();
        self.terms.add_magnitudes_at_nodes(&self.space.extended(at.phi), &mut out);
        self.sum_into(|_, _| true, Part::Whole, Weights::Magnitude, at, &mut out)?;
        Ok(out)
    }

    /// The incremental potential Π(φ) whose gradient is R, and the sum of the magnitudes of its contributions; `None` if a term has no
    /// potential.
    ///
    /// ```
    /// use bfree::mechanics::check::direction;
    /// use num_dual::Dual64;
    ///
    /// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
    /// let simulation = scene.build::<2>("scenes".as_ref())?;
    /// let coming = simulation.next_step()?;
    /// let (equilibrium, count) = (coming.equilibrium(), coming.nodes().len());
    /// // R = ∂Π/∂φ: along any u, the derivative of Π by dual numbers is R·u.
    /// let u = direction::<2>(count, 2);
    /// let phi: Vec<_> = direction::<2>(count, 1).iter().map(|x| x * 0.01).collect();
    /// let seeded: Vec<_> = phi.iter().zip(&u).map(|(x, u)| x.zip_map(u, Dual64::new)).collect();
    /// let slope = equilibrium.potential(&seeded).ok_or("a follower pressure has no potential")??.0.eps;
    /// let residual = equilibrium.residual(&phi)?;
    /// let work: f64 = residual.iter().zip(&u).map(|(r, u)| r.dot(u)).sum();
    /// assert!((slope - work).abs() < 1e-11 * equilibrium.magnitude(&phi)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// See [`Self::residual`].
    pub fn potential<T: Number>(&self, phi: &[Vector<T, D>]) -> Option<Result<(T, f64), Inadmissible>> {
        self.terms.energy(&self.space.extended(phi))
    }

    /// The trial state in a vector of unknowns: those of the nodes, then those of the cells in the mixed form.
    pub(crate) fn trial<'x>(&self, x: &'x [f64]) -> Trial<'x, f64, D> {
        let (nodes, dilatation) = x.split_at(self.space.entries());
        Trial { phi: bytemuck::cast_slice(nodes), dilatation }
    }

    /// Whether the tangent is symmetric.
    pub fn is_symmetric(&self) -> bool {
        let Step { alphas, bodies, loads, .. } = self.step;
        let (mixed, mean_stress) = (self.mixed, alphas.discrete_gradient);
        Unsymmetric { mixed, mean_stress, ..Unsymmetric::of(bodies, loads) }.reason().is_none()
    }

    /// Sets the prescribed degrees of freedom of a field to zero.
    pub fn clear_prescribed<T: num_traits::Zero + Copy + nalgebra::Scalar>(&self, field: &mut [Vector<T, D>]) {
        self.space.clear_prescribed(field);
    }
}
