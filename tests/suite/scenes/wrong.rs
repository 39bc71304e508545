//! Every value that a scene may not have, with the place of its refusal and words of the message.

use super::{GOOD, good_on_nodes};
use bfree::scene::{self, Place, SceneError};

/// (text of the good scene, its replacement, the key to be named, words of the message)
const WRONG_VALUES: &[(&str, &str, &str, &[&str])] = &[
    (r#""aggregation": true"#, r#""ghost_stiffness": -1"#, "ghost_stiffness", &["-1 is not", "0", "1"]),
    (r#""along": [0, 2]"#, r#""along": [0, 0]"#, "gravity.profile.along", &["zero vector", "direction"]),
    (r#""along": [0, 2]"#, r#""along": [1]"#, "gravity.profile.along", &["length 1", "2 components"]),
    ("[4, 0.5]", "[0, 0.5]", "gravity.profile.factor[1][0]", &["0 is not", "row before, 0"]),
    ("[4, 2]", "[]", "grid.size", &["length 0", "1, 2 or 3"]),
    ("[4, 2]", "[4, 2, 2, 2]", "grid.size", &["length 4", "1, 2 or 3"]),
    ("[4, 2]", "[4.2, 2]", "grid.size[0]", &["4.2", "multiple of the spacing 0.5", "such as 4"]),
    ("[4, 2]", "[4, -2]", "grid.size[1]", &["-2", "> 0"]),
    (r#""spacing": 0.5"#, r#""spacing": 0"#, "grid.spacing", &["0 is not", "> 0"]),
    ("[4, 2]", "[1e7, 2]", "grid.size[0]", &["1e7 is not", "at a spacing of 0.5", "2e7 cells", "at most 1e6"]),
    (r#""origin": [0, 0]"#, r#""origin": [0]"#, "grid.origin", &["length 1", "2 components"]),
    (r#""origin": [0, 0]"#, r#""origin": [0, -1e300]"#, "grid.origin[1]", &["-1e300", "1e100"]),
    (
        r#""origin": [0, 0]"#,
        r#""origin": [0, 1e16]"#,
        "grid.origin[1]",
        &["1e16", "too coarse to tell nodes 0.5 apart", "at most 2.25"],
    ),
    (r#""gamma": 3"#, r#""gamma": 11.1"#, "approximation.lme.gamma", &["11.1", "less than 11.0524"]),
    (r#""gamma": 3"#, r#""gamma": 0"#, "approximation.lme.gamma", &["0 is not", "between 0.1 and 1000"]),
    (
        r#""tolerance": 1e-6"#,
        r#""tolerance": 2"#,
        "approximation.lme.tolerance",
        &["2 is not", "between 1e-16 and 0.01"],
    ),
    (
        r#"{ "lme": { "gamma": 3, "tolerance": 1e-6, "support": "circle" } }"#,
        r#"{ "bspline": { "degree": 7 } }"#,
        "approximation.bspline.degree",
        &["7", "from 2 to 3"],
    ),
    (
        r#"{ "lme": { "gamma": 3, "tolerance": 1e-6, "support": "circle" } }"#,
        r#""gimp""#,
        "bodies[1].particles_per_cell",
        &["2 is not", "must be 3"],
    ),
    (r#""step": 0.01"#, r#""step": -1"#, "time.step", &["-1", "> 0"]),
    (r#""step": 0.01"#, r#""step": 1e-12"#, "time.step", &["1e-12", "1e12 steps", "at most 1e9"]),
    (r#""end": 1"#, r#""end": 0.001"#, "time.end", &["0.001", "at least one step, 0.01"]),
    (r#""beta": 0.25"#, r#""beta": 0.2"#, "time.beta", &["0.2", "gamma/2 = 0.25"]),
    (r#""gamma": 0.5"#, r#""gamma": 0.4"#, "time.gamma", &["0.4", "between 0.5"]),
    (r#""lumping": 0.5"#, r#""lumping": 1.5"#, "time.lumping", &["1.5", "between 0 and 1"]),
    (r#""rate": 5"#, r#""rate": 0"#, "transfer.blend.rate", &["0 is not", "> 0"]),
    (r#""order": 2"#, r#""order": 0"#, "transfer.blend.order", &["0 is not", "1 to 20"]),
    (
        r#"{ "blend": { "order": 2, "rate": 5 } }"#,
        r#"{ "pic": { "order": 21 } }"#,
        "transfer.pic.order",
        &["21", "1 to 20"],
    ),
    (
        r#"{ "blend": { "order": 2, "rate": 5 } }"#,
        r#"{ "limited": { "rate": -1 } }"#,
        "transfer.limited.rate",
        &["-1 is not", "> 0"],
    ),
    (r#""max_halvings": 3"#, r#""max_halvings": 21"#, "time.max_halvings", &["21", "0 to 20"]),
    (r#""name": "stiff""#, r#""name": """#, "bodies[1].name", &["empty"]),
    (r#""name": "stiff""#, r#""name": "soft""#, "bodies[1].name", &["soft", "differ"]),
    (r#""density": 2"#, r#""density": -4"#, "bodies[0].density", &["-4", "finite and > 0"]),
    (r#""poisson": 0.3"#, r#""poisson": 0.5"#, "bodies[0].material.neo_hookean.poisson", &["0.5", "< 0.5"]),
    (r#""young": 100"#, r#""young": 0"#, "bodies[0].material.neo_hookean.young", &["0 is not", "> 0"]),
    (r#""lambda": 1000"#, r#""lambda": -400"#, "bodies[1].material.st_venant_kirchhoff.lambda", &["-400", "-333.33"]),
    (
        r#""lambda": 1000"#,
        r#""lambda": 1000, "bulk": 1"#,
        "bodies[1].material.st_venant_kirchhoff",
        &["lambda with shear with bulk", "exactly one of the pairs"],
    ),
    (r#""young": 100, "#, "", "bodies[0].material.neo_hookean", &["poisson", "exactly one of the pairs"]),
    (r#""young": 100, "poisson": 0.3"#, "", "bodies[0].material.neo_hookean", &["nothing", "exactly one of the pairs"]),
    (r#""bulk": 10"#, r#""bulk": -1"#, "bodies[2].material.neo_hookean_logarithmic.bulk", &["-1", "> 0"]),
    (r#""velocity": [1, 0], "#, r#""velocity": [1, 0, 0], "#, "bodies[0].velocity", &["length 3", "2 components"]),
    (
        r#""particles_per_cell": 3"#,
        r#""particles_per_cell": 0"#,
        "bodies[0].particles_per_cell",
        &["0 is not", "1 to 100"],
    ),
    (
        r#""max": [1, 1] } }, "minus""#,
        r#""max": [1, 0] } }, "minus""#,
        "bodies[0].shape.difference.of.box.max[1]",
        &["0 is not", "greater than min[1] = 0"],
    ),
    (
        r#""max": [1, 1] } }, "minus""#,
        r#""max": [1, 2.5] } }, "minus""#,
        "bodies[0].shape",
        &["y = 0 to 2.5", "grid, from y = 0 to 2"],
    ),
    (r#""radius": 0.2"#, r#""radius": 0"#, "bodies[0].shape.difference.minus.ball.radius", &["0 is not", "> 0"]),
    ("[-1, 0]", "[0, 0]", "bodies[1].shape.intersection[0].half_space.normal", &["zero vector"]),
    (
        r#"{ "union": [{ "box": { "min": [2, 0], "max": [4, 2] } }, "#,
        r#"{ "union": [] }, { "union": [ "#,
        "bodies[1].shape.intersection[1].union",
        &["empty", "at least one"],
    ),
    (r#""particles": { "file": "grains.csv" }, "#, "", "bodies[2]", &["neither shape nor particles"]),
    (
        r#""density": 8"#,
        r#""density": 8, "particles": { "file": "a.csv" }"#,
        "bodies[1]",
        &["both shape and particles"],
    ),
    (r#""left": "sliding""#, r#""back": "sliding""#, "boundary.back", &["2 dimension"]),
    ("[true, false]", "[true]", "boundary.top.held", &["length 1", "2 components"]),
    (
        "[2, [0, null]]",
        "[2, [0, 1]]",
        "boundary.right.velocity[1][1][1]",
        &["1 is not", "null in every row or in none"],
    ),
    (
        "[[0, [-1, null]], [2, [0, null]]]",
        "[[0, [null, null]]]",
        "boundary.right.velocity[0][1]",
        &["at least one component"],
    ),
    ("[2, [0, null]]", "[0, [0, null]]", "boundary.right.velocity[1][0]", &["greater than in the row before, 0"]),
    ("[0, [0, null]]", "[0, [0.3, null]]", "prescribed[0].displacement[0][1][0]", &["0.3", "must be 0"]),
    ("[0, [0, null]]", "[0.2, [0, null]]", "prescribed[0].displacement[0][0]", &["0.2", "must be 0"]),
    (
        r#""displacement": [[0, [0, null]], [1, [0.1, null]]]"#,
        r#""displacement": []"#,
        "prescribed[0].displacement",
        &["empty"],
    ),
    (
        r#", "displacement": [[0, [0, null]], [1, [0.1, null]]]"#,
        "",
        "prescribed[0]",
        &["a region alone", "give its displacement, its velocity or its rotation"],
    ),
    ("[0, -9.81]", "[-9.81]", "gravity.acceleration", &["length 1", "2 components"]),
    ("[[0, 0], [1, 1]]", "[]", "gravity.curve", &["empty"]),
    (
        "[[0, 0], [1, 1]]",
        "[[0, 0], [1, 1], [0.5, 1]]",
        "gravity.curve[2][0]",
        &["0.5", "greater than in the row before, 1"],
    ),
    (r#""body": "soft""#, r#""body": "sft""#, "tractions[0].body", &["sft", "did you mean \"soft\""]),
    (r#""normal": [0, 1]"#, r#""normal": [0, 0]"#, "pressures[0].surface.normal", &["zero vector"]),
    (r#""area": 0.1"#, r#""area": -0.1"#, "pressures[0].surface.area", &["-0.1", "> 0"]),
    (
        r#""surface": { "normal": [0, 1], "area": 0.1 }, "#,
        "",
        "pressures[0].surface",
        &["needed for a body read from a file"],
    ),
    ("[10, 0]", "[10]", "initial_velocity.nodes[0].velocity", &["length 1"]),
    (r#""tolerance": 1e-10"#, r#""tolerance": 0"#, "solver.newton.tolerance", &["0 is not", "between 1e-15 and 0.1"]),
    (r#""restart": 50"#, r#""restart": 0"#, "solver.krylov.method.gmres.restart", &["0 is not", "1 to 1000"]),
    (r#"{ "gmres": { "restart": 50 } }"#, r#""conjugate_gradient""#, "solver.krylov.method", &["pressures", "gmres"]),
    (r#""fixed": 1e-7"#, r#""fixed": 1"#, "solver.krylov.forcing.fixed", &["1 is not", "0.9"]),
    (r#""every": 0.1"#, r#""every": 0"#, "output.every", &["0 is not", "> 0"]),
    (r#""checkpoint": 0.2"#, r#""checkpoint": 0"#, "output.checkpoint", &["0 is not", "> 0"]),
    (r#"["velocity", "stress"]"#, r#"["stress", "stress"]"#, "output.fields[1]", &["once", "stress, given before"]),
    (r#""name": "mid""#, r#""name": "tip""#, "output.probes[1].name", &["differ"]),
    // tip is a stress: its columns are tip_xx, tip_yy, …
    (
        r#""name": "mid", "field": "velocity""#,
        r#""name": "tip_xx", "field": "jacobian""#,
        "output.probes[1].name",
        &["tip_xx", "already has a column"],
    ),
    (
        r#""name": "mid", "field": "velocity""#,
        r#""name": "time", "field": "jacobian""#,
        "output.probes[1].name",
        &["already has a column \"time\""],
    ),
    (
        r#""solver":"#,
        r#""initial_velocity": { "nodes": [{ "region": { "ball": { "center": [1, 1], "radius": 1 } }, "velocity": [10, 0] }] }, "solver":"#,
        "bodies[0].velocity",
        &["[1.0, 0.0]", "initial_velocity", "remove one"],
    ),
    (r#""name": "mid""#, r#""name": "../mid""#, "output.probes[1].name", &["file name"]),
    (
        r#""point": [2, 1]"#,
        r#""point": [2, 2.5]"#,
        "output.probes[1].at.point",
        &["[2.0, 2.5]", "must lie in the grid"],
    ),
    (r#""point": [2, 1]"#, r#""point": [2]"#, "output.probes[1].at.point", &["length 1"]),
];

/// (text of the good scene, its replacement, the place to be named, words of the message), for text that is no scene at all.
const WRONG_TEXT: &[(&str, &str, &str, &[&str])] = &[
    (
        r#""density": 2"#,
        r#""densty": 2"#,
        "bodies[0].densty",
        &["unknown field", "did you mean `density`", "`velocity`"],
    ),
    (r#""density": 2"#, r#""density": "heavy""#, "bodies[0].density", &["string \"heavy\"", "a number"]),
    (r#""density": 2"#, r#""density": null"#, "bodies[0].density", &["null", "a number"]),
    (r#""density": 2"#, r#""density": 2, "density": 3"#, "bodies[0]", &["`density` is given twice"]),
    (r#""density": 2"#, r#""density": 1e400"#, "bodies[0].density", &["number out of range"]),
    (r#""density": 2"#, r#""density": NaN"#, "bodies[0].density", &["JSON has no NaN"]),
    (r#", "density": 2"#, "", "bodies[0]", &["missing field `density`"]),
    (r#""title""#, r#""titel""#, "titel", &["did you mean `title`"]),
    (r#""left": "sliding""#, r#""left": "slding""#, "boundary.left", &["unknown variant", "did you mean `sliding`"]),
    (
        r#""ball": { "center": [0.5"#,
        r#""sphere": { "center": [0.5"#,
        "bodies[0].shape.difference.minus",
        &["unknown variant", "`ball`"],
    ),
    (r#"{ "ball": { "center": [4, 2], "radius": 0.6 } }"#, "{}", "prescribed[0].region", &["exactly one key"]),
    (r#""max_halvings": 3"#, r#""max_halvings": -3"#, "time.max_halvings", &["-3", "whole number"]),
    (r#""max_halvings": 3"#, r#""max_halvings": 2.5"#, "time.max_halvings", &["2.5", "whole number"]),
    ("[0, -9.81]", "9.81", "gravity.acceleration", &["a list"]),
    (r#"{ "normal": [0, 1], "area": 0.1 }"#, "[[0, 1], 0.1]", "pressures[0].surface", &["a list, expected an object"]),
    (r#""sliding""#, r#"{ "sliding": null }"#, "boundary.left", &["an object, expected a word"]),
    ("[[0, 0], [1, 1]]", "[[0, 0], [1]]", "gravity.curve[1]", &["length 1"]),
    (r#""title": "two blocks","#, "// two blocks", "", &["JSON has no comments"]),
    (
        r#""mid", "field": "velocity", "at": { "point": [2, 1] } }] }"#,
        r#""mid", "field": "velocity""#,
        "",
        &["EOF while parsing"],
    ),
];

fn mutated(from: &str, to: &str) -> String {
    let good = if GOOD.contains(from) { GOOD.to_owned() } else { good_on_nodes() };
    assert!(good.contains(from), "the good scene has no {from}");
    good.replacen(from, to, 1)
}

#[test]
fn wrong_values_are_named_with_what_is_allowed() {
    for (from, to, path, words) in WRONG_VALUES {
        let error = scene::read(&mutated(from, to), &[]).expect_err(to);
        let SceneError::Values(problems) = &error else { panic!("{to}: {error}") };
        let named = problems.list.iter().find(|problem| problem.path == *path);
        let Some(problem) = named else { panic!("{to}: no problem at {path} in\n{error}") };
        let message = problem.to_string();
        assert!(message.starts_with(&format!("{path}: ")), "{message}");
        for word in *words {
            assert!(message.contains(word), "{to}: no {word:?} in\n{message}");
        }
        assert!(matches!(problem.place, Some(Place::Text { .. })), "{to}: no place");
        assert_eq!(problems.list.len(), 1, "{to}: more than was wrong:\n{error}");
    }
}

#[test]
fn wrong_text_is_refused_at_its_place() {
    for (from, to, path, words) in WRONG_TEXT {
        let text = mutated(from, to);
        let error = scene::read(&text, &[]).expect_err(to);
        let SceneError::Malformed(problems) = &error else { panic!("{to}: {error}") };
        let malformed = &problems.list[0];
        assert!(path.is_empty() || malformed.path == *path, "{to}: {path} expected, not {}", malformed.path);
        for word in *words {
            assert!(malformed.message.contains(word), "{to}: no {word:?} in\n{error}");
        }
        let Some(Place::Text { line, excerpt, .. }) = &malformed.place else { panic!("{to}: no place") };
        let there = text.lines().nth(line - 1).unwrap();
        assert!(there.contains(excerpt.as_str()), "{to}: line {line} has no {excerpt:?}");
        if !path.is_empty() {
            let changed = text[..GOOD.find(from).unwrap()].matches('\n').count() + 1;
            assert!(line.abs_diff(changed) <= 1, "{to}: line {line} instead of {changed}");
        }
    }
}
