//! References: a resumed one equals a single run, other files are refused, and committed ones agree with the renderer.

use crate::support::root;
use opsr::image::film::Film;
use opsr::integrator::{Settings, View};
use opsr::math::DVec3;
use opsr::sampler::{Independent, Seed};
use opsr::scene::Scene;
use opsr::scene::load::{LoadOptions, load};
use opsr_train::manifest::{Manifest, SceneEntry};
use opsr_train::reference::{Reference, SEED};
use std::path::Path;

fn committed() -> Manifest {
    Manifest::load(&root().join("training_scenes/manifest.toml")).unwrap()
}

fn scene(manifest: &Manifest, entry: &SceneEntry) -> (Scene, [u8; 32]) {
    let loaded = load(&manifest.file(entry), &LoadOptions::default()).unwrap();
    (Scene::new(loaded.parts), loaded.digest)
}

/// The committed list, with references in another folder.
fn elsewhere(folder: &Path) -> Manifest {
    Manifest {
        folder: folder.to_owned(),
        ..committed()
    }
}

#[test]
fn resume_of_a_reference_equals_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = elsewhere(folder.path());
    let entry = (manifest.scenes.iter().find(|e| e.name == "rings")).unwrap();
    let (scene, digest) = scene(&committed(), entry);
    let camera = &scene.parts().cameras[entry.camera];
    let open = || Reference::open(&manifest, entry, entry.crops[0], &digest, 5).unwrap();

    let mut whole = open();
    assert!(whole.noise().mean.is_infinite());
    whole.extend(&scene, camera, 7);
    let mut last = open();
    for (samples, expected) in [(3, 3), (1, 4), (3, 7)] {
        last = open();
        last.extend(&scene, camera, samples);
        last.save().unwrap();
        assert_eq!(last.samples(), expected);
        assert_eq!(open().samples(), expected);
    }
    // The same samples; the file in between rounds to single precision, relative to the largest value of a pixel.
    let close = |a: DVec3, b: DVec3, scale: DVec3| (a - b).abs().cmple(1e-6 * scale).all();
    let mut lit = 0;
    for (a, b) in whole.film().pixels.iter().zip(&last.film().pixels) {
        assert_eq!((a.n, b.n), (7, 7));
        let (va, vb) = (a.sample_variance(), b.sample_variance());
        assert!(close(a.mean, b.mean, a.mean), "{} {}", a.mean, b.mean);
        assert!(close(va, vb, va + a.mean * a.mean), "{va} {vb}");
        lit += usize::from(va.x > 0.0);
    }
    assert!(lit > 500, "too few pixels vary for this to say anything");
    // Without repeated samples.
    let mut other = Film::cropped(whole.film().size, whole.film().window).unwrap();
    let tracer = Settings {
        max_vertices: entry.max_vertices,
        ..Settings::default()
    }
    .tracer(opsr::regularise::Rule::Plain);
    let source = Independent { seed: Seed(5) };
    let view = View::of(&scene, camera, &other);
    tracer.estimate(&view, &source, 0..7, &mut other, &mut ());
    assert_eq!(&other, whole.film());
}

#[test]
fn reference_of_other_settings_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = elsewhere(folder.path());
    let entry = &manifest.scenes[0];
    let (scene, digest) = scene(&committed(), entry);
    let camera = &scene.parts().cameras[entry.camera];
    let crop = entry.crops[0];
    let mut reference = Reference::open(&manifest, entry, crop, &digest, 5).unwrap();
    reference.extend(&scene, camera, 2);
    reference.save().unwrap();

    let longer = SceneEntry {
        max_vertices: entry.max_vertices + 1,
        ..entry.clone()
    };
    let wider = SceneEntry {
        frame: [entry.frame[0] + 2, entry.frame[1]],
        ..entry.clone()
    };
    for (entry, digest, seed, word) in [
        (entry, [7; 32], 5, "scene_sha256"),
        (entry, digest, 6, "seed"),
        (&longer, digest, 5, "max_vertices"),
        (&wider, digest, 5, "frame"),
    ] {
        let error = Reference::open(&manifest, entry, crop, &digest, seed).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    }
    std::fs::write(reference.path(), "no picture").unwrap();
    let error = Reference::open(&manifest, entry, crop, &digest, 5).unwrap_err();
    assert!(error.to_string().contains(".exr"), "{error}");
}

/// Every committed reference exists, belongs to the committed scene, and its mean is that of a fresh render within the
/// noise of both.
#[test]
fn reference_files_agree_with_a_fresh_render() {
    const SPP: u32 = 32;
    let manifest = committed();
    let mut sum_of_squares = 0.0;
    let mut crops = 0.0;
    let mut total = 0;
    for entry in &manifest.scenes {
        let (scene, digest) = scene(&manifest, entry);
        let camera = &scene.parts().cameras[entry.camera];
        let settings = Settings {
            max_vertices: entry.max_vertices,
            ..Settings::default()
        };
        for &crop in &entry.crops {
            let reference = Reference::open(&manifest, entry, crop, &digest, SEED).unwrap();
            let name = reference.path().display();
            assert!(reference.samples() >= 1024, "{name}: too few samples");
            assert!(reference.noise().mean < 0.08, "{name}: too noisy");
            total += std::fs::metadata(reference.path()).unwrap().len();

            let film = reference.film();
            let mut fresh = Film::cropped(film.size, film.window).unwrap();
            let tracer = settings.tracer(opsr::regularise::Rule::Plain);
            let source = Independent { seed: Seed(1) };
            let view = View::of(&scene, camera, &fresh);
            tracer.estimate(&view, &source, 0..SPP, &mut fresh, &mut ());
            let mean = |film: &Film| (film.pixels.iter()).map(|p| p.mean.y).sum::<f64>();
            // The reference gives a better estimate of the variance than 32 samples.
            let variance: f64 = (film.pixels.iter())
                .map(|p| p.sample_variance().y * (1.0 / f64::from(SPP) + 1.0 / f64::from(p.n)))
                .sum();
            let z = (mean(&fresh) - mean(film)) / variance.sqrt();
            assert!(z.abs() < 4.0, "{name}: {z:.2} standard errors apart");
            sum_of_squares += z * z;
            crops += 1.0;
        }
    }
    // The sum of squares has mean `crops` and variance of about 2 `crops`.
    let excess = (sum_of_squares - crops) / f64::sqrt(2.0 * crops);
    assert!(excess.abs() < 4.0, "z scores {excess:.2} from chi-square");
    assert!(total < 4_000_000, "{total} bytes are too many to commit");
}
