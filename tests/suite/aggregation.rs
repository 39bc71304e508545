//! Aggregation: outer nodes follow inner ones. Tests of the quantities that aggregation keeps exact, and of the errors that it removes.

mod rows;

use crate::support::{Failure, Random, advance, scene};
use bfree::aggregation::{Extension, Occupied, Pieces};
use bfree::mechanics::check::direction;
use bfree::mechanics::reference::GridReset;
use bfree::plan::Plan;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;

const AGGREGATION: &str = "aggregation=true";

/// All kinds of polynomial pieces.
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
        // If functions curve at walls, their first nodes act in the first two cells.
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

const GRID: [u32; 3] = [12, 9, 0];

/// The cells of bodies drawn at random in [`GRID`]: in corners, at walls, in several parts.
fn drawn_cells(pieces: Pieces, random: &mut Random) -> Vec<([u32; 3], f64)> {
    let more = u32::from(pieces.degree == 2);
    let mut cells = Vec::new();
    let low = [random.below(6) as u32, random.below(5) as u32];
    let high = [low[0] + 1 + random.below(6) as u32, low[1] + 1 + random.below(4) as u32];
    for y in low[1]..=high[1].min(GRID[1] - 1 + more) {
        for x in low[0]..=high[0].min(GRID[0] - 1 + more) {
            let share = [0.05, 0.3, 0.6, 1.0][random.below(4) as usize];
            if random.below(5) > 0 {
                cells.push(([x, y, 0], share));
            }
        }
    }
    cells
}

/// The nodes and the extension of bodies that occupy these cells of a grid.
fn extension(pieces: Pieces, grid: [u32; 3], cells: Vec<([u32; 3], f64)>) -> (Vec<[u32; 3]>, Extension) {
    let nodes = nodes(pieces, &cells, grid);
    let extension = Extension::new(pieces, &Occupied { dimension: 2, grid, nodes: &nodes, cells });
    (nodes, extension)
}

fn drawn(pieces: Pieces, random: &mut Random) -> (Vec<[u32; 3]>, Extension) {
    extension(pieces, GRID, drawn_cells(pieces, random))
}

#[test]
fn linear_fields_are_continued_exactly_and_so_are_polynomials_away_from_walls() {
    let (mut random, mut followed) = (Random(7), 0);
    for pieces in pieces() {
        for _ in 0..200 {
            let (nodes, extension) = drawn(pieces, &mut random);
            let linear = |node: [u32; 3]| 3.0 + 0.7 * f64::from(node[0]) - 1.3 * f64::from(node[1]);
            // The coefficients of a polynomial are a polynomial of the node's index, except at walls.
            let power = if pieces.extension == pieces.degree { pieces.degree as i32 } else { 1 };
            let inside = |node: [u32; 3]| (2..=9).contains(&node[0]) && (2..=7).contains(&node[1]);
            let curved = |node: [u32; 3]| f64::from(node[0]).powi(power) * f64::from(node[1]).powi(power);
            for (outer, leaders) in extension.rows() {
                let leaders: Vec<_> = leaders.collect();
                let size: f64 = leaders.iter().map(|(_, weight)| weight.abs()).sum();
                let sum: f64 = leaders.iter().map(|(leader, weight)| weight * linear(nodes[*leader])).sum();
                assert!((sum - linear(nodes[outer])).abs() < 1e-12 * (1.0 + 20.0 * size), "{pieces:?}: {leaders:?}");
                let away = nodes[outer][0] > 0 && nodes[outer][1] > 0;
                if away && leaders.iter().all(|(leader, _)| inside(nodes[*leader])) {
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

/// Tractions, follower pressures, mean dilatation, plastic flow, damping and inertia, with prescribed nodes among the outer nodes.
#[test]
fn the_tangent_is_the_derivative_of_the_aggregated_residual() -> Result<(), Failure> {
    let quadratic = r#"approximation={"bspline":{"degree":2}}"#;
    let cases: [(&str, &[&str]); 6] = [
        ("cook.json", &[]),
        ("ring.json", &[]),
        ("tube.json", &["output={}"]),
        ("cook.json", &[r#"approximation={"lme":{"gamma":1.4}}"#]),
        ("cook.json", &[r#"approximation="gimp""#]),
        ("rebound.json", &[quadratic, "time.lumping=0.3", r#"damping={"mass":0.1,"stiffness":0.001}"#]),
    ];
    for (name, more) in cases {
        let overrides: Vec<&str> = more.iter().copied().chain([AGGREGATION]).collect();
        let simulation = scene::<2>(name, &overrides)?;
        let coming = simulation.next_step()?;
        let equilibrium = coming.equilibrium();
        let followers = equilibrium.step.connectivity.extension().map_or(0, |extension| extension.len());
        assert!(followers > 0, "{name}: no node follows");
        let count = coming.nodes().len();
        let dphi: Vec<_> = direction::<2>(count, 1).iter().map(|x| x * (1e-3 * simulation.grid.spacing)).collect();
        equilibrium.check_tangent(&dphi, &direction(count, 2)).map_err(|error| format!("{name}: {error}"))?;
    }
    Ok(())
}

/// In flight, with a lumped, a mixed and a consistent mass, and with both projections.
#[test]
fn momentum_is_that_of_the_particles() -> Result<(), Failure> {
    for (lumping, more) in [
        ("time.lumping=1", "output={}"),
        ("time.lumping=0.2", "output={}"),
        ("time.lumping=0", "output={}"),
        ("time.lumping=1", r#"time.projection="affine""#),
    ] {
        let mut simulation = scene::<2>("collision.json", &[AGGREGATION, lumping, more])?;
        // The discs stay apart during the test.
        simulation.settings.grid_reset = GridReset::EveryStep;
        let random = direction::<2>(simulation.particles.len(), 3);
        simulation.particles.velocity.iter_mut().zip(&random).for_each(|(v, random)| *v += random * 0.01);
        let sum = |simulation: &Simulation<2>| -> Vector<f64, 2> { simulation.particles.momentum() };
        let (before, size) = (sum(&simulation), simulation.particles.mass.iter().sum::<f64>());
        advance(&mut simulation, 3)?;
        let lost = (sum(&simulation) - before).norm();
        assert!(lost < 1e-9 * size, "{lumping}, {more}: {lost:e}");
    }
    Ok(())
}

/// A node diagonally across the corner of a block of full cells is further from their centres than a node along an axis.
#[test]
fn a_node_across_a_corner_follows() {
    let nodes: Vec<[u32; 3]> = (0..81).map(|i| [i % 9, i / 9, 0]).collect();
    let cells = (0..16).map(|i| ([i % 4, i / 4, 0], 1.0)).collect();
    let occupied = Occupied { dimension: 2, grid: [9, 9, 0], nodes: &nodes, cells };
    let extension = Extension::new(Pieces::LINEAR, &occupied);
    let corner = extension.rows().find(|(outer, _)| nodes[*outer] == [8, 8, 0]);
    // 5 (x₄ − x₃) from x₃ along each axis.
    let mut weights: Vec<f64> = corner.into_iter().flat_map(|(_, leaders)| leaders.map(|(_, weight)| weight)).collect();
    weights.sort_by(f64::total_cmp);
    assert_eq!(weights, [-20.0, -20.0, 16.0, 25.0]);
}

#[test]
fn a_plan_says_which_nodes_follow() -> Result<(), Failure> {
    let plan = |overrides: &[&str]| -> Result<Plan, Failure> { Ok(Plan::of(&scene::<2>("cook.json", overrides)?)?) };
    let (with, without) = (plan(&[])?, plan(&["aggregation=false"])?);
    let [on, off] = [&with, &without].map(|plan| plan.terms.iter().find(|(name, ..)| *name == "aggregation"));
    let ((_, on, why), (_, off, _)) = (on.ok_or("no such term")?, off.ok_or("no such term")?);
    assert!(*on && why.contains(" of ") && why.contains("active nodes follow"), "{why}");
    assert!(!off);
    assert!(with.unknowns < without.unknowns, "{} {}", with.unknowns, without.unknowns);
    Ok(())
}

/// Nodes follow without inertia, with a consistent mass, under loads on the surface of a shape, and in long steps of equal length.
#[test]
fn nodes_follow_where_mass_does_not_hold_them() -> Result<(), Failure> {
    let asked = |name: &str, overrides: &[&str]| -> Result<bool, Failure> {
        Ok(scene::<2>(name, overrides)?.settings.aggregation)
    };
    for (overrides, follow) in [
        (&[][..], true),
        (&["approximation=\"linear\""], true),
        (&["aggregation=false"], false),
        (&["ghost_stiffness=0"], false),
        (&["ghost_stiffness=0.02"], true),
        (&["ghost_stiffness=0.02", "aggregation=false"], false),
    ] {
        assert_eq!(asked("column_static.json", overrides)?, follow, "{overrides:?}");
    }
    assert!(asked("cantilever.json", &[])?);
    // √((Λ + 2G)/ρ) is 14.5 cells per second.
    for (step, follow) in [("time.step=0.05", false), ("time.step=0.6", false), ("time.step=0.8", true)] {
        assert_eq!(asked("rebound.json", &[step])?, follow, "{step}");
    }
    assert!(asked("rebound.json", &["time.lumping=0"])? && !asked("rebound.json", &["time.lumping=0.01"])?);
    assert!(!asked("rebound.json", &["time.step=0.8", r#"time.adaptive={"tolerance":1e-5}"#])?);
    Ok(())
}

/// Some nodes of linear functions have only points of the loaded end in their support. When these nodes were unknowns they moved away in
/// every step, and the run stopped.
#[test]
fn points_of_a_loaded_surface_stay_with_their_body() -> Result<(), Failure> {
    let reset = r#"grid.reset="every_step""#;
    let mut simulation = scene::<2>("cantilever.json", &["approximation=\"linear\"", reset])?;
    // The points start a sixteenth from the body, and the free end has little strain.
    let depth = |simulation: &Simulation<2>| {
        let (particles, solid) = (&simulation.particles, simulation.particles.solid_places());
        let nearest = |p: usize| {
            let distance = |&q: &u32| (particles.position[p] - particles.position[q as usize]).norm();
            solid.iter().map(distance).fold(f64::INFINITY, f64::min)
        };
        simulation.loads.surface[0].points.iter().map(|point| nearest(point.particle)).fold(0.0, f64::max)
    };
    let start = depth(&simulation);
    assert!((start * 16.0 - 1.0).abs() < 1e-5, "{start}");
    for _ in 0..160 {
        simulation.step()?;
        let now = depth(&simulation);
        assert!(now < 1.5 * start, "t = {}: {now} instead of {start}", simulation.clock.time());
    }
    // Aggregation dissipates no energy.
    assert_eq!(simulation.dissipated, 0.0);
    Ok(())
}
