//! Results at single points, against an independent program (`reference/points.json`): shape functions and laws.

use bfree::approximation::{Approximation, Gimp, Linear, Lme, LmeCircle, Scratch, ShapeFunction, Support};
use bfree::grid::Grid;
use bfree::material::{Lame, LameError, Law, Material, MaterialState, NeoHookean, StVenantKirchhoff, first_piola};
use bfree::tensor::{Tensor, Vector, identity};
use serde::Deserialize;

#[derive(Deserialize)]
struct Reference {
    grid: ReferenceGrid,
    shape: Vec<Shape>,
    material: Vec<Point>,
}

#[derive(Deserialize)]
struct ReferenceGrid {
    origin: [f64; 2],
    h: f64,
    /// Number of nodes along each axis.
    n: [u32; 2],
}

#[derive(Deserialize)]
struct Shape {
    kind: String,
    gamma: Option<f64>,
    lp: Option<f64>,
    x: [f64; 2],
    nodes_ij: Vec<[u32; 2]>,
    #[serde(rename = "N")]
    values: Vec<f64>,
    #[serde(rename = "dN")]
    gradients: Vec<[f64; 2]>,
}

/// Matrices are lists of rows.
#[derive(Deserialize)]
#[allow(non_snake_case)]
struct Point {
    kind: String,
    Lambda: f64,
    G: f64,
    F: [[f64; 2]; 2],
    v: [f64; 2],
    b: [f64; 2],
    W: f64,
    S: [[f64; 2]; 2],
    P: [[f64; 2]; 2],
    Cmat: [[f64; 2]; 2],
    K_vb_per_unit_volume: [[f64; 2]; 2],
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("../reference/points.json")).expect("the reference is well-formed")
}

fn family(shape: &Shape, h: f64) -> Approximation {
    match (shape.kind.as_str(), shape.gamma, shape.lp) {
        ("Q4", None, None) => Linear.into(),
        ("uGIMP", None, Some(lp)) => Gimp { half_width: lp / h }.into(),
        ("LME_circle", Some(gamma), None) => LmeCircle::new(gamma, 1e-6).into(),
        ("LME_box", Some(gamma), None) => Lme::new(gamma, 1e-6).into(),
        other => panic!("the reference has an unknown shape function {other:?}"),
    }
}

/// Largest differences in N and in h ∇N, a node missing on either side counting as zero there.
fn differences(shape: &Shape, found: &Support<2>, h: f64) -> (f64, f64) {
    let (mut value, mut gradient): (f64, f64) = (0.0, 0.0);
    let listed = |node| shape.nodes_ij.iter().position(|&other| other == node);
    for (i, &node) in found.nodes.iter().enumerate() {
        let (n, g) = listed(node).map_or((0.0, [0.0; 2]), |k| (shape.values[k], shape.gradients[k]));
        value = value.max((found.values[i] - n).abs());
        for k in 0..2 {
            gradient = gradient.max(h * (found.gradients[i][k] - g[k]).abs());
        }
    }
    for (k, node) in shape.nodes_ij.iter().enumerate() {
        if !found.nodes.contains(node) {
            value = value.max(shape.values[k]);
            gradient = gradient.max(h * shape.gradients[k][0].abs().max(shape.gradients[k][1].abs()));
        }
    }
    (value, gradient)
}

#[test]
fn shape_functions_are_those_of_the_reference() {
    let Reference { grid: ReferenceGrid { origin, h, n }, shape: shapes, .. } = reference();
    let grid = Grid { origin: Vector::from(origin), spacing: h, cells: [n[0] - 1, n[1] - 1] };
    let (mut scratch, mut support) = (Scratch::default(), Support::default());
    assert_eq!(shapes.len(), 45);
    for shape in &shapes {
        family(shape, h).evaluate(&grid, &Vector::from(shape.x), &mut scratch, &mut support).expect("inside the box");
        let (value, gradient) = differences(shape, &support, h);
        println!("{} γ {:?} at {:?}: {value:.1e} {gradient:.1e}", shape.kind, shape.gamma, shape.x);
        assert!(value < 1e-9, "{} γ {:?} at {:?}: N off by {value:e}", shape.kind, shape.gamma, shape.x);
        // The reference lists nodes with N > 0 only; next to a particle on a node linear functions have N = 0, ∇N ≠ 0.
        let jumps = shape.kind == "Q4" && shape.x == [2.5, 2.5];
        assert!(
            gradient < 1e-9 || jumps,
            "{} γ {:?} at {:?}: h∇N off by {gradient:e}",
            shape.kind,
            shape.gamma,
            shape.x
        );
    }
}

fn law_is_that_of_the_reference(law: &impl Law, point: &Point) {
    let rows = |a: [[f64; 2]; 2]| Tensor::<f64, 2>::from_fn(|i, k| a[i][k]);
    let f = rows(point.F);
    let h = f - identity::<f64, 2>();
    let at = MaterialState::new(h).admissible().expect("det F > 0");
    let (v, b) = (Vector::from(point.v), Vector::from(point.b));
    let check = |what: &str, found: Tensor<f64, 2>, expected: [[f64; 2]; 2]| {
        let expected = rows(expected);
        let error = (found - expected).amax() / expected.amax();
        println!("{} {what}: {error:.1e}", point.kind);
        assert!(error < 1e-13, "{} {what}: {found} instead of {expected}", point.kind);
    };
    let error = law.energy(&at) / point.W - 1.0;
    assert!(error.abs() < 1e-13, "{} W: off by {error:e}", point.kind);
    check("S", law.stress(&at), point.S);
    check("P", first_piola(law, &f, &at), point.P);
    check("ℂmat", law.tangent_density(&at, &v, &b), point.Cmat);
    // The reference gives the block for gradients in the reference configuration.
    let closed = law.closed(&identity(), &at, 1.0).expect("a closed form");
    check("K", closed.block(&v, &b), point.K_vb_per_unit_volume);
    // The same block by ℂmat: F ℂmat{v, b} Fᵀ + (v · S b) I.
    let geometric = identity::<f64, 2>() * v.dot(&(law.stress(&at) * b));
    let material = f * law.tangent_density(&at, &v, &b) * f.transpose();
    check("K by ℂmat", material + geometric, point.K_vb_per_unit_volume);
}

#[test]
fn laws_are_those_of_the_reference() {
    for point in reference().material {
        let lame = Lame::new(point.Lambda, point.G).expect("a stable solid");
        match point.kind.as_str() {
            "neo_hookean" => law_is_that_of_the_reference(&NeoHookean::ciarlet(lame), &point),
            "st_venant_kirchhoff" => law_is_that_of_the_reference(&StVenantKirchhoff { lame }, &point),
            other => panic!("the reference has an unknown law {other}"),
        }
    }
}

#[test]
fn three_pairs_of_constants_are_one_solid() -> Result<(), LameError> {
    for (lambda, shear) in [(300.0, 200.0), (-20.0, 50.0), (7e9, 3.0)] {
        let solid = Lame::new(lambda, shear)?;
        let (young, poisson) =
            (shear * (3.0 * lambda + 2.0 * shear) / (lambda + shear), 0.5 * lambda / (lambda + shear));
        for same in [Lame::from_young_poisson(young, poisson)?, Lame::from_bulk_shear(lambda + shear / 1.5, shear)?] {
            // 1 − 2ν loses as many digits as Λ is larger than G.
            let digits = 16.0 * f64::EPSILON * (1.0 + (lambda / shear).abs());
            assert!(
                (same.shear / shear - 1.0).abs() < 1e-15 && (same.lambda / lambda - 1.0).abs() < digits,
                "{same:?}"
            );
        }
        // The stiffness of a bar that cannot contract.
        for (_, law) in Material::examples(solid) {
            let stiffness = law.elasticity(&MaterialState::new(Tensor::<f64, 1>::zeros()), &identity())[0];
            assert!((stiffness / solid.p_wave_modulus() - 1.0).abs() < 1e-15, "{law:?}");
        }
    }
    Ok(())
}

#[test]
fn constants_at_the_limits_of_stability_are_refused() {
    let inf = f64::INFINITY;
    for shear in [0.0, -1.0, inf, f64::NAN] {
        assert!(matches!(Lame::new(1.0, shear), Err(LameError::Shear(_))), "G = {shear}");
        assert!(matches!(Lame::from_bulk_shear(1.0, shear), Err(LameError::Shear(_))), "G = {shear}");
    }
    assert!(matches!(Lame::new(-2.0, 3.0), Err(LameError::Bulk(_))));
    for bulk in [0.0, -1.0, inf, f64::NAN] {
        assert_eq!(Lame::from_bulk_shear(bulk, 1.0).map_err(|error| error.to_string().contains("bulk")), Err(true));
    }
    for young in [0.0, -1.0, inf, f64::NAN] {
        assert!(matches!(Lame::from_young_poisson(young, 0.3), Err(LameError::Young(_))), "E = {young}");
    }
    for poisson in [-1.0, 0.5, -1.5, 0.6, f64::NAN] {
        assert!(matches!(Lame::from_young_poisson(1.0, poisson), Err(LameError::Poisson(_))), "ν = {poisson}");
    }
}
