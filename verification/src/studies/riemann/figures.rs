//! The figures: Figs. 5, 6 and 7, and strong jumps.

use super::*;
use crate::axis::Axis;
use crate::sheet::{Curve, Mark, Panel, Sheet};
use plotters::prelude::SeriesLabelPosition;

/// The spacing at which the paper's scheme for strong jumps is shown.
const STRONG_SPACING: f64 = 0.05;

/// A name, and a function from a number (γ, h or Δt) to its case.
type Family = (&'static str, fn(f64) -> Case);

/// The discretisations of Fig. 5, as functions of γ.
pub(super) fn discretisations() -> [Family; 4] {
    const MESH: Mesh = Mesh { h: 0.1, courant: 1.0 };
    [
        ("Q8 elements", |gamma| Case::Elements(gamma, Jump::PAPER, MESH)),
        ("linear", |gamma| Case::Particles(Method { gamma, ..LINEAR }, Jump::PAPER, MESH)),
        ("uGIMP", |gamma| Case::Particles(Method { gamma, ..GIMP }, Jump::PAPER, MESH)),
        ("LME 4", |gamma| Case::Particles(Method { gamma, ..LME }, Jump::PAPER, MESH)),
    ]
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (_, case) in discretisations() {
        cases.extend(GAMMAS.map(case));
    }
    for h in SPACINGS {
        cases.extend([LINEAR, GIMP, LME].map(|method| Case::particles(method, Jump::PAPER, h, 1.0)));
        cases.push(Case::Elements(0.5, Jump::PAPER, Mesh { h, courant: 1.0 }));
    }
    for courant in COURANTS {
        cases.extend([LINEAR, LME, Method::RECOMMENDED].map(|method| Case::particles(method, Jump::PAPER, 0.1, courant)));
    }
    cases
}

pub(super) fn all(runs: &Runs) -> Result<Vec<Sheet>, StudyError> {
    Ok(vec![profiles(runs)?, convergence(runs)?, time_steps(runs)?, strong(runs)?, trade(runs)?])
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
    let window = [(40.7, 59.3), (-2.0, 12.0)];
    let mut panels = Vec::new();
    for (k, (name, case)) in discretisations().into_iter().enumerate() {
        let mut curves = vec![exact(Jump::PAPER, 40.7, 59.3)?];
        for (color, gamma) in GAMMAS.into_iter().enumerate() {
            let profile = runs.of(case(gamma))?.profile.clone();
            curves.push(Curve::new(format!("γ = {gamma}"), color + 1, Mark::Line, profile));
        }
        panels.push(Panel {
            title: name.into(),
            x: Axis::linear("X (m)"),
            y: Axis::linear("v (m/s)"),
            window: Some(window),
            curves,
            legend: (k == 0).then_some(SeriesLabelPosition::UpperRight),
        });
    }
    Ok(Sheet {
        name: "riemann_profiles",
        caption: "Fig. 5: velocity along the bar at 3 ms, at particles (Gauss points), h = 0.1 m, Courant 1, eps = 0.8 (consistent for elements).".into(),
        columns: 2,
        size: (520, 340),
        panels,
    })
}

fn convergence(runs: &Runs) -> Result<Sheet, StudyError> {
    type Value = fn(&Measured) -> f64;
    let errors = |case: fn(f64) -> Case, value: Value| -> Result<Vec<(f64, f64)>, StudyError> {
        SPACINGS.iter().map(|&h| Ok((h, value(runs.of(case(h))?)))).collect()
    };
    let lines: [(Family, usize); 5] = [
        (("linear", |h| Case::particles(LINEAR, Jump::PAPER, h, 1.0)), 2),
        (("uGIMP", |h| Case::particles(GIMP, Jump::PAPER, h, 1.0)), 3),
        (("LME 4", |h| Case::particles(LME, Jump::PAPER, h, 1.0)), 1),
        (("Q8 elements", |h| Case::Elements(0.5, Jump::PAPER, Mesh { h, courant: 1.0 })), 0),
        (("recommended", |h| Case::particles(Method::RECOMMENDED, Jump::PAPER, h, COURANT)), 4),
    ];
    let values: [(&str, Value); 2] = [("at particles", |found| found.particles), ("at nodes", |found| found.nodes)];
    let mut panels = Vec::new();
    for (k, (title, value)) in values.into_iter().enumerate() {
        let mut curves = Vec::new();
        for ((name, case), color) in lines {
            curves.push(Curve::new(name, color, Mark::Joined, errors(case, value)?));
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
        let profile = runs.particles(method, Jump::PAPER, h, courant)?.profile.clone();
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
        caption: "Fig. 6: errors against the spacing at fixed Courant number, and profiles at the smallest spacing.".into(),
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
            .map(|&courant| Ok((5e-5 * courant, runs.particles(method, Jump::PAPER, 0.1, courant)?.particles)))
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
        for (method, courant, color) in [(LME, 1.0, 1), (Method::UNDISSIPATED, COURANT, 5), (Method::RECOMMENDED, COURANT, 4)] {
            if let Ok(found) = runs.particles(method, jump, STRONG_SPACING, courant) {
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
            let points = spacings.iter().filter_map(|&h| Some((h, runs.particles(method, jump, h, courant).ok()?.particles)));
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

fn trade(runs: &Runs) -> Result<Sheet, StudyError> {
    let mut panels = Vec::new();
    for (k, size) in [100.0, 1000.0].into_iter().enumerate() {
        let jump = Jump::of(size);
        let mut curves = vec![
            Curve::new("asked for", 0, Mark::Dashed, vec![(0.8, 2.0), (1.5, 2.0)]),
            Curve::new("", 0, Mark::Dashed, vec![(1.5, 2.0), (1.5, 0.0)]),
        ];
        for ((name, strengths), color) in tables::TRADE.into_iter().zip([1, 2, 4]) {
            let points: Result<Vec<_>, StudyError> = (strengths.iter())
                .map(|&transfer| tables::trade(runs, transfer, jump).map(|(width, overshoot, _)| (width, 100.0 * overshoot)))
                .collect();
            curves.push(Curve::new(name, color, Mark::Joined, points?));
        }
        panels.push(Panel {
            title: format!("{size} m/s, h = 0.1 m, Courant 0.5"),
            x: Axis::linear("width of the front / undissipated"),
            y: Axis::linear("overshoot (% of the jump)"),
            window: Some([(0.8, 3.0), (-0.5, 20.0)]),
            curves,
            legend: (k == 0).then_some(SeriesLabelPosition::UpperRight),
        });
    }
    Ok(Sheet {
        name: "riemann_trade",
        caption: "Overshoot against width as the smoothing grows, in three ways: a blend of order 1, one of order 2, and the limited one.".into(),
        columns: 2,
        size: (520, 380),
        panels,
    })
}
