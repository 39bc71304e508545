//! Large rotation: a vortex (after Brannon, Kamojjala, Sadeghirad 2011, and Kamojjala et al., Engineering with Computers 31, 2015).

use super::Motion;
use bfree::scalar::Real;
use bfree::tensor::Vector;

/// x = Q(α) X with α(R, t) = A sin(ωt) (1 − R²)⁵ inside R = |X| < 1, and no motion outside.
///
/// The published profile on an annulus is once differentiable at its rims and has a shear of 6 A. This profile is four times
/// differentiable, and the body force twice, so that the quadrature over particles shows orders up to four. J = 1 everywhere; the rim R = 1
/// is free of stress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vortex {
    /// A, the largest rotation in radians.
    pub amplitude: f64,
    /// ω, in radians per time.
    pub frequency: f64,
}

impl Default for Vortex {
    /// A quarter turn at the centre at t = 1, and a shear of up to 1.3 around it.
    fn default() -> Self {
        Self { amplitude: std::f64::consts::FRAC_PI_2, frequency: std::f64::consts::FRAC_PI_2 }
    }
}

impl Motion<2> for Vortex {
    fn displacement<T: Real>(&self, x: &Vector<T, 2>, t: T) -> Vector<T, 2> {
        let rest = T::one() - (x[0] * x[0] + x[1] * x[1]);
        if rest.value() <= 0.0 {
            return Vector::zeros();
        }
        let alpha = T::lit(self.amplitude) * (T::lit(self.frequency) * t).sin() * rest.powi(5);
        // cos α − 1 = −2 sin² α/2
        let (sin, half) = (alpha.sin(), (alpha * T::lit(0.5)).sin());
        let cos_minus_one = T::lit(-2.0) * half * half;
        Vector::from([cos_minus_one * x[0] - sin * x[1], sin * x[0] + cos_minus_one * x[1]])
    }
}
