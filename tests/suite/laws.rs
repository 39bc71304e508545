//! Laws in vector lanes against the same laws one particle at a time.

use bfree::approximation::{Approximation, Linear, Lme};
use bfree::grid::Grid;
use bfree::material::{FrozenTangent, Lame, Law, Material, NonPositiveJacobian, first_piola};
use bfree::mechanics::residual::{Inadmissible, compose};
use bfree::mechanics::sweep::{Laws, Supports};
use bfree::mechanics::tangent::has_closed_form;
use bfree::particles::{Body, Particles};
use bfree::scalar::Real;
use bfree::solver::Precision;
use bfree::tensor::{Deformation, Tensor, Vector, identity};

/// A law of the list that the library does not know as such: it takes the plain loop.
struct Unknown(Material);

impl Law for Unknown {
    type Frozen<T: Real, const D: usize> = <Material as Law>::Frozen<T, D>;

    fn energy<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> T {
        self.0.energy(at)
    }

    fn stress<T: Real, const D: usize>(&self, at: &Deformation<T, D>) -> Tensor<T, D> {
        self.0.stress(at)
    }

    fn elasticity<T: Real, const D: usize>(&self, at: &Deformation<T, D>, x: &Tensor<T, D>) -> Tensor<T, D> {
        self.0.elasticity(at, x)
    }

    fn freeze<T: Real, const D: usize>(
        &self,
        f_n: &Tensor<T, D>,
        at: &Deformation<T, D>,
        volume: T,
    ) -> Self::Frozen<T, D> {
        self.0.freeze(f_n, at, volume)
    }
}

/// Numbers without pattern in (−1, 1): the golden-ratio sequence.
fn irregular(i: usize) -> f64 {
    2.0 * ((i + 1) as f64 * 0.618_033_988_749_894_9).fract() - 1.0
}

/// J at which the particles begin, and the size of what else deforms them.
const REGIMES: [(f64, f64); 4] = [(1.0, 1e-8), (1.0, 0.2), (0.05, 0.02), (20.0, 0.3)];

/// Jittered particles in some cells, groups full and not, bodies in turn, each strained about `REGIMES`.
fn particles<const D: usize>(bodies: u32, regimes: &[(f64, f64)]) -> Particles<D> {
    let mut particles = Particles::default();
    for p in 0..5_usize.pow(D as u32) * 3 {
        let x = Vector::from_fn(|k, _| 2.0 + 2.49 * irregular(7 * p + k).abs());
        let volume = 0.1 + 0.05 * irregular(p);
        particles.push(x, Vector::zeros(), volume, volume, p as u32 % bodies);
        let (j, size) = regimes[p % regimes.len()];
        let stretch = j.powf(1.0 / D as f64) - 1.0;
        particles.displacement_gradient[p] = Tensor::from_fn(|i, k| {
            let part = size * irregular(11 * p + 3 * i + k);
            if i == k { stretch + part * (1.0 + stretch) } else { part * (1.0 + stretch) }
        });
    }
    particles
}

/// All laws with a tangent for vector lanes.
fn materials() -> Vec<Material> {
    let all = Material::examples(Lame { lambda: 3.0, shear: 2.0 }).into_iter().map(|(_, law)| law);
    all.filter(|law| has_closed_form::<2, _>(&bodies([law.clone()]))).collect()
}

/// Whether its tangent has the term b L c.
fn has_both(law: &Material) -> bool {
    let at_rest = Deformation::<f64, 2>::new(Tensor::zeros());
    law.freeze(&identity(), &at_rest, 1.0).closed().is_some_and(|form| form.both.is_some())
}

fn bodies<L>(laws: impl IntoIterator<Item = L>) -> Vec<Body<L>> {
    laws.into_iter().map(|law| Body { name: "body".into(), law, density: 1.0 }).collect()
}

fn bits<const D: usize>(field: &[Vector<f64, D>]) -> Vec<u64> {
    field.iter().flatten().map(|x| x.to_bits()).collect()
}

/// Sum of forces, product of the tangents, and that in single precision.
type Results<const D: usize> = (Vec<Vector<f64, D>>, Vec<Vector<f64, D>>, Vec<Vector<f32, D>>);

fn results<const D: usize, L: Law>(
    supports: &Supports<D>,
    laws: &Laws<'_, D, L>,
    dphi: &[Vector<f64, D>],
    u: &[Vector<f64, D>],
    both: bool,
) -> Results<D> {
    let zeros = vec![Vector::zeros(); u.len()];
    let inertia = |p: usize, u: &Vector<f64, D>| u * (1.0 + 0.1 * p as f64);
    let weight = |p: usize| 2.0 + 0.1 * p as f64;
    let (mut forces, mut product) = (zeros.clone(), zeros.clone());
    supports.forces(laws, dphi, Some(&inertia), &mut forces).unwrap().unwrap();
    let tangents = supports.closed_tangents(laws, dphi, both, Some(&weight)).unwrap().unwrap();
    supports.product(&tangents, u, &mut product);
    let single = supports.single_tangents(laws, dphi, both, Some(&weight), 4.0).unwrap().unwrap();
    let u_single: Vec<Vector<f32, D>> = u.iter().map(|u| u.map(|x| x as f32)).collect();
    let mut product_single = vec![Vector::zeros(); u.len()];
    supports.single_product(&single, &u_single, &mut product_single);
    (forces, product, product_single)
}

/// Largest difference over largest value.
fn difference<const D: usize>(a: &[Vector<f64, D>], b: &[Vector<f64, D>]) -> f64 {
    let largest = b.iter().map(|x| x.amax()).fold(0.0, f64::max);
    a.iter().zip(b).map(|(a, b)| (a - b).amax()).fold(0.0, |worst, d| if d <= worst { worst } else { d }) / largest
}

fn compare<const D: usize>() {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [9; D] };
    let lists: Vec<_> = materials().into_iter().map(|law| vec![law]).chain([materials()]).collect();
    let regimes = REGIMES.iter().map(std::slice::from_ref).chain([REGIMES.as_slice()]);
    for (list, regime) in lists.iter().flat_map(|list| regimes.clone().map(move |regime| (list, regime))) {
        let particles = particles::<D>(list.len() as u32, regime);
        let (known, unknown) = (bodies(list.clone()), bodies(list.iter().cloned().map(Unknown)));
        let both = list.iter().any(has_both);
        for shape in [Approximation::from(Linear), Lme::new(3.0, 1e-6).into()] {
            let case = format!("{D}D {list:?} {regime:?} {shape:?}");
            let (supports, nodes) =
                Supports::with_precision(&shape, &grid, &particles.position, Precision::Mixed).unwrap();
            let u: Vec<Vector<f64, D>> =
                (0..nodes.len()).map(|n| Vector::from_fn(|i, _| irregular(5 * n + i))).collect();
            let dphi: Vec<_> = u.iter().map(|u| u * 0.01).collect();
            let in_lanes = Laws { particles: &particles, bodies: &known };
            let (forces, product, single) = results(&supports, &in_lanes, &dphi, &u, both);
            let one_by_one = Laws { particles: &particles, bodies: &unknown };
            let (same_forces, same_product, same_single) = results(&supports, &one_by_one, &dphi, &u, both);
            assert!(bits(&forces) == bits(&same_forces) && bits(&product) == bits(&same_product), "{case}");
            assert!(single == same_single, "{case}");
            // The formulas written down.
            let law = |p: usize| &known[particles.body[p] as usize].law;
            let h_n = |p: usize| &particles.displacement_gradient[p];
            let f_n = |p: usize| identity::<f64, D>() + h_n(p);
            let mut expected = vec![Vector::zeros(); u.len()];
            let at_particle = |p: usize, u: Vector<f64, D>, g: Tensor<f64, D>| {
                let h = compose(&g, h_n(p));
                let piola = first_piola(law(p), &(identity::<f64, D>() + h), h)?;
                Ok::<_, NonPositiveJacobian>((
                    u * (1.0 + 0.1 * p as f64),
                    piola * f_n(p).transpose() * particles.volume[p],
                ))
            };
            supports.assemble(&dphi, &mut expected, at_particle).unwrap();
            assert!(difference(&forces, &expected) < 1e-14, "{case}");
            let frozen = supports
                .interpolate(&dphi, |p, _, g| {
                    let at = Deformation::new(compose(&g, h_n(p)));
                    Ok::<_, NonPositiveJacobian>(law(p).freeze(&f_n(p), &at, particles.volume[p]))
                })
                .unwrap();
            expected.fill(Vector::zeros());
            let at_particle = |p: usize, u: Vector<f64, D>, l: Tensor<f64, D>| {
                Ok::<_, NonPositiveJacobian>((u * (2.0 + 0.1 * p as f64), frozen[p].apply(&l)))
            };
            supports.assemble(&u, &mut expected, at_particle).unwrap();
            assert!(difference(&product, &expected) < 1e-14, "{case}");
        }
    }
}

#[test]
fn a_law_in_lanes_gives_the_bits_of_one_particle_after_the_other() {
    compare::<1>();
    compare::<2>();
    compare::<3>();
}

#[test]
fn the_smallest_particle_that_cannot_be_deformed_is_named() {
    let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [9; 2] };
    for law in materials() {
        let mut particles = particles::<2>(1, &REGIMES);
        for (p, det_f) in [(40, -0.5), (17, 0.0), (60, f64::NAN)] {
            particles.displacement_gradient[p] = Tensor::from_diagonal(&Vector::from([det_f - 1.0, 0.0]));
        }
        let (supports, nodes) = Supports::new(&Approximation::from(Linear), &grid, &particles.position).unwrap();
        let zero = vec![Vector::zeros(); nodes.len()];
        let bodies = bodies([law]);
        let laws = Laws { particles: &particles, bodies: &bodies };
        let expected = Inadmissible { particle: 17, source: NonPositiveJacobian { det_f: 0.0 } };
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let forces = pool.install(|| supports.forces(&laws, &zero, None, &mut zero.clone()));
            assert_eq!(forces, Some(Err(expected)));
            let tangents = pool.install(|| supports.closed_tangents(&laws, &zero, true, None));
            assert_eq!(tangents.map(|tangents| tangents.map(|_| ())), Some(Err(Some(expected))));
        }
        // A tangent that has terms for which there is no room is not cut short.
        particles.displacement_gradient.fill(Tensor::zeros());
        let laws = Laws { particles: &particles, bodies: &bodies };
        let simple = supports.closed_tangents(&laws, &zero, false, None).map(|tangents| tangents.map(|_| ()));
        let has_room = !has_both(&bodies[0].law);
        assert_eq!(simple, Some(if has_room { Ok(()) } else { Err(None) }));
    }
}

#[test]
fn ln_j_has_all_its_digits_at_any_size() {
    let mut worst: f64 = 0.0;
    for i in 0..4000 {
        // j of either sign down to 1e-17, J from 1e-6 to 1e6.
        let x = irregular(i);
        let h =
            if i % 2 == 0 { x.signum() * 10.0_f64.powf(17.0 * x.abs() - 17.31) } else { 10.0_f64.powf(6.0 * x) - 1.0 };
        let (found, expected) = (Deformation::<f64, 1>::new(Tensor::from_element(h)).log_jacobian(), h.ln_1p());
        worst = worst.max((found - expected).abs() / expected.abs());
    }
    assert!(worst <= 3.0 * f64::EPSILON, "{:.1} eps", worst / f64::EPSILON);
    assert_eq!(Deformation::<f64, 2>::new(Tensor::zeros()).log_jacobian(), 0.0);
}
