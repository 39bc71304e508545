//! svMultiPhysics, issue 189 and pull request 190 (21 February 2024): the sheets of the heart have the stiffness of its fibres.
//!
//! Our law: two families of directions f and s in a neo-Hookean solid, each active in tension, with E_f = f · C f − 1,
//! g = a E exp(b E²), h = dg/dE = a (1 + 2b E²) exp(b E²):
//!
//! S = S₀ + Σ 2 g A, ∂S/∂E = ℂ₀ + Σ 4 h A ⊗ A, A = f ⊗ f or s ⊗ s.
//!
//! Before: the sheets take h of the fibres. Not modelled: the split into volume and shape, the shear of fibre against sheet, and
//! the active stress. With fibres in compression, the historical `g1` kept the value of the ground substance; ours is 0 there.

use crate::algebra::{RightCauchyGreen, Story, Version, double_dot, matrix, tension, vector};
use crate::check::{assert_law_wrong, assert_not_named};
use crate::neo_hooke;
use tangent_check::convention::{Measure, Tensor};
use tangent_check::law::{Response, Step};
use tangent_check::tensor::from_entries;

/// A family of parallel fibres.
struct Family {
    direction: [f64; 3],
    stiffness: f64,
    exponent: f64,
}

const FIBRES: Family = Family { direction: [1.0, 0.0, 0.0], stiffness: 3.0, exponent: 0.5 };
const SHEETS: Family = Family { direction: [0.0, 0.8, 0.6], stiffness: 0.5, exponent: 0.3 };

impl Family {
    fn tension(&self, c: &Tensor) -> (f64, f64) {
        let strain = double_dot(&from_entries(|i, j| self.structure(i, j)), c) - 1.0;
        tension(self.stiffness, self.exponent, strain)
    }

    fn structure(&self, i: usize, j: usize) -> f64 {
        self.direction[i] * self.direction[j]
    }
}

pub const STORY: Story =
    Story { law: "Fibres and sheets", measure: Measure::SecondPiolaByGreen, rest: Vec::new, respond };

fn respond(version: Version, step: &Step) -> Response {
    let at = RightCauchyGreen::new(&step.gradient);
    let ground = neo_hooke::second_piola(&at);
    let (fibre_stress, g1) = FIBRES.tension(&at.c);
    let (sheet_stress, g2) = SHEETS.tension(&at.c);
    // The historical line: g1 for g2.
    let sheet = match version {
        Version::Before if g2 > 0.0 => g1,
        _ => g2,
    };
    let stress = from_entries(|i, j| {
        ground[i][j] + 2.0 * (fibre_stress * FIBRES.structure(i, j) + sheet_stress * SHEETS.structure(i, j))
    });
    let tangent = matrix(|i, j, k, l| {
        let fibres = g1 * FIBRES.structure(i, j) * FIBRES.structure(k, l);
        let sheets = sheet * SHEETS.structure(i, j) * SHEETS.structure(k, l);
        neo_hooke::green_modulus(&at, [i, j, k, l]) + 4.0 * (fibres + sheets)
    });
    Response { stress: vector(&stress), tangent, state: Vec::new() }
}

#[test]
fn before_the_sheets_are_as_stiff_as_the_fibres() {
    // s ⊗ s ⊗ s ⊗ s with s in the plane 2, 3
    let entries = [1, 2, 5].into_iter().flat_map(|row| [1, 2, 5].map(|column| (row, column))).collect();
    let (report, finding) = assert_law_wrong(&STORY, &[(1, 1)], &entries);
    assert!((0.35..0.36).contains(&finding.deviation), "{}", finding.deviation);
    assert_not_named(&report);
}
