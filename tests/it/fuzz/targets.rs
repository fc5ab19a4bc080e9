//! The readers, and what must hold of anything they take.

use super::{Target, repair, seeds};
use opsr::image::{exr, png};
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::{FirstHit, Picture, Settings};
use opsr::math::{UVec2, Vec2, Vec3};
use opsr::regularise::file::TableFile;
use opsr::report::bench::Suite;
use opsr::scene::load::{LoadOptions, load};
use opsr::scene::manifest::Manifest;
use opsr::scene::{Camera, Environment, Scene};
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
    ]
}

fn text<T, E: ToString>(result: Result<T, E>) -> Result<T, String> {
    result.map_err(|e| e.to_string())
}

/// Loads, builds and renders a little: whatever is taken can be looked at.
pub(crate) fn gltf() -> Target {
    Target {
        file: "fuzz.glb",
        seeds: seeds::gltf(),
        repair: repair::glb,
        read: |path| {
            let parts = text(load(path, &LoadOptions::default()))?.parts;
            let own = parts.cameras.first().cloned();
            let scene = Scene::new(parts);
            let camera = own.unwrap_or_else(|| Camera::framing(scene.geometry().bounds(), 1.0));
            let mut picture = Picture {
                film: opsr::image::Film::new(UVec2::splat(2)),
                aovs: None,
            };
            let settings = Settings {
                max_vertices: 4,
                ..Settings::default()
            };
            let integrator = settings.integrator();
            integrator.pass(&scene, &camera, 0..1, &mut picture);
            Ok(())
        },
    }
}

pub(crate) fn exr() -> Target {
    Target {
        file: "fuzz.exr",
        seeds: seeds::exr(),
        repair: repair::nothing,
        read: |path| {
            // Whether the channels are those of a film or of a picture is another matter.
            let told = |r: Result<(), exr::ExrError>| {
                assert!(r.is_ok() || r.unwrap_err().to_string().contains("fuzz.exr"));
            };
            told(exr::read_film(path).map(|film| drop(film.mean())));
            told(exr::read_rgb(path).map(|p| assert_eq!(p.pixels.len(), p.width * p.height)));
            let layers = text(exr::read_layers(path))?;
            let n = layers.width * layers.height;
            assert!(layers.channels.values().all(|c| c.len() == n));
            Ok(())
        },
    }
}

/// An environment map, looked at and sampled.
pub(crate) fn hdr() -> Target {
    Target {
        file: "fuzz.hdr",
        seeds: seeds::hdr(),
        repair: repair::nothing,
        read: |path| {
            let map = text(Environment::load(path, 1.0, 0.3))?;
            for dir in [Vec3::X, Vec3::Y, Vec3::NEG_Y, Vec3::NEG_Z] {
                assert!(map.radiance(dir).is_finite());
            }
            for u in [Vec2::ZERO, Vec2::splat(0.999_999_9)] {
                if let Some((dir, radiance, pdf)) = map.sample(u) {
                    assert!(dir.is_finite() && radiance.is_finite() && pdf > 0.0);
                }
            }
            assert!(map.average().min_element() >= 0.0);
            Ok(())
        },
    }
}

pub(crate) fn png() -> Target {
    Target {
        file: "fuzz.png",
        seeds: seeds::png(),
        repair: repair::png,
        read: |path| {
            let picture = text(png::read(path))?;
            assert_eq!(picture.pixels.len(), picture.width * picture.height);
            Ok(())
        },
    }
}

/// A table that is taken is a table, and is the same after it was written again.
pub(crate) fn tables() -> Target {
    Target {
        file: "fuzz.json",
        seeds: seeds::tables(),
        repair: repair::nothing,
        read: |path| {
            let file = text(TableFile::load(path))?;
            let t = &file.table;
            assert!(t.gammas.iter().all(|g| (0.0..=1.0).contains(g)) && t.scale > 0.0);
            let again = TableFile::parse(file.to_json().unwrap().as_bytes(), path);
            assert_eq!(again.unwrap(), file);
            Ok(())
        },
    }
}

pub(crate) fn manifests() -> Target {
    Target {
        file: "fuzz.manifest",
        seeds: seeds::manifests(),
        repair: repair::nothing,
        read: |path| {
            let manifest = text(Manifest::load(path))?;
            for entry in &manifest.scenes {
                assert!(!entry.crops.is_empty() && entry.exposure > 0.0);
                manifest.reference(entry, entry.crops[0]);
            }
            Ok(())
        },
    }
}

pub(crate) fn suites() -> Target {
    Target {
        file: "fuzz.suite",
        seeds: seeds::suites(),
        repair: repair::nothing,
        read: |path| {
            let suite = text(Suite::load(path))?;
            for scene in &suite.scenes {
                assert!(!scene.window().is_empty());
                suite.methods_of(scene).count();
            }
            Ok(())
        },
    }
}

/// Whose checkpoint the seeds are.
fn fingerprint() -> Fingerprint {
    Fingerprint {
        version: "1".into(),
        scene: "00".into(),
        settings: "plain".into(),
    }
}

pub(crate) fn checkpoints() -> Target {
    let film = seeds::film();
    let aovs = Some(FirstHit::new(film.window));
    let seeds = [None, aovs].map(|aovs| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.ckpt");
        let picture = Picture {
            film: film.clone(),
            aovs,
        };
        let checkpoint = Checkpoint {
            fingerprint: fingerprint(),
            samples: 4,
            seconds: 1.5,
            picture,
        };
        checkpoint.save(&path).expect("saved");
        std::fs::read(&path).expect("a file")
    });
    Target {
        file: "fuzz.ckpt",
        seeds: seeds.into(),
        repair: repair::checkpoint,
        read: |path: &Path| {
            let checkpoint = text(Checkpoint::load(path, &fingerprint()))?;
            assert_eq!(checkpoint.picture.film.window, seeds::film().window);
            Ok(())
        },
    }
}
