//! Rayleigh damping: the energy it dissipates, its rate, and the quantities it must leave unchanged.

use crate::support::{Failure, advance, body, built, scene};
use bfree::approximation::{Approximation, Bspline};
use bfree::clock::Clock;
use bfree::grid::Grid;
use bfree::material::{Lame, Material, NeoHookean};
use bfree::mechanics::loads::{Curve, Gravity, Loads, Motion, Prescribed, Rayleigh, Selection};
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::particles::Particles;
use bfree::simulation::{Settings, Simulation};
use bfree::solver::{Forcing, NewtonSettings};
use bfree::tensor::{Tensor, Vector};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::num::NonZeroU64;

/// Tight tolerances, so that only round-off remains.
fn tight() -> NewtonSettings {
    NewtonSettings { relative_tolerance: 1e-13, forcing: Forcing::Fixed(1e-13), ..NewtonSettings::default() }
}

#[test]
fn a_free_rigid_body_slows_down_as_the_trapezoidal_rule_says() -> Result<(), Failure> {
    // A mass that is not lumped is inverted twice per step, to a tolerance of 1e-12.
    for (lumping, bound) in [("time.lumping=1", 1e-12), ("time.lumping=0.4", 80.0 * 1e-12)] {
        let mut simulation = scene::<2>("rebound.json", &[lumping])?;
        let (a, dt) = (0.8, simulation.clock.step());
        simulation.loads.damping = Some(Rayleigh { mass: a, stiffness: 0.0 });
        simulation.settings.newton = tight();
        let start = simulation.particles.by_id();
        simulation.set_initial_acceleration()?;
        let particles = &simulation.particles;
        assert!(particles.acceleration.iter().zip(&particles.velocity).all(|(x, v)| (x + v * a).norm() < 1e-13));
        let rate = (1.0 - 0.5 * a * dt) / (1.0 + 0.5 * a * dt);
        for n in 1..=40 {
            simulation.advance()?;
            let left = f64::powi(rate, n);
            for (v, v_0) in simulation.particles.by_id().velocity.iter().zip(&start.velocity) {
                assert!((v - v_0 * left).norm() < bound * v_0.norm(), "{lumping}, step {n}: {v}");
            }
            let lost = start.kinetic_energy() * (1.0 - left * left);
            let found = simulation.dissipated;
            assert!((found - lost).abs() < 10.0 * bound * lost, "{lumping}, step {n}: {found} for {lost}");
        }
        assert!(simulation.strain_energy() < 1e-20 && simulation.external_work == 0.0);
    }
    Ok(())
}

/// A nearly incompressible disc falls on a floor. J of its particles is free within a cell, so that the stiffness of U(J) is not positive.
#[test]
fn damping_of_averaged_cells_takes_energy_in_every_step() -> Result<(), Failure> {
    let disc = json!({ "name": "disc", "shape": { "ball": { "center": [0.7, 0.7], "radius": 0.5 } }, "velocity": [0, -3], "density": 1000,
                       "material": { "neo_hookean": { "young": 1e5, "poisson": 0.4999 } }, "volumetric": "mean_dilatation" });
    let mut simulation: Simulation<2> = built(&json!({
        "grid": { "origin": [-1, -0.2], "size": [3, 2.2], "spacing": 0.2 },
        "time": { "step": 0.005, "end": 1 }, "bodies": [disc], "damping": { "stiffness": 5e-4 },
        "obstacles": [{ "name": "floor", "shape": { "half_space": { "point": [0, 0], "normal": [0, 1] } } }]
    }))?;
    simulation.settings.check_tangent = NonZeroU64::new(10);
    while simulation.clock.time() < 0.2 {
        let before = simulation.dissipated;
        simulation.advance()?;
        assert!(simulation.dissipated >= before, "{}: {}", simulation.clock.time(), simulation.dissipated);
    }
    assert!(simulation.dissipated > 100.0, "{}", simulation.dissipated);
    Ok(())
}

/// A column that is pressed loses the same energy with and without averages, and in two schemes. After release it comes to rest, with new grids on
/// the way. Cells that were compressed before a reset lose digits there.
#[test]
fn averaged_cells_are_damped_like_particles_in_all_schemes_and_to_rest() -> Result<(), Failure> {
    let column = |scheme: &str, volumetric: &str, reset: Value| -> Result<Simulation<1>, Failure> {
        let body = json!({ "name": "column", "shape": { "box": { "min": [0], "max": [2] } }, "density": 1, "volumetric": volumetric,
                           "material": { "neo_hookean": { "young": 1000, "poisson": 0.49 } } });
        built(&json!({
            "grid": { "size": [4], "spacing": 0.25, "reset": reset }, "time": { "step": 0.01, "end": 9, "scheme": scheme },
            "bodies": [body], "boundary": { "left": "sliding" }, "damping": { "stiffness": 0.02 },
            "gravity": { "acceleration": [-1], "curve": [[0, 0], [0.5, 1500], [1, 1500], [1.5, 0]] }
        }))
    };
    let lost = |scheme: &str, volumetric: &str| -> Result<f64, Failure> {
        let mut simulation = column(scheme, volumetric, json!("never"))?;
        while simulation.clock.time() < 0.2 - 1e-9 {
            simulation.advance()?;
        }
        Ok(simulation.dissipated)
    };
    let averaged = lost("newmark", "mean_dilatation")?;
    for (other, bound) in [(lost("energy_momentum", "mean_dilatation")?, 1e-3), (lost("newmark", "pointwise")?, 0.03)] {
        assert!((other / averaged - 1.0).abs() < bound, "{other} and {averaged}");
    }
    let mut other = column("energy_momentum", "mean_dilatation", json!({ "strain": 0.05 }))?;
    other.settings.check_tangent = NonZeroU64::new(1);
    while other.clock.time() < 8.0 {
        assert!(other.advance()?.failed.is_empty(), "t = {}", other.clock.time());
    }
    Ok(())
}

/// A bar of Λ + 2G = ρ = 1 and length 1 in its lowest mode, ω = π. It starts with the velocity `speed` times the mode shape: sin πx between
/// two walls; cos πx for a free bar, which also flies.
pub fn bar(cells: u32, dt: f64, damping: Rayleigh, speed: f64, free: bool) -> Result<Simulation<1>, Failure> {
    let h = 1.0 / f64::from(cells);
    // The cells left and right of the bar.
    let beside = if free { 8 } else { 0 };
    let start = f64::from(beside) * h;
    let rate = damping.mass + damping.stiffness * PI * PI;
    let mut particles = Particles::<1>::default();
    for p in 0..2 * cells {
        let x = (f64::from(p) + 0.5) * 0.5 * h;
        let v = speed * if free { (PI * x).cos() } else { (PI * x).sin() };
        let uniform = if free { 0.5 * speed } else { 0.0 };
        particles.push(Vector::from([start + x]), Vector::from([v + uniform]), 0.5 * h, 0.5 * h, 0);
        particles.acceleration[p as usize] = Vector::from([-rate * v - damping.mass * uniform]);
    }
    let wall = |upper| Prescribed {
        name: "wall".into(),
        on: Selection::Face { axis: 0, upper },
        motion: [Some(Motion::Rest)],
    };
    let law = Material::from(NeoHookean::ciarlet(Lame::new(0.5, 0.25)?));
    let prescribed = if free { vec![] } else { vec![wall(false), wall(true)] };
    let grid = Grid { origin: Vector::zeros(), spacing: h, cells: [cells + 2 * beside] };
    Ok(Simulation {
        loads: Loads { prescribed, damping: Some(damping), ..Loads::default() },
        settings: Settings { lumping: 0.0, newton: tight(), ..Settings::default() },
        ..Simulation::new(grid, Approximation::from(Bspline::Quadratic), vec![body(law)], particles, Clock::new(dt, 0))
    })
}

/// The rate at which the kinetic energy falls over a whole period: from one of its maxima to the next but one.
fn rate(steps: u32, damping: Rayleigh) -> Result<f64, Failure> {
    let share = 0.5 * (damping.mass / PI + damping.stiffness * PI);
    let period = 2.0 / (1.0 - share * share).sqrt();
    let mut simulation = bar(32, period / f64::from(steps), damping, 1e-3, false)?;
    let before = simulation.particles.kinetic_energy();
    advance(&mut simulation, steps as usize)?;
    let after = simulation.particles.kinetic_energy();
    Ok((before / after).ln() / period)
}

#[test]
fn the_lowest_mode_of_a_bar_decays_as_theory_says() -> Result<(), Failure> {
    // ü + (a + b ω²) u̇ + ω² u = 0: amplitudes fall as e^(−(a + b ω²) t/2).
    for damping in [Rayleigh { mass: 0.0, stiffness: 0.04 }, Rayleigh { mass: 0.3, stiffness: 0.0 }] {
        let exact = damping.mass + damping.stiffness * PI * PI;
        let [coarse, fine] = [40, 160].map(|steps| rate(steps, damping).map(|rate| (rate / exact - 1.0).abs()));
        let (coarse, fine) = (coarse?, fine?);
        // A quarter of the step gives a sixteenth of the error, until the error of the 32 cells remains.
        assert!(coarse < 1e-2 && fine < 1e-3 && fine < 0.15 * coarse, "{damping:?}: off by {coarse:e} and {fine:e}");
    }
    Ok(())
}

#[test]
fn the_stiffness_part_takes_no_momentum() -> Result<(), Failure> {
    let near = ["bodies.1.shape.ball.center=[5.4, 2.75]", "bodies.0.velocity=[2,0]", "output.probes=[]"];
    let mut simulation = scene::<2>("collision.json", &near)?;
    simulation.loads.damping = Some(Rayleigh { mass: 0.0, stiffness: 0.01 });
    simulation.settings.newton = tight();
    let before = simulation.particles.momentum();
    let energy = simulation.particles.kinetic_energy();
    advance(&mut simulation, 30)?;
    let given = simulation.particles.momentum() - before;
    assert!(simulation.dissipated > 0.05 * energy, "{}", simulation.dissipated);
    assert!(given.norm() < 1e-11 * before.norm(), "{given}");
    Ok(())
}

/// The largest defect of the energy balance of a free bar under gravity, and the dissipated energy, over its energy at the start.
fn defect(steps: u32, damping: Rayleigh, speed: f64) -> Result<[f64; 2], Failure> {
    let mut simulation = bar(32, 1.0 / f64::from(steps), damping, speed, true)?;
    let g = Vector::from([-0.5 * speed]);
    simulation.loads.gravity = Some(Gravity { acceleration: g, curve: Curve::constant(1.0) });
    simulation.particles.acceleration.iter_mut().for_each(|a| *a += g);
    let start = simulation.particles.kinetic_energy();
    let mut most: f64 = 0.0;
    for _ in 0..steps {
        simulation.advance()?;
        let stored = simulation.particles.kinetic_energy() + simulation.strain_energy();
        most = most.max((stored + simulation.dissipated - simulation.external_work - start).abs());
    }
    assert!(simulation.external_work.abs() > 1e-2 * start);
    Ok([most / start, simulation.dissipated / start])
}

#[test]
fn what_damping_takes_is_counted() -> Result<(), Failure> {
    let mass = Rayleigh { mass: 0.3, stiffness: 0.0 };
    let orders = |damping, speed| -> Result<[f64; 3], Failure> {
        let [coarse, middle, fine] = [50, 100, 200].map(|steps| defect(steps, damping, speed));
        let ([coarse, _], [middle, _], [fine, dissipated]) = (coarse?, middle?, fine?);
        assert!(dissipated > 0.1, "{damping:?}: {dissipated}");
        Ok([coarse, middle, fine])
    };
    // The trapezoidal rule is of second order.
    let [coarse, middle, fine] = orders(mass, 1e-3)?;
    assert!(coarse < 1e-6 && middle < 0.3 * coarse && fine < 0.3 * middle, "{coarse:e} {middle:e} {fine:e}");
    // K_n changes with the strain from step to step, so the defect is of first order. It falls with the size of the motion.
    let stiffness = Rayleigh { mass: 0.0, stiffness: 0.04 };
    let [coarse, middle, fine] = orders(stiffness, 1e-3)?;
    assert!(coarse < 1e-5 && middle < 0.6 * coarse && fine < 0.6 * middle, "{coarse:e} {middle:e} {fine:e}");
    let [large, ..] = orders(stiffness, 1e-2)?;
    assert!(coarse < 0.12 * large, "{coarse:e} {large:e}");
    Ok(())
}

#[test]
fn a_body_that_turns_as_a_whole_is_not_damped_by_its_stiffness() -> Result<(), Failure> {
    let mut simulation = scene::<2>("rebound.json", &[])?;
    simulation.particles.displacement_gradient.fill(Tensor::<f64, 2>::new(0.2, 0.3, -0.1, -0.15));
    simulation.loads.damping = Some(Rayleigh { mass: 0.0, stiffness: 0.5 });
    let dt = simulation.clock.step();
    let (connectivity, nodes) =
        Connectivity::new(&simulation.approximation, &simulation.grid, &simulation.particles.position)?;
    let positions: Vec<_> = nodes.positions(&simulation.grid).map(|(_, x)| x).collect();
    // The body has turned by this angle on a grid that was not reset since.
    for angle in [0.0_f64, 1.0] {
        let (sin, cos) = angle.sin_cos();
        let turned = |x: &Vector<f64, 2>| {
            let arm = x - Vector::from([2.5, 2.5]);
            Vector::from([cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]])
        };
        let forces = |velocity: &dyn Fn(&Vector<f64, 2>) -> Vector<f64, 2>| -> Result<_, Failure> {
            let mut nodal = Nodal::at_rest(&simulation.particles, &connectivity);
            nodal.motion =
                positions.iter().map(|x| turned(x) - (x - Vector::from([2.5, 2.5]))).collect::<Vec<_>>().into();
            nodal.velocity.iter_mut().zip(&positions).for_each(|(v, x)| *v = velocity(&turned(x)));
            // v_{n+1} = v_n, for the real part of the dual numbers too.
            let phi: Vec<_> = nodal.motion.iter().zip(&*nodal.velocity).map(|(motion, v)| motion + v * dt).collect();
            let equilibrium =
                simulation.equilibrium(&connectivity, &nodal, &[], simulation.settings.scheme.end(dt), dt);
            let pieces = equilibrium.terms.pieces();
            let piece = pieces.iter().find(|piece| piece.name == "damping").ok_or("no damping")?;
            let force = equilibrium.residual_of::<f64>(*piece, &phi)?;
            Ok(force.iter().map(|f| f.norm()).fold(0.0, f64::max))
        };
        let turning = forces(&|arm| Vector::from([-arm[1], arm[0]]))?;
        let shearing = forces(&|arm| Vector::from([arm[1], arm[0]]))?;
        assert!(shearing > 1.0 && turning < 1e-12 * shearing, "{angle}: {turning:e} {shearing:e}");
    }
    Ok(())
}
