//! Promises of the library, in one program: what is generic is compiled once.

mod accuracy;
mod approximation;
mod compaction;
mod dynamics;
mod equilibrium;
mod examples;
mod hostile;
mod loads;
mod output;
mod points;
mod program;
mod rebound;
mod restart;
mod runs;
mod scenes;
mod smoothing;
mod support;
mod sweep;
mod transfer;
