//! The key `accuracy`: the values it sets, the values it leaves, and the values it refuses.

use crate::support::{self, Failure, said};
use bfree::scene::accuracy::levels;
use bfree::scene::{self, Scene};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

/// A block of 1 × 0.5 on a floor, without any setting; c = √(12/3) = 2.
fn open_scene() -> Value {
    json!({
        "grid": { "size": [2, 1] },
        "time": { "end": 1 },
        "bodies": [{
            "name": "block", "shape": { "box": { "min": [0.5, 0], "max": [1.5, 0.5] } }, "density": 3,
            "material": { "neo_hookean": { "lambda": 4, "shear": 4 } },
        }],
        "boundary": { "bottom": "sliding" },
        "gravity": { "acceleration": [0, -1] },
    })
}

fn read(scene: &Value) -> Result<Scene, Failure> {
    Ok(scene::read(&scene.to_string(), &[])?)
}

fn with(changes: &[(&str, Value)]) -> Value {
    support::with(open_scene(), changes)
}

#[test]
fn each_word_sets_what_its_row_of_the_table_says() -> Result<(), Failure> {
    for level in levels() {
        let asked = level.name.map_or(json!({ "error": level.error }), |name| name.into());
        let scene = read(&with(&[("/accuracy", asked)]))?;
        // The smallest extent is 0.5; the box and the block allow h = 0.5/n.
        let cells = 0.5 / scene.grid.spacing;
        assert!(cells >= level.cells - 1e-9 && cells < level.cells + 1.0 + 1e-9, "{cells} cells for {level:?}");
        let courant = 2.0 * scene.time.step / scene.grid.spacing;
        assert!(courant <= level.courant * (1.0 + 1e-12) && courant > 0.8 * level.courant, "{courant} for {level:?}");
        let steps = scene.time.end / scene.time.step;
        assert!((steps - steps.round()).abs() < 1e-9, "{steps} steps");
        let written = serde_json::to_value(&scene)?;
        let open = ["grid.spacing=0.5".parse()?, "time.step=1".parse()?];
        let default = serde_json::to_value(scene::read(&open_scene().to_string(), &open)?)?;
        let lumping = level.lumping.map_or_else(|| default["time"]["lumping"].clone(), Value::from);
        assert_eq!(written["time"]["lumping"], lumping);
        match level.gamma {
            Some(gamma) => assert_eq!(written["approximation"]["lme"]["gamma"], gamma),
            None => assert_eq!(written["approximation"], default["approximation"]),
        }
        assert_eq!(written["solver"]["newton"]["tolerance"], level.tolerance);
        assert_eq!(scene.bodies[0].particles_per_cell, level.particles_per_cell);
        // The settings that `accuracy` reports, given by hand, make the same scene.
        assert!(!scene.chosen.is_empty());
        let set = scene.chosen.iter().map(|chosen| format!("{}={}", chosen.key, chosen.value).parse());
        let given = scene::read(&open_scene().to_string(), &set.collect::<Result<Vec<_>, _>>()?)?;
        assert_eq!(Scene { accuracy: None, chosen: Vec::new(), ..scene }, given);
    }
    Ok(())
}

/// A template with its own settings takes at least as many steps as the same template as a draft, which chooses spacing and step.
#[test]
fn a_draft_takes_no_more_steps_than_the_templates() -> Result<(), Failure> {
    let dynamic = [
        "rebound",
        "collision",
        "cantilever",
        "compaction",
        "riemann_jump",
        "ball_drop",
        "taylor",
        "collapse",
        "bounce",
        "rolling",
    ];
    for name in dynamic {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.json"));
        let text = std::fs::read_to_string(&path)?;
        let own = scene::read(&text, &[])?;
        let mut open: Value = serde_json::from_str(&text)?;
        open["accuracy"] = "draft".into();
        open["grid"].as_object_mut().ok_or("an object")?.remove("spacing");
        open["time"].as_object_mut().ok_or("an object")?.remove("step");
        let draft = read(&open)?;
        let [own_steps, steps] = [&own, &draft].map(|scene| (scene.time.end / scene.time.step - 1e-9).ceil());
        assert!(steps <= own_steps, "{name}: {steps} steps, {own_steps} of its own");
        // No value that `draft` sets adds a linear system to a step.
        assert_eq!((own.time.lumping, &own.approximation), (draft.time.lumping, &draft.approximation), "{name}");
    }
    Ok(())
}

#[test]
fn it_yields_to_every_key_that_is_given() -> Result<(), Failure> {
    let given = with(&[
        ("/accuracy", "reference".into()),
        ("/grid/spacing", 0.25.into()),
        ("/time/step", 0.1.into()),
        ("/time/lumping", 1.into()),
        ("/approximation", "linear".into()),
        ("/solver", json!({ "newton": { "tolerance": 1e-3 } })),
        ("/bodies/0/particles_per_cell", 1.into()),
    ]);
    let scene = read(&given)?;
    assert_eq!(scene.chosen, []);
    let mut without = given;
    without["accuracy"] = Value::Null;
    assert_eq!(Scene { accuracy: None, ..scene }, read(&without)?);

    // Each key given alone, from the text or from an override; the step then follows the given spacing.
    let scene = scene::read(&with(&[("/accuracy", "draft".into())]).to_string(), &["grid.spacing=0.125".parse()?])?;
    assert_eq!(scene.grid.spacing, 0.125);
    assert!(scene.chosen.iter().all(|chosen| chosen.key != "grid.spacing"));
    let draft = levels()[0];
    assert!((scene.time.step - 1.0 / (1.0 / (draft.courant * 0.125 / 2.0)).ceil()).abs() < 1e-12);
    Ok(())
}

#[test]
fn what_it_cannot_choose_is_told() -> Result<(), Failure> {
    let draft = || ("/accuracy", Value::from("draft"));
    let steel = ("/bodies/0/material", json!({ "neo_hookean": { "young": -1, "poisson": 0.3 } }));
    let from_file = json!([{ "name": "cloud", "particles": { "file": "cloud.csv" }, "density": 1,
        "material": { "neo_hookean": { "lambda": 4, "shear": 4 } } }]);
    let odd = ("/grid/size", json!([2, std::f64::consts::SQRT_2]));
    let cases: [(Value, &[&str]); 8] = [
        (with(&[("/accuracy", "fine".into())]), &["accuracy", "unknown variant `fine`", "`draft`"]),
        (with(&[("/accuracy", json!({ "error": 7 }))]), &["accuracy.error", "7 is not allowed", "between"]),
        (with(&[("/accuracy", json!({ "error": -0.01 }))]), &["accuracy.error", "-0.01 is not allowed"]),
        (with(&[draft(), odd]), &["accuracy", "divides every edge", "give grid.spacing"]),
        (with(&[draft(), ("/bodies", from_file)]), &["accuracy", "\"cloud\"", "file", "give grid.spacing"]),
        (with(&[draft(), steel]), &["accuracy", "\"block\"", "speed of sound", "give time.step"]),
        (with(&[draft(), ("/bodies/0/shape/box/max", json!([0.1, 0.5]))]), &["accuracy", "\"block\" has no extent"]),
        (open_scene(), &["missing field `spacing`"]),
    ];
    for (scene, words) in cases {
        let error = read(&scene).map(|_| ()).unwrap_err().to_string();
        for word in words {
            assert!(error.contains(word), "no {word:?} in {error}");
        }
    }
    Ok(())
}

#[test]
fn without_inertia_it_sets_nothing_that_needs_it() -> Result<(), Failure> {
    let of_steps = |time: Value| with(&[("/accuracy", "standard".into()), ("/time", time)]);
    let scene = read(&of_steps(json!({ "end": 1, "step": 0.5, "scheme": "none" })))?;
    let keys: Vec<_> = scene.chosen.iter().map(|chosen| chosen.key.as_str()).collect();
    assert_eq!(keys, ["solver.newton.tolerance", "bodies.0.particles_per_cell", "grid.spacing"]);
    let error = read(&of_steps(json!({ "end": 1, "scheme": "none" }))).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("load steps") && error.contains("give time.step"), "{error}");
    Ok(())
}

/// Runs the program in a folder. Returns its exit code and what it said.
fn program(arguments: &[&str], folder: &Path) -> Result<(Option<i32>, String), Failure> {
    let mut program = Command::new(env!("CARGO_BIN_EXE_bfree"));
    let (code, out, err) = said(program.args(arguments).current_dir(folder))?;
    Ok((code, out + &err))
}

#[test]
fn check_run_and_report_show_it_and_a_restart_holds_it() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let scene = with(&[("/accuracy", "draft".into()), ("/output", json!({ "checkpoint": 0.1 }))]);
    std::fs::write(folder.path().join("block.json"), scene.to_string())?;
    let (_, text) = program(&["check", "block.json"], folder.path())?;
    assert!(text.contains("\"draft\" sets ") && text.contains("grid.spacing = 0."), "{text}");
    let (code, text) = program(&["run", "block.json", "--steps", "2", "--out", "out", "--plot"], folder.path())?;
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("accuracy \"draft\" sets ") && text.contains("time.step = 0."), "{text}");
    let report: Value = serde_json::from_slice(&std::fs::read(folder.path().join("out/report.json"))?)?;
    assert_eq!((&report["accuracy"]["asked"], &report["settings"]["accuracy"]), (&json!("draft"), &json!("draft")));
    let keys: Vec<_> = report["accuracy"]["sets"].as_array().into_iter().flatten().map(|set| &set["key"]).collect();
    assert!(keys.contains(&&json!("grid.spacing")) && !keys.contains(&&json!("time.lumping")), "{report}");
    assert!(std::fs::read_to_string(folder.path().join("out/report.html"))?.contains("What the accuracy has set"));

    let other = ["run", "block.json", "--out", "out", "--restart", "--set", "accuracy=standard"];
    let (code, text) = program(&other, folder.path())?;
    assert!(code == Some(2) && text.contains("accuracy was \"draft\" and is \"standard\""), "{text}");
    let (code, text) = program(&["run", "block.json", "--out", "out", "--restart", "--steps", "4"], folder.path())?;
    assert_eq!(code, Some(0), "{text}");
    Ok(())
}
