//! An independent minimiser of the incremental potential must find the increment of Newton's method.

use super::{Effort, Outcome, StudyError};
use crate::prepared::Prepared;
use crate::report::{Bound, Report};
use crate::shipped;
use crate::table::Table;
use argmin::core::{CostFunction, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use bfree::mechanics::residual::Equilibrium;
use bfree::material::Material;
use bfree::simulation::Simulation;
use bfree::pooled::Pool;
use bfree::solver::{BlockJacobi, Forcing, NewtonSettings, NonlinearProblem, newton};
use bfree::tensor::Vector;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "argmin minimises the potential and lands on the increment that Newton found";

/// Round-off of the difference of two values of Π, relative to the sum of the magnitudes of its n contributions.
///
/// Each value is a plain sum of n additions. Each addition is wrong by at most eps/2 of a partial sum, which the sum of the magnitudes
/// bounds. If the errors are independent and uniform, the standard deviation for both values is at most √(2n/3) eps/2. So √n eps is more
/// than two standard deviations. If all contributions have one sign, the partial sums grow from zero, and it is more than four. A
/// contribution V W has an error of about 4 eps from its own evaluation, and 4 more through H. W is of second order in H, and H is composed
/// of two gradients and so rounded to 2 eps.
fn round_off(contributions: usize) -> f64 {
    ((contributions as f64).sqrt() + 8.0) * f64::EPSILON
}

/// Pairs of vectors L-BFGS remembers.
const MEMORY: usize = 20;

/// The largest number of iterations; at the round-off of Π no improvement follows.
const MOST_ITERATIONS: u64 = 400;

/// Π and R in the variables y = √diag(K) x of the free degrees of freedom, in which the tangent has a unit diagonal.
struct Potential<'a> {
    equilibrium: &'a Equilibrium<'a, 2, Material>,
    scale: &'a [f64],
    /// Π at the start. It is subtracted, so that a constant costs no digits.
    start: f64,
}

impl Potential<'_> {
    fn increment(&self, y: &[f64]) -> Vec<f64> {
        y.iter().zip(self.scale).map(|(y, s)| y * s).collect()
    }
}

impl CostFunction for Potential<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, y: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        // For det F ≤ 0 the potential is infinite; under follower pressure there is none.
        let potential = NonlinearProblem::potential(self.equilibrium, &self.increment(y));
        Ok(potential.map_or(f64::NAN, |value| value.map_or(f64::INFINITY, |(value, _)| value - self.start)))
    }
}

impl Gradient for Potential<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, y: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        let mut r = vec![0.0; y.len()];
        NonlinearProblem::residual(self.equilibrium, &self.increment(y), &mut r)?;
        r.iter_mut().zip(self.scale).for_each(|(r, s)| *r *= s);
        Ok(r)
    }
}

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = Report::new("argmin's L-BFGS against Newton", &["quantity", "step"]);
    let mut table = Table::new(
        "steps of the rebound",
        ["step", "Newton", "products", "L-BFGS, best", "|dphi|", "|difference|", "energy norm", "bound"],
    );
    let cases: &[(f64, f64, f64)] = match effort {
        Effort::Short => &[(0.5, 21.8, 1.0), (2.5, 4.6, 0.5)],
        Effort::Full => &[(0.5, 21.8, 1.0), (0.5, 22.0, 1.0), (0.5, 22.0, 0.5), (0.5, 22.0, 0.01), (2.5, 4.6, 1.0), (2.5, 4.6, 0.5)],
    };
    for &(speed, time, lumping) in cases {
        let label = format!("v = {speed}, t = {time}, eps = {lumping}");
        case(&mut report, &mut table, &label, speed, time, lumping)?;
    }
    let remarks = vec![
        "A minimiser sees x only through Pi, whose round-off is d = (sqrt(n) + 8) eps times the sum of the magnitudes of its n contributions: with Pi = Pi_min + \
         e.Ke/2 that is an error of sqrt(2 d) in the energy norm sqrt(e.Ke), whatever the condition of K. That is the bound."
            .into(),
    ];
    Ok(Outcome { reports: vec![report], tables: vec![table], remarks, ..Outcome::default() })
}

/// Π and the sum of the magnitudes of its contributions.
fn potential(equilibrium: &Equilibrium<'_, 2, Material>, x: &[f64]) -> Result<(f64, f64), StudyError> {
    match NonlinearProblem::potential(equilibrium, x) {
        Some(value) => Ok(value?),
        None => Err("a follower pressure has no potential".into()),
    }
}

fn case(
    report: &mut Report,
    table: &mut Table,
    label: &str,
    speed: f64,
    time: f64,
    lumping: f64,
) -> Result<(), StudyError> {
    let overrides = [format!("bodies.0.velocity=[{speed},0]"), format!("time.lumping={lumping}")];
    let mut simulation: Simulation<2> = shipped::scene("rebound", &overrides.each_ref().map(String::as_str))?.build(&shipped::folder())?;
    // The step that ends at `time`.
    while simulation.clock.time() + 1.5 * simulation.clock.nominal() < time {
        simulation.advance()?;
    }
    let prepared = Prepared::new(&simulation)?;
    let equilibrium = prepared.equilibrium(&simulation);
    let mut by_newton = vec![Vector::<f64, 2>::zeros(); prepared.nodes.len()];
    prepared.prescribe(&mut by_newton);
    let start: Vec<f64> = bytemuck::cast_slice(&by_newton).to_vec();
    let settings =
        NewtonSettings { relative_tolerance: 1e-14, forcing: Forcing::Fixed(1e-10), ..NewtonSettings::default() };
    let newton = newton(
        &equilibrium,
        &mut BlockJacobi::<2>::default(),
        bytemuck::cast_slice_mut(&mut by_newton),
        &settings,
        &Pool::default(),
    )?;
    let by_newton: &[f64] = bytemuck::cast_slice(&by_newton);

    let diagonal = equilibrium.tangent(bytemuck::cast_slice(&start))?.diagonal_blocks();
    let scale: Vec<f64> = diagonal.iter().flat_map(|block| [block[(0, 0)], block[(1, 1)]]).map(|k| k.powf(-0.5)).collect();
    let problem = Potential { equilibrium: &equilibrium, scale: &scale, start: potential(&equilibrium, &start)?.0 };
    let y: Vec<f64> = start.iter().zip(&scale).map(|(x, s)| x / s).collect();
    let solver = LBFGS::new(MoreThuenteLineSearch::new().with_c(1e-4, 0.9)?, MEMORY)
        .with_tolerance_grad(0.0)?
        .with_tolerance_cost(0.0)?;
    let executor = Executor::new(problem, solver).configure(|state| state.param(y).max_iters(MOST_ITERATIONS));
    let result = match executor.timer(false).ctrlc(false).run() {
        Ok(result) => result,
        Err(error) => {
            // The error is a failure of this step; the other steps go on.
            report.push_error(&["L-BFGS", label], error.as_ref());
            return Ok(());
        }
    };
    let state = result.state();
    let Some(best) = state.get_best_param() else { return Err("argmin returned no point".into()) };
    let found: Vec<f64> = best.iter().zip(&scale).map(|(y, s)| y * s).collect();

    let difference: Vec<f64> = found.iter().zip(by_newton).map(|(a, b)| a - b).collect();
    let mut k_e = vec![0.0; difference.len()];
    equilibrium.linearize(by_newton)?.apply(&difference, &mut k_e);
    let energy_norm = bfree::solver::vector::dot(&difference, &k_e).max(0.0).sqrt();
    let (least, magnitude) = potential(&equilibrium, by_newton)?;
    let round_off = round_off(simulation.particles.len() + prepared.nodes.len());
    let bound = (2.0 * round_off * magnitude).sqrt();
    report.push(&["energy norm of the difference", label], energy_norm, Bound::AtMost(bound));
    let norm = bfree::solver::vector::norm;
    let relative = norm(&difference) / norm(by_newton);
    report.push(&["|difference| / |dphi|", label], relative, Bound::Reported);
    // Newton's result is a minimum: the other result must not be lower.
    let lower = (least - potential(&equilibrium, &found)?.0) / magnitude;
    report.push(&["(Pi Newton - Pi L-BFGS) / magnitude", label], lower, Bound::AtMost(round_off));
    table.push([
        label.into(),
        newton.history.iterations.len().to_string(),
        newton.history.counts.tangent_products.to_string(),
        state.get_last_best_iter().to_string(),
        format!("{:.3e}", norm(by_newton)),
        format!("{:.1e}", norm(&difference)),
        format!("{energy_norm:.1e}"),
        format!("{bound:.1e}"),
    ]);
    Ok(())
}
