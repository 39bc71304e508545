//! The two constants of an isotropic solid, in any of the three usual pairs.

/// Lamé's constants Λ and G, in the user's unit of stress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    /// Λ
    pub lambda: f64,
    /// The shear modulus G.
    pub shear: f64,
}

/// Constants that no stable solid has.
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
    /// G ≤ 0 or K = Λ + 2G/3 ≤ 0, or not finite.
    pub fn new(lambda: f64, shear: f64) -> Result<Self, LameError> {
        if !(shear > 0.0 && shear.is_finite()) {
            return Err(LameError::Shear(shear));
        }
        let bulk = lambda + 2.0 * shear / 3.0;
        if !(bulk > 0.0 && bulk.is_finite()) {
            return Err(LameError::Bulk(bulk));
        }
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
        if !(young > 0.0 && young.is_finite()) {
            return Err(LameError::Young(young));
        }
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
    /// // The paper's rebound: K = 170, G = 30. The same solid by E = 9KG/(3K + G), ν = (3K − 2G)/(6K + 2G).
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
    /// K ≤ 0 or G ≤ 0, or not finite.
    pub fn from_bulk_shear(bulk: f64, shear: f64) -> Result<Self, LameError> {
        if !(bulk > 0.0 && bulk.is_finite()) {
            return Err(LameError::Bulk(bulk));
        }
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
}
