//! Scenes that must agree under eight transformations, drawn at random over families, laws, schemes, loads and fillings.

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report, chain};
use crate::symmetry::{SymmetryError, TRANSFORMATIONS, Transformation, compare, draw};
use rayon::prelude::*;

/// The summary in the list of studies.
pub(super) const ABOUT: &str =
    "random scenes and their mirror images, turned, moved, halved, split, thickened and scaled";

/// The number of scenes for each transformation.
fn scenes(effort: Effort) -> u64 {
    match effort {
        Effort::Short => 30,
        Effort::Full => 1000,
    }
}

/// The largest share of scenes without an equilibrium, which are left out: nodes with little mass may have too little stiffness.
const LEFT_OUT: f64 = 0.25;

pub(super) fn run(effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = Report::new(
        "largest difference over round-off times the condition of the problem",
        &["transformation", "of", "scene"],
    )
    .as_matrix(&[1], 0, 2);
    let mut left_out = Report::new(
        "share of the scenes, and of the images of other scenes, that could not be run",
        &["transformation", "of"],
    );
    for transformation in TRANSFORMATIONS {
        judge(transformation, scenes(*effort), &mut report, &mut left_out);
    }
    Ok(Outcome { reports: vec![report, left_out], ..Outcome::default() })
}

fn judge(transformation: Transformation, scenes: u64, report: &mut Report, left_out: &mut Report) {
    let found: Vec<_> = (0..scenes)
        .into_par_iter()
        .map(|seed| {
            let (pair, name) = draw(seed, transformation);
            (format!("{seed}: {name}"), compare(&pair))
        })
        .collect();
    let mut unsolved = [0_u32; 3];
    for (name, found) in found {
        match found {
            Ok(found) => {
                for one in found {
                    // The bits either agree or do not.
                    let (value, bound) =
                        if pair_of_bits(transformation) { (one.difference, 0.0) } else { (one.used(), 1.0) };
                    report.push(&[transformation.name(), one.quantity, &name], value, Bound::AtMost(bound));
                }
            }
            Err(SymmetryError::Scene(_)) => unsolved[0] += 1,
            Err(error @ SymmetryError::Image(_)) => {
                unsolved[1] += 1;
                left_out.note(format!("{name}: {}", chain(&error)));
            }
            Err(error @ SymmetryError::Unstable(_)) => {
                unsolved[2] += 1;
                left_out.note(format!("{name}: {}", chain(&error)));
            }
        }
    }
    let [scene, image, unstable] = unsolved;
    let rows = [
        ("scene", scene + unstable, Bound::AtMost(LEFT_OUT)),
        ("image", image, Bound::AtMost(0.0)),
        ("image, of a scene whose perturbed copy cannot", unstable, Bound::Reported),
    ];
    for (of, unsolved, bound) in rows {
        left_out.push(&[transformation.name(), of], f64::from(unsolved) / scenes as f64, bound);
    }
}

fn pair_of_bits(transformation: Transformation) -> bool {
    transformation == Transformation::PowersOfTwo
}
