//! Steps of scenes are compiled here, once for each dimension.
//!
//! Rust compiles a generic function in every crate that calls it. The step is most of the program, and the tests, the studies and the Python
//! package would each spend minutes on it. So [`Simulation::step`] calls the functions of this file if the simulation is one of a scene.

use super::report::Spent;
use super::{Simulation, StepError, StepReport};
use crate::approximation::ShapeFunction;
use crate::material::Law;
use std::any::Any;

type Step<const D: usize> = fn(&mut Simulation<D>, &mut Spent) -> Result<StepReport<D>, StepError>;

static STEP_1: Step<1> = Simulation::attempt_in_this_crate;
static STEP_2: Step<2> = Simulation::attempt_in_this_crate;
static STEP_3: Step<3> = Simulation::attempt_in_this_crate;

/// A step, by the code that is compiled here if the simulation is one of a scene. `spent` counts the work, also if the step fails.
pub(super) fn attempt<const D: usize, L: Law + 'static, A: ShapeFunction + 'static>(
    simulation: &mut Simulation<D, L, A>,
    spent: &mut Spent,
) -> Result<StepReport<D>, StepError> {
    // The compiler leaves the other branch away. Unit tests need one dimension or two, and not the steps of all.
    if const { L::IN_SCENES && A::IN_SCENES && D <= 3 && !cfg!(test) } {
        let simulation: &mut dyn Any = simulation;
        let done = match D {
            1 => simulation.downcast_mut().and_then(|one| as_type(STEP_1(one, spent))),
            2 => simulation.downcast_mut().and_then(|one| as_type(STEP_2(one, spent))),
            _ => simulation.downcast_mut().and_then(|one| as_type(STEP_3(one, spent))),
        };
        done.unwrap_or_else(|| unreachable!("this is the simulation of a scene"))
    } else {
        simulation.attempt_in_this_crate(spent)
    }
}

/// `value`, if its type is `U`.
pub(crate) fn as_type<T: 'static, U: 'static>(value: T) -> Option<U> {
    let mut value = Some(value);
    (&mut value as &mut dyn Any).downcast_mut::<Option<U>>().and_then(Option::take)
}
