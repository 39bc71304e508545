//! The GPU: its product and its solver against those of the processor. The kernels run on a driver that gcc makes of them
//! (`tests/gpu/driver.c`), with threads and blocks as loops in three orders. The program finds it like the real one.

use crate::rigid_bodies::{flying, flying_3d};
use crate::support::{Failure, Said, built, said, scene};
use bfree::gpu::{Gpu, GpuError};
use bfree::mechanics::check::direction;
use bfree::mechanics::transfer::{Update, WallUpdate};
use bfree::plan::DeviceUse;
use bfree::solver::Linearization;
use bfree::space::vector::Vectors;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, OnceLock};

/// The orders in which the emulated driver runs threads and blocks.
const ORDERS: [&str; 3] = ["forward", "backward", "scrambled"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Compiles the emulated driver with the kernels of a folder.
fn compile(kernels: &Path, folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let mut gcc = Command::new("gcc");
    gcc.current_dir(root()).args(["-std=gnu11", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-DEMULATED"]);
    // A product and a sum are rounded once, as by the library's lanes.
    gcc.args(cfg!(target_arch = "x86_64").then_some("-mfma"));
    gcc.arg("-I").arg(kernels).args(["tests/gpu/driver.c", "-x", "c"]).arg(kernels.join("kernels.cu"));
    let made = gcc.arg("-o").arg(folder.join("libcuda.so")).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

fn kernels() -> PathBuf {
    root().join("src/gpu/kernels")
}

/// The folder of the emulated driver, which is compiled once.
fn emulator() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("emulated-gpu-{}", std::process::id()));
        compile(&kernels(), &folder);
        folder
    })
}

/// A command that finds the emulated driver.
fn emulated(program: &Path, order: &str) -> Command {
    let mut command = Command::new(program);
    command.stdin(Stdio::null()).env("LD_LIBRARY_PATH", emulator()).env("BFREE_GPU_ORDER", order);
    command
}

/// Runs this test again, in processes that find the emulated driver, and launch these kernels. Returns whether this is such a process.
fn is_emulated(test: &str, kernels: &[&str]) -> bool {
    if std::env::var_os("BFREE_EMULATED").is_some() {
        return true;
    }
    let directory = tempfile::tempdir().unwrap();
    for order in ORDERS {
        let log = directory.path().join(order);
        let mut again = emulated(&std::env::current_exe().unwrap(), order);
        again.args([&format!("gpu::{test}"), "--exact", "--nocapture"]).env("BFREE_EMULATED", "1");
        let said = again.env("BFREE_GPU_LOG", &log).output().unwrap();
        let text = [said.stdout, said.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
        assert!(said.status.success() && text.contains("1 passed"), "{order}: {text}");
        let launched = std::fs::read_to_string(&log).unwrap();
        kernels.iter().for_each(|kernel| assert!(launched.contains(kernel), "{order}: {kernel} ran elsewhere"));
    }
    false
}

fn bfree() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_bfree"))
}

/// Runs a scene into a directory.
fn run(command: &mut Command, scene: &str, out: &Path, arguments: &[&str]) -> Result<Said, Failure> {
    let scene = root().join("scenes").join(scene);
    said(
        command
            .arg("run")
            .arg(scene)
            .arg("--out")
            .arg(out)
            .args(arguments)
            .arg("--quiet")
            .env("RAYON_NUM_THREADS", "1"),
    )
}

/// Scenes that together have all parts of a linearised step, all solvers and preconditioners: name, steps, overrides, and whether the residual runs
/// on the device.
const SCENES: [(&str, &str, &[&str], bool); 12] = [
    // LME, dynamics
    ("rebound.json", "12", &[], true),
    // cubic functions, multigrid with its filter, nodes that follow
    ("block_static.json", "1", &[], true),
    ("cook.json", "1", &["--set", "aggregation=true"], true),
    // von Mises with averaged cells: general tangents
    ("cook_plastic.json", "2", &[], false),
    ("compaction.json", "3", &[], true),
    // friction and obstacles
    ("rolling.json", "4", &[], true),
    ("billiard.json", "4", &[], true),
    ("collision.json", "4", &[], true),
    // contact in load steps, and a path of equilibria
    ("wedge.json", "4", &[], true),
    ("cook.json", "2", &["--set", "time.scheme=\"arc_length\""], true),
    // three dimensions
    ("ball_drop.json", "2", &[], true),
    ("riemann.json", "3", &[], true),
];

#[test]
fn runs_on_a_gpu_have_the_bits_of_those_on_the_processor() -> Result<(), Failure> {
    for (scene, steps, sets, has_formula) in SCENES {
        let directory = tempfile::tempdir()?;
        let [here, there] = ["here", "there"].map(|name| directory.path().join(name));
        let arguments = [&["--steps", steps], sets].concat();
        let on_processor = run(&mut Command::new(bfree()), scene, &here, &arguments)?;
        assert_eq!(on_processor.0, Some(0), "{scene}: {}", on_processor.2);
        for order in ["forward", "scrambled"] {
            let log = directory.path().join(order);
            let arguments = [&arguments[..], &["--gpu", "--discard"]].concat();
            let on_gpu = run(emulated(bfree(), order).env("BFREE_GPU_LOG", &log), scene, &there, &arguments)?;
            assert_eq!(on_gpu.0, Some(0), "{scene}: {}", on_gpu.2);
            for name in ["history.csv", "particles_0000.vtu", "particles_0001.vtu", "contacts.csv"] {
                let [here, there] = [&here, &there].map(|folder| std::fs::read(folder.join(name)).ok());
                assert!(here == there, "{scene}, {order}: {name} differs");
            }
            let launched = std::fs::read_to_string(&log)?;
            assert!(launched.contains("product_"), "{scene}: the product ran elsewhere");
            assert_eq!(launched.contains("forces_"), has_formula, "{scene}: where the residual ran");
        }
    }
    Ok(())
}

/// A block of a random kind: functions, law, mass, damping, averaged cells, followers, pressure, walls.
fn random_block(dimension: usize, case: usize) -> Value {
    let families = [
        json!("linear"),
        json!("gimp"),
        json!({"bspline": {"degree": 2}}),
        json!({"bspline": {"degree": 3}}),
        json!({"lme": {"gamma": 3}}),
        json!({"lme": {"gamma": 0.8}}),
    ];
    let materials = [
        json!({"neo_hookean": {"young": 100, "poisson": 0.3}}),
        json!({"mooney_rivlin": {"c1": 20, "c2": 5, "bulk": 200}}),
        json!({"ogden": {"terms": [{"modulus": 20, "exponent": 2}, {"modulus": -5, "exponent": -2}], "bulk": 200}}),
        json!({"neo_hookean_logarithmic": {"young": 100, "poisson": 0.3}}),
        json!({"st_venant_kirchhoff": {"young": 100, "poisson": 0.3}}),
    ];
    let of = |x: f64| vec![x; dimension];
    let is_dynamic = case % 5 != 4;
    // St. Venant and Kirchhoff's energy has no part of the volume alone.
    let averages = case % 4 == 1 && case % materials.len() != 4;
    let body = json!({"name": "block", "density": 2, "shape": {"box": {"min": of(0.5), "max": of(2.25)}},
        "material": materials[case % materials.len()], "volumetric": if averages { "mean_dilatation" } else { "pointwise" }});
    let mut bodies = vec![body];
    if case.is_multiple_of(3) {
        // Groups at the interface have particles of two laws.
        let [min, max] = [(2.25, 0.5), (3.25, 2.25)].map(|(along, across)| {
            (0..dimension).map(|axis| if axis == 0 { along } else { across }).collect::<Vec<f64>>()
        });
        bodies.push(json!({"name": "other", "density": 3, "shape": {"box": {"min": min, "max": max}},
            "material": materials[(case + 1) % materials.len()]}));
    }
    let mut scene = json!({"grid": {"size": of(4.0), "spacing": 0.5}, "time": {"step": 0.01, "end": 1},
        "approximation": families[case % 6], "aggregation": case % 7 > 3, "bodies": bodies, "boundary": {"left": "fixed", "right": "sliding"}});
    if is_dynamic {
        scene["time"]["lumping"] = json!([1.0, 0.4, 0.0][case / 2 % 3]);
        scene["damping"] = json!({"mass": 0.1, "stiffness": if case.is_multiple_of(2) { 0.01 } else { 0.0 }});
    } else {
        scene["time"]["scheme"] = json!("none");
    }
    if has_pressure(case) {
        scene["pressures"] = json!([{"body": "block", "pressure": 3}]);
    }
    scene
}

/// Pressures are summed over the nodes in another order.
const fn has_pressure(case: usize) -> bool {
    case % 11 == 10
}

/// Compares the residuals, products and diagonal blocks of the next step of a scene. Particles are moved at random by up to most of a cell, so
/// that cells hold none to many. Some are stretched to several times their volume, and some pressed to a fraction.
fn compare_equilibria<const D: usize>(gpu: &Arc<Gpu>, case: usize) -> Result<(), Failure> {
    let scene = random_block(D, case);
    let mut simulation = built::<D>(&scene)?;
    let particles = &mut simulation.particles;
    let spread = 0.45 * (1 + case % 2) as f64 * simulation.grid.spacing;
    let moves = direction::<D>(particles.len(), case as u64);
    particles.position.iter_mut().zip(&moves).for_each(|(x, by)| *x += by * spread);
    // The projection with a consistent mass alone takes thousands of iterations.
    let speed = if simulation.settings.lumping > 0.0 { 1.0 } else { 0.0 };
    particles.velocity.iter_mut().zip(&moves).for_each(|(v, by)| *v = by * speed);
    particles.acceleration.iter_mut().zip(&moves).for_each(|(a, by)| *a = by * (30.0 * speed));
    for (k, h) in particles.displacement_gradient.iter_mut().enumerate() {
        h.iter_mut().enumerate().for_each(|(i, h)| *h = 0.1 * moves[(k + i) % moves.len()][0]);
        (0..D).for_each(|i| h[(i, i)] += [0.0, 0.9, 0.0, -0.45][(k + case) % 4]);
    }
    let mut there = simulation.clone();
    there.settings.gpu = Some(gpu.clone());
    let (here, there) = (simulation.next_step()?, there.next_step()?);
    let (of_processor, equilibrium, count) = (here.equilibrium(), there.equilibrium(), here.nodes().len());
    let phi: Vec<_> = direction::<D>(count, 1).iter().map(|x| x * 0.01).collect();
    assert!(here.nodal() == there.nodal(), "{D}D, case {case}, projection: {scene}");
    let moved = [&here, &there].map(|one| {
        let alphas = simulation.settings.scheme.end(0.01);
        let update = Update::new(&alphas, one.nodal(), one.nodal(), one.prescribed(), WallUpdate::Literal, &phi);
        let mut particles = simulation.particles.clone();
        update.commit(&mut particles, &simulation.bodies, one.connectivity(), 0.01);
        particles
    });
    assert!(moved[0] == moved[1], "{D}D, case {case}, update: {scene}");
    assert!(of_processor.residual(&phi)? == equilibrium.residual(&phi)?, "{D}D, case {case}, residual: {scene}");
    assert!(of_processor.magnitude(&phi)? == equilibrium.magnitude(&phi)?, "{D}D, case {case}, magnitude: {scene}");
    // Cells are turned inside out. Both name the same particle.
    let inadmissible: Vec<_> = phi.iter().map(|x| x * 1e3).collect();
    assert_eq!(of_processor.residual(&inadmissible), equilibrium.residual(&inadmissible), "{D}D, case {case}: {scene}");
    let refused = [&of_processor, &equilibrium].map(|one| one.tangent(None, &inadmissible).err());
    assert!(refused[0].is_some() && refused[0] == refused[1], "{D}D, case {case}: {refused:?}: {scene}");
    let mut u = direction::<D>(count, 2);
    here.prescribed().iter().for_each(|dof| u[dof.node][dof.component] = 0.0);
    let (tangent, on_gpu) = (of_processor.tangent(None, &phi)?, equilibrium.tangent(None, &phi)?);
    assert!(*tangent.diagonal_blocks() == *on_gpu.diagonal_blocks(), "{D}D, case {case}, blocks: {scene}");
    let mut expected = vec![Vector::zeros(); count];
    tangent.product(&u, &mut expected);
    let on_device = on_gpu.on_device().ok_or("no device")?;
    let (x, mut y) = (gpu.vector(&u.iter().flatten().copied().collect::<Vec<_>>()), gpu.zeros(D * count));
    on_device.apply(&x, &mut y);
    gpu.check()?;
    let found = gpu.numbers(&y);
    let largest = expected.iter().map(|f| f.amax()).fold(0.0, f64::max);
    let bound = if has_pressure(case) { 1e-14 * largest } else { 0.0 };
    // NaN is not within the bound.
    let wrong =
        expected.iter().flatten().zip(&found).position(|(a, b)| (a - b).abs().is_nan() || (a - b).abs() > bound);
    assert!(largest > 0.0 && wrong.is_none(), "{D}D, case {case}: number {wrong:?} of {}: {scene}", found.len());
    Ok(())
}

/// The kernels of an equilibrium, and of the transfers.
const KERNELS: [&str; 18] = [
    "at_particles_1",
    "at_particles_2",
    "at_particles_3",
    "spread_1",
    "spread_2",
    "spread_3",
    "forces_1",
    "forces_2",
    "forces_3",
    "linearize_1",
    "linearize_2",
    "linearize_3",
    "product_1",
    "product_2",
    "product_3",
    "diagonal_blocks_1",
    "diagonal_blocks_2",
    "diagonal_blocks_3",
];

/// Equilibria on a processor that rounds a product and a sum once have the bits of those on a device.
#[test]
fn equilibria_have_the_bits_of_the_processor() -> Result<(), Failure> {
    if !is_emulated("equilibria_have_the_bits_of_the_processor", &KERNELS) {
        return Ok(());
    }
    let gpu = Arc::new(Gpu::open()?);
    for case in 0..42 {
        compare_equilibria::<1>(&gpu, case)?;
        compare_equilibria::<2>(&gpu, case)?;
        compare_equilibria::<3>(&gpu, case)?;
    }
    Ok(())
}

#[test]
fn vectors_have_the_bits_of_the_processor() -> Result<(), Failure> {
    if !is_emulated("vectors_have_the_bits_of_the_processor", &["dot"]) {
        return Ok(());
    }
    let (gpu, pool) = (Gpu::open()?, bfree::pooled::Pool::default());
    for n in [1, 7, 127, 128, 129, 2047, 2048, 2049, 5000, 40_000] {
        let numbers = |seed| direction::<1>(n, seed).iter().map(|x| x[0]).collect::<Vec<f64>>();
        let (a, b) = (numbers(1), numbers(2));
        let (x, mut y) = (gpu.vector(&a), gpu.vector(&b));
        assert_eq!(gpu.dot(&x, &y).to_bits(), pool.dot(&a, &b).to_bits(), "{n}");
        let mut here = b.clone();
        pool.axpby(0.3, &a, -0.7, &mut here);
        gpu.axpby(0.3, &x, -0.7, &mut y);
        pool.divided(&here.clone(), 3.0, &mut here);
        gpu.divided(&gpu.copied(&y), 3.0, &mut y);
        assert_eq!(gpu.numbers(&y), here, "{n}");
        // Squares that underflow and overflow.
        for scale in [1e-200, 1e200] {
            let scaled: Vec<f64> = a.iter().map(|x| x * scale).collect();
            assert_eq!(gpu.norm(&gpu.vector(&scaled)).to_bits(), pool.norm(&scaled).to_bits(), "{n}");
        }
    }
    Ok(())
}

/// Each message is one sentence, and comes before anything is computed.
#[test]
fn a_gpu_that_cannot_be_used_is_told_in_one_sentence() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let refused = |command: &mut Command, arguments: &[&str], words: &str| -> Result<(), Failure> {
        let said = run(command, "rebound.json", &directory.path().join("run"), arguments)?;
        assert_eq!(said.0, Some(2), "{}", said.2);
        assert!(said.2.contains(words) && said.2.lines().count() == 1, "{}", said.2);
        Ok(())
    };
    let arguments = ["--gpu", "--steps", "1"];
    if matches!(Gpu::open(), Err(GpuError::NoDriver)) {
        refused(&mut Command::new(bfree()), &arguments, "no NVIDIA driver")?;
    }
    let with = |variable: &str, value: &str| {
        let mut command = emulated(bfree(), "forward");
        command.env(variable, value);
        command
    };
    refused(&mut with("BFREE_GPU_DRIVER", "11080"), &arguments, "driver is for CUDA 11.8; at least 12.0 is needed")?;
    refused(&mut with("BFREE_GPU_MEMORY", "20000"), &arguments, "has no room for")?;
    let wide = "approximation={\"lme\":{\"gamma\":0.1}}";
    let circle = "approximation={\"lme\":{\"gamma\":3,\"support\":\"circle\"}}";
    for (set, words) in [(circle, "LME functions on a circle"), (wide, "more than 16 nodes an axis")] {
        let arguments = [&arguments[..], &["--set", set]].concat();
        refused(&mut emulated(bfree(), "forward"), &arguments, words)?;
    }
    Ok(())
}

#[test]
fn a_gpu_that_fails_loses_nothing() -> Result<(), Failure> {
    let directory = tempfile::tempdir()?;
    let [whole, broken] = ["whole", "broken"].map(|name| directory.path().join(name));
    let steps = ["--steps", "12", "--set", "output.checkpoint=0.1", "--set", "time.max_halvings=3"];
    assert_eq!(run(&mut Command::new(bfree()), "rebound.json", &whole, &steps)?.0, Some(0));
    let arguments = [&steps[..], &["--gpu"]].concat();
    // A launch in the fifth step or so. Shorter steps would fail, too, so none is tried.
    let said = run(emulated(bfree(), "forward").env("BFREE_GPU_FAIL", "3000"), "rebound.json", &broken, &arguments)?;
    assert_eq!(said.0, Some(1), "{}", said.2);
    let words = ["CUDA_ERROR_LAUNCH_FAILED", "--restart", "(attempts: 1)"];
    assert!(words.iter().all(|word| said.2.contains(word)) && !said.2.contains("panicked"), "{}", said.2);
    let said = run(&mut Command::new(bfree()), "rebound.json", &broken, &[&steps[..], &["--restart"]].concat())?;
    assert_eq!(said.0, Some(0), "{}", said.2);
    assert_eq!(std::fs::read(whole.join("history.csv"))?, std::fs::read(broken.join("history.csv"))?);
    Ok(())
}

/// The kernels with one fault, compiled in a folder.
fn compile_with_fault(right: &str, wrong: &str, folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir(folder)?;
    let mut is_there = false;
    for entry in std::fs::read_dir(kernels())? {
        let path = entry?.path();
        let text = std::fs::read_to_string(&path)?;
        is_there |= text.contains(right);
        std::fs::write(folder.join(path.file_name().ok_or("a file without a name")?), text.replace(right, wrong))?;
    }
    assert!(is_there, "the kernels have no line {right}");
    compile(folder, folder);
    Ok(())
}

/// The check of the tangent uses the product that runs: it stops a run whose kernels have stresses or tangents that are a thousandth too large.
#[test]
fn the_tangent_check_sees_the_product_of_the_gpu() -> Result<(), Failure> {
    let (directory, arguments) = (tempfile::tempdir()?, ["--steps", "2", "--gpu", "--check-tangent"]);
    let mut right = emulated(bfree(), "forward");
    let said = run(&mut right, "rebound.json", &directory.path().join("right"), &arguments)?;
    assert_eq!(said.0, Some(0), "{}", said.2);
    let faults = [
        ("product", "double one = stress[i][k];", "double one = 1.001 * stress[i][k];"),
        ("tangent", "f_r, volume, constants, rows)", "f_r, 1.001 * volume, constants, rows)"),
    ];
    for (name, right, wrong) in faults {
        let [folder, out] = ["kernels", "out"].map(|end| directory.path().join(format!("{name}-{end}")));
        compile_with_fault(right, wrong, &folder)?;
        let mut faulty = emulated(bfree(), "forward");
        faulty.env("LD_LIBRARY_PATH", &folder);
        let said = run(&mut faulty, "rebound.json", &out, &arguments)?;
        assert!(said.0 == Some(1) && said.2.contains("the tangent is wrong"), "{name}: {}", said.2);
    }
    Ok(())
}

/// `bfree check --gpu` plans the memory that a run takes at most on the device.
#[test]
fn the_memory_of_the_device_is_planned() -> Result<(), Failure> {
    const DYNAMIC: &[&str] =
        &["time.scheme=\"newmark\"", "time.lumping=0.5", "time.step=0.001", "gravity.curve=[[0,1]]"];
    let spacing = "grid.spacing=0.125";
    for (functions, more) in [("\"linear\"", DYNAMIC), ("{\"bspline\":{\"degree\":3}}", &["time.step=0.5"])] {
        let functions = format!("approximation={functions}");
        let sets = [&[spacing, functions.as_str()], more].concat();
        let planned = DeviceUse::of(&scene::<3>("block_static.json", &sets)?)?.bytes as f64;
        let directory = tempfile::tempdir()?;
        let log = directory.path().join("log");
        let mut command = emulated(bfree(), "forward");
        command.env("BFREE_GPU_LOG", &log);
        let mut arguments = vec!["--gpu", "--steps", "1"];
        sets.iter().for_each(|set| arguments.extend(["--set", set]));
        let said = run(&mut command, "block_static.json", &directory.path().join("run"), &arguments)?;
        assert_eq!(said.0, Some(0), "{}", said.2);
        let text = std::fs::read_to_string(&log)?;
        let peak: f64 = text.split_whitespace().skip_while(|word| *word != "peak").nth(1).ok_or("no peak")?.parse()?;
        // Levels of multigrid are bounded by their number of nodes.
        assert!((1.0 / 1.05..1.2).contains(&(planned / peak)), "{functions}: {planned} planned, {peak} taken");
    }
    Ok(())
}

/// Steps of a scene in which a free obstacle meets a body.
fn compare_steps<const D: usize>(gpu: &Arc<Gpu>, scene: &Value, steps: usize) -> Result<(), Failure> {
    let mut here = built::<D>(scene)?;
    let mut there = here.clone();
    there.settings.gpu = Some(gpu.clone());
    let mut touches = false;
    for step in 0..steps {
        touches |= here.advance()?.touches();
        there.advance()?;
        assert!(here.particles.by_id() == there.particles.by_id(), "{D}D, step {step}");
    }
    assert!(touches);
    Ok(())
}

/// A simulation that has taken a step, and keeps its grid, uses a device that it gets now.
#[test]
fn a_gpu_is_used_from_the_next_step_on() -> Result<(), Failure> {
    if !is_emulated("a_gpu_is_used_from_the_next_step_on", &["product_2", "forces_2", "at_particles_2"]) {
        return Ok(());
    }
    // A clone would evaluate its shape functions anew, and with the device.
    let start = || scene::<2>("rebound.json", &["grid.reset=\"never\""]);
    let (mut here, mut there) = (start()?, start()?);
    here.advance()?;
    there.advance()?;
    let gpu = there.use_gpu()?;
    here.advance()?;
    assert!(!there.advance()?.reset && here.particles == there.particles);
    Ok(gpu.check()?)
}

#[test]
fn free_obstacles_have_the_bits_of_the_processor() -> Result<(), Failure> {
    if !is_emulated("free_obstacles_have_the_bits_of_the_processor", &["point_motions"]) {
        return Ok(());
    }
    let gpu = Arc::new(Gpu::open()?);
    compare_steps::<2>(&gpu, &flying(), 10)?;
    compare_steps::<3>(&gpu, &flying_3d(), 4)
}
