//! The messages of an error and of its causes, each once.

use std::error::Error;

/// The messages of an error and of its causes, outermost first. A message may already end with its cause, as in "cannot write a.csv: disk
/// full". The cause is then left out.
///
/// ```
/// use bfree::causes::{messages, on_one_line};
///
/// let error = bfree::scene::read_file("nowhere.json".as_ref(), &[]).unwrap_err();
/// // The message already ends with its cause, the message of the system.
/// assert_eq!(messages(&error).len(), 1);
/// assert!(on_one_line(&error).starts_with("cannot read nowhere.json: "));
/// ```
pub fn messages(error: &dyn Error) -> Vec<String> {
    let mut messages = vec![error.to_string()];
    let mut cause = error.source();
    while let Some(error) = cause {
        let message = error.to_string();
        if !messages.iter().any(|told| told.ends_with(&message)) {
            messages.push(message);
        }
        cause = error.source();
    }
    messages
}

/// The [`messages`] of an error on one line.
///
/// ```
/// use bfree::causes::{messages, on_one_line};
///
/// // A particle outside the box. The line says that the step failed, and why.
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let mut simulation = scene.build::<2>("scenes".as_ref())?;
/// simulation.particles.position[3][0] = -1.0;
/// let error = simulation.step().unwrap_err();
/// assert!(messages(&error).len() > 1);
/// assert!(on_one_line(&error).contains(": particle 3 has no shape functions: position [-1.0, "), "{}", on_one_line(&error));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn on_one_line(error: &dyn Error) -> String {
    messages(error).join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    enum Nested {
        #[error("{text}{}", source.as_ref().filter(|_| *telling).map_or(String::new(), |source| format!(": {source}")))]
        Level { text: &'static str, telling: bool, source: Option<Box<Nested>> },
    }

    fn level(text: &'static str, telling: bool, source: Option<Nested>) -> Nested {
        Nested::Level { text, telling, source: source.map(Box::new) }
    }

    #[test]
    fn every_cause_is_told_once_whether_or_not_the_message_holds_it() {
        for telling in [true, false] {
            let chain =
                level("cannot build", false, Some(level("cannot read a", telling, Some(level("gone", true, None)))));
            assert_eq!(on_one_line(&chain), "cannot build: cannot read a: gone");
        }
        let inner = level("cannot read a", true, Some(level("gone", true, None)));
        assert_eq!(messages(&level("cannot build", true, Some(inner))), ["cannot build: cannot read a: gone"]);
    }
}
