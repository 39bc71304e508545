//! The field that colours particles, chosen by name or by default.

use super::axes::extremes;
use crate::output::OutputError;
use crate::output::vtu::{Array, Snapshot};

/// One number per particle.
#[derive(Clone, Debug)]
pub(super) struct Colouring {
    /// Readable name of the field.
    pub label: String,
    /// One value per particle.
    pub values: Vec<f64>,
}

impl Colouring {
    /// Smallest and largest finite value; ∞ and −∞ if there is none.
    pub(super) fn extremes(&self) -> (f64, f64) {
        extremes(self.values.iter().copied())
    }

    /// The field called `field`: an array of the snapshot, a component such as `stress_xx`, or `von_mises` where there is a stress. A
    /// vector gives its length, a tensor its Frobenius norm. `None` if the snapshot holds no such field.
    pub(super) fn of(snapshot: &Snapshot, field: &str) -> Option<Self> {
        let array = |name: &str| snapshot.arrays.iter().find(|array| array.name == name);
        let label = words(field);
        if let Some(array) = array(field) {
            let label = if array.components.len() > 1 { format!("|{label}|") } else { label };
            return Some(Self { label, values: tuples(array, size) });
        }
        if field == "von_mises" {
            let stress = array("stress").or(array("principal_stress"))?;
            return Some(Self { label, values: tuples(stress, von_mises) });
        }
        snapshot.arrays.iter().find_map(|array| {
            let place = array.columns().iter().position(|column| column == field)?;
            Some(Self { label: label.clone(), values: tuples(array, |tuple| tuple[place]) })
        })
    }

    /// The field that is asked for. The default is the plastic strain, else the von Mises stress, else the first field. In one dimension,
    /// where the field is the vertical axis, the default is the first component of the first field.
    ///
    /// # Errors
    /// The snapshot holds no such field.
    pub(super) fn chosen(snapshot: &Snapshot, asked: Option<&str>) -> Result<Option<Self>, OutputError> {
        if let Some(field) = asked {
            let unknown = || OutputError::NoField { field: field.to_owned(), there: names(snapshot).join(", ") };
            return Self::of(snapshot, field).map(Some).ok_or_else(unknown);
        }
        let floats = || snapshot.arrays.iter().filter(|array| !array.is_index);
        if snapshot.background.dimension == 1 {
            return Ok(floats().find_map(|array| Self::of(snapshot, array.columns().first()?)));
        }
        let worth = ["plastic_strain", "von_mises"].iter().find_map(|field| Self::of(snapshot, field));
        Ok(worth.or_else(|| floats().find_map(|array| Self::of(snapshot, &array.name))))
    }
}

/// All names that [`Colouring::of`] knows.
fn names(snapshot: &Snapshot) -> Vec<String> {
    let mut names = Vec::new();
    for array in &snapshot.arrays {
        names.extend((array.components.len() > 1).then(|| array.name.clone()));
        names.extend(array.columns());
    }
    if Colouring::of(snapshot, "von_mises").is_some() && !names.iter().any(|name| name == "von_mises") {
        names.push("von_mises".to_owned());
    }
    names
}

/// A name in readable words.
pub(super) fn words(name: &str) -> String {
    if name == "von_mises" { "von Mises stress".to_owned() } else { name.replace('_', " ") }
}

/// One number per particle, computed from its tuple by `of`.
fn tuples(array: &Array, of: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    array.values.chunks_exact(array.components.len().max(1)).map(of).collect()
}

/// Length of a vector, Frobenius norm of a tensor, or the scalar itself.
fn size(tuple: &[f64]) -> f64 {
    if let [x] = tuple {
        return *x;
    }
    // The off-diagonal components of a symmetric tensor count twice.
    let weight = |k: usize| if tuple.len() == 6 && k >= 3 { 2.0 } else { 1.0 };
    tuple.iter().enumerate().map(|(k, x)| weight(k) * x * x).sum::<f64>().sqrt()
}

/// √(3/2 s:s) of σ = (xx, yy, zz, xy, yz, xz), or of its principal values.
fn von_mises(stress: &[f64]) -> f64 {
    let mean = stress.iter().take(3).sum::<f64>() / 3.0;
    let direct: f64 = stress.iter().take(3).map(|x| (x - mean).powi(2)).sum();
    let shear: f64 = stress.iter().skip(3).map(|x| x * x).sum();
    (1.5 * (direct + 2.0 * shear)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::vtu::Background;

    fn snapshot(dimension: u32, arrays: &[(&str, &[&str], &[f64])]) -> Snapshot {
        let array = |(name, components, values): &(&str, &[&str], &[f64])| Array {
            name: (*name).to_owned(),
            components: components.iter().map(|name| (*name).to_owned()).collect(),
            values: values.to_vec(),
            is_index: false,
        };
        let background = Background { dimension, origin: [0.0; 3], spacing: 1.0, cells: [2; 3] };
        Snapshot {
            time: 0.0,
            background,
            points: vec![[0.5; 3]],
            arrays: arrays.iter().map(array).collect(),
            corners: 1,
        }
    }

    #[test]
    fn a_field_worth_colouring_is_found_and_any_can_be_asked_for() -> Result<(), OutputError> {
        let stress: (&str, &[&str], &[f64]) =
            ("stress", &["xx", "yy", "zz", "xy", "yz", "xz"], &[5.0, 2.0, 2.0, 4.0, 0.0, 0.0]);
        let displacement: (&str, &[&str], &[f64]) = ("displacement", &["x", "y", "z"], &[3.0, -4.0, 0.0]);
        let plane = snapshot(2, &[displacement, stress]);
        let found = |snapshot: &Snapshot, field| -> Result<_, OutputError> {
            Ok(Colouring::chosen(snapshot, field)?.map(|one| (one.label, one.values)))
        };
        // In shear and tension: √(σ² + 3 τ²).
        let mises = (9.0_f64 + 48.0).sqrt();
        assert_eq!(found(&plane, None)?, Some(("von Mises stress".into(), vec![mises])));
        assert_eq!(found(&plane, Some("stress_xx"))?, Some(("stress xx".into(), vec![5.0])));
        assert_eq!(found(&plane, Some("displacement"))?, Some(("|displacement|".into(), vec![5.0])));
        assert_eq!(found(&plane, Some("displacement_y"))?, Some(("displacement y".into(), vec![-4.0])));
        assert_eq!(found(&snapshot(1, &[displacement, stress]), None)?, Some(("displacement x".into(), vec![3.0])));
        assert_eq!(found(&snapshot(2, &[]), None)?, None);
        let error = Colouring::chosen(&plane, Some("stres")).map(drop).unwrap_err().to_string();
        assert!(
            error.contains("\"stres\"") && error.contains("displacement_x") && error.contains("von_mises"),
            "{error}"
        );
        Ok(())
    }
}
