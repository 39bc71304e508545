//! Numbers of twice the digits, through the same generic code as `f64`. They are the reference for `f64`.
//!
//! Sums, products and square roots come from the crate `twofloat` (Joldes, Muller, Popescu, "Tight and rigorous error bounds for basic
//! building blocks of double-word arithmetic", 2017). Its quotients (version 0.8.4) and logarithms are accurate to 1e-16 only, so this
//! module has its own. Functions that no law of this project needs (exp, sin, …) come from the library, with its accuracy.

use num_dual::{DualNum, DualStruct, Mappable};
use num_traits::{FromPrimitive, Inv, Num, One, Signed, Zero};
use std::fmt;
use std::iter::{Product, Sum};
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Rem, RemAssign, Sub, SubAssign};
use twofloat::{TwoFloat, consts::LN_2};

/// An unevaluated sum of two `f64`, about 32 decimal digits.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct DoubleDouble(TwoFloat);

/// Number of terms of the series of artanh for |s| ≤ 0.172: s⁴⁴ = 2e-34.
const TERMS: u32 = 22;

/// The range in which ln(1 + x) is summed from x itself: s = x/(2 + x) is then as small as in `ln`.
const NEAR_ONE: std::ops::RangeInclusive<f64> = -0.29..=0.41;

impl DoubleDouble {
    /// The rounding unit of a sum or product, about 2⁻¹⁰⁴.
    pub const EPSILON: f64 = 5e-32;

    /// |self| as `f64`.
    pub fn magnitude(self) -> f64 {
        self.0.hi().abs()
    }

    /// Long division in three digits to base 2⁵³; the remainders have twice the digits.
    fn quotient(a: TwoFloat, b: TwoFloat) -> TwoFloat {
        let first = a.hi() / b.hi();
        let rest = a - b * first;
        let second = rest.hi() / b.hi();
        let third = (rest - b * second).hi() / b.hi();
        TwoFloat::new_add(first, second) + third
    }

    /// 2 artanh s = 2 (s + s³/3 + s⁵/5 + …)
    fn twice_artanh(s: TwoFloat) -> TwoFloat {
        let s2 = s * s;
        let mut series = TwoFloat::from(0.0);
        for k in (0..TERMS).rev() {
            series = series * s2 + Self::quotient(1.0.into(), f64::from(2 * k + 1).into());
        }
        s * series * 2.0
    }
}

impl From<f64> for DoubleDouble {
    fn from(x: f64) -> Self {
        Self(TwoFloat::from(x))
    }
}

impl From<TwoFloat> for DoubleDouble {
    fn from(x: TwoFloat) -> Self {
        Self(x)
    }
}

macro_rules! operations {
    ($($operation:ident $method:ident $assignment:ident $assign:ident $made:expr),*) => {$(
        impl $operation for DoubleDouble {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                let made: fn(TwoFloat, TwoFloat) -> TwoFloat = $made;
                Self(made(self.0, other.0))
            }
        }

        impl $operation<&Self> for DoubleDouble {
            type Output = Self;
            fn $method(self, other: &Self) -> Self {
                $operation::$method(self, *other)
            }
        }

        impl $operation<f64> for DoubleDouble {
            type Output = Self;
            fn $method(self, other: f64) -> Self {
                $operation::$method(self, Self::from(other))
            }
        }

        impl $assignment for DoubleDouble {
            fn $assign(&mut self, other: Self) {
                *self = $operation::$method(*self, other);
            }
        }

        impl $assignment<f64> for DoubleDouble {
            fn $assign(&mut self, other: f64) {
                *self = $operation::$method(*self, other);
            }
        }
    )*};
}

operations!(
    Add add AddAssign add_assign Add::add,
    Sub sub SubAssign sub_assign Sub::sub,
    Mul mul MulAssign mul_assign Mul::mul,
    Div div DivAssign div_assign DoubleDouble::quotient,
    Rem rem RemAssign rem_assign Rem::rem
);

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl PartialEq<f64> for DoubleDouble {
    fn eq(&self, other: &f64) -> bool {
        self.0 == *other
    }
}

impl PartialOrd<f64> for DoubleDouble {
    fn partial_cmp(&self, other: &f64) -> Option<std::cmp::Ordering> {
        self.0.partial_cmp(other)
    }
}

impl fmt::Display for DoubleDouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} + {:e}", self.0.hi(), self.0.lo())
    }
}

impl Zero for DoubleDouble {
    fn zero() -> Self {
        Self::from(0.0)
    }

    fn is_zero(&self) -> bool {
        *self == 0.0
    }
}

impl One for DoubleDouble {
    fn one() -> Self {
        Self::from(1.0)
    }
}

impl Num for DoubleDouble {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Self::from)
    }
}

impl Signed for DoubleDouble {
    fn abs(&self) -> Self {
        Self(self.0.abs())
    }

    fn abs_sub(&self, other: &Self) -> Self {
        if self > other { *self - *other } else { Self::zero() }
    }

    fn signum(&self) -> Self {
        Self(self.0.signum())
    }

    fn is_positive(&self) -> bool {
        *self > 0.0
    }

    fn is_negative(&self) -> bool {
        *self < 0.0
    }
}

impl Inv for DoubleDouble {
    type Output = Self;
    fn inv(self) -> Self {
        self.recip()
    }
}

impl Sum for DoubleDouble {
    fn sum<I: Iterator<Item = Self>>(numbers: I) -> Self {
        numbers.fold(Self::zero(), |sum, x| sum + x)
    }
}

impl Product for DoubleDouble {
    fn product<I: Iterator<Item = Self>>(numbers: I) -> Self {
        numbers.fold(Self::one(), |product, x| product * x)
    }
}

impl FromPrimitive for DoubleDouble {
    fn from_i64(n: i64) -> Option<Self> {
        Some(Self(TwoFloat::from(n)))
    }

    fn from_u64(n: u64) -> Option<Self> {
        Some(Self(TwoFloat::from(n)))
    }

    fn from_f64(x: f64) -> Option<Self> {
        Some(Self::from(x))
    }
}

impl DualStruct for DoubleDouble {
    type Real = f64;
    type Inner = Self;

    fn re(&self) -> f64 {
        self.0.hi()
    }

    fn from_inner(inner: &Self) -> Self {
        *inner
    }
}

impl Mappable<Self> for DoubleDouble {
    type Output<O> = O;
    fn map_dual<M: Fn(Self) -> O, O>(self, f: M) -> O {
        f(self)
    }
}

macro_rules! of_the_library {
    ($($function:ident),*) => {
        $(fn $function(&self) -> Self {
            Self(self.0.$function())
        })*
    };
}

impl DualNum for DoubleDouble {
    type Primitive = f64;
    const NDERIV: usize = 0;
    type InnerDual = Self;

    of_the_library!(
        sqrt, cbrt, exp, exp2, exp_m1, log2, log10, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, asinh, acosh,
        atanh
    );

    fn from_re(re: Self) -> Self {
        re
    }

    fn recip(&self) -> Self {
        Self::one() / *self
    }

    fn scale(self, factor: &Self) -> Self {
        self * factor
    }

    fn powi(&self, n: i32) -> Self {
        Self(self.0.powi(n))
    }

    fn powf(&self, n: f64) -> Self {
        Self(self.0.powf(TwoFloat::from(n)))
    }

    /// With x = 2ᵏ m, m between √½ and √2: k ln 2 + 2 artanh((m − 1)/(m + 1)); NaN for x ≤ 0.
    fn ln(&self) -> Self {
        let high = self.0.hi();
        if !(high > 0.0 && high.is_finite()) {
            return Self::from(if high == f64::INFINITY { high } else { f64::NAN });
        }
        let k = high.log2().round();
        // Two factors, so that neither overflows or underflows.
        let m = self.0 * (-(0.5 * k).floor()).exp2() * ((0.5 * k).floor() - k).exp2();
        Self(LN_2 * k + Self::twice_artanh(Self::quotient(m - 1.0, m + 1.0)))
    }

    /// 2 artanh(x/(2 + x)) near 0, where 1 + x would lose digits.
    fn ln_1p(&self) -> Self {
        if NEAR_ONE.contains(&self.0.hi()) {
            Self(Self::twice_artanh(Self::quotient(self.0, self.0 + 2.0)))
        } else {
            Self(self.0 + 1.0).ln()
        }
    }

    fn log(&self, base: f64) -> Self {
        self.ln() / Self::from(base).ln()
    }

    fn sin_cos(&self) -> (Self, Self) {
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }

    fn atan2(&self, other: Self) -> Self {
        Self(self.0.atan2(other.0))
    }

    fn sph_j0(&self) -> Self {
        if self.is_zero() { Self::one() } else { self.sin() / *self }
    }

    fn sph_j1(&self) -> Self {
        if self.is_zero() { *self } else { (self.sph_j0() - self.cos()) / *self }
    }

    fn sph_j2(&self) -> Self {
        if self.is_zero() { *self } else { self.sph_j1() / *self * 3.0 - self.sph_j0() }
    }
}
