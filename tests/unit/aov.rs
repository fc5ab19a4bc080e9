//! AOVs and traced paths against their picture.

use crate::image::film::{Film, Window};
use crate::integrator::aov::{Centres, LightSplit, PixelTime};
use crate::integrator::trace::trace;
use crate::integrator::{Aovs, FirstHit, Picture, Recorded, Settings, View};
use crate::math::{Rgb, UVec2, Vec2};
use crate::regularise::{Accumulated, Factors, Rule};
use crate::sampler::{Independent, Seed};
use crate::scene::Scene;
use crate::scene::finish::{Clearcoat, SheenCover};
use crate::unit::lab::gallery;
use crate::unit::support::render;
use crate::unit::support::scenes::point_light_over_plane;

const SIZE: UVec2 = UVec2::new(20, 18);

fn all(window: Window) -> Aovs {
    Aovs {
        light: Some(LightSplit::new(window)),
        ..FirstHit::new(window).into()
    }
}

fn rules() -> [Rule; 3] {
    let accumulated = Rule::Accumulated(Accumulated {
        factors: Factors::Constant(0.5),
        lambda: 0.0,
    });
    [Rule::Plain, accumulated, Rule::Mollifier(0.1)]
}

/// The picture after passes that end at these sample numbers.
fn picture(scene: &Scene, settings: &Settings, aovs: Option<Aovs>, passes: &[u32]) -> Picture {
    let mut picture = Picture {
        aovs,
        ..Picture::new(Film::new(SIZE))
    };
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    let mut start = 0;
    for &end in passes {
        settings.integrator().pass(&view, start..end, &mut picture);
        start = end;
    }
    picture
}

#[test]
fn aov_light_split_adds_up_and_equals_short_paths() {
    let mut parts = gallery::caustic_box();
    parts.lights = point_light_over_plane().lights;
    let scene = render::scene(parts);
    let window = Window::full(SIZE);
    for rule in rules() {
        let settings = Settings {
            rule,
            ..Settings::default()
        };
        let whole = picture(&scene, &settings, Some(all(window)), &[8]);
        let plain = picture(&scene, &settings, None, &[8]);
        assert_eq!(whole.film, plain.film, "AOVs change the picture");
        let short = Settings {
            max_vertices: 1,
            ..settings
        };
        let short = picture(&scene, &short, None, &[8]).film.mean();
        let light = whole.aovs.as_ref().and_then(|a| a.light.as_ref()).unwrap();
        let (emission, direct) = (light.emission(), light.direct());
        let indirect = light.indirect(&whole.film);
        let sum = |b: &crate::image::Buffer| b.pixels.iter().map(|p| p.element_sum()).sum::<f32>();
        assert!(sum(&emission) > 0.0 && sum(&direct) > 0.0 && sum(&indirect) > 0.0);
        for (i, total) in whole.film.mean().pixels.iter().enumerate() {
            let once = emission.pixels[i] + direct.pixels[i];
            let close = |a: crate::math::Rgb, b: crate::math::Rgb| {
                (a - b).abs().max_element() <= 1e-5 * (1.0 + b.max_element())
            };
            assert!(
                close(once, short.pixels[i]),
                "{i}: {once} {}",
                short.pixels[i]
            );
            assert!(close(once + indirect.pixels[i], *total), "{i}");
        }
    }
}

#[test]
fn aov_determinism_over_passes_and_checkpoint_numbers() {
    let scene = render::scene(gallery::caustic_box());
    let window = Window::full(SIZE);
    let settings = Settings::default();
    let whole = picture(&scene, &settings, Some(all(window)), &[9])
        .aovs
        .unwrap();
    let split = picture(&scene, &settings, Some(all(window)), &[2, 3, 9])
        .aovs
        .unwrap();
    assert!(whole == split);
    let timed = Aovs {
        time: Some(PixelTime::new(window)),
        ..all(window)
    };
    let timed = picture(&scene, &settings, Some(timed), &[3]).aovs.unwrap();
    let seconds = timed.time.as_ref().unwrap().seconds();
    assert!(seconds.iter().all(|&s| s > 0.0 && s < 10.0));
    // Every set of parts is read as written, and only with the exact number of values.
    for bits in 1..8u32 {
        let part = Aovs {
            first: timed.first.clone().filter(|_| bits & 1 != 0),
            light: timed.light.clone().filter(|_| bits & 2 != 0),
            time: timed.time.clone().filter(|_| bits & 4 != 0),
        };
        let mut numbers: Vec<f64> = part.numbers().collect();
        let read = Aovs::from_numbers(window, part.recorded(), &numbers).unwrap();
        assert!(read.numbers().eq(numbers.iter().copied()), "{bits}");
        assert_eq!(read.recorded(), part.recorded());
        numbers.push(0.0);
        assert!(Aovs::from_numbers(window, part.recorded(), &numbers).is_none());
        numbers.truncate(numbers.len() - 2);
        assert!(Aovs::from_numbers(window, part.recorded(), &numbers).is_none());
    }
    assert!(Aovs::from_numbers(window, Recorded::default(), &[]).is_none());
}

/// A sample chooses the coat, the sheen or the base; the albedo is the base's in every sample.
#[test]
fn aov_albedo_under_covers_has_no_noise() {
    let color = Rgb::new(0.6, 0.3, 0.1);
    let mut parts = point_light_over_plane();
    for material in &mut parts.materials {
        material.base_color = color;
        material.metallic = 0.0;
        let finish = material.finish_mut();
        finish.clearcoat = Some(Clearcoat {
            weight: 0.8,
            ..Clearcoat::default()
        });
        finish.sheen = Some(SheenCover {
            color: Rgb::new(0.2, 0.5, 0.9),
            alpha: 0.3,
            ..SheenCover::default()
        });
    }
    let scene = render::scene(parts);
    let first = FirstHit::new(Window::full(SIZE));
    let whole = picture(&scene, &Settings::default(), Some(first.into()), &[1]);
    let albedo = whole.aovs.unwrap().first.unwrap().albedo();
    let seen: Vec<&Rgb> = albedo.pixels.iter().filter(|p| **p != Rgb::ZERO).collect();
    assert!(seen.len() > 100, "{}", seen.len());
    let first = *seen[0];
    assert!((first - color).abs().max_element() < 0.05, "{first}");
    assert!(seen.iter().all(|p| **p == first));
}

#[test]
fn aov_centres_lie_on_their_surfaces() {
    let scene = render::scene(gallery::caustic_box());
    let film = Film::new(SIZE);
    let view = View::of(&scene, &scene.parts().cameras[0], &film);
    let centres = Centres::of(&view);
    let materials = scene.parts().materials.len() as f32;
    let mut met = 0;
    for (i, position) in centres.position.pixels.iter().enumerate() {
        if centres.ids[0][i] == 0.0 {
            assert_eq!((centres.ids[1][i], position.length()), (0.0, 0.0));
            continue;
        }
        met += 1;
        let aspect = SIZE.x as f32 / SIZE.y as f32;
        let (place, ..) = view
            .sensor
            .camera
            .project(*position, aspect, Vec2::ZERO)
            .unwrap();
        let expected = film.window.pixel(i).as_vec2() + Vec2::splat(0.5);
        assert!((place * SIZE.as_vec2() - expected).length() < 1e-3, "{i}");
        let [mesh, material] = [centres.ids[0][i], centres.ids[1][i]];
        assert!(mesh >= 1.0 && (1.0..=materials).contains(&material));
        let of_mesh = &scene.parts().meshes[mesh as usize - 1];
        assert_eq!(of_mesh.material as f32 + 1.0, material);
    }
    assert!(met > 200, "{met}");
}

/// Paths traced one by one have the radiance of the same samples in a render, and their parts add up.
#[test]
fn trace_of_a_pixel_equals_its_samples() {
    let mut parts = gallery::caustic_box();
    parts.lights = point_light_over_plane().lights;
    let scene = render::scene(parts);
    let mut roughened = 0;
    for rule in rules() {
        let settings = Settings {
            rule,
            ..Settings::default()
        };
        let mut film = Film::new(SIZE);
        let view = View::of(&scene, &scene.parts().cameras[0], &film.clone());
        let (tracer, seed) = (settings.tracer(settings.rule.clone()), Seed(settings.seed));
        tracer.estimate(&view, &Independent { seed }, 0..8, &mut film, &mut ());
        for (x, y) in [(3, 4), (10, 9), (10, 13), (19, 17)] {
            let paths = trace(&settings, &view, UVec2::new(x, y), 0..8).unwrap();
            let mut moments = crate::math::moments::Moments::default();
            for path in &paths {
                moments.push(path.radiance.as_dvec3());
                let light = path.vertices.iter().map(|v| v.light);
                let sum = path.emission + light.sum::<crate::math::Rgb>();
                let off = (sum - path.radiance).abs().max_element();
                assert!(
                    off <= 1e-5 * (1.0 + path.radiance.max_element()),
                    "{path:?}"
                );
                for (n, v) in path.vertices.iter().enumerate() {
                    let own = (1..4).contains(&n).then_some(n + 1);
                    let length = v.class.map(|class| class.bins().len());
                    assert!(
                        own.is_none() || length.is_none() || length == own,
                        "{path:?}"
                    );
                    assert!(v.lobe.is_some() || n + 1 == path.vertices.len());
                    roughened += u32::from(v.alpha_reg > v.alpha);
                }
            }
            let index = (y * SIZE.x + x) as usize;
            assert_eq!(film.pixels[index], moments, "{x} {y}");
        }
        assert!(trace(&settings, &view, SIZE, 0..1).is_err());
    }
    assert!(roughened > 0);
}

impl Aovs {
    /// The parts that are recorded.
    fn recorded(&self) -> Recorded {
        Recorded {
            first: self.first.is_some(),
            light: self.light.is_some(),
            time: self.time.is_some(),
        }
    }
}
