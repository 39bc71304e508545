//! `report.html`: the pictures and the numbers of a run on one page that needs nothing else.

use super::player::Played;
use super::run_report::has_inertia;
use serde_json::Value;
use std::fmt::Write;

/// Script of the player.
const PLAYER: &str = include_str!("player.js");

/// Controls of the player.
const CONTROLS: &str = "<noscript>particles.png shows the last snapshot; the player needs JavaScript.</noscript>
<div id=\"player\"><div class=\"stage\"><canvas id=\"scene\"></canvas><canvas id=\"above\"></canvas></div>
<p><button id=\"play\">▶</button><input id=\"frame\" type=\"range\" min=\"0\" value=\"0\" aria-label=\"snapshot\"><output id=\"time\"></output></p>
<p><label>colour <select id=\"field\"></select></label>
<label><input id=\"now\" type=\"checkbox\"> range of this time</label>
<label><input id=\"outline\" type=\"checkbox\" checked> undeformed outline</label>
<label>deformation × <input id=\"deformation\" type=\"number\" value=\"1\" step=\"any\"></label>
<button id=\"home\">whole view</button></p></div>";

const STYLE: &str = "
body { font: 15px/1.45 system-ui, sans-serif; color: #222; background: #fff; max-width: 960px; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em; margin-bottom: .2em } h2 { font-size: 1.15em; margin-top: 2em; border-bottom: 1px solid #ddd }
.lead { color: #555; margin-top: 0 }
.outcome { padding: .6em .9em; border-radius: 6px; background: #e8f4ee }
.outcome.failed, .warnings li { background: #fbeee6 } .outcome.interrupted, .outcome.killed { background: #fdf6dd }
.warnings { padding: 0; list-style: none } .warnings li { padding: .4em .9em; margin: .3em 0; border-radius: 6px }
.tables { display: flex; flex-wrap: wrap; gap: 0 3em; align-items: flex-start }
table { border-collapse: collapse; margin: .5em 0 } caption { text-align: left; font-weight: 600; padding: .3em 0 }
td { padding: .15em 1.2em .15em 0; border-bottom: 1px solid #eee } td.number { text-align: right; font-variant-numeric: tabular-nums }
.bar { display: inline-block; height: .7em; background: #0072b2; vertical-align: baseline }
figure { margin: 1em 0 } svg { max-width: 100%; height: auto }
.stage { position: relative; height: 560px } .stage canvas { position: absolute; width: 100%; height: 100% }
#above { touch-action: none; cursor: grab } #above:active { cursor: grabbing }
#player p { display: flex; flex-wrap: wrap; gap: .5em 1.2em; align-items: center; margin: .4em 0 } #frame { flex: 1; min-width: 12em }
#play { width: 3em } #time { min-width: 15em; font-variant-numeric: tabular-nums } #deformation { width: 6em }
details td { vertical-align: top; font-size: 13px } .note { color: #555 }
";

/// The page of a run: its report, the player of its snapshots, and its pictures (name and SVG). A run without a report goes on or was
/// killed.
pub(super) fn page(report: Option<&Value>, played: Option<&Played>, pictures: &[(&str, String)]) -> String {
    let report = report.unwrap_or(&Value::Null);
    let title = report["settings"]["title"].as_str().unwrap_or("A run of bfree");
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title><style>{STYLE}</style></head><body>\n<h1>{0}</h1>\n",
        escaped(title)
    );
    outcome(&mut out, report);
    warnings(&mut out, &report["warnings"]);
    if let Some(played) = played {
        controls(&mut out, played);
    }
    if report.is_object() {
        numbers(&mut out, report);
    }
    figures(&mut out, pictures);
    details(&mut out, report);
    if let Some(played) = played {
        scripts(&mut out, played);
    }
    out.push_str("</body></html>\n");
    out
}

// Writing to a string cannot fail, so results of `writeln!` are ignored.

/// The command line, and how the run ended.
fn outcome(out: &mut String, report: &Value) {
    let text = |key: &str| report[key].as_str().unwrap_or_default();
    let (outcome, message) = match text("outcome") {
        "" => ("killed", "There is no report: the run goes on, or it was killed. The pictures show what it wrote."),
        outcome => (outcome, text("message")),
    };
    let _ = writeln!(out, "<p class=\"lead\">{}</p>", escaped(&command(report)));
    let _ = writeln!(out, "<p class=\"outcome {outcome}\"><b>{outcome}</b>: {}</p>", escaped(message));
}

/// The controls of the player, with the note of a recording.
fn controls(out: &mut String, played: &Played) {
    let _ = writeln!(out, "{CONTROLS}");
    if let Some(note) = &played.note {
        let _ = writeln!(out, "<p class=\"note\">{}</p>", escaped(note));
    }
}

/// The tables of energies, counts and seconds.
fn numbers(out: &mut String, report: &Value) {
    out.push_str("<h2>Numbers</h2>\n<div class=\"tables\">\n");
    // In load steps, loads act at once, and the energy balance says nothing of their work.
    let left_out: &[&str] = if has_inertia(Some(report)) { &[] } else { &["balance", "kinetic"] };
    table(out, "Energy at the end", &report["energies"], left_out);
    table(out, "Counts", &report["counts"], &[]);
    seconds(out, &report["seconds"]);
    out.push_str("</div>\n");
}

fn figures(out: &mut String, pictures: &[(&str, String)]) {
    out.push_str("<h2>Pictures</h2>\n");
    for (name, svg) in pictures {
        // An XML declaration may stand at the start of a file only.
        let svg = svg.find("<svg").and_then(|start| svg.get(start..)).unwrap_or(svg);
        let _ = writeln!(out, "<figure id=\"{name}\">{svg}</figure>");
    }
}

/// The inputs of the run, each in a list that opens by a click.
fn details(out: &mut String, report: &Value) {
    for (key, caption) in [
        ("accuracy", "What the accuracy has set"),
        ("settings", "The scene, with all defaults"),
        ("command", "The command line"),
        ("probes", "Probes"),
    ] {
        if report[key].as_array().map_or(!report[key].is_null(), |list| !list.is_empty()) {
            let _ = writeln!(out, "<details><summary>{caption}</summary><table>");
            rows(out, String::new(), &report[key]);
            out.push_str("</table></details>\n");
        }
    }
}

/// The snapshots, and the script that plays them.
fn scripts(out: &mut String, played: &Played) {
    let Played { meta, numbers, .. } = played;
    let _ = writeln!(out, "<script type=\"application/json\" id=\"snapshots\">{meta}</script>");
    let _ = writeln!(out, "<script type=\"text/plain\" id=\"numbers\">{numbers}</script>\n<script>{PLAYER}</script>");
}

/// A row for every value, with its path. A list of plain values is one row.
fn rows(out: &mut String, path: String, value: &Value) {
    let plain = |value: &Value| match value {
        Value::String(text) => text.clone(),
        Value::Array(_) | Value::Object(_) => String::new(),
        value => value.to_string(),
    };
    match value {
        Value::Null => {}
        Value::Object(keys) => {
            let dot = if path.is_empty() { "" } else { "." };
            keys.iter().for_each(|(key, value)| rows(out, format!("{path}{dot}{key}"), value));
        }
        Value::Array(list) if list.iter().any(|one| one.is_object() || one.is_array()) => {
            list.iter().enumerate().for_each(|(k, value)| rows(out, format!("{path}[{k}]"), value));
        }
        value => {
            let text = value.as_array().map(|list| list.iter().map(plain).collect::<Vec<_>>().join(", "));
            let text = text.unwrap_or_else(|| plain(value));
            let _ = writeln!(out, "<tr><td>{}</td><td>{}</td></tr>", escaped(&path), escaped(&text));
        }
    }
}

/// Program, scene, particles, steps and time on one line.
fn command(report: &Value) -> String {
    let number = |value: &Value| value.as_f64().map(shown);
    let parts = [
        report["program"].as_str().map(str::to_owned),
        report["command"]["scene"].as_str().map(str::to_owned),
        number(&report["counts"]["particles"]).map(|count| format!("{count} particles")),
        number(&report["counts"]["steps"]).map(|count| format!("{count} steps")),
        number(&report["time"]).map(|time| format!("t = {time}")),
        report["seconds"]["total"]
            .as_f64()
            .map(|seconds| format!("{seconds:.1} s on {} threads", report["command"]["threads"])),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(" · ")
}

fn warnings(out: &mut String, warnings: &Value) {
    let Some(list) = warnings.as_array().filter(|list| !list.is_empty()) else { return };
    out.push_str("<ul class=\"warnings\">\n");
    for warning in list {
        let (time, step) = (warning["time"].as_f64().map(shown).unwrap_or_default(), &warning["step"]);
        let message = warning["message"].as_str().unwrap_or_default();
        let _ = writeln!(out, "<li><b>t = {time}</b>, step {step}: {}</li>", escaped(message));
    }
    out.push_str("</ul>\n");
}

fn table(out: &mut String, caption: &str, rows: &Value, left_out: &[&str]) {
    let _ = writeln!(out, "<table><caption>{caption}</caption>");
    for (name, value) in rows.as_object().into_iter().flatten().filter(|(name, _)| !left_out.contains(&name.as_str())) {
        let value = value.as_f64().map_or_else(|| escaped(value.as_str().unwrap_or_default()), shown);
        let _ = writeln!(out, "<tr><td>{}</td><td class=\"number\">{value}</td></tr>", words(name));
    }
    out.push_str("</table>\n");
}

fn seconds(out: &mut String, seconds: &Value) {
    let total = seconds["total"].as_f64().unwrap_or(0.0);
    out.push_str("<table><caption>Seconds</caption>\n");
    for (name, value) in seconds.as_object().into_iter().flatten() {
        let value = value.as_f64().unwrap_or(0.0);
        let part = if total > 0.0 && name != "total" { 120.0 * value / total } else { 0.0 };
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td class=\"number\">{value:.2}</td><td><span class=\"bar\" style=\"width:{part:.0}px\"></span></td></tr>",
            words(name)
        );
    }
    out.push_str("</table>\n");
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

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
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
        let page = page(Some(&report), None, &[("energies", "<?xml?><svg>x</svg>".to_owned())]);
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
        assert!(!page.contains("<script>") && !page.contains("<?xml") && !page.contains("http"), "{page}");
        assert!(super::page(None, None, &[]).contains("killed"));
    }
}
