//! The tables: Figs. 6 and 7 in numbers, strong jumps, and the causes of their difficulty.

use super::*;
use crate::table::Table;

/// Spacings of the tables.
const COARSE: [f64; 3] = [0.1, 0.05, 0.025];

/// Spacings for the search for causes.
const COARSEST: [f64; 2] = [0.1, 0.05];

/// The paper's scheme for strong jumps, and its replacements.
const STRONG: [(Method, f64); 4] = [(LINEAR, 1.0), (LME, 1.0), (SMOOTH, 1.0), (Method::RECOMMENDED, COURANT)];

/// Single changes: from the paper's scheme, then from the recommended one.
fn changes() -> Vec<(&'static str, Method, f64)> {
    let paper = |change: &'static str, method: Method| (change, method, 1.0);
    let best = |change: &'static str, method: Method| (change, method, COURANT);
    let (a, b) = (LME, Method::RECOMMENDED);
    vec![
        paper("paper: LME 4, 4 particles, eps 0.8, gamma 0.5, FLIP", a),
        paper("linear functions", LINEAR),
        paper("uGIMP", GIMP),
        paper("LME 3", Method { shape: r#"{"lme":{"gamma":3}}"#, ..a }),
        paper("LME 1.8", Method { shape: r#"{"lme":{"gamma":1.8}}"#, ..a }),
        paper("LME 1.4", SMOOTH),
        paper("LME 0.8", Method { shape: r#"{"lme":{"gamma":0.8}}"#, ..a }),
        paper("cubic B-splines", Method { shape: r#"{"bspline":{"degree":3}}"#, ..a }),
        paper("2 particles a cell", Method { particles_per_cell: 2, ..a }),
        paper("8 particles a cell", Method { particles_per_cell: 8, ..a }),
        paper("PIC", Method { transfer: Transfer::Pic(1), ..a }),
        paper("FMPM(4)", Method { transfer: Transfer::Pic(4), ..a }),
        paper("monotone blend", Method { transfer: Transfer::MONOTONE, ..a }),
        paper("limited, 0.8 c/h", Method { transfer: Transfer::Limited(0.8), ..a }),
        paper("gamma 0.6", Method { gamma: 0.6, ..a }),
        paper("eps 0.1", Method { lumping: 0.1, ..a }),
        best("recommended: LME 1.4, eps 0.02, limited 0.8 c/h", b),
        best("FLIP", Method::UNDISSIPATED),
        best("FMPM(8) in every step", Method { transfer: Transfer::Pic(8), ..b }),
        best("monotone blend, 1.2 (c/h)(h/L)^(1/4)", Method { transfer: Transfer::MONOTONE, ..b }),
        best("blend of order 2, 0.8 c/h", Method { transfer: Transfer::Blend(2, 0.8, 0.0), ..b }),
        best("half the rate", Method { transfer: Transfer::Limited(0.4), ..b }),
        best("twice the rate", Method { transfer: Transfer::Limited(1.6), ..b }),
        best("eps 0.8", Method { lumping: 0.8, ..b }),
        best("LME 4", Method { shape: LME.shape, ..b }),
        best("LME 1.8", Method { shape: r#"{"lme":{"gamma":1.8}}"#, ..b }),
        best("cubic B-splines", Method { shape: r#"{"bspline":{"degree":3}}"#, ..b }),
        best("2 particles a cell", Method { particles_per_cell: 2, ..b }),
        best("8 particles a cell", Method { particles_per_cell: 8, ..b }),
        ("Courant 1", b, 1.0),
    ]
}

const CAUSES: [Jump; 2] = [Jump::of(100.0), Jump::of(1000.0)];

/// Smoothing in three ways at several strengths, a of κ = a (c/h) (h/L)^e.
pub(super) const TRADE: [(&str, &[Transfer]); 3] = [
    ("order 1, a (c/h) (h/L)^(1/4)", &[
        Transfer::Blend(1, 0.15, 0.25),
        Transfer::Blend(1, 0.3, 0.25),
        Transfer::Blend(1, 0.6, 0.25),
        Transfer::Blend(1, 0.9, 0.25),
        Transfer::Blend(1, 1.2, 0.25),
    ]),
    ("order 2, a c/h", &[
        Transfer::Blend(2, 0.1, 0.0),
        Transfer::Blend(2, 0.2, 0.0),
        Transfer::Blend(2, 0.4, 0.0),
        Transfer::Blend(2, 0.8, 0.0),
        Transfer::Blend(2, 3.2, 0.0),
        Transfer::Blend(2, 12.8, 0.0),
    ]),
    ("limited, a c/h", &[
        Transfer::Limited(0.1),
        Transfer::Limited(0.2),
        Transfer::Limited(0.4),
        Transfer::Limited(0.6),
        Transfer::Limited(0.8),
        Transfer::Limited(1.0),
        Transfer::Limited(1.6),
    ]),
];

/// The spacing of the trade-off.
const TRADE_SPACING: f64 = 0.1;

/// The run of one kind and strength of smoothing.
fn traded(transfer: Transfer, jump: Jump) -> Case {
    let method = Method { transfer, ..Method::RECOMMENDED };
    Case::particles(method, jump, TRADE_SPACING, COURANT)
}

/// Overshoot in parts of the jump, and width over that of the undissipated scheme.
pub(super) fn trade(runs: &Runs, transfer: Transfer, jump: Jump) -> Result<(f64, f64, f64), StudyError> {
    let undissipated = runs.particles(Method::UNDISSIPATED, jump, TRADE_SPACING, COURANT)?;
    let found = runs.of(traded(transfer, jump))?;
    Ok((found.width / undissipated.width, found.overshoot, found.particles))
}

fn trades(runs: &Runs) -> Result<Table, StudyError> {
    let mut table = Table::new(
        format!("the trade: smoothing in three ways, h = {TRADE_SPACING} m, Courant {COURANT}; 100 | 1000 m/s"),
        ["smoothing", "a", "overshoot (%)", "width / undissipated", "L2 (m^1.5/s)"],
    );
    for (kind, strengths) in TRADE {
        for &transfer in strengths {
            let [weak, strong] = CAUSES.map(|jump| trade(runs, transfer, jump));
            let (weak, strong) = (weak?, strong?);
            let a = match transfer {
                Transfer::Blend(_, a, _) | Transfer::Limited(a) => a.to_string(),
                Transfer::Flip | Transfer::Pic(_) => "-".to_owned(),
            };
            table.push([
                kind.to_owned(),
                a,
                format!("{:.1} | {:.1}", 100.0 * weak.1, 100.0 * strong.1),
                format!("{:.2} | {:.2}", weak.0, strong.0),
                format!("{:.1} | {:.1}", weak.2, strong.2),
            ]);
        }
    }
    Ok(table)
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for h in COARSEST {
        for (_, method, courant) in changes() {
            cases.extend(CAUSES.map(|jump| Case::particles(method, jump, h, courant)));
        }
    }
    for h in COARSE {
        for (method, courant) in STRONG {
            cases.extend(strong_jumps().map(|jump| Case::particles(method, jump, h, courant)));
        }
    }
    for (_, strengths) in TRADE {
        for &transfer in strengths {
            cases.extend(CAUSES.map(|jump| traded(transfer, jump)));
        }
    }
    cases
}

fn strong_jumps() -> [Jump; 4] {
    [100.0, -100.0, 1000.0, -1000.0].map(Jump::of)
}

pub(super) fn all(runs: &Runs, plan: &Plan) -> Result<Vec<Table>, StudyError> {
    let mut tables = vec![by_spacing(runs), by_step(runs), by_gamma(runs)?];
    tables.push(strong(runs));
    tables.extend(CAUSES.map(|jump| causes(runs, jump)));
    tables.push(trades(runs)?);
    tables.push(judged(runs, plan)?);
    tables.push(cost()?);
    Ok(tables)
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
    for h in SPACINGS {
        let both = |found: &Measured| format!("{:.2} | {:.2}", found.particles, found.nodes);
        let mesh = Mesh { h, courant: 1.0 };
        let mut row = vec![h.to_string()];
        row.extend([LINEAR, GIMP, LME].map(|method| shown(runs.particles(method, Jump::PAPER, h, 1.0), both)));
        row.push(shown(runs.of(Case::Elements(0.5, Jump::PAPER, mesh)), both));
        row.push(shown(runs.particles(Method::RECOMMENDED, Jump::PAPER, h, COURANT), both));
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
        row.extend(
            [LINEAR, LME, Method::RECOMMENDED].map(|method| shown(runs.particles(method, Jump::PAPER, 0.1, courant), error)),
        );
        table.push(row);
    }
    table
}

fn by_gamma(runs: &Runs) -> Result<Table, StudyError> {
    let mut table = Table::new(
        "Fig. 5 in numbers: h = 0.1 m, Courant 1, beta = (gamma + 1/2)^2/4",
        ["discretisation", "gamma", "L2 (m^1.5/s)", "overshoot (%)", "plateau (%)", "width 10-90 % (m)", "energy lost (%)"],
    );
    for (name, case) in figures::discretisations() {
        for gamma in GAMMAS {
            let found = runs.of(case(gamma))?;
            table.push([
                name.to_owned(),
                gamma.to_string(),
                format!("{:.2}", found.particles),
                format!("{:.1}", 100.0 * found.overshoot),
                format!("{:.1}", 100.0 * found.plateau),
                format!("{:.2}", found.width),
                format!("{:.2}", 100.0 * found.lost),
            ]);
        }
    }
    Ok(table)
}

/// `a, b, c` for the spacings.
fn over(
    runs: &Runs,
    spacings: &[f64],
    (method, jump, courant): (Method, Jump, f64),
    value: impl Fn(f64, &Measured) -> String,
) -> String {
    let shown = |&h: &f64| shown(runs.particles(method, jump, h, courant), |found| value(h, found));
    spacings.iter().map(shown).collect::<Vec<_>>().join(", ")
}

fn strong(runs: &Runs) -> Table {
    let mut table = Table::new(
        "strong jumps, E = 5e10 Pa; three numbers are for h = 0.1, 0.05, 0.025 m",
        ["jump (m/s)", "scheme", "L2 (m^1.5/s)", "overshoot (%)", "plateau (%)", "width 10-90 % (h)"],
    );
    for jump in strong_jumps() {
        for (method, courant) in STRONG {
            let over = |value: &dyn Fn(f64, &Measured) -> String| over(runs, &COARSE, (method, jump, courant), value);
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

fn causes(runs: &Runs, jump: Jump) -> Table {
    let mut table = Table::new(
        format!("what matters, {}: one change at a time; h = 0.1, 0.05 m", jump.name()),
        ["change", "L2 (m^1.5/s)", "overshoot (%)", "plateau (%)", "width 10-90 % (h)", "energy lost (%)"],
    );
    for (change, method, courant) in changes() {
        let over = |value: &dyn Fn(f64, &Measured) -> String| over(runs, &COARSEST, (method, jump, courant), value);
        table.push([
            change.to_owned(),
            over(&|_, found| format!("{:.1}", found.particles)),
            over(&|_, found| format!("{:.1}", 100.0 * found.overshoot)),
            over(&|_, found| format!("{:.1}", 100.0 * found.plateau)),
            over(&|h, found| format!("{:.1}", found.width / h)),
            over(&|_, found| format!("{:.2}", 100.0 * found.lost)),
        ]);
    }
    table
}

fn judged(runs: &Runs, plan: &Plan) -> Result<Table, StudyError> {
    let mut table = Table::new(
        "the recommended setting",
        [
            "jump",
            "h (m)",
            "Courant",
            "L2 (m^1.5/s)",
            "L2 at nodes",
            "overshoot (%)",
            "plateau (%)",
            "width (h)",
            "undissipated, Courant 0.5 (h)",
            "undissipated, same step (h)",
            "paper's scheme, LME 1.4 (h)",
            "energy lost (%)",
            "lost in exact shocks (%)",
            "seconds",
        ],
    );
    for &jump in &plan.jumps {
        let by_h = plan.spacings(jump).iter().map(|&h| (h, COURANT));
        let by_step = plan.courants(jump).iter().skip(1).map(|&courant| (plan.spacings[0], courant));
        for (h, courant) in by_h.chain(by_step) {
            let found = runs.particles(Method::RECOMMENDED, jump, h, courant)?;
            let undissipated = runs.particles(Method::UNDISSIPATED, jump, h, COURANT)?;
            let width = |found: &Measured| format!("{:.1}", found.width / h);
            let same_step = runs.particles(Method::UNDISSIPATED, jump, h, courant).map_or("-".into(), width);
            let paper = runs.particles(SMOOTH, jump, h, 1.0)?;
            table.push([
                jump.name(),
                h.to_string(),
                courant.to_string(),
                format!("{:.3}", found.particles),
                format!("{:.3}", found.nodes),
                format!("{:.2}", 100.0 * found.overshoot),
                format!("{:.2}", 100.0 * found.plateau),
                width(found),
                width(undissipated),
                same_step,
                width(paper),
                format!("{:.2}", 100.0 * found.lost),
                format!("{:.2}", 100.0 * found.lost_by_shocks),
                format!("{:.1}", found.seconds),
            ]);
        }
    }
    Ok(table)
}

/// Seconds of runs one after the other, on one thread.
fn cost() -> Result<Table, StudyError> {
    let jump = Jump::of(1000.0);
    let mut table = Table::new(
        format!("what it costs: {}, h = 0.1 m, one thread, one run after the other", jump.name()),
        ["scheme", "Courant", "steps", "seconds", "of the first", "energy lost (%)", "L2 (m^1.5/s)"],
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut first = None;
    for (method, courant) in [(LME, 1.0), (LME, COURANT), (SMOOTH, COURANT), (Method::UNDISSIPATED, COURANT), (Method::RECOMMENDED, COURANT)] {
        let case = Case::particles(method, jump, 0.1, courant);
        let found = pool.install(|| case.run().map_err(|error| error.to_string()))?;
        let unit = *first.get_or_insert(found.seconds);
        table.push([
            method.name.to_owned(),
            courant.to_string(),
            found.steps.to_string(),
            format!("{:.2}", found.seconds),
            format!("{:.2}", found.seconds / unit),
            format!("{:.2}", 100.0 * found.lost),
            format!("{:.1}", found.particles),
        ]);
    }
    Ok(table)
}
