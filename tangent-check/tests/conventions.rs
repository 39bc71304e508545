//! Conversions of tangents, against definitions evaluated over dual numbers.

mod laws;

use laws::dual::{constant, value};
use laws::exact::{exact, inputs};
use laws::right::VOCE;
use laws::shipped::*;
use tangent_check::convention::{
    Components, Configuration, Convention, Measure, Tensor, cauchy_stress, convert, stress_vector,
};
use tangent_check::matrix::Matrix;
use tangent_check::tensor;

/// A general F: stretches from 0.6 to 1.7, turned on both sides.
fn gradient(which: usize) -> Tensor {
    let stretch = [[0.3, 0.11, -0.2], [0.11, -0.25, 0.17], [-0.2, 0.17, 0.05]];
    let factor = [1.0, -1.4, 0.3][which % 3];
    tensor::product(
        &tensor::exponential(&tensor::scaled(factor, &stretch)),
        &tensor::rotation_about([0.4 + which as f64, -0.7, 0.9]),
    )
}

fn gradient_before(which: usize) -> Tensor {
    let stretch = [[-0.1, 0.2, 0.05], [0.2, 0.1, -0.15], [0.05, -0.15, 0.12]];
    tensor::product(&tensor::exponential(&stretch), &tensor::rotation_about([-0.3, 0.2 * which as f64, 0.1]))
}

fn cauchy(law: &dyn Formula, f: &Tensor, before: &Tensor, old: (&Tensor, &[f64])) -> Tensor {
    value(&law.respond(&inputs(constant(f), before, old.0, old.1), Flow::Algorithmic).0)
}

/// Each measure in two orders.
fn conventions() -> Vec<Convention> {
    let mut all = Vec::new();
    for measure in Measure::ALL {
        all.push(Convention::mfront(measure));
        let full = measure.by_gradient();
        let strain = if full { Components::rows() } else { Components::voigt(2.0) };
        let stress = if measure == Measure::PiolaByGradient { Components::rows() } else { Components::explicit(1.0) };
        all.push(Convention { measure, stress, strain });
    }
    all
}

fn difference(a: &Matrix, b: &Matrix) -> f64 {
    let entries = a.entries.iter().zip(&b.entries).map(|(a, b)| a - b).collect();
    Matrix { entries, ..a.clone() }.greatest() / b.greatest()
}

#[test]
fn every_conversion_is_exact_for_an_anisotropic_law() {
    let law = SaintVenantKirchhoff { fibre: 3.0 };
    let mut worst: f64 = 0.0;
    for which in 0..3 {
        let [f, before] = [gradient(which), gradient_before(which)];
        let old = (&tensor::ZERO, &[][..]);
        let at = Configuration { gradient_before: before, gradient: f, stress: cauchy(&law, &f, &before, old) };
        let all: Vec<_> = conventions().into_iter().map(|c| (exact(&law, &c, &f, &before, old), c)).collect();
        for (given, from) in &all {
            for (expected, to) in &all {
                let error = difference(&convert(given, from, to, &at).unwrap(), expected);
                assert!(error < 2e-13, "{} → {}: {error:e}", from.words(), to.words());
                worst = worst.max(error);
            }
        }
    }
    println!("greatest error of 972 conversions: {worst:.1e}");
}

#[test]
fn strain_increments_give_the_exact_derivative_by_the_gradient() {
    // σ = ΔR σ₀ ΔRᵀ + C:Δε, returned: F acts through Δε and ΔR, and the law's tangent knows Δε only.
    for which in 0..3 {
        let [f, before] = [gradient(which), gradient_before(which)];
        let stress = [[0.4, 0.1, -0.2], [0.1, -0.3, 0.25], [-0.2, 0.25, 0.1]];
        let old = (&stress, &[0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0][..]);
        let at = Configuration { gradient_before: before, gradient: f, stress: cauchy(&VOCE, &f, &before, old) };
        let from = Convention::abaqus(Measure::CauchyByStrain);
        let given = exact(&VOCE, &from, &f, &before, old);
        for measure in Measure::ALL {
            let to = Convention::mfront(measure);
            let error = difference(&convert(&given, &from, &to, &at).unwrap(), &exact(&VOCE, &to, &f, &before, old));
            assert!(error < 2e-13, "{}: {error:e}", measure.words());
        }
    }
}

#[test]
fn plane_strain_conversions_agree_with_the_space() {
    let mut f = tensor::exponential(&[[0.3, 0.2, 0.0], [-0.1, -0.2, 0.0], [0.0, 0.0, 0.0]]);
    f[2][2] = 1.0;
    let before = tensor::IDENTITY;
    let old = (&tensor::ZERO, &[][..]);
    let at = Configuration { gradient_before: before, gradient: f, stress: cauchy(&NeoHookean, &f, &before, old) };
    let from = Convention::abaqus_plane(Measure::JaumannKirchhoff);
    let pairs = Components::mfront_gradient_plane();
    let to = Convention { measure: Measure::PiolaByGradient, stress: pairs.clone(), strain: pairs };
    let given = exact(&NeoHookean, &from, &f, &before, old);
    let error = difference(&convert(&given, &from, &to, &at).unwrap(), &exact(&NeoHookean, &to, &f, &before, old));
    assert!(error < 1e-14, "{error:e}");
    assert!(convert(&given, &from, &Convention::piola_in_rows(), &at).is_err());
}

#[test]
fn stresses_return_from_every_measure() {
    let f = gradient(0);
    let stress = [[0.4, 0.1, -0.2], [0.1, -0.3, 0.25], [-0.2, 0.25, 0.1]];
    for convention in conventions() {
        let vector = stress_vector(&convention, &stress, &f).unwrap();
        let back = cauchy_stress(&convention, &vector, &f).unwrap();
        assert!(tensor::norm(&tensor::sum(&back, -1.0, &stress)) < 1e-15);
    }
}

#[test]
fn bad_input_is_an_error() {
    let convention = Convention::abaqus(Measure::JaumannKirchhoff);
    let at = |gradient: Tensor| Configuration { gradient_before: tensor::IDENTITY, gradient, stress: tensor::ZERO };
    let good = Matrix::zeros(6, 6);
    assert!(convert(&good, &convention, &Convention::piola_in_rows(), &at(tensor::IDENTITY)).is_ok());
    assert!(convert(&Matrix::zeros(4, 6), &convention, &convention, &at(tensor::IDENTITY)).is_err());
    let lying = Matrix { rows: 6, columns: 6, entries: vec![1.0] };
    assert!(convert(&lying, &convention, &convention, &at(tensor::IDENTITY)).is_err());
    for bad in [tensor::ZERO, [[f64::NAN; 3]; 3], tensor::scaled(-1.0, &tensor::IDENTITY)] {
        for measure in Measure::ALL {
            assert!(convert(&good, &convention, &Convention::mfront(measure), &at(bad)).is_err());
        }
    }
    let twice = Components { pairs: vec![(0, 0); 6], shear: 1.0 };
    let outside = Components { pairs: vec![(0, 7); 6], shear: 1.0 };
    for stress in [twice, outside] {
        let wrong = Convention { stress, ..convention.clone() };
        assert!(convert(&good, &wrong, &convention, &at(tensor::IDENTITY)).is_err());
    }
}

#[test]
fn tensors_keep_their_promises() {
    for which in 0..3 {
        let f = gradient(which);
        let (rotation, stretch) = tensor::polar(&f).unwrap();
        let close = |a: &Tensor, b: &Tensor| tensor::norm(&tensor::sum(a, -1.0, b)) < 3e-15;
        assert!(close(&tensor::product(&stretch, &rotation), &f));
        assert!(close(&tensor::product(&rotation, &tensor::transposed(&rotation)), &tensor::IDENTITY));
        assert!(close(&tensor::exponential(&tensor::logarithm(&stretch)), &stretch));
        assert!(close(&tensor::product(&f, &tensor::inverse(&f).unwrap()), &tensor::IDENTITY));
    }
    assert!(tensor::polar(&tensor::ZERO).is_none() && tensor::inverse(&tensor::ZERO).is_none());
    assert!(tensor::exponential(&[[f64::INFINITY; 3]; 3])[0][0].is_nan());
    let _ = tensor::eigenvalues(&[[f64::NAN; 3]; 3]);
}
