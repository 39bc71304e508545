//! A block with a round hole that cuts cells. The tractions P N of the known motion act on the hole.

use super::{GAUSS, GAUSS_OF_MIDDLES, Held, Layout, NEAR, REGULAR, Refined};
use crate::manufactured::Block;
use crate::report::{Bound, Report};
use crate::studies::{Effort, Outcome};
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear, Lme, NotAKnotBspline};
use bfree::grid::Grid;
use bfree::mechanics::reference::GridReset;
use bfree::mechanics::schemes::Statics;
use bfree::shape::Ball;
use bfree::simulation::Settings;
use bfree::tensor::Vector;
use std::sync::Arc;

/// J is between 1 − this and 1 + this: a hole compressed by half has a wrinkled surface.
const CHANGE: f64 = 0.3;

/// Required orders for a body whose surface cuts cells, as in the issue: 2 for the displacement, and 2 for the stress of functions of a
/// degree above 1; 1.5 for the largest error of the stress at the hole.
/// Short effort leaves out cubic functions, which take most of the time.
pub(super) fn run(effort: Effort, outcome: &mut Outcome) {
    let title = "a block with a round hole under tractions, J from 0.7 to 1.3, no inertia, the grid kept";
    let mut report = Report::new(format!("{title}: order in h"), &["of", "shape", "layout"]);
    let header = ["shape", "layout", "cells", "displacement", "order", "stress", "order", "products x particles"];
    let mut table = Table::new(format!("{title}: errors, relative, in the mean square"), header);
    let cases: [(&str, Approximation, &Layout, f64); 5] = [
        ("linear", Linear.into(), &REGULAR, 1.0),
        ("linear", Linear.into(), &GAUSS, 1.0),
        ("LME 3", Lme::new(3.0, 1e-6).into(), &GAUSS, 1.0),
        ("not-a-knot quadratic", NotAKnotBspline(Bspline::Quadratic).into(), &GAUSS_OF_MIDDLES, 2.0),
        ("not-a-knot cubic", NotAKnotBspline(Bspline::Cubic).into(), &GAUSS, 2.0),
    ];
    let block = Block::curved_at_walls::<2>(CHANGE);
    let hole = Ball { center: Vector::from([0.47, 0.52]), radius: 0.23 };
    for (name, shape, layout, of_stress) in cases.into_iter().take(if effort == Effort::Full { 5 } else { 4 }) {
        let [displacement, stress] = [2.0, of_stress].map(|order| Bound::AtLeast(order - NEAR));
        let least = [("displacement, round hole", displacement), ("stress, round hole", stress)];
        let refined = Refined { report: &mut report, table: &mut table, least };
        refined.run(&[name, layout.name], &[8, 16, 32], |cells| {
            let grid = Grid { origin: Vector::zeros(), spacing: f64::from(cells).recip(), cells: [cells; 2] };
            let (scheme, grid_reset) = (Arc::new(Statics::default()), GridReset::Never);
            let settings = Settings { scheme, grid_reset, aggregation: true, ..Settings::default() };
            let held = Held::new(block, grid, (&shape, layout), Some(&hole), 1.0, settings)?.after(1)?;
            Ok(([held.displacement(), held.stress()], held.work))
        });
    }
    outcome.reports.push(report);
    outcome.tables.push(table);
}
