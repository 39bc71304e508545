//! Programs of this package export their functions, so that a law finds the utility routines of Abaqus in the program that loads it.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_UNIX").is_ok() {
        println!("cargo::rustc-link-arg=-rdynamic");
    }
}
