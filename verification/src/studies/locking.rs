//! Cook's membrane with ν = 0.3 … 0.4999 in load steps, with the volume of every particle and with the mean dilatation of cells.
//!
//! The reference displacements of the middle of the free edge come from another program (`verification/reference/cook_mixed.py`): 32 × 32
//! nine-node elements of the same law, with a linear volume in each (the potential of the mean dilatation with three numbers per element).
//! Displacements from 16 × 16 elements differ by 0.03 to 0.1 %.

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report, chain};
use crate::shipped;
use crate::table::Table;
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use rayon::prelude::*;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "Cook's membrane near incompressibility, with and without the mean dilatation of cells";

/// ν, and the reference displacement of the middle of the free edge.
const KNOWN: [(f64, f64); 4] = [(0.3, 14.507), (0.49, 12.135), (0.499, 12.003), (0.4999, 11.990)];

/// The relative error with 32 cells per edge.
const BOUND: f64 = 0.01;

const SHAPES: [(&str, &str); 2] = [("linear", "\"linear\""), ("cubic B-splines", r#"{"bspline":{"degree":3}}"#)];

/// The results of a run.
struct End {
    tip: f64,
    newton: usize,
    krylov: usize,
}

fn membrane(shape: &str, poisson: f64, cells: u32, averaged: bool) -> Result<End, StudyError> {
    let volumetric = if averaged { "mean_dilatation" } else { "pointwise" };
    let overrides = [
        format!("approximation={shape}"),
        format!("grid={{\"size\":[60,84],\"spacing\":{}}}", 48.0 / f64::from(cells)),
        format!("bodies.0.material.neo_hookean={{\"young\":{},\"poisson\":{poisson}}}", 0.845 * (1.0 + poisson)),
        format!("bodies.0.volumetric=\"{volumetric}\""),
        // On one reference configuration the end depends neither on the number of load steps nor on the preconditioner.
        "time.step=0.5".to_owned(),
        r#"solver.krylov.preconditioner="multigrid""#.to_owned(),
        "output={}".to_owned(),
    ];
    let mut simulation: Simulation<2> = shipped::simulation("cook", &overrides)?;
    let start = simulation.particles.clone();
    let (mut newton, mut krylov) = (0, 0);
    while simulation.clock.time() < 1.0 - 1e-9 {
        let history = simulation.advance()?.newton.history;
        newton += history.iterations.len();
        krylov += history.counts.krylov_iterations;
    }
    let now = simulation.particles.by_id();
    let away = |p: usize| (start.position[p] - Vector::from([48.0, 52.0])).norm();
    let tip = (0..start.len()).min_by(|&a, &b| away(a).total_cmp(&away(b))).ok_or("no particles")?;
    Ok(End { tip: now.position[tip][1] - start.position[tip][1], newton, krylov })
}

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let (cells, known): (&[u32], _) = match effort {
        Effort::Full => (&[8, 16, 32], &KNOWN[..]),
        Effort::Short => (&[8, 16], &KNOWN[..2]),
    };
    let mut report = Report::new(
        "Cook's membrane: error of the displacement of the free edge",
        &["volume", "shape", "cells an edge", "Poisson's ratio"],
    );
    let header = ["shape", "volume", "Poisson's ratio", "cells an edge", "displacement", "error", "Newton", "Krylov"];
    let mut table = Table::new("Cook's membrane, beside elements of the same law", header);
    let of_shape =
        |shape| [false, true].into_iter().flat_map(move |averaged| known.iter().map(move |of| (shape, averaged, of)));
    let cases: Vec<_> =
        SHAPES.iter().flat_map(of_shape).flat_map(|case| cells.iter().map(move |&n| (case, n))).collect();
    // Runs in parallel: a small membrane keeps one core busy.
    let ends = cases.into_par_iter().with_max_len(1).map(|(case @ ((_, shape), averaged, (poisson, _)), n)| {
        (case, n, membrane(shape, *poisson, n, averaged).map_err(|error| chain(&*error)))
    });
    for ((&(name, _), averaged, &(poisson, known)), n, end) in ends.collect::<Vec<_>>() {
        let End { tip, newton, krylov } = end?;
        let volume = if averaged { "mean of cells" } else { "pointwise" };
        let error = (tip / known - 1.0).abs();
        let bound = match n {
            // The order is at least one.
            16.. if averaged => Bound::AtMost(BOUND * 32.0 / f64::from(n)),
            _ => Bound::Reported,
        };
        report.push(&[volume, name, &n.to_string(), &poisson.to_string()], error, bound);
        table.push([
            name.to_owned(),
            volume.to_owned(),
            poisson.to_string(),
            n.to_string(),
            format!("{tip:.3}"),
            format!("{:.2} %", 100.0 * error),
            newton.to_string(),
            krylov.to_string(),
        ]);
    }
    Ok(Outcome { reports: vec![report], tables: vec![table], ..Outcome::default() })
}
