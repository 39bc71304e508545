//! Scenes: the shipped ones are valid, wrong ones are refused with a helpful message, and no text makes the reader panic.

mod random;
mod wrong;

use crate::support::{built, with};
use bfree::material::{Lame, NeoHookean};
use bfree::particles::Particles;
use bfree::plan::Plan;
use bfree::scene::{self, Override, Scene, SceneError};
use bfree::shape::fill;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Every kind of key at least once. Each wrong scene is this one with one word replaced.
const GOOD: &str = r#"{
  "title": "two blocks",
  "grid": { "origin": [0, 0], "size": [4, 2], "spacing": 0.5 },
  "approximation": { "lme": { "gamma": 3, "tolerance": 1e-6, "support": "circle" } },
  "time": { "step": 0.01, "end": 1, "beta": 0.25, "gamma": 0.5, "lumping": 0.5, "initial_guess": "velocity", "projection": "affine", "wall_update": "consistent", "max_halvings": 3 }, "transfer": { "blend": { "order": 2, "rate": 5 } },
  "bodies": [
    { "name": "soft", "shape": { "difference": { "of": { "box": { "min": [0, 0], "max": [1, 1] } }, "minus": { "ball": { "center": [0.5, 0.5], "radius": 0.2 } } } },
      "material": { "neo_hookean": { "young": 100, "poisson": 0.3 } }, "density": 2, "velocity": [1, 0], "particles_per_cell": 3, "fill": "cells" },
    { "name": "stiff", "shape": { "intersection": [{ "half_space": { "point": [3, 0], "normal": [-1, 0] } }, { "union": [{ "box": { "min": [2, 0], "max": [4, 2] } }, { "rotated": { "of": { "polygon": [[2, 0.5], [3, 0.5], [2.5, 1]] }, "about": [2.5, 1], "angle": 30 } }, { "scaled": { "of": { "cylinder": { "from": [3, 0.5], "to": [3, 1.5], "radius": 0.2 } }, "about": [3, 1], "factor": 0.5 } }, { "cone": { "from": [3, 0.5], "to": [3.5, 1], "radii": [0.2, 0] } }] }] },
      "material": { "st_venant_kirchhoff": { "lambda": 1000, "shear": 500 } }, "density": 8 },
    { "name": "grains", "particles": { "file": "grains.csv" }, "material": { "neo_hookean_logarithmic": { "bulk": 10, "shear": 1 } }, "density": 1, "particles_per_cell": 3 }
  ],
  "boundary": { "left": "sliding", "bottom": "fixed", "top": { "held": [true, false] }, "right": { "velocity": [[0, [-1, null]], [2, [0, null]]] } },
  "prescribed": [{ "region": { "ball": { "center": [4, 2], "radius": 0.6 } }, "displacement": [[0, [0, null]], [1, [0.1, null]]] }],
  "aggregation": true, "gravity": { "acceleration": [0, -9.81], "curve": [[0, 0], [1, 1]], "profile": { "along": [0, 2], "factor": [[0, 1], [4, 0.5]] } },
  "tractions": [{ "body": "soft", "traction": [0, 5], "curve": [[0, 1]] }],
  "pressures": [{ "body": "grains", "pressure": 7, "surface": { "normal": [0, 1], "area": 0.1 }, "region": { "box": { "min": [0, 1], "max": [1, 2] } } }],
  "solver": { "newton": { "tolerance": 1e-10, "max_iterations": 20 }, "krylov": { "method": { "gmres": { "restart": 50 } }, "forcing": { "fixed": 1e-7 }, "max_iterations": 500 } },
  "output": { "every": 0.1, "checkpoint": 0.2, "fields": ["velocity", "stress"], "probes": [{ "name": "tip", "field": "stress", "body": "soft", "at": { "particle": [3.9, 1] } }, { "name": "mid", "field": "velocity", "at": { "point": [2, 1] } }] }
}"#;

/// The same scene with velocities given to nodes, so that no body has one.
fn good_on_nodes() -> String {
    let nodes = r#""initial_velocity": { "nodes": [{ "region": { "box": { "min": [0, 0], "max": [1, 1] } }, "velocity": [10, 0] }] }"#;
    GOOD.replace(r#""velocity": [1, 0], "#, "").replace(r#""solver""#, &format!(r#"{nodes}, "solver""#))
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn refusal(text: &str) -> String {
    scene::read(text, &[]).expect_err(text).to_string()
}

fn overridden(arguments: &[&str]) -> Result<Scene, SceneError> {
    let overrides: Result<Vec<Override>, _> = arguments.iter().map(|argument| argument.parse()).collect();
    scene::read(GOOD, &overrides?)
}

/// Grid and number of particles of the first body of a shipped scene.
fn filled<const D: usize>(name: &str) -> (bfree::grid::Grid<D>, usize) {
    let scene = scene::read_file(&folder("scenes").join(name), &[]).unwrap();
    let (grid, body) = (scene.grid.build::<D>().unwrap(), &scene.bodies[0]);
    let shape = body.shape.as_ref().and_then(|shape| shape.build()).unwrap();
    let particles = fill(&grid, &shape, scene.filling(body)).unwrap();
    (grid, particles.len())
}

#[test]
fn shipped_scenes_have_the_published_sizes() {
    assert_eq!(filled::<2>("rebound.json").1, 112);
    let (grid, particles) = filled::<2>("compaction.json");
    assert_eq!((grid.cells, particles), ([20, 15], 400));
    assert_eq!(filled::<2>("compaction_confined.json").0.cells, [10, 15]);
    let (grid, particles) = filled::<1>("riemann.json");
    assert_eq!((grid.cells, particles), ([1000], 4000));
    assert!((4600..6000).contains(&filled::<3>("ball_drop.json").1));
    // Paper: Λ = 150 from K = 170 and G = 30
    let rebound = scene::read_file(&folder("scenes").join("rebound.json"), &[]).unwrap();
    let law = rebound.bodies[0].material.law(&mut scene::Problems::default(), "material");
    assert_eq!(law, Some(NeoHookean::ciarlet(Lame { lambda: 150.0, shear: 30.0 }).into()));
    assert_eq!((rebound.time.end / rebound.time.step).round(), 1600.0);
}

#[test]
fn a_scene_too_large_for_the_memory_is_refused() {
    let scene = scene::read_file(&folder("scenes").join("compaction.json"), &[]).unwrap();
    let simulation = scene.build::<2>(&folder("scenes")).unwrap();
    let plan = Plan::of(&simulation).unwrap();
    // The memory check precedes the allocation of the particles. It accepts a limit below the bytes of the whole plan.
    let least = 3 * 400 * Particles::<2>::BYTES as u64;
    assert!(least < plan.bytes());
    assert!(scene.build_within::<2>(&folder("scenes"), least).is_ok());
    let refused = scene.build_within::<2>(&folder("scenes"), least - 1).err().map(|error| error.to_string());
    let refused = refused.unwrap_or_default();
    assert!(refused.starts_with("bodies[0].shape: 400 particles so far need at least 84.38 KiB"), "{refused}");
    assert!(plan.check_fits(plan.bytes()).is_ok());
    let refused = plan.check_fits(plan.bytes() - 1).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(refused.contains("solver.krylov.method"), "{refused}");
}

#[test]
fn the_good_scene_is_good_and_defaults_are_the_documented_ones() {
    for good in [GOOD.to_owned(), good_on_nodes()] {
        scene::read(&good, &[]).unwrap_or_else(|error| panic!("{error}"));
    }
    let least = r#"{"grid": {"size": [1], "spacing": 0.1}, "time": {"step": 1, "end": 1},
        "bodies": [{"name": "a", "shape": {"half_space": {"point": [0.5], "normal": [1]}},
                    "material": {"neo_hookean": {"bulk": 1, "shear": 1}}, "density": 1}]}"#;
    let scene = scene::read(least, &[]).unwrap_or_else(|error| panic!("{error}"));
    let all = least.replacen('{', r#"{"approximation": {"bspline": {"degree": 3}},
        "transfer": "flip", "boundary": {}, "prescribed": [], "tractions": [], "pressures": [],
        "solver": {"newton": {"tolerance": 1e-9, "max_iterations": 30},
                   "krylov": {"method": "automatic", "max_iterations": 2000}},
        "output": {"fields": ["displacement", "velocity", "stress", "jacobian"], "probes": []}, "#, 1)
        .replace(r#""end": 1"#, r#""end": 1, "beta": 0.25, "gamma": 0.5, "lumping": 1, "initial_guess": "zero", "projection": "mass", "wall_update": "literal", "max_halvings": 10"#)
        .replace(r#""density": 1"#, r#""density": 1, "particles_per_cell": 2, "fill": "cut", "layout": "regular""#);
    assert_eq!(scene, scene::read(&all, &[]).unwrap_or_else(|error| panic!("{error}")));
    for (short, long) in [
        ("bspline={}", r#"bspline={"degree": 3}"#),
        ("lme={}", r#"lme={"gamma": 3, "tolerance": 1e-6, "support": "separable"}"#),
    ] {
        let with = |family: &str| scene::read(least, &[format!("approximation.{family}").parse().unwrap()]);
        assert_eq!(with(short).unwrap(), with(long).unwrap());
    }
    // A scene that is written can be read again, unchanged.
    let written = serde_json::to_string(&scene).unwrap();
    assert_eq!(scene, scene::read(&written, &[]).unwrap_or_else(|error| panic!("{error}")));
}

#[test]
fn the_message_shows_line_column_and_caret() {
    let message = refusal(&GOOD.replace(r#""density": 8"#, r#""density": -8"#));
    let expected = r#"bodies[1].density: -8 is not allowed; must be finite and > 0
  --> line 10, column 80"#;
    assert!(message.starts_with(expected), "{message}");
    let lines: Vec<&str> = message.lines().collect();
    assert_eq!(lines[2].find("\"density\""), lines[3].find('^'), "{message}");
}

/// A unit block in a box of 2 × 2 (× 2), with cells of ½, everything in multiples of `length`.
fn block(dimension: usize, length: f64) -> Value {
    let corner = |x: f64| vec![x * length; dimension];
    json!({
        "grid": {"size": corner(2.0), "spacing": 0.5 * length},
        "time": {"step": 1, "end": 1},
        "bodies": [{"name": "block", "shape": {"box": {"min": corner(0.5), "max": corner(1.5)}}, "density": 1,
                    "material": {"neo_hookean": {"young": 1000, "poisson": 0.25}}}]
    })
}

/// The strain energy after three steps of a block on the floor, under gravity, in these units of length, mass and time.
fn energy_in_units(length: f64, mass: f64, time: f64, scheme: &str) -> f64 {
    let scene = json!({
        "grid": {"size": [4.0 * length, 4.0 * length], "spacing": length},
        "time": {"step": 0.1 * time, "end": 0.3 * time, "scheme": scheme},
        "gravity": {"acceleration": [0, -0.3 * length / time / time]}, "boundary": {"bottom": "fixed"},
        "bodies": [{"name": "block", "density": mass / length / length,
                    "shape": {"box": {"min": [length, 0], "max": [3.0 * length, 2.0 * length]}},
                    "material": {"neo_hookean": {"young": 10.0 * mass / time / time, "poisson": 0.3}}}]
    });
    let mut simulation = built::<2>(&scene).unwrap();
    (0..3).for_each(|_| drop(simulation.advance().unwrap()));
    simulation.strain_energy() / (mass * length * length / time / time)
}

/// Forces are from 1e-170 to 1e170, so their squares underflow or overflow.
#[test]
fn extreme_units_change_no_result() {
    for scheme in ["newmark", "none"] {
        let one = energy_in_units(1.0, 1.0, 1.0, scheme);
        for [length, mass, time] in [[1e-40, 1.0, 1.0], [1e-80, 1e-90, 1.0], [1e80, 1e90, 1.0], [1e-50, 1e-20, 1e40]] {
            let other = energy_in_units(length, mass, time, scheme);
            assert!((other / one - 1.0).abs() < 1e-12, "{scheme}, {length:e}, {mass:e}, {time:e}: {other} for {one}");
        }
    }
}

/// A block whose masses, forces or energies are beyond floating point has no answer, and says so in its first step at the latest.
#[test]
fn numbers_that_do_not_fit_are_an_error() {
    for (length, key, value) in [
        (1e-75, "/bodies/0/density", json!(1e-99)),
        (1.0, "/bodies/0/velocity", json!([0, 1e70, 0])),
        (1.0, "/gravity", json!({"acceleration": [0, 1e99, 0], "curve": [[0, 1e50]]})),
        (1.0, "/tractions", json!([{"body": "block", "traction": [0, 1e90, 0], "curve": [[0, -1e50]]}])),
    ] {
        let Ok(mut simulation) = built::<3>(&with(block(3, length), &[(key, value)])) else { continue };
        let moved = simulation.advance();
        assert!(moved.is_err(), "{key}: {:?}", simulation.particles.position[0]);
    }
}

#[test]
fn every_face_of_a_box_is_loaded_with_its_whole_area() -> Result<(), Box<dyn std::error::Error>> {
    let pressed = |dimension: usize, region: Value| {
        with(block(dimension, 1.0), &[("/pressures", json!([{"body": "block", "pressure": 1, "region": region}]))])
    };
    // The whole surface: the perimeter of the unit square, 2 particles per cell and 4 along each side.
    let points = built::<2>(&pressed(2, Value::Null))?.loads.surface.remove(0).points;
    assert_eq!(points.len(), 4 * 4);
    assert_eq!(points.iter().map(|point| point.area).sum::<f64>(), 4.0);
    assert!(points.iter().all(|point| point.normal.amax() == 1.0));
    let points = built::<3>(&pressed(3, Value::Null))?.loads.surface.remove(0).points;
    assert_eq!((points.len(), points.iter().map(|point| point.area).sum::<f64>()), (6 * 16, 6.0));
    // The top alone, with a region that begins at it. A region that reaches further down also contains a part of the sides.
    let top = json!({"half_space": {"point": [0, 1.5], "normal": [0, -1]}});
    let points = built::<2>(&pressed(2, top))?.loads.surface.remove(0).points;
    assert_eq!((points.len(), points.iter().map(|point| point.area).sum::<f64>()), (4, 1.0));
    assert!(points.iter().all(|point| point.normal[1] == 1.0));
    let below = json!({"box": {"min": [0, 1.4], "max": [2, 1.5]}});
    let points = built::<2>(&pressed(2, below))?.loads.surface.remove(0).points;
    assert!(points.len() == 6 && (points.iter().map(|point| point.area).sum::<f64>() - 1.2).abs() < 1e-12);
    Ok(())
}

#[test]
fn velocities_of_a_file_and_of_nodes_exclude_each_other() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let everywhere = json!({"half_space": {"point": [9, 9], "normal": [1, 0]}});
    let scene = with(
        block(2, 1.0),
        &[
            ("/initial_velocity", json!({"nodes": [{"region": everywhere, "velocity": [1, 0]}]})),
            ("/bodies/0/shape", Value::Null),
            ("/bodies/0/particles", json!({"file": "p.csv"})),
        ],
    );
    let scene = scene::read(&scene.to_string(), &[])?;
    std::fs::write(folder.path().join("p.csv"), "x,y,volume\n1,1,0.1\n")?;
    assert!((scene.build::<2>(folder.path())?.particles.velocity[0][0] - 1.0).abs() < 1e-12);
    std::fs::write(folder.path().join("p.csv"), "x,y,volume,vx,vy\n1,1,0.1,3,4\n")?;
    let error = scene.build::<2>(folder.path()).expect_err("two velocities").to_string();
    assert!(error.contains("bodies[0].particles.file") && error.contains("initial_velocity"), "{error}");
    Ok(())
}

#[test]
fn all_wrong_values_are_told_at_once() {
    let text = GOOD.replace(r#""density": 8"#, r#""density": -8"#).replace(r#""step": 0.01"#, r#""step": 0"#);
    let Err(SceneError::Values(problems)) = scene::read(&text, &[]) else { panic!("accepted") };
    let paths: Vec<&str> = problems.list.iter().map(|problem| problem.path.as_str()).collect();
    assert_eq!(paths, ["time.step", "bodies[1].density"]);
    // ten thousand wrong rows do not make ten thousand messages
    let rows = vec!["[0, 0]"; 10_000].join(", ");
    let text = GOOD.replace("[[0, 0], [1, 1]]", &format!("[{rows}]"));
    let Err(SceneError::Values(problems)) = scene::read(&text, &[]) else { panic!("accepted") };
    assert_eq!(problems.list.len() + problems.more, 9_999);
    assert!(problems.list.len() <= 50);
}

#[test]
fn all_wrong_keys_and_types_are_told_at_once() {
    let text = GOOD
        .replace(r#""density": 2"#, r#""densty": 2"#)
        .replace(r#""left": "sliding""#, r#""left": "slding", "uper": 1"#)
        .replace(r#""step": 0.01, "#, "")
        .replace(r#""max_halvings": 3"#, r#""max_halvings": -3"#)
        .replace(r#""ball": { "center": [0.5"#, r#""bal": { "center": [0.5"#)
        .replace(r#""particles_per_cell": 3, "fill""#, r#""particles_per_cell": "three", "fill""#)
        .replace(r#""acceleration": [0, -9.81]"#, r#""acceleration": {"y": -9.81}"#);
    let message = refusal(&text);
    for words in [
        "bodies[0].densty: unknown field `densty`",
        "did you mean `density`?",
        "bodies[0]: missing field `density`",
        "boundary.left: unknown variant `slding`",
        "did you mean `sliding`?",
        "boundary.uper: unknown field `uper`",
        "time: missing field `step`",
        "time.max_halvings: invalid",
        "bodies[0].shape.difference.minus: unknown variant `bal`",
        "did you mean `ball`?",
        "bodies[0].particles_per_cell: invalid type: string \"three\", expected a whole number",
        "gravity.acceleration: invalid type: an object, expected a list",
    ] {
        assert_eq!(message.matches(words).count(), 1, "{words}\n{message}");
    }
    // Each message has its place in the file, and nothing else.
    assert_eq!(message.matches("--> line").count(), 9, "{message}");
    let SceneError::Malformed(problems) = scene::read(&text, &[]).expect_err("wrong") else { panic!("{message}") };
    assert_eq!(problems.list.len(), 9, "{message}");
}

#[test]
fn every_key_of_the_good_scene_is_documented_once() {
    let keys = scene::keys::documented(&serde_json::from_str(GOOD).unwrap());
    let paths: Vec<&str> = keys.iter().map(|key| key.path.as_str()).collect();
    for path in [
        "bodies[].density",
        "bodies[].shape.difference.of.box",
        "bodies[].fill = \"cells\"",
        "boundary.left = \"sliding\"",
        "boundary.right.velocity",
        "time.lumping",
        "solver.krylov.forcing.fixed",
        "gravity.curve",
        "output.probes[].at.particle",
    ] {
        assert_eq!(paths.iter().filter(|one| **one == path).count(), 1, "{path} in {paths:?}");
    }
    assert!(keys.iter().all(|key| !key.about.is_empty()));
}

#[test]
fn overrides_replace_add_and_are_named() {
    let scene =
        overridden(&["time.step=0.02", "bodies.0.density=3", "bodies[1].density=4", "approximation=linear"]).unwrap();
    assert_eq!((scene.time.step, scene.bodies[0].density, scene.bodies[1].density), (0.02, 3.0, 4.0));
    assert_eq!(scene.approximation, bfree::approximation::Parameters::Linear);
    let held = r#"boundary.left={"held": [true, true]}"#;
    let scene = overridden(&["bodies.1.velocity=[1, 2]", "bodies.1.velocity.0=5", held]).unwrap();
    assert_eq!(scene.bodies[1].velocity, Some(vec![5.0, 2.0]));

    for (argument, words) in [
        ("time.step=-1", &["time.step: -1 is not allowed", "in the override time.step=-1"][..]),
        ("time.stp=1", &["time.stp: unknown field", "did you mean `step`", "in the override time.stp=1"]),
        ("gravty.acceleration=[0,1]", &["gravty: unknown field", "did you mean `gravity`", "in the override"]),
        ("time.step=abc", &["time.step: invalid type: string \"abc\", expected a number", "in the override"]),
        ("time={\"step\": 1}", &["time: missing field `end`", "in the override time="]),
        ("bodies.7.density=1", &["bodies has 3 entries", "7 is not one of them"]),
        ("bodies.density=1", &["bodies is a list of 3 entries", "takes a number"]),
        ("time.0=1", &["time is an object", "takes a key"]),
        ("time.step.x=1", &["time.step is a number, which has no keys"]),
        ("time.step", &["must read KEY.PATH=JSON"]),
        ("=1", &["must read KEY.PATH=JSON"]),
        ("time.step=1e400", &["not JSON", "number out of range"]),
        ("time={\"step\": 1, \"step\": 2}", &["not JSON", "given twice"]),
        ("time.step=[1", &["not JSON", "EOF"]),
    ] {
        let error = overridden(&[argument]).expect_err(argument).to_string();
        for word in words {
            assert!(error.contains(word), "{argument}: no {word:?} in\n{error}");
        }
    }
}

#[test]
fn text_that_is_too_long_too_deep_or_no_object_is_refused() {
    assert!(matches!(scene::read(&" ".repeat(scene::MAX_BYTES as usize + 1), &[]), Err(SceneError::TooLong(_))));
    assert!(refusal(&"[".repeat(100_000)).contains("recursion limit"));
    let nested = format!("{}{}{}", r#"{"union": ["#.repeat(1000), "1", "]}".repeat(1000));
    let deep = GOOD.replace(r#"{ "ball": { "center": [4, 2], "radius": 0.6 } }"#, &nested);
    assert!(refusal(&deep).contains("recursion limit"));
    for text in ["", "[]", "7", "null", "\u{feff}", "\"{}\""] {
        refusal(text);
    }
    assert!(refusal("[1, 2]").contains("a scene is an object"));
    assert!(matches!(scene::read_file(Path::new("/nowhere/scene.json"), &[]), Err(SceneError::File { .. })));
    scene::read(&format!("\u{feff}{GOOD}"), &[]).unwrap();
}

#[test]
fn the_schema_is_up_to_date_and_documents_every_key() {
    let schema = scene::schema().to_value();
    let path = folder("schemas").join("scene.schema.json");
    if std::env::var_os("BFREE_WRITE_SCHEMA").is_some() {
        std::fs::write(&path, serde_json::to_string_pretty(&schema).unwrap() + "\n").unwrap();
    }
    let stored: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(stored, schema, "renew it: BFREE_WRITE_SCHEMA=1 cargo test --release --test suite schema");

    let types = schema["$defs"].as_object().unwrap().iter().map(|(name, schema)| (name.as_str(), schema));
    for (name, schema) in types.chain([("Scene", &schema)]) {
        assert!(schema["description"].is_string(), "{name} is not documented");
        for (key, property) in schema["properties"].as_object().into_iter().flatten() {
            assert!(property["description"].is_string(), "{name}.{key} is not documented");
        }
        for variant in schema["oneOf"].as_array().into_iter().flatten() {
            assert!(variant["description"].is_string(), "{name}: {variant} is not documented");
        }
    }
}
