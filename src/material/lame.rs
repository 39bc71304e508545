//! The two constants of an isotropic solid, in any of the three usual pairs.

use crate::problems::{Number, Problems};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Lamé's constants Λ and G, in the user's unit of stress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    /// Λ
    pub lambda: f64,
    /// The shear modulus G.
    pub shear: f64,
}

/// An elastic constant that no stable solid has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LameError {
    /// G must be finite and positive.
    #[error("the shear modulus is {0:e}; it must be finite and > 0")]
    Shear(f64),
    /// K = Λ + 2G/3 must be finite and positive.
    #[error("the bulk modulus Λ + 2G/3 is {0:e}; it must be finite and > 0")]
    Bulk(f64),
    /// E must be finite and positive.
    #[error("Young's modulus is {0:e}; it must be finite and > 0")]
    Young(f64),
    /// ν must lie in (−1, ½).
    #[error("Poisson's ratio is {0}; it must lie between -1 and 0.5, both excluded")]
    Poisson(f64),
}

fn positive(x: f64, error: impl Fn(f64) -> LameError) -> Result<(), LameError> {
    if x > 0.0 && x.is_finite() { Ok(()) } else { Err(error(x)) }
}

impl Lame {
    /// From Λ and G.
    ///
    /// ```
    /// use bfree::material::Lame;
    ///
    /// // Λ may be negative, as long as the bulk modulus Λ + 2G/3 is not.
    /// let lame = Lame::new(-0.5, 1.0)?;
    /// assert_eq!(lame.p_wave_modulus(), 1.5);
    /// assert!(Lame::new(-0.7, 1.0).is_err());
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    ///
    /// # Errors
    /// G ≤ 0, K = Λ + 2G/3 ≤ 0, or one of them is not finite.
    pub fn new(lambda: f64, shear: f64) -> Result<Self, LameError> {
        positive(shear, LameError::Shear)?;
        positive(lambda + 2.0 * shear / 3.0, LameError::Bulk)?;
        Ok(Self { lambda, shear })
    }

    /// From Young's modulus E and Poisson's ratio ν: Λ = Eν/((1+ν)(1−2ν)), G = E/(2(1+ν)).
    ///
    /// # Errors
    /// E ≤ 0, or ν outside (−1, ½).
    ///
    /// ```
    /// use bfree::material::Lame;
    ///
    /// let lame = Lame::from_young_poisson(2.5, 0.25)?;
    /// assert_eq!((lame.lambda, lame.shear, lame.p_wave_modulus()), (1.0, 1.0, 3.0));
    /// assert!(Lame::from_young_poisson(2.5, 0.5).is_err());
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    pub fn from_young_poisson(young: f64, poisson: f64) -> Result<Self, LameError> {
        positive(young, LameError::Young)?;
        if !(poisson > -1.0 && poisson < 0.5) {
            return Err(LameError::Poisson(poisson));
        }
        Self::new(young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson)))
    }

    /// From the bulk modulus K and the shear modulus G: Λ = K − 2G/3.
    ///
    /// ```
    /// use bfree::material::Lame;
    ///
    /// // The paper's rebound: K = 170, G = 30. E = 9KG/(3K + G) and ν = (3K − 2G)/(6K + 2G) give the same solid.
    /// let (bulk, shear) = (170.0, 30.0);
    /// let lame = Lame::from_bulk_shear(bulk, shear)?;
    /// assert_eq!((lame.lambda, lame.shear), (150.0, 30.0));
    /// let young = 9.0 * bulk * shear / (3.0 * bulk + shear);
    /// let same = Lame::from_young_poisson(young, (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear))?;
    /// assert!((same.lambda - lame.lambda).abs() < 1e-12 * lame.lambda);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    ///
    /// # Errors
    /// K ≤ 0, G ≤ 0, or one of them is not finite.
    pub fn from_bulk_shear(bulk: f64, shear: f64) -> Result<Self, LameError> {
        positive(bulk, LameError::Bulk)?;
        Self::new(bulk - 2.0 * shear / 3.0, shear)
    }

    /// Λ + 2G, the modulus of plane compression waves.
    ///
    /// ```
    /// use bfree::material::Lame;
    ///
    /// // Section 4.1: E = 1e10 Pa, ν = 0.3, ρ = 2600 kg/m³; waves run at c = √(M/ρ), M = E (1−ν)/((1+ν)(1−2ν)).
    /// let modulus = Lame::from_young_poisson(1e10, 0.3)?.p_wave_modulus();
    /// assert!((modulus / (1e10 * 0.7 / (1.3 * 0.4)) - 1.0).abs() < 1e-15);
    /// assert_eq!((modulus / 2600.0).sqrt().round(), 2275.0);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    pub fn p_wave_modulus(&self) -> f64 {
        self.lambda + 2.0 * self.shear
    }

    /// The bulk modulus K = Λ + 2G/3.
    ///
    /// ```
    /// use bfree::material::Lame;
    ///
    /// assert_eq!(Lame::new(1.0, 1.5)?.bulk_modulus(), 2.0);
    /// # Ok::<(), bfree::material::LameError>(())
    /// ```
    pub fn bulk_modulus(&self) -> f64 {
        self.lambda + 2.0 * self.shear / 3.0
    }
}

/// The largest Λ/G allowed. Above it a stress has fewer than four digits of G.
const APART: f64 = 1e12;

/// The constants of an isotropic law: exactly one of the pairs `lambda` and `shear`, `young` and `poisson`, `bulk` and
/// `shear`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Constants")]
#[serde(deny_unknown_fields)]
pub struct LameParameters {
    /// Lamé's Λ (stress), > −2/3 `shear`.
    pub lambda: Option<f64>,
    /// The shear modulus G (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub shear: Option<f64>,
    /// Young's modulus E (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub young: Option<f64>,
    /// Poisson's ratio ν (no unit), −1 < ν < 0.5.
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 0.5))]
    pub poisson: Option<f64>,
    /// The bulk modulus K = Λ + 2/3 G (stress), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub bulk: Option<f64>,
}

impl LameParameters {
    /// Λ and G. `None` if a value below the key `path` is not allowed; `problems` then says why.
    pub(crate) fn lame(&self, problems: &mut Problems, path: &str) -> Option<Lame> {
        let Self { lambda, shear, young, poisson, bulk } = *self;
        let keys = [("lambda", lambda), ("shear", shear), ("young", young), ("poisson", poisson), ("bulk", bulk)];
        let given: Vec<(&str, f64)> = keys.into_iter().filter_map(|(key, value)| Some((key, value?))).collect();
        let mut sensible = true;
        for (key, value) in &given {
            let (path, any_sign) = (format!("{path}.{key}"), matches!(*key, "lambda" | "poisson"));
            sensible &= if any_sign { problems.number(&path, *value) } else { problems.positive(&path, *value) };
        }
        let lame = match (lambda, shear, young, poisson, bulk) {
            (Some(lambda), Some(shear), None, None, None) => Lame::new(lambda, shear),
            (None, None, Some(young), Some(poisson), None) => Lame::from_young_poisson(young, poisson),
            (None, Some(shear), None, None, Some(bulk)) => Lame::from_bulk_shear(bulk, shear),
            _ => {
                let keys: Vec<&str> = given.iter().map(|(key, _)| *key).collect();
                let found = if keys.is_empty() { "nothing".to_owned() } else { keys.join(" with ") };
                let allowed = "must be exactly one of the pairs lambda and shear, young and poisson, bulk and shear";
                problems.refuse(path, found, allowed);
                return None;
            }
        };
        if !sensible {
            return None;
        }
        let (key, value, allowed) = match (lame, lambda, poisson) {
            (Ok(lame), ..) => {
                let ratio = lame.lambda / lame.shear;
                let allowed = format_args!("the smaller modulus must not be lost in the larger one: at most {APART:e}");
                let found = format_args!("lambda / shear = {}", Number(ratio));
                return problems.require(ratio <= APART, path, found, allowed).then_some(lame);
            }
            (Err(LameError::Poisson(poisson)), ..) => ("poisson", poisson, "must be > -1 and < 0.5".to_owned()),
            // The moduli given are positive, but not the bulk modulus that follows from them.
            (Err(_), Some(lambda), _) => {
                let least = Number(-2.0 / 3.0 * shear.unwrap_or(0.0));
                ("lambda", lambda, format!("must be greater than -2/3 shear = {least}"))
            }
            (Err(_), None, Some(poisson)) => {
                let allowed = "the bulk modulus young / (3 (1 - 2 poisson)) must be finite and > 0";
                ("poisson", poisson, allowed.to_owned())
            }
            (Err(error), ..) => ("bulk", bulk.unwrap_or(0.0), format!("{error}, beside this shear modulus")),
        };
        problems.refuse(&format!("{path}.{key}"), Number(value), allowed);
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_pairs_of_constants_give_the_same_solid() -> Result<(), Box<dyn std::error::Error>> {
        // E = 2.5, ν = ¼ is Λ = G = 1. One constant of each is not a pair.
        let mut problems = Problems::default();
        let mut lame =
            |text| serde_json::from_str::<LameParameters>(text).map(|given| given.lame(&mut problems, "material"));
        assert_eq!(lame(r#"{"young": 2.5, "poisson": 0.25}"#)?, Lame::new(1.0, 1.0).ok());
        assert_eq!(lame(r#"{"lambda": 1, "shear": 1}"#)?, Lame::new(1.0, 1.0).ok());
        assert!(lame(r#"{"young": 2.5, "shear": 1}"#)?.is_none());
        assert!(problems.to_string().contains("shear with young"), "{problems}");
        Ok(())
    }
}
