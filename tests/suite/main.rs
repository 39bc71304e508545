//! Promises of the library, in one program: what is generic is compiled once.

mod accuracy;
mod adaptive;
mod approximation;
mod compaction;
mod damping;
mod dynamics;
mod equilibrium;
mod examples;
mod hostile;
mod ladder;
mod laws;
mod loads;
mod memory;
mod output;
mod points;
mod program;
mod rebound;
mod restart;
mod runs;
mod scenes;
mod smoothing;
mod statics;
mod storage;
mod support;
mod sweep;
mod transfer;
