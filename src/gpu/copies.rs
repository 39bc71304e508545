//! The copies of particles and their shape functions on a device.

use super::product::Masses;
use super::solids::States;
use super::transfer::Transfer;
use std::sync::{Arc, OnceLock};

/// Copies in the memory of a device, which are made at the first use. They stay as long as the shape functions.
#[derive(Debug, Default)]
pub(crate) struct Copies {
    pub transfer: OnceLock<Arc<Transfer>>,
    pub masses: OnceLock<Arc<Masses>>,
    pub states: OnceLock<Arc<States>>,
}
