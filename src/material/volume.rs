//! What a law makes of a change of volume alone.

/// The part U(θ) of an energy that depends on the volume ratio θ alone, per reference volume, and how it changes with ln θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeResponse<T> {
    /// U
    pub energy: T,
    /// θ U', Kirchhoff's mean stress.
    pub stress: T,
    /// θ (θ U')'
    pub stiffness: T,
}
