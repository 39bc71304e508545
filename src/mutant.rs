//! Deliberate faults. The study `mutants` switches on one fault at a time, and a check must then fail. A normal build has no faults.
//!
//! A fault stands at the place that it changes, so a refactoring moves the fault with the code. The right line stays as it is, and the line
//! below it holds the fault:
//!
//! - `mutant!("name": x = wrong);` gives the variable `x` another value.
//! - `mutant!("name": { statements });` runs statements, which may also leave the function.
//!
//! `verification/src/studies/mutants/table.rs` lists each name with the check that must fail.

#[cfg(not(feature = "mutants"))]
macro_rules! mutant {
    ($($fault:tt)*) => {};
}

#[cfg(feature = "mutants")]
macro_rules! mutant {
    ($name:literal: $variable:ident = $wrong:expr) => {
        let $variable = if mutant!(@is_on $name) { $wrong } else { $variable };
    };
    ($name:literal: { $($statements:tt)* }) => {
        if mutant!(@is_on $name) {
            $($statements)*
        }
    };
    // Each place remembers the answer, because some places are in the innermost loops.
    (@is_on $name:literal) => {{
        static IS_ON: std::sync::OnceLock<bool> = std::sync::OnceLock::new();
        *IS_ON.get_or_init(|| std::env::var("BFREE_MUTANT").is_ok_and(|chosen| chosen == $name))
    }};
}
