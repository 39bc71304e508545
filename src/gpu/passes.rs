//! Passes without laws on a device: a nodal field at all particles, and sums of forces of the particles at the nodes.

use super::device::arguments;
use super::transfer::{Gathers, Transfer};

impl Transfer {
    /// Σ u_I N_I of each field at all particles, in the order of the passes; behind that of the first field Σ u_I ⊗ ∇N_I by columns, if
    /// `gradient`. Returns whether `results` were written.
    pub(crate) fn gather(&self, fields: &[&[f64]], gradient: bool, results: &mut [f64]) -> bool {
        let (gpu, d) = (self.gpu(), self.dimension);
        let more = if gradient { d * d } else { 0 };
        if fields.iter().any(|u| u.len() < self.nodal * d) {
            return false;
        }
        let (found, stride) = (gpu.memory_for(results.len()), fields.len() * d + more);
        for (i, u) in fields.iter().enumerate() {
            let u = gpu.copy_of(u);
            // `AtParticles` of `kernels/data.h`.
            let arguments = arguments! {
                transfer: self.arguments(),
                u: u.address(),
                results: found.address(),
                stride: stride as i32,
                first: if i > 0 { i * d + more } else { 0 } as i32,
                gradient: i32::from(gradient && i == 0),
            };
            self.launch(["at_particles_1", "at_particles_2", "at_particles_3"], self.shared, &arguments);
        }
        gpu.read_at(&found, 0, results);
        gpu.check().is_ok()
    }

    /// `out += Σ_p q_p N_I`. The forces q lie in the order of the passes, and have the first `components` of those of `out`. Returns whether the
    /// forces were added. Otherwise `out` is unchanged.
    pub(crate) fn spread(&self, components: usize, forces: &[f64], out: &mut [f64]) -> bool {
        let gpu = self.gpu();
        let _lock = gpu.lock();
        let (forces, start, mut sums) = (gpu.copy_of(forces), gpu.copy_of(out), gpu.memory_for(out.len()));
        let gathers = Gathers { values: true, gradients: false, magnitudes: false };
        // `Spread` of `kernels/data.h`.
        let arguments =
            arguments! { pass: self.pass(0, gathers), forces: forces.address(), components: components as i32 };
        self.launch(["spread_1", "spread_2", "spread_3"], self.shared, &arguments);
        self.add_boxes(&start, &mut sums);
        gpu.read_all(&sums, out)
    }
}
