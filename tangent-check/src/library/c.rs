//! Laws with our own header, `include/bfree_law.h`, in C, C++ or Fortran; and the loading of libraries.

use std::ffi::{CStr, c_char, c_int};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};

use crate::convention::Convention;
use crate::law::{CallFailed, Response, Step};

use super::arena::{Arena, arrays};
use super::{
    Caller, Description, Kind, Signature, check_input, check_output, check_properties, failed, resize, values_at_rest,
};

/// The version of `bfree_law.h` that is understood.
const VERSION: c_int = 1;

/// The length of the message, with its final zero.
const MESSAGE: usize = 256;

type Function = unsafe extern "C" fn(
    gradient_before: *const f64,
    gradient: *const f64,
    length: f64,
    state_before: *const f64,
    properties: *const f64,
    energy: *mut f64,
    stress: *mut f64,
    tangent: *mut f64,
    state: *mut f64,
    message: *mut c_char,
) -> c_int;

arrays! {
    (state, properties):
    GradientBefore "F_n" 9,
    Gradient "F" 9,
    StateBefore "state_n" state,
    Properties "properties" properties,
    Energy "energy" 1,
    Stress "P" 9,
    Tangent "dP/dF" 81,
    State "state" state,
}

/// A loaded law with our own header.
pub struct CLaw {
    function: Function,
    arena: Arena,
    signature: Signature,
    properties: Vec<f64>,
    energy: Option<f64>,
    /// Keeps the function in memory.
    _library: Shared,
}

impl CLaw {
    /// Loads the library and reads its symbols.
    ///
    /// # Errors
    /// See [`super::open`].
    pub fn open(description: &Description) -> Result<Self, CallFailed> {
        let Kind::C { name } = &description.kind else {
            return Err(CallFailed("The description is not that of a law with our C header.".into()));
        };
        let library = Shared::open(&description.library)?;
        // Sound: the header gives these symbols their types, and the user says that the library keeps to it.
        #[allow(unsafe_code)]
        let (version, function) =
            unsafe { (library.value::<c_int>(&format!("{name}_version")), library.symbol::<Function>(name)) };
        let version = version.ok_or_else(|| library.missing(&[&format!("{name}_version")]))?;
        if version != VERSION {
            return Err(library.says(format!("{name} follows version {version} of bfree_law.h; this is {VERSION}.")));
        }
        let function = function.ok_or_else(|| library.missing(&[name]))?;
        let properties = split(&library.text(&format!("{name}_properties"))?);
        check_properties(description, &properties)?;
        let (state, values) = state(&library, name)?;
        let state_at_rest = values_at_rest(description, &state, values)?;
        Ok(Self {
            function,
            arena: arena(state.len(), properties.len()),
            signature: Signature {
                name: format!("{}, {name}", description.library.display()),
                convention: Convention::piola_in_rows(),
                properties,
                state,
                state_at_rest,
            },
            properties: description.properties.clone(),
            energy: None,
            _library: library,
        })
    }

    /// The stored energy per reference volume after the last call, if the law computes it.
    pub fn energy(&self) -> Option<f64> {
        self.energy
    }

    fn write(&mut self, step: &Step) {
        let mut copy = |index: Array, numbers: &[f64]| self.arena.get_mut(index as usize).copy_from_slice(numbers);
        copy(Array::GradientBefore, step.gradient_before.as_flattened());
        copy(Array::Gradient, step.gradient.as_flattened());
        copy(Array::StateBefore, &step.state);
        copy(Array::Properties, &self.properties);
        copy(Array::Energy, &[f64::NAN]);
        copy(Array::Stress, &[0.0; 9]);
        copy(Array::Tangent, &[0.0; 81]);
        copy(Array::State, &step.state);
    }

    fn invoke(&mut self, length: f64, message: &mut [c_char; MESSAGE]) -> c_int {
        let [gradient_before, gradient, state_before, properties, energy, stress, tangent, state] =
            self.arena.pointers();
        let message = message.as_mut_ptr();
        // Sound if the library keeps to the header: the arrays have the sizes that it says, and they live until the call returns. The child
        // process protects from libraries that do not.
        #[allow(unsafe_code)]
        unsafe {
            (self.function)(
                gradient_before,
                gradient,
                length,
                state_before,
                properties,
                energy,
                stress,
                tangent,
                state,
                message,
            )
        }
    }
}

impl Caller for CLaw {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn call(&mut self, step: &Step, response: &mut Response) -> Result<(), CallFailed> {
        check_input(step, &self.signature)?;
        self.write(step);
        let mut message = [0; MESSAGE];
        let status = self.invoke(step.length, &mut message);
        self.arena.check().map_err(|sentence| failed(step, sentence))?;
        if status != 0 {
            let message = text(&message);
            return Err(failed(step, format!("the law refuses the step with status {status}: {message}")));
        }
        resize(response, &self.signature);
        response.stress.copy_from_slice(self.arena.get(Array::Stress as usize));
        response.tangent.entries.copy_from_slice(self.arena.get(Array::Tangent as usize));
        response.state.copy_from_slice(self.arena.get(Array::State as usize));
        self.energy = Some(self.arena.get(Array::Energy as usize)[0]).filter(|energy| !energy.is_nan());
        check_output(step, &self.signature, response)
    }
}

/// The message of a library up to its final zero.
pub(super) fn text(message: &[c_char]) -> String {
    let bytes: Vec<u8> = message.iter().map(|&letter| letter as u8).take_while(|&letter| letter != 0).collect();
    let text = String::from_utf8_lossy(&bytes).trim().to_string();
    if text.is_empty() { "it gives no reason.".into() } else { text }
}

/// The names in "E, nu"; none in "".
fn split(names: &str) -> Vec<String> {
    names.split(',').map(|name| name.trim().to_string()).filter(|name| !name.is_empty()).collect()
}

/// Names and values at rest: "Q11 = 0, Q22 = 0".
fn state(library: &Shared, name: &str) -> Result<(Vec<String>, Vec<f64>), CallFailed> {
    let symbol = format!("{name}_state");
    let mut names = Vec::new();
    let mut values = Vec::new();
    for entry in split(&library.text(&symbol)?) {
        let parsed = entry.split_once('=').map(|(name, value)| (name.trim(), value.trim().parse::<f64>()));
        let Some((name, Ok(value))) = parsed else {
            return Err(library.says(format!("{symbol} holds `{entry}`, but `name = value` is expected.")));
        };
        names.push(name.to_string());
        values.push(value);
    }
    Ok((names, values))
}

/// A library in this program.
pub(super) struct Shared {
    library: Library,
    path: PathBuf,
}

impl Shared {
    /// Loads a library. All functions that it needs must be found now, so that a missing one is an error here and not the end of the program
    /// later.
    pub(super) fn open(path: &Path) -> Result<Self, CallFailed> {
        let failed = |what: String| CallFailed(format!("The library {}: {what}", path.display()));
        // An absolute path: the loader looks for a bare name in the system's folders instead of here.
        let absolute = path.canonicalize().map_err(|error| failed(format!("{error}.")))?;
        recognise(&absolute).map_err(failed)?;
        super::utilities::keep();
        // Sound as far as the library's initialisers are: loading runs them. The user asked for this library.
        #[allow(unsafe_code)]
        let library = unsafe { Library::open(Some(&absolute), RTLD_NOW | RTLD_LOCAL) };
        let library = library.map_err(|error| failed(explained(&error)))?;
        Ok(Self { library, path: path.into() })
    }

    /// A symbol whose address is a `T`: a function pointer or a pointer to data.
    ///
    /// # Safety
    /// The symbol has this type. The value must not be used after the library is dropped.
    #[allow(unsafe_code)]
    pub(super) unsafe fn symbol<T: Copy>(&self, name: &str) -> Option<T> {
        // Sound: the caller vouches for the type.
        unsafe { self.library.get::<T>(name.as_bytes()) }.ok().map(|symbol| *symbol)
    }

    /// The value of a variable.
    ///
    /// # Safety
    /// The variable has this type.
    #[allow(unsafe_code)]
    pub(super) unsafe fn value<T: Copy>(&self, name: &str) -> Option<T> {
        // Sound: the address of a variable of this type, as the caller vouches, points to a value that lives as long as the library.
        unsafe { self.symbol::<*const T>(name).filter(|address| !address.is_null()).map(|address| *address) }
    }

    /// A variable that is an array of characters with a final zero.
    pub(super) fn text(&self, name: &str) -> Result<String, CallFailed> {
        // Sound: the header demands the final zero.
        #[allow(unsafe_code)]
        let text = unsafe { self.symbol::<*const c_char>(name).map(|address| CStr::from_ptr(address)) };
        let text = text.ok_or_else(|| self.missing(&[name]))?;
        Ok(text.to_string_lossy().into_owned())
    }

    /// The error for symbols of which none is there.
    pub(super) fn missing(&self, names: &[&str]) -> CallFailed {
        self.says(format!("it has no symbol {}. `nm -D` lists those that it has.", names.join(", ")))
    }

    /// An error about this library.
    pub(super) fn says(&self, what: String) -> CallFailed {
        CallFailed(format!("The library {}: {what}", self.path.display()))
    }
}

/// The loader's message, and what to do about missing functions.
fn explained(error: &libloading::Error) -> String {
    let source = std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string);
    if source.contains("undefined symbol") || source.contains("symbol not found") {
        format!("{source}. Give or link the source file that has this routine, too.")
    } else {
        format!("{source}.")
    }
}

const NO_LIBRARY: &str = "it is not a shared library. Compile it: gfortran -shared -fPIC -o libmine.so mine.f90.";

/// Fails if the file is not a shared library for this machine. The loader's own words for that mislead: "no such file".
fn recognise(path: &Path) -> Result<(), String> {
    let mut head = [0; 20];
    File::open(path).and_then(|mut file| file.read_exact(&mut head)).map_err(|_| NO_LIBRARY)?;
    let machine = match head {
        [0x7f, b'E', b'L', b'F', bits, order, ..] => {
            let word = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
            if order == 1 && word(16) == 1 {
                return Err("it is an object file. Link it: gfortran -shared -o libmine.so mine.o.".into());
            }
            match (bits, order, word(18)) {
                (2, 1, 62) => "x86_64".into(),
                (2, 1, 183) => "aarch64".into(),
                (2, 1, 243) => "riscv64".into(),
                (1, 1, 3) => "x86 (32 bits)".into(),
                (1, 1, 40) => "arm (32 bits)".into(),
                (_, _, machine) => format!("machine {machine} of the ELF standard"),
            }
        }
        [0xcf, 0xfa, 0xed, 0xfe, 7, 0, 0, 1, ..] => "x86_64".into(),
        [0xcf, 0xfa, 0xed, 0xfe, 12, 0, 0, 1, ..] => "aarch64".into(),
        // Several architectures in one file of macOS: the loader chooses.
        [0xca, 0xfe, 0xba, 0xbe, ..] => return Ok(()),
        [b'M', b'Z', ..] => return Err("it is a library for Windows.".into()),
        _ => return Err(NO_LIBRARY.into()),
    };
    let here = std::env::consts::ARCH;
    let known = ["x86_64", "aarch64", "riscv64"].contains(&here);
    if known && machine != here { Err(format!("it is for {machine}, but this program is for {here}.")) } else { Ok(()) }
}
