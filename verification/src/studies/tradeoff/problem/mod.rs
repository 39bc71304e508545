//! The problems with known answers, as scenes without knobs: every knob has the default of the scene's types.

mod compaction;
mod manufactured;
mod riemann;

pub(super) use compaction::Compaction;
pub(super) use manufactured::Manufactured;
pub(super) use riemann::Bar;

use super::cost::Cost;
use super::setting::Setting;
use crate::report::chain;
use crate::studies::StudyError;
use bfree::scene::{self, Override, Scene};
use serde_json::{Value, json};

/// Spacings of each problem.
pub(super) const LEVELS: usize = 5;

/// A problem with a known answer.
pub(super) trait Problem: Sync {
    /// The name in reports.
    fn name(&self) -> &'static str;
    /// 1, 2 or 3.
    fn dimension(&self) -> usize;
    /// 1/h of each level, coarse to fine, in cells per unit of length.
    fn cells(&self) -> [f64; LEVELS];
    /// The speed of pressure waves at rest.
    fn speed(&self) -> f64;
    /// The time of the answer.
    fn end(&self) -> f64;
    /// The number of times at which the answer is compared; the number of steps is a multiple of it.
    fn samples(&self) -> u64 {
        1
    }
    /// Whether the answer has no jumps.
    fn smooth(&self) -> bool {
        true
    }
    /// The scene without `grid.spacing`, `time` and any knob.
    fn scene(&self) -> Value;
    /// The spacing for a number of cells, if the least extent of the body does not measure the motion in it. Otherwise the key `accuracy`
    /// chooses the spacing.
    fn spacing_of(&self, _cells: f64) -> Option<f64> {
        None
    }
    /// Runs a prepared scene. Returns the relative error and the cost.
    fn solve(&self, scene: &Scene) -> Result<(f64, Cost), StudyError>;

    /// h of a level.
    fn spacing(&self, level: usize) -> f64 {
        self.cells()[level].recip()
    }

    /// Runs a setting.
    fn run(&self, setting: &Setting) -> Result<(f64, Cost), StudyError> {
        self.solve(&self.set(setting)?)
    }

    /// The scene of a setting.
    fn set(&self, setting: &Setting) -> Result<Scene, StudyError> {
        let mut scene = self.scene();
        scene["time"] = json!({ "end": self.end() });
        let spacing = setting.level.map(|level| self.spacing(level));
        if let Some(spacing) = spacing {
            scene["grid"]["spacing"] = spacing.into();
        }
        if let (Some(courant), Some(spacing)) = (setting.courant, spacing) {
            scene["time"]["step"] = (courant * spacing / self.speed()).min(self.end()).into();
        }
        let overrides: Vec<Override> = setting.keys.iter().map(|key| key.parse()).collect::<Result<_, _>>()?;
        let mut scene = scene::read(&scene.to_string(), &overrides)?;
        scene.time.step = whole_steps(scene.time.end, scene.time.step, self.samples());
        Ok(scene)
    }

    /// The value of a key in the scene of a setting.
    fn value(&self, setting: &Setting, key: &str) -> Option<Value> {
        let scene = self.set(setting).map_err(|error| chain(&*error)).ok()?;
        let scene = serde_json::to_value(scene).ok()?;
        let place = key.split('.').try_fold(&scene, |at, step| match step.parse::<usize>() {
            Ok(index) => at.get(index),
            Err(_) => at.get(step),
        });
        place.cloned()
    }
}

/// The longest step, at most `step`, that reaches `end` in a multiple of `samples` steps.
pub(super) fn whole_steps(end: f64, step: f64, samples: u64) -> f64 {
    let samples = samples as f64;
    end / (samples * (end / (step * samples) - 1e-9).ceil().max(1.0))
}

/// Whole steps of a scene.
fn steps(scene: &Scene) -> u64 {
    (scene.time.end / scene.time.step).round() as u64
}
