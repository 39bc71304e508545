//! Multigrid: it must not change the results, and must save iterations.

use crate::support::{Failure, built, merged, solid};
use bfree::mechanics::check::direction;
use bfree::mechanics::sweep::Connectivity;
use bfree::mechanics::transfer::Nodal;
use bfree::simulation::Simulation;
use bfree::solver::{Multigrid, Preconditioner, Preconditioning};
use serde_json::{Value, json};

/// A block on a fixed floor under its weight. Its sides lie between cell faces.
pub fn block<const D: usize>(family: &Value, cells: u32, inertia: &str, more: Value) -> Result<Simulation<D>, Failure> {
    let (low, high) = (0.53, 1.53);
    let (mut min, mut max, mut down) = (vec![low; D], vec![high; D], vec![0.0; D]);
    (min[D - 1], max[D - 1], down[D - 1]) = (0.0, 1.0, -50.0);
    let floor = ["left", "bottom", "back"][D - 1];
    let scene = json!({
        "grid": {"size": vec![2; D], "spacing": 1.0 / f64::from(cells)},
        "approximation": family,
        "time": {"step": 0.2, "end": 1, "scheme": inertia},
        "bodies": [solid("block", 1000, json!({"box": {"min": min, "max": max}}))],
        "boundary": {floor: "fixed"},
        "gravity": {"acceleration": down},
        "solver": {"krylov": {"method": "conjugate_gradient", "forcing": {"fixed": 1e-8}}}
    });
    built(&merged(scene, more))
}

/// Takes one step. Returns the Krylov iterations per Newton iteration.
pub fn iterations<const D: usize>(
    mut simulation: Simulation<D>,
    with: Preconditioning,
) -> Result<(f64, Simulation<D>), Failure> {
    simulation.settings.preconditioner = with;
    let report = simulation.step()?;
    let history = &report.newton.history;
    Ok((history.counts.krylov_iterations as f64 / history.iterations.len() as f64, simulation))
}

pub fn families() -> [Value; 5] {
    [
        json!("linear"),
        json!({"bspline": {"degree": 2}}),
        json!({"bspline": {"degree": 3}}),
        json!({"lme": {"gamma": 3}}),
        json!({"lme": {"gamma": 3, "support": "circle"}}),
    ]
}

/// The positions of the particles do not depend on the preconditioner, within the tolerance of Newton's method.
pub fn same<const D: usize>(one: &Simulation<D>, other: &Simulation<D>) -> bool {
    let (one, other) = (one.particles.by_id(), other.particles.by_id());
    one.position.iter().zip(&other.position).all(|(a, b)| (a - b).norm() < 1e-8)
}

/// A body of this many cells of edge ¼ along each axis, on a floor that holds it. Along x and z it begins in the middle of a coarse cell.
fn few_cells(cells: [u32; 3], family: &Value) -> Result<Simulation<3>, Failure> {
    let max = [0, 1, 2].map(|k| [0.25, 0.0, 0.25][k] + 0.25 * f64::from(cells[k]));
    built(&json!({
        "grid": {"size": [1.5, 1.5, 1.5], "spacing": 0.25},
        "approximation": family,
        "time": {"step": 1, "end": 1, "scheme": "none"},
        "bodies": [solid("body", 1000, json!({"box": {"min": [0.25, 0.0, 0.25], "max": max}}))],
        "boundary": {"bottom": "fixed"},
        "gravity": {"acceleration": [8, -15, 4]},
        "solver": {"krylov": {"method": "conjugate_gradient", "forcing": {"fixed": 1e-8}}}
    }))
}

#[test]
fn bodies_of_a_few_cells_are_held_on_every_level() -> Result<(), Failure> {
    // A coarse cell of which a quarter is full has two finer cells. One quadrature point for each of them holds 12 of 24 motions.
    for cells in [[1, 1, 1], [2, 2, 2], [1, 2, 3], [3, 1, 2], [2, 3, 1], [3, 3, 1], [3, 3, 3]] {
        for family in [json!("linear"), json!("gimp"), json!({"bspline": {"degree": 2}}), json!({"lme": {"gamma": 3}})]
        {
            let simulation = || few_cells(cells, &family);
            let (many, plain) = iterations(simulation()?, Preconditioning::BlockJacobi)?;
            let (few, multigrid) = iterations(simulation()?, Preconditioning::Multigrid)?;
            assert!(same(&multigrid, &plain), "{cells:?} cells, {family}: multigrid moves the body elsewhere");
            assert!(2.0 * few < many, "{cells:?} cells, {family}: {few} iterations, {many} without multigrid");
        }
    }
    Ok(())
}

#[test]
fn it_changes_no_result_in_any_dimension_and_saves_most_iterations() -> Result<(), Failure> {
    fn compare<const D: usize>(cells: u32, share: f64) -> Result<(), Failure> {
        for family in families() {
            for inertia in ["none", "newmark"] {
                // In steps much longer than the wave time, cut cells are as hard as in statics.
                let scene = || block::<D>(&family, cells, inertia, json!({"aggregation": true}));
                let (by_blocks, one) = iterations(scene()?, Preconditioning::BlockJacobi)?;
                let (by_levels, other) = iterations(scene()?, Preconditioning::Multigrid)?;
                assert!(same(&one, &other), "{D}D, {family}, {inertia}");
                let enough = by_levels < share * by_blocks || by_levels < 12.0;
                assert!(enough, "{D}D, {family}, {inertia}: {by_levels} after {by_blocks}");
            }
        }
        Ok(())
    }
    // Smoothing alone also needs only a tenth of the iterations, but twice as many after each refinement.
    compare::<1>(512, 0.04)?;
    compare::<2>(20, 0.5)?;
    compare::<3>(6, 0.8)
}

/// Without the filter of the finest smoother, cubic splines take 21 iterations in the plane and 42 in space.
#[test]
fn cubic_splines_take_few_iterations_too() -> Result<(), Failure> {
    fn taken<const D: usize>(cells: u32) -> Result<f64, Failure> {
        let scene = block::<D>(&json!({"bspline": {"degree": 3}}), cells, "none", json!({"aggregation": true}))?;
        Ok(iterations(scene, Preconditioning::Multigrid)?.0)
    }
    let (in_the_plane, in_space) = (taken::<2>(40)?, taken::<3>(10)?);
    assert!(in_the_plane < 14.0 && in_space < 21.0, "{in_the_plane}, {in_space}");
    Ok(())
}

/// M⁻¹ is symmetric and positive, as conjugate gradients require.
#[test]
fn a_cycle_is_symmetric_and_positive() -> Result<(), Failure> {
    let simulation = block::<2>(&json!({"lme": {}}), 15, "newmark", json!({}))?;
    let (approximation, grid) = (&simulation.approximation, &simulation.grid);
    let (connectivity, nodes) = Connectivity::new(approximation, grid, &simulation.particles.position)?;
    let (nodal, prescribed) = (Nodal::at_rest(&simulation.particles, &connectivity), simulation.prescribed(&nodes));
    let equilibrium =
        simulation.equilibrium(&connectivity, &nodal, &prescribed, simulation.settings.scheme.end(0.2), 0.2);
    let at_rest = vec![Default::default(); nodes.len()];
    let tangent = equilibrium.tangent(None, &at_rest)?;
    let mut multigrid = Multigrid::<2>::default();
    let inverse = multigrid.prepare(&tangent);
    // r, for a direction that leaves prescribed nodes alone, and z = M⁻¹ r.
    let of = |number| {
        let mut r = direction::<2>(nodes.len(), number);
        prescribed.iter().for_each(|dof| r[dof.node][dof.component] = 0.0);
        let r: Vec<f64> = r.iter().flatten().copied().collect();
        let mut z = vec![0.0; r.len()];
        inverse.apply(&r, &mut z);
        [r, z]
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let ([a, of_a], [b, of_b]) = (of(1), of(2));
    let size = (dot(&a, &of_a) * dot(&b, &of_b)).sqrt();
    assert!(dot(&a, &of_a) > 0.0 && dot(&b, &of_b) > 0.0);
    assert!((dot(&a, &of_b) - dot(&b, &of_a)).abs() < 1e-12 * size);
    Ok(())
}

/// At the surface of a ball whose lower part is held, prescribed nodes lead others. The matrix of the coarsest grid has no entries of them.
#[test]
fn held_nodes_that_lead_others_do_not_spoil_the_coarsest_grid() -> Result<(), Failure> {
    let scene = json!({
        "grid": {"size": [2, 2], "spacing": 0.05},
        "approximation": "linear",
        "time": {"step": 1, "end": 1, "scheme": "none"},
        "bodies": [solid("ball", 1000, json!({"ball": {"center": [0.93, 0.93], "radius": 0.5}}))],
        "gravity": {"acceleration": [0, -50]},
        "prescribed": [{"region": {"half_space": {"point": [0, 0.601], "normal": [0, 1]}}, "displacement": [[0, [0, 0]]]}],
        "solver": {"krylov": {"preconditioner": "multigrid", "forcing": {"fixed": 1e-8}}}
    });
    let mut simulation: Simulation<2> = built(&scene)?;
    let history = simulation.step()?.newton.history;
    let iterations = history.counts.krylov_iterations as f64 / history.iterations.len() as f64;
    // 6 to 8 iterations if the coarsest grid is solved, 20 if its matrix is singular.
    assert!(iterations <= 10.0, "{iterations}");
    Ok(())
}
