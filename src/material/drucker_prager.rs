//! Drucker and Prager's yield criterion for soils, with cohesion, friction, and a dilatancy independent of friction.

use super::hencky::Radial;
use super::plastic::round_off;
use super::{Criterion, Hardening, Lame, LameParameters, ReturnMapped};
use crate::problems::{Number, Problems};
use crate::scalar::Real;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::SQRT_2;

/// Plastic flow starts where √J₂ + η p reaches ξ c(ε̄). p = tr τ/3 is positive in tension, and a [`Cone`] gives η and ξ. The flow dilates
/// by η̄, the η of ψ. At the apex it is any flow that leads to the apex (de Souza Neto, Perić, Owen, 2008, sec. 8.3).
///
/// τ is the Kirchhoff stress J σ. ε̄ grows by ξ Δγ on the cone. At the apex it grows by ξ Δγ of the shear, and by ξ/η times the dilatation
/// beyond it. This further flow is associated, so that the return map exists for ψ = 0 too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DruckerPrager {
    /// η
    friction: f64,
    /// η̄
    dilatancy: f64,
    /// ξ
    cohesive: f64,
    /// c(ε̄)
    cohesion: Hardening,
}

/// The cone in place of Mohr and Coulomb's pyramid |τ| + σ tan φ = c.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "StrengthCone")]
pub enum Cone {
    /// The cone through the compressive edges of the pyramid: as strong as the pyramid in triaxial compression, stronger elsewhere.
    #[default]
    Compression,
    /// The cone that is as strong as the pyramid where soil flows in plane strain: for slopes and footings in 2D.
    PlaneStrain,
}

impl Cone {
    /// η, η̄ and ξ of φ and ψ in radians.
    ///
    /// Compression: η = 6 sin φ/(√3 (3 − sin φ)), ξ = η/tan φ, and η̄ is the η of ψ. Plane strain: flow without an out-of-plane part has
    /// s_zz = −⅔ η̄ √J₂. Mohr and Coulomb's criterion then gives η = sin φ/d and ξ = cos φ/d with d = √(1 − η̄²/3) + η̄ sin φ/3. For ψ = φ
    /// this is η = 3 tan φ/√(9 + 12 tan² φ).
    fn slopes(self, phi: f64, psi: f64) -> [f64; 3] {
        match self {
            Self::Compression => {
                let edge = |angle: f64| 6.0 / (3.0_f64.sqrt() * (3.0 - angle.sin()));
                [edge(phi) * phi.sin(), edge(psi) * psi.sin(), edge(phi) * phi.cos()]
            }
            Self::PlaneStrain => {
                let dilatancy = psi.sin() / (1.0 + psi.sin().powi(2) / 3.0).sqrt();
                let d = (1.0 - dilatancy * dilatancy / 3.0).sqrt() + dilatancy * phi.sin() / 3.0;
                [phi.sin() / d, dilatancy, phi.cos() / d]
            }
        }
    }
}

/// The constants of [`DruckerPrager`].
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "DruckerPrager")]
#[serde(deny_unknown_fields)]
pub struct DruckerPragerParameters {
    /// The elastic constants.
    pub elastic: LameParameters,
    /// The angle of friction φ in degrees, 0 ≤ φ < 90.
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 90))]
    pub friction: f64,
    /// The angle of dilatancy ψ in degrees, 0 ≤ ψ ≤ φ. Default 0.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "exclusiveMaximum" = 90))]
    pub dilatancy: f64,
    /// The cohesion c, as a function of the accumulated plastic strain.
    pub cohesion: Hardening,
    /// The cone in place of Mohr and Coulomb's pyramid of φ and c. Default: `"compression"`.
    #[serde(default)]
    pub cone: Cone,
}

impl DruckerPrager {
    /// From φ and ψ in degrees, 0 ≤ ψ ≤ φ < 90, the cohesion and the cone.
    ///
    /// ```
    /// use bfree::material::{Cone, DruckerPrager, Hardening, Lame, Law, MaterialState, Plastic};
    /// use bfree::tensor::{Tensor, Vector};
    ///
    /// // Under tension on all sides the soil bears tr τ/3 = c cot φ.
    /// let (c, phi) = (0.1, 30.0_f64);
    /// let criterion = DruckerPrager::new(phi, 0.0, Hardening::perfect(c), Cone::Compression);
    /// let law = Plastic { solid: Lame::from_young_poisson(1000.0, 0.3)?, criterion };
    /// let at = MaterialState::new(Tensor::from_diagonal(&Vector::from([0.1; 3])));
    /// let stress = at.f * law.stress(&at) * at.f.transpose();
    /// assert!((stress[(0, 0)] / (c / phi.to_radians().tan()) - 1.0).abs() < 1e-12);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    pub fn new(friction: f64, dilatancy: f64, cohesion: Hardening, cone: Cone) -> Self {
        let [friction, dilatancy, cohesive] = cone.slopes(friction.to_radians(), dilatancy.to_radians());
        Self { friction, dilatancy, cohesive, cohesion }
    }
}

impl Criterion for DruckerPrager {
    type Parameters = DruckerPragerParameters;
    const HAS_POTENTIAL: bool = false;
    const ISOCHORIC: bool = false;

    fn build(given: &DruckerPragerParameters, problems: &mut Problems, path: &str) -> Option<(Lame, Self)> {
        let DruckerPragerParameters { elastic, friction, dilatancy, cohesion, cone } = given;
        let solid = elastic.lame(problems, &format!("{path}.elastic"));
        let rough = (0.0..90.0).contains(friction);
        problems.require(rough, &format!("{path}.friction"), Number(*friction), "must be ≥ 0 and < 90");
        let dilates = (0.0..=friction.max(0.0)).contains(dilatancy);
        let allowed = format_args!("must lie between 0 and the friction, {}", Number(*friction));
        problems.require(dilates || !rough, &format!("{path}.dilatancy"), Number(*dilatancy), allowed);
        let criterion = Self::new(*friction, *dilatancy, *cohesion, *cone);
        // G + K η η̄ on the cone and K η² at the apex, both over ξ², must exceed the rate of softening.
        let stiffness = solid.filter(|_| rough && dilates).map_or(f64::INFINITY, |solid| {
            let (bulk, eta) = (solid.bulk_modulus(), criterion.friction);
            let cone = solid.shear + bulk * eta * criterion.dilatancy;
            let apex = if eta > 0.0 { bulk * eta * eta } else { f64::INFINITY };
            cone.min(apex) / criterion.cohesive.powi(2)
        });
        let good = cohesion.check(stiffness, problems, &format!("{path}.cohesion"));
        solid.filter(|_| good && rough && dilates).map(|solid| (solid, criterion))
    }

    fn is_associated(&self) -> bool {
        self.friction == self.dilatancy
    }

    fn example(solid: &Lame) -> Self {
        let g = solid.shear;
        let cohesion = Hardening { initial: 0.05 * g, linear: 0.02 * g, saturation: -0.02 * g, rate: 5.0 };
        Self::new(30.0, 10.0, cohesion, Cone::Compression)
    }

    /// Returns to the cone, √J₂ − G Δγ + η (p − K η̄ Δγ) = ξ c(ε̄ + ξ Δγ). If √J₂ < G Δγ, it returns to the apex, η p = ξ c.
    fn return_map<T: Real>(&self, solid: &Lame, v: T, d: T, before: f64) -> ReturnMapped<T> {
        let Self { friction: eta, dilatancy: eta_bar, cohesive: xi, cohesion } = self;
        let (shear, bulk, lit) = (solid.shear, solid.bulk_modulus(), T::lit);
        let (before, elastic) = (lit(before), Radial::elastic(solid, v));
        // √J₂ = ‖dev τ‖/√2
        let root_j2 = d * lit(SQRT_2 * shear);
        let excess = root_j2 + elastic.p * lit(*eta);
        let beyond = excess.value() - xi * cohesion.strength(before.value());
        if beyond <= round_off(shear + bulk * eta, d.value() + v.value().abs(), before.value()) {
            return ReturnMapped::elastic(solid, v, before.value());
        }
        let (gamma, w) = cohesion.solve(excess, shear + bulk * eta * eta_bar, *xi, before);
        let left = root_j2 - gamma * lit(shear);
        if left.value() >= 0.0 {
            let p = elastic.p - gamma * lit(bulk * eta_bar);
            mutant!("laws: friction for dilatancy in the flow": p = elastic.p - gamma * lit(bulk * eta));
            let g = elastic.g * left / root_j2;
            let radial = Radial {
                p,
                g,
                p_v: lit(bulk) * (T::one() - w * lit(eta_bar * eta * bulk)),
                p_d: -w * lit(bulk * eta_bar * SQRT_2 * shear),
                t_v: -w * lit(SQRT_2 * shear * eta * bulk),
                t_d: elastic.g * (T::one() - w * lit(shear)),
            };
            // p Δε_v + √J₂ 2Δd/√2 with the stresses at the end of the step, Δε_v = η̄ Δγ and Δd = Δγ/√2
            let dissipated = gamma * (p * lit(*eta_bar) + left);
            return ReturnMapped { radial, plastic_strain: before + gamma * lit(*xi), dissipated };
        }
        // All shear flows and dilates by η̄. A dilatation η δ follows, until η K (v − η̄ √J₂/G − η δ) = ξ c(ε̄ + ξ √J₂/G + ξ δ).
        let sheared = root_j2 * lit(1.0 / shear);
        let after = before + sheared * lit(*xi);
        let excess = (v - sheared * lit(*eta_bar)) * lit(eta * bulk);
        let (delta, w) = cohesion.solve(excess, bulk * eta * eta, *xi, after);
        let plastic_volume = sheared * lit(*eta_bar) + delta * lit(*eta);
        let (p, plastic_strain) = ((v - plastic_volume) * lit(bulk), after + delta * lit(*xi));
        let hardens = cohesion.slope(plastic_strain) * lit(xi * xi);
        // Derivatives of √J₂/G and δ with respect to d, and of δ with respect to v
        let (s_d, d_v) = (lit(SQRT_2), w * lit(eta * bulk));
        let d_d = -w * (lit(eta * bulk * eta_bar) + hardens) * s_d;
        let radial = Radial {
            p,
            g: T::zero(),
            p_v: lit(bulk) * (T::one() - d_v * lit(*eta)),
            p_d: -(s_d * lit(*eta_bar) + d_d * lit(*eta)) * lit(bulk),
            t_v: T::zero(),
            t_d: T::zero(),
        };
        ReturnMapped { radial, plastic_strain, dissipated: p * plastic_volume }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// De Souza Neto, Perić, Owen (2008), eqs. 6.123 and 6.124, for associated flow: η = 3 tan φ/√(9 + 12 tan² φ), ξ = 3/√(9 + 12 tan² φ).
    #[test]
    fn the_cone_of_plane_strain_is_the_known_one_for_associated_flow() {
        for phi in [0.0, 10.0, 30.0, 50.0_f64].map(f64::to_radians) {
            let root = (9.0 + 12.0 * phi.tan().powi(2)).sqrt();
            let known = [3.0 * phi.tan() / root, 3.0 * phi.tan() / root, 3.0 / root];
            for (found, known) in Cone::PlaneStrain.slopes(phi, phi).into_iter().zip(known) {
                assert!((found - known).abs() < 1e-15, "{found} instead of {known} at {phi}");
            }
        }
    }
}
