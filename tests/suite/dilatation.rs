//! The mean dilatation of cells: its value, its internal variable, and the absence of locking.

use crate::support::{Failure, advance, in_threads, restored, run_to, scene};
use bfree::mechanics::schemes::Alphas;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::{Nodal, Update, WallUpdate};
use bfree::plan::Plan;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector, determinant, identity};

const MEAN: &str = r#"bodies.0.volumetric="mean_dilatation""#;
const LINEAR: &str = r#"approximation="linear""#;

/// Cook's membrane of G = 422.5 kPa.
fn membrane(poisson: f64, spacing: f64, steps: u32, more: &[&str]) -> Result<Simulation<2>, Failure> {
    let given = [
        format!("grid={{\"size\":[60,84],\"spacing\":{spacing}}}"),
        format!("bodies.0.material.neo_hookean={{\"young\":{},\"poisson\":{poisson}}}", 0.845 * (1.0 + poisson)),
        format!("time.step={}", 1.0 / f64::from(steps)),
        "output={}".to_owned(),
    ];
    let given: Vec<&str> = given.iter().map(String::as_str).chain(more.iter().copied()).collect();
    scene("cook.json", &given)
}

/// The displacement of the middle of the free edge: the displacement of the loaded point nearest to it.
fn tip(simulation: &Simulation<2>, start: &Simulation<2>) -> f64 {
    let (now, before) = (simulation.particles.by_id(), start.particles.by_id());
    let away = |p: &usize| (before.position[*p] - Vector::from([48.0, 52.0])).norm();
    let nearest = (0..before.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0);
    now.position[nearest][1] - before.position[nearest][1]
}

/// Over several grids, a motion with the same change of volume at all particles: the mean θ equals J, and the energy is that of the law.
#[test]
fn the_mean_of_a_uniform_motion_is_what_every_particle_does() -> Result<(), Failure> {
    let mut averaged = membrane(0.49, 4.0, 1, &[MEAN, LINEAR])?;
    let mut pointwise = membrane(0.49, 4.0, 1, &[LINEAR])?;
    let mut f = identity::<f64, 2>();
    for (k, h) in [[0.1, 0.0, 0.05, 0.03], [-0.15, 0.0, 0.1, 0.08], [0.04, 0.0, 0.02, -0.06]].into_iter().enumerate() {
        let h = Tensor::<f64, 2>::new(h[0], h[1], h[2], h[3]);
        let mut energies = Vec::new();
        for simulation in [&mut averaged, &mut pointwise] {
            let (connectivity, nodes) =
                Connectivity::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
            let dphi: Vec<_> = nodes.positions(&simulation.grid).map(|(_, x)| h * x).collect();
            let nodal = Nodal::default();
            let equilibrium = simulation.equilibrium(&connectivity, &nodal, &[], Alphas::START, 0.0);
            let (energy, _) = equilibrium.potential::<f64>(&dphi).ok_or("a potential")??;
            let (at_rest, _) =
                equilibrium.potential::<f64>(&vec![Vector::zeros(); nodes.len()]).ok_or("a potential")??;
            // The energy at the start of a step equals the energy at the end of the last step.
            assert!((at_rest / simulation.strain_energy() - 1.0).abs() < 1e-11 || k == 0, "{at_rest}");
            energies.push(energy);
            let update = Update::new(&Alphas::START, &nodal, &nodal, &[], WallUpdate::Literal, &dphi);
            let mut particles = simulation.particles.clone();
            update.commit(&mut particles, &simulation.bodies, &connectivity, 1.0);
            simulation.particles = particles;
        }
        assert!((energies[0] / energies[1] - 1.0).abs() < 1e-11, "{energies:?}");
        f = (identity::<f64, 2>() + h) * f;
        let particles = &averaged.particles;
        let solid = (0..particles.len()).filter(|&p| particles.is_solid(p));
        let worst = solid.map(|p| (particles.dilatation[p] - (determinant(&f) - 1.0)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-12, "grid {k}: {worst}");
    }
    // A body without mean dilatation stores none.
    assert!(pointwise.particles.dilatation.is_empty());
    Ok(())
}

/// With one reference configuration the answer does not depend on the number of steps. After a grid reset the energy is continuous.
#[test]
fn what_is_remembered_is_that_of_when_the_grid_was_new() -> Result<(), Failure> {
    let tight = "solver.newton.tolerance=1e-12";
    let start = membrane(0.49, 6.0, 1, &[MEAN, LINEAR, tight])?;
    let (mut one, mut four) = (start.clone(), membrane(0.49, 6.0, 4, &[MEAN, LINEAR, tight])?);
    run_to(&mut one, 1.0)?;
    run_to(&mut four, 1.0)?;
    let (a, b) = (tip(&one, &start), tip(&four, &start));
    assert!((a / b - 1.0).abs() < 1e-8, "{a} {b}");
    let mut renewed = membrane(0.49, 6.0, 4, &[MEAN, LINEAR, r#"grid.reset="every_step""#])?;
    advance(&mut renewed, 2)?;
    let (connectivity, nodes) = Connectivity::new(&renewed.approximation, &renewed.grid, &renewed.particles.position)?;
    let nodal = Nodal::default();
    let equilibrium = renewed.equilibrium(&connectivity, &nodal, &[], Alphas::START, 0.0);
    let (energy, _) = equilibrium.potential::<f64>(&vec![Vector::zeros(); nodes.len()]).ok_or("a potential")??;
    assert!((energy / renewed.strain_energy() - 1.0).abs() < 1e-11, "{energy} {}", renewed.strain_energy());
    // θ differs from J.
    let particles = &renewed.particles;
    let jacobian = |p: usize| determinant(&(identity::<f64, 2>() + particles.displacement_gradient[p]));
    assert!((0..particles.len()).any(|p| (jacobian(p) - 1.0 - particles.dilatation[p]).abs() > 1e-2));
    Ok(())
}

#[test]
fn threads_and_restarts_change_no_bit() -> Result<(), Failure> {
    let fresh = || membrane(0.49, 6.0, 4, &[MEAN, LINEAR, r#"grid.reset={"strain":0.2}"#]);
    let by = |threads| {
        in_threads(threads, || {
            let mut simulation = fresh()?;
            run_to(&mut simulation, 1.0)?;
            Ok(simulation.particles.by_id())
        })
    };
    let one = by(1)?;
    assert_eq!(one, by(3)?);
    for after in [1, 3] {
        let start = fresh()?;
        let mut simulation = start.clone();
        advance(&mut simulation, after)?;
        let mut continued = restored(&simulation, &start)?;
        run_to(&mut continued, 1.0)?;
        assert_eq!(continued.particles.by_id(), one, "after {after} steps");
    }
    Ok(())
}

/// A total Lagrangian grid whose reference configuration has θ ≠ 1. The particles may be reordered in memory between two steps; the
/// next step puts them back.
#[test]
fn dilatations_of_a_kept_grid_go_with_their_particles() -> Result<(), Failure> {
    let mut simulation = membrane(0.49, 6.0, 8, &[MEAN, LINEAR, r#"grid.reset={"strain":0.05}"#])?;
    let mut renewed = 0;
    while renewed < 2 || simulation.history.resets_grid() {
        renewed += u32::from(simulation.advance()?.reset);
        assert!(simulation.clock.time() < 0.8, "no second grid that is kept");
    }
    let mut other = simulation.clone();
    let order: Vec<u32> = (0..other.particles.len() as u32).rev().collect();
    other.rearrange(&order);
    assert!(!simulation.advance()?.reset && !other.advance()?.reset);
    assert_eq!(simulation.particles.by_id(), other.particles.by_id());
    Ok(())
}

/// Then the stress shown at a loaded edge is the stress of the body.
#[test]
fn points_of_a_loaded_edge_have_the_dilatation_of_the_nearest_cell() -> Result<(), Failure> {
    let mut simulation = membrane(0.49, 4.0, 1, &[LINEAR, MEAN])?;
    let start = simulation.particles.by_id().position;
    simulation.advance()?;
    let particles = &simulation.particles;
    let solid = particles.solid_places();
    for point in &simulation.loads.surface[0].points {
        let own = particles.dilatation[point.particle];
        let place = start[particles.id[point.particle] as usize];
        let beside = |&&q: &&u32| (start[particles.id[q as usize] as usize] - place).amax() < 4.0;
        let near: Vec<f64> = solid.iter().filter(beside).map(|&q| particles.dilatation[q as usize]).collect();
        assert!(own != 0.0 && near.contains(&own), "{own:e} is none of {near:?}");
    }
    Ok(())
}

#[test]
fn a_law_without_such_a_part_is_refused_and_the_plan_says_what_it_costs() -> Result<(), Failure> {
    let law = r#"bodies.0.material={"st_venant_kirchhoff":{"young":1,"poisson":0.3}}"#;
    let refused = scene::<2>("cook.json", &[MEAN, law]).err().ok_or("no such part")?.to_string();
    assert!(refused.contains("bodies[0].volumetric"), "{refused}");
    let [without, with] = [&[][..], &[MEAN][..]].map(|more| membrane(0.49, 6.0, 4, more));
    let [without, with] = [Plan::of(&without?)?, Plan::of(&with?)?];
    let names = |plan: &Plan| plan.arrays.iter().filter(|array| array.name.contains("mean dilatation")).count();
    assert_eq!((names(&without), names(&with)), (0, 2));
    Ok(())
}
