//! A body slides into the next cells by fractions of h. Nodes then have tiny mass and stiffness; the study shows the effect on the linear
//! solver with diagonal blocks.

use super::bodies::{self, stir};
use super::{Outcome, StudyError, rows, solvable};
use crate::report::short;
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear, Lme};
use bfree::pooled::Pool;
use bfree::simulation::Simulation;
use bfree::solver::{BlockJacobi, GmresSettings, NonlinearProblem, System};
use bfree::tensor::{Tensor, Vector};

/// The tolerance of the linear systems.
const TOLERANCE: f64 = 1e-8;

/// The reference offset, in cells.
const REFERENCE: f64 = 0.25;

/// Iterations may double.
const MORE: f64 = 2.0;

/// The step in wave times. It is long enough for stiffness to dominate inertia.
const STEP: f64 = 10.0;

pub(super) fn run(outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut report = rows("sliding into the next cells: iterations over those of an overlap of a quarter of a cell");
    let title = "GMRES iterations to 1e-8 with diagonal blocks, against the overlap";
    let mut table = Table::new(title, ["shape", "eps", "overlap", "iterations"]);
    for (name, shape) in [
        ("linear", Approximation::from(Linear)),
        ("LME 3", Lme::new(3.0, 1e-6).into()),
        ("cubic", Bspline::Cubic.into()),
    ] {
        for lumping in [1.0, 0.1] {
            let reference = solve(&shape, lumping, REFERENCE)?;
            for exponent in [1, 2, 4, 6, 8, 10, 12] {
                let overlap = 10.0_f64.powi(-exponent);
                let solved = solve(&shape, lumping, overlap)?;
                let numbers = [lumping, overlap, solved].map(short);
                table.push(std::iter::once(name.into()).chain(numbers));
                let case = format!("eps = {lumping}, overlap {}", short(overlap));
                let iterations = Ok::<_, StudyError>(solved / reference);
                solvable(&mut report, &format!("iterations, {name}"), &case, iterations, MORE);
            }
        }
    }
    outcome.reports.push(report);
    outcome.tables.push(table);
    Ok(())
}

/// A square of 4 × 4 cells. Along both axes its outermost particles lie `overlap` cells beyond a line of nodes.
fn square(shape: &Approximation, lumping: f64, overlap: f64) -> Simulation<2> {
    let sound = bodies::PLAIN.p_wave_modulus().sqrt();
    let mut simulation = bodies::block::<2>(4, shape.clone(), STEP / sound);
    simulation.settings.lumping = lumping;
    for x in &mut simulation.particles.position {
        // The square moves from ¼ before the line to `overlap` after it, exactly.
        *x += Vector::repeat(0.25 + overlap);
    }
    stir(&mut simulation, &(Tensor::<f64, 2>::new(0.1, 0.04, 0.02, -0.07) * sound));
    simulation.particles.displacement_gradient.fill(Tensor::<f64, 2>::new(-0.05, 0.03, 0.0, 0.04));
    simulation
}

/// The first linear system of a step.
fn solve(shape: &Approximation, lumping: f64, overlap: f64) -> Result<f64, StudyError> {
    let simulation = square(shape, lumping, overlap);
    let coming = simulation.next_step()?;
    let equilibrium = coming.equilibrium();
    let dphi = vec![0.0; 2 * coming.nodes().len()];
    let mut right = dphi.clone();
    NonlinearProblem::residual(&equilibrium, &dphi, &mut right)?;
    let tangent = equilibrium.tangent(None, bytemuck::cast_slice(&dphi))?;
    let mut blocks = BlockJacobi::<2>::default();
    blocks.take(&tangent);
    let settings = GmresSettings { relative_tolerance: TOLERANCE, max_iterations: 10_000, restart: 200 };
    let mut solution = dphi.clone();
    let system = System { vectors: &Pool::default(), operator: &tangent, inverse: &blocks };
    let report = settings.solve(&system, &right, &mut solution)?;
    // If the tolerance is not met, the number of iterations is undefined.
    Ok(if report.converged() { report.iterations as f64 } else { f64::NAN })
}
