//! Aggregation: outer nodes follow inner ones. What it keeps exact, and what it mends.

use crate::support::{Failure, Random, scene};
use bfree::aggregation::{Extension, Occupied, Pieces};
use bfree::mechanics::check::direction;
use bfree::mechanics::kept::Renewal;
use bfree::plan::Plan;
use bfree::scene;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};

const AGGREGATION: &str = "aggregation=true";

/// All kinds of pieces.
fn pieces() -> Vec<Pieces> {
    let of = |(degree, extension)| Pieces { degree, extension, ..Pieces::LINEAR };
    let mut all: Vec<Pieces> = [(1, 1), (2, 1), (2, 2), (3, 1), (3, 3)].map(of).into();
    all.extend([2, 3].map(|degree| Pieces { curves_at_walls: true, ..of((degree, degree)) }));
    all
}

/// The nodes of the functions that are not zero in an occupied knot cell.
fn nodes(pieces: Pieces, cells: &[([u32; 3], f64)], grid: [u32; 3]) -> Vec<[u32; 3]> {
    let along = |cell: u32, cells: u32| {
        let first = i64::from(cell) - i64::from(pieces.degree / 2);
        // Where functions curve at walls, their first nodes act in the first two cells.
        let last = i64::from(cells) - i64::from(pieces.degree);
        let first = if pieces.curves_at_walls { first.clamp(0, last) } else { first };
        (first..=first + i64::from(pieces.degree)).filter(move |node| (0..=i64::from(cells)).contains(node))
    };
    let mut all = Vec::new();
    for (cell, _) in cells {
        for y in along(cell[1], grid[1]) {
            all.extend(along(cell[0], grid[0]).map(|x| [x as u32, y as u32, 0]));
        }
    }
    all.sort_unstable_by_key(|node| (node[1], node[0]));
    all.dedup();
    all
}

/// Bodies drawn at random in a grid of 12 × 9 cells: in corners, at walls, in pieces.
fn drawn(pieces: Pieces, random: &mut Random) -> (Vec<[u32; 3]>, Extension) {
    let grid = [12, 9, 0];
    let more = u32::from(pieces.degree == 2);
    let mut cells = Vec::new();
    let low = [random.below(6) as u32, random.below(5) as u32];
    let high = [low[0] + 1 + random.below(6) as u32, low[1] + 1 + random.below(4) as u32];
    for y in low[1]..=high[1].min(grid[1] - 1 + more) {
        for x in low[0]..=high[0].min(grid[0] - 1 + more) {
            let share = [0.05, 0.3, 0.6, 1.0][random.below(4) as usize];
            if random.below(5) > 0 {
                cells.push(([x, y, 0], share));
            }
        }
    }
    let nodes = nodes(pieces, &cells, grid);
    let extension = Extension::new(pieces, &Occupied { dimension: 2, grid, nodes: &nodes, cells });
    (nodes, extension)
}

#[test]
fn linear_fields_are_continued_exactly_and_so_are_polynomials_away_from_walls() {
    let (mut random, mut followed) = (Random(7), 0);
    for pieces in pieces() {
        for _ in 0..200 {
            let (nodes, extension) = drawn(pieces, &mut random);
            let linear = |node: [u32; 3]| 3.0 + 0.7 * f64::from(node[0]) - 1.3 * f64::from(node[1]);
            // Coefficients of a polynomial are a polynomial of the node's index, but for walls.
            let power = if pieces.extension == pieces.degree { pieces.degree as i32 } else { 1 };
            let inside = |node: [u32; 3]| (2..=9).contains(&node[0]) && (2..=7).contains(&node[1]);
            let curved = |node: [u32; 3]| f64::from(node[0]).powi(power) * f64::from(node[1]).powi(power);
            for (outer, leaders) in extension.rows() {
                let leaders: Vec<_> = leaders.collect();
                let size: f64 = leaders.iter().map(|(_, weight)| weight.abs()).sum();
                let sum: f64 = leaders.iter().map(|(leader, weight)| weight * linear(nodes[*leader])).sum();
                assert!((sum - linear(nodes[outer])).abs() < 1e-12 * (1.0 + 20.0 * size), "{pieces:?}: {leaders:?}");
                if leaders.iter().all(|(leader, _)| inside(nodes[*leader]))
                    && nodes[outer][0] > 0
                    && nodes[outer][1] > 0
                {
                    let sum: f64 = leaders.iter().map(|(leader, weight)| weight * curved(nodes[*leader])).sum();
                    let scale = size * 9f64.powi(2 * power);
                    assert!((sum - curved(nodes[outer])).abs() < 1e-13 * scale, "{pieces:?}: {leaders:?}");
                }
                followed += 1;
            }
        }
    }
    assert!(followed > 1000, "{followed} outer nodes were drawn");
}

/// Tractions, follower pressures, mean dilatation, plastic flow, damping and inertia, with prescribed nodes among the outer ones.
#[test]
fn the_tangent_is_the_derivative_of_the_aggregated_residual() -> Result<(), Failure> {
    let cases: [(&str, &[&str]); 6] = [
        ("cook.json", &[]),
        ("ring.json", &[]),
        ("tube.json", &["output={}"]),
        ("cook.json", &[r#"approximation={"lme":{"gamma":1.4}}"#]),
        ("cook.json", &[r#"approximation="gimp""#]),
        (
            "rebound.json",
            &[
                r#"approximation={"bspline":{"degree":2}}"#,
                "time.lumping=0.3",
                "damping={\"mass\":0.1,\"stiffness\":0.001}",
            ],
        ),
    ];
    for (name, more) in cases {
        let overrides: Vec<&str> = more.iter().copied().chain([AGGREGATION]).collect();
        let simulation = scene::<2>(name, &overrides)?;
        let coming = simulation.coming()?;
        let equilibrium = coming.equilibrium();
        let followers = equilibrium.step.supports.extension().map_or(0, |extension| extension.len());
        assert!(followers > 0, "{name}: no node follows");
        let count = coming.nodes().len();
        let dphi: Vec<_> = direction::<2>(count, 1).iter().map(|x| x * (1e-3 * simulation.grid.spacing)).collect();
        equilibrium.check_tangent(&dphi, &direction(count, 2)).map_err(|error| format!("{name}: {error}"))?;
    }
    Ok(())
}

/// A bar between planes of symmetry, pulled at its end, which lies anywhere in its cell.
fn bar(family: Value, offset: f64, traction: f64) -> Result<Simulation<2>, Failure> {
    let (h, end) = (0.125, 1.0 + 0.125 * offset);
    let scene = json!({
        "grid": { "size": [1.5, 1.0], "spacing": h }, "approximation": family, "aggregation": true,
        "time": { "step": 1, "end": 1, "inertia": "none" },
        "bodies": [{ "name": "bar", "shape": { "box": { "min": [0, 0], "max": [end, 0.5 + 0.3 * h] } }, "density": 1,
            "material": { "neo_hookean": { "young": 1000, "poisson": 0.3 } } }],
        "boundary": { "left": "sliding", "bottom": "sliding" },
        "tractions": [{ "body": "bar", "region": { "half_space": { "point": [end, 0], "normal": [-1, 0] } }, "traction": [traction, 0] }],
        "solver": { "newton": { "tolerance": 1e-14 } }
    });
    Ok(scene::read(&scene.to_string(), &[])?.build(".".as_ref())?)
}

/// The penalty left the end of such a bar 10 % too long on grid lines, and a stress of thirty times the traction in its points.
#[test]
fn a_bar_under_tension_is_strained_evenly_wherever_its_end_lies() -> Result<(), Failure> {
    for family in [json!("gimp"), json!("linear")] {
        for offset in [0.0, 0.1, 0.3, 0.5, 0.7, 0.9] {
            let mut simulation = bar(family.clone(), offset, 10.0)?;
            simulation.advance()?;
            let h = &simulation.particles.displacement_gradient;
            let apart = h.iter().map(|one| (one - h[0]).norm()).fold(0.0, f64::max);
            assert!(apart < 1e-12 * h[0].norm(), "{family}, {offset}: {apart:e} of {:e}", h[0].norm());
            assert_eq!(simulation.dissipated, 0.0, "{family}, {offset}");
        }
    }
    Ok(())
}

#[test]
fn a_kept_grid_gives_one_answer_in_any_number_of_load_steps() -> Result<(), Failure> {
    let tip = |step: &str| -> Result<f64, Failure> {
        let mut simulation = scene::<2>("cook.json", &[AGGREGATION, step])?;
        while simulation.clock.time() < 1.0 - 1e-9 {
            simulation.advance()?;
        }
        let end = simulation.particles.by_id();
        Ok(end.position.iter().map(|x| x[1]).fold(0.0, f64::max))
    };
    let (one, four) = (tip("time.step=1")?, tip("time.step=0.25")?);
    assert!((one - four).abs() < 1e-6, "{one} {four}");
    Ok(())
}

/// In flight, with a lumped, a mixed and a consistent mass, by both projections.
#[test]
fn momentum_is_that_of_the_particles() -> Result<(), Failure> {
    for (lumping, more) in [
        ("time.lumping=1", "output={}"),
        ("time.lumping=0.2", "output={}"),
        ("time.lumping=0", "output={}"),
        ("time.lumping=1", r#"time.projection="affine""#),
    ] {
        let mut simulation = scene::<2>("collision.json", &[AGGREGATION, lumping, more])?;
        // Apart for as long as the test looks.
        simulation.settings.renewal = Renewal::EveryStep;
        let random = direction::<2>(simulation.particles.len(), 3);
        simulation.particles.velocity.iter_mut().zip(&random).for_each(|(v, random)| *v += random * 0.01);
        let sum = |simulation: &Simulation<2>| -> Vector<f64, 2> { simulation.particles.momentum() };
        let (before, size) = (sum(&simulation), simulation.particles.mass.iter().sum::<f64>());
        for _ in 0..3 {
            simulation.advance()?;
        }
        let lost = (sum(&simulation) - before).norm();
        assert!(lost < 1e-9 * size, "{lumping}, {more}: {lost:e}");
    }
    Ok(())
}

#[test]
fn a_plan_says_which_nodes_follow_and_the_old_cure_is_off() -> Result<(), Failure> {
    let plan = |overrides: &[&str]| -> Result<Plan, Failure> { Ok(Plan::of(&scene::<2>("cook.json", overrides)?)?) };
    let (with, without) = (plan(&[AGGREGATION])?, plan(&[])?);
    let used = |plan: &Plan, name: &str| plan.terms.iter().find(|term| term.name == name).map(|term| term.used);
    assert_eq!([used(&with, "aggregation"), used(&with, "ghost stiffness")], [Some(true), Some(false)]);
    assert_eq!([used(&without, "aggregation"), used(&without, "ghost stiffness")], [Some(false), Some(true)]);
    assert!(with.unknowns < without.unknowns, "{} {}", with.unknowns, without.unknowns);
    let both = scene::<2>("cook.json", &[AGGREGATION, "ghost_stiffness=0.01"]).err().ok_or("two cures")?;
    let said = format!("{both:#}") + &both.source().map(ToString::to_string).unwrap_or_default();
    assert!(said.contains("aggregation"), "{said}");
    Ok(())
}
