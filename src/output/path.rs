//! Events on the equilibrium path: the load turns, the path bends sharply, or it goes back along its earlier points.

use super::Reference;
use crate::simulation::Simulation;
use crate::tensor::{Tensor, Vector};
use serde::{Deserialize, Serialize};

/// Smallest cosine of the angle between two successive steps without a sharp bend.
const SHARP_BEND_COSINE: f64 = 0.5;

/// Distance from the turning point, relative to the size of the path, beyond which the path is compared with its earlier points.
const MIN_DISTANCE_FROM_TURN: f64 = 0.05;

/// Largest distance of a returning path from its earlier points, relative to the distance from the turning point. Beyond a limit point, the
/// other side at the same load is twice as far away as the turning point.
const RETURN_DISTANCE: f64 = 0.2;

/// A point of the path: the load, and moments of the displacement that distinguish states.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Point {
    load: f64,
    /// Σ V₀ u and Σ V₀ u ⊗ (X − X̄)/L, in one list (length times volume).
    moments: Vec<f64>,
}

impl Point {
    pub(crate) fn of<const D: usize, L, A>(simulation: &Simulation<D, L, A>, reference: &Reference<D>) -> Self {
        let particles = &simulation.particles;
        // Points that were added to surfaces have no volume.
        let first = |p: usize| reference.position.get(particles.id[p] as usize).unwrap_or(&particles.position[p]);
        let volume: f64 = particles.volume.iter().sum();
        let mut middle = Vector::<f64, D>::zeros();
        for (p, part) in particles.volume.iter().enumerate() {
            middle += *part * first(p) / volume;
        }
        let mut displacement = Vector::<f64, D>::zeros();
        let mut gradient = Tensor::<f64, D>::zeros();
        let mut length: f64 = 0.0;
        for (p, part) in particles.volume.iter().enumerate() {
            let weighted = (particles.position[p] - first(p)) * *part;
            let arm = first(p) - middle;
            displacement += weighted;
            gradient += weighted * arm.transpose();
            length = length.max(arm.amax());
        }
        gradient /= length.max(f64::MIN_POSITIVE);
        Self { load: simulation.path.load, moments: displacement.iter().chain(&gradient).copied().collect() }
    }

    fn distance(&self, other: &[f64]) -> f64 {
        self.moments.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }
}

/// The points of the path so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Followed {
    points: Vec<Point>,
    /// Index of the last point before the load turned.
    turn: Option<usize>,
}

/// An event on the path in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Event {
    /// The load turned at this λ.
    Turned(f64),
    /// The path turned by this angle (degrees) from one step to the next.
    Bent(f64),
    /// The path is back on its earlier points, at this λ.
    Returned(f64),
}

impl Followed {
    /// Adds a step to `point`. `cosine` is the cosine of the angle between the displacements of this step and the previous step.
    pub(crate) fn add(&mut self, point: Point, cosine: Option<f64>) -> Vec<Event> {
        let mut events = Vec::new();
        if let Some(cosine) = cosine.filter(|&cosine| cosine < SHARP_BEND_COSINE) {
            events.push(Event::Bent(cosine.clamp(-1.0, 1.0).acos().to_degrees()));
        }
        if let [.., before, last] = &self.points[..]
            && (last.load - before.load) * (point.load - last.load) < 0.0
        {
            events.push(Event::Turned(last.load));
            self.turn = Some(self.points.len() - 1);
        }
        if self.turn.is_some_and(|turn| self.returns(turn, &point)) {
            events.push(Event::Returned(point.load));
        }
        self.points.push(point);
        events
    }

    /// Whether a point lies on the path before the turning point.
    fn returns(&self, turn: usize, point: &Point) -> bool {
        let origin = vec![0.0; point.moments.len()];
        let scale = self.points.iter().map(|one| one.distance(&origin)).fold(0.0, f64::max);
        let away = point.distance(&self.points[turn].moments);
        let near = |ends: &[Point]| {
            let [from, to] = ends else { return false };
            let part = (point.load - from.load) / (to.load - from.load);
            let between: Vec<f64> = from.moments.iter().zip(&to.moments).map(|(a, b)| a + part * (b - a)).collect();
            (0.0..=1.0).contains(&part) && point.distance(&between) < RETURN_DISTANCE * away
        };
        away > MIN_DISTANCE_FROM_TURN * scale && self.points[..=turn].windows(2).any(near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(path: impl Fn(f64) -> (f64, f64), end: u32) -> Vec<Event> {
        let mut followed = Followed::default();
        let point = |step| {
            let (load, u) = path(0.1 * f64::from(step));
            Point { load, moments: vec![u] }
        };
        (0..=end).flat_map(|step| followed.add(point(step), None)).collect()
    }

    #[test]
    fn a_limit_point_turns_and_does_not_return() {
        // λ = 3u − u³ about its two limit points.
        let events = told(|s| (3.0 * (s - 2.0) - (s - 2.0).powi(3) + 3.0, s), 40);
        assert!(matches!(events[..], [Event::Turned(_), Event::Turned(_)]), "{events:?}");
    }

    #[test]
    fn a_path_that_goes_back_is_told_to_return() {
        let back = |s: f64| if s < 2.05 { s } else { 4.0 - s };
        let events = told(|s| (back(s).powi(2), back(s)), 30);
        assert_eq!(events[0], Event::Turned(4.0));
        assert!(events[1..].iter().all(|event| matches!(event, Event::Returned(_))) && events.len() > 5, "{events:?}");
    }

    #[test]
    fn a_sharp_bend_is_told_with_its_angle() {
        let point = Point { load: 1.0, moments: vec![1.0] };
        let events = Followed::default().add(point, Some(0.0));
        assert!(matches!(events[..], [Event::Bent(angle)] if (angle - 90.0).abs() < 1e-12), "{events:?}");
    }
}
