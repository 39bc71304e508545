//! Steps of scenes are compiled here, once for each dimension.
//!
//! Rust compiles a generic function in every crate that calls it. The step is most of the program, and the tests, the studies and the Python
//! package would each spend minutes on it. So [`Simulation::attempt`] calls the functions of this file if the simulation is one of a scene.

use super::report::Spent;
use super::{Simulation, StepError, StepReport};
use std::any::Any;

type Step<const D: usize> = fn(&mut Simulation<D>, &mut Spent) -> Result<StepReport<D>, StepError>;

static STEP_1: Step<1> = Simulation::attempt_in_this_crate;
static STEP_2: Step<2> = Simulation::attempt_in_this_crate;
static STEP_3: Step<3> = Simulation::attempt_in_this_crate;

/// A step of a simulation of a scene, by the code that is compiled here. `None` for another type of simulation.
pub(super) fn step<const D: usize>(
    simulation: &mut dyn Any,
    spent: &mut Spent,
) -> Option<Result<StepReport<D>, StepError>> {
    match D {
        1 => as_type(STEP_1(simulation.downcast_mut()?, spent)),
        2 => as_type(STEP_2(simulation.downcast_mut()?, spent)),
        3 => as_type(STEP_3(simulation.downcast_mut()?, spent)),
        _ => None,
    }
}

/// `value`, if its type is `U`.
pub(crate) fn as_type<T: 'static, U: 'static>(value: T) -> Option<U> {
    let mut value = Some(value);
    (&mut value as &mut dyn Any).downcast_mut::<Option<U>>().and_then(Option::take)
}
