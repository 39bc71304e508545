//! Laws from shared libraries: UMATs, MFront's behaviours, and laws in C.
//!
//! Such a law is a black box of three dimensions. It takes F at the start and at the end of a step, and its own stress and internal variables
//! at the start. It gives stress, internal variables and a tangent, in a convention of its own. The tangent of Newton's method is the tangent
//! that the law claims, converted exactly to ℂ = ∂S/∂E:
//!
//! S(E) = S₀ + ℂ : (E − E₀)
//!
//! with S₀, ℂ and E₀ of the call. For plain numbers this is S₀. For dual numbers it carries ℂ.

mod parameters;

pub(super) use parameters::Outside;
pub use parameters::{CLawParameters, InternalVariables, MfrontParameters, TangentOf, UmatParameters, allow_library};

use super::closed_tangent::{rows, tensor};
use super::{InternalVariable, Law, MaterialState, TangentBlocks};
use crate::parallel::held;
use crate::scalar::Real;
use crate::tensor::{Tensor, Vector, contract, cut, embed, outer, symmetric};
use std::any::TypeId;
use std::fmt;
use std::sync::{Arc, Mutex};
use tangent_check::convention::{self, Components, Configuration, Convention, ConversionFailed, Measure};
use tangent_check::finding::{Entry, Verdict};
use tangent_check::judge::check_columns;
use tangent_check::law::{CallFailed, Response, Step};
use tangent_check::library::{Caller, Description, Signature, empty_response, open};
use tangent_check::matrix::Matrix;

/// A law from a shared library. Threads call it at the same time, so it must not keep data between calls.
#[derive(Clone)]
pub struct Foreign {
    calls: Arc<Calls>,
    symmetric: bool,
}

/// The library, and the data that calls need.
struct Calls {
    description: Description,
    signature: Signature,
    /// ∂S/∂E in the components that the law has.
    material: Convention,
    variables: Vec<InternalVariable>,
    /// Callers that no thread uses now. A caller has buffers of its own.
    idle: Mutex<Vec<Call>>,
    /// The sentence of the last call that failed.
    failure: Mutex<Option<String>>,
}

/// A caller with its buffers.
struct Call {
    caller: Box<dyn Caller>,
    step: Step,
    response: Response,
}

/// The internal variables of a particle: those of the law come first. The others hold the state at t_n that a law may read.
struct Stored<'a> {
    /// The law's own variables.
    own: &'a [f64],
    /// The law's stress, in its own components.
    stress: &'a [f64],
    /// The accumulated strain.
    strain: &'a [f64],
    /// F, row by row.
    gradient: &'a [f64],
    time: f64,
    /// The number of steps.
    steps: f64,
    /// The work of the stress.
    work: f64,
}

impl<'a> Stored<'a> {
    fn new(signature: &Signature, internal: &'a [f64]) -> Self {
        let (own, rest) = internal.split_at(signature.state_at_rest.len());
        let (stress, rest) = rest.split_at(signature.convention.stress.count());
        let (strain, rest) = rest.split_at(strains().count());
        let (gradient, others) = rest.split_at(9);
        Self { own, stress, strain, gradient, time: others[0], steps: others[1], work: others[2] }
    }
}

/// The components of the accumulated strain.
fn strains() -> Components {
    Components::abaqus(1.0)
}

/// The internal variables of the program, from those of the law.
fn variables(signature: &Signature) -> Vec<InternalVariable> {
    // A name lives as long as the program: a scene has a handful of laws.
    let named = |name: String, at_rest: f64| InternalVariable { name: name.leak(), at_rest };
    let own = signature.state.iter().zip(&signature.state_at_rest).map(|(name, &at_rest)| named(name.clone(), at_rest));
    let all = |what: &'static str, components: &Components| {
        let names: Vec<String> = components.names().iter().map(|name| format!("law_{what}_{name}")).collect();
        names.into_iter().map(move |name| {
            let diagonal = what == "gradient" && ["11", "22", "33"].iter().any(|end| name.ends_with(end));
            named(name, f64::from(diagonal))
        })
    };
    let stress = all("stress", &signature.convention.stress);
    let (strain, gradient) = (all("strain", &strains()), all("gradient", &Components::rows()));
    let others = ["law_time", "law_steps", "law_work"].map(|name| InternalVariable { name, at_rest: 0.0 });
    own.chain(stress).chain(strain).chain(gradient).chain(others).collect()
}

fn failed(error: ConversionFailed) -> CallFailed {
    CallFailed(error.0)
}

impl Calls {
    /// The response to F at the end of a step of length Δt, from the internal variables at its start. `None` if the call fails.
    fn respond<R>(
        &self,
        f: &convention::Tensor,
        dt: f64,
        internal: &[f64],
        read: impl FnOnce(&Step, &Response) -> Result<R, CallFailed>,
    ) -> Option<R> {
        let idle = held(&self.idle).pop();
        let result = idle.map_or_else(|| self.new_call(), Ok).and_then(|mut call| {
            let result = self.start(&mut call.step, f, dt, internal).and_then(|()| {
                call.caller.call(&call.step, &mut call.response)?;
                read(&call.step, &call.response)
            });
            held(&self.idle).push(call);
            result
        });
        result.map_err(|CallFailed(sentence)| *held(&self.failure) = Some(sentence)).ok()
    }

    fn new_call(&self) -> Result<Call, CallFailed> {
        Ok(Call { caller: open(&self.description)?, step: Step::at_rest(), response: empty_response() })
    }

    /// Writes the inputs of a step.
    fn start(&self, step: &mut Step, f: &convention::Tensor, dt: f64, internal: &[f64]) -> Result<(), CallFailed> {
        let stored = Stored::new(&self.signature, internal);
        stored.own.clone_into(&mut step.state);
        stored.stress.clone_into(&mut step.stress);
        step.strain = strains().symmetric_tensor(stored.strain);
        step.gradient_before = Components::rows().full_tensor(stored.gradient);
        step.rotation = tangent_check::tensor::IDENTITY;
        step.time = stored.time;
        step.length = dt;
        // Laws may prepare their variables in the first step.
        step.number = 1 + stored.steps as usize;
        if step.turn_to(f) { Ok(()) } else { Err(CallFailed("F has no polar decomposition.".to_owned())) }
    }

    /// S of a stress of the law at F.
    fn second_piola(&self, f: &convention::Tensor, stress: &[f64]) -> Result<Tensor<f64, 3>, CallFailed> {
        let cauchy = convention::cauchy_stress(&self.signature.convention, stress, f).map_err(failed)?;
        let vector = convention::stress_vector(&self.material, &cauchy, f).map_err(failed)?;
        Ok(tensor(&self.material.stress.symmetric_tensor(&vector)))
    }

    /// ℂ = ∂S/∂E at the end of a step.
    fn moduli(&self, step: &Step, response: &Response) -> Result<Matrix, CallFailed> {
        let stress = convention::cauchy_stress(&self.signature.convention, &response.stress, &step.gradient);
        let at = Configuration {
            gradient_before: step.gradient_before,
            gradient: step.gradient,
            stress: stress.map_err(failed)?,
        };
        convention::convert(&response.tangent, &self.signature.convention, &self.material, &at).map_err(failed)
    }

    /// ℂ : X for a symmetric X.
    fn contract<T: Real>(&self, moduli: &Matrix, x: &Tensor<T, 3>) -> Tensor<T, 3> {
        let Convention { stress, strain, .. } = &self.material;
        let mut out = Tensor::zeros();
        for (row, &(i, j)) in stress.pairs.iter().enumerate() {
            for (column, &(k, l)) in strain.pairs.iter().enumerate() {
                out[(i, j)] += x[(k, l)] * T::lit(moduli[(row, column)] * strain.factor(column));
            }
            out[(j, i)] = out[(i, j)];
        }
        out
    }
}

/// F in three dimensions: the missing stretches are 1.
fn gradient<T: Real, const D: usize>(at: &MaterialState<T, D>) -> convention::Tensor {
    rows(&(Tensor::identity() + embed(&at.h.map(Real::value))))
}

impl Foreign {
    /// Opens the library. `symmetric` says that the tangent of the law has major symmetry.
    ///
    /// # Errors
    /// A sentence that says why the library cannot be used.
    pub(crate) fn open(description: Description, symmetric: bool) -> Result<Self, CallFailed> {
        let caller = open(&description)?;
        let signature = caller.signature().clone();
        let components: fn(f64) -> Components =
            if signature.convention.plane() { Components::abaqus_plane } else { Components::abaqus };
        let material =
            Convention { measure: Measure::SecondPiolaByGreen, stress: components(1.0), strain: components(2.0) };
        let variables = variables(&signature);
        let first = Call { caller, step: Step::at_rest(), response: empty_response() };
        let idle = Mutex::new(vec![first]);
        let calls = Calls { description, signature, material, variables, idle, failure: Mutex::new(None) };
        Ok(Self { calls: Arc::new(calls), symmetric })
    }

    /// The internal variables at t_n; those of a body at rest for a state that has none.
    fn internal<'a, T: Real, const D: usize>(&self, at: &MaterialState<'a, T, D>) -> std::borrow::Cow<'a, [f64]> {
        if at.internal.len() == self.calls.variables.len() {
            return at.internal.into();
        }
        self.calls.variables.iter().map(|one| one.at_rest).collect()
    }

    /// S and, for numbers that carry derivatives, ℂ.
    fn respond<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Option<(Tensor<f64, 3>, Option<Matrix>)> {
        let (calls, internal, f) = (&*self.calls, self.internal(at), gradient(at));
        let stored = Stored::new(&calls.signature, &internal);
        let plain = TypeId::of::<T>() == TypeId::of::<f64>();
        // At t_n itself the stress is known, and the law is not called: a step without a length may divide by it.
        if plain && at.dt == 0.0 && f.as_flattened() == stored.gradient {
            return Some((calls.second_piola(&f, stored.stress).ok()?, None));
        }
        calls.respond(&f, at.dt, &internal, |step, response| {
            let stress = calls.second_piola(&f, &response.stress)?;
            Ok((stress, if plain { None } else { Some(calls.moduli(step, response)?) }))
        })
    }

    /// ℂ at a state; NaN if the call fails.
    fn moduli<const D: usize>(&self, at: &MaterialState<f64, D>) -> Matrix {
        let (calls, internal) = (&*self.calls, self.internal(at));
        let moduli = calls.respond(&gradient(at), at.dt, &internal, |step, response| calls.moduli(step, response));
        moduli.unwrap_or_else(|| {
            let count = calls.material.stress.count();
            Matrix { rows: count, columns: count, entries: vec![f64::NAN; count * count] }
        })
    }
}

impl Law for Foreign {
    /// W of the last step, plus ½ (P_n + P) : (F − F_n): the work of the stress, of which the law may dissipate a part.
    fn energy<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> T {
        let (calls, internal) = (&*self.calls, self.internal(at));
        let stored = Stored::new(&calls.signature, &internal);
        let f_n = Components::rows().full_tensor(stored.gradient);
        let before = calls.second_piola(&f_n, stored.stress).ok();
        let Some((before, (stress, _))) = before.zip(self.respond(at)) else { return T::lit(f64::NAN) };
        let (f, f_n) = (tensor(&gradient(at)), tensor(&f_n));
        let work = 0.5 * contract(&(f_n * before + f * stress), &(f - f_n));
        let strain = embed::<T, D>(&at.green_lagrange());
        let moved = strain - strain.map(|x| T::lit(x.value()));
        T::lit(stored.work + work) + contract(&stress.map(T::lit), &moved)
    }

    fn stress<T: Real, const D: usize>(&self, at: &MaterialState<T, D>) -> Tensor<T, D> {
        let Some((stress, moduli)) = self.respond(at) else { return Tensor::from_element(T::lit(f64::NAN)) };
        let stress = cut(&stress.map(T::lit));
        let Some(moduli) = moduli else { return stress };
        let strain = embed::<T, D>(&at.green_lagrange());
        stress + cut(&self.calls.contract(&moduli, &(strain - strain.map(|x| T::lit(x.value())))))
    }

    fn elasticity<const D: usize>(&self, at: &MaterialState<f64, D>, x: &Tensor<f64, D>) -> Tensor<f64, D> {
        cut(&self.calls.contract(&self.moduli(at), &embed(&symmetric(x))))
    }

    /// F ℂmat{F_rᵀe_k, F_rᵀe_l} Fᵀ from one call: column j of ℂmat{v, b} is [ℂ:(e_j ⊗ b)] v.
    fn tangent_blocks<const D: usize>(&self, f_r: &Tensor<f64, D>, at: &MaterialState<f64, D>) -> TangentBlocks<D> {
        let moduli = self.moduli(at);
        let unit = |k: usize| f_r.row(k).transpose();
        let turned: [[Tensor<f64, D>; D]; D] = std::array::from_fn(|l| {
            std::array::from_fn(|j| {
                let e_j = Vector::<f64, D>::from_fn(|i, _| f64::from(i == j));
                cut(&self.calls.contract(&moduli, &embed(&symmetric(&outer(&e_j, &unit(l))))))
            })
        });
        let density = |k: usize, l: usize| {
            let mut density = Tensor::<f64, D>::zeros();
            (0..D).for_each(|j| density.set_column(j, &(turned[l][j] * unit(k))));
            density
        };
        std::array::from_fn(|k| std::array::from_fn(|l| at.f * density(k, l) * at.f.transpose()))
    }

    fn internal_variables(&self) -> &[InternalVariable] {
        &self.calls.variables
    }

    fn update_variables<const D: usize>(&self, at: &MaterialState<f64, D>, variables: &mut [f64]) {
        let (calls, internal, f) = (&*self.calls, self.internal(at), gradient(at));
        let stored = Stored::new(&calls.signature, &internal);
        let work = self.energy(at);
        let next = calls.respond(&f, at.dt, &internal, |step, response| {
            let strain = tangent_check::tensor::sum(&step.strain, 1.0, &step.strain_increment);
            let mut next = [&response.state[..], &response.stress[..], &strains().vector(&strain)].concat();
            next.extend(f.as_flattened());
            next.extend([stored.time + at.dt, stored.steps + 1.0, work]);
            Ok(next)
        });
        let next = next.unwrap_or_else(|| vec![f64::NAN; variables.len()]);
        variables.iter_mut().zip(next).for_each(|(variable, next)| *variable = next);
    }

    fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    fn has_potential(&self) -> bool {
        false
    }

    /// ∂P/∂F = δF S + F [ℂ : sym(Fᵀ δF)] with the claimed ℂ, column by column, against differences of P = F S.
    fn check_claim<const D: usize>(&self, at: &MaterialState<f64, D>) -> Result<(), String> {
        let unit = |index: usize| (index / D, index % D);
        let delta = |column: usize| Tensor::<f64, D>::from_fn(|i, k| f64::from((i, k) == unit(column)));
        let rows = |piola: &Tensor<f64, D>| (0..D * D).map(|index| piola[unit(index)]).collect::<Vec<f64>>();
        let (stress, moduli) = (self.stress(at), self.moduli(at));
        let mut claimed = Matrix::zeros(D * D, D * D);
        for column in 0..D * D {
            let strain = embed(&symmetric(&(at.f.transpose() * delta(column))));
            let change = delta(column) * stress + at.f * cut::<f64, D>(&self.calls.contract(&moduli, &strain));
            rows(&change).iter().enumerate().for_each(|(row, x)| claimed[(row, column)] = *x);
        }
        let mut perturbed = |column: usize, h: f64| {
            let moved = at.deformed(at.h + delta(column) * h).admissible();
            let moved = moved.map_err(|error| CallFailed(error.to_string()))?;
            Ok(rows(&(moved.f * self.stress(&moved))))
        };
        let finding = check_columns("", &claimed, &rows(&(at.f * stress)), &mut perturbed);
        let Some(Entry { row, column, claimed, measured, error }) =
            finding.worst.filter(|_| finding.verdict == Verdict::Wrong)
        else {
            return Ok(());
        };
        let name = |index: usize| format!("{}{}", unit(index).0 + 1, unit(index).1 + 1);
        Err(format!("∂P{}/∂F{}: claimed {claimed:e}, measured {measured:e} ± {error:.0e}", name(row), name(column)))
    }

    fn last_failure(&self) -> Option<String> {
        held(&self.calls.failure).take()
    }
}

impl fmt::Debug for Foreign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { calls, symmetric } = self;
        f.debug_struct("Foreign").field("description", &calls.description).field("symmetric", symmetric).finish()
    }
}

/// Laws of the same library with the same properties.
impl PartialEq for Foreign {
    fn eq(&self, other: &Self) -> bool {
        self.calls.description == other.calls.description && self.symmetric == other.symmetric
    }
}
