//! Manufactured solutions with large rotation and large strain and a grid reset in every step: observed orders in space. The study `order`
//! has the total Lagrangian orders, and those in time.

use super::{Effort, Outcome, StudyError};
use crate::manufactured::{AxisAligned, Motion, Vortex, force_field, state};
use crate::report::{Bound, Report};
use crate::table::Table;
use bfree::approximation::Approximation;
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{self, Loads, Prescribed, Selection};
use bfree::mechanics::transfer::WallUpdate;
use bfree::particles::{Body, Particles};
use bfree::simulation::{Settings, Simulation};
use bfree::solver::{Forcing, NewtonSettings};
use bfree::tensor::Vector;

/// The summary in the list of studies.
pub(super) const ABOUT: &str =
    "orders in space on a vortex and on an axis-aligned motion, the grid renewed in every step";

/// Particles along each axis of a cell.
const PER_AXIS: u32 = 2;

/// Δt over h; waves travel 1.2 per unit of time, so the Courant number is about a half.
const STEP_OVER_SPACING: f64 = 0.4;

/// The least order in space of the position error where ∇N is continuously differentiable.
///
/// With fixed particles per cell, the sums over particles leave a force error of σ/h times a number that does not fall with h (Steffen,
/// Kirby, Berzins 2008). On the scale of the grid this error moves nodes by h times that number. So the order is 1 once the interpolation
/// error, of order 2, is smaller. The study requires 0.8 of that order.
const ORDER: f64 = 0.8;

/// One family.
struct Family {
    name: &'static str,
    shape: Approximation,
    /// Whether ∇N is continuously differentiable, to rounding. If it has jumps or kinks (LME with a large γ̂ is nearly linear), the number
    /// is large and changes as particles cross faces. It then shakes the grid without damping, more often on finer grids, and no order is
    /// guaranteed.
    smooth: bool,
}

/// All families with a lumped mass; LME with the largest width and with the paper's.
fn families(effort: Effort) -> Vec<Family> {
    let left_out = |name| match name {
        "lme 1.8" | "lme circle 1.8" | "not-a-knot quadratic" | "not-a-knot cubic" => true,
        "lme circle 3" => effort == Effort::Short,
        _ => false,
    };
    let examples = Approximation::examples().into_iter().filter(|(name, _)| !left_out(*name));
    examples.map(|(name, shape)| Family { name, shape, smooth: matches!(name, "cubic" | "lme 0.8") }).collect()
}

/// A motion of a body in a box.
trait Problem: Motion<2> + Copy + Send + 'static {
    /// The box, in cells of edge `h`.
    fn grid(&self, h: f64) -> Grid<2>;
    /// Whether there is matter at the reference position `x`.
    fn holds(&self, x: &Vector<f64, 2>) -> bool;
    /// Whether the body touches the walls of the box.
    const WALLS: bool;
    /// The number of halvings from h = 1/8 to the finest h.
    fn halvings(&self, effort: Effort) -> i32;
}

impl Problem for AxisAligned {
    fn grid(&self, h: f64) -> Grid<2> {
        Grid { origin: Vector::zeros(), spacing: h, cells: [(1.0 / h).round() as u32; 2] }
    }
    fn holds(&self, _: &Vector<f64, 2>) -> bool {
        true
    }
    const WALLS: bool = true;
    fn halvings(&self, _: Effort) -> i32 {
        2
    }
}

impl Problem for Vortex {
    fn grid(&self, h: f64) -> Grid<2> {
        Grid { origin: Vector::from([-1.5, -1.5]), spacing: h, cells: [(3.0 / h).round() as u32; 2] }
    }
    fn holds(&self, x: &Vector<f64, 2>) -> bool {
        x.norm() < 1.1875
    }
    const WALLS: bool = false;
    fn halvings(&self, effort: Effort) -> i32 {
        if effort == Effort::Short { 1 } else { 2 }
    }
}

/// A run to t = 1 in `steps` steps on cells of edge `h`. Returns the final particles, ordered by id, and their reference positions.
fn simulate<P: Problem>(
    problem: &P,
    shape: &Approximation,
    h: f64,
    steps: u32,
) -> Result<(Simulation<2>, Vec<Vector<f64, 2>>), StudyError> {
    let law = Material::from(NeoHookean::ciarlet(Lame::from_young_poisson(1.0, 0.3)?));
    let grid = problem.grid(h);
    let density = 1.0;
    let mut particles = Particles::default();
    let mut reference = Vec::new();
    let volume = (h / f64::from(PER_AXIS)).powi(2);
    for j in 0..grid.cells[1] * PER_AXIS {
        for i in 0..grid.cells[0] * PER_AXIS {
            let x = grid.origin + Vector::from([f64::from(i) + 0.5, f64::from(j) + 0.5]) * (h / f64::from(PER_AXIS));
            if problem.holds(&x) {
                let start = state(problem, &x, 0.0);
                particles.push(start.position, start.velocity, volume, density * volume, 0);
                if let Some(a) = particles.acceleration.last_mut() {
                    *a = start.acceleration;
                }
                reference.push(x);
            }
        }
    }
    let prescribed = if P::WALLS {
        let walls = [(0, false), (0, true), (1, false), (1, true)];
        walls
            .map(|(axis, upper)| {
                let mut motion = [None, None];
                motion[axis] = Some(loads::Motion::Rest);
                Prescribed { name: "wall".into(), on: Selection::Face { axis, upper }, motion }
            })
            .to_vec()
    } else {
        Vec::new()
    };
    let bodies =
        vec![Body { name: "body".into(), law: law.clone(), density, dilatation: Default::default(), field: 0 }];
    let mut simulation = Simulation {
        loads: Loads {
            prescribed,
            field: Some(force_field(*problem, law, density, reference.clone())),
            ..Loads::default()
        },
        settings: Settings {
            wall_update: WallUpdate::Consistent,
            newton: NewtonSettings { forcing: Forcing::Fixed(1e-3), ..NewtonSettings::default() },
            ..Settings::default()
        },
        ..Simulation::new(grid, shape.clone(), bodies, particles, Clock::new(1.0 / f64::from(steps), 0))
    };
    for _ in 0..steps {
        simulation.step()?;
    }
    simulation.particles = simulation.particles.by_id();
    Ok((simulation, reference))
}

/// Root mean squares over the particles of the errors of position, velocity and F at t = 1.
fn errors<P: Problem>(problem: &P, simulation: &Simulation<2>, reference: &[Vector<f64, 2>]) -> [f64; 3] {
    let particles = &simulation.particles;
    let mut sums = [0.0; 3];
    for (p, x) in reference.iter().enumerate() {
        let exact = state(problem, x, simulation.clock.time());
        sums[0] += (particles.position[p] - exact.position).norm_squared();
        sums[1] += (particles.velocity[p] - exact.velocity).norm_squared();
        sums[2] += (particles.displacement_gradient[p] - exact.displacement_gradient).norm_squared();
    }
    sums.map(|sum| (sum / reference.len() as f64).sqrt())
}

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut outcome = Outcome::default();
    let mut report = Report::new("orders of the manufactured solutions", &["quantity", "shape", "motion"]);
    space(&AxisAligned::default(), "axis-aligned", *effort, &mut report, &mut outcome);
    space(&Vortex::default(), "vortex", *effort, &mut report, &mut outcome);
    outcome.reports.push(report);
    outcome.remarks.push(
        "In space only functions with smooth gradients converge: linear functions and LME with a large gamma diverge or stand still, GIMP and \
         quadratic B-splines stop where the quadrature error of their kinks is reached (F off by 6 percent, whatever h)."
            .into(),
    );
    Ok(outcome)
}

/// The study in space: h is refined, with Δt in proportion.
fn space<P: Problem>(problem: &P, motion: &str, effort: Effort, report: &mut Report, outcome: &mut Outcome) {
    let spacings: Vec<f64> = (0..=problem.halvings(effort)).map(|k| 0.125 * 0.5_f64.powi(k)).collect();
    let mut table = Table::new(
        format!("{motion}: rms errors at t = 1 in space, dt = {STEP_OVER_SPACING} h"),
        ["shape", "h", "steps", "position", "order", "velocity", "order", "F", "order"],
    );
    for family in families(effort) {
        let mut found: Vec<[f64; 3]> = Vec::new();
        for h in &spacings {
            let steps = (1.0 / (STEP_OVER_SPACING * h)).ceil() as u32;
            let errors = match simulate(problem, &family.shape, *h, steps) {
                Ok((simulation, reference)) => errors(problem, &simulation, &reference),
                Err(error) => {
                    report.push_error(&[&format!("run at h = {h}"), family.name, motion], error.as_ref());
                    break;
                }
            };
            let mut row = vec![family.name.into(), format!("{h}"), steps.to_string()];
            for (k, error) in errors.iter().enumerate() {
                let order = found.last().map(|before| (before[k] / error).log2());
                row.extend([format!("{error:.3e}"), order.map_or("-".into(), |order| format!("{order:.2}"))]);
            }
            table.push(row);
            found.push(errors);
        }
        if let [coarse, .., fine] = &found[..] {
            let order = (coarse[0] / fine[0]).log2() / (found.len() - 1) as f64;
            let bound = if family.smooth { Bound::AtLeast(ORDER) } else { Bound::Reported };
            report.push(&["order in space, position", family.name, motion], order, bound);
        }
    }
    outcome.tables.push(table);
}
