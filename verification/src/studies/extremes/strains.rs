//! Strains from 1e-15 to 10: all laws, in every dimension.

use super::points::{Errors, Rounding, judge, laws, reference};
use super::{Effort, Outcome, SOLVABLE};
use crate::check::regime::rotation;
use crate::random::Random;
use crate::report::{Bound, Report, short};
use bfree::material::Material;
use bfree::tensor::{Tensor, determinant, identity};

/// Roundings on the longest path from H to S in 3D: 8 in j, 5 in a cofactor, 3 in C⁻¹, 5 in E, 5 in their product; each is half an eps.
pub(super) const ROUNDINGS: f64 = 13.0;

/// Constants such as 1/3 in a series have double precision. Double-double is then exact to one rounding, a tenth of the error under test.
const REFERENCE: f64 = f64::EPSILON;

/// Deformations tried for each kind and size.
const TRIES: usize = 20;

/// From this strain up to 1 the textbook formulas in double-double keep enough digits to check the reference.
const RESOLVED: f64 = 1e-3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Random,
    Shear,
    Turned,
}

impl Kind {
    const ALL: [Self; 3] = [Self::Random, Self::Shear, Self::Turned];

    fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Shear => "shear",
            Self::Turned => "turned by 2 to 3 rad",
        }
    }

    /// H of the given size with det F > 0; `None` if this kind has none.
    fn displacement<const D: usize>(self, size: f64, random: &mut Random) -> Option<Tensor<f64, D>> {
        if D == 1 && self != Self::Random {
            return None;
        }
        if self == Self::Shear {
            let mut h = Tensor::zeros();
            h[(0, D - 1)] = size * random.signed();
            return Some(h);
        }
        loop {
            let strained = random.tensor::<D>() * size;
            let f = identity::<f64, D>() + strained;
            if determinant(&f) > 0.0 {
                // Q (I + X) − I = (Q − I) + Q X keeps the digits of X as far as H can.
                let q = if self == Self::Turned { rotation::<D>(random) } else { identity() };
                return Some((q - identity::<f64, D>()) + q * strained);
            }
        }
    }
}

pub(super) fn run(effort: &Effort, outcome: &mut Outcome) {
    let sizes: Vec<f64> = match effort {
        Effort::Short => vec![1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0],
        Effort::Full => (-30..=2).map(|k| 10.0_f64.powf(0.5 * f64::from(k))).collect(),
    };
    let columns = ["quantity", "beforehand", "law", "D", "strain", "kind"];
    let mut report =
        Report::new("strains 1e-15 to 10: roundings, in eps, that the errors of W and S amount to", &columns)
            .as_matrix(&[0, 1], 4, 5);
    let mut judge_of_judge =
        super::rows("the reference against textbook formulas in double-double, strains 1e-3 to 10");
    let mut worst_reference: f64 = 0.0;
    for &size in &sizes {
        for (name, law) in &laws() {
            let mut cell = Cells { name, law, size, report: &mut report };
            cell.all();
            if size >= RESOLVED {
                for error in [check::<1>(law, size), check::<2>(law, size), check::<3>(law, size)] {
                    worst_reference = super::worse(worst_reference, error);
                }
            }
        }
    }
    report
        .note("An error is judged by what rounding H changes, eps |H| |dS/dH|, beside eps |S|: a strain of 1e-15 in a");
    report.note("body turned by 2 rad is below the last digit of H itself, and no formula can know it.");
    super::solvable(
        &mut judge_of_judge,
        "W and S",
        "random",
        Ok::<_, std::convert::Infallible>(worst_reference),
        REFERENCE,
    );
    outcome.reports.extend([judge_of_judge, report]);
}

/// The generic code in double-double against the textbook formulas.
fn check<const D: usize>(law: &Material, size: f64) -> f64 {
    let mut random = Random::new(43);
    (0..TRIES).filter_map(|_| Kind::Random.displacement::<D>(size, &mut random)).fold(0.0, |worst, h| {
        // Close to det F = 0 the textbook formulas lose digits.
        let resolved = determinant(&(identity::<f64, D>() + h)) > 0.01;
        if resolved { super::worse(worst, reference(law, &h)) } else { worst }
    })
}

struct Cells<'a> {
    name: &'a str,
    law: &'a Material,
    size: f64,
    report: &'a mut Report,
}

impl Cells<'_> {
    /// All kinds in all dimensions. A kind that does not exist in a dimension is left out.
    fn all(&mut self) {
        for kind in Kind::ALL {
            self.one::<1>(kind);
            self.one::<2>(kind);
            self.one::<3>(kind);
        }
    }

    fn one<const D: usize>(&mut self, kind: Kind) -> Option<()> {
        let mut random = Random::new(47);
        let tried = (0..TRIES).map(|_| {
            let h = kind.displacement::<D>(self.size, &mut random)?;
            Some(judge::<D>(self.law, &h, Rounding::Displacement))
        });
        let worst = tried.collect::<Option<Vec<_>>>()?.into_iter().fold(Errors::NONE, Errors::worse);
        let (dimension, size) = (D.to_string(), short(self.size));
        for (quantity, value) in [("W", worst.energy), ("S", worst.stress)] {
            let labels = [quantity, SOLVABLE, self.name, &dimension, &size, kind.name()];
            self.report.push(&labels, value, Bound::AtMost(ROUNDINGS));
        }
        Some(())
    }
}
