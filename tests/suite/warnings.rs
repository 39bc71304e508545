//! The warnings of `bfree check` and of the start of a run, with numbers.

use crate::support::{self, Failure, merged, shipped, solid};
use bfree::mechanics::reference::GridReset;
use bfree::scene;
use serde_json::{Value, json};
use std::path::Path;

/// The warnings about a 2D scene with these bodies. Its functions are linear, and its grid has 8 × 8 cells of 1.
fn warnings(bodies: Value, more: Value, folder: &Path) -> Result<Vec<String>, Failure> {
    let text = json!({
        "grid": {"size": [8, 8], "spacing": 1}, "time": {"step": 0.1, "end": 1}, "approximation": "linear", "bodies": bodies
    });
    let scene = scene::read(&merged(text, more).to_string(), &[])?;
    Ok(scene.warnings(&scene.build::<2>(folder)?))
}

fn block(name: &str, min: [f64; 2], max: [f64; 2]) -> Value {
    solid(name, 100, json!({"box": {"min": min, "max": max}}))
}

fn file(name: &str, file: &str) -> Value {
    json!({"name": name, "particles": {"file": file}, "density": 1, "material": {"neo_hookean": {"young": 100, "poisson": 0.3}}})
}

/// Exactly one warning contains all the words.
fn assert_one(warnings: &[String], words: &[&str]) {
    let all = |text: &&String| words.iter().all(|word| text.contains(word));
    assert_eq!(warnings.iter().filter(all).count(), 1, "{words:?}: {warnings:?}");
}

#[test]
fn bodies_that_overlap_are_named_with_particles_and_volume() -> Result<(), Failure> {
    let nowhere = Path::new(".");
    let bodies = |x: f64| json!([block("a", [1.0, 1.0], [4.0, 4.0]), block("b", [x, 2.0], [x + 3.0, 5.0])]);
    let found = warnings(bodies(3.0), json!({}), nowhere)?;
    // One cell wide, two high: 8 particles of each body in the same places.
    assert_one(&found, &["\"a\" and \"b\" overlap: 16 particles", "volume of 2.0000e0"]);
    assert_one(&found, &["8 particles lie at the place of another one: at (3.25, 2.25)", "…"]);
    assert_eq!(found.len(), 2, "{found:?}");
    // The bodies lie side by side.
    assert_eq!(warnings(bodies(4.0), json!({}), nowhere)?, Vec::<String>::new());
    // Round bodies that touch in a point.
    let ball = |name: &str, x: f64| solid(name, 100, json!({"ball": {"center": [x, 4.1], "radius": 1.3}}));
    assert_eq!(warnings(json!([ball("a", 2.0), ball("b", 4.6)]), json!({}), nowhere)?, Vec::<String>::new());
    Ok(())
}

#[test]
fn particles_of_a_file_at_one_place_or_in_another_body_are_named() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let rows: String = (0..36)
        .map(|i| format!("{},{},0.25\n", 1.25 + 0.5 * f64::from(i % 6), 1.25 + 0.5 * f64::from(i / 6)))
        .collect();
    std::fs::write(folder.path().join("p.csv"), format!("x,y,volume\n{rows}2.25,1.75,0.25\n"))?;
    let found = warnings(json!([file("a", "p.csv")]), json!({}), folder.path())?;
    assert_one(&found, &["1 particles lie at the place of another one: at (2.25, 1.75); they move as one"]);
    assert_eq!(found.len(), 1, "{found:?}");
    let found = warnings(json!([file("a", "p.csv"), block("b", [3.0, 1.0], [6.0, 4.0])]), json!({}), folder.path())?;
    assert_one(&found, &["\"a\" and \"b\" overlap: 12 particles", "volume of 3.0000e0"]);
    Ok(())
}

#[test]
fn a_body_of_less_than_two_cells_is_named_with_its_thickness() -> Result<(), Failure> {
    let nowhere = Path::new(".");
    let thick =
        |thickness: f64| warnings(json!([block("plate", [1.0, 2.0], [7.0, 2.0 + thickness])]), json!({}), nowhere);
    assert_one(&thick(1.0)?, &["\"plate\" is about 1.000e0 thick", "1.00 cells"]);
    assert_eq!(thick(2.0)?, Vec::<String>::new());
    // The warning names the thickness of the ring's wall, not the diameter of the ring.
    let disc = |radius: f64| json!({"ball": {"center": [4, 4], "radius": radius}});
    let ring = json!([solid("ring", 100, json!({"difference": {"of": disc(3.5), "minus": disc(2.7)}}))]);
    assert_one(&warnings(ring, json!({}), nowhere)?, &["\"ring\" is about", "cells"]);
    let folder = tempfile::tempdir()?;
    std::fs::write(folder.path().join("p.csv"), "x,y,volume\n1.25,1.25,0.25\n1.75,1.25,0.25\n2.25,1.25,0.25\n")?;
    assert_one(
        &warnings(json!([file("bar", "p.csv")]), json!({}), folder.path())?,
        &["\"bar\" is about 5.000e-1 thick", "0.50 cells"],
    );
    Ok(())
}

#[test]
fn a_mass_that_misses_the_shape_by_a_percent_is_said() -> Result<(), Failure> {
    let nowhere = Path::new(".");
    let mut disc = solid("disc", 100, json!({"ball": {"center": [4, 4], "radius": 2.2}}));
    disc["fill"] = "cells".into();
    // The centres of 16 cells lie in the circle, whose area is 15.2.
    assert_one(
        &warnings(json!([disc]), json!({}), nowhere)?,
        &["\"disc\" has the volume 16.000000", "+5.2 % off", "bodies[0].fill \"cut\""],
    );
    disc["fill"] = "cut".into();
    assert_eq!(warnings(json!([disc]), json!({}), nowhere)?, Vec::<String>::new());
    Ok(())
}

#[test]
fn a_prescribed_region_between_nodes_is_named() -> Result<(), Failure> {
    let region = |x: f64| {
        json!({"prescribed": [{"region": {"box": {"min": [0, 0], "max": [8, 8]}}, "velocity": [[0, [0, null]]]},
                              {"region": {"box": {"min": [x, 0.1], "max": [x + 0.5, 8]}}, "velocity": [[0, [0, 0]]]}]})
    };
    let bodies = json!([block("a", [1.0, 1.0], [4.0, 4.0])]);
    let found = warnings(bodies.clone(), region(3.2), Path::new("."))?;
    assert_one(&found, &["prescribed[1].region holds no node of the grid"]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(warnings(bodies.clone(), region(2.7), Path::new("."))?, Vec::<String>::new());
    let beside = json!({"initial_velocity": {"nodes": [{"region": {"box": {"min": [1.1, 1.1], "max": [1.9, 1.9]}}, "velocity": [1, 0]},
                                                       {"region": {"box": {"min": [9, 9], "max": [10, 10]}}, "velocity": [1, 0]}]}});
    let found = warnings(bodies, beside, Path::new("."))?;
    assert_one(&found, &["initial_velocity.nodes[0].region holds no node", "make it larger"]);
    assert_one(&found, &["initial_velocity.nodes[1].region holds no node", "outside of the grid"]);
    Ok(())
}

#[test]
fn a_body_that_locks_is_named_with_its_number_and_its_cure() -> Result<(), Failure> {
    let nowhere = Path::new(".");
    let of = |material: Value, more: Value| {
        let body = merged(block("a", [1.0, 1.0], [4.0, 4.0]), json!({"material": material}));
        warnings(json!([merged(body, more)]), json!({}), nowhere)
    };
    let rubber = |poisson: f64| json!({"neo_hookean": {"young": 100, "poisson": poisson}});
    let mean = json!({"volumetric": "mean_dilatation"});
    let cure = "bodies[0].volumetric = \"mean_dilatation\"";
    assert_one(&of(rubber(0.4999), json!({}))?, &["\"a\" hardly changes its volume", "0.499900", cure]);
    assert_one(&of(rubber(0.45), json!({}))?, &["0.450000"]);
    for (material, more) in [(rubber(0.449), json!({})), (rubber(0.4999), mean.clone())] {
        assert_eq!(of(material, more)?, Vec::<String>::new());
    }
    let metal = json!({"von_mises": {"elastic": {"young": 100, "poisson": 0.3}, "yield_stress": {"initial": 1}}});
    assert_one(&of(metal.clone(), json!({}))?, &["flows without a change of volume", "0.300000", cure]);
    assert_eq!(of(metal, mean)?, Vec::<String>::new());
    // A law without a volumetric part needs another remedy.
    let other = json!({"st_venant_kirchhoff": {"young": 100, "poisson": 0.49}});
    assert_one(&of(other, json!({}))?, &["0.490000", "take \"neo_hookean\" with that"]);
    Ok(())
}

#[test]
fn deprecated_keys_are_read_and_named() -> Result<(), Failure> {
    let body = || json!([block("a", [1.0, 1.0], [4.0, 4.0])]);
    let grid = json!({"size": [8, 8], "spacing": 1, "renewed": "never"});
    for (key, given, cure) in [
        ("ghost_stiffness", json!({"ghost_stiffness": 0.001}), "aggregation"),
        ("solver.krylov.precision", json!({"solver": {"krylov": {"precision": "double"}}}), "Remove the key"),
        ("solver.krylov.precision", json!({"solver": {"krylov": {"precision": "mixed"}}}), "Remove the key"),
        ("time.inertia", json!({"time": {"step": 0.1, "end": 1, "inertia": "newmark"}}), "time.scheme"),
        ("grid.renewed", json!({"grid": grid}), "grid.reset"),
    ] {
        let found = warnings(body(), given, Path::new("."))?;
        assert_eq!(found.len(), 1, "{found:?}");
        assert_one(&found, &[key, cure]);
    }
    assert_eq!(warnings(body(), json!({}), Path::new("."))?, Vec::<String>::new());
    assert_eq!(
        support::scene::<2>("rebound.json", &[r#"grid.renewed="never""#])?.settings.grid_reset,
        GridReset::Never
    );
    // `time.inertia` selects the scheme, unless `time.scheme` is given.
    for (inertia, has_inertia) in
        [(r#""none""#, false), (r#""newmark","scheme":"none""#, false), (r#""newmark""#, true)]
    {
        let time = format!(r#"time={{"step":0.25,"end":1,"inertia":{inertia}}}"#);
        assert_eq!(support::scene::<2>("cook.json", &[&time])?.settings.scheme.has_inertia(), has_inertia, "{time}");
    }
    Ok(())
}

#[test]
fn narrow_obstacles_and_seams_are_named() -> Result<(), Failure> {
    let of = |obstacles: Value| {
        warnings(json!([block("a", [2.0, 4.0], [5.0, 7.0])]), json!({ "obstacles": obstacles }), Path::new("."))
    };
    let rect = |min: [f64; 2], max: [f64; 2]| json!({ "box": { "min": min, "max": max } });
    let (left, right) = (rect([0.0, 1.0], [4.0, 2.0]), rect([4.0, 0.0], [8.0, 2.5]));
    let union = |parts: [&Value; 2]| json!([{ "name": "floor", "shape": { "union": parts } }]);
    assert_one(&of(union([&left, &right]))?, &["parts of obstacle \"floor\" touch along a face at [4.0, 1.5]"]);
    let apart = json!([{ "name": "l", "shape": left }, { "name": "r", "shape": right }]);
    assert_one(&of(apart)?, &["obstacles [\"l\", \"r\"] touch along a face", "one union"]);
    // Parts that overlap, that touch at a corner or in a point, and obstacles that move.
    let disc = |x: f64| json!({ "ball": { "center": [x, 2.0], "radius": 1.0 } });
    let moving = json!([{ "name": "l", "shape": left }, { "name": "r", "shape": right, "velocity": [[0, [0, 0.1]]] }]);
    for sound in [
        union([&rect([0.0, 1.0], [4.5, 2.0]), &right]),
        union([&rect([0.0, 1.0], [4.0, 2.0]), &rect([4.0, 2.0], [8.0, 3.0])]),
        union([&disc(2.0), &disc(4.0)]),
        moving,
    ] {
        assert_eq!(of(sound)?, Vec::<String>::new());
    }
    let pin = |width: f64| json!([{ "name": "pin", "shape": rect([4.0, 0.0], [4.0 + width, 3.0]) }]);
    assert_one(&of(pin(0.4))?, &["obstacles[0] is 4.000e-1 wide", "5.000e-1 apart", "the run ends"]);
    assert_eq!(of(pin(0.5))?, Vec::<String>::new());
    Ok(())
}

#[test]
fn shipped_scenes_are_sound_and_have_nothing_to_warn_of() -> Result<(), Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut names = Vec::new();
    for path in shipped()? {
        let scene = scene::read_file(&path, &[])?;
        let found = match scene.dimension() {
            1 => scene.warnings(&scene.build::<1>(&folder)?),
            2 => scene.warnings(&scene.build::<2>(&folder)?),
            _ => scene.warnings(&scene.build::<3>(&folder)?),
        };
        assert_eq!(found, Vec::<String>::new(), "{}", path.display());
        assert!(scene.title.is_some(), "{}", path.display());
        names.push(path.file_stem().ok_or("no name")?.to_string_lossy().into_owned());
    }
    assert_eq!(
        names.join(" "),
        "ball_drop billiard block_static bounce cantilever collapse collision column_static compaction compaction_confined cook cook_plastic \
         elastica foam punch rebound rebound_fast riemann riemann_jump ring rings rolling slope taylor tube wedge"
    );
    Ok(())
}
