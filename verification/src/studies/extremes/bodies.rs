//! Small bodies of regular particles, and their simulations.

use bfree::approximation::Approximation;
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, Gravity, Motion, Prescribed, Selection};
use bfree::particles::{Body, Particles};
use bfree::simulation::{Settings, Simulation, StepReport};
use bfree::solver::{Forcing, Krylov, NewtonSettings};
use bfree::tensor::{Tensor, Vector};

/// Linear momentum over whole steps, relative to Σ m |v|.
pub(super) const MOMENTUM: f64 = 1e-13;

/// Newton's method ends at the latest when ‖R‖ is below 16 floors of 4 eps of the sum of the magnitudes of the contributions to R.
const ROUND_OFF: f64 = 64.0 * f64::EPSILON;

/// A bound of Σ_I |R_I| at the end of Newton's method: over n nodes at most √n ‖R‖. The momentum changes by Δt Σ_I R_I, for any stresses.
pub(super) fn left_by_newton<const D: usize>(settings: &Settings, step: &StepReport<D>) -> f64 {
    let history = &step.newton.history;
    let number = |measured: Option<f64>| measured.unwrap_or(f64::NAN);
    let asked = settings.newton.relative_tolerance * number(history.first_residual);
    let residual = super::worse(asked, ROUND_OFF * number(history.magnitude));
    (step.active_nodes as f64).sqrt() * residual
}

/// A body of Ciarlet's law.
pub(super) fn body(lame: Lame, density: f64) -> Body<Material> {
    Body {
        name: "body".into(),
        law: NeoHookean::ciarlet(lame).into(),
        density,
        dilatation: Default::default(),
        field: 0,
    }
}

/// Λ = G = 1, ρ = 1: a speed of sound of √3.
pub(in crate::studies) const PLAIN: Lame = Lame { lambda: 1.0, shear: 1.0 };

/// Fills the cells `from` … `to` with `per_axis` particles along each axis of a cell.
pub(super) fn fill<const D: usize>(
    particles: &mut Particles<D>,
    grid: &Grid<D>,
    (from, to): ([u32; D], [u32; D]),
    per_axis: u32,
    (body, density): (u32, f64),
) {
    let counts: [u32; D] = std::array::from_fn(|k| (to[k] - from[k]) * per_axis);
    let width = grid.spacing / f64::from(per_axis);
    let volume = width.powi(D as i32);
    for number in 0..counts.iter().product() {
        let mut rest = number;
        let position = Vector::from_fn(|k, _| {
            let index = rest % counts[k];
            rest /= counts[k];
            grid.origin[k] + f64::from(from[k]) * grid.spacing + (f64::from(index) + 0.5) * width
        });
        particles.push(position, Vector::zeros(), volume, density * volume, body);
    }
}

/// Newton's method converges to the last digit, so that results do not depend on tolerances.
pub(super) const TOLERANCE: f64 = 1e-14;

/// Settings with the tolerance [`TOLERANCE`].
pub(in crate::studies) fn settings(lumping: f64) -> Settings {
    Settings {
        lumping,
        newton: NewtonSettings {
            relative_tolerance: TOLERANCE,
            forcing: Forcing::Fixed(1e-8),
            // The list of known failures was measured with this method.
            krylov: Krylov::Gmres { restart: 30 },
            max_krylov_iterations: 5000,
            ..NewtonSettings::default()
        },
        ..Settings::default()
    }
}

/// A simulation without loads.
pub(super) fn simulation<const D: usize>(
    grid: Grid<D>,
    approximation: Approximation,
    particles: Particles<D>,
    bodies: Vec<Body<Material>>,
    dt: f64,
) -> Simulation<D> {
    Simulation { settings: settings(1.0), ..Simulation::new(grid, approximation, bodies, particles, Clock::new(dt, 0)) }
}

/// A block of 2ᴰ particles a cell, `cells` cells wide, in the middle of a box three times as wide, of spacing 1.
pub(in crate::studies) fn block<const D: usize>(cells: u32, approximation: Approximation, dt: f64) -> Simulation<D> {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [3 * cells; D] };
    let mut particles = Particles::default();
    fill(&mut particles, &grid, ([cells; D], [2 * cells; D]), 2, (0, 1.0));
    simulation(grid, approximation, particles, vec![body(PLAIN, 1.0)], dt)
}

/// A condition on one face of the box.
pub(super) fn face<const D: usize>(axis: usize, upper: bool, motion: [Option<Motion<D>>; D]) -> Prescribed<D> {
    Prescribed { name: format!("face {axis} {upper}"), on: Selection::Face { axis, upper }, motion }
}

/// The normal component of a face, held or moved.
pub(super) fn normal<const D: usize>(axis: usize, upper: bool, motion: Motion<D>) -> Prescribed<D> {
    face(axis, upper, std::array::from_fn(|k| (k == axis).then(|| motion.clone())))
}

/// The conditions of a box with sliding faces.
pub(super) fn sliding<const D: usize>() -> Vec<Prescribed<D>> {
    (0..D).flat_map(|axis| [false, true].map(|upper| normal(axis, upper, Motion::Rest))).collect()
}

/// Gravity that is constant in time.
pub(super) fn gravity<const D: usize>(acceleration: Vector<f64, D>) -> Gravity<D> {
    Gravity { acceleration, curve: Curve::constant(1.0) }
}

/// Gives the particles the velocity A (x − c), c being the middle of the box.
pub(in crate::studies) fn stir<const D: usize>(simulation: &mut Simulation<D>, a: &Tensor<f64, D>) {
    let grid = &simulation.grid;
    let centre = grid.origin + Vector::from_fn(|k, _| 0.5 * f64::from(grid.cells[k]) * grid.spacing);
    let particles = &mut simulation.particles;
    for (v, x) in particles.velocity.iter_mut().zip(&particles.position) {
        *v = a * (x - centre);
    }
}

/// Σ m |v|
pub(super) fn sum_of_momenta<const D: usize>(particles: &Particles<D>) -> f64 {
    particles.velocity.iter().zip(&particles.mass).map(|(v, m)| v.norm() * m).sum()
}
