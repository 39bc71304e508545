//! Particle-to-grid and grid-to-particle transfers compared: the losses of a spinning body.

use crate::report::{Bound, Report};
use crate::studies::patch::{angular_momentum, spinning};
use crate::studies::{Outcome, StudyError};
use crate::table::Table;
use bfree::approximation::{Approximation, Bspline, Linear};
use bfree::mechanics::reference::GridReset;
use bfree::mechanics::schemes::GeneralizedAlpha;
use bfree::mechanics::smoothing::Smoothing;
use bfree::mechanics::transfer::Projection;
use bfree::simulation::Settings;
use std::sync::Arc;

/// The relative change of the momenta: the projection's tolerance of 1e-12 allows this in 40 steps.
const CONSERVED: f64 = 1e-10;

/// A transfer from particles to nodes and back.
struct Transfer {
    name: &'static str,
    /// ε of the mass matrix in the projection and in the inertia.
    lumping: f64,
    projection: Projection,
    /// The order k of PIC (1) and FMPM; none for FLIP.
    order: Option<u32>,
}

const TRANSFERS: [Transfer; 7] = [
    Transfer { name: "FLIP, lumped", lumping: 1.0, projection: Projection::Mass, order: None },
    Transfer { name: "FLIP, eps = 0.01", lumping: 0.01, projection: Projection::Mass, order: None },
    Transfer { name: "FLIP, consistent", lumping: 0.0, projection: Projection::Mass, order: None },
    Transfer { name: "PIC, lumped", lumping: 1.0, projection: Projection::Mass, order: Some(1) },
    Transfer { name: "FMPM(2), lumped", lumping: 1.0, projection: Projection::Mass, order: Some(2) },
    Transfer { name: "FMPM(4), lumped", lumping: 1.0, projection: Projection::Mass, order: Some(4) },
    Transfer { name: "FLIP, affine", lumping: 1.0, projection: Projection::Affine, order: None },
];

impl Transfer {
    fn settings(&self, other: Settings) -> Settings {
        let smoothing = self.order.map(|order| Smoothing::uniform(order, f64::INFINITY));
        Settings { lumping: self.lumping, projection: self.projection, smoothing, ..other }
    }
}

fn families() -> [(&'static str, Approximation); 2] {
    [("linear", Linear.into()), ("cubic", Bspline::Cubic.into())]
}

/// Number of steps, each of a fortieth of a radian.
const STEPS: u32 = 40;

/// The changes over one radian of rotation: of the linear momentum over Σ m |v|, and of angular momentum and energy over their initial
/// values. The grid is reset after the steps that `renewed_after` selects.
fn lost(
    shape: &Approximation,
    transfer: &Transfer,
    renewed_after: impl Fn(u32) -> bool,
) -> Result<[f64; 3], StudyError> {
    let mut simulation = spinning(shape, transfer.lumping, 2.0 / f64::from(STEPS))?;
    simulation.settings = transfer.settings(simulation.settings);
    simulation.settings.scheme = Arc::new(GeneralizedAlpha { spectral_radius: 1.0 });
    let energy = |of: &bfree::simulation::Simulation<2>| of.particles.kinetic_energy() + of.strain_energy();
    let particles = &simulation.particles;
    let (spin, start, before) = (angular_momentum(particles), particles.momentum(), energy(&simulation));
    let size: f64 = particles.velocity.iter().zip(&particles.mass).map(|(v, m)| v.norm() * m).sum();
    for step in 1..=STEPS {
        simulation.settings.grid_reset = if renewed_after(step) { GridReset::EveryStep } else { GridReset::Never };
        simulation.step()?;
    }
    let particles = &simulation.particles;
    let change = |now: f64, before: f64| (now - before) / before;
    let moved = (particles.momentum() - start).norm() / size;
    Ok([moved, change(angular_momentum(particles), spin), change(energy(&simulation), before)])
}

/// Every transfer conserves linear momentum. A consistent mass conserves angular momentum: Σ N_I (x_I − x_p) = 0. PIC with a lumped mass
/// takes a mean of means, and dissipates energy.
fn losses(outcome: &mut Outcome) {
    let title = "a square that spins by a radian in 40 steps and breathes, midpoint rule";
    let mut report = Report::new(format!("{title}: what transfers take"), &["of", "grid", "shape", "transfer"]);
    let mut table = Table::new(
        format!("{title}: change of angular momentum and energy, over the start"),
        [
            "shape",
            "transfer",
            "L, kept",
            "one grid_reset",
            "new in every step",
            "E, kept",
            "one grid_reset",
            "new in every step",
        ],
    );
    for (name, shape) in families() {
        for transfer in &TRANSFERS {
            let mut found = Vec::new();
            for (grid, renewals) in [("kept", 0), ("renewed once", 1), ("new in every step", STEPS)] {
                let renewed = |step: u32| renewals == STEPS || (renewals == 1 && step == STEPS / 2);
                let labels = |what| [what, grid, name, transfer.name];
                match lost(&shape, transfer, renewed) {
                    Ok([linear, angular, energy]) => {
                        report.push(&labels("linear momentum"), linear, Bound::AtMost(CONSERVED));
                        if transfer.lumping == 0.0 {
                            report.push(&labels("angular momentum"), angular.abs(), Bound::AtMost(CONSERVED));
                        }
                        if transfer.order == Some(1) {
                            report.push(&labels("energy"), energy, Bound::AtMost(0.0));
                        }
                        found.push([angular, energy]);
                    }
                    // A consistent mass has null modes on a reset grid (study `newton`).
                    Err(_) if transfer.lumping == 0.0 && renewals > 0 => found.push([f64::NAN; 2]),
                    Err(error) => {
                        report.push_error(&labels("run"), error.as_ref());
                        found.push([f64::NAN; 2]);
                    }
                }
            }
            let mut row = vec![name.to_string(), transfer.name.into()];
            for k in 0..2 {
                row.extend([
                    format!("{:.2e}", found[0][k]),
                    format!("{:+.2e}", found[1][k] - found[0][k]),
                    format!("{:.2e}", found[2][k]),
                ]);
            }
            table.push(row);
        }
    }
    outcome.reports.push(report);
    outcome.tables.push(table);
}

pub(super) fn run(outcome: &mut Outcome) {
    losses(outcome);
    outcome.remarks.push(
        "Of a body that spins, the column \"one grid_reset\" is what a single grid_reset on the way adds to a grid that is kept; a consistent mass \
         keeps the angular momentum on both, where it comes to the end: NaN is a run that fails, by null modes of the mass."
            .into(),
    );
}
