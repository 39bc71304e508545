//! A law as a black box.

use crate::convention::{Convention, Tensor};
use crate::matrix::Matrix;
use crate::tensor::{IDENTITY, ZERO};

/// The inputs of a law in one step, in the words of Abaqus. A law reads what it needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Time at the start of the step.
    pub time: f64,
    /// The length Δt of the step.
    pub length: f64,
    /// The number of the step, from 1.
    pub number: usize,
    /// F at the start of the step (DFGRD0).
    pub gradient_before: Tensor,
    /// F at the end of the step (DFGRD1).
    pub gradient: Tensor,
    /// The strain at the start of the step (STRAN), a tensor (no engineering shears), rotated by `rotation`.
    pub strain: Tensor,
    /// The strain increment (DSTRAN), a tensor: the logarithm of the incremental stretch.
    pub strain_increment: Tensor,
    /// The rotation increment (DROT).
    pub rotation: Tensor,
    /// The stress at the start of the step, in the law's components, as the law returned it.
    pub stress: Vec<f64>,
    /// The internal variables at the start of the step (STATEV).
    pub state: Vec<f64>,
}

impl Step {
    /// The first step of a body that stays at rest, in no time, without stress and internal variables.
    pub fn at_rest() -> Self {
        Self {
            time: 0.0,
            length: 0.0,
            number: 1,
            gradient_before: IDENTITY,
            gradient: IDENTITY,
            strain: ZERO,
            strain_increment: ZERO,
            rotation: IDENTITY,
            stress: Vec::new(),
            state: Vec::new(),
        }
    }
}

/// The answer of a law.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// The stress in the components of the law's convention.
    pub stress: Vec<f64>,
    /// The claimed tangent.
    pub tangent: Matrix,
    /// The internal variables at the end of the step.
    pub state: Vec<f64>,
}

/// A call that gave no answer: a sentence that says what happened.
#[derive(Clone, Debug, PartialEq)]
pub struct CallFailed(pub String);

/// A law that can be called.
pub trait Law {
    /// A name for reports.
    fn name(&self) -> String;

    /// The meaning of its stress and tangent.
    fn convention(&self) -> Convention;

    /// The internal variables of a body at rest.
    fn state_at_rest(&self) -> Vec<f64>;

    /// The response to a step. Calls are independent: the same step gives the same response, whatever was called before.
    ///
    /// # Errors
    /// The call failed.
    fn respond(&mut self, step: &Step) -> Result<Response, CallFailed>;

    /// The stress of the response to a step. A law whose tangent costs a call of its own leaves it out here: differences need no tangent.
    ///
    /// # Errors
    /// The call failed.
    fn stress(&mut self, step: &Step) -> Result<Vec<f64>, CallFailed> {
        Ok(self.respond(step)?.stress)
    }
}
