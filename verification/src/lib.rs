//! The verification of bfree. Its checks also serve the tests of other crates:
//!
//! ```
//! use bfree::material::{Lame, NeoHookean};
//!
//! let law = NeoHookean::ciarlet(Lame::new(100.0, 40.0)?);
//! let report = verification::check_material(&law);
//! assert!(report.passed(), "{report}");
//! # Ok::<(), bfree::material::LameError>(())
//! ```

#[cfg(feature = "studies")]
pub mod axis;
mod check;
#[cfg(feature = "studies")]
pub mod device;
#[cfg(feature = "studies")]
pub mod double_double;
#[cfg(feature = "studies")]
pub mod known;
#[cfg(feature = "studies")]
pub mod manufactured;
#[cfg(feature = "studies")]
pub mod processor;
pub mod random;
#[cfg(feature = "studies")]
pub mod record;
pub mod report;
#[cfg(feature = "studies")]
pub mod riemann;
#[cfg(feature = "studies")]
mod settling;
#[cfg(feature = "studies")]
pub mod sheet;
#[cfg(feature = "studies")]
pub mod shipped;
#[cfg(feature = "studies")]
pub mod start;
#[cfg(feature = "studies")]
pub mod studies;
#[cfg(feature = "studies")]
pub mod symmetry;
pub mod table;

pub use check::{check_approximation, check_material, check_material_from, check_tangent};
pub use report::{Bound, Cell, Report, Verdict};
