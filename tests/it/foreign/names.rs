//! Names of parameters: the readers accept no unknown name.

use super::{message, read};

/// A misspelt name, or a name of another version or kind, is an error with its line and the valid names; with
/// `--unsupported skip` it is a warning.
#[test]
fn foreign_unknown_names_are_errors_with_their_line() {
    for (text, line, kind, name) in [
        (
            "Material \"diffuse\"\n\"rgb reflektance\" [1 0 0]",
            3,
            "diffuse",
            "reflektance",
        ),
        ("Material \"metal\" \"rgb Kr\" [1 1 1]", 2, "metal", "Kr"),
        (
            "LightSource \"infinite\"\n\n\"string map\" \"a.exr\"",
            4,
            "infinite",
            "map",
        ),
        ("LightSource \"point\" \"rgb L\" [1 1 1]", 2, "point", "L"),
        (
            "AreaLightSource \"diffuse\" \"rgb Le\" [1 1 1]",
            2,
            "diffuse",
            "Le",
        ),
        ("Shape \"sphere\" \"float raduis\" 2", 2, "sphere", "raduis"),
        (
            "Texture \"a\" \"float\" \"checkerboard\" \"float tex3\" 1",
            2,
            "checkerboard",
            "tex3",
        ),
        (
            "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb Kd\" [1 1 1]",
            2,
            "diffuse",
            "Kd",
        ),
        (
            "MakeNamedMedium \"a\" \"string type\" \"homogeneous\" \"rgb sigmas\" [1 1 1]",
            2,
            "homogeneous",
            "sigmas",
        ),
        ("Film \"rgb\" \"integer xres\" 32", 2, "rgb", "xres"),
        (
            "Camera \"perspective\" \"float fow\" 32",
            2,
            "perspective",
            "fow",
        ),
    ] {
        let text = format!("WorldBegin\n{text}\nShape \"disk\"");
        let found = message("a.pbrt", &text);
        let expected = format!("a.pbrt: line {line}: `{kind}` has no parameter `{name}`");
        assert!(found.contains(&expected), "{text}: {found}");
        let warnings = read("a.pbrt", &text, true).unwrap().warnings;
        assert!(
            warnings
                .iter()
                .any(|w| w.contains(&format!("no parameter `{name}`"))),
            "{warnings:?}"
        );
    }
    for (xml, kind, name) in [
        (
            "<bsdf type=\"diffuse\"><rgb name=\"reflektance\" value=\"1\"/></bsdf>",
            "diffuse",
            "reflektance",
        ),
        (
            "<bsdf type=\"diffuse\"><texture name=\"colour\" type=\"checkerboard\"/></bsdf>",
            "diffuse",
            "colour",
        ),
        (
            "<bsdf type=\"diffuse\"><texture type=\"checkerboard\"/></bsdf>",
            "diffuse",
            "",
        ),
        (
            "<bsdf type=\"conductor\"><float name=\"alpha\" value=\"0.2\"/></bsdf>",
            "conductor",
            "alpha",
        ),
        (
            "<shape type=\"sphere\"><float name=\"raduis\" value=\"2\"/></shape>",
            "sphere",
            "raduis",
        ),
        (
            "<emitter type=\"point\"><rgb name=\"radiance\" value=\"1\"/></emitter>",
            "point",
            "radiance",
        ),
        (
            "<sensor type=\"perspective\"><float name=\"fow\" value=\"40\"/></sensor>",
            "perspective",
            "fow",
        ),
        (
            "<medium type=\"homogeneous\"><float name=\"sigma\" value=\"1\"/></medium>",
            "homogeneous",
            "sigma",
        ),
        (
            "<film type=\"hdrfilm\"><integer name=\"widht\" value=\"8\"/></film>",
            "hdrfilm",
            "widht",
        ),
    ] {
        let found = message(
            "a.xml",
            &format!("<scene version=\"3.0.0\">\n\n{xml}</scene>"),
        );
        let expected = format!("a.xml: line 3: `{kind}` has no parameter `{name}`");
        assert!(found.contains(&expected), "{xml}: {found}");
    }
    // In a plugin without inner objects a reference can only be a texture.
    let text = "<scene version=\"3.0.0\"><texture type=\"checkerboard\" id=\"t\"/>\n\
        <bsdf type=\"diffuse\"><ref id=\"t\" name=\"reflektance\"/></bsdf></scene>";
    assert!(message("a.xml", text).contains("line 2: `diffuse` has no parameter `reflektance`"));
}

/// Parameters of `Attribute` apply only to elements that have them.
#[test]
fn foreign_names_of_attribute_need_not_fit() {
    let text = "WorldBegin Attribute \"shape\" \"float radius\" 2 Shape \"sphere\"\n\
        Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]";
    assert_eq!(read("a.pbrt", text, false).unwrap().parts.meshes.len(), 2);
}

/// Ignored settings that change a picture cause a warning.
#[test]
fn foreign_what_is_not_taken_is_named() {
    let sensor = |near: f32, far: f32| {
        format!(
            "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><float name=\"near_clip\" value=\"{near}\"/>\
             <float name=\"far_clip\" value=\"{far}\"/></sensor>"
        )
    };
    let warnings = |inner: &str| {
        let text = format!("<scene version=\"3.0.0\"><shape type=\"sphere\"/>\n{inner}</scene>");
        read("a.xml", &text, false).unwrap().warnings
    };
    let integrator = "<integrator type=\"path\"><integer name=\"max_depth\" value=\"6\"/><boolean name=\"hide_emitters\" value=\"true\"/>\
        </integrator>";
    assert_eq!(
        warnings(integrator),
        [
            "line 2: `max_depth` 6 is not taken; `--max-vertices 5` does the same",
            "line 2: `hide_emitters` is not taken: lights are seen"
        ]
    );
    let unlimited =
        "<integrator type=\"path\"><integer name=\"max_depth\" value=\"-1\"/></integrator>";
    assert!(warnings(unlimited).is_empty());
    assert!(warnings(&sensor(0.01, 10_000.0)).is_empty());
    assert!(warnings(&sensor(2.0, 10_000.0))[0].contains("`near_clip`"));
    assert!(warnings(&sensor(0.01, 8.0))[0].contains("`far_clip`"));
    let sheen = "<bsdf type=\"principled\"><float name=\"sheen\" value=\"1\"/></bsdf>";
    assert_eq!(
        warnings(sheen),
        ["line 2: `sheen` of `principled` is not taken"]
    );
    let pbrt = "WorldBegin Shape \"disk\"\nIntegrator \"path\" \"integer maxdepth\" 3";
    let expected = "line 2: `maxdepth` 3 is not taken; `--max-vertices 3` does the same";
    assert_eq!(read("a.pbrt", pbrt, false).unwrap().warnings, [expected]);
}

/// Coloured maps of numbers in Mitsuba count by their luminance; roughness in each direction may have a map.
#[test]
fn foreign_coloured_maps_are_numbers_by_their_luminance() {
    let folder = crate::support::quick_folder();
    let red = image::RgbImage::from_pixel(4, 4, image::Rgb([255, 0, 0]));
    red.save(folder.path().join("red.png")).unwrap();
    let parts = |bsdf: &str| {
        let path = folder.path().join("a.xml");
        let text =
            format!("<scene version=\"3.0.0\"><shape type=\"rectangle\">{bsdf}</shape></scene>");
        std::fs::write(&path, text).unwrap();
        opsr::scene::load::load(&path, &opsr_formats::options()).map(|loaded| loaded.parts)
    };
    let map = |name: &str| {
        format!(
            "<texture name=\"{name}\" type=\"bitmap\"><string name=\"filename\" value=\"red.png\"/><boolean name=\"raw\" value=\"true\"/></texture>"
        )
    };
    for name in ["alpha", "alpha_u", "alpha_v"] {
        let found = parts(&format!(
            "<bsdf type=\"roughconductor\">{}</bsdf>",
            map(name)
        ))
        .unwrap();
        let rough = found.materials[0].metallic_roughness_texture.unwrap();
        let [_, root, ..] = found.textures[rough.texture as usize].texel(0, 0);
        assert!((root * root - 0.2126).abs() < 1e-3, "{name}: {root}");
    }
    let diffuse = "<bsdf type=\"diffuse\"/>";
    let mixed = parts(&format!(
        "<bsdf type=\"blendbsdf\">{}{diffuse}{diffuse}</bsdf>",
        map("weight")
    ))
    .unwrap();
    let mix = (mixed.materials.iter())
        .find_map(|m| m.finish.as_ref()?.mix.as_ref())
        .unwrap();
    let [weight, ..] = mixed.textures[mix.texture.unwrap().texture as usize].texel(0, 0);
    assert!((mix.weight * weight - 0.2126).abs() < 1e-3, "{weight}");
    // These parameters use the mean of the map.
    let mean = |name: &str| {
        let bsdf = format!("<bsdf type=\"principled\">{}</bsdf>", map(name));
        parts(&bsdf).unwrap().materials[0].clone()
    };
    assert!((mean("metallic").metallic - 0.2126).abs() < 1e-3);
    assert!((mean("spec_trans").transmission - 0.2126).abs() < 1e-3);
}
