//! Checks that a tangent is the derivative of its stress or residual, for any law and any code. There is no tolerance to choose.
//!
//! A checked law or residual is a black box: it gives values and claims a tangent. The derivative is measured by extrapolated differences
//! that know their own error ([`difference`]). The claimed tangent is compared with the measured one ([`judge`]), entry by entry, and each
//! check spoils the tangent by a small known amount to show that it would see it (the negative control). [`roads::check_law`] compares a wrong
//! tangent with frequent mistakes ([`diagnosis`]). [`judge::check_columns`] does not, because it does not know what the columns mean.
//!
//! # A law with a wrong sign
//!
//! A law implements [`law::Law`]. [`states::for_law`] makes paths of deformation for it, and [`roads::check_law`] checks each step. The sign
//! of this tangent is wrong on purpose, and the report says so:
//!
//! ```
//! use tangent_check::convention::{Convention, Measure};
//! use tangent_check::finding::Verdict;
//! use tangent_check::law::{CallFailed, Law, Response, Step};
//! use tangent_check::matrix::Matrix;
//! use tangent_check::roads::check_law;
//! use tangent_check::states::for_law;
//! use tangent_check::tensor::{determinant, product, transposed};
//!
//! /// A neo-Hookean solid, J σ = G (b − I) + Λ ln J I, with its spatial tangent times a sign.
//! struct NeoHookean {
//!     sign: f64,
//! }
//!
//! impl Law for NeoHookean {
//!     fn name(&self) -> String {
//!         "neo-Hookean".to_string()
//!     }
//!     fn convention(&self) -> Convention {
//!         Convention::abaqus(Measure::Truesdell) // components 11, 22, 33, 12, 13, 23
//!     }
//!     fn state_at_rest(&self) -> Vec<f64> {
//!         Vec::new() // no internal variables
//!     }
//!     fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
//!         let (g, lambda) = (80.0, 120.0);
//!         let f = step.gradient;
//!         let (b, det) = (product(&f, &transposed(&f)), determinant(&f));
//!         let delta = |i: usize, j: usize| f64::from(i == j);
//!         let pressure = lambda * det.ln();
//!         let pairs = self.convention().stress.pairs;
//!         let stress = pairs.iter().map(|&(i, j)| (g * (b[i][j] - delta(i, j)) + pressure * delta(i, j)) / det).collect();
//!         let mut tangent = Matrix::zeros(6, 6);
//!         for (row, &(i, j)) in pairs.iter().enumerate() {
//!             for (column, &(k, l)) in pairs.iter().enumerate() {
//!                 let shear = delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k);
//!                 let modulus = lambda * delta(i, j) * delta(k, l) + (g - pressure) * shear;
//!                 tangent[(row, column)] = self.sign * modulus / det;
//!             }
//!         }
//!         Ok(Response { stress, tangent, state: Vec::new() })
//!     }
//! }
//!
//! let seed = 1;
//! let paths = for_law(&mut NeoHookean { sign: 1.0 }, seed)?;
//! check_law(&mut NeoHookean { sign: 1.0 }, &paths, seed).assert_consistent();
//!
//! let report = check_law(&mut NeoHookean { sign: -1.0 }, &paths, seed);
//! assert_eq!(report.verdict(), Verdict::Wrong);
//! assert_eq!(report.diagnoses[0].sentence, "Your tangent is the right one with the opposite sign.");
//! # Ok::<(), CallFailed>(())
//! ```
//!
//! In a test, `assert_consistent` is enough: it fails with the report as its message. [`judge::check_columns`] checks a plain function,
//! without paths.

/// The example of the README is compiled and run with the tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod convention;
pub mod convergence;
pub mod diagnosis;
pub mod difference;
pub mod finding;
mod json;
pub mod judge;
pub mod law;
#[cfg(all(unix, feature = "libraries"))]
pub mod library;
mod listed;
pub mod matrix;
#[cfg(all(unix, feature = "libraries"))]
pub mod program;
mod random;
pub mod report;
pub mod roads;
pub mod states;
pub mod tensor;
