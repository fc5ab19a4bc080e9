//! Parts that are shown as their nearest equivalent, and names of older versions.

use super::{message, read};
use opsr::math::{Ray, Rgb, Vec2, Vec3, luminance};
use opsr::scene::load::{LoadOptions, Loaded, Unsupported, load};
use opsr::scene::{Material, PunctualLight, Scene};

/// Reads a scene next to these files, with this treatment of unsupported parts.
pub(super) fn with_files(
    name: &str,
    text: &str,
    files: &[(&str, Vec<u8>)],
    unsupported: Unsupported,
) -> Result<Loaded, String> {
    let folder = crate::support::quick_folder();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("a file");
    }
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("a file");
    let options = LoadOptions {
        unsupported,
        ..opsr_formats::options()
    };
    load(&path, &options).map_err(|e| e.to_string())
}

pub(super) fn usual(name: &str, text: &str) -> Loaded {
    with_files(name, text, &[], Unsupported::Nearest).unwrap_or_else(|e| panic!("{e}"))
}

pub(super) fn xml(inner: &str) -> String {
    format!("<scene version=\"3.0.0\">\n{inner}\n</scene>")
}

/// An unsupported surface is approximated with a warning, or refused on request; unsupported lights are errors.
#[test]
fn nearest_surfaces_are_named_and_lights_are_not_left_out() {
    let measured = xml("<shape type=\"sphere\"><bsdf type=\"measured\"/></shape>");
    let line = "line 2: bsdf `measured` is not supported: shown as a grey diffuse surface";
    assert_eq!(usual("a.xml", &measured).warnings, [line]);
    let report = message("a.xml", &measured);
    assert!(
        report.contains("--unsupported nearest shows a grey diffuse surface"),
        "{report}"
    );
    assert_eq!(
        read("a.xml", &measured, true).expect("a scene").warnings,
        [line]
    );
    for (name, text) in [
        ("a.xml", xml("<emitter type=\"laser\"/>")),
        ("a.xml", xml("<shape type=\"heightfield\"/>")),
        (
            "a.xml",
            xml(
                "<shape type=\"sphere\"><medium type=\"heterogeneous\" name=\"interior\"/></shape>",
            ),
        ),
        ("a.pbrt", "WorldBegin LightSource \"laser\"".into()),
        ("a.pbrt", "WorldBegin Shape \"nurbs\"".into()),
        (
            "a.pbrt",
            "MakeNamedMedium \"a\" \"string type\" \"cloud\"".into(),
        ),
        (
            "a.pbrt",
            "WorldBegin Material \"diffuse\" \"rgb reflektance\" [1 1 1]".into(),
        ),
    ] {
        let report = with_files(name, &text, &[], Unsupported::Nearest).expect_err("an error");
        assert!(
            report.contains("--unsupported skip goes on without it"),
            "{text}: {report}"
        );
        assert!(
            with_files(name, &text, &[], Unsupported::Skip).is_ok(),
            "{text}"
        );
    }
}

fn pbrt(line: &str) -> Material {
    let text = format!("WorldBegin\n{line}\nShape \"sphere\"");
    let parts = usual("a.pbrt", &text).parts;
    let number = parts.meshes[0].material as usize;
    parts.materials[number].clone()
}

#[test]
fn materials_of_pbrt_3_are_read() {
    // [PBRT3 §8.4.2] evaluated for a roughness of 0.1.
    let of_a_tenth = 0.461_76;
    let plastic = pbrt(
        "Material \"plastic\" \"rgb Kd\" [0.3 0.2 0.1] \"rgb Ks\" [0.5 0.25 0.5] \"float roughness\" 0.1",
    );
    assert_eq!(plastic.base_color, Rgb::new(0.3, 0.2, 0.1));
    assert_eq!(
        (plastic.specular, plastic.specular_color),
        (0.5, Rgb::new(1.0, 0.5, 1.0))
    );
    assert!(
        (plastic.alpha - of_a_tenth).abs() < 1e-4,
        "{}",
        plastic.alpha
    );
    let plain =
        pbrt("Material \"plastic\" \"float roughness\" 0.1 \"bool remaproughness\" \"false\"");
    assert_eq!((plain.alpha, plain.ior), (0.1, 1.5));
    let mirror = pbrt("Material \"mirror\" \"rgb Kr\" [0.7 0.8 0.9]");
    assert_eq!(
        (mirror.metallic, mirror.alpha, mirror.base_color),
        (1.0, 0.0, Rgb::new(0.7, 0.8, 0.9))
    );
    let glass = pbrt("Material \"glass\" \"float index\" 1.33 \"rgb Kt\" [1 0.5 1]");
    assert_eq!(
        (glass.transmission, glass.solid, glass.ior),
        (1.0, true, 1.33)
    );
    assert_eq!(
        (glass.base_color, glass.alpha),
        (Rgb::new(1.0, 0.5, 1.0), 0.0)
    );
    let metal = pbrt("Material \"metal\"");
    assert!(
        metal.metallic == 1.0 && metal.alpha > 0.0 && metal.alpha < 0.2,
        "{}",
        metal.alpha
    );
    // A layer of this index reflects `Ks` of a substrate at normal incidence.
    let substrate = pbrt("Material \"substrate\" \"rgb Ks\" [0.09 0.09 0.09]");
    let reflected = ((substrate.ior - 1.0) / (substrate.ior + 1.0)).powi(2);
    assert!((reflected - 0.09).abs() < 1e-5);
    let holes = pbrt("Material \"uber\" \"rgb opacity\" [0.25 0.25 0.25] \"rgb Kd\" [1 0 0]");
    assert_eq!((holes.opacity, holes.base_color), (0.25, Rgb::X));
    let clear = pbrt("Material \"uber\" \"rgb Kd\" [0 0 0] \"rgb Kt\" [0.9 0.9 0.9]");
    assert_eq!((clear.transmission, clear.solid), (1.0, true));
    let disney = pbrt(
        "Material \"disney\" \"rgb color\" [0.1 0.2 0.3] \"float metallic\" 0.5 \"float roughness\" 0.6",
    );
    assert!((disney.alpha - 0.36).abs() < 1e-6 && disney.metallic == 0.5);
    for kind in ["subsurface", "kdsubsurface", "measured", "hair"] {
        let text = format!("WorldBegin Material \"{kind}\" Shape \"sphere\"");
        let warnings = usual("a.pbrt", &text).warnings;
        assert!(
            warnings.iter().any(|w| w.contains("shown as")),
            "{kind}: {warnings:?}"
        );
        assert!(
            message("a.pbrt", &text).contains("--unsupported nearest shows"),
            "{kind}"
        );
    }
}

/// Version 3's amount is the first material's share, version 4's the second's; nested mixtures keep the heaviest.
#[test]
fn mixtures_have_their_shares() {
    let named = "MakeNamedMaterial \"red\" \"string type\" \"matte\" \"rgb Kd\" [1 0 0]\n\
                 MakeNamedMaterial \"green\" \"string type\" \"diffuse\" \"rgb reflectance\" [0 1 0]\n\
                 MakeNamedMaterial \"blue\" \"string type\" \"diffuse\" \"rgb reflectance\" [0 0 1]\n";
    // The mean colour of the mixture.
    let mean = |mixture: &str| {
        let text = format!("WorldBegin\n{named}{mixture}\nShape \"sphere\"");
        let loaded = usual("a.pbrt", &text);
        let materials = &loaded.parts.materials;
        let first = &materials[loaded.parts.meshes[0].material as usize];
        let mix = first
            .finish
            .as_ref()
            .and_then(|f| f.mix)
            .expect("a mixture");
        let other = &materials[mix.other as usize];
        assert!(other.finish.as_ref().is_none_or(|f| f.mix.is_none()));
        (
            first.base_color.lerp(other.base_color, mix.weight),
            loaded.warnings,
        )
    };
    let older = "Material \"mix\" \"string namedmaterial1\" \"red\" \"string namedmaterial2\" \"green\" \"rgb amount\" [0.25 0.25 0.25]";
    assert_eq!(mean(older), (Rgb::new(0.25, 0.75, 0.0), Vec::new()));
    let newer = "Material \"mix\" \"string materials\" [\"red\" \"green\"] \"float amount\" 0.25";
    assert_eq!(mean(newer), (Rgb::new(0.75, 0.25, 0.0), Vec::new()));
    let nested = "MakeNamedMaterial \"two\" \"string type\" \"mix\" \"string materials\" [\"red\" \"green\"] \"float amount\" 0.25\n\
                  Material \"mix\" \"string materials\" [\"two\" \"blue\"] \"float amount\" 0.5";
    // Red has 0.375, green 0.125, blue 0.5.
    let (found, warnings) = mean(nested);
    assert!(
        found.distance(Rgb::new(0.375, 0.0, 0.5) / 0.875) < 1e-6,
        "{found}"
    );
    assert!(
        warnings[0].contains("a mixture of 3 materials"),
        "{warnings:?}"
    );
    let diffuse = |colour: &str| {
        format!("<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"{colour}\"/></bsdf>")
    };
    let three = format!(
        "<shape type=\"sphere\"><bsdf type=\"mixturebsdf\"><string name=\"weights\" value=\"0.2, 0.5, 0.3\"/>{}{}{}</bsdf></shape>",
        diffuse("1 0 0"),
        diffuse("0 1 0"),
        diffuse("0 0 1")
    );
    let parts = usual("a.xml", &xml(&three)).parts;
    let first = &parts.materials[parts.meshes[0].material as usize];
    let mix = first
        .finish
        .as_ref()
        .and_then(|f| f.mix)
        .expect("a mixture");
    assert_eq!(
        (
            first.base_color,
            parts.materials[mix.other as usize].base_color
        ),
        (Rgb::Y, Rgb::Z)
    );
    assert!((mix.weight - 0.375).abs() < 1e-6);
}

/// A movement is shown at its beginning; a black body of version 3 has a scale.
#[test]
fn movements_are_shown_as_they_begin() {
    let text = "WorldBegin Translate 1 0 0 ActiveTransform EndTime Translate 5 0 0 ActiveTransform All Translate 0 2 0\n\
                AreaLightSource \"diffuse\" \"blackbody L\" [3000 4] Shape \"sphere\"";
    let loaded = usual("a.pbrt", text);
    let mesh = &loaded.parts.meshes[0];
    let mean = mesh.positions.iter().sum::<Vec3>() / mesh.positions.len() as f32;
    assert!(mean.distance(Vec3::new(1.0, 2.0, 0.0)) < 1e-2, "{mean}");
    let words = "motion blur (`ActiveTransform`) is not supported: shown as its first moment";
    assert_eq!(loaded.warnings, [format!("line 1: {words}")]);
    let emission = loaded.parts.materials[mesh.material as usize].emission;
    assert!((luminance(emission) - 4.0).abs() < 1e-3, "{emission}");
}

/// Lamps with images emit their mean, within the cone of a projector.
#[test]
fn lamps_with_images_shine_with_their_mean() {
    let mut map = b"PF\n2 1\n-1.0\n".to_vec();
    for value in [1f32, 2.0, 3.0, 3.0, 4.0, 5.0] {
        map.extend(value.to_le_bytes());
    }
    let light = |line: &str| {
        let text = format!("WorldBegin LightSource {line}");
        let files = [("m.pfm", map.clone())];
        assert!(with_files("a.pbrt", &text, &files, Unsupported::Error).is_err());
        let loaded = with_files("a.pbrt", &text, &files, Unsupported::Nearest);
        let loaded = loaded.unwrap_or_else(|e| panic!("{e}"));
        assert!(
            loaded.warnings[0].contains("of its mean"),
            "{:?}",
            loaded.warnings
        );
        loaded.parts.lights[0]
    };
    let PunctualLight::Point { intensity, .. } =
        light("\"goniometric\" \"string mapname\" \"m.pfm\" \"rgb I\" [2 2 2]")
    else {
        panic!("a point light");
    };
    assert_eq!(intensity, Rgb::new(4.0, 6.0, 8.0));
    let projector = light("\"projection\" \"string filename\" \"m.pfm\" \"float fov\" 60");
    let PunctualLight::Spot {
        intensity,
        cos_outer,
        ..
    } = projector
    else {
        panic!("a spot light");
    };
    assert_eq!(intensity, Rgb::new(2.0, 3.0, 4.0));
    assert!((cos_outer - 30f32.to_radians().cos()).abs() < 1e-6);
}

/// Quadrics of version 3 have their extents, and curves are tubes of their width around their points.
#[test]
fn quadrics_and_curves_of_pbrt_are_meshes() {
    let span = |line: &str| {
        let loaded = usual("a.pbrt", &format!("WorldBegin Shape {line}"));
        let points = &loaded.parts.meshes[0].positions;
        let fold = |of: fn(Vec3, Vec3) -> Vec3| points.iter().copied().reduce(of).expect("points");
        [fold(Vec3::min), fold(Vec3::max)]
    };
    let near = |found: [Vec3; 2], low: [f32; 3], high: [f32; 3]| {
        let far = found[0]
            .distance(low.into())
            .max(found[1].distance(high.into()));
        assert!(far < 2e-3, "{found:?}");
    };
    near(
        span("\"cone\" \"float radius\" 2 \"float height\" 3"),
        [-2.0, -2.0, 0.0],
        [2.0, 2.0, 3.0],
    );
    near(
        span("\"paraboloid\" \"float radius\" 2 \"float zmax\" 3"),
        [-2.0, -2.0, 0.0],
        [2.0, 2.0, 3.0],
    );
    near(
        span("\"hyperboloid\" \"point p1\" [1 0 -1] \"point p2\" [0.6 0.8 2]"),
        [-1.0, -1.0, -1.0],
        [1.0, 1.0, 2.0],
    );
    let line = "\"curve\" \"point3 P\" [0 0 0  0 0 1  0 0 2  0 0 3]";
    // The tube has six sides, so it is slightly narrower than the circle.
    let [low, high] = span(&format!("{line} \"float width\" 0.2"));
    assert!(low.z.abs() < 1e-6 && (high.z - 3.0).abs() < 1e-6);
    let wide = high.truncate().max_element();
    assert!(wide <= 0.1 + 1e-6 && wide > 0.09, "{low} {high}");
    // A B-spline goes from the mean of its first three points, weighted 1, 4, 1, to that of its last.
    let [low, high] = span(&format!(
        "{line} \"string basis\" \"bspline\" \"float width\" 0.2"
    ));
    assert!(
        (low.z - 1.0).abs() < 1e-6 && (high.z - 2.0).abs() < 1e-6,
        "{low} {high}"
    );
    for (line, words) in [
        (
            "\"point3 P\" [0 0 0  0 0 1  0 0 2  0 0 3  0 0 4]",
            "5 points of a curve of degree 3",
        ),
        (
            "\"point3 P\" [0 0 0  0 0 1] \"integer degree\" 1",
            "a curve of degree 1",
        ),
        (
            "\"point3 P\" [0 0 0  0 0 1  0 0 2  0 0 3] \"string basis\" \"hermite\"",
            "basis `hermite`",
        ),
    ] {
        let report = message("a.pbrt", &format!("WorldBegin Shape \"curve\" {line}"));
        assert!(report.contains(words), "{report}");
    }
}

/// Vertex colours apply to materials that refer to them, also nested ones, and to no others.
#[test]
fn mesh_colours_of_mitsuba_paint_what_asks_for_them() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float r\n\
               property float g\nproperty float b\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0 1 0 0\n1 0 0 0 1 0\n0 1 0 0 0 1\n3 0 1 2\n";
    let shape = |bsdf: &str| {
        format!("<shape type=\"ply\"><string name=\"filename\" value=\"a.ply\"/>{bsdf}</shape>")
    };
    let painted = "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"><texture type=\"mesh_attribute\" name=\"reflectance\">\
                   <string name=\"name\" value=\"vertex_color\"/></texture></bsdf></bsdf>";
    let text = xml(&(shape(painted) + &shape("<bsdf type=\"diffuse\"/>")));
    let files = [("a.ply", ply.as_bytes().to_vec())];
    let loaded =
        with_files("a.xml", &text, &files, Unsupported::Error).unwrap_or_else(|e| panic!("{e}"));
    let [first, second] = &loaded.parts.meshes[..] else {
        panic!("two meshes");
    };
    assert_eq!(first.colors[1].truncate(), Vec3::Y);
    let of = |number: u32| {
        let material = &loaded.parts.materials[number as usize];
        (
            material.base_color,
            material.finish.as_ref().is_some_and(|f| f.has_colors),
        )
    };
    assert_eq!(of(first.material), (Rgb::ONE, true));
    assert_eq!(of(second.material), (Rgb::splat(0.5), false));
}

/// Weights that do not fit are an error, and a sum other than 1 is a warning.
#[test]
fn weights_of_mixtures_are_checked() {
    let two = "<bsdf type=\"diffuse\"/><bsdf type=\"diffuse\"/>";
    let mixture = |weights: &str, inner: &str| {
        let property = format!("<string name=\"weights\" value=\"{weights}\"/>");
        xml(&format!(
            "<shape type=\"cube\"><bsdf type=\"mixturebsdf\">{property}{inner}</bsdf></shape>"
        ))
    };
    for (weights, inner, words) in [
        ("0.5", two.to_owned(), "1 weights of 2 BSDFs"),
        ("0.5, 0.5", format!("{two}{two}"), "2 weights of 4 BSDFs"),
        ("0.5, -0.5", two.to_owned(), "2 weights of 2 BSDFs"),
        ("0, 0", two.to_owned(), "a mixture of nothing"),
    ] {
        let report = message("a.xml", &mixture(weights, &inner));
        assert!(
            report.contains("line 2: ") && report.contains(words),
            "{report}"
        );
    }
    let report = usual("a.xml", &mixture("0.2, 0.6", two)).warnings;
    assert!(report[0].contains("weights of a sum of 0.8"), "{report:?}");
}

/// A PNG of random colours.
pub(super) fn png(seed: u32, side: u32) -> Vec<u8> {
    let picture = image::RgbImage::from_fn(side, side, |x, y| {
        let hash = |k: u32| {
            ((x * 7 + y * 13 + seed * 29 + k * 31).wrapping_mul(2_654_435_761) >> 24) as u8
        };
        image::Rgb([hash(0), hash(1), hash(2)])
    });
    crate::support::gltf::png(&picture.into())
}

/// Products and mixtures of two images are exact at texel centres; different coordinates make them impossible.
#[test]
fn images_are_multiplied_and_mixed() {
    let files = [("a.png", png(1, 8)), ("b.png", png(2, 8))];
    let scene = |class: &str, more: &str, other: &str| {
        let image = |name: &str, more: &str| {
            format!(
                "Texture \"{name}\" \"spectrum\" \"imagemap\" \"string filename\" \"{name}.png\" \"string filter\" \"point\" {more}\n"
            )
        };
        let text = format!(
            "WorldBegin\n{}{}Texture \"c\" \"spectrum\" \"{class}\" {more}\nMaterial \"diffuse\" \"texture reflectance\" \"c\"\nShape \"disk\"",
            image("a", "\"float scale\" 0.5"),
            image("b", other)
        );
        with_files("a.pbrt", &text, &files, Unsupported::Nearest).unwrap_or_else(|e| panic!("{e}"))
    };
    let colours = |loaded: &Loaded| -> Vec<Rgb> {
        let material = &loaded.parts.materials[0];
        let map = material.base_color_texture.expect("a texture");
        let texture = &loaded.parts.textures[map.texture as usize];
        let at = |i: usize| Vec2::new((i % 8) as f32 + 0.5, (i / 8) as f32 + 0.5) / 8.0;
        let colour = |i| Vec3::from_slice(&texture.sample(at(i))) * material.base_color;
        (0..64).map(colour).collect()
    };
    let linear = |bytes: &[u8]| -> Vec<Rgb> {
        let picture = image::load_from_memory(bytes).expect("a picture").to_rgb8();
        let linear = |c: u8| {
            let c = f32::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        };
        picture
            .pixels()
            .map(|p| Rgb::from_array(p.0.map(linear)))
            .collect()
    };
    let (a, b) = (linear(&files[0].1), linear(&files[1].1));
    let product = colours(&scene(
        "scale",
        "\"texture tex\" \"a\" \"texture scale\" \"b\"",
        "",
    ));
    let mixture = colours(&scene(
        "mix",
        "\"texture tex1\" \"a\" \"texture tex2\" \"b\" \"float amount\" 0.25",
        "",
    ));
    for i in 0..64 {
        assert!(product[i].distance(0.5 * a[i] * b[i]) < 1e-3, "{i}");
        assert!(
            mixture[i].distance(0.75 * 0.5 * a[i] + 0.25 * b[i]) < 1e-3,
            "{i}"
        );
    }
    // A product with a colour needs no new texture.
    let tinted = scene(
        "scale",
        "\"texture tex\" \"a\" \"rgb scale\" [1 0.5 0.25]",
        "",
    );
    let material = &tinted.parts.materials[0];
    assert_eq!(material.base_color, 0.5 * Rgb::new(1.0, 0.5, 0.25));
    let map = material.base_color_texture.expect("a texture");
    assert_eq!((map.texture, tinted.parts.textures.len()), (0, 2));
    let other = scene(
        "scale",
        "\"texture tex\" \"a\" \"texture scale\" \"b\"",
        "\"float uscale\" 2",
    );
    assert!(
        other.warnings[0].contains("two images of different coordinates"),
        "{:?}",
        other.warnings
    );
}

/// A map of version 3 has latitude and longitude around +z `[PBRT3 §12.6]`, and its colour multiplies it.
#[test]
fn maps_of_pbrt_3_shine_from_where_they_say() {
    let (width, height) = (64, 32);
    for (x, y) in [(5, 9), (40, 20), (20, 3)] {
        let mut map = format!("PF\n{width} {height}\n-1.0\n").into_bytes();
        // The first row of the file is the bottom one.
        for row in (0..height).rev() {
            for column in 0..width {
                let value = if (column, row) == (x, y) {
                    100f32
                } else {
                    0.01
                };
                (0..3).for_each(|_| map.extend(value.to_le_bytes()));
            }
        }
        let text = "WorldBegin LightSource \"infinite\" \"string mapname\" \"m.pfm\" \"rgb L\" [2 1 1] \"rgb scale\" [1 1 0.5]";
        let loaded = with_files("a.pbrt", text, &[("m.pfm", map)], Unsupported::Error);
        let sky = loaded
            .unwrap_or_else(|e| panic!("{e}"))
            .parts
            .environment
            .expect("a sky");
        let (u, v) = (
            (x as f32 + 0.5) / width as f32,
            (y as f32 + 0.5) / height as f32,
        );
        let (theta, phi) = (v * std::f32::consts::PI, u * std::f32::consts::TAU);
        let dir = Vec3::new(
            theta.sin() * phi.cos(),
            theta.sin() * phi.sin(),
            theta.cos(),
        );
        let there = sky.radiance(dir);
        // Texels near the pole are narrow, and resampling blurs them.
        assert!(there.y > 30.0, "{x}, {y}: {there}");
        assert!((there.x / there.y - 2.0).abs() < 1e-3 && (there.z / there.y - 0.5).abs() < 1e-3);
        assert!(sky.radiance(-dir).y < 0.1);
    }
    let lamp = "WorldBegin AreaLightSource \"diffuse\" \"rgb L\" [4 4 4] \"rgb scale\" [1 0.5 0] Shape \"sphere\"";
    let parts = usual("a.pbrt", lamp).parts;
    let emission = parts
        .materials
        .iter()
        .map(|m| m.emission)
        .fold(Rgb::ZERO, Rgb::max);
    assert_eq!(emission, Rgb::new(4.0, 2.0, 0.0));
}

/// Colours of other spaces: white remains white, and colours within Rec. 709 are exact.
#[test]
fn colour_spaces_of_pbrt_are_taken_to_ours() {
    let colour = |space: &str, rgb: [f64; 3]| {
        let [r, g, b] = rgb;
        pbrt(&format!(
            "ColorSpace \"{space}\" Material \"diffuse\" \"rgb reflectance\" [{r} {g} {b}]"
        ))
        .base_color
    };
    for space in ["srgb", "rec2020", "dci-p3", "aces2065-1"] {
        let white = colour(space, [0.5; 3]);
        assert!(white.distance(Rgb::splat(0.5)) < 5e-4, "{space}: {white}");
    }
    // A Rec. 709 red in Rec. 2020 (ITU-R BT.2087), and in AP0.
    assert!(colour("rec2020", [0.6274, 0.0691, 0.0164]).distance(Rgb::X) < 2e-3);
    assert!(colour("aces2065-1", [0.4396, 0.0898, 0.0174]).distance(Rgb::X) < 2e-3);
    let warnings = usual("a.pbrt", "ColorSpace \"other\" WorldBegin Shape \"disk\"").warnings;
    assert_eq!(
        warnings,
        ["line 1: colour space `other` is not supported: shown as `srgb`"]
    );
}

#[test]
fn names_of_older_mitsuba_are_read() {
    let material = |bsdf: &str| {
        let loaded = usual(
            "a.xml",
            &xml(&format!("<shape type=\"sphere\">{bsdf}</shape>")),
        );
        loaded.parts.materials[loaded.parts.meshes[0].material as usize].clone()
    };
    let phong = material("<bsdf type=\"phong\"><float name=\"exponent\" value=\"98\"/></bsdf>");
    assert!((phong.alpha - 0.02f32.sqrt()).abs() < 1e-6 && phong.specular == 1.0);
    let ward = material(
        "<bsdf type=\"ward\"><float name=\"alphaU\" value=\"0.1\"/><float name=\"alphaV\" value=\"0.4\"/></bsdf>",
    );
    assert!((ward.alpha - 0.2).abs() < 1e-6);
    let coated = material("<bsdf type=\"coating\"><bsdf type=\"diffuse\"/></bsdf>");
    let coat = coated.finish.and_then(|f| f.clearcoat).expect("a coat");
    assert_eq!((coat.weight, coat.alpha), (1.0, 0.0));
    let bitmap = "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"ldrtexture\" name=\"reflectance\">\
                  <string name=\"filename\" value=\"a.png\"/></texture></bsdf></shape>";
    let loaded = with_files(
        "a.xml",
        &xml(bitmap),
        &[("a.png", png(3, 4))],
        Unsupported::Error,
    );
    assert_eq!(
        loaded
            .unwrap_or_else(|e| panic!("{e}"))
            .parts
            .textures
            .len(),
        1
    );
    let merged = "<shape type=\"merge\"><shape type=\"sphere\"/><shape type=\"cube\"/></shape>";
    assert_eq!(usual("a.xml", &xml(merged)).parts.meshes.len(), 2);
    let fog = "<shape type=\"cube\"><medium type=\"homogeneous\" name=\"interior\"><phase type=\"rayleigh\"/></medium></shape>";
    assert!(usual("a.xml", &xml(fog)).warnings[0].contains("phase function `rayleigh`"));
}

/// The zenith is +z in Mitsuba 3 and +y before; a sun without sky is a light without area.
#[test]
fn skies_of_mitsuba_have_their_sun_where_they_say() {
    let sky = |version: &str, plugin: &str, sun: &str| {
        let text = format!(
            "<scene version=\"{version}\"><emitter type=\"{plugin}\"><vector name=\"sun_direction\" value=\"{sun}\"/>\
             <float name=\"turbidity\" value=\"3\"/></emitter></scene>"
        );
        let loaded = usual("a.xml", &text);
        assert!(
            loaded.warnings[0].contains("Preetham's model"),
            "{:?}",
            loaded.warnings
        );
        loaded.parts
    };
    for (version, sun, zenith) in [
        ("3.0.0", Vec3::new(0.6, 0.0, 0.8), Vec3::Z),
        ("0.6.0", Vec3::new(0.6, 0.8, 0.0), Vec3::Y),
    ] {
        let words = format!("{}, {}, {}", sun.x, sun.y, sun.z);
        let made = sky(version, "sunsky", &words).environment.expect("a sky");
        let at = |dir: Vec3| luminance(made.radiance(dir));
        assert!(
            at(sun) > 100.0 * at(zenith) && at(zenith) > 0.01,
            "{version}"
        );
        let alone = sky(version, "sky", &words).environment.expect("a sky");
        let at = |dir: Vec3| luminance(alone.radiance(dir));
        assert!(at(sun) < 100.0 * at(zenith), "{version}");
        let [PunctualLight::Directional { direction, .. }] = sky(version, "sun", &words).lights[..]
        else {
            panic!("a sun");
        };
        assert!(direction.distance(-sun) < 1e-6);
    }
}

/// Reflectance and transmittance of the first material at a point, from its BSDF straight back and straight through.
fn both_sides(loaded: &Loaded) -> [Rgb; 2] {
    let scene = Scene::new(loaded.parts.clone());
    let ray = Ray::new(Vec3::new(0.1, 0.2, 3.0), Vec3::NEG_Z);
    let hit = scene.intersect(&ray).expect("the sheet");
    let bsdf = scene.bsdf(&mut scene.surface(&hit), 0.9);
    [Vec3::Z, Vec3::NEG_Z].map(|wi| bsdf.eval(1.0, Vec3::Z, wi).value * std::f32::consts::PI)
}

fn near([a, b]: [Rgb; 2], [c, d]: [Rgb; 2]) {
    let far = (a - c).abs().max((b - d).abs()).max_element();
    assert!(far < 1e-5, "{a} {c}, {b} {d}");
}

/// Diffusely transmitting surfaces transmit on the sides and by the amounts of their formats.
#[test]
fn foreign_surfaces_transmit_diffusely() {
    let [quarter, fifth] = [Rgb::splat(0.25), Rgb::new(0.2, 0.3, 0.1)];
    let pbrt = |material: &str| {
        let loaded = usual("a.pbrt", &format!("WorldBegin\n{material}\nShape \"disk\""));
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        both_sides(&loaded)
    };
    near(pbrt("Material \"diffusetransmission\""), [quarter; 2]);
    let both = "\"rgb reflectance\" [0.2 0.3 0.1] \"rgb transmittance\" [0.5 0.5 0.5]";
    near(
        pbrt(&format!("Material \"diffusetransmission\" {both}")),
        [fifth, Rgb::splat(0.5)],
    );
    near(
        pbrt(&format!(
            "Material \"diffusetransmission\" {both} \"float scale\" 0.5"
        )),
        [0.5 * fifth, quarter],
    );
    let scaled = |scale: &str| {
        let material = format!("Material \"diffusetransmission\" {both} \"float scale\" {scale}");
        usual("a.pbrt", &format!("WorldBegin\n{material}\nShape \"disk\""))
    };
    near(both_sides(&scaled("-1")), [Rgb::ZERO; 2]);
    let bright = scaled("1e39");
    near(both_sides(&bright), [Rgb::splat(0.5); 2]);
    assert_eq!(
        bright.warnings,
        ["line 2: reflectance and transmittance of more than 1 together are scaled down"]
    );
    // A coat of version 3 dims both sides equally, and glossy transmission causes a warning.
    let shiny = "WorldBegin\nMaterial \"translucent\" \"rgb Kd\" [0.4 0.4 0.4] \"rgb reflect\" [1 1 1]\nShape \"disk\"";
    let shiny = usual("a.pbrt", shiny);
    let left = "line 2: glossy transmission of `translucent` is left out";
    assert_eq!(shiny.warnings, [left]);
    let matt = "Material \"translucent\" \"rgb Kd\" [0.4 0.4 0.4] \"rgb Ks\" [0 0 0] \"rgb reflect\" [1 1 1]";
    near(pbrt(matt), [Rgb::splat(0.4), Rgb::splat(0.2)]);
    let thin = "WorldBegin\nMaterial \"disney\" \"bool thin\" true \"float difftrans\" 0.5\nShape \"disk\"";
    let thin = usual("a.pbrt", thin).parts.materials[0].clone();
    let through = thin.translucency().expect("diffuse transmission");
    assert_eq!((through.weight, through.color), (0.25, Rgb::splat(0.5)));

    let mitsuba = |bsdf: &str| {
        let text = xml(&format!("<shape type=\"rectangle\">{bsdf}</shape>"));
        usual("a.xml", &text)
    };
    let sheet =
        "<bsdf type=\"difftrans\"><rgb name=\"transmittance\" value=\"0.2, 0.3, 0.1\"/></bsdf>";
    let sheet = mitsuba(sheet);
    assert!(sheet.warnings.is_empty(), "{:?}", sheet.warnings);
    near(both_sides(&sheet), [Rgb::ZERO, fifth]);
    let leaf = "<bsdf type=\"principledthin\"><float name=\"diff_trans\" value=\"1.5\"/></bsdf>";
    let leaf = mitsuba(leaf);
    let shown = "line 2: `principledthin` is shown by glTF's model";
    assert_eq!(leaf.warnings, [shown]);
    let through = leaf.parts.materials[0].translucency();
    assert_eq!(through.expect("diffuse transmission").weight, 0.75);
    let pane = "<bsdf type=\"principledthin\"><float name=\"spec_trans\" value=\"1\"/></bsdf>";
    let pane = &mitsuba(pane).parts.materials[0];
    assert!(!pane.solid && pane.transmission == 1.0 && pane.translucency().is_none());
}
