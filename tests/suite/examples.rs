//! The programs of `examples/`, as modules: their generic code is compiled together with the rest of the tests.

use crate::support::Failure;

#[path = "../../examples/law_from_energy.rs"]
mod law_from_energy;
#[path = "../../examples/observer.rs"]
mod observer;
#[path = "../../examples/own_shape_function.rs"]
mod own_shape_function;
#[path = "../../examples/scene_in_code.rs"]
mod scene_in_code;

#[test]
fn examples_run() -> Result<(), Failure> {
    law_from_energy::main()?;
    observer::main()?;
    own_shape_function::main()?;
    scene_in_code::main()
}
