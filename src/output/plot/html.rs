//! `report.html`: the pictures and the numbers of a run on one page that needs nothing else.

use super::picture::escaped;
use super::player::Played;
use super::run_report::has_inertia;
use serde_json::Value;

/// Script of the player.
const PLAYER: &str = include_str!("player.js");

/// Controls of the player.
const CONTROLS: &str = include_str!("player.html");

/// Style of the page.
const STYLE: &str = include_str!("page.css");

/// The page of a run: its report, the player of its snapshots, and its pictures (name and SVG). The report is null for a run that goes on
/// or was killed.
pub(super) fn page(report: &Value, played: Option<&Played>, pictures: &[(&str, String)]) -> String {
    let title = escaped(report["settings"]["title"].as_str().unwrap_or("A run of bfree"));
    let parts = [
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head><body>\n\
             <h1>{title}</h1>\n"
        ),
        outcome(report),
        warnings(&report["warnings"]),
        played.map(controls).unwrap_or_default(),
        if report.is_object() { numbers(report) } else { String::new() },
        figures(pictures),
        details(report),
        played.map(scripts).unwrap_or_default(),
        "</body></html>\n".to_owned(),
    ];
    parts.concat()
}

/// The command line, and how the run ended.
fn outcome(report: &Value) -> String {
    let text = |key: &str| report[key].as_str().unwrap_or_default();
    let (outcome, message) = match text("outcome") {
        "" => ("killed", "There is no report: the run goes on, or it was killed. The pictures show what it wrote."),
        outcome => (outcome, text("message")),
    };
    let (command, message) = (escaped(&command(report)), escaped(message));
    format!("<p class=\"lead\">{command}</p>\n<p class=\"outcome {outcome}\"><b>{outcome}</b>: {message}</p>\n")
}

/// Program, scene, particles, steps and time on one line.
fn command(report: &Value) -> String {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let number = |value: &Value| value.as_f64().map(shown);
    let seconds = report["seconds"]["total"].as_f64();
    let parts = [
        text(&report["program"]),
        text(&report["command"]["scene"]),
        number(&report["counts"]["particles"]).map(|count| format!("{count} particles")),
        number(&report["counts"]["steps"]).map(|count| format!("{count} steps")),
        number(&report["time"]).map(|time| format!("t = {time}")),
        seconds.map(|seconds| format!("{seconds:.1} s on {} threads", report["command"]["threads"])),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(" · ")
}

fn warnings(list: &Value) -> String {
    let items = list.as_array().into_iter().flatten().map(|warning| {
        let time = warning["time"].as_f64().map(shown).unwrap_or_default();
        let message = escaped(warning["message"].as_str().unwrap_or_default());
        format!("<li><b>t = {time}</b>, step {}: {message}</li>\n", warning["step"])
    });
    let items: String = items.collect();
    if items.is_empty() { items } else { format!("<ul class=\"warnings\">\n{items}</ul>\n") }
}

/// The controls of the player, with the note of a recording.
fn controls(played: &Played) -> String {
    let note = played.note.iter().map(|note| format!("<p class=\"note\">{}</p>\n", escaped(note)));
    format!("{CONTROLS}\n{}", note.collect::<String>())
}

/// The tables of energies, counts and seconds.
fn numbers(report: &Value) -> String {
    // In load steps, loads act at once, and the energy balance says nothing of their work.
    let has_meaning = |name: &str| has_inertia(report) || !["balance", "kinetic"].contains(&name);
    let number = |name: &str, value: &Value| {
        let value = value.as_f64().map_or_else(|| escaped(value.as_str().unwrap_or_default()), shown);
        format!("<tr><td>{}</td><td class=\"number\">{value}</td></tr>\n", words(name))
    };
    let total = report["seconds"]["total"].as_f64().unwrap_or(0.0);
    let bar = |name: &str, value: &Value| {
        let value = value.as_f64().unwrap_or(0.0);
        let part = if total > 0.0 && name != "total" { 120.0 * value / total } else { 0.0 };
        format!(
            "<tr><td>{}</td><td class=\"number\">{value:.2}</td><td><span class=\"bar\" style=\"width:{part:.0}px\"></span></td></tr>\n",
            words(name)
        )
    };
    format!(
        "<h2>Numbers</h2>\n<div class=\"tables\">\n{}{}{}</div>\n",
        table("Energy at the end", &report["energies"], |name, value| {
            if has_meaning(name) { number(name, value) } else { String::new() }
        }),
        table("Counts", &report["counts"], number),
        table("Seconds", &report["seconds"], bar)
    )
}

fn table(caption: &str, rows: &Value, row: impl Fn(&str, &Value) -> String) -> String {
    let rows: String = rows.as_object().into_iter().flatten().map(|(name, value)| row(name, value)).collect();
    format!("<table><caption>{caption}</caption>\n{rows}</table>\n")
}

fn figures(pictures: &[(&str, String)]) -> String {
    let figure = |(name, svg): &(&str, String)| format!("<figure id=\"{name}\">{svg}</figure>\n");
    format!("<h2>Pictures</h2>\n{}", pictures.iter().map(figure).collect::<String>())
}

/// The inputs of the run, each in a list that opens by a click.
fn details(report: &Value) -> String {
    let lists = [
        ("accuracy", "What the accuracy has set"),
        ("settings", "The scene, with all defaults"),
        ("command", "The command line"),
        ("probes", "Probes"),
    ];
    let list = |(key, caption): (&str, &str)| {
        let rows = rows("", &report[key]);
        format!("<details><summary>{caption}</summary><table>\n{rows}</table></details>\n")
    };
    let is_there = |value: &Value| value.as_array().map_or(!value.is_null(), |list| !list.is_empty());
    lists.into_iter().filter(|(key, _)| is_there(&report[key])).map(list).collect()
}

/// The snapshots, and the script that plays them.
fn scripts(Played { meta, numbers, .. }: &Played) -> String {
    format!(
        "<script type=\"application/json\" id=\"snapshots\">{meta}</script>\n\
         <script type=\"text/plain\" id=\"numbers\">{numbers}</script>\n<script>{PLAYER}</script>\n"
    )
}

/// A row for every value, with its path. A list of plain values is one row.
fn rows(path: &str, value: &Value) -> String {
    let plain = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    match value {
        Value::Null => String::new(),
        Value::Object(keys) => {
            let dot = if path.is_empty() { "" } else { "." };
            keys.iter().map(|(key, value)| rows(&format!("{path}{dot}{key}"), value)).collect()
        }
        Value::Array(list) if list.iter().any(|one| one.is_object() || one.is_array()) => {
            list.iter().enumerate().map(|(k, value)| rows(&format!("{path}[{k}]"), value)).collect()
        }
        value => {
            let text = match value.as_array() {
                Some(list) => list.iter().map(plain).collect::<Vec<_>>().join(", "),
                None => plain(value),
            };
            format!("<tr><td>{}</td><td>{}</td></tr>\n", escaped(path), escaped(&text))
        }
    }
}

/// A key as words.
fn words(name: &str) -> String {
    escaped(&name.replace('_', " "))
}

/// A readable number: a whole number as it is, others with five decimals.
fn shown(x: f64) -> String {
    match x.abs() {
        size if x.fract() == 0.0 && size < 1e15 => format!("{x:.0}"),
        size if (1e-3..1e6).contains(&size) => format!("{x:.5}"),
        _ => format!("{x:.5e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_title_cannot_break_the_page() {
        let report = json!({
            "outcome": "failed", "message": "a < b", "settings": {"title": "<script>alert(1)</script>"}, "probes": [],
            "energies": {"kinetic": 0.5, "strain": "NaN"}, "counts": {"max_active_nodes": 7}, "seconds": {"newton": 1.0, "total": 4.0},
            "warnings": [{"time": 0.25, "step": 5, "kind": "energy_created", "message": "more & more"}],
        });
        let page = page(&report, None, &[("energies", "<svg>x</svg>".to_owned())]);
        for words in [
            "&lt;script&gt;",
            "<b>failed</b>: a &lt; b",
            "more &amp; more",
            "<b>t = 0.25000</b>, step 5",
            "max active nodes",
            "<td class=\"number\">NaN</td>",
            "width:30px",
            "<figure id=\"energies\"><svg>x</svg></figure>",
        ] {
            assert!(page.contains(words), "no {words} in {page}");
        }
        assert!(!page.contains("<script>") && !page.contains("http"), "{page}");
        assert!(super::page(&Value::Null, None, &[]).contains("killed"));
    }
}
