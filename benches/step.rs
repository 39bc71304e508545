//! The parts of a step, in particles per second: `cargo bench --bench step`, with `-- product` behind it for one part.
//!
//! One thread; a jittered, strained block with 2^D particles per cell.

use bfree::mechanics::residual::Equilibrium;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use divan::Bencher;
use divan::counter::ItemsCount;
use serde_json::json;
use std::hint::black_box;
use std::path::Path;

const SHAPES: [&str; 4] = ["linear", "gimp", "cubic", "lme"];

fn main() {
    if let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(1).build_global() {
        eprintln!("{error}");
    }
    divan::main();
}

/// A block of `cells`ᴰ cells. Its particles are moved by up to 0.1 h.
fn block<const D: usize>(shape: &str, cells: u32) -> Simulation<D> {
    let approximation = match shape {
        "linear" => json!("linear"),
        "gimp" => json!("gimp"),
        "cubic" => json!({"bspline": {"degree": 3}}),
        _ => json!({"lme": {"gamma": 3}}),
    };
    let scene = json!({
        "grid": {"size": vec![cells + 8; D], "spacing": 1}, "time": {"step": 0.01, "end": 1}, "approximation": approximation,
        "bodies": [{"name": "block", "shape": {"box": {"min": vec![4; D], "max": vec![cells + 4; D]}}, "density": 1,
                    "material": {"neo_hookean": {"young": 1000, "poisson": 0.3}}}]
    });
    let scene = bfree::scene::read(&scene.to_string(), &[]).expect("a valid scene");
    let mut simulation: Simulation<D> = scene.build(Path::new(".")).expect("a valid scene");
    let mut at = 0.0;
    for x in &mut simulation.particles.position {
        *x = x.map(|x| {
            at += 0.618_033_988_749_894_9_f64;
            x + 0.2 * (at.fract() - 0.5)
        });
    }
    simulation
}

/// Calls `work` with the equilibrium of the next step and a small displacement.
fn at_a_step<const D: usize>(
    bencher: Bencher<'_, '_>,
    shape: &str,
    cells: u32,
    work: impl FnOnce(Bencher<'_, '_>, &Equilibrium<'_, D, bfree::material::Material>, &[Vector<f64, D>]),
) {
    let simulation = block::<D>(shape, cells);
    let (positions, dt) = (&simulation.particles.position, simulation.clock.step());
    let (connectivity, nodes) =
        Connectivity::new(&simulation.approximation, &simulation.grid, positions).expect("inside the grid");
    let nodal = Nodal::project(&simulation.particles, &connectivity, 1.0).expect("finite velocities");
    let equilibrium = simulation.equilibrium(&connectivity, &nodal, &[], simulation.settings.scheme.end(dt), dt);
    let u: Vec<Vector<f64, D>> =
        nodes.positions(&simulation.grid).map(|(_, x)| x.map(|x| 0.01 * (0.7 * x).sin())).collect();
    work(bencher, &equilibrium, &u);
}

macro_rules! in_dimension {
    ($name:ident, $dimension:literal, $cells:literal) => {
        mod $name {
            use super::*;

            const PARTICLES: usize = (2 * $cells as usize).pow($dimension);

            #[divan::bench(args = SHAPES)]
            fn product(bencher: Bencher<'_, '_>, shape: &str) {
                at_a_step::<$dimension>(
                    bencher.counter(ItemsCount::new(PARTICLES)),
                    shape,
                    $cells,
                    |bencher, at, u| {
                        let tangent = at.tangent(None, u).expect("admissible");
                        let mut out = vec![Vector::zeros(); u.len()];
                        bencher.bench_local(|| tangent.product(black_box(u), &mut out));
                    },
                );
            }

            #[divan::bench(args = SHAPES)]
            fn residual(bencher: Bencher<'_, '_>, shape: &str) {
                at_a_step::<$dimension>(
                    bencher.counter(ItemsCount::new(PARTICLES)),
                    shape,
                    $cells,
                    |bencher, at, u| {
                        bencher.bench_local(|| at.residual::<f64>(black_box(u)));
                    },
                );
            }

            #[divan::bench(args = SHAPES)]
            fn freezing_the_tangent(bencher: Bencher<'_, '_>, shape: &str) {
                at_a_step::<$dimension>(
                    bencher.counter(ItemsCount::new(PARTICLES)),
                    shape,
                    $cells,
                    |bencher, at, u| {
                        bencher.bench_local(|| at.tangent(None, black_box(u)).is_ok());
                    },
                );
            }

            #[divan::bench(args = SHAPES)]
            fn shape_functions(bencher: Bencher<'_, '_>, shape: &str) {
                let simulation = block::<$dimension>(shape, $cells);
                bencher.counter(ItemsCount::new(PARTICLES)).bench_local(|| {
                    Connectivity::new(
                        &simulation.approximation,
                        &simulation.grid,
                        black_box(&simulation.particles.position),
                    )
                    .is_ok()
                });
            }
        }
    };
}

in_dimension!(plane, 2, 64);
in_dimension!(space, 3, 16);
