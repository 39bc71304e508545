//! The scene argument of a command, and `bfree check`.

use super::agreement::agreed;
use super::failure::{Failure, print, tell};
use super::probes::{Bound, bound_probes};
use crate::material::allow_library;
use crate::memory;
use crate::parallel::Processes;
use crate::particles::Particles;
use crate::plan::{DeviceUse, Plan, ProcessUse};
use crate::scene::{self, Override, Scene, SceneError};
use crate::simulation::Simulation;
use clap::Args;
use indicatif::BinaryBytes;
use std::cell::OnceCell;
use std::error::Error;
use std::path::{Path, PathBuf};

/// The scene file, and overrides of its keys.
#[derive(Args, Default)]
pub(super) struct SceneArguments {
    /// The scene, a JSON file.
    pub scene: PathBuf,
    /// Override one key of the scene, for example time.step=0.01 or approximation='"linear"'.
    #[arg(long = "set", value_name = "KEY.PATH=JSON")]
    pub overrides: Vec<String>,
    /// Let the scene load this shared library, a UMAT for example. Libraries run code, so no scene loads one by itself.
    #[arg(long = "allow-library", value_name = "PATH")]
    pub libraries: Vec<PathBuf>,
    /// The text of the scene, once it was read.
    #[arg(skip)]
    pub text: OnceCell<String>,
}

/// A scene that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", path.display())]
struct Unusable {
    path: PathBuf,
    source: Box<dyn Error>,
}

impl SceneArguments {
    /// Reads the scene, applies the overrides and validates the result.
    pub(crate) fn read(&self) -> Result<Scene, Failure> {
        self.libraries.iter().for_each(|path| allow_library(path));
        let overrides: Result<Vec<Override>, _> = self.overrides.iter().map(|text| text.parse()).collect();
        let overrides = overrides.map_err(Failure::scene)?;
        let text = self.text.get().cloned().map_or_else(|| scene::text(&self.scene), Ok);
        let read = text.and_then(|text| scene::read(self.text.get_or_init(|| text), &overrides));
        read.map_err(|error| match error {
            // `File` names the file already, and `Override` concerns an option: neither needs the path of the scene.
            SceneError::File { .. } | SceneError::Override(_) => Failure::scene(error),
            error => self.unusable(error),
        })
    }

    /// The folder of the scene, in which the files that it names are looked for.
    pub(crate) fn folder(&self) -> &Path {
        self.scene.parent().unwrap_or(Path::new("."))
    }

    /// Adds the path of the scene to an error.
    pub(crate) fn unusable(&self, error: impl Error + 'static) -> Failure {
        Failure::scene(Unusable { path: self.scene.clone(), source: Box::new(error) })
    }

    /// Builds the simulation at t = 0. Too little memory for its particles is an error.
    pub(crate) fn build<const D: usize>(&self, scene: &Scene) -> Result<Simulation<D>, Failure> {
        let memory = memory::available().unwrap_or(u64::MAX);
        scene.build_within::<D>(self.folder(), memory).map_err(|error| self.unusable(error))
    }

    /// [`Self::build`], together with other processes, which share the evaluation of the acceleration at t = 0.
    pub(crate) fn build_among<const D: usize>(
        &self,
        scene: &Scene,
        processes: &Processes,
    ) -> Result<Simulation<D>, Failure> {
        let memory = memory::available().unwrap_or(u64::MAX);
        let built = scene.build_unstarted::<D>(self.folder(), memory).map_err(|error| self.unusable(error));
        let mut simulation = agreed(processes, built)?;
        simulation.settings.processes = processes.clone();
        agreed(processes, Scene::start(&mut simulation).map_err(|error| self.unusable(error)))?;
        simulation.settings.processes = Processes::default();
        Ok(simulation)
    }

    /// The plan of a run: its terms and arrays. Too little memory for the arrays is an error.
    pub(crate) fn plan<const D: usize>(&self, simulation: &Simulation<D>) -> Result<Plan, Failure> {
        let plan = Plan::of(simulation).map_err(|error| self.unusable(error))?;
        // The particles are allocated already, but the plan counts them again.
        let particles = (simulation.particles.len() * Particles::<D>::BYTES) as u64;
        let memory = memory::available().map_or(u64::MAX, |bytes| bytes.saturating_add(particles));
        plan.check_fits(memory).map_err(|error| self.unusable(error))?;
        Ok(plan)
    }

    /// Lets the simulation run on the GPU. Returns the memory that it takes there, in words.
    ///
    /// # Errors
    /// There is no GPU, the scene does not run there, or it has too little memory.
    pub(crate) fn plan_on_gpu<const D: usize>(&self, simulation: &mut Simulation<D>) -> Result<String, Failure> {
        let gpu = simulation.use_gpu().map_err(Failure::scene)?;
        let needed = DeviceUse::of(simulation).map_err(|error| self.unusable(error))?;
        let free = needed.check_fits(&gpu).map_err(Failure::scene)?;
        let [bytes, free, sent] = [needed.bytes, free, needed.sent].map(|bytes| BinaryBytes(bytes as u64));
        let laws = match needed.sent {
            0 => "laws are evaluated there, too".to_owned(),
            _ => format!("laws are evaluated on the processor, which sends {sent} in each Newton iteration"),
        };
        Ok(format!("{bytes} on {}, where {free} are free; {laws}", gpu.name()))
    }

    /// Runs `bfree check`: prints the particles, plan, output and probes of the scene.
    pub(crate) fn check(&self, gpu: bool, ranks: Option<u64>) -> Result<(), Failure> {
        let scene = self.read()?;
        in_dimensions!(scene.dimension(), D => self.check_in::<D>(&scene, gpu, ranks))
    }

    fn check_in<const D: usize>(&self, scene: &Scene, gpu: bool, ranks: Option<u64>) -> Result<(), Failure> {
        let mut simulation = self.build::<D>(scene)?;
        let mut lines: Vec<String> = scene.title.iter().cloned().collect();
        lines.extend(what_accuracy_sets(scene).map(|set| format!("accuracy      {set}")));
        let (step, end) = (scene.time.step, scene.time.end);
        let steps = simulation.clock.whole_steps(end);
        let rest = simulation.clock.rest(end).map_or_else(String::new, |rest| format!(" and one of {rest:.6}"));
        lines.push(format!("steps         {steps} of {step}{rest} to t = {end}"));
        lines.extend(scene.filled(&simulation).iter().map(|body| format!("body          {body}")));
        let mut fields = simulation.bodies.iter().map(|body| body.field).collect::<Vec<_>>();
        fields.sort_unstable();
        fields.dedup();
        if simulation.bodies.len() > 1 && fields.len() < simulation.bodies.len() {
            let h = scene.grid.spacing;
            let felt = match scene.approximation.contact_distance() {
                Some([least, most]) => {
                    format!("{:.4} to {:.4} apart ({least} to {most} spacings)", least * h, most * h)
                }
                None => "how far was not measured for these functions".to_owned(),
            };
            let contact = "contact       bodies feel each other before their surfaces meet";
            lines.push(format!("{contact}: {felt}, see docs/src/limits.md"));
        }
        let plan = self.plan(&simulation)?;
        lines.push(plan.to_string());
        if let Some(ranks) = ranks {
            let each = ProcessUse::of(&simulation, &plan, ranks as usize).map_err(|error| self.unusable(error))?;
            lines.push(each.to_string());
        }
        if gpu {
            lines.push(format!("gpu           {}", self.plan_on_gpu(&mut simulation)?));
        }
        lines.push(format!("output        {}", written(scene)));
        let probes = bound_probes(scene, &simulation);
        lines.extend(probes.iter().map(|bound| format!("probe         {bound}")));
        for warning in probes.iter().filter_map(Bound::warning).chain(scene.warnings(&simulation)) {
            tell(format_args!("warning: {warning}"));
        }
        print(lines.join("\n"))
    }
}

/// The fields in the snapshots, in words. No other field is computed, except for probes.
fn written(scene: &Scene) -> String {
    let fields = scene.fields();
    let names: Vec<&str> = fields.iter().map(|field| field.name()).collect();
    match scene.output.every {
        Some(every) => format!("{} of all particles every {every}", names.join(", ")),
        None => "no snapshots (output.every): no field is computed of all particles".into(),
    }
}

/// The keys set by `accuracy`, on one line. `None` if the scene has no `accuracy`.
pub(crate) fn what_accuracy_sets(scene: &Scene) -> Option<String> {
    let accuracy = scene.accuracy?;
    let set: Vec<String> = scene.chosen.iter().map(ToString::to_string).collect();
    let set = if set.is_empty() { "nothing: the scene gives every key".to_owned() } else { set.join(", ") };
    Some(format!("{accuracy} sets {set}"))
}
