//! Scenes at random.

use super::scene::{Form, Hold, Law, Load, Pressing, Scene, Scheme, Units};
use super::transform::{Pair, Transformation};
use crate::random::Random;
use serde_json::{Value, json};

/// Whether scenes use the stabilisation of nodes with little mass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Devices {
    /// The program's default, and loads on surfaces of shapes.
    Default,
    /// No stabilisation with inertia; loads on particles.
    Off,
}

/// The scene of a seed and its image.
pub fn draw(seed: u64, transformation: Transformation, devices: Devices) -> (Pair, String) {
    let mut random = Random::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let random = &mut random;
    let spacing = one_of(random, &[0.25, 0.2, 0.3]);
    let scheme = one_of(random, &[Scheme::Newmark, Scheme::GeneralizedAlpha, Scheme::LoadSteps]);
    let inertia = scheme != Scheme::LoadSteps;
    let half = transformation == Transformation::Doubled;
    let held = !inertia || one_of(random, &[true, false]);
    let (family_name, family) = family(random, half);
    // Gauss's rule for quadratic functions has half cells at the ends of a body. So there are more particles along a cut and across a slab.
    let regular = family_name == "uGIMP"
        || family_name == "quadratic" && matches!(transformation, Transformation::Split | Transformation::Slab);
    let layout = if regular { "regular" } else { one_of(random, &["regular", "gauss"]) };
    let (form_name, form) = form(random, spacing, transformation, held);
    // Points that integrate polynomials over cut cells differ from those of the mirror image.
    let fills: &[&str] = match (devices, layout) {
        (Devices::Off, "gauss") => &["particles"],
        // Aggregation takes the domain of a particle for a cube. Cut particles have other edges in the plane and in space.
        _ if transformation == Transformation::Slab && !inertia => &["particles"],
        _ => &["cut", "particles"],
    };
    let law = law(random, half);
    let renewed = match transformation {
        // Bodies in contact reset the grid in every step; without inertia they are bonded.
        Transformation::Split if inertia => json!("every_step"),
        _ => one_of(random, &[json!("every_step"), json!("never"), json!({ "strain": 0.02 })]),
    };
    // Means of cells are taken body by body, and particles that cross a cut before a grid reset change the body that they count for.
    let averages = law.has_volumetric_part() && (transformation != Transformation::Split || renewed == "never");
    let averaged = averages && one_of(random, &[true, false]);
    let steps = 3;
    // Without inertia bodies carry smaller loads.
    let share = if inertia { 1.0 } else { 0.3 };
    let mut scene = Scene {
        units: Units::ONE,
        origin: [0.0; 2],
        cells: [7, 8],
        spacing,
        family,
        layout,
        fill: one_of(random, fills),
        renewed,
        bodies: vec![form.clone()],
        law,
        averaged,
        velocity: [if half { 0.0 } else { random.between(-2.0, 2.0) }, random.between(-2.0, 2.0)],
        faces: faces(random, half, held, inertia),
        gravity: Some(
            [if half { 0.0 } else { random.between(-20.0, 20.0) }, random.between(-30.0, -10.0)].map(|g| share * g),
        ),
        load: None,
        scheme,
        // A pressure wave travels 0.3 to 3 cells in a step.
        step: if inertia { spacing / 36.7 * random.between(0.3, 3.0) } else { steps_of_load(steps) },
        steps,
        // The projection by a consistent mass is solved to 1e-12, in both scenes with different iterates.
        lumping: if transformation.changes_systems() { 1.0 } else { one_of(random, &[1.0, 0.5]) },
        // A plane of symmetry does not stop particles, so its prescribed nodes must not change their velocities.
        wall_update: if half { "literal" } else { one_of(random, &["literal", "consistent"]) },
        // Blending uses the projected velocities, and the projection of a half lacks the other half.
        blend: if half { None } else { one_of(random, &[None, Some(10.0)]) },
        damping: one_of(random, &[None, Some([1.0, 1e-4])]),
        // Without inertia only aggregation stabilises nodes with little mass.
        aggregation: (devices == Devices::Off).then_some(!inertia),
        forcing: 1e-9,
        slab: false,
    };
    scene.load = load(random, &scene, &form, share, devices);
    let name = format!(
        "{}: {family_name}, {law:?}{}, {scheme:?}, {form_name}, {layout}, {}, renewed {}, load {}",
        transformation.name(),
        if averaged { " averaged" } else { "" },
        scene.fill,
        scene.renewed,
        scene.load.as_ref().map_or("none".to_owned(), |load| format!("{:?}", load.pressing)),
    );
    let choice = random.between(0.0, 512.0) as u32;
    (transformation.of(scene, choice), name)
}

fn steps_of_load(steps: u32) -> f64 {
    f64::from(steps).recip()
}

fn one_of<T: Clone>(random: &mut Random, list: &[T]) -> T {
    let last = list.len() - 1;
    list[(random.between(0.0, list.len() as f64) as usize).min(last)].clone()
}

/// For halves, only families whose functions at a wall equal the mirrored ones. Other families are one-sided there: coefficients beyond a
/// wall continue the field linearly, where a plane of symmetry would mirror it. With them, halves agree with the whole only to the
/// resolution of the grid.
fn family(random: &mut Random, half: bool) -> (&'static str, Value) {
    let lme = |gamma: f64| json!({ "lme": { "gamma": gamma } });
    let bspline = |degree: u32| json!({ "bspline": { "degree": degree } });
    let families = [
        ("linear", json!("linear")),
        ("uGIMP", json!("gimp")),
        ("quadratic", bspline(2)),
        ("cubic", bspline(3)),
        ("LME 3", lme(3.0)),
        ("LME 1.4", lme(1.4)),
    ];
    one_of(random, if half { &families[..1] } else { &families })
}

fn law(random: &mut Random, half: bool) -> Law {
    let angle = random.between(0.0, 3.0);
    let fibres = if half { [0.0, 1.0] } else { [angle.cos(), angle.sin()] };
    one_of(
        random,
        &[
            Law::NeoHookean,
            Law::Logarithmic,
            Law::StVenantKirchhoff,
            Law::MooneyRivlin,
            Law::Fibres(fibres),
            Law::Viscoelastic,
            Law::Viscoelastic,
            Law::VonMises,
            Law::VonMises,
            Law::DruckerPrager,
        ],
    )
}

/// A body 3 to 4 cells wide; `held` bodies stand on the bottom, and halves begin at the left face.
fn form(random: &mut Random, h: f64, transformation: Transformation, held: bool) -> (&'static str, Form) {
    let half = transformation == Transformation::Doubled;
    let at = [if half { 0.0 } else { 2.0 * h }, if held { 0.0 } else { 2.0 * h }];
    let off = |random: &mut Random, at_plane: bool| if at_plane { 0.0 } else { random.between(0.1, 0.9) * h };
    let boxes = matches!(transformation, Transformation::Split | Transformation::Slab);
    let forms = if boxes {
        2
    } else if held || half {
        3
    } else {
        4
    };
    match one_of(random, &[0, 1, 2, 3][..forms]) {
        0 => ("box on grid lines", Form::Box { min: at, max: [at[0] + 3.0 * h, at[1] + 3.0 * h] }),
        1 => {
            let min = [at[0] + off(random, half), at[1] + off(random, held)];
            let max = [at[0] + random.between(3.05, 3.95) * h, at[1] + random.between(3.05, 3.95) * h];
            ("box off grid lines", Form::Box { min, max })
        }
        2 => {
            let (left, lower) = (off(random, half), off(random, held));
            let corners = [
                [left, lower],
                [random.between(2.6, 3.4) * h, lower],
                [random.between(3.0, 3.9) * h, random.between(2.6, 3.4) * h],
                [left, random.between(3.0, 3.9) * h],
            ];
            ("polygon", Form::Polygon(corners.map(|x| [at[0] + x[0], at[1] + x[1]]).into()))
        }
        _ => {
            let radius = random.between(1.5, 1.9) * h;
            let center = [at[0] + 2.0 * h + off(random, false), at[1] + 2.0 * h];
            ("ball", Form::Ball { center, radius })
        }
    }
}

/// A body on the bottom is held there, without inertia in both directions.
fn faces(random: &mut Random, half: bool, held: bool, inertia: bool) -> [Option<Hold>; 4] {
    let across = if half { 0.0 } else { random.between(-0.02, 0.02) };
    let moves = Hold::Moves([across, random.between(-0.02, 0.02)]);
    let holds: &[Hold] = match (half, inertia) {
        // A moving wall changes velocities at its corner with the plane of symmetry, which the whole body does not have.
        (true, true) => &[Hold::Fixed, Hold::Sliding],
        (false, true) => &[Hold::Fixed, moves, Hold::Sliding],
        (_, false) => &[Hold::Fixed, moves],
    };
    let bottom = held.then(|| one_of(random, holds));
    [half.then_some(Hold::Sliding), None, bottom, None]
}

/// A traction or a pressure on the upper part of the body, or none.
fn load(random: &mut Random, scene: &Scene, form: &Form, share: f64, devices: Devices) -> Option<Load> {
    let half = scene.faces[0].is_some();
    let across = if half { 0.0 } else { random.between(-10.0, 10.0) };
    let traction = Pressing::Traction([across, random.between(-15.0, 5.0)].map(|t| share * t));
    let pressure = Pressing::Pressure(share * random.between(-5.0, 15.0));
    let pressing = one_of(random, &[None, Some(traction), Some(pressure)])?;
    let (top, ends) = match form {
        Form::Box { min, max } => (max[1], [min[0], max[0]]),
        Form::Ball { center, radius } => (center[1] + radius, [center[0] - radius, center[0] + radius]),
        Form::Polygon(corners) => {
            let over =
                |axis: usize, of: fn(f64, f64) -> f64, start: f64| corners.iter().map(|x| x[axis]).fold(start, of);
            (over(1, f64::max, 0.0), [over(0, f64::min, f64::MAX), over(0, f64::max, 0.0)])
        }
    };
    let h = scene.spacing;
    // The region extends beyond the body, so that no particle lies on its edge; a half begins at its plane. The region is less deep than a
    // layer of particles. The next layer would count as loaded beside the faces of cuts and slabs, which the image does not have.
    let lower = if half { 0.0 } else { ends[0] - 0.1 * h };
    let region = Form::Box { min: [lower, top - 0.499 * h], max: [ends[1] + 0.1 * h, top + 0.1 * h] };
    let carried = (devices == Devices::Off).then_some(([0.0, 1.0], 0.5 * h));
    Some(Load { region, pressing, carried })
}
