//! A number that records how it was computed, as the lines of a C function. The formulas of the library run on it.

use crate::lanes::Lane;
use num_dual::{DualNum, DualStruct, Mappable};
use num_traits::{FromPrimitive, Inv, Num, One, Signed, Zero};
use std::cell::RefCell;
use std::cmp::Ordering;
use std::fmt::{Display, Formatter};
use std::iter::{Product, Sum};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};

/// The lines of one function, and the arguments that formulas take as plain numbers.
#[derive(Default)]
struct Function {
    /// The expression of each variable, argument and constant, and whether it is a variable.
    lines: Vec<(String, bool)>,
    /// Plain numbers that stand for arguments, with the expressions of these.
    arguments: Vec<(f64, String)>,
    /// The value of a variable that a formula may branch on.
    value: Option<(usize, f64)>,
}

thread_local!(static FUNCTION: RefCell<Function> = RefCell::default());

/// A plain number above this is an argument.
const ARGUMENT: f64 = 1e200;

/// A variable of the C function that is being recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Recorded(usize);

impl Recorded {
    /// Equal expressions have one variable.
    fn of(expression: String, is_variable: bool) -> Self {
        FUNCTION.with_borrow_mut(|function| {
            let known = function.lines.iter().position(|(line, _)| *line == expression);
            Self(known.unwrap_or_else(|| {
                function.lines.push((expression, is_variable));
                function.lines.len() - 1
            }))
        })
    }

    /// A variable with this expression.
    fn variable(expression: String) -> Self {
        Self::of(expression, true)
    }

    /// An argument of the function.
    pub(super) fn argument(name: impl Into<String>) -> Self {
        Self::of(name.into(), false)
    }

    /// A constant, or the argument that the number stands for.
    fn of_number(x: f64) -> Self {
        let argument = |(of, name): &(f64, String)| (*of == x).then(|| name.clone());
        let argument = FUNCTION.with_borrow(|function| function.arguments.iter().find_map(argument));
        assert!(argument.is_some() || x.abs() < ARGUMENT, "an argument was changed before it was recorded");
        Self::argument(argument.unwrap_or_else(|| format!("{x:?}")))
    }

    /// The only variable that a formula may branch on, with the value that decides.
    pub(super) fn decided_by(self, value: f64) -> Self {
        FUNCTION.with_borrow_mut(|function| function.value = Some((self.0, value)));
        self
    }

    fn is(self, constant: &str) -> bool {
        FUNCTION.with_borrow(|function| function.lines[self.0].0 == constant)
    }
}

/// A plain number that stands for an argument of the function.
pub(super) fn argument(name: impl Into<String>) -> f64 {
    FUNCTION.with_borrow_mut(|function| {
        let number = ARGUMENT * (2 + function.arguments.len()) as f64;
        function.arguments.push((number, name.into()));
        number
    })
}

/// Makes the number stand for an argument.
pub(super) fn stands_for(number: f64, name: &str) {
    FUNCTION.with_borrow_mut(|function| function.arguments.push((number, name.to_owned())));
}

/// The C function with this head, whose results `record` returns with the places where they go. Lines without use are left out.
pub(super) fn function(head: &str, record: impl FnOnce() -> Vec<(String, Recorded)>) -> String {
    FUNCTION.take();
    let results = record();
    let mut is_used: Vec<bool> = FUNCTION.with_borrow(|function| vec![false; function.lines.len()]);
    let written: String = results.iter().map(|(to, result)| format!("    {to} = {result};\n")).collect();
    results.iter().for_each(|(_, result)| is_used[result.0] = true);
    let lines = FUNCTION.take().lines;
    for k in (0..lines.len()).rev().filter(|&k| lines[k].1) {
        // A line uses lines before it, which are looked at later.
        let words = lines[k].0.split(|c: char| !c.is_alphanumeric());
        let variables = words.filter_map(|word| word.strip_prefix('t')?.parse::<usize>().ok());
        let is_line_used = is_used[k];
        variables.filter(|_| is_line_used).for_each(|variable| is_used[variable] = true);
    }
    let used = lines.iter().enumerate().filter(|(k, (_, is_variable))| *is_variable && is_used[*k]);
    let used: String = used.map(|(k, (line, _))| format!("    const double t{k} = {line};\n")).collect();
    format!("\nFUNCTION void {head} {{\n{used}{written}}}\n")
}

macro_rules! operators {
    ($($operator:ident $method:ident $assigning:ident $assign:ident $sign:literal;)+) => {$(
        impl $operator for Recorded {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                // Formulas of matrices multiply by one.
                if $sign == "*" && (self.is("1.0") || other.is("1.0")) {
                    return if self.is("1.0") { other } else { self };
                }
                Self::variable(format!("{self} {} {other}", $sign))
            }
        }

        impl $operator<&Self> for Recorded {
            type Output = Self;
            fn $method(self, other: &Self) -> Self {
                $operator::$method(self, *other)
            }
        }

        impl $operator<f64> for Recorded {
            type Output = Self;
            fn $method(self, other: f64) -> Self {
                $operator::$method(self, Self::of_number(other))
            }
        }

        impl $assigning for Recorded {
            fn $assign(&mut self, other: Self) {
                *self = $operator::$method(*self, other);
            }
        }

        impl $assigning<f64> for Recorded {
            fn $assign(&mut self, other: f64) {
                *self = $operator::$method(*self, other);
            }
        }
    )+};
}

operators! {
    Add add AddAssign add_assign "+";
    Sub sub SubAssign sub_assign "-";
    Mul mul MulAssign mul_assign "*";
    Div div DivAssign div_assign "/";
    Rem rem RemAssign rem_assign "%";
}

impl Neg for Recorded {
    type Output = Self;
    fn neg(self) -> Self {
        Self::variable(format!("-{self}"))
    }
}

impl Lane for Recorded {
    fn constant(self, x: f64) -> Self {
        Self::of_number(x)
    }

    fn add_product(self, a: Self, b: Self) -> Self {
        Self::variable(format!("fma({a}, {b}, {self})"))
    }

    fn sub_product(self, a: Self, b: Self) -> Self {
        Self::variable(format!("fma(-{a}, {b}, {self})"))
    }

    fn where_less(self, other: Self, then: Self, otherwise: Self) -> Self {
        Self::variable(format!("{self} < {other} ? {then} : {otherwise}"))
    }

    fn abs(self) -> Self {
        Self::variable(format!("fabs({self})"))
    }
}

// The rest makes it a `Real`. No law with a formula on the device uses the functions that are not recorded.

const NOT_RECORDED: &str = "this is not recorded";

impl Display for Recorded {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        FUNCTION.with_borrow(|function| match &function.lines[self.0] {
            (_, true) => write!(f, "t{}", self.0),
            (expression, false) => f.write_str(expression),
        })
    }
}

impl PartialOrd for Recorded {
    fn partial_cmp(&self, _: &Self) -> Option<Ordering> {
        unreachable!("{NOT_RECORDED}")
    }
}

impl PartialEq<f64> for Recorded {
    fn eq(&self, _: &f64) -> bool {
        unreachable!("{NOT_RECORDED}")
    }
}

impl PartialOrd<f64> for Recorded {
    fn partial_cmp(&self, _: &f64) -> Option<Ordering> {
        unreachable!("{NOT_RECORDED}")
    }
}

impl From<f64> for Recorded {
    fn from(x: f64) -> Self {
        Self::of_number(x)
    }
}

impl FromPrimitive for Recorded {
    fn from_i64(n: i64) -> Option<Self> {
        Some(Self::of_number(n as f64))
    }

    fn from_u64(n: u64) -> Option<Self> {
        Some(Self::of_number(n as f64))
    }
}

impl Zero for Recorded {
    fn zero() -> Self {
        Self::of_number(0.0)
    }

    fn is_zero(&self) -> bool {
        self.is("0.0")
    }
}

impl One for Recorded {
    fn one() -> Self {
        Self::of_number(1.0)
    }
}

impl Num for Recorded {
    type FromStrRadixErr = ();

    fn from_str_radix(_: &str, _: u32) -> Result<Self, ()> {
        Err(())
    }
}

impl Sum for Recorded {
    fn sum<I: Iterator<Item = Self>>(of: I) -> Self {
        of.fold(Self::zero(), Add::add)
    }
}

impl Product for Recorded {
    fn product<I: Iterator<Item = Self>>(of: I) -> Self {
        of.fold(Self::one(), Mul::mul)
    }
}

impl Inv for Recorded {
    type Output = Self;
    fn inv(self) -> Self {
        DualNum::recip(&self)
    }
}

impl Signed for Recorded {
    fn abs(&self) -> Self {
        Lane::abs(*self)
    }

    fn abs_sub(&self, _: &Self) -> Self {
        unreachable!("{NOT_RECORDED}")
    }

    fn signum(&self) -> Self {
        unreachable!("{NOT_RECORDED}")
    }

    fn is_positive(&self) -> bool {
        unreachable!("{NOT_RECORDED}")
    }

    fn is_negative(&self) -> bool {
        unreachable!("{NOT_RECORDED}")
    }
}

impl DualStruct for Recorded {
    type Real = f64;
    type Inner = f64;

    /// The value of the variable that decides a branch.
    fn re(&self) -> f64 {
        let decided = FUNCTION.with_borrow(|function| function.value.filter(|(of, _)| *of == self.0));
        decided.expect("a formula branches on a number that is recorded").1
    }

    fn from_inner(inner: &f64) -> Self {
        Self::of_number(*inner)
    }
}

impl Mappable<Self> for Recorded {
    type Output<O> = O;

    fn map_dual<M: Fn(Self) -> O, O>(self, f: M) -> O {
        f(self)
    }
}

macro_rules! not_recorded {
    ($($function:ident)+) => {
        $(fn $function(&self) -> Self {
            unreachable!("{NOT_RECORDED}")
        })+
    };
}

impl DualNum for Recorded {
    type Primitive = f64;
    type InnerDual = f64;
    const NDERIV: usize = 0;

    fn from_re(re: f64) -> Self {
        Self::of_number(re)
    }

    fn scale(self, factor: &f64) -> Self {
        self * *factor
    }

    fn recip(&self) -> Self {
        Self::one() / *self
    }

    fn sqrt(&self) -> Self {
        Self::variable(format!("sqrt({self})"))
    }

    fn powi(&self, _: i32) -> Self {
        unreachable!("{NOT_RECORDED}")
    }

    fn powf(&self, _: f64) -> Self {
        unreachable!("{NOT_RECORDED}")
    }

    fn log(&self, _: f64) -> Self {
        unreachable!("{NOT_RECORDED}")
    }

    fn atan2(&self, _: Self) -> Self {
        unreachable!("{NOT_RECORDED}")
    }

    fn sin_cos(&self) -> (Self, Self) {
        unreachable!("{NOT_RECORDED}")
    }

    not_recorded! {
        cbrt exp exp2 exp_m1 ln log2 log10 ln_1p sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh sph_j0 sph_j1 sph_j2
    }
}
