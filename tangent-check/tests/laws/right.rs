//! Twelve laws of plasticity, damage, viscosity and crystals in addition to those of `shipped`, and their tangents as users write them.

use super::dual::*;
use super::exact::unit_strain;
use super::planted::{constants, plain, right};
use super::shipped::{Flow, Formula, Inputs, number, pack, unpack};
use std::cell::Cell;
use tangent_check::convention::{Convention, Measure, Tensor, stress_vector};
use tangent_check::law::{CallFailed, Law, Response, Step};
use tangent_check::matrix::Matrix;
use tangent_check::roads::with_gradient;
use tangent_check::tensor;

thread_local! {
    /// The residual, over its scale, at which local iterations end.
    static TOLERANCE: Cell<f64> = const { Cell::new(0.0) };
    /// Whether literals have single precision.
    static SINGLE: Cell<bool> = const { Cell::new(false) };
}

/// A literal of the source code.
pub fn literal(x: f64) -> f64 {
    if SINGLE.get() { f64::from(x as f32) } else { x }
}

/// The root of r(x) = 0 by Newton's method from `x`, and its derivative by the implicit function theorem. `r` gives r and ∂r/∂x.
pub fn root(mut x: f64, scale: f64, r: impl Fn(Dual) -> (Dual, f64)) -> Dual {
    for _ in 0..100 {
        let (residual, slope) = r(number(x));
        let change = residual.0 / slope;
        if residual.0.abs() <= TOLERANCE.get() * scale || change.abs() <= 1e-15 * x.abs() {
            break;
        }
        x -= change;
    }
    let (residual, slope) = r(number(x));
    Dual(x, -residual.1 / slope)
}

const SHEAR: f64 = 80e3;
const BULK: f64 = 160e3;

/// J2 plasticity of strain increments with isotropic (H, Voce), kinematic (K) hardening and viscosity: ‖s − β‖ = √⅔ [σ₀ + H α + Q (1 − e^(−δ α))
/// + η (Δγ/Δt)ᵐ] at the end of the step, and β grows by ⅔ K Δγ n. State: α and β, which turns with the body.
pub struct J2 {
    pub name: &'static str,
    pub strength: f64,
    pub linear: f64,
    pub voce: f64,
    pub kinematic: f64,
    pub viscosity: f64,
    pub exponent: f64,
}

/// A steel without hardening, in MPa.
pub const STEEL: J2 =
    J2 { name: "", strength: 250.0, linear: 0.0, voce: 0.0, kinematic: 0.0, viscosity: 0.0, exponent: 1.0 };

/// A steel whose hardening saturates.
pub const VOCE: J2 = J2 { name: "J2, Voce", linear: 130.0, voce: 265.0, ..STEEL };

impl Formula for J2 {
    fn name(&self) -> &'static str {
        self.name
    }
    fn state_at_rest(&self) -> Vec<f64> {
        vec![0.0; 7]
    }
    fn incremental(&self) -> bool {
        true
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>) {
        let turn = |a: &D3| mul(&mul(&inputs.rotation, a), &t(&inputs.rotation));
        let trial = add(&turn(&inputs.stress), &times(number(2.0 * SHEAR), &dev(&inputs.strain_increment)));
        let trial = add(&trial, &times(tr(&inputs.strain_increment) * BULK, &unit()));
        let (alpha, back) = (inputs.state[0], turn(&unpack(&inputs.state[1..])));
        let s = sub(&dev(&trial), &back);
        let (norm, factor) = (size(&s), (2.0_f64 / 3.0).sqrt());
        let strength = |gamma: Dual| {
            let a = number(alpha) + gamma * factor;
            let decay = (a * -16.93).exp();
            let (hard, slope) = (
                a * self.linear - decay * self.voce + number(self.strength + self.voce),
                self.linear + decay.0 * 16.93 * self.voce,
            );
            if self.viscosity == 0.0 {
                return (hard, slope * factor);
            }
            let rate = Dual((gamma.0 / inputs.length).max(1e-300), gamma.1 / inputs.length);
            let drag = rate.powf(self.exponent) * self.viscosity;
            (hard + drag, slope * factor + self.exponent * drag.0 / rate.0 / inputs.length)
        };
        let yields = norm.0 - factor * strength(number(0.0)).0.0;
        if yields <= 0.0 {
            return (trial, [vec![alpha], pack(&value(&back))].concat());
        }
        let stiff = 2.0 * SHEAR + 2.0 / 3.0 * self.kinematic;
        let gamma =
            root(if self.viscosity == 0.0 { 0.0 } else { 1e-3 * yields / stiff }, factor * self.strength, |gamma| {
                let (strong, slope) = strength(gamma);
                (norm - gamma * stiff - strong * factor, -stiff - slope * factor)
            });
        let gamma = if flow == Flow::Frozen { number(gamma.0) } else { gamma };
        let n = times(number(1.0) / norm, &s);
        let n = if flow == Flow::Frozen { constant(&value(&n)) } else { n };
        let back = add(&back, &times(gamma * (2.0 / 3.0 * self.kinematic), &n));
        let state = [vec![alpha + gamma.0 * factor], pack(&value(&back))].concat();
        (sub(&trial, &times(gamma * (2.0 * SHEAR), &n)), state)
    }
}

/// τ = F S Fᵀ/J of S = S(C), and its state.
fn pushed(f: &D3, s: &D3) -> D3 {
    times(number(1.0) / det(f), &mul(&mul(f, s), &t(f)))
}

fn green(f: &D3) -> D3 {
    times(number(0.5), &sub(&mul(&t(f), f), &unit()))
}

fn hooke(strain: &D3) -> D3 {
    add(&times(tr(strain) * BULK, &unit()), &times(number(2.0 * SHEAR), &dev(strain)))
}

/// Damage with exponential softening: S = (1 − D) ℂ:E, D = 1 − κ₀/κ e^(−(κ − κ₀)/κ_f), where κ is the greatest √(E : E). State: κ, D.
pub struct Softening {
    pub name: &'static str,
    pub onset: f64,
    pub ductility: f64,
}

impl Formula for Softening {
    fn name(&self) -> &'static str {
        self.name
    }
    fn state_at_rest(&self) -> Vec<f64> {
        vec![self.onset, 0.0]
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>) {
        let strain = green(&inputs.gradient);
        let greatest = inputs.state[0];
        let now = size(&strain);
        let kappa = if now.0 > greatest && flow == Flow::Algorithmic { now } else { number(now.0.max(greatest)) };
        let damage = number(1.0) - ((number(self.onset) - kappa) * (1.0 / self.ductility)).exp() * self.onset / kappa;
        (pushed(&inputs.gradient, &times(number(1.0) - damage, &hooke(&strain))), vec![kappa.0, damage.0])
    }
}

/// Norton's creep of a deviator: Δγ = Δt A ‖s‖ⁿ at the end of the step. No state but the stress.
pub struct Norton;

impl Formula for Norton {
    fn name(&self) -> &'static str {
        "Norton's creep"
    }
    fn incremental(&self) -> bool {
        true
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>) {
        let turned = mul(&mul(&inputs.rotation, &inputs.stress), &t(&inputs.rotation));
        let trial = add(&turned, &hooke(&inputs.strain_increment));
        let s = dev(&trial);
        let norm = size(&s);
        if norm.0 == 0.0 {
            return (trial, Vec::new());
        }
        let creep = inputs.length * 1e-3;
        // x is ‖s‖ over 100 at the end: x + 2 G creep xⁿ/100 = trial.
        let x = root(norm.0.min(300.0) / 100.0, norm.0 / 100.0, |x| {
            let rate = x.powf(4.0) * (2.0 * SHEAR * creep / 100.0);
            (x + rate - norm * 0.01, 1.0 + 4.0 * rate.0 / x.0)
        });
        let ratio = if flow == Flow::Frozen { number(100.0 * x.0 / norm.0) } else { x * 100.0 / norm };
        (sub(&trial, &times(number(1.0) - ratio, &s)), Vec::new())
    }
}

/// A crystal with three slip systems: S = ℂ:(E − Σ γ_s P_s), γ_s grows by Δt γ₀ (|τ_s|/g)⁵ sign τ_s, and g by h Σ|Δγ_s|. State: γ_s, g.
pub struct Crystal;

impl Crystal {
    fn systems() -> [D3; 3] {
        let all = [
            ([1.0, 1.0, 1.0], [1.0, -1.0, 0.0]),
            ([-1.0, 1.0, 1.0], [1.0, 0.0, 1.0]),
            ([1.0, -1.0, 1.0], [0.0, 1.0, 1.0]),
        ];
        all.map(|(m, s)| constant(&tensor::from_entries(|i, j| 0.5 * (m[i] * s[j] + m[j] * s[i]) / 6.0_f64.sqrt())))
    }
}

/// The stresses at which the residuals vanish, by Newton's method, and their derivatives.
fn solved(tau: &[Dual; 3], residual: &dyn Fn(&[Dual; 3]) -> [Dual; 3], slope: &dyn Fn([f64; 3]) -> D3) -> [Dual; 3] {
    let mut x = tau.map(|tau| tau.0.clamp(-80.0, 80.0));
    let norm = |r: &[Dual; 3]| r.iter().map(|r| r.0.abs()).fold(0.0, f64::max);
    let scale = norm(tau);
    for _ in 0..200 {
        let r: [Dual; 3] = residual(&x.map(number));
        if norm(&r) <= TOLERANCE.get().max(4e-16) * scale {
            break;
        }
        let back = slope(x);
        let change: [f64; 3] = std::array::from_fn(|s| (0..3).map(|q| back[s][q].0 * r[q].0).sum());
        // A step that increases the residual is halved.
        let mut part = 1.0;
        let next = |part: f64| -> [f64; 3] { std::array::from_fn(|s| x[s] - part * change[s]) };
        while part > 1e-3 && norm(&residual(&next(part).map(number))) > norm(&r) {
            part *= 0.5;
        }
        x = if part > 1e-3 { next(part) } else { break };
    }
    let r: [Dual; 3] = residual(&x.map(number));
    let back = slope(x);
    std::array::from_fn(|s| Dual(x[s], -(0..3).map(|q| back[s][q].0 * r[q].1).sum::<f64>()))
}

fn inner(a: &D3, b: &D3) -> Dual {
    (0..9).fold(number(0.0), |sum, k| sum + a[k / 3][k % 3] * b[k / 3][k % 3])
}

impl Formula for Crystal {
    fn name(&self) -> &'static str {
        "crystal of three slip systems"
    }
    fn state_at_rest(&self) -> Vec<f64> {
        vec![0.0, 0.0, 0.0, 60.0]
    }
    fn respond(&self, inputs: &Inputs, flow: Flow) -> (D3, Vec<f64>) {
        let systems = Self::systems();
        let old = &inputs.state;
        let elastic = (0..3).fold(green(&inputs.gradient), |e, s| sub(&e, &times(number(old[s]), &systems[s])));
        let trial = hooke(&elastic);
        let tau: [Dual; 3] = std::array::from_fn(|s| inner(&trial, &systems[s]));
        let stiff = of(|s, r| inner(&hooke(&systems[s]), &systems[r]));
        let hardening = 200.0;
        // The residual in the stresses τ_s: x_s + Σ stiff_sr Δγ_r(x) − τ_s, and its tangent.
        let slip = |x: &[Dual; 3]| {
            let mut g = number(old[3]);
            // The strength at the end of the step, to round-off.
            let rate = |x: Dual, g: Dual| {
                let ratio = x / g;
                ratio * ratio * ratio * ratio * ratio * inputs.length
            };
            for _ in 0..40 {
                let sum = x.iter().fold(number(0.0), |sum, x| sum + rate(if x.0 < 0.0 { -*x } else { *x }, g) * 1e-3);
                let residual = g - number(old[3]) - sum * hardening;
                let change = residual / (number(1.0) + sum / g * (5.0 * hardening));
                g = g - change;
                if change.0.abs() <= f64::EPSILON * g.0 && change.1.abs() <= f64::EPSILON * g.1.abs() {
                    break;
                }
            }
            (x.map(|x| rate(x, g) * 1e-3), g)
        };
        let residual = |x: &[Dual; 3]| {
            let gamma = slip(x).0;
            std::array::from_fn(|s| x[s] + (0..3).fold(number(0.0), |sum, r| sum + stiff[s][r] * gamma[r]) - tau[s])
        };
        let slope = |x: [f64; 3]| {
            let columns: [[Dual; 3]; 3] = std::array::from_fn(|k| {
                let at: [Dual; 3] = std::array::from_fn(|s| Dual(x[s], f64::from(s == k)));
                let fixed: [f64; 3] = std::array::from_fn(|s| tau[s].1);
                let r: [Dual; 3] = residual(&at);
                std::array::from_fn(|s| number(r[s].1 + fixed[s]))
            });
            inv(&of(|i, j| columns[j][i]))
        };
        let solved = solved(&tau, &residual, &slope);
        let (gamma, g) = slip(&solved);
        let gamma = if flow == Flow::Frozen { gamma.map(|gamma| number(gamma.0)) } else { gamma };
        let elastic = (0..3).fold(elastic, |e, s| sub(&e, &times(gamma[s], &systems[s])));
        let state = vec![old[0] + gamma[0].0, old[1] + gamma[1].0, old[2] + gamma[2].0, g.0];
        (pushed(&inputs.gradient, &hooke(&elastic)), state)
    }
}

/// Fibres that carry tension alone, without a matrix: S = k ⟨a·E a⟩ a ⊗ a.
pub struct Fibres;

impl Formula for Fibres {
    fn name(&self) -> &'static str {
        "fibres in tension"
    }
    fn respond(&self, inputs: &Inputs, _: Flow) -> (D3, Vec<f64>) {
        let a = [0.36, 0.48, 0.8];
        let fibre = constant(&tensor::from_entries(|i, j| a[i] * a[j]));
        let stretch = inner(&green(&inputs.gradient), &fibre);
        let force =
            if stretch.0 > 0.0 { stretch * (stretch * stretch * 2.0).exp() * literal(0.1) } else { number(0.0) };
        (pushed(&inputs.gradient, &times(force, &fibre)), Vec::new())
    }
}

/// The laws that a check must never call wrong.
pub fn laws() -> Vec<Box<dyn Formula>> {
    use super::shipped::{DruckerPrager, J2Finite, Maxwell};
    vec![
        Box::new(J2 { name: "J2, perfect", ..STEEL }),
        Box::new(J2 { name: "J2, linear hardening", linear: 2000.0, ..STEEL }),
        Box::new(VOCE),
        Box::new(J2 { name: "J2, kinematic", linear: 500.0, kinematic: 5000.0, ..STEEL }),
        Box::new(J2 { name: "viscoplastic", linear: 500.0, viscosity: 400.0, exponent: 0.5, ..STEEL }),
        Box::new(J2Finite),
        Box::new(DruckerPrager),
        Box::new(Softening { name: "damage", onset: 1e-3, ductility: 0.02 }),
        Box::new(Softening { name: "late damage", onset: 0.8, ductility: 1.0 }),
        Box::new(Maxwell),
        Box::new(Norton),
        Box::new(Crystal),
        Box::new(Fibres),
    ]
}

/// How a tangent is written.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Written {
    Exactly,
    /// By forward differences with h.
    Forward(f64),
    /// With literals in single precision.
    Single,
    /// Of a law whose local iteration ends at this tolerance.
    Loose(f64),
}

/// A right law with its tangent.
pub struct Right<'a> {
    pub formula: &'a dyn Formula,
    pub written: Written,
}

impl Right<'_> {
    /// Stress, as a tensor, and state.
    fn answer(&self, step: &Step) -> (Tensor, Vec<f64>) {
        TOLERANCE.set(if let Written::Loose(tolerance) = self.written { tolerance } else { 0.0 });
        let (stress, state) = constants(step, &self.convention());
        let (sigma, state) = self.formula.respond(&plain(step, &stress, &state), Flow::Algorithmic);
        TOLERANCE.set(0.0);
        (value(&sigma), state)
    }

    /// (σ(Δε + h B) − σ)/h, or (τ(F + h B F) − τ)/(J h).
    fn forward(&self, step: &Step, h: f64) -> Matrix {
        let convention = self.convention();
        let at = |step: &Step| self.answer(step).0;
        let column = |k: usize| {
            let b = unit_strain(&convention, k);
            let [value, perturbed] = if self.formula.incremental() {
                let grown = Step { strain_increment: tensor::sum(&step.strain_increment, h, &b), ..step.clone() };
                [at(step), at(&grown)]
            } else {
                let gradient = tensor::sum(&step.gradient, h, &tensor::product(&b, &step.gradient));
                let ratio = tensor::determinant(&gradient) / tensor::determinant(&step.gradient);
                [at(step), tensor::scaled(ratio, &at(&with_gradient(step, &gradient).unwrap()))]
            };
            convention.stress.vector(&tensor::scaled(1.0 / h, &tensor::sum(&perturbed, -1.0, &value)))
        };
        Matrix::from_columns(6, &(0..6).map(column).collect::<Vec<_>>())
    }
}

impl Law for Right<'_> {
    fn name(&self) -> String {
        format!("{}, {:?}", self.formula.name(), self.written)
    }
    fn convention(&self) -> Convention {
        Convention::abaqus(if self.formula.incremental() { Measure::CauchyByStrain } else { Measure::JaumannKirchhoff })
    }
    fn state_at_rest(&self) -> Vec<f64> {
        self.formula.state_at_rest()
    }
    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let (sigma, state) = self.answer(step);
        let stress = stress_vector(&self.convention(), &sigma, &step.gradient).map_err(|e| CallFailed(e.0))?;
        let exact = || right(self.formula, step, &self.convention(), Flow::Algorithmic);
        let tangent = match self.written {
            Written::Forward(h) => self.forward(step, h),
            Written::Single => {
                SINGLE.set(true);
                let tangent = exact();
                SINGLE.set(false);
                tangent
            }
            Written::Loose(tolerance) => {
                TOLERANCE.set(tolerance);
                let tangent = exact();
                TOLERANCE.set(0.0);
                tangent
            }
            Written::Exactly => exact(),
        };
        Ok(Response { stress, tangent, state })
    }
    fn stress(&mut self, step: &Step) -> Result<Vec<f64>, CallFailed> {
        stress_vector(&self.convention(), &self.answer(step).0, &step.gradient).map_err(|e| CallFailed(e.0))
    }
}
