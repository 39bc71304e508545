//! Transformations of a scene that must not change its answer.

use super::scene::{Form, Hold, Law, Load, Pressing, Scene, Units};

/// A change of a scene with a known effect on its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transformation {
    /// x to −x.
    Mirrored,
    /// Rotation by 90°.
    Turned,
    /// Translation of the box and its contents by whole cells.
    Moved,
    /// The whole, against the half above a plane of symmetry, which is a sliding face.
    Doubled,
    /// A body cut into two of the same law along a line of the grid.
    Split,
    /// A slab of one cell between sliding faces, in three dimensions.
    Slab,
    /// Other units, by powers of two: the answer has the same bits.
    PowersOfTwo,
    /// Other units.
    Scaled,
}

/// All transformations.
pub const TRANSFORMATIONS: [Transformation; 8] = [
    Transformation::Mirrored,
    Transformation::Turned,
    Transformation::Moved,
    Transformation::Doubled,
    Transformation::Split,
    Transformation::Slab,
    Transformation::PowersOfTwo,
    Transformation::Scaled,
];

/// The map of positions and directions from a scene to its image: x′_i = signs_i x_axes_i + shift_i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Map {
    pub axes: [usize; 2],
    pub signs: [f64; 2],
    pub shift: [f64; 2],
}

impl Map {
    pub const SAME: Self = Self { axes: [0, 1], signs: [1.0; 2], shift: [0.0; 2] };

    /// The image of a direction.
    pub fn vector(&self, x: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| self.signs[i] * x[self.axes[i]])
    }

    /// The image of a position.
    pub fn point(&self, x: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| self.signs[i] * x[self.axes[i]] + self.shift[i])
    }

    /// The image of a face of the box, as its number.
    pub fn face(&self, face: usize) -> usize {
        let (axis, upper) = (face / 2, face % 2 == 1);
        let image = usize::from(self.axes[1] == axis);
        2 * image + usize::from(upper != (self.signs[image] < 0.0))
    }

    fn form(&self, form: &Form) -> Form {
        match form {
            Form::Box { min, max } => {
                let [a, b] = [self.point(*min), self.point(*max)];
                let pick = |of: fn(f64, f64) -> f64| std::array::from_fn(|i| of(a[i], b[i]));
                Form::Box { min: pick(f64::min), max: pick(f64::max) }
            }
            Form::Ball { center, radius } => Form::Ball { center: self.point(*center), radius: *radius },
            Form::Polygon(corners) => Form::Polygon(corners.iter().map(|x| self.point(*x)).collect()),
        }
    }
}

/// Two scenes that must agree, and the map from the answer of the first to that of the second.
#[derive(Clone, Debug)]
pub struct Pair {
    pub scenes: [Scene; 2],
    pub map: Map,
    /// The number of copies of the first scene in the second.
    pub times: f64,
    /// Whether the second has the same bits.
    pub bits: bool,
}

impl Transformation {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mirrored => "mirrored",
            Self::Turned => "turned by 90°",
            Self::Moved => "moved by whole cells",
            Self::Doubled => "half and whole",
            Self::Split => "split in two",
            Self::Slab => "slab in 3D",
            Self::PowersOfTwo => "units × powers of 2",
            Self::Scaled => "units × 3.7",
        }
    }

    /// Whether the image has more unknowns, so that the iterates of its linear systems differ.
    pub fn changes_systems(self) -> bool {
        matches!(self, Self::Doubled | Self::Slab)
    }

    /// The scene and its image; `choice` is a random whole number.
    pub fn of(self, scene: Scene, choice: u32) -> Pair {
        let edges = scene.cells.map(|cells| f64::from(cells) * scene.spacing);
        let ends: [f64; 2] = std::array::from_fn(|i| 2.0 * scene.origin[i] + edges[i]);
        let map = match self {
            Self::Mirrored => Map { signs: [-1.0, 1.0], shift: [ends[0], 0.0], ..Map::SAME },
            Self::Turned => Map { axes: [1, 0], signs: [-1.0, 1.0], shift: [ends[1], 0.0] },
            Self::Moved => Map { shift: [f64::from(choice % 5) * scene.spacing, -7.0 * scene.spacing], ..Map::SAME },
            Self::Doubled => Map { shift: [edges[0], 0.0], ..Map::SAME },
            Self::Split | Self::Slab | Self::PowersOfTwo | Self::Scaled => Map::SAME,
        };
        let mut image = mapped(&scene, &map, edges);
        let mut times = 1.0;
        match self {
            Self::Doubled => {
                image = doubled(&scene, edges[0]);
                times = 2.0;
            }
            Self::Split => image.bodies = split(&scene),
            Self::Slab => {
                image.slab = true;
                times = scene.spacing;
            }
            Self::PowersOfTwo => {
                let power = |shift: u32| 2.0_f64.powi((choice >> shift & 7) as i32 - 3);
                image.units = Units { length: power(0), time: power(3), density: power(6) };
            }
            Self::Scaled => image.units = Units { length: 3.7, time: 3.7 * 3.7, density: 3.7_f64.recip() },
            Self::Mirrored | Self::Turned | Self::Moved => {}
        }
        Pair { scenes: [scene, image], map, times, bits: self == Self::PowersOfTwo }
    }
}

/// The scene with all its positions and directions mapped.
fn mapped(scene: &Scene, map: &Map, edges: [f64; 2]) -> Scene {
    let far = std::array::from_fn(|i| scene.origin[i] + edges[i]);
    let Form::Box { min: origin, .. } = map.form(&Form::Box { min: scene.origin, max: far }) else {
        return scene.clone();
    };
    let mut faces = [None; 4];
    for (face, hold) in scene.faces.iter().enumerate() {
        faces[map.face(face)] = hold.map(|hold| match hold {
            Hold::Moves(by) => Hold::Moves(map.vector(by)),
            other => other,
        });
    }
    Scene {
        origin,
        cells: map.axes.map(|axis| scene.cells[axis]),
        bodies: scene.bodies.iter().map(|body| map.form(body)).collect(),
        law: match scene.law {
            Law::Fibres(direction) => Law::Fibres(map.vector(direction)),
            law => law,
        },
        velocity: map.vector(scene.velocity),
        faces,
        gravity: scene.gravity.map(|gravity| map.vector(gravity)),
        load: scene.load.as_ref().map(|load| Load {
            region: map.form(&load.region),
            pressing: match load.pressing {
                Pressing::Traction(traction) => Pressing::Traction(map.vector(traction)),
                pressure => pressure,
            },
            carried: load.carried.map(|(normal, area)| (map.vector(normal), area)),
        }),
        ..scene.clone()
    }
}

/// The half and its mirror image, as one body in a box of twice the width.
fn doubled(scene: &Scene, width: f64) -> Scene {
    let whole = |form: &Form| match form {
        // The half begins on the plane x = origin.
        Form::Box { min, max } => {
            Form::Box { min: [min[0] + width - (max[0] - min[0]), min[1]], max: [max[0] + width, max[1]] }
        }
        Form::Ball { center, radius } => Form::Ball { center: [center[0] + width, center[1]], radius: *radius },
        Form::Polygon(corners) => {
            let plane = 2.0 * (scene.origin[0] + width);
            let right: Vec<[f64; 2]> = corners.iter().map(|x| [x[0] + width, x[1]]).collect();
            // Corners run from the lower end of the plane to its upper end.
            let left = right.iter().rev().filter(|x| x[0] > scene.origin[0] + width).map(|x| [plane - x[0], x[1]]);
            Form::Polygon(right.iter().copied().chain(left).collect())
        }
    };
    let mut faces = scene.faces;
    faces[0] = None;
    Scene {
        cells: [2 * scene.cells[0], scene.cells[1]],
        bodies: scene.bodies.iter().map(whole).collect(),
        faces,
        load: scene.load.as_ref().map(|load| Load { region: whole(&load.region), ..load.clone() }),
        ..scene.clone()
    }
}

/// Boxes cut along the line of the grid nearest to their middle.
fn split(scene: &Scene) -> Vec<Form> {
    let cut = |form: &Form| match form {
        Form::Box { min, max } => {
            let line = ((0.5 * (min[0] + max[0]) - scene.origin[0]) / scene.spacing).round();
            let x = scene.origin[0] + line * scene.spacing;
            vec![Form::Box { min: *min, max: [x, max[1]] }, Form::Box { min: [x, min[1]], max: *max }]
        }
        other => vec![other.clone()],
    };
    scene.bodies.iter().flat_map(cut).collect()
}
