//! A body slides into the next cells by fractions of h. Nodes then have tiny mass and stiffness; the study shows the effect on the linear
//! solver with diagonal blocks.

use super::bodies::{self, stir};
use super::{Outcome, StudyError, rows, solvable, worse};
use crate::prepared::Prepared;
use crate::report::short;
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear, Lme};
use bfree::pooled::Pool;
use bfree::simulation::Simulation;
use bfree::solver::{BlockJacobi, GmresSettings, LinearOperator, NonlinearProblem, gmres};
use bfree::tensor::{Tensor, Vector};
use nalgebra::{DMatrix, SymmetricEigen};

/// The tolerance of the linear systems.
const TOLERANCE: f64 = 1e-8;

/// The reference offset, in cells.
const REFERENCE: f64 = 0.25;

/// Iterations may double, and condition numbers may grow fourfold: iterations scale with the root of the condition number.
const MORE: f64 = 2.0;

/// The step in wave times. It is long enough for stiffness to dominate inertia.
const STEP: f64 = 10.0;

/// GMRES iterations, and the condition number of the preconditioned matrix.
struct Solved {
    iterations: f64,
    condition: f64,
}

pub(super) fn run(outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut report = rows("sliding into the next cells: iterations and condition over those of an overlap of a quarter of a cell");
    let title = "GMRES iterations to 1e-8 and condition number with diagonal blocks, against the overlap";
    let mut table = Table::new(title, ["shape", "eps", "overlap", "iterations", "condition"]);
    for (name, shape) in
        [("linear", Approximation::from(Linear)), ("LME 3", Lme::new(3.0, 1e-6).into()), ("cubic", Bspline::Cubic.into())]
    {
        for lumping in [1.0, 0.1] {
            let reference = solve(&shape, lumping, REFERENCE)?;
            for exponent in [1, 2, 4, 6, 8, 10, 12] {
                let overlap = 10.0_f64.powi(-exponent);
                let solved = solve(&shape, lumping, overlap)?;
                let numbers = [lumping, overlap, solved.iterations, solved.condition].map(short);
                table.push(std::iter::once(name.into()).chain(numbers));
                let case = format!("eps = {lumping}, overlap {}", short(overlap));
                let iterations = Ok::<_, StudyError>(solved.iterations / reference.iterations);
                solvable(&mut report, &format!("iterations, {name}"), &case, iterations, MORE);
                let condition = Ok::<_, StudyError>(solved.condition / reference.condition);
                solvable(&mut report, &format!("condition, {name}"), &case, condition, MORE * MORE);
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
fn solve(shape: &Approximation, lumping: f64, overlap: f64) -> Result<Solved, StudyError> {
    let simulation = square(shape, lumping, overlap);
    let prepared = Prepared::new(&simulation)?;
    let equilibrium = prepared.equilibrium(&simulation);
    let dphi = vec![0.0; 2 * prepared.nodes.len()];
    let mut right = dphi.clone();
    NonlinearProblem::residual(&equilibrium, &dphi, &mut right)?;
    let tangent = equilibrium.tangent(bytemuck::cast_slice(&dphi))?;
    let mut blocks = BlockJacobi::<2>::default();
    blocks.take(&tangent);
    let settings = GmresSettings { relative_tolerance: TOLERANCE, max_iterations: 10_000, restart: 200 };
    let mut solution = dphi.clone();
    let report = gmres(&tangent, &blocks, &right, &mut solution, &settings, &Pool::default())?;
    // If the tolerance is not met, the number of iterations is undefined.
    let iterations = if report.converged() { report.iterations as f64 } else { f64::NAN };
    Ok(Solved { iterations, condition: condition(&dense(&tangent, dphi.len())) })
}

/// K, column by column.
fn dense(tangent: &impl LinearOperator, n: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(n, n);
    let mut unit = vec![0.0; n];
    for column in 0..n {
        unit[column] = 1.0;
        tangent.apply(&unit, matrix.column_mut(column).as_mut_slice());
        unit[column] = 0.0;
    }
    matrix
}

/// λ_max/λ_min of L⁻¹ K L⁻ᵀ, where L Lᵀ are the diagonal blocks of K.
fn condition(matrix: &DMatrix<f64>) -> f64 {
    let n = matrix.nrows();
    // L⁻¹ of each block, lower triangular.
    let mut left = DMatrix::zeros(n, n);
    for i in (0..n).step_by(2) {
        let first = matrix[(i, i)].sqrt();
        let below = matrix[(i + 1, i)] / first;
        let second = (matrix[(i + 1, i + 1)] - below * below).sqrt();
        left[(i, i)] = first.recip();
        left[(i + 1, i)] = -below / (first * second);
        left[(i + 1, i + 1)] = second.recip();
    }
    let scaled = &left * matrix * left.transpose();
    let values = SymmetricEigen::new((&scaled + scaled.transpose()) * 0.5).eigenvalues;
    let largest = values.iter().copied().fold(0.0, worse);
    let smallest = values.iter().copied().fold(f64::INFINITY, f64::min);
    // Eigenvalues below round-off of the largest one are not resolved.
    largest / smallest.max(f64::EPSILON * largest)
}
