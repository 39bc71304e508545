//! User materials of Abaqus/Standard: a function `umat_` (gfortran), `umat` or `UMAT`.
//!
//! Source: Abaqus User Subroutines Reference Guide, "UMAT". Matrices are column-major; STRAN and DSTRAN hold engineering shears; components
//! are in the order 11, 22, 33, 12, 13, 23.

use std::sync::{Mutex, PoisonError};

use crate::convention::{Components, Convention, Measure};
use crate::law::{CallFailed, Response, Step};
use crate::tensor::transposed;

use super::arena::{Arena, arrays};
use super::c::Shared;
use super::{
    Caller, Description, Kind, Signature, StressState, check_input, check_output, check_plane, failed, resize, rotate,
    write_components,
};

/// The last argument is the length of CMNAME, which Fortran passes by value behind all others. A function without it ignores it, on every
/// 64-bit calling convention of Linux and macOS.
type Function = unsafe extern "C" fn(
    stress: *mut f64,
    statev: *mut f64,
    ddsdde: *mut f64,
    sse: *mut f64,
    spd: *mut f64,
    scd: *mut f64,
    rpl: *mut f64,
    ddsddt: *mut f64,
    drplde: *mut f64,
    drpldt: *mut f64,
    stran: *mut f64,
    dstran: *mut f64,
    time: *mut f64,
    dtime: *mut f64,
    temp: *mut f64,
    dtemp: *mut f64,
    predef: *mut f64,
    dpred: *mut f64,
    cmname: *mut u8,
    ndi: *mut i32,
    nshr: *mut i32,
    ntens: *mut i32,
    nstatv: *mut i32,
    props: *mut f64,
    nprops: *mut i32,
    coords: *mut f64,
    drot: *mut f64,
    pnewdt: *mut f64,
    celent: *mut f64,
    dfgrd0: *mut f64,
    dfgrd1: *mut f64,
    noel: *mut i32,
    npt: *mut i32,
    layer: *mut i32,
    kspt: *mut i32,
    jstep: *mut i32,
    kinc: *mut i32,
    cmname_length: usize,
);

arrays! {
    (size, state, properties):
    Stress "STRESS" size,
    Statev "STATEV" state,
    Ddsdde "DDSDDE" size * size,
    Sse "SSE" 1,
    Spd "SPD" 1,
    Scd "SCD" 1,
    Rpl "RPL" 1,
    Ddsddt "DDSDDT" size,
    Drplde "DRPLDE" size,
    Drpldt "DRPLDT" 1,
    Stran "STRAN" size,
    Dstran "DSTRAN" size,
    Time "TIME" 2,
    Dtime "DTIME" 1,
    Temp "TEMP" 1,
    Dtemp "DTEMP" 1,
    Predef "PREDEF" 1,
    Dpred "DPRED" 1,
    Props "PROPS" properties,
    Coords "COORDS" 3,
    Drot "DROT" 9,
    Pnewdt "PNEWDT" 1,
    Celent "CELENT" 1,
    Dfgrd0 "DFGRD0" 9,
    Dfgrd1 "DFGRD1" 9,
}

/// The number of arrays.
const ARRAYS: usize = Array::Dfgrd1 as usize + 1;

/// PNEWDT before the call. Abaqus sets a large value, too; a law that wants shorter steps lowers it.
const PNEWDT: f64 = 1e36;

/// A loaded UMAT.
pub struct Umat {
    function: Function,
    arena: Arena,
    signature: Signature,
    properties: Vec<f64>,
    material: [u8; 80],
    temperature: f64,
    /// Keeps the function in memory.
    _library: Shared,
}

/// Names of `count` internal variables that are zero at rest: `STATEV(1)`, `STATEV(2)`, …
pub fn state(count: usize) -> Vec<(String, f64)> {
    (1..=count).map(|number| (format!("STATEV({number})"), 0.0)).collect()
}

/// Abaqus' components: 11, 22, 33, 12, 13, 23; in plane strain the first four; in plane stress 11, 22, 12.
pub fn components(stress_state: StressState, shear: f64) -> Components {
    match stress_state {
        StressState::Solid => of_counts(3, 3, shear),
        StressState::PlaneStrain => of_counts(3, 1, shear),
        StressState::PlaneStress => of_counts(2, 1, shear),
    }
}

/// The components of NDI direct and NSHR shear ones.
pub(super) fn of_counts(ndi: usize, nshr: usize, shear: f64) -> Components {
    let [direct, shears] = [[(0, 0), (1, 1), (2, 2)], [(0, 1), (0, 2), (1, 2)]];
    Components { pairs: [&direct[..ndi.min(3)], &shears[..nshr.min(3)]].concat(), shear }
}

impl Umat {
    /// Loads the library and finds the function.
    ///
    /// # Errors
    /// See [`super::open`]. An option is not possible: a CMNAME beyond 80 characters, a tangent that is not 6×6.
    pub fn open(description: &Description) -> Result<Self, CallFailed> {
        let Kind::Umat { material, tangent, temperature } = &description.kind else {
            return Err(CallFailed("The description is not that of a UMAT.".into()));
        };
        let convention = convention(*tangent, description.stress_state)?;
        let library = Shared::open(&description.library)?;
        let names = ["umat_", "umat", "UMAT"];
        // Sound: a function pointer has the size of a symbol's address. The user says that the library holds a UMAT.
        #[allow(unsafe_code)]
        let function = names.iter().find_map(|name| unsafe { library.symbol::<Function>(name) });
        let function = function.ok_or_else(|| library.missing(&names))?;
        start_analysis(&library);
        let (state, state_at_rest) = description.state.iter().cloned().unzip();
        let signature = Signature {
            name: format!("{}, umat", description.library.display()),
            convention,
            properties: Vec::new(),
            state,
            state_at_rest,
        };
        Ok(Self {
            function,
            arena: arena(signature.convention.stress.pairs.len(), signature.state.len(), description.properties.len()),
            signature,
            properties: description.properties.clone(),
            material: padded(material)?,
            temperature: *temperature,
            _library: library,
        })
    }

    fn write(&mut self, step: &Step) {
        let Convention { stress, strain, .. } = &self.signature.convention;
        (0..ARRAYS).for_each(|index| self.arena.get_mut(index).fill(0.0));
        let mut copy = |index: Array, numbers: &[f64]| self.arena.get_mut(index as usize).copy_from_slice(numbers);
        copy(Array::Stress, &step.stress);
        copy(Array::Statev, &step.state);
        copy(Array::Time, &[step.time, step.time]);
        copy(Array::Dtime, &[step.length]);
        copy(Array::Temp, &[self.temperature]);
        copy(Array::Props, &self.properties);
        copy(Array::Pnewdt, &[PNEWDT]);
        copy(Array::Celent, &[1.0]);
        let matrices =
            [(Array::Drot, &step.rotation), (Array::Dfgrd0, &step.gradient_before), (Array::Dfgrd1, &step.gradient)];
        for (index, tensor) in matrices {
            copy(index, transposed(tensor).as_flattened());
        }
        write_components(&step.strain, strain, self.arena.get_mut(Array::Stran as usize));
        write_components(&step.strain_increment, strain, self.arena.get_mut(Array::Dstran as usize));
        rotate(self.arena.get_mut(Array::Stress as usize), stress, &step.rotation);
    }

    fn invoke(&mut self, number: usize) {
        let increment = number.try_into().unwrap_or(i32::MAX);
        let pairs = &self.signature.convention.stress.pairs;
        let direct = pairs.iter().filter(|(row, column)| row == column).count();
        let [mut ndi, mut nshr, mut ntens] = [direct, pairs.len() - direct, pairs.len()].map(|count| count as i32);
        let [mut nstatv, mut nprops] = [self.signature.state.len() as i32, self.properties.len() as i32];
        let [mut noel, mut npt, mut layer, mut kspt, mut kinc] = [1, 1, 1, 1, increment];
        let mut jstep = [1, 0, 0, 0];
        let mut cmname = self.material;
        let a: [*mut f64; ARRAYS] = self.arena.pointers();
        let at = |index: Array| a[index as usize];
        // Sound if the library keeps to Abaqus' calling convention: the pointers are to arrays of the sizes that NTENS, NSTATV and NPROPS say,
        // and they live until the call returns. The child process protects from libraries that do not.
        #[allow(unsafe_code)]
        unsafe {
            (self.function)(
                at(Array::Stress),
                at(Array::Statev),
                at(Array::Ddsdde),
                at(Array::Sse),
                at(Array::Spd),
                at(Array::Scd),
                at(Array::Rpl),
                at(Array::Ddsddt),
                at(Array::Drplde),
                at(Array::Drpldt),
                at(Array::Stran),
                at(Array::Dstran),
                at(Array::Time),
                at(Array::Dtime),
                at(Array::Temp),
                at(Array::Dtemp),
                at(Array::Predef),
                at(Array::Dpred),
                cmname.as_mut_ptr(),
                &mut ndi,
                &mut nshr,
                &mut ntens,
                &mut nstatv,
                at(Array::Props),
                &mut nprops,
                at(Array::Coords),
                at(Array::Drot),
                at(Array::Pnewdt),
                at(Array::Celent),
                at(Array::Dfgrd0),
                at(Array::Dfgrd1),
                &mut noel,
                &mut npt,
                &mut layer,
                &mut kspt,
                jstep.as_mut_ptr(),
                &mut kinc,
                cmname.len(),
            );
        }
    }

    fn read(&self, response: &mut Response) {
        resize(response, &self.signature);
        response.stress.copy_from_slice(self.arena.get(Array::Stress as usize));
        response.state.copy_from_slice(self.arena.get(Array::Statev as usize));
        let ddsdde = self.arena.get(Array::Ddsdde as usize);
        let size = response.stress.len();
        for row in 0..size {
            for column in 0..size {
                response.tangent[(row, column)] = ddsdde[row + size * column];
            }
        }
    }
}

impl Caller for Umat {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn call(&mut self, step: &Step, response: &mut Response) -> Result<(), CallFailed> {
        check_input(step, &self.signature)?;
        if self.signature.convention.plane() {
            check_plane(step)?;
        }
        self.write(step);
        self.invoke(step.number);
        self.arena.check().map_err(|sentence| failed(step, sentence))?;
        let shorter = self.arena.get(Array::Pnewdt as usize)[0];
        if shorter.is_nan() || shorter < 1.0 {
            return Err(failed(step, format!("the law refuses the step and asks for {shorter} of it (PNEWDT).")));
        }
        self.read(response);
        check_output(step, &self.signature, response)
    }
}

/// UEXTERNALDB(LOP, LRESTART, TIME, DTIME, KSTEP, KINC).
type ExternalDatabase = unsafe extern "C" fn(*mut i32, *mut i32, *mut f64, *mut f64, *mut i32, *mut i32);

/// Tells a library that the analysis starts, once in this program: many read their data then.
fn start_analysis(library: &Shared) {
    static STARTED: Mutex<Vec<usize>> = Mutex::new(Vec::new());
    // Sound: a function pointer has the size of a symbol's address, and the arguments are those of Abaqus.
    #[allow(unsafe_code)]
    let start = unsafe { library.symbol::<ExternalDatabase>("uexternaldb_") };
    let mut started = STARTED.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(start) = start.filter(|start| !started.contains(&(*start as usize))) else { return };
    started.push(start as usize);
    let [mut lop, mut restart, mut step, mut increment] = [0; 4];
    let (mut time, mut length) = ([0.0; 2], 0.0);
    #[allow(unsafe_code)]
    unsafe {
        start(&mut lop, &mut restart, time.as_mut_ptr(), &mut length, &mut step, &mut increment);
    }
}

fn convention(measure: Measure, stress_state: StressState) -> Result<Convention, CallFailed> {
    if !measure.spatial() {
        return Err(CallFailed(format!("{measure:?} cannot be the tangent of a UMAT: STRESS is the Cauchy stress.")));
    }
    Ok(Convention { measure, stress: components(stress_state, 1.0), strain: components(stress_state, 2.0) })
}

/// CMNAME: 80 characters, filled with blanks.
fn padded(material: &str) -> Result<[u8; 80], CallFailed> {
    let mut name = [b' '; 80];
    let target = name.get_mut(..material.len());
    let target =
        target.ok_or_else(|| CallFailed(format!("The material's name `{material}` exceeds 80 characters.")))?;
    target.copy_from_slice(material.as_bytes());
    Ok(name)
}
