//! The fast and the plain transfer must agree, for every law, shape function and D.

use super::general::General;
use crate::random::Random;
use crate::report::{Bound, Report};
use crate::settling::{block, lame};
use crate::studies::StudyError;
use bfree::approximation::{Approximation, ShapeFunction};
use bfree::material::{Law, Material};
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::simulation::Simulation;
use bfree::solver::NonlinearProblem;
use bfree::tensor::{Tensor, Vector};

const SAME: f64 = 1e-12;

/// h; the value 1 would hide a missing power of h.
const SPACING: f64 = 0.3;

/// The compared quantities, in this order.
const QUANTITIES: [&str; 5] = ["tangent product", "residual", "magnitude", "diagonal blocks", "projected velocity"];

/// Compares a strained, jittered block of `cells`ᴰ cells; half of the mass is consistent.
pub(super) fn judge<const D: usize>(report: &mut Report, cells: u32) -> Result<(), StudyError> {
    // All products of functions of one coordinate; LME with the largest width and with the paper's.
    let judged = |(name, shape): &(&str, Approximation)| shape.separable().is_some() && *name != "lme 1.8";
    let shapes: Vec<_> = Approximation::examples().into_iter().filter(judged).collect();
    for (law_name, law) in &Material::examples(lame()?) {
        let law_name = law_name.trim_start_matches("neo-Hookean, ");
        for (shape_name, shape) in &shapes {
            let mut simulation = block::<D>(shape.clone(), Some(law.clone()), cells, 0.24, 0.5)?;
            simulation.grid.spacing *= SPACING;
            simulation.particles.position.iter_mut().for_each(|x| *x *= SPACING);
            let mut random = Random::new(7);
            for (h, v) in simulation.particles.displacement_gradient.iter_mut().zip(&mut simulation.particles.velocity)
            {
                *h = Tensor::from_fn(|_, _| 0.15 * random.signed());
                *v = random.vector();
            }
            compare(&simulation, random.clone(), law_name, shape_name, report)?;
            let general = simulation.with_laws(|body| General(body.law.clone()));
            compare(&general, random, &format!("{law_name}, no closed form"), shape_name, report)?;
        }
    }
    Ok(())
}

/// Compares the two transfers on a block.
fn compare<const D: usize, L: Law>(
    simulation: &Simulation<D, L>,
    mut random: Random,
    law_name: &str,
    shape_name: &str,
    report: &mut Report,
) -> Result<(), StudyError> {
    let shape = &simulation.approximation;
    let (grid, positions) = (&simulation.grid, &simulation.particles.position);
    let (fast, nodes) = Connectivity::new(shape, grid, positions)?;
    let (plain, _) = Connectivity::plain(shape, grid, positions)?;
    let prescribed = simulation.prescribed(&nodes);
    let count = nodes.len();
    let dphi: Vec<Vector<f64, D>> = random.field(count).iter().map(|x: &Vector<f64, D>| x * (0.01 * SPACING)).collect();
    let u: Vec<Vector<f64, D>> = random.field(count);
    let by = |connectivity: &Connectivity<D>| -> Result<[Vec<f64>; 5], StudyError> {
        let nodal = Nodal::project(&simulation.particles, connectivity, 0.5)?;
        let alphas = simulation.settings.scheme.end(simulation.clock.step());
        let equilibrium = simulation.equilibrium(connectivity, &nodal, &prescribed, alphas, 0.1);
        let tangent = equilibrium.tangent(None, &dphi)?;
        let mut product = vec![Vector::zeros(); count];
        tangent.product(&u, &mut product);
        let flat = |field: &[Vector<f64, D>]| bytemuck::cast_slice(field).to_vec();
        Ok([
            flat(&product),
            flat(&equilibrium.residual::<f64>(&dphi)?),
            vec![NonlinearProblem::magnitude(&equilibrium, bytemuck::cast_slice(&dphi))?],
            tangent.diagonal_blocks().iter().flat_map(|block| block.iter().copied().collect::<Vec<_>>()).collect(),
            flat(&nodal.velocity),
        ])
    };
    let (a, b) = (by(&fast)?, by(&plain)?);
    for (quantity, (a, b)) in QUANTITIES.iter().zip(a.iter().zip(&b)) {
        report.push(&[quantity, &D.to_string(), law_name, shape_name], difference(a, b), Bound::AtMost(SAME));
    }
    Ok(())
}

/// The largest difference, relative to the largest entry of `b`. It is infinite if there is none; NaN counts as largest.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let largest = b.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |worst, d| if d <= worst { worst } else { d }) / largest
}
