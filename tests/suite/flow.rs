//! Laws with plastic or viscous flow: closed forms at a point, and whole bodies that yield.

use crate::support::{Failure, Random, advance, cases, in_threads, output, restored, scene};
use bfree::field::Field;
use bfree::material::{
    Branch, Cone, DISSIPATED, DruckerPrager, Hardening, Lame, Law, Material, MaterialState, NeoHookean, PLASTIC_STRAIN,
    Parameters, Plastic, Viscoelastic, VonMises, internal_variable,
};
use bfree::output::history::Energies;
use bfree::output::{Recorder, Reference};
use bfree::scene::Problems;
use bfree::simulation::Simulation;
use bfree::solver::Krylov;
use bfree::tensor::{Tensor, Vector, determinant, identity};
use std::num::NonZeroU64;

/// A material point, deformed step by step, with its internal variables.
struct Point<L> {
    law: L,
    internal: Vec<f64>,
}

impl<L: Law> Point<L> {
    fn new(law: L) -> Self {
        let internal = law.internal_variables().iter().map(|one| one.at_rest).collect();
        Self { law, internal }
    }

    /// The Kirchhoff stress at the end of a step to F.
    fn step<const D: usize>(&mut self, f: Tensor<f64, D>, dt: f64) -> Tensor<f64, D> {
        let mut next = self.internal.clone();
        let at = MaterialState::new(f - identity()).in_step(dt, &self.internal);
        let stress = f * self.law.stress(&at) * f.transpose();
        self.law.update_variables(&at, &mut next);
        self.internal = next;
        stress
    }

    fn internal_variable(&self, name: &str) -> Option<f64> {
        let at = MaterialState::new(Tensor::<f64, 3>::zeros()).in_step(0.0, &self.internal);
        internal_variable(&self.law, &at, name)
    }
}

fn solid() -> Result<Lame, Failure> {
    Ok(Lame::from_young_poisson(1000.0, 0.3)?)
}

fn von_mises(yield_stress: Hardening) -> Result<Plastic<VonMises>, Failure> {
    Ok(Plastic { solid: solid()?, criterion: VonMises { yield_stress } })
}

/// Uniaxial strain ε = ln λ: q = 2G ε until σ₀; then Δp = (2G ε − σ₀)/(3G + H), q = σ₀ + H p, and τ = K ε + ⅔ q. On unloading, q falls with
/// the slope 2G until it reaches −σ_y.
#[test]
fn uniaxial_yield_and_reversal_have_a_closed_form() -> Result<(), Failure> {
    let (initial, linear) = (20.0, 50.0);
    let law = von_mises(Hardening { initial, linear, saturation: 0.0, rate: 0.0 })?;
    let (bulk, shear) = (law.solid.bulk_modulus(), law.solid.shear);
    let mut point = Point::new(law);
    let (mut p, mut q, mut before): (f64, f64, f64) = (0.0, 0.0, 0.0);
    let path = [0.01, 0.02, 0.05, 0.1, 0.09, 0.05, 0.0, -0.1, -0.2, -0.1, 0.3];
    for strain in path {
        let trial: f64 = q + 2.0 * shear * (strain - before);
        let flow = ((trial.abs() - initial - linear * p) / (3.0 * shear + linear)).max(0.0);
        (p, q, before) = (p + flow, trial - 3.0 * shear * flow * trial.signum(), strain);
        let tau = point.step(Tensor::<f64, 1>::from_element(strain.exp()), 1.0)[0];
        let exact = bulk * strain + q / 1.5;
        assert!((tau - exact).abs() < 1e-12 * bulk, "{tau} instead of {exact} at {strain}");
        assert!((point.internal_variable(PLASTIC_STRAIN).unwrap_or(f64::NAN) - p).abs() < 1e-13);
    }
    assert!(p > 0.4, "the path is meant to flow: {p}");
    Ok(())
}

/// Proportional stretching at constant volume: radial return is exact for any steps, and the stress is Voce's hardening at its own p.
#[test]
fn a_return_ends_on_the_surface_and_keeps_the_volume() -> Result<(), Failure> {
    let hardening = Hardening { initial: 20.0, linear: 10.0, saturation: 30.0, rate: 8.0 };
    let stretch =
        |x: f64| Tensor::<f64, 3>::from_diagonal(&Vector::from([x.exp(), (-0.5 * x).exp(), (-0.5 * x).exp()]));
    let mut results = Vec::new();
    for steps in [1, 40] {
        let mut point = Point::new(von_mises(hardening)?);
        let mut tau = Tensor::zeros();
        for step in 1..=steps {
            tau = point.step(stretch(0.5 * f64::from(step) / f64::from(steps)), 1.0);
        }
        let p = point.internal_variable(PLASTIC_STRAIN).unwrap_or(f64::NAN);
        let q = tau[(0, 0)] - tau[(1, 1)];
        assert!((q / hardening.strength(p) - 1.0).abs() < 1e-12, "{q} at {p}");
        // ε = p + q/(3G)
        assert!((p + q / (3.0 * solid()?.shear) - 0.5).abs() < 1e-12);
        let flowed = &point.internal[2..];
        let volume = (1.0 + flowed[0]) * (1.0 + flowed[1]) * (1.0 + flowed[2]);
        assert!((volume - 1.0).abs() < 1e-13, "det C_p = 1: {volume}");
        // The plastic work: ∫ σ_y dp.
        let lost = point.internal_variable("dissipated").unwrap_or(f64::NAN);
        assert!((lost / hardening.work(p) - 1.0).abs() < 1e-12);
        results.push(q);
    }
    assert!((results[0] / results[1] - 1.0).abs() < 1e-12);
    Ok(())
}

/// On the cone √J₂ + η p = ξ c. The plastic flow dilates by η̄/√… of its shear: tr Δε_p = η̄ Δγ with ε̄ = ξ Δγ. Beyond the cone, the apex p
/// = c ξ/η.
#[test]
fn drucker_and_prager_return_to_the_cone_or_to_its_apex() -> Result<(), Failure> {
    let (phi, psi, c) = (35.0_f64, 12.0_f64, 5.0);
    let slope = |angle: f64| 6.0 * angle.to_radians().sin() / (3.0_f64.sqrt() * (3.0 - angle.to_radians().sin()));
    let (eta, eta_bar) = (slope(phi), slope(psi));
    let xi = eta / phi.to_radians().tan();
    let criterion = DruckerPrager::new(phi, psi, Hardening::perfect(c), Cone::Compression);
    let law = Plastic { solid: solid()?, criterion };
    let mut random = Random(5);
    let mut number = || random.below(2_000_001) as f64 * 1e-6 - 1.0;
    let (mut on_cone, mut at_apex) = (0, 0);
    for _ in 0..200 {
        let f = identity::<f64, 3>() * (1.0 + 0.05 * number()) + Tensor::from_fn(|_, _| 0.05 * number());
        let mut point = Point::new(law);
        let tau = point.step(f, 1.0);
        let p = tau.trace() / 3.0;
        let deviator = tau - identity::<f64, 3>() * p;
        let root_j2 = deviator.norm() / 2.0_f64.sqrt();
        let flow = point.internal_variable(PLASTIC_STRAIN).unwrap_or(f64::NAN);
        if flow == 0.0 {
            assert!(root_j2 + eta * p <= xi * c + 1e-12);
            continue;
        }
        assert!((root_j2 + eta * p - xi * c).abs() < 1e-11, "not on the surface: {}", root_j2 + eta * p - xi * c);
        // −½ ln det C_p⁻¹ is the plastic change of volume.
        let [xx, yy, zz, xy, yz, xz] = point.internal[2..8].try_into()?;
        let inverse_plastic = identity::<f64, 3>() + Tensor::<f64, 3>::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let dilated = -0.5 * determinant(&inverse_plastic).ln();
        if root_j2 > 1e-9 {
            assert!((dilated - eta_bar * flow / xi).abs() < 1e-12, "{dilated} for {flow}");
            on_cone += 1;
        } else {
            assert!((p - c * xi / eta).abs() < 1e-11 && dilated > 0.0);
            at_apex += 1;
        }
    }
    assert!(on_cone > 20 && at_apex > 20, "{on_cone} {at_apex}");
    Ok(())
}

/// Plane-strain shear up to pure plastic flow. The strength of the soil is then Mohr–Coulomb's: (τ₁ − τ₂)/2 + (τ₁ + τ₂)/2 sin φ = c cos φ
/// in the plane. The cone through the compressive edges is stronger, by 6/(√3 (3 − sin φ)).
#[test]
fn the_cone_of_plane_strain_has_mohr_and_coulomb_s_strength_there() -> Result<(), Failure> {
    let (phi, c) = (25.0_f64, 5.0);
    let (sin, cos) = phi.to_radians().sin_cos();
    for (cone, strength) in [(Cone::PlaneStrain, 1.0), (Cone::Compression, 6.0 / (3.0_f64.sqrt() * (3.0 - sin)))] {
        let criterion = DruckerPrager::new(phi, 0.0, Hardening::perfect(c), cone);
        let mut point = Point::new(Plastic { solid: solid()?, criterion });
        let mut tau = Tensor::zeros();
        for step in 0..=200 {
            let sheared = Tensor::<f64, 2>::new(1.0, 0.005 * f64::from(step), 0.0, 1.0);
            tau = point.step(sheared * 0.99, 1.0);
        }
        let [mean, radius] = [0.5 * tau.trace(), (0.5 * (tau[(0, 0)] - tau[(1, 1)])).hypot(tau[(0, 1)])];
        let found = radius / (c * cos - mean * sin);
        assert!(mean < -2.0 * c, "under pressure: {mean}");
        assert!((found / strength - 1.0).abs() < 1e-9, "{cone:?}: {found} instead of {strength}");
    }
    Ok(())
}

/// Relaxation at constant strain: G∞ + Σ G e^{−t/τ_r}, for steps of any length.
#[test]
fn relaxation_is_exact() -> Result<(), Failure> {
    let branches = vec![Branch { shear: 3.0, relaxation_time: 0.5 }, Branch { shear: 2.0, relaxation_time: 20.0 }];
    let law = Viscoelastic::new(NeoHookean::ciarlet(Lame::new(10.0, 1.0)?), branches.clone()).ok_or("elastic")?;
    let strain = 1e-7;
    let f = identity::<f64, 2>() + Tensor::<f64, 2>::new(0.0, strain, 0.0, 0.0);
    let mut point = Point::new(law);
    let mut time = 0.0;
    for dt in [0.0, 1e-3, 0.1, 1.0, 7.0, 30.0] {
        time += dt;
        let modulus = point.step(f, dt)[(0, 1)] / strain;
        let exact = branches.iter().fold(1.0, |sum, one| sum + one.shear * (-time / one.relaxation_time).exp());
        assert!((modulus / exact - 1.0).abs() < 1e-8, "{modulus} instead of {exact} at {time}");
    }
    // At large strain, along the principal axes of the strain: in one branch, the difference of two principal stresses falls by e^{−t/τ_r}.
    let only = Viscoelastic::new(NeoHookean::ciarlet(Lame::new(10.0, 1.0)?), vec![branches[0]]).ok_or("elastic")?;
    let mut base = Point::new(Material::from(NeoHookean::ciarlet(Lame::new(10.0, 1.0)?)));
    let f = Tensor::<f64, 3>::new(1.5, 0.3, 0.0, -0.2, 0.8, 0.1, 0.0, 0.0, 1.1);
    let mut point = Point::new(only);
    let elastic = base.step(f, 0.0);
    let [at_once, later] = [0.0, 0.8].map(|dt| point.step(f, dt) - elastic);
    assert!((later - at_once * (-0.8_f64 / 0.5).exp()).norm() < 1e-13 * at_once.norm());
    Ok(())
}

/// Under a constant shear stress γ(t) = (τ/G∞) (1 − G₁/(G∞ + G₁) e^{−t/τ_c}), τ_c = τ_r (G∞ + G₁)/G∞: of first order in Δt.
#[test]
fn creep_converges_to_its_closed_form() -> Result<(), Failure> {
    let (base, shear, relaxation_time, time, stress) = (1.0, 3.0, 0.5, 1.5, 1e-8);
    let crept = |steps: u32| -> Result<f64, Failure> {
        let branch = Branch { shear, relaxation_time };
        let law = Viscoelastic::new(NeoHookean::ciarlet(Lame::new(10.0, base)?), vec![branch]).ok_or("elastic")?;
        let (mut point, mut strain) = (Point::new(law), 0.0);
        // The first step has Δt = 0: the load acts at once.
        for dt in std::iter::once(0.0).chain(std::iter::repeat_n(time / f64::from(steps), steps as usize)) {
            for _ in 0..4 {
                let f = identity::<f64, 2>() + Tensor::<f64, 2>::new(0.0, strain, 0.0, 0.0);
                let at = MaterialState::new(f - identity()).in_step(dt, &point.internal);
                let tau = (f * point.law.stress(&at) * f.transpose())[(0, 1)];
                strain += (stress - tau) / (base + shear * (-dt / relaxation_time).exp());
            }
            point.step(identity::<f64, 2>() + Tensor::<f64, 2>::new(0.0, strain, 0.0, 0.0), dt);
        }
        Ok(strain * base / stress)
    };
    let exact = 1.0 - shear / (base + shear) * (-time * base / (relaxation_time * (base + shear))).exp();
    let coarse = (0..7).map(|k| crept(16 << k)).collect::<Result<Vec<_>, _>>()?;
    let ratio = (coarse[5] - exact) / (coarse[6] - exact);
    assert!((1.9..2.1).contains(&ratio), "of first order: {ratio}");
    // Romberg's extrapolation to Δt = 0.
    let mut row = coarse;
    for order in 1..7 {
        let factor = f64::from(1 << order);
        row = row.windows(2).map(|pair| (factor * pair[1] - pair[0]) / (factor - 1.0)).collect();
    }
    assert!((row[0] / exact - 1.0).abs() < 1e-8, "{} instead of {exact}", row[0]);
    Ok(())
}

const METAL: &str = r#"bodies.0.material={"von_mises":{"elastic":{"young":1.0985,"poisson":0.3},"yield_stress":{"initial":0.12,"linear":0.1,"saturation":0.05,"rate":10}}}"#;
const SOIL: &str = r#"bodies.0.material={"drucker_prager":{"elastic":{"young":1.0985,"poisson":0.3},"friction":25,"dilatancy":5,"cohesion":{"initial":0.07,"linear":0.1}}}"#;
const POLYMER: &str = r#"bodies.0.material={"viscoelastic":{"base":{"neo_hookean":{"young":0.6,"poisson":0.3}},"branches":[{"shear":0.2,"relaxation_time":0.3},{"shear":0.1,"relaxation_time":3}]}}"#;

/// Cook's membrane, coarse, in load steps.
fn membrane(material: &str, steps: u32, more: &[&str]) -> Result<Simulation<2>, Failure> {
    let step = format!("time.step={}", 1.0 / f64::from(steps));
    scene("cook.json", &[&["grid.spacing=8", material, &step, "output={}"], more].concat())
}

fn run(simulation: &mut Simulation<2>) -> Result<(Vec<usize>, f64), Failure> {
    let (mut iterations, mut yielding) = (Vec::new(), 0.0_f64);
    while simulation.clock.time() < 1.0 - 1e-9 {
        let report = simulation.advance()?;
        assert!(report.failed.is_empty(), "{:?}", report.failed);
        iterations.push(report.newton.history.iterations.len());
        yielding = yielding.max(report.yielding);
    }
    Ok((iterations, yielding))
}

/// A reset grid carries over the out-of-balance force at t_n, without the relaxation of the coming step. So a bar under a constant load
/// creeps equally with a reset in every step and without one.
#[test]
fn a_bar_creeps_on_new_grids_as_on_one_that_is_kept() -> Result<(), Failure> {
    let crept = |renewed: &str| -> Result<[f64; 2], Failure> {
        let bar = [
            POLYMER,
            r#"grid={"size":[12,8],"spacing":1}"#,
            r#"bodies.0.shape={"box":{"min":[0,0],"max":[8,4]}}"#,
            r#"boundary={"left":"sliding","bottom":"sliding"}"#,
            r#"tractions=[{"body":"membrane","region":{"half_space":{"point":[8,0],"normal":[-1,0]}},"traction":[0.1,0],"curve":[[0,0],[0.1,1]]}]"#,
            "output={}",
            "time.step=0.1",
            &format!("grid.reset={renewed}"),
        ];
        let mut simulation = scene::<2>("cook.json", &bar)?;
        let end = |simulation: &Simulation<2>| simulation.particles.position.iter().map(|x| x[0]).fold(0.0, f64::max);
        simulation.step()?;
        let loaded = end(&simulation);
        run(&mut simulation)?;
        Ok([loaded, end(&simulation) - loaded])
    };
    let ([_, kept], [_, renewed]) = (crept(r#""never""#)?, crept(r#""every_step""#)?);
    assert!(kept > 0.1, "it creeps: {kept}");
    assert!((renewed / kept - 1.0).abs() < 0.02, "{renewed} beside {kept}");
    Ok(())
}

#[test]
fn bodies_that_flow_have_exact_tangents_and_converge() -> Result<(), Failure> {
    for material in [METAL, SOIL, POLYMER] {
        let mut simulation = membrane(material, 4, &[])?;
        simulation.settings.check_tangent = NonZeroU64::new(1);
        let (iterations, yielding) = run(&mut simulation)?;
        assert!(iterations.iter().all(|&count| count <= 12), "{material}: {iterations:?}");
        assert_eq!(yielding > 0.02, material != POLYMER, "{yielding}");
        let method = if material == SOIL { Krylov::Gmres { restart: 50 } } else { Krylov::ConjugateGradient };
        assert_eq!(simulation.krylov().0, method);
    }
    Ok(())
}

/// stored + lost − work. Its error comes from the trapezoidal rule for the work and from the relaxation per step, and falls with the step.
#[test]
fn energy_is_stored_or_lost() -> Result<(), Failure> {
    for (material, order) in [(METAL, 1.5), (SOIL, 0.7), (POLYMER, 0.7)] {
        let defect = |steps| -> Result<f64, Failure> {
            let mut simulation = membrane(material, steps, &["aggregation=false"])?;
            let reference = Reference::of(&simulation);
            run(&mut simulation)?;
            let energies = Energies::of(&simulation, &reference);
            assert!(energies.dissipated > 0.01 * energies.external, "{energies:?}");
            Ok(energies.balance.abs() / energies.external)
        };
        let (coarse, fine) = (defect(10)?, defect(20)?);
        assert!(fine < 0.02 && coarse / fine > f64::powf(2.0, order), "{material}: {coarse} {fine}");
    }
    Ok(())
}

#[test]
fn flow_has_the_same_bits_for_any_threads_and_after_a_restart() -> Result<(), Failure> {
    for material in [METAL, SOIL, POLYMER] {
        let by = |threads| {
            in_threads(threads, || {
                let mut simulation = membrane(material, 4, &[])?;
                run(&mut simulation)?;
                Ok(simulation.particles.by_id())
            })
        };
        let one = by(1)?;
        assert_eq!(one, by(3)?);
        let start = membrane(material, 4, &[])?;
        let mut simulation = start.clone();
        advance(&mut simulation, 2)?;
        let mut continued = restored(&simulation, &start)?;
        run(&mut continued)?;
        assert_eq!(continued.particles.by_id(), one);
        let (particles, width) = (&continued.particles, continued.particles.variable_count);
        for (field, name) in [(Field::PlasticStrain, PLASTIC_STRAIN), (Field::DissipatedDensity, DISSIPATED)] {
            let shown = field.values(&continued, &Reference::of(&continued))?;
            let place = continued.bodies[0].law.internal_variables().iter().position(|one| one.name == name);
            let solid = particles.solid_places();
            let kept = |&p: &u32| place.map_or(0.0, |place| particles.memory[p as usize * width + place]);
            assert_eq!(shown, solid.iter().map(kept).collect::<Vec<_>>());
            assert_eq!(shown.iter().any(|x| *x > 0.0), place.is_some());
            let internal = Field::Internal(name.to_owned()).values(&continued, &Reference::of(&continued));
            match place {
                Some(_) => assert_eq!(internal?, shown),
                None => {
                    assert!(internal.expect_err("no law has it").to_string().contains("the laws have dissipated, "))
                }
            }
        }
        let folder = tempfile::tempdir()?;
        Recorder::start(output(folder.path()), &start, Reference::of(&start))?;
        let header = std::fs::read_to_string(folder.path().join("history.csv"))?;
        let header = header.lines().next().unwrap_or_default().to_owned();
        assert!(header.contains("dissipated"), "{header}");
        assert_eq!(header.contains("yielding"), material != POLYMER, "{header}");
    }
    Ok(())
}

#[test]
fn conjugate_gradients_are_refused_where_a_law_makes_the_tangent_unsymmetric() -> Result<(), Failure> {
    let method = r#"solver.krylov.method="conjugate_gradient""#;
    let refused = membrane(SOIL, 4, &[method]).err().ok_or("friction")?.to_string();
    assert!(refused.contains("a law makes") && refused.contains("gmres"), "{refused}");
    assert!(membrane(METAL, 4, &[method]).is_ok());
    Ok(())
}

/// Constants of a law | the key to be named | words of the message.
const NO_SOLID: &str = r##"
{"von_mises":{"elastic":{"young":1,"poisson":0.3},"yield_stress":{"initial":0}}} | yield_stress.initial | > 0
{"von_mises":{"elastic":{"young":1,"poisson":0.3},"yield_stress":{"initial":1,"saturation":-2}}} | yield_stress.saturation | -initial = -1
{"von_mises":{"elastic":{"young":1,"poisson":0.3},"yield_stress":{"initial":1,"saturation":-0.5,"rate":10}}} | yield_stress.rate | softens faster
{"von_mises":{"elastic":{"young":1,"poisson":0.3},"yield_stress":{"initial":1,"saturation":1}}} | yield_stress.rate | > 0 with a saturation
{"von_mises":{"elastic":{"young":1,"poisson":0.3},"yield_stress":{"initial":1,"rate":1}}} | yield_stress.rate | needs a saturation
{"drucker_prager":{"elastic":{"young":1,"poisson":0.3},"friction":90,"cohesion":{"initial":1}}} | friction | < 90
{"drucker_prager":{"elastic":{"young":1,"poisson":0.3},"friction":20,"dilatancy":30,"cohesion":{"initial":1}}} | dilatancy | between 0 and the friction, 20
{"viscoelastic":{"base":{"neo_hookean":{"young":1,"poisson":0.3}},"branches":[]}} | branches | 1 to 8
{"viscoelastic":{"base":{"von_mises":{"elastic":{"young":1,"poisson":0.3},"yield_stress":{"initial":1}}},"branches":[{"shear":1,"relaxation_time":1}]}} | base | elastic
{"mooney_rivlin":{"c1":1,"c2":1,"bulk":6}} | bulk | greater than
{"ogden":{"terms":[{"modulus":1,"exponent":-2}],"bulk":6}} | terms[0].modulus | sign
{"ogden":{"terms":[{"modulus":1,"exponent":2}],"bulk":0.5}} | bulk | greater than
"##;

#[test]
fn constants_that_no_solid_has_are_refused() -> Result<(), Failure> {
    for case in cases(NO_SOLID) {
        let [text, key, words] = case[..] else { return Err(format!("{case:?}").into()) };
        let (mut problems, given) = (Problems::default(), serde_json::from_str::<Parameters>(text)?);
        assert!(given.law(&mut problems, "material").is_none(), "{text}");
        let message = problems.to_string();
        assert!(message.contains(key) && message.contains(words), "{text}: {message}");
        assert_eq!(problems.list.len(), 1, "{message}");
    }
    // A criterion read from a scene equals the criterion in code.
    let text = r#"{"von_mises":{"elastic":{"young":1000,"poisson":0.3},"yield_stress":{"initial":2}}}"#;
    let given: Parameters = serde_json::from_str(text)?;
    let law = given.law(&mut Problems::default(), "material").ok_or("good constants")?;
    assert_eq!(law, von_mises(Hardening::perfect(2.0))?.into());
    Ok(())
}
