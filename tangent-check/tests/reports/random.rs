//! Promises of every format, on random reports with names and numbers of any kind.

use super::{NASTY, options, report, wrong};
use serde_json::Value;
use std::collections::BTreeSet;
use tangent_check::finding::{Diagnosis, Entry, Finding, Reason, Report, Verdict};
use tangent_check::matrix::Matrix;
use tangent_check::report::{Format, Options, write};
use tangent_check::states;

/// Random parts of reports.
struct Random(states::Random);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        (self.0.between(0.0, bound as f64) as usize).min(bound - 1)
    }

    fn number(&mut self) -> f64 {
        let special = [0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE, 5e-324];
        let value = f64::from_bits((self.below(1 << 32) as u64) << 32);
        special.get(self.below(12)).copied().unwrap_or(value)
    }

    fn text(&mut self) -> String {
        let nasty: Vec<char> = NASTY.chars().collect();
        (0..self.below(150)).map(|_| nasty[self.below(nasty.len())]).collect()
    }

    /// A matrix whose sizes need not fit its entries.
    fn matrix(&mut self) -> Matrix {
        let entries = (0..self.below(7)).map(|_| self.number()).collect();
        Matrix { rows: self.below(4), columns: self.below(4), entries }
    }

    fn finding(&mut self, verdicts: &[Verdict]) -> Finding {
        let reasons = [
            Reason::ForwardDifference(self.number()),
            Reason::SinglePrecision,
            Reason::LocalIteration(self.number()),
            Reason::Kink,
            Reason::NothingExercised,
            Reason::ZeroResponse,
            Reason::TooNoisy(self.number()),
            Reason::ControlMissed(self.number()),
            Reason::CallFailed(self.text()),
        ];
        let entry = Entry {
            row: self.below(3),
            column: usize::MAX * self.below(2),
            claimed: self.number(),
            measured: self.number(),
            error: self.number(),
        };
        Finding {
            name: self.text(),
            verdict: verdicts[self.below(verdicts.len())],
            reason: reasons.get(self.below(10)).cloned(),
            worst: [Some(entry), None][self.below(2)],
            deviation: self.number(),
            error: self.number(),
            noise: self.number(),
            control: [Some(self.number()), None][self.below(2)],
            calls: [self.below(400), usize::MAX][self.below(2)],
            claimed: self.matrix(),
            measured: self.matrix(),
            errors: self.matrix(),
        }
    }

    /// A report with few kinds of verdicts, so that all verdicts over the whole occur.
    fn report(&mut self) -> Report {
        let all = [Verdict::Consistent, Verdict::Inexact, Verdict::NotChecked, Verdict::Wrong];
        let verdicts = [all[self.below(4)], all[self.below(3)]];
        let diagnosis = Diagnosis {
            sentence: self.text(),
            candidates: vec![self.text(); self.below(3)],
            states_that_tell: vec![self.text(); self.below(2)],
            coefficient: [Some(self.number()), None][self.below(2)],
            share: self.number(),
        };
        let mut report = report((0..self.below(30)).map(|_| self.finding(&verdicts)).collect());
        report.subject = self.text();
        report.convention = self.text();
        report.rows = vec![self.text(); self.below(3)];
        report.diagnoses = vec![diagnosis; self.below(2)];
        report.notes = vec![self.text(); self.below(2)];
        report
    }
}

/// Random reports with all combinations of options.
fn random_reports() -> impl Iterator<Item = (Report, Options)> {
    let mut random = Random(states::Random::new(37));
    (0..400).map(move |_| {
        let options =
            Options { file: [Some(random.text()), None][random.below(2)].clone(), allow_inexact: random.below(2) == 0 };
        (random.report(), options)
    })
}

#[test]
fn all_formats_fail_together() {
    let mut codes = BTreeSet::new();
    for (report, options) in random_reports() {
        let code = report.exit_code(&options);
        codes.insert(code);
        let failed = code != 0;
        let junit = write(&report, Format::Junit, &options);
        assert_eq!(junit.contains("<failure "), failed, "{junit}");
        assert_eq!(!junit.contains(" failures=\"0\""), failed, "{junit}");
        assert_eq!(write(&report, Format::Github, &options).contains("::error "), failed);
        let sarif: Value = serde_json::from_str(&write(&report, Format::Sarif, &options)).expect("SARIF is JSON");
        let results = sarif["runs"][0]["results"].as_array().expect("there are results");
        assert_eq!(results.iter().any(|result| result["level"] == "error"), failed);
        let json: Value = serde_json::from_str(&write(&report, Format::Json, &options)).expect("JSON");
        assert_eq!(json["exit_code"], code);
    }
    assert_eq!(codes, BTreeSet::from([0, 1, 2]));
}

#[test]
fn the_terminal_gets_short_lines_without_control_characters() {
    for (report, options) in random_reports() {
        let text = write(&report, Format::Terminal, &options);
        for line in text.lines() {
            assert!(line.chars().count() <= 100, "{line}");
            assert!(!line.chars().any(char::is_control), "{line:?}");
        }
        assert!(!text.contains("\n\n\n"), "{text}");
    }
}

/// Reads XML without comments and sections, and gives the texts of attributes and elements. Panics if the XML is not well-formed.
fn xml_texts(xml: &str) -> Vec<String> {
    let body = xml.strip_prefix("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n").expect("a declaration");
    let mut open = Vec::new();
    let mut texts = Vec::new();
    for piece in body.trim_end().split('<').skip(1) {
        let (tag, text) = piece.split_once('>').expect("a tag ends");
        assert!(!text.contains('>'), "{text}");
        texts.push(unescaped(text));
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "elements nest");
            continue;
        }
        let (name, attributes) = tag.split_once(' ').unwrap_or((tag.trim_end_matches('/'), ""));
        if !tag.ends_with('/') {
            open.push(name);
        }
        let quoted: Vec<&str> = attributes.split('"').collect();
        assert_eq!(quoted.len() % 2, 1, "{attributes}");
        texts.extend(quoted.iter().skip(1).step_by(2).map(|value| unescaped(value)));
    }
    assert!(open.is_empty());
    texts
}

fn unescaped(text: &str) -> String {
    let allowed = |character: char| !character.is_control() && !('\u{fffe}'..='\u{ffff}').contains(&character);
    let mut plain = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        if first != '&' {
            assert!(allowed(first) || first == '\n', "{first:?}");
            plain.push(first);
            rest = &rest[first.len_utf8()..];
            continue;
        }
        let (name, after) = rest[1..].split_once(';').expect("a reference ends");
        plain.push(match name {
            "lt" => '<',
            "gt" => '>',
            "amp" => '&',
            "quot" => '"',
            "apos" => '\'',
            "#9" => '\t',
            "#10" => '\n',
            "#13" => '\r',
            other => panic!("unknown reference {other}"),
        });
        rest = after;
    }
    plain
}

#[test]
fn junit_is_well_formed_and_keeps_names() {
    for (report, options) in random_reports() {
        let texts = xml_texts(&write(&report, Format::Junit, &options));
        for finding in &report.findings {
            let shown = |character: char| match character {
                '\t' | '\n' | '\r' => character.to_string(),
                '\u{fffe}' | '\u{ffff}' => character.escape_unicode().to_string(),
                _ if character.is_control() => character.escape_unicode().to_string(),
                _ => character.to_string(),
            };
            let name: String = finding.name.chars().map(shown).collect();
            assert!(texts.contains(&name), "{name:?}");
        }
    }
}

#[test]
fn annotations_are_commands_of_one_line_and_at_most_ten() {
    for (report, options) in random_reports() {
        let text = write(&report, Format::Github, &options);
        let of_kind = |kind: &str| text.lines().filter(|line| line.starts_with(kind)).count();
        let (errors, warnings) = (of_kind("::error "), of_kind("::warning "));
        assert!(errors <= 10 && warnings <= 10 && errors + warnings == text.lines().count(), "{text}");
        for line in text.lines() {
            let (properties, message) = line[2..].split_once("::").expect("a message");
            let names: Vec<&str> =
                properties.split([' ', ',']).filter_map(|part| part.split_once('=')).map(|p| p.0).collect();
            assert!(names.iter().all(|name| ["file", "title"].contains(name)) || options.file.is_none(), "{line}");
            assert_eq!(properties.matches(',').count(), usize::from(options.file.is_some()), "{line}");
            assert!(!properties.contains(':') && !message.chars().any(char::is_control), "{line}");
            let encoded =
                ["%25", "%0D", "%0A", "%3A", "%2C"].iter().map(|code| line.matches(code).count()).sum::<usize>();
            assert_eq!(line.matches('%').count(), encoded, "{line}");
        }
    }
}

#[test]
fn markdown_stays_below_the_limit_of_a_summary() {
    let name = "`long | *name*`".repeat(100);
    let many = report((0..20_000).map(|_| wrong(&name, 0.5, None)).collect());
    assert!(write(&many, Format::Markdown, &options()).len() < 1 << 20);
}

#[test]
fn json_names_every_number_that_is_not_finite() {
    for (report, options) in random_reports() {
        let text = write(&report, Format::Json, &options);
        // serde_json rounds numbers that it reads, so the text is read.
        let noises = text.split("\"noise\":").skip(1).filter_map(|rest| rest.split_once(','));
        // A quoted value is the name of a number that is not finite.
        let noises = noises.filter(|(noise, _)| !noise.starts_with('"'));
        let noises: Vec<Option<f64>> = noises.map(|(noise, _)| noise.parse().ok()).collect();
        let finite = |finding: &Finding| Some(finding.noise).filter(|noise| noise.is_finite());
        assert_eq!(noises, report.findings.iter().map(finite).collect::<Vec<_>>());
        let json: Value = serde_json::from_str(&text).expect("JSON");
        for (finding, value) in report.findings.iter().zip(json["findings"].as_array().expect("findings")) {
            let not_finite = value["not_finite"].as_object().expect("an object");
            for (path, name) in not_finite {
                assert_eq!(value.pointer(&format!("/{path}")), Some(&Value::Null), "{path}");
                assert!(["NaN", "inf", "-inf"].contains(&name.as_str().expect("a name")));
            }
            assert_eq!(not_finite.contains_key("noise"), !finding.noise.is_finite());
            let bad = finding.measured.entries.iter().filter(|entry| !entry.is_finite()).count();
            assert_eq!(not_finite.keys().filter(|path| path.starts_with("measured/")).count(), bad);
        }
    }
}

#[test]
fn entries_show_the_digits_in_which_they_differ() {
    let mut random = Random(states::Random::new(5));
    for _ in 0..2000 {
        let measured = (1.0 + random.below(1000) as f64 / 100.0) * 10_f64.powi(random.below(40) as i32 - 20);
        let claimed = measured * (1.0 + 10_f64.powi(-(random.below(14) as i32)));
        let entry = Entry { row: 0, column: 0, claimed, measured, error: 0.0 };
        let text = write(&report(vec![wrong("state", 0.5, Some(entry))]), Format::Terminal, &Options::default());
        let (_, numbers) = text.split_once("∂σ₁₁/∂ε₁₁: claimed ").expect("the entry is shown");
        let (first, second) = numbers.split_once(", measured ").expect("both numbers");
        assert_ne!(first, second.split_once(" ±").expect("an error").0, "{claimed:e} and {measured:e}");
    }
}
