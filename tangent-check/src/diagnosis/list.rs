//! The list of frequent mistakes.

use super::mistakes::{Candidate, GENERAL, Mistake, Side};
use super::observation::Elsewhere;
use crate::convention::{Components, Convention, Measure};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

const STRESSED: &str = "large strain and stress";
const VOLUME: &str = "states with J ≠ 1";
const UNSYMMETRIC: &str = "a law whose tangent is not symmetric (flow without association)";
const YIELDING: &str = "large plastic or viscous steps";
const MEMORY: &str = "paths of several unequal steps";
const ELASTIC: &str = "large elastic strain";

/// All mistakes that can be made in this convention.
pub(super) fn candidates(convention: &Convention) -> Vec<Candidate> {
    let mut all = reordered(convention);
    if !convention.measure.by_gradient() {
        all.extend(shear_factors());
    }
    if convention.stress.count() == convention.strain.count() {
        all.push(Candidate::new(Mistake::Transposed, "rows and columns transposed", UNSYMMETRIC));
        let name = "its symmetric part only: it was symmetrised";
        all.push(Candidate::new(Mistake::Symmetrised, name, UNSYMMETRIC));
        let copied = |side, name: &str| Candidate::new(Mistake::Copied(side), name, UNSYMMETRIC);
        all.push(copied(Side::Below, "the entries below the diagonal copied from those above"));
        all.push(copied(Side::Above, "the entries above the diagonal copied from those below"));
        let block = |shear, name: &str| Candidate::new(Mistake::BlockTransposed { shear }, name, UNSYMMETRIC);
        all.push(block(false, "its block of normal by normal transposed"));
        all.push(block(true, "its block of shear by shear transposed"));
    }
    let whole = "all entries cut to whole numbers (a name that begins with I to N is an integer in Fortran)";
    all.push(Candidate::new(Mistake::WholeNumbers, whole, "properties in other units"));
    if !convention.measure.by_gradient() {
        for (increment, rotation) in [(false, "the rotation of F"), (true, "the rotation increment (DROT)")] {
            for (back, name) in [(true, format!("back by {rotation}")), (false, format!("by {rotation} once more"))] {
                let name = format!("its axes turned {name}");
                all.push(Candidate::new(Mistake::Turned { increment, back }, &name, "an anisotropic law"));
            }
        }
    }
    let volume = |power, name: &str| Candidate::new(Mistake::VolumeRatio(power), name, VOLUME);
    all.push(volume(1, "an additional factor J (Kirchhoff's stress in place of Cauchy's)"));
    all.push(volume(-1, "an additional factor 1/J"));
    all.push(Candidate::new(Mistake::Sign, "the opposite sign", "any state"));
    all.extend(other_measures(convention.measure));
    all.extend(elsewhere());
    all
}

fn elsewhere() -> Vec<Candidate> {
    let candidate = |kind, name: &str, shows_in| Candidate::other(Mistake::Elsewhere(kind), name, shows_in);
    vec![
        candidate(Elsewhere::StepBefore, "that of the step before", MEMORY),
        candidate(Elsewhere::Elastic, "the elastic one in place of the algorithmic one", YIELDING),
        candidate(Elsewhere::Continuum, "the continuum tangent in place of the algorithmic one", YIELDING),
        candidate(Elsewhere::StartOfStep, "that at the start of the step", MEMORY),
        candidate(Elsewhere::AtRest, "the elastic one at rest, without strain", ELASTIC),
        candidate(
            Elsewhere::Heated,
            "that at a strain without its thermal part, or with one that the stress lacks",
            ELASTIC,
        ),
    ]
}

fn shear_factors() -> Vec<Candidate> {
    let factors = [(2.0, "2"), (0.5, "½"), (SQRT_2, "√2"), (FRAC_1_SQRT_2, "1/√2")];
    let mut all = Vec::new();
    for (factor, symbol) in factors {
        let places = [
            ("the shear rows", factor, 1.0),
            ("the shear columns", 1.0, factor),
            ("the shear rows and columns", factor, factor),
        ];
        for (place, rows, columns) in places {
            let name = format!("{place} multiplied by {symbol} (engineering shear)");
            all.push(Candidate::new(Mistake::ShearFactors { rows, columns }, &name, GENERAL));
        }
        let name = format!("the entries of shear by shear multiplied by {symbol} (engineering shear)");
        all.push(Candidate::new(Mistake::ShearBlock(factor), &name, GENERAL));
    }
    all
}

/// Tangents of another measure or with a wrong part of the stress.
fn other_measures(measure: Measure) -> Vec<Candidate> {
    let rates = [Measure::JaumannKirchhoff, Measure::JaumannCauchy, Measure::Truesdell, Measure::GreenNaghdi];
    let own = if measure == Measure::CauchyByStrain { Measure::JaumannCauchy } else { measure };
    let others = rates.into_iter().filter(|rate| *rate != own);
    let name = |rate: Measure| match rate {
        Measure::Truesdell => "that of the Truesdell rate: its geometric part with the stress is missing".to_string(),
        Measure::JaumannCauchy => {
            "that of the Jaumann rate of the Cauchy stress, which is ∂σ/∂Δε: the term σ ⊗ I is missing".to_string()
        }
        rate => format!("that of another rate: {}", rate.words()),
    };
    let mut all = Vec::new();
    if measure.spatial() {
        all.extend(others.map(|rate| Candidate::other(Mistake::OtherMeasure(rate), &name(rate), STRESSED)));
        let pairs = rates.into_iter().flat_map(|from| rates.map(|to| [from, to]));
        // The Jaumann rates differ by σ ⊗ I, which is one of the terms.
        let jaumann = |rate: &Measure| matches!(rate, Measure::JaumannKirchhoff | Measure::JaumannCauchy);
        let differ = |[from, to]: &[Measure; 2]| from != to && !(jaumann(from) && jaumann(to));
        for [from, to] in pairs.filter(|pair| differ(pair) && pair[0] != own) {
            let name = format!("the term too much that leads from {} to {}", from.words(), to.words());
            all.push(Candidate::new(Mistake::RateTerm([from, to]), &name, STRESSED));
        }
        let material = Mistake::OtherMeasure(Measure::SecondPiolaByGreen);
        all.push(Candidate::other(material, "the material one, ∂S/∂E, in place of the spatial one", STRESSED));
        return all;
    }
    let jaumann = others.filter(|rate| *rate != Measure::Truesdell);
    for rate in jaumann {
        let taken = format!("built from {}, taken for the Truesdell rate", rate.words());
        all.push(Candidate::other(Mistake::TakenForTruesdell(rate), &taken, STRESSED));
        if measure != Measure::PiolaByGradient && measure.by_gradient() {
            let spinless = format!("that of {} without the terms of its spin", rate.words());
            all.push(Candidate::other(Mistake::WithoutSpin(rate), &spinless, STRESSED));
        }
    }
    if measure == Measure::SecondPiolaByGreen {
        for rate in [Measure::Truesdell, Measure::JaumannKirchhoff] {
            let name = format!("the spatial one, {}, in place of ∂S/∂E", rate.words());
            all.push(Candidate::other(Mistake::OtherMeasure(rate), &name, STRESSED));
        }
        return all;
    }
    all.push(Candidate::new(Mistake::NoGeometricPart, "the geometric part with the stress missing", STRESSED));
    let swapped = match measure {
        Measure::CauchyByGradient => Some(Measure::KirchhoffByGradient),
        Measure::KirchhoffByGradient => Some(Measure::CauchyByGradient),
        _ => None,
    };
    let other = |measure: Measure| Candidate::other(Mistake::OtherMeasure(measure), measure.words(), STRESSED);
    all.extend(swapped.map(other));
    all
}

type Pairs = Vec<(usize, usize)>;

/// Orders of components that are taken for the right one, each with its name.
fn orders(components: &Components) -> Vec<(String, Pairs)> {
    let own = &components.pairs;
    let mut all: Vec<(String, Pairs)> = Vec::new();
    let full = own.iter().any(|(i, j)| i != j && own.contains(&(*j, *i)));
    let swapped: Pairs = own.iter().map(|(i, j)| (*j, *i)).collect();
    if full {
        all.push(("the indices ij and ji exchanged".to_string(), swapped));
        all.push(("components ordered in rows".to_string(), Components::rows().pairs));
        let columns = Components::rows().pairs.iter().map(|(i, j)| (*j, *i)).collect();
        all.push(("components ordered in columns".to_string(), columns));
        all.push(("components in MFront's order".to_string(), Components::mfront_gradient().pairs));
    } else {
        all.extend(permuted(own, |(i, j)| i != j, "shear components"));
        let rows = vec![(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        all.push(("components ordered 11, 12, 13, 22, 23, 33".to_string(), rows));
        let columns = vec![(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)];
        all.push(("components ordered 11, 12, 22, 13, 23, 33".to_string(), columns));
    }
    all.extend(permuted(own, |(i, j)| i == j, "normal components"));
    all
}

/// The five other orders of three components of a kind, or the one of two.
fn permuted(own: &Pairs, kind: impl Fn((usize, usize)) -> bool, noun: &str) -> Vec<(String, Pairs)> {
    let places: Vec<usize> = (0..own.len()).filter(|k| kind(own[*k])).collect();
    let [a, b, c] = match places.as_slice() {
        [a, b, c] => [*a, *b, *c],
        _ => return Vec::new(),
    };
    let label = |k: usize| {
        let (i, j) = own[k];
        format!("{}{}", i.min(j) + 1, i.max(j) + 1)
    };
    let with = |order: [usize; 3]| {
        let mut pairs = own.clone();
        (pairs[a], pairs[b], pairs[c]) = (own[order[0]], own[order[1]], own[order[2]]);
        pairs
    };
    let mut all = Vec::new();
    for (x, y, order) in [(a, b, [b, a, c]), (a, c, [c, b, a]), (b, c, [a, c, b])] {
        all.push((format!("the {noun} {} and {} exchanged", label(x), label(y)), with(order)));
    }
    for order in [[b, c, a], [c, a, b]] {
        let [x, y, z] = order.map(label);
        all.push((format!("the {noun} in the order {x}, {y}, {z}"), with(order)));
    }
    all
}

/// The places in `own` of the components of another order; `None` if the orders do not have the same components.
fn places(own: &Components, other: &Pairs) -> Option<Vec<usize>> {
    let place = |(i, j): (usize, usize)| {
        let exact = own.pairs.iter().position(|pair| *pair == (i, j));
        exact.or_else(|| own.pairs.iter().position(|pair| *pair == (j, i)))
    };
    let found: Vec<usize> = other.iter().filter_map(|pair| place(*pair)).collect();
    let mut sorted = found.clone();
    sorted.sort_unstable();
    (sorted == (0..own.count()).collect::<Vec<_>>()).then_some(found)
}

/// Wrong orders of the rows, of the columns, and of both alike.
fn reordered(convention: &Convention) -> Vec<Candidate> {
    let own: [Vec<usize>; 2] = [&convention.stress, &convention.strain].map(|side| (0..side.count()).collect());
    let mut all: Vec<Candidate> = Vec::new();
    let mut seen: Vec<[Vec<usize>; 2]> = vec![own.clone()];
    let mut add = |rows: &Vec<usize>, columns: &Vec<usize>, name: &str, place: &str| {
        if seen.contains(&[rows.clone(), columns.clone()]) {
            return;
        }
        seen.push([rows.clone(), columns.clone()]);
        let mistake = Mistake::Reordered { rows: rows.clone(), columns: columns.clone() };
        all.push(Candidate::new(mistake, &format!("{name}{place}"), GENERAL));
    };
    for (name, order) in orders(&convention.strain) {
        let [rows, columns] = [places(&convention.stress, &order), places(&convention.strain, &order)];
        if let (Some(rows), Some(columns)) = (&rows, &columns) {
            add(rows, columns, &name, "");
        }
        if let Some(columns) = &columns {
            add(&own[0], columns, &name, ", in the columns only");
        }
    }
    for (name, order) in orders(&convention.stress) {
        if let Some(rows) = places(&convention.stress, &order) {
            add(&rows, &own[1], &name, ", in the rows only");
        }
    }
    all
}
