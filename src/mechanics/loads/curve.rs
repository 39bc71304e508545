//! Factors in time.

/// A piecewise-linear function of time, constant before its first and after its last point.
///
/// ```
/// use bfree::mechanics::loads::Curve;
///
/// // Gravity that ramps up over 1 s. The velocity is the integral of its value, and the value is the integral of its slope.
/// let ramp = Curve::new(vec![[0.0, 0.0], [1.0, 9.81]])?;
/// assert_eq!((ramp.slope(0.5), ramp.slope(2.0)), (9.81, 0.0));
/// assert_eq!(ramp.value(0.5), 0.5 * ramp.slope(0.5));
/// assert_eq!(ramp.integral(0.0, 1.0) + ramp.integral(1.0, 3.0), ramp.integral(0.0, 3.0));
/// // After the ramp, the integral is that of constant gravity from t = 0.5 on.
/// assert_eq!(ramp.integral(0.0, 3.0), Curve::constant(9.81).integral(0.5, 3.0));
/// # Ok::<(), bfree::mechanics::loads::CurveError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    points: Vec<[f64; 2]>,
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
        Ok(Self { points })
    }

    /// The constant function.
    pub fn constant(value: f64) -> Self {
        Self { points: vec![[0.0, value]] }
    }

    /// The piece `[a, b]` that holds `t`, if `t` lies between the first and the last point.
    fn piece(&self, t: f64) -> Option<([f64; 2], [f64; 2])> {
        let after = self.points.partition_point(|point| point[0] <= t);
        (after > 0 && after < self.points.len()).then(|| (self.points[after - 1], self.points[after]))
    }

    /// The value at time `t`.
    ///
    /// ```
    /// use bfree::mechanics::loads::Curve;
    ///
    /// let ramp = Curve::new(vec![[0.0, 0.0], [2.0, 1.0]])?;
    /// assert_eq!((ramp.value(-1.0), ramp.value(1.0), ramp.value(9.0)), (0.0, 0.5, 1.0));
    /// assert_eq!((ramp.slope(1.0), ramp.slope(9.0)), (0.5, 0.0));
    /// assert_eq!(ramp.integral(0.0, 3.0), 2.0);
    /// assert!(Curve::new(vec![[1.0, 0.0], [1.0, 1.0]]).is_err());
    /// # Ok::<(), bfree::mechanics::loads::CurveError>(())
    /// ```
    pub fn value(&self, t: f64) -> f64 {
        match self.piece(t) {
            Some((a, b)) => a[1] + (b[1] - a[1]) * ((t - a[0]) / (b[0] - a[0])),
            None if t < self.points[0][0] => self.points[0][1],
            None => self.points[self.points.len() - 1][1],
        }
    }

    /// The slope at time `t`; at a kink, the slope of the piece after the kink.
    pub fn slope(&self, t: f64) -> f64 {
        self.piece(t).map_or(0.0, |(a, b)| (b[1] - a[1]) / (b[0] - a[0]))
    }

    /// The slopes at the start of the step from `t` to `t + dt`, from the right, and at its end, from the left. They are evaluated slightly
    /// inside the step, so that round-off at a kink does not bring in the neighbouring piece.
    pub(super) fn slopes(&self, t: f64, dt: f64) -> [f64; 2] {
        [1e-6, 1.0 - 1e-6].map(|part| self.slope(t + part * dt))
    }

    /// ∫ value dt from `from` to `to`, exactly, kinks included.
    pub fn integral(&self, from: f64, to: f64) -> f64 {
        let kinks = self.points.iter().map(|point| point[0]).filter(|&t| t > from && t < to);
        let mut sum = 0.0;
        let mut start = from;
        for end in kinks.chain(std::iter::once(to)) {
            sum += 0.5 * (self.value(start) + self.value(end)) * (end - start);
            start = end;
        }
        sum
    }
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
