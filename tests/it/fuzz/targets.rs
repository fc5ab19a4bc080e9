//! Fuzz targets: the readers, and assertions about every value that they accept.

#[cfg(feature = "train")]
use super::trained;
use super::{Target, repair, seeds};
use crate::support::gltf::File;
use crate::support::root;
use opsr::files::FileError;
use opsr::image::level_film::LevelFilm;
use opsr::image::{exr, png};
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::part::{MergeError, Part, merge};
use opsr::integrator::{Amounts, Estimator, FirstHit, Picture, Recorded, Settings, View};
use opsr::math::{UVec2, Vec3};
use opsr::regularise::file::TableFile;
use opsr::scene::load::{LoadOptions, Unsupported, load};
use opsr::scene::{Environment, Scene, SceneParts, Texels};
use opsr_lab::report::bench::page::page;
use opsr_lab::report::bench::{Results, Suite, summary};
use opsr_train::manifest::Manifest;
use serde_json::json;
use std::path::Path;

pub(crate) fn all() -> Vec<Target> {
    vec![
        gltf(),
        exr(),
        hdr(),
        png(),
        tables(),
        manifests(),
        suites(),
        checkpoints(),
        parts(),
        textures(),
        results(),
        #[cfg(feature = "train")]
        trained::configurations(),
        #[cfg(feature = "train")]
        trained::trainings(),
        #[cfg(feature = "train")]
        trained::recordings(),
    ]
}

/// The result with its error as text.
pub(super) fn text<T, E: ToString>(result: Result<T, E>) -> Result<T, String> {
    result.map_err(|e| e.to_string())
}

/// Bytes of the file that `save` writes.
pub(super) fn written(save: impl FnOnce(&Path) -> Result<(), String>) -> Vec<u8> {
    let folder = crate::support::quick_folder();
    let path = folder.path().join("file");
    save(&path).expect("saved");
    std::fs::read(&path).expect("a file")
}

/// Scenes of other renderers, and the meshes of such scenes.
pub(crate) fn foreign() -> Vec<Target> {
    let file = |name: &str| {
        let folder = root().join("tests/data/scenes");
        let text = std::fs::read_to_string(folder.join(name)).expect("a scene");
        // Spheres would become many triangles.
        let text = text.replace(
            "\"sphere\"",
            if name.ends_with("xml") {
                "\"cube\""
            } else {
                "\"disk\""
            },
        );
        text.into_bytes()
    };
    fn rendered(path: &Path) -> Result<String, String> {
        let options = LoadOptions {
            unsupported: Unsupported::Skip,
            ..opsr_formats::options()
        };
        let parts = text(load(path, &options))?.parts;
        let (meshes, lights) = (parts.meshes.len(), parts.lights.len());
        let own = parts.cameras.first().cloned();
        let scene = Scene::new(parts);
        let camera = own.unwrap_or_else(|| scene.framing_camera(1.0));
        let mut picture = Picture {
            film: opsr::image::Film::new(UVec2::splat(2)),
            aovs: None,
            levels: None,
        };
        let settings = Settings {
            max_vertices: 4,
            ..Settings::default()
        };
        let view = View::of(&scene, &camera, &picture.film);
        settings.integrator().pass(&view, 0..1, &mut picture);
        let mean = picture.film.mean();
        assert!(mean.pixels.iter().all(|p| p.is_finite()), "{path:?}");
        Ok(format!("{meshes} meshes, {lights} lights"))
    }
    /// A mesh, read by a scene in the same folder.
    fn mesh(path: &Path) -> Result<String, String> {
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        let (scene, words) = match name.ends_with(".ply") {
            true => (
                "a.pbrt",
                format!("Shape \"plymesh\" \"string filename\" \"{name}\""),
            ),
            false => {
                let kind = name.rsplit('.').next().unwrap_or_default();
                let shape = format!(
                    "<shape type=\"{kind}\"><string name=\"filename\" value=\"{name}\"/></shape>"
                );
                ("a.xml", format!("<scene version=\"3.0.0\">{shape}</scene>"))
            }
        };
        let scene = path.with_file_name(scene);
        std::fs::write(&scene, words).expect("a file");
        rendered(&scene)
    }
    let target = |name, file_name, seeds, read| Target {
        name,
        file_name,
        seeds,
        repair: |bytes| bytes,
        read,
    };
    vec![
        target(
            "mitsuba",
            "fuzz.xml",
            vec![file("glass.xml"), file("pool.xml"), OLDER_XML.into()],
            rendered,
        ),
        target(
            "pbrt",
            "fuzz.pbrt",
            vec![file("glass.pbrt"), file("pool.pbrt"), OLDER_PBRT.into()],
            rendered,
        ),
        target(
            "ply",
            "fuzz.ply",
            vec![file("tetra.ply"), binary_ply()],
            mesh,
        ),
        target("obj", "fuzz.obj", vec![file("tetra.obj")], mesh),
        target("model", "model.obj", vec![file("tetra.obj")], rendered),
        target("mtl", "fuzz.mtl", vec![mtl()], |path| {
            let model = path.with_file_name("fuzz.mtl.obj");
            let text = "mtllib fuzz.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\n";
            std::fs::write(&model, text).expect("a file");
            rendered(&model)
        }),
        target("draco", "fuzz.drc", streams("draco"), |path| {
            rendered(&wrapped(path, draco))
        }),
        target("meshopt", "fuzz.meshopt", streams("meshopt"), |path| {
            rendered(&wrapped(path, meshopt))
        }),
        target("ktx2", "fuzz.ktx2", streams("ktx2"), |path| {
            rendered(&wrapped(path, ktx2))
        }),
        target("serialized", "fuzz.serialized", vec![serialized()], mesh),
        target("hair", "fuzz.hair", hair(), mesh),
        target("lens", "fuzz.dat", vec![LENS.into()], |path| {
            let scene = path.with_file_name("a.pbrt");
            let text = "Camera \"realistic\" \"string lensfile\" \"fuzz.dat\"\nWorldBegin Shape \"sphere\"";
            std::fs::write(&scene, text).expect("a file");
            rendered(&scene)
        }),
    ]
}

/// A pbrt-v3 scene with mixtures and a movement.
const OLDER_PBRT: &str = "LookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" WorldBegin ColorSpace \"rec2020\"\n\
    LightSource \"point\" \"color I\" [1 2 3] \"rgb scale\" [1 1 1]\n\
    MakeNamedMaterial \"a\" \"string type\" \"uber\" \"rgb Kd\" [.5 .5 .5] \"rgb opacity\" [.5 .5 .5] \"float index\" 1.4\n\
    MakeNamedMaterial \"b\" \"string type\" \"substrate\" \"float uroughness\" .1 \"xyz Ks\" [.1 .1 .1]\n\
    MakeNamedMaterial \"c\" \"string type\" \"mix\" \"string namedmaterial1\" \"a\" \"string namedmaterial2\" \"b\" \"rgb amount\" [.2 .2 .5]\n\
    Material \"mix\" \"string materials\" [\"c\" \"b\"] \"float amount\" .5 Shape \"disk\"\n\
    ActiveTransform EndTime Rotate 7 0 0 1 ActiveTransform All Material \"glass\" Shape \"disk\" \"float radius\" 2";

/// A Mitsuba 0.6 scene with mixtures.
const OLDER_XML: &str = "<scene version=\"0.6.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>\
    <emitter type=\"sun\"><vector name=\"sunDirection\" x=\"1\" y=\"1\" z=\"0\"/></emitter>\
    <shape type=\"merge\"><shape type=\"cube\"><bsdf type=\"mixturebsdf\"><string name=\"weights\" value=\".2, .3, .5\"/>\
    <bsdf type=\"phong\"><float name=\"exponent\" value=\"9\"/></bsdf><bsdf type=\"ward\"/><bsdf type=\"coating\"><bsdf type=\"diffuse\"/></bsdf>\
    </bsdf></shape></shape></scene>";

/// A material file with materials of several kinds.
fn mtl() -> Vec<u8> {
    b"newmtl a\nKd 0.5 0.4 0.3\nKs 0.5 0.5 0.5\nNs 100\nillum 2\nKe 1 1 1\nd 0.5\n\
      newmtl b\nNi 1.5\nd 0.1\nTf 1 0.9 0.8\nillum 7\nPr 0.3\nPm 0.5\n"
        .to_vec()
}

/// Compressed parts of the files of `tests/data/compressed`.
fn streams(kind: &str) -> Vec<Vec<u8>> {
    let folder = root().join("tests/data/compressed");
    let read = |name: &str| std::fs::read(folder.join(name)).expect("a file");
    match kind {
        "ktx2" => ["etc1s", "etc1s_alpha", "uastc", "uastc_zstd"]
            .map(|name| read(&format!("{name}.ktx2")))
            .into(),
        "draco" => ["draco.glb", "sequential.glb"]
            .map(|name| {
                let file = File::from_glb(&read(name));
                let view = &file.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["bufferView"];
                let view = &file.json["bufferViews"][view.as_u64().expect("a view") as usize];
                let at = |name: &str| view[name].as_u64().unwrap_or(0) as usize;
                file.bytes[at("byteOffset")..][..at("byteLength")].to_vec()
            })
            .into(),
        // The stream after its JSON description.
        _ => {
            let (ext, khr) = (read("ext.glb"), read("khr.glb"));
            let of = |glb: &[u8], extension: &str| -> Vec<Vec<u8>> {
                let file = File::from_glb(glb);
                let views = file.json["bufferViews"].as_array().expect("views");
                let packed = views.iter().filter_map(|view| view["extensions"].get(extension));
                let stream = |packed: &serde_json::Value| {
                    let at = |name: &str| packed[name].as_u64().unwrap_or(0) as usize;
                    let mut head = packed.clone();
                    (head["byteOffset"], head["buffer"]) = (json!(0), json!(0));
                    let mut bytes = head.to_string().into_bytes();
                    bytes.push(b'\n');
                    bytes.extend(&file.bytes[at("byteOffset")..][..at("byteLength")]);
                    bytes
                };
                packed.map(stream).collect()
            };
            let mut all = of(&ext, "EXT_meshopt_compression");
            all.extend(of(&khr, "KHR_meshopt_compression"));
            all
        }
    }
}

/// Writes a glTF file next to a compressed one, with its bytes inside.
fn wrapped(path: &Path, file: fn(&[u8]) -> File) -> std::path::PathBuf {
    let name = path.file_name().and_then(|name| name.to_str());
    let around = path.with_file_name(format!("{}.glb", name.unwrap_or_default()));
    let bytes = std::fs::read(path).expect("a file");
    std::fs::write(&around, file(&bytes).glb()).expect("a file");
    around
}

/// A primitive with a Draco stream.
fn draco(stream: &[u8]) -> File {
    File::of(|file| {
        let view = file.view(stream);
        let mut accessor = |component: u32, count: u32, kind: &str| {
            file.push(
                "accessors",
                json!({ "componentType": component, "count": count, "type": kind }),
            )
        };
        let (p, n, i) = (
            accessor(5126, 153, "VEC3"),
            accessor(5126, 153, "VEC3"),
            accessor(5123, 768, "SCALAR"),
        );
        file.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
        let packed = json!({ "bufferView": view, "attributes": { "POSITION": 0, "NORMAL": 1 } });
        json!({ "attributes": { "POSITION": p, "NORMAL": n }, "indices": i, "extensions": { "KHR_draco_mesh_compression": packed } })
    })
}

/// A triangle with a meshopt-compressed view.
fn meshopt(bytes: &[u8]) -> File {
    let mut file = File::triangle();
    let split = bytes
        .iter()
        .position(|b| *b == b'\n')
        .unwrap_or(bytes.len());
    let mut head: serde_json::Value = serde_json::from_slice(&bytes[..split]).unwrap_or(json!({}));
    let stream = bytes.get(split + 1..).unwrap_or_default();
    let view = file.view(stream);
    if let Some(packed) = head.as_object_mut() {
        packed.insert(
            "byteOffset".into(),
            file.json["bufferViews"][view]["byteOffset"].clone(),
        );
        packed.insert("byteLength".into(), json!(stream.len()));
    }
    let number = |name: &str| head[name].as_u64().unwrap_or(0);
    let length = number("count").saturating_mul(number("byteStride"));
    file.json["extensionsUsed"] = json!(["EXT_meshopt_compression"]);
    let extensions = json!({ "EXT_meshopt_compression": head });
    file.push(
        "bufferViews",
        json!({ "buffer": 0, "byteLength": length, "extensions": extensions }),
    );
    file
}

/// A triangle with a KTX2 texture.
fn ktx2(bytes: &[u8]) -> File {
    let mut file = File::triangle();
    let view = file.view(bytes);
    file.push("images", json!({ "bufferView": view }));
    file.push(
        "textures",
        json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } }),
    );
    let info = json!({ "baseColorTexture": { "index": 0 } });
    file.push("materials", json!({ "pbrMetallicRoughness": info }));
    file.json["extensionsUsed"] = json!(["KHR_texture_basisu"]);
    file
}

/// A triangle in binary PLY.
fn binary_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nproperty float u\nproperty float v\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n"
        .to_vec();
    for x in [
        0f32, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0,
    ] {
        bytes.extend(x.to_be_bytes());
    }
    bytes.push(3);
    for i in 0..3i32 {
        bytes.extend(i.to_be_bytes());
    }
    bytes
}

/// A lens file: a stop in front of a ball of glass.
const LENS: &str = "# a ball\n0 5 0 4\n10 20 1.5 20\n-10 30 1 20\n";

/// Two strands as text, and in Mitsuba's binary form.
fn hair() -> Vec<Vec<u8>> {
    let strand = |x: f32| [[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 2.0, 1.0]];
    let line = |[x, y, z]: [f32; 3]| format!("{x} {y} {z} 0.1\n");
    let text = [0.0, 1.0].map(|x| strand(x).map(line).concat());
    let mut binary = [b"BINARY_HAIR".as_slice(), &6u32.to_le_bytes()].concat();
    for x in [0.0, 1.0] {
        let begin = [f32::INFINITY].into_iter();
        let numbers = begin.chain(strand(x).into_iter().flatten());
        binary.extend(numbers.flat_map(f32::to_le_bytes));
    }
    vec![text.join("\n").into_bytes(), binary]
}

/// A triangle in Mitsuba's `.serialized` format.
fn serialized() -> Vec<u8> {
    use std::io::Write;
    let mut body = 0x1000u32.to_le_bytes().to_vec();
    body.push(0);
    body.extend(3u64.to_le_bytes());
    body.extend(1u64.to_le_bytes());
    for x in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
        body.extend(x.to_le_bytes());
    }
    (0..3u32).for_each(|i| body.extend(i.to_le_bytes()));
    let mut packer =
        flate2::write::ZlibEncoder::new(vec![0x1c, 4, 4, 0], flate2::Compression::none());
    packer.write_all(&body).expect("packed");
    let mut bytes = packer.finish().expect("packed");
    bytes.extend(0u64.to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    bytes
}

/// Scenes: loads the file, builds the scene and renders one sample of a 2×2 picture.
pub(crate) fn gltf() -> Target {
    Target {
        name: "gltf",
        file_name: "fuzz.glb",
        seeds: seeds::gltf(),
        repair: repair::glb,
        read: |path| {
            let loaded = text(load(path, &opsr_formats::options()))?;
            let (parts, warnings) = (loaded.parts, loaded.warnings.join("; "));
            let has = |n: usize, what: &str| (n > 0).then(|| format!(" {what}"));
            let contents = [
                has(parts.meshes.len(), "meshes"),
                has(parts.lights.len(), "lights"),
                has(parts.cameras.len(), "cameras"),
                has(parts.textures.len(), "textures"),
            ];
            let contents: String = contents.into_iter().flatten().collect();
            let own = parts.cameras.first().cloned();
            let scene = Scene::new(parts);
            let camera = own.unwrap_or_else(|| scene.framing_camera(1.0));
            let mut picture = Picture {
                film: opsr::image::Film::new(UVec2::splat(2)),
                aovs: None,
                levels: None,
            };
            let settings = Settings {
                max_vertices: 4,
                ..Settings::default()
            };
            let view = View::of(&scene, &camera, &picture.film);
            settings.integrator().pass(&view, 0..1, &mut picture);
            // One of the other estimators, which the file alone determines.
            let others = [
                Estimator::Guided { unbiased: false },
                Estimator::Light,
                Estimator::Bdpt,
                Estimator::Vcm(Radius::default()),
                Estimator::Sppm(Radius::default()),
                Estimator::Mlt { mutations: 1 },
            ];
            let settings = Settings {
                estimator: others[scene.geometry().triangle_count() % others.len()],
                ..settings
            };
            if settings.check_scene(&scene).is_ok() {
                let mut integrator = settings.integrator();
                integrator.notes(&view);
                integrator.pass(&view, 0..2, &mut picture);
            }
            Ok(format!("with{contents}: {warnings}"))
        },
    }
}

/// Pictures: reads the layers, then tries the file as a film and as an RGB picture.
pub(crate) fn exr() -> Target {
    Target {
        name: "exr",
        file_name: "fuzz.exr",
        seeds: seeds::exr(),
        repair: repair::nothing,
        read: |path| {
            // A file without the channels of a film or of a picture is accepted, and the summary states it.
            let error_of = |r: Result<(), FileError>| {
                let name = path.display().to_string();
                let message = r.map_or_else(|e| e.to_string(), |()| name.clone());
                assert!(message.contains(&name), "{message}");
                message.replace(&name, "")
            };
            let film = error_of(exr::read_film(path).map(|film| drop(film.mean())));
            let rgb = error_of(
                exr::read_rgb(path).map(|p| assert_eq!(p.pixels.len(), p.width * p.height)),
            );
            let layers = text(exr::read_layers(path))?;
            let n = layers.width * layers.height;
            assert!(layers.channels.values().all(|c| c.len() == n));
            Ok(format!("as a film{film}; as a picture{rgb}"))
        },
    }
}

/// Environment maps: evaluates and samples the map.
pub(crate) fn hdr() -> Target {
    Target {
        name: "hdr",
        file_name: "fuzz.hdr",
        seeds: seeds::hdr(),
        repair: repair::nothing,
        read: |path| {
            let map = text(Environment::load(path, 1.0, 0.3))?;
            for dir in [Vec3::X, Vec3::Y, Vec3::NEG_Y, Vec3::NEG_Z] {
                assert!(map.radiance(dir).is_finite());
            }
            let parts = SceneParts {
                environment: Some(map.clone()),
                ..SceneParts::default()
            };
            let scene = Scene::new(parts);
            for u in [0.0, 0.999_999_9] {
                if let Some(light) = scene.lights().sample(Vec3::ZERO, [u; 3].into()) {
                    assert!(light.wi.is_finite() && light.radiance.is_finite());
                    assert!(light.density.value() > 0.0);
                }
            }
            assert!(map.average().min_element() >= 0.0);
            let black = map.average().max_element() == 0.0;
            Ok(if black { "a black map" } else { "a map" }.into())
        },
    }
}

/// Display pictures, PNG or JPEG.
pub(crate) fn png() -> Target {
    Target {
        name: "png",
        file_name: "fuzz.png",
        seeds: seeds::png(),
        repair: repair::png,
        read: |path| {
            let picture = text(png::read(path))?;
            assert_eq!(picture.pixels.len(), picture.width * picture.height);
            let grey = picture.pixels.iter().all(|p| p.x == p.y && p.y == p.z);
            Ok(if grey { "grey" } else { "coloured" }.into())
        },
    }
}

/// Tables: an accepted table has valid factors and survives a round trip.
pub(crate) fn tables() -> Target {
    Target {
        name: "tables",
        file_name: "fuzz.json",
        seeds: seeds::tables(),
        repair: repair::nothing,
        read: |path| {
            let file = text(TableFile::load(path))?;
            let t = &file.table;
            assert!(t.gammas.iter().all(|g| (0.0..=1.0).contains(g)) && t.scale > 0.0);
            let again = TableFile::parse(file.to_json().unwrap().as_bytes(), path);
            assert_eq!(again.unwrap(), file);
            let provenance = file.provenance.is_some();
            Ok(format!("{:?}, provenance {provenance}", t.lookup))
        },
    }
}

/// Manifests of training scenes.
pub(crate) fn manifests() -> Target {
    Target {
        name: "manifests",
        file_name: "fuzz.manifest",
        seeds: seeds::manifests(),
        repair: repair::nothing,
        read: |path| {
            let manifest = text(Manifest::load(path))?;
            for entry in &manifest.scenes {
                assert!(!entry.crops.is_empty() && entry.exposure > 0.0);
                manifest.reference(entry, entry.crops[0]);
            }
            let none = manifest.scenes.is_empty();
            Ok(if none { "no scenes" } else { "scenes" }.into())
        },
    }
}

/// Suites of benches.
pub(crate) fn suites() -> Target {
    Target {
        name: "suites",
        file_name: "fuzz.suite",
        seeds: seeds::suites(),
        repair: repair::nothing,
        read: |path| {
            let suite = text(Suite::load(path))?;
            for scene in &suite.scenes {
                assert!(!scene.window().is_empty());
                suite.methods_of(scene).count();
            }
            let methods = suite
                .methods
                .iter()
                .map(|m| format!("{:?} ", m.spec.settings()));
            Ok(methods.collect())
        },
    }
}

/// Fingerprint of the render that wrote the seeds.
fn fingerprint() -> Fingerprint {
    Fingerprint {
        version: "1".into(),
        scene: "00".into(),
        settings: "plain".into(),
    }
}

/// Checkpoints of renders.
pub(crate) fn checkpoints() -> Target {
    let film = seeds::film();
    let aovs = Some(FirstHit::new(film.window).into());
    let levels = LevelFilm::new(film.size, film.window, 2);
    let seeds = [(None, None), (aovs, None), (None, Some(levels))].map(|(aovs, levels)| {
        let checkpoint = Checkpoint {
            amounts: match levels {
                Some(_) => self::levels(),
                None => Amounts::Raw,
            },
            picture: Picture {
                film: film.clone(),
                aovs,
                levels,
            },
            fingerprint: fingerprint(),
            samples: 4,
            seconds: 1.5,
            metadata: Default::default(),
        };
        written(|path| text(checkpoint.save(path)))
    });
    Target {
        name: "checkpoints",
        file_name: "fuzz.ckpt",
        seeds: seeds.into(),
        repair: repair::sealed,
        read: |path: &Path| {
            let checkpoint = text(Checkpoint::load(path, &fingerprint()))?;
            let film = checkpoint.picture.film;
            assert_eq!(film.pixels.len(), film.window.len());
            let rejected = film.rejected.total() > 0;
            let aovs = checkpoint.picture.aovs.is_some();
            let levels = (checkpoint.picture.levels).map_or(0, |film| film.levels());
            let layers = format!("AOVs {aovs}, levels {levels}");
            Ok(format!("rejected samples {rejected}, {layers}"))
        },
    }
}

/// Two levels.
fn levels() -> Amounts {
    Amounts::roughening(&[0.0, 1.0]).expect("scales")
}

/// A part of a render.
fn part(samples: std::ops::Range<u32>, amounts: Amounts) -> Vec<u8> {
    let scene = crate::support::render::scene(opsr_lab::gallery::caustic_box());
    let (camera, film) = (&scene.parts().cameras[0], seeds::film());
    let view = View::of(&scene, camera, &film);
    let settings = Settings {
        rule: opsr::regularise::Rule::constant(0.3),
        amounts: amounts.clone(),
        ..Settings::default()
    };
    let aovs = Recorded {
        first: amounts.films() > 1,
        ..Recorded::default()
    };
    let part = Part::new(fingerprint(), &view, samples, amounts, aovs);
    let mut go_on = |_: &_| std::ops::ControlFlow::Continue(());
    let mut integrator = settings.integrator();
    written(|path| text(part.render(path, &mut *integrator, &view, &mut go_on)).map(drop))
}

/// Parts of renders: those that begin with sample 0, and those that follow them.
pub(crate) fn parts() -> Target {
    Target {
        name: "parts",
        file_name: "fuzz.part",
        seeds: vec![
            part(0..2, Amounts::Raw),
            part(2..4, Amounts::Raw),
            part(0..2, levels()),
            part(2..4, levels()),
        ],
        repair: repair::sealed,
        read: |path: &Path| {
            let bytes = text(std::fs::read(path))?;
            let has = |words: &str| bytes.windows(words.len()).any(|w| w == words.as_bytes());
            let folder = crate::support::quick_folder();
            let mut paths = vec![path.to_owned()];
            if !has("\"samples\":[0,") {
                let first = if has("\"amounts\":\"raw\"") {
                    part(0..2, Amounts::Raw)
                } else {
                    part(0..2, levels())
                };
                paths.push(folder.path().join("first.part"));
                text(std::fs::write(&paths[1], first))?;
            }
            let merged = merge(&paths, |_| seeds::film().window, None, true);
            let other = format!("{}/", folder.path().display());
            let merged = merged.map_err(|e| match e {
                MergeError::Samples(what) => format!("{}: {what}", path.display()),
                e => e.to_string().replace(&other, ""),
            });
            let picture = merged?.picture;
            assert_eq!(picture.film.pixels.len(), picture.film.window.len());
            let aovs = picture.aovs.is_some();
            let levels = picture.levels.map_or(0, |film| film.levels());
            Ok(format!("AOVs {aovs}, levels {levels}"))
        },
    }
}

/// Textures: embeds the picture in a scene of one triangle and loads the scene.
pub(crate) fn textures() -> Target {
    Target {
        name: "textures",
        file_name: "fuzz-texture.png",
        seeds: seeds::textures(),
        repair: repair::png,
        read: |path| {
            let folder = crate::support::quick_folder();
            let mut file = File::triangle();
            let view = file.view(&text(std::fs::read(path))?);
            let image = file.push("images", json!({ "bufferView": view }));
            file.push("textures", json!({ "source": image }));
            file.push("materials", json!({ "emissiveTexture": { "index": 0 } }));
            file.primitive()["material"] = json!(0);
            // The scene has the picture's file name, which error messages must contain.
            let scene = folder.path().join(path.file_name().unwrap_or_default());
            text(std::fs::write(&scene, file.glb()))?;
            let error = |e: FileError| {
                let (ours, theirs) = (scene.display().to_string(), path.display().to_string());
                e.to_string().replace(&ours, &theirs)
            };
            let loaded = load(&scene, &opsr_formats::options()).map_err(error)?;
            let texture = &loaded.parts.textures[0];
            let (width, height) = (texture.width as usize, texture.height as usize);
            let channels = usize::from(texture.channels);
            let values = match &texture.texels {
                Texels::Byte(codes) => codes.len(),
                Texels::Word(codes) => codes.len(),
            };
            assert_eq!(values, width * height * channels);
            let texels = (0..texture.height).flat_map(|y| (0..texture.width).map(move |x| (x, y)));
            let opaque = texels
                .map(|(x, y)| texture.texel(x, y))
                .all(|t| t[3] == 1.0);
            Ok(if opaque { "opaque" } else { "with alpha" }.into())
        },
    }
}

/// Results of benches: prints the summary and the HTML page.
pub(crate) fn results() -> Target {
    Target {
        name: "results",
        file_name: "fuzz-results.json",
        seeds: seeds::results(),
        repair: repair::nothing,
        read: |path| {
            let results = text(Results::load(path))?;
            summary::text(&results);
            let html = page(&results);
            let words = [
                "<svg",
                "data:image",
                "class=\"off\"",
                "class=\"better\"",
                "class=\"worse\"",
            ];
            let has = words.iter().filter(|w| html.contains(*w));
            Ok(format!("a page with {}", has.copied().collect::<String>()))
        },
    }
}
