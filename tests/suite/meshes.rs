//! Meshes of Gmsh as bodies, loaded surfaces and held regions.

use crate::support::Failure;
use bfree::scene::{self, mesh_file::read_group};
use bfree::shape::{GridBox, Shape};
use bfree::simulation::Simulation;
use bfree::tensor::Vector;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The folder of the meshes.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/meshes")
}

/// The boxes of a grid over [0.7, 3.9]ᴰ.
fn boxes<const D: usize>() -> impl Iterator<Item = GridBox<D>> {
    let spacing = 0.16;
    (0..20_usize.pow(D as u32)).map(move |number| {
        let place = |k| 0.7 + spacing * (number / 20_usize.pow(k as u32) % 20) as f64;
        GridBox { lower: Vector::from_fn(|k, _| place(k)), edges: Vector::repeat(spacing), spacing }
    })
}

fn volume<const D: usize>(shape: &Shape<D>) -> f64 {
    boxes().map(|of| shape.part(&of).0).sum()
}

fn area<const D: usize>(shape: &Shape<D>, region: Option<&Shape<D>>) -> f64 {
    boxes().flat_map(|of| shape.facets(region, &of)).map(|facet| facet.area).sum()
}

fn near(found: f64, exact: f64) -> Result<(), String> {
    if (found / exact - 1.0).abs() < 1e-10 { Ok(()) } else { Err(format!("{found} for {exact}")) }
}

/// The exact values are sums over the elements, which the Python package of Gmsh 4.15 has read from the files.
#[test]
fn groups_have_the_volumes_and_areas_of_their_elements() -> Result<(), Failure> {
    for name in ["plate.msh", "plate_binary.msh"] {
        let group = |group: &str| read_group::<2>(&folder().join(name), group);
        let (steel, rubber) = (group("steel")?, group("rubber")?);
        near(volume(&steel), 1.8289743632101183)?;
        near(volume(&rubber), 0.75)?;
        for (on, region, exact) in
            [(&steel, "left", 1.0), (&steel, "hole", 1.5185930869114532), (&rubber, "top of rubber", 0.75)]
        {
            near(area(on, Some(&group(region)?)), exact)?;
        }
        // The whole surface of steel, and its part along the rubber.
        near(area(&steel, None), 6.0 + 1.5185930869114532)?;
        assert_eq!(area(&rubber, Some(&group("left")?)), 0.0);
        near(area(&rubber, Some(&steel)), 1.0)?;
    }
    for name in ["part.msh", "part_binary.msh"] {
        let group = |group: &str| read_group::<3>(&folder().join(name), group);
        let (steel, rubber) = (group("steel")?, group("rubber")?);
        near(volume(&steel), 0.9457772887762683)?;
        near(volume(&rubber), 0.63)?;
        for (region, exact) in [("foot", 2.0), ("hole", 0.887537238538106), ("top of steel", 1.1)] {
            near(area(&steel, Some(&group(region)?)), exact)?;
        }
        assert_eq!(area(&rubber, Some(&group("foot")?)), 0.0);
        near(area(&rubber, None), 2.0 * (0.9 + 0.63 + 0.7))?;
        // The surface of the same box of another file is selected, too.
        let block = bfree::shape::Block { min: Vector::from([1.0; 3]), max: Vector::from([3.0, 2.0, 1.5]) };
        near(area(&block.into(), Some(&group("top of steel")?)), 1.1)?;
    }
    let bricks = |group: &str| read_group::<3>(&folder().join("bricks.msh"), group);
    near(volume(&bricks("bricks")?), 0.42)?;
    near(area(&bricks("bricks")?, Some(&bricks("lid")?)), 0.7)?;
    Ok(())
}

/// A hexahedron with a pyramid on it, and a prism with a tetrahedron beside it. The seventh node is at this x.
fn mixed(x: f64) -> String {
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n3 1 \"a\"\n3 2 \"b\"\n$EndPhysicalNames\n\
         $Entities\n0 0 0 2\n1 0 0 0 0 0 0 2 1 3 0\n2 0 0 0 0 0 0 2 2 3 0\n$EndEntities\n\
         $Nodes\n1 12 1 12\n3 1 0 12\n1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n12\n1 1 1\n2 1 1\n2 2 1\n1 2 1\n1 1 2\n2 1 2\n\
         {x} 2 2\n1 2 2\n3 1 1\n3 2 1\n2 0.8 1\n1.5 1.5 3\n$EndNodes\n$Elements\n4 4 1 4\n3 1 5 1\n1 1 2 3 4 5 6 7 8\n\
         3 1 7 1\n2 5 6 7 8 12\n3 2 6 1\n3 2 9 6 3 10 7\n3 2 4 1\n4 2 9 6 11\n$EndElements\n"
    )
}

#[test]
fn elements_of_all_kinds_meet_without_gaps() -> Result<(), Failure> {
    let [flat, bent] = [2.0, 2.2].map(|x| move |group: &str| read::<3>(mixed(x).as_bytes(), group));
    for (group, exact) in [("a", 4.0 / 3.0), ("b", 0.5 + 0.1 / 3.0)] {
        near(volume(&flat(group)?), exact)?;
    }
    // The common face is no plane: it has the same triangles seen from both sides. A group without a name is known by its tag.
    let (a, b, both) = (bent("a")?, bent("b")?, bent("3")?);
    near(volume(&both), volume(&a) + volume(&b))?;
    near(area(&a, Some(&b)), area(&b, Some(&a)))?;
    assert!(area(&a, Some(&b)) > 1.01 && (volume(&a) - 4.0 / 3.0).abs() > 0.01);
    Ok(())
}

#[test]
fn parameters_of_nodes_and_other_sections_are_skipped() -> Result<(), Failure> {
    let more = SQUARE.replace("2 1 0 4", "2 1 1 4").replace("$Nodes", "$Comments\n7\n$EndComments\n$Nodes");
    let more = ["0 0 0\n", "1 0 0\n", "1 1 0\n0", "0 1 0\n$"]
        .iter()
        .fold(more, |text, x| text.replace(x, &x.replacen('\n', " 8 9\n", 1)));
    let (part, side) = (read::<2>(more.as_bytes(), "part")?, read::<2>(more.as_bytes(), "side")?);
    assert_eq!(part, read(SQUARE.as_bytes(), "part")?);
    assert_eq!(side.bounding_box(), (Vector::from([0.0, 0.0]), Vector::from([1.0, 0.0])));
    assert_eq!(read::<2>(SQUARE.replace('\n', "\r\n").as_bytes(), "part")?, part);
    Ok(())
}

fn built<const D: usize>(name: &str, changes: &[(&str, Value)]) -> Result<Simulation<D>, Failure> {
    let mut scene: Value = serde_json::from_str(&std::fs::read_to_string(folder().join(name))?)?;
    for (pointer, value) in changes {
        *scene.pointer_mut(pointer).ok_or("no such key")? = value.clone();
    }
    Ok(scene::read(&scene.to_string(), &[])?.build(&folder())?)
}

fn loaded<const D: usize>(simulation: &Simulation<D>) -> Vec<f64> {
    simulation.loads.surface.iter().map(|load| load.points.iter().map(|point| point.area).sum()).collect()
}

#[test]
fn groups_are_bodies_loaded_surfaces_and_held_regions_of_a_scene() -> Result<(), Failure> {
    let mut plate = built::<2>("plate.json", &[])?;
    let loads = loaded(&plate);
    near(loads[0], 0.75)?;
    near(loads[1], 1.5185930869114532)?;
    near(plate.particles.volume.iter().sum(), 2.578974363210118)?;
    // A pressure in a hole has no resultant: the support bears half of the traction on the rubber.
    let report = plate.advance()?;
    let force = report.reactions.first().ok_or("no reaction")?.force;
    assert!((force.abs() - Vector::from([1.5, 0.75])).norm() < 0.01, "{force}");
    let part = built::<3>("part.json", &[])?;
    near(loaded(&part)[0], 0.887537238538106)?;
    near(loaded(&part)[1], 1.1)?;
    near(part.particles.volume.iter().sum(), 1.5757772887762683)?;
    // Twice as large, about a corner of the grid: the group of a load as much as the body.
    let doubled = |group: &str| json!({"scaled": {"of": {"mesh": {"file": "plate.msh", "group": group}}, "about": [1, 1], "factor": 2}});
    let changes = [
        ("/grid/size", json!([8, 6])),
        ("/bodies/0/shape", doubled("steel")),
        ("/bodies/1/shape", doubled("rubber")),
        ("/prescribed/0/region", doubled("left")),
        ("/tractions/0/region", doubled("top of rubber")),
        ("/pressures/0/region", doubled("hole")),
    ];
    let large = built::<2>("plate.json", &changes)?;
    near(loaded(&large)[0], 1.5)?;
    near(loaded(&large)[1], 2.0 * 1.5185930869114532)?;
    near(large.particles.volume.iter().sum(), 4.0 * 2.578974363210118)?;
    Ok(())
}

#[test]
fn a_wrong_use_of_a_group_is_refused_with_its_key() -> Result<(), Failure> {
    let mesh = |file: &str, group: &str| json!({"mesh": {"file": file, "group": group}});
    let wrong = [
        ("/bodies/0/shape", mesh("plate.msh", "stel"), "bodies[0].shape.mesh.file: ", "has 0 physical groups \"stel\""),
        (
            "/bodies/0/shape",
            mesh("plate.msh", "stel"),
            "bodies[0].shape.mesh.file: ",
            "[\"left\", \"hole\", \"top of rubber\", \"steel\", \"rubber\"]",
        ),
        (
            "/bodies/0/shape",
            mesh("plate.msh", "left"),
            "bodies[0].shape: ",
            "must have an inside: a physical group of 2 dimensions",
        ),
        (
            "/prescribed/0/region",
            mesh("plate.msh", "hole"),
            "prescribed[0].region: ",
            "does not lie in one plane of the grid",
        ),
        (
            "/tractions/0/region",
            mesh("plate.msh", "left"),
            "tractions[0]: ",
            "nothing of the surface of body \"rubber\" is loaded",
        ),
        ("/bodies/0/shape", mesh("plate.stl", "steel"), "bodies[0].shape.mesh.file: ", "must end in .msh"),
        ("/bodies/0/shape", mesh("none.msh", "steel"), "bodies[0].shape.mesh.file: ", "No such file"),
        (
            "/bodies/0/shape",
            json!({"union": [mesh("part.msh", "hole")]}),
            "bodies[0].shape.union[0].mesh.file: ",
            "in 2 dimensions all must have one z",
        ),
        (
            "/bodies/0/shape",
            mesh("part.msh", "steel"),
            "bodies[0].shape.mesh.file: ",
            "one surface or curve: [\"foot\"",
        ),
    ];
    for (key, value, place, words) in wrong {
        let error = built::<2>("plate.json", &[(key, value.clone())]).err().ok_or(words)?.to_string();
        assert!(error.starts_with(place) && error.contains(words), "{value}: {error}");
    }
    Ok(())
}

/// A square of two triangles.
const SQUARE: &str = "$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
1 7 \"side\"
2 5 \"part\"
$EndPhysicalNames
$Entities
0 1 1 0
1 0 0 0 1 0 0 1 7 0
1 0 0 0 1 1 0 1 -5 1 1
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
1 1 0
0 1 0
$EndNodes
$Elements
2 3 1 3
1 1 1 1
1 1 2
2 1 2 2
2 1 2 3
3 1 3 4
$EndElements
";

fn read<const D: usize>(bytes: &[u8], group: &str) -> Result<Shape<D>, Failure> {
    let file = tempfile::Builder::new().suffix(".msh").tempfile()?;
    std::fs::write(file.path(), bytes)?;
    Ok(read_group(file.path(), group)?)
}

#[test]
fn broken_files_are_refused_with_the_place() -> Result<(), Failure> {
    let binary = std::fs::read(folder().join("plate_binary.msh"))?;
    let with = |text: &str, by: &str| SQUARE.replace(text, by).into_bytes();
    let crossed = SQUARE.replace("1 1 0\n0 1 0", "0 1 0\n0.5 1 0").replace("2 3 1 3", "2 2 1 2");
    let crossed = crossed.replace("2 1 2 2\n2 1 2 3\n3 1 3 4", "2 1 3 1\n2 1 2 3 4");
    let mut swapped = binary.clone();
    let one = swapped.iter().position(|byte| *byte == 1).ok_or("no 1")?;
    swapped[one..one + 4].reverse();
    let wrong: Vec<(Vec<u8>, &str)> = vec![
        (b"solid cube".to_vec(), "in line 1, another beginning than $MeshFormat"),
        (
            with("4.1 0 8", "2.2 0 8"),
            "in line 2, the version \"2.2\" of MSH; must be 4.1: save it with `Mesh.MshFileVersion = 4.1`",
        ),
        (with("4.1 0 8", "4 0 8"), "in line 2, the version \"4\" of MSH"),
        (with("4.1 0 8", "4.1 0 4"), "in line 2, another type of file than 0 or 1, or another size of numbers than 8"),
        (swapped, "before byte 24, numbers in another order of bytes"),
        (SQUARE.as_bytes()[..200].to_vec(), "in line 21, \"\" instead of a coordinate of a node"),
        (binary[..5000].to_vec(), "before byte 5000, its end instead of a node of an element"),
        (with("1 4 1 4", "1 5 1 4"), "in line 24, 4 nodes where 5 are announced"),
        (with("2 3 1 3", "2 4 1 3"), "in line 32, 3 elements where 4 are announced"),
        (with("2 1 0 4", "2 1 0 18446744073709551615"), "in line 25, \"$EndNodes\" instead of the tag of a node"),
        (with("2 1 2 2", "2 1 2 999999999999"), "in line 33, \"$EndElements\" instead of the tag of an element"),
        (with("3 1 3 4", "3 1 3 9"), "in line 32, element 3 with node 9, which is not in $Nodes"),
        (with("1 1 0\n0", "1 nan 0\n0"), "in line 23, node 3 at [1.0, NaN, 0.0]; must be finite"),
        (with("1 1 0\n0", "1 1e300 0\n0"), "in line 23, node 3 at [1.0, 1e300, 0.0]"),
        (with("1\n2\n3\n4\n", "1\n2\n3\n3\n"), "in line 24, node 3 for the second time"),
        (with("2 1 2 2", "3 1 2 2"), "in line 30, elements of 2 dimensions in an entity of 3"),
        (
            with("2 1 2 2", "2 1 9 2"),
            "in line 30, elements of type 9; elements must be of first order: `Mesh.ElementOrder = 1`",
        ),
        (with("-5 1 1", "-6 1 1"), "has no elements in the group \"part\""),
        (with("\"part\"", "\"side"), "in line 7, \"\\\"side\" instead of a name in quotes"),
        (with("$Nodes", "$PartitionedEntities\n$EndPartitionedEntities\n$Nodes"), "in line 14, a partitioned mesh"),
        (with("$Nodes", "$Periodic\n1\n$Nodes"), "in line 14, \"$Periodic\" without its end"),
        (
            with("1 1 0\n0", "1 1 0.5\n0"),
            "with nodes at [0.0, 0.0, 0.0] and [1.0, 1.0, 0.5]; in 2 dimensions all must have one z",
        ),
        (with("3 1 3 4", "3 2 3 4"), "an outline that meets itself at [1.0, 1.0]"),
        (with("1 1 0\n0 1 0", "0 1 0\n1 1 0"), "an outline that meets itself at [0.0, 0.0]"),
        (
            crossed.into_bytes(),
            "with the edge between vertices 3 and 0 that meets the one between 1 and 2, at [0.5, 1.0]",
        ),
    ];
    for (bytes, words) in &wrong {
        let error = read::<2>(bytes, "part").err().ok_or(*words)?.to_string();
        assert!(error.contains(words), "{words}: {error}");
    }
    assert!(read::<1>(SQUARE.as_bytes(), "part").is_err());
    Ok(())
}
