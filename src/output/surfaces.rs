//! Pressure, traction and gap at every point of the surfaces that may touch, for ParaView: `contacts_*.vtu`.

use super::fields::padded;
use super::history::AXES;
use super::vtu::{Array, Snapshot};
use super::vtu_writer::Head;
use crate::material::Law;
use crate::simulation::Simulation;

/// The points of the surfaces at the time of `head`. A point that touches nothing has no pressure; its gap is that to the
/// nearest obstacle, and NaN without obstacles.
pub(super) fn snapshot<const D: usize, L: Law, A>(simulation: &Simulation<D, L, A>, head: &Head) -> Snapshot {
    let (contacts, of) = (&simulation.loads.contacts, &simulation.particles);
    let time = simulation.clock.time();
    let poses: Vec<_> = contacts.obstacles.iter().map(|obstacle| obstacle.pose(time)).collect();
    let count = contacts.points.len();
    let (mut pressure, mut traction, mut gap) = (vec![0.0; count], vec![[0.0; 3]; count], vec![f64::NAN; count]);
    for (point, gap) in contacts.points.iter().zip(&mut gap) {
        let x = &of.position[point.particle];
        let obstacles = contacts.obstacles.iter().zip(&poses);
        let distances = obstacles.map(|(obstacle, pose)| obstacle.shape.signed_distance(&pose.to_frame(x)));
        *gap = distances.fold(f64::NAN, f64::min);
    }
    for one in &contacts.touching {
        let sum = padded(&one.traction);
        (0..3).for_each(|k| traction[one.number][k] += sum[k]);
        pressure[one.number] += one.pressure;
        gap[one.number] = gap[one.number].min(one.gap);
    }
    let body = contacts.points.iter().map(|point| f64::from(of.body[point.particle])).collect();
    let area = contacts.points.iter().map(|point| point.area).collect();
    let components = AXES.map(str::to_owned).to_vec();
    let arrays = vec![
        Array::scalar("pressure", pressure, false),
        Array { components, ..Array::scalar("traction", traction.concat(), false) },
        Array::scalar("gap", gap, false),
        Array::scalar("area", area, false),
        Array::scalar("body", body, true),
    ];
    let points = contacts.points.iter().map(|point| padded(&of.position[point.particle])).collect();
    Snapshot { time: head.time, background: head.background, points, arrays, corners: 1 }
}
