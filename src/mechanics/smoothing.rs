//! Smoothing of the particles' velocity and acceleration towards the nodal fields: from FLIP to PIC and FMPM(k).
//!
//! The increments of eqs. 50 and 51 (FLIP) keep all particle modes, also those that the nodes cannot represent. The other extreme, PIC,
//! gives every particle the interpolated nodal velocity. FMPM(k) does so with a better approximation of the projection (Hammerquist and
//! Nairn 2017, Nairn and Hammerquist 2021). Here the particle fields relax towards the nodal fields at a rate κ. The smoothing in a given
//! time then does not depend on Δt.
//!
//! Smoothing of low order everywhere widens fronts; smoothing of high order lets fronts ring. [`Smoothing::limited`] therefore smooths with
//! high order everywhere, and with first order only at nodes where the velocity has a kink or an extremum. Jameson, Schmidt and Turkel
//! (1981) do so in gas dynamics, with differences of second and fourth order.

use crate::mechanics::sweep::Connectivity;
use crate::parallel;
use crate::particles::Particles;
use crate::pooled::Pooled;
use crate::tensor::Vector;

/// κ₁/κ of [`Smoothing::limited`].
const AT_KINKS: f64 = 5.0;

/// A node counts as a full kink from this q on. Below, its weight falls with the power `SHARPNESS` of q. q is 0 for a function that is
/// linear around the node, 2 at the vertex of a parabola, and far below ½ on the flank of a front.
const KINK: f64 = 0.5;
const SHARPNESS: i32 = 3;

/// Variances below this part of the mean square velocity count as round-off.
const ROUND_OFF: f64 = 1e-12;

/// The relaxation of a particle field u_p towards the nodal field:
///
/// u_p ← u_p − θ (u_p − Σ N w) − Σ N_I θ_I (u_p − ū_I),  θ = 1 − exp(−κΔt),
/// w = Σ_{j<k} (I − M_L⁻¹M)^j ū,  ū = M_L⁻¹ Σ_p N m u_p.
///
/// For k = 1 the first term acts like a viscosity of the size κ h², larger for wider shape functions; for k = 2 like one on fourth
/// derivatives. For k → ∞, w is the projection with the consistent mass, and only modes that the nodes cannot represent are removed.
///
/// The second term has the order k = 1, and a rate of its own at each node, θ_I = 1 − exp(−κ₁ min(1, (2 q_I)³) Δt). The number q compares
/// the curvature of the velocity with its slope:
/// q_I = |v̄_I − v̿_I|² / σ_I²,  v̿ = M_L⁻¹ M v̄,  σ_I² = Σ_p m N_I |v_p − v̄_I|² / m_I.
///
/// ```
/// use bfree::mechanics::{check::direction, smoothing::Smoothing, sweep::Connectivity, transfer::Nodal};
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// let particles = &mut simulation.particles;
/// particles.velocity = direction(particles.len(), 1); // full of modes that nodes cannot represent
/// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
/// let mass = Nodal::at_rest(particles, &connectivity).mass;
///
/// let (smoothing, dt) = (Smoothing::limited(40.0), 0.05);
/// let at_kinks = smoothing.shares_at_kinks(particles, &connectivity, &mass, dt);
/// let change = smoothing.change(particles, &connectivity, &mass, at_kinks.as_deref(), &particles.velocity, dt);
/// // Momentum is conserved, energy is lost.
/// let given: Vector<f64, 2> = change.iter().zip(&particles.mass).map(|(dv, &m)| dv * m).sum();
/// assert!(given.norm() < 1e-13 * particles.mass.iter().sum::<f64>());
/// let before = particles.kinetic_energy();
/// particles.velocity.iter_mut().zip(&change).for_each(|(v, dv)| *v += dv);
/// assert!(particles.kinetic_energy() < 0.5 * before);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// k ≥ 1: 1 is PIC.
    pub order: u32,
    /// κ ≥ 0, per unit of time; infinite for PIC and FMPM(k) proper.
    pub rate: f64,
    /// κ₁ ≥ 0, per unit of time: upper bound of the additional rate at kinks and extrema of the velocity.
    pub at_kinks: f64,
}

impl Smoothing {
    /// Uniform smoothing of order `order` at the rate `rate`.
    ///
    /// ```
    /// use bfree::mechanics::smoothing::Smoothing;
    ///
    /// // Limited smoothing is uniform smoothing with an additional rate at kinks.
    /// assert_eq!(Smoothing { at_kinks: 0.0, ..Smoothing::limited(8.0) }, Smoothing::uniform(2, 8.0));
    /// ```
    pub const fn uniform(order: u32, rate: f64) -> Self {
        Self { order, rate, at_kinks: 0.0 }
    }

    /// For shocks and jumps: k = 2 at the rate κ, and κ₁ = 5 κ.
    pub const fn limited(rate: f64) -> Self {
        Self { order: 2, rate, at_kinks: AT_KINKS * rate }
    }

    /// θ = 1 − exp(−κΔt)
    ///
    /// ```
    /// use bfree::mechanics::smoothing::Smoothing;
    ///
    /// // Two steps of half the length smooth as much as one step: (1 − θ(Δt/2))² = 1 − θ(Δt).
    /// let smoothing = Smoothing::uniform(2, 8.0);
    /// let left = |dt| 1.0 - smoothing.share(dt);
    /// assert!((left(0.05) * left(0.05) - left(0.1)).abs() < 1e-15);
    /// // PIC proper has θ = 1, however short the step.
    /// assert_eq!(Smoothing::uniform(1, f64::INFINITY).share(1e-9), 1.0);
    /// ```
    pub fn share(&self, dt: f64) -> f64 {
        -(-self.rate * dt).exp_m1()
    }

    /// θ_I at the active nodes; `None` if κ₁ = 0. `mass` is M_L, the lumped mass of the nodes.
    ///
    /// θ_I depends neither on the units nor on a common velocity or a rotation of the axes.
    pub fn shares_at_kinks<const D: usize>(
        &self,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        mass: &[f64],
        dt: f64,
    ) -> Option<Pooled<f64>> {
        if self.at_kinks == 0.0 {
            return None;
        }
        // In the frame of the centre of mass, the variance ⟨v²⟩ − v̄² loses the fewest digits.
        let frame = particles.momentum() / particles.mass.iter().sum::<f64>();
        let (pool, count) = (connectivity.pool(), particles.len());
        let velocity = pool.made(count, |p| particles.velocity[p] - frame);
        let mean = nodal_mean(particles, connectivity, mass, &velocity);
        let squares = pool.made(count, |p| Vector::from([velocity[p].norm_squared()]));
        let mean_square = nodal_mean(particles, connectivity, mass, &squares);
        let mean_of_mean = nodal_mean(particles, connectivity, mass, &connectivity.values(&mean));
        let share = |node: usize| {
            let (v, v_twice, square) = (mean[node], mean_of_mean[node], mean_square[node]);
            let variance = (square[0] - v.norm_squared()).max(0.0) + ROUND_OFF * square[0];
            let q = if variance > 0.0 { (v - v_twice).norm_squared() / variance } else { 0.0 };
            let kink = (q / KINK).powi(SHARPNESS).min(1.0);
            // The share is zero without a kink, also for an infinite rate.
            if kink > 0.0 { -(-self.at_kinks * kink * dt).exp_m1() } else { 0.0 }
        };
        Some(pool.made(mean.len(), share))
    }

    /// −θ (u_p − Σ N w) − Σ N_I θ_I (u_p − ū_I) for a particle field u. `mass` is M_L at the active nodes, `at_kinks` is from
    /// [`Self::shares_at_kinks`].
    ///
    /// The change conserves Σ m u, because 1ᵀ(M_L − M) = 0 and Σ_p m N_I (u_p − ū_I) = 0. Σ m u² never grows.
    pub fn change<const D: usize>(
        &self,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        mass: &[f64],
        at_kinks: Option<&[f64]>,
        field: &[Vector<f64, D>],
        dt: f64,
    ) -> Pooled<Vector<f64, D>> {
        let theta = self.share(dt);
        // r_j = (I − N M_L⁻¹ Nᵀm)^j u at the particles, and Σ N w = u − r_k.
        let mut change = connectivity.pool().copy_of(field);
        for _ in 0..self.order {
            let smooth = nodal_mean(particles, connectivity, mass, &change);
            parallel::zip(&mut change, &connectivity.values(&smooth), |change, smooth| *change -= smooth);
        }
        parallel::each(&mut change, |_, r| *r *= -theta);
        if let Some(shares) = at_kinks {
            let mut drawn = nodal_mean(particles, connectivity, mass, field);
            parallel::zip(&mut drawn, shares, |u, share| *u *= *share);
            let shares = connectivity.values::<1>(bytemuck::cast_slice(shares));
            let drawn = connectivity.values(&drawn);
            parallel::each(&mut change, |p, change| {
                *change -= field[p] * shares[p][0];
                *change += drawn[p];
            });
        }
        change
    }
}

/// M_L⁻¹ Σ_p N m u_p
fn nodal_mean<const C: usize, const D: usize>(
    particles: &Particles<D>,
    connectivity: &Connectivity<D>,
    mass: &[f64],
    field: &[Vector<f64, C>],
) -> Pooled<Vector<f64, C>> {
    let mut out: Pooled<Vector<f64, C>> = connectivity.field();
    connectivity.spread(&mut out, |p| field[p] * particles.mass[p]);
    // A node without mass has no weight in later sums either.
    parallel::zip(&mut out, mass, |w, &m| *w = if m > 0.0 { *w / m } else { Vector::zeros() });
    out
}
