//! Contact of unequal bodies: what does not depend on their order, and what follows from the softer one.

use super::blocks;
use crate::support::{Failure, built, solid, with};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};

/// Two layers between smooth walls, the lower one 1.07 and both 2 high and wide, are springs in series with their contact:
/// δ = σ (L₁/M₁ + L₂/M₂ + h/min M) with M = Λ + 2G, for ν < 1/3.
#[test]
fn the_softer_body_gives_the_stiffness_of_contact() -> Result<(), Failure> {
    let pressed = 2e-4;
    for young in [[1000.0, 1000.0], [1000.0, 8000.0], [8000.0, 1000.0]] {
        let changes = [
            ("/bodies/0/material/neo_hookean/young", json!(young[0])),
            ("/bodies/1/material/neo_hookean/young", json!(young[1])),
            ("/boundary/top", json!({"displacement": [[0, [null, 0]], [1, [null, -pressed]]]})),
            ("/solver", json!({"newton": {"tolerance": 1e-12}})),
        ];
        let mut simulation: Simulation<2> = built(&with(blocks(1.07), &changes))?;
        // Points of surfaces lie a little below them, so that both steps together tell the stiffness.
        let [first, second] = [simulation.advance()?, simulation.advance()?].map(|step| step.pairs[0]);
        let (force, depth) = (second.force[1] - first.force[1], second.depth - first.depth);
        let modulus = |young: f64| young * 0.7 / (1.3 * 0.4);
        let [lower, upper] = young.map(modulus);
        let stiffness = lower.min(upper) / 0.25;
        let stress = 0.5 * pressed / (1.07 / lower + 0.93 / upper + 1.0 / stiffness);
        // The strains of 1e-4 change moduli by parts of that size.
        assert!((force / (2.0 * stress) - 1.0).abs() < 1e-3, "{young:?}: {force} {stress}");
        assert!((depth * stiffness / stress - 1.0).abs() < 1e-3, "{young:?}: {depth} {stress}");
    }
    Ok(())
}

/// The force of a smooth block on which a corner stands that leans to one side. The block is above or below.
fn force_of_corner(is_below: bool, angle: f64) -> Result<Vector<f64, 2>, Failure> {
    let height = |y: f64| if is_below { y } else { 2.5 - y };
    let range = |a: f64, b: f64| [height(a).min(height(b)), height(a).max(height(b))];
    let ([base, top], [start, end]) = (range(0.0, 1.0), range(1.75, 2.5));
    let square = json!({"box": {"min": [1.7, height(1.5) - 0.3], "max": [2.3, height(1.5) + 0.3]}});
    let angle = if is_below { angle } else { -angle };
    // The lowest corner is at the distance 0.3 √2 cos(45° − angle) from the middle.
    let reach = 0.3 * 2f64.sqrt() * (45.0 - angle.abs()).to_radians().cos();
    let way = if is_below { -1.0 } else { 1.0 };
    let moved = (0.5 - reach + 0.02) * way;
    let turned = json!({"rotated": {"of": square, "about": [2, height(1.5)], "angle": angle}});
    let mut simulation: Simulation<2> = built(&json!({
        "grid": {"size": [4, 2.5], "spacing": 0.125},
        "time": {"step": 0.5, "end": 1, "scheme": "none"},
        "bodies": [solid("block", 1000, json!({"box": {"min": [0.5, base], "max": [3.5, top]}})), solid("corner", 1000, turned)],
        "boundary": {if is_below { "bottom" } else { "top" }: "fixed"},
        "prescribed": [{"region": {"box": {"min": [0, start], "max": [4, end]}}, "displacement": [[0, [0, 0]], [1, [0, moved]]]}],
        "contact": {}
    }))?;
    simulation.advance()?;
    Ok(simulation.advance()?.pairs[0].force)
}

/// A corner acts along the normals of the surface that it meets, and not along its own, even if it leans.
#[test]
fn a_corner_that_leans_presses_along_the_normal_of_the_surface() -> Result<(), Failure> {
    for is_below in [true, false] {
        for angle in [20.0, -30.0] {
            let force = force_of_corner(is_below, angle)?;
            assert!(force[1].abs() > 0.1, "{force}");
            // The surface is still flat at the start of the step in which the corner reaches it.
            assert!(force[0].abs() < 1e-9 * force[1].abs(), "{is_below}, {angle}: {force}");
        }
    }
    Ok(())
}

/// A block on a floor twice as stiff, held by friction against a push of 0.6 of the limit.
fn resting(floor_first: bool) -> Value {
    let block =
        |name, young, min: [f64; 2], max: [f64; 2]| solid(name, young, json!({"box": {"min": min, "max": max}}));
    let mut bodies = [block("floor", 20000, [0.25, 0.5], [3.75, 1.0]), block("block", 10000, [1.0, 1.0], [2.0, 1.5])];
    if !floor_first {
        bodies.reverse();
    }
    json!({
        "grid": {"size": [4, 2], "spacing": 0.25},
        "time": {"step": 0.02, "end": 1, "scheme": {"generalized_alpha": {"spectral_radius": 0.5}}},
        "bodies": bodies,
        "prescribed": [{"region": {"box": {"min": [0, 0], "max": [4, 0.5]}}, "displacement": [[0, [0, 0]]]}],
        "gravity": {"acceleration": [0.3, -1], "curve": [[0, 0], [0.2, 1]]},
        "contact": {"friction": 0.5},
        "solver": {"newton": {"tolerance": 1e-12}}
    })
}

#[test]
fn a_body_that_rests_by_friction_does_so_in_any_order_of_the_list() -> Result<(), Failure> {
    let (mut one, mut other): (Simulation<2>, Simulation<2>) = (built(&resting(true))?, built(&resting(false))?);
    let weight = 0.5;
    for _ in 0..25 {
        let [first, second] = [one.advance()?, other.advance()?].map(|step| step.pairs[0]);
        // The force is that on the second body of the list.
        assert!((first.force + second.force).norm() < 1e-8 * weight, "{} {}", first.force, second.force);
        assert!(
            (first.area - second.area).abs() < 1e-12
                && (first.depth - second.depth).abs() < 1e-8 * first.depth.max(1e-6)
        );
    }
    for simulation in [&one, &other] {
        // The elastic slip stores the work of friction. None of it is lost while it sticks.
        let (loss, stored) = (simulation.loads.contacts.friction_loss(), simulation.contact_energy());
        assert!(loss < 1e-3 * stored, "{loss} {stored}");
    }
    Ok(())
}
