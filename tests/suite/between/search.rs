//! The closest points of contact between bodies: where surfaces stretch, turn, and slide in load steps.

use super::discs;
use crate::support::{Failure, advance, built, solid, with};
use bfree::mechanics::loads::{BodyContact, Candidate};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::json;
use std::collections::HashSet;

fn body_contact<const D: usize>(simulation: &Simulation<D>) -> Result<&BodyContact<D>, Failure> {
    Ok(simulation.loads.contacts.between.as_ref().ok_or("no contact between bodies")?)
}

/// The position of a point of a surface.
fn position(simulation: &Simulation<2>, number: usize) -> Vector<f64, 2> {
    simulation.particles.position[simulation.loads.contacts.points[number].particle]
}

#[test]
fn a_slip_keeps_its_length_where_the_surface_turns() -> Result<(), Failure> {
    let mut simulation: Simulation<2> = built(&with(discs(0.4), &[("/contact/friction", json!(0.3))]))?;
    let mut most_turned = 0.0_f64;
    while simulation.clock.time() < 0.3 {
        let slips = body_contact(&simulation)?.slips.clone();
        simulation.advance()?;
        for one in &body_contact(&simulation)?.candidates {
            let Some(before) = slips.get(&[one.number, one.pair]).filter(|slip| slip.norm() > 1e-12) else { continue };
            let (long, now) = (before.norm(), one.slip.norm());
            most_turned = most_turned.max(one.normal.dot(before).abs() / long);
            assert!((now / long - 1.0).abs() < 1e-12 && one.normal.dot(&one.slip).abs() < 1e-12 * long, "{long} {now}");
        }
    }
    assert!(most_turned > 1e-3, "the surfaces turn by {most_turned}");
    Ok(())
}

/// The part along the surface of a point's way from the material that was chosen as its closest point.
fn way_along(simulation: &Simulation<2>, one: &Candidate<2>) -> f64 {
    let closest = one.closest.iter().map(|part| (position(simulation, part.number) + part.offset) * part.share);
    let apart = position(simulation, one.number) - closest.sum::<Vector<f64, 2>>();
    (apart - one.normal * one.normal.dot(&apart)).norm()
}

/// The force of a point acts on the material that is below it at the end of the step. While a block slides steadily, this place is known.
#[test]
fn points_that_slide_in_load_steps_act_on_the_material_below_them() -> Result<(), Failure> {
    let block = |name, min: [f64; 2], max: [f64; 2]| solid(name, 1000, json!({"box": {"min": min, "max": max}}));
    let mut simulation: Simulation<2> = built(&json!({
        "grid": {"size": [4, 2], "spacing": 0.25, "reset": "never"},
        "time": {"step": 0.125, "end": 1, "scheme": "none"},
        "bodies": [block("base", [0.3, 0.0], [3.7, 1.0]), block("block", [1.1, 1.0], [2.1, 1.6])],
        "boundary": {"bottom": "fixed"},
        "prescribed": [{"region": {"box": {"min": [0, 1.4], "max": [4, 2]}},
                        "displacement": [[0, [0, 0]], [0.25, [0, -0.01]], [1, [0.45, -0.01]]]}],
        "contact": {}
    }))?;
    advance(&mut simulation, 4)?;
    let way = 0.45 / 6.0;
    for _ in 0..2 {
        let before: Vec<_> =
            (0..simulation.loads.contacts.points.len()).map(|number| position(&simulation, number)).collect();
        simulation.advance()?;
        let candidates = &body_contact(&simulation)?.candidates;
        let most = candidates.iter().map(|one| way_along(&simulation, one)).fold(0.0, f64::max);
        let slides = |one: &&Candidate<2>| (position(&simulation, one.number) - before[one.number])[0] > 0.9 * way;
        assert!(candidates.iter().filter(slides).count() > 5, "{} candidates", candidates.len());
        // Both bodies are strained by a percent.
        assert!(most < 0.1 * way, "{most} beside its point, and {way} is the way of a step");
    }
    Ok(())
}

/// A strip that is pulled to more than twice its length just above a base. Every point of the base below it sees it.
#[test]
fn a_surface_that_stretches_has_no_gaps() -> Result<(), Failure> {
    let block = |name, min: [f64; 2], max: [f64; 2]| solid(name, 1000, json!({"box": {"min": min, "max": max}}));
    let pulled = |from: f64, to: f64, way: f64| {
        let region = json!({"box": {"min": [from, 0.7], "max": [to, 2]}});
        json!({"region": region, "displacement": [[0, [0, 0]], [1, [way, 0]]]})
    };
    let mut simulation: Simulation<2> = built(&json!({
        "grid": {"size": [4, 1.5], "spacing": 0.25, "reset": "every_step"},
        "approximation": "linear",
        "time": {"step": 0.05, "end": 1, "scheme": "none"},
        "bodies": [block("base", [0.0, 0.0], [4.0, 0.5]), block("strip", [1.5, 0.5], [2.5, 1.0])],
        "boundary": {"bottom": "fixed", "left": "sliding", "right": "sliding"},
        "prescribed": [pulled(0.0, 1.6, -0.5), pulled(2.4, 4.0, 0.5)],
        "contact": {}
    }))?;
    let start = simulation.loads.contacts.points.len();
    let mut most = 0.0_f64;
    while simulation.clock.time() < 1.0 - 1e-9 {
        let places: Vec<_> =
            (0..simulation.loads.contacts.points.len()).map(|number| position(&simulation, number)).collect();
        simulation.advance()?;
        let (particles, points) = (&simulation.particles, &simulation.loads.contacts.points);
        let of_strip = |number: &usize| particles.body[points[*number].particle] == 1;
        let ends = (0..places.len()).filter(of_strip).map(|number| places[number][0]);
        let (low, high) = ends.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        let seen: HashSet<usize> = body_contact(&simulation)?.candidates.iter().map(|one| one.number).collect();
        let lies_below = |number: &usize| !of_strip(number) && (low + 0.1..high - 0.1).contains(&places[*number][0]);
        let on_top = (0..places.len()).filter(lies_below).filter(|number| points[*number].normal[1] > 0.9);
        let free: Vec<_> = on_top.filter(|number| !seen.contains(number)).map(|number| places[number]).collect();
        assert!(free.is_empty(), "t = {}: {free:?} between {low} and {high}", simulation.clock.time());
        let stretch = |p: usize| 1.0 + particles.displacement_gradient[p][(0, 0)];
        most = (0..particles.len()).filter(|&p| particles.body[p] == 1).map(stretch).fold(most, f64::max);
    }
    assert!(most > 2.2 && simulation.loads.contacts.points.len() > start, "{most}");
    Ok(())
}
