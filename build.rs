//! There is nothing to build: Cargo unifies the features in `build-dependencies` only for packages with a build script.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
}
