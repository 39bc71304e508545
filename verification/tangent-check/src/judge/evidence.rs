//! What the measurements say about one column of a claimed tangent.

use super::{ERRORS, Entry, Estimate, Matrix, Measured, greatest, loose};

/// The round-off of a claimed tangent over ‖C‖, in units of ε.
const ROUND_OFF: f64 = 4.0;

/// The verdict over one column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColumnVerdict {
    Consistent,
    Inexact,
    Kink,
    Wrong,
}

/// The measured tangent in the form in which columns are judged.
pub(super) struct Evidence {
    /// The derivatives that a column may match: one, or those to both sides of a kink.
    pub columns: Vec<Vec<Estimate>>,
    /// ‖C‖, the greatest entry of the measured tangent.
    scale: f64,
    /// The accepted deviation in errors.
    errors: f64,
    /// The deviation that a loose local iteration explains; 0 without a trace of one.
    explained: f64,
}

impl Evidence {
    /// The evidence of differences.
    pub fn of(measured: &Measured) -> Self {
        let mut columns: Vec<Vec<Estimate>> = measured
            .columns
            .iter()
            .map(|column| match column.has_kink() {
                true => vec![column.forward.clone(), column.backward.clone()],
                false => vec![column.best()],
            })
            .collect();
        let finite = |value: &&f64| value.is_finite();
        let values = columns.iter().flatten().flat_map(|estimate| estimate.value.iter().filter(finite));
        let scale = values.fold(0.0_f64, |greatest, value| greatest.max(value.abs()));
        for error in columns.iter_mut().flatten().flat_map(|estimate| &mut estimate.error) {
            *error += ROUND_OFF * f64::EPSILON * scale;
        }
        let explained = measured.jump.map_or(0.0, |jump| loose::explained(jump, scale));
        Self { columns, scale, errors: ERRORS, explained }
    }

    /// The evidence of an exact tangent with round-off `bound`, relative to its greatest entry.
    pub fn exact(exact: &Matrix, bound: f64) -> Self {
        let scale = exact.greatest();
        let error = vec![bound * scale; exact.rows];
        let columns = (0..exact.columns)
            .map(|k| vec![Estimate { value: super::column(exact, k), error: error.clone() }])
            .collect();
        Self { columns, scale, errors: 1.0, explained: 0.0 }
    }

    /// ‖C‖; of the claimed tangent, if the measured one is zero.
    pub fn scale_for(&self, claimed: &Matrix) -> f64 {
        if self.scale > 0.0 { self.scale } else { claimed.greatest() }
    }

    /// ‖C‖.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The verdict over column `k`, if the law claims `claimed`.
    pub fn verdict(&self, k: usize, claimed: &[f64]) -> ColumnVerdict {
        let sides = &self.columns[k];
        let within = |explained: f64| {
            sides.iter().any(|side| {
                let entries = claimed.iter().zip(side.value.iter().zip(&side.error));
                // An entry that could not be measured deviates by NaN, which no comparison calls too great.
                !entries.into_iter().any(|(c, (d, e))| (c - d).abs() > (self.errors * e).max(explained))
            })
        };
        match (within(0.0), within(self.explained), sides.len()) {
            (true, _, _) => ColumnVerdict::Consistent,
            (_, true, _) => ColumnVerdict::Inexact,
            (_, _, 1) => ColumnVerdict::Wrong,
            _ => ColumnVerdict::Kink,
        }
    }

    /// The estimate of column `k` from which the claimed column deviates least, in errors.
    pub fn nearest(&self, k: usize, claimed: &[f64]) -> Estimate {
        let excess = |side: &Estimate| {
            let entries = claimed.iter().zip(side.value.iter().zip(&side.error));
            entries.fold(0.0_f64, |greatest, (c, (d, e))| greatest.max((c - d).abs() / e))
        };
        let nearest = self.columns[k].iter().min_by(|a, b| excess(a).total_cmp(&excess(b)));
        nearest.cloned().unwrap_or_else(|| Estimate::none(claimed.len()))
    }

    /// Whether an entry deviates by more than its error allows.
    pub fn deviates(&self, entry: &Entry) -> bool {
        entry.deviation() > self.errors * entry.error
    }

    /// Whether the claimed and the measured tangent are zero within the errors.
    pub fn is_zero(&self, claimed: &Matrix) -> bool {
        let small = |value: f64, error: f64| value.abs() <= self.errors * error;
        (0..claimed.columns).all(|k| {
            self.columns[k].iter().all(|side| {
                (0..claimed.rows).all(|i| small(side.value[i], side.error[i]) && small(claimed[(i, k)], side.error[i]))
            })
        })
    }

    /// The greatest deviation in column `k`.
    pub fn deviation(&self, k: usize, claimed: &Matrix) -> f64 {
        let column = super::column(claimed, k);
        let nearest = self.nearest(k, &column);
        greatest(&column.iter().zip(&nearest.value).map(|(c, d)| c - d).collect::<Vec<f64>>())
    }
}
