//! A body slides into the next cells by fractions of h. Nodes then have tiny mass and stiffness; the study shows the effect on the linear
//! solver.

use super::bodies::{self, stir};
use super::{Effort, Outcome, Report, StudyError, rows, solvable, worse};
use crate::axis::Axis;
use crate::prepared::Prepared;
use crate::report::short;
use crate::sheet::{Curve, Mark, Panel, Sheet};
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear, Lme};
use bfree::mechanics::tangent::Tangent;
use bfree::simulation::Simulation;
use bfree::pooled::Pool;
use bfree::solver::{BlockJacobi, GmresSettings, Identity, LinearOperator, NonlinearProblem, gmres};
use bfree::tensor::{Tensor, Vector};
use nalgebra::{DMatrix, SymmetricEigen};
use plotters::prelude::SeriesLabelPosition;

/// The tolerance of the linear systems.
const TOLERANCE: f64 = 1e-8;

/// The reference offset, in cells.
const REFERENCE: f64 = 0.25;

/// Iterations may double, and condition numbers may grow fourfold: iterations scale with the root of the condition number.
const MORE: f64 = 2.0;

/// The step in wave times. It is long enough for stiffness to dominate inertia.
const STEP: f64 = 10.0;

/// The scaling of the linear system before its solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scaling {
    Nothing,
    Diagonal,
    Blocks,
}

impl Scaling {
    const ALL: [Self; 3] = [Self::Nothing, Self::Diagonal, Self::Blocks];

    fn name(self) -> &'static str {
        match self {
            Self::Nothing => "none",
            Self::Diagonal => "diagonal",
            Self::Blocks => "blocks",
        }
    }
}

/// Iterations and condition number with each scaling.
struct Solved {
    iterations: [f64; 3],
    conditions: [f64; 3],
}

pub(super) fn run(effort: &Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    let mut report = rows("sliding into the next cells: iterations and condition over those of an overlap of a quarter of a cell");
    let mut table = Table::new(
        "GMRES iterations to 1e-8 and condition number against the overlap, by preconditioner (blocks is bfree's)",
        ["shape", "eps", "overlap", "iterations: none", "diagonal", "blocks", "condition: none", "diagonal", "blocks"],
    );
    let mut overlaps: Vec<f64> = vec![REFERENCE];
    let exponents = match effort {
        Effort::Short => vec![1, 2, 4, 6, 8, 10, 12],
        Effort::Full => (1..=12).collect(),
    };
    overlaps.extend(exponents.into_iter().map(|exponent| 10.0_f64.powi(-exponent)));
    let mut panels = Vec::new();
    for (name, shape) in
        [("linear", Approximation::from(Linear)), ("LME 3", Lme::new(3.0, 1e-6).into()), ("cubic", Bspline::Cubic.into())]
    {
        for lumping in [1.0, 0.1] {
            let mut curves: [Vec<(f64, f64)>; 3] = Default::default();
            let mut reference: Option<Solved> = None;
            for &overlap in &overlaps {
                let solved = solve(&shape, lumping, overlap)?;
                let numbers = solved.iterations.iter().chain(&solved.conditions).map(|x| short(*x));
                table.push([name.into(), lumping.to_string(), short(overlap)].into_iter().chain(numbers));
                for (curve, iterations) in curves.iter_mut().zip(solved.iterations) {
                    curve.push((overlap, iterations));
                }
                let Some(reference) = &reference else {
                    reference = Some(solved);
                    continue;
                };
                judge(&mut report, name, lumping, overlap, &solved, reference);
            }
            if lumping == 1.0 {
                panels.push(panel(name, curves));
            }
        }
    }
    outcome.reports.push(report);
    outcome.tables.push(table);
    outcome.sheets.push(Sheet {
        name: "extremes_sliding",
        caption: "GMRES iterations to 1e-8 as a square slides into the next cells, against the overlap; bfree's preconditioner is that of blocks.".into(),
        columns: 3,
        size: (360, 320),
        panels,
    });
    Ok(())
}

fn judge(report: &mut Report, name: &str, lumping: f64, overlap: f64, solved: &Solved, reference: &Solved) {
    let blocks = Scaling::Blocks as usize;
    let case = format!("eps = {lumping}, overlap {}", short(overlap));
    let iterations = solved.iterations[blocks] / reference.iterations[blocks];
    solvable(report, &format!("iterations, {name}"), &case, Ok::<_, StudyError>(iterations), MORE);
    let condition = solved.conditions[blocks] / reference.conditions[blocks];
    solvable(report, &format!("condition, {name}"), &case, Ok::<_, StudyError>(condition), MORE * MORE);
}

fn panel(name: &str, curves: [Vec<(f64, f64)>; 3]) -> Panel {
    let curves = Scaling::ALL.into_iter().zip(curves).zip([2, 3, 1]);
    Panel {
        title: name.into(),
        x: Axis::logarithmic("overlap / h"),
        y: Axis::linear("iterations"),
        window: Some([(3e-13, 1.0), (0.0, 180.0)]),
        curves: curves.map(|((scaling, points), color)| Curve::new(scaling.name(), color, Mark::Joined, points)).collect(),
        legend: (name == "linear").then_some(SeriesLabelPosition::UpperRight),
    }
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
    let (diagonal, mut blocks) = (Diagonal::new(&tangent), BlockJacobi::<2>::default());
    blocks.take(&tangent);
    let settings = GmresSettings { relative_tolerance: TOLERANCE, max_iterations: 10_000, restart: 200 };
    let iterations = |with: &dyn LinearOperator| -> Result<f64, StudyError> {
        let mut solution = dphi.clone();
        let report = gmres(&tangent, with, &right, &mut solution, &settings, &Pool::default())?;
        // If the tolerance is not met, the number of iterations is undefined.
        Ok(if report.converged() { report.iterations as f64 } else { f64::NAN })
    };
    let iterations = [iterations(&Identity)?, iterations(&diagonal)?, iterations(&blocks)?];
    let matrix = dense(&tangent, dphi.len());
    let conditions = Scaling::ALL.map(|scaling| condition(&matrix, scaling));
    Ok(Solved { iterations, conditions })
}

/// The inverse of the diagonal.
struct Diagonal(Vec<f64>);

impl Diagonal {
    fn new(tangent: &Tangent<'_, 2>) -> Self {
        Self(tangent.diagonal_blocks().iter().flat_map(|block| [block[(0, 0)].recip(), block[(1, 1)].recip()]).collect())
    }
}

impl LinearOperator for Diagonal {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        for ((z, r), inverse) in z.iter_mut().zip(r).zip(&self.0) {
            *z = r * inverse;
        }
    }
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

/// λ_max/λ_min of L⁻¹ K L⁻ᵀ, where L Lᵀ is the scaling of K.
fn condition(matrix: &DMatrix<f64>, scaling: Scaling) -> f64 {
    let n = matrix.nrows();
    // L⁻¹ of each block, lower triangular.
    let mut left = DMatrix::zeros(n, n);
    for i in (0..n).step_by(2) {
        let (a, b, c) = (matrix[(i, i)], matrix[(i + 1, i)], matrix[(i + 1, i + 1)]);
        let (first, below, second) = match scaling {
            Scaling::Nothing => (1.0, 0.0, 1.0),
            Scaling::Diagonal => (a.sqrt(), 0.0, c.sqrt()),
            Scaling::Blocks => (a.sqrt(), b / a.sqrt(), (c - b * b / a).sqrt()),
        };
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
