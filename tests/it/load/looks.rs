//! Loading rare features of materials: vertex colours, second texture coordinates, variants, sheen, films, and textures
//! of the reflectance.

use crate::support::gltf::File;
use image::{DynamicImage, RgbImage, RgbaImage};
use opsr::bsdf::Bsdf;
use opsr::math::{Ray, Rgb, Vec3};
use opsr::scene::load::{FileLight, LoadOptions, Loaded, load};
use opsr::scene::{Scene, Surface};
use serde_json::{Value, json};
use std::f32::consts::PI;

/// A triangle with a material, and a texture whose left half is black and whose right half is white and half opaque.
/// Its coordinates of set 0 are in the left half, those of set 1 in the right.
fn painted(material: Value) -> File {
    let mut file = File::triangle();
    let texels = RgbaImage::from_fn(8, 1, |x, _| match x {
        0..4 => image::Rgba([0, 0, 0, 0]),
        _ => image::Rgba([255, 255, 255, 128]),
    });
    file.texture(&DynamicImage::from(texels));
    let left = file.floats("VEC2", &[0.25; 6]);
    let right = file.floats("VEC2", &[0.75; 6]);
    file.push("materials", material);
    *file.primitive() = json!({
        "attributes": { "POSITION": 0, "TEXCOORD_0": left, "TEXCOORD_1": right }, "material": 0,
    });
    file
}

/// The surface in the middle of the triangle, and its BSDF.
fn seen(loaded: Loaded, u: f32) -> (Scene, Surface, Bsdf) {
    let scene = Scene::new(loaded.parts);
    let ray = Ray::new(Vec3::new(0.3, 0.3, 1.0), Vec3::NEG_Z);
    let hit = scene.intersect(&ray).expect("the triangle");
    let mut surface = scene.surface(&hit);
    let bsdf = scene.bsdf(&mut surface, u);
    (scene, surface, bsdf)
}

fn albedo(bsdf: &Bsdf) -> Rgb {
    match bsdf {
        Bsdf::Diffuse(l) => l.albedo,
        Bsdf::Glossy(l) => l.albedo,
        _ => panic!("{bsdf:?}"),
    }
}

#[test]
fn vertex_colours_multiply_the_base_colour_and_the_opacity() {
    let base = json!({ "baseColorFactor": [0.5, 1, 1, 0.5], "metallicFactor": 0 });
    let mut file = File::triangle();
    file.push(
        "materials",
        json!({ "pbrMetallicRoughness": base, "alphaMode": "BLEND" }),
    );
    // Red at the first corner, green at the second, blue at the third, with opacities.
    let colors = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 1.];
    let index = file.floats("VEC4", &colors);
    file.primitive()["attributes"]["COLOR_0"] = json!(index);
    file.primitive()["material"] = json!(0);
    let loaded = file.loaded();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let scene = Scene::new(loaded.parts);
    let n = 4000;
    let at = |x: f32, y: f32| {
        let rays = (0..n).map(|i| Vec3::new(x, y, 1.0 + 1e-4 * i as f32));
        let hits: Vec<_> = rays
            .filter_map(|from| scene.intersect(&Ray::new(from, Vec3::NEG_Z)))
            .collect();
        let first = hits.first().map(|hit| {
            let mut surface = scene.surface(hit);
            albedo(&scene.bsdf(&mut surface, 0.0))
        });
        (hits.len() as f32 / n as f32, first)
    };
    let (share, color) = at(0.2, 0.5);
    assert!((share - 0.25).abs() < 0.03, "{share}");
    let color = color.expect("some rays meet it");
    assert!(
        (color - Rgb::new(0.15, 0.2, 0.5)).abs().max_element() < 1e-3,
        "{color}"
    );
    // White vertex colours are dropped.
    let mut white = File::triangle();
    let index = white.floats("VEC3", &[1.0; 9]);
    white.primitive()["attributes"]["COLOR_0"] = json!(index);
    let parts = white.loaded().parts;
    assert!(parts.meshes[0].colors.is_empty() && parts.materials[0].finish.is_none());
}

#[test]
fn textures_of_one_material_take_either_set_of_coordinates() {
    let of = |base: u32, rough: u32| {
        let file = painted(json!({ "pbrMetallicRoughness": {
            "baseColorTexture": { "index": 0, "texCoord": base }, "metallicFactor": 0,
            "metallicRoughnessTexture": { "index": 0, "texCoord": rough },
        }}));
        let loaded = file.loaded();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        let (_, _, bsdf) = seen(loaded, 0.0);
        (albedo(&bsdf).x > 0.5, bsdf.alpha() > 0.5)
    };
    assert_eq!(of(0, 0), (false, false));
    assert_eq!(of(1, 0), (true, false));
    assert_eq!(of(0, 1), (false, true));
    assert_eq!(of(1, 1), (true, true));
}

#[test]
fn specular_textures_scale_the_reflectance() {
    let f0 = |extension: Value| {
        let file = painted(json!({
            "pbrMetallicRoughness": { "metallicFactor": 0 },
            "extensions": { "KHR_materials_specular": extension },
        }));
        let (_, _, bsdf) = seen(file.loaded(), 0.0);
        match bsdf {
            Bsdf::Glossy(l) => (l.f0.x, l.f90),
            _ => (0.0, 0.0),
        }
    };
    let (half, f90) = f0(json!({ "specularTexture": { "index": 0, "texCoord": 1 } }));
    let opacity = 128.0 / 255.0;
    assert!((half - 0.04 * opacity).abs() < 1e-6 && (f90 - opacity).abs() < 1e-6);
    let black = f0(json!({ "specularColorTexture": { "index": 0 } }));
    assert_eq!(black, (0.0, 1.0));
}

/// Reflectance and roughness of the archived extension: f0 is its colour, α the square of one minus the glossiness.
#[test]
fn specular_glossiness_is_read() {
    let file = painted(
        json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [0.2, 0.4, 0.6, 1], "specularFactor": [0.5, 0.25, 1],
            "glossinessFactor": 0.5, "specularGlossinessTexture": { "index": 0, "texCoord": 1 },
        }}}),
    );
    let (_, _, bsdf) = seen(file.loaded(), 0.0);
    let Bsdf::Glossy(lobe) = bsdf else {
        panic!("{bsdf:?}");
    };
    assert!(
        (lobe.f0 - Rgb::new(0.5, 0.25, 1.0)).abs().max_element() < 1e-5,
        "{lobe:?}"
    );
    assert!((lobe.albedo - Rgb::new(0.2, 0.4, 0.6)).abs().max_element() < 1e-5);
    let roughness: f32 = 1.0 - 0.5 * 128.0 / 255.0;
    assert!(
        (lobe.alpha - roughness * roughness).abs() < 1e-5,
        "{}",
        lobe.alpha
    );
}

#[test]
fn sheen_and_iridescence_are_read_with_their_textures() {
    let file = painted(json!({ "extensions": {
        "KHR_materials_sheen": {
            "sheenColorFactor": [0.5, 0.25, 0.125], "sheenRoughnessFactor": 0.5,
            "sheenColorTexture": { "index": 0, "texCoord": 1 },
            "sheenRoughnessTexture": { "index": 0, "texCoord": 1 },
        },
    }}));
    let (_, _, drawn) = seen(file.loaded(), 0.0);
    let Bsdf::Sheen(sheen) = drawn else {
        panic!("{drawn:?}");
    };
    let roughness: f32 = 0.5 * 128.0 / 255.0;
    assert!((sheen.alpha - roughness * roughness).abs() < 1e-6);
    // The colour is divided by the probability of 0.3 times its largest channel.
    assert!(
        (sheen.color - Rgb::new(0.5, 0.25, 0.125) / 0.15)
            .abs()
            .max_element()
            < 1e-4
    );
    let file = painted(json!({ "extensions": { "KHR_materials_iridescence": {
        "iridescenceFactor": 1, "iridescenceThicknessMinimum": 200, "iridescenceThicknessMaximum": 600,
        "iridescenceThicknessTexture": { "index": 0, "texCoord": 1 },
    }}}));
    let loaded = file.loaded();
    let film = loaded.parts.materials[0]
        .finish
        .clone()
        .and_then(|f| f.film);
    let film = film.expect("a film");
    assert_eq!(
        (film.weight, film.ior, film.thickness),
        (1.0, 1.3, [200.0, 600.0])
    );
    let (_, _, bsdf) = seen(loaded, 0.0);
    assert!(matches!(bsdf, Bsdf::Iridescent(_)), "{bsdf:?}");
}

#[test]
fn diffuse_transmission_is_read_with_its_textures() {
    // A base of this colour: Lambertian, unless the metalness adds a metal lobe.
    let of = |metallic: f32, extension: Value, others: Value| {
        let mut material = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 1, 1], "metallicFactor": metallic },
            "extensions": others,
        });
        material["extensions"]["KHR_materials_specular"] = json!({ "specularFactor": 0 });
        material["extensions"]["KHR_materials_diffuse_transmission"] = extension;
        painted(material).loaded()
    };
    // Reflectance and transmittance, straight back and straight through.
    let shown = |loaded: Loaded| {
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        let (_, _, bsdf) = seen(loaded, 0.0);
        [Vec3::Z, Vec3::NEG_Z].map(|wi| bsdf.eval(1.0, Vec3::Z, wi).value * PI)
    };
    let near = |[a, b]: [Rgb; 2], [c, d]: [Rgb; 2]| {
        let far = (a - c).abs().max((b - d).abs()).max_element();
        assert!(far < 1e-5, "{a} {c}, {b} {d}");
    };
    let base = Rgb::new(0.5, 0.25, 1.0);
    let color = [0.25, 0.5, 0.75];
    near(shown(of(0.0, json!({}), json!({}))), [base, Rgb::ZERO]);
    let quarter = json!({ "diffuseTransmissionFactor": 0.25 });
    near(
        shown(of(0.0, quarter, json!({}))),
        [0.75 * base, Rgb::splat(0.25)],
    );
    let all = |set: u32| {
        json!({
            "diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": color,
            "diffuseTransmissionTexture": { "index": 0, "texCoord": 1 },
            "diffuseTransmissionColorTexture": { "index": 0, "texCoord": set },
        })
    };
    let weight = 0.5 * 128.0 / 255.0;
    let through = weight * Rgb::from_array(color);
    near(
        shown(of(0.0, all(1), json!({}))),
        [(1.0 - weight) * base, through],
    );
    // The left half of the texture is black.
    near(
        shown(of(0.0, all(0), json!({}))),
        [(1.0 - weight) * base, Rgb::ZERO],
    );
    assert_eq!(shown(of(1.0, all(1), json!({})))[1], Rgb::ZERO);
    // In a body it applies as in a sheet if the surface transmits nothing else; in glass it is ignored.
    let volume = |transmission: f32| {
        json!({
            "KHR_materials_volume": { "thicknessFactor": 1 },
            "KHR_materials_transmission": { "transmissionFactor": transmission },
        })
    };
    let (sheet, glass) = (of(0.0, all(1), volume(0.0)), of(0.0, all(1), volume(0.5)));
    let message = "diffuse transmission is that of a thin sheet";
    assert!(sheet.warnings.iter().any(|w| w.contains(message)));
    assert!(sheet.parts.materials[0].translucency().is_some());
    let message = "diffuse transmission of glass is left out";
    assert!(glass.warnings.iter().any(|w| w.contains(message)));
    assert!(glass.parts.materials[0].translucency().is_none());
    let wrong = json!({ "diffuseTransmissionFactor": 2 });
    let file = painted(json!({ "extensions": { "KHR_materials_diffuse_transmission": wrong }}));
    let message = file.load().map(|_| ()).unwrap_err().to_string();
    assert!(
        message.contains("diffuseTransmissionFactor is 2"),
        "{message}"
    );
}

fn load_variant(file: &File, variant: Option<&str>) -> Result<Loaded, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, file.gltf()).expect("a file");
    let options = LoadOptions {
        variant: variant.map(Into::into),
        ..LoadOptions::default()
    };
    load(&path, &options).map_err(|e| e.to_string())
}

#[test]
fn variants_choose_materials_by_name_or_number() {
    let mut file = File::triangle();
    for name in ["own", "red", "blue"] {
        file.push("materials", json!({ "name": name }));
    }
    file.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    file.json["extensions"] = json!({ "KHR_materials_variants": { "variants": [{ "name": "day" }, { "name": "night" }] } });
    let mappings = json!([{ "material": 1, "variants": [0] }, { "material": 2, "variants": [1] }]);
    file.primitive()["material"] = json!(0);
    file.primitive()["extensions"] = json!({ "KHR_materials_variants": { "mappings": mappings } });
    let shown = |variant| {
        let loaded = load_variant(&file, variant)?;
        let parts = loaded.parts;
        Ok(parts.materials[parts.meshes[0].material as usize]
            .name
            .clone())
    };
    let good = |variant| -> Result<String, String> { shown(variant) };
    assert_eq!(good(None).as_deref(), Ok("own"));
    assert_eq!(good(Some("day")).as_deref(), Ok("red"));
    assert_eq!(good(Some("1")).as_deref(), Ok("blue"));
    let refused = good(Some("dusk")).expect_err("no such variant");
    assert!(
        refused.contains("there is no `dusk`: the file has day, night"),
        "{refused}"
    );
}

#[test]
fn materials_with_the_same_trouble_share_a_warning() {
    let mut file = File::triangle();
    let picture = RgbImage::from_pixel(1, 1, image::Rgb([9, 9, 9]));
    file.texture(&DynamicImage::from(picture));
    let info = |set: u32| json!({ "index": 0, "texCoord": set });
    for name in ["a", "b", "c", "d"] {
        file.push("materials", json!({
            "name": name, "emissiveTexture": info(2),
            "pbrMetallicRoughness": { "baseColorTexture": info(0), "metallicRoughnessTexture": info(1) },
        }));
    }
    let warnings = file.loaded().warnings;
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0].starts_with("4 textures: a third TEXCOORD set"),
        "{warnings:?}"
    );
}

/// Solid glass from a modelling program tints light twice, so the base colour is the square of the tint.
#[test]
fn bodies_of_solid_glass_tint_by_the_root_of_the_base_colour() {
    use opsr_lab::gallery::glb;
    use opsr_lab::gallery::shapes;
    let mut parts = opsr::scene::SceneParts::default();
    parts.add(Default::default(), [shapes::sphere(Vec3::ZERO, 1.0, 4)]);
    let mut file = File::from_glb(&glb::to_glb(&parts).expect("a scene"));
    file.json["materials"] = json!([{
        "pbrMetallicRoughness": { "baseColorFactor": [0.25, 0.64, 1, 1], "metallicFactor": 0 },
        "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1 } },
    }]);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, file.gltf()).expect("a file");
    let options = LoadOptions {
        solid_glass: Some(true),
        ..LoadOptions::default()
    };
    let scene = Scene::new(load(&path, &options).expect("a scene").parts);
    let hit = scene
        .intersect(&Ray::new(Vec3::Z * 3.0, Vec3::NEG_Z))
        .expect("the ball");
    let mut surface = scene.surface(&hit);
    let Bsdf::Dielectric(glass) = scene.bsdf(&mut surface, 0.0) else {
        panic!("a body");
    };
    assert!((glass.tint - Rgb::new(0.5, 0.8, 1.0)).abs().max_element() < 1e-6);
}

/// Closed glass from Blender is a body unless the user chooses thin; other closed glass is a thin wall unless solid.
#[test]
fn closed_glass_of_blender_is_a_body() {
    use opsr_lab::gallery::glb;
    use opsr_lab::gallery::shapes;
    let mut parts = opsr::scene::SceneParts::default();
    parts.add(Default::default(), [shapes::sphere(Vec3::ZERO, 1.0, 4)]);
    let mut file = File::from_glb(&glb::to_glb(&parts).expect("a scene"));
    let glass = json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } });
    file.json["materials"] = json!([{ "name": "glass", "extensions": glass }]);
    let mut load = |generator: &str, solid_glass| {
        file.json["asset"]["generator"] = json!(generator);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.gltf");
        std::fs::write(&path, file.gltf()).expect("a file");
        let options = LoadOptions {
            solid_glass,
            ..LoadOptions::default()
        };
        let loaded = opsr::scene::load::load(&path, &options).expect("a scene");
        let m = &loaded.parts.materials[0];
        assert_eq!(m.solid, m.root_tint);
        (m.solid, loaded.warnings.len())
    };
    let blender = "Khronos glTF Blender I/O v4.5.51";
    assert_eq!(load(blender, None), (true, 1));
    assert_eq!(load(blender, Some(true)), (true, 0));
    assert_eq!(load(blender, Some(false)), (false, 0));
    assert_eq!(load("other", None), (false, 1));
    assert_eq!(load("other", Some(true)), (true, 0));
}

/// Decoration does not light a scene; lamps do.
#[test]
fn files_are_lit_by_lamps_alone() {
    let lit = |material: Value| {
        let mut file = File::triangle();
        let picture = RgbImage::from_pixel(1, 1, image::Rgb([200, 200, 200]));
        file.texture(&DynamicImage::from(picture));
        file.push("materials", material);
        file.primitive()["material"] = json!(0);
        file.loaded().light == FileLight::Surfaces
    };
    assert!(!lit(json!({})));
    assert!(lit(json!({ "emissiveFactor": [1, 1, 1] })));
    assert!(lit(
        json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": 0 } })
    ));
    assert!(!lit(json!({ "extensions": { "KHR_materials_unlit": {} } })));
}
