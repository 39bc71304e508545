//! Mistakes in one place of the tangent: an entry, a row, a column, a block or a triangle.

use super::observation::{AGREEMENT, Observation, VISIBLE, is_shear};
use crate::convention::Convention;
use crate::finding::Diagnosis;

/// A factor is taken for a round one within this.
const ROUND: f64 = 1e-6;

/// The entries that visibly deviate in any state.
struct Support(Vec<(usize, usize)>);

/// The smallest place that holds all deviations, and what is wrong there; `None` if they lie all over the tangent.
pub(super) fn fit(convention: &Convention, observations: &[Observation]) -> Option<Diagnosis> {
    let support = Support::of(convention, observations)?;
    let place = support.place(convention)?;
    let factor = support.factor(observations);
    let wrong = match factor {
        Some(factor) if factor.abs() < ROUND => "zero".to_string(),
        Some(factor) if (factor + 1.0).abs() < ROUND => "of the opposite sign".to_string(),
        Some(factor) => format!("multiplied by {factor:.6}"),
        None => "wrong".to_string(),
    };
    let verb = if place.starts_with("the entries") { "are" } else { "is" };
    let sentence = format!("Your tangent is the right one, but {place} {verb} {wrong}.");
    Some(Diagnosis { coefficient: factor, ..Diagnosis::alone(sentence) })
}

impl Support {
    fn of(convention: &Convention, observations: &[Observation]) -> Option<Self> {
        let [rows, columns] = [convention.stress.count(), convention.strain.count()];
        let deviates = |(i, j): (usize, usize), errors: f64| {
            observations.iter().any(|observation| {
                let deviation = observation.claimed[(i, j)] - observation.measured.tangent[(i, j)];
                deviation.abs() > errors * observation.measured.error()
            })
        };
        let all = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
        let places: Vec<_> = all.filter(|place| deviates(*place, AGREEMENT)).collect();
        places.iter().any(|place| deviates(*place, VISIBLE)).then_some(Self(places))
    }

    /// The name of the smallest place with all of these entries.
    fn place(&self, convention: &Convention) -> Option<String> {
        let [rows, columns] = [convention.stress.names(), convention.strain.names()];
        let (i, j) = self.0[0];
        let all = |holds: &dyn Fn(usize, usize) -> bool| self.0.iter().all(|(i, j)| holds(*i, *j));
        let shear = |i: usize, j: usize| (is_shear(&convention.stress, i), is_shear(&convention.strain, j));
        // The kinds of row and column: a normal component or a shear.
        let kinds = |rows: bool, columns: bool| all(&|row, column| shear(row, column) == (rows, columns));
        let places = [
            (self.0.len() == 1, format!("the entry {} by {} alone", rows[i], columns[j])),
            (all(&|row, _| row == i), format!("the row of {} alone", rows[i])),
            (all(&|_, column| column == j), format!("the column of {} alone", columns[j])),
            (kinds(false, true), "the entries of normal by shear".into()),
            (kinds(true, false), "the entries of shear by normal".into()),
            (kinds(true, true), "the entries of shear by shear".into()),
            (
                all(&|row, column| shear(row, column).0 != shear(row, column).1),
                "the entries of normal by shear and shear by normal".into(),
            ),
            (kinds(false, false), "the entries of normal by normal".into()),
            (all(&|row, column| row > column), "the entries below the diagonal".into()),
            (all(&|row, column| row < column), "the entries above the diagonal".into()),
        ];
        places.into_iter().find_map(|(holds, name)| holds.then_some(name))
    }

    /// The one factor by which the right entries are multiplied in all states, by least squares; `None` if there is none.
    fn factor(&self, observations: &[Observation]) -> Option<f64> {
        let pairs = || {
            let of = |observation: &Observation| {
                let error = observation.measured.error();
                let pair = |place: &(usize, usize)| (observation.claimed[*place], observation.measured.tangent[*place]);
                self.0
                    .iter()
                    .map(pair)
                    .map(move |(claimed, right)| (claimed / error, right / error))
                    .collect::<Vec<_>>()
            };
            observations.iter().flat_map(of)
        };
        let [product, square] =
            pairs().fold([0.0, 0.0], |[p, s], (claimed, right)| [p + claimed * right, s + right * right]);
        let factor = product / square;
        let allowed = AGREEMENT * factor.abs().max(1.0);
        (factor.is_finite() && pairs().all(|(claimed, right)| (claimed - factor * right).abs() <= allowed))
            .then_some(factor)
    }
}
