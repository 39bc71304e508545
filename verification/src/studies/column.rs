//! A column compacted by its own weight in load steps without inertia, against its analytical stress and displacement.
//!
//! In uniaxial strain the stress is the weight above, for any law: P(X) = −ρ₀ g (H − X). The law gives the stretch, P(λ) = P(X), and u(X) =
//! ∫ (λ − 1) dX.

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report};
use crate::shipped;
use crate::table::Table;
use bfree::material::{Law, Material, MaterialState};
use bfree::simulation::Simulation;
use bfree::tensor::Tensor;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "a column compacted by its own weight without inertia, against its analytical stress";

/// ρ₀, g and H of the scene.
const WEIGHT: (f64, f64, f64) = (2700.0, 9.81, 1.0);

/// (name, scene key, least order of the stress in one load step, largest error of the stress in ten, largest error of the displacement of
/// the top with ten cells)
const SHAPES: [(&str, &str, f64, f64, f64); 6] = [
    ("linear", "\"linear\"", 0.95, 0.2, 0.015),
    ("uGIMP", "\"gimp\"", 0.95, 0.03, 0.015),
    ("quadratic B-splines", r#"{"bspline":{"degree":2}}"#, 1.95, 0.03, 0.015),
    ("cubic B-splines", r#"{"bspline":{"degree":3}}"#, 2.95, 0.01, 0.007),
    ("LME 3", r#"{"lme":{"gamma":3}}"#, 0.95, 0.07, 0.015),
    ("LME 1.4", r#"{"lme":{"gamma":1.4}}"#, 0.95, 0.07, 0.007),
];

/// Least order of the displacement in one load step.
const ORDER_OF_DISPLACEMENT: f64 = 1.95;

/// Errors relative to ρ₀ g H, in the mean square over the particles, and to the displacement of the top.
struct Errors {
    stress: f64,
    displacement: f64,
    newton: usize,
    krylov: usize,
}

/// λ with P(λ) = `stress`, by bisection.
fn stretch(law: &Material, stress: f64) -> f64 {
    let piola = |stretch: f64| {
        let at = MaterialState::new(Tensor::<f64, 1>::new(stretch - 1.0)).admissible();
        at.map_or(f64::NAN, |at| stretch * law.stress(&at)[0])
    };
    let (mut low, mut high) = (0.01, 10.0);
    while high - low > 1e-15 * high {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if piola(middle) < stress { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

fn column(shape: &str, cells: u32, steps: u32) -> Result<Errors, StudyError> {
    let (density, g, height) = WEIGHT;
    let h = height / f64::from(cells);
    let wide = 4.0 * h;
    let overrides = [
        format!("approximation={shape}"),
        format!("grid={{\"size\":[{wide},{height}],\"spacing\":{h}}}"),
        format!("bodies.0.shape={{\"box\":{{\"min\":[0,0],\"max\":[{wide},{height}]}}}}"),
        format!("time.step={}", 1.0 / f64::from(steps)),
        "output.probes=[]".to_owned(),
    ];
    let mut simulation: Simulation<2> = shipped::simulation("column_static", &overrides)?;
    let start = simulation.particles.position.clone();
    let (mut newton, mut krylov) = (0, 0);
    for _ in 0..steps {
        let history = simulation.advance()?.newton.history;
        newton += history.iterations.len();
        krylov += history.counts.krylov_iterations;
    }
    let particles = simulation.particles.by_id();
    let law = &simulation.bodies[0].law;
    let carried = |x: f64| -density * g * (height - x);
    let (mut squares, mut top) = (0.0, 0);
    for (p, x) in start.iter().enumerate() {
        let at = particles.state(p, 0.0).admissible()?;
        let piola = at.f * law.stress(&at);
        squares += ((piola[(1, 1)] - carried(x[1])) / (density * g * height)).powi(2);
        if x[1] > start[top][1] {
            top = p;
        }
    }
    // Simpson's rule.
    let (x, parts) = (start[top][1], 1000);
    let weight = |k: i32| if k == 0 || k == parts { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
    let at = |k: i32| stretch(law, carried(x * f64::from(k) / f64::from(parts))) - 1.0;
    let exact = (0..=parts).map(|k| weight(k) * at(k)).sum::<f64>() * x / f64::from(3 * parts);
    let displacement = particles.position[top][1] - x;
    Ok(Errors {
        stress: (squares / start.len() as f64).sqrt(),
        displacement: (displacement / exact - 1.0).abs(),
        newton,
        krylov,
    })
}

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let cells: &[u32] = if *effort == Effort::Full { &[10, 20, 40, 80] } else { &[10, 20, 40] };
    let mut report =
        Report::new("static compaction of a column against its analytical stress", &["of", "shape", "load steps"]);
    let header = ["shape", "load steps", "cells", "stress", "order", "top displacement", "order", "Newton", "Krylov"];
    let mut table = Table::new(
        "errors relative to the stress at the foot (mean square) and to the displacement of the top",
        header,
    );
    for (name, shape, least_order, largest, largest_of_top) in SHAPES {
        for steps in [1, 10] {
            let mut before: Option<Errors> = None;
            for &n in cells {
                let errors = column(shape, n, steps)?;
                let order = |of: fn(&Errors) -> f64| before.as_ref().map(|before| (of(before) / of(&errors)).log2());
                let orders = [order(|e| e.stress), order(|e| e.displacement)];
                let shown = orders.map(|order| order.map_or_else(|| "-".to_owned(), |order| format!("{order:.2}")));
                let [of_stress, of_displacement] = shown;
                table.push([
                    name.to_owned(),
                    steps.to_string(),
                    n.to_string(),
                    format!("{:.2e}", errors.stress),
                    of_stress,
                    format!("{:.2e}", errors.displacement),
                    of_displacement,
                    errors.newton.to_string(),
                    errors.krylov.to_string(),
                ]);
                if n == 10 {
                    let label = steps.to_string();
                    report.push(&["top, 10 cells", name, &label], errors.displacement, Bound::AtMost(largest_of_top));
                }
                if Some(&n) == cells.last() {
                    let label = steps.to_string();
                    let least =
                        [("order of the stress", least_order), ("order of the displacement", ORDER_OF_DISPLACEMENT)];
                    for ((what, least), order) in least.into_iter().zip(orders).filter(|_| steps == 1) {
                        let order = order.ok_or("one grid alone has no order")?;
                        report.push(&[what, name, &label], order, Bound::AtLeast(least));
                    }
                    let bound = if steps == 1 { Bound::Reported } else { Bound::AtMost(largest) };
                    report.push(&["error of the stress", name, &label], errors.stress, bound);
                }
                before = Some(errors);
            }
        }
    }
    report.note(NOTE);
    Ok(Outcome { reports: vec![report], tables: vec![table], ..Outcome::default() })
}

const NOTE: &str = "In one load step from rest the particles stay where they are good quadrature points, and errors fall with h. In several, particles cross \
     cells between the steps: the quadrature error that this makes in the stress does not fall with h, for any shape function; the smoother it is, the less.";
