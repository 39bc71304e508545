//! The plan: which terms of the residual a scene has, and why.

use crate::mechanics::loads::{Loads, Pressing, Rayleigh};
use crate::mechanics::schemes::Scheme;

/// `(name, used, why)`: whether a term, or a part of a term, is used, and the reason.
pub(crate) type Reason = (&'static str, bool, String);

/// The entries of all terms in a plan. `lumping` is ε, `averages` says whether a body has mean dilatation, and `may_reset` whether the grid
/// may be reset.
pub(crate) fn planned<const D: usize>(
    loads: &Loads<D>,
    scheme: &dyn Scheme,
    lumping: f64,
    averages: bool,
    may_reset: bool,
) -> Vec<Reason> {
    let moves = scheme.has_inertia();
    let inertia = |why: String| if moves { why } else { format!("time.scheme says none: {}", scheme.name()) };
    let mean = match averages {
        false => "only with volumetric = \"mean_dilatation\" of a body",
        true => "one change of volume for the particles of a cell; a pass more a residual and a product",
    };
    let damping = loads.damping.filter(|_| moves);
    let damped = |Rayleigh { mass, stiffness }| format!("{mass} M + {stiffness} K; two passes more a residual");
    let gravity = match (&loads.gravity, &loads.field) {
        (None, None) => "only with gravity",
        (_, Some(_)) => "it varies: one pass over particles a step",
        (Some(_), None) if moves => "from the lumped mass: no pass over particles of its own",
        (Some(_), None) => "one pass over particles a step, for the nodal mass it acts on",
    };
    let pulled = loads.loaded(|pressing| matches!(pressing, Pressing::Traction(_)));
    let pressed = loads.loaded(|pressing| matches!(pressing, Pressing::Pressure(_)));
    let (points, obstacles) = (loads.contacts.points.len(), loads.contacts.obstacles.len());
    let pairs = loads.contacts.between.as_ref().map_or(0, |between| between.pairs.len());
    let slides = if loads.contacts.have_friction() { "; friction makes the tangent unsymmetric" } else { "" };
    let touched = format!("{points} points of surfaces; obstacles: {obstacles}; pairs of bodies: {pairs}{slides}");
    vec![
        ("inertia, lumped", moves && lumping > 0.0, inertia(format!("time.lumping = {lumping}, {}", scheme.name()))),
        (
            "inertia, consistent",
            moves && lumping < 1.0,
            inertia("only for time.lumping < 1; its projection is an iteration".into()),
        ),
        ("internal force", true, format!("F S of every particle, {D}×{D}")),
        ("mean dilatation", averages, mean.into()),
        ("damping", damping.is_some(), damping.map_or_else(|| "only with damping".into(), damped)),
        ("gravity", loads.gravity.is_some() || loads.field.is_some(), gravity.into()),
        ("tractions", pulled > 0, format!("{pulled} loaded particles")),
        ("out-of-balance force", may_reset && !moves, "after a grid reset in load steps".into()),
        ("follower pressure", pressed > 0, format!("{pressed} loaded particles; makes the tangent unsymmetric")),
        ("contact", loads.contacts.exist(), touched),
    ]
}
