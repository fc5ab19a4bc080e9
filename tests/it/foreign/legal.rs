//! Legal input of pbrt and Mitsuba, and its results.

use super::nearest::{png, usual, with_files, xml};
use super::{message, read};
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::load::{Loaded, Unsupported};
use opsr::scene::{Material, Projection, Scene};

/// A pbrt scene that is read without warnings.
fn silent(text: &str, files: &[(&str, Vec<u8>)]) -> Loaded {
    let loaded = with_files("a.pbrt", text, files, Unsupported::Error);
    let loaded = loaded.unwrap_or_else(|e| panic!("{text}: {e}"));
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    loaded
}

/// The material of the last mesh.
fn last(loaded: &Loaded) -> &Material {
    let mesh = loaded.parts.meshes.last().expect("a mesh");
    &loaded.parts.materials[mesh.material as usize]
}

/// Parameters of pbrt-v3 `[PBRT3 §10.4, §9.3, §12.2, §6.2]`; its shutter does not change the exposure.
#[test]
fn foreign_parameters_of_pbrt_3_are_taken() {
    let files = [("a.png", png(5, 4))];
    for (more, srgb) in [
        ("", true),
        ("\"bool gamma\" \"true\" \"bool trilinear\" \"true\"", true),
        (
            "\"bool gamma\" \"false\" \"string encoding\" \"sRGB\"",
            true,
        ),
        ("\"bool gamma\" \"false\"", false),
    ] {
        let text = format!(
            "WorldBegin\nTexture \"a\" \"color\" \"imagemap\" \"string filename\" \"a.png\" {more}\n\
             Material \"matte\" \"texture Kd\" \"a\" \"texture bumpmap\" \"a\"\nShape \"disk\""
        );
        let loaded = silent(&text, &files);
        let map = last(&loaded).base_color_texture.expect("a texture");
        assert_eq!(
            loaded.parts.textures[map.texture as usize].srgb, srgb,
            "{more}"
        );
        assert!(last(&loaded).normal_texture.is_some());
    }
    let text = "Film \"image\" \"integer xresolution\" 8 \"integer yresolution\" 8\n\
        Camera \"perspective\" \"float halffov\" 30 \"float shutterclose\" 0.25\nWorldBegin\n\
        AreaLightSource \"area\" \"rgb L\" [ 4 4 4 ] Shape \"disk\"";
    let old = silent(text, &[]);
    assert_eq!(last(&old).emission, Rgb::splat(4.0));
    let Projection::Perspective { tan_half_y } = old.parts.cameras[0].projection else {
        panic!("a perspective");
    };
    assert!((tan_half_y - 30f32.to_radians().tan()).abs() < 1e-6);
    let new = silent(&text.replace("\"image\"", "\"rgb\""), &[]);
    assert_eq!(last(&new).emission, Rgb::ONE);
}

/// Options of pbrt-v4 are names with a value, and maybe a type; unknown ones are errors.
#[test]
fn foreign_options_of_pbrt_are_known_by_name() {
    for option in [
        "\"disablepixeljitter\" true",
        "\"Disable-pixel_jitter\" [ false ]",
        "\"seed\" 5",
        "\"rendercoordsys\" \"camera\"",
        "\"bool forcediffuse\" false \"integer seed\" [ 5 ]",
    ] {
        silent(&format!("Option {option}\nWorldBegin Shape \"disk\""), &[]);
    }
    let report = |option: &str| message("a.pbrt", &format!("\nOption {option}"));
    assert!(report("\"sead\" 5").contains("line 2: `Option` has no parameter `sead`"));
    assert!(report("\"seed\"").contains("line 2: `seed` has no value"));
    let grey = usual("a.pbrt", "Option \"forcediffuse\" true\nWorldBegin");
    assert_eq!(
        grey.warnings,
        ["line 1: `forcediffuse` is not taken: materials are shown"]
    );
}

/// Coordinates by position are a mesh's second pair, in the texture's space. They are those of pbrt's book at every
/// corner and close to them in every face, without a jump at the seam `[PBRT4 §10.2]`.
#[test]
fn foreign_mappings_of_pbrt_are_coordinates_of_their_meshes() {
    use std::f32::consts::{PI, TAU};
    let plane = "planar\" \"vector3 v1\" [ 1 0 2 ] \"vector3 v2\" [ 0 -1 0 ] \"float udelta\" 0.5";
    let square = "trianglemesh\" \"point3 P\" [ -1 -1 0.5  2 -1 0  2 1 0  -1 1 0.5 ] \"integer indices\" [ 0 1 2 0 2 3 ]";
    // Both are symmetric about the plane z = 0 of the texture's space, where curved edges have exact midpoints.
    let tall = "cylinder\" \"float zmin\" -10.2 \"float zmax\" 9.8";
    let upright = "trianglemesh\" \"point3 P\" [ 1 -1 -1.2  1 1 -1.2  1 1 0.8  1 -1 0.8 ] \"integer indices\" [ 0 1 2 0 2 3 ]";
    let other = upright.replace("[ 0 1 2 0 2 3 ]", "[ 0 1 3 1 2 3 ]");
    let planar = |p: Vec3| (0.5 + p.x + 2.0 * p.z, -p.y);
    let spherical = |p: Vec3| {
        let round = p.y.atan2(p.x) / TAU;
        (
            (p.z / p.length()).acos() / PI,
            if round < 0.0 { round + 1.0 } else { round },
        )
    };
    let cylindrical = |p: Vec3| (0.5 + p.y.atan2(p.x) / TAU, p.z);
    let old = |p: Vec3| (0.5 + p.y.atan2(p.x) / TAU, p.z / p.length());
    let close = |found: Vec2, (s, t): (f32, f32), within: f32, what: &str| {
        let apart = found - Vec2::new(s, t);
        let apart = (apart - apart.round()).abs().max_element();
        assert!(apart < within, "{what}: {found} {s} {t}");
    };
    for (film, mapping, map) in [
        ("", plane, &planar as &dyn Fn(Vec3) -> (f32, f32)),
        ("", "spherical\"", &spherical),
        ("", "cylindrical\"", &cylindrical),
        ("Film \"image\"\n", "cylindrical\"", &old),
    ] {
        for shape in ["sphere\"", tall, square, upright, &other] {
            let text = format!(
                "{film}WorldBegin AttributeBegin Translate 3 0 0 Scale 2 1 1\n\
                 Texture \"a\" \"spectrum\" \"checkerboard\" \"string mapping\" \"{mapping} AttributeEnd\n\
                 Translate 3.1 0 0.2 Material \"diffuse\" \"texture reflectance\" \"a\" Shape \"{shape}"
            );
            let loaded = silent(&text, &[]);
            let map_used = last(&loaded).base_color_texture.expect("a texture");
            assert!(map_used.second && last(&loaded).finish.as_ref().expect("one").has_second_uvs);
            let mesh = &loaded.parts.meshes[0];
            let count = mesh.indices.len();
            let is_flat = shape.starts_with("trianglemesh");
            assert!(count < 20_000 || !is_flat, "{mapping} {shape} {count}");
            for face in &mesh.indices {
                let corners = face.map(|i| mesh.positions[i as usize]);
                let uvs = face.map(|i| mesh.second_uvs[i as usize]);
                // The transform to the texture's space.
                let at = |p: Vec3| (p - 3.0 * Vec3::X) / Vec3::new(2.0, 1.0, 1.0);
                let middle = at(corners.iter().sum::<Vec3>() / 3.0);
                if mapping == plane || middle.truncate().length() > 0.05 {
                    let round = usize::from(mapping.starts_with("spherical"));
                    let size = |uv: Vec2| mapping == plane || uv[round].abs() < 0.3;
                    assert!(
                        size(uvs[1] - uvs[0]) && size(uvs[2] - uvs[0]),
                        "{mapping} {uvs:?}"
                    );

                    corners
                        .iter()
                        .zip(uvs)
                        .for_each(|(&p, uv)| close(uv, map(at(p)), 1e-3, mapping));
                    close(uvs.iter().sum::<Vec2>() / 3.0, map(middle), 4e-3, mapping);
                }
            }
        }
    }
}

/// The mapping of the base colour takes precedence, and the mesh keeps its own coordinates.
#[test]
fn foreign_mappings_of_pbrt_meet_in_one_material() {
    let files = [("a.png", png(5, 4))];
    let texture = |name: &str, more: &str| {
        format!("Texture \"{name}\" \"float\" \"imagemap\" \"string filename\" \"a.png\" {more}\n")
    };
    let text = format!(
        "WorldBegin\n{}{}{}",
        texture("uv", ""),
        texture("plane", "\"string mapping\" \"planar\""),
        texture("ball", "\"string mapping\" \"spherical\"")
    );
    let scene = |more: &str| {
        with_files(
            "a.pbrt",
            &format!("{text}{more}"),
            &files,
            Unsupported::Nearest,
        )
        .expect("a scene")
    };
    let both = scene(
        "Material \"diffuse\" \"texture reflectance\" \"plane\" \"texture displacement\" \"uv\"\nShape \"disk\"",
    );
    assert!(both.warnings.is_empty(), "{:?}", both.warnings);
    let mesh = &both.parts.meshes[0];
    assert!(last(&both).normal_texture.is_some_and(|map| !map.second));
    for (p, uv) in mesh.positions.iter().zip(&mesh.second_uvs) {
        assert!(p.truncate().distance(*uv) < 1e-6);
    }
    assert!(mesh.uvs.iter().any(|uv| uv.y == 1.0));
    let two = scene(
        "Material \"diffuse\" \"texture reflectance\" \"plane\" \"texture displacement\" \"ball\"\nShape \"disk\"",
    );
    let report = "line 5: a second mapping of one surface is not supported: shown as the first";
    assert_eq!(two.warnings, [report]);
    assert_eq!(two.parts.meshes[0].second_uvs, mesh.second_uvs);
    // Bumps along x by a mapping tilt normals along x, whatever the disk's own coordinates are.
    let bumps = scene("Material \"diffuse\" \"texture displacement\" \"plane\"\nShape \"disk\"");
    assert!(last(&bumps).normal_texture.is_some_and(|map| map.second));
    let tangents = &bumps.parts.meshes[0].tangents;
    assert!(
        tangents
            .iter()
            .all(|t| t.truncate().distance(Vec3::X) < 1e-5)
    );
    let object = scene(
        "ObjectBegin \"o\"\nMaterial \"diffuse\" \"texture reflectance\" \"ball\"\nShape \"disk\" ObjectEnd\nObjectInstance \"o\"",
    );
    assert_eq!(
        object.warnings,
        ["line 7: a mapping of an object stays with it: pbrt's stays in the world"]
    );
}

/// A control mesh becomes its limit surface, with pbrt's front: the clockwise side.
#[test]
fn foreign_subdivision_of_pbrt_is_made() {
    let cube = "\"point3 P\" [ 0 0 0  1 0 0  0 1 0  1 1 0  0 0 1  1 0 1  0 1 1  1 1 1 ] \"integer indices\" \
        [ 0 2 1 1 2 3  4 5 6 5 7 6  0 1 4 1 5 4  2 6 3 3 6 7  0 4 2 2 4 6  1 3 5 3 7 5 ]";
    let volume = |more: &str| {
        let text = format!("WorldBegin Shape \"loopsubdiv\" {cube} {more}");
        let loaded = silent(&text, &[]);
        let mesh = &loaded.parts.meshes[0];
        assert_eq!(mesh.normals.len(), mesh.positions.len());
        let part = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|i| mesh.positions[i as usize]);
            a.cross(b).dot(c) / 6.0
        };
        (
            mesh.indices.len(),
            mesh.indices.iter().map(part).sum::<f32>(),
        )
    };
    let (count, three) = volume("");
    assert_eq!(count, 12 * 64);
    let (same, again) = volume("\"integer nlevels\" 3");
    assert_eq!((same, again), (count, three));
    let (count, five) = volume("\"integer levels\" 5");
    assert_eq!(count, 12 * 1024);
    // The surface is inside out, with the same volume at any level.
    assert!(
        three < 0.0 && (three / five - 1.0).abs() < 0.02,
        "{three} {five}"
    );
    let report = |more: &str| message("a.pbrt", &format!("\nShape \"loopsubdiv\" {cube} {more}"));
    assert!(report("\"integer levels\" 15").contains("line 2: a subdivision of 15 levels"));
    assert!(report("\"float levels\" 0.5").contains("line 2: a subdivision of 0.5 levels"));
    let twice = usual(
        "a.pbrt",
        &format!(
            "Shape \"loopsubdiv\" {}",
            cube.replace("[ 0 2 1 1 2 3", "[ 0 1 2 1 2 3")
        ),
    );
    assert_eq!(
        twice.warnings,
        [
            "line 1: subdivision of what is no surface of one winding is not supported: shown as its control mesh"
        ]
    );
}

/// Four colours are blended over [0, 1]², v upwards, and clamped outside; a mixture by direction becomes an even one.
#[test]
fn foreign_blends_of_pbrt_are_textures() {
    let texture = |class: &str| {
        format!(
            "WorldBegin\nTexture \"a\" \"spectrum\" {class}\nMaterial \"diffuse\" \"texture reflectance\" \"a\"\nShape \"disk\""
        )
    };
    let blend = "\"bilerp\" \"rgb v00\" [ 0 0.5 0 ] \"rgb v10\" [ 1 0.5 0 ] \"rgb v11\" [ 1 2 4 ] \"rgb v01\" [ 0 1 0 ]";
    let loaded = silent(&texture(blend), &[]);
    let (map, factor) = (
        last(&loaded).base_color_texture.expect("a texture"),
        last(&loaded).base_color,
    );
    for (u, v) in [(0.0f32, 0.0f32), (1.0, 0.0), (0.3, 0.6), (0.9, 1.0)] {
        let uv = map.transform.transform_point2(Vec2::new(u, v));
        let [r, g, b, _] = loaded.parts.textures[map.texture as usize].sample(uv);
        let expected = Rgb::new(u, 0.5 * (1.0 - v) + v * (1.0 + u), 4.0 * u * v);
        assert!(
            (factor * Rgb::new(r, g, b) - expected).abs().max_element() < 1e-3,
            "{u} {v}: {r} {g} {b}"
        );
    }
    // Heights have their slope up to the border.
    let heights = "WorldBegin Texture \"h\" \"float\" \"bilerp\" \"float v00\" 0 \"float v01\" 0 \"float v10\" 1 \"float v11\" 1 \
        Material \"diffuse\" \"texture displacement\" \"h\" Shape \"trianglemesh\" \
        \"point3 P\" [ -1 -1 0 1 -1 0 1 1 0 -1 1 0 ] \"point2 uv\" [ 0 0 1 0 1 1 0 1 ] \"integer indices\" [ 0 1 2 0 2 3 ]";
    let loaded = silent(heights, &[]);
    let map = last(&loaded).normal_texture.expect("a texture");
    for (u, v) in [(0.02, 0.5), (0.3, 0.6), (0.5, 0.98)] {
        let uv = map.transform.transform_point2(Vec2::new(u, v));
        let [x, y, z, _] = loaded.parts.textures[map.texture as usize].sample(uv);
        let n = 2.0 * Vec3::new(x, y, z) - 1.0;
        let slope = n.truncate() / n.z;
        assert!(slope.distance(Vec2::new(-0.5, 0.0)) < 0.02, "{u} {v}: {n}");
    }
    let mixed = usual(
        "a.pbrt",
        &texture("\"directionmix\" \"rgb tex1\" [ 1 0 0 ] \"vector3 dir\" [ 1 0 0 ]"),
    );
    assert_eq!(last(&mixed).base_color, Rgb::new(1.0, 0.5, 0.5));
    assert_eq!(
        mixed.warnings,
        ["line 2: texture `directionmix` is not supported: shown as an even mixture"]
    );
}

/// Presets of media are those of Jensen et al. 2001; the default is whole milk.
#[test]
fn foreign_presets_of_media_are_known() {
    let medium = |more: &str| {
        let text = format!(
            "WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"homogeneous\" {more}\n\
             MediumInterface \"m\" \"\" Material \"interface\" Shape \"sphere\""
        );
        let loaded = silent(&text, &[]);
        let medium = last(&loaded).medium.as_deref().expect("a medium");
        (medium.scattering, medium.absorption)
    };
    let ketchup = (Rgb::new(1.8, 0.7, 0.3), Rgb::new(0.61, 9.7, 14.5));
    let found = medium("\"string preset\" \"Ketchup\" \"float scale\" 10");
    assert!(
        found.0.distance(ketchup.0) < 1e-5 && found.1.distance(ketchup.1) < 1e-5,
        "{found:?}"
    );
    let milk = (Rgb::new(2.55, 3.21, 3.77), Rgb::new(0.0011, 0.0024, 0.014));
    assert_eq!(medium(""), milk);
    // Version 4 ignores coefficients next to a preset.
    let more = "\"rgb sigma_s\" [1 2 3]";
    assert_eq!(
        medium(&format!("\"string preset\" \"Wholemilk\" {more}")),
        milk
    );
    assert_eq!(medium(more), (Rgb::new(1.0, 2.0, 3.0), milk.1));
    assert_eq!(medium("\"string preset\" \"\""), milk);
    let report = message(
        "a.pbrt",
        "\nMakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"string preset\" \"Mud\"",
    );
    assert!(
        report.contains("line 2: the preset `Mud` of a medium is not supported"),
        "{report}"
    );
}

/// Values out of range are errors, or warnings if they are shown differently.
#[test]
fn foreign_values_out_of_range_are_not_let_pass() {
    let pbrt = |line: &str| format!("WorldBegin\nMaterial {line}\nShape \"disk\"");
    for (line, words) in [
        (
            "\"disney\" \"string thin\" \"true\"",
            "`thin` is neither true nor false",
        ),
        (
            "\"disney\" \"bool thin\" \"yes\"",
            "`thin` is neither true nor false",
        ),
        ("\"disney\" \"float eta\" -1", "index of refraction 0"),
        ("\"dielectric\" \"float eta\" 0", "index of refraction 0"),
    ] {
        let report = with_files("a.pbrt", &pbrt(line), &[], Unsupported::Nearest).expect_err(line);
        assert!(
            report.contains(words) && report.contains("line "),
            "{report}"
        );
    }
    for (kind, values) in [
        (
            "dielectric",
            "<float name=\"int_ior\" value=\"-1.5\"/><float name=\"ext_ior\" value=\"-1\"/>",
        ),
        ("plastic", "<float name=\"int_ior\" value=\"0\"/>"),
        (
            "dielectric",
            "<float name=\"int_ior\" value=\"1e30\"/><float name=\"ext_ior\" value=\"1e-30\"/>",
        ),
        ("thindielectric", "<string name=\"int_ior\" value=\"-1\"/>"),
        ("principled", "<float name=\"eta\" value=\"-1\"/>"),
    ] {
        let text = xml(&format!(
            "<shape type=\"sphere\"><bsdf type=\"{kind}\">{values}</bsdf></shape>"
        ));
        let report = with_files("a.xml", &text, &[], Unsupported::Nearest).expect_err(kind);
        assert!(report.contains("line 2: index of refraction "), "{report}");
    }
    let report = "line 2: reflectance and transmittance of more than 1 together are scaled down";
    let leaf = |r: f32| {
        pbrt(&format!(
            "\"diffusetransmission\" \"float reflectance\" {r} \"float transmittance\" 0.4"
        ))
    };
    assert_eq!(usual("a.pbrt", &leaf(0.7)).warnings, [report]);
    silent(&leaf(0.6), &[]);
    let paper = xml(
        "<shape type=\"sphere\"><bsdf type=\"difftrans\"><rgb name=\"transmittance\" value=\"0.5, 1.5, 0\"/></bsdf></shape>",
    );
    assert_eq!(usual("a.xml", &paper).warnings, [report]);
    let plastic = xml(
        "<shape type=\"sphere\"><bsdf type=\"pplastic\"><float name=\"alpha\" value=\"0.3\"/></bsdf></shape>",
    );
    let plastic = usual("a.xml", &plastic);
    assert_eq!(last(&plastic).alpha, 0.3);
    assert_eq!(
        plastic.warnings,
        ["line 2: bsdf `pplastic` is not supported: shown as `roughplastic`"]
    );
}

/// Materials and objects may be declared after their use; an undeclared name is an error where it is used.
#[test]
fn foreign_names_of_pbrt_may_be_declared_later() {
    let text = "WorldBegin\nAttributeBegin Translate 0 0 2 NamedMaterial \"red\" Shape \"disk\" AttributeEnd\n\
        AttributeBegin Translate 0 3 0 ObjectInstance \"ball\" AttributeEnd\nShape \"disk\"\n\
        MakeNamedMaterial \"red\" \"string type\" \"diffuse\" \"rgb reflectance\" [ 1 0 0 ]\n\
        ObjectBegin \"ball\" NamedMaterial \"red\" Shape \"sphere\" \"float radius\" 0.5 ObjectEnd";
    let parts = silent(text, &[]).parts;
    let expected = [
        (Vec3::ZERO, Rgb::splat(0.5)),
        (2.0 * Vec3::Z, Rgb::X),
        (3.0 * Vec3::Y, Rgb::X),
    ];
    assert_eq!(parts.meshes.len(), expected.len());
    for (mesh, (centre, colour)) in parts.meshes.iter().zip(expected) {
        let mean = mesh.positions.iter().sum::<Vec3>() / mesh.positions.len() as f32;
        assert!(mean.distance(centre) < 0.01, "{mean}");
        let material = &parts.materials[mesh.material as usize];
        assert_eq!(material.base_color, colour);
    }
    for (text, line) in [
        (
            text.replace("MakeNamedMaterial \"red\"", "MakeNamedMaterial \"blue\""),
            "line 2: no material `red`",
        ),
        (
            text.replace("ObjectBegin \"ball\"", "ObjectBegin \"cube\""),
            "line 3: no object `ball`",
        ),
        (
            "\nNamedMaterial \"red\"\nShape \"disk\"".into(),
            "line 2: no material `red`",
        ),
    ] {
        let report = message("a.pbrt", &text);
        assert!(report.contains(line), "{report}");
    }
}

/// Reflectance at normal incidence.
fn reflectance(material: &Material) -> Rgb {
    use opsr::scene::finish::ExactCover;
    let exact = material.finish.as_ref().and_then(|f| f.exact.as_ref());
    let Some(ExactCover::Metal { eta, k }) = exact else {
        panic!("a metal");
    };
    let of = |c: usize| opsr::bsdf::fresnel::conductor(1.0, eta[c], k[c]);
    Rgb::new(of(0), of(1), of(2))
}

/// A metal given by its reflectance has pbrt's index, also under a layer; a metal without data is bright.
#[test]
fn foreign_metals_of_pbrt_reflect_what_they_say() {
    let metal = |line: &str| {
        usual(
            "a.pbrt",
            &format!("WorldBegin\nMaterial {line}\nShape \"disk\""),
        )
    };
    let bare = metal("\"conductor\" \"rgb reflectance\" [ 0.5 0.2 0.9 ]");
    assert!(reflectance(last(&bare)).distance(Rgb::new(0.5, 0.2, 0.9)) < 1e-4);
    // k = 2 √0.5 / √0.5, and both relative to the layer's 1.5.
    let under = reflectance(last(&metal(
        "\"coatedconductor\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]",
    )));
    let same = "\"coatedconductor\" \"float conductor.eta\" 1 \"float conductor.k\" 2";
    assert!(under.distance(reflectance(last(&metal(same)))) < 1e-5);
    // ((1 − η)² + k²) / ((1 + η)² + k²)
    let (below, above) = ((1f32 / 3.0).powi(2), (5f32 / 3.0).powi(2));
    let expected = (below + 16.0 / 9.0) / (above + 16.0 / 9.0);
    assert!((under.x - expected).abs() < 1e-5, "{under} {expected}");
    for (name, other) in [("CuZn", "Cu"), ("Xx", "Al")] {
        let of = |name: &str| {
            metal(&format!(
                "\"conductor\" \"spectrum eta\" \"metal-{name}-eta\" \"spectrum k\" \"metal-{name}-k\""
            ))
        };
        let loaded = of(name);
        assert_eq!(reflectance(last(&loaded)), reflectance(last(&of(other))));
        let report =
            format!("spectrum `metal-{name}-k` is not supported: shown as `metal-{other}-k`");
        assert!(
            loaded.warnings.iter().any(|w| w.contains(&report)),
            "{:?}",
            loaded.warnings
        );
    }
    // Another spectrum may end like that of a metal.
    let other = metal("\"conductor\" \"spectrum k\" \"foo-k\"").warnings;
    let report = "spectrum `foo-k` is not supported: shown as 1 at all wavelengths";
    assert!(other.iter().any(|w| w.contains(report)), "{other:?}");
}

/// Mean radiance of a rectangle with this BSDF, which emits 1 in front of a sky of 0.5, and the warnings.
fn lamp(bsdf: &str, files: &[(&str, Vec<u8>)]) -> (f64, Vec<String>) {
    let text = xml(&format!(
        "<shape type=\"rectangle\">{bsdf}<emitter type=\"area\"><rgb name=\"radiance\" value=\"1\"/></emitter></shape>\n\
         <emitter type=\"constant\"><rgb name=\"radiance\" value=\"0.5\"/></emitter>\n\
         <sensor type=\"perspective\"><float name=\"fov\" value=\"10\"/><transform name=\"to_world\">\
         <lookat origin=\"0, 0, 5\" target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform></sensor>"
    ));
    let loaded = with_files("a.xml", &text, files, Unsupported::Error);
    let loaded = loaded.unwrap_or_else(|e| panic!("{e}"));
    let settings = opsr::integrator::Settings::default();
    let film = super::film_with(&Scene::new(loaded.parts), &settings, 16, 256);
    (super::mean(&film).0, loaded.warnings)
}

/// In Mitsuba neither `null` nor a mask dims the emitter of its shape.
#[test]
fn foreign_lamps_with_holes_emit_all_of_their_light() {
    let mask = |opacity: &str| {
        format!(
            "<bsdf type=\"mask\">{opacity}<bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0\"/></bsdf></bsdf>"
        )
    };
    let number = |x: f32| mask(&format!("<float name=\"opacity\" value=\"{x}\"/>"));
    let report = ["line 2: a lamp without a surface casts shadows of lights without area"];
    for (bsdf, expected, words) in [
        ("<bsdf type=\"null\"/>".to_owned(), 1.5, &report[..]),
        (number(0.0), 1.5, &report[..]),
        // The emission, and 0.6 of the sky.
        (number(0.4), 1.3, &[]),
        (number(1.0), 1.0, &[]),
    ] {
        let (found, warnings) = lamp(&bsdf, &[]);
        assert!((found - expected).abs() < 0.02, "{bsdf}: {found}");
        assert_eq!(warnings, words);
    }
    let map = "<texture type=\"bitmap\" name=\"opacity\"><string name=\"filename\" value=\"a.png\"/></texture>";
    let (_, warnings) = lamp(&mask(map), &[("a.png", png(5, 4))]);
    assert_eq!(
        warnings,
        ["line 2: a lamp with a map of its opacity shines where it is opaque alone"]
    );
}

/// Points of a cylinder along this axis where u is 0 and a quarter, as `uv` of Mitsuba 3.9.
#[test]
fn foreign_textures_of_cylinders_begin_where_mitsuba_has_them() {
    for (axis, zero, quarter) in [
        ([0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]),
        (
            [0.5, 0.7, -0.4],
            [0.804607, -0.273550, 0.527046],
            [0.273550, -0.617030, -0.737865],
        ),
        (
            [0.5, 0.7, 0.4],
            [0.804607, -0.273550, -0.527046],
            [-0.273550, 0.617030, -0.737865],
        ),
    ] {
        let [x, y, z]: [f32; 3] = axis;
        let text = xml(&format!(
            "<shape type=\"cylinder\"><point name=\"p0\" value=\"0, 0, 0\"/><point name=\"p1\" value=\"{x}, {y}, {z}\"/></shape>"
        ));
        let mesh = &usual("a.xml", &text).parts.meshes[0];
        for (u, normal) in [(0.0, zero), (0.25, quarter)] {
            let mut there = (0..mesh.uvs.len()).filter(|&i| mesh.uvs[i].x == u);
            assert!(there.clone().count() > 0);
            assert!(
                there.all(|i| mesh.normals[i].distance(normal.into()) < 1e-5),
                "{axis:?} {u}"
            );
        }
    }
}

/// A sensor with different scales along x and y causes a warning.
#[test]
fn foreign_sensors_of_two_scales_are_named() {
    let sensor = |x: f32| {
        let sensor = format!(
            "<sensor type=\"orthographic\"><transform name=\"to_world\"><scale x=\"{x}\" y=\"2\"/></transform>\
             <film type=\"hdrfilm\"><integer name=\"width\" value=\"8\"/><integer name=\"height\" value=\"8\"/></film></sensor>"
        );
        usual("a.xml", &xml(&sensor)).warnings
    };
    assert!(sensor(2.001).is_empty());
    assert_eq!(
        sensor(3.0),
        ["line 2: pixels that are not square is not supported: shown as square ones"]
    );
}

/// A medium of constant volumes has their values.
#[test]
fn foreign_constant_volumes_are_values() {
    let volume = |name: &str, value: &str| {
        format!("<volume type=\"constvolume\" name=\"{name}\">{value}</volume>")
    };
    let fog = |inner: String| {
        let text = xml(&format!(
            "<shape type=\"sphere\"><bsdf type=\"null\"/><medium name=\"interior\" type=\"homogeneous\">{inner}</medium></shape>"
        ));
        let parts = read("a.xml", &text, false)
            .unwrap_or_else(|e| panic!("{e}"))
            .parts;
        let medium = parts.materials[0].medium.as_deref().expect("a medium");
        (medium.absorption, medium.scattering)
    };
    let four = "<float name=\"value\" value=\"4\"/>";
    let by_albedo =
        fog(volume("sigma_t", four)
            + &volume("albedo", "<rgb name=\"value\" value=\"0.5, 0.25, 1\"/>"));
    assert_eq!(
        by_albedo,
        (Rgb::new(2.0, 3.0, 0.0), Rgb::new(2.0, 1.0, 4.0))
    );
    assert_eq!(fog(volume("sigma_s", four)), (Rgb::ZERO, Rgb::splat(4.0)));
    let grid = xml(
        "<medium type=\"homogeneous\" id=\"m\"><volume type=\"gridvolume\" name=\"albedo\"/></medium>\n\
        <shape type=\"sphere\"><ref id=\"m\" name=\"interior\"/></shape>",
    );
    assert!(
        message("a.xml", &grid)
            .contains("line 2: a volume as `albedo` of a medium is not supported")
    );
}

/// TGA images are recognised by their names; one with too few texels is an error.
#[test]
fn foreign_tga_images_are_read() {
    // 2 × 1 texels of 24 bits from the top left, blue first.
    let tga = |width: u8, texels: &[u8]| {
        let mut bytes = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, width, 0, 1, 0, 24, 0x20];
        bytes.extend(texels);
        bytes
    };
    let read = |bytes: Vec<u8>| {
        let text =
            "WorldBegin\nTexture \"a\" \"spectrum\" \"imagemap\" \"string filename\" \"a.TGA\"";
        with_files("a.pbrt", text, &[("a.TGA", bytes)], Unsupported::Error)
    };
    let loaded = read(tga(2, &[0, 0, 255, 255, 0, 0])).unwrap_or_else(|e| panic!("{e}"));
    let texture = &loaded.parts.textures[0];
    assert_eq!(texture.texel(0, 0)[..3], [1.0, 0.0, 0.0]);
    assert_eq!(texture.texel(1, 0)[..3], [0.0, 0.0, 1.0]);
    let short = read(tga(200, &[0; 6])).expect_err("an error");
    assert!(
        short.contains("line 2: a.TGA: cannot be decoded"),
        "{short}"
    );
}

/// The tint of a pane's reflection only dims the reflection.
#[test]
fn foreign_tints_of_a_panes_reflection_add_no_light_behind_it() {
    let text = xml("<emitter type=\"constant\"/>\n\
        <sensor type=\"perspective\"><float name=\"fov\" value=\"2\"/><transform name=\"to_world\">\
        <lookat origin=\"0,0,3\" target=\"0,0,0\" up=\"0,1,0\"/></transform></sensor>\n\
        <shape type=\"rectangle\"><bsdf type=\"thindielectric\"><float name=\"int_ior\" value=\"1.5\"/>\
        <float name=\"ext_ior\" value=\"1\"/><rgb name=\"specular_reflectance\" value=\"0.1, 0.5, 1\"/></bsdf></shape>");
    let scene = Scene::new(read("a.xml", &text, false).expect("a scene").parts);
    let render = opsr::Render::new(&scene).size(2, 2).spp(4096).raw();
    let picture = render.run().expect("a picture").shown.picture;
    let found = picture.pixels.iter().copied().sum::<Rgb>() / 4.0;
    // Both faces of 4 % together reflect 1/13.
    let expected = Rgb::ONE - Rgb::new(0.9, 0.5, 0.0) / 13.0;
    assert!(
        (found - expected).abs().max_element() < 2e-3,
        "{found} {expected}"
    );
}
