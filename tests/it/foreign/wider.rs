//! Parts of other renderers' scenes that are shown exactly or approximately instead of being refused.

use super::nearest::{png, usual, with_files, xml};
use super::{message, read};
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::load::{Loaded, Unsupported};
use opsr::scene::{Camera, Environment, Projection, PunctualLight, Wrap};
use std::f32::consts::PI;

fn pbrt(text: &str) -> Loaded {
    usual("a.pbrt", &format!("WorldBegin\n{text}"))
}

/// The only warning of a scene.
fn word(loaded: &Loaded) -> &str {
    assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
    &loaded.warnings[0]
}

/// Noise textures are replaced by their mean, with a warning; textures without a known mean become grey.
#[test]
fn foreign_textures_of_noise_are_their_mean() {
    let colour = |texture: &str| {
        let loaded = pbrt(&format!(
            "Texture \"t\" \"spectrum\" {texture}\nMaterial \"diffuse\" \"texture reflectance\" \"t\" Shape \"disk\""
        ));
        let kind = texture.split('"').nth(1).expect("a kind");
        let shown = word(&loaded);
        assert!(
            shown.contains(&format!("texture `{kind}` is not supported")),
            "{shown}"
        );
        (
            loaded.parts.materials[0].base_color,
            shown.contains("its mean"),
        )
    };
    // Two fifths of the cells have a disk of radius 0.35.
    let covered = 0.39 * PI * 0.35 * 0.35;
    let (dotted, mean) = colour("\"dots\" \"rgb inside\" [1 0.5 0] \"rgb outside\" [0 0.5 1]");
    let expected = Rgb::new(covered, 0.5, 1.0 - covered);
    assert!(
        mean && (dotted - expected).abs().max_element() < 0.01,
        "{dotted}"
    );
    for kind in ["fbm", "wrinkled", "windy", "marble"] {
        let (found, mean) = colour(&format!("\"{kind}\""));
        assert!(mean && found.min_element() > 0.0 && found.max_element() < 1.0);
    }
    assert_eq!(colour("\"ptex\""), (Rgb::splat(0.5), false));
}

/// A texture may be the share of a mixture, texel by texel; a `bilerp` beyond its square causes a warning.
#[test]
fn foreign_textures_are_mixed_by_textures() {
    let files = [("a.png", png(1, 8)), ("b.png", png(2, 8))];
    let image = |name: &str| {
        format!(
            "Texture \"{name}\" \"spectrum\" \"imagemap\" \"string filename\" \"{name}.png\" \"string filter\" \"point\"\n"
        )
    };
    let text = format!(
        "WorldBegin\n{}{}Texture \"m\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"rgb tex2\" [0.2 2 0.4] \"texture amount\" \"b\"\n\
         Material \"diffuse\" \"texture reflectance\" \"m\" Shape \"disk\"",
        image("a"),
        image("b")
    );
    let loaded = with_files("a.pbrt", &text, &files, Unsupported::Error).expect("a scene");
    let material = &loaded.parts.materials[0];
    let map = material.base_color_texture.expect("a texture").texture;
    let at = |i: usize, texture: usize| {
        let uv = Vec2::new((i % 8) as f32 + 0.5, (i / 8) as f32 + 0.5) / 8.0;
        Rgb::from_slice(&loaded.parts.textures[texture].sample(uv)[..3])
    };
    for i in 0..64 {
        let (a, t) = (at(i, 0), at(i, 1));
        let expected = a + (Rgb::new(0.2, 2.0, 0.4) - a) * t;
        let found = material.base_color * at(i, map as usize);
        assert!(found.distance(expected) < 1e-3, "{i}: {found} {expected}");
    }
    let blend = |more: &str| {
        pbrt(&format!(
            "Texture \"t\" \"spectrum\" \"bilerp\" {more}\nMaterial \"diffuse\" \"texture reflectance\" \"t\" Shape \"disk\""
        ))
    };
    assert!(
        blend("\"float uscale\" 0.5 \"float udelta\" 0.5")
            .warnings
            .is_empty()
    );
    for more in [
        "\"float vscale\" 2",
        "\"float udelta\" -0.1",
        "\"string mapping\" \"planar\"",
    ] {
        assert!(word(&blend(more)).contains("held at its border"), "{more}");
    }
}

fn pfm(side: usize, texel: impl Fn(usize) -> f32) -> Vec<u8> {
    let mut map = format!("PF\n{side} {side}\n-1.0\n").into_bytes();
    for i in 0..side * side {
        map.extend([texel(i); 3].iter().flat_map(|value| value.to_le_bytes()));
    }
    map
}

/// Several lights from infinity add up in every direction.
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
    // Mitsuba has only one environment.
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
        // The camera's units are three times as large as the scene's.
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
    // Ray directions of Mitsuba 3.9 through these film positions, for the middle of the wavelengths.
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
    // Shifts of the picture, which glTF cannot express, are reported.
    let lost =
        opsr_lab::gallery::lowered::lowered(read("a.xml", &text, false).expect("a scene").parts)
            .lost;
    assert!(
        lost.iter()
            .any(|line| line.contains("shifts of the picture")),
        "{lost:?}"
    );
}

/// A lens given by its surfaces becomes its focal length and entrance pupil, tested with a ball of glass.
#[test]
fn foreign_lenses_by_their_surfaces_have_their_focal_length() {
    let shot = |lens: &str, more: &str| {
        let text = format!(
            "Film \"rgb\" \"integer xresolution\" 300 \"integer yresolution\" 400 \"float diagonal\" 20\n\
             Camera \"realistic\" \"string lensfile\" \"l.dat\" {more}\nWorldBegin"
        );
        with_files(
            "a.pbrt",
            &text,
            &[("l.dat", lens.into())],
            Unsupported::Nearest,
        )
    };
    // A stop 5 mm before a ball of radius 10 mm and index 1.5: focal length n R / (2 (n − 1)). The stop is the pupil.
    let ball = "# a ball\n0 5 0 4\n10 20 1.5 20\n-10 30 1 20\n";
    let loaded = shot(
        ball,
        "\"float aperturediameter\" 3 \"float focusdistance\" 2",
    )
    .expect("a scene");
    assert!(word(&loaded).contains("a perspective one of its focal length"));
    let camera = &loaded.parts.cameras[0];
    let Projection::Perspective { tan_half_y } = camera.projection else {
        panic!("a perspective");
    };
    // The height is four fifths of the diagonal.
    assert!(
        (tan_half_y - 0.5 * 20.0 * 0.8 / 15.0).abs() < 1e-5,
        "{tan_half_y}"
    );
    let lens = camera.lens.expect("a lens");
    assert!(
        (lens.radius - 0.0015).abs() < 1e-7 && lens.focus == 2.0,
        "{lens:?}"
    );
    // The parameter cannot exceed the size of the stop.
    let wide = shot(ball, "\"float aperturediameter\" 9").expect("a scene");
    assert!((wide.parts.cameras[0].lens.expect("a lens").radius - 0.002).abs() < 1e-7);
    // A stop behind a thin lens of focal length 20 mm, half-way to its focus, appears twice as large.
    let behind = "20 0 1.5 20\n-20 10 1 20\n0 10 0 4\n";
    let lens = shot(behind, "\"float aperturediameter\" 4")
        .expect("a scene")
        .parts
        .cameras[0]
        .lens;
    assert!(
        (lens.expect("a lens").radius - 0.004).abs() < 1e-6,
        "{lens:?}"
    );
    for lens in [
        "",
        "10 20 1.5",
        "10 20 1.5 x",
        "-10 0 1.5 20\n10 0 1 20\n0 1 0 2",
    ] {
        let report = shot(lens, "").expect_err("an error");
        assert!(
            report.contains("line 2: l.dat: no lens"),
            "{lens}: {report}"
        );
    }
}

/// Parts of mixtures, materials of shapes in objects, and objects may be declared later.
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
    let report = message("a.pbrt", &format!("WorldBegin\n{mixture}{shapes}"));
    assert!(report.contains("line 2: no material `a`"), "{report}");
    let endless = mixture.replace("\"b\" \"b\"", "\"m\" \"n\"");
    let report = message("a.pbrt", &format!("WorldBegin\n{endless}{parts}{shapes}"));
    assert!(report.contains("a mixture that holds itself"), "{report}");
}

/// Names of pbrt-v3 and of Mitsuba 0.6 without effect are accepted; others take effect or cause a warning.
#[test]
fn foreign_names_of_older_files_are_known() {
    let triangle = "\"point P\" [ 0 0 0 1 0 0 0 1 0 ]";
    let mesh = pbrt(&format!(
        "Shape \"trianglemesh\" {triangle} \"bool discarddegenerateUVs\" \"true\""
    ));
    assert!(mesh.warnings.is_empty(), "{:?}", mesh.warnings);
    let shadow = pbrt(&format!(
        "Shape \"trianglemesh\" {triangle} \"float shadowalpha\" 0"
    ));
    assert!(word(&shadow).contains("`shadowalpha` of `trianglemesh` is not taken"));
    // This image only guides sampling; the emission is that of the lamp itself.
    let lamp = pbrt(
        "AreaLightSource \"diffuse\" Shape \"bilinearmesh\" \"string emissionfilename\" \"a.exr\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 1 1 0 ]",
    );
    assert!(lamp.warnings.is_empty() && lamp.parts.materials[0].emission == Rgb::ONE);
    let hills = pbrt(
        "Shape \"heightfield\" \"integer nu\" 3 \"integer nv\" 2 \"float Pz\" [ 0 1 2 3 4 5 ]",
    );
    let mesh = &hills.parts.meshes[0];
    assert!(hills.warnings.is_empty() && mesh.indices.len() == 4);
    assert!(
        mesh.positions.contains(&Vec3::new(0.5, 1.0, 4.0))
            && mesh.positions.contains(&Vec3::new(1.0, 0.0, 2.0))
    );
    let report = message(
        "a.pbrt",
        "WorldBegin\nShape \"heightfield\" \"integer nu\" 3 \"integer nv\" 2",
    );
    assert!(
        report.contains("line 2: 0 heights for 3 times 2"),
        "{report}"
    );
    let text = |texture: &str| {
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
            property uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
            0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n";
        let shape = format!(
            "<scene version=\"0.6.0\"><shape type=\"ply\"><string name=\"filename\" value=\"a.ply\"/>\
             <bsdf type=\"diffuse\">{texture}</bsdf></shape></scene>"
        );
        let files = [("a.ply", ply.into()), ("a.png", png(3, 4))];
        with_files("a.xml", &shape, &files, Unsupported::Error).expect("a scene")
    };
    let clamped = text(
        "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"a.png\"/>\
         <string name=\"wrapModeU\" value=\"clamp\"/><string name=\"wrapModeV\" value=\"mirror\"/></texture>",
    );
    assert_eq!(clamped.parts.textures[0].wrap, [Wrap::Clamp, Wrap::Mirror]);
    let painted = text("<texture type=\"vertexcolors\" name=\"reflectance\"/>");
    let finish = painted.parts.materials[0]
        .finish
        .as_ref()
        .expect("a finish");
    assert!(finish.has_colors && painted.parts.materials[0].base_color == Rgb::ONE);
}

/// A projector is a spot light of its mean. For an image of 3 Mitsuba 3.9 has a radiance of 0.75 on a white wall at
/// distance 2, within 0.728 times half of that to each side.
#[test]
fn foreign_projectors_are_spots_of_their_mean() {
    let text = |more: &str| {
        let texture = "<texture type=\"bitmap\" name=\"irradiance\"><string name=\"filename\" value=\"m.pfm\"/></texture>";
        xml(&format!(
            "<emitter type=\"projector\">{more}{texture}</emitter>"
        ))
    };
    let mut map = b"PF\n2 1\n-1.0\n".to_vec();
    map.extend(
        [2f32, 2.0, 2.0, 4.0, 4.0, 4.0]
            .iter()
            .flat_map(|value| value.to_le_bytes()),
    );
    let files = [("m.pfm", map)];
    let loaded = with_files(
        "a.xml",
        &text("<float name=\"fov\" value=\"40\"/>"),
        &files,
        Unsupported::Nearest,
    );
    let loaded = loaded.expect("a scene");
    assert!(word(&loaded).contains("a spot light of its mean"));
    let PunctualLight::Spot {
        intensity,
        cos_outer,
        direction,
        ..
    } = loaded.parts.lights[0]
    else {
        panic!("a spot light");
    };
    assert_eq!(direction, Vec3::Z);
    let radiance = intensity / (2.0 * 2.0 * PI);
    assert!((radiance - 0.75).abs().max_element() < 1e-5, "{radiance}");
    let (disk, image) = (PI * (cos_outer.powi(-2) - 1.0), (0.728 * 0.728) / 2.0);
    assert!((disk / image - 1.0).abs() < 2e-3, "{disk} {image}");
    let report = message("a.xml", &text(""));
    assert!(report.contains("line 2: "), "{report}");
}

/// Phase functions are replaced by Henyey and Greenstein's with their mean cosine.
#[test]
fn foreign_phase_functions_have_their_mean_cosine() {
    let cosine = |phase: &str| {
        let text = xml(&format!(
            "<shape type=\"sphere\"><medium name=\"interior\" type=\"homogeneous\">{phase}</medium></shape>"
        ));
        let text = text.replace("<medium", "<bsdf type=\"null\"/><medium");
        let loaded = usual("a.xml", &text);
        assert!(!loaded.warnings.is_empty());
        loaded.parts.materials[0]
            .medium
            .as_ref()
            .expect("a medium")
            .mean_cosine
    };
    // ∫ c (1 + c) over ∫ (1 + c) is 1/3; a tent around 0 has 0.
    let table = |values: &str| {
        format!("<phase type=\"tabphase\"><string name=\"values\" value=\"{values}\"/></phase>")
    };
    for (phase, expected) in [
        (table("0, 1"), 1.0 / 3.0),
        (table("0, 0.5, 1"), 1.0 / 3.0),
        (table("3, 3, 3"), 0.0),
        (table("0, 2, 0"), 0.0),
        (table("1, 0, 0, 0, 0"), -1.0 + 0.5 / 3.0),
        ("<phase type=\"sggx\"/>".into(), 0.0),
        ("<phase type=\"rayleigh\"/>".into(), 0.0),
        (
            format!(
                "<phase type=\"blendphase\"><float name=\"weight\" value=\"0.25\"/>{}<phase type=\"hg\"><float name=\"g\" value=\"0.8\"/></phase></phase>",
                table("0, 1")
            ),
            0.25 + 0.2,
        ),
    ] {
        let found = cosine(&phase);
        assert!(
            (found - expected).abs() < 1e-6,
            "{phase}: {found} {expected}"
        );
    }
    for phase in [
        table(""),
        table("1"),
        table("1, -1"),
        "<phase type=\"blendphase\"/>".into(),
    ] {
        let text = format!(
            "<shape type=\"sphere\"><medium name=\"interior\" type=\"homogeneous\">\n{phase}</medium></shape>"
        );
        let report =
            with_files("a.xml", &xml(&text), &[], Unsupported::Nearest).expect_err("an error");
        assert!(report.contains("line 3: "), "{report}");
    }
}

/// Hair is a surface with its multiple-scattering colour, and curves are tubes of their radius.
#[test]
fn foreign_hair_is_tubes_of_its_colour() {
    let of_pbrt = |more: &str| {
        let loaded = pbrt(&format!("Material \"hair\" {more} Shape \"sphere\""));
        assert!(word(&loaded).contains("a glossy surface of its colour"));
        loaded.parts.materials[0].base_color
    };
    // Chiang et al. 2016: a colour c has the absorption (ln c / f)², with f for a roughness of 0.3.
    let f = 5.969 - 0.215 * 0.3 + 2.532 * 0.3f32.powi(2) - 10.73 * 0.3f32.powi(3)
        + 5.574 * 0.3f32.powi(4)
        + 0.245 * 0.3f32.powi(5);
    let colour = Rgb::new(0.8, 0.5, 0.2);
    let [r, g, b] = colour.to_array().map(|c| (c.ln() / f).powi(2));
    let found = of_pbrt(&format!("\"rgb sigma_a\" [ {r} {g} {b} ]"));
    assert!(found.distance(colour) < 1e-5, "{found}");
    assert_eq!(of_pbrt("\"rgb reflectance\" [ 0.8 0.5 0.2 ]"), colour);
    let (black, red, blond) = (
        of_pbrt(""),
        of_pbrt("\"float pheomelanin\" 1.3"),
        of_pbrt("\"float eumelanin\" 0.1"),
    );
    assert!(
        black.max_element() < 0.02 && blond.x > 0.2 && red.x > 2.0 * red.y,
        "{black} {red} {blond}"
    );
    let text = "<shape type=\"sphere\"><bsdf type=\"hair\"><float name=\"eumelanin\" value=\"0.1\"/></bsdf></shape>";
    assert_eq!(
        usual("a.xml", &xml(text)).parts.materials[0].base_color,
        blond
    );

    let curves = "0 0 0 0.1\n0 0 1 0.1\n0 0 2 0.1\n0 0 3 0.1\n\n\n9 0 0 0.1\n9 0 1 0.1\n9 0 2 0.1\n9 0 3 0.1\n";
    let mut hair = [b"BINARY_HAIR".as_slice(), &8u32.to_le_bytes()].concat();
    for (k, line) in curves.lines().filter(|line| !line.is_empty()).enumerate() {
        let infinite = (k == 4).then_some(f32::INFINITY);
        let place = line
            .split(' ')
            .take(3)
            .map(|word| word.parse().expect("a number"));
        hair.extend(infinite.into_iter().chain(place).flat_map(f32::to_le_bytes));
    }
    let files = [("c.txt", curves.into()), ("c.hair", hair)];
    let read = |plugin: &str, more: &str| {
        let text = xml(&format!(
            "<shape type=\"{plugin}\">{more}<transform name=\"to_world\"><scale value=\"2\"/></transform></shape>"
        ));
        with_files("a.xml", &text, &files, Unsupported::Error)
    };
    let span = |plugin: &str, more: &str| {
        let loaded = read(plugin, more).expect("a scene");
        assert!(word(&loaded).contains("is shown as tubes"));
        let points = &loaded.parts.meshes[0].positions;
        let fold = |of: fn(Vec3, Vec3) -> Vec3| points.iter().copied().reduce(of).expect("points");
        (fold(Vec3::min), fold(Vec3::max))
    };
    let file = "<string name=\"filename\" value=\"c.txt\"/>";
    // Points are transformed, radii are not, as in Mitsuba 3.9. A spline begins at a mean with weights 1, 4, 1.
    for (plugin, more, low, high, radius) in [
        ("linearcurve", file.to_owned(), 0.0, 6.0, 0.1),
        ("bsplinecurve", file.to_owned(), 2.0, 4.0, 0.1),
        (
            "hair",
            format!("{file}<float name=\"radius\" value=\"0.2\"/>"),
            0.0,
            6.0,
            0.1,
        ),
        (
            "hair",
            file.replace("c.txt", "c.hair") + "<float name=\"radius\" value=\"0.2\"/>",
            0.0,
            6.0,
            0.2,
        ),
    ] {
        let (from, to) = span(plugin, &more);
        assert!(
            (from.z - low).abs() < 1e-5 && (to.z - high).abs() < 1e-5,
            "{plugin}: {from} {to}"
        );
        let wide = [-from.x, to.x - 18.0];
        assert!(
            wide.iter()
                .all(|w| *w < radius + 1e-5 && *w > 0.86 * radius),
            "{plugin}: {from} {to}"
        );
    }
    for (curves, words) in [
        ("0 0 0 0.1\n0 0 1\n1 2\n", "line 3: is no point"),
        ("0 0 0 1\n", "curve 0 has too few points, 1"),
        ("0 0 0 nan\n0 0 1 1", "curve 0 is not finite"),
        ("0 0 0 1\n0 0 1 -1", "curve 0 has a negative radius"),
        ("\n\n", "has no curves"),
    ] {
        let report = refused("linearcurve", curves.as_bytes());
        assert!(report.contains(words), "{report}");
    }
    let head = |count: u32| [b"BINARY_HAIR".as_slice(), &count.to_le_bytes()].concat();
    let point = [0u8; 12];
    for (bytes, words) in [
        (b"BINARY_HAIR".to_vec(), "ends before its points"),
        (head(0), "has no curves"),
        (
            [head(2), point.to_vec()].concat(),
            "has 1 points and says 2",
        ),
        (
            [head(1), point[1..].to_vec()].concat(),
            "ends within a point",
        ),
        (
            [head(1), point.to_vec(), vec![0]].concat(),
            "has 1 points and says 1",
        ),
    ] {
        let report = refused("hair", &bytes);
        assert!(report.contains(words), "{report}");
    }
}

/// The error for curves with these contents.
fn refused(plugin: &str, curves: &[u8]) -> String {
    let file = "<string name=\"filename\" value=\"c.txt\"/>";
    let text = xml(&format!("<shape type=\"{plugin}\">{file}</shape>"));
    let files = [("c.txt", curves.to_vec())];
    let read = with_files("a.xml", &text, &files, Unsupported::Nearest);
    read.expect_err("an error")
}

/// Cameras whose pictures have no finite size are refused.
#[test]
fn foreign_pictures_without_a_size_are_refused() {
    let wide = "\"float screenwindow\" [ 1e300 1.1e300 0 1e299 ]";
    for (film, camera, words) in [
        ("\"float diagonal\" 0", "", "a diagonal of 0 mm"),
        ("\"float diagonal\" -35", "", "a diagonal of -35 mm"),
        (
            "\"integer xresolution\" 100 \"integer yresolution\" 100",
            wide,
            "no picture of a finite size",
        ),
    ] {
        let text = format!(
            "Film \"rgb\" {film}\nCamera \"perspective\" {camera}\nWorldBegin\nShape \"sphere\""
        );
        let report = message("a.pbrt", &text);
        assert!(report.contains(words), "{report}");
    }
}
