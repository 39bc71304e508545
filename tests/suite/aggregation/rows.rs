//! Rows of extensions by the places of their nodes: mirrored and separate bodies, and components that are prescribed.

use super::{GRID, drawn, drawn_cells, extension, pieces};
use crate::support::{Failure, Random, built, irregular, solid};
use bfree::aggregation::{Extension, Pieces};
use bfree::simulation::Simulation;
use bfree::space::Followers;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

type Node = [u32; 3];

/// The inner nodes that each outer node follows, and their weights.
type Rows = BTreeMap<Node, BTreeMap<Node, f64>>;

/// The rows of an extension whose nodes are moved to other places.
fn rows(nodes: &[Node], extension: &Extension, place: impl Fn(Node) -> Node) -> Rows {
    let row = |leaders: &mut dyn Iterator<Item = (usize, f64)>| {
        leaders.map(|(leader, weight)| (place(nodes[leader]), weight)).collect()
    };
    extension.rows().map(|(outer, mut leaders)| (place(nodes[outer]), row(&mut leaders))).collect()
}

/// The same outer nodes, and the same weights to round-off.
fn assert_same(found: &Rows, wanted: &Rows, what: &str) {
    assert!(found.keys().eq(wanted.keys()), "{what}: {:?} and {:?} follow", found.keys(), wanted.keys());
    for ((node, one), other) in found.iter().zip(wanted.values()) {
        let size: f64 = one.values().map(|weight| weight.abs()).sum();
        let weight = |row: &BTreeMap<Node, f64>, leader| row.get(leader).copied().unwrap_or(0.0);
        let leaders: BTreeSet<&Node> = one.keys().chain(other.keys()).collect();
        let apart = leaders.into_iter().map(|leader| (weight(one, leader) - weight(other, leader)).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-12 * size, "{what}: node {node:?} follows {one:?} and {other:?}");
    }
}

/// The image of a node, or of a knot cell with the index `last` at the upper wall: mirrored on some axes, then with x and y exchanged.
fn image(at: Node, last: Node, mirrored: [bool; 2], exchanged: bool) -> Node {
    let [x, y] = [0, 1].map(|k| if mirrored[k] { last[k] - at[k] } else { at[k] });
    if exchanged { [y, x, 0] } else { [x, y, 0] }
}

const IMAGES: [([bool; 2], bool); 7] = [
    ([true, false], false),
    ([false, true], false),
    ([true, true], false),
    ([false, false], true),
    ([true, false], true),
    ([false, true], true),
    ([true, true], true),
];

#[test]
fn extensions_of_mirrored_and_exchanged_bodies_are_images_of_each_other() {
    let mut random = Random(11);
    for pieces in pieces() {
        // Knot cells of even degree are centred on nodes.
        let last_cell = GRID.map(|cells| cells.saturating_sub(u32::from(pieces.degree % 2 == 1)));
        for _ in 0..60 {
            let cells = drawn_cells(pieces, &mut random);
            let (nodes, original) = extension(pieces, GRID, cells.clone());
            for (mirrored, exchanged) in IMAGES {
                let cells = cells.iter().map(|&(cell, share)| (image(cell, last_cell, mirrored, exchanged), share));
                let grid = image(GRID, GRID, [false; 2], exchanged);
                let (other_nodes, other) = extension(pieces, grid, cells.collect());
                let wanted = rows(&nodes, &original, |node| image(node, GRID, mirrored, exchanged));
                assert_same(&rows(&other_nodes, &other, |node| node), &wanted, &format!("{pieces:?}, {mirrored:?}"));
            }
        }
    }
}

#[test]
fn outer_nodes_of_a_body_do_not_follow_another_body_beside_it() {
    let (mut random, mut followed) = (Random(12), 0);
    for pieces in pieces().into_iter().filter(|pieces| !pieces.curves_at_walls) {
        for _ in 0..100 {
            let [left, right] = [drawn_cells(pieces, &mut random), drawn_cells(pieces, &mut random)];
            let Some((end, begin)) = left.iter().map(|one| one.0[0]).max().zip(right.iter().map(|one| one.0[0]).min())
            else {
                continue;
            };
            // As near as two bodies without a common node can be, and away from the walls at x = 0 and at the right.
            let shifted = |cells: Vec<(Node, f64)>, by: u32| -> Vec<(Node, f64)> {
                cells.into_iter().map(|([x, y, z], share)| ([x + by, y, z], share)).collect()
            };
            let (left, right) = (shifted(left, 20), shifted(right, 21 + end + pieces.degree - begin));
            let grid = [60, GRID[1], 0];
            let rows_of = |cells: &[(Node, f64)]| {
                let (nodes, extension) = extension(pieces, grid, cells.to_vec());
                rows(&nodes, &extension, |node| node)
            };
            let (mut wanted, both) = (rows_of(&left), rows_of(&[left, right.clone()].concat()));
            wanted.extend(rows_of(&right));
            followed += wanted.len();
            assert_same(&both, &wanted, &format!("{pieces:?}"));
        }
    }
    assert!(followed > 1000, "{followed} outer nodes were drawn");
}

/// A wedge that lies on the lower wall of a grid, and its images on the other walls.
fn wedge(family: &Value, [start, length]: [f64; 2], thickness: [f64; 2], side: usize) -> Value {
    let corners = [[start, 0.0], [start + length, 0.0], [start + length, thickness[1]], [start, thickness[0]]];
    let on_side = |[along, across]: [f64; 2]| match side {
        0 => [along, across],
        1 => [along, 2.0 - across],
        2 => [across, along],
        _ => [2.0 - across, along],
    };
    let mut wedge = solid("wedge", 1000, json!({"polygon": corners.map(on_side)}));
    wedge["fill"] = json!("cut");
    json!({
        "grid": {"size": [2, 2], "spacing": 0.125},
        "approximation": family,
        "time": {"step": 0.5, "end": 1, "scheme": "none"},
        "aggregation": true,
        "bodies": [wedge]
    })
}

/// The rows of a body at a wall, by the nodes that the same body has at the lower wall.
fn rows_at_wall(scene: &Value, side: usize) -> Result<Rows, Failure> {
    let simulation: Simulation<2> = built(scene)?;
    let coming = simulation.next_step()?;
    let index = |x: f64| (x / simulation.grid.spacing).round() as u32;
    let nodes: Vec<Node> = coming.positions().map(|x| [index(x[0]), index(x[1]), 0]).collect();
    let equilibrium = coming.equilibrium();
    let extension = equilibrium.step.connectivity.extension().ok_or("no node follows")?;
    Ok(rows(&nodes, extension, |[x, y, _]| match side {
        0 => [x, y, 0],
        1 => [x, 16 - y, 0],
        2 => [y, x, 0],
        _ => [y, 16 - x, 0],
    }))
}

#[test]
fn bodies_have_the_same_outer_nodes_at_every_wall() -> Result<(), Failure> {
    let families = [json!("linear"), json!({"bspline": {"degree": 2}}), json!({"bspline": {"degree": 3}})];
    let mut followed = 0;
    for family in families {
        for k in 0..6 {
            let place = [0.4 + 0.11 * irregular(3 * k), 0.9 + 0.3 * irregular(3 * k + 1)];
            // From a fifth of a cell to one and a half cells.
            let thickness = [0.03 + 0.01 * irregular(3 * k + 2), 0.13 + 0.06 * irregular(3 * k)];
            let rows_on = |side: usize| rows_at_wall(&wedge(&family, place, thickness, side), side);
            let lower = rows_on(0)?;
            followed += lower.len();
            for side in 1..4 {
                assert_same(&rows_on(side)?, &lower, &format!("{family}, wedge {k}, side {side}"));
            }
        }
    }
    assert!(followed > 50, "{followed} nodes follow");
    Ok(())
}

#[test]
fn the_components_of_an_outer_node_are_prescribed_one_by_one() {
    let mut random = Random(13);
    let pieces = Pieces { degree: 2, extension: 2, ..Pieces::LINEAR };
    for _ in 0..50 {
        let (nodes, extension) = drawn(pieces, &mut random);
        let outer = extension.outer().to_vec();
        // Of three outer nodes, the first has x prescribed, the second y, and the third none.
        let is_prescribed = |place: usize, component: usize| place % 3 == component;
        let pairs = (0..outer.len()).flat_map(|place| (0..2).map(move |component| (place, component)));
        let prescribed: Vec<_> = pairs.filter(|&(place, component)| is_prescribed(place, component)).collect();
        let of_nodes = prescribed.iter().map(|&(place, component)| (outer[place] as usize, component));
        let followers = Followers::<2>::new(extension.clone().into(), of_nodes);
        let field: Vec<_> = (0..nodes.len()).map(|k| Vector::from([irregular(k), irregular(1000 + k)])).collect();
        let (mut free, mut held) = (field.clone(), field.clone());
        Followers::<2>::new(extension.into(), [].into_iter()).extend(&mut free);
        followers.extend(&mut held);
        for (place, &node) in outer.iter().enumerate() {
            for component in 0..2 {
                let wanted = if is_prescribed(place, component) { &field } else { &free };
                assert_eq!(held[node as usize][component], wanted[node as usize][component], "{place} {component}");
            }
        }
        // Forces do the same work on both sides: f·E û = Eᵀ f·û.
        let forces: Vec<_> =
            (0..nodes.len()).map(|k| Vector::from([irregular(2000 + k), irregular(3000 + k)])).collect();
        let mut restricted = forces.clone();
        followers.restrict(&mut restricted);
        let work = |f: &[Vector<f64, 2>], u: &[Vector<f64, 2>]| f.iter().zip(u).map(|(f, u)| f.dot(u)).sum::<f64>();
        let (one, other) = (work(&forces, &held), work(&restricted, &field));
        let scale: f64 = forces.iter().zip(&held).map(|(f, u)| f.norm() * u.norm()).sum();
        assert!((one - other).abs() <= 1e-12 * scale, "{one} {other}");
    }
}
