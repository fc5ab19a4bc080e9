//! Lights and exposures of pbrt and Mitsuba: their brightness.

use super::{message, read};
use opsr::math::{Rgb, Vec3};
use opsr::scene::{PunctualLight, Scene, SceneParts};

fn parts(name: &str, text: &str) -> SceneParts {
    read(name, text, false).unwrap().parts
}

/// Intensity of the only light without area.
fn intensity(text: &str) -> Rgb {
    match parts("a.pbrt", &format!("WorldBegin\n{text}")).lights[..] {
        [PunctualLight::Point { intensity, .. } | PunctualLight::Spot { intensity, .. }] => {
            intensity
        }
        [PunctualLight::Directional { irradiance, .. }] => irradiance,
        ref other => panic!("{other:?}"),
    }
}

fn same(found: Rgb, expected: f32) {
    let far = (found / expected - Rgb::ONE).abs().max_element();
    assert!(far < 1e-4, "{found} {expected}");
}

/// `power` and `illuminance` refer to white light; `scale` and the values of an rgb colour multiply them.
#[test]
fn foreign_lights_of_a_power_are_scaled_too() {
    use std::f32::consts::PI;
    let point =
        |more: &str| intensity(&format!("LightSource \"point\" \"float power\" 100 {more}"));
    let one = 100.0 / (4.0 * PI);
    same(point(""), one);
    same(point("\"float scale\" 0.5"), 0.5 * one);
    same(point("\"rgb I\" [ 2 2 2 ]"), 2.0 * one);
    let spot =
        "LightSource \"spot\" \"float power\" 10 \"float coneangle\" 60 \"float conedeltaangle\" 0";
    // A cone of half angle 60° has a solid angle of π sr.
    same(intensity(spot), 10.0 / PI);
    same(intensity(&format!("{spot} \"float scale\" 3")), 30.0 / PI);
    let sun = |more: &str| {
        intensity(&format!(
            "LightSource \"distant\" \"float illuminance\" 2 {more}"
        ))
    };
    same(sun(""), 2.0);
    same(sun("\"float scale\" 0.1 \"rgb L\" [ 3 3 3 ]"), 0.6);
    let sky = |more: &str| {
        let text = format!("WorldBegin LightSource \"infinite\" \"float illuminance\" 2 {more}");
        let sky = parts("a.pbrt", &text).environment.unwrap();
        sky.radiance(Vec3::Z)
    };
    same(sky(""), 2.0 / PI);
    same(sky("\"float scale\" 0.25"), 0.5 / PI);
    let lamp = |more: &str| {
        let text = format!(
            "WorldBegin AreaLightSource \"diffuse\" \"float power\" 8 {more} Shape \"sphere\""
        );
        parts("a.pbrt", &text).materials[0].emission
    };
    // The sphere's triangles have slightly less area than the sphere.
    let plain = lamp("");
    assert!(
        (plain.x * 4.0 * PI * PI / 8.0 - 1.0).abs() < 1e-3,
        "{plain}"
    );
    same(lamp("\"float scale\" 0.5"), 0.5 * plain.x);
    same(lamp("\"rgb L\" [ 3 3 3 ]"), 3.0 * plain.x);
    let both = "WorldBegin\nAreaLightSource \"diffuse\" \"rgb L\" [1 1 1] \"string filename\" \"a.png\" Shape \"disk\"";
    assert!(message("a.pbrt", both).contains("line 2: has both `L` and an image"));
}

/// The illuminance of a map is that of a patch that faces up: a map of 1 has π.
#[test]
fn foreign_map_of_an_illuminance_is_scaled_to_it() {
    let folder = crate::support::quick_folder();
    let mut map = b"PF\n4 4\n-1\n".to_vec();
    map.extend((0..3 * 16).flat_map(|_| 5f32.to_le_bytes()));
    std::fs::write(folder.path().join("sky.pfm"), map).unwrap();
    let radiance = |more: &str| {
        let path = folder.path().join("a.pbrt");
        let text =
            format!("WorldBegin LightSource \"infinite\" \"string filename\" \"sky.pfm\" {more}");
        std::fs::write(&path, text).unwrap();
        let loaded = opsr::scene::load::load(&path, &opsr_formats::options()).unwrap();
        loaded.parts.environment.unwrap().radiance(Vec3::X).x
    };
    assert_eq!(radiance(""), 5.0);
    let scaled = radiance("\"float illuminance\" 2 \"float scale\" 3");
    let expected = 6.0 / std::f32::consts::PI;
    assert!((scaled / expected - 1.0).abs() < 0.01, "{scaled}");
}

/// Film and shutter scale all light; other effects of a film on colours cause warnings.
#[test]
fn foreign_films_expose_the_picture() {
    let lit = |film: &str, camera: &str| {
        let text = format!(
            "Film \"rgb\" {film}\nCamera \"perspective\" {camera}\nWorldBegin\nLightSource \"point\" \
             LightSource \"infinite\" AreaLightSource \"diffuse\" \"rgb L\" [4 4 4] Shape \"sphere\""
        );
        let loaded = read("a.pbrt", &text, false).unwrap();
        let PunctualLight::Point { intensity, .. } = loaded.parts.lights[0] else {
            panic!("{:?}", loaded.parts.lights);
        };
        let sky = loaded.parts.environment.unwrap().radiance(Vec3::X).x;
        let lamp = loaded.parts.materials[0].emission.x;
        ([intensity.x, sky, lamp], loaded.warnings)
    };
    assert_eq!(lit("", ""), ([1.0, 1.0, 4.0], vec![]));
    assert_eq!(lit("\"float iso\" 600", "").0, [6.0, 6.0, 24.0]);
    let both = lit("\"float iso\" 200", "\"float shutterclose\" 0.25").0;
    assert_eq!(both, [0.5, 0.5, 2.0]);
    assert_eq!(lit("\"float exposuretime\" 2", "").0, [2.0, 2.0, 8.0]);
    let (_, warnings) = lit(
        "\"string sensor\" \"canon_eos_5d\" \"float whitebalance\" 5000 \"float maxcomponentvalue\" 10",
        "",
    );
    for name in ["canon_eos_5d", "whitebalance", "maxcomponentvalue"] {
        assert!(
            warnings
                .iter()
                .any(|w| w.contains(name) && w.contains("line 1")),
            "{warnings:?}"
        );
    }
    let closed = "Film \"rgb\" \"float iso\" 0\nWorldBegin";
    assert!(message("a.pbrt", closed).contains("line 1: an exposure of 0"));
}

/// An area light on a boundary without a material is ignored, as in pbrt, with a warning.
#[test]
fn foreign_light_of_an_interface_is_ignored_with_a_word() {
    let text = "WorldBegin\nMaterial \"interface\"\nAreaLightSource \"diffuse\"\nShape \"sphere\"";
    let loaded = read("a.pbrt", text, false).unwrap();
    assert_eq!(loaded.parts.materials[0].emission, Rgb::ZERO);
    let expected =
        "line 3: an area light on a shape without a material (`interface`) is ignored, as in pbrt";
    assert_eq!(loaded.warnings, [expected]);
}

/// Bilinear patches have their given normals: a flat patch can have those of a ball.
#[test]
fn foreign_patches_have_their_normals() {
    let text = "WorldBegin Shape \"bilinearmesh\" \"point3 P\" [ 0 0 0  1 0 0  0 1 0  1 1 0 ] \
        \"normal N\" [ -1 0 1  1 0 1  -1 0 1  1 0 1 ]";
    let mesh = &parts("a.pbrt", text).meshes[0];
    let (mut least, mut most) = (1.0f32, -1.0f32);
    for normal in &mesh.normals {
        (least, most) = (least.min(normal.x), most.max(normal.x));
    }
    let end = std::f32::consts::FRAC_1_SQRT_2;
    assert!(
        (least + end).abs() < 1e-5 && (most - end).abs() < 1e-5,
        "{least} {most}"
    );
    let short = text.replace("  1 0 1 ]", " ]");
    assert!(message("a.pbrt", &short).contains("3 normals for 4 points"));
}

/// Lamps of two temperatures have the ratio of Planck's law.
#[test]
fn foreign_black_bodies_of_mitsuba_are_in_proportion() {
    let green = |lamp: &str| {
        let text = format!(
            "<scene version=\"3.0.0\"><shape type=\"sphere\"><emitter type=\"area\">{lamp}</emitter></shape></scene>"
        );
        parts("a.xml", &text).materials[0].emission.y
    };
    let plugin = |kelvin: u32| {
        green(&format!(
            "<spectrum name=\"radiance\" type=\"blackbody\"><float name=\"temperature\" value=\"{kelvin}\"/></spectrum>"
        ))
    };
    let (low, high) = (plugin(3000), plugin(6500));
    assert!(
        (high / low / (41_443.0 / 350.0) - 1.0).abs() < 0.02,
        "{low} {high}"
    );
    assert_eq!(
        green("<blackbody name=\"radiance\" temperature=\"3000K\" scale=\"0.5\"/>"),
        0.5 * low
    );
}

/// A lamp of alpha 0 gives the same light as a visible lamp, with every estimator, but is invisible.
#[test]
fn foreign_lamp_of_alpha_0_lights_and_is_not_seen() {
    use crate::support::render::mean;
    use opsr::Render;
    use opsr::integrator::method::IntegratorKind::{self, Bdpt, Light, Path, Sppm, Vcm};
    use opsr::render::value::ResolveChoice;
    let scene = |alpha: &str, target: &str| {
        let text = format!(
            "LookAt 0 1 6  {target}  0 1 0 Camera \"perspective\" \"float fov\" 20 WorldBegin\n\
             AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [9 9 9] Translate 0 5 0\n\
             Shape \"sphere\" {alpha} AttributeEnd\nMaterial \"diffuse\"\n\
             Shape \"trianglemesh\" \"integer indices\" [0 1 2 0 2 3] \"point3 P\" [-9 -1 9 9 -1 9 9 -1 -9 -9 -1 -9]"
        );
        Scene::new(parts("a.pbrt", &text))
    };
    let brightness = |scene: &Scene, integrator: IntegratorKind, levels: bool| {
        let render = Render::new(scene).size(8, 8).spp(256).with(|spec| {
            spec.integrator = Some(integrator);
            spec.resolve = (!levels).then_some(ResolveChoice::Raw);
        });
        mean(&render.run().unwrap().outcome.picture.film)
    };
    let unseen = "\"float alpha\" 0";
    let (floor, lamp) = ("0 -1 0", "0 5 0");
    assert_eq!(brightness(&scene(unseen, lamp), Path, false).0, 0.0);
    assert!(brightness(&scene("", lamp), Path, false).0 > 1.0);
    let (seen, _) = brightness(&scene("", floor), Path, false);
    for (integrator, levels) in [
        (Path, false),
        (Path, true),
        (Bdpt, false),
        (Vcm, false),
        (Light, false),
        (Sppm, false),
    ] {
        let (found, error) = brightness(&scene(unseen, floor), integrator, levels);
        assert!(
            (found / seen - 1.0).abs() < 0.02 + 4.0 * error / seen,
            "{integrator:?}: {found} ± {error}, {seen}"
        );
    }
}
