//! Passes without laws on a device: a nodal field at all particles, and sums of forces of the particles at the nodes.

use super::device::arguments;
use super::transfer::{Gathers, Transfer};

impl Transfer {
    /// Σ u_I N_I at all particles, or Σ u_I ⊗ ∇N_I by columns, in the order of the passes. Returns whether `results` were written.
    pub(crate) fn gather(&self, gradients: bool, u: &[f64], results: &mut [f64]) -> bool {
        let gpu = self.gpu();
        let (u, found) = (gpu.copy_of(u), gpu.memory_for(results.len()));
        // `AtParticles` of `kernels/data.h`.
        let arguments = arguments! {
            transfer: self.arguments(),
            u: u.address(),
            results: found.address(),
            gradients: i32::from(gradients),
        };
        self.launch(["at_particles_1", "at_particles_2", "at_particles_3"], self.shared, &arguments);
        gpu.read_at(&found, 0, results);
        gpu.check().is_ok()
    }

    /// `out += Σ_p q_p N_I`, or `Σ_p q_p |N_I|` if `magnitudes`. The forces q lie in the order of the passes, and have the first `components`
    /// of those of `out`. Returns whether the forces were added. Otherwise `out` is unchanged.
    pub(crate) fn spread(&self, components: usize, magnitudes: bool, forces: &[f64], out: &mut [f64]) -> bool {
        let gpu = self.gpu();
        let _lock = gpu.lock();
        let (forces, start, mut sums) = (gpu.copy_of(forces), gpu.copy_of(out), gpu.memory_for(out.len()));
        let gathers = Gathers { values: true, gradients: false, magnitudes };
        // `Spread` of `kernels/data.h`.
        let arguments =
            arguments! { pass: self.pass(0, gathers), forces: forces.address(), components: components as i32 };
        self.launch(["spread_1", "spread_2", "spread_3"], self.shared, &arguments);
        self.add_boxes(&start, &mut sums);
        gpu.read_all(&sums, out)
    }
}
