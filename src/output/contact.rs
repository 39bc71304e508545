//! Contact of bodies that share nodes: its beginning and end, the gap, and whether the bodies are pulled apart.

use super::plot::rounded;
use crate::simulation::SharedNodes;
use serde::{Deserialize, Serialize};

/// Growth of the gap (in grid spacings) beyond which bodies that met during the run are pulled apart.
const MIN_OPENING: f64 = 0.1;

/// Two bodies that share nodes, or have shared nodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Names of the bodies.
    pub bodies: [String; 2],
    /// Time since when the bodies share nodes: the start of the run, if the bodies share nodes in the first step.
    pub since: f64,
    /// Whether the bodies share nodes since the start of the run.
    pub from_start: bool,
    /// Time since when the bodies no longer share nodes; `None` while they share nodes.
    pub until: Option<f64>,
    /// Smallest distance between the surfaces, in grid spacings: when the bodies began to share nodes, and in the last step with shared
    /// nodes. An overlap is negative. `None` from four spacings on.
    pub gap: [Option<f64>; 2],
    /// Time at which the bodies were first pulled apart but did not separate.
    pub pulled_apart: Option<f64>,
}

/// Adds a step that ended at `time` to the contacts of a run; `first` marks the first step of the run. Returns a sentence for each pair of
/// bodies that is now pulled apart for the first time.
pub(crate) fn see(
    contacts: &mut Vec<Contact>,
    time: f64,
    dt: f64,
    first: bool,
    shared_nodes: &[SharedNodes],
    names: &[&str],
) -> Vec<String> {
    let named = |shared_nodes: &SharedNodes| shared_nodes.bodies.map(|body| names[body as usize].to_owned());
    let is_over = |contact: &Contact| shared_nodes.iter().all(|one| named(one) != contact.bodies);
    for contact in contacts.iter_mut().filter(|contact| contact.until.is_none() && is_over(contact)) {
        contact.until = Some(time);
    }
    let mut said = Vec::new();
    for one in shared_nodes {
        let (bodies, gap) = (named(one), [one.gap; 2]);
        let known = contacts.iter().position(|contact| contact.until.is_none() && contact.bodies == bodies);
        let at = known.unwrap_or(contacts.len());
        if known.is_none() {
            let since = if first { time - dt } else { time };
            contacts.push(Contact { bodies, since, from_start: first, until: None, gap, pulled_apart: None });
        }
        let contact = &mut contacts[at];
        contact.gap[1] = one.gap;
        if contact.pulled_apart.is_none() && contact.is_pulled(one) {
            contact.pulled_apart = Some(time);
            said.push(contact.pulled_says(one));
        }
    }
    said
}

impl Contact {
    /// Whether a step pulls the bodies apart. Bodies that share nodes since the start are pulled apart by a tension. Bodies that met later
    /// are pulled apart if the gap exceeds the gap at their meeting by [`MIN_OPENING`].
    fn is_pulled(&self, now: &SharedNodes) -> bool {
        let opened = self.gap[0].zip(now.gap).is_some_and(|(met, gap)| gap > met + MIN_OPENING);
        if self.from_start { now.tension.is_some() } else { opened }
    }

    fn pulled_says(&self, now: &SharedNodes) -> String {
        let [a, b] = &self.bodies;
        let since = if self.from_start { "the start".to_owned() } else { format!("t = {}", rounded(self.since)) };
        let tension = now.tension.map_or_else(String::new, |tension| format!(" and a tension of {tension:.3e}"));
        format!(
            "bodies {a:?} and {b:?} share nodes since {since} and are pulled apart, at a gap of {}{tension}: while they share nodes they \
             move as one there, and will not separate; if they are not meant to be bonded, let them touch and part with the key \
             contact of the scene",
            spacings(now.gap)
        )
    }
}

/// A gap in words.
fn spacings(gap: Option<f64>) -> String {
    gap.map_or_else(|| "more than four spacings".to_owned(), |gap| format!("{:.2} spacings", gap.max(0.0)))
}

impl std::fmt::Display for Contact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { bodies: [a, b], since, until, gap: [_, gap], pulled_apart, .. } = self;
        let (gap, since) = (spacings(*gap), rounded(*since));
        match until.map(rounded) {
            None => write!(f, "{a:?} and {b:?} share nodes since t = {since}, at a gap of {gap}")?,
            Some(until) => {
                write!(f, "{a:?} and {b:?} shared nodes from t = {since} to {until}, at last at a gap of {gap}")?
            }
        }
        let Some(time) = pulled_apart else { return Ok(()) };
        write!(f, "; pulled apart at t = {}, they stuck together", rounded(*time))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_that_meet_and_leave_are_no_warning_and_bodies_that_are_held_are() {
        let shared_nodes = |gap: f64, tension: Option<f64>| [SharedNodes { bodies: [0, 1], gap: Some(gap), tension }];
        let names = ["a", "b"];
        let mut contacts = Vec::new();
        assert!(see(&mut contacts, 0.1, 0.1, true, &[], &names).is_empty() && contacts.is_empty());
        for (time, gap, tension) in [(0.2, 1.5, None), (0.3, 0.5, None), (0.4, 1.4, Some(1.0)), (0.5, 1.59, Some(1.0))]
        {
            assert!(see(&mut contacts, time, 0.1, false, &shared_nodes(gap, tension), &names).is_empty(), "{time}");
        }
        let said = see(&mut contacts, 0.6, 0.1, false, &shared_nodes(1.7, None), &names);
        assert!(
            matches!(&said[..], [one] if one.contains("since t = 0.2") && one.contains("1.70 spacings")),
            "{said:?}"
        );
        assert!(see(&mut contacts, 0.7, 0.1, false, &shared_nodes(1.9, None), &names).is_empty(), "once");
        assert!(see(&mut contacts, 0.8, 0.1, false, &[], &names).is_empty());
        let [contact] = &contacts[..] else { panic!("one: {contacts:?}") };
        assert_eq!((contact.until, contact.pulled_apart, contact.gap), (Some(0.8), Some(0.6), [Some(1.5), Some(1.9)]));
        // For bodies in contact since the start, a tension suffices.
        let mut bonded = Vec::new();
        assert!(see(&mut bonded, 0.1, 0.1, true, &shared_nodes(0.0, None), &names).is_empty());
        let said = see(&mut bonded, 0.2, 0.1, false, &shared_nodes(0.01, Some(2.0)), &names);
        assert!(matches!(&said[..], [one] if one.contains("since the start") && one.contains("2.000e0")), "{said:?}");
        assert_eq!(bonded[0].since, 0.0);
    }
}
