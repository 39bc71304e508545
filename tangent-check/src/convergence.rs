//! The order of convergence of Newton's method, from the norms of its residuals.
//!
//! Far from round-off, the norms of a method of order p obey r_{k+1} ≈ C r_k^p. Two successive contractions q_k = r_k/r_{k−1} give
//!
//! p_k = ln q_{k+1} / ln q_k
//!
//! without C. A norm at round-off is larger than the method alone would leave it, so p_k is then a lower bound.

/// Orders from here on count as quadratic. The exact order is reached in the limit; a last contraction from 1e-3 shows 2 within 15 %.
const QUADRATIC: f64 = 1.7;

/// Orders up to here count as linear.
const LINEAR: f64 = 1.2;

/// A contraction above this ratio belongs to the search for the solution, not to the convergence.
const CONVERGES: f64 = 0.5;

/// The residuals of one solution by Newton's method.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The name in tables: "step 12, t = 0.6".
    pub name: String,
    /// ‖R‖ at the initial guess and after each iteration.
    pub norms: Vec<f64>,
    /// The norm that round-off leaves. Without it, a norm below 1e-14 of the greatest norm counts as round-off.
    pub round_off: Option<f64>,
}

/// The order that the norms show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// Quadratic: the order seen last above round-off, or its lower bound.
    Quadratic(f64),
    /// Between linear and quadratic.
    Superlinear(f64),
    /// Linear.
    Linear(f64),
    /// The first iterations reach round-off: the equations are linear there, or nearly so.
    Immediate,
    /// Too few norms fall to tell.
    Unknown,
    /// A norm is not finite.
    NotFinite,
}

impl Order {
    /// Whether the norms do not contradict quadratic convergence.
    pub fn is_quadratic(self) -> bool {
        matches!(self, Self::Quadratic(_) | Self::Immediate)
    }
}

impl std::fmt::Display for Order {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Quadratic(order) => write!(f, "quadratic ({order:.1})"),
            Self::Superlinear(order) => write!(f, "superlinear ({order:.1})"),
            Self::Linear(order) => write!(f, "linear ({order:.1})"),
            Self::Immediate => f.write_str("round-off at once"),
            Self::Unknown => f.write_str("unknown"),
            Self::NotFinite => f.write_str("not finite"),
        }
    }
}

impl Solution {
    /// The norm at and below which round-off decides.
    pub fn floor(&self) -> f64 {
        self.round_off.unwrap_or_else(|| 1e-14 * self.norms.iter().fold(0.0, |most: f64, norm| most.max(*norm)))
    }

    /// The order p_k that each iteration shows, from the second on; `None` where it shows none. The norms must fall, and the norm before
    /// must be above round-off. If the last norm is round-off, p_k is a lower bound, and shows nothing unless it is quadratic.
    ///
    /// ```
    /// use tangent_check::convergence::Solution;
    ///
    /// // The norms 10^−1, 10^−2, 10^−4, 10^−8, and round-off at 10^−14.
    /// let norms = [-1, -2, -4, -8, -14].map(|power| 10_f64.powi(power)).to_vec();
    /// let newton = Solution { name: "step 1".into(), norms, round_off: Some(1e-14) };
    /// let orders: Vec<_> = newton.orders().into_iter().map(|order| order.map(|order| (order * 10.0).round() / 10.0)).collect();
    /// assert_eq!(orders, [Some(2.0), Some(2.0), None]);
    /// ```
    pub fn orders(&self) -> Vec<Option<f64>> {
        let floor = self.floor();
        let order = |three: &[f64]| {
            let (before, now) = (three[1] / three[0], three[2].max(f64::MIN_POSITIVE) / three[1]);
            let finite = three.iter().all(|norm| norm.is_finite());
            let falls = finite && three[1] > floor && before <= CONVERGES && now < 1.0;
            let order = now.ln() / before.ln();
            (falls && (three[2] > floor || order >= QUADRATIC)).then_some(order)
        };
        self.norms.windows(3).map(order).collect()
    }

    /// The order of convergence: the greater of the last two orders. The tolerance of the linear solver may limit the last one.
    ///
    /// ```
    /// use tangent_check::convergence::{Order, Solution};
    ///
    /// let of = |norms: &[f64]| Solution { name: String::new(), norms: norms.to_vec(), round_off: None }.order();
    /// assert!(matches!(of(&[0.1, 1e-2, 1e-4, 1e-8]), Order::Quadratic(order) if (order - 2.0).abs() < 1e-6));
    /// assert!(matches!(of(&[1.0, 1e-2, 1e-4, 1e-6, 1e-8]), Order::Linear(order) if (order - 1.0).abs() < 1e-6));
    /// assert_eq!(of(&[1.0, 1e-7, 1e-15]), Order::Immediate);
    /// assert_eq!(of(&[1.0, 0.9]), Order::Unknown);
    /// assert_eq!(of(&[1.0, f64::NAN]), Order::NotFinite);
    /// ```
    pub fn order(&self) -> Order {
        if self.norms.iter().any(|norm| !norm.is_finite()) {
            return Order::NotFinite;
        }
        let floor = self.floor();
        let reaches_round_off = self.norms.iter().take(3).any(|norm| *norm <= floor);
        match self.orders().iter().rev().flatten().take(2).copied().reduce(f64::max) {
            Some(order) if order >= QUADRATIC => Order::Quadratic(order),
            _ if reaches_round_off => Order::Immediate,
            Some(order) if order > LINEAR => Order::Superlinear(order),
            Some(order) => Order::Linear(order),
            None => Order::Unknown,
        }
    }
}

/// The forms of a table of solutions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableForm {
    /// Aligned columns, for a terminal.
    Text,
    /// A table of GitHub's Markdown.
    Markdown,
    /// A `tabular` with the rules of the package booktabs.
    Latex,
    /// Comma-separated values, with all digits. Names should have no commas.
    Csv,
}

/// The norms of all solutions and their orders: a column for each iteration, a row for each solution.
///
/// ```
/// use tangent_check::convergence::{Solution, TableForm, table};
///
/// let solution = Solution { name: "step 1".into(), norms: vec![0.1, 1e-2, 1e-4, 1e-8], round_off: None };
/// assert_eq!(
///     table(&[solution], TableForm::Markdown),
///     "|  | 0 | 1 | 2 | 3 | order |\n|---|---|---|---|---|---|\n| step 1 | 1.0e-1 | 1.0e-2 | 1.0e-4 | 1.0e-8 | quadratic (2.0) |\n"
/// );
/// ```
pub fn table(solutions: &[Solution], form: TableForm) -> String {
    let most = solutions.iter().map(|solution| solution.norms.len()).max().unwrap_or(0);
    let mut rows = vec![Vec::from([String::new()])];
    rows[0].extend((0..most).map(|k| k.to_string()).chain(["order".to_owned()]));
    for solution in solutions {
        let norm = |k: usize| solution.norms.get(k).map_or_else(String::new, |norm| number(*norm, form));
        let mut row = vec![solution.name.clone()];
        row.extend((0..most).map(norm).chain([solution.order().to_string()]));
        rows.push(row);
    }
    match form {
        TableForm::Text => aligned(&rows),
        TableForm::Markdown => markdown(&rows),
        TableForm::Latex => latex(&rows),
        TableForm::Csv => rows.iter().map(|row| row.join(",") + "\n").collect(),
    }
}

fn number(x: f64, form: TableForm) -> String {
    match form {
        TableForm::Csv => format!("{x:e}"),
        TableForm::Latex if x.is_finite() => {
            let (digits, power) =
                format!("{x:.1e}").split_once('e').map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap_or_default();
            format!("${digits}\\cdot10^{{{power}}}$")
        }
        _ => format!("{x:.1e}"),
    }
}

fn aligned(rows: &[Vec<String>]) -> String {
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:width$}")).collect();
        cells.join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

fn markdown(rows: &[Vec<String>]) -> String {
    let line = |row: &Vec<String>| format!("| {} |\n", row.join(" | "));
    let rule = "|---".repeat(rows[0].len());
    format!("{}{rule}|\n{}", line(&rows[0]), rows[1..].iter().map(line).collect::<String>())
}

/// Text in which LaTeX takes no character for a command; formulas stay.
fn escaped(cell: &str) -> String {
    if cell.starts_with('$') {
        return cell.to_owned();
    }
    let escape = |c: char| match c {
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        '\\' => "\\textbackslash{}".to_owned(),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        c => c.to_string(),
    };
    cell.chars().map(escape).collect()
}

fn latex(rows: &[Vec<String>]) -> String {
    let line = |row: &Vec<String>| row.iter().map(|cell| escaped(cell)).collect::<Vec<_>>().join(" & ") + " \\\\\n";
    let columns = "r".repeat(rows[0].len() - 2);
    let body: String = rows[1..].iter().map(line).collect();
    format!(
        "\\begin{{tabular}}{{l{columns}l}}\n\\toprule\n{}\\midrule\n{body}\\bottomrule\n\\end{{tabular}}\n",
        line(&rows[0])
    )
}
