//! Behaviours of MFront's interface `generic`, as MGIS calls them.
//!
//! Source: the structures of `BehaviourDataView.hxx` and `StateView.hxx` of MGIS 3.1 (December 2025), which are those of
//! `GenericBehaviour/BehaviourData.h` and `State.h` of TFEL 5.1.0, API version 1. The structure has been the same since TFEL 3.4.1 and 4.0.
//!
//! A finite strain behaviour gives P and ∂P/∂F (`K[1] = 2`, `K[2] = 2`). A small strain behaviour gives σ and ∂σ/∂ε; its stress and symmetric
//! internal variables are rotated by DROT before the call. Components are in MFront's order: 11, 22, 33, 12, 21, 13, 31, 23, 32; symmetric
//! tensors 11, 22, 33, √2·12, √2·13, √2·23. The axes of an orthotropic material are those of the scene.

use std::ffi::{CStr, c_char, c_int, c_ushort};
use std::ops::Range;

use crate::convention::{Components, Convention, Measure};
use crate::law::{CallFailed, Response, Step};

use super::arena::Arena;
use super::c::{Shared, text};
use super::{
    Caller, Description, Kind, Signature, check_input, check_output, check_plane, check_properties, component, failed,
    resize, rotate, values_at_rest,
};

/// `mfront_gb_State`, and `mfront_gb_InitialState`, whose layout is the same.
#[repr(C)]
struct State {
    gradients: *const f64,
    thermodynamic_forces: *mut f64,
    mass_density: *const f64,
    material_properties: *const f64,
    internal_state_variables: *mut f64,
    stored_energy: *mut f64,
    dissipated_energy: *mut f64,
    external_state_variables: *const f64,
}

/// `mfront_gb_BehaviourData`.
#[repr(C)]
struct BehaviourData {
    error_message: *mut c_char,
    dt: f64,
    tangent: *mut f64,
    rdt: *mut f64,
    speed_of_sound: *mut f64,
    before: State,
    after: State,
}

type Function = unsafe extern "C" fn(*mut BehaviourData) -> c_int;

/// The version of the interface: `NAME_api_version`.
const API_VERSION: c_ushort = 1;

/// The room for a message, as the header demands.
const MESSAGE: usize = 512;

/// Room temperature in kelvin, the default of `Temperature`.
const TEMPERATURE: f64 = 293.15;

/// The indices of the arrays in the arena.
#[derive(Clone, Copy)]
enum Array {
    GradientsBefore,
    ForcesBefore,
    StateBefore,
    Gradients,
    Forces,
    State,
    Tangent,
    Properties,
    External,
    /// Time step factor, speed of sound, mass density.
    Scalars,
    /// Stored and dissipated energy before the step, then after it.
    Energies,
}

/// A loaded behaviour.
pub struct Behaviour {
    function: Function,
    arena: Arena,
    signature: Signature,
    finite_strain: bool,
    /// The places of symmetric tensors among the internal variables of a small strain behaviour.
    symmetric: Vec<Range<usize>>,
    plane_strain: bool,
    /// Keeps the function in memory.
    _library: Shared,
}

impl Behaviour {
    /// Loads the library and reads the behaviour's symbols.
    ///
    /// # Errors
    /// See [`super::open`]. The behaviour is neither of small nor of finite strain, or has variables of other types than scalars, vectors and
    /// tensors.
    pub fn open(description: &Description) -> Result<Self, CallFailed> {
        let Kind::Mfront { name, external } = &description.kind else {
            return Err(CallFailed("The description is not that of a behaviour of MFront.".into()));
        };
        let symbols = Symbols {
            library: Shared::open(&description.library)?,
            name: name.clone(),
            plane_strain: description.plane_strain,
        };
        let function = symbols.function()?;
        symbols.check_interface()?;
        let finite_strain = symbols.finite_strain()?;
        let properties = symbols.properties()?;
        check_properties(description, &properties)?;
        let variables = symbols.variables("InternalStateVariables")?;
        let symmetric = if finite_strain { Vec::new() } else { symbols.symmetric(&variables)? };
        let state: Vec<String> = variables.iter().flat_map(|variable| variable.components()).collect();
        let state_at_rest = values_at_rest(description, &state, vec![0.0; state.len()])?;
        let convention = convention(finite_strain, description.plane_strain);
        let external = symbols.external(external)?;
        let source = symbols.pointer(&format!("{name}_src")).map_or(String::new(), |file| format!(" from {file}"));
        let mut arena = arena(&convention, state.len(), properties.len(), external.len());
        arena.get_mut(Array::Properties as usize).copy_from_slice(&description.properties);
        arena.get_mut(Array::External as usize).copy_from_slice(&external);
        let name = format!("{}, {name}{source}", description.library.display());
        Ok(Self {
            function,
            arena,
            signature: Signature { name, convention, properties, state, state_at_rest },
            finite_strain,
            symmetric,
            plane_strain: description.plane_strain,
            _library: symbols.library,
        })
    }

    fn write(&mut self, step: &Step) {
        let Convention { stress, strain, .. } = &self.signature.convention;
        let [before, after] = if self.finite_strain {
            [step.gradient_before, step.gradient]
        } else {
            let sum = |i: usize, j: usize| step.strain[i][j] + step.strain_increment[i][j];
            [step.strain, std::array::from_fn(|i| std::array::from_fn(|j| sum(i, j)))]
        };
        super::write_components(&before, strain, self.arena.get_mut(Array::GradientsBefore as usize));
        super::write_components(&after, strain, self.arena.get_mut(Array::Gradients as usize));
        for index in [Array::ForcesBefore, Array::Forces] {
            let forces = self.arena.get_mut(index as usize);
            forces.copy_from_slice(&step.stress);
            if !self.finite_strain {
                rotate(forces, stress, &step.rotation);
            }
        }
        for index in [Array::StateBefore, Array::State] {
            let state = self.arena.get_mut(index as usize);
            state.copy_from_slice(&step.state);
            for tensor in &self.symmetric {
                rotate(&mut state[tensor.clone()], stress, &step.rotation);
            }
        }
        self.arena.get_mut(Array::Scalars as usize).copy_from_slice(&[1.0, 0.0, 0.0]);
        self.arena.get_mut(Array::Energies as usize).fill(0.0);
        let tangent = self.arena.get_mut(Array::Tangent as usize);
        tangent.fill(0.0);
        // Consistent tangent; first Piola–Kirchhoff stress; its derivative by F.
        tangent[..3].copy_from_slice(&[4.0, 2.0, 2.0]);
    }

    fn invoke(&mut self, length: f64, message: &mut [c_char; MESSAGE]) -> c_int {
        let [f_n, forces_n, state_n, f, forces, state, tangent, properties, external, scalars, energies] =
            self.arena.pointers();
        let side = |gradients, thermodynamic_forces, internal_state_variables, energies: *mut f64| State {
            gradients,
            thermodynamic_forces,
            mass_density: scalars.wrapping_add(2),
            material_properties: properties,
            internal_state_variables,
            stored_energy: energies,
            dissipated_energy: energies.wrapping_add(1),
            external_state_variables: external,
        };
        let mut data = BehaviourData {
            error_message: message.as_mut_ptr(),
            dt: length,
            tangent,
            rdt: scalars,
            speed_of_sound: scalars.wrapping_add(1),
            before: side(f_n, forces_n, state_n, energies),
            after: side(f, forces, state, energies.wrapping_add(2)),
        };
        // Sound if the behaviour keeps to the interface: its API version was checked, the arrays have the sizes of its symbols, and they live
        // until the call returns. The child process protects from libraries that do not.
        #[allow(unsafe_code)]
        unsafe {
            (self.function)(&mut data)
        }
    }
}

impl Caller for Behaviour {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn call(&mut self, step: &Step, response: &mut Response) -> Result<(), CallFailed> {
        check_input(step, &self.signature)?;
        if self.plane_strain {
            check_plane(step)?;
        }
        self.write(step);
        let mut message = [0; MESSAGE];
        let status = self.invoke(step.length, &mut message);
        self.arena.check().map_err(|sentence| failed(step, sentence))?;
        if status != 1 {
            let factor = self.arena.get(Array::Scalars as usize)[0];
            let message = text(&message);
            let kind = if status == 0 { "calls its result unreliable" } else { "refuses the step" };
            let asks = format!("and asks for {factor} of the step");
            return Err(failed(step, format!("the behaviour {kind} (status {status}) {asks}: {message}")));
        }
        resize(response, &self.signature);
        let tangent = &mut response.tangent.entries;
        let size = tangent.len();
        tangent.copy_from_slice(&self.arena.get(Array::Tangent as usize)[..size]);
        response.stress.copy_from_slice(self.arena.get(Array::Forces as usize));
        response.state.copy_from_slice(self.arena.get(Array::State as usize));
        check_output(step, &self.signature, response)
    }
}

/// MFront's symmetric tensors: 11, 22, 33, √2·12, √2·13, √2·23, or the first four in plane strain.
pub fn symmetric(plane_strain: bool) -> Components {
    super::umat::components(plane_strain, std::f64::consts::SQRT_2)
}

/// MFront's tensors: 11, 22, 33, 12, 21, 13, 31, 23, 32, or the first five in plane strain.
pub fn full(plane_strain: bool) -> Components {
    let count = if plane_strain { 5 } else { 9 };
    let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)];
    Components { pairs: pairs[..count].to_vec(), shear: 1.0 }
}

fn convention(finite_strain: bool, plane_strain: bool) -> Convention {
    let (measure, components) = if finite_strain {
        (Measure::PiolaByGradient, full(plane_strain))
    } else {
        (Measure::CauchyByStrain, symmetric(plane_strain))
    };
    Convention { measure, stress: components.clone(), strain: components }
}

fn arena(convention: &Convention, state: usize, properties: usize, external: usize) -> Arena {
    let size = convention.stress.pairs.len();
    Arena::new(&[
        ("the gradients before the step", size),
        ("the thermodynamic forces before the step", size),
        ("the internal state variables before the step", state),
        ("the gradients", size),
        ("the thermodynamic forces", size),
        ("the internal state variables", state),
        ("K", size * size),
        ("the material properties", properties),
        ("the external state variables", external),
        ("the scalars rdt, speed of sound and mass density", 3),
        ("the energies", 4),
    ])
}

/// A variable of a behaviour.
struct Variable {
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
    fn components(&self) -> Vec<String> {
        let Self { name, kind } = self;
        let named = |pairs: &[(usize, usize)]| pairs.iter().map(|&pair| name.clone() + &component(pair)).collect();
        match kind {
            VariableKind::Scalar => vec![name.clone()],
            VariableKind::Vector(count) => (1..=*count).map(|number| format!("{name}{number}")).collect(),
            VariableKind::Symmetric(count) => named(&symmetric(false).pairs[..*count]),
            VariableKind::Tensor(count) => named(&full(false).pairs[..*count]),
        }
    }
}

/// The symbols of a behaviour.
struct Symbols {
    library: Shared,
    name: String,
    plane_strain: bool,
}

impl Symbols {
    fn hypothesis(&self) -> &'static str {
        if self.plane_strain { "PlaneStrain" } else { "Tridimensional" }
    }

    fn function(&self) -> Result<Function, CallFailed> {
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
    fn pointer(&self, name: &str) -> Option<String> {
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

    fn variables(&self, suffix: &str) -> Result<Vec<Variable>, CallFailed> {
        let names = self.names(suffix)?;
        let types = self.types(suffix, names.len());
        let variables = names.into_iter().zip(types).map(|(name, kind)| Variable::new(name, kind, self.plane_strain));
        variables.collect::<Result<_, _>>().map_err(|sentence| self.library.says(sentence))
    }

    fn check_interface(&self) -> Result<(), CallFailed> {
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
    fn finite_strain(&self) -> Result<bool, CallFailed> {
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
    fn properties(&self) -> Result<Vec<String>, CallFailed> {
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
    fn external(&self, given: &[(String, f64)]) -> Result<Vec<f64>, CallFailed> {
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
    fn symmetric(&self, variables: &[Variable]) -> Result<Vec<Range<usize>>, CallFailed> {
        let mut start = 0;
        let mut places = Vec::new();
        for variable in variables {
            let count = variable.components().len();
            match variable.kind {
                VariableKind::Scalar => {}
                VariableKind::Symmetric(size) if size == symmetric(self.plane_strain).pairs.len() => {
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
