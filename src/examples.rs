//! Complete programs. Each states its subject and asserts a fact of mechanics. The tests run all of them.
//!
//! | | |
//! |---|---|
//! | [`scene_in_code`] | everything a JSON scene can say, as fields of a [`crate::simulation::Simulation`] |
//! | [`law_from_energy`] | your own law, from its energy alone |
//! | `examples/own_law` of the repository, a crate of its own | your own law with its analytic tangent, and the one line that checks it in your CI |
//! | [`own_shape_function`] | your own shape function |
//! | [`observer`] | the solver driven step by step |

macro_rules! shown {
    ($($name:ident: $file:literal),*) => {
        $(#[doc = concat!("`", $file, "`:\n\n```ignore\n", include_str!(concat!("../", $file)), "\n```")] pub mod $name {})*
    };
}

shown!(
    scene_in_code: "examples/scene_in_code.rs",
    law_from_energy: "examples/law_from_energy.rs",
    own_shape_function: "examples/own_shape_function.rs",
    observer: "examples/observer.rs"
);
