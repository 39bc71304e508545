//! Invalid and malicious input to the program.

use crate::support::{Failure, Random, said, shipped};
use crate::{images, meshes, surfaces};
use bfree::causes;
use bfree::checkpoint::{self, Identity};
use bfree::scene::{self, Scene, SceneError, mesh_file, particle_file, surface_file};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// A value that replaces another one. No such value makes a valid scene much larger.
fn junk(random: &mut Random) -> Value {
    const LIST: &str = r#"[null, true, 0, -1, -0.0, 2, 3.5, 1e9, 1e308, -1e308, 1e-308, 5e-324, 18446744073709551615, -9223372036854775808,
        "NaN", "inf", "", "linear", "sliding", "\u0000\u202e\n", [], {}, [[]], [0, 0], [1e308, -1e308, 1e308], [[0, 0], [0, 0]],
        [[0, [0, 0]]], {"lme": {}}, {"union": []}, {"box": {"min": [0, 0], "max": [1, 1]}},
        {"ball": {"center": [1, 1], "radius": 1e300}}, {"half_space": {"point": [1, 1], "normal": [0, 1e-200]}},
        {"young": 1e308, "poisson": 0.49999999999999994}, {"__proto__": {"grid": 1}}]"#;
    let mut list: Vec<Value> = serde_json::from_str(LIST).expect("valid JSON");
    list.push(json!("x".repeat(10_000)));
    random.of(&list).clone()
}

/// The number of values in a value, itself included.
fn count(value: &Value) -> u64 {
    1 + match value {
        Value::Object(object) => object.values().map(count).sum(),
        Value::Array(list) => list.iter().map(count).sum(),
        _ => 0,
    }
}

/// Changes value number `pick` of `value`; counts down on the way.
fn change(value: &mut Value, pick: &mut u64, random: &mut Random) -> bool {
    if *pick > 0 {
        *pick -= 1;
        return match value {
            Value::Object(object) => object.values_mut().any(|inner| change(inner, pick, random)),
            Value::Array(list) => list.iter_mut().any(|inner| change(inner, pick, random)),
            _ => false,
        };
    }
    let what = random.below(6);
    match value {
        Value::Object(object) if what < 4 && !object.is_empty() => {
            let keys: Vec<String> = object.keys().cloned().collect();
            let key = random.of(&keys).clone();
            let inner = object.remove(&key);
            match what {
                // The key is removed, misspelt, replaced by another key, or joined by an unknown one.
                0 => {}
                1 => drop(object.insert(key.chars().rev().collect(), inner.unwrap_or_default())),
                2 => drop(object.insert(random.of(&keys).clone(), inner.unwrap_or_default())),
                _ => {
                    object.insert(key, inner.unwrap_or_default());
                    object.insert("extra".to_owned(), junk(random));
                }
            }
        }
        Value::Array(list) if what < 3 && !list.is_empty() => {
            let at = random.below(list.len() as u64) as usize;
            match what {
                0 => drop(list.remove(at)),
                1 => list.push(list[at].clone()),
                _ => list.push(junk(random)),
            }
        }
        value => *value = junk(random),
    }
    true
}

/// A shipped scene with one to three values changed.
fn changed(scenes: &[Value], random: &mut Random) -> Value {
    let mut scene = random.of(scenes).clone();
    for _ in 0..=random.below(3) {
        let mut pick = random.below(count(&scene));
        change(&mut scene, &mut pick, random);
    }
    scene
}

/// Text with bytes changed, repeated, nested, or cut off.
fn broken(text: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = text.to_vec();
    for _ in 0..=random.below(3) {
        let at = random.below(bytes.len() as u64) as usize;
        match random.below(6) {
            0 => bytes[at..].iter_mut().take(1).for_each(|byte| *byte = random.below(256) as u8),
            1 => bytes.truncate(at),
            2 => {
                let piece = bytes[at..(at + random.below(40) as usize).min(bytes.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            3 => drop(bytes.splice(
                at..at,
                random.of(&[&b"NaN"[..], b"1e999", b"//", b"\"", b"{", b"]", b"\xff", b"-", b","]).iter().copied(),
            )),
            4 => drop(bytes.splice(at..at, b"[".repeat(random.below(300) as usize))),
            _ => drop(bytes.splice(at..(at + 5).min(bytes.len()), [])),
        }
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}

/// Runs `bfree check` with at most a second of processor time and 4 GB of memory. Returns the exit code and standard error.
#[cfg(unix)]
fn check(scene: &Path) -> Result<(Option<i32>, String), Failure> {
    let script = "ulimit -t 1; ulimit -v 4000000; exec \"$0\" check \"$1\"";
    let (code, _, message) = said(Command::new("sh").args(["-c", script, env!("CARGO_BIN_EXE_bfree")]).arg(scene))?;
    Ok((code, message))
}

#[cfg(unix)]
#[test]
fn a_gigabyte_is_refused_before_it_is_read() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("large.json");
    // A sparse file takes no space on the disk, but reading it would take a while.
    std::fs::File::create(&path)?.set_len(1 << 30)?;
    let start = Instant::now();
    let error = scene::read_file(&path, &[]).expect_err("a gigabyte");
    assert!(matches!(error, SceneError::TooLong(length) if length == 1 << 30), "{error}");
    assert!(start.elapsed() < Duration::from_secs(1));
    let (code, message) = check(&path)?;
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("large.json") && message.contains("1073741824 bytes"), "{message}");
    // A particle file with one line of a gigabyte: reading stops after four kilobytes.
    let text = r#"{"grid": {"size": [4, 4], "spacing": 1}, "time": {"step": 0.1, "end": 1}, "bodies": [{"name": "a",
        "particles": {"file": "large.json"}, "density": 1, "material": {"neo_hookean": {"bulk": 1, "shear": 1}}}]}"#;
    let scene = folder.path().join("scene.json");
    std::fs::write(&scene, text)?;
    let (code, message) = check(&scene)?;
    let named = ["scene.json", "bodies[0].particles.file"].iter().all(|words| message.contains(words));
    assert!(code == Some(2) && named && message.len() < 100_000, "{message}");
    // A device without an end.
    let (code, message) = check(Path::new("/dev/zero"))?;
    assert_eq!(code, Some(2), "{message}");
    Ok(())
}

#[test]
fn moduli_and_densities_near_the_least_number_run_or_are_refused_by_key() -> Result<(), Failure> {
    let base = r#"{"grid": {"size": [4, 4], "spacing": 1}, "time": {"step": 0.1, "end": 1}, "bodies": [{"name": "a", "velocity": [1, 0],
        "shape": {"box": {"min": [1, 1], "max": [3, 3]}}, "density": 1, "material": {"neo_hookean": {"young": 1, "poisson": 0.3}}}]}"#;
    let set = |density: &str, young: &str| -> Result<Vec<_>, Failure> {
        let set = [format!("bodies[0].density={density}"), format!("bodies[0].material.neo_hookean.young={young}")];
        Ok(set.iter().map(|set| set.parse()).collect::<Result<Vec<_>, _>>()?)
    };
    for least in ["5e-324", "1e-308", "1e-300", "1e-160", "1e-100", "1e160", "1e308"] {
        for (given, key) in
            [((least, "1"), "bodies[0].density"), (("1", least), "bodies[0].material.neo_hookean.young")]
        {
            let message = scene::read(base, &set(given.0, given.1)?).expect_err(least).to_string();
            let expected = format!("{key}: {least} is not allowed; must be greater than 1e-100 and at most 1e100");
            assert!(message.contains(&expected), "{message}");
        }
    }
    // Free flight of a soft body, or of one whose stiffness does not reduce the step to round-off.
    let values = ["1e-99", "1e-60", "1", "1e60", "1e99"];
    for (i, density) in values.iter().enumerate() {
        for young in &values[..=i] {
            let mut simulation = scene::read(base, &set(density, young)?)?.build::<2>(Path::new("."))?;
            for _ in 0..3 {
                simulation.step().map_err(|error| format!("{density} {young}: {error}"))?;
            }
            let off = simulation.particles.velocity.iter().map(|v| (v[0] - 1.0).abs()).fold(0.0, f64::max);
            // Newton's method stops at 1e-9 of the initial residual.
            assert!(off < 1e-8, "{density} {young}: {off}");
        }
    }
    Ok(())
}

/// Whether a scene has few enough particles to be built in milliseconds.
fn small(scene: &Scene) -> bool {
    let cells: f64 = scene.grid.cells().into_iter().flatten().map(f64::from).product();
    let dimension = scene.dimension() as i32;
    scene.bodies.iter().map(|body| cells * f64::from(body.particles_per_cell).powi(dimension)).sum::<f64>() < 20_000.0
}

fn build(scene: &Scene) {
    let nowhere = Path::new("/nowhere");
    match scene.dimension() {
        1 => drop(scene.build::<1>(nowhere)),
        2 => drop(scene.build::<2>(nowhere)),
        _ => drop(scene.build::<3>(nowhere)),
    }
}

/// A small run with a checkpoint: its directory, identity, simulation at the start, and the checkpoint's bytes.
fn checkpointed(folder: &Path) -> Result<(Identity, Simulation<2>, Vec<u8>), Failure> {
    let path = folder.join("scene.json");
    let text = r#"{"grid": {"size": [4, 4], "spacing": 1}, "time": {"step": 0.1, "end": 1}, "bodies": [{"name": "a",
        "shape": {"box": {"min": [1, 1], "max": [2, 2]}}, "density": 1, "material": {"neo_hookean": {"bulk": 1, "shear": 1}}}],
        "output": {"checkpoint": 0.1}}"#;
    std::fs::write(&path, text)?;
    let mut run = Command::new(env!("CARGO_BIN_EXE_bfree"));
    assert!(run.arg("run").arg(&path).arg("--out").arg(folder).arg("--quiet").status()?.success());
    let scene = scene::read_file(&path, &[])?;
    let simulation = scene.build::<2>(folder)?;
    let identity = Identity::new(serde_json::to_value(&scene)?, &simulation.particles);
    std::fs::remove_file(folder.join("checkpoint_0.bfree"))?;
    let bytes = std::fs::read(folder.join("checkpoint_1.bfree"))?;
    Ok((identity, simulation, bytes))
}

/// The inputs that are broken, and what a reader needs to judge them.
struct Inputs {
    folder: tempfile::TempDir,
    texts: Vec<String>,
    scenes: Vec<Value>,
    picture: Vec<u8>,
    /// One box as a binary and as a written STL file, and as PLY.
    surfaces: [Vec<u8>; 3],
    /// A mesh as text and as binary file.
    meshes: [Vec<u8>; 2],
    /// A scene whose body has the shape of the picture.
    pictured: Scene,
    identity: Identity,
    fresh: Simulation<2>,
    checkpoint: Vec<u8>,
}

const TABLE: &[u8] = b"x,y,volume,vx,vy\n1,1,0.25,0,0\n1.5,1,0.25,1e-3,-2\n2,1,0.25,0,0\n";

impl Inputs {
    fn new() -> Result<Self, Failure> {
        let folder = tempfile::tempdir()?;
        let texts = shipped()?.iter().map(std::fs::read_to_string).collect::<Result<Vec<_>, _>>()?;
        let scenes: Vec<Value> = texts.iter().map(|text| serde_json::from_str(text)).collect::<Result<_, _>>()?;
        let (identity, fresh, checkpoint) = checkpointed(folder.path())?;
        let bytes: Vec<u8> = (0..600_u32).map(|i| (i * 7 % 256) as u8).collect();
        let picture = images::grey([30, 20], &bytes)?;
        let image = json!({"file": "fuzz.png", "min": [1, 1], "max": [3, 3], "values": [0, 100]});
        let pictured = scene::read(&images::scene_of(&[4, 4], &[images::body("a", &image)], json!({})), &[])?;
        let cube = surfaces::cuboid(Vector::repeat(1.0), Vector::repeat(2.0));
        let stl = folder.path().join("whole.stl");
        surfaces::stl(&cube, &stl)?;
        let surfaces =
            [std::fs::read(stl)?, surfaces::ascii_stl(&cube).into_bytes(), surfaces::ply(&cube).into_bytes()];
        let mesh = |name: &str| std::fs::read(meshes::folder().join(name));
        let meshes = [mesh("plate.msh")?, mesh("plate_binary.msh")?];
        Ok(Self { folder, texts, scenes, picture, surfaces, meshes, pictured, identity, fresh, checkpoint })
    }

    /// The input of a kind, 0 to 13.
    fn broken(&self, kind: u64, random: &mut Random) -> Vec<u8> {
        match kind {
            0..6 => changed(&self.scenes, random).to_string().into_bytes(),
            6 | 7 => broken(random.of(&self.texts).clone().as_bytes(), random),
            8 => broken(TABLE, random),
            9 => broken(&self.picture, random),
            10 => broken(&self.surfaces[random.below(2) as usize], random),
            11 => broken(&self.surfaces[2], random),
            12 => broken(&self.meshes[random.below(2) as usize], random),
            _ => broken(&self.checkpoint, random),
        }
    }

    /// The file in which an input of a kind is read, if it is read from one.
    fn file(&self, kind: u64) -> Option<PathBuf> {
        let name = match kind {
            9 => "fuzz.png",
            10 => "fuzz.stl",
            11 => "fuzz.ply",
            12 => "fuzz.msh",
            13 => "checkpoint_1.bfree",
            _ => return None,
        };
        Some(self.folder.path().join(name))
    }

    /// Whether the input is refused, and whether a scene was built.
    fn judge(&self, kind: u64, input: &[u8]) -> (bool, bool) {
        match kind {
            0..8 => judged_scene(&String::from_utf8_lossy(input)),
            8 => (particle_file::read::<2>(input).is_err(), false),
            9 => match self.pictured.build::<2>(self.folder.path()) {
                Ok(_) => (false, true),
                Err(error) => {
                    assert!(causes::on_one_line(&error).contains("fuzz.png"), "{error}");
                    (true, false)
                }
            },
            10 | 11 => (self.file(kind).is_none_or(|file| surface_file::read_file(&file).is_err()), false),
            12 => (self.file(kind).is_none_or(|file| mesh_file::read_group::<2>(&file, "steel").is_err()), false),
            _ => {
                let result = checkpoint::restore(self.folder.path(), &self.identity, &mut self.fresh.clone());
                assert!(result.is_err() || input == self.checkpoint, "a damaged checkpoint is taken for a good one");
                (result.is_err(), false)
            }
        }
    }
}

/// Whether the text of a scene is refused, and whether its scene was built.
fn judged_scene(text: &str) -> (bool, bool) {
    match scene::read(text, &[]) {
        Ok(scene) if small(&scene) => {
            build(&scene);
            (false, true)
        }
        Ok(_) => (false, false),
        Err(error) => {
            assert!((1..100_000).contains(&error.to_string().len()));
            (true, false)
        }
    }
}

/// More inputs, with counts of the outcomes: `BFREE_FUZZ=1000000 cargo test --release --test suite hostile::fuzz -- --nocapture`
#[test]
fn fuzz() -> Result<(), Failure> {
    let inputs = std::env::var("BFREE_FUZZ").map_or(Ok(10_000), |inputs| inputs.parse::<u64>())?;
    let all = Inputs::new()?;
    let mut random = Random(1);
    let (mut refused, mut built, mut slowest) = (0_u64, 0_u64, (Duration::ZERO, String::new()));
    for k in 0..inputs {
        let kind = k % 14;
        let input = all.broken(kind, &mut random);
        if let Some(file) = all.file(kind) {
            std::fs::write(file, &input)?;
        }
        let start = Instant::now();
        let judged = catch_unwind(AssertUnwindSafe(|| all.judge(kind, &input)));
        let elapsed = start.elapsed();
        let text = || String::from_utf8_lossy(&input).into_owned();
        let Ok(judged) = judged else { return Err(format!("input {k} brings it down:\n{}", text()).into()) };
        refused += u64::from(judged.0);
        built += u64::from(judged.1);
        if elapsed > slowest.0 {
            slowest = (elapsed, text());
        }
    }
    println!("{inputs} inputs: {refused} refused, {built} built, the slowest {:.3} s", slowest.0.as_secs_f64());
    assert!(slowest.0 < Duration::from_secs(1), "{}", slowest.1);
    Ok(())
}
