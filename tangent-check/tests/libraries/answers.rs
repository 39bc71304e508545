//! The answers of right laws are those of their formulas, and their tangents those of differences.

use crate::compiled::{c_law, compile_text, described, host, mfront, stress_state, umat};
use crate::steps::{assert_close, double_dot, general_step, green_lagrange, hooke};
use crate::{LAMBDA, MU};
use tangent_check::convention::{Components, Measure, Tensor};
use tangent_check::finding::Verdict;
use tangent_check::judge::check_columns;
use tangent_check::law::{Law, Response, Step};
use tangent_check::library::child::{Child, LIMIT};
use tangent_check::library::{Caller, Description, Kind, LibraryLaw, Signature, StressState, c};
use tangent_check::library::{empty_response, open, umat};
use tangent_check::roads::{Perturbed, inputs_read, roads};
use tangent_check::tensor::{IDENTITY, ZERO, determinant, inverse, product, sum, trace, transposed};

/// The response in this program and in the child, which must be the same to the last bit; and the tangent against differences.
fn checked(description: &Description, step: &dyn Fn(&Signature) -> Step) -> Response {
    let mut inside = open(description).unwrap();
    let mut outside = Child::start(host(), description.clone(), LIMIT).unwrap();
    assert_eq!(inside.signature(), outside.signature());
    let step = step(inside.signature());
    let [mut response, mut other] = [empty_response(), empty_response()];
    inside.call(&step, &mut response).unwrap();
    outside.call(&step, &mut other).unwrap();
    assert_eq!(response, other);
    let mut law = LibraryLaw::new(Box::new(outside));
    let read = inputs_read(&mut law, &step).unwrap();
    let mut perturbed = Perturbed::new(&mut law, &step, roads(&read, inside.signature().convention.measure)[0]);
    let value = perturbed.value(0, 0.0).unwrap();
    let name = &inside.signature().name;
    let finding = check_columns(name, &response.tangent, &value, &mut |k, h| perturbed.value(k, h));
    assert_eq!(finding.verdict, Verdict::Consistent, "{finding:?}");
    response
}

/// P = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ
fn neo_hookean(f: &Tensor) -> Tensor {
    let cofactor = transposed(&inverse(f).unwrap());
    sum(&sum(&sum(&ZERO, MU, f), -MU, &cofactor), LAMBDA * determinant(f).ln(), &cofactor)
}

/// A UMAT of the total F in 3D and plane strain: σ = P Fᵀ / J.
#[test]
fn neo_hookean_umat() {
    for plane in [false, true] {
        let Some(mut description) = umat("neo_hookean.f", Measure::JaumannKirchhoff, &[LAMBDA, MU], 0) else { return };
        description.stress_state = stress_state(plane);
        let response = checked(&description, &|signature| general_step(signature, plane));
        let f = general_step(open(&description).unwrap().signature(), plane).gradient;
        let kirchhoff = product(&neo_hookean(&f), &transposed(&f));
        let cauchy = sum(&ZERO, 1.0 / determinant(&f), &kirchhoff);
        assert_close(&response.stress, &umat::components(stress_state(plane), 1.0).vector(&cauchy), 1e-12, "σ");
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
        description.stress_state = stress_state(plane);
        let components = umat::components(stress_state(plane), 1.0);
        let make = |signature: &Signature| {
            let mut step = general_step(signature, plane);
            step.strain_increment = sum(&ZERO, scale, &step.strain_increment);
            step.stress = vec![120.0, -80.0, 30.0, 50.0, -20.0, 10.0][..components.pairs.len()].to_vec();
            step.state = vec![0.01];
            step
        };
        let response = checked(&description, &make);
        let step = make(open(&description).unwrap().signature());
        let before = components.symmetric_tensor(&step.stress);
        let before = product(&product(&step.rotation, &before), &transposed(&step.rotation));
        let (stress, a) = radial_return(&properties, &before, 0.01, &step.strain_increment);
        assert_eq!(a > 0.01, scale == 1.0, "the step is plastic or elastic as planned");
        assert_close(&response.stress, &components.vector(&stress), 1e-12, "σ");
        assert_close(&response.state, &[a], 1e-12, "equivalent plastic strain");
    }
}

/// A law in C with memory over two steps: S = 𝕃 : E + Q, Q = a Qₙ + g b 𝕃 : (E − Eₙ).
#[test]
fn viscoelastic_c() {
    let [g, τ] = [0.4, 0.7];
    let Some(description) = c_law("viscoelastic.c", "viscoelastic", &[LAMBDA, MU, g, τ]) else { return };
    let state_before: Vec<f64> = [0.1, -0.2, 0.3, 0.05, -0.1, 0.2].into();
    let make = |signature: &Signature| Step { state: state_before.clone(), ..general_step(signature, false) };
    let response = checked(&description, &make);
    let caller = open(&description).unwrap();
    assert_eq!(caller.signature().properties, ["lambda", "mu", "g", "tau"]);
    assert_eq!(caller.signature().state[3], "Q12");
    let step = make(caller.signature());
    let [e_n, e] = [green_lagrange(&step.gradient_before), green_lagrange(&step.gradient)];
    let decay = (-step.length / τ).exp();
    let branch = g * (1.0 - decay) * τ / step.length;
    let components = umat::components(StressState::Solid, 1.0);
    let before = sum(&ZERO, decay, &components.symmetric_tensor(&state_before));
    let q = sum(&before, branch, &hooke(LAMBDA, MU, &sum(&e, -1.0, &e_n)));
    let p = product(&step.gradient, &sum(&hooke(LAMBDA, MU, &e), 1.0, &q));
    assert_close(&response.stress, p.as_flattened(), 1e-12, "P");
    assert_close(&response.state, &components.vector(&q), 1e-12, "Q");
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
        description.stress_state = stress_state(plane);
        description.state = vec![("GreatestEnergy".into(), greatest)];
        let response = checked(&description, &|signature| general_step(signature, plane));
        let caller = open(&description).unwrap();
        assert_eq!(caller.signature().properties[2], "Softening");
        let f = general_step(caller.signature(), plane).gradient;
        let ln_j = determinant(&f).ln();
        let w = MU / 2.0 * (double_dot(&f, &f) - 3.0 - 2.0 * ln_j) + LAMBDA / 2.0 * ln_j * ln_j;
        let η = if w < greatest { 1.0 - softening * (1.0 - w / greatest) } else { 1.0 };
        let p = sum(&ZERO, η, &neo_hookean(&f));
        let components = caller.signature().convention.stress.clone();
        assert_eq!(components.pairs.len(), if plane { 5 } else { 9 });
        assert_close(&response.stress, &components.vector(&p), 1e-12, "P");
        assert_close(&response.state, &[w.max(greatest)], 1e-12, "greatest energy");
    }
}

/// A small strain behaviour with MFront's interface: √2, the elastic properties in front, and a tensor that turns with the material.
#[test]
fn mfront_small_strain() {
    let [e, ν] = [70e3, 0.25];
    for plane in [false, true] {
        let Some(mut description) = mfront("Elasticity", &[e, ν]) else { return };
        description.stress_state = stress_state(plane);
        let before = [1e-3, 2e-3, -1e-3, 3e-3, -2e-3, 1e-3];
        let make = |signature: &Signature| {
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
        let components = Components { shear: 2f64.sqrt(), ..umat::components(stress_state(plane), 1.0) };
        assert_eq!([&signature.convention.stress, &signature.convention.strain], [&components; 2]);
        let turned =
            product(&product(&step.rotation, &components.symmetric_tensor(&step.state)), &transposed(&step.rotation));
        let strain = sum(&turned, 1.0, &step.strain_increment);
        let stress = hooke(e * ν / ((1.0 + ν) * (1.0 - 2.0 * ν)), e / (2.0 * (1.0 + ν)), &strain);
        assert_close(&response.stress, &components.vector(&stress), 1e-12, "σ");
        assert_close(&response.state, &components.vector(&strain), 1e-12, "elastic strain");
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
    let Some(library) = compile_text("probe.f90", PROBE) else { return };
    let kind = Kind::Umat { material: "STEEL".into(), tangent: Measure::JaumannKirchhoff, temperature: 20.0 };
    let description = Description { kind, properties: vec![7.0, 8.0], state: umat::state(72), ..described(library) };
    let mut law = LibraryLaw::new(Box::new(Child::start(host(), description, LIMIT).unwrap()));
    let mut step = general_step(law.signature(), false);
    step.stress = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let [stress, engineering] = [1.0, 2.0].map(|shear| umat::components(StressState::Solid, shear));
    let turned = product(&product(&step.rotation, &stress.symmetric_tensor(&step.stress)), &transposed(&step.rotation));
    let wanted = [
        &stress.vector(&turned)[..],
        &engineering.vector(&step.strain),
        &engineering.vector(&step.strain_increment),
        &[0.25, 0.25, 0.5, 20.0, 0.0],
        step.rotation.as_flattened(),
        step.gradient_before.as_flattened(),
        step.gradient.as_flattened(),
        &[7.0, 8.0, 3.0, 3.0, 6.0, 72.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 3.0],
        &[80.0, 5.0, f64::from(b'S'), f64::from(b'L'), 0.0, 1.0],
    ];
    assert_close(&law.respond(&step).unwrap().state, &wanted.concat(), 1e-15, "arguments");
}
