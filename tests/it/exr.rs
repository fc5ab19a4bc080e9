//! EXR and PNG files.

use std::collections::{BTreeMap, BTreeSet};

use opsr::image::exr::{self, Layer};
use opsr::image::film::{Film, Window};
use opsr::image::{Buffer, png};
use opsr::math::{Rgb, UVec2};

use crate::film::noise;

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
            let value = noise(film.pixel(i), s, 3) * 100.0;
            film.push(i, value, s);
        }
    }
    film
}

fn picture(f: impl Fn(usize, usize) -> Rgb) -> Buffer {
    Buffer::from_fn(21, 18, f)
}

#[test]
fn exr_round_trip_of_film_layers_and_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.exr");
    let film = small_film();
    let normal = picture(|x, y| Rgb::new(x as f32, -(y as f32), f32::INFINITY));
    let depth: Vec<f32> = (0..film.pixels.len()).map(|i| i as f32 * 0.1).collect();
    let layers = [
        Layer::xyz("normal", &normal),
        Layer::scalar("depth", depth.clone()),
    ];
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
    assert_eq!(
        read.picture(["normal.X", "normal.Y", "normal.Z"]).unwrap(),
        normal
    );
    assert_eq!(read.channel("depth").unwrap(), depth);
    let names = ["R", "G", "B"].map(|c| format!("variance_of_mean.{c}"));
    assert_eq!(
        read.picture(names.each_ref().map(String::as_str)).unwrap(),
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

    let short = Layer::scalar("depth", vec![1.0]);
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
            // Mostly in the header, where sizes are.
            let place = (i * 7919) % if i % 3 == 1 { 600 } else { good.len() };
            bytes[place] = bytes[place].wrapping_add(1 + (i * 31 % 255) as u8);
        }
        std::fs::write(&path, &bytes).unwrap();
        refused += usize::from(exr::read_layers(&path).is_err());
    }
    assert!(refused > 100, "only {refused} refused");
}

/// A broken block and an end that is missing: whichever thread is faster, the first of the file is told.
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
    let told: BTreeSet<String> = (0..40)
        .map(|_| exr::read_rgb(&path).unwrap_err().to_string())
        .collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told.iter().all(|t| t.contains("compressed")), "{told:?}");
}

#[test]
fn exr_header_with_too_many_pixels_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.exr");
    exr::write_rgb(&path, &picture(|_, _| Rgb::ONE), &BTreeMap::new()).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    // The data window of 21x18 pixels is stored as 0, 0, 20, 17 after its name, type and length.
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
    assert_eq!(bytes[at + 8..at + 12], 20i32.to_le_bytes());
    bytes[at + 8..at + 12].copy_from_slice(&29_999i32.to_le_bytes());
    bytes[at + 12..at + 16].copy_from_slice(&29_999i32.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    let error = exr::read_rgb(&path).unwrap_err().to_string();
    assert!(error.contains("30000x30000 pixels"), "{error}");
}

/// A file of half floats whose data window is made larger: memory for it would have to be written, not only promised.
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
        let encoded = |p: Rgb| p.to_array().map(png::srgb_encode);
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
