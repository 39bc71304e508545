//! The keys of laws from shared libraries, and the permission to load a library.

use super::Foreign;
use crate::parallel::held;
use crate::problems::Problems;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tangent_check::convention::Measure;
use tangent_check::law::CallFailed;
use tangent_check::library::{Description, Kind, StressState};

/// Libraries that scenes may load.
static ALLOWED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Lets scenes load this library. A scene is data, and runs code only with this permission, which `--allow-library` gives on the command
/// line. A scene names the library by the last components of `path`.
pub fn allow_library(path: &Path) {
    // A path without a folder would be looked for in the folders of the system.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    held(&ALLOWED).push(path);
}

/// The path of an allowed library that ends with `name`.
fn allowed(name: &Path) -> Option<PathBuf> {
    held(&ALLOWED).iter().find(|path| path.ends_with(name)).cloned()
}

/// The internal variables of a law that does not name them itself.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InternalVariables {
    /// Their names, in the order of the law: the fields of outputs. A name `plastic_strain` marks the particles that yield.
    pub names: Vec<String>,
    /// Their values in a body at rest. Default: zeros.
    pub at_rest: Option<Vec<f64>>,
}

/// The meaning of DDSDDE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TangentOf {
    /// The Jaumann rate of the Kirchhoff stress over J, as Abaqus asks at finite strain.
    #[default]
    JaumannKirchhoff,
    /// The Jaumann rate of the Cauchy stress.
    JaumannCauchy,
    /// The derivative of the Cauchy stress with respect to DSTRAN, the rotation held: laws that were written for small strain.
    Strain,
}

impl TangentOf {
    /// The measure of the crate `tangent-check`.
    pub(crate) fn measure(self) -> Measure {
        match self {
            Self::JaumannKirchhoff => Measure::JaumannKirchhoff,
            Self::JaumannCauchy => Measure::JaumannCauchy,
            Self::Strain => Measure::CauchyByStrain,
        }
    }
}

/// A UMAT of Abaqus/Standard.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Umat")]
#[serde(deny_unknown_fields)]
pub struct UmatParameters {
    /// The file name of the shared library. The option `--allow-library PATH` permits its use, and says where it is.
    pub library: PathBuf,
    /// PROPS, in the units of the scene.
    #[serde(default)]
    pub properties: Vec<f64>,
    /// STATEV.
    #[serde(default)]
    pub state: InternalVariables,
    /// The meaning of DDSDDE.
    #[serde(default)]
    pub tangent: TangentOf,
    /// CMNAME, at most 80 characters. Default `"BFREE"`.
    #[serde(default = "UmatParameters::default_name")]
    #[schemars(length(max = 80))]
    pub name: String,
    /// TEMP, constant. Default 0.
    #[serde(default)]
    pub temperature: f64,
    /// Whether the law is called with four components (NTENS = 4), in one and two dimensions. Default false: six.
    #[serde(default)]
    pub plane_strain: bool,
    /// Whether the tangent has major symmetry, so that conjugate gradients may be used. Default false.
    #[serde(default)]
    pub symmetric: bool,
}

impl UmatParameters {
    fn default_name() -> String {
        "BFREE".to_owned()
    }
}

/// A behaviour of MFront, built with the interface `generic`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "Mfront")]
#[serde(deny_unknown_fields)]
pub struct MfrontParameters {
    /// The file name of the shared library. The option `--allow-library PATH` permits its use, and says where it is.
    pub library: PathBuf,
    /// The name of the behaviour.
    pub behaviour: String,
    /// The material properties, in the order of the behaviour and the units of the scene.
    #[serde(default)]
    pub properties: Vec<f64>,
    /// External state variables, such as `"Temperature"`, constant.
    #[serde(default)]
    pub external: BTreeMap<String, f64>,
    /// Whether the hypothesis is plane strain, in one and two dimensions. Default false: three dimensions.
    #[serde(default)]
    pub plane_strain: bool,
    /// Whether the tangent has major symmetry, so that conjugate gradients may be used. Default false.
    #[serde(default)]
    pub symmetric: bool,
}

/// A law in C, C++ or Fortran with the header `bfree_law.h`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(rename = "CLaw")]
#[serde(deny_unknown_fields)]
pub struct CLawParameters {
    /// The file name of the shared library. The option `--allow-library PATH` permits its use, and says where it is.
    pub library: PathBuf,
    /// The name of the law.
    pub law: String,
    /// The properties, in the order of the law and the units of the scene.
    #[serde(default)]
    pub properties: Vec<f64>,
    /// Whether the tangent has major symmetry, so that conjugate gradients may be used. Default false.
    #[serde(default)]
    pub symmetric: bool,
}

fn stress_state(plane_strain: bool) -> StressState {
    if plane_strain { StressState::PlaneStrain } else { StressState::Solid }
}

/// The keys of a law from a library.
pub(crate) trait Outside {
    /// The library and how to call it, with the path as the scene gives it, and whether the tangent has major symmetry.
    fn description(&self) -> (Description, bool);

    /// Checks values that no type excludes. `false` if one is not allowed; `problems` then says why.
    fn check(&self, _problems: &mut Problems, _path: &str) -> bool {
        true
    }

    /// Opens the library. `None` if it is not allowed or cannot be used; `problems` then says why.
    fn open(&self, problems: &mut Problems, path: &str) -> Option<Foreign> {
        if !self.check(problems, path) {
            return None;
        }
        let (named, symmetric) = self.description();
        let (path, shown) = (format!("{path}.library"), named.library.display().to_string());
        let Some(library) = allowed(&named.library) else {
            let wanted = "must be allowed, because a scene is data and loads no code: add --allow-library PATH to the command line, in \
                          Python Scene(…, allow_libraries=[PATH])";
            problems.refuse(&path, shown, wanted);
            return None;
        };
        let opened = Foreign::open(Description { library, ..named }, symmetric);
        let unusable = |why| format!("must be a library that can be used: {why}");
        opened.map_err(|CallFailed(why)| problems.refuse(&path, shown, unusable(why))).ok()
    }
}

impl Outside for UmatParameters {
    fn description(&self) -> (Description, bool) {
        let zeros = vec![0.0; self.state.names.len()];
        let at_rest = self.state.at_rest.as_ref().unwrap_or(&zeros);
        let description = Description {
            library: self.library.clone(),
            kind: Kind::Umat {
                material: self.name.clone(),
                tangent: self.tangent.measure(),
                temperature: self.temperature,
            },
            properties: self.properties.clone(),
            state: self.state.names.iter().cloned().zip(at_rest.iter().copied()).collect(),
            stress_state: stress_state(self.plane_strain),
        };
        (description, self.symmetric)
    }

    fn check(&self, problems: &mut Problems, path: &str) -> bool {
        let names = self.state.names.len();
        let values = self.state.at_rest.as_ref().map_or(names, Vec::len);
        let wanted = format_args!("must have a value for each of the {names} names");
        problems.require(values == names, &format!("{path}.state.at_rest"), format_args!("a list of {values}"), wanted)
    }
}

impl Outside for MfrontParameters {
    fn description(&self) -> (Description, bool) {
        let external = self.external.iter().map(|(name, value)| (name.clone(), *value)).collect();
        let description = Description {
            library: self.library.clone(),
            kind: Kind::Mfront { name: self.behaviour.clone(), external },
            properties: self.properties.clone(),
            state: Vec::new(),
            stress_state: stress_state(self.plane_strain),
        };
        (description, self.symmetric)
    }
}

impl Outside for CLawParameters {
    fn description(&self) -> (Description, bool) {
        let description = Description {
            library: self.library.clone(),
            kind: Kind::C { name: self.law.clone() },
            properties: self.properties.clone(),
            state: Vec::new(),
            stress_state: StressState::Solid,
        };
        (description, self.symmetric)
    }
}
