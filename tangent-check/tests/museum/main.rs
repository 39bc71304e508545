//! The museum of wrong tangents: mistakes of the past as small laws and residuals of our own, before and after the repair.
//!
//! Each file models one mistake. The manual tells the stories with their sources in `docs/src/museum.md`.

mod algebra;
mod bent_plate;
mod check;
mod damage_softening;
mod fibre_dispersion;
mod frequent;
mod green_for_cauchy;
mod half_shear;
mod hencky_axes;
mod index_order;
mod kinematic_hardening;
mod kirchhoff_for_cauchy;
mod mollifier;
mod neo_hooke;
mod plate_rebar;
mod rotation_increment;
mod shear_order;
mod sheet_stiffness;
mod thermal_strain;
mod user_element;

use algebra::{Story, Told, Version};
use tangent_check::finding::{Finding, Verdict};

/// The laws of all stories.
const STORIES: [&Story; 10] = [
    &damage_softening::STORY,
    &fibre_dispersion::STORY,
    &half_shear::STORY,
    &hencky_axes::STORY,
    &index_order::STORY,
    &kinematic_hardening::STORY,
    &kirchhoff_for_cauchy::STORY,
    &sheet_stiffness::STORY,
    &shear_order::STORY,
    &user_element::STORY,
];

#[test]
fn after_the_repair_every_law_is_consistent() {
    for story in STORIES {
        let report = check::report(&mut Told(story, Version::After));
        report.assert_consistent();
        // Of this law alone, states about yielding lie on kinks.
        let smooth = story.law != kinematic_hardening::STORY.law;
        let consistent = |finding: &Finding| finding.verdict == Verdict::Consistent;
        assert!(!smooth || report.findings.iter().all(consistent), "{}", story.law);
        assert!(report.diagnoses.is_empty(), "{}", story.law);
    }
}
