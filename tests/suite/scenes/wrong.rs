//! Every value that a scene may not have, with the place of its refusal and words of the message.

use super::{GOOD, good_on_nodes};
use crate::support::{assert_refused, cases};
use bfree::scene::{self, Place, SceneError};

/// One case a row: text of the good scene => its replacement | the key to be named | words of the message.
const WRONG_VALUES: &str = r##"
"aggregation": true => "ghost_stiffness": -1 | ghost_stiffness | -1 is not | 0 | 1
"along": [0, 2] => "along": [0, 0] | gravity.profile.along | zero vector | direction
"along": [0, 2] => "along": [1] | gravity.profile.along | length 1 | 2 components
[4, 0.5] => [0, 0.5] | gravity.profile.factor[1][0] | 0 is not | row before, 0
[4, 2] => [] | grid.size | length 0 | 1, 2 or 3
[4, 2] => [4, 2, 2, 2] | grid.size | length 4 | 1, 2 or 3
[4, 2] => [4.2, 2] | grid.size[0] | 4.2 | multiple of the spacing 0.5 | such as 4
[4, 2] => [4, -2] | grid.size[1] | -2 | > 0
"spacing": 0.5 => "spacing": 0 | grid.spacing | 0 is not | > 0
[4, 2] => [1e7, 2] | grid.size[0] | 1e7 is not | at a spacing of 0.5 | 2e7 cells | at most 1e6
"origin": [0, 0] => "origin": [0] | grid.origin | length 1 | 2 components
"origin": [0, 0] => "origin": [0, -1e300] | grid.origin[1] | -1e300 | 1e100
"origin": [0, 0] => "origin": [0, 1e16] | grid.origin[1] | 1e16 | too coarse to tell nodes 0.5 apart | at most 2.25
"gamma": 3 => "gamma": 11.1 | approximation.lme.gamma | 11.1 | less than 11.0524
"gamma": 3 => "gamma": 0 | approximation.lme.gamma | 0 is not | between 0.1 and 1000
"tolerance": 1e-6 => "tolerance": 2 | approximation.lme.tolerance | 2 is not | between 1e-16 and 0.01
{ "lme": { "gamma": 3, "tolerance": 1e-6, "support": "circle" } } => { "bspline": { "degree": 7 } } | approximation.bspline.degree | 7 | from 2 to 3
{ "lme": { "gamma": 3, "tolerance": 1e-6, "support": "circle" } } => "gimp" | bodies[1].particles_per_cell | 2 is not | must be 3
"step": 0.01 => "step": -1 | time.step | -1 | > 0
"step": 0.01 => "step": 1e-12 | time.step | 1e-12 | 1e12 steps | at most 1e9
"end": 1 => "end": 0.001 | time.end | 0.001 | at least one step, 0.01
"beta": 0.25 => "beta": 0.2 | time.beta | 0.2 | gamma/2 = 0.25
"gamma": 0.5 => "gamma": 0.4 | time.gamma | 0.4 | between 0.5
"lumping": 0.5 => "lumping": 1.5 | time.lumping | 1.5 | between 0 and 1
"rate": 5 => "rate": 0 | transfer.blend.rate | 0 is not | > 0
"order": 2 => "order": 0 | transfer.blend.order | 0 is not | 1 to 20
{ "blend": { "order": 2, "rate": 5 } } => { "pic": { "order": 21 } } | transfer.pic.order | 21 | 1 to 20
{ "blend": { "order": 2, "rate": 5 } } => { "limited": { "rate": -1 } } | transfer.limited.rate | -1 is not | > 0
"max_halvings": 3 => "max_halvings": 21 | time.max_halvings | 21 | 0 to 20
"name": "stiff" => "name": "" | bodies[1].name | empty
"name": "stiff" => "name": "soft" | bodies[1].name | soft | differ
"density": 2 => "density": -4 | bodies[0].density | -4 | finite and > 0
"poisson": 0.3 => "poisson": 0.5 | bodies[0].material.neo_hookean.poisson | 0.5 | < 0.5
"young": 100 => "young": 0 | bodies[0].material.neo_hookean.young | 0 is not | > 0
"lambda": 1000 => "lambda": -400 | bodies[1].material.st_venant_kirchhoff.lambda | -400 | -333.33
"lambda": 1000 => "lambda": 1000, "bulk": 1 | bodies[1].material.st_venant_kirchhoff | lambda with shear with bulk | exactly one of the pairs
"young": 100,  =>  | bodies[0].material.neo_hookean | poisson | exactly one of the pairs
"young": 100, "poisson": 0.3 =>  | bodies[0].material.neo_hookean | nothing | exactly one of the pairs
"bulk": 10 => "bulk": -1 | bodies[2].material.neo_hookean_logarithmic.bulk | -1 | > 0
"velocity": [1, 0],  => "velocity": [1, 0, 0],  | bodies[0].velocity | length 3 | 2 components
"particles_per_cell": 3 => "particles_per_cell": 0 | bodies[0].particles_per_cell | 0 is not | 1 to 100
"max": [1, 1] } }, "minus" => "max": [1, 0] } }, "minus" | bodies[0].shape.difference.of.box.max[1] | 0 is not | greater than min[1] = 0
"max": [1, 1] } }, "minus" => "max": [1, 2.5] } }, "minus" | bodies[0].shape | y = 0 to 2.5 | grid, from y = 0 to 2
"radius": 0.2 => "radius": 0 | bodies[0].shape.difference.minus.ball.radius | 0 is not | > 0
[-1, 0] => [0, 0] | bodies[1].shape.intersection[0].half_space.normal | zero vector
{ "union": [{ "box": { "min": [2, 0], "max": [4, 2] } },  => { "union": [] }, { "union": [  | bodies[1].shape.intersection[1].union | empty | at least one
"particles": { "file": "grains.csv" },  =>  | bodies[2] | neither shape nor particles
"density": 8 => "density": 8, "particles": { "file": "a.csv" } | bodies[1] | both shape and particles
"left": "sliding" => "back": "sliding" | boundary.back | 2 dimension
[true, false] => [true] | boundary.top.held | length 1 | 2 components
[2, [0, null]] => [2, [0, 1]] | boundary.right.velocity[1][1][1] | 1 is not | null in every row or in none
[[0, [-1, null]], [2, [0, null]]] => [[0, [null, null]]] | boundary.right.velocity[0][1] | at least one component
[2, [0, null]] => [0, [0, null]] | boundary.right.velocity[1][0] | greater than in the row before, 0
[0, [0, null]] => [0, [0.3, null]] | prescribed[0].displacement[0][1][0] | 0.3 | must be 0
[0, [0, null]] => [0.2, [0, null]] | prescribed[0].displacement[0][0] | 0.2 | must be 0
"displacement": [[0, [0, null]], [1, [0.1, null]]] => "displacement": [] | prescribed[0].displacement | empty
, "displacement": [[0, [0, null]], [1, [0.1, null]]] =>  | prescribed[0] | a region alone | give its displacement, its velocity or its rotation
[0, -9.81] => [-9.81] | gravity.acceleration | length 1 | 2 components
[[0, 0], [1, 1]] => [] | gravity.curve | empty
[[0, 0], [1, 1]] => [[0, 0], [1, 1], [0.5, 1]] | gravity.curve[2][0] | 0.5 | greater than in the row before, 1
"body": "soft" => "body": "sft" | tractions[0].body | sft | did you mean "soft"
"normal": [0, 1] => "normal": [0, 0] | pressures[0].surface.normal | zero vector
"area": 0.1 => "area": -0.1 | pressures[0].surface.area | -0.1 | > 0
"surface": { "normal": [0, 1], "area": 0.1 },  =>  | pressures[0].surface | needed for a body read from a file
[10, 0] => [10] | initial_velocity.nodes[0].velocity | length 1
"tolerance": 1e-10 => "tolerance": 0 | solver.newton.tolerance | 0 is not | between 1e-15 and 0.1
"restart": 50 => "restart": 0 | solver.krylov.method.gmres.restart | 0 is not | 1 to 1000
{ "gmres": { "restart": 50 } } => "conjugate_gradient" | solver.krylov.method | pressures | gmres
"fixed": 1e-7 => "fixed": 1 | solver.krylov.forcing.fixed | 1 is not | 0.9
"every": 0.1 => "every": 0 | output.every | 0 is not | > 0
"checkpoint": 0.2 => "checkpoint": 0 | output.checkpoint | 0 is not | > 0
["velocity", "stress"] => ["stress", "stress"] | output.fields[1] | once | stress, given before
["velocity", "stress"] => ["stress", {"internal": "damage"}] | output.fields[1] | no law here has one | "damage"
"name": "mid" => "name": "tip" | output.probes[1].name | differ
"name": "mid", "field": "velocity" => "name": "tip_xx", "field": "jacobian" | output.probes[1].name | tip_xx | already has a column
"name": "mid", "field": "velocity" => "name": "mid", "component": "z", "field": "velocity" | output.probes[1].component | "z" | must be a component of velocity: x, y
"name": "mid", "field": "velocity" => "name": "mid", "component": "x", "field": "jacobian" | output.probes[1].component | jacobian has one component: remove the key
"name": "mid", "field": "velocity" => "name": "time", "field": "jacobian" | output.probes[1].name | already has a column "time"
"solver": => "initial_velocity": { "nodes": [{ "region": { "ball": { "center": [1, 1], "radius": 1 } }, "velocity": [10, 0] }] }, "solver": | bodies[0].velocity | [1.0, 0.0] | initial_velocity | remove one
"name": "mid" => "name": "../mid" | output.probes[1].name | file name
"point": [2, 1] => "point": [2, 2.5] | output.probes[1].at.point | [2.0, 2.5] | must lie in the grid
"point": [2, 1] => "point": [2] | output.probes[1].at.point | length 1
"##;

/// The same for text that is no scene at all, with the place to be named.
const WRONG_TEXT: &str = r##"
"density": 2 => "densty": 2 | bodies[0].densty | unknown field | did you mean `density` | `velocity`
"density": 2 => "density": "heavy" | bodies[0].density | string "heavy" | a number
"density": 2 => "density": null | bodies[0].density | null | a number
"density": 2 => "density": 2, "density": 3 | bodies[0] | `density` is given twice
"density": 2 => "density": 1e400 | bodies[0].density | number out of range
"density": 2 => "density": NaN | bodies[0].density | JSON has no NaN
"title" => "titel" | titel | did you mean `title`
"ball": { "center": [0.5 => "sphere": { "center": [0.5 | bodies[0].shape.difference.minus | unknown variant | `ball`
{ "ball": { "center": [4, 2], "radius": 0.6 } } => {} | prescribed[0].region | exactly one key
"max_halvings": 3 => "max_halvings": 2.5 | time.max_halvings | 2.5 | whole number
[0, -9.81] => 9.81 | gravity.acceleration | a list
{ "normal": [0, 1], "area": 0.1 } => [[0, 1], 0.1] | pressures[0].surface | a list, expected an object
"sliding" => { "sliding": null } | boundary.left | an object, expected a word
[[0, 0], [1, 1]] => [[0, 0], [1]] | gravity.curve[1] | length 1
"title": "two blocks", => // two blocks |  | JSON has no comments
"mid", "field": "velocity", "at": { "point": [2, 1] } }] } => "mid", "field": "velocity" |  | EOF while parsing
"##;

/// The good scene with a change `FROM => TO`.
fn mutated(from: &str, to: &str) -> String {
    let good = if GOOD.contains(from) { GOOD.to_owned() } else { good_on_nodes() };
    assert!(good.contains(from), "the good scene has no {from}");
    good.replacen(from, to, 1)
}

#[test]
fn wrong_values_are_named_with_what_is_allowed() {
    for case in cases(WRONG_VALUES) {
        let (from, to) = case[0].split_once(" => ").unwrap();
        assert_refused(&mutated(from, to), case[1], &case[2..]);
    }
}

#[test]
fn wrong_text_is_refused_at_its_place() {
    for case in cases(WRONG_TEXT) {
        let ((from, to), path) = (case[0].split_once(" => ").unwrap(), case[1]);
        let text = mutated(from, to);
        let error = scene::read(&text, &[]).expect_err(to);
        let SceneError::Malformed(problems) = &error else { panic!("{to}: {error}") };
        let malformed = &problems.list[0];
        assert!(path.is_empty() || malformed.path == path, "{to}: {path} expected, not {}", malformed.path);
        for word in &case[2..] {
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
