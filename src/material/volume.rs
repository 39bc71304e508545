//! The response of a law to a change of volume alone.

/// The part U(θ) of the energy per reference volume that depends on the volume ratio θ alone, and its derivatives with respect to ln θ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeResponse<T> {
    /// U
    pub energy: T,
    /// θ U', the mean Kirchhoff stress.
    pub stress: T,
    /// θ (θ U')'
    pub stiffness: T,
}
