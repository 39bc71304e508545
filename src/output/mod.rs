//! Results on disk and on screen. This module reads the simulation and does not change it.
//!
//! A [`Recorder`] writes into one directory during the run. If the run dies, the results so far are there:
//!
//! | file | content |
//! |---|---|
//! | `history.csv` | energies, momentum, Newton and Krylov iterations of every step |
//! | `reactions.csv` | force of every prescribed condition on the bodies, torque of rotations, if there are any |
//! | `contacts.csv` | force, moment, area and depth of contact, and friction loss of every pair of bodies in contact, if bodies may touch |
//! | `obstacles.csv` | force, moment, area and depth of contact, work and friction loss of every obstacle, if there are any |
//! | `probes.csv` | fields at chosen particles or points, if any are asked for |
//! | `particles.pvd`, `particles_*.vtu` | snapshots of the particles for ParaView |
//! | `obstacles.pvd`, `obstacles_*.vtu` | the surfaces of the obstacles at the same times, if there are any |
//! | `bodies.pvd`, `bodies_*.vtu` | the outlines of the bodies at the same times, in 2D, if all bodies are shapes that cut their cells |
//! | `contacts.pvd`, `contacts_*.vtu` | pressure, traction and gap of every surface point at the same times, if bodies may touch anything |
//! | `newton.jsonl` | Newton's method, one line per step; moved into `report.json` at the end, but also kept if there are checkpoints |
//! | `particles.vtkhdf` | all snapshots of the particles in one file, by `bfree pack`; so for the other series |
//! | `report.json` | settings, outcome, counts, seconds by phase, Newton and Krylov iterations and residuals of every step, warnings |
//!
//! [`plot::plot_run`] draws pictures of a directory, and a page with a player of the snapshots. Floats in text files have enough digits to
//! give back the same bits.

mod asked;
mod contact;
mod counts;
mod csv;
mod earlier;
mod error;
mod fields;
pub(crate) mod files;
mod hdf5;
pub mod history;
mod losses;
mod mark;
mod moved_outlines;
mod outlines;
pub(crate) mod path;
pub mod plot;
pub mod probes;
mod progress;
mod pvd;
mod recorder;
mod reference;
mod report;
pub(crate) mod rows;
pub(crate) mod snapshots;
mod summary;
mod surfaces;
mod touched;
mod vtkhdf;
pub mod vtu;
mod vtu_writer;
pub mod warnings;

pub(crate) use asked::Asked;
pub(crate) use earlier::{Role, foreign, held, outcome, role};
pub use error::OutputError;
pub use mark::Mark;
pub use probes::{Place, Probe, nearest};
pub use progress::Audience;
pub use recorder::{OutputSettings, Recorder};
pub use reference::Reference;
pub use report::Outcome;
pub(crate) use snapshots::unique;
pub use summary::Summary;
pub(crate) use vtkhdf::pack;
