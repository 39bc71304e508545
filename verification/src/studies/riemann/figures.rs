//! The figures: Figs. 5, 6 and 7, and strong jumps.

use super::*;
use crate::axis::Axis;
use crate::sheet::{Curve, Mark, Panel, Sheet};
use plotters::prelude::SeriesLabelPosition;

/// The spacing at which the paper's scheme for strong jumps is shown.
const STRONG_SPACING: f64 = 0.05;

/// The methods of Fig. 5.
const OF_FIGURE_5: [Method; 3] = [LINEAR, GIMP, LME];

/// The velocity at the Gauss points of three-node elements for each γ, h = 0.1 m, Courant 1; see `ELEMENTS`.
const OF_ELEMENTS: &str = include_str!("../../../reference/riemann_fem_q8.csv");

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for method in OF_FIGURE_5 {
        cases.extend(GAMMAS.map(|gamma| Case::new(Method { gamma, ..method }, Jump::PAPER, 0.1, 1.0)));
    }
    for h in SPACINGS {
        cases.extend([LINEAR, GIMP, LME].map(|method| Case::new(method, Jump::PAPER, h, 1.0)));
    }
    for courant in COURANTS {
        cases.extend([LINEAR, LME, Method::RECOMMENDED].map(|method| Case::new(method, Jump::PAPER, 0.1, courant)));
    }
    cases
}

pub(super) fn all(runs: &Runs) -> Result<Vec<Sheet>, StudyError> {
    Ok(vec![profiles(runs)?, convergence(runs)?, time_steps(runs)?, strong(runs)?])
}

/// The exact velocity at 3 ms between two positions.
fn exact(jump: Jump, from: f64, to: f64) -> Result<Curve, StudyError> {
    let solved = jump.exact()?;
    let points = (0..=2000).map(|k| {
        let x = from + (to - from) * f64::from(k) / 2000.0;
        (x, solved.at((x - 50.0) / 3e-3).velocity)
    });
    Ok(Curve::new("exact", 0, Mark::Dashed, points.collect()))
}

fn profiles(runs: &Runs) -> Result<Sheet, StudyError> {
    let mut panels = vec![panel_of_profiles("Q8 elements", |k| Ok(of_elements(k)))?];
    for method in OF_FIGURE_5 {
        let profile = |k: usize| {
            let of_gamma = Method { gamma: GAMMAS[k], ..method };
            Ok(runs.of(of_gamma, Jump::PAPER, 0.1, 1.0)?.profile.clone())
        };
        panels.push(panel_of_profiles(method.name, profile)?);
    }
    panels[0].legend = Some(SeriesLabelPosition::UpperRight);
    Ok(Sheet {
        name: "riemann_profiles",
        caption: "Fig. 5: velocity along the bar at 3 ms, at particles (Gauss points), h = 0.1 m, Courant 1, eps = 0.8 (consistent for elements).".into(),
        columns: 2,
        size: (520, 340),
        panels,
    })
}

/// The profile of the elements for a γ by its number.
fn of_elements(number: usize) -> Vec<(f64, f64)> {
    let row = |line: &str| -> Option<(f64, f64)> {
        let numbers: Vec<f64> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        Some((*numbers.first()?, *numbers.get(number + 1)?))
    };
    OF_ELEMENTS.lines().filter_map(row).collect()
}

/// The profiles for all γ, beside the exact one.
fn panel_of_profiles(
    title: &str,
    profile: impl Fn(usize) -> Result<Vec<(f64, f64)>, StudyError>,
) -> Result<Panel, StudyError> {
    let mut curves = vec![exact(Jump::PAPER, 40.7, 59.3)?];
    for (k, gamma) in GAMMAS.into_iter().enumerate() {
        curves.push(Curve::new(format!("γ = {gamma}"), k + 1, Mark::Line, profile(k)?));
    }
    Ok(Panel {
        title: title.into(),
        x: Axis::linear("X (m)"),
        y: Axis::linear("v (m/s)"),
        window: Some([(40.7, 59.3), (-2.0, 12.0)]),
        curves,
        legend: None,
    })
}

fn convergence(runs: &Runs) -> Result<Sheet, StudyError> {
    type Value = fn(&Measured) -> f64;
    let lines = [
        ("linear", LINEAR, 1.0, 2),
        ("uGIMP", GIMP, 1.0, 3),
        ("LME 4", LME, 1.0, 1),
        ("recommended", Method::RECOMMENDED, COURANT, 4),
    ];
    let values: [(&str, Value); 2] = [("at particles", |found| found.particles), ("at nodes", |found| found.nodes)];
    let mut panels = Vec::new();
    for (k, (title, value)) in values.into_iter().enumerate() {
        let of_elements = ELEMENTS.map(|(h, at_points, at_nodes)| (h, [at_points, at_nodes][k]));
        let mut curves = vec![Curve::new("Q8 elements", 0, Mark::Joined, of_elements.into())];
        for (name, method, courant, color) in lines {
            let error = |&h: &f64| Ok((h, value(runs.of(method, Jump::PAPER, h, courant)?)));
            let errors = SPACINGS.iter().map(error).collect::<Result<Vec<_>, StudyError>>()?;
            curves.push(Curve::new(name, color, Mark::Joined, errors));
        }
        panels.push(Panel {
            title: format!("L2 error {title}"),
            x: Axis::logarithmic("h (m)"),
            y: Axis::logarithmic("|e| (m^1.5/s)"),
            window: Some([(0.008, 0.13), (0.5, 10.0)]),
            curves,
            legend: (k == 0).then_some(SeriesLabelPosition::UpperRight),
        });
    }
    let h = 0.01;
    let mut curves = vec![exact(Jump::PAPER, 42.0, 58.0)?];
    for (method, courant, color) in [(LINEAR, 1.0, 2), (LME, 1.0, 1), (Method::RECOMMENDED, COURANT, 4)] {
        let profile = runs.of(method, Jump::PAPER, h, courant)?.profile.clone();
        curves.push(Curve::new(method.name, color, Mark::Line, profile));
    }
    panels.push(Panel {
        title: format!("velocity at particles, h = {h} m"),
        x: Axis::linear("X (m)"),
        y: Axis::linear("v (m/s)"),
        window: Some([(42.0, 58.0), (-6.0, 16.0)]),
        curves,
        legend: Some(SeriesLabelPosition::UpperRight),
    });
    Ok(Sheet {
        name: "riemann_convergence",
        caption: "Fig. 6: errors against the spacing at fixed Courant number, and profiles at the smallest spacing."
            .into(),
        columns: 3,
        size: (430, 360),
        panels,
    })
}

fn time_steps(runs: &Runs) -> Result<Sheet, StudyError> {
    let mut curves = Vec::new();
    for (method, color) in [(LINEAR, 2), (LME, 1), (Method::RECOMMENDED, 4)] {
        let points: Result<Vec<_>, StudyError> = COURANTS
            .iter()
            .map(|&courant| Ok((5e-5 * courant, runs.of(method, Jump::PAPER, 0.1, courant)?.particles)))
            .collect();
        curves.push(Curve::new(method.name, color, Mark::Joined, points?));
    }
    Ok(Sheet {
        name: "riemann_time_steps",
        caption: "Fig. 7: errors at particles against the time step, h = 0.1 m.".into(),
        columns: 1,
        size: (560, 380),
        panels: vec![Panel {
            title: "L2 error at particles, h = 0.1 m".into(),
            x: Axis::logarithmic("time step (s)"),
            y: Axis::linear("|e| (m^1.5/s)"),
            window: Some([(3e-7, 8e-5), (0.0, 5.0)]),
            curves,
            legend: Some(SeriesLabelPosition::UpperRight),
        }],
    })
}

fn strong(runs: &Runs) -> Result<Sheet, StudyError> {
    let mut panels = Vec::new();
    for (k, size) in [100.0, 1000.0, -1000.0].into_iter().enumerate() {
        let jump = Jump::of(size);
        let mut curves = vec![exact(jump, 32.0, 68.0)?];
        for (method, courant, color) in
            [(LME, 1.0, 1), (Method::UNDISSIPATED, COURANT, 5), (Method::RECOMMENDED, COURANT, 4)]
        {
            if let Ok(found) = runs.of(method, jump, STRONG_SPACING, courant) {
                curves.push(Curve::new(method.name, color, Mark::Line, found.profile.clone()));
            }
        }
        let scale = jump.size();
        panels.push(Panel {
            title: format!("{} m/s, h = {STRONG_SPACING} m", jump.left - jump.right),
            x: Axis::linear("X (m)"),
            y: Axis::linear("v (m/s)"),
            window: Some([(32.0, 68.0), (-0.4 * scale, 1.4 * scale)]),
            curves,
            legend: (k == 0).then_some(SeriesLabelPosition::UpperRight),
        });
    }
    // The ranges leave room for the legend below the points.
    let heights = [(0.5, 200.0), (20.0, 2000.0), (20.0, 2000.0)];
    for (k, (size, height)) in [100.0, 1000.0, -1000.0].into_iter().zip(heights).enumerate() {
        let jump = Jump::of(size);
        let mut curves = Vec::new();
        for (method, courant, color, spacings) in [
            (LINEAR, 1.0, 2, &[0.1, 0.05, 0.025][..]),
            (LME, 1.0, 1, &[0.1, 0.05, 0.025]),
            (SMOOTH, 1.0, 3, &SPACINGS),
            (Method::UNDISSIPATED, COURANT, 5, &SPACINGS),
            (Method::RECOMMENDED, COURANT, 4, &SPACINGS),
        ] {
            let points = spacings.iter().filter_map(|&h| Some((h, runs.of(method, jump, h, courant).ok()?.particles)));
            curves.push(Curve::new(method.name, color, Mark::Joined, points.collect()));
        }
        panels.push(Panel {
            title: format!("{} m/s: L2 error at particles", jump.left - jump.right),
            x: Axis::logarithmic("h (m)"),
            y: Axis::logarithmic("|e| (m^1.5/s)"),
            window: Some([(0.02, 0.125), height]),
            curves,
            legend: (k == 0).then_some(SeriesLabelPosition::LowerLeft),
        });
    }
    Ok(Sheet {
        name: "riemann_strong",
        caption: "Strong jumps, E = 5e10 Pa: the paper's scheme (linear, LME 4, LME 1.4), and the recommended setting without and with its smoothing.".into(),
        columns: 3,
        size: (430, 340),
        panels,
    })
}
