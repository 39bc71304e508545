//! An eighth of a thick sphere under inner pressure, between planes of symmetry, against Lamé's solution. Its surfaces cut cells.

use super::{NEAR, Refined};
use crate::report::{Bound, Report};
use crate::studies::{Effort, Outcome, StudyError};
use crate::table::Table;
use bfree::material::{Law, MaterialState};
use bfree::scene;
use bfree::simulation::Simulation;
use bfree::tensor::Tensor;

/// Inner and outer radius; Λ = G of the scene's E = 2500, ν = ¼. Squares of strains, 1e-6, are below all errors.
const RADII: [f64; 2] = [1.0, 2.0];
const LAME: f64 = 1000.0;
const PRESSURE: f64 = 1e-3;

/// u = A r + B/r²: A = p a³/((3Λ + 2G)(b³ − a³)), B = p a³ b³/(4G (b³ − a³)).
fn constants() -> [f64; 2] {
    let [inner, outer] = RADII.map(|radius| radius.powi(3));
    [PRESSURE * inner / (5.0 * LAME * (outer - inner)), PRESSURE * inner * outer / (4.0 * LAME * (outer - inner))]
}

/// Errors of the displacement and of the stress; and the work.
fn shell(family: &str, cells: u32) -> Result<([f64; 2], f64), StudyError> {
    let spacing = f64::from(cells).recip();
    let size = RADII[1] + spacing;
    let [inner, outer] = RADII;
    let text = format!(
        r#"{{
            "grid": {{ "size": [{size}, {size}, {size}], "spacing": {spacing} }},
            "time": {{ "step": 1, "end": 1, "scheme": "none" }},
            "approximation": {family},
            "bodies": [{{
                "name": "shell",
                "shape": {{ "intersection": [
                    {{ "difference": {{ "of": {{ "ball": {{ "center": [0, 0, 0], "radius": {outer} }} }},
                                        "minus": {{ "ball": {{ "center": [0, 0, 0], "radius": {inner} }} }} }} }},
                    {{ "box": {{ "min": [0, 0, 0], "max": [3, 3, 3] }} }} ] }},
                "material": {{ "neo_hookean": {{ "young": 2500, "poisson": 0.25 }} }},
                "density": 1,
                "particles_per_cell": 2
            }}],
            "boundary": {{ "left": "sliding", "bottom": "sliding", "back": "sliding" }},
            "pressures": [{{ "body": "shell", "region": {{ "ball": {{ "center": [0, 0, 0], "radius": 1.5 }} }},
                             "pressure": {PRESSURE}, "curve": [[0, 0], [1, 1]] }}],
            "output": {{ "every": 1 }}
        }}"#
    );
    let mut simulation: Simulation<3> = scene::read(&text, &[])?.build(std::path::Path::new("."))?;
    let reference = simulation.particles.by_id().position;
    let mut products = 0;
    while simulation.clock.nominal_steps() < 1 {
        products += simulation.advance()?.newton.history.counts.tangent_products;
    }
    let particles = simulation.particles.by_id();
    let law = &simulation.bodies[0].law;
    let [a, b] = constants();
    let [mut displacement, mut stress] = [[0.0; 2]; 2];
    for (p, x) in reference.iter().enumerate().filter(|(p, _)| particles.is_solid(*p)) {
        let (radius, along) = (x.norm(), x / x.norm());
        let volume = particles.volume[p];
        let exact = along * (a * radius + b / radius.powi(2));
        displacement[0] += volume * (particles.position[p] - x - exact).norm_squared();
        displacement[1] += volume * exact.norm_squared();
        let at = MaterialState::new(particles.displacement_gradient[p]);
        let tau = at.f * law.stress(&at) * at.f.transpose();
        let radial = along * along.transpose();
        // σ_r = 5G A − 4G B/r³, σ_θ = 5G A + 2G B/r³
        let exact = Tensor::<f64, 3>::identity() * (LAME * (5.0 * a + 2.0 * b / radius.powi(3)))
            - radial * (6.0 * LAME * b / radius.powi(3));
        stress[0] += volume * (tau - exact).norm_squared();
        stress[1] += volume * exact.norm_squared();
    }
    let relative = |[found, exact]: [f64; 2]| (found / exact).sqrt();
    Ok(([relative(displacement), relative(stress)], (products * reference.len()) as f64))
}

/// The required orders are those in 2D: 2 for the displacement, 1.5 for the stress, 1 for that of linear functions.
pub(super) fn run(effort: Effort, outcome: &mut Outcome) {
    let title = "a thick sphere under inner pressure, the grid kept";
    let mut report = Report::new(format!("{title}: order in h"), &["of", "shape"]);
    let header = ["shape", "cells in 1", "displacement", "order", "stress", "order", "products x particles"];
    let mut table = Table::new(format!("{title}: errors, relative to Lamé's solution"), header);
    let full = effort == Effort::Full;
    let few: &[u32] = if full { &[2, 4, 8] } else { &[2, 4] };
    let families = [
        ("linear", "\"linear\"", few, 1.0),
        ("quadratic", r#"{"bspline":{"degree":2}}"#, few, 1.5),
        // From here on the error of the centroids of boxes shows: order 1.3.
        ("cubic", r#"{"bspline":{"degree":3}}"#, &[4, 8], 1.5),
    ];
    // The cubic shell of 8 cells takes as long as a fifth of the whole study at short effort.
    for (name, family, sizes, of_stress) in families.into_iter().filter(|&(name, ..)| full || name != "cubic") {
        let [displacement, stress] = [2.0, of_stress].map(|order| Bound::AtLeast(order - NEAR));
        let least = [("displacement, sphere", displacement), ("stress, sphere", stress)];
        Refined { report: &mut report, table: &mut table, least }.run(&[name], sizes, |cells| shell(family, cells));
    }
    outcome.reports.push(report);
    outcome.tables.push(table);
}
