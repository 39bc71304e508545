//! Writes the product of the closed-form tangent as C, from the one in Rust: it runs on numbers that record what is done with them.

use crate::lanes::{LANES, Lane};
use crate::material::ClosedTangent;
use std::cell::RefCell;
use std::fmt::Write;
use std::ops::{Add, Div, Mul, Sub};
use std::path::Path;

thread_local!(static LINES: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) });

/// A number that records how it was computed: a variable of the C function.
#[derive(Clone, Copy)]
struct Recorded(usize);

impl Recorded {
    fn new(expression: String) -> Self {
        LINES.with_borrow_mut(|lines| {
            lines.push(expression);
            Self(lines.len() - 1)
        })
    }
}

macro_rules! operator {
    ($operator:ident, $method:ident, $sign:literal) => {
        impl $operator for Recorded {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                Self::new(format!("t{} {} t{}", self.0, $sign, other.0))
            }
        }
    };
}

operator!(Add, add, "+");
operator!(Sub, sub, "-");
operator!(Mul, mul, "*");
operator!(Div, div, "/");

impl Lane for Recorded {
    fn constant(self, x: f64) -> Self {
        Self::new(format!("{x:?}"))
    }

    fn add_product(self, a: Self, b: Self) -> Self {
        Self::new(format!("fma(t{}, t{}, t{})", a.0, b.0, self.0))
    }

    fn sub_product(self, a: Self, b: Self) -> Self {
        Self::new(format!("fma(-t{}, t{}, t{})", a.0, b.0, self.0))
    }

    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        Self::new(format!("t{} < t{} ? t{} : t{}", self.0, other.0, then.0, otherwise.0))
    }

    fn abs(self) -> Self {
        Self::new(format!("fabs(t{})", self.0))
    }
}

/// A symmetric tensor from its upper triangle, column by column. `of` has as many entries.
fn symmetric<const D: usize>(of: &[[Recorded; D]; D], next: &mut dyn FnMut() -> Recorded) -> [[Recorded; D]; D] {
    let mut b = *of;
    for k in 0..D {
        for i in 0..=k {
            b[i][k] = next();
            b[k][i] = b[i][k];
        }
    }
    b
}

/// The function in C for `D` dimensions, with the rows of `constitutive/tangents.rs`.
fn function<const D: usize>(with_factors: bool) -> String {
    LINES.take();
    let mut rows = (0..).map(|row| Recorded::new(format!("rows[{}]", row * LANES)));
    let mut next = || rows.next().unwrap();
    let a = [[(); D]; D].map(|line| line.map(|()| next()));
    let right = symmetric(&a, &mut next);
    let (bulk, q) = (next(), next());
    let factors = with_factors.then(|| [symmetric(&a, &mut next), symmetric(&a, &mut next)]);
    let l: [[Recorded; D]; D] = std::array::from_fn(|i| std::array::from_fn(|k| Recorded::new(format!("l[{i}][{k}]"))));
    let out = ClosedTangent { a, right, bulk, q, factors }.product(&l);
    let name = if with_factors { "closed_with_factors" } else { "closed" };
    let mut text =
        format!("\nFUNCTION void {name}_{D}(const double *rows, const double l[{D}][{D}], double out[{D}][{D}]) {{\n");
    let lines = LINES.take();
    for (k, line) in lines.iter().enumerate() {
        _ = writeln!(text, "    const double t{k} = {line};");
    }
    for (i, row) in out.iter().enumerate() {
        for (k, number) in row.iter().enumerate() {
            _ = writeln!(text, "    out[{i}][{k}] = t{};", number.0);
        }
    }
    text + "}\n"
}

#[test]
fn the_closed_product_in_c_is_recorded_from_that_in_rust() {
    let functions = [
        function::<1>(false),
        function::<1>(true),
        function::<2>(false),
        function::<2>(true),
        function::<3>(false),
        function::<3>(true),
    ];
    let head = "// ClosedTangent::product of src/material/closed_tangent.rs, recorded by src/gpu/tests.rs. Written by\n\
                // BFREE_WRITE_KERNELS=1 cargo test --release --lib recorded\n";
    let recorded = head.to_owned() + &functions.concat();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu/kernels/closed.h");
    if std::env::var_os("BFREE_WRITE_KERNELS").is_some() {
        std::fs::write(&path, &recorded).unwrap();
    }
    assert!(std::fs::read_to_string(&path).unwrap() == recorded, "{} is out of date", path.display());
}
