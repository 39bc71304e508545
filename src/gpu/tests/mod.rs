//! Writes the formulas of the library as C: they run on numbers that record what is done with them. So no formula is written twice.

mod recorded;

use crate::lanes::LANES;
use crate::material::{
    ClosedTangent, Formula, Lame, Law, Material, MaterialState, NeoHookean, StVenantKirchhoff, first_piola,
};
use crate::mechanics::kinematics::{compose, to_nodes};
use crate::mechanics::sweep::pair;
use crate::tensor::{Deformation, Tensor, change_of_volume, determinant, identity};
use recorded::{Recorded, argument, function, stands_for};
use std::array::from_fn;
use std::f64::consts::LN_2;
use std::path::Path;

/// A tensor of variables, by rows.
fn tensor<const D: usize>(name: &str) -> Tensor<Recorded, D> {
    Tensor::from_fn(|i, k| Recorded::argument(format!("{name}[{i}][{k}]")))
}

/// A tensor of arguments that formulas take as plain numbers.
fn plain<const D: usize>(name: &str) -> Tensor<f64, D> {
    Tensor::from_fn(|i, k| argument(format!("{name}[{i}][{k}]")))
}

/// The entries of a tensor, with the places where they go.
fn results<const D: usize>(of: &Tensor<Recorded, D>) -> Vec<(String, Recorded)> {
    let places = (0..D).flat_map(|i| (0..D).map(move |k| (i, k)));
    places.map(|(i, k)| (format!("out[{i}][{k}]"), of[(i, k)])).collect()
}

/// A symmetric tensor from its upper triangle, column by column.
fn symmetric<const D: usize>(next: &mut dyn FnMut() -> Recorded) -> [[Recorded; D]; D] {
    let mut b = [[Recorded::argument("0.0"); D]; D];
    for k in 0..D {
        for i in 0..=k {
            b[i][k] = next();
            b[k][i] = b[i][k];
        }
    }
    b
}

/// The entries of the upper triangle, column by column.
fn upper<const D: usize>(b: &[[Recorded; D]; D]) -> impl Iterator<Item = Recorded> {
    (0..D).flat_map(move |k| (0..=k).map(move |i| b[i][k]))
}

/// The closed tangent that the rows of a particle hold (`constitutive/tangents.rs`).
fn read<const D: usize>(with_factors: bool) -> ClosedTangent<Recorded, D> {
    let mut rows = (0..).map(|row| Recorded::argument(format!("rows[{}]", row * LANES)));
    let mut next = || rows.next().unwrap();
    let a = [[(); D]; D].map(|line| line.map(|()| next()));
    let right = symmetric(&mut next);
    let (bulk, q) = (next(), next());
    let factors = with_factors.then(|| [symmetric(&mut next), symmetric(&mut next)]);
    ClosedTangent { a, right, bulk, q, factors }
}

/// The name of a function for closed tangents.
fn closed(name: &str, with_factors: bool) -> String {
    if with_factors { format!("{name}_with_factors") } else { name.to_owned() }
}

/// 𝔸 : L of the closed tangent.
fn product<const D: usize>(with_factors: bool) -> String {
    let name = closed("closed", with_factors);
    let head = format!("{name}_{D}(const double *rows, const double l[{D}][{D}], double out[{D}][{D}])");
    function(&head, || {
        let (tangent, l) = (read::<D>(with_factors), tensor::<D>("l"));
        let out = tangent.product(&from_fn(|i| from_fn(|k| l[(i, k)])));
        results(&Tensor::<_, D>::from_fn(|i, k| out[i][k]))
    })
}

/// Row i of the blocks of all pairs of unit gradients, 𝔸_kl + 𝔸_lk for k < l and 𝔸_kk.
fn blocks<const D: usize>(with_factors: bool, i: usize) -> String {
    let head = format!("{}_{i}_{D}(const double *rows, double out[][{D}])", closed("pairs", with_factors));
    function(&head, || {
        let tangent = read::<D>(with_factors);
        let entry = |k: usize, l: usize, j: usize| {
            let [one, other] = [tangent.unit_block(k, l)[i][j], tangent.unit_block(l, k)[i][j]];
            (format!("out[{}][{j}]", pair(k, l)), if k < l { one + other } else { one })
        };
        let pairs = (0..D).flat_map(|l| (0..=l).map(move |k| (k, l)));
        pairs.flat_map(|(k, l)| (0..D).map(move |j| (k, l, j))).map(|(k, l, j)| entry(k, l, j)).collect()
    })
}

/// H of the end from L, and the volumes that belong to H.
fn deformation<const D: usize>() -> [String; 3] {
    let h = format!("const double h[{D}][{D}]");
    let compose = format!("compose_{D}(const double l[{D}][{D}], const double h_r[{D}][{D}], double out[{D}][{D}])");
    [
        function(&compose, || results(&compose_recorded::<D>())),
        function(&format!("change_of_volume_{D}({h}, double *out)"), || {
            vec![("*out".to_owned(), change_of_volume(&tensor::<D>("h")))]
        }),
        function(&format!("determinant_{D}({h}, double *out)"), || {
            vec![("*out".to_owned(), determinant(&(identity() + tensor::<D>("h"))))]
        }),
    ]
}

fn compose_recorded<const D: usize>() -> Tensor<Recorded, D> {
    compose(&tensor::<D>("l"), &plain("h_r"))
}

/// A law whose formula is recorded: its name in C, J at which its branches are decided, and the law with its constants as arguments.
fn law(formula: u32, far: bool) -> (&'static str, Material) {
    let lame = Lame { lambda: argument("constants[0]"), shear: argument("constants[1]") };
    match (formula, far) {
        (Formula::CIARLET, _) => ("ciarlet", NeoHookean::ciarlet(lame).into()),
        (Formula::LOGARITHMIC, false) => ("logarithmic", NeoHookean::logarithmic(lame).into()),
        (Formula::LOGARITHMIC, true) => ("logarithmic_far", NeoHookean::logarithmic(lame).into()),
        _ => ("st_venant_kirchhoff", StVenantKirchhoff { lame }.into()),
    }
}

/// The exponent of J where ln J is recorded for volumes far from 1.
const FAR: i32 = 300;

/// The state of a particle whose H and volumes are variables.
fn state<const D: usize>(far: bool) -> MaterialState<'static, Recorded, D> {
    let (j, jacobian) = (Recorded::argument("v->j"), Recorded::argument("v->jacobian"));
    if far {
        stands_for(2f64.powi(-FAR), "v->scale");
        stands_for(f64::from(FAR) * LN_2, "v->k_ln_2");
    }
    let h = tensor::<D>("h");
    let jacobian = jacobian.decided_by(if far { 2f64.powi(FAR) } else { 1.0 });
    MaterialState::of(Deformation { h, f: identity() + h, j, jacobian })
}

fn arguments<const D: usize>() -> String {
    format!(
        "const double h[{D}][{D}], const struct Volume *v, const double f_r[{D}][{D}], double volume, \
         const double *constants"
    )
}

/// V₀ F S F_rᵀ
fn stress<const D: usize>(formula: u32, far: bool) -> String {
    let head = format!("stress_{}_{D}({}, double out[{D}][{D}])", law(formula, far).0, arguments::<D>());
    function(&head, || {
        let ((_, law), at) = (law(formula, far), state::<D>(far));
        results(&to_nodes(&first_piola(&law, &at.f, &at), &plain("f_r"), argument("volume")))
    })
}

/// The rows of the closed tangent.
fn tangent<const D: usize>(formula: u32, far: bool) -> String {
    let head = format!("tangent_{}_{D}({}, double *rows)", law(formula, far).0, arguments::<D>());
    function(&head, || {
        let ((_, law), at) = (law(formula, far), state::<D>(far));
        let ClosedTangent { a, right, bulk, q, factors } =
            law.closed(&tensor::<D>("f_r"), &at, Recorded::argument("volume")).unwrap();
        let factors = factors.iter().flatten().flat_map(upper);
        let rows = a.iter().flatten().copied().chain(upper(&right)).chain([bulk, q]).chain(factors);
        rows.enumerate().map(|(row, number)| (format!("rows[{}]", row * LANES), number)).collect()
    })
}

fn functions<const D: usize>() -> String {
    let products = [false, true].map(product::<D>).concat();
    let blocks = [false, true].map(|with_factors| (0..D).map(|i| blocks::<D>(with_factors, i)).collect::<String>());
    let laws = [
        (Formula::CIARLET, false),
        (Formula::LOGARITHMIC, false),
        (Formula::LOGARITHMIC, true),
        (Formula::ST_VENANT_KIRCHHOFF, false),
    ];
    let laws = laws.map(|(formula, far)| stress::<D>(formula, far) + &tangent::<D>(formula, far));
    products + &blocks.concat() + &deformation::<D>().concat() + &laws.concat()
}

#[test]
fn formulas_in_c_are_recorded_from_those_in_rust() {
    let head = "// Formulas of the library, recorded by src/gpu/tests. Written by\n\
                // BFREE_WRITE_KERNELS=1 cargo test --release --lib recorded\n";
    let recorded = head.to_owned() + &functions::<1>() + &functions::<2>() + &functions::<3>();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu/kernels/recorded.h");
    if std::env::var_os("BFREE_WRITE_KERNELS").is_some() {
        std::fs::write(&path, &recorded).unwrap();
    }
    assert!(std::fs::read_to_string(&path).is_ok_and(|text| text == recorded), "{} is out of date", path.display());
}
