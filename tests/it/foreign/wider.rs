//! Parts of other renderers' scenes that are shown, exactly or as what is nearest, where they could be refused.

use super::nearest::{usual, with_files, xml};
use super::{message, read};
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::load::{Loaded, Unsupported};
use opsr::scene::{Camera, Environment};

fn pbrt(text: &str) -> Loaded {
    usual("a.pbrt", &format!("WorldBegin\n{text}"))
}

fn pfm(side: usize, texel: impl Fn(usize) -> f32) -> Vec<u8> {
    let mut map = format!("PF\n{side} {side}\n-1.0\n").into_bytes();
    for i in 0..side * side {
        map.extend([texel(i); 3].iter().flat_map(|value| value.to_le_bytes()));
    }
    map
}

/// Many lights from infinity are their sum in every direction.
#[test]
fn foreign_infinite_lights_add_up() {
    let files = [
        ("a.pfm", pfm(64, |i| (i % 7) as f32)),
        ("b.pfm", pfm(24, |i| f32::from(u8::from(i == 300)) * 100.0)),
    ];
    let sky = |lights: &[&str]| -> Environment {
        let lines = lights
            .iter()
            .map(|light| format!("LightSource \"infinite\" {light}\n"));
        let text = format!("WorldBegin\n{}", lines.collect::<String>());
        let loaded = with_files("a.pbrt", &text, &files, Unsupported::Error).expect("a scene");
        loaded.parts.environment.expect("a sky")
    };
    let (red, fine, coarse) = (
        "\"rgb L\" [1 0 0]",
        "\"string filename\" \"a.pfm\"",
        "\"string filename\" \"b.pfm\"",
    );
    let (first, second) = (sky(&[fine]), sky(&[coarse]));
    let sum = sky(&[coarse, red, fine]);
    let (alone, all) = (first.average() + second.average() + Rgb::X, sum.average());
    assert!(
        (all / alone - 1.0).abs().max_element() < 0.02,
        "{all} {alone}"
    );
    let with_red = sky(&[fine, red]);
    for i in 0..500 {
        let (z, phi) = ((i as f32 + 0.5) / 250.0 - 1.0, 2.4 * i as f32);
        let r = (1.0 - z * z).sqrt();
        let dir = Vec3::new(r * phi.cos(), r * phi.sin(), z);
        assert_eq!(with_red.radiance(dir), first.radiance(dir) + Rgb::X);
    }
    assert_eq!(sky(&[red, red]).radiance(Vec3::Z), 2.0 * Rgb::X);
    // Mitsuba has one environment alone.
    let two = xml("<emitter type=\"constant\"/>\n<emitter type=\"constant\"/>");
    assert!(message("a.xml", &two).contains("line 3: a second environment"));
}

/// A window off the centre of pbrt's screen, and Mitsuba's principal point off the centre of its film.
#[test]
fn foreign_pictures_off_the_centre_look_where_they_say() {
    let camera = |kind: &str, scale: &str| -> Camera {
        let text = format!(
            "Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 100\n{scale}\nCamera \"{kind}\" \
             \"float screenwindow\" [ -0.5 1.5 -0.75 0.25 ]\nWorldBegin"
        );
        let loaded = read("a.pbrt", &text, false).expect("a scene");
        assert!(loaded.warnings.is_empty());
        loaded.parts.cameras[0].clone()
    };
    // A field of view of 90°: the screen is at distance 1. pbrt's camera looks along +z, with +x to the right.
    let pinhole = camera("perspective", "");
    for (film, x, y) in [
        (Vec2::ZERO, -0.5, 0.25),
        (Vec2::ONE, 1.5, -0.75),
        (Vec2::splat(0.5), 0.5, -0.25),
    ] {
        let dir = pinhole.ray(film, 2.0).dir;
        assert!(
            dir.distance(Vec3::new(x, y, 1.0).normalize()) < 1e-6,
            "{film} {dir}"
        );
        let (seen, ..) = pinhole
            .project(3.0 * dir, 2.0, Vec2::ZERO)
            .expect("in front");
        assert!(seen.distance(film) < 1e-5);
        // The camera is three times as large as its own units.
        let ray = camera(
            "orthographic",
            "Scale 0.3333333333 0.3333333333 0.3333333333",
        )
        .ray(film, 2.0);
        let origin = ray.origin;
        assert!(
            origin.distance(3.0 * Vec3::new(x, y, 0.0)) < 1e-5,
            "{origin}"
        );
    }
    // By Mitsuba 3.9: directions of its rays through these places, a sample at the middle of the wavelengths.
    let text = xml(
        "<sensor type=\"perspective\"><float name=\"fov\" value=\"50\"/><float name=\"principal_point_offset_x\" value=\"0.2\"/>\
         <float name=\"principal_point_offset_y\" value=\"-0.1\"/><film type=\"hdrfilm\"><integer name=\"width\" value=\"60\"/>\
         <integer name=\"height\" value=\"40\"/></film></sensor>",
    );
    let camera = read("a.xml", &text, false).expect("a scene").parts.cameras[0].clone();
    for (film, dir) in [
        (Vec2::splat(0.5), [-0.183019, 0.0610064, 0.981215]),
        (Vec2::ZERO, [0.253571, 0.338095, 0.906308]),
        (Vec2::ONE, [-0.535172, -0.203875, 0.819772]),
    ] {
        let found = camera.ray(film, 1.5).dir;
        assert!(found.distance(dir.into()) < 1e-5, "{film}: {found}");
    }
    // What glTF cannot hold is named.
    let lost =
        opsr_lab::gallery::lowered::lowered(read("a.xml", &text, false).expect("a scene").parts)
            .lost;
    assert!(
        lost.iter()
            .any(|line| line.contains("shifts of the picture")),
        "{lost:?}"
    );
}

/// Parts of mixtures, and materials of shapes in objects, may be declared later, as may objects.
#[test]
fn foreign_parts_of_mixtures_may_be_declared_later() {
    let mixture = "MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [ \"a\" \"n\" ] \"float amount\" 0.25\n\
        MakeNamedMaterial \"n\" \"string type\" \"mix\" \"string materials\" [ \"b\" \"b\" ]\n";
    let parts = "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb reflectance\" [ 1 0 0 ]\n\
        MakeNamedMaterial \"b\" \"string type\" \"diffuse\" \"rgb reflectance\" [ 0 1 0 ]\n";
    let shapes = "NamedMaterial \"m\" Shape \"disk\"\n\
        ObjectBegin \"o\" Shape \"sphere\" NamedMaterial \"b\" Shape \"disk\" ObjectEnd\n\
        AttributeBegin Translate 0 0 7 ObjectInstance \"o\" AttributeEnd\n";
    let seen = |text: &str| {
        let parts = pbrt(text).parts;
        let mut all: Vec<_> = (parts.meshes.iter())
            .map(|mesh| {
                let material = &parts.materials[mesh.material as usize];
                let mix = material.finish.as_ref().and_then(|f| f.mix);
                let other = mix.map(|mix| {
                    (
                        parts.materials[mix.other as usize].base_color.to_array(),
                        mix.weight,
                    )
                });
                let place = mesh.positions[0].to_array();
                format!(
                    "{place:?} {} {:?} {other:?}",
                    mesh.indices.len(),
                    material.base_color
                )
            })
            .collect();
        all.sort();
        all
    };
    let usual = seen(&[parts, mixture, shapes].concat());
    assert_eq!(usual.len(), 3);
    assert_eq!(seen(&[mixture, shapes, parts].concat()), usual);
    assert_eq!(seen(&[shapes, parts, mixture].concat()), usual);
    assert_eq!(seen(&[mixture, parts, shapes].concat()), usual);
    let said = message("a.pbrt", &format!("WorldBegin\n{mixture}{shapes}"));
    assert!(said.contains("line 2: no material `a`"), "{said}");
    let endless = mixture.replace("\"b\" \"b\"", "\"m\" \"n\"");
    let said = message("a.pbrt", &format!("WorldBegin\n{endless}{parts}{shapes}"));
    assert!(said.contains("a mixture that holds itself"), "{said}");
}
