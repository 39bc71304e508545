//! The GPU on which studies solve linear systems, if the command line says so.

use bfree::gpu::{Gpu, GpuError};
use std::sync::{Arc, OnceLock};

static USED: OnceLock<Arc<Gpu>> = OnceLock::new();

/// Lets the studies in [`crate::studies::ON_DEVICE`] use the GPU of this machine from now on.
///
/// # Errors
/// There is no GPU that can be used.
pub fn open() -> Result<(), GpuError> {
    let gpu = Arc::new(Gpu::open()?);
    USED.get_or_init(|| gpu);
    Ok(())
}

/// The GPU, if studies use one.
pub fn used() -> Option<Arc<Gpu>> {
    USED.get().cloned()
}
