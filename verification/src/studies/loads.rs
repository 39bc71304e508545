//! Uniform stress under tractions and pressures: every family, every offset in the cell, oblique faces and a disc.
//!
//! Loads P N on the free faces and two planes of symmetry keep a homogeneous deformation F exactly, for any shape of the body. Displacement
//! and stress are read where users read them: at the particles and at the points of the loaded surface.

use super::{Effort, Outcome, StudyError};
use crate::report::{Bound, Report};
use crate::table::Table;
use bfree::material::{Lame, Law, Material, MaterialState, NeoHookean};
use bfree::scene;
use bfree::simulation::Simulation;
use bfree::tensor::{Tensor, Vector, determinant};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// The summary in the list of studies.
pub(super) const ABOUT: &str = "uniform stress under tractions and pressures, at the particles and at the loaded faces";

/// E and ν of the law.
const YOUNG: f64 = 1000.0;
const POISSON: f64 = 0.3;

/// λ − 1 along x under tension, and in all directions under pressure.
const STRAIN: f64 = 0.01;

/// Cells per unit of length: the errors at the first are judged, and must fall to the second.
const CELLS: [u32; 2] = [8, 16];

/// uGIMP in boxes has exact sums over particles, so the errors are round-off times the condition of the stiffness: 2e-16 × 5e3.
const EXACT: f64 = 1e-12;
/// Error of the displacement of the loaded face at `CELLS[0]`, relative to the greatest displacement.
const DISPLACEMENT: f64 = 0.01;
/// Error of the stress at the loaded face at `CELLS[0]`, relative to the applied stress.
const STRESS: f64 = 0.1;

/// The depth of the points of a loaded surface below it, in spacings.
const DEPTH: f64 = 1e-6;

/// An error below this share of its bound need not fall.
const SMALL: f64 = 0.01;

/// The families of shape functions, by their keys in a scene.
fn families() -> [(&'static str, Value); 6] {
    [
        ("uGIMP", json!("gimp")),
        ("LME 3", json!({ "lme": { "gamma": 3 } })),
        ("LME 1.4", json!({ "lme": { "gamma": 1.4 } })),
        ("linear", json!("linear")),
        ("quadratic", json!({ "bspline": { "degree": 2 } })),
        ("cubic", json!({ "bspline": { "degree": 3 } })),
    ]
}

/// The body, between the planes of symmetry x = 0 and y = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// A box whose free faces lie this many spacings beyond a line of the grid.
    Box { offset: f64 },
    /// A box rotated by 27°, cut at the planes of symmetry.
    Turned,
    /// A quarter of a disc.
    Disc,
}

/// The load on the free faces.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Load {
    /// Tension along x: P = diag(P_xx, 0).
    Tension,
    /// A pressure that follows the surface.
    Pressure,
}

/// A form and its load.
struct Case {
    name: &'static str,
    form: Form,
    load: Load,
}

const CASES: [Case; 7] = [
    Case { name: "box on grid lines, tension", form: Form::Box { offset: 0.0 }, load: Load::Tension },
    Case { name: "box off by 0.3 h, tension", form: Form::Box { offset: 0.3 }, load: Load::Tension },
    Case { name: "box turned by 27°, tension", form: Form::Turned, load: Load::Tension },
    Case { name: "box on grid lines, pressure", form: Form::Box { offset: 0.0 }, load: Load::Pressure },
    Case { name: "box off by 0.3 h, pressure", form: Form::Box { offset: 0.3 }, load: Load::Pressure },
    Case { name: "box turned by 27°, pressure", form: Form::Turned, load: Load::Pressure },
    Case { name: "disc, pressure", form: Form::Disc, load: Load::Pressure },
];

impl Form {
    /// The shape in the form of a scene.
    fn shape(self, spacing: f64) -> Value {
        match self {
            Self::Box { offset } => {
                json!({ "box": { "min": [0, 0], "max": [1.0 + offset * spacing, 0.75 + offset * spacing] } })
            }
            Self::Turned => {
                let [along, across] = turned();
                let corner = [1.0 + 0.8 * across[0], 0.8 * across[1]];
                let left = corner[1] - corner[0] * along[1] / along[0];
                json!({ "polygon": [[0, 0], [1, 0], corner, [0, left]] })
            }
            Self::Disc => {
                json!({ "intersection": [{ "ball": { "center": [0, 0], "radius": 0.97 } }, { "box": { "min": [0, 0], "max": [1.5, 1.5] } }] })
            }
        }
    }

    /// The free flat faces: a point and the outward normal of each.
    fn faces(self, spacing: f64) -> Vec<([f64; 2], [f64; 2])> {
        match self {
            Self::Box { offset } => {
                vec![([1.0 + offset * spacing, 0.0], [1.0, 0.0]), ([0.0, 0.75 + offset * spacing], [0.0, 1.0])]
            }
            Self::Turned => {
                let [along, across] = turned();
                vec![([1.0, 0.0], along), ([1.0 + 0.8 * across[0], 0.8 * across[1]], across)]
            }
            Self::Disc => Vec::new(),
        }
    }
}

/// The axes of a box rotated by 27°.
fn turned() -> [[f64; 2]; 2] {
    let (sine, cosine) = 27.0_f64.to_radians().sin_cos();
    [[cosine, sine], [-sine, cosine]]
}

/// The exact deformation, and its first Piola–Kirchhoff stress.
struct Exact {
    gradient: Tensor<f64, 2>,
    piola: Tensor<f64, 2>,
}

fn law() -> Result<Material, StudyError> {
    Ok(NeoHookean::ciarlet(Lame::from_young_poisson(YOUNG, POISSON)?).into())
}

/// P = F S
fn piola(law: &Material, gradient: Tensor<f64, 2>) -> Tensor<f64, 2> {
    let at = MaterialState::new(gradient);
    at.f * law.stress(&at)
}

/// σ = P Fᵀ / J
fn cauchy(law: &Material, gradient: Tensor<f64, 2>) -> Tensor<f64, 2> {
    let f = gradient + Tensor::<f64, 2>::identity();
    piola(law, gradient) * f.transpose() / determinant(&f)
}

impl Exact {
    fn of(law: &Material, load: Load) -> Self {
        let stretched = |across: f64| Tensor::<f64, 2>::new(STRAIN, 0.0, 0.0, across);
        let gradient = match load {
            Load::Pressure => stretched(STRAIN) * -1.0,
            // The lateral face is free; bisection ends at neighbouring numbers.
            Load::Tension => {
                let (mut low, mut high) = (-STRAIN, 0.0);
                for _ in 0..100 {
                    let middle = 0.5 * (low + high);
                    if piola(law, stretched(middle))[(1, 1)] < 0.0 { low = middle } else { high = middle }
                }
                stretched(0.5 * (low + high))
            }
        };
        Self { gradient, piola: piola(law, gradient) }
    }
}

/// The scene of a case.
fn scene(case: &Case, family: &Value, cells: u32, exact: &Exact, law: &Material) -> Value {
    let spacing = f64::from(cells).recip();
    let mut scene = json!({
        "grid": { "size": [1.5, 1.5], "spacing": spacing },
        "approximation": family,
        "aggregation": true,
        "time": { "step": 1, "end": 1, "scheme": "none" },
        "bodies": [{
            "name": "body",
            "shape": case.form.shape(spacing),
            "material": { "neo_hookean": { "young": YOUNG, "poisson": POISSON } },
            "density": 1,
        }],
        "boundary": { "left": "sliding", "bottom": "sliding" },
        "solver": { "newton": { "tolerance": 1e-14 }, "krylov": { "forcing": { "fixed": 1e-6 } } },
    });
    match case.load {
        Load::Pressure => {
            scene["pressures"] = json!([{ "body": "body", "pressure": -cauchy(law, exact.gradient)[(0, 0)] }])
        }
        Load::Tension => {
            let loaded = case.form.faces(spacing).into_iter().map(|(point, normal)| {
                let traction = exact.piola * Vector::from(normal);
                let inwards = normal.map(|x| -x);
                let region = json!({ "half_space": { "point": point, "normal": inwards } });
                json!({ "body": "body", "region": region, "traction": [traction[0], traction[1]] })
            });
            scene["tractions"] = Value::Array(loaded.collect());
        }
    }
    scene
}

/// The largest relative errors: displacements at the particles and at the loaded faces, stresses at both, and the energy.
#[derive(Clone, Copy, Debug)]
struct Errors {
    displacement: [f64; 2],
    stress: [f64; 2],
    /// The dissipated energy over the strain energy.
    dissipated: f64,
    particles: usize,
}

fn errors(case: &Case, family: &Value, cells: u32) -> Result<Errors, StudyError> {
    let law = law()?;
    let exact = Exact::of(&law, case.load);
    let text = scene(case, family, cells, &exact, &law).to_string();
    let mut simulation: Simulation<2> = scene::read(&text, &[])?.build(Path::new("."))?;
    let start = simulation.particles.by_id().position;
    while simulation.clock.time() < 1.0 - 1e-9 {
        simulation.advance()?;
    }
    let now = simulation.particles.by_id();
    let stress = cauchy(&law, exact.gradient);
    let mut found = Errors {
        displacement: [0.0; 2],
        stress: [0.0; 2],
        dissipated: simulation.dissipated.abs() / simulation.strain_energy(),
        particles: now.len(),
    };
    // The displacement of a surface point is that of the surface itself.
    let mut shown = start.clone();
    for point in simulation.loads.surface.iter().flat_map(|load| &load.points) {
        shown[simulation.particles.id[point.particle] as usize] += point.normal * (DEPTH / f64::from(cells));
    }
    let greatest = start.iter().map(|x| (exact.gradient * x).norm()).fold(0.0, f64::max);
    for (p, x) in start.iter().enumerate() {
        let where_read = usize::from(!now.is_solid(p));
        let displacement = (now.position[p] - x - exact.gradient * shown[p]).norm() / greatest;
        let stress = (cauchy(&law, now.displacement_gradient[p]) - stress).norm() / stress.norm();
        // `max` would drop NaN.
        for (worst, one) in
            [(&mut found.displacement[where_read], displacement), (&mut found.stress[where_read], stress)]
        {
            if one.is_nan() || one > *worst {
                *worst = one;
            }
        }
    }
    Ok(found)
}

/// Judges the errors at both spacings.
fn judge(report: &mut Report, names: [&str; 2], exact: bool, [coarse, fine]: [Errors; 2]) {
    let mut push = |what: &str, value: f64, bound: Bound| report.push(&[names[0], names[1], what], value, bound);
    let places = ["particles", "loaded face"];
    let [displacement, stress] = if exact { [EXACT; 2] } else { [DISPLACEMENT, STRESS] };
    for (k, place) in places.into_iter().enumerate() {
        push(&format!("displacement, {place}"), coarse.displacement[k], Bound::AtMost(displacement));
        push(&format!("stress, {place}"), coarse.stress[k], Bound::AtMost(stress));
    }
    push("dissipated over strain energy", coarse.dissipated, Bound::AtMost(EXACT));
    if exact {
        // Round-off does not fall with the spacing.
        return;
    }
    let falls = |[fine, coarse]: [f64; 2], bound: f64| fine.max(SMALL * bound) / coarse.max(SMALL * bound);
    let of_displacement = falls([fine.displacement[1], coarse.displacement[1]], displacement);
    let of_stress = falls([fine.stress[1], coarse.stress[1]], stress);
    push("displacement of the face, h/2 over h", of_displacement, Bound::AtMost(1.0));
    push("stress at the face, h/2 over h", of_stress, Bound::AtMost(1.0));
}

pub(super) fn run(_effort: &Effort) -> Result<Outcome, StudyError> {
    let mut report = Report::new("greatest errors, relative", &["case", "shape", "of"]).as_matrix(&[0, 2], 1, 1);
    let header =
        ["case", "shape", "cells", "particles", "displacement", "at the face", "stress", "at the face", "dissipated"];
    let mut table =
        Table::new("greatest errors, relative to the greatest displacement and to the stress applied", header);
    let families = families();
    let all: Vec<(&Case, &(&str, Value))> =
        CASES.iter().flat_map(|case| families.iter().map(move |family| (case, family))).collect();
    let found: Vec<[Result<Errors, String>; 2]> = all
        .par_iter()
        .map(|(case, family)| {
            CELLS.map(|cells| errors(case, &family.1, cells).map_err(|error| crate::report::chain(error.as_ref())))
        })
        .collect();
    for ((case, (family, _)), found) in all.into_iter().zip(found) {
        for (cells, found) in CELLS.iter().zip(&found) {
            let numbers = found.as_ref().map_or_else(
                |error| vec![error.clone()],
                |errors| {
                    let [u, s] = [errors.displacement, errors.stress];
                    let numbers = [u[0], u[1], s[0], s[1], errors.dissipated].map(|x| format!("{x:.1e}"));
                    std::iter::once(errors.particles.to_string()).chain(numbers).collect()
                },
            );
            table.push([case.name.to_owned(), (*family).to_owned(), cells.to_string()].into_iter().chain(numbers));
        }
        let exact = *family == "uGIMP" && matches!(case.form, Form::Box { .. });
        match found {
            [Ok(coarse), Ok(fine)] => judge(&mut report, [case.name, family], exact, [coarse, fine]),
            [Err(error), _] | [_, Err(error)] => {
                // Runs without an equilibrium.
                report.push(&[case.name, family, "run"], 1.0, Bound::AtMost(0.0));
                report.note(format!("{}, {family}: {error}", case.name));
            }
        }
    }
    Ok(Outcome { reports: vec![report], tables: vec![table], ..Outcome::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Under tension the lateral face is free; under pressure the stress is equal in all directions.
    #[test]
    fn the_loads_are_those_of_the_deformation() -> Result<(), StudyError> {
        let law = law()?;
        let tension = Exact::of(&law, Load::Tension).piola;
        assert!(tension[(1, 1)].abs() < 1e-12 * tension[(0, 0)] && tension[(0, 0)] > 0.9 * STRAIN * YOUNG, "{tension}");
        let stress = cauchy(&law, Exact::of(&law, Load::Pressure).gradient);
        assert!(
            stress[(0, 0)] < 0.0 && (stress - Tensor::<f64, 2>::identity() * stress[(0, 0)]).norm() < 1e-12,
            "{stress}"
        );
        Ok(())
    }
}
