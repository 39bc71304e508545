//! Laws, each a function of the inputs of a step.

use super::dual::*;
use tangent_check::convention::{Components, Tensor};

/// The inputs of a step with derivatives.
pub struct Inputs {
    pub gradient: D3,
    pub gradient_before: D3,
    pub strain_increment: D3,
    pub rotation: D3,
    pub length: f64,
    /// The Cauchy stress at the start of the step.
    pub stress: D3,
    pub state: Vec<f64>,
}

/// How plastic or viscous flow takes part in the derivative.
#[derive(Clone, Copy, PartialEq)]
pub enum Flow {
    Algorithmic,
    /// The internal variables rest at their values at the end of the step.
    Frozen,
}

/// A law: Cauchy stress and internal variables.
pub trait Formula {
    fn name(&self) -> &'static str;
    fn state_at_rest(&self) -> Vec<f64> {
        Vec::new()
    }
    /// Whether it takes the strain increment, not F.
    fn incremental(&self) -> bool {
        false
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>);
}

pub fn pack(a: &Tensor) -> Vec<f64> {
    Components::abaqus(1.0).vector(a)
}

pub fn unpack(v: &[f64]) -> D3 {
    constant(&Components::abaqus(1.0).symmetric_tensor(v))
}

pub fn number(x: f64) -> Dual {
    Dual::new(x)
}

/// σ = μ/J (b − I) + λ ln J/J I.
pub struct NeoHookean;

impl Formula for NeoHookean {
    fn name(&self) -> &'static str {
        "neo-Hookean"
    }
    fn respond(&self, inputs: &Inputs, _: Flow) -> (D3, Vec<f64>) {
        let f = &inputs.gradient;
        let [mu, lambda] = [1.3, 2.1];
        let j = det(f);
        let b = mul(f, &t(f));
        let deviatoric = times(number(mu) / j, &sub(&b, &unit()));
        (add(&deviatoric, &times(j.ln() * lambda / j, &unit())), Vec::new())
    }
}

/// S = λ tr E I + 2 μ E, with an additional stiff fibre if asked for.
pub struct SaintVenantKirchhoff {
    pub fibre: f64,
}

impl Formula for SaintVenantKirchhoff {
    fn name(&self) -> &'static str {
        "St. Venant–Kirchhoff"
    }
    fn respond(&self, inputs: &Inputs, _: Flow) -> (D3, Vec<f64>) {
        let f = &inputs.gradient;
        let e = times(number(0.5), &sub(&mul(&t(f), f), &unit()));
        let a = [0.36, 0.48, 0.8];
        let fibre = of(|i, j| number(a[i] * a[j]));
        let stretch = tr(&mul(&e, &fibre));
        let s = add(&times(tr(&e) * 1.7, &unit()), &times(number(2.4), &e));
        let s = add(&s, &times(stretch * self.fibre, &fibre));
        (times(number(1.0) / det(f), &mul(&mul(f, &s), &t(f))), Vec::new())
    }
}

/// τ = Σ μ_p dev(b̄^(α_p/2)) + κ J (J − 1) I.
pub struct Ogden;

impl Formula for Ogden {
    fn name(&self) -> &'static str {
        "Ogden"
    }
    fn respond(&self, inputs: &Inputs, _: Flow) -> (D3, Vec<f64>) {
        let f = &inputs.gradient;
        let j = det(f);
        let b = times(j.powf(-2.0 / 3.0), &mul(f, &t(f)));
        let mut tau = times(j * (j - number(1.0)) * 4.0, &unit());
        for (mu, alpha) in [(1.1, 1.3), (0.05, 5.0), (-0.2, -2.0)] {
            tau = add(&tau, &times(number(mu), &dev(&power(&b, 0.5 * alpha))));
        }
        (times(number(1.0) / j, &tau), Vec::new())
    }
}

/// Voce hardening: σ_y = 1 + 0.5 α + 0.8 (1 − e^(−12 α)), and its slope.
fn voce(alpha: Dual) -> (Dual, Dual) {
    let decay = (alpha * -12.0).exp();
    (number(1.8) + alpha * 0.5 - decay * 0.8, number(0.5) + decay * 9.6)
}

/// The plastic multiplier Δγ of ‖s‖ − 2 G Δγ = √⅔ σ_y(α + √⅔ Δγ): Newton's method over dual numbers.
fn radial_return(trial: Dual, shear: f64, alpha: f64) -> Dual {
    let root = (2.0_f64 / 3.0).sqrt();
    let mut gamma = number(0.0);
    for _ in 0..30 {
        let (strength, slope) = voce(number(alpha) + gamma * root);
        let residual = trial - gamma * (2.0 * shear) - strength * root;
        gamma = gamma + residual / (number(2.0 * shear) + slope * (2.0 / 3.0));
    }
    gamma
}

const SHEAR: f64 = 80.0;
const BULK: f64 = 160.0;

/// The logarithmic elastic strain of b_e = F C_p⁻¹ Fᵀ without flow.
fn trial(inputs: &Inputs) -> D3 {
    let f = &inputs.gradient;
    times(number(0.5), &log(&mul(&mul(f, &unpack(&inputs.state[..6])), &t(f))))
}

/// The internal variables after flow: C_p⁻¹ of an elastic strain, and the variable of hardening.
fn flowed(inputs: &Inputs, elastic: &D3, hardening: f64) -> Vec<f64> {
    let inverse = inv(&inputs.gradient);
    let cp = mul(&mul(&inverse, &exp(&times(number(2.0), elastic))), &t(&inverse));
    [pack(&value(&cp)), vec![hardening]].concat()
}

/// The stress from internal variables that rest, inside the yield surface by far.
fn resting(law: &dyn Formula, inputs: &Inputs, state: &[f64], inside: f64) -> D3 {
    let mut state = state.to_vec();
    state[6] += inside;
    law.respond(&Inputs { state, ..*inputs }, Flow::Algorithmic).0
}

/// J2 plasticity with the logarithmic elastic strain.
pub struct J2Finite;

impl Formula for J2Finite {
    fn name(&self) -> &'static str {
        "J2, finite strain"
    }
    fn state_at_rest(&self) -> Vec<f64> {
        vec![1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>) {
        let f = &inputs.gradient;
        let alpha = inputs.state[6];
        let strain = trial(inputs);
        let s = times(number(2.0 * SHEAR), &dev(&strain));
        let volume = times(tr(&strain) * BULK, &unit());
        let [norm, root] = [size(&s), number((2.0_f64 / 3.0).sqrt())];
        let yielded = norm.0 > (voce(number(alpha)).0 * root).0;
        if !yielded {
            return (times(number(1.0) / det(f), &add(&s, &volume)), inputs.state.clone());
        }
        let gamma = radial_return(norm, SHEAR, alpha);
        let returned = times(number(1.0) - gamma * (2.0 * SHEAR) / norm, &s);
        let elastic = add(&times(number(0.5 / SHEAR), &returned), &times(tr(&strain) * (1.0 / 3.0), &unit()));
        let state = flowed(inputs, &elastic, alpha + (gamma * root).0);
        if flow == Flow::Frozen {
            return (resting(self, inputs, &state, 1.0), state);
        }
        (times(number(1.0) / det(f), &add(&returned, &volume)), state)
    }
}

/// Drucker and Prager without association: f = ‖s‖ + η p − c, flow along s/‖s‖ + η̄ I, logarithmic strains.
pub struct DruckerPrager;

impl Formula for DruckerPrager {
    fn name(&self) -> &'static str {
        "Drucker–Prager"
    }
    fn state_at_rest(&self) -> Vec<f64> {
        vec![1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>) {
        let [friction, dilatancy, cohesion, hardening] = [0.5, 0.15, 1.5, 2.0];
        let f = &inputs.gradient;
        let strain = trial(inputs);
        let s = times(number(2.0 * SHEAR), &dev(&strain));
        let pressure = tr(&strain) * BULK;
        let norm = size(&s);
        let strength = cohesion + hardening * inputs.state[6];
        let excess = norm + pressure * friction - number(strength);
        let tau = add(&s, &times(pressure, &unit()));
        if excess.0 <= 0.0 {
            return (times(number(1.0) / det(f), &tau), inputs.state.clone());
        }
        let gamma = excess * (1.0 / (2.0 * SHEAR + 3.0 * BULK * friction * dilatancy + hardening));
        // Beyond the apex: all shear is lost, and the pressure stays on the cone's tip.
        let apex = norm.0 < 2.0 * SHEAR * gamma.0;
        let tip = (pressure - number(strength / friction)) * (1.0 / (3.0 * BULK * dilatancy + hardening / friction));
        let gamma = if apex { tip } else { gamma };
        let ratio = if apex { number(0.0) } else { number(1.0) - gamma * (2.0 * SHEAR) / norm };
        let pressure = pressure - gamma * (3.0 * BULK * dilatancy);
        let returned = times(ratio, &s);
        let elastic = add(&times(number(0.5 / SHEAR), &returned), &times(pressure * (1.0 / (3.0 * BULK)), &unit()));
        let state = flowed(inputs, &elastic, inputs.state[6] + gamma.0);
        if flow == Flow::Frozen {
            return (resting(self, inputs, &state, 10.0), state);
        }
        let tau = add(&returned, &times(pressure, &unit()));
        (times(number(1.0) / det(f), &tau), state)
    }
}

/// A neo-Hookean solid with a Maxwell branch: Q = e^(−Δt/τ) Q₀ + g e^(−Δt/2τ) (S − S₀), second Piola–Kirchhoff stresses.
pub struct Maxwell;

impl Formula for Maxwell {
    fn name(&self) -> &'static str {
        "Maxwell"
    }
    fn state_at_rest(&self) -> Vec<f64> {
        vec![0.0; 12]
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>) {
        let [mu, lambda, share, relaxation] = [1.0, 1.5, 0.8, 1.0];
        let f = &inputs.gradient;
        let c = inv(&mul(&t(f), f));
        let j = det(f);
        let s = add(&times(number(mu), &sub(&unit(), &c)), &times(j.ln() * lambda, &c));
        let ratio = inputs.length / relaxation;
        let old = unpack(&inputs.state[6..]);
        let increment = times(number(share * (-0.5 * ratio).exp()), &sub(&s, &unpack(&inputs.state[..6])));
        let q = add(&times(number((-ratio).exp()), &old), &increment);
        let mut state = pack(&value(&s));
        state.extend(pack(&value(&q)));
        // Without relaxation in the derivative: ∂Q/∂S = g.
        let q = if flow == Flow::Frozen { dual(&value(&q), &slope(&times(number(share), &s))) } else { q };
        (times(number(1.0) / j, &mul(&mul(f, &add(&s, &q)), &t(f))), state)
    }
}
