//! The table of all laws: verdicts, calls, and the part of planted errors that is seen.

use crate::cases::{Case, LAWS, case};
use crate::tensor::Random;
use crate::{check, states};
use tangent_check::difference::Ladder;
use tangent_check::finding::{Reason, Verdict};
use tangent_check::judge::{Measured, judge, measure};
use tangent_check::matrix::Matrix;

/// Planted errors are 10⁻ᵏ of a component, for these k.
const EXPONENTS: std::ops::RangeInclusive<i32> = 5..=10;

/// The errors planted in components of one kind: how many, how many seen, how many called wrong, for each k.
#[derive(Default)]
struct Planted {
    counts: [[usize; 3]; 6],
}

impl Planted {
    /// Spoils some of the components with sizes between `low` and `high` of ‖C‖, one at a time.
    fn plant(&mut self, case: &Case, measured: &Measured, low: f64, high: f64, random: &mut Random) {
        let scale = case.claimed.greatest();
        let eligible: Vec<usize> = (0..case.claimed.entries.len())
            .filter(|m| (low..=high).contains(&(case.claimed.entries[*m].abs() / scale)))
            .collect();
        if eligible.is_empty() {
            return;
        }
        for _ in 0..6 {
            let m = eligible[(random.unit() * eligible.len() as f64) as usize];
            let sign = if random.unit() < 0.5 { -1.0 } else { 1.0 };
            for (counts, exponent) in self.counts.iter_mut().zip(EXPONENTS) {
                let mut claimed: Matrix = case.claimed.clone();
                claimed.entries[m] *= 1.0 + sign * 10.0_f64.powi(-exponent);
                let verdict = judge(case.law, &claimed, measured).verdict;
                counts[0] += 1;
                counts[1] += usize::from(verdict != Verdict::Consistent);
                counts[2] += usize::from(verdict == Verdict::Wrong);
            }
        }
    }

    /// The part seen of the errors 10⁻ᵏ; 1 if none was planted.
    fn seen(&self, exponent: i32) -> f64 {
        let [planted, seen, _] = self.counts[(exponent - EXPONENTS.start()) as usize];
        if planted == 0 { 1.0 } else { seen as f64 / planted as f64 }
    }

    /// "seen (called wrong)" in percent, for each k.
    fn row(&self) -> String {
        let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let cells = self.counts.iter().map(|[planted, seen, wrong]| {
            if *planted == 0 {
                "            -".into()
            } else {
                format!("{:5.1} ({:5.1})", percent(*seen, *planted), percent(*wrong, *planted))
            }
        });
        cells.collect::<Vec<String>>().join(" ")
    }
}

#[test]
fn table_of_false_alarms_and_planted_errors() {
    println!("one component spoiled by 10^-k: % seen (% called wrong), k = 5, 6, 7, 8, 9, 10");
    for law in LAWS {
        let plastic = law.contains("J2") || law.contains("Drucker");
        let [mut away, mut near, mut small] = [Planted::default(), Planted::default(), Planted::default()];
        let mut verdicts = [0; 4];
        let (mut calls, mut most_calls) = (0, 0);
        let (mut ratio, mut control) = (0.0_f64, 0.0_f64);
        for number in 0..states() {
            let case = case(law, number);
            let finding = check(&case);
            verdicts[finding.verdict as usize] += 1;
            calls += finding.calls;
            most_calls = most_calls.max(finding.calls);
            let kink_alone = finding.reason == Some(Reason::Kink) && case.kink.is_some();
            assert!(finding.verdict == Verdict::Consistent || kink_alone, "{law}, state {number}: {finding:?}");
            assert!(finding.calls <= 300, "{law}, state {number}: {} calls", finding.calls);
            if finding.verdict != Verdict::Consistent {
                continue;
            }
            control = control.max(finding.control.unwrap_or(1.0));
            let entries = finding.claimed.entries.iter().zip(&finding.measured.entries).zip(&finding.errors.entries);
            ratio = entries
                .fold(ratio, |ratio, ((claimed, measured), error)| ratio.max((claimed - measured).abs() / error));
            let ladder = if case.claimed.columns > 6 { Ladder::coarse() } else { Ladder::default() };
            let mut f = |k: usize, h: f64| Ok((case.respond)(k, h));
            let measured = measure(&case.claimed, &case.value, ladder, &mut f).expect("the law answers");
            let mut random = Random(number as u64);
            let large = if case.kink.is_some() && plastic { &mut near } else { &mut away };
            large.plant(&case, &measured, 0.01, 1.0, &mut random);
            if case.kink.is_none() {
                small.plant(&case, &measured, 1e-6, 1e-3, &mut random);
            }
        }
        println!(
            "{law:34} consistent {:3} inexact {} not checked {} wrong {} | calls {:3}, at most {most_calls} | true error at most {ratio:.1} e \
             | control {control:.0e} or smaller",
            verdicts[0],
            verdicts[1],
            verdicts[2],
            verdicts[3],
            calls / states()
        );
        println!("    > 1 % of |C|                 {}", away.row());
        println!("    > 1 % of |C|, next to a kink {}", near.row());
        println!("    1e-6 to 1e-3 of |C|          {}", small.row());
        // Nine columns are measured on the coarse ladder.
        let exponent = match (plastic, case(law, 0).claimed.columns) {
            (false, _) => 9,
            (true, 6) => 7,
            (true, _) => 6,
        };
        assert_eq!(away.seen(exponent), 1.0, "{law}: 1e-{exponent} in components above 1 %");
        assert_eq!(near.seen(6), 1.0, "{law}: 1e-6 next to kinks");
        if case(law, 0).claimed.columns == 6 {
            assert_eq!(small.seen(6), 1.0, "{law}: 1e-6 in small components");
        }
    }
}

/// At most one state in ten thousand, so none of a few. `STATES=20000 cargo test --release -p tangent-check --test numerics false_alarms`
/// takes two minutes.
#[test]
fn false_alarms_are_rarer_than_one_in_ten_thousand() {
    /// The first state: other states than those of the table.
    const FIRST: usize = 20_000;
    for law in LAWS.into_iter().filter(|law| law.contains("J2") || law.contains("Drucker")) {
        let mut verdicts = [0; 4];
        for number in 0..states() {
            verdicts[check(&case(law, FIRST + number)).verdict as usize] += 1;
        }
        println!("{law}: consistent, inexact, not checked, wrong: {verdicts:?}");
        assert!(10_000 * verdicts[Verdict::Wrong as usize] <= states(), "{law}");
    }
}
