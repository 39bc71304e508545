//! Scenes: read, checked, built.

use crate::law::{BodyLaw, Law};
use crate::model::{Model, Sized};
use crate::simulation::Simulation;
use crate::{SceneError, chain, scene_error};
use bfree::memory;
use bfree::output::Reference;
use bfree::plan::Plan;
use bfree::scene;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict, PyMapping};
use std::collections::HashMap;
use std::path::PathBuf;

/// A scene that has been read and checked.
#[pyclass(frozen, module = "bfree")]
pub struct Scene {
    scene: scene::Scene,
    /// Where the files it names are looked for.
    folder: PathBuf,
}

/// JSON of what Python holds; arrays and numbers of NumPy as lists and numbers.
fn json(value: &Bound<'_, PyAny>) -> PyResult<String> {
    let py = value.py();
    let to_list = py.import("operator")?.call_method1("methodcaller", ("tolist",))?;
    py.import("json")?.call_method("dumps", (value,), Some(&[("default", to_list)].into_py_dict(py)?))?.extract()
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (source, *, set = None, folder = None, allow_libraries = Vec::new()))]
    fn new(
        source: &Bound<'_, PyAny>,
        set: Option<&Bound<'_, PyDict>>,
        folder: Option<PathBuf>,
        allow_libraries: Vec<PathBuf>,
    ) -> PyResult<Self> {
        allow_libraries.iter().for_each(|path| bfree::material::allow_library(path));
        let mut overrides = Vec::new();
        for (key, value) in set.into_iter().flatten() {
            let text = format!("{}={}", key.extract::<String>()?, json(&value)?);
            overrides.push(text.parse().map_err(|error| scene_error(&error))?);
        }
        if let Ok(scene) = source.cast::<PyMapping>() {
            // A mapping that is no dict is none for JSON either.
            let text = json(source.py().get_type::<PyDict>().call1((scene,))?.as_any())?;
            let scene = scene::read(&text, &overrides).map_err(|error| scene_error(&error))?;
            return Ok(Self { scene, folder: folder.unwrap_or_else(|| PathBuf::from(".")) });
        }
        let path: PathBuf = source.extract().map_err(|_| PyTypeError::new_err("a scene is a path or a dict"))?;
        let scene = scene::read_file(&path, &overrides).map_err(|error| match error {
            // The one names the file, the other is about `set`.
            scene::SceneError::File { .. } | scene::SceneError::Override(_) => scene_error(&error),
            error => SceneError::new_err(format!("{}: {}", path.display(), chain(&error))),
        })?;
        let beside = path.parent().map(PathBuf::from).unwrap_or_default();
        Ok(Self { scene, folder: folder.unwrap_or(beside) })
    }

    /// 1, 2 or 3.
    #[getter]
    fn dimension(&self) -> usize {
        self.scene.dimension()
    }

    /// All of its keys, with the values of those that were left out.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(&self.scene).map_err(|error| scene_error(&error))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    /// The simulation at its start.
    #[pyo3(signature = (*, laws = None, gpu = false))]
    fn build(&self, py: Python<'_>, laws: Option<HashMap<String, Py<Law>>>, gpu: bool) -> PyResult<Simulation> {
        let laws: HashMap<String, BodyLaw> =
            laws.into_iter().flatten().map(|(name, law)| (name, BodyLaw::Energy(law.get().law.clone()))).collect();
        let bodies: Vec<&str> = self.scene.bodies.iter().map(|body| body.name.as_str()).collect();
        if let Some(unknown) = laws.keys().find(|name| !bodies.contains(&name.as_str())) {
            return Err(SceneError::new_err(format!("laws: no body is called {unknown:?}; the bodies are {bodies:?}")));
        }
        py.detach(|| match self.scene.dimension() {
            1 => self.build_in::<1>(&laws, gpu),
            2 => self.build_in::<2>(&laws, gpu),
            _ => self.build_in::<3>(&laws, gpu),
        })
    }

    fn __repr__(&self) -> String {
        let bodies: Vec<&str> = self.scene.bodies.iter().map(|body| body.name.as_str()).collect();
        let title = self.scene.title.as_deref().unwrap_or("no title");
        format!("<scene in {} dimensions of {}: {title}>", self.scene.dimension(), bodies.join(", "))
    }
}

impl Scene {
    fn build_in<const D: usize>(&self, laws: &HashMap<String, BodyLaw>, gpu: bool) -> PyResult<Simulation> {
        let available = || memory::available().unwrap_or(u64::MAX);
        let simulation =
            self.scene.build_within::<D>(&self.folder, available()).map_err(|error| scene_error(&error))?;
        let mut simulation = simulation.with_laws(|body| match laws.get(&body.name) {
            Some(law) => law.clone(),
            None => BodyLaw::Shipped(body.law.clone()),
        });
        if gpu {
            simulation.use_gpu().map_err(|error| scene_error(&error))?;
        }
        let plan = Plan::of(&simulation).map_err(|error| scene_error(&error))?;
        plan.check_fits(available()).map_err(|error| scene_error(&error))?;
        let start = Reference::of(&simulation);
        let bodies = simulation.bodies.iter().map(|body| body.name.clone()).collect();
        let model: Box<dyn Model> = Box::new(Sized { simulation, start });
        Ok(Simulation::new(model, self.scene.time.end, bodies, plan.to_string()))
    }
}
