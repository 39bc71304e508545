//! Laws from shared libraries in scenes, compiled here from `examples/laws`.

mod inputs;
mod memory;

use super::support::{Failure, built, failure, in_threads, restored, run_to, with};
use bfree::material::{Law, allow_library};
use bfree::scene;
use bfree::simulation::StepReport;
use serde_json::{Value, json};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::process::Command;

const LAMBDA: f64 = 0.63375;
const SHEAR: f64 = 0.4225;

/// Faults of `bad.f90` that are a refusal, and a word of their sentence.
const REFUSALS: [(u32, &str); 3] = [(3, "stress is NaN"), (8, "wrote"), (10, "PNEWDT")];

/// A compiled library that scenes may load. The folder goes with it.
struct Library {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

impl Library {
    /// `None`, with a loud note, where there is no compiler for this source.
    fn of(source: &str) -> Result<Option<Self>, Failure> {
        Self::compiled(&Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/laws"), source)
    }

    /// The same for a source in any folder.
    fn compiled(sources: &Path, source: &str) -> Result<Option<Self>, Failure> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let compiler = if source.ends_with(".c") { "gcc" } else { "gfortran" };
        let folder = tempfile::tempdir()?;
        let path = folder.path().join(format!("lib_{}.so", source.replace('.', "_")));
        let mut command = Command::new(compiler);
        command.args(["-O2", "-shared", "-fPIC", "-o"]).arg(&path).arg(source).current_dir(sources);
        if compiler == "gcc" {
            command.arg("-I").arg(root.join("tangent-check/include"));
        }
        let Ok(status) = command.status() else {
            eprintln!("*** NOT TESTED: {source}, because there is no {compiler} ***");
            return Ok(None);
        };
        assert!(status.success(), "{source} does not compile");
        allow_library(&path);
        Ok(Some(Self { path, _folder: folder }))
    }

    fn name(&self) -> &str {
        self.path.to_str().unwrap_or_default()
    }
}

/// A block that is pulled at its top, with or without inertia.
fn block(dimension: usize, statics: bool, material: &Value) -> Value {
    let corner = |x: f64| vec![x; dimension];
    let mut load = vec![0.0; dimension];
    (load[0], load[1]) = (0.03, 0.1);
    let mut normal = vec![0.0; dimension];
    normal[1] = -1.0;
    let mut top = vec![0.5; dimension];
    top[1] = 1.5;
    let time =
        if statics { json!({"step": 0.5, "end": 1, "scheme": "none"}) } else { json!({"step": 0.1, "end": 0.5}) };
    json!({
        "grid": {"size": corner(3.0), "spacing": 0.5},
        "approximation": {"bspline": {"degree": 2}},
        "time": time,
        "bodies": [{"name": "block", "density": 0.1, "material": material,
                    "shape": {"box": {"min": vec![0.0; dimension], "max": corner(1.5)}}}],
        "boundary": {"bottom": "fixed"},
        "solver": {"krylov": {"method": {"gmres": {}}}},
        "tractions": [{"body": "block", "region": {"half_space": {"point": top, "normal": normal}}, "traction": load,
                       "curve": [[0, 0], [1, 1]]}]
    })
}

/// The same motion, and the same residuals of Newton's method, as those of our own law.
fn same_as_ours<const D: usize>(statics: bool, ours: &Value, theirs: &Value) -> Result<(), Failure> {
    let [mut ours, mut theirs] = [built::<D>(&block(D, statics, ours))?, built(&block(D, statics, theirs))?];
    // The tangent that the law claims, through the products that the solver applies, against the stress with that tangent.
    theirs.settings.check_tangent = NonZeroU64::new(1);
    for _ in 0..2 {
        let [expected, found] = [ours.advance()?, theirs.advance()?];
        let norms = |report: &StepReport<D>| -> Vec<f64> {
            report.newton.history.iterations.iter().map(|one| one.residual).collect()
        };
        let (expected, found) = (norms(&expected), norms(&found));
        assert_eq!(expected.len(), found.len(), "{expected:?} {found:?}");
        let first = expected[0];
        assert!(expected.iter().zip(&found).all(|(a, b)| (a - b).abs() <= 1e-9 * first), "{expected:?} {found:?}");
    }
    let (a, b) = (ours.particles.by_id(), theirs.particles.by_id());
    let apart = a.position.iter().zip(&b.position).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-10, "{apart:e}");
    Ok(())
}

#[test]
fn laws_of_the_same_formula_give_the_same_motion() -> Result<(), Failure> {
    let ours = json!({"neo_hookean_logarithmic": {"lambda": LAMBDA, "shear": SHEAR}});
    if let Some(library) = Library::of("neo_hookean.f")? {
        let umat = json!({"umat": {"library": library.name(), "properties": [LAMBDA, SHEAR]}});
        same_as_ours::<2>(true, &ours, &umat)?;
        same_as_ours::<3>(true, &ours, &umat)?;
        same_as_ours::<2>(false, &ours, &umat)?;
        let plane = with(umat, &[("/umat/plane_strain", json!(true))]);
        same_as_ours::<2>(true, &ours, &plane)?;
    }
    if let Some(library) = Library::of("like_mfront.c")? {
        // Without softening it is the same neo-Hookean solid.
        let mfront = json!({"mfront": {"library": library.name(), "behaviour": "SofteningNeoHooke", "properties": [LAMBDA, SHEAR, 0]}});
        same_as_ours::<2>(true, &ours, &mfront)?;
        same_as_ours::<3>(false, &ours, &mfront)?;
    }
    if let Some(library) = Library::of("saint_venant.f90")? {
        let ours = json!({"st_venant_kirchhoff": {"lambda": LAMBDA, "shear": SHEAR}});
        let fortran = json!({"c": {"library": library.name(), "law": "saint_venant", "properties": [LAMBDA, SHEAR]}});
        same_as_ours::<2>(true, &ours, &fortran)?;
        same_as_ours::<3>(false, &ours, &fortran)?;
    }
    Ok(())
}

/// A metal in plastic flow: it yields, its memory is restarted, and threads do not matter.
#[test]
fn memory_is_restarted_to_the_bit() -> Result<(), Failure> {
    let Some(library) = Library::of("j2.f90")? else { return Ok(()) };
    let law = json!({"umat": {
        "library": library.name(), "properties": [1.0, 0.3, 0.1, 0.2, 0.02, 10.0], "tangent": "strain",
        "state": {"names": ["plastic_strain"]}
    }});
    let scene = with(block(2, true, &law), &[("/time/step", json!(0.125))]);
    let start = built::<2>(&scene)?;
    let names: Vec<_> = start.bodies[0].law.internal_variables().iter().map(|one| one.name).collect();
    assert_eq!((names[0], names.last()), ("plastic_strain", Some(&"law_work")));
    let mut half = start.clone();
    run_to(&mut half, 0.5)?;
    let mut continued = restored(&half, &start)?;
    let mut whole = half.clone();
    run_to(&mut whole, 1.0)?;
    run_to(&mut continued, 1.0)?;
    let (a, b) = (whole.particles.by_id(), continued.particles.by_id());
    assert!(a == b);
    let greatest = (0..a.len()).map(|p| a.state(p, 0.0).internal[0]).fold(0.0, f64::max);
    assert!(greatest > 0.01, "nothing yields: {greatest}");
    let threaded = in_threads(2, || {
        let mut simulation = start.clone();
        run_to(&mut simulation, 1.0)?;
        Ok(simulation.particles.by_id().position)
    })?;
    assert_eq!(threaded, a.position);
    Ok(())
}

/// The tangent check of a run sees a claim that does not hold where the body turns, and a claim of another meaning.
#[test]
fn claims_are_compared_with_differences() -> Result<(), Failure> {
    let Some(library) = Library::of("fixed_axes.f90")? else { return Ok(()) };
    let law = |properties: [f64; 9], tangent: &str| json!({"umat": {"library": library.name(), "properties": properties, "tangent": tangent}});
    let orthotropic = [2.0, 1.0, 0.5, 0.3, 0.25, 0.2, 0.4, 0.3, 0.2];
    let isotropic = [1.4, 1.4, 1.4, 0.6, 0.6, 0.6, 0.4, 0.4, 0.4];
    for (properties, tangent, holds) in [
        (isotropic, "strain", true),
        (orthotropic, "strain", false),
        // ∂σ/∂Δε is not the Jaumann rate of the Kirchhoff stress.
        (isotropic, "jaumann_kirchhoff", false),
    ] {
        let mut simulation = built::<2>(&block(2, true, &law(properties, tangent)))?;
        simulation.settings.check_tangent = NonZeroU64::new(1);
        match simulation.advance() {
            Ok(_) => assert!(holds, "{properties:?}, {tangent}: nothing is found"),
            Err(error) => {
                let message = bfree::causes::on_one_line(&error);
                assert!(!holds && message.contains("claims a tangent that is not the derivative"), "{message}");
            }
        }
    }
    Ok(())
}

/// A law that refuses a state ends the run with its sentence, after shorter steps.
#[test]
fn refusals_are_told() -> Result<(), Failure> {
    let Some(library) = Library::of("bad.f90")? else { return Ok(()) };
    let law = |fault: u32| {
        json!({"umat": {
            "library": library.name(), "properties": [fault, 1.0], "tangent": "strain", "state": {"names": ["a"]}
        }})
    };
    for (fault, word) in REFUSALS {
        let scene = with(block(2, true, &law(fault)), &[("/time/step", json!(0.05))]);
        let mut simulation = built::<2>(&scene)?;
        let error = failure(&mut simulation);
        assert_eq!(simulation.clock.steps(), 12, "the fault is in increment 13");
        let message = bfree::causes::on_one_line(&error);
        assert!(message.contains("a law gave no stress") && message.contains(word), "{message}");
    }
    Ok(())
}

#[test]
fn libraries_need_permission() {
    let text = block(2, true, &json!({"umat": {"library": "libnever.so"}})).to_string();
    let error = scene::read(&text, &[]).expect_err("not allowed").to_string();
    assert!(error.contains("libnever.so") && error.contains("--allow-library"), "{error}");
    // A permission for another library is none.
    allow_library(Path::new("/tmp/libother.so"));
    assert!(scene::read(&text, &[]).is_err());
    allow_library(Path::new("/nowhere/libnever.so"));
    let error = scene::read(&text, &[]).expect_err("not there").to_string();
    assert!(error.contains("/nowhere/libnever.so") && error.contains("No such file"), "{error}");
    let list = block(2, true, &json!({"umat": {"library": "libnever.so", "state": {"names": ["a"], "at_rest": []}}}));
    let error = scene::read(&list.to_string(), &[]).expect_err("no values").to_string();
    assert!(error.contains("umat.state.at_rest"), "{error}");
}
