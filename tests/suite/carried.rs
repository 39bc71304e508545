//! Grid resets: the state of the particles, the out-of-balance force and the reactions that the new grid takes over from the old one.

use crate::support::{Failure, advance, apart, built, run_to, scene, solid};
use bfree::mechanics::loads::Pressing;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::json;

const EVERY_STEP: &str = r#"grid.reset="every_step""#;

/// A short beam, bent by half of its length in eight load steps; its load follows `curve`.
fn beam(curve: &str, more: &[&str]) -> Result<Simulation<2>, Failure> {
    let load = format!(
        r#"tractions=[{{"body":"beam","region":{{"half_space":{{"point":[6,0],"normal":[-1,0]}}}},"traction":[0,-10],"curve":{curve}}}]"#
    );
    let short = [
        "grid.size=[8, 8]",
        "grid.spacing=0.5",
        r#"bodies.0.shape={"box":{"min":[0,6],"max":[6,7]}}"#,
        &load,
        "output={}",
        "solver.newton.tolerance=1e-12",
        "time.step=0.125",
    ];
    scene("elastica.json", &[&short, more].concat())
}

/// The load grows up to t = 0.5 and is constant from then on.
const RESTS: &str = "[[0,0],[0.5,1]]";

/// On a reset grid the stresses are out of balance. This out-of-balance force is carried over, so under constant loads nothing moves.
#[test]
fn what_a_new_grid_does_not_balance_is_carried_over() -> Result<(), Failure> {
    for renewed in [EVERY_STEP, r#"grid.reset={"strain": 0.05}"#] {
        let mut simulation = beam(RESTS, &[renewed])?;
        let mut renewals = 0;
        for _ in 0..4 {
            renewals += u32::from(simulation.advance()?.reset);
        }
        assert!(renewals > 1, "{renewals}");
        let loaded = simulation.clone();
        for _ in 0..4 {
            // The equilibrium of the next step, as the step solves it: at Δφ = 0 its residual vanishes.
            let coming = simulation.next_step()?;
            let still = coming.motion(&vec![Vector::zeros(); coming.nodes().len()]);
            let mut residual = coming.equilibrium().residual(&still)?;
            coming.equilibrium().clear_prescribed(&mut residual);
            let largest = residual.iter().map(|r| r.amax()).fold(0.0, f64::max);
            assert!(largest < 1e-9, "{renewed}: {largest:e}");
            simulation.advance()?;
        }
        // Newton's tolerance of 1e-12 in residuals, for a beam of length 6 that is soft in bending.
        assert!(apart(&loaded, &simulation) < 1e-8, "{renewed}: {:e}", apart(&loaded, &simulation));
    }
    Ok(())
}

/// The step carries over the out-of-balance force of the last step only: loads that are changed by hand act in full.
#[test]
fn loads_changed_between_steps_are_not_taken_for_what_was_in_balance() -> Result<(), Failure> {
    let mut by_hand = beam(RESTS, &[EVERY_STEP])?;
    let mut doubled = beam("[[0,0],[0.5,1],[0.625,2]]", &[EVERY_STEP])?;
    advance(&mut by_hand, 4)?;
    advance(&mut doubled, 4)?;
    let before = by_hand.clone();
    by_hand.loads.surface[0].pressing = Pressing::Traction(Vector::from([0.0, -20.0]));
    // A copy with another order of its particles.
    let mut reversed = by_hand.clone();
    reversed.rearrange(&(0..by_hand.particles.len() as u32).rev().collect::<Vec<_>>());
    for simulation in [&mut by_hand, &mut doubled, &mut reversed] {
        simulation.step()?;
    }
    assert!(apart(&before, &by_hand) > 0.1, "{:e}", apart(&before, &by_hand));
    assert!(apart(&doubled, &by_hand) < 1e-8, "{:e}", apart(&doubled, &by_hand));
    assert!(apart(&doubled, &reversed) < 1e-8, "{:e}", apart(&doubled, &reversed));
    Ok(())
}

/// Laws that are changed by hand act in full, too.
#[test]
fn other_laws_have_to_be_balanced() -> Result<(), Failure> {
    let mut simulation = beam(RESTS, &[EVERY_STEP])?;
    advance(&mut simulation, 5)?;
    let before = simulation.clone();
    let soft = beam(RESTS, &[r#"bodies.0.material={"neo_hookean":{"young":1000,"poisson":0}}"#])?;
    let mut softer = simulation.with_laws(|_| soft.bodies[0].law.clone());
    softer.step()?;
    assert!(apart(&before, &softer) > 0.1, "{:e}", apart(&before, &softer));
    Ok(())
}

/// Σ r + Σ f = 0 on every grid.
#[test]
fn reactions_balance_loads_after_renewals() -> Result<(), Failure> {
    for family in [r#""linear""#, r#"{"bspline": {"degree": 3}}"#] {
        for renewed in [EVERY_STEP, r#"grid.reset={"strain": 0.05}"#] {
            let mut simulation = beam("[[0,0],[1,1]]", &[renewed, &format!("approximation={family}")])?;
            for _ in 0..8 {
                let step = simulation.advance()?;
                let load = Vector::from([0.0, -10.0 * simulation.clock.time()]);
                let sum: Vector<f64, 2> = step.reactions.iter().map(|reaction| reaction.force).sum();
                assert!((sum + load).norm() < 1e-9, "{family}, {renewed}: {sum} for {load}");
            }
        }
    }
    Ok(())
}

/// A bar fixed at one end and rotated at the other up to t = 0.5. Forces and torques then stay constant, whatever the grid.
#[test]
fn reactions_go_on_over_renewals() -> Result<(), Failure> {
    let turned = json!({
        "grid": {"size": [8, 8], "spacing": 0.5, "reset": "every_step"},
        "time": {"step": 0.125, "end": 1, "scheme": "none"},
        "bodies": [solid("bar", 100, json!({"box": {"min": [1, 3.1], "max": [7, 4.9]}}))],
        "prescribed": [
            {"region": {"box": {"min": [0, 0], "max": [1.6, 8]}}, "displacement": [[0, [0, 0]]]},
            {"region": {"box": {"min": [6.4, 0], "max": [8, 8]}}, "rotation": {"center": [7, 4], "angle": [[0, 0], [0.5, 0.3], [1, 0.3]]}}
        ],
        "solver": {"newton": {"tolerance": 1e-12}}
    });
    let mut simulation = built::<2>(&turned)?;
    let mut reactions = Vec::new();
    while simulation.clock.time() < 1.0 {
        reactions.push(simulation.step()?.reactions);
    }
    let [loaded, last] = [3, 7].map(|step| &reactions[step]);
    assert!(loaded[1].torque.abs() > 1.0, "{loaded:?}");
    for (one, other) in loaded.iter().zip(last) {
        let apart = (one.force - other.force).norm().max((one.torque - other.torque).abs());
        assert!(apart < 1e-7, "{one:?} {other:?}");
    }
    Ok(())
}

/// A bar is bent between two clamps, and then turns with them by 0.2. Both torques balance on a kept grid. The out-of-balance force of a
/// reset keeps its direction, which the manual gives as a limit.
#[test]
fn clamps_that_turn_together_have_opposite_torques_on_a_kept_grid() -> Result<(), Failure> {
    let clamp = |min: f64, max: f64, bent: f64| {
        let angle = json!([[0, 0], [0.5, bent], [1, bent + 0.2]]);
        json!({"region": {"box": {"min": [min, 0], "max": [max, 8]}}, "rotation": {"center": [4, 4], "angle": angle}})
    };
    for (reset, most) in [("never", 1e-9), ("every_step", 0.03)] {
        let mut simulation = built::<2>(&json!({
            "grid": {"size": [8, 8], "spacing": 0.5, "reset": reset},
            "time": {"step": 0.125, "end": 1, "scheme": "none"},
            "bodies": [solid("bar", 100, json!({"box": {"min": [1, 3.1], "max": [7, 4.9]}}))],
            "prescribed": [clamp(0.0, 1.6, -0.05), clamp(6.4, 8.0, 0.05)],
            "solver": {"newton": {"tolerance": 1e-12}}
        }))?;
        advance(&mut simulation, 7)?;
        let reactions = simulation.advance()?.reactions;
        let [one, other] = [0, 1].map(|number: usize| reactions[number].torque);
        assert!((one + other).abs() < most * one.abs(), "{reset}: {one} {other}");
    }
    Ok(())
}

/// A stretched block. Its prescribed displacement is removed, and the force of that condition must not remain.
#[test]
fn what_a_body_has_lost_does_not_hold_it() -> Result<(), Failure> {
    let mut simulation = built::<2>(&pressed(&["left"], -0.05))?;
    run_to(&mut simulation, 0.5)?;
    let before = simulation.strain_energy();
    let grip = simulation.loads.prescribed.len() - 1;
    simulation.loads.prescribed.truncate(grip);
    simulation.step()?;
    // The residuals of the reset grids themselves are small.
    assert!(simulation.strain_energy() < 1e-2 * before, "{} of {before}", simulation.strain_energy());
    Ok(())
}

/// A block pressed on by another one, which is then taken away.
#[test]
fn a_body_that_has_parted_does_not_hold_another() -> Result<(), Failure> {
    let mut simulation = built::<2>(&pressed(&["left", "right"], 0.1))?;
    run_to(&mut simulation, 0.5)?;
    let energy = |of: &Simulation<2>| {
        let particles = &of.particles;
        let of_first = (0..particles.len()).filter(|&p| particles.body[p] == 0);
        of_first.map(|p| particles.volume[p] * particles.displacement_gradient[p].norm_squared()).sum::<f64>()
    };
    let before = energy(&simulation);
    assert!(before > 1e-4, "{before}");
    let mut stuck = simulation.clone();
    stuck.step()?;
    assert!((energy(&stuck) / before - 1.0).abs() < 1e-6, "{} of {before}", energy(&stuck));
    let particles = &mut simulation.particles;
    (0..particles.len()).filter(|&p| particles.body[p] == 1).for_each(|p| particles.position[p][0] += 2.0);
    simulation.step()?;
    assert!(energy(&simulation) < 1e-2 * before, "{} of {before}", energy(&simulation));
    Ok(())
}

/// Blocks of length 1 in a row, the first fixed at x = 0. The last half of the row is moved by −`by` up to t = 0.5.
fn pressed(names: &[&str], by: f64) -> serde_json::Value {
    let block = |(k, name): (usize, &&str)| solid(name, 100, json!({"box": {"min": [k, 1], "max": [k + 1, 2]}}));
    json!({
        "grid": {"size": [6, 3], "spacing": 0.5, "reset": "every_step"},
        "time": {"step": 0.25, "end": 1, "scheme": "none"},
        "approximation": "linear",
        "bodies": names.iter().enumerate().map(block).collect::<Vec<_>>(),
        "boundary": {"left": "fixed"},
        "prescribed": [{"region": {"half_space": {"point": [names.len() as f64 - 0.6, 0], "normal": [-1, 0]}},
                        "displacement": [[0, [0, 0]], [0.5, [-by, 0]]]}],
        "solver": {"newton": {"tolerance": 1e-12}}
    })
}

/// Gravity that grows along x, on a block moved along x without strain. The reaction shows which force acts on the block: x is the position
/// at the beginning of the step, on every grid.
#[test]
fn a_field_acts_where_a_body_has_come_to() -> Result<(), Failure> {
    for renewed in [json!("never"), json!("every_step"), json!({"strain": 0.1})] {
        let moved = json!({
            "grid": {"size": [8, 3], "spacing": 0.5, "reset": renewed},
            "time": {"step": 0.25, "end": 1, "scheme": "none"},
            "bodies": [{"name": "block", "shape": {"box": {"min": [1, 1], "max": [2, 2]}}, "density": 2,
                        "material": {"neo_hookean": {"young": 1000, "poisson": 0.3}}}],
            "prescribed": [{"region": {"box": {"min": [0, 0], "max": [8, 3]}}, "displacement": [[0, [0, 0]], [1, [4, 0]]]}],
            "gravity": {"acceleration": [0, -1], "curve": [[0, 1], [1, 2]], "profile": {"along": [1, 0], "factor": [[0, 0], [8, 8]]}}
        });
        let mut simulation = built::<2>(&moved)?;
        for _ in 0..4 {
            let particles = &simulation.particles;
            let moment: f64 = particles.position.iter().zip(&particles.mass).map(|(x, m)| m * x[0]).sum();
            let step = simulation.step()?;
            let weight = moment * (1.0 + simulation.clock.time());
            let held = step.reactions[0].force[1];
            assert!((held / weight - 1.0).abs() < 1e-9, "{renewed}: {held} of {weight}");
        }
    }
    Ok(())
}
