//! Work–precision diagrams.

use super::measured::{Measured, Point};
use super::setting::{Origin, SHAPES};
use crate::axis::Axis;
use crate::sheet::{Curve, Mark, Panel, Sheet};

/// The pictures of the study.
pub(super) fn sheets(all: &[Measured], knobs: &[(&'static str, String)]) -> Vec<Sheet> {
    vec![front(all), turned(all, knobs)]
}

/// Error against work for all problems, and against bytes for the last one; the key has its own panel.
fn front(all: &[Measured]) -> Sheet {
    let mut panels: Vec<Panel> = all
        .iter()
        .map(|measured| diagram(measured, "work (products of one particle)", measured.front(), |point| point.work))
        .collect();
    if let Some(last) = all.last() {
        panels.push(diagram(last, "bytes", last.front_in_bytes(), |point| point.cost.bytes as f64));
    }
    let names = panels.first().map(|panel| panel.curves.clone()).unwrap_or_default();
    panels.push(Panel::key(names));
    Sheet {
        name: "front",
        caption: "Error against work: every setting measured, and the front of those that nothing beats.".into(),
        columns: 3,
        size: (430, 370),
        panels,
    }
}

fn diagram(measured: &Measured, price: &str, front: Vec<&Point>, of: impl Fn(&Point) -> f64) -> Panel {
    let at = |point: &Point| (of(point), point.error);
    let family = |name: &str| -> Vec<(f64, f64)> {
        let belongs = |point: &&Point| matches!(&point.setting.origin, Origin::Design(shape, _) if *shape == name);
        measured.points.iter().filter(belongs).map(at).collect()
    };
    let knobs = measured.points.iter().filter(|point| matches!(point.setting.origin, Origin::Knob(..)));
    let mut curves = vec![
        Curve::new("front", 0, Mark::Line, front.into_iter().map(at).collect()),
        Curve::new("one knob turned", 7, Mark::Dots, knobs.map(at).collect()),
    ];
    let colors = [2, 5, 3, 6, 4, 1];
    curves.extend(SHAPES.iter().zip(colors).map(|((name, _), color)| Curve::new(*name, color, Mark::Dots, family(name))));
    let chosen = measured.points.iter().filter(|point| matches!(point.setting.origin, Origin::Accuracy(_)));
    let mut chosen: Vec<_> = chosen.map(at).collect();
    chosen.sort_by(|a, b| a.0.total_cmp(&b.0));
    curves.push(Curve::new("the key accuracy", 0, Mark::Dashed, chosen));
    curves.push(Curve::new("defaults", 0, Mark::Dots, vec![at(&measured.base)]));
    Panel {
        title: measured.problem.into(),
        x: Axis::logarithmic(price),
        y: Axis::logarithmic("relative error"),
        window: None,
        curves,
        legend: None,
    }
}

/// Each knob alone: error against work, both as ratios to those of the defaults.
fn turned(all: &[Measured], knobs: &[(&'static str, String)]) -> Sheet {
    let curve = |k: usize, measured: &Measured, knob: &str| {
        let base = measured.base_of(knob);
        let turned = measured.points.iter().filter(|point| point.setting.of_knob(knob).is_some()).chain(base);
        let ratios = |point: &Point| base.map(|base| (point.work / base.work, point.error / base.error));
        let mut points: Vec<_> = turned.filter_map(ratios).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Curve::new(measured.problem, k + 1, Mark::Joined, points)
    };
    let panel = |(knob, _): &(&'static str, String)| {
        let curves: Vec<Curve> = all.iter().enumerate().map(|(k, measured)| curve(k, measured, knob)).collect();
        Panel {
            title: (*knob).into(),
            x: Axis::logarithmic("work over that of the default"),
            y: Axis::logarithmic("error over that of the default"),
            window: Some([window(&curves, |point| point.0), window(&curves, |point| point.1)]),
            curves,
            legend: None,
        }
    };
    let mut panels: Vec<Panel> = knobs.iter().map(panel).collect();
    let names = panels.first().map(|panel| panel.curves.clone()).unwrap_or_default();
    panels.push(Panel::key(names));
    Sheet {
        name: "knobs",
        caption: "One knob at a time, on the four problems: what it costs and what it buys.".into(),
        columns: 4,
        size: (390, 330),
        panels,
    }
}

/// A range that holds all points and is so wide that a ratio of 1.01 is invisible.
fn window(curves: &[Curve], of: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
    let ratios = curves.iter().flat_map(|curve| &curve.points).map(of);
    ratios.fold((0.4, 2.5), |(low, high), ratio| (low.min(0.9 * ratio), high.max(1.1 * ratio)))
}
