//! Roads: how a law is perturbed so that its response measures the tangent that it claims.
//!
//! A law of F is perturbed through F₁, and every other kinematic input of the step follows: Δε = ln ΔV, ΔR of F₁ F₀⁻¹ = ΔV ΔR, and the
//! turned strain. A law of Δε may also be perturbed through Δε alone, with ΔR and F frozen. Column k belongs to the unit strain B_k.
//!
//! | measure | F₁ grows to | derivative of |
//! |---|---|---|
//! | Jaumann rate of Kirchhoff's stress over J | exp(h B) F₁ | (J/J₁) σ |
//! | Jaumann rate of Cauchy's stress | exp(h B) F₁ | σ |
//! | Truesdell | exp(h B) F₁ | (J/J₁) e^(−h B) σ e^(−h B) |
//! | Green–Naghdi | exp(h B) F₁ | (J/J₁) Qᵀ σ Q, Q = R R₁ᵀ |
//! | ∂S/∂E | F₁ + h F₁⁻ᵀ B | S |
//! | ∂P/∂F, ∂σ/∂F, ∂τ/∂F | F₁ + h B | P, σ, τ |
//! | ∂σ/∂Δε | exp(ln ΔV + h B) ΔR F₀ | σ |
//!
//! Through Δε alone: Δε + h B, and the derivative of σ; for the Jaumann rate of Kirchhoff's stress, of e^(h tr B) σ.

mod cause;
mod check;
mod objectivity;
mod observations;
mod ranges;

pub use check::check_law;

use crate::convention::{Convention, Measure, Tensor, unit_strain};
use crate::law::{CallFailed, Law, Response, Step};
use crate::listed::listed;
use crate::tensor::{
    IDENTITY, ZERO, determinant, exponential, finite, inverse, logarithm, polar, product, product3, scaled, sum, trace,
    transposed,
};

/// A way to perturb a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Road {
    /// F₁ changes, and Δε, ΔR and the turned strain follow.
    Gradient,
    /// Δε changes; ΔR and F are frozen.
    Strain,
}

impl Road {
    /// The road in words.
    pub fn words(self) -> &'static str {
        match self {
            Road::Gradient => "through F",
            Road::Strain => "through the strain increment",
        }
    }
}

listed! {
    /// An input of a step that a law may read.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    Input, words "The input in words, with its name in Abaqus.":
    StrainIncrement "the strain increment (DSTRAN)",
    Strain "the strain (STRAN)",
    Gradient "F at the end of the step (DFGRD1)",
    GradientBefore "F at the start of the step (DFGRD0)",
    Rotation "the rotation increment (DROT)",
    Stress "the stress at the start of the step (STRESS)",
    State "the internal variables (STATEV)",
    Length "the time increment (DTIME)",
    Time "the time (TIME)",
}

/// A general small strain, without an aligned axis; plane if asked for.
fn probe(plane: bool) -> Tensor {
    let out = if plane { 0.0 } else { 1.0 };
    scaled(1e-3, &[[0.7, 0.31, 0.23 * out], [0.31, -0.4, -0.17 * out], [0.23 * out, -0.17 * out, 0.2]])
}

/// The step with one input changed and all others as they are.
fn changed(step: &Step, input: Input, plane: bool) -> Step {
    let mut step = step.clone();
    let strain = probe(plane);
    let growth = exponential(&strain);
    match input {
        Input::StrainIncrement => step.strain_increment = sum(&step.strain_increment, 1.0, &strain),
        Input::Strain => step.strain = sum(&step.strain, 1.0, &strain),
        Input::Gradient => step.gradient = product(&growth, &step.gradient),
        Input::GradientBefore => step.gradient_before = product(&growth, &step.gradient_before),
        Input::Rotation => {
            step.rotation = product(&exponential(&[[0.0, -0.01, 0.0], [0.01, 0.0, 0.0], [0.0; 3]]), &step.rotation);
        }
        Input::Stress => {
            let size = step.stress.iter().fold(0.0_f64, |size, value| size.max(value.abs())).max(1e-3);
            for (k, value) in step.stress.iter_mut().enumerate() {
                *value += 1e-3 * size * (1.0 + 0.3 * k as f64);
            }
        }
        Input::State => {
            for value in &mut step.state {
                *value += 1e-3 * value.abs().max(1e-2);
            }
        }
        Input::Length => step.length *= 1.1,
        Input::Time => step.time += 0.1 * step.length,
    }
    step
}

/// The inputs on which the stress of a law depends in this step: those whose change alone changes the stress or makes the call fail.
///
/// # Errors
/// The law does not answer the step as it is.
pub fn inputs_read(law: &mut dyn Law, step: &Step) -> Result<Vec<Input>, CallFailed> {
    let plane = law.convention().plane();
    let stress = law.stress(step)?;
    let mut read = Vec::new();
    for input in Input::ALL {
        let answer = law.stress(&changed(step, input, plane));
        if answer.is_ok_and(|changed| changed == stress) {
            continue;
        }
        read.push(input);
    }
    Ok(read)
}

/// The roads for a law that reads these inputs. Through Δε alone only σ is measured, so that other measures go through F.
pub fn roads(inputs: &[Input], measure: Measure) -> Vec<Road> {
    let by_strain = matches!(measure, Measure::CauchyByStrain | Measure::JaumannKirchhoff | Measure::JaumannCauchy);
    let reads_gradient = inputs.contains(&Input::Gradient);
    match (inputs.contains(&Input::StrainIncrement) && by_strain, reads_gradient) {
        (true, true) => vec![Road::Gradient, Road::Strain],
        (true, false) => vec![Road::Strain],
        (false, _) => vec![Road::Gradient],
    }
}

/// So many steps, from all over the paths, show which inputs a law reads and whether it is objective.
const PROBED: usize = 6;

/// A body along a path: what a step hands to the next.
#[derive(Clone, Debug)]
pub struct History {
    /// The time.
    pub time: f64,
    /// The number of steps done.
    pub steps: usize,
    /// F.
    pub gradient: Tensor,
    /// The accumulated strain, in the axes of the last step.
    pub strain: Tensor,
    /// The stress as the law returned it.
    pub stress: Vec<f64>,
    /// The internal variables.
    pub state: Vec<f64>,
}

impl History {
    /// A body at rest, without stress.
    pub fn at_rest(law: &dyn Law) -> Self {
        let stress = vec![0.0; law.convention().stress.count()];
        Self { time: 0.0, steps: 0, gradient: IDENTITY, strain: ZERO, stress, state: law.state_at_rest() }
    }

    /// The step to a deformation gradient in a time Δt; `None` unless det F > 0.
    pub fn step_to(&self, gradient: &Tensor, length: f64) -> Option<Step> {
        let mut step = Step {
            time: self.time,
            length,
            number: self.steps + 1,
            gradient_before: self.gradient,
            gradient: self.gradient,
            strain: self.strain,
            stress: self.stress.clone(),
            state: self.state.clone(),
            ..Step::at_rest()
        };
        step.turn_to(gradient).then_some(step)
    }

    /// The body before a step, in the axes at its end.
    fn before(step: &Step) -> Self {
        let Step { time, number, gradient_before, strain, ref stress, ref state, .. } = *step;
        let [stress, state] = [stress.clone(), state.clone()];
        Self { time, steps: number.saturating_sub(1), gradient: gradient_before, strain, stress, state }
    }

    /// The body after a step with its response.
    pub fn after(step: &Step, response: &Response) -> Self {
        Self {
            time: step.time + step.length,
            steps: step.number,
            gradient: step.gradient,
            strain: sum(&step.strain, 1.0, &step.strain_increment),
            stress: response.stress.clone(),
            state: response.state.clone(),
        }
    }
}

/// A step of a path with its response.
#[derive(Clone, Debug)]
struct Visit {
    name: String,
    step: Step,
    response: Response,
    /// The visit one step earlier on the same path.
    before: Option<usize>,
}

/// The step to another F₁: Δε = ln ΔV, ΔR, and the turned strain follow. `None` unless det F₁ > 0.
pub fn with_gradient(step: &Step, gradient: &Tensor) -> Option<Step> {
    let mut step = step.clone();
    step.turn_to(gradient).then_some(step)
}

impl Step {
    /// Changes F₁; Δε = ln ΔV, ΔR, and the turned strain follow. False, with the step unchanged, unless det F₁ > 0.
    pub fn turn_to(&mut self, gradient: &Tensor) -> bool {
        let increment = inverse(&self.gradient_before).map(|inverse| product(gradient, &inverse));
        let Some((rotation, stretch)) = increment.and_then(|increment| polar(&increment)) else { return false };
        let strain_increment = logarithm(&stretch);
        if !finite(&strain_increment) {
            return false;
        }
        let turn = product(&rotation, &transposed(&self.rotation));
        self.strain = product3(&turn, &self.strain, &transposed(&turn));
        (self.gradient, self.strain_increment, self.rotation) = (*gradient, strain_increment, rotation);
        true
    }
}

/// A response as a function of the perturbation: column k perturbed by h.
pub struct Perturbed<'a> {
    law: &'a mut dyn Law,
    convention: Convention,
    step: &'a Step,
    road: Road,
    /// Whether F₁ grows to (I + h B) F₁ in place of exp(h B) F₁, as users perturb it for forward differences.
    linear: bool,
}

impl<'a> Perturbed<'a> {
    /// A law in a step, perturbed on a road.
    pub fn new(law: &'a mut dyn Law, step: &'a Step, road: Road) -> Self {
        let convention = law.convention();
        Self { law, convention, step, road, linear: false }
    }

    /// The stress whose derivative by h is column k of the tangent, in the components of the law.
    ///
    /// # Errors
    /// The call failed, or the perturbed F has no positive determinant.
    pub fn value(&mut self, column: usize, h: f64) -> Result<Vec<f64>, CallFailed> {
        let strain = unit_strain(&self.convention, column);
        let step = self.perturbed(&strain, h)?;
        let stress = self.law.stress(&step)?;
        self.rated(&strain, h, &step, stress)
    }

    /// The greatest component of the strain increment.
    pub fn size(&self) -> f64 {
        self.step.strain_increment.as_flattened().iter().fold(0.0, |most: f64, x| most.max(x.abs()))
    }

    /// The stress after the part s of the step, in the components of the law: 1 is the whole step.
    ///
    /// # Errors
    /// The call failed, or F has no positive determinant there.
    pub fn part(&mut self, s: f64) -> Result<Vec<f64>, CallFailed> {
        let step = match self.road {
            Road::Strain => {
                Some(Step { strain_increment: scaled(s, &self.step.strain_increment), ..self.step.clone() })
            }
            Road::Gradient => {
                let [before, after] = [&self.step.gradient_before, &self.step.gradient];
                with_gradient(self.step, &sum(&scaled(s, after), 1.0 - s, before))
            }
        };
        let step = step.ok_or_else(|| CallFailed(format!("The part {s} of the step left no F with det F > 0.")))?;
        Ok(self.law.respond(&step)?.stress)
    }

    /// The step with column k perturbed by h.
    ///
    /// # Errors
    /// The perturbed F has no positive determinant.
    pub fn step(&self, column: usize, h: f64) -> Result<Step, CallFailed> {
        self.perturbed(&unit_strain(&self.convention, column), h)
    }

    fn perturbed(&self, strain: &Tensor, h: f64) -> Result<Step, CallFailed> {
        let step = self.step;
        if self.road == Road::Strain {
            return Ok(Step { strain_increment: sum(&step.strain_increment, h, strain), ..step.clone() });
        }
        let gradient = match self.convention.measure {
            measure if measure.by_gradient() => Some(sum(&step.gradient, h, strain)),
            Measure::SecondPiolaByGreen => {
                let grown = |inverse: Tensor| sum(&step.gradient, h, &product(&transposed(&inverse), strain));
                inverse(&step.gradient).map(grown)
            }
            Measure::CauchyByStrain => {
                let stretch = exponential(&sum(&step.strain_increment, h, strain));
                Some(product3(&stretch, &step.rotation, &step.gradient_before))
            }
            _ if self.linear => Some(product(&sum(&IDENTITY, h, strain), &step.gradient)),
            _ => Some(product(&exponential(&scaled(h, strain)), &step.gradient)),
        };
        let step = gradient.and_then(|gradient| with_gradient(step, &gradient));
        step.ok_or_else(|| CallFailed(format!("A perturbation by {h:e} left no F with det F > 0.")))
    }

    /// The stress, convected so that its derivative is the rate of the measure.
    fn rated(&self, strain: &Tensor, h: f64, step: &Step, stress: Vec<f64>) -> Result<Vec<f64>, CallFailed> {
        let measure = self.convention.measure;
        let ratio = match self.road {
            Road::Gradient => determinant(&step.gradient) / determinant(&self.step.gradient),
            Road::Strain => (h * trace(strain)).exp(),
        };
        match measure {
            Measure::JaumannKirchhoff => Ok(stress.iter().map(|value| ratio * value).collect()),
            Measure::Truesdell => {
                let back = exponential(&scaled(-h, strain));
                Ok(self.turned(&back, ratio, &stress))
            }
            Measure::GreenNaghdi => {
                let failed = || CallFailed("F has no polar decomposition.".to_string());
                let (first, _) = polar(&self.step.gradient).ok_or_else(failed)?;
                let (second, _) = polar(&step.gradient).ok_or_else(failed)?;
                Ok(self.turned(&product(&first, &transposed(&second)), ratio, &stress))
            }
            _ => Ok(stress),
        }
    }

    /// s A σ Aᵀ, in the components of the law.
    fn turned(&self, a: &Tensor, s: f64, stress: &[f64]) -> Vec<f64> {
        let components = &self.convention.stress;
        let turned = product3(a, &components.symmetric_tensor(stress), &transposed(a));
        components.vector(&scaled(s, &turned))
    }
}
