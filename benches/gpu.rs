//! The rates of products and of iterations of conjugate gradients on a GPU: `cargo bench --bench gpu -- --cells 64`, and with `--cells 128`.
//!
//! A cube of cells³ cells with 8 particles each, neo-Hookean, in a step with inertia and a consistent mass. The same product on all cores of the
//! processor stands beside it, and so do whole steps. The first lines say whether both have the same bits.

use bfree::gpu::{Gpu, GpuVector};
use bfree::mechanics::check::direction;
use bfree::scene::{self, Override};
use bfree::simulation::Simulation;
use bfree::solver::{BlockJacobi, ConjugateGradientSettings, Linearization, Preconditioner, System};
use bfree::space::vector::Vectors;
use bfree::tensor::Vector;
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

/// Shape functions, and the targets of the product and of an iteration on an H100 or H200 in 10⁹ particles a second.
const FAMILIES: [(&str, &str, &str); 4] = [
    ("linear", "\"linear\"", "11, 10"),
    ("quadratic", "{\"bspline\":{\"degree\":2}}", "6, 5.5"),
    ("cubic", "{\"bspline\":{\"degree\":3}}", "4.3, 4"),
    ("LME 3", "{\"lme\":{\"gamma\":3}}", "none"),
];

/// Products and iterations that are timed.
const COUNT: usize = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let cells: usize =
        arguments.iter().skip_while(|one| *one != "--cells").nth(1).map_or(Ok(64), |cells| cells.parse())?;
    let gpu = match Gpu::open() {
        Ok(gpu) => Arc::new(gpu),
        Err(error) => {
            println!("skipped: {error}");
            return Ok(());
        }
    };
    println!("{} particles on {}", 8 * cells.pow(3), gpu.name());
    println!(
        "functions   same bits  10^9 particles/s: product, iteration (targets)  on the processor  step, s: processor, GPU"
    );
    for (name, family, targets) in FAMILIES {
        let mut simulation = block(cells, family)?;
        let ([product, iteration, here], same) = rates(&simulation, &gpu)?;
        let seconds = |simulation: &mut Simulation<3>| {
            let start = Instant::now();
            simulation.advance().map(|_| start.elapsed().as_secs_f64())
        };
        // Both take the first step, with its shape functions.
        let mut there = simulation.clone();
        there.settings.gpu = Some(gpu.clone());
        let (on_processor, on_gpu) = (seconds(&mut simulation)?, seconds(&mut there)?);
        let same = if same { "yes" } else { "no" };
        println!(
            "{name:11} {same:9}  {product:8.2}, {iteration:8.2} ({targets})  {here:10.4}  {on_processor:8.2}, {on_gpu:8.2}"
        );
    }
    Ok(())
}

/// The cube with this many cells along an edge.
fn block(cells: usize, family: &str) -> Result<Simulation<3>, Box<dyn Error>> {
    let spacing = 1.0 / cells as f64;
    let step = 1.3 * spacing / (1000.0_f64 * 0.7 / (1.3 * 0.4)).sqrt();
    let changes = [
        format!("grid.spacing={spacing}"),
        format!("time.step={step}"),
        format!("approximation={family}"),
        "time.scheme=\"newmark\"".to_owned(),
        "time.lumping=0.5".to_owned(),
        "gravity.curve=[[0,1]]".to_owned(),
    ];
    let overrides = changes.iter().map(|change| change.parse()).collect::<Result<Vec<Override>, _>>()?;
    Ok(scene::read_file("scenes/block_static.json".as_ref(), &overrides)?.build("scenes".as_ref())?)
}

/// 10⁹ particles a second: products and iterations on the GPU, products on the processor; and whether both products have the same bits.
fn rates(simulation: &Simulation<3>, gpu: &Arc<Gpu>) -> Result<([f64; 3], bool), Box<dyn Error>> {
    let mut on_gpu = simulation.clone();
    on_gpu.settings.gpu = Some(gpu.clone());
    let coming = on_gpu.next_step()?;
    let (equilibrium, count) = (coming.equilibrium(), coming.nodes().len());
    let mut u = direction::<3>(count, 1);
    coming.prescribed().iter().for_each(|dof| u[dof.node][dof.component] = 0.0);
    let phi: Vec<_> = u.iter().map(|u| u * (0.01 * simulation.grid.spacing)).collect();
    let tangent = equilibrium.tangent(None, &phi)?;
    let system = tangent.on_device().ok_or("the tangent has no form for a GPU")?;
    let numbers: Vec<f64> = u.iter().flatten().copied().collect();
    let (x, mut y) = (gpu.vector(&numbers), gpu.zeros(3 * count));
    let particles = COUNT as f64 * simulation.particles.len() as f64 / 1e9;
    let product = particles / timed(gpu, &mut y, |y| (0..COUNT).for_each(|_| system.apply(&x, y)))?;
    let mut out = vec![Vector::zeros(); count];
    tangent.product(&u, &mut out);
    let start = Instant::now();
    tangent.product(&u, &mut out);
    let here = particles / COUNT as f64 / start.elapsed().as_secs_f64();
    let same = out.iter().flatten().zip(gpu.numbers(&y)).all(|(a, b)| *a == b);
    let mut jacobi = BlockJacobi::<3>::default();
    let inverse = jacobi.prepare_on_device(&tangent, &*system).ok_or("block-Jacobi has no form for a GPU")?;
    let settings = ConjugateGradientSettings { relative_tolerance: 1e-300, max_iterations: COUNT };
    let mut solution = gpu.zeros(3 * count);
    let iterate = |solution: &mut GpuVector| {
        _ = settings.solve(&System { vectors: &**gpu, operator: &*system, inverse: &*inverse }, &x, solution);
    };
    let iteration = particles / timed(gpu, &mut solution, iterate)?;
    Ok(([product, iteration, here], same))
}

/// The seconds that some work takes whose result is a vector, after once for warming up.
fn timed(gpu: &Gpu, y: &mut GpuVector, mut work: impl FnMut(&mut GpuVector)) -> Result<f64, Box<dyn Error>> {
    work(y);
    gpu.norm(y);
    let start = Instant::now();
    work(y);
    // A sum waits for the device.
    gpu.norm(y);
    let seconds = start.elapsed().as_secs_f64();
    gpu.check()?;
    Ok(seconds)
}
