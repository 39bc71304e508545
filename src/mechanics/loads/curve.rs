//! Factors in time.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A piecewise-linear function of time, constant before its first and after its last point, or a sine.
///
/// ```
/// use bfree::mechanics::loads::Curve;
///
/// // Gravity that ramps up over 1 s.
/// let ramp = Curve::new(vec![[0.0, 0.0], [1.0, 9.81]])?;
/// assert_eq!((ramp.slope(0.5), ramp.slope(2.0)), (9.81, 0.0));
/// assert_eq!(ramp.value(0.5), 0.5 * ramp.slope(0.5));
/// # Ok::<(), bfree::mechanics::loads::CurveError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Curve(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Points(Vec<[f64; 2]>),
    Sine(Sine),
}

/// mean + amplitude · sin(2π frequency t + phase)
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    /// The mean. Default: 0.
    #[serde(default)]
    pub mean: f64,
    /// The amplitude. Default: 1.
    #[serde(default = "default_amplitude")]
    pub amplitude: f64,
    /// The frequency (1/time), > 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub frequency: f64,
    /// The phase (radians). Default: 0.
    #[serde(default)]
    pub phase: f64,
}

fn default_amplitude() -> f64 {
    1.0
}

impl Sine {
    fn angle(&self, t: f64) -> f64 {
        TAU * self.frequency * t + self.phase
    }

    /// ∫ value dt. Over a short time, the difference of the cosines is 2 sin(Δ/2) sin(middle) to the last digit.
    fn integral(&self, from: f64, to: f64) -> f64 {
        let (half, middle) = (0.5 * TAU * self.frequency * (to - from), 0.5 * (self.angle(from) + self.angle(to)));
        self.mean * (to - from) + self.amplitude / (TAU * self.frequency) * 2.0 * half.sin() * middle.sin()
    }
}

/// A list of points that does not define a curve.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CurveError {
    /// No points.
    #[error("a curve needs at least one point [time, value]")]
    Empty,
    /// Time must grow strictly.
    #[error("point {index}: time {time} does not come after {previous}; times must increase")]
    Order {
        /// The offending point.
        index: usize,
        /// The time of this point.
        time: f64,
        /// The time of the point before.
        previous: f64,
    },
    /// NaN or infinite.
    #[error("point {index} is not finite")]
    NotFinite {
        /// The offending point.
        index: usize,
    },
    /// A sine with a number that is not finite, or a frequency that is not positive.
    #[error("{0:?} must be finite, and its frequency > 0")]
    Sine(Sine),
}

impl Curve {
    /// A curve from points `[time, value]` with strictly increasing times.
    ///
    /// # Errors
    /// No points, times out of order, or numbers that are not finite.
    pub fn new(points: Vec<[f64; 2]>) -> Result<Self, CurveError> {
        if points.is_empty() {
            return Err(CurveError::Empty);
        }
        for (index, point) in points.iter().enumerate() {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(CurveError::NotFinite { index });
            }
            if index > 0 && point[0] <= points[index - 1][0] {
                return Err(CurveError::Order { index, time: point[0], previous: points[index - 1][0] });
            }
        }
        Ok(Self(Kind::Points(points)))
    }

    /// A sine.
    ///
    /// ```
    /// use bfree::mechanics::loads::{Curve, Sine};
    ///
    /// let sine = Curve::sine(Sine { mean: 0.0, amplitude: 1.0, frequency: 2.0, phase: 0.0 })?;
    /// assert_eq!((sine.value(0.0), sine.slope(0.0)), (0.0, 4.0 * std::f64::consts::PI));
    /// # Ok::<(), bfree::mechanics::loads::CurveError>(())
    /// ```
    ///
    /// # Errors
    /// A number that is not finite, or a frequency that is not positive.
    pub fn sine(sine: Sine) -> Result<Self, CurveError> {
        let Sine { mean, amplitude, frequency, phase } = sine;
        let is_finite = [mean, amplitude, frequency, phase].iter().all(|x| x.is_finite());
        if is_finite && frequency > 0.0 { Ok(Self(Kind::Sine(sine))) } else { Err(CurveError::Sine(sine)) }
    }

    /// The curve times a number.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self(match self.0 {
            Kind::Points(points) => Kind::Points(points.into_iter().map(|[t, x]| [t, factor * x]).collect()),
            Kind::Sine(sine) => {
                Kind::Sine(Sine { mean: factor * sine.mean, amplitude: factor * sine.amplitude, ..sine })
            }
        })
    }

    /// The constant function.
    pub fn constant(value: f64) -> Self {
        Self(Kind::Points(vec![[0.0, value]]))
    }

    /// The value at time `t`.
    ///
    /// ```
    /// use bfree::mechanics::loads::Curve;
    ///
    /// let ramp = Curve::new(vec![[0.0, 0.0], [2.0, 1.0]])?;
    /// assert_eq!((ramp.value(-1.0), ramp.value(1.0), ramp.value(9.0)), (0.0, 0.5, 1.0));
    /// assert_eq!((ramp.slope(1.0), ramp.slope(9.0)), (0.5, 0.0));
    /// assert!(Curve::new(vec![[1.0, 0.0], [1.0, 1.0]]).is_err());
    /// # Ok::<(), bfree::mechanics::loads::CurveError>(())
    /// ```
    pub fn value(&self, t: f64) -> f64 {
        match &self.0 {
            Kind::Sine(sine) => sine.mean + sine.amplitude * sine.angle(t).sin(),
            Kind::Points(points) => match piece(points, t) {
                Some((a, b)) => a[1] + (b[1] - a[1]) * ((t - a[0]) / (b[0] - a[0])),
                None if t < points[0][0] => points[0][1],
                None => points[points.len() - 1][1],
            },
        }
    }

    /// The slope at time `t`; at a kink, the slope of the piece after the kink.
    pub fn slope(&self, t: f64) -> f64 {
        match &self.0 {
            Kind::Sine(sine) => TAU * sine.frequency * sine.amplitude * sine.angle(t).cos(),
            Kind::Points(points) => piece(points, t).map_or(0.0, |(a, b)| (b[1] - a[1]) / (b[0] - a[0])),
        }
    }

    /// The slopes at the start of the step from `t` to `t + dt`, from the right, and at its end, from the left. They are evaluated slightly
    /// inside the step, so that round-off at a kink does not bring in the neighbouring piece.
    pub(super) fn slopes(&self, t: f64, dt: f64) -> [f64; 2] {
        [1e-6, 1.0 - 1e-6].map(|part| self.slope(t + part * dt))
    }

    /// ∫ value dt from `from` to `to`, exactly, kinks included.
    pub(crate) fn integral(&self, from: f64, to: f64) -> f64 {
        let points = match &self.0 {
            Kind::Sine(sine) => return sine.integral(from, to),
            Kind::Points(points) => points,
        };
        let kinks = points.iter().map(|point| point[0]).filter(|&t| t > from && t < to);
        let mut sum = 0.0;
        let mut start = from;
        for end in kinks.chain(std::iter::once(to)) {
            sum += 0.5 * (self.value(start) + self.value(end)) * (end - start);
            start = end;
        }
        sum
    }
}

/// The piece `[a, b]` that holds `t`, if `t` lies between the first and the last point.
fn piece(points: &[[f64; 2]], t: f64) -> Option<([f64; 2], [f64; 2])> {
    let after = points.partition_point(|point| point[0] <= t);
    (after > 0 && after < points.len()).then(|| (points[after - 1], points[after]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_that_goes_back_in_time_is_refused() {
        let back = Curve::new(vec![[0.0, 0.0], [1.0, 2.0], [0.5, 2.0]]);
        assert_eq!(back, Err(CurveError::Order { index: 2, time: 0.5, previous: 1.0 }));
        assert_eq!(Curve::new(vec![]), Err(CurveError::Empty));
        assert_eq!(Curve::new(vec![[0.0, f64::NAN]]), Err(CurveError::NotFinite { index: 0 }));
    }

    #[test]
    fn value_slope_and_integral_of_a_sine_agree() -> Result<(), CurveError> {
        let sine = Curve::sine(Sine { mean: 0.3, amplitude: -2.0, frequency: 1.7, phase: 0.4 })?.times(1.5);
        let h = 1e-5;
        for t in [-0.3, 0.0, 0.21, 5.0] {
            assert!(((sine.value(t + h) - sine.value(t - h)) / (2.0 * h) - sine.slope(t)).abs() < 1e-7);
            assert!((sine.integral(t - h, t + h) / (2.0 * h) - sine.value(t)).abs() < 1e-8);
        }
        let part = sine.integral(0.1, 0.7) + sine.integral(0.7, 2.0);
        assert!((part - sine.integral(0.1, 2.0)).abs() < 1e-14);
        let slow = Sine { mean: 0.0, amplitude: 1.0, frequency: 0.0, phase: 0.0 };
        assert_eq!(Curve::sine(slow), Err(CurveError::Sine(slow)));
        Ok(())
    }

    #[test]
    fn a_curve_is_constant_before_and_after_and_linear_between() -> Result<(), CurveError> {
        let curve = Curve::new(vec![[2.0, 5.0], [6.0, 3.0], [6.5, -1.0]])?;
        let values = [-1.0, 2.0, 3.0, 5.0, 6.0, 6.125, 6.5, 9.0].map(|t| curve.value(t));
        assert_eq!(values, [5.0, 5.0, 4.5, 3.5, 3.0, 2.0, -1.0, -1.0]);
        let slopes = [1.0, 2.0, 5.0, 6.0, 6.25, 6.5, 7.0].map(|t| curve.slope(t));
        assert_eq!(slopes, [0.0, -0.5, -0.5, -8.0, -8.0, 0.0, 0.0]);
        // 5·2 before the first point, trapezia between, −1·½ after the last.
        assert_eq!(curve.integral(0.0, 7.0), 10.0 + 16.0 + 0.5 - 0.5);
        assert_eq!(curve.integral(0.0, 7.0), curve.integral(0.0, 6.25) + curve.integral(6.25, 7.0));
        Ok(())
    }
}
