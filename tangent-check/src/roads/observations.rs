//! The observations of a diagnosis: the measured tangent of each state, and for some wrong states the tangents elsewhere, such as the elastic one.

use super::{History, Perturbed, Road, Visit, probe, with_gradient};
use crate::convention::{Configuration, cauchy_stress};
use crate::diagnosis::{Elsewhere, Measured, Observation};
use crate::difference::{Estimate, Tableau};
use crate::finding::{Finding, Verdict};
use crate::law::{Law, Step};
use crate::matrix::Matrix;
use crate::tensor::{exponential, scaled};

/// In so many wrong states the tangents elsewhere are measured.
const DIAGNOSED: usize = 10;

/// Derivatives to both sides that differ by more than this, relative to the greatest entry, are a kink.
pub(super) const SIDES: f64 = 1e-6;

/// The greatest perturbation of the one-sided derivatives.
const GREATEST: f64 = 1e-4;

/// The measured states; for some wrong ones also the tangents elsewhere.
pub(super) fn observations(law: &mut dyn Law, visits: &[Visit], road: Road, findings: &[Finding]) -> Vec<Observation> {
    let convention = law.convention();
    let measured = |finding: &Finding| Measured { tangent: finding.measured.clone(), errors: finding.errors.clone() };
    let wrong: Vec<usize> = (0..visits.len()).filter(|index| findings[*index].verdict == Verdict::Wrong).collect();
    let chosen: Vec<usize> = wrong.iter().step_by(wrong.len().div_ceil(DIAGNOSED).max(1)).copied().collect();
    let flowing = if chosen.is_empty() { Vec::new() } else { flow_variables(law) };
    let rest = if chosen.is_empty() { None } else { at_rest(law, road, &flowing) };
    let heat = chosen.last().and_then(|index| thermal(law, &visits[*index], road, &findings[*index].claimed, &flowing));
    let mut observations = Vec::new();
    for (index, (visit, finding)) in visits.iter().zip(findings).enumerate() {
        let judged = matches!(finding.verdict, Verdict::Wrong | Verdict::Consistent | Verdict::Inexact)
            && (wrong.is_empty() || smooth(law, &visit.step, road, finding));
        let Some(stress) =
            cauchy_stress(&convention, &visit.response.stress, &visit.step.gradient).ok().filter(|_| judged)
        else {
            continue;
        };
        let [gradient_before, gradient] = [visit.step.gradient_before, visit.step.gradient];
        let mut elsewhere = Vec::new();
        if let Some(before) = visit.before {
            elsewhere.push((Elsewhere::StepBefore, measured(&findings[before])));
        }
        elsewhere.extend(rest.clone().map(|rest| (Elsewhere::AtRest, rest)));
        if chosen.contains(&index) {
            let heated = heat.and_then(|strain| heated(law, visit, road, strain, &flowing));
            elsewhere.extend(heated.map(|heated| (Elsewhere::Heated, heated)));
            let history = History::after(&visit.step, &visit.response);
            let start = History::before(&visit.step);
            let sides = both_sides(law, &start, visit.step.length, road, &flowing);
            elsewhere.extend(sides.map(|[elastic, _]| (Elsewhere::StartOfStep, elastic)));
            if let Some([elastic, continuum]) = both_sides(law, &history, visit.step.length, road, &flowing) {
                elsewhere.extend([(Elsewhere::Elastic, elastic), (Elsewhere::Continuum, continuum)]);
            }
        }
        let at = Configuration { gradient_before, gradient, stress };
        let claimed = finding.claimed.clone();
        observations.push(Observation {
            name: visit.name.clone(),
            at,
            rotation: visit.step.rotation,
            claimed,
            measured: measured(finding),
            elsewhere,
        });
    }
    observations
}

/// Whether the derivatives to both sides are the measured one. At a kink the law may rightly claim either of them, so that the state
/// tells nothing about a mistake.
fn smooth(law: &mut dyn Law, step: &Step, road: Road, finding: &Finding) -> bool {
    let (measured, errors) = (&finding.measured, &finding.errors);
    let mut perturbed = Perturbed::new(law, step, road);
    (0..measured.columns).all(|column| {
        [1.0, -1.0].into_iter().all(|sign| {
            let side = one_sided(sign, &mut |h| perturbed.value(column, h).ok());
            side.is_some_and(|Estimate { value: derivative, error }| {
                (0..measured.rows).all(|row| {
                    let tolerance = SIDES * measured.greatest() + 10.0 * (errors[(row, column)] + error[row]);
                    (derivative[row] - measured[(row, column)]).abs() <= tolerance
                })
            })
        })
    })
}

/// The tangent at rest.
fn at_rest(law: &mut dyn Law, road: Road, flowing: &[usize]) -> Option<Measured> {
    let history = History::at_rest(law);
    both_sides(law, &history, 1.0, road, flowing).map(|[elastic, _]| elastic)
}

/// The tangent in the state of a visit with a thermal strain s I.
fn heated(law: &mut dyn Law, visit: &Visit, road: Road, s: f64, flowing: &[usize]) -> Option<Measured> {
    let step = with_gradient(&visit.step, &scaled(s.exp(), &visit.step.gradient))?;
    let history = History::after(&step, &law.respond(&step).ok()?);
    both_sides(law, &history, step.length, road, flowing).map(|[elastic, _]| elastic)
}

/// The thermal strain s I with which a tangent is the claimed one, by Newton's method; `None` if there is none.
fn thermal(law: &mut dyn Law, visit: &Visit, road: Road, claimed: &Matrix, flowing: &[usize]) -> Option<f64> {
    const PROBE: f64 = 1e-4;
    let (mut s, mut before) = (0.0, f64::INFINITY);
    for _ in 0..6 {
        let [at, next] = [s, s + PROBE].map(|s| heated(law, visit, road, s, flowing));
        let (Measured { tangent: at, errors }, next) = (at?, next?.tangent);
        let rest = at.mapped(|i, j| claimed[(i, j)] - at[(i, j)]);
        if rest.greatest() <= errors.greatest() {
            break;
        }
        if rest.greatest() > 0.5 * before {
            return None;
        }
        before = rest.greatest();
        let slopes = next.entries.iter().zip(&at.entries).map(|(next, at)| (next - at) / PROBE);
        let [product, square] = slopes.zip(&rest.entries).fold([0.0; 2], |[p, q], (a, b)| [p + a * b, q + a * a]);
        s += product / square;
    }
    (s.is_finite() && s != 0.0).then_some(s)
}

/// The internal variables that change by flow alone: a small general strain from rest leaves them as they are.
fn flow_variables(law: &mut dyn Law) -> Vec<usize> {
    let history = History::at_rest(law);
    let strain = probe(law.convention().plane());
    let step = history.step_to(&exponential(&scaled(1e-3, &strain)), 1e-10);
    let state = step.and_then(|step| law.respond(&step).ok()).map(|response| response.state).unwrap_or_default();
    (0..state.len().min(history.state.len())).filter(|k| state[*k] == history.state[*k]).collect()
}

/// The one-sided derivatives of a step of no deformation and nearly no time: on the side without flow (elastic), and on the other
/// (continuum). A column in which both sides flow, as at an apex, has no elastic side: its errors are infinite. `None` if a call fails.
fn both_sides(
    law: &mut dyn Law,
    history: &History,
    length: f64,
    road: Road,
    flowing: &[usize],
) -> Option<[Measured; 2]> {
    let step = history.step_to(&history.gradient, 1e-10 * length)?;
    let convention = law.convention();
    let [rows, columns] = [convention.stress.count(), convention.strain.count()];
    let zeros = Measured { tangent: Matrix::zeros(rows, columns), errors: Matrix::zeros(rows, columns) };
    let mut sides = [zeros.clone(), zeros];
    for column in 0..columns {
        let forward = changes(law, &step, road, (column, GREATEST))?;
        let backward = changes(law, &step, road, (column, -GREATEST))?;
        // Damage grows from the first strain on, but rests while the body is unloaded.
        let by_flow = |k: &usize| flowing.contains(k) || forward[*k] != backward[*k];
        let by_flow: Vec<usize> = (0..forward.len()).filter(by_flow).collect();
        let [forward, backward] = [forward, backward].map(|changes| by_flow.iter().any(|k| changes[*k]));
        let elastic = if forward { -1.0 } else { 1.0 };
        for (side, sign) in sides.iter_mut().zip([elastic, -elastic]) {
            let mut perturbed = Perturbed::new(law, &step, road);
            let Estimate { value, error } = one_sided(sign, &mut |h| perturbed.value(column, h).ok())?;
            let unknown = forward && backward && sign == elastic;
            for row in 0..rows {
                side.tangent[(row, column)] = value[row];
                side.errors[(row, column)] = if unknown { f64::INFINITY } else { error[row] };
            }
        }
    }
    Some(sides)
}

/// Whether a perturbation of a column by h changes each internal variable. `None` if a call fails or loses variables.
fn changes(law: &mut dyn Law, step: &Step, road: Road, (column, h): (usize, f64)) -> Option<Vec<bool>> {
    let perturbed = Perturbed::new(law, step, road).step(column, h).ok()?;
    let state = law.respond(&perturbed).ok()?.state;
    (state.len() == step.state.len()).then(|| state.iter().zip(&step.state).map(|(new, old)| new != old).collect())
}

/// The one-sided derivative of a vector function at 0, from h to h/64, and the error of each component.
fn one_sided(sign: f64, f: &mut dyn FnMut(f64) -> Option<Vec<f64>>) -> Option<Estimate> {
    const LEVELS: i32 = 7;
    let origin = f(0.0)?;
    let mut tableau = Tableau::new(2.0, LEVELS as usize, origin.len());
    for level in 0..LEVELS {
        let h = GREATEST * 0.5_f64.powi(level);
        let quotient: Vec<f64> = f(sign * h)?.iter().zip(&origin).map(|(a, b)| (a - b) / (sign * h)).collect();
        // Rounding of F moves the stress by ε times the tangent.
        let size = origin.iter().chain(&quotient).fold(0.0_f64, |size, entry| size.max(entry.abs()));
        tableau.add(h, quotient, &vec![4.0 * f64::EPSILON * size / h; origin.len()]);
    }
    Some(tableau.best)
}
