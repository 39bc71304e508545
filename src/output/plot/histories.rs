//! Probes, reactions and forces of contact against time: one panel each, with its components.

use super::chart::{Line, Panel};
use super::palette;
use super::picture::Color;
use super::table::Columns;
use crate::output::OutputError;

/// Largest number of panels in a picture.
const MOST: usize = 8;

/// A value below this fraction of the scale of its quantity is round-off.
pub(super) const ROUND_OFF: f64 = 1e-12;

/// Colours of components. A tensor with more components repeats the first colours.
const COLORS: [Color; 6] =
    [palette::BLUE, palette::VERMILLION, palette::GREEN, palette::PURPLE, palette::SKY, palette::BLACK];

/// Gives panels of the same quantity axes of the same length, so that round-off is not drawn like a force.
pub(super) fn on_one_scale(panels: &mut [Panel], quantity: impl Fn(&str) -> String) {
    let length = |panel: &Panel| panel.upright().1 - panel.upright().0;
    let lengths: Vec<(String, f64)> = panels.iter().map(|panel| (quantity(&panel.y), length(panel))).collect();
    for panel in panels {
        let same = lengths.iter().filter(|(of, _)| *of == quantity(&panel.y));
        panel.least = same.map(|(_, length)| *length).fold(0.0, f64::max);
    }
}

/// One panel for each name in the columns of `table` that is `shown`, in order, at most [`MOST`]. Returns the panels, and a text with the
/// number of panels before this limit and the names of panels left out.
///
/// A panel is left out if everything in it is 0, up to the round-off of the largest panel of the same `quantity`.
pub(super) fn panels(
    table: &Columns,
    shown: impl Fn(&str) -> bool,
    quantity: impl Fn(&str) -> String,
) -> Result<(Vec<Panel>, String), OutputError> {
    let mut panels: Vec<Panel> = Vec::new();
    for column in table.names.iter().filter(|column| *column != "time") {
        let (name, component) = split(column);
        if !shown(name) {
            continue;
        }
        let points = table.pairs("time", column)?;
        let line = |k: usize| Line::new(component, COLORS[k % COLORS.len()], points);
        match panels.last_mut().filter(|panel| panel.y == name) {
            Some(panel) => panel.lines.push(line(panel.lines.len())),
            None => panels.push(Panel::over_time(name, vec![line(0)])),
        }
    }
    let is_zero = |panel: &Panel| {
        let same = panels.iter().filter(|other| quantity(&other.y) == quantity(&panel.y));
        panel.size() <= ROUND_OFF * same.map(Panel::size).fold(0.0, f64::max)
    };
    let zero: Vec<bool> = panels.iter().map(is_zero).collect();
    let mut zero = zero.into_iter();
    let left_out: Vec<Panel> = panels.extract_if(.., |_| zero.next() == Some(true)).collect();
    let mut text = String::new();
    if panels.len() > MOST {
        text = format!(", the first {MOST} of {}", panels.len());
        panels.truncate(MOST);
    }
    if !left_out.is_empty() {
        let names: Vec<&str> = left_out.iter().map(|panel| panel.y.as_str()).collect();
        text += &format!("; zero: {}", names.join(", "));
    }
    Ok((panels, text))
}

/// Name and component of a column; twice the name if there is no component.
fn split(column: &str) -> (&str, &str) {
    match column.rsplit_once('_') {
        Some((name, end)) if matches!(end.len(), 1 | 2) && end.bytes().all(|b| b"xyz".contains(&b)) => (name, end),
        _ => (column, column),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_share_a_panel_and_none_shows_round_off() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("probes.csv");
        let rows =
            "time,tip_x,tip_y,mid_point,s_xx,s_xy,still_x,still_y\n0,1,2,3,4,5,0,0\n1,2,NaN,4,5,6,1e-15,-2e-16\n";
        std::fs::write(&path, rows)?;
        let quantity = |name: &str| if name == "s" { "stress" } else { "displacement" }.to_owned();
        let (mut panels, text) = panels(&Columns::read(path)?, |name| name != "mid_point", quantity)?;
        assert_eq!(text, "; zero: still");
        let shown: Vec<_> = panels.iter().map(|panel| (panel.y.as_str(), panel.lines.len())).collect();
        assert_eq!(shown, [("tip", 2), ("s", 2)]);
        assert_eq!(panels[1].lines[1].label, "xy");
        assert_eq!(panels[0].lines[0].points, [(0.0, 1.0), (1.0, 2.0)]);
        // From 1 to 3, and from 4 to 6: then both axes have the length of the longer one.
        panels[1].lines[0].points = vec![(0.0, 1e-9), (1.0, -1e-9)];
        panels[1].lines.truncate(1);
        on_one_scale(&mut panels, |_| "force".to_owned());
        let [low, high] = [panels[1].upright().0, panels[1].upright().1];
        assert!((high + low).abs() < 1e-12 && (high - low - 1.12).abs() < 1e-9, "{low} {high}");
        Ok(())
    }
}
