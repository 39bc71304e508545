//! The sources of `examples/laws`, compiled, and descriptions of the laws in them.

use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use tangent_check::convention::Measure;
use tangent_check::library::child::{ARGUMENT, Host};
use tangent_check::library::{Description, Kind, StressState};

/// Compiles a source of `examples/laws`; `None`, and a note that no test captures, if there is no compiler.
pub fn compile(source: &str) -> Option<PathBuf> {
    static COMPILED: Mutex<Option<HashMap<String, Option<PathBuf>>>> = Mutex::new(None);
    let mut compiled = COMPILED.lock().unwrap();
    let laws = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/laws");
    compiled.get_or_insert_default().entry(source.into()).or_insert_with(|| compile_now(&laws, source)).clone()
}

/// Compiles a source of a test.
pub fn compile_text(source: &str, text: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join(source), text).unwrap();
    compile_now(folder, source)
}

fn compile_now(sources: &Path, source: &str) -> Option<PathBuf> {
    let include = Path::new(env!("CARGO_MANIFEST_DIR")).join("include");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let library = folder.join(format!("lib{}.so", source.split('.').next().unwrap()));
    let compiler = if source.ends_with(".c") { "gcc" } else { "gfortran" };
    // Another process of these tests may be using the file: it is replaced in one move.
    let fresh = folder.join(format!("{source}.{}.so", std::process::id()));
    let mut command = Command::new(compiler);
    command.args(["-O2", "-w", "-shared", "-fPIC", "-I"]).arg(include).arg("-o").arg(&fresh);
    if compiler == "gfortran" {
        // A Fortran module would leave a file in the folder of the sources.
        command.arg("-J").arg(folder);
    }
    match command.arg(sources.join(source)).arg("-lm").status() {
        Ok(status) => assert!(status.success(), "{compiler} does not compile {source}"),
        Err(error) => {
            let note = format!("\n*** NOT TESTED: {source}, because {compiler} cannot be started: {error} ***\n");
            std::io::stderr().write_all(note.as_bytes()).unwrap();
            return None;
        }
    }
    std::fs::rename(&fresh, &library).unwrap();
    Some(library)
}

pub fn host() -> Host {
    Host { program: env!("CARGO_BIN_EXE_tangent-check").into(), arguments: vec![ARGUMENT.into()] }
}

pub fn umat(source: &str, tangent: Measure, properties: &[f64], state: usize) -> Option<Description> {
    let kind = Kind::Umat { material: "STEEL".into(), tangent, temperature: 20.0 };
    Some(Description { kind, state: tangent_check::library::umat::state(state), ..c_law(source, "", properties)? })
}

pub fn c_law(source: &str, name: &str, properties: &[f64]) -> Option<Description> {
    let kind = Kind::C { name: name.into() };
    Some(Description { kind, properties: properties.into(), ..described(compile(source)?) })
}

/// A UMAT without properties and internal variables.
pub fn described(library: PathBuf) -> Description {
    Description {
        library,
        kind: Kind::umat(),
        properties: Vec::new(),
        state: Vec::new(),
        stress_state: StressState::Solid,
    }
}

pub fn mfront(name: &str, properties: &[f64]) -> Option<Description> {
    let kind = Kind::Mfront { name: name.into(), external: Vec::new() };
    Some(Description { kind, ..c_law("like_mfront.c", "", properties)? })
}

/// Plane strain, or three dimensions.
pub fn stress_state(plane: bool) -> StressState {
    if plane { StressState::PlaneStrain } else { StressState::Solid }
}
