//! Laws in Fortran and C, compiled here and called in this program and in a child process.

#![cfg(all(unix, feature = "libraries"))]

use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use tangent_check::convention::{Components, Measure, Tensor};
use tangent_check::law::{Law, Response, Step};
use tangent_check::library::child::{ARGUMENT, Child, Host, LIMIT};
use tangent_check::library::{Caller, Description, Kind, LibraryLaw, c, empty_response, open, umat};
use tangent_check::matrix::Matrix;

const IDENTITY: Tensor = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const LAMBDA: f64 = 3.0;
const MU: f64 = 2.0;

/// Compiles a source of `examples/laws`; `None`, and a note that no test captures, if there is no compiler.
fn compile(source: &str) -> Option<PathBuf> {
    static COMPILED: Mutex<Option<HashMap<String, Option<PathBuf>>>> = Mutex::new(None);
    let mut compiled = COMPILED.lock().unwrap();
    compiled.get_or_insert_default().entry(source.into()).or_insert_with(|| compile_now(source)).clone()
}

fn compile_now(source: &str) -> Option<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let laws = here.join("../../examples/laws");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let library = folder.join(format!("lib{}.so", source.split('.').next().unwrap()));
    let compiler = if source.ends_with(".c") { "gcc" } else { "gfortran" };
    // Another process of these tests may be using the file: it is replaced in one move.
    let fresh = folder.join(format!("{source}.{}.so", std::process::id()));
    let mut command = Command::new(compiler);
    command.args(["-O2", "-shared", "-fPIC", "-I"]).arg(here.join("include")).arg("-o").arg(&fresh);
    if compiler == "gfortran" {
        // A Fortran module would leave a file in the folder of the sources.
        command.arg("-J").arg(folder);
    }
    match command.arg(laws.join(source)).arg("-lm").status() {
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

fn host() -> Host {
    Host { program: env!("CARGO_BIN_EXE_tangent-check-child").into(), arguments: vec![ARGUMENT.into()] }
}

fn umat(source: &str, tangent: Measure, properties: &[f64], state: usize) -> Option<Description> {
    let kind = Kind::Umat { material: "STEEL".into(), tangent, temperature: 20.0 };
    Some(Description { kind, state: umat::state(state), ..c_law(source, "", properties)? })
}

fn c_law(source: &str, name: &str, properties: &[f64]) -> Option<Description> {
    Some(Description {
        library: compile(source)?,
        kind: Kind::C { name: name.into() },
        properties: properties.into(),
        state: Vec::new(),
        plane_strain: false,
    })
}

fn mfront(name: &str, properties: &[f64]) -> Option<Description> {
    let kind = Kind::Mfront { name: name.into(), external: Vec::new() };
    Some(Description { kind, ..c_law("like_mfront.c", "", properties)? })
}

fn product(a: &Tensor, b: &Tensor) -> Tensor {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transpose(a: &Tensor) -> Tensor {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// a + s b
fn sum(a: &Tensor, s: f64, b: &Tensor) -> Tensor {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + s * b[i][j]))
}

fn trace(a: &Tensor) -> f64 {
    a[0][0] + a[1][1] + a[2][2]
}

fn double_dot(a: &Tensor, b: &Tensor) -> f64 {
    trace(&product(a, &transpose(b)))
}

fn determinant(a: &Tensor) -> f64 {
    a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1])
        + a[0][1] * (a[1][2] * a[2][0] - a[1][0] * a[2][2])
        + a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0])
}

fn inverse(a: &Tensor) -> Tensor {
    let square = product(a, a);
    let [first, second] = [trace(a), (trace(a).powi(2) - trace(&square)) / 2.0];
    // Cayley–Hamilton: a⁻¹ = (a² − I₁ a + I₂ 1) / det a.
    let adjugate = sum(&sum(&square, -first, a), second, &IDENTITY);
    sum(&[[0.0; 3]; 3], determinant(a).recip(), &adjugate)
}

/// A turn about the axis (1, 2, 2)/3.
fn rotation(angle: f64) -> Tensor {
    let n = [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
    let skew = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]];
    sum(&sum(&IDENTITY, angle.sin(), &skew), 1.0 - angle.cos(), &product(&skew, &skew))
}

/// A turn about the third axis, which stays in the plane.
fn plane_rotation(angle: f64) -> Tensor {
    let [sine, cosine] = [angle.sin(), angle.cos()];
    [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]
}

/// λ tr E 1 + 2 μ E
fn hooke(λ: f64, μ: f64, strain: &Tensor) -> Tensor {
    sum(&sum(&[[0.0; 3]; 3], λ * trace(strain), &IDENTITY), 2.0 * μ, strain)
}

fn green_lagrange(f: &Tensor) -> Tensor {
    let difference = sum(&product(&transpose(f), f), -1.0, &IDENTITY);
    sum(&[[0.0; 3]; 3], 0.5, &difference)
}

fn vector(tensor: &Tensor, components: &Components) -> Vec<f64> {
    let factor = |row, column| if row == column { 1.0 } else { components.shear };
    components.pairs.iter().map(|&(row, column)| factor(row, column) * tensor[row][column]).collect()
}

fn tensor(vector: &[f64], components: &Components) -> Tensor {
    let mut tensor = [[0.0; 3]; 3];
    for (number, &(row, column)) in vector.iter().zip(&components.pairs) {
        tensor[row][column] = number / if row == column { 1.0 } else { components.shear };
        tensor[column][row] = tensor[row][column];
    }
    tensor
}

/// A step with stretch, shear, rotation and a change of volume, in the plane or out of it. The strains belong to no deformation; a law reads
/// either them or F.
fn general_step(signature: &tangent_check::library::Signature, plane: bool) -> Step {
    let out = if plane { 0.0 } else { 1.0 };
    let gradient_before =
        [[1.05, 0.1, -0.03 * out], [0.02, 0.97, 0.04 * out], [0.01 * out, 0.05 * out, 1.0 + 0.02 * out]];
    let stretch = [[1.2, 0.15, 0.1 * out], [0.15, 0.9, -0.05 * out], [0.1 * out, -0.05 * out, 1.0 + 0.1 * out]];
    let turn = if plane { plane_rotation } else { rotation };
    Step {
        time: 0.25,
        length: 0.5,
        number: 3,
        gradient_before,
        gradient: product(&turn(0.6), &stretch),
        strain: [[3e-3, 1e-3, -2e-3 * out], [1e-3, -1e-3, 5e-4 * out], [-2e-3 * out, 5e-4 * out, 1e-3 * out]],
        strain_increment: [[4e-3, 3e-3, 1e-3 * out], [3e-3, -2e-3, 2e-3 * out], [1e-3 * out, 2e-3 * out, 1e-3 * out]],
        rotation: turn(0.3),
        stress: vec![0.0; signature.convention.stress.pairs.len()],
        state: signature.state_at_rest.clone(),
    }
}

fn assert_close(found: &[f64], wanted: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    let greatest = |numbers: &[f64]| numbers.iter().fold(0.0, |greatest: f64, number| greatest.max(number.abs()));
    let differences: Vec<f64> = found.iter().zip(wanted).map(|(found, wanted)| found - wanted).collect();
    let relative = greatest(&differences) / greatest(wanted);
    assert!(relative <= tolerance, "{what}: off by {relative:e}\n{found:?}\n{wanted:?}");
}

/// The step with its last increment changed by `change` in a direction of the convention.
fn perturbed(step: &Step, measure: Measure, direction: &Tensor, change: f64) -> Step {
    let mut step = step.clone();
    match measure {
        Measure::PiolaByGradient => step.gradient = sum(&step.gradient, change, direction),
        Measure::CauchyByStrain => step.strain_increment = sum(&step.strain_increment, change, direction),
        _ => {
            // exp(change · direction), up to an error of the fourth power of the change.
            let [first, second] = [sum(&IDENTITY, change, direction), product(direction, direction)];
            let third = product(&second, direction);
            let exponential = sum(&sum(&first, change.powi(2) / 2.0, &second), change.powi(3) / 6.0, &third);
            step.gradient = product(&exponential, &step.gradient);
        }
    }
    step
}

/// The tangent by central differences of two steps, extrapolated.
fn measured(caller: &mut dyn Caller, step: &Step) -> Matrix {
    let convention = caller.signature().convention.clone();
    let (stress, strain) = (&convention.stress, &convention.strain);
    let full = convention.measure == Measure::PiolaByGradient;
    let kirchhoff = convention.measure == Measure::JaumannKirchhoff;
    let mut response = empty_response();
    let mut tangent = Matrix::zeros(stress.pairs.len(), strain.pairs.len());
    for (column, &(k, l)) in strain.pairs.iter().enumerate() {
        let mut direction = [[0.0; 3]; 3];
        direction[k][l] = if k == l { 1.0 } else { 1.0 / strain.shear };
        if !full {
            direction[l][k] = direction[k][l];
        }
        let mut at = |change: f64| {
            let step = perturbed(step, convention.measure, &direction, change);
            caller.call(&step, &mut response).unwrap();
            let factor = if kirchhoff { determinant(&step.gradient) } else { 1.0 };
            response.stress.iter().map(|stress| factor * stress).collect::<Vec<_>>()
        };
        // Strain increments are a thousand times smaller than the entries of F.
        let h = if convention.measure == Measure::CauchyByStrain { 1e-6 } else { 1e-3 };
        let values = [h, -h, h / 2.0, -h / 2.0].map(&mut at);
        for row in 0..stress.pairs.len() {
            let coarse = (values[0][row] - values[1][row]) / (2.0 * h);
            let fine = (values[2][row] - values[3][row]) / h;
            let factor = if kirchhoff { determinant(&step.gradient) } else { 1.0 };
            tangent[(row, column)] = (4.0 * fine - coarse) / 3.0 / factor;
        }
    }
    tangent
}

/// The response in this program and in the child, which must be the same to the last bit; and the tangent against differences.
fn checked(description: &Description, step: &dyn Fn(&tangent_check::library::Signature) -> Step) -> Response {
    let mut inside = open(description).unwrap();
    let mut outside = Child::start(host(), description.clone(), LIMIT).unwrap();
    assert_eq!(inside.signature(), outside.signature());
    let step = step(inside.signature());
    let [mut response, mut other] = [empty_response(), empty_response()];
    inside.call(&step, &mut response).unwrap();
    outside.call(&step, &mut other).unwrap();
    assert_eq!(response, other);
    let tangent = measured(&mut outside, &step);
    assert_close(&response.tangent.entries, &tangent.entries, 1e-9, &inside.signature().name);
    response
}

/// P = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ
fn neo_hookean(f: &Tensor) -> Tensor {
    let cofactor = transpose(&inverse(f));
    sum(&sum(&sum(&[[0.0; 3]; 3], MU, f), -MU, &cofactor), LAMBDA * determinant(f).ln(), &cofactor)
}

/// A UMAT of the total F in 3D and plane strain: σ = P Fᵀ / J.
#[test]
fn neo_hookean_umat() {
    for plane in [false, true] {
        let Some(mut description) = umat("neo_hookean.f", Measure::JaumannKirchhoff, &[LAMBDA, MU], 0) else { return };
        description.plane_strain = plane;
        let response = checked(&description, &|signature| general_step(signature, plane));
        let f = general_step(open(&description).unwrap().signature(), plane).gradient;
        let kirchhoff = product(&neo_hookean(&f), &transpose(&f));
        let cauchy = sum(&[[0.0; 3]; 3], 1.0 / determinant(&f), &kirchhoff);
        assert_close(&response.stress, &vector(&cauchy, &umat::components(plane, 1.0)), 1e-12, "σ");
    }
}

/// Radial return with tensors; the plastic multiplier by bisection.
fn radial_return(properties: &[f64; 6], stress: &Tensor, a: f64, strain_increment: &Tensor) -> (Tensor, f64) {
    let [e, ν, σ_0, h, q, δ] = *properties;
    let [λ, g] = [e * ν / ((1.0 + ν) * (1.0 - 2.0 * ν)), e / (2.0 * (1.0 + ν))];
    let trial = sum(stress, 1.0, &hooke(λ, g, strain_increment));
    let deviator = sum(&trial, -trace(&trial) / 3.0, &IDENTITY);
    let mises = (1.5 * double_dot(&deviator, &deviator)).sqrt();
    let excess = |step: f64| mises - 3.0 * g * step - (σ_0 + h * (a + step) + q * (1.0 - (-δ * (a + step)).exp()));
    if excess(0.0) <= 0.0 {
        return (trial, a);
    }
    let [mut low, mut high] = [0.0, mises / (3.0 * g)];
    for _ in 0..200 {
        let middle = (low + high) / 2.0;
        *if excess(middle) > 0.0 { &mut low } else { &mut high } = middle;
    }
    (sum(&trial, -3.0 * g * low / mises, &deviator), a + low)
}

/// A UMAT of the strain increment, elastic and plastic, with a stress at the start that DROT turns.
#[test]
fn j2_umat() {
    let properties = [210e3, 0.3, 400.0, 1e3, 150.0, 20.0];
    for (plane, scale) in [(false, 1.0), (true, 1.0), (false, 1e-2)] {
        let Some(mut description) = umat("j2.f90", Measure::CauchyByStrain, &properties, 1) else { return };
        description.plane_strain = plane;
        let components = umat::components(plane, 1.0);
        let make = |signature: &tangent_check::library::Signature| {
            let mut step = general_step(signature, plane);
            step.strain_increment = sum(&[[0.0; 3]; 3], scale, &step.strain_increment);
            step.stress = vec![120.0, -80.0, 30.0, 50.0, -20.0, 10.0][..components.pairs.len()].to_vec();
            step.state = vec![0.01];
            step
        };
        let response = checked(&description, &make);
        let step = make(open(&description).unwrap().signature());
        let before = tensor(&step.stress, &components);
        let before = product(&product(&step.rotation, &before), &transpose(&step.rotation));
        let (stress, a) = radial_return(&properties, &before, 0.01, &step.strain_increment);
        assert_eq!(a > 0.01, scale == 1.0, "the step is plastic or elastic as planned");
        assert_close(&response.stress, &vector(&stress, &components), 1e-12, "σ");
        assert_close(&response.state, &[a], 1e-12, "equivalent plastic strain");
    }
}

/// A law in C with memory over two steps: S = 𝕃 : E + Q, Q = a Qₙ + g b 𝕃 : (E − Eₙ).
#[test]
fn viscoelastic_c() {
    let [g, τ] = [0.4, 0.7];
    let Some(description) = c_law("viscoelastic.c", "viscoelastic", &[LAMBDA, MU, g, τ]) else { return };
    let state_before: Vec<f64> = [0.1, -0.2, 0.3, 0.05, -0.1, 0.2].into();
    let make = |signature: &tangent_check::library::Signature| Step {
        state: state_before.clone(),
        ..general_step(signature, false)
    };
    let response = checked(&description, &make);
    let caller = open(&description).unwrap();
    assert_eq!(caller.signature().properties, ["lambda", "mu", "g", "tau"]);
    assert_eq!(caller.signature().state[3], "Q12");
    let step = make(caller.signature());
    let [e_n, e] = [green_lagrange(&step.gradient_before), green_lagrange(&step.gradient)];
    let decay = (-step.length / τ).exp();
    let branch = g * (1.0 - decay) * τ / step.length;
    let components = umat::components(false, 1.0);
    let before = sum(&[[0.0; 3]; 3], decay, &tensor(&state_before, &components));
    let q = sum(&before, branch, &hooke(LAMBDA, MU, &sum(&e, -1.0, &e_n)));
    let p = product(&step.gradient, &sum(&hooke(LAMBDA, MU, &e), 1.0, &q));
    assert_close(&response.stress, p.as_flattened(), 1e-12, "P");
    assert_close(&response.state, &vector(&q, &components), 1e-12, "Q");
}

/// A law in Fortran through the C header; and the energy, whose derivative is P.
#[test]
fn saint_venant_fortran() {
    let Some(description) = c_law("saint_venant.f90", "saint_venant", &[LAMBDA, MU]) else { return };
    let response = checked(&description, &|signature| general_step(signature, false));
    let mut law = c::CLaw::open(&description).unwrap();
    let step = general_step(law.signature(), false);
    let e = green_lagrange(&step.gradient);
    let p = product(&step.gradient, &hooke(LAMBDA, MU, &e));
    assert_close(&response.stress, p.as_flattened(), 1e-12, "P");
    assert_eq!(law.energy(), None);
    law.call(&step, &mut empty_response()).unwrap();
    let energy = law.energy().unwrap();
    assert_close(&[energy], &[double_dot(&e, &hooke(LAMBDA, MU, &e)) / 2.0], 1e-12, "energy");
}

/// A finite strain behaviour with MFront's interface, loading and unloading.
#[test]
fn mfront_finite_strain() {
    let softening = 0.6;
    for (plane, greatest) in [(false, 0.0), (false, 2.0), (true, 0.0), (true, 2.0)] {
        let Some(mut description) = mfront("SofteningNeoHooke", &[LAMBDA, MU, softening]) else { return };
        description.plane_strain = plane;
        description.state = vec![("GreatestEnergy".into(), greatest)];
        let response = checked(&description, &|signature| general_step(signature, plane));
        let caller = open(&description).unwrap();
        assert_eq!(caller.signature().properties[2], "Softening");
        let f = general_step(caller.signature(), plane).gradient;
        let ln_j = determinant(&f).ln();
        let w = MU / 2.0 * (double_dot(&f, &f) - 3.0 - 2.0 * ln_j) + LAMBDA / 2.0 * ln_j * ln_j;
        let η = if w < greatest { 1.0 - softening * (1.0 - w / greatest) } else { 1.0 };
        let p = sum(&[[0.0; 3]; 3], η, &neo_hookean(&f));
        let components = caller.signature().convention.stress.clone();
        assert_eq!(components.pairs.len(), if plane { 5 } else { 9 });
        assert_close(&response.stress, &vector(&p, &components), 1e-12, "P");
        assert_close(&response.state, &[w.max(greatest)], 1e-12, "greatest energy");
    }
}

/// A small strain behaviour with MFront's interface: √2, the elastic properties in front, and a tensor that turns with the material.
#[test]
fn mfront_small_strain() {
    let [e, ν] = [70e3, 0.25];
    for plane in [false, true] {
        let Some(mut description) = mfront("Elasticity", &[e, ν]) else { return };
        description.plane_strain = plane;
        let before = [1e-3, 2e-3, -1e-3, 3e-3, -2e-3, 1e-3];
        let make = |signature: &tangent_check::library::Signature| {
            let mut step = general_step(signature, plane);
            step.state = before[..step.state.len()].to_vec();
            step
        };
        let response = checked(&description, &make);
        let caller = open(&description).unwrap();
        let signature = caller.signature();
        assert_eq!(signature.properties, ["YoungModulus", "PoissonRatio"]);
        assert_eq!(signature.state[3], "ElasticStrain12");
        let step = make(signature);
        let components = Components { shear: 2f64.sqrt(), ..umat::components(plane, 1.0) };
        assert_eq!([&signature.convention.stress, &signature.convention.strain], [&components; 2]);
        let turned = product(&product(&step.rotation, &tensor(&step.state, &components)), &transpose(&step.rotation));
        let strain = sum(&turned, 1.0, &step.strain_increment);
        let stress = hooke(e * ν / ((1.0 + ν) * (1.0 - 2.0 * ν)), e / (2.0 * (1.0 + ν)), &strain);
        assert_close(&response.stress, &vector(&stress, &components), 1e-12, "σ");
        assert_close(&response.state, &vector(&strain, &components), 1e-12, "elastic strain");
    }
}

/// A UMAT that writes what it was given into STATEV, in the order of [`every_argument`].
const PROBE: &str = "
subroutine umat(stress, statev, ddsdde, sse, spd, scd, rpl, ddsddt, drplde, drpldt, stran, dstran, time, dtime, &
    temp, dtemp, predef, dpred, cmname, ndi, nshr, ntens, nstatv, props, nprops, coords, drot, pnewdt, celent, &
    dfgrd0, dfgrd1, noel, npt, layer, kspt, jstep, kinc)
  implicit none
  integer :: ndi, nshr, ntens, nstatv, nprops, noel, npt, layer, kspt, jstep(4), kinc
  double precision :: stress(ntens), statev(nstatv), ddsdde(ntens, ntens), sse, spd, scd, rpl, ddsddt(ntens)
  double precision :: drplde(ntens), drpldt, stran(ntens), dstran(ntens), time(2), dtime, temp, dtemp, predef(1)
  double precision :: dpred(1), props(nprops), coords(3), drot(3, 3), pnewdt, celent, dfgrd0(3, 3), dfgrd1(3, 3)
  character(len=*) :: cmname
  statev = [stress, stran, dstran, time, dtime, temp, dtemp, transpose(drot), transpose(dfgrd0), transpose(dfgrd1), &
    props, dble([ndi, nshr, ntens, nstatv, nprops, noel, npt, layer, kspt, jstep, kinc, len(cmname), &
    len_trim(cmname), ichar(cmname(1:1)), ichar(cmname(5:5))]), sum(abs(ddsdde)) + sse + spd + scd + rpl + drpldt &
    + sum(abs(ddsddt)) + sum(abs(drplde)) + sum(abs(coords)) + predef + dpred, celent]
  if (pnewdt < 1e10) statev = -1
end subroutine umat
";

/// Each argument of a UMAT arrives: its value, its order of components, the length of CMNAME.
#[test]
fn every_argument() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let [source, library] = ["probe.f90", "libprobe.so"].map(|name| folder.join(name));
    std::fs::write(&source, PROBE).unwrap();
    let mut compiler = Command::new("gfortran");
    let Ok(status) = compiler.args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).status() else {
        std::io::stderr().write_all(b"\n*** NOT TESTED: every_argument, there is no gfortran ***\n").unwrap();
        return;
    };
    assert!(status.success());
    let state = umat::state(72);
    let kind = Kind::Umat { material: "STEEL".into(), tangent: Measure::JaumannKirchhoff, temperature: 20.0 };
    let description = Description { library, kind, properties: vec![7.0, 8.0], state, plane_strain: false };
    let mut law = LibraryLaw::new(Box::new(Child::start(host(), description, LIMIT).unwrap()));
    let mut step = general_step(law.signature(), false);
    step.stress = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let [stress, engineering] = [1.0, 2.0].map(|shear| umat::components(false, shear));
    let turned = product(&product(&step.rotation, &tensor(&step.stress, &stress)), &transpose(&step.rotation));
    let wanted = [
        &vector(&turned, &stress)[..],
        &vector(&step.strain, &engineering),
        &vector(&step.strain_increment, &engineering),
        &[0.25, 0.25, 0.5, 20.0, 0.0],
        step.rotation.as_flattened(),
        step.gradient_before.as_flattened(),
        step.gradient.as_flattened(),
        &[7.0, 8.0, 3.0, 3.0, 6.0, 72.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 3.0],
        &[80.0, 5.0, f64::from(b'S'), f64::from(b'L'), 0.0, 1.0],
    ];
    assert_close(&law.respond(&step).unwrap().state, &wanted.concat(), 1e-15, "arguments");
}

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
        let good = Step { strain: [[0.0; 3]; 3], ..general_step(child.signature(), false) };
        let bad = Step { number: 13, ..good.clone() };
        let mut response = empty_response();
        for _ in 0..2 {
            let said = child.call(&bad, &mut response).unwrap_err().0;
            println!("{said}");
            assert!(said.contains(sentence), "fault {fault}: {said}");
            assert!(said.starts_with("Step 13 from time 0.25 to 0.75 with F = [["), "fault {fault}: {said}");
            child.call(&good, &mut response).unwrap();
            let stress = sum(&[[0.0; 3]; 3], 100.0, &good.strain_increment);
            assert_close(&response.stress, &vector(&stress, &umat::components(false, 1.0)), 1e-12, "σ after the fault");
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
    let output = inner.args(["--exact", "prints", "--nocapture"]).env(INNER, "1").output().unwrap();
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
    description.plane_strain = true;
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
    cases[3].1 = "the law is for plane strain, but the step shears out of the plane.";
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
        Description {
            library: path,
            kind: Kind::umat(),
            properties: Vec::new(),
            state: Vec::new(),
            plane_strain: false,
        }
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

/// A UMAT that needs one of Abaqus' utility routines is told to link it.
#[test]
fn missing_utility() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let [source, library] = ["needs_rotsig.c", "libneeds_rotsig.so"].map(|name| folder.join(name));
    std::fs::write(&source, "void rotsig_(void); void umat_(void) { rotsig_(); }").unwrap();
    let status = Command::new("gcc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).status();
    let Ok(status) = status else {
        std::io::stderr().write_all(b"\n*** NOT TESTED: missing_utility, there is no gcc ***\n").unwrap();
        return;
    };
    assert!(status.success());
    let state = Vec::new();
    let description = Description { library, kind: Kind::umat(), properties: Vec::new(), state, plane_strain: false };
    let sentence = "This is a utility routine of Abaqus; link an implementation of it into the library.";
    if cfg!(target_os = "linux") {
        start_fails(description, sentence);
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

/// Calls per second, in this program and through the child. `cargo test --release … speed -- --nocapture` prints them.
#[test]
fn speed() {
    let Some(description) = umat("neo_hookean.f", Measure::JaumannKirchhoff, &[LAMBDA, MU], 0) else { return };
    let callers: [(&str, Box<dyn Caller>); 2] = [
        ("in this program", open(&description).unwrap()),
        ("through the child", Box::new(Child::start(host(), description, LIMIT).unwrap())),
    ];
    for (place, mut caller) in callers {
        let step = general_step(caller.signature(), false);
        let mut response = empty_response();
        let start = Instant::now();
        let mut calls = 0;
        while start.elapsed() < Duration::from_millis(300) {
            caller.call(&step, &mut response).unwrap();
            calls += 1;
        }
        println!("neo_hookean.f {place}: {:.0} calls a second", f64::from(calls) / start.elapsed().as_secs_f64());
        assert!(calls > 100);
    }
}
