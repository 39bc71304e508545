//! Random scenes and their images, which must agree: the mirrored and rotated scenes of the study `symmetry`.

use shared::{Disagreement, SymmetryError, Transformation, compare, draw};

#[path = "../../verification/src/symmetry/mod.rs"]
#[allow(dead_code, unused_imports, reason = "the study judges the other transformations")]
mod shared;

/// Scenes per transformation.
const SCENES: u64 = 60;

fn judge(transformation: Transformation) {
    let (mut wrong, mut compared) = (Vec::new(), 0);
    for seed in 0..SCENES {
        let (pair, name) = draw(seed, transformation);
        match compare(&pair) {
            Ok(found) => {
                compared += 1;
                let beyond = found.iter().filter(|one: &&Disagreement| one.used() > 1.0);
                wrong.extend(beyond.map(|one| format!("{seed}: {name}: {one:?}")));
            }
            Err(SymmetryError::Scene(_)) => {}
            Err(error @ SymmetryError::Image(_)) => wrong.push(format!("{seed}: {name}: {error:?}")),
        }
    }
    assert!(wrong.is_empty(), "{} of {compared} scenes: {wrong:#?}", transformation.name());
    // Without inertia and without stabilisation of nodes with little mass, some scenes have no equilibrium.
    assert!(4 * compared >= 3 * SCENES, "{}: {compared} of {SCENES} scenes", transformation.name());
}

#[test]
fn random_scenes_agree_with_their_mirror_images() {
    judge(Transformation::Mirrored);
}

#[test]
fn random_scenes_agree_when_they_are_turned() {
    judge(Transformation::Turned);
}
