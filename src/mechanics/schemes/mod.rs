//! Time integration schemes, one file each. A scheme says at which instant of a step forces are in balance, and gives a and v at this
//! instant and at the end of the step.
//!
//! In every scheme, a and v are affine functions of the motion increment, of one form ([`Alphas`]). The terms of the residual therefore do
//! not depend on the scheme.

mod energy_momentum;
mod generalized_alpha;
mod newmark;
mod statics;

pub use energy_momentum::EnergyMomentum;
pub use generalized_alpha::GeneralizedAlpha;
pub use newmark::Newmark;
pub use statics::Statics;

use crate::problems::Problems;
use crate::tensor::Vector;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use std::sync::Arc;

/// Courant number of pressure waves. Above it, inertia hardly restrains a node at the boundary of a body.
pub(crate) const LONG_STEPS: f64 = 10.0;

/// A time integration scheme, from t_n to t_{n+1}.
///
/// Newton's unknown is the motion up to t_n + θ Δt, where forces are in balance. Δφ of the whole step is 1/θ of this motion.
pub trait Scheme: Debug + Send + Sync {
    /// The name in reports.
    fn name(&self) -> String;

    /// θ in (0, 1].
    fn instant(&self) -> f64 {
        1.0
    }

    /// a and v in the balance of forces, as functions of the motion up to t_n + θ Δt, which lasts θ Δt.
    fn balance(&self, dt: f64) -> Alphas {
        self.end(dt)
    }

    /// a and v at t_{n+1}, as functions of Δφ.
    fn end(&self, dt: f64) -> Alphas;

    /// The constant c of the local displacement error c Δt² |Δa|; exact to leading order.
    fn error_constant(&self) -> f64;

    /// Whether the scheme has inertia. Without inertia there is no velocity, acceleration or mass matrix, and time only selects the loads.
    fn has_inertia(&self) -> bool {
        true
    }

    /// Whether a step has an arc length on the equilibrium path, and the load at its end is solved for.
    fn follows_path(&self) -> bool {
        false
    }
}

/// The time integration scheme.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "TimeScheme")]
pub enum Parameters {
    /// Dynamics, by Newmark's method.
    #[default]
    Newmark,
    /// Dynamics, by the generalised-α method of Chung and Hulbert. The method is of second order, and damps vibrations that the time step
    /// does not resolve.
    GeneralizedAlpha(GeneralizedAlpha),
    /// Dynamics that keep energy, momentum and angular momentum for every step length: the midpoint rule with the mean stress of the step, a
    /// discrete gradient of the strain energy, and with the mean pressure of obstacles. A grid reset still loses energy. Not for laws
    /// from libraries, and not with `contact`.
    EnergyMomentum,
    /// Statics: time only sets the loads and the prescribed motions.
    None,
    /// Quasi-statics along the equilibrium path, by arc length: loads may fall after they have risen (snap-through). The first step applies
    /// the loads of the time `step`. All later steps have the same arc length, measured in the motion. The column `load` of `history.csv`
    /// gives the time whose loads act. The scheme is for dead loads and walls at rest.
    ArcLength,
}

impl Parameters {
    /// The scheme; `newmark` gives the constants of Newmark's method.
    pub(crate) fn scheme(&self, newmark: Newmark) -> Arc<dyn Scheme> {
        match *self {
            Self::Newmark => Arc::new(newmark),
            Self::GeneralizedAlpha(scheme) => Arc::new(scheme),
            Self::EnergyMomentum => Arc::new(EnergyMomentum),
            Self::None => Arc::new(Statics { by_arc_length: false }),
            Self::ArcLength => Arc::new(Statics { by_arc_length: true }),
        }
    }

    /// Whether the scheme has inertia, see [`Scheme::has_inertia`].
    pub(crate) fn has_inertia(&self) -> bool {
        !matches!(self, Self::None | Self::ArcLength)
    }

    /// Adds invalid values of the keys below `path` to `problems`.
    pub(crate) fn check(&self, problems: &mut Problems, path: &str) {
        if let Self::GeneralizedAlpha(scheme) = self {
            scheme.check(problems, &format!("{path}.generalized_alpha"));
        }
    }
}

/// a = α₁ Δφ − α₂ v_n − α₃ a_n,  v = α₄ Δφ + α₅ v_n + α₆ a_n   (eq. 19), evaluated as
///
/// ```text
/// a       = α₁ (Δφ − Δφ̂),  Δφ̂ = Δt v_n + α₃/α₁ a_n
/// v − v_n = α₄ (Δφ − Δt v_n) + α₆ a_n
/// a − a_n = α₁ (Δφ − Δt v_n) − (α₃ + 1) a_n
/// ```
///
/// Both forms are equal, because α₂ = α₁ Δt and α₅ = 1 − α₄ Δt. In the printed form, large terms leave a small difference. In steady flight
/// this difference is rounded the same way in every step, and the momentum drifts. In the form above, Δφ = Δt v_n without acceleration
/// changes not a bit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // named in the formulas above
pub struct Alphas {
    pub dt: f64,
    pub a1: f64,
    pub a2: f64,
    pub a3: f64,
    pub a4: f64,
    pub a6: f64,
    /// Whether the stress and the pressures of contact beside them are means of the step, discrete gradients of their energies. Forces are
    /// then in balance halfway, θ = ½.
    pub discrete_gradient: bool,
}

impl Alphas {
    /// a = a_n for Δφ = 0: the equilibrium at the start of a step.
    pub const START: Self = Self { dt: 0.0, a1: 1.0, a2: 0.0, a3: -1.0, a4: 0.0, a6: 0.0, discrete_gradient: false };

    /// Δφ̂ from v_n and a_n: the motion increment that ends without acceleration. Δφ̂ exists only with inertia.
    ///
    /// ```
    /// use bfree::mechanics::schemes::Newmark;
    /// use bfree::tensor::Vector;
    ///
    /// // Without acceleration at the start too, Δφ̂ is the increment of uniform motion.
    /// let (v, rest) = (Vector::from([3.0, -1.0]), Vector::from([0.0, 0.0]));
    /// assert_eq!(Newmark::default().alphas(0.5).predicted(&v, &rest), v * 0.5);
    /// ```
    #[inline(always)]
    pub fn predicted<const D: usize>(&self, v: &Vector<f64, D>, a: &Vector<f64, D>) -> Vector<f64, D> {
        v * self.dt + a * (self.a3 / self.a1)
    }

    /// v − v_n and a − a_n, from Δφ, v_n and a_n.
    #[inline(always)]
    pub(crate) fn increments<const D: usize>(
        &self,
        dphi: &Vector<f64, D>,
        v: &Vector<f64, D>,
        a: &Vector<f64, D>,
    ) -> (Vector<f64, D>, Vector<f64, D>) {
        let bent = dphi - v * self.dt;
        (bent * self.a4 + a * self.a6, bent * self.a1 - a * (self.a3 + 1.0))
    }
}
