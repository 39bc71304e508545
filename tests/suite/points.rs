//! Results at single points, against an independent program (`reference/points.json`): shape functions and laws.

use bfree::approximation::{Approximation, Gimp, Linear, Lme, LmeCircle, Scratch, ShapeFunction, Support};
use bfree::grid::Grid;
use bfree::material::{Lame, LameError, Law, Material, MaterialState, NeoHookean, StVenantKirchhoff, first_piola};
use bfree::tensor::{Tensor, Vector, identity};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

#[derive(Deserialize)]
struct Reference {
    grid: Value,
    shape: Vec<Shape>,
    material: Vec<Value>,
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

fn reference() -> Reference {
    serde_json::from_str(include_str!("../reference/points.json")).expect("the reference is well-formed")
}

/// A value of the reference.
fn read<T: DeserializeOwned>(value: &Value) -> T {
    serde_json::from_value(value.clone()).expect("a number or a list of numbers")
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
    let at = |nodes: &[[u32; 2]], values: &[f64], gradients: &[[f64; 2]], node| {
        let place = nodes.iter().position(|&other| other == node);
        place.map_or((0.0, [0.0; 2]), |k| (values[k], gradients[k]))
    };
    for &node in found.nodes.iter().chain(&shape.nodes_ij) {
        let (n, g) = at(&found.nodes, &found.values, &found.gradients, node);
        let (m, f) = at(&shape.nodes_ij, &shape.values, &shape.gradients, node);
        value = value.max((n - m).abs());
        gradient = gradient.max(h * (g[0] - f[0]).abs().max((g[1] - f[1]).abs()));
    }
    (value, gradient)
}

#[test]
fn shape_functions_are_those_of_the_reference() {
    let Reference { grid, shape: shapes, .. } = reference();
    // n is the number of nodes along each axis.
    let (h, n): (f64, [u32; 2]) = (read(&grid["h"]), read(&grid["n"]));
    let grid = Grid { origin: Vector::from(read::<[f64; 2]>(&grid["origin"])), spacing: h, cells: n.map(|n| n - 1) };
    let (mut scratch, mut support) = (Scratch::default(), Support::default());
    assert_eq!(shapes.len(), 45);
    for shape in &shapes {
        family(shape, h).evaluate(&grid, &Vector::from(shape.x), &mut scratch, &mut support).expect("inside the box");
        let (value, gradient) = differences(shape, &support, h);
        let what = format!("{} γ {:?} at {:?}", shape.kind, shape.gamma, shape.x);
        assert!(value < 1e-9, "{what}: N off by {value:e}");
        // The reference lists nodes with N > 0 only; next to a particle on a node linear functions have N = 0, ∇N ≠ 0.
        let jumps = shape.kind == "Q4" && shape.x == [2.5, 2.5];
        assert!(gradient < 1e-9 || jumps, "{what}: h∇N off by {gradient:e}");
    }
}

/// Matrices are lists of rows.
fn law_is_that_of_the_reference(law: &impl Law, point: &Value) {
    let rows = |key: &str| {
        let a: [[f64; 2]; 2] = read(&point[key]);
        Tensor::<f64, 2>::from_fn(|i, k| a[i][k])
    };
    let f = rows("F");
    let h = f - identity::<f64, 2>();
    let at = MaterialState::new(h).admissible().expect("det F > 0");
    let [v, b] = ["v", "b"].map(|key| Vector::from(read::<[f64; 2]>(&point[key])));
    let check = |key: &str, found: Tensor<f64, 2>| {
        let expected = rows(key);
        let error = (found - expected).amax() / expected.amax();
        assert!(error < 1e-13, "{} {key}: {found} instead of {expected}", point["kind"]);
    };
    let error = law.energy(&at) / read::<f64>(&point["W"]) - 1.0;
    assert!(error.abs() < 1e-13, "{} W: off by {error:e}", point["kind"]);
    check("S", law.stress(&at));
    check("P", first_piola(law, &f, &at));
    check("Cmat", law.tangent_density(&at, &v, &b));
    // The reference gives the block for gradients in the reference configuration.
    let closed = law.closed(&identity(), &at, 1.0).expect("a closed form");
    check("K_vb_per_unit_volume", closed.block(&v, &b));
    // The same block by ℂmat: F ℂmat{v, b} Fᵀ + (v · S b) I.
    let geometric = identity::<f64, 2>() * v.dot(&(law.stress(&at) * b));
    let material = f * law.tangent_density(&at, &v, &b) * f.transpose();
    check("K_vb_per_unit_volume", material + geometric);
}

#[test]
fn laws_are_those_of_the_reference() {
    for point in reference().material {
        let lame = Lame::new(read(&point["Lambda"]), read(&point["G"])).expect("a stable solid");
        match read::<String>(&point["kind"]).as_str() {
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
            let [of_shear, of_lambda] = [same.shear / shear - 1.0, same.lambda / lambda - 1.0].map(f64::abs);
            assert!(of_shear < 1e-15 && of_lambda < digits, "{same:?}");
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
