//! All faults in one program: every patched piece becomes a choice, made by an environment variable at run time.
//!
//! Untch, Offutt, Harrold, "Mutation analysis using mutant schemata", 1993: one build for all mutants.

use super::patches::Patch;

/// The environment variable with the number of the fault; without it, or with 0, the program is as shipped.
pub(super) const VARIABLE: &str = "BFREE_MUTANT";

/// The module added to the library, and the line that declares it.
pub(super) const MODULE: (&str, &str) = ("src/mutant.rs", "mod mutant;\n");

/// The source of the module.
pub(super) fn module() -> String {
    format!(
        "//! Which fault is on.\n\
         use std::sync::OnceLock;\n\
         static NUMBER: OnceLock<usize> = OnceLock::new();\n\
         pub(crate) fn on(number: usize) -> bool {{\n\
         \x20   *NUMBER.get_or_init(|| std::env::var(\"{VARIABLE}\").ok().and_then(|n| n.parse().ok()).unwrap_or(0)) == number\n\
         }}\n"
    )
}

/// A patch that does not fit its file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Misfit {
    #[error("the patch `{name}` looks for `{find}` in {file}, which holds it {count} times; it must be there once")]
    Count { name: &'static str, file: &'static str, find: &'static str, count: usize },
    #[error("the patches `{first}` and `{second}` overlap in {file}")]
    Overlap { first: &'static str, second: &'static str, file: &'static str },
}

/// The text of `file` with every patch of that file as a choice: `(if on(k) { fault } else { as shipped })`. Patch numbers start at 1.
///
/// # Errors
/// A piece does not occur exactly once, or pieces overlap.
pub(super) fn apply(file: &str, text: &str, patches: &[Patch]) -> Result<String, Misfit> {
    // Each distinct piece: its position, and its numbered patches.
    let mut pieces: Vec<(usize, Vec<(usize, &Patch)>)> = Vec::new();
    for (number, patch) in (1..).zip(patches).filter(|(_, patch)| patch.file == file) {
        let found: Vec<usize> = text.match_indices(patch.find).map(|(place, _)| place).collect();
        let &[place] = found.as_slice() else {
            let Patch { name, file, find, .. } = *patch;
            return Err(Misfit::Count { name, file, find, count: found.len() });
        };
        match pieces.iter_mut().find(|(other, list)| *other == place && list[0].1.find == patch.find) {
            Some((_, list)) => list.push((number, patch)),
            None => pieces.push((place, vec![(number, patch)])),
        }
    }
    pieces.sort_by_key(|(place, _)| *place);
    let mut out = String::new();
    let (mut done, mut before) = (0, "");
    for (place, list) in &pieces {
        let first = list[0].1;
        if *place < done {
            return Err(Misfit::Overlap { first: before, second: first.name, file: first.file });
        }
        let choices: String = list
            .iter()
            .map(|(number, patch)| format!("if crate::mutant::on({number}) {{ {} }} else ", patch.replace))
            .collect();
        let choice = format!("{choices}{{ {} }}", first.find);
        out += &text[done..*place];
        out += &if first.find.ends_with(';') { choice } else { format!("({choice})") };
        (done, before) = (place + first.find.len(), first.name);
    }
    out += &text[done..];
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::super::patches::Fate;
    use super::*;

    const fn patch(name: &'static str, find: &'static str, replace: &'static str) -> Patch {
        Patch { name, file: "a.rs", find, replace, fate: Fate::Equivalent("a test") }
    }

    #[test]
    fn patches_of_one_piece_share_a_choice_and_statements_stay_statements() {
        let patches = [patch("one", "b + c", "b - c"), patch("two", "b + c", "b"), patch("three", "go();", "stop();")];
        let text = apply("a.rs", "let a = 2 * (b + c); go();", &patches);
        let expected = "let a = 2 * ((if crate::mutant::on(1) { b - c } else if crate::mutant::on(2) { b } else { b + c })); \
                        if crate::mutant::on(3) { stop(); } else { go(); }";
        assert_eq!(text.as_deref(), Ok(expected));
        assert_eq!(apply("b.rs", "nothing", &patches).as_deref(), Ok("nothing"));
    }

    #[test]
    fn a_piece_that_is_gone_or_not_alone_is_named() {
        for (text, count) in [("d", 0), ("b + c, b + c", 2)] {
            let misfit = Misfit::Count { name: "one", file: "a.rs", find: "b + c", count };
            assert_eq!(apply("a.rs", text, &[patch("one", "b + c", "b")]), Err(misfit));
        }
        let overlapping = [patch("one", "b + c", "b"), patch("two", "c + d", "c")];
        let misfit = Misfit::Overlap { first: "one", second: "two", file: "a.rs" };
        assert_eq!(apply("a.rs", "b + c + d", &overlapping), Err(misfit));
    }
}
