//! A thick cylinder of nearly rigid-plastic metal, widened from a = 10 to 85 mm in plane strain: a quarter between planes of symmetry, with
//! linear functions and the mean dilatation of cells, in total Lagrangian steps.
//!
//! G = 3.8 GPa, K = 40 GPa, σ_Y = 0.5 MPa, a₀ = 10 mm, b₀ = 20 mm (Simo, Taylor and Pister, Comput. Methods Appl. Mech. Eng. 51, 1985). At
//! constant volume r² = R² + a² − a₀², and the stress at the hole falls along the whole path:
//!
//! ```text
//! σ_rr(a) = σ_Y/√3 ln [a²/(b₀² + a² − a₀²)]
//! ```
//!
//! A falling pressure cannot be prescribed as a load. Therefore the nodes in the hole are moved like an incompressible filling into which
//! a² − a₀² is pumped at the axis. The stress follows from the work of their forces: −σ_rr dV = Σ f·dx with V = π a²/4.

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report};
use crate::shipped;
use crate::table::Table;
use bfree::mechanics::loads::{Curve, Motion, Prescribed, Selection};
use bfree::shape::{Ball, Shape};
use bfree::simulation::{Simulation, StepReport};
use bfree::tensor::Vector;
use std::f64::consts::PI;

/// The summary in the list of studies.
pub(super) const ABOUT: &str =
    "a rigid-plastic cylinder whose hole is widened from 10 to 85 mm, against the formula of its stress";

/// a at the start and the end, b at the start, and σ_Y.
const INNER: [f64; 2] = [10.0, 85.0];
const OUTER: f64 = 20.0;
const YIELD: f64 = 0.5;

/// The radius a at which the short effort ends.
const DOUBLED: f64 = 2.0 * INNER[0];

/// The spacing, for five cells across the wall.
const SPACING: f64 = 2.0;

/// The number of steps; a grows by the same factor in each.
const STEPS: u32 = 100;

/// Relative error of the stress.
const BOUND: f64 = 0.01;

/// The number of steps per row of the table.
const ROWS: u64 = 5;

/// The radius a at the time t, 0 to 1.
fn inner(t: f64) -> f64 {
    INNER[0] * (INNER[1] / INNER[0]).powf(t)
}

/// The position of the point X when the hole has the radius a.
fn moved(x: &Vector<f64, 2>, a: f64) -> Vector<f64, 2> {
    x * (1.0 + (a * a - INNER[0] * INNER[0]) / x.norm_squared()).sqrt()
}

/// σ_rr at the hole of radius a.
fn known(a: f64) -> f64 {
    YIELD / 3.0_f64.sqrt() * (a * a / (OUTER * OUTER + a * a - INNER[0] * INNER[0])).ln()
}

/// The cylinder on a grid of spacing `h`, and the prescribed nodes; their conditions are the last ones of the simulation.
fn cylinder(h: f64) -> Result<(Simulation<2>, Vec<Vector<f64, 2>>), StudyError> {
    let box_side = (INNER[1] * 1.1 / h).ceil() * h;
    let body = format!(
        r#"bodies.0.shape={{"intersection":[{{"difference":{{"of":{{"ball":{{"center":[0,0],"radius":{OUTER}}}}},"minus":{{"ball":{{"center":[0,0],"radius":{}}}}}}}}},{{"box":{{"min":[0,0],"max":[{OUTER},{OUTER}]}}}}]}}"#,
        INNER[0]
    );
    let (bulk, shear) = (40e3, 3.8e3);
    let overrides = [
        format!(r#"grid={{"size":[{box_side},{box_side}],"spacing":{h},"reset":"never"}}"#),
        r#"approximation="linear""#.to_owned(),
        format!(r#"time={{"step":{},"end":1,"scheme":"none","initial_guess":"last_step"}}"#, 1.0 / f64::from(STEPS)),
        body,
        format!(
            r#"bodies.0.material={{"von_mises":{{"elastic":{{"bulk":{bulk},"shear":{shear}}},"yield_stress":{{"initial":{YIELD}}}}}}}"#
        ),
        r#"bodies.0.volumetric="mean_dilatation""#.to_owned(),
        "pressures=[]".to_owned(),
        // Aggregation would constrain second differences of the whole motion, which are large here.
        "aggregation=false".to_owned(),
        r#"solver={"newton":{"tolerance":1e-6,"max_iterations":60}}"#.to_owned(),
        "output={}".to_owned(),
    ];
    let mut simulation: Simulation<2> = shipped::simulation("tube", &overrides)?;
    let side = (INNER[0] / h) as u32;
    let all = (0..=side).flat_map(|i| (0..=side).map(move |k| Vector::from([f64::from(i) * h, f64::from(k) * h])));
    // Linear functions have a support of one cell to each side.
    let nodes: Vec<_> = all.filter(|x| (INNER[0] - 1.5 * h..=INNER[0]).contains(&x.norm())).collect();
    for x in &nodes {
        let curve = |i: usize| {
            let times = (0..=STEPS).map(|step| f64::from(step) / f64::from(STEPS));
            Curve::new(times.map(|t| [t, moved(x, inner(t))[i] - x[i]]).collect())
        };
        simulation.loads.prescribed.push(Prescribed {
            name: "in the hole".into(),
            on: Selection::Region(Shape::from(Ball { center: *x, radius: 0.1 * h })),
            motion: [Some(Motion::Displacement(curve(0)?)), Some(Motion::Displacement(curve(1)?))],
        });
    }
    Ok((simulation, nodes))
}

/// σ_rr from the work of the forces on the prescribed nodes.
fn stress(step: &StepReport<2>, nodes: &[Vector<f64, 2>], a: f64) -> f64 {
    let forces = step.reactions.iter().rev().zip(nodes.iter().rev());
    // dx/da = a x/|x|²
    let power = forces.map(|(reaction, node)| {
        let x = moved(node, a);
        reaction.force.dot(&x) * a / x.norm_squared()
    });
    -power.sum::<f64>() / (0.5 * PI * a)
}

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let end = if *effort == Effort::Full { INNER[1] - 1e-6 } else { DOUBLED };
    let mut table = Table::new(
        "a cylinder that is widened: stress at the hole, MPa",
        ["inner radius", "computed", "formula", "error", "Newton", "Krylov"],
    );
    let (mut simulation, nodes) = cylinder(SPACING)?;
    // The largest error until a has doubled, and the radius up to which all errors are within the bound.
    let (mut doubled, mut reached) = (0.0_f64, INNER[0]);
    let (mut newton, mut krylov) = (0, 0);
    while inner(simulation.clock.time()) < end {
        let Ok(step) = simulation.advance() else { break };
        newton += step.newton.history.iterations.len();
        krylov += step.newton.history.counts.krylov_iterations;
        let a = inner(simulation.clock.time());
        let (computed, known) = (stress(&step, &nodes, a), known(a));
        let error = computed / known - 1.0;
        if a <= DOUBLED {
            doubled = doubled.max(error.abs());
        }
        let over = error.abs() > BOUND;
        if over || simulation.clock.steps() % ROWS == 0 {
            table.push([
                format!("{a:.2}"),
                format!("{computed:.5}"),
                format!("{known:.5}"),
                format!("{:+.2} %", 100.0 * error),
                newton.to_string(),
                krylov.to_string(),
            ]);
        }
        if over {
            break;
        }
        reached = a;
    }
    let mut report = Report::new("a cylinder that is widened: how far its stress is that of the formula", &["what"]);
    report.push(&["error until the inner radius is doubled"], doubled, Bound::AtMost(BOUND));
    if *effort == Effort::Full {
        report.push(&[REACHED], reached, Bound::AtLeast(end));
    }
    report.note(NOTE);
    Ok(Outcome { reports: vec![report], tables: vec![table], ..Outcome::default() })
}

const REACHED: &str = "inner radius to which the error is within 1 %";

const NOTE: &str = "A cell of the reference configuration becomes a/a₀ times as long and as thin: cut from the circle that it follows, its chord leaves \
     (a/a₀)² h/(8 a₀) of its thickness, which is what linear functions miss.";
