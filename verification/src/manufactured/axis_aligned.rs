//! Large strain: displacement along the axes of a unit square (after Brannon, Kamojjala, Sadeghirad 2011).

use super::Motion;
use bfree::scalar::Real;
use bfree::tensor::Vector;

/// u₁ = A sin(2πX₁) sin(ωt), u₂ = −A sin(2πX₂) sin(ωt), and u₃ as u₁, in the unit square or cube: no normal displacement at its
/// walls, F diagonal with stretches 1 ± 2πA.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisAligned {
    /// A, a length.
    pub amplitude: f64,
    /// ω, in radians per time.
    pub frequency: f64,
}

impl Default for AxisAligned {
    /// Stretches from 0.5 to 1.5, reached at t = 1.
    fn default() -> Self {
        Self { amplitude: 0.5 / std::f64::consts::TAU, frequency: std::f64::consts::FRAC_PI_2 }
    }
}

impl<const D: usize> Motion<D> for AxisAligned {
    fn displacement<T: Real>(&self, x: &Vector<T, D>, t: T) -> Vector<T, D> {
        let amplitude = T::lit(self.amplitude) * (T::lit(self.frequency) * t).sin();
        let wave = |x: T| amplitude * (T::lit(std::f64::consts::TAU) * x).sin();
        Vector::from_fn(|k, _| if k == 1 { -wave(x[k]) } else { wave(x[k]) })
    }
}
