//! Several processes: the same bits for any number of them, and the same errors. Here a process is a thread of the test.

mod launched;

use crate::support::{Failure, built, merged, scene, solid};
use bfree::mechanics::check::direction;
use bfree::mechanics::sweep::{Connectivity, Mode, Points};
use bfree::parallel::{Exchange, Processes};
use bfree::plan::{Plan, ProcessUse};
use bfree::pooled::Pool;
use bfree::simulation::{Simulation, StepReport};
use bfree::tensor::Vector;
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// The part of the state that every process has, and the report of a step, as bits.
fn bits<const D: usize>(simulation: &Simulation<D>, step: &StepReport<D>) -> Vec<u64> {
    let particles = &simulation.particles;
    let places: Vec<usize> = particles.places().into_iter().map(|place| place as usize).collect();
    let positions = places.iter().flat_map(|&p| particles.position[p].iter().copied());
    let dilatations = places.iter().filter_map(|&p| particles.dilatation.get(p).copied());
    let reactions = step.reactions.iter().flat_map(|reaction| reaction.force.iter().copied());
    let forces = step.obstacles.iter().chain(&step.pairs).flat_map(|contact| contact.force.iter().copied());
    let iterations = step.newton.history.iterations.iter().map(|one| one.residual);
    let shared = step.shared_nodes.iter().flat_map(|one| [one.gap, one.tension]).map(|one| one.unwrap_or(-1.0));
    let others = [
        simulation.external_work,
        simulation.dissipated,
        simulation.clock.time(),
        step.error.unwrap_or(-1.0),
        step.yielding,
    ];
    let all = positions.chain(dilatations).chain(reactions).chain(forces).chain(iterations).chain(shared);
    all.chain(others).map(f64::to_bits).collect()
}

/// The part of the state that only process 0 has whole, as bits.
fn bits_of_first<const D: usize>(simulation: &Simulation<D>) -> Vec<u64> {
    let particles = simulation.particles.by_id();
    let vectors = particles.velocity.iter().chain(&particles.acceleration);
    let gradients = particles.displacement_gradient.iter().flat_map(|gradient| gradient.iter().copied());
    let numbers = vectors.flat_map(|vector| vector.iter().copied()).chain(gradients);
    let energies = [simulation.strain_energy(), simulation.dissipated_by_laws()];
    numbers.chain(particles.memory.iter().copied()).chain(energies).map(f64::to_bits).collect()
}

/// The state after a step: what every process has, and what only process 0 has.
type State = (Vec<u64>, Option<Vec<u64>>);

/// A run of every process, or the error of each.
type Runs = Vec<Result<Vec<State>, String>>;

/// Steps of the same simulation in every process.
fn runs<const D: usize>(start: &Simulation<D>, processes: Vec<Processes>, steps: usize) -> Runs {
    let run = |processes: Processes| {
        let mut simulation = start.clone();
        simulation.settings.processes = processes;
        let is_first = simulation.settings.processes.rank() == 0;
        let step = |_| {
            let step = simulation.advance();
            simulation.collect_particles();
            match step {
                Ok(step) => Ok((bits(&simulation, &step), is_first.then(|| bits_of_first(&simulation)))),
                Err(error) => Err(format!("{error:?}").split("seconds").next().unwrap_or_default().to_owned()),
            }
        };
        (0..steps).map(step).collect()
    };
    thread::scope(|scope| {
        let run = &run;
        let all: Vec<_> = processes.into_iter().map(|one| scope.spawn(move || run(one))).collect();
        all.into_iter().map(|one| one.join().unwrap()).collect()
    })
}

/// Steps of one process, and of teams of these sizes, have the same bits. No process may have all particles.
fn agree<const D: usize>(name: &str, start: &Simulation<D>, counts: &[usize], steps: usize) {
    let alone = runs(start, vec![Processes::default()], steps).remove(0);
    for &count in counts {
        let share = ProcessUse::of(start, &Plan::of(start).unwrap(), count).unwrap().share;
        assert!(
            share < 0.8 || name.contains("circle"),
            "{name}: one of {count} processes has {share} of the particles"
        );
        for (rank, one) in runs(start, Processes::as_threads(count), steps).into_iter().enumerate() {
            let process = format!("{name}: process {rank} of {count}");
            match (&one, &alone) {
                (Ok(one), Ok(alone)) => {
                    let is_same = |(one, alone): (&State, &State)| one.0 == alone.0 && (rank > 0 || one.1 == alone.1);
                    assert!(one.len() == alone.len() && one.iter().zip(alone).all(is_same), "{process}");
                }
                (one, alone) => assert_eq!(one.as_ref().err(), alone.as_ref().err(), "{process}"),
            }
        }
    }
}

/// Particles of the cylinder in several blocks.
const FINE: &str = "grid.spacing=0.125";

/// [`agree`] for a shipped scene.
fn shipped_agrees<const D: usize>(name: &str, overrides: &[&str], counts: &[usize]) -> Result<(), Failure> {
    agree(&format!("{name} {overrides:?}"), &scene::<D>(name, overrides)?, counts, 2);
    Ok(())
}

#[test]
fn scenes_have_the_same_bits_for_any_number_of_processes() -> Result<(), Failure> {
    // Two bodies, contact with friction, multigrid, a kept grid, plasticity, follower pressure and mixed form, defaults.
    shipped_agrees::<2>("collision.json", &[], &[2, 7])?;
    shipped_agrees::<2>("billiard.json", &["grid.spacing=0.25"], &[2, 4])?;
    shipped_agrees::<2>("wedge.json", &["grid.spacing=0.05"], &[2, 3])?;
    shipped_agrees::<2>("compaction.json", &["grid.spacing=0.05"], &[2, 7])?;
    shipped_agrees::<3>("block_static.json", &["grid.spacing=0.125"], &[2, 3])?;
    shipped_agrees::<2>("elastica.json", &[], &[3])?;
    shipped_agrees::<2>("cook_plastic.json", &[], &[2, 4])?;
    shipped_agrees::<2>("ring.json", &["grid.spacing=0.05"], &[2, 7])?;
    let nearly_incompressible = "bodies.0.material.neo_hookean.poisson=0.4999";
    shipped_agrees::<2>("ring.json", &[nearly_incompressible, "grid.spacing=0.05"], &[2, 7])?;
    shipped_agrees::<3>("ball_drop.json", &[], &[3])?;
    shipped_agrees::<1>("riemann.json", &[], &[2, 7])
}

#[test]
fn every_family_has_the_same_bits() -> Result<(), Failure> {
    for family in [
        "\"linear\"",
        "\"gimp\"",
        "{\"bspline\": {\"degree\": 2}}",
        "{\"bspline\": {\"degree\": 3}}",
        "{\"lme\": {\"gamma\": 3}}",
        "{\"lme\": {\"gamma\": 3, \"support\": \"circle\"}}",
    ] {
        let family = format!("approximation={family}");
        shipped_agrees::<2>("rebound.json", &[&family, "time.step=0.5", FINE], &[2, 3])?;
        let multigrid = "solver.krylov.preconditioner=\"multigrid\"";
        shipped_agrees::<2>("cook.json", &[&family, multigrid, "grid.spacing=2"], &[2])?;
    }
    Ok(())
}

#[test]
fn schemes_and_terms_have_the_same_bits() -> Result<(), Failure> {
    let energy_momentum = "time={\"step\": 0.05, \"end\": 80, \"scheme\": \"energy_momentum\"}";
    shipped_agrees::<2>("rebound.json", &[energy_momentum, FINE], &[3])?;
    let damped = "damping={\"mass\": 0.1, \"stiffness\": 0.01}";
    shipped_agrees::<2>("rebound.json", &["time.lumping=0.3", damped, FINE], &[3])?;
    let mean = "bodies.0.volumetric=\"mean_dilatation\"";
    shipped_agrees::<2>("cook.json", &[mean, "aggregation=true", "grid.spacing=1"], &[2, 5])?;
    let arc_length = "time={\"step\": 0.1, \"end\": 1, \"scheme\": \"arc_length\"}";
    shipped_agrees::<2>("elastica.json", &[arc_length, "grid.spacing=0.5"], &[2])
}

/// Particles that go to other processes take their velocity, deformation and internal variables with them, on a new grid in each step and on one
/// that is kept over a few steps. The disc stretches while it flies.
#[test]
fn particles_that_change_their_process_have_the_same_bits() -> Result<(), Failure> {
    let plastic = r#"bodies.0.material={"von_mises": {"elastic": {"young": 80, "poisson": 0.33}, "yield_stress": {"initial": 4}}}"#;
    for reset in ["\"every_step\"", "{\"strain\": 0.02}"] {
        let reset = format!("grid.reset={reset}");
        let mut start = scene::<2>("rebound.json", &[FINE, plastic, "time.step=0.05", &reset])?;
        for (v, x) in start.particles.velocity.iter_mut().zip(&start.particles.position) {
            *v = Vector::from([4.0 + 0.5 * (x[0] - 2.5), 0.2 * (x[0] - 2.5) * (x[1] - 2.5)]);
        }
        agree(&format!("rebound, {reset}"), &start, &[2, 5], 40);
        let mut end = start.clone();
        (0..40).try_for_each(|_| end.advance().map(drop))?;
        let flowed = end.particles.memory.iter().filter(|one| **one > 1e-3).count();
        assert!(flowed > 100 && flowed < end.particles.memory.len(), "{flowed}");
    }
    Ok(())
}

/// Two blocks that stick to each other, across the blocks of cells of several processes.
#[test]
fn bodies_that_share_nodes_have_the_same_bits() -> Result<(), Failure> {
    let block = |name, x: f64| solid(name, 1000, json!({"box": {"min": [x, 0.5], "max": [x + 1.0, 1.5]}}));
    let start = built::<2>(&json!({
        "grid": {"size": [3, 2], "spacing": 0.0625}, "time": {"step": 0.01, "end": 1},
        "bodies": [block("left", 0.0), block("right", 1.0)], "boundary": {"left": "fixed"},
        "gravity": {"acceleration": [20, 0]},
    }))?;
    let mut one = start.clone();
    let shared = (0..3).map(|_| one.advance().map(|step| step.shared_nodes)).collect::<Result<Vec<_>, _>>()?;
    assert!(shared[2].iter().any(|one| one.gap.is_some() && one.tension.is_some()), "{shared:?}");
    agree("two blocks", &start, &[2, 5], 3);
    Ok(())
}

/// Balls that fly at each other and at a free obstacle, in three dimensions.
#[test]
fn contact_has_the_same_bits() -> Result<(), Failure> {
    let ball = |name, x: f64, velocity: [f64; 3]| {
        let shape = json!({"ball": {"center": [x, 1.0, 1.0], "radius": 0.4}});
        merged(solid(name, 1000, shape), json!({"velocity": velocity}))
    };
    let start = built::<3>(&json!({
        "grid": {"size": [3, 2, 2], "spacing": 0.25}, "time": {"step": 0.01, "end": 1},
        "bodies": [ball("left", 0.7, [2.0, 0.1, 0.0]), ball("right", 1.52, [0.0; 3])], "contact": {"friction": 0.3},
    }))?;
    agree("two balls", &start, &[2, 5], 6);
    Ok(())
}

#[test]
fn a_step_that_fails_fails_in_all_processes() -> Result<(), Failure> {
    let mut start = scene::<2>("rebound.json", &[FINE])?;
    start.particles.velocity[500] *= 400.0;
    start.settings.newton.max_iterations = 2;
    agree("halved steps", &start, &[2, 7], 2);
    start.particles.velocity.iter_mut().for_each(|v| *v *= 1e4);
    agree("out of the grid", &start, &[3], 1);
    start.particles.velocity.fill(Vector::zeros());
    start.particles.displacement_gradient[17][(0, 0)] = -1.5;
    agree("turned inside out", &start, &[3], 1);
    Ok(())
}

/// Counts calls and bytes.
#[derive(Debug)]
struct Counted(Processes, Arc<[AtomicUsize; 2]>);

impl Exchange for Counted {
    fn rank(&self) -> usize {
        self.0.rank()
    }

    fn count(&self) -> usize {
        self.0.count()
    }

    fn exchange(&self, lengths: &[usize], all: &mut [u8]) {
        self.1[0].fetch_add(1, Ordering::Relaxed);
        self.1[1].fetch_add(lengths[self.rank()], Ordering::Relaxed);
        let start: usize = lengths[..self.rank()].iter().sum();
        let (told, _) = self.0.joined(all[start..start + lengths[self.rank()]].to_vec());
        all.copy_from_slice(&told);
    }
}

/// A scatter is one message. Each process tells the sums at its interior nodes and the entries at the interface, as `check --ranks` plans.
#[test]
fn a_scatter_is_one_message_of_the_planned_length() -> Result<(), Failure> {
    let start = scene::<3>("block_static.json", &["grid.spacing=0.125"])?;
    let (nodes, plan) = (start.next_step()?.nodes().len(), Plan::of(&start)?);
    for count in [2, 3, 8] {
        let told = |one: Processes| {
            let counts: Arc<[AtomicUsize; 2]> = Arc::default();
            let processes = Processes::new(Counted(one, counts.clone()));
            let points = Points { processes, ..Points::at(&start.particles.position) };
            let (approximation, pool) = (&start.approximation, Pool::default());
            let (connectivity, _) = Connectivity::rebuilt(None, approximation, &start.grid, &points, &pool).unwrap();
            counts.iter().for_each(|one| one.store(0, Ordering::Relaxed));
            let mut force = vec![Vector::zeros(); nodes];
            connectivity.sweep(Some(&direction::<3>(nodes, 1)), Mode::BOTH, &mut force, |_, at, sums| *sums = *at);
            [0, 1].map(|which| counts[which].load(Ordering::Relaxed))
        };
        let all = thread::scope(|scope| {
            let told = &told;
            let team: Vec<_> =
                Processes::as_threads(count).into_iter().map(|one| scope.spawn(move || told(one))).collect();
            team.into_iter().map(|one| one.join().unwrap()).collect::<Vec<_>>()
        });
        assert!(all.iter().all(|[messages, _]| *messages == 1), "{count} processes: {all:?}");
        let most = all.iter().map(|[_, bytes]| *bytes as u64).max();
        assert_eq!(most, Some(ProcessUse::of(&start, &plan, count)?.told), "{count} processes: {all:?}");
        assert!(all.iter().map(|[_, bytes]| bytes).sum::<usize>() > 24 * nodes, "{count} processes: {all:?}");
    }
    Ok(())
}
