//! Reports in all formats, beside the files of tests/reports.
//!
//! `TANGENT_CHECK_WRITE=1 cargo test -p tangent-check --test reports` writes these files anew; read the difference before committing it.

mod random;

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tangent_check::finding::{Diagnosis, Entry, Finding, Reason, Report, Verdict};
use tangent_check::matrix::Matrix;
use tangent_check::report::{Format, JSON_SCHEMA, Options, write};

/// A name with every character that a format reads as a mark, with control characters and beyond ASCII.
const NASTY: &str = "\"q\" 'a' <b>&amp; 100%, a:b|c `x` *y* _z_ [l](1) {0} $m$ \\\n::error::\r\t\u{1b}[31m\u{0}\u{85}\u{fffe} σ₁₂ 漢字 🎉 ]]>";

/// A finding with matrices of size 2 × 2.
fn finding(name: &str, verdict: Verdict, reason: Option<Reason>) -> Finding {
    Finding {
        name: name.to_owned(),
        verdict,
        reason,
        worst: None,
        deviation: 3.25e-12,
        error: 1.5e-11,
        noise: 2.2e-16,
        control: Some(1e-9),
        calls: 211,
        claimed: Matrix { rows: 2, columns: 2, entries: vec![4.0, 1.0, 1.0, 3.0] },
        measured: Matrix { rows: 2, columns: 2, entries: vec![4.0, 1.0, 1.0, 3.0] },
        errors: Matrix { rows: 2, columns: 2, entries: vec![1e-11, 0.0, 2e-12, 6e-11] },
    }
}

fn wrong(name: &str, deviation: f64, worst: Option<Entry>) -> Finding {
    Finding { worst, deviation, control: Some(1e-7), ..finding(name, Verdict::Wrong, None) }
}

fn not_checked(name: &str, reason: Option<Reason>) -> Finding {
    let blank = Matrix { rows: 2, columns: 2, entries: vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0] };
    let numbers = Finding {
        deviation: f64::NAN,
        error: f64::INFINITY,
        control: None,
        calls: 0,
        ..finding(name, Verdict::NotChecked, reason)
    };
    Finding { measured: blank.clone(), errors: blank, ..numbers }
}

fn report(findings: Vec<Finding>) -> Report {
    Report {
        subject: "libmine.so, umat <J2 & \"Voce\">".to_owned(),
        convention: "Jaumann rate of the Kirchhoff stress over J; σ₁₁, σ₁₂".to_owned(),
        rows: vec!["σ₁₁".to_owned(), "σ₁₂".to_owned()],
        columns: vec!["ε₁₁".to_owned(), "ε₁₃".to_owned()],
        seed: u64::MAX,
        findings,
        diagnoses: Vec::new(),
        notes: Vec::new(),
    }
}

/// A report with all verdicts, all reasons, and nasty texts everywhere.
fn full_report() -> Report {
    let entry = Entry { row: 1, column: 1, claimed: 3214.5, measured: 1607.25, error: 2e-7 };
    let unnamed = Entry { row: 7, column: 1, claimed: f64::NAN, measured: -1.000_001_2e3, error: f64::INFINITY };
    let close = Entry { row: 0, column: 0, claimed: 1000.0012, measured: 1000.0, error: 3e-9 };
    let mut report = report(vec![
        finding("uniaxial stretch 1.2", Verdict::Consistent, None),
        Finding {
            worst: Some(close),
            deviation: 1.2e-6,
            ..finding("step 3, a forward difference", Verdict::Inexact, Some(Reason::ForwardDifference(1e-7)))
        },
        wrong(
            "simple shear, step 12, with a name that is far too long for the table of a terminal, state 7",
            0.5,
            Some(entry),
        ),
        wrong(NASTY, f64::NAN, Some(unnamed)),
        wrong("without an entry", 0.75, None),
        not_checked("apex", Some(Reason::Kink)),
        not_checked("zero strain", Some(Reason::NothingExercised)),
        not_checked("virgin state", Some(Reason::ZeroResponse)),
        not_checked("single precision", Some(Reason::TooNoisy(1.2e-5))),
        not_checked("noise without bound", Some(Reason::TooNoisy(f64::INFINITY))),
        not_checked("blind", Some(Reason::ControlMissed(1e-6))),
        not_checked("crash", Some(Reason::CallFailed(format!("the library stopped (signal 11) at {NASTY}")))),
        not_checked("crash", None),
    ]);
    report.diagnoses = vec![
        Diagnosis {
            sentence: "The tangent is the right one with the shear components 13 and 23 exchanged.".to_owned(),
            candidates: vec!["shears 13 and 23 exchanged".to_owned()],
            states_that_tell: Vec::new(),
            coefficient: None,
            share: 1.0,
        },
        Diagnosis {
            sentence: format!("A term σ ⊗ I is missing. {NASTY}"),
            candidates: vec!["σ ⊗ I is missing".to_owned(), "<the factor J> is missing".to_owned()],
            states_that_tell: vec!["a state with J ≠ 1".to_owned()],
            coefficient: Some(-0.999_987),
            share: 0.9312,
        },
    ];
    report.notes = vec!["The law reads DSTRAN only.".to_owned(), NASTY.to_owned()];
    report
}

fn options() -> Options {
    Options { file: Some("src/my law, 50%: σ.f90".to_owned()), allow_inexact: true }
}

#[track_caller]
fn assert_file(name: &str, text: &str) {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reports").join(name);
    if std::env::var_os("TANGENT_CHECK_WRITE").is_some() {
        fs::write(&path, text).expect("the file can be written");
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    assert!(text == expected, "{name} differs from {}:\n{text}", path.display());
}

#[test]
fn a_report_with_everything() {
    let report = full_report();
    assert_file("full.txt", &write(&report, Format::Terminal, &options()));
    assert_file("full.md", &write(&report, Format::Markdown, &options()));
    assert_file("full.xml", &write(&report, Format::Junit, &options()));
    assert_file("full.github.txt", &write(&report, Format::Github, &options()));
    let version = format!("\"semanticVersion\": \"{}\"", env!("CARGO_PKG_VERSION"));
    let sarif = write(&report, Format::Sarif, &options());
    assert!(sarif.contains(&version));
    assert_file("full.sarif", &sarif.replace(&version, "\"semanticVersion\": \"0.0.0\""));
    let json = write(&report, Format::Json, &options());
    assert_eq!(json.lines().count(), 1);
    // A line for each finding, for people who read the file.
    assert_file("full.json", &json.replace("{\"calls\"", "\n{\"calls\""));
}

#[test]
fn short_reports_in_the_terminal() {
    let consistent = || finding("stretch", Verdict::Consistent, None);
    let kink = || not_checked("apex", Some(Reason::Kink));
    let inexact =
        || Finding { deviation: 2e-6, ..finding("loose", Verdict::Inexact, Some(Reason::LocalIteration(1e-6))) };
    let shown = |findings| write(&report(findings), Format::Terminal, &Options::default());
    assert_file("consistent.txt", &shown(vec![consistent(), consistent()]));
    assert_file("consistent_with_kink.txt", &shown(vec![consistent(), kink()]));
    assert_file("inexact.txt", &shown(vec![consistent(), inexact(), kink()]));
    assert_file("kinks.txt", &shown(vec![kink(), kink()]));
    assert_file("empty.txt", &shown(Vec::new()));
    let allowed = Options { allow_inexact: true, file: None };
    assert_file("inexact_allowed.txt", &write(&report(vec![inexact()]), Format::Terminal, &allowed));
}

#[test]
fn formats_by_name() {
    for format in Format::ALL {
        assert_eq!(Format::from_name(format.name()), Ok(format));
    }
    let error = Format::from_name("x\nml").expect_err("no format has this name");
    let names = "terminal, terminal-full, markdown, junit, github, sarif, json";
    assert_eq!(error, format!("There is no report format \"x\\nml\". Allowed are: {names}."));
}

#[test]
fn exit_codes() {
    let code = |findings: &[Verdict], allow_inexact| {
        let options = Options { allow_inexact, file: None };
        report(findings.iter().map(|verdict| finding("", *verdict, None)).collect()).exit_code(&options)
    };
    use Verdict::{Consistent, Inexact, NotChecked, Wrong};
    assert_eq!((code(&[Consistent], false), code(&[], true)), (0, 2));
    assert_eq!((code(&[Consistent, Inexact], false), code(&[Consistent, Inexact], true)), (1, 0));
    assert_eq!((code(&[NotChecked, Inexact], false), code(&[NotChecked, Inexact], true)), (1, 2));
    assert_eq!((code(&[NotChecked, Wrong], true), code(&[NotChecked, Consistent], false)), (1, 2));
    let nothing = finding("", Consistent, Some(Reason::ZeroResponse));
    assert_eq!(report(vec![nothing.clone()]).exit_code(&Options::default()), 2);
    assert_eq!(report(vec![nothing, finding("", Consistent, None)]).exit_code(&Options::default()), 0);
}

#[test]
fn an_inexact_tangent_is_an_error_unless_allowed() {
    let report = report(vec![Finding { deviation: 2e-6, ..finding("loose", Verdict::Inexact, None) }]);
    for (allow_inexact, level, failures) in [(true, "warning", 0), (false, "error", 1)] {
        let options = Options { file: None, allow_inexact };
        let github = write(&report, Format::Github, &options);
        assert!(github.starts_with(&format!("::{level} title=Inexact tangent%3A loose::")), "{github}");
        assert_eq!(github.lines().count(), 1, "{github}");
        assert_eq!(write(&report, Format::Junit, &options).matches("<failure type=\"inexact\"").count(), failures);
        let sarif: Value = serde_json::from_str(&write(&report, Format::Sarif, &options)).expect("SARIF is JSON");
        let result = &sarif["runs"][0]["results"][0];
        assert_eq!((&result["ruleId"], &result["level"]), (&"inexact-tangent".into(), &level.into()));
    }
}

#[test]
fn components_without_a_symbol_are_spelt_out() {
    let entry = Entry { row: 1, column: 0, claimed: 2.0, measured: 1.0, error: 1e-9 };
    let mut report = report(vec![wrong("state", 0.5, Some(entry))]);
    report.rows = vec!["11".to_owned(), "12".to_owned()];
    report.columns = vec!["13".to_owned()];
    let text = write(&report, Format::Terminal, &Options::default());
    assert!(text.contains("\n  component 12 by component 13: claimed 2.0e0, measured 1.0e0 ± 1e-9\n"), "{text}");
}

#[test]
fn an_assertion_fails_with_the_report() {
    Report::new("law", vec![finding("stretch", Verdict::Consistent, None)]).assert_consistent();
    for findings in [Vec::new(), vec![wrong("stretch", 0.5, None)], vec![not_checked("zero", None)]] {
        let report = Report::new("law", findings);
        let panic = std::panic::catch_unwind(|| report.assert_consistent()).expect_err("the assertion fails");
        let text = panic.downcast_ref::<String>().expect("a message");
        assert_eq!(text.trim(), write(&report, Format::Terminal, &Options::default()).trim());
    }
}

/// The keys of an object, sorted.
fn keys(value: &Value) -> Vec<String> {
    value.as_object().map(|object| object.keys().cloned().collect()).unwrap_or_default()
}

#[test]
fn the_json_schema_lists_the_keys_of_a_report() {
    let schema: Value = serde_json::from_str(JSON_SCHEMA).expect("the schema is JSON");
    let json: Value = serde_json::from_str(&write(&full_report(), Format::Json, &options())).expect("JSON");
    let finding = &schema["$defs"]["finding"];
    let pairs = [
        (&json, &schema),
        (&json["findings"][0], finding),
        (&json["findings"][3]["worst"], &finding["properties"]["worst"]),
        (&json["findings"][5]["reason"], &finding["properties"]["reason"]),
        (&json["diagnoses"][1], &schema["$defs"]["diagnosis"]),
    ];
    for (value, described) in pairs {
        assert_eq!(keys(value), keys(&described["properties"]));
        let required: Vec<&str> =
            described["required"].as_array().expect("a list").iter().filter_map(Value::as_str).collect();
        assert_eq!(keys(value), required);
    }
}
