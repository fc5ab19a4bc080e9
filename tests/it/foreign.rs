//! Scenes of Mitsuba and pbrt: pictures against references by Mitsuba 3 (`tests/bench/scenes_by_mitsuba.py`),
//! conventions, messages, broken files.

mod legal;
mod lights;
mod models;
mod names;
mod nearest;
mod subdivision;
mod wider;

use super::support::render::{film_with, mean};
use crate::support::root;
use opsr::Render;
use opsr::files::FileError;
use opsr::image::Buffer;
use opsr::integrator::Settings;
use opsr::math::{DVec3, Rgb, Vec3};
use opsr::render::value::ResolveChoice;
use opsr::scene::load::{FileLight, LoadOptions, Loaded, Unsupported, load};
use opsr::scene::{Medium, PunctualLight, Scene};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Side of a tile in pixels.
const TILE: usize = 8;

#[derive(Deserialize)]
struct Reference {
    size: [usize; 2],
    tiles: Vec<[f64; 3]>,
    errors: Vec<[f64; 3]>,
}

fn folder() -> PathBuf {
    root().join("tests/data/scenes")
}

fn references() -> BTreeMap<String, Reference> {
    let text = std::fs::read_to_string(folder().join("references.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Means and standard errors of the tiles of a picture.
fn tiles(mean: &Buffer, variance: &Buffer) -> Vec<(DVec3, DVec3)> {
    let mut out = Vec::new();
    for y in 0..mean.height / TILE {
        for x in 0..mean.width / TILE {
            let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..TILE * TILE {
                let at = (y * TILE + i / TILE) * mean.width + x * TILE + i % TILE;
                sum += mean.pixels[at].as_dvec3();
                squares += variance.pixels[at].as_dvec3();
            }
            let n = (TILE * TILE) as f64;
            out.push((sum / n, squares.map(f64::sqrt) / n));
        }
    }
    out
}

/// Root mean square and largest of the z-scores of a file's tiles.
fn scores(file: &str, reference: &Reference, options: &LoadOptions, spp: u32) -> (f64, f64) {
    let loaded = load(&folder().join(file), options).unwrap();
    let scene = Scene::new(loaded.parts);
    let render = Render::new(&scene).with(|spec| {
        (spec.size, spec.spp) = (None, Some(spp));
        spec.resolve = Some(ResolveChoice::Raw);
    });
    let rendered = render.run().unwrap();
    let film = &rendered.outcome.picture.film;
    let mean = film.mean();
    assert_eq!([mean.width, mean.height], reference.size, "{file}");
    let (mut sum, mut most, mut count) = (0.0, 0.0f64, 0.0);
    let (mut ours, mut theirs) = (DVec3::ZERO, DVec3::ZERO);
    for ((tile, error), (expected, other)) in (tiles(&mean, &film.variance_of_mean()).into_iter())
        .zip(reference.tiles.iter().zip(&reference.errors))
    {
        ours += tile;
        theirs += DVec3::from(*expected);
        for c in 0..3 {
            // Half a percent is allowed for interpolated texels and faceted curves.
            let slack = 0.005 * expected[c];
            let error = (error[c].powi(2) + other[c].powi(2) + slack * slack)
                .sqrt()
                .max(1e-6);
            let z = (tile[c] - expected[c]) / error;
            if std::env::var_os("OPSR_SCORES").is_some() {
                eprintln!(
                    "{file} {} {c}: {:.4} {:.4} z {z:.1}",
                    count as u32 / 3,
                    tile[c],
                    expected[c]
                );
            }
            (sum, most, count) = (sum + z * z, most.max(z.abs()), count + 1.0);
        }
    }
    eprintln!(
        "{file}: mean {:.4} over {:.4}, rms z {:.2}, largest {most:.2}",
        ours / count * 3.0,
        theirs / count * 3.0,
        (sum / count).sqrt()
    );
    ((sum / count).sqrt(), most)
}

/// Ten scenes in both formats.
#[test]
fn foreign_scenes_agree_with_mitsuba() {
    let references = references();
    assert_eq!(references.len(), 10);
    let mut wrong = Vec::new();
    for (name, reference) in &references {
        for kind in ["xml", "pbrt"] {
            let options = LoadOptions {
                distribution: (name == "pool" && kind == "pbrt")
                    .then_some(opsr::bsdf::Distribution::Beckmann),
                ..opsr_formats::options()
            };
            let file = format!("{name}.{kind}");
            let spp = std::env::var("OPSR_SPP").map_or(192, |n| n.parse().unwrap());
            let (rms, most) = scores(&file, reference, &options, spp);
            if !(rms < 1.4 && most < 5.0) {
                wrong.push(format!("{file}: rms {rms:.2}, largest {most:.2}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Loads a file with this text.
pub(super) fn read(name: &str, text: &str, skip: bool) -> Result<Loaded, FileError> {
    let folder = crate::support::quick_folder();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    let options = LoadOptions {
        unsupported: match skip {
            true => Unsupported::Skip,
            false => Unsupported::Error,
        },
        ..opsr_formats::options()
    };
    load(&path, &options)
}

pub(super) fn message(name: &str, text: &str) -> String {
    read(name, text, false).unwrap_err().to_string()
}

/// Unsupported elements are errors with their line, or with `--unsupported skip` warnings.
#[test]
fn foreign_unsupported_parts_are_named_with_their_line() {
    let xml = "<scene version=\"3.0.0\">\n  <shape type=\"sphere\">\n    <bsdf type=\"measured\"/>\n  </shape>\n</scene>";
    let text = message("a.xml", xml);
    assert!(
        text.contains(
            "line 3: bsdf `measured` is not supported; --unsupported nearest shows a grey"
        ),
        "{text}"
    );
    let loaded = read("a.xml", xml, true).unwrap();
    assert_eq!(
        loaded.warnings,
        ["line 3: bsdf `measured` is not supported: shown as a grey diffuse surface"]
    );
    assert_eq!(loaded.parts.meshes.len(), 1);
    let pbrt = "WorldBegin\n# A comment\nMaterial \"measured\"\nShape \"sphere\"\n";
    let text = message("a.pbrt", pbrt);
    assert!(
        text.contains("line 3: material `measured` is not supported"),
        "{text}"
    );
    let loaded = read("a.pbrt", pbrt, true).unwrap();
    assert_eq!(
        loaded.warnings,
        ["line 3: material `measured` is not supported: shown as a grey diffuse surface"]
    );
}

/// Broken files: a message that names file and line.
#[test]
fn foreign_broken_files_are_named_with_their_line() {
    let scene = |inner: &str| format!("<scene version=\"3.0.0\">\n{inner}\n</scene>");
    for (inner, expected) in [
        (
            "<shape type=\"sphere\"><float name=\"radius\" value=\"x\"/></shape>",
            "line 2: `x` is no float",
        ),
        (
            "<shape type=\"sphere\"><ref id=\"q\"/></shape>",
            "line 2: no object `q`",
        ),
        (
            "<shape type=\"obj\"><string name=\"filename\" value=\"../a.obj\"/></shape>",
            "leaves the scene's folder",
        ),
        (
            "<shape type=\"ply\"><string name=\"filename\" value=\"none.ply\"/></shape>",
            "line 2: cannot read",
        ),
        ("<include filename=\"a.xml\"/>", "includes itself"),
        ("<float name=\"a\" value=\"$b\"/>", "`$b` has no <default>"),
        (
            "<shape type=\"sphere\"><transform name=\"to_world\"><scale value=\"nan\"/></transform></shape>",
            "is no vector",
        ),
        (
            "<bsdf type=\"twosided\" id=\"a\"><ref id=\"a\"/></bsdf><shape type=\"sphere\"><ref id=\"a\"/></shape>",
            "line 2: refers to itself",
        ),
        ("<wrong/>", "line 2: <wrong> is no element of Mitsuba"),
        (
            "<sensor type=\"perspective\"><string name=\"focal_length\" value=\"far\"/></sensor>",
            "line 2: focal_length is no length",
        ),
    ] {
        let text = message("a.xml", &scene(inner));
        assert!(
            text.contains(expected) && text.contains("a.xml"),
            "{inner}: {text}"
        );
    }
    assert!(message("a.xml", "<scene>\n<shape>").contains("a.xml: XML line "));
    for (text, expected) in [
        (
            "Shape \"sphere\" \"float radius\" [ 1",
            "line 1: a bracket without its end",
        ),
        // A form feed is white space; the reader once made endless empty words of it.
        (
            "Shape \"sphere\" \"float radius\" [ 1 a\u{c}0 ]",
            "line 1: values that are not of one kind",
        ),
        (
            "\nShape \"trianglemesh\" \"point3 P\" [ 0 0 0 ] \"integer indices\" [ 0 1 2 ]",
            "line 2: an index is not below",
        ),
        ("AttributeEnd", "line 1: an end without its begin"),
        ("\n\nWrong", "line 3: `Wrong` is no directive"),
        ("Include \"a.pbrt\"", "includes itself"),
        (
            "NamedMaterial \"a\" Shape \"disk\"",
            "line 1: no material `a`",
        ),
        ("Translate 1 2", "line 1: 3 numbers should follow"),
        (
            "Scale 1e300 1 1 Scale 1e300 1 1",
            "line 1: the transform is not finite",
        ),
        (
            "Shape \"plymesh\" \"string filename\" \"/etc/passwd\"",
            "leaves the scene's folder",
        ),
        (
            "Film \"rgb\" \"integer xresolution\" 1e9\nCamera \"perspective\"",
            "line 1: xresolution",
        ),
        ("Shape \"sphere", "line 1: a string without its end"),
    ] {
        let found = message("a.pbrt", text);
        assert!(
            found.contains(expected) && found.contains("a.pbrt"),
            "{text}: {found}"
        );
    }
}

/// The same camera in both formats: pbrt's space is left-handed.
#[test]
fn foreign_cameras_see_the_right_side() {
    let xml = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"90\"/>
        <transform name=\"to_world\"><lookat origin=\"0,0,0\" target=\"0,0,1\" up=\"0,1,0\"/></transform>
        <film type=\"hdrfilm\"><integer name=\"width\" value=\"200\"/><integer name=\"height\" value=\"100\"/></film>
        </sensor></scene>";
    let mitsuba = &read("a.xml", xml, false).unwrap().parts.cameras[0];
    let film = "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100\n";
    let pbrt = format!(
        "LookAt 0 0 0  0 0 1  0 1 0\nCamera \"perspective\" \"float fov\" 90\n{film}WorldBegin"
    );
    let pbrt = &read("a.pbrt", &pbrt, false).unwrap().parts.cameras[0];
    let right = |camera: &opsr::scene::Camera| camera.ray(opsr::math::Vec2::new(1.0, 0.5), 2.0).dir;
    // Mitsuba's fov is that of the width, with +x to the left; in pbrt +x is to the right.
    assert!((right(mitsuba) - Vec3::new(-1.0, 0.0, 1.0).normalize()).length() < 1e-5);
    // pbrt's fov is that of the shorter side.
    assert!((right(pbrt) - Vec3::new(2.0, 0.0, 1.0).normalize()).length() < 1e-5);
    assert_eq!(mitsuba.film.expect("a film").size.to_array(), [200, 100]);
    assert_eq!(pbrt.film.expect("a film").size.to_array(), [200, 100]);
}

/// Names of Mitsuba 0.5, and parameters of pbrt in other units.
#[test]
fn foreign_conventions_are_converted() {
    let xml = "<scene version=\"0.5.0\"><shape type=\"sphere\"><bsdf type=\"dielectric\"><float name=\"intIOR\" value=\"1.6\"/>
        <string name=\"extIOR\" value=\"vacuum\"/></bsdf><transform name=\"toWorld\"><translate x=\"3\"/></transform></shape>
        </scene>";
    let loaded = read("a.xml", xml, false).unwrap();
    assert!(loaded.parts.own_boundaries);
    assert_eq!(loaded.parts.materials[0].ior, 1.6);
    assert!(loaded.parts.meshes[0].positions.iter().all(|p| p.x > 1.9));
    let rough = |line: &str| {
        let text = format!("WorldBegin\nMaterial \"conductor\" {line}\nShape \"sphere\"");
        read("a.pbrt", &text, false).unwrap().parts.materials[0].alpha
    };
    assert_eq!(rough("\"float roughness\" 0.25"), 0.5);
    assert_eq!(
        rough("\"float roughness\" 0.25 \"bool remaproughness\" false"),
        0.25
    );
    assert_eq!(rough(""), 0.0);
    let text = "WorldBegin\nLightSource \"point\" \"blackbody I\" 6500 \"float power\" 100";
    let lights = read("a.pbrt", text, false).unwrap().parts.lights;
    let PunctualLight::Point { intensity, .. } = lights[0] else {
        panic!("{lights:?}");
    };
    let luminance = 0.2126 * intensity.x + 0.7152 * intensity.y + 0.0722 * intensity.z;
    assert!((luminance * 4.0 * std::f32::consts::PI - 100.0).abs() < 0.1);
}

/// A gzip-compressed scene is the same.
#[test]
fn foreign_packed_files_are_unpacked() {
    use std::io::Write;
    let folder = crate::support::quick_folder();
    let path = folder.path().join("a.pbrt.gz");
    let file = std::fs::File::create(&path).unwrap();
    let mut packer = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
    packer.write_all(b"WorldBegin Shape \"disk\"").unwrap();
    packer.finish().unwrap();
    let loaded = load(&path, &opsr_formats::options()).unwrap();
    assert_eq!(loaded.parts.meshes.len(), 1);
}

/// A scene of Mitsuba as glTF: losses are errors, approximations are not.
#[test]
fn foreign_scenes_are_written_as_gltf() {
    use opsr_lab::gallery::{glb, lowered};
    let parts = |name: &str| {
        load(&folder().join(name), &opsr_formats::options())
            .unwrap()
            .parts
    };
    let pool = lowered::lowered(parts("pool.pbrt"));
    assert_eq!(pool.lost, ["1 indices of refraction below 1: 1 is written"]);
    assert_eq!(pool.changed, ["1 materials by Schlick's approximation"]);
    let room = lowered::lowered(parts("room.pbrt"));
    assert!(room.lost.is_empty(), "{:?}", room.lost);
    let folder = crate::support::quick_folder();
    let path = folder.path().join("room.glb");
    glb::save(&room.parts, &path).unwrap();
    let again = load(&path, &opsr_formats::options()).unwrap().parts;
    assert_eq!(again.meshes.len(), room.parts.meshes.len());
    let mean = |parts| {
        let scene = Scene::new(parts);
        let render = Render::new(&scene).size(16, 16).spp(32);
        let picture = render
            .with(|spec| spec.resolve = Some(ResolveChoice::Raw))
            .run()
            .unwrap();
        picture
            .shown
            .picture
            .pixels
            .iter()
            .map(|p| p.x + p.y + p.z)
            .sum::<f32>()
    };
    let (before, after) = (mean(parts("room.pbrt")), mean(again));
    assert!((before / after - 1.0).abs() < 0.02, "{before} {after}");
    // Textures that are left out become their mean colours, so the picture is as bright.
    let lamps = lowered::lowered(parts("lamps.pbrt"));
    let (before, after) = (mean(parts("lamps.pbrt")), mean(lamps.parts));
    assert!((before / after - 1.0).abs() < 0.1, "{before} {after}");
}

/// Vertex colours, sheen, films, unlit materials, hidden and cone-shaped lamps, written as glTF and read again.
#[test]
fn foreign_looks_as_gltf_are_the_same_again() {
    use opsr::math::Vec4;
    use opsr::scene::Material;
    use opsr::scene::finish::{FilmCover, SheenCover};
    use opsr::scene::lamp::{Cone, Lamp};
    use opsr_lab::gallery::{glb, lowered};
    use opsr_lab::gallery::{materials, shapes};
    let mut mesh = shapes::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.colors = (0..4)
        .map(|i| Vec4::new(0.2 * i as f32, 1.0, 0.0, 1.0))
        .collect();
    let mut looks = Material::default();
    let finish = looks.finish_mut();
    finish.has_colors = true;
    finish.sheen = Some(SheenCover {
        color: Rgb::new(0.5, 0.25, 0.125),
        alpha: 0.25,
        ..SheenCover::default()
    });
    finish.film = Some(FilmCover {
        weight: 0.5,
        ior: 1.25,
        thickness: [100.0, 400.0],
        ..FilmCover::default()
    });
    let cone = Cone {
        direction: Vec3::NEG_Y,
        cos_inner: 0.75,
        cos_outer: 0.5,
    };
    let lamp = Lamp {
        hidden: true,
        cone: Some(cone),
    };
    let mut emitter = materials::emitter("lamp", Rgb::splat(3.0));
    emitter.finish_mut().lamp = Some(lamp);
    let unlit = Material {
        unlit: true,
        specular: 0.0,
        ..materials::emitter("label", Rgb::new(0.5, 0.25, 1.0))
    };
    let mut parts = opsr::scene::SceneParts::default();
    parts.add(looks, [mesh.clone()]);
    parts.add(emitter, [shapes::quad(Vec3::Z, Vec3::X, Vec3::Y)]);
    // Vertex colours that the material does not use.
    let mut plain = mesh.clone();
    plain.positions.iter_mut().for_each(|p| *p -= Vec3::Z);
    parts.add(unlit, [plain]);
    let made = lowered::lowered(parts);
    assert!(made.lost.is_empty() && made.changed.is_empty());
    let folder = crate::support::quick_folder();
    let written = folder.path().join("looks.glb");
    glb::save(&made.parts, &written).unwrap();
    let again = load(&written, &opsr_formats::options()).unwrap().parts;
    assert_eq!(again.meshes[0].colors, mesh.colors);
    assert!(again.meshes[2].colors.is_empty());
    let [looks, emitter, unlit] = &again.materials[..] else {
        panic!("{} materials", again.materials.len());
    };
    let finish = looks.finish.as_ref().expect("a finish");
    let sheen = finish.sheen.as_ref().expect("a sheen");
    assert_eq!(
        (sheen.color, sheen.alpha),
        (Rgb::new(0.5, 0.25, 0.125), 0.25)
    );
    let film = finish.film.as_ref().expect("a film");
    assert_eq!(
        (film.weight, film.ior, film.thickness),
        (0.5, 1.25, [100.0, 400.0])
    );
    assert!(finish.has_colors);
    assert_eq!(emitter.lamp(), Some(&lamp));
    assert!(unlit.unlit && unlit.emission == Rgb::new(0.5, 0.25, 1.0));
}

/// A sheet that reflects and transmits two colours, as one base in glTF.
#[test]
fn foreign_translucent_sheet_as_gltf_transmits_as_much() {
    use opsr_lab::gallery::{glb, lowered};
    let folder = crate::support::quick_folder();
    let path = folder.path().join("sheet.pbrt");
    let text = "LookAt 0 0 3 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 5 WorldBegin\n\
        LightSource \"point\" \"point3 from\" [ 0 0 LIGHT ]\n\
        Material \"diffusetransmission\" \"rgb reflectance\" [ 0.6 0.2 0.1 ] \"rgb transmittance\" [ 0.1 0.3 0.05 ]\n\
        Shape \"disk\"";
    for light in ["2", "-2"] {
        std::fs::write(&path, text.replace("LIGHT", light)).unwrap();
        let read = load(&path, &opsr_formats::options()).unwrap().parts;
        let made = lowered::lowered(read.clone());
        assert!(made.lost.is_empty() && made.changed.is_empty());
        let written = folder.path().join("sheet.glb");
        glb::save(&made.parts, &written).unwrap();
        let again = load(&written, &opsr_formats::options()).unwrap().parts;
        let [before, after] = [read, again].map(|parts| {
            let scene = Scene::new(parts);
            let picture = Render::new(&scene).size(4, 4).spp(16).run().unwrap();
            picture.shown.picture.pixels.iter().copied().sum::<Rgb>() / 16.0
        });
        let expected = match light {
            "2" => Rgb::new(0.6, 0.2, 0.1),
            _ => Rgb::new(0.1, 0.3, 0.05),
        } / (4.0 * std::f32::consts::PI);
        let far = |found: Rgb| (found / expected - Rgb::ONE).abs().max_element();
        assert!(
            far(before) < 0.01 && far(after) < 0.01,
            "{before} {after} {expected}"
        );
    }
}

/// A base in glTF has shares of one reflected and one transmitted colour; other pairs are reported.
#[test]
fn foreign_translucent_colours_that_gltf_cannot_hold_are_named() {
    use opsr_lab::gallery::lowered;
    let made = |reflected: &str, transmitted: &str| {
        let text = format!(
            "WorldBegin\nMaterial \"diffusetransmission\" \"rgb reflectance\" [ {reflected} ] \"rgb transmittance\" [ {transmitted} ]\n\
             Shape \"disk\""
        );
        lowered::lowered(read("a.pbrt", &text, false).unwrap().parts)
    };
    let red_and_green = made("0.9 0 0", "0 0.9 0");
    let line =
        "1 colours of light that is reflected and transmitted, which one base cannot have both";
    assert_eq!(red_and_green.lost, [line]);
    // A sum above 1 is scaled down equally in all channels, as in a render.
    let bright = made("0.8 0.2 0.2", "0.8 0.2 0.2");
    assert!(bright.lost.is_empty(), "{:?}", bright.lost);
    let material = &bright.parts.materials[0];
    let through = material.translucency().unwrap();
    let [reflected, passed] = [
        material.base_color * (1.0 - through.weight),
        through.color * through.weight,
    ];
    let expected = Rgb::new(0.8, 0.2, 0.2) / 1.6;
    assert!(
        (reflected - expected).abs().max_element() < 1e-6,
        "{reflected}"
    );
    assert!((passed - expected).abs().max_element() < 1e-6, "{passed}");
}

/// The colour in glTF includes light that a plastic layer reflects back to the base.
#[test]
fn foreign_plastic_as_gltf_reflects_as_much() {
    use opsr_lab::gallery::lowered;
    let folder = crate::support::quick_folder();
    let path = folder.path().join("ball.xml");
    let text = r#"<scene version="3.0.0"><emitter type="constant"/><shape type="sphere"><bsdf type="plastic">
        <rgb name="diffuse_reflectance" value="0.2, 0.5, 0.8"/><float name="int_ior" value="1.6"/>
        <boolean name="nonlinear" value="true"/></bsdf></shape><sensor type="perspective"><float name="fov" value="10"/>
        <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform></sensor></scene>"#;
    std::fs::write(&path, text).unwrap();
    let exact = load(&path, &opsr_formats::options()).unwrap().parts;
    let mut close = lowered::lowered(exact.clone()).parts;
    close.environment = exact.environment.clone();
    let [exact, close] = [exact, close].map(|parts| {
        let scene = Scene::new(parts);
        let picture = Render::new(&scene).size(8, 8).spp(256).run().unwrap();
        let radiance = picture.shown.picture;
        radiance.pixels.iter().copied().sum::<Rgb>() / radiance.pixels.len() as f32
    });
    let ratio = exact / close;
    assert!(
        (ratio - Rgb::ONE).abs().max_element() < 0.02,
        "{exact} {close}"
    );
}

/// Media of both formats, and their unsupported features.
#[test]
fn foreign_media_are_read_or_named_with_their_line() {
    let pbrt = "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [ 1 2 3 ]\n\
        \"rgb sigma_s\" [ 0 1 0.5 ] \"float scale\" 2 \"float g\" -0.3\n\
        MediumInterface \"fog\" Camera \"perspective\"\nWorldBegin\n\
        MediumInterface \"\" \"fog\" Material \"interface\" Shape \"sphere\"\n\
        MediumInterface \"fog\" Material \"dielectric\" Shape \"sphere\"\n";
    let parts = read("a.pbrt", pbrt, false).unwrap().parts;
    let fog = Medium {
        absorption: Rgb::new(2.0, 4.0, 6.0),
        scattering: Rgb::new(0.0, 2.0, 1.0),
        mean_cosine: -0.3,
    };
    assert_eq!(parts.medium, Some(fog));
    let own: Vec<_> = (parts.materials.iter())
        .map(|m| m.medium.as_deref().copied())
        .collect();
    // A bubble, and glass inside fog.
    assert_eq!(own, [Some(Medium::default()), None]);
    let bubble = &parts.materials[0];
    assert_eq!((bubble.ior, bubble.transmission), (1.0, 1.0));

    let xml = "<scene version=\"3.0.0\">\n<shape type=\"sphere\"><bsdf type=\"null\"/>\n\
        <medium name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"4\"/>\
        <rgb name=\"albedo\" value=\"0.5, 0.25, 1\"/><float name=\"scale\" value=\"0.5\"/>\n\
        <phase type=\"hg\"><float name=\"g\" value=\"0.7\"/></phase></medium></shape></scene>";
    let parts = read("a.xml", xml, false).unwrap().parts;
    let cloud = Medium {
        absorption: Rgb::new(1.0, 1.5, 0.0),
        scattering: Rgb::new(1.0, 0.5, 2.0),
        mean_cosine: 0.7,
    };
    assert_eq!(parts.materials[0].medium.as_deref(), Some(&cloud));
    assert_eq!(parts.medium, None);

    for (name, text, expected) in [
        (
            "a.pbrt",
            pbrt.replace("homogeneous", "uniformgrid"),
            "line 1: a medium of type `uniformgrid` is not",
        ),
        (
            "a.pbrt",
            pbrt.replace("MediumInterface \"\" \"fog\"", "MediumInterface \"mist\""),
            "line 5: no medium `mist`",
        ),
        (
            "a.pbrt",
            pbrt.replace("-0.3", "1"),
            "line 1: g of a medium is 1, not between -1 and 1",
        ),
        (
            "a.pbrt",
            pbrt.replace("float scale\" 2", "float scale\" 1e38"),
            "line 1: coefficients of a medium, times its scale, are not",
        ),
        (
            "a.pbrt",
            pbrt.replace("float scale\" 2", "rgb Le\" [ 1 1 1 ]"),
            "line 1: a medium that shines",
        ),
        (
            "a.pbrt",
            pbrt.replace("interface", "thindielectric"),
            "line 5: a medium behind a thin wall",
        ),
        (
            "a.pbrt",
            pbrt.replace(
                "WorldBegin\nMediumInterface \"\" \"fog\"",
                "WorldBegin MakeNamedMedium \"mist\" \"string type\" \"homogeneous\"\nMediumInterface \"mist\" \"\"",
            ),
            "line 5: another medium outside of all bodies than elsewhere",
        ),
        (
            "a.xml",
            xml.replace("homogeneous", "heterogeneous"),
            "line 3: a medium of type `heterogeneous` is not",
        ),
        (
            "a.xml",
            xml.replace("\"hg\"", "\"sggx\""),
            "line 4: phase function `sggx` is not",
        ),
    ] {
        let text = message(name, &text);
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

/// A scene, unlike a model, is lit even by a dim lamp over wide ground.
#[test]
fn foreign_scenes_with_any_light_are_lit() {
    let ground = "WorldBegin\nShape \"disk\" \"float radius\" 1000\n";
    let lamp = "AreaLightSource \"diffuse\" \"float scale\" 0.1 Shape \"sphere\"";
    let light = |text: &str| read("a.pbrt", text, false).unwrap().light;
    assert_eq!(light(ground), FileLight::None);
    assert_eq!(light(&format!("{ground}{lamp}")), FileLight::Lamps);
}

/// A camera in front of two clouds, in their common plane, is outside of both, although a ray along the plane may enter
/// one and leave the other.
#[test]
fn foreign_camera_on_a_plane_of_two_media_is_outside() {
    let cloud = |name: &str, low: f32| {
        let high = low + 1.0;
        let corners = |y: f32| format!("{low} {y} -1 {high} {y} -1 {high} {y} 1 {low} {y} 1");
        format!(
            "AttributeBegin MediumInterface \"{name}\" \"\" Material \"interface\" Shape \"trianglemesh\" \
             \"point3 P\" [ {} {} ] \"integer indices\" [ 0 1 2 0 2 3 4 6 5 4 7 6 0 4 5 0 5 1 1 5 6 1 6 2 2 6 7 2 7 3 \
             3 7 4 3 4 0 ] AttributeEnd\n",
            corners(0.2),
            corners(1.8)
        )
    };
    let light = |x: f32| {
        let text = format!(
            "MakeNamedMedium \"a\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1.5 1 0.5 ]\n\
             MakeNamedMedium \"b\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 0.5 1.5 3 ]\n\
             LookAt {x} 0.6 5 {x} 0.6 0 0 1 0 Camera \"perspective\" \"float fov\" 45\nWorldBegin\n\
             AttributeBegin AreaLightSource \"diffuse\" Translate 0 0 -3 Shape \"disk\" \"float radius\" 9 AttributeEnd\n{}{}",
            cloud("a", -1.0),
            cloud("b", 0.0)
        );
        let scene = Scene::new(read("a.pbrt", &text, false).unwrap().parts);
        let settings = Settings {
            max_vertices: 8,
            ..Settings::default()
        };
        mean(&film_with(&scene, &settings, 16, 64)).0
    };
    let (on, beside) = (light(0.0), light(1e-3));
    assert!((on / beside - 1.0).abs() < 0.05, "{on} {beside}");
}

/// A ball of smoke around a ball of fog, in a lit room full of the same fog, from outside and from the inner ball.
/// Means are those of Mitsuba 3.9.1's `volpath`, 1,536 samples.
#[test]
fn foreign_camera_in_a_medium_that_fills_bodies_too() {
    let mitsuba = |z: f32| {
        let room = "<transform name=\"to_world\"><scale value=\"3\"/></transform><bsdf type=\"twosided\"><bsdf type=\"diffuse\">\
            <rgb name=\"reflectance\" value=\"0.5, 0.5, 0.5\"/></bsdf></bsdf>";
        let lamp = "<transform name=\"to_world\"><rotate x=\"1\" angle=\"90\"/><translate y=\"2.9\"/></transform>\
            <emitter type=\"area\"><rgb name=\"radiance\" value=\"5, 5, 5\"/></emitter>";
        let ball = |radius: f32, inside: &str, outside: &str| {
            format!(
                "<shape type=\"sphere\"><point name=\"center\" z=\"-1\"/><float name=\"radius\" value=\"{radius}\"/>\
                 <bsdf type=\"null\"/><ref id=\"{inside}\" name=\"interior\"/><ref id=\"{outside}\" name=\"exterior\"/></shape>"
            )
        };
        format!(
            "<scene version=\"3.0.0\"><medium type=\"homogeneous\" id=\"fog\"><float name=\"sigma_t\" value=\"0.5\"/>\
             <rgb name=\"albedo\" value=\"0.8, 0.7, 0.6\"/></medium><medium type=\"homogeneous\" id=\"smoke\">\
             <float name=\"sigma_t\" value=\"2\"/><rgb name=\"albedo\" value=\"0.5, 0.6, 0.9\"/></medium>\
             <sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/><transform name=\"to_world\">\
             <lookat origin=\"0, 0, {z}\" target=\"0, 0, -4\" up=\"0, 1, 0\"/></transform><film type=\"hdrfilm\"><integer name=\"width\" value=\"16\"/>\
             <integer name=\"height\" value=\"16\"/></film><ref id=\"fog\"/></sensor>\
             <shape type=\"cube\">{room}</shape><shape type=\"rectangle\">{lamp}</shape>{}{}</scene>",
            ball(1.5, "smoke", "fog"),
            ball(0.9, "fog", "smoke")
        )
    };
    let pbrt = |z: f32| {
        let ball = |radius: f32, sides: &str| {
            format!(
                "AttributeBegin MediumInterface {sides} Material \"interface\" Translate 0 0 -1 Shape \"sphere\" \
                 \"float radius\" {radius} AttributeEnd\n"
            )
        };
        format!(
            "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 0.4 0.35 0.3 ] \"rgb sigma_a\" [ 0.1 0.15 0.2 ]\n\
             MakeNamedMedium \"smoke\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ 1 1.2 1.8 ] \"rgb sigma_a\" [ 1 0.8 0.2 ]\n\
             LookAt 0 0 {z} 0 0 -4 0 1 0 MediumInterface \"\" \"fog\" Camera \"perspective\" \"float fov\" 60\nWorldBegin\n\
             MediumInterface \"\" \"\" Material \"diffuse\" Shape \"trianglemesh\" \"point3 P\" [ -3 -3 -3  3 -3 -3  3 -3 3  -3 -3 3 \
             -3 3 -3  3 3 -3  3 3 3  -3 3 3 ] \"integer indices\" [ 0 1 2 0 2 3 4 6 5 4 7 6 0 4 5 0 5 1 1 5 6 1 6 2 2 6 7 2 7 3 \
             3 7 4 3 4 0 ]\nAttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [ 5 5 5 ] Shape \"trianglemesh\" \"point3 P\" \
             [ -1 2.9 -1  1 2.9 -1  1 2.9 1  -1 2.9 1 ] \"integer indices\" [ 0 1 2 0 2 3 ] AttributeEnd\n{}{}",
            ball(1.5, "\"smoke\" \"fog\""),
            ball(0.9, "\"fog\" \"smoke\"")
        )
    };
    for (z, expected) in [
        (2.5, [0.0747, 0.0554, 0.0502]),
        (-1.0, [0.0248, 0.0218, 0.0336]),
    ] {
        for (name, text) in [("a.xml", mitsuba(z)), ("a.pbrt", pbrt(z))] {
            let parts = read(name, &text, false).unwrap().parts;
            let fog = parts.medium.expect("fog");
            let scattering = Rgb::new(0.4, 0.35, 0.3);
            assert!(fog.scattering.abs_diff_eq(scattering, 1e-6), "{fog:?}");
            let scene = Scene::new(parts);
            // Fog near lamps has a high variance.
            let settings = Settings {
                max_vertices: 32,
                ..Settings::default()
            };
            let film = film_with(&scene, &settings, 16, 128);
            let pixels = film.mean().pixels;
            let found = pixels.iter().sum::<Rgb>() / pixels.len() as f32;
            let ratio = found / Rgb::from(expected);
            assert!(
                (ratio - 1.0).abs().max_element() < 0.1,
                "{name}, {z}: {found}"
            );
        }
    }
    // Glass around the camera does not determine a medium. A shape without an exterior contradicts a camera in fog.
    let glass = "<shape type=\"sphere\"><point name=\"center\" z=\"2.5\"/><float name=\"radius\" value=\"0.2\"/>\
        <bsdf type=\"dielectric\"/></shape></scene>";
    let text = mitsuba(2.5).replace("</scene>", glass);
    let medium = read("a.xml", &text, false).unwrap().parts.medium;
    assert!(medium.is_some());
    let text = mitsuba(2.5).replace("<ref id=\"fog\" name=\"exterior\"/>", "");
    let error = read("a.xml", &text, false).unwrap_err().to_string();
    let expected = "another medium outside of all bodies than elsewhere";
    assert!(error.contains(expected), "{error}");
}

/// An empty medium name means no medium; a disk has no degenerate triangles.
#[test]
fn foreign_empty_medium_and_disk_say_nothing() {
    let folder = crate::support::quick_folder();
    let path = folder.path().join("disk.pbrt");
    std::fs::write(
        &path,
        r#"WorldBegin LightSource "distant" MediumInterface "" "" MediumInterface "" Shape "disk""#,
    )
    .unwrap();
    let loaded = load(&path, &opsr_formats::options()).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let scene = Scene::new(loaded.parts);
    assert!(scene.warnings().is_empty(), "{:?}", scene.warnings());
}
