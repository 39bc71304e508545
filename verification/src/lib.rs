//! Everything that judges bfree. The checks are for other crates' tests too:
//!
//! ```
//! use bfree::material::{Lame, NeoHookean};
//!
//! let law = NeoHookean::ciarlet(Lame::new(100.0, 40.0)?);
//! let report = verification::check_material(&law);
//! assert!(report.passed(), "{report}");
//! # Ok::<(), bfree::material::LameError>(())
//! ```

pub mod baseline;
mod check;
pub mod double_double;
pub mod elements;
pub mod figure;
pub mod known;
pub mod manufactured;
pub mod prepared;
pub mod processor;
pub mod random;
pub mod record;
pub mod report;
pub mod riemann;
mod settling;
pub mod sheet;
pub mod shipped;
pub mod start;
pub mod studies;
pub mod table;

pub use check::{check_approximation, check_material, check_material_from, check_tangent};
pub use report::{Bound, Cell, Report, Verdict};
