//! The motion of a prescribed component over one step.

/// The motion of a prescribed component over one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionStep {
    /// g(t_{n+1}) − g(t_n)
    pub increment: f64,
    /// ġ, g̈ at the start of the step (from the right, where the curve has a kink).
    pub velocity_start: f64,
    /// See [`Self::velocity_start`].
    pub acceleration_start: f64,
    /// ġ, g̈ at the end of the step (from the left, where the curve has a kink).
    pub velocity_end: f64,
    /// See [`Self::velocity_end`].
    pub acceleration_end: f64,
}
