//! OpenSees, issue 551 (4 March 2021): reinforcement at an oblique angle, wrong for nine years and through two repairs.
//!
//! The components are 11, 22, 12. The tangents of 2013 and 2021 have c³s and c²s² exchanged, that of 2016 in all rows but the first.
//!
//! Our function: a bar at angle θ with the stress σ(ε) = σ₀ tanh(E ε/σ₀), c = cos θ, s = sin θ:
//!
//! ε = ε₁₁ c² + ε₂₂ s² + γ₁₂ c s, σ₁₁ = σ c², σ₂₂ = σ s², σ₁₂ = σ c s, tangent = σ'(ε) v ⊗ v with v = (c², s², c s).

use crate::check::{assert_consistent, assert_wrong, vector_finding};
use tangent_check::matrix::Matrix;

const STIFFNESS: f64 = 2.0;
const STRENGTH: f64 = 1.0;

/// The repairs, by their year.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Year {
    Y2013,
    Y2016,
    Y2021,
    Y2022,
}

/// ε₁₁, ε₂₂, γ₁₂.
pub type Strain = [f64; 3];

fn along(angle: f64) -> [f64; 3] {
    let (s, c) = angle.sin_cos();
    [c * c, s * s, c * s]
}

fn bar_strain(angle: f64, strain: Strain) -> f64 {
    along(angle).iter().zip(strain).map(|(v, e)| v * e).sum()
}

/// σ₁₁, σ₂₂, σ₁₂ where a component of the strain grows by h.
pub fn stress(angle: f64, strain: Strain, component: usize, h: f64) -> Vec<f64> {
    let mut moved = strain;
    moved[component] += h;
    let stress = STRENGTH * (STIFFNESS * bar_strain(angle, moved) / STRENGTH).tanh();
    along(angle).map(|v| stress * v).to_vec()
}

/// The tangent of that year.
pub fn tangent(year: Year, angle: f64, strain: Strain) -> Matrix {
    let (s, c) = angle.sin_cos();
    let cosh = (STIFFNESS * bar_strain(angle, strain) / STRENGTH).cosh();
    let modulus = STIFFNESS / (cosh * cosh);
    let (c4, c3s, c2s2, cs3, s4) = (c.powi(4), c.powi(3) * s, c * c * s * s, c * s.powi(3), s.powi(4));
    let entries = match year {
        Year::Y2013 | Year::Y2021 => [c4, c3s, c2s2, c3s, c2s2, cs3, c2s2, cs3, s4],
        Year::Y2016 => [c4, c2s2, c3s, c3s, s4, 0.0, c2s2, cs3, c3s],
        Year::Y2022 => [c4, c2s2, c3s, c2s2, s4, cs3, c3s, cs3, c2s2],
    };
    Matrix { rows: 3, columns: 3, entries: entries.map(|entry| modulus * entry).to_vec() }
}

const OBLIQUE: f64 = 0.5;
const STATE: Strain = [0.1, 0.2, -0.1];

fn check(year: Year, angle: f64) -> tangent_check::finding::Finding {
    vector_finding(&tangent(year, angle, STATE), &mut |k, h| stress(angle, STATE, k, h))
}

#[test]
fn in_2013_and_2021_the_order_is_another() {
    let entries = [(0, 1), (0, 2), (1, 0), (1, 1), (2, 0), (2, 2)].into_iter().collect();
    for year in [Year::Y2013, Year::Y2021] {
        let finding = check(year, OBLIQUE);
        assert_wrong(&finding, &[(0, 1), (0, 2), (1, 0), (2, 0)], &entries);
        assert!((0.24..0.25).contains(&finding.deviation), "{}", finding.deviation);
    }
}

#[test]
fn in_2016_four_entries_are_wrong() {
    let entries = [(1, 0), (1, 2), (2, 0), (2, 2)].into_iter().collect();
    let finding = check(Year::Y2016, OBLIQUE);
    assert_eq!(crate::check::wrong_entries(&finding), entries);
    assert_eq!(finding.verdict, tangent_check::finding::Verdict::Wrong);
}

#[test]
fn at_45_degrees_the_order_does_not_show() {
    let angle = std::f64::consts::FRAC_PI_4;
    for year in [Year::Y2013, Year::Y2021, Year::Y2022] {
        assert_consistent(&check(year, angle));
    }
    assert_wrong(&check(Year::Y2016, angle), &[(1, 2)], &[(1, 2)].into_iter().collect());
}

#[test]
fn in_2022_the_tangent_is_right() {
    assert_consistent(&check(Year::Y2022, OBLIQUE));
}
