//! The symbols of a behaviour: its variables, properties and interface.

use std::ffi::{CStr, c_char, c_int, c_ushort};
use std::ops::Range;

use super::interface::Function;
use crate::convention::Components;
use crate::law::CallFailed;
use crate::library::c::Shared;
use crate::library::component;

/// The version of the interface: `NAME_api_version`.
const API_VERSION: c_ushort = 1;

/// Room temperature in kelvin, the default of `Temperature`.
const TEMPERATURE: f64 = 293.15;

/// A variable of a behaviour.
pub(super) struct Variable {
    name: String,
    kind: VariableKind,
}

enum VariableKind {
    Scalar,
    Vector(usize),
    /// A symmetric tensor with 3, 4 or 6 components.
    Symmetric(usize),
    Tensor(usize),
}

impl Variable {
    /// MFront's identifier of a type: 3 bits for the kind, 2 bits for the dimension, which is 0 if the hypothesis decides.
    fn new(name: String, identifier: c_int, plane_strain: bool) -> Result<Self, String> {
        let dimension = match (identifier >> 3) & 3 {
            0 if plane_strain => 2,
            0 => 3,
            dimension => dimension as usize,
        };
        let kind = match identifier & 7 {
            0 => VariableKind::Scalar,
            1 => VariableKind::Symmetric([0, 3, 4, 6][dimension]),
            2 => VariableKind::Vector(dimension),
            3 => VariableKind::Tensor([0, 3, 5, 9][dimension]),
            _ => return Err(format!("the variable `{name}` is of type {identifier}, which is not supported.")),
        };
        Ok(Self { name, kind })
    }

    /// A name for each number.
    pub fn components(&self) -> Vec<String> {
        let Self { name, kind } = self;
        let named = |pairs: &[(usize, usize)]| pairs.iter().map(|&pair| name.clone() + &component(pair)).collect();
        match kind {
            VariableKind::Scalar => vec![name.clone()],
            VariableKind::Vector(count) => (1..=*count).map(|number| format!("{name}{number}")).collect(),
            VariableKind::Symmetric(count) => named(&Components::mfront().pairs[..*count]),
            VariableKind::Tensor(count) => named(&Components::mfront_gradient().pairs[..*count]),
        }
    }
}

/// The symbols of a behaviour.
pub(super) struct Symbols {
    pub library: Shared,
    pub name: String,
    pub plane_strain: bool,
}

impl Symbols {
    fn hypothesis(&self) -> &'static str {
        if self.plane_strain { "PlaneStrain" } else { "Tridimensional" }
    }

    pub fn function(&self) -> Result<Function, CallFailed> {
        let name = format!("{}_{}", self.name, self.hypothesis());
        // Sound: a function pointer has the size of a symbol's address; `check_interface` sees whether the function is a behaviour.
        #[allow(unsafe_code)]
        let function = unsafe { self.library.symbol::<Function>(&name) };
        function.ok_or_else(|| self.library.missing(&[&name]))
    }

    /// A variable of type `unsigned short`.
    fn number(&self, name: &str) -> Option<c_ushort> {
        // Sound: the interface gives all symbols that are asked for here this type.
        #[allow(unsafe_code)]
        unsafe {
            self.library.value::<c_ushort>(name)
        }
    }

    /// A number whose symbol may carry the hypothesis in its name.
    fn either(&self, suffix: &str) -> Result<c_ushort, CallFailed> {
        let names = self.names_of(suffix);
        let number = names.iter().find_map(|name| self.number(name));
        number.ok_or_else(|| self.library.missing(&[&names[0], &names[1]]))
    }

    fn names_of(&self, suffix: &str) -> [String; 2] {
        [format!("{}_{}_{suffix}", self.name, self.hypothesis()), format!("{}_{suffix}", self.name)]
    }

    /// A variable of type `const char *`.
    pub fn pointer(&self, name: &str) -> Option<String> {
        // Sound: the interface gives all symbols that are asked for here this type; the texts end with a zero.
        #[allow(unsafe_code)]
        unsafe {
            let text = self.library.value::<*const c_char>(name).filter(|text| !text.is_null())?;
            Some(CStr::from_ptr(text).to_string_lossy().into_owned())
        }
    }

    /// The array `NAME_suffix` of `NAME_nsuffix` texts.
    fn names(&self, suffix: &str) -> Result<Vec<String>, CallFailed> {
        let count = self.either(&format!("n{suffix}"))? as usize;
        if count == 0 {
            return Ok(Vec::new());
        }
        let symbols = self.names_of(suffix);
        // Sound: the interface gives the symbol this type and this number of texts.
        #[allow(unsafe_code)]
        let texts = symbols.iter().find_map(|name| unsafe {
            let texts = self.library.symbol::<*const *const c_char>(name)?;
            let texts = std::slice::from_raw_parts(texts, count);
            Some(texts.iter().map(|&text| CStr::from_ptr(text).to_string_lossy().into_owned()).collect())
        });
        texts.ok_or_else(|| self.library.missing(&[&symbols[0], &symbols[1]]))
    }

    /// The array `NAME_suffixTypes` of `count` numbers; scalars if it is missing.
    fn types(&self, suffix: &str, count: usize) -> Vec<c_int> {
        let symbols = self.names_of(&format!("{suffix}Types"));
        // Sound: the interface gives the symbol this type and, if `count` is not zero, this number of entries.
        #[allow(unsafe_code)]
        let types = symbols.iter().filter(|_| count > 0).find_map(|name| unsafe {
            let types = self.library.symbol::<*const c_int>(name)?;
            Some(std::slice::from_raw_parts(types, count).to_vec())
        });
        types.unwrap_or_else(|| vec![0; count])
    }

    pub fn variables(&self, suffix: &str) -> Result<Vec<Variable>, CallFailed> {
        let names = self.names(suffix)?;
        let types = self.types(suffix, names.len());
        let variables = names.into_iter().zip(types).map(|(name, kind)| Variable::new(name, kind, self.plane_strain));
        variables.collect::<Result<_, _>>().map_err(|sentence| self.library.says(sentence))
    }

    pub fn check_interface(&self) -> Result<(), CallFailed> {
        let name = &self.name;
        let entry = format!("{name}_mfront_ept");
        self.pointer(&entry).ok_or_else(|| self.library.missing(&[&entry]))?;
        let interface = self.pointer(&format!("{name}_mfront_interface")).unwrap_or_default();
        if !interface.eq_ignore_ascii_case("generic") {
            let wanted = "compile it with `mfront --interface=generic`.";
            return Err(self.library.says(format!("{name} is for MFront's interface `{interface}`; {wanted}")));
        }
        match self.number(&format!("{name}_api_version")).unwrap_or(0) {
            API_VERSION => Ok(()),
            version => {
                let wanted = format!("{API_VERSION} is needed. Compile it with TFEL 3.4.1, 4.0 or later.");
                Err(self.library.says(format!("{name} has version {version} of MFront's interface; {wanted}")))
            }
        }
    }

    /// Whether the gradient is F and not the strain.
    pub fn finite_strain(&self) -> Result<bool, CallFailed> {
        let kind = self.either("BehaviourType")?;
        let kinematic = self.either("BehaviourKinematic")?;
        let gradients = self.names("Gradients")?;
        let forces = self.names("ThermodynamicForces")?;
        match (kind, kinematic, gradients.as_slice(), forces.as_slice()) {
            (1, 1, [gradient], [force]) if gradient == "Strain" && force == "Stress" => Ok(false),
            (2, 3, [gradient], [force]) if gradient == "DeformationGradient" && force == "Stress" => Ok(true),
            _ => Err(self.library.says(format!(
                "{} has type {kind}, kinematic {kinematic} and gradients {}. Only behaviours of small strain (1, 1, \
                 Strain) and finite strain (2, 3, DeformationGradient) are supported.",
                self.name,
                gradients.join(", ")
            ))),
        }
    }

    /// The names of the properties. A behaviour that needs the stiffness takes the elastic properties first, as MGIS does.
    pub fn properties(&self) -> Result<Vec<String>, CallFailed> {
        let mut names: Vec<&str> = Vec::new();
        if self.either("requiresStiffnessTensor")? == 1 {
            match (self.either("ElasticSymmetryType")?, self.plane_strain) {
                (0, _) => names.extend(["YoungModulus", "PoissonRatio"]),
                (_, plane_strain) => {
                    names.extend(["YoungModulus1", "YoungModulus2", "YoungModulus3"]);
                    names.extend(["PoissonRatio12", "PoissonRatio23", "PoissonRatio13", "ShearModulus12"]);
                    names.extend(["ShearModulus23", "ShearModulus13"].into_iter().filter(|_| !plane_strain));
                }
            }
        }
        if self.either("requiresThermalExpansionCoefficientTensor")? == 1 {
            let isotropic = self.either("SymmetryType")? == 0;
            let orthotropic = ["ThermalExpansion1", "ThermalExpansion2", "ThermalExpansion3"];
            names.extend(if isotropic { &["ThermalExpansion"][..] } else { &orthotropic });
        }
        let mut names: Vec<String> = names.into_iter().map(String::from).collect();
        names.extend(self.names("MaterialProperties")?);
        Ok(names)
    }

    /// The values of the external state variables. The temperature is the first, unless the behaviour says that it lists it itself.
    pub fn external(&self, given: &[(String, f64)]) -> Result<Vec<f64>, CallFailed> {
        let listed = self.number(&format!("{}_TemperatureRemovedFromExternalStateVariables", self.name)) == Some(0);
        let temperature = Some("Temperature".to_string()).filter(|_| !listed);
        let variables = self.variables("ExternalStateVariables")?;
        let names = variables.iter().flat_map(|variable| variable.components());
        let value = |name: String| match given.iter().find(|(known, _)| *known == name) {
            Some((_, value)) => Ok(*value),
            None if name == "Temperature" => Ok(TEMPERATURE),
            None => Err(self.library.says(format!("{} needs the value of the external variable {name}.", self.name))),
        };
        temperature.into_iter().chain(names).map(value).collect()
    }

    /// The places of symmetric tensors. Other tensors of a small strain behaviour would have to be rotated, too.
    pub fn symmetric(&self, variables: &[Variable]) -> Result<Vec<Range<usize>>, CallFailed> {
        let mut start = 0;
        let mut places = Vec::new();
        for variable in variables {
            let count = variable.components().len();
            match variable.kind {
                VariableKind::Scalar => {}
                VariableKind::Symmetric(size) if size == if self.plane_strain { 4 } else { 6 } => {
                    places.push(start..start + count);
                }
                _ => {
                    let what = "is neither a scalar nor a symmetric tensor; how it turns with the material is unknown";
                    return Err(self.library.says(format!("the variable `{}` {what}.", variable.name)));
                }
            }
            start += count;
        }
        Ok(places)
    }
}
