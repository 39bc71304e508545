//! Von Mises' yield criterion for metals, with isotropic hardening and associated flow.

use super::hencky::Radial;
use super::plastic::round_off;
use super::{Criterion, Hardening, Lame, LameParameters, ReturnMapped};
use crate::problems::Problems;
use crate::scalar::Real;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Plastic flow starts where q = √(3/2) ‖dev τ‖ reaches σ_y(p), and runs along dev τ. τ is the Kirchhoff stress J σ, and p accumulates
/// √(2/3) of the norm of the plastic strain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VonMises {
    /// σ_y(p)
    pub yield_stress: Hardening,
}

/// The constants of [`VonMises`].
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "VonMises")]
#[serde(deny_unknown_fields)]
pub struct VonMisesParameters {
    /// The elastic constants.
    pub elastic: LameParameters,
    /// The yield stress in tension, as a function of the accumulated plastic strain. It limits the Kirchhoff stress J σ, which in metals
    /// nearly equals the Cauchy stress.
    pub yield_stress: Hardening,
}

impl Criterion for VonMises {
    type Parameters = VonMisesParameters;
    const HAS_POTENTIAL: bool = true;
    const ISOCHORIC: bool = true;

    fn build(given: &VonMisesParameters, problems: &mut Problems, path: &str) -> Option<(Lame, Self)> {
        let solid = given.elastic.lame(problems, &format!("{path}.elastic"));
        let stiffness = 3.0 * solid.map_or(f64::INFINITY, |solid| solid.shear);
        let good = given.yield_stress.check(stiffness, problems, &format!("{path}.yield_stress"));
        solid.filter(|_| good).map(|solid| (solid, Self { yield_stress: given.yield_stress }))
    }

    fn is_associated(&self) -> bool {
        true
    }

    fn example(solid: &Lame) -> Self {
        let g = solid.shear;
        let yield_stress = Hardening { initial: 0.1 * g, linear: 0.05 * g, saturation: 0.05 * g, rate: 5.0 };
        Self { yield_stress }
    }

    /// q_trial − 3G Δp = σ_y(p_n + Δp); dev τ is scaled by 1 − 3G Δp/q_trial, and t = √(2/3) q.
    fn return_map<T: Real>(&self, solid: &Lame, v: T, d: T, before: f64) -> ReturnMapped<T> {
        let (shear, p_n) = (solid.shear, T::lit(before));
        let trial = d * T::lit(6.0_f64.sqrt() * shear);
        let beyond = trial.value() - self.yield_stress.strength(before);
        if beyond <= round_off(3.0 * shear, d.value(), before) {
            return ReturnMapped::elastic(solid, v, before);
        }
        let (delta, compliance) = self.yield_stress.solve(trial, 3.0 * shear, 1.0, p_n);
        let elastic = Radial::elastic(solid, v);
        let plastic_strain = p_n + delta;
        // Far beyond yield, σ_y/q_trial and k'/(3G + k') keep the digits that 1 − 3G Δp/q_trial and 1 − 3G/(3G + k') lose.
        let radial = Radial {
            g: elastic.g * self.yield_stress.strength(plastic_strain) / trial,
            t_d: elastic.g * self.yield_stress.slope(plastic_strain) * compliance,
            ..elastic
        };
        let dissipated = self.yield_stress.work(plastic_strain) - self.yield_stress.work(p_n);
        ReturnMapped { radial, plastic_strain, dissipated }
    }
}
