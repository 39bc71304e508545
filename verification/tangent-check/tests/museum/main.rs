//! The museum of wrong tangents: mistakes of the past as small laws and residuals of our own, before and after the repair.
//!
//! Each file tells one story with its source. The manual tells them in `docs/src/museum.md`.

mod algebra;
mod bent_plate;
mod damage_softening;
mod fibre_dispersion;
mod green_for_cauchy;
mod half_shear;
mod hencky_axes;
mod index_order;
mod kirchhoff_for_cauchy;
mod mollifier;
mod neo_hooke;
mod plate_rebar;
mod shear_order;
mod sheet_stiffness;
mod user_element;
mod witness;

use algebra::{Version, step};
use tangent_check::convention::Tensor;
use tangent_check::law::{Law, Step};
use tangent_check::tensor::{IDENTITY, sum};

/// A general F with J = 1.19 that stretches fibres and sheets.
const GRADIENT: Tensor = [[1.3, 0.2, 0.1], [-0.1, 1.1, 0.15], [0.05, -0.2, 0.8]];
const STRAIN: Tensor = [[0.1, 0.03, -0.02], [0.03, -0.05, 0.04], [-0.02, 0.04, 0.02]];

#[test]
fn witness() {
    let mut laws: Vec<Box<dyn Fn(Version) -> Box<dyn Law>>> = Vec::new();
    laws.push(Box::new(|v| Box::new(fibre_dispersion::DispersedFibres(v))));
    laws.push(Box::new(|v| Box::new(damage_softening::Damage(v))));
    laws.push(Box::new(|v| Box::new(sheet_stiffness::HeartMuscle(v))));
    laws.push(Box::new(|v| Box::new(index_order::FrictionalUmat(v))));
    laws.push(Box::new(|v| Box::new(shear_order::Orthotropic(v))));
    laws.push(Box::new(|v| Box::new(half_shear::LogarithmicVolume(v))));
    laws.push(Box::new(|v| Box::new(kirchhoff_for_cauchy::Rubber(v))));
    laws.push(Box::new(|v| Box::new(user_element::ElementLaw(v))));
    laws.push(Box::new(|v| Box::new(hencky_axes::Hencky(v))));
    for make in laws {
        for v in [Version::Before, Version::After] {
            let mut law = make(v);
            let s = step(GRADIENT, STRAIN, law.state_at_rest());
            let w = witness::law(law.as_mut(), &s);
            println!("{:45} {:?}", law.name(), w);
        }
    }
    use plate_rebar::Year::*;
    for y in [Y2013, Y2016, Y2021, Y2022] {
        for a in [0.5, std::f64::consts::FRAC_PI_4] {
            let e = [1e-3, 2e-3, -1e-3];
            let m = witness::columns(3, 3, &mut |k, h| plate_rebar::stress(a, e, k, h * 1e-3));
            let m = tangent_check::matrix::Matrix { entries: m.entries.iter().map(|x| x * 1e3).collect(), ..m };
            println!("{y:?} {a} {:?}", witness::worst(&plate_rebar::tangent(y, a, e), &m));
        }
    }
    let c = [[1.5, 0.2, 0.1], [0.2, 1.1, -0.2], [0.1, -0.2, 0.8]];
    let u = [0.01, 0.02, -0.03, 0.2, 0.3];
    for v in [Version::Before, Version::After] {
        let m = witness::columns(6, 6, &mut |k, h| green_for_cauchy::stress(&c, k, h));
        println!("green {:?}", witness::worst(&green_for_cauchy::tangent(v, &c), &m));
        let m = witness::columns(5, 5, &mut |k, h| bent_plate::force(v, u, k, h));
        println!("plate {:?}", witness::worst(&bent_plate::tangent(v, u), &m));
    }
    let shape = [1.0, 0.1, 0.0, 1.1, 0.2, 0.1, 0.2, 0.3, 1.1];
    let disp = [0.1, 0.05, -0.1, 0.0, 0.1, 0.2, 0.1, 0.0, 0.05];
    for (factor, term) in [(false, false), (true, false), (false, true), (true, true)] {
        let m = witness::columns(9, 9, &mut |k, h| mollifier::force(&shape, &disp, k, h));
        println!(
            "moll {factor} {term} {:?}",
            witness::worst(&mollifier::tangent(mollifier::Repairs { factor, term }, &shape, &disp), &m)
        );
    }
    let _ = (sum(&IDENTITY, 1.0, &IDENTITY), None::<Step>);
}
