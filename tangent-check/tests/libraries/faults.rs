//! Each fault of a library, of its file and of its input is a sentence, and nothing else stops.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::compiled::{c_law, compile, compile_text, described, host, mfront, umat};
use crate::steps::{assert_close, general_step};
use crate::{LAMBDA, MU};
use tangent_check::convention::{Components, Measure};
use tangent_check::law::{Law, Step};
use tangent_check::library::child::{Child, Host, LIMIT};
use tangent_check::library::{Caller, Description, Kind, LibraryLaw, StressState, empty_response, open};
use tangent_check::tensor::{ZERO, product3, sum, transposed};

/// Each fault of a library gives its sentence with the step, and the next call works. The library also prints in every call.
#[test]
fn faults() {
    let faults = [
        (1.0, "the library crashed: signal 11 (SIGSEGV"),
        (2.0, "the library did not return within 1s and was stopped."),
        (3.0, "component 12 of the stress is NaN."),
        (4.0, "entry (22, 12) of the tangent is NaN."),
        (5.0, "the library ended its program, with exit code 0. STOP in Fortran"),
        (6.0, "the library ended its program, with exit code 3. STOP in Fortran"),
        (7.0, "the library crashed: signal 6 (SIGABRT"),
        (8.0, "The library wrote past the end of STATEV, which has 2 numbers."),
        (9.0, "The library wrote before the start of STRESS."),
        (10.0, "the law refuses the step and asks for 0.25 of it (PNEWDT)."),
        (11.0, "component 11 of the stress is NaN."),
        (12.0, "the library crashed: signal 11 (SIGSEGV"),
    ];
    for (fault, sentence) in faults {
        let Some(description) = umat("bad.f90", Measure::CauchyByStrain, &[fault, 100.0], 2) else { return };
        // Only the endless loop has to wait for its limit; elsewhere a busy machine must not reach it.
        let limit = Duration::from_secs(if fault == 2.0 { 1 } else { 60 });
        let mut child = Child::start(host(), description, limit).unwrap();
        let good = Step { strain: ZERO, ..general_step(child.signature(), false) };
        let bad = Step { number: 13, ..good.clone() };
        let mut response = empty_response();
        for _ in 0..2 {
            let said = child.call(&bad, &mut response).unwrap_err().0;
            println!("{said}");
            assert!(said.contains(sentence), "fault {fault}: {said}");
            assert!(said.starts_with("Step 13 from time 0.25 to 0.75 with F = [["), "fault {fault}: {said}");
            child.call(&good, &mut response).unwrap();
            let stress = sum(&ZERO, 100.0, &good.strain_increment);
            let wanted = Components::abaqus(1.0).vector(&stress);
            assert_close(&response.stress, &wanted, 1e-12, "σ after the fault");
        }
    }
}

/// The prints of a library go to the standard error. This test starts itself, to read both.
#[test]
fn prints() {
    const INNER: &str = "TANGENT_CHECK_PRINTS";
    if std::env::var_os(INNER).is_some() {
        let Some(description) = umat("bad.f90", Measure::CauchyByStrain, &[0.0, 100.0], 2) else { return };
        let mut child = Child::start(host(), description, LIMIT).unwrap();
        let step = general_step(child.signature(), false);
        return child.call(&step, &mut empty_response()).unwrap();
    }
    if compile("bad.f90").is_none() {
        return;
    }
    let mut inner = Command::new(std::env::current_exe().unwrap());
    let output = inner.args(["--exact", "faults::prints", "--nocapture"]).env(INNER, "1").output().unwrap();
    assert!(output.status.success());
    let [out, error] = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(error.contains("bad.f90 prints: increment           3"), "{error}");
    assert!(!out.contains("bad.f90"), "{out}");
}

/// Refusals with a message of the library: C and MFront.
#[test]
fn refusals() {
    let visco = c_law("viscoelastic.c", "viscoelastic", &[LAMBDA, MU, 0.1, 1.0]);
    let neo = mfront("SofteningNeoHooke", &[LAMBDA, MU, 0.1]);
    let wanted = [
        (visco, "the law refuses the step with status 1: det F = -1, but it must be positive."),
        (neo, "the behaviour refuses the step (status -1) and asks for 0.1 of the step: det F is not positive"),
    ];
    for (description, sentence) in wanted {
        let Some(description) = description else { continue };
        let mut child = Child::start(host(), description, LIMIT).unwrap();
        let good = general_step(child.signature(), false);
        let mut bad = good.clone();
        bad.gradient = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        let said = child.call(&bad, &mut empty_response()).unwrap_err().0;
        assert!(said.ends_with(sentence), "{said}");
        child.call(&good, &mut empty_response()).unwrap();
    }
}

/// Input that a law cannot take is a sentence before the law is called.
#[test]
fn impossible_input() {
    let Some(mut description) = umat("neo_hookean.f", Measure::JaumannKirchhoff, &[LAMBDA, MU], 0) else { return };
    description.stress_state = StressState::PlaneStrain;
    let mut law = LibraryLaw::new(Box::new(Child::start(host(), description.clone(), LIMIT).unwrap()));
    let good = general_step(law.signature(), true);
    let mut cases: [(Step, &str); 4] = std::array::from_fn(|_| (good.clone(), ""));
    cases[0].0.gradient[1][1] = f64::INFINITY;
    cases[0].1 = "holds a number that is not finite";
    cases[1].0.stress.push(0.0);
    cases[1].1 = "the stress has 5 numbers, but the law needs 4.";
    cases[2].0.state.push(0.0);
    cases[2].1 = "the state has 1 numbers, but the law needs 0.";
    cases[3].0.gradient[0][2] = 0.1;
    cases[3].1 = "the law is for the plane, but the step shears out of it.";
    for (step, sentence) in cases {
        let said = law.respond(&step).unwrap_err().0;
        assert!(said.contains(sentence), "{said}");
    }
    law.respond(&good).unwrap();
}

fn start_fails(description: Description, sentence: &str) {
    let said = Child::start(host(), description.clone(), LIMIT).err().expect(sentence).0;
    println!("{said}");
    assert!(said.contains(sentence), "{said}");
    let said = open(&description).err().expect(sentence).0;
    assert!(said.contains(sentence), "{said}");
}

/// A file that cannot be loaded has an error that says why, in the child and in this program.
#[test]
fn loading_fails() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        described(path)
    };
    let machine = if cfg!(target_arch = "x86_64") { 183 } else { 62 };
    let mut foreign = [0; 64];
    foreign[..6].copy_from_slice(&[0x7f, b'E', b'L', b'F', 2, 1]);
    [foreign[16], foreign[18]] = [3, machine];
    let other = if machine == 183 { "is for aarch64, but this program is for" } else { "is for x86_64, but" };
    start_fails(file("libforeign.so", &foreign), other);
    [foreign[16], foreign[18]] = [1, machine];
    start_fails(file("mine.o", &foreign), "is an object file. Link it: gfortran -shared");
    start_fails(file("libtext.so", b"This is not a library, but a text."), "is not a shared library.");
    start_fails(file("libempty.so", b""), "is not a shared library.");
    let missing = Description { library: folder.join("libnone.so"), ..file("libempty.so", b"") };
    start_fails(missing, "No such file or directory");
}

/// A missing symbol, a wrong number of properties and unknown names say what is there.
#[test]
fn symbols_and_names() {
    let Some(mut visco) = c_law("viscoelastic.c", "viscoelastic", &[LAMBDA, MU]) else { return };
    start_fails(visco.clone(), "2 properties were given, but the law needs 4: lambda, mu, g, tau.");
    let kind = Kind::umat();
    start_fails(Description { kind, ..visco.clone() }, "it has no symbol umat_, umat, UMAT.");
    start_fails(Description { kind: Kind::C { name: "nothing".into() }, ..visco.clone() }, "no symbol nothing_version");
    visco.properties = vec![LAMBDA, MU, 0.1, 1.0];
    visco.state = vec![("Q14".into(), 0.0)];
    start_fails(visco, "The law has no internal variable `Q14`. It has: Q11, Q22,");
    let Some(description) = mfront("Nothing", &[]) else { return };
    start_fails(description, "it has no symbol Nothing_Tridimensional.");
    let measure = Measure::PiolaByGradient;
    let Some(description) = umat("neo_hookean.f", measure, &[LAMBDA, MU], 0) else { return };
    start_fails(description, "PiolaByGradient cannot be the tangent of a UMAT");
}

/// A UMAT finds Abaqus' utility routines in this program and in the child. It returns the stress that ROTSIG turns by DROT; a routine that
/// nobody has is named.
#[test]
fn utilities() {
    let source = "
        void umat_(double *s, double *v, double *c, double *e, double *p, double *r, double *rpl, double *t, double *d, double *dr,
                   double *eps, double *deps, double *time, double *dt, double *temp, double *dtemp, double *pre, double *dpre, char *name,
                   int *ndi, int *nshr, int *ntens, int *nstatv, double *props, int *nprops, double *coords, double *drot) {
            int strain = 2, number = 0;
            int all = getnumcpus_(&number) + (long)&sprinc_ + (long)&sprind_ + (long)&sinv_ + (long)&MutexInit + (long)&getjobname_;
            rotsig_(deps, drot, s, &strain, ndi, nshr);
            if (number != 1 || all == 0) xit_();
        }";
    let declared = ["getnumcpus_", "sprinc_", "sprind_", "sinv_", "MutexInit", "getjobname_", "rotsig_", "xit_"];
    let source = declared.map(|name| format!("int {name}();\n")).concat() + source;
    let Some(known) = compile_text("utilities.c", &source).map(described) else { return };
    let callers: [Box<dyn Caller>; 2] =
        [open(&known).unwrap(), Box::new(Child::start(host(), known.clone(), LIMIT).unwrap())];
    for mut caller in callers {
        let step = general_step(caller.signature(), false);
        let mut response = empty_response();
        caller.call(&step, &mut response).unwrap();
        let turned = product3(&step.rotation, &step.strain_increment, &transposed(&step.rotation));
        assert_close(&response.stress, &caller.signature().convention.strain.vector(&turned), 1e-14, "ROTSIG");
    }
    let unknown = compile_text("unknown.c", "void mine_(void); void umat_(void) { mine_(); }").map(described).unwrap();
    if cfg!(target_os = "linux") {
        start_fails(unknown, "undefined symbol: mine_. Give or link the source file that has this routine, too.");
    }
}

/// A program that is no child, or does not exist, is an error and not a hang.
#[test]
fn wrong_host() {
    let Some(description) = c_law("viscoelastic.c", "viscoelastic", &[LAMBDA, MU, 0.1, 1.0]) else { return };
    for (program, sentence) in [("/bin/true", "while it was loaded"), ("/nowhere/at/all", "cannot start")] {
        let host = Host { program: program.into(), arguments: Vec::new() };
        let said = Child::start(host, description.clone(), LIMIT).err().unwrap().0;
        assert!(said.contains(sentence), "{said}");
    }
    // A limit beyond every clock does not overflow.
    let mut child = Child::start(host(), description, Duration::MAX).unwrap();
    let step = general_step(child.signature(), false);
    child.call(&step, &mut empty_response()).unwrap();
}
