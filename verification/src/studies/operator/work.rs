//! Operations and bytes of one tangent product.

use crate::settling::block;
use crate::prepared::Prepared;
use crate::studies::StudyError;
use crate::table::Table;
use bfree::approximation::{Approximation, AxisWeights, Linear, Lme, ShapeFunction};
use bfree::material::{Law, MaterialState};
use bfree::mechanics::tangent::frozen_bytes;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector, identity};

/// The work of one product, summed over all particles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Work {
    /// Floating-point operations (a fused multiply-add counts as two) on the nodes in each particle's connectivity.
    pub useful: f64,
    /// The useful operations and the padding of the lanes: windows of groups, empty lanes, rows rounded up to eight.
    pub padded: f64,
    /// Bytes read and written at least once: weights, tangents, the field and the result.
    pub bytes: f64,
}

/// Fused multiply-adds of a gather over a window: along x, then y, then z, with D components.
fn gather(width: [usize; 3], d: usize) -> usize {
    let [x, y, z] = width;
    let along_x = y * z * x * 2 * d;
    match d {
        1 => along_x,
        2 => along_x + y * 3 * d,
        _ => along_x + z * y * 3 * d + z * 3 * d,
    }
}

/// Fused multiply-adds of a scatter with `rows` rows of `x` nodes: products of the weights, forces of a row, then the nodes of the row.
fn scatter(rows: usize, x: usize, d: usize) -> usize {
    let products = if d == 3 { 3 } else { 0 };
    rows * (products + d * d + 2 * d * x)
}

/// Fused multiply-adds of the closed tangent of a neo-Hookean solid, or of a tangent without a closed form.
fn point(d: usize, closed: bool) -> usize {
    if closed { d * d * (3 * d + 3) + 1 } else { d.pow(4) }
}

impl Work {
    /// The work of the product with the given shape-function values.
    pub(super) fn of<const D: usize, L: Law>(
        simulation: &Simulation<D, L>,
        prepared: &Prepared<D>,
    ) -> Result<Self, StudyError> {
        const LANES: usize = 8;
        let mut work = Self::default();
        let mut axis = AxisWeights::default();
        let rest = MaterialState::new(Tensor::<f64, D>::zeros());
        let closed = simulation.bodies.iter().all(|body| body.law.closed(&identity(), &rest, 1.0).is_some());
        let point = point(D, closed);
        let Some(product) = simulation.approximation.separable() else { return Ok(work) };
        for x in &simulation.particles.position {
            let mut width = [1; 3];
            for k in 0..D {
                product.axis(&simulation.grid.axis(k), x[k], &mut axis)?;
                width[k] = axis.values.len();
            }
            work.useful += 2.0 * (gather(width, D) + point + scatter(width[1] * width[2], width[0], D)) as f64;
        }
        for (width, lanes) in prepared.supports.windows() {
            let rows = (width[1] * width[2]).next_multiple_of(LANES);
            work.padded += 2.0 * (LANES * (gather(width, D) + point) + lanes * scatter(rows, width[0], D)) as f64;
        }
        let field = prepared.nodes.len() * size_of::<Vector<f64, D>>();
        let frozen = frozen_bytes(&simulation.particles, &simulation.bodies, &prepared.supports);
        work.bytes = (prepared.supports.bytes() + frozen + 2 * field) as f64;
        Ok(work)
    }
}

/// Operations and bytes per particle for moderate and for large jitter.
pub(super) fn table() -> Result<Table, StudyError> {
    let mut table = Table::new(
        "one tangent product, a particle (neo-Hookean, 2^D particles a cell)",
        ["D", "shape", "jitter / h", "flop useful", "flop padded", "bytes", "flop / byte"],
    );
    for (name, shape) in [("linear", Approximation::from(Linear)), ("lme 3", Lme::new(3.0, 1e-6).into())] {
        for jitter in [0.1, 0.24] {
            row::<2>(&mut table, name, &shape, 32, jitter)?;
            row::<3>(&mut table, name, &shape, 8, jitter)?;
        }
    }
    Ok(table)
}

fn row<const D: usize>(
    table: &mut Table,
    name: &str,
    shape: &Approximation,
    cells: u32,
    jitter: f64,
) -> Result<(), StudyError> {
    let simulation = block::<D>(shape.clone(), None, cells, jitter, 1.0)?;
    let work = Work::of(&simulation, &Prepared::new(&simulation)?)?;
    let each = |x: f64| format!("{:.0}", x / simulation.particles.len() as f64);
    table.push([
        D.to_string(),
        name.into(),
        jitter.to_string(),
        each(work.useful),
        each(work.padded),
        each(work.bytes),
        format!("{:.1}", work.useful / work.bytes),
    ]);
    Ok(())
}
