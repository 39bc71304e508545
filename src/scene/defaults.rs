//! Defaults that depend on other keys of the scene.

use super::body::Body;
use super::{Scene, accuracy, boundary, transfer};
use crate::field::Field;
use crate::material::{Law, Material, PLASTIC_STRAIN};
use crate::mechanics::contact::contact_modulus;
use crate::mechanics::reference::GridReset;
use crate::mechanics::schemes::{LONG_STEPS, Parameters};
use crate::problems::Problems;

/// The strain up to which load steps keep a grid by themselves.
const STATIC_STRAIN: f64 = 1.0;

/// The strain up to which a clamped body keeps its grid with inertia. The cantilever of `docs/src/choosing.md` loses 0.01 % of its energy.
const VIBRATION_STRAIN: f64 = 0.1;

/// The default of `time.lumping` where bodies may touch obstacles or each other (`docs/src/obstacles.md`).
const LUMPING_IN_CONTACT: f64 = 0.1;

/// The strain up to which a grid is kept where bodies may touch obstacles or each other. A new grid loses a part of the vibrations that impacts
/// cause (`docs/src/obstacles.md`).
const CONTACT_STRAIN: f64 = 0.3;

/// The largest default stiffness of contact, and its largest product with the Courant number (`docs/src/obstacles.md`).
const STIFFNESS: [f64; 2] = [1.0, 2.0];

/// A body that comes this near to a face of the box, in spacings, touches it.
const TOUCHES: f64 = 1e-9;

impl Scene {
    /// Fills in defaults that depend on other keys, for all keys that have a meaning in this scene.
    pub(super) fn complete(mut self) -> Self {
        if self.time.scheme().has_inertia() {
            self.time.lumping = Some(self.lumping());
        }
        self.time.complete();
        let layouts: Vec<_> = self.bodies.iter().map(|body| self.filling(body).layout).collect();
        self.bodies.iter_mut().zip(layouts).for_each(|(body, layout)| body.layout = Some(layout));
        self.grid.reset = Some(self.grid_reset());
        if self.time.scheme().has_inertia() {
            self.transfer.get_or_insert_default();
        }
        self.aggregation = Some(self.aggregates());
        let stiffness = self.contact_stiffness();
        let contacts = self.obstacles.iter_mut().map(|one| &mut one.stiffness);
        contacts.chain(self.contact.iter_mut().map(|one| &mut one.stiffness)).for_each(|one| {
            one.get_or_insert(stiffness);
        });
        self.output.fields = Some(self.fields());
        self
    }

    /// Whether nodes with little support from a body follow other nodes. In short steps a lumped mass holds such nodes, except where a node
    /// has more of a loaded surface than of the particles below. Adaptive steps become short at impacts.
    pub(super) fn aggregates(&self) -> bool {
        let computed = self.surface_loads().any(|(_, load)| load.surface.is_none());
        let has_inertia = self.time.scheme().has_inertia();
        let courant = || accuracy::courant(&self.bodies, self.grid.spacing, self.time.step).unwrap_or(0.0);
        let long_steps = self.time.adaptive.is_none() && (!has_inertia || courant() > LONG_STEPS);
        let consistent = has_inertia && self.lumping() == 0.0;
        let needed = long_steps || consistent || computed || self.has_contact();
        self.aggregation.or(self.ghost_stiffness.map(|factor| factor > 0.0)).unwrap_or(needed)
    }

    /// ε, the lumped share of the mass. Bodies that touch obstacles or each other lose energy with a lumped mass, and a consistent one
    /// makes the force of contact ring. The energy that the energy–momentum scheme keeps is that of particles with a consistent mass.
    pub(super) fn lumping(&self) -> f64 {
        let default = match self.time.scheme() {
            Parameters::EnergyMomentum => 0.0,
            _ if self.has_contact() => LUMPING_IN_CONTACT,
            _ => 1.0,
        };
        self.time.lumping.unwrap_or(default)
    }

    /// When the grid is reset. A clamped body vibrates, and seldom meets anything. Obstacles need no reset either, and a reset loses what the
    /// energy–momentum scheme keeps. Other bodies may come to
    /// walls, and a grid that is reset in every step feels a wall from farther away.
    pub(super) fn grid_reset(&self) -> GridReset {
        let flip = self.transfer.is_none_or(|transfer| transfer == transfer::Transfer::Flip);
        let keeps_energy = self.time.scheme() == Parameters::EnergyMomentum;
        self.grid.given_reset().unwrap_or(match self.time.scheme().has_inertia() {
            false => GridReset::Strain(STATIC_STRAIN),
            true if flip && self.has_contact() => GridReset::Strain(CONTACT_STRAIN),
            true if flip && (self.is_clamped() || keeps_energy) => GridReset::Strain(VIBRATION_STRAIN),
            true => GridReset::EveryStep,
        })
    }

    /// The default stiffness of contact. A contact that is too stiff for the step makes bodies vibrate, and loses energy.
    pub(super) fn contact_stiffness(&self) -> f64 {
        let [most, of_courant] = STIFFNESS;
        let speed = |body: &Body| Some((contact_modulus(&body.law()?) / body.density).sqrt());
        let fastest = self.bodies.iter().filter_map(speed).fold(0.0, f64::max);
        let courant = fastest * self.time.step / self.grid.spacing;
        if self.time.scheme().has_inertia() && courant * most > of_courant { of_courant / courant } else { most }
    }

    /// Whether the scene has one body, and its shape reaches a fixed face of the box.
    fn is_clamped(&self) -> bool {
        let [body] = self.bodies.as_slice() else { return false };
        let bounds = body.shape.as_ref().and_then(|shape| shape.check(&mut Problems::default(), "", self.dimension()));
        let Some([lower, upper]) = bounds else { return false };
        let (origin, near) = (self.grid.origin(), TOUCHES * self.grid.spacing);
        (0..self.dimension()).any(|k| {
            let is_fixed = |upper| *self.boundary.face(k, upper) == boundary::Face::Fixed;
            let far_end = origin[k] + self.grid.size[k];
            (is_fixed(false) && lower[k] < origin[k] + near) || (is_fixed(true) && upper[k] > far_end - near)
        })
    }

    /// The fields of a snapshot.
    ///
    /// ```
    /// use bfree::field::Field;
    ///
    /// // Without inertia there are no velocities to show; where a metal flows, its plastic strain is what pictures show. The numbers of
    /// // several bodies tell the bodies apart.
    /// let of = |name: &str| {
    ///     let asked = ["output.fields=null".parse()?];
    ///     Ok::<_, Box<dyn std::error::Error>>(bfree::scene::read_file(format!("scenes/{name}.json").as_ref(), &asked)?.fields())
    /// };
    /// assert_eq!(of("cook")?, [Field::Displacement, Field::Stress, Field::Jacobian]);
    /// assert_eq!(of("rings")?, [Field::Displacement, Field::Velocity, Field::Stress, Field::Jacobian, Field::Body]);
    /// assert_eq!(of("tube")?, [Field::PlasticStrain, Field::Displacement, Field::Stress, Field::Jacobian]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn fields(&self) -> Vec<Field> {
        let has_inertia = self.time.scheme().has_inertia();
        let flows = |law: Material| law.internal_variables().iter().any(|one| one.name == PLASTIC_STRAIN);
        self.output.fields.clone().unwrap_or_else(|| {
            let mut fields = vec![Field::Displacement, Field::Velocity, Field::Stress, Field::Jacobian];
            fields.retain(|field| has_inertia || !field.needs_inertia());
            fields.splice(..0, self.laws().any(flows).then_some(Field::PlasticStrain));
            fields.extend((self.bodies.len() > 1).then_some(Field::Body));
            fields
        })
    }
}
