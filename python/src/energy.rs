//! An energy written in Python, called once: what it does to its strain is recorded, and what was recorded is evaluated with any number,
//! without Python.

use bfree::material::Energy;
use bfree::scalar::Real;
use bfree::tensor::Tensor;
use num_traits::NumCast;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Operations of an energy, at most: one that has more was meant to be something else, such as a loop that never ends.
const MOST: usize = 100_000;

/// A function of one number.
#[derive(Clone, Copy, Debug)]
enum Function {
    Negative,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Sinh,
    Cosh,
    Tanh,
    Arctan,
}

/// One operation on what came before it, by number.
#[derive(Clone, Copy, Debug)]
enum Operation {
    /// E_ik
    Strain(usize, usize),
    Constant(f64),
    Sum(usize, usize),
    Difference(usize, usize),
    Product(usize, usize),
    Quotient(usize, usize),
    Integer(usize, i32),
    Power(usize, f64),
    Of(Function, usize),
}

type Tape = Arc<Mutex<Vec<Operation>>>;

/// The list after a panic of another thread: it only grows, so it is as good as before.
fn held(tape: &Tape) -> MutexGuard<'_, Vec<Operation>> {
    tape.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A number of which an energy is made: it has no value, and remembers what it was made from.
#[pyclass(frozen, module = "bfree")]
pub struct Number {
    tape: Tape,
    at: usize,
}

/// Another number, or a constant.
#[derive(FromPyObject)]
pub enum Operand<'py> {
    Recorded(Bound<'py, Number>),
    Constant(f64),
}

impl Number {
    fn record(tape: &Tape, operation: Operation) -> PyResult<Self> {
        let mut list = held(tape);
        if list.len() == MOST {
            return Err(PyValueError::new_err(format!("an energy has at most {MOST} operations")));
        }
        list.push(operation);
        Ok(Self { tape: tape.clone(), at: list.len() - 1 })
    }

    fn operand(&self, other: &Operand<'_>) -> PyResult<usize> {
        match other {
            Operand::Constant(x) => Ok(Self::record(&self.tape, Operation::Constant(*x))?.at),
            Operand::Recorded(other) if Arc::ptr_eq(&self.tape, &other.get().tape) => Ok(other.get().at),
            Operand::Recorded(_) => Err(PyValueError::new_err("a strain of another call of the energy")),
        }
    }

    fn with(&self, other: &Operand<'_>, make: impl Fn(usize, usize) -> Operation) -> PyResult<Self> {
        let other = self.operand(other)?;
        Self::record(&self.tape, make(self.at, other))
    }

    fn of(&self, function: Function) -> PyResult<Self> {
        Self::record(&self.tape, Operation::Of(function, self.at))
    }

    fn valueless() -> PyErr {
        PyTypeError::new_err(
            "the strain of an energy has no value: it is recorded once, for all strains; use no branches, no comparisons and no float(), \
             and NumPy's functions in place of those of math",
        )
    }
}

/// NumPy calls methods by the names of its functions where an array holds objects.
#[pymethods]
impl Number {
    fn __add__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, Operation::Sum)
    }
    fn __radd__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, Operation::Sum)
    }
    fn __sub__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, Operation::Difference)
    }
    fn __rsub__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, |this, other| Operation::Difference(other, this))
    }
    fn __mul__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, Operation::Product)
    }
    fn __rmul__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, Operation::Product)
    }
    fn __truediv__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, Operation::Quotient)
    }
    fn __rtruediv__(&self, other: Operand<'_>) -> PyResult<Self> {
        self.with(&other, |this, other| Operation::Quotient(other, this))
    }
    fn __pow__(&self, exponent: Operand<'_>, modulo: Option<Bound<'_, PyAny>>) -> PyResult<Self> {
        match exponent {
            _ if modulo.is_some() => Err(PyTypeError::new_err("a power modulo something")),
            Operand::Constant(x) if x.fract() == 0.0 && x.abs() < 1e9 => {
                Self::record(&self.tape, Operation::Integer(self.at, x as i32))
            }
            Operand::Constant(x) => Self::record(&self.tape, Operation::Power(self.at, x)),
            // aᵇ = exp(b ln a)
            Operand::Recorded(_) => {
                let product = self.of(Function::Ln)?.with(&exponent, Operation::Product)?;
                product.of(Function::Exp)
            }
        }
    }
    fn __rpow__(&self, base: f64, modulo: Option<Bound<'_, PyAny>>) -> PyResult<Self> {
        match modulo {
            Some(_) => Err(PyTypeError::new_err("a power modulo something")),
            None => self.with(&Operand::Constant(base.ln()), Operation::Product)?.of(Function::Exp),
        }
    }
    fn __neg__(&self) -> PyResult<Self> {
        self.of(Function::Negative)
    }
    fn __pos__(this: Py<Self>) -> Py<Self> {
        this
    }
    fn sqrt(&self) -> PyResult<Self> {
        self.of(Function::Sqrt)
    }
    fn exp(&self) -> PyResult<Self> {
        self.of(Function::Exp)
    }
    fn log(&self) -> PyResult<Self> {
        self.of(Function::Ln)
    }
    fn sin(&self) -> PyResult<Self> {
        self.of(Function::Sin)
    }
    fn cos(&self) -> PyResult<Self> {
        self.of(Function::Cos)
    }
    fn tan(&self) -> PyResult<Self> {
        self.of(Function::Tan)
    }
    fn sinh(&self) -> PyResult<Self> {
        self.of(Function::Sinh)
    }
    fn cosh(&self) -> PyResult<Self> {
        self.of(Function::Cosh)
    }
    fn tanh(&self) -> PyResult<Self> {
        self.of(Function::Tanh)
    }
    fn arctan(&self) -> PyResult<Self> {
        self.of(Function::Arctan)
    }
    fn __richcmp__(&self, _other: Bound<'_, PyAny>, _how: pyo3::basic::CompareOp) -> PyResult<bool> {
        Err(Self::valueless())
    }
    fn __bool__(&self) -> PyResult<bool> {
        Err(Self::valueless())
    }
    fn __float__(&self) -> PyResult<f64> {
        Err(Self::valueless())
    }
    fn __abs__(&self) -> PyResult<Self> {
        Err(PyTypeError::new_err(
            "abs() has a kink: an energy needs two derivatives; write (x*x)**0.5 if x is never zero",
        ))
    }
    fn __repr__(&self) -> String {
        format!("<number {} of an energy>", self.at)
    }
}

/// The determinant of a 3×3 array of numbers, recorded ones too.
#[pyfunction]
pub fn det<'py>(a: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let entry = |i: usize, k: usize| a.get_item(i)?.get_item(k % 3);
    let mut sum: Option<Bound<'py, PyAny>> = None;
    for k in 0..3 {
        // a₀ₖ (a₁ₖ₊₁ a₂ₖ₊₂ − a₁ₖ₊₂ a₂ₖ₊₁)
        let minor = entry(1, k + 1)?.mul(entry(2, k + 2)?)?.sub(entry(1, k + 2)?.mul(entry(2, k + 1)?)?)?;
        let term = entry(0, k)?.mul(minor)?;
        sum = Some(match sum {
            Some(sum) => sum.add(term)?,
            None => term,
        });
    }
    sum.ok_or_else(|| PyValueError::new_err("no determinant"))
}

/// The error of an energy's call; that of a function of NumPy that needs numbers says what to take in its place.
fn explained(py: Python<'_>, error: PyErr) -> PyErr {
    if !error.value(py).to_string().contains("Cannot cast ufunc") {
        return error;
    }
    let clear = PyTypeError::new_err(format!(
        "np.linalg needs numbers, and the strain of an energy has no value: take bfree.det(E) in place of np.linalg.det(E), and write other \
         functions of np.linalg by arithmetic ({})",
        error.value(py)
    ));
    clear.set_cause(py, Some(error));
    clear
}

/// The operations of an energy on its strain.
#[derive(Clone, Debug)]
pub struct Recorded {
    operations: Arc<[Operation]>,
    /// The number of the result.
    result: usize,
}

impl Recorded {
    /// Calls `energy` with a 3×3 array of recorded strains.
    pub fn call(energy: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = energy.py();
        let tape: Tape = Arc::default();
        // The array is symmetric, with the same numbers on both sides of its diagonal.
        let mut strain: Vec<Vec<Py<Number>>> = Vec::new();
        for i in 0..3 {
            let mut row = Vec::new();
            for k in 0..3 {
                row.push(match strain.get(k).filter(|_| k < i).and_then(|above| above.get(i)) {
                    Some(same) => same.clone_ref(py),
                    None => Py::new(py, Number::record(&tape, Operation::Strain(i, k))?)?,
                });
            }
            strain.push(row);
        }
        let array = py.import("numpy")?.call_method1("array", (strain,))?;
        let result = energy.call1((array,)).map_err(|error| explained(py, error))?;
        let number = match result.extract::<Operand<'_>>() {
            Ok(Operand::Recorded(number)) => number,
            _ => {
                let message = "an energy returns one number made from the strain, and this one returned";
                return Err(PyTypeError::new_err(format!("{message} {}", result.repr()?)));
            }
        };
        if !Arc::ptr_eq(&tape, &number.get().tape) {
            return Err(PyValueError::new_err("a strain of another call of the energy"));
        }
        let operations = held(&tape).as_slice().into();
        Ok(Self { operations, result: number.get().at })
    }

    /// How many operations it has.
    pub fn len(&self) -> usize {
        self.operations.len()
    }
}

impl Energy for Recorded {
    fn energy<T: Real>(&self, e: &Tensor<T, 3>) -> T {
        let mut values: Vec<T> = Vec::with_capacity(self.operations.len());
        for operation in &*self.operations {
            let of = |i: usize| values[i];
            values.push(match *operation {
                // The derivative of W by a component off the diagonal, of which E has two, sees both.
                Operation::Strain(i, k) if i == k => e[(i, k)],
                Operation::Strain(i, k) => (e[(i, k)] + e[(k, i)]) * T::lit(0.5),
                Operation::Constant(x) => T::lit(x),
                Operation::Sum(a, b) => of(a) + of(b),
                Operation::Difference(a, b) => of(a) - of(b),
                Operation::Product(a, b) => of(a) * of(b),
                Operation::Quotient(a, b) => of(a) / of(b),
                Operation::Integer(a, n) => of(a).powi(n),
                // A cast between floats always succeeds; the other branch is never taken.
                Operation::Power(a, x) => NumCast::from(x).map_or(T::lit(f64::NAN), |x| of(a).powf(x)),
                Operation::Of(function, a) => match function {
                    Function::Negative => -of(a),
                    Function::Sqrt => of(a).sqrt(),
                    Function::Exp => of(a).exp(),
                    Function::Ln => of(a).ln(),
                    Function::Sin => of(a).sin(),
                    Function::Cos => of(a).cos(),
                    Function::Tan => of(a).tan(),
                    Function::Sinh => of(a).sinh(),
                    Function::Cosh => of(a).cosh(),
                    Function::Tanh => of(a).tanh(),
                    Function::Arctan => of(a).atan(),
                },
            });
        }
        values[self.result]
    }
}
