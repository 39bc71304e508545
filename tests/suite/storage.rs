//! The order of the particles in memory is near that of the transfer, and has no influence on the results.

use crate::support::{Failure, Random, restored, scene};
use bfree::mechanics::sweep::Connectivity;
use bfree::plan::Plan;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;

/// A dead load and a follower pressure, each on some particles of two bodies with two laws.
const LOADED: [&str; 2] = [
    r#"tractions=[{"body":"soft","region":{"box":{"min":[0,0],"max":[2.4,10]}},"traction":[0.1,0]}]"#,
    r#"pressures=[{"body":"stiff","region":{"box":{"min":[7.6,0],"max":[10,10]}},"pressure":0.1}]"#,
];

fn shuffled<const D: usize>(simulation: &Simulation<D>) -> Simulation<D> {
    let (mut random, mut other) = (Random(5), simulation.clone());
    other.rearrange(&random.order(simulation.particles.len()));
    assert_ne!(other.particles.id, simulation.particles.id);
    other
}

fn same_bits<const D: usize>(mut one: Simulation<D>) -> Result<(), Failure> {
    let mut other = shuffled(&one);
    for _ in 0..3 {
        let (here, there) = (one.advance()?, other.advance()?);
        assert_eq!(here.newton.history, there.newton.history);
        assert_eq!(here.reactions, there.reactions);
    }
    assert_eq!(one.particles.by_id(), other.particles.by_id());
    Ok(())
}

#[test]
fn no_bit_depends_on_where_particles_lie() -> Result<(), Failure> {
    same_bits(scene::<2>("collision.json", &LOADED)?)?;
    same_bits(scene::<2>("collision.json", &["time.lumping=0.5", LOADED[0], LOADED[1]])?)?;
    same_bits(scene::<2>("cantilever.json", &[])?)?;
    same_bits(scene::<3>("ball_drop.json", &[])?)
}

#[test]
fn a_step_puts_the_particles_where_the_sweep_looks_for_them() -> Result<(), Failure> {
    let mut simulation = shuffled(&scene::<2>("collision.json", &[])?);
    let is_in_block_order = |of: &Simulation<2>, positions: &[Vector<f64, 2>]| -> Result<bool, Failure> {
        let (connectivity, _) = Connectivity::new(&of.approximation, &of.grid, positions)?;
        Ok(connectivity.block_order().is_none())
    };
    assert!(!is_in_block_order(&simulation, &simulation.particles.position)?);
    for _ in 0..3 {
        let before = simulation.particles.by_id().position;
        simulation.advance()?;
        // The shape functions of the step are those at its beginning.
        let before: Vec<_> = simulation.particles.id.iter().map(|&id| before[id as usize]).collect();
        assert!(is_in_block_order(&simulation, &before)?);
    }
    Ok(())
}

#[test]
fn a_checkpoint_knows_where_the_particles_lie() -> Result<(), Failure> {
    let start = scene::<2>("collision.json", &LOADED)?;
    let mut simulation = shuffled(&start);
    simulation.advance()?;
    // The step has sorted the particles into the order of `continued`. A second shuffle reveals a restart that does not store the order.
    let mut simulation = shuffled(&simulation);
    let mut continued = restored(&simulation, &start)?;
    assert_eq!((&continued.particles, &continued.loads), (&simulation.particles, &simulation.loads));
    simulation.advance()?;
    continued.advance()?;
    assert_eq!((&continued.particles, &continued.loads), (&simulation.particles, &simulation.loads));
    Ok(())
}

/// The bytes that a block of `cells`³ cells under its weight holds in a step, and the least that its thread allocates in one of some steps.
fn held_and_allocated(cells: u32, method: &str) -> Result<[f64; 2], Failure> {
    let side = f64::from(cells) * 0.1;
    let overrides = [
        format!("grid.size=[{0},{0},{0}]", side + 0.4),
        "grid.spacing=0.1".to_owned(),
        format!(r#"bodies.0.shape={{"box":{{"min":[0.2,0,0.2],"max":[{0},{side},{0}]}}}}"#, side + 0.2),
        "bodies.0.velocity=[0,0,0]".to_owned(),
        "output={}".to_owned(),
        format!("solver.krylov={method}"),
    ];
    let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
    let mut simulation = scene::<3>("ball_drop.json", &overrides)?;
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut step = || alone.install(|| allocation_counter::measure(|| assert!(simulation.step().is_ok())).bytes_total);
    // The first steps allocate the arrays and sort the particles.
    step();
    step();
    let least = (0..4).map(|_| step()).min().ok_or("no steps")?;
    Ok([Plan::of(&simulation)?.bytes() as f64, least as f64])
}

#[test]
fn a_step_that_writes_nothing_allocates_none_of_its_arrays() -> Result<(), Failure> {
    for method in [r#"{"method":{"gmres":{}}}"#, r#"{"method":"conjugate_gradient"}"#] {
        let (small, large) = (held_and_allocated(10, method)?, held_and_allocated(18, method)?);
        // The growing part consists of lists of blocks, partial sums, and the nodes on walls.
        let share = (large[1] - small[1]) / (large[0] - small[0]);
        assert!(share < 0.01, "{method}: {share} of the arrays, {small:?} and {large:?} bytes");
    }
    Ok(())
}
