//! The messages of a run and of `bfree check`: the report, the history, progress, warnings.

use super::{check, program, rebound, report, run, scene};
use crate::support::{Failure, merged, said, solid};
use serde_json::{Value, json};

#[test]
fn check_says_how_far_apart_bodies_feel_each_other() -> Result<(), Failure> {
    let check = |set: &str| -> Result<String, Failure> {
        let (code, text, told) = check(&scene("collision.json"), &[set])?;
        assert!(code == Some(0) && told.is_empty(), "{told}");
        Ok(text)
    };
    assert!(check("approximation=\"linear\"")?.contains("0.1000 to 0.3500 apart (0.4 to 1.4 spacings)"));
    assert!(check("approximation={\"lme\": {\"gamma\": 2}}")?.contains("how far was not measured"));
    Ok(())
}

#[test]
fn load_steps_have_no_balance() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    assert_eq!(run(&scene("column_static.json"), directory.path(), &["--steps", "1", "--quiet"])?.0, Some(0));
    let history = std::fs::read_to_string(directory.path().join("history.csv"))?;
    let columns: Vec<&str> = history.lines().next().unwrap_or_default().split(',').collect();
    assert!(columns.contains(&"strain") && !columns.contains(&"balance"), "{columns:?}");
    assert_eq!(history.lines().last().map(|row| row.split(',').count()), Some(columns.len()));
    Ok(())
}

#[test]
fn the_report_says_what_was_asked_for() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let far = r#"output.probes=[{"name": "far", "field": "velocity", "at": {"point": [14, 4]}},
                               {"name": "near", "field": "velocity", "at": {"particle": [2.5, 2.5]}}]"#;
    let limits = ["--until", "0.3", "--steps", "4", "--threads", "1", "--check-tangent", "3", "--quiet"];
    let (code, _, message) = rebound(directory.path(), &[&["--set", far], &limits[..]].concat())?;
    assert_eq!(code, Some(0), "{message}");
    assert!(message.starts_with("warning: probe \"far\": the nearest particle"), "{message}");
    assert!(message.contains("spacing 2.500e-1;"), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    let report = report(directory.path())?;
    let command = &report["command"];
    assert_eq!((&command["until"], &command["steps"], &command["threads"]), (&0.3.into(), &4.into(), &1.into()));
    assert_eq!((&command["check_tangent"], &command["set"][0]), (&3.into(), &far.into()));
    assert_eq!(report["settings"]["time"]["end"], 0.3);
    assert_eq!(report["steps"].as_array().map(Vec::len), Some(4));
    assert_eq!((&report["outcome"], &report["surfaces"]), (&"finished".into(), &Value::Array(Vec::new())));
    // 3 spacings beyond the disc of radius 1.5 around (2.5, 2.5), and half a diagonal of ¼ from its centre.
    assert!(report["probes"][0]["distance"].as_f64().is_some_and(|distance| distance > 10.0), "{report}");
    assert_eq!(report["probes"][1]["distance"].as_f64(), Some(0.125 * 2.0_f64.sqrt()));
    assert_eq!(report["probes"][1]["warning"], Value::Null);
    let probes = std::fs::read_to_string(directory.path().join("probes.csv"))?;
    assert!(probes.lines().skip(1).all(|row| row.split(',').nth(1) == Some("NaN")), "{probes}");
    Ok(())
}

#[test]
fn a_picture_shows_what_is_asked_for() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    assert_eq!(rebound(directory.path(), &["--until", "2", "--quiet"])?.0, Some(0));
    let plot = |arguments: &[&str]| said(program().arg("plot").arg(directory.path()).args(arguments));
    let (code, drawn, text) = plot(&["--field", "stress_xx", "--time", "0.7", "--format", "svg"])?;
    assert_eq!(code, Some(0), "{text}");
    assert!(drawn.contains("particles.svg") && !drawn.contains(".png"), "{drawn}");
    let picture = || std::fs::read_to_string(directory.path().join("particles.svg"));
    // Snapshots are 0.5 apart.
    assert!(picture()?.contains(">Stress xx, t = 0.5<"), "{}", picture()?);
    let (code, drawn, text) = plot(&["--format", "both"])?;
    assert!(code == Some(0) && drawn.contains("particles.svg") && drawn.contains("particles.png"), "{text}{drawn}");
    assert_eq!(plot(&[])?, (code, drawn, text));
    assert!(picture()?.contains(">Von Mises stress, t = 2<"));
    let (code, _, text) = plot(&["--field", "stress_xq"])?;
    assert!(code == Some(2) && text.contains("\"stress_xq\"") && text.contains("stress_xy"), "{text}");
    assert_eq!(plot(&["--view", "xx"])?.0, Some(2));
    Ok(())
}

#[test]
fn seconds_of_set_up_are_told_apart() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    // 45,000 particles are made, and no step is taken.
    let (_, summary, _) = rebound(directory.path(), &["--steps", "0", "--set", "grid.spacing=0.025"])?;
    assert!(summary.contains("seconds   set up "), "{summary}");
    let report = report(directory.path())?;
    let seconds = report["seconds"].as_object().ok_or("no seconds")?;
    let of = |name: &str| seconds[name].as_f64().unwrap_or(f64::NAN);
    let sum: f64 = seconds.keys().filter(|name| *name != "total").map(|name| of(name)).sum();
    assert!(of("set_up") > 0.0 && (sum / of("total") - 1.0).abs() < 1e-9, "{seconds:?}");
    assert_eq!([of("shape_functions"), of("projection"), of("newton"), of("update")], [0.0; 4]);
    Ok(())
}

#[test]
fn a_failed_run_reports_every_attempt_and_its_work() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    // One iteration is never enough, so the step is halved twice.
    let few = ["--set", "solver.newton.max_iterations=1", "--set", "time.max_halvings=2", "--steps", "400", "--quiet"];
    let tight = ["--set", "solver.newton.tolerance=1e-14"];
    let (code, _, message) = rebound(directory.path(), &[&few[..], &tight].concat())?;
    assert_eq!(code, Some(1), "{message}");
    assert_eq!(message.matches("allowed iterations").count(), 1, "{message}");
    let report = report(directory.path())?;
    let sum = |key: &str| {
        let steps = report["steps"].as_array().into_iter().flatten();
        let attempts = report["failed_attempts"].as_array().into_iter().flatten();
        let within = steps.clone().flat_map(|step| step["failed_attempts"].as_array().into_iter().flatten());
        steps.chain(attempts).chain(within).map(|line| line[key].as_array().map_or(0, Vec::len)).sum::<usize>()
    };
    let attempts = report["failed_attempts"].as_array().ok_or("no attempts")?;
    assert_eq!(attempts.len(), 3, "{report}");
    for (k, attempt) in attempts.iter().enumerate() {
        assert_eq!(attempt["dt"].as_f64(), Some(0.05 * 0.5_f64.powi(k as i32)));
        assert!(attempt["why"].as_str().is_some_and(|why| why.contains("after the 1 allowed iterations")), "{attempt}");
    }
    assert_eq!(report["outcome"], "failed");
    assert_eq!(report["counts"]["newton_iterations"], sum("krylov_iterations"));
    assert!(report["counts"]["failed_attempts"].as_u64().is_some_and(|count| count >= 3));
    Ok(())
}

#[test]
fn a_program_that_watches_reads_json() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let far = r#"output.probes=[{"name": "far", "field": "velocity", "at": {"point": [14, 4]}}]"#;
    let arguments = ["--progress", "json", "--until", "24", "--set", "time.lumping=0.05", "--set", far];
    let (code, _, text) = rebound(directory.path(), &arguments)?;
    assert_eq!(code, Some(0), "{text}");
    let lines: Vec<Value> = text.lines().map(serde_json::from_str).collect::<Result<_, _>>()?;
    assert_eq!(lines[0]["event"], "warning");
    assert!(lines[0]["message"].as_str().is_some_and(|words| words.starts_with("probe \"far\"")), "{text}");
    let steps: Vec<&Value> = lines.iter().filter(|line| line["event"] == "step").collect();
    let last = steps.last().ok_or("no step")?;
    assert_eq!((&last["step"], &last["time"], &last["end"]), (&480.into(), &24.0.into(), &24.0.into()));
    let history = std::fs::read_to_string(directory.path().join("history.csv"))?;
    let row: Vec<&str> = history.lines().last().ok_or("no rows")?.split(',').collect();
    assert_eq!((last["balance"].as_f64(), last["krylov"].to_string()), (row[7].parse().ok(), row[11].to_owned()));
    assert!(last["seconds_left"].as_f64() == Some(0.0) && last["seconds"].as_f64() > Some(0.0), "{last}");
    assert!(steps.is_sorted_by_key(|step| step["step"].as_u64()));
    // The report contains the warnings too.
    let warned = lines.iter().filter(|line| line["event"] == "warning" && line["kind"].is_string()).count();
    assert_eq!(report(directory.path())?["warnings"].as_array().map(Vec::len), Some(warned));
    // The progress contains errors too.
    let (code, _, text) = rebound(directory.path(), &["--progress", "json", "--set", "time.step=-1"])?;
    let error: Value = serde_json::from_str(&text)?;
    assert_eq!((&error["event"], &error["code"], code), (&"error".into(), &2.into(), Some(2)));
    let [message, because] = ["message", "because"].map(|key| error[key].to_string());
    assert!(message.contains("rebound.json") && (message + &because).contains("time.step"), "{error}");
    assert_eq!(rebound(directory.path(), &["--progress", "json", "--quiet"])?.0, Some(2));
    Ok(())
}

#[test]
fn a_run_warns_once_of_halved_steps_and_many_iterations() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let arguments = ["--set", "time.step=0.2", "--set", "solver.newton.max_iterations=3", "--until", "6", "--quiet"];
    let (code, _, text) = run(&scene("rebound_fast.json"), directory.path(), &arguments)?;
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(text.matches("the step had to be halved").count(), 1, "{text}");
    assert!(text.contains("of 3 allowed iterations"), "{text}");
    let warnings = report(directory.path())?["warnings"].clone();
    for warning in warnings.as_array().ok_or("no warnings")? {
        let (time, step) = (warning["time"].as_f64().ok_or("no time")?, &warning["step"]);
        let line = format!("warning: t = {time}, step {step}: {}", warning["message"].as_str().unwrap_or_default());
        assert_eq!(text.matches(&line).count(), 1, "{line} in {text}");
    }
    Ok(())
}

#[test]
fn a_run_says_what_solves_its_systems_and_warns_of_those_left_unsolved() -> Result<(), Failure> {
    const METHOD: &str = "solver.krylov.method=\"automatic\"";
    let directory = tempfile::tempdir()?;
    let arguments = ["--steps", "2", "--set", "solver.krylov.max_iterations=2", "--set", METHOD];
    let (code, text, told) = run(&scene("compaction.json"), directory.path(), &arguments)?;
    assert_eq!(code, Some(0), "{told}");
    assert!(text.contains("of conjugate gradients a step"), "{text}");
    assert_eq!(told.matches("left unsolved after the 2 iterations allowed").count(), 1, "{told}");
    // The warning advises no setting that is set already.
    let [aggregation, multigrid] = ["aggregation = true", "preconditioner = \"multigrid\""];
    assert!(told.contains(aggregation) && told.contains(multigrid), "{told}");
    let set = ["aggregation=true", "solver.krylov.preconditioner=\"multigrid\"", "solver.krylov.max_iterations=1"];
    let other = tempfile::tempdir()?;
    let settings: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).chain(["--steps", "1"]).collect();
    let (_, _, told) = run(&scene("compaction.json"), other.path(), &settings)?;
    assert!(told.contains("left unsolved") && !told.contains(aggregation) && !told.contains(multigrid), "{told}");
    let report = report(directory.path())?;
    assert_eq!(report["counts"]["krylov_limited"], report["counts"]["newton_iterations"]);
    let krylov = serde_json::json!({ "method": "conjugate gradients", "why": "the tangent is symmetric" });
    assert_eq!((&report["krylov"], &report["warnings"][0]["kind"]), (&krylov, &"krylov_limited".into()));
    let (_, text, _) = check(&scene("compaction.json"), &[])?;
    assert!(text.contains("solver        GMRES(50): it was asked for"), "{text}");
    Ok(())
}

/// Runs a scene given as text. Returns standard output, standard error, and the report.
fn ran(text: &Value) -> Result<(String, String, Value), Failure> {
    let directory = tempfile::tempdir()?;
    let (path, out) = (directory.path().join("scene.json"), directory.path().join("out"));
    std::fs::write(&path, text.to_string())?;
    let (code, said, warned) = run(&path, &out, &[])?;
    assert_eq!(code, Some(0), "{warned}");
    Ok((said, warned, report(&out)?))
}

#[test]
fn a_ring_that_bounces_says_how_much_energy_it_lost_and_where() -> Result<(), Failure> {
    let disc = |radius: f64| json!({"ball": {"center": [1, 1], "radius": radius}});
    let (_, warned, report) = ran(&json!({
        "grid": {"size": [2, 2], "spacing": 0.1}, "time": {"step": 0.005, "end": 0.6}, "output": {},
        "bodies": [{"name": "ring", "density": 1000, "shape": {"difference": {"of": disc(0.5), "minus": disc(0.25)}},
                    "material": {"neo_hookean": {"young": 1e5, "poisson": 0.3}}}],
        "boundary": {"bottom": "sliding"}, "gravity": {"acceleration": [0, -9.81]}
    }))?;
    assert!(warned.contains("energy was lost") && warned.contains("a body meets a wall (impact)"), "{warned}");
    let [first, lost] = report["warnings"].as_array().map_or(&[][..], Vec::as_slice) else { panic!("{report}") };
    assert!(first["kind"] == "energy_lost" && lost["kind"] == "energy_lost", "{report}");
    assert_eq!(lost["time"], report["time"]);
    // The message gives the final loss, relative to the largest energy without the work of the weight.
    let balance = report["energies"]["balance"].as_f64().ok_or("no balance")?;
    let message = lost["message"].as_str().unwrap_or_default();
    assert!(message.contains(&format!("{:.3e}", -balance)) && message.contains("shorten time.step"), "{message}");
    Ok(())
}

/// A block of height L between a soft floor with the stiffness s (Λ + 2G)/h and a wall that moves down by δ is δ h/(h + s L) deep in the floor.
#[test]
fn a_body_deep_in_an_obstacle_is_told_beyond_a_quarter_of_a_spacing() -> Result<(), Failure> {
    for (parts, is_told) in [(0.24, false), (0.26, true)] {
        let (h, stiffness) = (0.25, 0.05);
        let moved = -parts * (h + stiffness);
        let (_, warned, report) = ran(&json!({
            "grid": {"size": [2, 1.5], "spacing": h}, "time": {"step": 0.25, "end": 1, "scheme": "none"}, "output": {},
            "bodies": [{"name": "block", "density": 1, "shape": {"box": {"min": [0, 0.5], "max": [2, 1.5]}},
                        "material": {"neo_hookean": {"young": 1000, "poisson": 0}}}],
            "boundary": {"left": "sliding", "right": "sliding", "top": {"displacement": [[0, [null, 0]], [1, [null, moved]]]}},
            "obstacles": [{"name": "floor", "stiffness": stiffness, "shape": {"half_space": {"point": [0, 0.500001], "normal": [0, 1]}}}]
        }))?;
        let depth = report["obstacles"][0]["largest_depth"].as_f64().ok_or("no depth")?;
        assert!((depth / (parts * h) - 1.0).abs() < 0.02, "{depth}");
        assert_eq!(kinds(&report).contains(&"obstacle_deep".into()), is_told, "{warned}");
    }
    Ok(())
}

/// The kinds of the warnings of a report.
fn kinds(report: &Value) -> Vec<Value> {
    report["warnings"].as_array().into_iter().flatten().map(|one| one["kind"].clone()).collect()
}

/// Two blocks of height L together, whose contact has the stiffness s (Λ + 2G)/h, between a wall and one that moves by δ: one is
/// δ h/(h + s L) deep in the other.
#[test]
fn a_body_deep_in_another_one_is_told_beyond_a_quarter_of_a_spacing() -> Result<(), Failure> {
    let block = |name: &str, low: f64, high: f64| {
        json!({"name": name, "density": 1, "shape": {"box": {"min": [0, low], "max": [2, high]}},
               "material": {"neo_hookean": {"young": 1000, "poisson": 0}}})
    };
    for (parts, is_told) in [(0.24, false), (0.26, true)] {
        let (h, stiffness) = (0.25, 0.05);
        let moved = -parts * (h + 1.5 * stiffness);
        let (_, warned, report) = ran(&json!({
            "grid": {"size": [2, 1.5], "spacing": h}, "time": {"step": 0.25, "end": 1, "scheme": "none"}, "output": {},
            "bodies": [block("lower", 0.0, 0.75), block("upper", 0.75, 1.5)],
            "boundary": {"left": "sliding", "right": "sliding", "bottom": "sliding",
                         "top": {"displacement": [[0, [null, 0]], [1, [null, moved]]]}},
            "contact": {"stiffness": stiffness}
        }))?;
        let depth = report["pairs"][0]["largest_depth"].as_f64().ok_or("no depth")?;
        assert!((depth / (parts * h) - 1.0).abs() < 0.02, "{depth}");
        assert_eq!(kinds(&report).contains(&"obstacle_deep".into()), is_told, "{warned}");
    }
    Ok(())
}

/// A block slides faster and faster, so that kinetic energy and friction loss are largest at the end.
#[test]
fn a_loss_is_a_part_of_the_energy_with_what_friction_took() -> Result<(), Failure> {
    let square = solid("square", 1000, json!({"box": {"min": [0.5, 0.55], "max": [1, 1.05]}}));
    let (_, warned, report) = ran(&json!({
        "grid": {"size": [6, 2], "spacing": 0.125}, "time": {"step": 0.01, "end": 0.6}, "output": {},
        "bodies": [merged(square, json!({"velocity": [0, -0.5]}))],
        "obstacles": [{"name": "floor", "friction": 0.5, "shape": {"half_space": {"point": [0, 0.5], "normal": [0, 1]}}}],
        "gravity": {"acceleration": [6, -10]}
    }))?;
    let energy = |name: &str| report["energies"][name].as_f64().ok_or(name.to_owned());
    let (total, friction) = (energy("kinetic")? + energy("strain")? + energy("dissipated")?, energy("dissipated")?);
    let message = report["warnings"].as_array().and_then(|all| all.last()).and_then(|last| last["message"].as_str());
    let message = message.filter(|text| text.starts_with("energy was lost")).ok_or(warned)?;
    let number = |from: &str, to: &str| -> Result<f64, Failure> {
        let (_, rest) = message.split_once(from).ok_or("no number")?;
        Ok(rest.split(to).next().unwrap_or_default().parse()?)
    };
    let (lost, largest) = (number("took: ", ",")?, number("largest total energy ", ";")?);
    let percent: f64 =
        message.split(" %").next().and_then(|text| text.rsplit(", ").next()).ok_or("no percents")?.parse()?;
    // The block bounces a little, so that its energy is not the largest in the very last step.
    assert!(friction > 0.3 * total && largest > 0.999 * total && largest < 1.05 * total, "{total}: {message}");
    assert!(
        (lost + energy("balance")?).abs() < 1e-3 * lost && (100.0 * lost / largest - percent).abs() < 0.06,
        "{message}"
    );
    Ok(())
}

/// Two blocks with the distance `gap`. They start with velocities that separate them, or that make them collide.
fn blocks(gap: f64, apart: f64) -> Value {
    let block = |name: &str, y: f64, v: f64| {
        let shape = json!({"box": {"min": [2, y], "max": [6, y + 2.0]}});
        merged(solid(name, 100, shape), json!({"velocity": [0, v]}))
    };
    json!({"grid": {"size": [8, 10], "spacing": 0.5}, "time": {"step": 0.02, "end": 0.6}, "output": {},
           "bodies": [block("lower", 2.0, -apart), block("upper", 4.0 + gap, apart)]})
}

#[test]
fn bodies_that_are_glued_say_so() -> Result<(), Failure> {
    let (said, warned, report) = ran(&blocks(0.0, 0.5))?;
    let words = "\"lower\" and \"upper\" share nodes since the start and are pulled apart";
    assert!([words, "0.00 spacings", "will not separate"].iter().all(|word| warned.contains(word)), "{warned}");
    assert!(said.contains("contact   \"lower\" and \"upper\" share nodes since t = 0"), "{said}");
    let contact = &report["contact"][0];
    assert_eq!((&contact["bodies"][1], &contact["from_start"]), (&"upper".into(), &true.into()));
    assert!(contact["until"].is_null(), "{contact}");
    assert!(contact["pulled_apart"].as_f64().is_some_and(|time| time < 0.1), "{report}");
    // Blocks pressed together are in contact, which causes no warning.
    let mut pressed = blocks(0.0, -0.5);
    pressed["time"]["end"] = 0.2.into();
    let (_, warned, report) = ran(&pressed)?;
    assert!(!warned.contains("pulled apart") && report["contact"][0]["pulled_apart"].is_null(), "{warned}");
    // Blocks far apart share no nodes.
    let (said, _, report) = ran(&blocks(3.0, 0.1))?;
    assert!(!said.contains("contact") && report["contact"] == json!([]), "{said}");
    Ok(())
}

#[test]
fn check_says_which_bodies_are_glued_from_the_start() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("scene.json");
    for (gap, glued) in [(0.0, true), (3.0, false)] {
        std::fs::write(&path, blocks(gap, 0.0).to_string())?;
        let (code, said, _) = check(&path, &[])?;
        let words = "\"lower\" and \"upper\" share nodes at the start, at a gap of 0.00 spacings";
        assert!(code == Some(0) && said.contains(words) == glued, "{said}");
    }
    Ok(())
}

#[test]
fn the_summary_of_a_plastic_block_balances_its_energy_and_counts_its_warnings() -> Result<(), Failure> {
    let (said, warned, report) = ran(&json!({
        "grid": {"size": [4, 3], "spacing": 0.5}, "time": {"step": 0.1, "end": 1, "scheme": "none"}, "output": {},
        "bodies": [{"name": "block", "density": 1, "shape": {"box": {"min": [0, 0], "max": [2, 2]}},
                    "material": {"von_mises": {"elastic": {"young": 100, "poisson": 0.3}, "yield_stress": {"initial": 0.1, "linear": 10}}}}],
        "boundary": {"left": "sliding", "bottom": "sliding"},
        "tractions": [{"body": "block", "region": {"half_space": {"point": [2, 0], "normal": [-1, 0]}}, "traction": [0.4, 0],
                       "curve": [[0, 0], [1, 1]]}]
    }))?;
    let energy = |name: &str| report["energies"][name].as_f64().ok_or(name.to_owned());
    let (strain, work, laws) = (energy("strain")?, energy("external")?, energy("dissipated_by_laws")?);
    assert!(laws > 5.0 * strain && (work / (strain + laws) - 1.0).abs() < 0.02, "{strain} {work} {laws}");
    assert!(said.contains(&format!("(by laws {laws:.6e})")), "{said}");
    assert!(warned.contains("warning: body \"block\" flows without a change of volume"), "{warned}");
    assert!(said.contains("warnings  ") && said.contains("report.json"), "{said}");
    assert!(report["scene_warnings"][0].as_str().is_some_and(|text| text.contains("mean_dilatation")), "{report}");
    Ok(())
}
