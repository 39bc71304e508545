//! Orders in h and in Δt at large deformation: whole total Lagrangian steps against known solutions; the errors of grid resets; and the
//! energy that an impact loses.

mod beam;
mod block;
mod hole;
mod rebound;
mod ring;
mod shell;
mod transfers;
mod vortex;

use super::{Effort, Outcome, StudyError};
use crate::manufactured::{Motion, State, force_field, state};
use crate::report::{Bound, Report};
use crate::table::Table;
use bfree::approximation::Approximation;
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Law, Material, MaterialState, NeoHookean};
use bfree::mechanics::loads::{self, Curve, Loads, Prescribed, Pressing, Selection, SurfaceLoad, SurfacePoint};
use bfree::particles::{Body, Particles};
use bfree::shape::{self, Ball, Block, Difference, Fill, Filling, GridBox, Seed, Shape, fill};
use bfree::simulation::{InitialGuess, Settings, Simulation};
use bfree::tensor::{Tensor, Vector};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "orders in h and dt at large deformation on a grid that is kept; what its grid_reset costs; the energy that the rebound loses";

/// The allowed shortfall of an observed order. An error C hᵖ (1 + c h) of a body with c = 2, from 16 to 32 cells across, shows the order p
/// + 2 (1/16 − 1/32)/ln 2.
const NEAR: f64 = 0.1;

/// The positions of the particles of a cell.
struct Layout {
    name: &'static str,
    filling: Filling,
}

impl Layout {
    const fn new(name: &'static str, per_axis: u32, layout: shape::Layout, degree: u32) -> Self {
        Self { name, filling: Filling { per_axis, layout, rule: Fill::Cut, degree } }
    }
}

const REGULAR: Layout = Layout::new("regular", 2, shape::Layout::Regular, 1);

/// Gauss points of functions that are polynomials between nodes.
const GAUSS: Layout = Layout::new("Gauss", 2, shape::Layout::Gauss, 3);

/// Gauss points of quadratic B-splines, which are polynomials from the middle of one cell to the middle of the next.
const GAUSS_OF_MIDDLES: Layout = Layout::new("Gauss, of middles", 2, shape::Layout::Gauss, 2);

const GAUSS_3: Layout = Layout::new("Gauss 3", 3, shape::Layout::Gauss, 3);

/// A body that fills the box of its grid, held at its faces. The body force of a known motion moves it.
struct Held<M, const D: usize> {
    motion: M,
    simulation: Simulation<D>,
    /// X of the particles, by id.
    reference: Vec<Vector<f64, D>>,
    /// The number of products with the tangent, times the number of particles.
    work: f64,
}

impl<M: Motion<D> + Copy + Send + 'static, const D: usize> Held<M, D> {
    fn new(
        motion: M,
        grid: Grid<D>,
        (shape, layout): (&Approximation, &Layout),
        hole: Option<&Ball<D>>,
        dt: f64,
        settings: Settings,
    ) -> Result<Self, StudyError> {
        let law = Material::from(NeoHookean::ciarlet(Lame::from_young_poisson(1.0, 0.3)?));
        let inertia = settings.scheme.has_inertia();
        let mut particles = Particles::default();
        let mut body = Shape::from(Block { min: grid.origin, max: grid.position(grid.cells) });
        if let Some(hole) = hole {
            body = Difference { of: Box::new(body), minus: Box::new(hole.clone().into()) }.into();
        }
        for (number, Seed { position: x, volume }) in fill(&grid, &body, layout.filling)?.into_iter().enumerate() {
            if inertia {
                let start = state(&motion, &x, 0.0);
                particles.push(x, start.velocity, volume, volume, 0);
                particles.acceleration[number] = start.acceleration;
            } else {
                particles.push_without_inertia(x, volume, volume, 0);
            }
        }
        let surface =
            hole.map_or(Ok(Vec::new()), |hole| tractions((&motion, &law), &grid, (&body, hole), &mut particles))?;
        let reference = particles.position.clone();
        let faces = (0..D).flat_map(|axis| [false, true].map(|upper| Selection::Face { axis, upper }));
        let wall =
            |on| Prescribed { name: "wall".into(), on, motion: std::array::from_fn(|_| Some(loads::Motion::Rest)) };
        let loads = Loads {
            prescribed: faces.map(wall).collect(),
            field: Some(force_field(motion, law.clone(), 1.0, reference.clone())),
            surface,
            ..Loads::default()
        };
        let settings = Settings { initial_guess: InitialGuess::LastStep, ..settings };
        let bodies = vec![Body { name: "body".into(), law, density: 1.0, dilatation: Default::default(), field: 0 }];
        let clock = Clock::new(dt, 0);
        let simulation =
            Simulation { loads, settings, ..Simulation::new(grid, shape.clone(), bodies, particles, clock) };
        Ok(Self { motion, simulation, reference, work: 0.0 })
    }

    fn after(mut self, steps: u32) -> Result<Self, StudyError> {
        for _ in 0..steps {
            let products = self.simulation.step()?.newton.history.counts.tangent_products;
            self.work += (products * self.reference.len()) as f64;
        }
        Ok(self)
    }

    /// √(Σ V d²) over √(Σ V s²), with the difference d from the exact value and the exact value s.
    fn relative(&self, squares: impl Fn(&Particles<D>, usize, &State<D>) -> [f64; 2]) -> f64 {
        let particles = &self.simulation.particles;
        let mut sums = [0.0; 2];
        for p in 0..particles.len() {
            let exact = state(&self.motion, &self.reference[particles.id[p] as usize], self.simulation.clock.time());
            let here = squares(particles, p, &exact);
            (0..2).for_each(|k| sums[k] += particles.volume[p] * here[k]);
        }
        (sums[0] / sums[1]).sqrt()
    }

    /// The relative error of the displacement.
    fn displacement(&self) -> f64 {
        self.relative(|particles, p, exact| {
            let x = self.reference[particles.id[p] as usize];
            [(particles.position[p] - exact.position).norm_squared(), (exact.position - x).norm_squared()]
        })
    }

    /// The relative error of the velocity.
    fn velocity(&self) -> f64 {
        self.relative(|particles, p, exact| {
            [(particles.velocity[p] - exact.velocity).norm_squared(), exact.velocity.norm_squared()]
        })
    }

    /// The relative error of the Kirchhoff stress τ = F S Fᵀ.
    fn stress(&self) -> f64 {
        let law = &self.simulation.bodies[0].law;
        let tau = |h: Tensor<f64, D>| {
            let at = MaterialState::new(h);
            at.f * law.stress(&at) * at.f.transpose()
        };
        self.relative(|particles, p, exact| {
            let of_exact = tau(exact.displacement_gradient);
            [(tau(particles.displacement_gradient[p]) - of_exact).norm_squared(), of_exact.norm_squared()]
        })
    }
}

/// The tractions P N of the motion at t = 1 on a hole, proportional to t. Each point of the surface becomes a particle with a load.
fn tractions<M: Motion<D>, const D: usize>(
    (motion, law): (&M, &Material),
    grid: &Grid<D>,
    (body, hole): (&Shape<D>, &Ball<D>),
    particles: &mut Particles<D>,
) -> Result<Vec<SurfaceLoad<D>>, StudyError> {
    // The number of boxes per cell, as in scenes with Gauss points.
    const BOXES: usize = 2;
    let edges = Vector::repeat(grid.spacing / BOXES as f64);
    let around = Ball { radius: hole.radius + grid.spacing, ..hole.clone() }.into();
    let mut loads = Vec::new();
    for number in 0..grid.cells.iter().map(|&cells| BOXES * cells as usize).product() {
        let mut rest: usize = number;
        let lower = Vector::from_fn(|k, _| {
            let across = BOXES * grid.cells[k] as usize;
            let at = rest % across;
            rest /= across;
            grid.origin[k] + at as f64 * edges[k]
        });
        for facet in body.surface_points(Some(&around), &GridBox { lower, edges, spacing: grid.spacing }) {
            let at = MaterialState::new(state(motion, &facet.position, 1.0).displacement_gradient);
            let traction = at.f * law.stress(&at) * facet.normal;
            let point = SurfacePoint::new(particles.len(), facet.normal, facet.area);
            // The particle lies slightly inside, in the cell of the body.
            particles.push_without_inertia(facet.position - facet.normal * (1e-6 * grid.spacing), 0.0, 0.0, 0);
            let curve = Curve::new(vec![[0.0, 0.0], [1.0, 1.0]])?;
            loads.push(SurfaceLoad { pressing: Pressing::Traction(traction), curve, points: vec![point] });
        }
    }
    Ok(loads)
}

/// Errors of one case on a sequence of grids.
struct Refined<'a, const N: usize> {
    report: &'a mut Report,
    table: &'a mut Table,
    /// The measured quantities, and the least order of each.
    least: [(&'static str, Bound); N],
}

impl<const N: usize> Refined<'_, N> {
    /// Runs the case for each number of cells; the closure returns its errors and its work. The orders between the last two are judged.
    fn run(
        self,
        labels: &[&str],
        sizes: &[u32],
        run: impl Fn(u32) -> Result<([f64; N], f64), StudyError>,
    ) -> Vec<(f64, [f64; N])> {
        let mut found: Vec<(f64, [f64; N])> = Vec::new();
        let mut orders = [f64::NAN; N];
        for &cells in sizes {
            let (errors, work) = match run(cells) {
                Ok(run) => run,
                Err(error) => {
                    let mut labels = labels.to_vec();
                    let place = format!("{cells} cells");
                    labels.insert(0, &place);
                    self.report.push_error(&labels, error.as_ref());
                    return found;
                }
            };
            let size = f64::from(cells);
            let mut row: Vec<String> = labels.iter().map(|&label| label.into()).collect();
            row.push(cells.to_string());
            for k in 0..N {
                row.push(format!("{:.2e}", errors[k]));
                row.push(found.last().map_or("-".into(), |(before, coarse)| {
                    orders[k] = (coarse[k] / errors[k]).ln() / (size / before).ln();
                    format!("{:.2}", orders[k])
                }));
            }
            row.push(format!("{work:.1e}"));
            self.table.push(row);
            found.push((size, errors));
        }
        for ((what, bound), order) in self.least.into_iter().zip(orders) {
            let labels: Vec<&str> = std::iter::once(what).chain(labels.iter().copied()).collect();
            self.report.push(&labels, order, bound);
        }
        found
    }
}

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut outcome = Outcome::default();
    block::run(*effort, &mut outcome);
    hole::run(*effort, &mut outcome);
    ring::run(*effort, &mut outcome);
    shell::run(*effort, &mut outcome);
    beam::run(&mut outcome)?;
    vortex::run(*effort, &mut outcome)?;
    transfers::run(&mut outcome);
    rebound::run(*effort, &mut outcome)?;
    outcome.remarks.push(
        "On a grid that is kept, functions of degree p on Gauss points of their own pieces have order p + 1 in the displacement and p in the \
         stress. B-splines that do not curve at a wall where the displacement does have 2.5 and 1.5, whatever p; without a knot beside the \
         wall they have their own order again. Regular particles have 2 and 1.5. A lumped mass leaves order 2."
            .into(),
    );
    Ok(outcome)
}
