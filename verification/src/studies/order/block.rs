//! In space, without inertia: a block between walls, J from 0.3 to 1.7.

use super::{GAUSS, GAUSS_3, Held, Layout, NEAR, REGULAR, Refined, figure, line};
use crate::manufactured::Block;
use crate::report::{Bound, Report};
use crate::studies::{Effort, Outcome, StudyError};
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Gimp, Linear, Lme};
use bfree::grid::Grid;
use bfree::mechanics::kept::Renewal;
use bfree::mechanics::schemes::Statics;
use bfree::simulation::Settings;
use bfree::tensor::Vector;
use std::sync::Arc;

/// J is between 1 − this and 1 + this.
const CHANGE: f64 = 0.7;

/// Load steps: with the grid kept, the answer is the same for any number of them that Newton's method can take.
const STEPS: u32 = 4;

/// Shape functions on a layout, and their orders in h, of displacement and stress.
struct Case {
    name: &'static str,
    shape: Approximation,
    layout: &'static Layout,
    orders: [f64; 2],
}

/// A wide one of LME on the box, and the paper's.
fn cases() -> Vec<Case> {
    let case = |name, shape, layout, orders| Case { name, shape, layout, orders };
    let (quadratic, cubic) = (Approximation::from(Bspline::Quadratic), Approximation::from(Bspline::Cubic));
    let (wide, narrow) = (Approximation::from(Lme::new(1.4, 1e-6)), Approximation::from(Lme::new(3.0, 1e-6)));
    vec![
        case("linear", Linear.into(), &REGULAR, [2.0, 1.0]),
        case("linear", Linear.into(), &GAUSS, [2.0, 1.0]),
        case("gimp", Gimp::particles_per_axis(2).into(), &REGULAR, [2.0, 1.0]),
        case("LME 3", narrow.clone(), &REGULAR, [2.0, 1.0]),
        case("LME 3", narrow, &GAUSS, [2.0, 1.0]),
        case("LME 1.4", wide.clone(), &REGULAR, [2.0, 1.0]),
        case("LME 1.4", wide, &GAUSS, [2.0, 1.0]),
        case("quadratic", quadratic.clone(), &REGULAR, [2.0, 1.8]),
        case("quadratic", quadratic.clone(), &GAUSS, [3.0, 3.0]),
        case("quadratic", quadratic, &GAUSS_3, [3.0, 3.0]),
        case("cubic", cubic.clone(), &REGULAR, [2.0, 1.5]),
        case("cubic", cubic.clone(), &GAUSS, [2.5, 1.5]),
        case("cubic", cubic, &GAUSS_3, [2.5, 1.5]),
    ]
}

/// The block under its whole load, on so many cells across.
fn loaded<const D: usize>(
    case: &Case,
    cells: u32,
    steps: u32,
    renewal: Renewal,
) -> Result<Held<Block, D>, StudyError> {
    let grid = Grid { origin: Vector::zeros(), spacing: f64::from(cells).recip(), cells: [cells; D] };
    let settings = Settings { scheme: Arc::new(Statics), renewal, ..Settings::default() };
    let block = Block::with_change::<D>(CHANGE);
    Held::new(block, grid, (&case.shape, case.layout), f64::from(steps).recip(), settings)?.after(steps)
}

fn refine<const D: usize>(case: &Case, sizes: &[u32], report: &mut Report, table: &mut Table) -> Vec<(f64, [f64; 2])> {
    let [displacement, stress] = case.orders.map(|order| Bound::AtLeast(order - NEAR));
    let least = [("displacement", displacement), ("stress", stress)];
    let dimension = D.to_string();
    Refined { report, table, least }.run(&[case.name, case.layout.name, &dimension], sizes, |cells| {
        let held = loaded::<D>(case, cells, STEPS, Renewal::Never)?;
        Ok(([held.displacement(), held.stress()], held.work))
    })
}

pub(super) fn run(effort: Effort, outcome: &mut Outcome) -> Result<(), StudyError> {
    let title = "a block between walls, J from 0.3 to 1.7, no inertia, the grid kept";
    let mut report = Report::new(format!("{title}: order in h"), &["of", "shape", "layout", "D"]);
    let header = ["shape", "layout", "D", "cells", "displacement", "order", "stress", "order", "products x particles"];
    let mut table = Table::new(format!("{title}: errors, relative, in the mean square"), header);
    let mut lines = [Vec::new(), Vec::new()];
    let (plane, space): (&[u32], &[u32]) = match effort {
        Effort::Short => (&[8, 16, 32], &[4, 8]),
        Effort::Full => (&[8, 16, 32], &[4, 8, 16]),
    };
    for case in cases() {
        let found = refine::<2>(&case, plane, &mut report, &mut table);
        for (k, lines) in lines.iter_mut().enumerate() {
            let name = format!("{}, {}", case.name, case.layout.name);
            lines.push(line(&name, found.iter().map(|(cells, errors)| (*cells, errors[k]))));
        }
        refine::<3>(&case, space, &mut report, &mut table);
    }
    for (what, lines) in ["displacement", "stress"].into_iter().zip(lines) {
        outcome.figures.push(figure(what, &format!("{what} of a block, 2D, the grid kept"), lines));
    }
    outcome.reports.push(report);
    outcome.tables.push(table);
    Ok(())
}
