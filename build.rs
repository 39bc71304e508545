//! Programs of this package export the utility routines of Abaqus, as those of tangent-check do, so that a law finds them in the program that loads
//! it. Cargo also unifies the features in `build-dependencies` only for packages with a build script.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if let Ok(argument) = std::env::var("DEP_TANGENT_CHECK_LINK_ARGUMENT") {
        println!("cargo::rustc-link-arg={argument}");
    }
}
