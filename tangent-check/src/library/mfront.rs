//! Behaviours of MFront's interface `generic`, as MGIS calls them.
//!
//! Source: the structures of `BehaviourDataView.hxx` and `StateView.hxx` of MGIS 3.1 (December 2025), which are those of
//! `GenericBehaviour/BehaviourData.h` and `State.h` of TFEL 5.1.0, API version 1. The structure has been the same since TFEL 3.4.1 and 4.0.
//!
//! A finite strain behaviour gives P and ∂P/∂F (`K[1] = 2`, `K[2] = 2`). A small strain behaviour gives σ and ∂σ/∂ε; its stress and symmetric
//! internal variables are rotated by DROT before the call. Components are in MFront's order: 11, 22, 33, 12, 21, 13, 31, 23, 32; symmetric
//! tensors 11, 22, 33, √2·12, √2·13, √2·23. The axes of an orthotropic material are those of the scene.

mod interface;
mod symbols;

use std::ffi::{c_char, c_int};
use std::ops::Range;

use crate::convention::{Components, Convention, Measure};
use crate::law::{CallFailed, Response, Step};
use crate::tensor::sum;

use super::arena::{Arena, arrays};
use super::c::{Shared, text};
use super::{
    Caller, Description, Kind, Signature, StressState, check_input, check_output, check_plane, check_properties,
    failed, resize, rotate, values_at_rest,
};
use interface::{BehaviourData, Function, State};
use symbols::Symbols;

/// The room for a message, as the header demands.
const MESSAGE: usize = 512;

arrays! {
    (size, state, properties, external):
    GradientsBefore "the gradients before the step" size,
    ForcesBefore "the thermodynamic forces before the step" size,
    StateBefore "the internal state variables before the step" state,
    Gradients "the gradients" size,
    Forces "the thermodynamic forces" size,
    State "the internal state variables" state,
    Tangent "K" size * size,
    Properties "the material properties" properties,
    External "the external state variables" external,
    /// Time step factor, speed of sound, mass density.
    Scalars "the scalars rdt, speed of sound and mass density" 3,
    /// Stored and dissipated energy before the step, then after it.
    Energies "the energies" 4,
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
        let plane_strain = match description.stress_state {
            StressState::Solid => false,
            StressState::PlaneStrain => true,
            StressState::PlaneStress => {
                return Err(CallFailed(
                    "Behaviours of MFront are called in three dimensions and in plane strain, not in plane stress."
                        .into(),
                ));
            }
        };
        let symbols = Symbols { library: Shared::open(&description.library)?, name: name.clone(), plane_strain };
        let function = symbols.function()?;
        symbols.check_interface()?;
        let finite_strain = symbols.finite_strain()?;
        let properties = symbols.properties()?;
        check_properties(description, &properties)?;
        let variables = symbols.variables("InternalStateVariables")?;
        let symmetric = if finite_strain { Vec::new() } else { symbols.symmetric(&variables)? };
        let state: Vec<String> = variables.iter().flat_map(|variable| variable.components()).collect();
        let state_at_rest = values_at_rest(description, &state, vec![0.0; state.len()])?;
        let convention = convention(finite_strain, plane_strain);
        let external = symbols.external(external)?;
        let source = symbols.pointer(&format!("{name}_src")).map_or(String::new(), |file| format!(" from {file}"));
        let mut arena = arena(convention.stress.count(), state.len(), properties.len(), external.len());
        arena.get_mut(Array::Properties as usize).copy_from_slice(&description.properties);
        arena.get_mut(Array::External as usize).copy_from_slice(&external);
        let name = format!("{}, {name}{source}", description.library.display());
        Ok(Self {
            function,
            arena,
            signature: Signature { name, convention, properties, state, state_at_rest },
            finite_strain,
            symmetric,
            plane_strain,
            _library: symbols.library,
        })
    }

    fn write(&mut self, step: &Step) {
        let Convention { stress, strain, .. } = &self.signature.convention;
        let [before, after] = if self.finite_strain {
            [step.gradient_before, step.gradient]
        } else {
            [step.strain, sum(&step.strain, 1.0, &step.strain_increment)]
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

fn convention(finite_strain: bool, plane_strain: bool) -> Convention {
    let (measure, components) = match (finite_strain, plane_strain) {
        (true, false) => (Measure::PiolaByGradient, Components::mfront_gradient()),
        (true, true) => (Measure::PiolaByGradient, Components::mfront_gradient_plane()),
        (false, false) => (Measure::CauchyByStrain, Components::mfront()),
        (false, true) => (Measure::CauchyByStrain, Components::mfront_plane()),
    };
    Convention { measure, stress: components.clone(), strain: components }
}
