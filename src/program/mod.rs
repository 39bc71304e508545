//! The command-line program: joins scenes, simulations and output.
//!
//! It is part of the library. As a crate of its own it would compile every generic function of the library once more.

mod agreement;
mod check_law;
mod command;
mod directory;
mod failure;
mod new;
mod newton;
mod options;
mod pack;
mod probes;
mod provenance;
mod reproduce;
mod run;
mod scene_arguments;
mod steps;

pub use command::main;
