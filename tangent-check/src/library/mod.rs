//! Material laws from shared libraries: UMATs ([`umat`]), MFront's generic behaviours ([`mfront`]) and laws with our own C header ([`c`]).
//!
//! A [`Caller`] calls a law with buffers that it keeps. It exists in two kinds: [`open`] loads the library into this program, which is fast
//! and unprotected; [`child::Child`] calls it in a child process, which survives crashes and endless loops. [`LibraryLaw`] makes a [`Law`] of
//! either.

mod arena;
pub mod c;
pub mod child;
pub mod mfront;
pub mod umat;
mod utilities;

use std::path::PathBuf;

use crate::convention::{Components, Convention, Measure, Tensor};
use crate::law::{CallFailed, Law, Response, Step};
use crate::matrix::Matrix;
use crate::tensor::{product3, transposed};

/// A law in a shared library, and how to call it.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The file: `libmine.so`, `libmine.dylib`.
    pub library: PathBuf,
    /// The calling convention and its options.
    pub kind: Kind,
    /// The properties (PROPS) in the library's order and units.
    pub properties: Vec<f64>,
    /// Names of internal variables and their values in a body at rest. A UMAT needs all of them. The other kinds name theirs; values given
    /// here replace the library's.
    pub state: Vec<(String, f64)>,
    /// The components with which the law is called. A law with our C header is always three-dimensional; plane strain is F₃₃ = 1.
    pub stress_state: StressState,
}

/// The components of stress and strain that a law is called with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StressState {
    /// 11, 22, 33, 12, 13, 23: NTENS = 6 for a UMAT, hypothesis `Tridimensional` for MFront.
    #[default]
    Solid,
    /// 11, 22, 33, 12: NTENS = 4, hypothesis `PlaneStrain`. Axial symmetry has the same components.
    PlaneStrain,
    /// 11, 22, 12: NTENS = 3, σ₃₃ = 0. For UMATs alone.
    PlaneStress,
}

impl StressState {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Solid, Self::PlaneStrain, Self::PlaneStress];
}

/// The calling convention of a law.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// A user material of Abaqus/Standard.
    Umat {
        /// The name of the material (CMNAME), at most 80 characters.
        material: String,
        /// The meaning of DDSDDE: [`Measure::JaumannKirchhoff`] is Abaqus' for finite strain.
        tangent: Measure,
        /// The temperature (TEMP), constant; 0 if the law does not read it.
        temperature: f64,
    },
    /// A behaviour of MFront's interface `generic`.
    Mfront {
        /// The name of the behaviour.
        name: String,
        /// Names and values of external state variables. `Temperature` is 293.15 if it is not given.
        external: Vec<(String, f64)>,
    },
    /// A law with the header `bfree_law.h`.
    C {
        /// The name of the law.
        name: String,
    },
}

impl Kind {
    /// A UMAT with Abaqus' tangent for finite strain.
    pub fn umat() -> Self {
        Self::Umat { material: "BFREE".into(), tangent: Measure::JaumannKirchhoff, temperature: 0.0 }
    }
}

/// The interface of a loaded law: what its vectors mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Signature {
    /// The name of the law and its library, for reports.
    pub name: String,
    /// The meaning of stress and tangent.
    pub convention: Convention,
    /// The names of the properties; empty if the library does not tell.
    pub properties: Vec<String>,
    /// The names of the internal variables, one per number.
    pub state: Vec<String>,
    /// The internal variables of a body at rest.
    pub state_at_rest: Vec<f64>,
}

impl Signature {
    /// Whether a response has the sizes of the law.
    fn fits(&self, response: &Response) -> bool {
        let Convention { stress, strain, .. } = &self.convention;
        let [rows, columns] = [stress.count(), strain.count()];
        let Matrix { entries, .. } = &response.tangent;
        [response.stress.len(), response.tangent.rows, response.tangent.columns, entries.len(), response.state.len()]
            == [rows, rows, columns, rows * columns, self.state_at_rest.len()]
    }
}

/// A law that can be called with buffers of the caller.
pub trait Caller: Send {
    /// The interface of the law.
    fn signature(&self) -> &Signature;

    /// The response to a step. The vectors of `response` take the law's sizes; in this program, a response that is used again needs no new
    /// memory.
    ///
    /// # Errors
    /// A sentence that names the step: the law refused it, wrote outside its arrays, or answered with a number that is not finite. The
    /// response is then meaningless.
    fn call(&mut self, step: &Step, response: &mut Response) -> Result<(), CallFailed>;
}

/// Loads a library into this program. A crash, an endless loop or a STOP of the library is then one of this program; [`child::Child`] avoids
/// that.
///
/// # Errors
/// A sentence: no such file, not a shared library, another architecture, a missing symbol, a wrong number of properties.
pub fn open(description: &Description) -> Result<Box<dyn Caller>, CallFailed> {
    Ok(match description.kind {
        Kind::Umat { .. } => Box::new(umat::Umat::open(description)?),
        Kind::Mfront { .. } => Box::new(mfront::Behaviour::open(description)?),
        Kind::C { .. } => Box::new(c::CLaw::open(description)?),
    })
}

/// A law from a library, for the checker.
pub struct LibraryLaw {
    caller: Box<dyn Caller>,
}

impl LibraryLaw {
    /// The law that `caller` calls.
    pub fn new(caller: Box<dyn Caller>) -> Self {
        Self { caller }
    }

    /// The interface of the law.
    pub fn signature(&self) -> &Signature {
        self.caller.signature()
    }
}

impl Law for LibraryLaw {
    fn name(&self) -> String {
        self.caller.signature().name.clone()
    }

    fn convention(&self) -> Convention {
        self.caller.signature().convention.clone()
    }

    fn state_at_rest(&self) -> Vec<f64> {
        self.caller.signature().state_at_rest.clone()
    }

    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed> {
        let mut response = empty_response();
        self.caller.call(step, &mut response)?;
        Ok(response)
    }
}

/// A response without numbers, for [`Caller::call`].
pub fn empty_response() -> Response {
    Response { stress: Vec::new(), tangent: Matrix::zeros(0, 0), state: Vec::new() }
}

/// A failure with the step in which it happened.
fn failed(step: &Step, what: impl std::fmt::Display) -> CallFailed {
    let [a, b, c] = step.gradient;
    let [start, end] = [step.time, step.time + step.length];
    CallFailed(format!("Step {} from time {start} to {end} with F = [{a:.6?}, {b:.6?}, {c:.6?}]: {what}", step.number))
}

/// The name of a component for sentences: "12".
fn component((row, column): (usize, usize)) -> String {
    format!("{}{}", row + 1, column + 1)
}

/// Fails if a vector of the step has another size than the law's, or if a number is not finite.
fn check_input(step: &Step, signature: &Signature) -> Result<(), CallFailed> {
    let sizes = [
        ("stress", step.stress.len(), signature.convention.stress.pairs.len()),
        ("state", step.state.len(), signature.state_at_rest.len()),
    ];
    for (what, given, wanted) in sizes {
        if given != wanted {
            return Err(failed(step, format!("the {what} has {given} numbers, but the law needs {wanted}.")));
        }
    }
    let tensors = [&step.gradient_before, &step.gradient, &step.strain, &step.strain_increment, &step.rotation];
    let mut numbers = tensors.into_iter().flatten().flatten().chain(&step.stress).chain(&step.state);
    if !numbers.all(|number| number.is_finite()) || !step.time.is_finite() || !step.length.is_finite() {
        return Err(failed(step, "the input of the step holds a number that is not finite; the law was not called."));
    }
    Ok(())
}

/// Fails if a law for the plane is asked for shear out of its plane.
fn check_plane(step: &Step) -> Result<(), CallFailed> {
    let out_of_plane = [(0, 2), (1, 2), (2, 0), (2, 1)];
    let tensors = [&step.gradient_before, &step.gradient, &step.strain, &step.strain_increment];
    let shears = out_of_plane.iter().all(|&(row, column)| tensors.iter().all(|tensor| tensor[row][column] == 0.0));
    if shears { Ok(()) } else { Err(failed(step, "the law is for the plane, but the step shears out of it.")) }
}

/// Fails if the response holds a number that is not finite.
fn check_output(step: &Step, signature: &Signature, response: &Response) -> Result<(), CallFailed> {
    let Convention { stress, strain, .. } = &signature.convention;
    let not_finite = |numbers: &[f64]| numbers.iter().position(|number| !number.is_finite());
    let sentence = if let Some(row) = not_finite(&response.stress) {
        format!("component {} of the stress is {}.", component(stress.pairs[row]), response.stress[row])
    } else if let Some(place) = not_finite(&response.tangent.entries) {
        let [row, column] = [place / strain.pairs.len(), place % strain.pairs.len()];
        let [row, column] = [component(stress.pairs[row]), component(strain.pairs[column])];
        format!("entry ({row}, {column}) of the tangent is {}.", response.tangent.entries[place])
    } else if let Some(place) = not_finite(&response.state) {
        format!("the internal variable {} is {}.", signature.state[place], response.state[place])
    } else {
        return Ok(());
    };
    Err(failed(step, sentence))
}

/// Gives the response the law's sizes.
fn resize(response: &mut Response, signature: &Signature) {
    let Convention { stress, strain, .. } = &signature.convention;
    response.stress.resize(stress.pairs.len(), 0.0);
    response.state.resize(signature.state_at_rest.len(), 0.0);
    response.tangent.rows = stress.pairs.len();
    response.tangent.columns = strain.pairs.len();
    response.tangent.entries.resize(stress.pairs.len() * strain.pairs.len(), 0.0);
}

/// Writes the components of a symmetric tensor.
fn write_components(tensor: &Tensor, components: &Components, to: &mut [f64]) {
    for (k, number) in to.iter_mut().enumerate() {
        *number = components.factor(k) * tensor[components.pairs[k].0][components.pairs[k].1];
    }
}

/// Rotates the components of a symmetric tensor in place: R t Rᵀ.
fn rotate(vector: &mut [f64], components: &Components, rotation: &Tensor) {
    let tensor = components.symmetric_tensor(vector);
    write_components(&product3(rotation, &tensor, &transposed(rotation)), components, vector);
}

/// Values at rest: the library's, replaced by those of the description.
fn values_at_rest(description: &Description, names: &[String], mut values: Vec<f64>) -> Result<Vec<f64>, CallFailed> {
    for (name, value) in &description.state {
        let Some(place) = names.iter().position(|known| known == name) else {
            return Err(CallFailed(format!("The law has no internal variable `{name}`. It has: {}.", listed(names))));
        };
        values[place] = *value;
    }
    Ok(values)
}

/// Fails if the number of properties is not the library's.
fn check_properties(description: &Description, names: &[String]) -> Result<(), CallFailed> {
    let [given, wanted] = [description.properties.len(), names.len()];
    if given == wanted {
        return Ok(());
    }
    let library = description.library.display();
    Err(CallFailed(format!("{library}: {given} properties were given, but the law needs {wanted}: {}.", listed(names))))
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}
