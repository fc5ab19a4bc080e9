//! Loading materials, textures, lights and cameras.

use super::broken::refused;
use super::close;
use crate::support::gltf::{File, load_in};
use glam::Vec2;
use image::{DynamicImage, RgbImage, RgbaImage};
use opsr::math::{Rgb, Vec3};
use opsr::scene::load::LoadOptions;
use opsr::scene::{AlphaMode, Material, Mesh, Projection, PunctualLight, SceneParts, Texels, Wrap};
use opsr_lab::gallery::glb;
use opsr_lab::gallery::materials;
use opsr_lab::gallery::shapes;
use serde_json::{Value, json};

/// The material loaded from a description.
fn material(value: Value) -> Material {
    let mut file = File::triangle();
    file.push("materials", value);
    file.primitive()["material"] = json!(0);
    file.loaded().parts.materials.remove(0)
}

fn with(extension: &str, body: Value) -> Material {
    let key = format!("KHR_materials_{extension}");
    material(json!({ "extensions": { key: body } }))
}

#[test]
fn load_material_factors() {
    let m = material(json!({
        "name": "steel",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25, "roughnessFactor": 0.3,
        },
        "emissiveFactor": [0.5, 0, 1], "doubleSided": true, "alphaMode": "BLEND",
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8 } },
    }));
    assert_eq!(m.name, "steel");
    assert_eq!((m.base_color, m.opacity), (Rgb::new(0.1, 0.2, 0.3), 0.4));
    // Perceptual roughness 0.3 is α = 0.09.
    assert!(m.metallic == 0.25 && (m.alpha - 0.09).abs() < 1e-7);
    assert_eq!(m.emission, Rgb::new(4.0, 0.0, 8.0));
    assert!(m.double_sided && m.alpha_mode == AlphaMode::Blend);
    let plain = material(json!({}));
    assert!(!plain.double_sided && plain.alpha_mode == AlphaMode::Opaque);
    assert_eq!((plain.metallic, plain.alpha, plain.ior), (1.0, 1.0, 1.5));
    let masked = material(json!({ "alphaMode": "MASK" }));
    assert_eq!(masked.alpha_mode, AlphaMode::Mask(0.5));
    let masked = material(json!({ "alphaMode": "MASK", "alphaCutoff": 0.25 }));
    assert_eq!(masked.alpha_mode, AlphaMode::Mask(0.25));
}

#[test]
fn load_clearcoat() {
    let coat = |body: Value| with("clearcoat", body);
    let m = coat(json!({ "clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.2 }));
    let read = m.clearcoat().expect("a coat");
    assert!(read.weight == 0.5 && (read.alpha - 0.04).abs() < 1e-7);
    let m = coat(json!({}));
    assert!(m.clearcoat().is_none());
    for (body, fragment) in [
        (
            json!({ "clearcoatFactor": 2 }),
            "clearcoatFactor is 2, not from 0 to 1",
        ),
        (
            json!({ "clearcoatRoughnessFactor": -1 }),
            "clearcoatRoughnessFactor is -1, not from 0 to 1",
        ),
        (
            json!({ "clearcoatFactor": "much" }),
            "KHR_materials_clearcoat",
        ),
        (json!({ "clearcoatTexture": { "index": 7 } }), "textures"),
    ] {
        let mut file = File::triangle();
        let extensions = json!({ "KHR_materials_clearcoat": body });
        file.push("materials", json!({ "extensions": extensions }));
        refused(&file.gltf(), fragment, fragment);
    }
    let body =
        json!({ "clearcoatFactor": 1, "clearcoatNormalTexture": { "index": 0, "scale": 0.5 } });
    let mut file = File::triangle();
    file.texture(&DynamicImage::ImageRgb8(RgbImage::new(1, 1)));
    file.push(
        "materials",
        json!({ "extensions": { "KHR_materials_clearcoat": body } }),
    );
    let materials = file.loaded().parts.materials;
    let coat = materials[0].clearcoat().expect("a coat");
    assert!(coat.normal_texture.is_some() && coat.normal_scale == 0.5);
}

#[test]
fn load_anisotropy() {
    let brushed = |body: Value| with("anisotropy", body);
    let m = brushed(json!({ "anisotropyStrength": 0.6, "anisotropyRotation": -2.5 }));
    let read = m.anisotropy().expect("brushed");
    assert_eq!((read.strength, read.rotation), (0.6, -2.5));
    assert!(read.texture.is_none());
    assert!(brushed(json!({ "anisotropyRotation": 1 })).finish.is_none());
    for (body, fragment) in [
        (
            json!({ "anisotropyStrength": 1.5 }),
            "anisotropyStrength is 1.5, not from 0 to 1",
        ),
        (
            json!({ "anisotropyStrength": "much" }),
            "KHR_materials_anisotropy",
        ),
        (
            json!({ "anisotropyStrength": 1, "anisotropyTexture": { "index": 7 } }),
            "textures",
        ),
    ] {
        let mut file = File::triangle();
        let extensions = json!({ "KHR_materials_anisotropy": body });
        file.push("materials", json!({ "extensions": extensions }));
        refused(&file.gltf(), fragment, fragment);
    }
}

#[test]
fn textures_without_coordinates_get_a_warning() {
    let mut file = File::triangle();
    file.texture(&DynamicImage::ImageRgb8(RgbImage::new(1, 1)));
    let pbr = json!({ "baseColorTexture": { "index": 0 } });
    file.push("materials", json!({ "pbrMetallicRoughness": pbr }));
    file.primitive()["material"] = json!(0);
    let warnings = file.loaded().warnings;
    let message = |w: &String| w.contains("no TEXCOORD_0: textures show the texel");
    assert!(warnings.iter().any(message), "{warnings:?}");
}

/// A closed ball and an open pane of a material without the thickness extension, and of one with a thickness of 0.
#[test]
fn load_closed_transmission_without_thickness() {
    let message = |body: Value| {
        let mut extensions = json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } });
        if !body.is_null() {
            extensions["KHR_materials_volume"] = body;
        }
        json!({ "name": "glass", "extensions": extensions })
    };
    let file = |body: Value, pane: bool| {
        let mut parts = SceneParts::default();
        let ball = shapes::sphere(Vec3::ZERO, 1.0, 4);
        let sheet = shapes::quad(Vec3::splat(2.0), Vec3::X, Vec3::Y);
        parts.add(Material::default(), [ball]);
        if pane {
            parts.meshes.push(sheet);
        }
        let mut file = File::from_glb(&glb::to_glb(&parts).expect("a scene"));
        file.json["materials"] = json!([message(body)]);
        file
    };
    let load = |file: &File, solid_glass: bool| {
        let options = LoadOptions {
            solid_glass: solid_glass.then_some(true),
            ..LoadOptions::default()
        };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.gltf");
        std::fs::write(&path, file.gltf()).expect("a file");
        let loaded = opsr::scene::load::load(&path, &options).expect("a scene");
        let parts = &loaded.parts;
        let solid = |mesh: &Mesh| parts.materials[mesh.material as usize].solid;
        let solid: Vec<bool> = parts.meshes.iter().map(solid).collect();
        (solid, loaded.warnings.len(), parts.materials.len())
    };
    let glass = file(Value::Null, true);
    assert_eq!(load(&glass, false), (vec![false, false], 1, 1));
    assert_eq!(load(&glass, true), (vec![true, false], 0, 2));
    assert_eq!(load(&file(Value::Null, false), true), (vec![true], 0, 1));
    let thin = file(json!({ "thicknessFactor": 0 }), true);
    assert_eq!(load(&thin, true), (vec![false, false], 0, 1));
}

#[test]
fn load_warns_of_emission_whose_variance_does_not_fit() {
    for (strength, warned) in [(1e15, false), (1e38, true)] {
        let mut file = File::triangle();
        file.push("materials", json!({
            "name": "lamp", "emissiveFactor": [1, 1, 1],
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": strength } },
        }));
        file.primitive()["material"] = json!(0);
        let warnings = file.loaded().warnings;
        let named = |w: &String| w.contains("materials[0] (`lamp`)") && w.contains("1e38");
        assert_eq!(warnings.iter().any(named), warned, "{warnings:?}");
    }
}

#[test]
fn load_priority_of_a_body_from_extras() {
    for (extras, expected, warned) in [
        (json!({ "priority": 2 }), 2.0, false),
        (json!({ "priority": -0.5, "other": [1] }), -0.5, false),
        (json!({ "other": 3 }), 0.0, false),
        (json!("text"), 0.0, false),
        (json!({ "priority": "high" }), 0.0, true),
    ] {
        let mut file = File::triangle();
        file.push("materials", json!({ "extras": extras }));
        file.primitive()["material"] = json!(0);
        let loaded = file.loaded();
        assert_eq!(loaded.parts.materials[0].priority, expected, "{extras}");
        let says = |w: &String| w.contains("extras.priority");
        assert_eq!(loaded.warnings.iter().any(says), warned, "{extras}");
    }
}

#[test]
fn load_transmission_and_volume() {
    let thin = with("transmission", json!({ "transmissionFactor": 0.75 }));
    assert!(thin.transmission == 0.75 && !thin.solid && thin.absorption == Rgb::ZERO);
    assert!(!with("volume", json!({ "attenuationDistance": 1 })).solid);
    let body = json!({
        "thicknessFactor": 0.1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0],
    });
    let solid = with("volume", body);
    assert!(solid.solid && solid.absorption.x == 0.0 && solid.absorption.z.is_finite());
    // After two units half of the green and none of the blue remain.
    let left = (-2.0 * solid.absorption).exp();
    assert!((left.y - 0.5).abs() < 1e-6 && left.z < 1e-30);
    assert_eq!(
        with("volume", json!({ "thicknessFactor": 1 })).absorption,
        Rgb::ZERO
    );
    assert_eq!(with("ior", json!({ "ior": 1.33 })).ior, 1.33);
    // Index 0 stands for an infinite one, which reflects everything.
    let mirror = material(json!({ "extensions": {
        "KHR_materials_ior": { "ior": 0 },
        "KHR_materials_transmission": { "transmissionFactor": 1 },
    }}));
    assert_eq!((mirror.ior, mirror.transmission), (0.0, 0.0));
}

#[test]
fn load_specular_and_unlit() {
    let m = with(
        "specular",
        json!({ "specularFactor": 0.5, "specularColorFactor": [1, 0.5, 2] }),
    );
    let of = |m: &opsr::scene::Material| (m.specular, m.specular_color);
    assert_eq!(of(&m), (0.5, Rgb::new(1.0, 0.5, 2.0)));
    let m = material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 1] },
        "extensions": { "KHR_materials_unlit": {} },
    }));
    assert_eq!(
        (m.emission, m.base_color),
        (Rgb::new(0.1, 0.2, 0.3), Rgb::ZERO)
    );
    // Single-sided materials are invisible from behind, as unlit hulls that draw outlines require.
    assert!(m.is_lambert() && m.unlit && !m.double_sided);
}

/// A square of 2 x 2 texels: red and green above, blue and white below.
fn quarters() -> DynamicImage {
    let texels = vec![255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    RgbImage::from_raw(2, 2, texels).expect("2 x 2").into()
}

#[test]
fn load_textures_by_use_and_sampler() {
    let mut file = File::triangle();
    file.texture(&quarters());
    file.json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }]);
    file.push("textures", json!({ "source": 0, "sampler": 0 }));
    let info = |i: u32| json!({ "index": i });
    file.push("materials", json!({
        "pbrMetallicRoughness": { "baseColorTexture": info(0), "metallicRoughnessTexture": info(0) },
        "emissiveTexture": info(0), "emissiveFactor": [1, 1, 1],
        "normalTexture": { "index": 1, "scale": 0.5 },
        "extensions": { "KHR_materials_transmission": { "transmissionTexture": info(1) } },
    }));
    let loaded = file.loaded();
    let parts = &loaded.parts;
    let m = &parts.materials[0];
    let of = |t: &Option<opsr::scene::TextureRef>| {
        let index = t.as_ref().expect("a texture").texture;
        (index, &parts.textures[index as usize])
    };
    let (base, colour) = of(&m.base_color_texture);
    let (rough, data) = of(&m.metallic_roughness_texture);
    let (bumps, normal) = of(&m.normal_texture);
    assert!(colour.srgb && !data.srgb && !normal.srgb);
    assert_eq!(of(&m.emissive_texture).0, base);
    assert_eq!(of(&m.transmission_texture).0, bumps);
    assert!(base != rough && rough != bumps && parts.textures.len() == 3);
    assert_eq!(data.wrap, [Wrap::Repeat; 2]);
    assert_eq!(normal.wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(m.normal_scale, 0.5);
    let expected = Texels::Byte(quarters().as_bytes().into());
    assert!(
        (parts.textures.iter())
            .all(|t| t.texels == expected && (t.width, t.height, t.channels) == (2, 2, 3))
    );
    assert!(normal.nearest && !data.nearest);
}

#[test]
fn load_image_pixel_formats() {
    let alpha = RgbaImage::from_pixel(1, 1, image::Rgba([10, 20, 30, 40]));
    let bytes = |codes: &[u8]| Texels::Byte(codes.into());
    let words = |codes: &[u16]| Texels::Word(codes.into());
    let wide = image::ImageBuffer::from_pixel(1, 1, image::Rgb([0x8081u16, 0, 0xffff]));
    let wide_grey = image::ImageBuffer::from_pixel(1, 1, image::LumaA([300u16, 60_000]));
    let grey = image::GrayImage::from_pixel(1, 1, image::Luma([7]));
    let pictures: [(DynamicImage, u8, Texels); 4] = [
        (alpha.into(), 4, bytes(&[10, 20, 30, 40])),
        (grey.into(), 1, bytes(&[7])),
        (wide.into(), 3, words(&[0x8081, 0, 0xffff])),
        (wide_grey.into(), 2, words(&[300, 60_000])),
    ];
    for (picture, channels, texels) in pictures {
        let mut file = File::triangle();
        file.texture(&picture);
        file.push("materials", json!({ "emissiveTexture": { "index": 0 } }));
        let texture = &file.loaded().parts.textures[0];
        assert_eq!(texture.channels, channels);
        assert_eq!(texture.texels, texels);
    }
    // A JPEG is read by its content, not by the MIME type of the file.
    let mut out = std::io::Cursor::new(Vec::new());
    let grey = RgbImage::from_pixel(8, 8, image::Rgb([128; 3]));
    grey.write_to(&mut out, image::ImageFormat::Jpeg)
        .expect("a JPEG");
    let mut file = File::triangle();
    let view = file.view(&out.into_inner());
    file.push(
        "images",
        json!({ "bufferView": view, "mimeType": "image/png" }),
    );
    file.push("textures", json!({ "source": 0 }));
    file.push("materials", json!({ "emissiveTexture": { "index": 0 } }));
    let texel = file.loaded().parts.textures[0].sample(opsr::math::Vec2::ZERO);
    // IEC 61966-2-1: code 128 is 0.2159.
    assert!(
        (texel.iter().take(3)).all(|c| (c - 0.2159).abs() < 0.01),
        "{texel:?}"
    );
}

#[test]
fn load_texture_transforms() {
    let mut file = File::triangle();
    file.texture(&quarters());
    let quarter_turn = json!({ "rotation": std::f32::consts::FRAC_PI_2 });
    let all =
        json!({ "offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3] });
    let info = |t: &Value| json!({ "index": 0, "extensions": { "KHR_texture_transform": t } });
    file.push("materials", json!({
        "pbrMetallicRoughness": { "baseColorTexture": info(&quarter_turn), "metallicRoughnessTexture": info(&all) },
        "normalTexture": info(&all),
    }));
    let m = &file.loaded().parts.materials[0];
    let at = |t: &Option<opsr::scene::TextureRef>, u: f32, v: f32| {
        let map = t.as_ref().expect("a texture").transform;
        map.transform_point2(Vec2::new(u, v))
    };
    // Counter-clockwise in the picture, with v downward: right becomes up.
    let turned = at(&m.base_color_texture, 1.0, 0.0);
    assert!((turned - Vec2::new(0.0, -1.0)).length() < 1e-6, "{turned}");
    // Scale first, then rotation, then translation.
    for texture in [&m.metallic_roughness_texture, &m.normal_texture] {
        let moved = at(texture, 1.0, 1.0);
        assert!((moved - Vec2::new(3.5, -1.75)).length() < 1e-6, "{moved}");
    }
}

#[test]
fn load_texture_coordinate_sets() {
    let build = |texture: Value| {
        let mut file = File::triangle();
        file.texture(&quarters());
        let zero = file.floats("VEC2", &[0.0; 6]);
        let one = file.floats("VEC2", &[1.0; 6]);
        file.primitive()["attributes"]["TEXCOORD_0"] = json!(zero);
        file.primitive()["attributes"]["TEXCOORD_1"] = json!(one);
        file.primitive()["material"] = json!(0);
        let mr = json!({ "index": 0 });
        file.push(
            "materials",
            json!({ "pbrMetallicRoughness": { "baseColorTexture": texture } }),
        );
        file.push(
            "materials",
            json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": mr } }),
        );
        let loaded = file.loaded();
        assert!(loaded.warnings.is_empty());
        loaded.parts.meshes[0].uvs[2]
    };
    assert_eq!(build(json!({ "index": 0 })), Vec2::ZERO);
    assert_eq!(build(json!({ "index": 0, "texCoord": 1 })), Vec2::ONE);
    let over = json!({ "KHR_texture_transform": { "texCoord": 1 } });
    assert_eq!(build(json!({ "index": 0, "extensions": over })), Vec2::ONE);
}

#[test]
fn load_punctual_lights() {
    let mut file = File::new();
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "point", "intensity": 3, "color": [1, 0.5, 0], "range": 7 },
        { "type": "spot", "spot": {} },
        { "type": "directional", "intensity": 2 },
    ]}});
    let h = 0.5f64.sqrt();
    for i in 0..3 {
        // Rotated by 90° about x: -z becomes y.
        file.push(
            "nodes",
            json!({
                "translation": [1, 2, 3], "rotation": [h, 0, 0, h], "scale": [2, 2, -2],
                "extensions": { "KHR_lights_punctual": { "light": i } },
            }),
        );
    }
    let lights = file.loaded().parts.lights;
    let at = Vec3::new(1.0, 2.0, 3.0);
    assert!(
        matches!(lights[0], PunctualLight::Point { position, intensity, range }
        if position == at && intensity == Rgb::new(3.0, 1.5, 0.0) && range == 7.0)
    );
    // A mirrored node reverses its light: the direction is its own -z.
    assert!(
        matches!(lights[1], PunctualLight::Spot { position, direction, intensity, range, cos_inner, cos_outer, .. }
        if position == at && close(direction, Vec3::NEG_Y) && intensity == Rgb::ONE && range.is_infinite()
        && cos_inner == 1.0 && (cos_outer - h as f32).abs() < 1e-6)
    );
    assert!(
        matches!(lights[2], PunctualLight::Directional { direction, irradiance }
        if close(direction, Vec3::NEG_Y) && irradiance == Rgb::splat(2.0))
    );
}

#[test]
fn load_cameras() {
    let mut file = File::triangle();
    let lens = json!({ "yfov": 1.2, "znear": 0.1, "aspectRatio": 1.5 });
    let flat = json!({ "xmag": 3, "ymag": 2, "znear": 0, "zfar": 9 });
    file.json["cameras"] = json!([
        { "name": "plan", "type": "orthographic", "orthographic": flat },
        { "type": "perspective", "perspective": lens },
        { "name": "unused", "type": "perspective", "perspective": lens },
    ]);
    let h = 0.5f64.sqrt();
    file.json["nodes"] = json!([
        { "camera": 1, "translation": [1, 2, 3], "rotation": [0, h, 0, h], "scale": [2, 5, 3] },
        { "camera": 0, "scale": [-1, 1, 1] },
        { "camera": 1, "name": "second" },
        { "mesh": 0 },
    ]);
    let cameras = file.loaded().parts.cameras;
    let names: Vec<&str> = cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["plan", "camera 1", "second"]);
    let ray = cameras[0].ray(Vec2::new(1.0, 0.0), 1.5);
    assert!(close(ray.dir, Vec3::NEG_Z) && close(ray.origin, Vec3::new(3.0, 2.0, 0.0)));
    assert_eq!(cameras[0].aspect, Some(1.5));
    // Negative magnifications mirror the picture.
    for (x, y) in [(-3, 2), (3, -2), (-3, -2)] {
        file.json["cameras"][0]["orthographic"]["xmag"] = json!(x);
        file.json["cameras"][0]["orthographic"]["ymag"] = json!(y);
        let mirrored = &file.loaded().parts.cameras[0];
        let ray = mirrored.ray(Vec2::new(1.0, 0.0), 1.5);
        let origin = Vec3::new(x as f32, y as f32, 0.0);
        assert!(
            close(ray.dir, Vec3::NEG_Z) && close(ray.origin, origin),
            "{ray:?}"
        );
        assert_eq!(mirrored.aspect, Some(1.5));
        // A written file has the same magnifications.
        let written = glb::to_glb(&file.loaded().parts).expect("a small file");
        let parts = File::from_glb(&written).loaded().parts;
        let again = parts.cameras.iter().find(|camera| camera.name == "plan");
        let ray = again.expect("a camera").ray(Vec2::new(1.0, 0.0), 1.5);
        assert!(close(ray.origin, origin), "{ray:?}");
    }
    let turned = &cameras[1];
    assert!(
        matches!(turned.projection, Projection::Perspective { tan_half_y }
        if (tan_half_y - 0.6f32.tan()).abs() < 1e-6)
    );
    let ray = turned.ray(Vec2::new(0.5, 0.5), 1.0);
    assert!(close(ray.origin, Vec3::new(1.0, 2.0, 3.0)) && close(ray.dir, Vec3::NEG_X));
    // To the right of the view direction -x is -z.
    let right = turned.ray(Vec2::new(1.0, 0.5), 1.0).dir;
    assert!(right.z < -0.5 && right.y.abs() < 1e-6);
}

/// A name with a bare `%` is not percent-encoded: it is used literally.
#[test]
fn load_images_with_a_bare_percent_in_their_name() {
    let folder = tempfile::tempdir().unwrap();
    let red = image::RgbImage::from_pixel(2, 2, image::Rgb([255, 0, 0]));
    red.save(folder.path().join("10%.png")).unwrap();
    let mut file = File::triangle();
    file.push("images", json!({ "uri": "10%.png" }));
    file.push("textures", json!({ "source": 0 }));
    let base = json!({ "baseColorTexture": { "index": 0 } });
    file.push("materials", json!({ "pbrMetallicRoughness": base }));
    let uv = file.floats("VEC2", &[0.0; 6]);
    file.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
    file.primitive()["material"] = json!(0);
    let parts = load_in(folder.path(), "s.gltf", &file.gltf())
        .unwrap()
        .parts;
    assert_eq!(parts.textures[0].texel(1, 1), [1.0, 0.0, 0.0, 1.0]);
}

/// Texels of the filter NEAREST have sharp edges at any size, also if another texture filters the same image linearly.
#[test]
fn load_textures_of_the_nearest_texel() {
    let mut file = File::triangle();
    let checkers = image::GrayImage::from_fn(2, 2, |x, y| image::Luma([255 * ((x + y) % 2) as u8]));
    file.texture(&checkers.into());
    file.json["samplers"] = json!([{ "magFilter": 9728 }, { "magFilter": 9729 }]);
    file.json["textures"] = json!([{ "source": 0, "sampler": 0 }, { "source": 0, "sampler": 1 }]);
    for index in [0, 1] {
        let base = json!({ "baseColorTexture": { "index": index } });
        file.push("materials", json!({ "pbrMetallicRoughness": base }));
    }
    let uv = file.floats("VEC2", &[0.0; 6]);
    file.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
    let mut other = file.primitive().clone();
    other["material"] = json!(1);
    file.primitive()["material"] = json!(0);
    let list = file.json["meshes"][0]["primitives"].as_array_mut().unwrap();
    list.push(other);
    let loaded = file.loaded();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let of = |material: usize, x: f32, y: f32| {
        let map = loaded.parts.materials[material].base_color_texture.unwrap();
        loaded.parts.textures[map.texture as usize].sample(Vec2::new(x, y))[0]
    };
    for (x, y, expected) in [
        (0.01, 0.01, 0.0),
        (0.49, 0.01, 0.0),
        (0.51, 0.01, 1.0),
        (0.99, 0.49, 1.0),
        (0.49, 0.51, 1.0),
        (1.01, 0.99, 1.0),
        (-0.01, 0.99, 0.0),
    ] {
        assert_eq!(of(0, x, y), expected, "{x} {y}");
    }
    assert!((of(1, 0.5, 0.25) - 0.5).abs() < 1e-6);
}

/// Smooth meshes get a single tangent per vertex, so that highlights show no facets.
#[test]
fn loaded_anisotropy_derives_smooth_tangents() {
    let mut parts = SceneParts::default();
    let plate = opsr_lab::gallery::shapes::disc(1.0, 12);
    // Slightly less than a full turn: u would jump at the seam.
    let uvs = (plate.positions.iter())
        .map(|p| Vec2::new((p.z.atan2(p.x)) / 6.3, p.length()))
        .collect();
    let mut plate = Mesh {
        uvs,
        tangents: Vec::new(),
        ..plate
    };
    plate.indices.retain(|face| {
        let u = face.map(|i| plate.uvs[i as usize].x);
        (u[0] - u[1]).abs() < 0.5 && (u[1] - u[2]).abs() < 0.5 && (u[0] - u[2]).abs() < 0.5
    });
    let steel = materials::metal("steel", Rgb::ONE, 0.01);
    parts.add(materials::brushed(steel, 0.5, 0.0), [plate]);
    let bytes = opsr_lab::gallery::glb::to_glb(&parts).expect("a small file");
    let directory = tempfile::tempdir().expect("a folder");
    let path = directory.path().join("plate.glb");
    std::fs::write(&path, bytes).expect("written");
    let options = opsr_formats::options();
    let loaded = opsr::scene::load::load(&path, &options).expect("loaded");
    let mesh = &loaded.parts.meshes[0];
    let read = loaded.parts.materials[0].anisotropy().expect("brushed");
    assert_eq!((read.strength, read.rotation), (0.5, 0.0));
    assert_eq!(mesh.tangents.len(), mesh.positions.len());
    let inner = |p: &&Vec3| p.x > 0.1;
    let around = mesh.positions.iter().zip(&mesh.tangents);
    for (p, t) in around.filter(|(p, _)| inner(p)) {
        let cos = t.truncate().dot(Vec3::Y.cross(*p).normalize()).abs();
        assert!(cos > 0.99, "{p} {t}");
    }
}

/// The draft KHR_materials_volume_scatter: attenuation is extinction, and the albedo follows from the colour of
/// multiply scattered light.
#[test]
fn gltf_bodies_scatter() {
    let load = |scatter: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        let text = format!(
            r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_materials_transmission", "KHR_materials_volume",
            "KHR_materials_volume_scatter"], "materials": [{{"extensions": {{"KHR_materials_transmission": {{"transmissionFactor": 1}},
            "KHR_materials_volume": {{"thicknessFactor": 1, "attenuationDistance": 0.5, "attenuationColor": [0.5, 0.25, 1]}},
            "KHR_materials_volume_scatter": {scatter}}}}}]}}"#
        );
        std::fs::write(&path, text).unwrap();
        opsr::scene::load::load(&path, &opsr_formats::options())
    };
    let loaded = load(r#"{"multiscatterColor": [1, 0.5, 0.5], "scatterAnisotropy": 0.4}"#).unwrap();
    let own = loaded.parts.materials[0].medium.as_deref().unwrap();
    assert_eq!(own.mean_cosine, 0.4);
    let extinction = [2.0f32.ln() * 2.0, 4.0f32.ln() * 2.0, 0.0];
    for (c, extinction) in extinction.into_iter().enumerate() {
        let sum = own.absorption[c] + own.scattering[c];
        assert!((sum - extinction).abs() < 1e-5 * sum.max(1.0));
    }
    // White has albedo 1; a colour of one half has the albedo of s, about 0.3.
    assert!(own.absorption.x < 1e-3, "{own:?}");
    let s = 4.09712f32 + 4.20863 * 0.5 - (9.59217f32 + 41.6808 * 0.5 + 17.7126 * 0.25).sqrt();
    let albedo = (1.0 - s * s) / (1.0 - 0.4 * s * s);
    assert!(
        (own.scattering.y / extinction[1] - albedo).abs() < 1e-5,
        "{own:?}"
    );
    let none = load("{}").unwrap();
    assert_eq!(none.parts.materials[0].medium, None);
    let wrong = load(r#"{"scatterAnisotropy": -1}"#)
        .unwrap_err()
        .to_string();
    assert!(wrong.contains("scatterAnisotropy is -1"), "{wrong}");
}
