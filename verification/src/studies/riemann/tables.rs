//! The tables: Figs. 6 and 7 in numbers, and strong jumps.

use super::*;
use crate::table::Table;

/// Spacings of the table of strong jumps.
const COARSE: [f64; 3] = [0.1, 0.05, 0.025];

/// The paper's scheme for strong jumps, and its replacements.
const STRONG: [(Method, f64); 4] = [(LINEAR, 1.0), (LME, 1.0), (SMOOTH, 1.0), (Method::RECOMMENDED, COURANT)];

fn strong_jumps() -> [Jump; 4] {
    [100.0, -100.0, 1000.0, -1000.0].map(Jump::of)
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for h in COARSE {
        for (method, courant) in STRONG {
            cases.extend(strong_jumps().map(|jump| Case::new(method, jump, h, courant)));
        }
    }
    cases
}

pub(super) fn all(runs: &Runs) -> Vec<Table> {
    vec![by_spacing(runs), by_step(runs), strong(runs)]
}

/// A number of a run, or the reason why there is none.
fn shown(run: Result<&Measured, StudyError>, value: impl Fn(&Measured) -> String) -> String {
    run.map_or_else(|_| "breaks down".into(), value)
}

fn by_spacing(runs: &Runs) -> Table {
    let mut table = Table::new(
        "Fig. 6: L2 error of the velocity (m^1.5/s) in the paper's case, Courant 1, at particles | at nodes",
        ["h (m)", "linear", "uGIMP", "LME 4", "Q8 elements", "recommended, Courant 0.5"],
    );
    for (h, at_points, at_nodes) in ELEMENTS {
        let both = |found: &Measured| format!("{:.2} | {:.2}", found.particles, found.nodes);
        let mut row = vec![h.to_string()];
        row.extend([LINEAR, GIMP, LME].map(|method| shown(runs.of(method, Jump::PAPER, h, 1.0), both)));
        row.push(format!("{at_points:.2} | {at_nodes:.2}"));
        row.push(shown(runs.of(Method::RECOMMENDED, Jump::PAPER, h, COURANT), both));
        table.push(row);
    }
    table
}

fn by_step(runs: &Runs) -> Table {
    let mut table = Table::new(
        "Fig. 7: L2 error at particles (m^1.5/s) in the paper's case against the time step, h = 0.1 m",
        ["Courant", "dt (s)", "linear", "LME 4", "recommended"],
    );
    for courant in COURANTS {
        let error = |found: &Measured| format!("{:.3}", found.particles);
        let mut row = vec![courant.to_string(), format!("{:.1e}", 5e-5 * courant)];
        let methods = [LINEAR, LME, Method::RECOMMENDED];
        row.extend(methods.map(|method| shown(runs.of(method, Jump::PAPER, 0.1, courant), error)));
        table.push(row);
    }
    table
}

fn strong(runs: &Runs) -> Table {
    let mut table = Table::new(
        "strong jumps, E = 5e10 Pa; three numbers are for h = 0.1, 0.05, 0.025 m",
        ["jump (m/s)", "scheme", "L2 (m^1.5/s)", "overshoot (%)", "plateau (%)", "width 10-90 % (h)"],
    );
    for jump in strong_jumps() {
        for (method, courant) in STRONG {
            let over = |value: &dyn Fn(f64, &Measured) -> String| {
                let at = |h: f64| shown(runs.of(method, jump, h, courant), |found| value(h, found));
                COARSE.map(at).join(", ")
            };
            table.push([
                format!("{}", jump.left - jump.right),
                method.name.into(),
                over(&|_, found| format!("{:.1}", found.particles)),
                over(&|_, found| format!("{:.1}", 100.0 * found.overshoot)),
                over(&|_, found| format!("{:.1}", 100.0 * found.plateau)),
                over(&|h, found| format!("{:.1}", found.width / h)),
            ]);
        }
    }
    table
}
