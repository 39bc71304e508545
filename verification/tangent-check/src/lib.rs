//! Checks that a tangent is the derivative of its stress or residual, for any law and any code. There is no tolerance to choose.
//!
//! A checked law or residual is a black box: it gives values and claims a tangent. The derivative is measured by extrapolated differences
//! that know their own error ([`difference`]). The claimed tangent is compared with the measured one ([`judge`]), entry by entry, and each
//! check spoils the tangent by a small known amount to show that it would see it (the negative control). A wrong tangent is compared with
//! frequent mistakes ([`diagnosis`]).

pub mod convention;
pub mod convergence;
pub mod diagnosis;
pub mod difference;
pub mod finding;
pub mod judge;
pub mod law;
#[cfg(all(unix, feature = "libraries"))]
pub mod library;
pub mod matrix;
pub mod report;
pub mod roads;
pub mod states;
pub mod tensor;
