//! Programs that load laws export the utility routines of Abaqus, so that a law finds them there. They export nothing else: the linker keeps whatever
//! is exported, and its name.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let list = concat!(env!("CARGO_MANIFEST_DIR"), "/src/library/utilities.list");
    println!("cargo::rerun-if-changed={list}");
    let is = |variable| std::env::var(variable).is_ok();
    let argument = match (is("CARGO_CFG_UNIX"), std::env::var("CARGO_CFG_TARGET_VENDOR").as_deref()) {
        (false, _) => return,
        (true, Ok("apple")) => "-rdynamic".to_string(),
        (true, _) => format!("-Wl,--dynamic-list={list}"),
    };
    println!("cargo::rustc-link-arg={argument}");
    // For the build scripts of packages whose programs load laws, too.
    println!("cargo::metadata=LINK_ARGUMENT={argument}");
}
