//! Rates and seconds: tables, no verdicts. All times are the best of several, on one thread unless said otherwise.

use super::general::General;
use crate::settling::block;
use super::machine::{copy_bandwidth, peak, read_bandwidth};
use super::work::Work;
use crate::baseline::{BFree, Pattern, assemble};
use crate::prepared::{Prepared, arranged};
use crate::random::Random;
use crate::shipped;
use crate::studies::{Outcome, StudyError};
use crate::table::Table;
use bfree::approximation::{Approximation, Linear, Lme};
use bfree::material::{Law, Material};
use bfree::mechanics::sweep::{Points, Supports};
use bfree::mechanics::tangent::frozen_bytes;
use bfree::particles::Body;
use bfree::plan::Plan;
use bfree::pooled::Pool;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use std::hint::black_box;
use std::time::Instant;

/// The largest number of assembled blocks: 1.1 GB in 3D.
const MOST_BLOCKS: usize = 14_000_000;

fn shapes() -> [(&'static str, Approximation); 2] {
    [("linear", Linear.into()), ("lme 3", Lme::new(3.0, 1e-6).into())]
}

/// The shortest of several runs, in seconds.
fn best<R>(times: usize, mut run: impl FnMut() -> R) -> f64 {
    (0..times).fold(f64::INFINITY, |best: f64, _| {
        let start = Instant::now();
        black_box(run());
        best.min(start.elapsed().as_secs_f64())
    })
}

/// Measures everything.
pub(super) fn measure(outcome: &mut Outcome) -> Result<(), StudyError> {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build()?;
    let tables = one.install(|| -> Result<Vec<Table>, String> {
        let all = || -> Result<Vec<Table>, StudyError> {
            let (peak, copy, read) = (peak(), copy_bandwidth(), read_bandwidth());
            let mut machine = Table::new("the machine, one core", ["GFLOP/s of multiply-adds", "GB/s copied (read and written)", "GB/s read"]);
            machine.push([peak, copy, read].map(|rate| format!("{:.1}", rate / 1e9)));
            Ok(vec![machine, products(peak, copy, &two)?, matrices(copy, read)?, steps()?, rebound()?, growth()?])
        };
        all().map_err(|error| error.to_string())
    })?;
    outcome.tables.extend(tables);
    Ok(())
}

/// Rates of the product and of all other parts of a step.
fn products(peak: f64, copy: f64, two: &rayon::ThreadPool) -> Result<Table, StudyError> {
    let mut table = Table::new(
        "one tangent product, and the other parts of a step in units of it",
        [
            "case", "particles", "M particles/s", "ns", "floor ns", "useful share of peak", "with padding", "2 threads", "residual",
            "tangent frozen", "shape functions",
        ],
    );
    for (name, shape) in shapes() {
        for jitter in [0.1, 0.24] {
            let (plane, space) = (shape.clone(), shape.clone());
            product::<2, _>(&mut table, name, block(plane, None, 160, jitter, 1.0)?, jitter, [peak, copy], two)?;
            product::<3, _>(&mut table, name, block(space, None, 32, jitter, 1.0)?, jitter, [peak, copy], two)?;
        }
        let name = format!("{name}, no closed form");
        let general = |body: &Body<Material>| General(body.law.clone());
        let (plane, space) = (block(shape.clone(), None, 160, 0.1, 1.0)?, block(shape, None, 32, 0.1, 1.0)?);
        product::<2, _>(&mut table, &name, plane.with_laws(general), 0.1, [peak, copy], two)?;
        product::<3, _>(&mut table, &name, space.with_laws(general), 0.1, [peak, copy], two)?;
    }
    Ok(table)
}

fn product<const D: usize, L: Law>(
    table: &mut Table,
    name: &str,
    simulation: Simulation<D, L>,
    jitter: f64,
    [peak, copy]: [f64; 2],
    two: &rayon::ThreadPool,
) -> Result<(), StudyError> {
    let shape = &simulation.approximation.clone();
    let prepared = Prepared::new(&simulation)?;
    let work = Work::of(&simulation, &prepared)?;
    let equilibrium = prepared.equilibrium(&simulation);
    let mut random = Random::new(11);
    let u: Vec<Vector<f64, D>> = random.field(prepared.nodes.len()).iter().map(|x: &Vector<f64, D>| x * 0.01).collect();
    let tangent = equilibrium.tangent(&u)?;
    let mut out = vec![Vector::zeros(); u.len()];
    let seconds = best(15, || tangent.product(&u, &mut out));
    let on_two = two.install(|| best(15, || tangent.product(&u, &mut out)));
    let particles = simulation.particles.len() as f64;
    // The memory of the last step is reused, as in a step, and the particles have moved by 0.05 h along each axis.
    let (grid, before) = (&simulation.grid, &simulation.particles.position);
    let after: Vec<_> = before.iter().map(|x| x.add_scalar(0.05 * grid.spacing)).collect();
    let (pool, mut spare) = (Pool::default(), Some(Supports::new(shape, grid, &after)?.0));
    let mut turns = [before, &after].into_iter().cycle();
    let shape_functions = best(6, || {
        let positions = turns.next().unwrap_or(before);
        spare = Supports::renewed(spare.take(), shape, grid, &Points::at(positions), &pool).ok().map(|(supports, _)| supports);
    });
    let times = |s: f64| format!("{:.1}", s / seconds);
    let floor = (work.useful / peak).max(work.bytes / copy);
    table.push([
        format!("{D}D {name}, jitter {jitter}"),
        format!("{particles}"),
        format!("{:.2}", particles / seconds / 1e6),
        format!("{:.1}", seconds / particles * 1e9),
        format!("{:.1}", floor / particles * 1e9),
        format!("{:.0} %", 100.0 * work.useful / seconds / peak),
        format!("{:.0} %", 100.0 * work.padded / seconds / peak),
        format!("{:.2} x", seconds / on_two),
        times(best(5, || equilibrium.residual::<f64>(&u))),
        times(best(5, || equilibrium.tangent(&u).map(|_| ()))),
        times(shape_functions),
    ]);
    Ok(())
}

/// The same product with an assembled matrix of 3×3 blocks.
fn matrices(copy: f64, read: f64) -> Result<Table, StudyError> {
    let mut table = Table::new(
        "the product by an assembled block matrix, 3D",
        ["shape", "particles", "share of copy bandwidth", "share of read bandwidth", "matrix / free, time", "matrix / free, bytes", "assembly, in free products"],
    );
    for ((name, shape), cells) in shapes().into_iter().zip([32, 16]) {
        let simulation = block::<3>(shape, None, cells, 0.1, 1.0)?;
        let prepared = Prepared::new(&simulation)?;
        let equilibrium = prepared.equilibrium(&simulation);
        let count = prepared.nodes.len();
        let u: Vec<Vector<f64, 3>> = Random::new(11).field(count).iter().map(|x: &Vector<f64, 3>| x * 0.01).collect();
        let start = Instant::now();
        let pattern = Pattern::new(&prepared.supports, count, MOST_BLOCKS)?;
        let matrix = assemble(&equilibrium, &u, &pattern, &BFree)?;
        let assembly = start.elapsed().as_secs_f64();
        let tangent = equilibrium.tangent(&u)?;
        let mut out = vec![Vector::zeros(); count];
        let by_matrix = best(9, || matrix.product(&u, &mut out));
        let free = best(9, || tangent.product(&u, &mut out));
        let frozen = frozen_bytes(&simulation.particles, &simulation.bodies, &prepared.supports);
        let bytes = prepared.supports.bytes() + frozen;
        table.push([
            name.into(),
            simulation.particles.len().to_string(),
            format!("{:.0} %", 100.0 * matrix.bytes() as f64 / by_matrix / copy),
            format!("{:.0} %", 100.0 * matrix.bytes() as f64 / by_matrix / read),
            format!("{:.2}", by_matrix / free),
            format!("{:.2}", matrix.bytes() as f64 / bytes as f64),
            format!("{:.0}", assembly / free),
        ]);
    }
    Ok(table)
}

/// Whole implicit steps.
fn steps() -> Result<Table, StudyError> {
    let mut table = Table::new(
        "a whole step, Newton to 1e-8, Courant 1 (the best of three)",
        [
            "case", "particles", "us / particle", "products", "residuals", "linearizations", "Newton", "bytes / particle (planned)",
            "step / (products + residuals + linearizations + 1) products",
        ],
    );
    for (name, shape) in shapes() {
        for cells in [80, 160] {
            step::<2>(&mut table, name, &shape, cells)?;
        }
        for cells in [20, 40] {
            step::<3>(&mut table, name, &shape, cells)?;
        }
    }
    Ok(table)
}

fn step<const D: usize>(
    table: &mut Table,
    name: &str,
    shape: &Approximation,
    cells: u32,
) -> Result<(), StudyError> {
    let mut simulation = arranged(block::<D>(shape.clone(), None, cells, 0.1, 1.0)?)?;
    let particles = simulation.particles.len();
    let planned = Plan::of(&simulation)?.bytes();
    let product = {
        let prepared = Prepared::new(&simulation)?;
        let equilibrium = prepared.equilibrium(&simulation);
        let u = vec![Vector::repeat(1e-3); prepared.nodes.len()];
        let tangent = equilibrium.tangent(&u)?;
        let mut out = vec![Vector::zeros(); u.len()];
        best(9, || tangent.product(&u, &mut out))
    };
    let mut fastest: Option<(f64, bfree::solver::NewtonReport)> = None;
    for _ in 0..3 {
        let start = Instant::now();
        let report = simulation.advance()?;
        let seconds = start.elapsed().as_secs_f64();
        if fastest.as_ref().is_none_or(|(best, _)| seconds < *best) {
            fastest = Some((seconds, report.newton));
        }
    }
    let Some((seconds, newton)) = fastest else { return Ok(()) };
    let counts = newton.history.counts;
    let units = counts.tangent_products + counts.residuals + counts.linearizations + 1;
    table.push([
        format!("{D}D {name}"),
        particles.to_string(),
        format!("{:.2}", seconds / particles as f64 * 1e6),
        counts.tangent_products.to_string(),
        counts.residuals.to_string(),
        counts.linearizations.to_string(),
        newton.history.iterations.len().to_string(),
        format!("{:.0}", planned as f64 / particles as f64),
        format!("{:.2}", seconds / (units as f64 * product)),
    ]);
    Ok(())
}

/// Cells along an edge of the block, for 10⁵ and 10⁶ particles in 3D.
const GROWING: [u32; 2] = [23, 50];

/// The growth of the step time with the number of particles, at a fixed Courant number.
fn growth() -> Result<Table, StudyError> {
    let mut table = Table::new(
        "the second step of a block in 3D, Newton to 1e-8, Courant 1: time ~ N^p",
        ["shape", "particles", "s / step", "us / particle", "p from the row before", "Krylov iterations", "Newton", "GiB (planned)"],
    );
    for (name, shape) in shapes() {
        let mut before: Option<(f64, f64)> = None;
        for cells in GROWING {
            let mut simulation = block::<3>(shape.clone(), None, cells, 0.1, 1.0)?;
            let particles = simulation.particles.len() as f64;
            let planned = Plan::of(&simulation)?.bytes() as f64;
            simulation.advance()?;
            let start = Instant::now();
            let newton = simulation.advance()?.newton.history;
            let seconds = start.elapsed().as_secs_f64();
            let power = before.map(|(n, s)| (seconds / s).ln() / (particles / n).ln());
            before = Some((particles, seconds));
            table.push([
                name.into(),
                format!("{particles}"),
                format!("{seconds:.2}"),
                format!("{:.2}", seconds / particles * 1e6),
                power.map_or_else(|| "-".into(), |p| format!("{p:.3}")),
                newton.counts.krylov_iterations.to_string(),
                newton.iterations.len().to_string(),
                format!("{:.2}", planned / 1024.0_f64.powi(3)),
            ]);
        }
    }
    Ok(table)
}

/// The whole rebound, without output.
fn rebound() -> Result<Table, StudyError> {
    let mut table = Table::new("the rebound, 1600 steps, no output", ["shape", "s", "over linear"]);
    let mut linear = None;
    for (name, choice) in [("linear", "approximation=\"linear\""), ("lme 3", "approximation={\"lme\":{\"gamma\":3}}")] {
        let seconds = {
            let mut simulation: Simulation<2> = shipped::scene("rebound", &[choice])?.build(&shipped::folder())?;
            let start = Instant::now();
            while simulation.clock.time() < 80.0 - 1e-9 {
                simulation.advance()?;
            }
            start.elapsed().as_secs_f64()
        };
        let reference = *linear.get_or_insert(seconds);
        table.push([name.into(), format!("{seconds:.2}"), format!("{:.2}", seconds / reference)]);
    }
    Ok(table)
}
