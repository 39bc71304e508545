//! Lagrangian finite elements with the same residual: elements are another way to make shape-function values.
//!
//! Gauss points take the place of particles and stay at X. The nodes of serendipity elements (three in 1D, eight in 2D, twenty in 3D) are
//! nodes of a grid of half the element's size. With F_n = I and the whole displacement u as Δφ, the residual of a step is that of the total
//! Lagrangian method.

use bfree::approximation::{ApproximationError, Scratch, Separable, ShapeFunction, Support, Validate};
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::Law;
use bfree::mechanics::loads::{Loads, prescribed_dofs};
use bfree::mechanics::residual::{Equilibrium, Inadmissible};
use bfree::mechanics::schemes::{Newmark, Scheme};
use bfree::mechanics::sweep::Supports;
use bfree::mechanics::terms::Step;
use bfree::mechanics::transfer::Nodal;
use bfree::nodes::Nodes;
use bfree::particles::{Body, Particles};
use bfree::pooled::Pool;
use bfree::simulation::StepError;
use bfree::solver::{BlockJacobi, NewtonReport, NewtonSettings, newton};
use bfree::tensor::Vector;
use std::sync::Arc;

/// Quadratic serendipity elements whose corners are every second node of the grid, which must have an even number of cells
/// along each axis.
#[derive(Clone, Copy, Debug)]
struct Serendipity;

impl Validate for Serendipity {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        Ok(())
    }
}

impl ShapeFunction for Serendipity {
    fn evaluate<const D: usize>(
        &self,
        grid: &Grid<D>,
        x: &Vector<f64, D>,
        _scratch: &mut Scratch,
        out: &mut Support<D>,
    ) -> Result<(), ApproximationError> {
        let Some(cell) = grid.cell(x) else {
            let last = grid.position(grid.cells);
            return Err(ApproximationError::Outside {
                position: x.as_slice().to_vec(),
                lower: grid.origin.as_slice().to_vec(),
                upper: last.as_slice().to_vec(),
            });
        };
        let middle = cell.map(|cell| cell - cell % 2 + 1);
        let xi = (x - grid.position(middle)) / grid.spacing;
        out.clear();
        for code in 0..3_usize.pow(D as u32) {
            let at: [f64; D] = std::array::from_fn(|k| (code / 3_usize.pow(k as u32) % 3) as f64 - 1.0);
            let (value, gradient) = match at.iter().filter(|&&a| a == 0.0).count() {
                0 => corner(&xi, &at),
                1 => midside(&xi, &at),
                _ => continue,
            };
            let node = std::array::from_fn(|k| (f64::from(middle[k]) + at[k]) as u32);
            out.push(node, value, gradient.map(|g| g / grid.spacing));
        }
        Ok(())
    }

    fn separable(&self) -> Option<&dyn Separable> {
        None
    }
}

/// N = 2⁻ᴰ Π_k (1 + ξ_k a_k) (Σ_k ξ_k a_k − D + 1) and ∂N/∂ξ of the corner at a ∈ {−1, 1}ᴰ.
fn corner<const D: usize>(xi: &Vector<f64, D>, at: &[f64; D]) -> (f64, [f64; D]) {
    let scale = 0.5_f64.powi(D as i32);
    let factor: [f64; D] = std::array::from_fn(|k| 1.0 + xi[k] * at[k]);
    let sum = (0..D).map(|k| xi[k] * at[k]).sum::<f64>() - D as f64 + 1.0;
    let others = |k: usize| (0..D).filter(|&m| m != k).map(|m| factor[m]).product::<f64>();
    let value = scale * factor.iter().product::<f64>() * sum;
    (value, std::array::from_fn(|k| scale * at[k] * others(k) * (sum + factor[k])))
}

/// N = 2¹⁻ᴰ (1 − ξ_k²) Π_{m≠k} (1 + ξ_m a_m) and ∂N/∂ξ of the node in the middle of an edge along axis k, where a_k = 0.
fn midside<const D: usize>(xi: &Vector<f64, D>, at: &[f64; D]) -> (f64, [f64; D]) {
    let scale = 0.5_f64.powi(D as i32 - 1);
    let factor: [f64; D] =
        std::array::from_fn(|k| if at[k] == 0.0 { 1.0 - xi[k] * xi[k] } else { 1.0 + xi[k] * at[k] });
    let slope: [f64; D] = std::array::from_fn(|k| if at[k] == 0.0 { -2.0 * xi[k] } else { at[k] });
    let others = |k: usize| (0..D).filter(|&m| m != k).map(|m| factor[m]).product::<f64>();
    (scale * factor.iter().product::<f64>(), std::array::from_fn(|k| scale * slope[k] * others(k)))
}

/// A box of elements in motion; one entry a node in each array.
pub struct Elements<const D: usize, L> {
    grid: Grid<D>,
    nodes: Nodes,
    supports: Supports<D>,
    /// The Gauss points, always at X and undeformed.
    points: Particles<D>,
    bodies: Vec<Body<L>>,
    mass: Vec<f64>,
    /// Displacement.
    pub displacement: Vec<Vector<f64, D>>,
    /// Velocity.
    pub velocity: Vec<Vector<f64, D>>,
    acceleration: Vec<Vector<f64, D>>,
    /// Gravity and prescribed motion.
    pub loads: Loads<D>,
    /// The time scheme.
    pub scheme: Arc<dyn Scheme>,
    /// Newton and Krylov.
    pub newton: NewtonSettings,
    /// The time.
    pub clock: Clock,
}

/// Gauss's rule with three points: positions in [−1, 1] and weights that sum to 1.
const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 18.0), (0.0, 4.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 18.0)];

impl<const D: usize, L: Law> Elements<D, L> {
    /// `count` elements of edge `size` along each axis from `origin`, with three Gauss points an axis, at rest.
    ///
    /// # Errors
    /// None in practice: every Gauss point lies in its element.
    pub fn new(
        origin: Vector<f64, D>,
        size: f64,
        count: [u32; D],
        body: Body<L>,
        clock: Clock,
    ) -> Result<Self, StepError> {
        let grid = Grid { origin, spacing: 0.5 * size, cells: count.map(|n| 2 * n) };
        let mut points = Particles::default();
        let elements: usize = count.iter().map(|&n| n as usize).product();
        for element in 0..elements {
            let mut rest = element;
            let middle = Vector::from_fn(|k, _| {
                let index = rest % count[k] as usize;
                rest /= count[k] as usize;
                origin[k] + (index as f64 + 0.5) * size
            });
            for code in 0..3_usize.pow(D as u32) {
                let rule: [(f64, f64); D] = std::array::from_fn(|k| GAUSS[code / 3_usize.pow(k as u32) % 3]);
                let volume = rule.iter().map(|(_, weight)| weight * size).product::<f64>();
                let x = middle + Vector::from_fn(|k, _| 0.5 * size * rule[k].0);
                points.push(x, Vector::zeros(), volume, body.density * volume, 0);
            }
        }
        let (supports, nodes) = Supports::new(&Serendipity, &grid, &points.position)?;
        let mass = Nodal::mass_alone(&points, &supports).mass.to_vec();
        let zero = vec![Vector::zeros(); nodes.len()];
        Ok(Self {
            grid,
            nodes,
            supports,
            points,
            bodies: vec![body],
            mass,
            displacement: zero.clone(),
            velocity: zero.clone(),
            acceleration: zero,
            loads: Loads::default(),
            scheme: Arc::new(Newmark::default()),
            newton: NewtonSettings::default(),
            clock,
        })
    }

    /// Gives every node a velocity by its position.
    pub fn set_velocity(&mut self, velocity: impl Fn(&Vector<f64, D>) -> Vector<f64, D>) {
        self.velocity = self.nodes.positions(&self.grid).map(|(_, x)| velocity(&x)).collect();
    }

    /// One step with the consistent mass.
    ///
    /// # Errors
    /// No equilibrium was found; the elements are then unchanged.
    pub fn step(&mut self) -> Result<NewtonReport, StepError> {
        let (t, dt) = (self.clock.time(), self.clock.step());
        let (theta, alphas, end) = (self.scheme.instant(), self.scheme.balance(dt), self.scheme.end(dt));
        let nodal = Nodal {
            mass: self.mass.clone().into(),
            velocity: self.velocity.clone().into(),
            acceleration: self.acceleration.clone().into(),
            motion: self.displacement.clone().into(),
            ..Nodal::default()
        };
        // Only resting walls are supported: u = 0 there.
        let prescribed = prescribed_dofs(&self.loads.prescribed, &self.grid, &self.nodes, &[], t, dt);
        let nodal = nodal.with_prescribed(&prescribed);
        let (particles, bodies, loads, supports) = (&self.points, &self.bodies, &self.loads, &self.supports);
        let (nodal, lumping, time) = (&nodal, 0.0, t + theta * dt);
        let step = Step { particles, bodies, loads, supports, nodal, alphas, lumping, time, dt: alphas.dt };
        let equilibrium = Equilibrium::new(step, &prescribed);
        let mut u = self.displacement.clone();
        let report = newton(
            &equilibrium,
            &mut BlockJacobi::<D>::default(),
            bytemuck::cast_slice_mut(&mut u),
            &self.newton,
            &Pool::default(),
        )?;
        for (node, balanced) in u.iter().enumerate() {
            let by = (balanced - self.displacement[node]) / theta;
            let (delta_v, delta_a) = end.increments(&by, &self.velocity[node], &self.acceleration[node]);
            self.displacement[node] += by;
            self.velocity[node] += delta_v;
            self.acceleration[node] += delta_a;
        }
        self.clock.advance();
        Ok(report)
    }

    /// The Gauss points: their positions, volumes and masses.
    pub fn points(&self) -> &Particles<D> {
        &self.points
    }

    /// The velocity at the Gauss points.
    pub fn point_velocity(&self) -> Vec<Vector<f64, D>> {
        self.supports.values(&self.velocity)
    }

    /// Kinetic energy in the frame that moves with `frame`, plus strain energy.
    ///
    /// # Errors
    /// A Gauss point with det F ≤ 0.
    pub fn energy(&self, frame: &Vector<f64, D>) -> Result<f64, StepError> {
        let parts = self.supports.interpolate(&self.displacement, |p, _, g| {
            let at = self.points.state(p, 0.0).deformed(g).admissible();
            let at = at.map_err(|source| Inadmissible { particle: p, source })?;
            let body = &self.bodies[self.points.body[p] as usize];
            Ok::<_, Inadmissible>(self.points.volume[p] * body.law.energy(&at))
        })?;
        let kinetic =
            self.point_velocity().into_iter().zip(&self.points.mass).map(|(v, m)| 0.5 * m * (v - frame).norm_squared());
        Ok(parts.iter().sum::<f64>() + kinetic.sum::<f64>())
    }

    /// Positions of the nodes.
    pub fn node_positions(&self) -> Vec<Vector<f64, D>> {
        self.nodes.positions(&self.grid).map(|(_, x)| x).collect()
    }

    /// The displacement at `x`.
    ///
    /// # Errors
    /// `x` lies in no element.
    pub fn displacement_at(&self, x: &Vector<f64, D>) -> Result<Vector<f64, D>, ApproximationError> {
        let mut support = Support::default();
        Serendipity.evaluate(&self.grid, x, &mut Scratch::default(), &mut support)?;
        let entries = support.nodes.iter().zip(&support.values);
        Ok(entries
            .filter_map(|(&index, &n)| Some(self.displacement[self.nodes.number(self.grid.id(index))?] * n))
            .sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bfree::material::{Lame, Material, NeoHookean};

    /// Values, gradients by the difference of values, and reproduction of all quadratics.
    fn elements_reproduce_quadratics<const D: usize>() {
        let grid = Grid::<D> { origin: Vector::repeat(-0.3), spacing: 0.25, cells: [6; D] };
        let (mut scratch, mut out) = (Scratch::default(), Support::default());
        let quadratic = |x: &Vector<f64, D>| 1.0 + x.sum() + 3.0 * x.norm_squared() + x[0] * x[D - 1];
        for p in 1..60 {
            let x = Vector::from_fn(|k, _| -0.3 + 1.5 * (f64::from(p) * [0.618034, 0.414214, 0.732051][k]).fract());
            Serendipity.evaluate(&grid, &x, &mut scratch, &mut out).unwrap();
            let nodal = |node: [u32; D]| quadratic(&grid.position(node));
            let value: f64 = out.nodes.iter().zip(&out.values).map(|(&node, n)| nodal(node) * n).sum();
            assert!((value - quadratic(&x)).abs() < 1e-13);
            for k in 0..D {
                let slope: f64 = out.nodes.iter().zip(&out.gradients).map(|(&node, g)| nodal(node) * g[k]).sum();
                let mut exact = 1.0 + 6.0 * x[k];
                exact += if k == 0 { x[D - 1] } else { 0.0 } + if k == D - 1 { x[0] } else { 0.0 };
                assert!((slope - exact).abs() < 1e-12, "{slope} {exact}");
            }
        }
    }

    #[test]
    fn serendipity_elements_reproduce_quadratics() {
        elements_reproduce_quadratics::<1>();
        elements_reproduce_quadratics::<2>();
        elements_reproduce_quadratics::<3>();
    }

    #[test]
    fn a_bar_rings_at_its_exact_frequency() -> Result<(), Box<dyn std::error::Error>> {
        // A free bar of length 1 with v = V cos(πx). The amplitude is small, so the motion is linear; its period is 2/c.
        let law = Material::from(NeoHookean::ciarlet(Lame::new(0.5, 0.25)?));
        let body = Body { name: "bar".into(), law, density: 1.0, dilatation: Default::default() };
        let mut bar = Elements::<1, _>::new(Vector::zeros(), 0.1, [10], body, Clock::new(2.0 / 400.0, 0))?;
        bar.set_velocity(|x| x.map(|x| 1e-6 * (std::f64::consts::PI * x).cos()));
        let start = bar.velocity.clone();
        for _ in 0..400 {
            bar.step()?;
        }
        let distance = |a: &[Vector<f64, 1>], b: &[Vector<f64, 1>]| {
            a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
        };
        let zero = vec![Vector::zeros(); start.len()];
        assert!(distance(&bar.velocity, &start) < 2e-3 * distance(&start, &zero));
        Ok(())
    }
}
