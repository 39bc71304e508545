//! Properties that hold for any layout of particles: affine motion and the patch test. Other studies take its body that spins.

use super::{Effort, Outcome, StudyError, worse};
use crate::check_approximation;
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::approximation::Approximation;
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Law, Material, MaterialState, NeoHookean};
use bfree::mechanics::loads::Loads;
use bfree::mechanics::residual::Equilibrium;
use bfree::mechanics::schemes::{Alphas, Newmark, Scheme, Statics};
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::terms::Step;
use bfree::mechanics::transfer::{Nodal, Update, WallUpdate};
use bfree::particles::{Body, Particles};
use bfree::simulation::{InitialGuess, Settings, Simulation};
use bfree::solver::{Forcing, NewtonSettings};
use bfree::tensor::{Tensor, Vector, identity};

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "affine motion, the patch test, and the shape functions themselves";

/// The error of sums of a few dozen products of size one, times the few cells of the patch.
const EXACT: f64 = 1e-12;

/// Balance of a homogeneous state, relative to the summed magnitudes. N and ∇N have the round-off of positions, some ten spacings from the
/// origin; max-ent also has that of its multipliers.
const BALANCE: f64 = 1e-13;

/// Cells along each axis of the patch.
const CELLS: u32 = 6;

/// All families, LME with the usual largest and smallest width.
fn families() -> Vec<(&'static str, Approximation)> {
    Approximation::examples().into_iter().filter(|(name, _)| !matches!(*name, "lme 1.8" | "lme circle 1.8")).collect()
}

pub(super) fn run(_effort: &Effort) -> Result<Outcome, StudyError> {
    let mut affine = Report::new(
        "affine motion, random layouts with points on nodes, faces, walls and corners",
        &["quantity", "shape", "D"],
    );
    let mut shapes =
        Report::new("shape functions, worst place", &["quantity", "D", "place", "shape"]).as_matrix(&[0, 1], 3, 2);
    for (name, shape) in &families() {
        for cell in check_approximation(shape).cells() {
            let labels: Vec<&str> = cell.labels.iter().map(String::as_str).chain([*name]).collect();
            shapes.push(&labels, cell.value, cell.bound);
        }
    }
    let mut imbalance = Report::new(
        "patch test: force of a homogeneous state on inner nodes over the sum of its magnitudes; judged where theory says 0",
        &["particles", "shape", "D"],
    );
    for (name, shape) in &families() {
        affine_motion::<1>(name, shape, &mut affine)?;
        affine_motion::<2>(name, shape, &mut affine)?;
        affine_motion::<3>(name, shape, &mut affine)?;
        patch_test::<1>(name, shape, &mut imbalance)?;
        patch_test::<2>(name, shape, &mut imbalance)?;
        patch_test::<3>(name, shape, &mut imbalance)?;
    }
    let remarks = vec![
        "Where the patch test does not hold, its imbalance is the quadrature error of particles: functions of x_n are summed, not integrated.".into(),
    ];
    Ok(Outcome { reports: vec![shapes, affine, imbalance], remarks, ..Outcome::default() })
}

/// The grid of the patch; its spacing is a power of two so that points on nodes are exact.
fn grid<const D: usize>() -> Grid<D> {
    Grid { origin: Vector::from_fn(|k, _| k as f64 - 1.0), spacing: 0.5, cells: [CELLS; D] }
}

/// Random points, a third of them with some coordinates on faces, nodes, walls or in corners.
fn layout<const D: usize>(grid: &Grid<D>, count: usize, random: &mut Random) -> Vec<Vector<f64, D>> {
    let last = f64::from(CELLS);
    (0..count)
        .map(|k| {
            let local = Vector::<f64, D>::from_fn(|i, _| {
                let s = random.between(0.0, last);
                match (k % 9, (k / 9 + i) % 2) {
                    (0, 0) | (1, _) => s.floor(),
                    (2, 0) => 0.0,
                    (3, _) => {
                        if s < 0.5 * last {
                            0.0
                        } else {
                            last
                        }
                    }
                    _ => s,
                }
            });
            grid.origin + local * grid.spacing
        })
        .collect()
}

/// Δφ_I = (A − I)(x_I − c) + b must move every particle by the same map and multiply its F by A.
fn affine_motion<const D: usize>(name: &str, shape: &Approximation, report: &mut Report) -> Result<(), StudyError> {
    let mut random = Random::new(17);
    let grid = grid::<D>();
    let mut particles = Particles::default();
    for x in layout(&grid, 60 * D, &mut random) {
        particles.push(x, random.vector(), 1.0, 1.0, 0);
    }
    for h in &mut particles.displacement_gradient {
        *h = random.tensor() * (0.4 / D as f64);
    }
    let (connectivity, nodes) = Connectivity::new(shape, &grid, &particles.position)?;
    let stretch: Tensor<f64, D> = random.tensor() * 0.5;
    let (shift, centre) = (random.vector::<D>() * 0.3, grid.position([CELLS / 2; D]));
    let map = |x: &Vector<f64, D>| stretch * (x - centre) + shift;
    let dphi: Vec<_> = nodes.positions(&grid).map(|(_, x)| map(&x)).collect();
    let nodal = Nodal::project(&particles, &connectivity, 1.0)?;
    let dt = 0.1;
    let alphas: Alphas = Newmark::default().alphas(dt);
    let update = Update::new(&alphas, &nodal, &nodal, &[], WallUpdate::Consistent, &dphi);
    let mut after = particles.clone();
    let bodies: [Body<Material>; 0] = [];
    update.commit(&mut after, &bodies, &connectivity, dt);
    let (mut position, mut strain): (f64, f64) = (0.0, 0.0);
    for p in 0..particles.len() {
        let x = &particles.position[p];
        position = worse(position, (after.position[p] - x - map(x)).amax());
        let f_n = identity::<f64, D>() + particles.displacement_gradient[p];
        let expected = (identity::<f64, D>() + stretch) * f_n - identity::<f64, D>();
        strain = worse(strain, (after.displacement_gradient[p] - expected).amax());
    }
    let dimension = D.to_string();
    report.push(&["x = A x + b", name, &dimension], position, Bound::AtMost(EXACT));
    report.push(&["F = A F_n", name, &dimension], strain, Bound::AtMost(EXACT));

    // An affine velocity of the nodes must reach the particles unchanged.
    let velocity = connectivity.values(&dphi);
    let error = velocity.iter().zip(&particles.position).fold(0.0, |worst, (v, x)| worse(worst, (v - map(x)).amax()));
    report.push(&["v = A x + b", name, &dimension], error, Bound::AtMost(EXACT));
    Ok(())
}

/// The positions of the particles in the patch, two per cell and axis.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Layout {
    /// On the quarter points of the cells.
    Regular,
    /// The quarter points, all moved by one vector.
    Moved,
    /// In each cell at m ± s_k along each axis, with the middle m and a separate s.
    Mirrored,
    /// Each particle moved by up to a tenth of a spacing, within its cell.
    Jittered,
    /// Anywhere.
    Random,
}

impl Layout {
    const ALL: [(Self, &str); 5] = [
        (Self::Regular, "regular"),
        (Self::Moved, "moved"),
        (Self::Mirrored, "mirrored"),
        (Self::Jittered, "jittered"),
        (Self::Random, "random"),
    ];

    /// The particles of the cells `first .. first + count` along each axis.
    fn particles<const D: usize>(self, first: usize, count: usize) -> Vec<Vector<f64, D>> {
        let mut random = Random::new(23);
        let spread: Vec<Vector<f64, D>> =
            (0..count.pow(D as u32)).map(|_| Vector::from_fn(|_, _| random.between(0.05, 0.45))).collect();
        let all = Vector::from_fn(|k, _| [0.13, -0.07, 0.19][k]);
        let end = (first + count) as f64;
        let particle = |p: usize| {
            let at: [usize; D] = std::array::from_fn(|k| p / (2 * count).pow(k as u32) % (2 * count));
            let cell = (0..D).map(|k| at[k] / 2 * count.pow(k as u32)).sum::<usize>();
            let place = |s: &Vector<f64, D>| {
                Vector::<f64, D>::from_fn(|k, _| {
                    let (middle, side) = ((first + at[k] / 2) as f64 + 0.5, (at[k] % 2) as f64 * 2.0 - 1.0);
                    middle + side * s[k]
                })
            };
            let quarter = place(&Vector::repeat(0.25));
            match self {
                Self::Regular => quarter,
                Self::Moved => quarter + all,
                Self::Mirrored => place(&spread[cell]),
                Self::Jittered => quarter + random.vector() * 0.1,
                Self::Random => Vector::from_fn(|_, _| random.between(first as f64, end)),
            }
        };
        (0..(2 * count).pow(D as u32)).map(particle).collect()
    }

    /// Whether a uniform stress must be in balance on nodes that feel no wall and no rim, Σ_p V ∇N_I = 0:
    ///
    /// - regular: the layout is its own mirror image about every node, and ∇N_I is odd there, for any family that knows no left and right;
    /// - moved: by Poisson's formula the sum over a lattice of spacing h/m is that of the transform of ∇N_I at multiples of 2πm/h. There it
    ///   vanishes for functions that are a convolution with the hat of a cell: B-splines of any degree, linear functions and GIMP among
    ///   them (Strang, Fix 1971), not for max-ent;
    /// - mirrored: in a cell, ∂N_I/∂x_k of linear functions does not depend on x_k and is a product of polynomials of degree 1 in the
    ///   others, which two points about the middle integrate exactly; in 1D, a constant, any layout with as many particles in each cell.
    fn balanced(self, shape: &Approximation, dimension: usize) -> bool {
        let linear = matches!(shape, Approximation::Linear(_));
        match self {
            Self::Regular => true,
            Self::Moved => !matches!(shape, Approximation::Lme(_) | Approximation::LmeCircle(_)),
            Self::Mirrored => linear,
            Self::Jittered => linear && dimension == 1,
            Self::Random => false,
        }
    }
}

/// The patch test: the internal forces of a homogeneous deformation, over the sums of their magnitudes, at nodes outside the influence of
/// the rim. The influence of walls must not reach them either, not even through the node lists of max-ent functions.
fn patch_test<const D: usize>(name: &str, shape: &Approximation, report: &mut Report) -> Result<(), StudyError> {
    // Node lists reach up to 4.2 spacings. The particles lie at least 5 from the walls and at least 5 beyond the judged nodes.
    let (cells, first, count, judged) = (22, 5, 12, 10..=12);
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [cells; D] };
    let volume = 0.5_f64.powi(D as i32);
    let law = Material::from(NeoHookean::ciarlet(Lame::new(150.0, 30.0)?));
    let h = Random::new(37).tensor::<D>() * 0.3;
    let at = MaterialState::new(h);
    let stress = volume * (at.f * law.stress(&at) * at.f.transpose()).norm();
    let bodies = [Body { name: "patch".into(), law, density: 1.0, dilatation: Default::default(), field: 0 }];
    for (layout, label) in Layout::ALL {
        let mut particles = Particles::default();
        layout.particles(first, count).into_iter().for_each(|x| particles.push_without_inertia(x, volume, volume, 0));
        particles.displacement_gradient.fill(h);
        let (connectivity, nodes) = Connectivity::new(shape, &grid, &particles.position)?;
        let (at_rest, nodal) = (vec![Vector::zeros(); nodes.len()], Nodal::default());
        let (particles, bodies, connectivity, loads) = (&particles, &bodies, &connectivity, &Loads::default());
        let (nodal, alphas, lumping, time, dt) = (&nodal, Statics::default().end(0.0), 1.0, 0.0, 0.0);
        let step = Step { particles, bodies, loads, connectivity, nodal, alphas, lumping, time, dt, poses: None };
        let equilibrium = Equilibrium::new(step, &[]);
        let force = equilibrium.residual::<f64>(&at_rest)?;
        let mut size = vec![0.0; nodes.len()];
        for p in 0..particles.len() {
            connectivity.of(p).for_each(|(node, _, grad_n)| size[node] += grad_n.norm() * stress);
        }
        let inner = nodes.positions(&grid).map(|(index, _)| index.iter().all(|i| judged.contains(i)));
        let worst = (force.iter().zip(&size).zip(inner).filter(|(_, inner)| *inner))
            .fold(0.0, |worst, ((f, s), _)| worse(worst, f.norm() / s));
        let bound = if layout.balanced(shape, D) { Bound::AtMost(BALANCE) } else { Bound::Reported };
        report.push(&[label, name, &D.to_string()], worst, bound);
    }
    Ok(())
}

/// A square with jittered particles that spins and vibrates in the middle of a large box.
pub(super) fn spinning(shape: &Approximation, lumping: f64, dt: f64) -> Result<Simulation<2>, StudyError> {
    let mut random = Random::new(31);
    let centre = Vector::from([6.0, 6.0]);
    let mut particles = Particles::default();
    for j in 0..8 {
        for i in 0..8 {
            let x =
                Vector::from([f64::from(i), f64::from(j)]) * 0.5 + Vector::from([4.25, 4.25]) + random.vector() * 0.1;
            let r = x - centre;
            // Translation, rotation, and a breathing mode.
            let v = Vector::from([0.3, 0.2]) + Vector::from([-r[1], r[0]]) * 0.5 + r * 0.2;
            particles.push(x, v, 0.25, 1.0, 0);
        }
    }
    let law = Material::from(NeoHookean::ciarlet(Lame::new(15.0, 10.0)?));
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [12, 12] };
    let bodies = vec![Body { name: "square".into(), law, density: 4.0, dilatation: Default::default(), field: 0 }];
    Ok(Simulation {
        settings: Settings {
            lumping,
            initial_guess: InitialGuess::Velocity,
            newton: NewtonSettings {
                relative_tolerance: 1e-14,
                forcing: Forcing::Fixed(1e-6),
                ..NewtonSettings::default()
            },
            ..Settings::default()
        },
        ..Simulation::new(grid, shape.clone(), bodies, particles, Clock::new(dt, 0))
    })
}

/// Σ m x × v about the centre of mass.
pub(super) fn angular_momentum(particles: &Particles<2>) -> f64 {
    let mass: f64 = particles.mass.iter().sum();
    let centre = particles.position.iter().zip(&particles.mass).map(|(x, &m)| x * m).sum::<Vector<f64, 2>>() / mass;
    (0..particles.len())
        .map(|p| {
            let (x, v) = (particles.position[p] - centre, &particles.velocity[p]);
            particles.mass[p] * (x[0] * v[1] - x[1] * v[0])
        })
        .sum()
}
