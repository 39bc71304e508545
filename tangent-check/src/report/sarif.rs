//! A log after SARIF 2.1.0, the Static Analysis Results Interchange Format of OASIS.

use super::options::Options;
use super::severity::{Severity, failure_of_the_whole, worst_first};
use super::words;
use crate::finding::{Finding, Report, Verdict};
use crate::json::{Value, json};
use std::collections::BTreeMap;

const SCHEMA: &str = "https://json.schemastore.org/sarif-2.1.0.json";

/// A rule: identifier, level, short and full description, help.
struct Rule(&'static str, &'static str, &'static str, &'static str, &'static str);

const RULES: [Rule; 3] = [
    Rule(
        "wrong-tangent",
        "error",
        "The tangent is not the derivative.",
        "The claimed tangent differs from the measured derivative by more than ten times the error of the measurement.",
        "Correct the entry that the message names. A wrong tangent costs the quadratic convergence of Newton's method.",
    ),
    Rule(
        "inexact-tangent",
        "warning",
        "The tangent is slightly off.",
        "The claimed tangent is off by less than 1e-6 of the scale of the law, or by a cause that the check has shown.",
        "Mend the cause that the message names, or allow inexact tangents.",
    ),
    Rule(
        "not-checked",
        "error",
        "The tangent could not be checked.",
        "The check cannot tell whether the tangent is the derivative: a kink, noise, no response, or a failed call.",
        "The message gives the reason. States on kinks are notes and do not count against the law.",
    ),
];

pub(super) fn write(report: &Report, options: &Options) -> String {
    let mut repeated = BTreeMap::new();
    let mut results = Vec::new();
    if let Some(message) = failure_of_the_whole(report, options) {
        results.push(result(report, options, 2, "error", "", &message, 0));
    }
    for (wanted, level) in [(Severity::Error, "error"), (Severity::Warning, "warning"), (Severity::Skipped, "note")] {
        for finding in worst_first(report, options, wanted) {
            let rule = rule(finding);
            let number = repeated.entry((rule, finding.name.as_str())).and_modify(|number| *number += 1).or_insert(0);
            results.push(result(report, options, rule, level, &finding.name, &message(report, finding), *number));
        }
    }
    let driver = json!({
        "name": "tangent-check",
        "rules": RULES.iter().map(descriptor).collect::<Vec<_>>(),
        "semanticVersion": env!("CARGO_PKG_VERSION"),
    });
    let properties = json!({ "convention": report.convention, "seed": report.seed, "subject": report.subject });
    let run = json!({ "columnKind": "unicodeCodePoints", "properties": properties, "results": results,
                      "tool": json!({ "driver": driver }) });
    format!("{:#}\n", json!({ "$schema": SCHEMA, "runs": vec![run], "version": "2.1.0" }))
}

fn descriptor(&Rule(id, level, short, full, help): &Rule) -> Value {
    let text = |text: &str| json!({ "text": text });
    json!({ "defaultConfiguration": json!({ "level": level }), "fullDescription": text(full), "help": text(help),
            "id": id, "shortDescription": text(short) })
}

/// The index of the rule that a finding breaks.
fn rule(finding: &Finding) -> usize {
    match finding.verdict {
        Verdict::Consistent | Verdict::Wrong => 0,
        Verdict::Inexact => 1,
        Verdict::NotChecked => 2,
    }
}

/// The first sentence of a message is the title of an alert, so the diagnoses follow the finding.
fn message(report: &Report, finding: &Finding) -> String {
    let mut lines = words::with_diagnoses(report, finding);
    lines.push(format!("State: {}", finding.name));
    lines.join("\n")
}

/// A result. `number` counts findings with the same rule and name.
fn result(
    report: &Report,
    options: &Options,
    rule: usize,
    level: &str,
    name: &str,
    message: &str,
    number: usize,
) -> Value {
    let id = RULES[rule].0;
    let print = format!("{:016x}:{number}", hash(&[id, &report.subject, name]));
    json!({
        "level": level,
        "locations": vec![location(report, options, name)],
        // SARIF 2.1.0, section 3.11.5: braces mark placeholders, and literal braces are doubled.
        "message": json!({ "text": message.replace('{', "{{").replace('}', "}}") }),
        "partialFingerprints": json!({ "tangentCheck/v1": print }),
        "ruleId": id,
        "ruleIndex": rule,
    })
}

/// The first line of the source file, if it is known, and the state.
fn location(report: &Report, options: &Options, name: &str) -> Value {
    let mut location = json!({ "logicalLocations": vec![json!({
        "fullyQualifiedName": format!("{}/{name}", report.subject), "kind": "state", "name": name })] });
    if let Some(file) = &options.file {
        let (uri, region) = (json!({ "uri": uri(file) }), json!({ "startLine": 1_u32 }));
        location.insert("physicalLocation", json!({ "artifactLocation": uri, "region": region }));
    }
    location
}

/// A path as a reference after RFC 3986: bytes other than unreserved ones are percent-encoded.
fn uri(path: &str) -> String {
    let path = path.replace('\\', "/");
    let mut uri = if path.starts_with('/') { "file://".to_owned() } else { String::new() };
    for byte in path.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~/".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri += &format!("%{byte:02X}");
        }
    }
    uri
}

/// The hash FNV-1a of texts, 64 bits: h ← (h ⊕ byte) · 0x100000001b3. A byte 255, which no UTF-8 has, ends each text.
fn hash(texts: &[&str]) -> u64 {
    let bytes = texts.iter().flat_map(|text| text.bytes().chain([255]));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
