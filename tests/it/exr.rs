//! EXR and PNG files.

use crate::support::srgb;
use std::collections::{BTreeMap, BTreeSet};

use ::exr::prelude as exrs;
use exrs::WritableImage;
use opsr::image::exr::{self, Layer};
use opsr::image::film::{Film, Window};
use opsr::image::{Buffer, png};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::scene::Camera;

use crate::support::draws::noise;

fn small_film() -> Film {
    let window = Window {
        x: 2,
        y: 1,
        w: 21,
        h: 18,
    };
    let mut film = Film::cropped(UVec2::new(30, 20), window).unwrap();
    for i in 0..film.pixels.len() {
        for s in 0..1 + (i as u32 % 5) {
            let value = noise(film.window.pixel(i), s, 3) * 100.0;
            film.push(i, value, s);
        }
    }
    film
}

fn picture(f: impl Fn(usize, usize) -> Rgb) -> Buffer {
    Buffer::from_fn(21, 18, f)
}

/// A number per pixel.
fn scalar(name: &str, values: Vec<f32>) -> Layer {
    Layer {
        name: name.to_owned(),
        channels: vec![("", values)],
    }
}

/// A vector in three channels.
fn xyz(name: &str, picture: &Buffer) -> Layer {
    let plane = |i: usize| picture.pixels.iter().map(|p| p[i]).collect();
    Layer {
        name: name.to_owned(),
        channels: vec![("X", plane(0)), ("Y", plane(1)), ("Z", plane(2))],
    }
}

#[test]
fn exr_round_trip_of_film_layers_and_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.exr");
    let film = small_film();
    let normal = picture(|x, y| Rgb::new(x as f32, -(y as f32), f32::INFINITY));
    let depth: Vec<f32> = (0..film.pixels.len()).map(|i| i as f32 * 0.1).collect();
    let layers = [xyz("normal", &normal), scalar("depth", depth.clone())];
    let metadata = BTreeMap::from([
        (
            "command".to_owned(),
            "opsr render a.gltf --spp 4".to_owned(),
        ),
        ("scene".to_owned(), "Küche \"3\" \u{1f4a1}\nend".to_owned()),
    ]);
    exr::write_film(&path, &film, &layers, &metadata).unwrap();

    assert_eq!(exr::read_rgb(&path).unwrap(), film.mean());
    let read = exr::read_layers(&path).unwrap();
    assert_eq!(read.metadata, metadata);
    assert_eq!((read.size, read.position), (film.size, (2, 1)));
    assert_eq!(read.layer("normal").unwrap(), normal);
    assert_eq!(read.channels["depth"], depth);
    assert_eq!(
        read.layer("variance_of_mean").unwrap(),
        film.variance_of_mean()
    );

    let again = exr::read_film(&path).unwrap();
    assert_eq!((again.size, again.window), (film.size, film.window));
    assert_eq!(again.mean(), film.mean());
    for (a, b) in again.pixels.iter().zip(&film.pixels) {
        assert_eq!(a.n, b.n);
        assert!((a.m2() - b.m2()).abs().max_element() <= 1e-6 * b.m2().max_element());
    }
}

#[test]
fn exr_determinism_and_whole_file_writes() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    let metadata: BTreeMap<_, _> = (0..20)
        .map(|i| (format!("key{i}"), i.to_string()))
        .collect();
    exr::write_rgb(&b, &picture(|_, _| Rgb::ONE), &BTreeMap::new()).unwrap();
    for path in [&a, &b] {
        exr::write_film(path, &small_film(), &[], &metadata).unwrap();
    }
    assert!(std::fs::read(&a).unwrap() == std::fs::read(&b).unwrap());
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        2,
        "no temporary file is left"
    );
}

#[test]
fn exr_errors_name_the_file_and_the_missing_channel() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    let error = exr::read_rgb(&path).unwrap_err();
    assert!(error.to_string().contains("picture.exr"), "{error}");
    assert!(error.is_missing());

    exr::write_rgb(&path, &picture(|_, _| Rgb::ONE), &BTreeMap::new()).unwrap();
    let error = exr::read_film(&path).unwrap_err().to_string();
    assert!(
        error.contains("sample_variance.R") && error.contains("B, G, R"),
        "{error}"
    );

    let short = scalar("depth", vec![1.0]);
    let error = exr::write_film(&path, &small_film(), &[short], &BTreeMap::new()).unwrap_err();
    assert!(error.to_string().contains("depth"), "{error}");

    let nowhere = folder.path().join("no/such/folder.exr");
    assert!(exr::write_film(&nowhere, &small_film(), &[], &BTreeMap::new()).is_err());
}

#[test]
fn exr_damaged_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.exr");
    exr::write_film(&path, &small_film(), &[], &BTreeMap::new()).unwrap();
    let good = std::fs::read(&path).unwrap();
    let mut refused = 0;
    for i in 0..300usize {
        let mut bytes = good.clone();
        if i % 3 == 0 {
            bytes.truncate(i * good.len() / 300);
        } else {
            // Mostly in the header, which contains the sizes.
            let place = (i * 7919) % if i % 3 == 1 { 600 } else { good.len() };
            bytes[place] = bytes[place].wrapping_add(1 + (i * 31 % 255) as u8);
        }
        std::fs::write(&path, &bytes).unwrap();
        refused += usize::from(exr::read_layers(&path).is_err());
    }
    assert!(refused > 100, "only {refused} refused");
}

/// A broken block and a missing end: the first fault in the file is reported, whichever thread is faster.
#[test]
fn exr_error_determinism_of_two_faults() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("twice.exr");
    let grain = |x, y| noise(UVec2::new(x as u32, y as u32), 0, 3);
    let picture = Buffer::from_fn(256, 256, grain);
    exr::write_rgb(&path, &picture, &BTreeMap::new()).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let (broken, end) = (bytes.len() / 2, bytes.len() * 9 / 10);
    bytes[broken..broken + 64].fill(0);
    bytes.truncate(end);
    std::fs::write(&path, &bytes).unwrap();
    let report: BTreeSet<String> = (0..40)
        .map(|_| exr::read_rgb(&path).unwrap_err().to_string())
        .collect();
    assert_eq!(report.len(), 1, "{report:?}");
    assert!(
        report.iter().all(|t| t.contains("compressed")),
        "{report:?}"
    );
}

#[test]
fn exr_header_with_too_many_pixels_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.exr");
    exr::write_rgb(&path, &picture(|_, _| Rgb::ONE), &BTreeMap::new()).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    // After name, type and length, the data window of 21x18 pixels is stored as 0, 0, 20, 17.
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    assert_eq!(bytes[at + 8..at + 12], 20i32.to_le_bytes());
    bytes[at + 8..at + 12].copy_from_slice(&29_999i32.to_le_bytes());
    bytes[at + 12..at + 16].copy_from_slice(&29_999i32.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    let error = exr::read_rgb(&path).unwrap_err().to_string();
    assert!(error.contains("30000x30000 pixels"), "{error}");
}

/// A file of half floats with an enlarged data window, whose pixels are missing.
#[test]
fn exr_header_larger_than_its_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("promise.exr");
    let halves = crate::fuzz::seeds::foreign(
        ::exr::prelude::Compression::ZIP1,
        ::exr::prelude::Blocks::ScanLines,
    );
    let name = b"dataWindow\0box2i\0";
    let at = halves.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    for (edge, refused) in [(6i32, false), (2_000, true), (16_000, true)] {
        let mut bytes = halves.clone();
        bytes[at + 8..at + 12].copy_from_slice(&(edge + 2).to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&edge.to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        match exr::read_rgb(&path) {
            Ok(picture) => assert!(!refused && picture.height == 7),
            Err(e) => assert!(refused && e.to_string().contains("cannot hold"), "{e}"),
        }
    }
}

#[test]
fn png_with_too_many_pixels_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.png");
    std::fs::write(&path, crate::load::hostile::claiming(20_000, 20_000)).unwrap();
    let error = png::read(&path).unwrap_err().to_string();
    assert!(error.contains("huge.png: 20000x20000 pixels"), "{error}");
}

#[test]
fn png_round_trip_within_eight_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("display.png");
    let ramp = picture(|x, y| Rgb::new(x as f32 / 20.0, y as f32 / 17.0, 0.001 * x as f32));
    png::write(&path, &ramp, -1.0).unwrap();
    let read = png::read(&path).unwrap();
    assert_eq!(read.size(), ramp.size());
    for (a, b) in read.pixels.iter().zip(&ramp.pixels) {
        let encoded = |p: Rgb| p.to_array().map(srgb);
        for (a, b) in encoded(*a).into_iter().zip(encoded(*b * 0.5)) {
            assert!((a - b).abs() <= 0.5001 / 255.0);
        }
    }
    std::fs::write(&path, b"\x89PNG\r\n\x1a\nnot really").unwrap();
    assert!(
        png::read(&path)
            .unwrap_err()
            .to_string()
            .contains("display.png")
    );
}

/// A part of an EXR file with these channels of one value each.
fn part(name: &str, channels: &[(&str, f32)]) -> exrs::Layer<exrs::AnyChannels<exrs::FlatSamples>> {
    let channel = |&(name, value): &(&str, f32)| {
        exrs::AnyChannel::new(name, exrs::FlatSamples::F32(vec![value; 12]))
    };
    let attributes = exrs::LayerAttributes {
        layer_name: exrs::Text::new_or_none(name),
        ..Default::default()
    };
    let channels = exrs::AnyChannels::sort(channels.iter().map(channel).collect());
    exrs::Layer::new((4, 3), attributes, exrs::Encoding::UNCOMPRESSED, channels)
}

/// Channel names of Blender in one part (up to 4.5) and in many (from 5.0), and of Arnold.
#[test]
fn exr_multilayer_files_of_blender_and_arnold() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("multi.exr");
    let blender = [
        ("ViewLayer.Combined.R", 1.0),
        ("ViewLayer.Combined.G", 2.0),
        ("ViewLayer.Combined.B", 3.0),
        ("ViewLayer.Combined.A", 1.0),
        ("ViewLayer.Depth.Z", 9.0),
        ("ViewLayer.Normal.X", 0.1),
        ("ViewLayer.Normal.Y", 0.2),
        ("ViewLayer.Normal.Z", 0.3),
    ];
    let arnold = [
        ("R", 1.0),
        ("G", 2.0),
        ("B", 3.0),
        ("A", 1.0),
        ("Depth.Z", 9.0),
        ("Normal.X", 0.1),
        ("Normal.Y", 0.2),
        ("Normal.Z", 0.3),
    ];
    let bounds = exrs::IntegerBounds::from_dimensions((4, 3));
    let image = |parts: Vec<_>| exrs::Image {
        attributes: exrs::ImageAttributes::new(bounds),
        layer_data: exrs::Layers::from(parts),
    };
    for file in [
        image(vec![part("", &blender)]),
        image(vec![
            part("ViewLayer.Combined", &blender[..4]),
            part("ViewLayer.Depth", &blender[4..5]),
            part("ViewLayer.Normal", &blender[5..]),
        ]),
        image(vec![part("", &arnold)]),
        image(vec![part("RGBA", &arnold[..4]), part("rest", &arnold[4..])]),
    ] {
        file.write().to_file(&path).unwrap();
        let first = |picture: Buffer| picture.pixels[0];
        assert_eq!(
            first(exr::read_rgb(&path).unwrap()),
            Rgb::new(1.0, 2.0, 3.0)
        );
        let layers = exr::read_layers(&path).unwrap();
        assert_eq!(first(layers.layer("Depth").unwrap()), Rgb::splat(9.0));
        assert_eq!(
            first(layers.layer("Normal").unwrap()),
            Rgb::new(0.1, 0.2, 0.3)
        );
        let missing = layers.layer("Albedo").unwrap_err().to_string();
        assert!(
            missing.contains("Albedo") && missing.contains("Normal"),
            "{missing}"
        );
    }
    let two = [
        ("a.x.R", 1.0),
        ("a.x.G", 1.0),
        ("a.x.B", 1.0),
        ("b.x.R", 2.0),
        ("b.x.G", 2.0),
        ("b.x.B", 2.0),
    ];
    image(vec![part("", &two)]).write().to_file(&path).unwrap();
    let layers = exr::read_layers(&path).unwrap();
    let error = layers.layer("x").unwrap_err().to_string();
    assert!(
        error.contains("more than one") && error.contains("a.x, b.x"),
        "{error}"
    );
    assert!(layers.main().unwrap_err().to_string().contains("a.x, b.x"));
    assert_eq!(layers.layer("b.x").unwrap().pixels[0].x, 2.0);
}

/// Standard attributes for other programs, and radiance beyond half floats.
#[test]
fn exr_half_floats_are_cut_and_attributes_are_standard() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.exr");
    let (from, to) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.5, -1.0));
    let camera = Camera::look_at(from, to, Vec3::Y, 1.0);
    let metadata = BTreeMap::new();
    let header = exr::Header {
        storage: exr::Storage {
            half: true,
            ..Default::default()
        },
        world_to_camera: Some(camera.world_to_camera()),
        ..exr::Header::from(&metadata)
    };
    let mut film = Film::new(UVec2::new(4, 4));
    (0..16).for_each(|i| film.push(i, Rgb::new(1e9, 0.1, 0.0), 0));
    exr::write_film(&path, &film, &[], header).unwrap();
    let picture = exr::read_rgb(&path).unwrap();
    assert_eq!(picture.pixels[0].x, 65504.0);
    assert!((picture.pixels[0].y - 0.1).abs() < 1e-4);
    let meta = ::exr::meta::MetaData::read_from_file(&path, false).unwrap();
    let header = &meta.headers[0];
    let white = header.shared_attributes.chromaticities.unwrap().white;
    assert_eq!((white.x(), white.y()), (0.3127, 0.329));
    // Points are row vectors: the target is straight ahead, at its distance.
    let m = header.own_attributes.world_to_camera.unwrap();
    let p = [to.x, to.y, to.z, 1.0];
    let image: Vec<f32> = (0..4)
        .map(|j| (0..4).map(|i| p[i] * m[4 * i + j]).sum())
        .collect();
    let expected = [0.0, 0.0, from.distance(to), 1.0];
    assert!(
        image
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() < 1e-5),
        "{image:?}"
    );
}
