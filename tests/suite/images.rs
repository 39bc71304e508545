//! Pictures and scans as shapes: comparison with sums over their pixels, and invalid files.

use crate::support::{Failure, Random, merged};
use bfree::scene;
use bfree::shape::{Filling, Layout, Mask, Pixels, Shape, Similar, fill};
use bfree::tensor::{Vector, identity};
use serde_json::{Value, json};
use std::path::Path;

/// A picture as PNG, the first row at the top.
fn png(size: [u32; 2], color: png::ColorType, depth: png::BitDepth, bytes: &[u8]) -> Result<Vec<u8>, Failure> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == png::ColorType::Indexed {
        encoder.set_palette(vec![0; 6]);
    }
    encoder.write_header()?.write_image_data(bytes)?;
    Ok(file)
}

pub(crate) fn grey(size: [u32; 2], bytes: &[u8]) -> Result<Vec<u8>, Failure> {
    png(size, png::ColorType::Grayscale, png::BitDepth::Eight, bytes)
}

/// A body made of the pixels with the given values, for a grid of two or three dimensions.
pub(crate) fn body(name: &str, image: &Value) -> Value {
    json!({"name": name, "shape": {"image": image}, "density": 2, "material": {"neo_hookean": {"young": 100, "poisson": 0.3}}})
}

pub(crate) fn scene_of(size: &[u32], bodies: &[Value], more: Value) -> String {
    let scene = json!({"grid": {"size": size, "spacing": 1}, "time": {"step": 0.1, "end": 1}, "bodies": bodies});
    merged(scene, more).to_string()
}

/// The error message of reading or building the scene.
fn refusal<const D: usize>(text: &str, folder: &Path) -> Result<String, Failure> {
    match scene::read(text, &[]) {
        Err(error) => Ok(error.to_string()),
        Ok(scene) => Ok(scene.build::<D>(folder).err().ok_or("it was built")?.to_string()),
    }
}

/// Random pixels with holes, some of them large.
fn random_mask<const D: usize>(random: &mut Random, count: [usize; 3]) -> Option<(Pixels<D>, Vec<bool>)> {
    let cell = |i: usize| (i / 3 % 2, i / (3 * count[0]) % 2);
    let inside: Vec<bool> = (0..count.iter().product()).map(|i| cell(i) == (0, 0) || random.below(4) == 0).collect();
    let mask = Mask::new(count, inside.iter().copied())?;
    let max = Vector::from_fn(|k, _| 1.0 + [2.0, 1.5, 3.0][k]);
    Some((Pixels::new(Vector::repeat(1.0), max, mask)?, inside))
}

/// The distance to the nearest pixel of the other kind, by a search over all pixels. Outside the picture there is no body.
fn distance<const D: usize>(inside: &[bool], count: [usize; 3], x: &Vector<f64, D>) -> f64 {
    let edge = |k: usize| [2.0, 1.5, 3.0][k] / count[k] as f64;
    let padded = count.map(|n| n + 2);
    let state = |place: [usize; 3]| {
        let within = (0..3).all(|k| k >= D || (1..=count[k]).contains(&place[k]));
        let at = |k: usize| if k < D { place[k] - 1 } else { 0 };
        within && inside[at(0) + count[0] * (at(1) + count[1] * at(2))]
    };
    let (mut out, mut solid) = (f64::INFINITY, f64::INFINITY);
    for i in 0..padded.iter().product::<usize>() {
        let place = [i % padded[0], i / padded[0] % padded[1], i / padded[0] / padded[1]];
        let away = Vector::<f64, D>::from_fn(|k, _| {
            // The empty surroundings of the picture have no end.
            let from = if place[k] == 0 { f64::NEG_INFINITY } else { 1.0 + (place[k] as f64 - 1.0) * edge(k) };
            let to = if place[k] == padded[k] - 1 { f64::INFINITY } else { 1.0 + place[k] as f64 * edge(k) };
            (from - x[k]).max(x[k] - to).max(0.0)
        });
        let nearest = if state(place) { &mut solid } else { &mut out };
        *nearest = nearest.min(away.norm());
    }
    if solid > 0.0 { solid } else { -out }
}

fn distances_in<const D: usize>(count: [usize; 3]) -> Result<(), Failure> {
    let mut random = Random(5);
    for _ in 0..4 {
        let (pixels, inside) = random_mask::<D>(&mut random, count).ok_or("a mask")?;
        let shape = Shape::from(pixels);
        for _ in 0..200 {
            let x = Vector::<f64, D>::from_fn(|_, _| 0.5 + 4.0 * random.below(1 << 20) as f64 / f64::from(1 << 20));
            let (d, normal) = shape.distance_and_normal(&x);
            let expected = distance(&inside, count, &x);
            assert!((d - expected).abs() < 1e-13, "{x}: {d} for {expected}");
            assert!((normal.norm() - 1.0).abs() < 1e-13);
            // The foot point lies on the surface, and the normal points outward.
            assert!(shape.signed_distance(&(x - normal * d)).abs() < 1e-13);
            assert!(shape.signed_distance(&(x + normal * (1e-9 - d))) > 0.0);
        }
    }
    Ok(())
}

#[test]
fn distances_are_those_from_the_nearest_pixel_of_the_other_kind() -> Result<(), Failure> {
    distances_in::<2>([13, 8, 1])?;
    distances_in::<3>([7, 5, 9])
}

#[test]
fn parts_of_boxes_by_pixels_and_by_the_planes_of_their_faces_agree() -> Result<(), Failure> {
    let mut random = Random(6);
    let (pixels, _) = random_mask::<2>(&mut random, [13, 8, 1]).ok_or("a mask")?;
    let direct = Shape::from(pixels);
    // Inside `Similar`, even with no rotation, the shape no longer uses its rows of pixels.
    let (of, about) = (Box::new(direct.clone()), Vector::zeros());
    let planes = Shape::from(Similar { of, about, rotation: identity(), factor: 1.0 });
    for _ in 0..50 {
        let lower = Vector::from_fn(|_, _| 0.5 + 3.0 * random.below(1000) as f64 / 1000.0);
        let edges = Vector::from([0.4, 0.3]);
        let ((one, a), (other, b)) = (direct.part(&lower, &edges, 0.5), planes.part(&lower, &edges, 0.5));
        assert!((one - other).abs() < 1e-9, "{lower}: {one} {other}");
        assert!((a - b).norm() * one < 1e-9, "{lower}: {a} {b}");
    }
    Ok(())
}

#[test]
fn bodies_by_label_have_the_volume_of_their_pixels_and_lie_where_one_sees_them() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    // A grain of label 7 at the top left, a grain of label 9 around it, and no grain at the lower edge.
    let size = [50_u32, 40];
    let label = |i: u32| match (i % size[0], i / size[0]) {
        (_, 30..) => 0,
        (x, y) if x * x + y * y < 400 => 7,
        _ => 9,
    };
    let bytes: Vec<u8> = (0..size[0] * size[1]).map(label).collect();
    std::fs::write(folder.path().join("grains.png"), grey(size, &bytes)?)?;
    let image = |values: [u8; 2]| json!({"file": "grains.png", "min": [1, 1], "max": [6, 5], "values": values});
    let text = scene_of(&[8, 8], &[body("grain", &image([7, 7])), body("rest", &image([8, 255]))], json!({}));
    let scene = scene::read(&text, &[])?;
    let simulation = scene.build::<2>(folder.path())?;
    let pixel = 0.01;
    for (filled, value) in scene.filled(&simulation).iter().zip([7, 9]) {
        let exact = pixel * bytes.iter().filter(|&&byte| byte == value).count() as f64;
        assert!((filled.volume / exact - 1.0).abs() < 1e-12, "{filled}");
        assert!((filled.drawn.ok_or("a shape")? / exact - 1.0).abs() < 1e-12, "{filled}");
        assert!((filled.mass / (2.0 * exact) - 1.0).abs() < 1e-12, "{filled}");
    }
    // Labels share faces and overlap nowhere.
    assert_eq!(scene.warnings(&simulation), Vec::<String>::new());
    // Top left.
    let particles = &simulation.particles;
    let of_first = (0..particles.len()).filter(|&p| particles.body[p] == 0);
    let center: Vector<f64, 2> = of_first.map(|p| particles.position[p] * particles.mass[p]).sum();
    let first = Vector::from([1.0, 5.0]);
    let mut exact = Vector::<f64, 2>::zeros();
    for i in (0..size[0] * size[1]).filter(|&i| label(i) == 7) {
        let from_corner = Vector::from([f64::from(i % size[0]) + 0.5, -f64::from(i / size[0]) - 0.5]) * 0.1;
        exact += (first + from_corner) * (2.0 * pixel);
    }
    assert!((center - exact).norm() < 1e-10 * exact.norm(), "{center} {exact}");
    Ok(())
}

#[test]
fn voxels_run_along_x_first_and_have_their_volume() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let size = [6_u32, 5, 4];
    let solid = |i: u32| i % size[0] < 4 && i / size[0] % size[1] > 1 && i / size[0] / size[1] < 3;
    let bytes: Vec<u8> = (0..120).map(|i| if solid(i) { 200 } else { 3 }).collect();
    std::fs::write(folder.path().join("bone.raw"), &bytes)?;
    let image = json!({"file": "bone.raw", "size": size, "min": [1, 1, 1], "max": [4, 3.5, 3], "values": [128, 255]});
    let scene = scene::read(&scene_of(&[6, 6, 6], &[body("bone", &image)], json!({})), &[])?;
    let simulation = scene.build::<3>(folder.path())?;
    let filled = scene.filled(&simulation).remove(0);
    assert!((filled.volume / (0.125 * 4.0 * 3.0 * 3.0) - 1.0).abs() < 1e-12, "{filled}");
    let shape = scene.bodies[0].shape.as_ref().and_then(|shape| shape.build::<3>()).ok_or("a shape")?;
    assert_eq!(shape.bounding_box(), (Vector::from([1.0, 2.0, 1.0]), Vector::from([3.0, 3.5, 2.5])));
    // Gauss points as well.
    let gauss = Filling { per_axis: 2, layout: Layout::Gauss, ..Filling::default() };
    let volume: f64 = fill(&simulation.grid, &shape, gauss)?.iter().map(|seed| seed.volume).sum();
    assert!((volume / filled.volume - 1.0).abs() < 1e-12, "{volume}");
    Ok(())
}

#[test]
fn a_pressure_on_pixels_has_the_resultant_of_the_section_and_a_traction_is_warned_of() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    // A disc of radius 2.
    let n = 80_u32;
    let inside = |i: u32| (i % n).abs_diff(n / 2).pow(2) + (i / n).abs_diff(n / 2).pow(2) < 1600;
    let bytes: Vec<u8> = (0..n * n).map(|i| if inside(i) { 255 } else { 0 }).collect();
    std::fs::write(folder.path().join("disc.png"), grey([n, n], &bytes)?)?;
    let image = json!({"file": "disc.png", "min": [1, 1], "max": [5, 5], "values": [255, 255]});
    let right = json!({"half_space": {"point": [3, 0], "normal": [-1, 0]}});
    let loads = json!({
        "pressures": [{"body": "disc", "pressure": 1, "region": right}],
        "tractions": [{"body": "disc", "traction": [1, 0], "region": right}],
    });
    let scene = scene::read(&scene_of(&[6, 6], &[body("disc", &image)], loads), &[])?;
    let simulation = scene.build::<2>(folder.path())?;
    let [traction, pressure] = simulation.loads.surface.as_slice() else { return Err("two loads".into()) };
    let resultant: Vector<f64, 2> = pressure.points.iter().map(|point| point.normal * point.area).sum();
    let height = 0.05 * (0..n).filter(|j| (0..n).any(|i| i >= n / 2 && inside(i + n * j))).count() as f64;
    assert!((resultant - Vector::from([height, 0.0])).norm() < 1e-6, "{resultant}");
    // Half of a circle is 2π, its staircase 8, and an arc of one pixel is missing.
    let area: f64 = traction.points.iter().map(|point| point.area).sum();
    assert!((area - 7.9).abs() < 0.11, "{area}");
    let warnings = scene.warnings(&simulation);
    let [warning] = &warnings[..] else { return Err(format!("{warnings:?}").into()) };
    assert!(warning.contains("staircase") && warning.contains("1.41 times"), "{warning}");
    Ok(())
}

#[test]
fn files_that_give_no_shape_are_refused_with_what_is_allowed() -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes);
    write("rgb.png", &png([2, 1], png::ColorType::Rgb, png::BitDepth::Eight, &[0; 6])?)?;
    write("palette.png", &png([2, 1], png::ColorType::Indexed, png::BitDepth::Eight, &[0, 1])?)?;
    write("deep.png", &png([2, 1], png::ColorType::Grayscale, png::BitDepth::Sixteen, &[0; 4])?)?;
    let good = grey([30, 20], &[7; 600])?;
    write("good.png", &good)?;
    write("cut.png", &good[..good.len() - 20])?;
    write("text.png", b"not a picture")?;
    write("short.raw", &[1; 7])?;
    // The header promises 10⁸ pixels, but the file has 70 bytes.
    for (name, size) in [("huge.png", [0, 0, 39, 16, 0, 0, 39, 16]), ("larger.png", [0, 1, 0, 0, 0, 1, 0, 0])] {
        let mut header = good.clone();
        header[16..24].copy_from_slice(&size);
        let crc = crc32fast::hash(&header[12..29]).to_be_bytes();
        header[29..33].copy_from_slice(&crc);
        write(name, &header)?;
    }
    let flat = |file: &str, values: [u8; 2]| {
        let image = json!({"file": file, "min": [1, 1], "max": [3, 3], "values": values});
        refusal::<2>(&scene_of(&[4, 4], &[body("a", &image)], json!({})), folder.path())
    };
    let path = "bodies[0].shape.image.file";
    for (file, values, words) in [
        ("gone.png", [7, 7], "No such file"),
        ("rgb.png", [7, 7], "is a PNG of Rgb and 8 bits; grey ones of 1, 2, 4 or 8 bits are allowed"),
        ("palette.png", [7, 7], "is a PNG of Indexed"),
        ("deep.png", [7, 7], "Grayscale and 16 bits"),
        ("cut.png", [7, 7], "cannot be read"),
        ("text.png", [7, 7], "cannot be read"),
        ("huge.png", [7, 7], "bytes, and 100000000 pixels"),
        ("larger.png", [7, 7], "has 65536 × 65536 pixels; 1 to 134217728 in all are allowed"),
        ("good.png", [8, 255], "has no pixel of a value from 8 to 255: its values are from 7 to 7"),
        ("good.raw", [7, 7], "must end in .png in 2 dimensions"),
        ("a\0.png", [7, 7], "cannot be read"),
        ("good.png", [9, 7], "must be the least value, then the greatest"),
    ] {
        let message = flat(file, values)?;
        assert!(message.contains(words), "{file}: {message}");
        assert!(message.contains(path) || message.contains("bodies[0].shape.image.values"), "{file}: {message}");
    }
    let deep = |size: Value| {
        let image = json!({"file": "short.raw", "min": [1, 1, 1], "max": [3, 3, 3], "values": [1, 1], "size": size});
        refusal::<3>(&scene_of(&[4, 4, 4], &[body("a", &image)], json!({})), folder.path())
    };
    for (size, words) in [
        (json!([2, 2, 2]), "short.raw has 7 bytes, and 8 pixels"),
        (json!([0, 2, 2]), "must be three numbers of at least 1"),
        (json!([4_000_000_000_u32, 4_000_000_000_u32, 4_000_000_000_u32]), "whose product is at most 134217728"),
        (Value::Null, "must give the voxels along x, y and z"),
    ] {
        let message = deep(size)?;
        assert!(message.contains(words), "{message}");
    }
    // The program does not wait for a pipe and does not read a folder.
    std::fs::create_dir(folder.path().join("folder.png"))?;
    assert!(flat("folder.png", [7, 7])?.contains("is no regular file"));
    Ok(())
}
