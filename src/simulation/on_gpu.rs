//! A simulation on a GPU, and the parts of a simulation that do not run there yet.

use super::Simulation;
use crate::approximation::ShapeFunction;
use crate::gpu::{Gpu, GpuError};
use crate::material::Law;
use crate::mechanics::sweep::WIDEST;
use std::sync::Arc;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// Runs Newton's method and the transfers of all further steps on the GPU of this machine, which is returned.
    ///
    /// ```
    /// use bfree::gpu::GpuError;
    ///
    /// let mut simulation = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?.build::<2>("scenes".as_ref())?;
    /// match simulation.use_gpu() {
    ///     Ok(gpu) => println!("on {}", gpu.name()),
    ///     Err(GpuError::NoDriver) => println!("no driver: the processor solves them"),
    ///     Err(other) => return Err(other.into()),
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A part of the simulation does not run there, or there is no device.
    pub fn use_gpu(&mut self) -> Result<Arc<Gpu>, GpuError> {
        self.check_gpu()?;
        let gpu = Arc::new(Gpu::open()?);
        self.settings.gpu = Some(gpu.clone());
        Ok(gpu)
    }

    /// Whether the simulation can run on a GPU.
    ///
    /// # Errors
    /// The first part that cannot.
    fn check_gpu(&self) -> Result<(), GpuError> {
        let refused = |part, cure| Err(GpuError::NotYet { part, cure });
        match self.approximation.separable() {
            None => return refused("LME functions on a circle of nodes do", "take \"support\": \"separable\""),
            Some(product) if product.width() > WIDEST => {
                return refused("functions of more than 16 nodes an axis do", "take a larger gamma");
            }
            Some(_) => {}
        }
        if self.settings.processes.are_several() {
            return refused("several processes do", "start one process");
        }
        if self.is_mixed() {
            let cure = "set solver.krylov.preconditioner to \"block_jacobi\"";
            return refused("unknowns for the dilatations of cells do", cure);
        }
        Ok(())
    }
}
