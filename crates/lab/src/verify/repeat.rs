//! Pictures that must be bit-identical: at any number of threads, in any split into passes, and after stop and resume.

use super::{Finding, Numbers, Size, pool};
use crate::gallery::caustic_box;
use crate::gallery::materials::{brushed, clearcoated, coated};
use crate::gallery::shapes::{Placing, disc, sphere};
use crate::verify::modes::{MODES, Mode, Uniform};
use opsr::image::Film;
use opsr::image::film::Window;
use opsr::image::level_film::LevelFilm;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::{Estimator, FirstHit, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::scene::Scene;
use std::error::Error;

const FRAME: UVec2 = UVec2::new(24, 20);

const CROP: Window = Window {
    x: 3,
    y: 2,
    w: 19,
    h: 17,
};

/// Random settings of every mode.
fn ways() -> impl Iterator<Item = (&'static str, Settings)> {
    let mut numbers = Numbers::new(11);
    let drawn = move |mode: &'static Mode| {
        let settings = mode.settings(Uniform(&mut || numbers.next()));
        // A path of a single vertex does not show differences between modes.
        let max_vertices = settings.max_vertices.max(3);
        (
            mode.name,
            Settings {
                max_vertices,
                ..settings
            },
        )
    };
    MODES.iter().map(drawn)
}

/// The caustic box with a lacquered ball and a brushed plate.
fn scene() -> Scene {
    let mut parts = caustic_box();
    let lacquer = coated("lacquer", Rgb::splat(0.5), 0.02);
    parts.add(
        clearcoated(lacquer.clone(), 0.1),
        [sphere(Vec3::new(0.0, 1.2, 0.0), 0.3, 2)],
    );
    let plate = disc(0.3, 16).placed([0.0, 1.3, 0.0], Vec3::new(-0.5, 1.2, -0.5));
    parts.add(brushed(lacquer, 0.8, 0.3), [plate]);
    Scene::new(parts)
}

/// An empty picture with first-hit layers.
fn blank(settings: &Settings, window: Window) -> Picture {
    let mut film = Film::new(FRAME);
    if window != Window::full(FRAME) {
        film = film.cut(window);
    }
    let levels = settings.amounts.films();
    Picture {
        levels: (levels > 0).then(|| LevelFilm::new(film.size, window, levels)),
        aovs: Some(FirstHit::new(window).into()),
        film,
    }
}

/// A picture by passes of these numbers of samples, with this number of threads.
fn picture(
    scene: &Scene,
    settings: &Settings,
    window: Window,
    threads: usize,
    passes: &[u32],
) -> Picture {
    let mut picture = blank(settings, window);
    let mut integrator = settings.integrator();
    pool(threads).install(|| {
        let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
        let mut first = 0;
        for &n in passes {
            integrator.pass(&view, first..first + n, &mut picture);
            first += n;
        }
    });
    picture
}

/// Number of pixels of two films that are not bit-identical; all pixels if only other data differ.
pub(super) fn apart(a: &Picture, b: &Picture) -> f64 {
    if a == b {
        return 0.0;
    }
    let pixels = a.film.pixels.iter().zip(&b.film.pixels);
    let count = pixels.filter(|(a, b)| a != b).count();
    if count == 0 {
        a.film.pixels.len() as f64
    } else {
        count as f64
    }
}

/// Bit-identity at 1, 2, 3 and 8 threads, in several splits into passes, and of a crop, except for guides. Findings are
/// computed lazily.
pub fn determinism(size: Size) -> impl Iterator<Item = Finding> {
    let unit = size.of(1, 4, 128);
    let scene = scene();
    let full = Window::full(FRAME);
    ways().flat_map(move |(name, settings)| {
        let render = |window, threads, passes: &[u32]| {
            let passes: Vec<u32> = passes.iter().map(|n| n * unit).collect();
            picture(&scene, &settings, window, threads, &passes)
        };
        let whole = render(full, 1, &[6]);
        let splits = [(2, &[1, 5][..]), (8, &[6]), (3, &[2, 3, 1])];
        let splits = splits.map(|(threads, passes)| apart(&whole, &render(full, threads, passes)));
        let samples = 6 * unit;
        let tried = format!("{name}, {samples} samples: pixels that differ by threads, passes");
        let mut all = vec![Finding::new(tried, 0.0, splits)];
        // A guide depends on all rendered pixels, so its crop differs.
        if matches!(settings.estimator, Estimator::Guided { .. }) {
            return all;
        }
        let part = render(CROP, 2, &[6]).film;
        let expected = whole.film.cut(CROP);
        let pixels = expected.pixels.iter().zip(&part.pixels);
        let differ = pixels.filter(|(a, b)| a != b).count();
        let tried = format!("{name}: pixels of a crop that differ");
        all.push(Finding::new(tried, 0.0, [differ as f64]));
        all
    })
}

/// Bit-identity of renders that are stopped at many samples, each time saved to a file, loaded and continued at another
/// number of threads. Findings are computed lazily.
pub fn resume(size: Size) -> impl Iterator<Item = Finding> {
    let (stops, samples) = size.of((5, 24), (50, 120), (500, 4000));
    let scene = scene();
    ways().map(move |(name, settings)| {
        let tried = format!("{name}: pixels that differ after {stops} stops");
        match resumed(&scene, &settings, stops, samples) {
            Ok(differ) => Finding::new(tried, 0.0, [differ]),
            Err(error) => Finding::failed(error),
        }
    })
}

fn fingerprint(settings: &Settings) -> Fingerprint {
    Fingerprint {
        version: "1".into(),
        scene: "box".into(),
        settings: settings.fingerprint(),
    }
}

/// Number of pixels that differ after stops at random samples.
fn resumed(
    scene: &Scene,
    settings: &Settings,
    stops: usize,
    samples: u32,
) -> Result<f64, Box<dyn Error>> {
    let whole = picture(scene, settings, CROP, 2, &[samples]);
    let mut ends = Numbers::new(60).places(samples, stops);
    ends.push(samples);
    let resumed = resumed_at(scene, settings, &ends, blank(settings, CROP))?;
    Ok(apart(&resumed, &whole))
}

/// A picture by passes that end at these samples. Each pass has another number of threads; after each the picture is
/// saved and loaded.
pub(super) fn resumed_at(
    scene: &Scene,
    settings: &Settings,
    ends: &[u32],
    blank: Picture,
) -> Result<Picture, Box<dyn Error>> {
    let ours = fingerprint(settings);
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("a.ckpt");
    let pools = [1, 2, 3, 8].map(pool);
    let mut checkpoint = Checkpoint {
        fingerprint: ours.clone(),
        samples: 0,
        seconds: 0.0,
        amounts: settings.amounts.clone(),
        metadata: Default::default(),
        picture: blank,
    };
    for (i, &end) in ends.iter().enumerate() {
        let samples = checkpoint.samples..end;
        let picture = &mut checkpoint.picture;
        let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
        // A new integrator, as in a new process.
        let mut integrator = settings.integrator();
        pools[i % 4].install(|| integrator.pass(&view, samples, picture));
        checkpoint.samples = end;
        checkpoint.save(&path)?;
        // The next pass continues from the contents of the file alone.
        checkpoint = Checkpoint::load(&path, &ours)?;
    }
    Ok(checkpoint.picture)
}

/// Bits of the films of all modes, each read back from its checkpoint, and of a learned table.
pub(super) fn round() -> Result<Vec<u64>, Box<dyn Error>> {
    let (scene, folder) = (scene(), tempfile::tempdir()?);
    let path = folder.path().join("a.ckpt");
    let mut bits = Vec::new();
    for (_, settings) in ways() {
        let checkpoint = Checkpoint {
            fingerprint: fingerprint(&settings),
            samples: 2,
            seconds: 0.0,
            amounts: settings.amounts.clone(),
            metadata: Default::default(),
            picture: picture(&scene, &settings, Window::full(FRAME), 2, &[2]),
        };
        checkpoint.save(&path)?;
        let film = Checkpoint::load(&path, &checkpoint.fingerprint)?
            .picture
            .film;
        for m in &film.pixels {
            let numbers = [m.mean.to_array(), m.m2().to_array()].concat();
            bits.push(u64::from(m.n));
            bits.extend(numbers.into_iter().map(f64::to_bits));
        }
    }
    #[cfg(feature = "train")]
    {
        use super::learning::{crop_of, learn, quick};
        let crop = crop_of(caustic_box(), 2)?;
        let config = quick(opsr_train::config::Evaluation::Tabulated);
        let table = learn(&config, &crop, Some(folder.path()), u32::MAX)?.table;
        bits.extend(table.gammas.iter().map(|g| u64::from(g.to_bits())));
    }
    Ok(bits)
}
