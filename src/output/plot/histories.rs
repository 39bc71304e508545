//! Probes and reactions against time: a panel each, the components in it.

use super::chart::{Line, Panel};
use super::table::Columns;
use super::{PlotError, palette};

/// Panels of a picture, at most.
const MOST: usize = 8;

/// Colours of components; a tensor has more than there are colours, and its last ones look like its first.
const COLORS: [plotters::style::RGBColor; 6] =
    [palette::BLUE, palette::VERMILLION, palette::GREEN, palette::PURPLE, palette::SKY, palette::BLACK];

/// A panel for each name that begins columns of `table`, in its order; the first [`MOST`] of them, and how many there are.
pub(super) fn panels(table: &Columns) -> Result<(Vec<Panel>, usize), PlotError> {
    let mut panels: Vec<Panel> = Vec::new();
    for column in table.names().iter().filter(|column| *column != "time") {
        let (name, component) = split(column);
        if panels.last().is_none_or(|panel| panel.y != name) {
            panels.push(Panel { x: "time", x_labels: 10, y: name.to_owned(), lines: Vec::new(), share: 1 });
        }
        if let Some(panel) = panels.last_mut() {
            let color = COLORS[panel.lines.len() % COLORS.len()];
            panel.lines.push(Line { label: component.to_owned(), color, points: table.pairs("time", column)? });
        }
    }
    let there = panels.len();
    panels.truncate(MOST);
    Ok((panels, there))
}

/// A column's name and its component; the name again if it has none.
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
    fn components_share_a_panel() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("probes.csv");
        std::fs::write(&path, "time,tip_x,tip_y,mid_point,s_xx,s_xy\n0,1,2,3,4,5\n1,2,NaN,4,5,6\n")?;
        let (panels, there) = panels(&Columns::read(path)?)?;
        assert_eq!(there, 3);
        let shown: Vec<_> = panels.iter().map(|panel| (panel.y.as_str(), panel.lines.len())).collect();
        assert_eq!(shown, [("tip", 2), ("mid_point", 1), ("s", 2)]);
        assert_eq!(panels[2].lines[1].label, "xy");
        assert_eq!(panels[0].lines[0].points, [(0.0, 1.0), (1.0, 2.0)]);
        Ok(())
    }
}
