//! The options of a report.

/// The options of a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// The source file of the law, relative to the root of the repository. Annotations and SARIF results point to it.
    pub file: Option<String>,
    /// Whether an inexact tangent passes.
    pub allow_inexact: bool,
}
