//! False alarms and the smallest error seen, over seeded states of laws with consistent tangents.

mod cases;
mod laws;
mod tensor;

use cases::{Case, LAWS, case};
use tangent_check::finding::{Finding, Reason, Verdict};
use tangent_check::judge::check_columns;

fn check(case: &Case) -> Finding {
    check_columns(case.law, &case.claimed, &case.value, &mut |k, h| Ok((case.respond)(k, h)))
}

#[test]
#[ignore]
fn survey() {
    let states = std::env::var("STATES").ok().and_then(|n| n.parse().ok()).unwrap_or(250);
    for law in LAWS {
        let mut verdicts = [0; 4];
        let (mut kink, mut noisy, mut other) = (0, 0, 0);
        let mut controls = [[0usize; 14]; 2];
        let (mut calls, mut most) = (0, 0);
        let mut over = 0;
        let mut over = 0;
        let mut margin = 0.0_f64;
        let mut error = 0.0_f64;
        for number in 0..states {
            let case = case(law, number);
            let finding = check(&case);
            verdicts[finding.verdict as usize] += 1;
            match &finding.reason {
                Some(Reason::Kink) => kink += 1,
                Some(Reason::TooNoisy(_)) => noisy += 1,
                Some(reason) => {
                    other += 1;
                    println!("   {law} {number} {reason:?} kink {:?}", case.kink);
                }
                None => (),
            }
            if matches!(finding.verdict, Verdict::Wrong | Verdict::Inexact)
                || (finding.verdict == Verdict::NotChecked && case.kink.is_none())
            {
                println!(
                    "   {law} {number} {:?} {:?} kink {:?} worst {:?} dev {:e}",
                    finding.verdict, finding.reason, case.kink, finding.worst, finding.deviation
                );
            }
            if let Some(control) = finding.control {
                controls[usize::from(case.kink.is_some())][(-control.log10()).round() as usize] += 1;
            }
            if finding.verdict == Verdict::Consistent {
                error = error.max(finding.error);
                for i in 0..finding.claimed.entries.len() {
                    margin = margin.max(
                        (finding.claimed.entries[i] - finding.measured.entries[i]).abs() / finding.errors.entries[i],
                    );
                }
            }
            if finding.verdict == Verdict::Consistent && finding.worst.is_some() {
                let m = (0..finding.claimed.entries.len())
                    .map(|i| {
                        (finding.claimed.entries[i] - finding.measured.entries[i]).abs() / finding.errors.entries[i]
                    })
                    .fold(0.0, f64::max);
                if m > 3.0 {
                    println!("   Wrongish {law} {number} kink {:?} margin {m} {:?}", case.kink, finding.worst);
                }
            }
            over += usize::from(finding.calls > 300);
            over += usize::from(finding.calls > 300);
            calls += finding.calls;
            most = most.max(finding.calls);
        }
        println!(
            "{law:36} verdicts {verdicts:?} kink {kink} noisy {noisy} other {other} calls {} {most} {over} {over} margin {margin:.1} err {error:.0e} smooth {:?} kink {:?}",
            calls / states,
            &controls[0][3..],
            &controls[1][3..]
        );
    }
}

#[test]
#[ignore]
fn show() {
    use tangent_check::difference::{Ladder, derivative, noise};
    for (law, number, column, row) in [
        ("Drucker-Prager, small strain", 32, 1, 4),
        ("Drucker-Prager, P(F)", 136, 7, 0),
        ("Drucker-Prager apex, small strain", 10, 0, 5),
        ("J2 Voce, P(F)", 31, 2, 3),
    ] {
        let case = case(law, number);
        let mut f = |h: f64| Ok((case.respond)(column, h));
        let u = noise(&mut f, &case.value, Ladder::default()).unwrap();
        println!("{law} {number} value {:?} noise {u:?}", case.value);
        let d = derivative(&mut f, &case.value, &u, Ladder::default()).unwrap();
        println!("{d:?}");
        println!("claimed {}", case.claimed[(row, column)]);
        for i in 0..22 {
            let h = 0.04 * 0.5f64.powi(i);
            let (p, m) = (f(h).unwrap()[row], f(-h).unwrap()[row]);
            println!("{h:e} {} {} {}", (p - m) / 2.0 / h, (p - case.value[row]) / h, (case.value[row] - m) / h);
        }
    }
}

#[test]
#[ignore]
fn loose() {
    for tolerance in [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12] {
        let mut verdicts = [0; 4];
        let mut most = 0;
        let mut worst = 0.0_f64;
        for number in 0..250 {
            let mut random = tensor::Random(77 + 991 * number);
            let (law, strain) = cases::voce(&mut random, None, tolerance);
            let start = law.plastic_strain;
            let again = laws::Voce { plastic_strain: law.plastic_strain, ..law };
            let case = cases::small_strain("loose", None, law, strain);
            let finding = {
                use laws::Law;
                let change = tensor::combine(1.0, &strain, -1.0, &start);
                let mut along = |s: f64| {
                    Ok(tensor::PAIRS
                        .map(|(i, j)| again.respond(&tensor::combine(1.0, &start, s, &change)).0[i][j])
                        .to_vec())
                };
                let loading = tangent_check::judge::Loading { size: tensor::norm(&change), respond: &mut along };
                tangent_check::judge::check_columns_on(
                    "loose",
                    &case.claimed,
                    &case.value,
                    Default::default(),
                    &mut |k, h| Ok((case.respond)(k, h)),
                    Some(loading),
                )
            };
            verdicts[finding.verdict as usize] += 1;
            most = most.max(finding.calls);
            worst = worst.max(finding.deviation);
            if finding.verdict != Verdict::Consistent && finding.verdict != Verdict::Inexact {
                println!(
                    "   {tolerance:e} {number} {:?} {:?} dev {:e} err {:e} calls {} {:?}",
                    finding.verdict, finding.reason, finding.deviation, finding.error, finding.calls, finding.worst
                );
            }
        }
        println!("{tolerance:e} {verdicts:?} most {most} worst {worst:e}");
    }
}
