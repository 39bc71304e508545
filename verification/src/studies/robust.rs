//! Iterations of linear solves for hard systems: statics against refinement, cut cells, near incompressibility and contrast; long time
//! steps. Then an equilibrium path with turning points.
//!
//! A body of size one stands on fixed nodes and carries its weight in one load step. Each linear system is solved to 1e-8. Iterations are
//! counts, so they are judged. The bounds suit a method whose work grows with the unknowns, and give users numbers for planning.

mod snap;

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report};
use bfree::scene;
use bfree::simulation::{Simulation, StepError};
use bfree::solver::Preconditioning;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use snap::snap_through;

/// The summary in the list of studies.
pub(super) const ABOUT: &str =
    "linear iterations against refinement, cuts, time steps, ν and contrast, with multigrid; and a path that turns";

/// The most linear iterations per Newton iteration in 2D and in 3D, and the largest growth by the last refinement.
const MOST: [f64; 2] = [20.0, 30.0];
const GROWTH: f64 = 1.3;

/// The spacings in 2D and in 3D; the finest of each is for full effort.
const PLANE: [f64; 4] = [0.1, 0.05, 0.025, 0.0125];
const SPACE: [f64; 3] = [0.2, 0.1, 0.05];

/// The most iterations for steps of 1 to 1000 Courant numbers.
const MOST_IN_TIME: f64 = 20.0;

/// The smallest spacing in 2D and in 3D at which full effort shows diagonal blocks beside multigrid: their iterations double at each refinement.
const LEAST_SPACING: [f64; 2] = [0.025, 0.1];

/// The largest over the smallest count, for all positions of the body in a cell.
const BY_CUTS: f64 = 2.0;

const CONTRAST: f64 = 1e4;
const MOST_BY_CONTRAST: f64 = 50.0;

/// ν, and the iterations allowed in 2D.
const NEARLY_INCOMPRESSIBLE: [(f64, f64); 3] = [(0.45, 30.0), (0.49, 50.0), (0.499, 100.0)];

/// ν of bodies with mean dilatation, which have the mixed form, and the iterations allowed.
const AVERAGED: [f64; 3] = [0.49, 0.4999, 0.499999];
const MOST_AVERAGED: f64 = 60.0;

/// The functions that short effort tries with mean dilatation.
const WITH_MEANS: [&str; 2] = ["linear", "cubic"];

fn families() -> [(&'static str, Value); 6] {
    [
        ("linear", json!("linear")),
        ("uGIMP", json!("gimp")),
        ("quadratic", json!({"bspline": {"degree": 2}})),
        ("cubic", json!({"bspline": {"degree": 3}})),
        ("LME 3", json!({"lme": {"gamma": 3}})),
        ("LME 1.4", json!({"lme": {"gamma": 1.4}})),
    ]
}

/// The body that carries its weight.
#[derive(Clone, Copy, PartialEq)]
enum Shape {
    /// A box on the fixed floor. Its other sides lie between cell faces.
    Block,
    /// A ball whose lower part is held.
    Ball,
    /// A box rotated by 27° in the plane of the first and last axis, whose lower part is held.
    Turned,
}

impl Shape {
    const ALL: [(Self, &'static str); 3] =
        [(Self::Block, "block"), (Self::Ball, "ball"), (Self::Turned, "turned block")];
}

/// The scene with replaced keys.
fn scene<const D: usize>(shape: Shape, family: &Value, h: f64, more: &Value) -> Result<Simulation<D>, StudyError> {
    let up = D - 1;
    let (mut min, mut max, mut down) = (vec![0.53; D], vec![1.53; D], vec![0.0; D]);
    (min[up], max[up], down[up]) = if shape == Shape::Block { (0.0, 1.0, -50.0) } else { (0.33, 1.33, -50.0) };
    let body = match shape {
        Shape::Ball => json!({"ball": {"center": vec![0.93; D], "radius": 0.5}}),
        Shape::Block | Shape::Turned => json!({"box": {"min": min, "max": max}}),
    };
    let mut scene = json!({
        "grid": {"size": vec![2; D], "spacing": h},
        "approximation": family,
        "time": {"step": 1, "end": 1, "scheme": "none"},
        "bodies": [{
            "name": "body", "shape": body, "density": 1, "particles_per_cell": 2,
            "material": {"neo_hookean": {"young": 1000, "poisson": 0.3}}
        }],
        "gravity": {"acceleration": down},
        "solver": {"krylov": {"preconditioner": "multigrid", "forcing": {"fixed": 1e-8}}}
    });
    if shape == Shape::Block {
        scene["boundary"] = json!({["left", "bottom", "back"][up]: "fixed"});
    } else {
        let (mut point, mut normal) = (vec![0.0; D], vec![0.0; D]);
        (point[up], normal[up]) = (0.601, 1.0);
        let below = json!({"half_space": {"point": point, "normal": normal}});
        scene["prescribed"] = json!([{"region": below, "displacement": [[0, vec![0; D]]]}]);
    }
    for (key, value) in more.as_object().into_iter().flatten() {
        scene[key] = value.clone();
    }
    let mut simulation: Simulation<D> = scene::read(&scene.to_string(), &[])?.build(".".as_ref())?;
    if shape == Shape::Turned {
        let (sine, cosine) = 27_f64.to_radians().sin_cos();
        let centre = Vector::<f64, D>::from_fn(|k, _| 0.5 * (min[k] + max[k]));
        for x in &mut simulation.particles.position {
            let from = *x - centre;
            x[0] = centre[0] + cosine * from[0] - sine * from[up];
            x[up] = centre[up] + sine * from[0] + cosine * from[up];
        }
    }
    Ok(simulation)
}

/// Linear iterations per Newton iteration in one step.
fn iterations<const D: usize>(mut simulation: Simulation<D>, by: Preconditioning) -> Result<f64, Box<StepError>> {
    simulation.settings.preconditioner = by;
    let history = simulation.step()?.newton.history;
    Ok(history.counts.krylov_iterations as f64 / history.iterations.len() as f64)
}

/// Adds the iterations to a report and returns them. If the step fails, it adds the error and returns NaN.
fn push<const D: usize>(
    report: &mut Report,
    labels: &[&str],
    simulation: Simulation<D>,
    by: Preconditioning,
    bound: Bound,
) -> f64 {
    match iterations(simulation, by) {
        Ok(count) => {
            report.push(labels, count, bound);
            count
        }
        Err(error) => {
            report.push_error(labels, &*error);
            f64::NAN
        }
    }
}

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut refined = Report::new("iterations against refinement, statics", &["quantity", "body", "D", "shape", "h"]);
    for (name, family) in families() {
        for (shape, body) in Shape::ALL {
            // The other bodies differ by their cut cells, which coarse grids have too.
            let finest = *effort == Effort::Full && shape == Shape::Block;
            let [plane, space] = [PLANE.len(), SPACE.len()].map(|all| if finest { all } else { all - 1 });
            refinement::<2>((name, &family), (shape, body), (&PLANE[..plane], finest), &mut refined)?;
            if *effort == Effort::Full || shape == Shape::Block {
                refinement::<3>((name, &family), (shape, body), (&SPACE[..space], finest), &mut refined)?;
            }
        }
    }
    let mut others = Report::new("iterations where systems are hard, block in the plane", &["quantity", "shape", "at"]);
    for (name, family) in families() {
        time_steps(name, &family, &mut others)?;
        cuts(name, &family, *effort, &mut others)?;
        materials(name, &family, &mut others)?;
        if *effort == Effort::Full || WITH_MEANS.contains(&name) {
            averaged(name, &family, &mut others)?;
        }
    }
    Ok(Outcome { reports: vec![refined, others, snap_through(*effort)?], ..Outcome::default() })
}

fn refinement<const D: usize>(
    (name, family): (&str, &Value),
    (shape, body): (Shape, &str),
    (spacings, beside): (&[f64], bool),
    report: &mut Report,
) -> Result<(), StudyError> {
    let (dimension, mut before) = (D.to_string(), None);
    // A body of five cells is mostly surface, so the growth is judged from the second refinement on.
    for (number, &h) in spacings.iter().enumerate() {
        let labels = [body, &dimension, name, &h.to_string()];
        let with = |quantity| [&[quantity], &labels[..]].concat();
        let simulation = scene::<D>(shape, family, h, &json!({}))?;
        let most = Bound::AtMost(MOST[D - 2]);
        let count = push(report, &with("iterations"), simulation.clone(), Preconditioning::Multigrid, most);
        if let Some(before) = before.replace(count)
            && number >= 2
        {
            report.push(&with("growth"), count / before, Bound::AtMost(GROWTH));
        }
        if beside && h >= LEAST_SPACING[D - 2] {
            push(report, &with("with diagonal blocks"), simulation, Preconditioning::BlockJacobi, Bound::Reported);
        }
    }
    Ok(())
}

/// Dynamics in steps of many wave times.
fn time_steps(name: &str, family: &Value, report: &mut Report) -> Result<(), StudyError> {
    let h = 0.05;
    // Λ + 2G of the scene, ρ = 1
    let speed = (1000.0_f64 * 0.7 / (1.3 * 0.4)).sqrt();
    for courant in [1.0, 10.0, 100.0, 1000.0] {
        let time = json!({"time": {"step": courant * h / speed, "end": courant * h / speed}});
        let simulation = scene::<2>(Shape::Block, family, h, &time)?;
        let labels = ["Courant number", name, &courant.to_string()];
        push(report, &labels, simulation, Preconditioning::Multigrid, Bound::AtMost(MOST_IN_TIME));
    }
    Ok(())
}

/// The block, shifted within a cell along each axis and along both.
fn cuts(name: &str, family: &Value, effort: Effort, report: &mut Report) -> Result<(), StudyError> {
    let h = 0.1;
    let parts = if effort == Effort::Full { 16 } else { 8 };
    for (along, direction) in [("x", [1.0, 0.0]), ("y", [0.0, 1.0]), ("both", [1.0, 1.0])] {
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for part in 0..=parts {
            let offset = h * (f64::from(part) / f64::from(parts)).clamp(1e-9, 1.0 - 1e-9);
            let mut simulation = scene::<2>(Shape::Ball, family, h, &json!({}))?;
            simulation.particles.position.iter_mut().for_each(|x| *x += Vector::from(direction) * offset);
            let count = iterations(simulation, Preconditioning::Multigrid).unwrap_or(f64::INFINITY);
            (least, most) = (least.min(count), most.max(count));
        }
        report.push(&["places in a cell, most over least", name, along], most / least, Bound::AtMost(BY_CUTS));
    }
    Ok(())
}

/// Bodies with mean dilatation and ν near one half: also in 3D, with cells filled to a thousandth, with two bodies of different stiffness, and in
/// steps of inertia.
fn averaged(name: &str, family: &Value, report: &mut Report) -> Result<(), StudyError> {
    let body = |shape: Value, young: f64, poisson: f64| {
        json!({
            "name": format!("{shape}"), "shape": {"box": shape}, "density": 1, "particles_per_cell": 2,
            "material": {"neo_hookean": {"young": young, "poisson": poisson}}, "volumetric": "mean_dilatation"
        })
    };
    let most = Bound::AtMost(MOST_AVERAGED);
    let mut judge = |what: &str, at: &str, simulation: Simulation<2>| {
        push(report, &[what, name, at], simulation, Preconditioning::Multigrid, most);
    };
    for poisson in AVERAGED {
        let bodies = json!({"bodies": [body(json!({"min": [0.53, 0], "max": [1.53, 1]}), 1000.0, poisson)]});
        judge("ν, mixed form", &poisson.to_string(), scene::<2>(Shape::Block, family, 0.05, &bodies)?);
    }
    let whole = |min: f64| body(json!({"min": [min, 0], "max": [1.53, 1]}), 1000.0, 0.4999);
    let sliver = json!({"bodies": [whole(0.55 - 1.1e-3 * 0.05)]});
    judge("mixed form", "cells filled to 0.001", scene::<2>(Shape::Block, family, 0.05, &sliver)?);
    let half = |low: f64, high: f64, young| body(json!({"min": [0.53, low], "max": [1.53, high]}), young, 0.4999);
    let two = json!({"bodies": [half(0.0, 0.5, 1e6), half(0.5, 1.0, 1e3)]});
    judge("mixed form", "contrast 1e3", scene::<2>(Shape::Block, family, 0.05, &two)?);
    for step in [0.5, 0.05, 0.005] {
        // ρ α₁ h²/G from 1e-4 to 1
        let moving = json!({"bodies": [whole(0.53)], "time": {"step": step, "end": step}});
        judge("mixed form, Δt", &step.to_string(), scene::<2>(Shape::Block, family, 0.05, &moving)?);
    }
    let block = body(json!({"min": [0.53, 0.53, 0], "max": [1.53, 1.53, 1]}), 1000.0, 0.4999);
    let simulation = scene::<3>(Shape::Block, family, 0.1, &json!({"bodies": [block]}))?;
    push(report, &["mixed form", name, "3D"], simulation, Preconditioning::Multigrid, most);
    Ok(())
}

/// ν near one half, and two bodies of different stiffness.
fn materials(name: &str, family: &Value, report: &mut Report) -> Result<(), StudyError> {
    let body = |low: f64, high: f64, young: f64, poisson: f64| {
        json!({
            "name": format!("from {low}"), "shape": {"box": {"min": [0.53, low], "max": [1.53, high]}}, "density": 1,
            "material": {"neo_hookean": {"young": young, "poisson": poisson}}, "particles_per_cell": 2
        })
    };
    for (poisson, most) in NEARLY_INCOMPRESSIBLE {
        let bodies = json!({"bodies": [body(0.0, 1.0, 1000.0, poisson)]});
        let simulation = scene::<2>(Shape::Block, family, 0.05, &bodies)?;
        let labels = ["ν", name, &poisson.to_string()];
        push(report, &labels, simulation, Preconditioning::Multigrid, Bound::AtMost(most));
    }
    for (place, at) in [("upper body stiffer", 1.0), ("lower body stiffer", 0.0)] {
        let young = |here| if here == at { 1000.0 * CONTRAST } else { 1000.0 };
        let bodies = json!({"bodies": [body(0.0, 0.52, young(0.0), 0.3), body(0.52, 1.0, young(1.0), 0.3)]});
        let simulation = scene::<2>(Shape::Block, family, 0.05, &bodies)?;
        let (labels, most) = (["contrast 1e4", name, place], Bound::AtMost(MOST_BY_CONTRAST));
        push(report, &labels, simulation, Preconditioning::Multigrid, most);
    }
    Ok(())
}
