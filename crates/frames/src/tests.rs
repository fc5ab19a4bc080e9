//! Films of a painted wall, whose light and noise are known.

use super::average::WINDOWS;
use super::reproject::Reprojection;
use super::surfaces::{SurfacePoint, places};
use super::{Averaged, Frame, Sequence, Surfaces};
use opsr::image::Buffer;
use opsr::image::exr::Metadata;
use opsr::image::film::Window;
use opsr::integrator::View;
use opsr::math::{Rgb, UVec2, Vec2, Vec3};
use opsr::scene::{Camera, Material, Mesh, Scene, SceneParts};
use opsr_lab::gallery::{materials, shapes};

const SIZE: UVec2 = UVec2::new(48, 32);

/// Half the height of the view.
const HALF: f32 = 1.0;

/// Side of a pixel.
const PIXEL: f32 = 2.0 * HALF / SIZE.y as f32;

/// A number in [0, 1) for a pixel of a frame.
fn random(frame: u32, pixel: usize) -> f32 {
    let mut x = u64::from(frame) << 32 | pixel as u64;
    for _ in 0..3 {
        x = (x ^ x >> 31)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15)
            .rotate_left(29);
    }
    (x >> 40) as f32 / (1u64 << 24) as f32
}

/// A camera with parallel rays, this many pixels to the right.
fn camera(shift: f32) -> Camera {
    let from = Vec3::new(shift * PIXEL, 0.0, 3.0);
    let mut camera = Camera::look_at(from, from - Vec3::Z, Vec3::Y, 1.0);
    camera.projection = opsr::scene::Projection::Orthographic { half_height: HALF };
    camera
}

/// A frame of the wall z = 0, whose radiance is `light` with independent noise of this relative deviation.
fn frame(number: u32, shift: f32, noise: f32, light: impl Fn(Vec3) -> f32) -> Frame {
    let camera = camera(shift);
    let place = |i: usize| {
        let (x, y) = ((i % SIZE.x as usize) as f32, (i / SIZE.x as usize) as f32);
        let across = (x + 0.5 - 0.5 * SIZE.x as f32 + shift) * PIXEL;
        Vec3::new(across, HALF - (y + 0.5) * PIXEL, 0.0)
    };
    let count = (SIZE.x * SIZE.y) as usize;
    let points = (0..count).map(|i| SurfacePoint::new(place(i), Vec3::Z, Rgb::splat(0.5)));
    let pixel = |i: usize| {
        let error = noise * 12f32.sqrt() * (random(number, i) - 0.5);
        Rgb::splat(light(place(i)) * (1.0 + error))
    };
    Frame {
        number,
        size: SIZE,
        window: Window::full(SIZE),
        camera,
        picture: Buffer {
            width: SIZE.x as usize,
            height: SIZE.y as usize,
            pixels: (0..count).map(pixel).collect(),
        },
        error: vec![noise; count],
        squares: Vec::new(),
        surfaces: Surfaces {
            points: points.collect(),
            before: None,
            after: None,
        },
        layers: Vec::new(),
        metadata: Metadata::new(),
    }
}

/// The averages of all frames, in their order.
fn averaged(frames: impl IntoIterator<Item = Frame>) -> Vec<Averaged> {
    let (mut sequence, mut all) = (Sequence::new(true), Vec::new());
    for frame in frames {
        all.extend(
            sequence
                .push(frame)
                .expect("frames of one size")
                .map(|(_, a)| a),
        );
    }
    while let Some((_, averaged)) = sequence.average_next() {
        all.push(averaged);
    }
    all
}

/// Mean squared relative error, and mean of the picture over that of the light.
fn errors(picture: &Buffer, truth: &Buffer) -> (f32, f32) {
    let pairs = || picture.pixels.iter().zip(&truth.pixels);
    let square = pairs()
        .map(|(a, b)| ((a.x - b.x) / b.x).powi(2))
        .sum::<f32>();
    let sum = |p: &Buffer| p.pixels.iter().map(|p| p.x).sum::<f32>();
    (
        square / truth.pixels.len() as f32,
        sum(picture) / sum(truth),
    )
}

fn smooth(place: Vec3) -> f32 {
    1.0 + 0.3 * (3.0 * place.x).sin()
}

#[test]
fn noise_of_a_still_light_is_divided() {
    // A whole number of pixels, so that no light is interpolated, and a part of one.
    for shift in [0.0, 1.0, 0.37] {
        let film = |noise| (0..9).map(move |k| frame(k, shift * k as f32, noise, smooth));
        let (all, truth) = (averaged(film(0.3)), averaged(film(0.0)));
        let middle = &all[4];
        let (square, energy) = errors(&middle.picture, &truth[4].picture);
        // Nine frames, and less where frames do not overlap.
        assert!(square < 0.2 * 0.09, "{shift}: {square}");
        assert!((energy - 1.0).abs() < 0.01, "{shift}: {energy}");
        let widest = middle.window.iter().filter(|r| **r == 4).count();
        assert!(widest as f32 > 0.8 * middle.window.len() as f32, "{widest}");
        // Surfaces move to the left as the camera moves to the right.
        let [last, next] = &middle.motion;
        for (way, expected) in [(last, shift), (next, -shift)] {
            assert!(
                way.iter()
                    .all(|way| way.distance(Vec2::new(expected, 0.0)) < 1e-3)
            );
        }
        let ends = [&all[0].motion[0], &all[8].motion[1]];
        assert!(
            ends.iter()
                .all(|way| way.iter().all(|way| *way == Vec2::ZERO))
        );
        // The stated error falls as the true one.
        let stated =
            f64::from(middle.error.iter().map(|e| e * e).sum::<f32>()) / middle.error.len() as f64;
        let ratio = stated / f64::from(square);
        assert!((0.5..4.0).contains(&ratio), "{shift}: {ratio}");
        let noise = f64::from(square / 0.09).sqrt();
        assert!(
            middle.error_ratio > noise && middle.error_ratio < 0.7,
            "{} {noise}",
            middle.error_ratio
        );
    }
}

#[test]
fn moving_shadow_is_not_smeared() {
    let light = |k: u32| {
        move |place: Vec3| {
            if place.x < 3.0 * PIXEL * (k as f32 - 4.0) {
                0.1
            } else {
                1.0
            }
        }
    };
    let film = |noise| (0..9).map(move |k| frame(k, 0.0, noise, light(k)));
    let (all, alone, truth) = (averaged(film(0.1)), film(0.1).nth(4), film(0.0).nth(4));
    let (alone, truth) = (alone.expect("frame").picture, truth.expect("frame").picture);
    let (before, after) = (errors(&alone, &truth).0, errors(&all[4].picture, &truth).0);
    assert!(after < 0.6 * before, "{before} {after}");
    // Columns that the edge crosses within four frames have narrow windows; those far from it do not.
    let narrow = |x: usize| {
        let column = (0..SIZE.y as usize).map(|y| all[4].window[y * SIZE.x as usize + x]);
        column.filter(|r| *r < 4).count() as f32 / SIZE.y as f32
    };
    let shares = [20, 24, 46].map(narrow);
    assert!(
        shares[0] > 0.9 && shares[1] > 0.9 && shares[2] < 0.2,
        "{shares:?}"
    );
}

/// A lamp that dims changes every pixel by less than its noise.
#[test]
fn dimming_lamp_keeps_its_energy() {
    let light = |k: u32| move |_: Vec3| 0.93f32.powi(k as i32 - 4).min(1.0);
    let film = |noise| (0..9).map(move |k| frame(k, 0.0, noise, light(k)));
    let (all, alone, truth) = (averaged(film(0.1)), film(0.1).nth(4), film(0.0).nth(4));
    let (alone, truth) = (alone.expect("frame").picture, truth.expect("frame").picture);
    let ((before, _), (after, energy)) = (errors(&alone, &truth), errors(&all[4].picture, &truth));
    assert!((energy - 1.0).abs() < 0.035, "{energy}");
    assert!(after < 0.5 * before, "{before} {after}");
}

#[test]
fn what_other_frames_do_not_see_is_left_alone() {
    let mut frames: Vec<Frame> = (0..9).map(|k| frame(k, 0.0, 0.2, |_| 1.0)).collect();
    let hidden = 1000;
    // Something stands before the wall there in all other frames, with another light.
    for other in frames.iter_mut().filter(|frame| frame.number != 4) {
        other.surfaces.points[hidden] = SurfacePoint::new(Vec3::Z, Vec3::Z, Rgb::splat(0.5));
        other.picture.pixels[hidden] = Rgb::splat(50.0);
        // A pixel without a surface.
        other.surfaces.points[hidden + 10] =
            SurfacePoint::new(Vec3::INFINITY, Vec3::ZERO, Rgb::ZERO);
        other.picture.pixels[hidden + 10] = Rgb::splat(50.0);
    }
    let own = frames[4].picture.clone();
    let all = averaged(frames);
    for pixel in [hidden, hidden + 10] {
        assert!((all[4].picture.pixels[pixel].x - own.pixels[pixel].x).abs() < 1e-4);
    }
}

/// A bright sample is in the squares of one frame only, and is shared among the frames that show its place.
#[test]
fn bright_samples_are_noise() {
    let pixel = 12 * SIZE.x as usize + 24;
    let frames = |bright: bool| {
        (0..9).map(move |k| {
            let mut frame = frame(k, 0.0, 0.02, smooth);
            frame.squares = vec![0.02 * 0.02; frame.error.len()];
            if bright && k == 4 {
                frame.picture.pixels[pixel] = Rgb::splat(4.0);
                frame.squares[pixel] = 4.0;
            }
            frame
        })
    };
    let [still, bright] = [false, true].map(|bright| averaged(frames(bright)));
    let added: Vec<f32> = (still.iter().zip(&bright))
        .map(|(still, bright)| bright.picture.pixels[pixel].x - still.picture.pixels[pixel].x)
        .collect();
    assert!(added[4] < 0.6, "{added:?}");
    // A third of its light is in the film, and without the mean over the frames a tenth.
    let (kept, own) = (
        added.iter().sum::<f32>(),
        4.0 - still[4].picture.pixels[pixel].x,
    );
    assert!(kept > 0.3 * own, "{kept} of {own}: {added:?}");
}

/// Radiance is interpolated between pixels of another frame; a hidden, bent or repainted surface is not found there.
#[test]
fn surfaces_are_found_between_pixels() {
    let slope = |place: Vec3| 1.0 + 0.5 * place.x;
    let (own, mut other) = (frame(0, 0.0, 0.0, slope), frame(1, 0.37, 0.0, slope));
    let pixel = 10 * SIZE.x as usize + 20;
    let variance = vec![0.2; own.error.len()];
    let reprojection = Reprojection::new(&own, pixel);
    let seen = reprojection
        .light(&other, &variance, 0.1)
        .expect("it is seen");
    let expected = own.picture.pixels[pixel].x;
    // A twentieth of a pixel.
    assert!(
        (seen.light.x - expected).abs() < 0.05 * 0.5 * PIXEL,
        "{seen:?} {expected}"
    );
    assert!(seen.weight > 0.9 && seen.weight <= 1.0 && (seen.variance - 0.2).abs() < 1e-6);
    let points = other.surfaces.points.clone();
    let place = |point: &SurfacePoint| point.position;
    let others: [fn(&SurfacePoint, Vec3) -> SurfacePoint; 3] = [
        |_, at| SurfacePoint::new(at + 0.5 * Vec3::Z, Vec3::Z, Rgb::splat(0.5)),
        |_, at| SurfacePoint::new(at, Vec3::X, Rgb::splat(0.5)),
        |_, at| SurfacePoint::new(at, Vec3::Z, Rgb::new(0.9, 0.5, 0.5)),
    ];
    for hide in others {
        other.surfaces.points = points
            .iter()
            .map(|point| hide(point, place(point)))
            .collect();
        assert_eq!(reprojection.light(&other, &variance, 0.1), None);
    }
    // Beyond the edge of the picture.
    assert_eq!(
        Reprojection::new(&own, 0).light(&frame(1, 5.0, 0.0, slope), &variance, 0.1),
        None
    );
}

#[test]
fn frames_come_in_order_and_of_one_size() {
    let mut sequence = Sequence::default();
    let mut numbers = Vec::new();
    for k in 0..7 {
        let done = sequence.push(frame(k, 0.0, 0.1, smooth)).expect("one size");
        numbers.extend(done.map(|(frame, _)| frame.number));
    }
    assert_eq!(numbers, [0, 1, 2]);
    let mut other = frame(7, 0.0, 0.1, smooth);
    other.size = UVec2::new(64, 64);
    let refused = sequence.push(other).map(|_| ()).expect_err("another size");
    assert!(refused.contains("frame 6 shows 48x32"), "{refused}");
    while let Some((frame, _)) = sequence.average_next() {
        numbers.push(frame.number);
    }
    assert_eq!(numbers, [0, 1, 2, 3, 4, 5, 6]);
}

#[test]
fn single_frame_is_itself_and_an_unknown_error_averages() {
    let alone = frame(0, 0.0, 0.3, smooth);
    let one = averaged([alone.clone()]);
    let difference = errors(&one[0].picture, &alone.picture).0;
    assert!(
        difference < 1e-12 && one[0].error_ratio == 1.0 && one[0].window.iter().all(|r| *r == 0)
    );
    let unknown = (0..9).map(|k| Frame {
        error: Vec::new(),
        ..frame(k, 0.0, 0.3, smooth)
    });
    let all = averaged(unknown);
    assert!(all[4].error.is_empty() && all[4].window.iter().all(|r| *r == 4));
    assert_eq!(WINDOWS, [0, 1, 2, 4]);
}

/// A scene of a ball at a place before a wall.
fn ball(at: Vec3, segments: u32) -> Scene {
    let mut parts = SceneParts::default();
    parts.add(
        materials::diffuse("ball", Rgb::splat(0.6)),
        [shapes::sphere(at, 0.5, segments)],
    );
    let corner = Vec3::new(-4.0, -4.0, -1.0);
    let wall = shapes::quad(corner, 8.0 * Vec3::X, 8.0 * Vec3::Y);
    parts.add(materials::diffuse("wall", Rgb::splat(0.3)), [wall]);
    Scene::new(parts)
}

#[test]
fn surfaces_move_with_their_triangles() {
    let step = Vec3::new(2.0 * PIXEL, PIXEL, 0.0);
    let scenes: Vec<Scene> = (0..9).map(|k| ball(step * (k as f32 - 4.0), 3)).collect();
    let camera = camera(0.0);
    let of = |k: usize| Surfaces::of(&View::new(&scenes[k], &camera, SIZE, Window::full(SIZE)));
    let (own, hits) = of(4);
    // A still scene gives `None`; positions in another mesh are not finite.
    assert_eq!(places(&hits, &scenes[4], &ball(Vec3::ZERO, 3)), None);
    let other = places(&hits, &scenes[4], &ball(step, 2)).expect("another mesh");
    assert!(other.iter().all(|place| !place.is_finite()));
    let moved = places(&hits, &scenes[4], &scenes[5]).expect("it moves");
    let mut balls = 0;
    for (point, place) in own.points.iter().zip(&moved) {
        let on_ball = point.position.z > -0.9;
        balls += usize::from(on_ball);
        let expected = if on_ball {
            point.position + step
        } else {
            point.position
        };
        assert!(place.distance(expected) < 1e-5, "{place} {expected}");
    }
    assert!(balls > 100, "{balls}");
    // A pattern of light that moves with the ball is averaged along the ball.
    let film = |noise: f32| {
        let frames = (0..9).map(|k| {
            let centre = step * (k as f32 - 4.0);
            let mut frame = frame(k as u32, 0.0, noise, |_| 1.0);
            let (surfaces, hits) = of(k);
            frame.surfaces = surfaces;
            if k > 0 {
                frame.surfaces.before = places(&hits, &scenes[k], &scenes[k - 1]);
            }
            if k < 8 {
                frame.surfaces.after = places(&hits, &scenes[k], &scenes[k + 1]);
            }
            for (pixel, point) in frame.picture.pixels.iter_mut().zip(&frame.surfaces.points) {
                if point.position.z > -0.9 {
                    *pixel *= 1.0 + 0.5 * (4.0 * (point.position - centre).x).sin();
                }
            }
            frame
        });
        frames.collect::<Vec<Frame>>()
    };
    let (noisy, clean) = (film(0.2), film(0.0));
    let (alone, truth) = (noisy[4].picture.clone(), clean[4].picture.clone());
    let inner = |picture: &Buffer| {
        let pairs = picture.pixels.iter().zip(&truth.pixels).zip(&own.points);
        let inner = pairs.filter(|(_, point)| point.position.z > 0.2);
        let squares = inner.map(|((a, b), _)| ((a.x - b.x) / b.x).powi(2));
        squares.sum::<f32>()
    };
    let all = averaged(noisy);
    for (point, way) in own.points.iter().zip(&all[4].motion[1]) {
        let on_ball = point.position.z > -0.9;
        let expected = if on_ball {
            Vec2::new(2.0, 1.0)
        } else {
            Vec2::ZERO
        };
        assert!(way.distance(expected) < 1e-3, "{way} {expected}");
    }
    let ratio = inner(&all[4].picture) / inner(&alone);
    assert!(ratio < 0.35, "{ratio}");
}

/// A scene of one object before the camera, and a lamp of mean light 16 in the plane of height `z`, up or down.
fn lamp_beside(material: Material, object: Mesh, z: f32, up: f32) -> Scene {
    let mut parts = SceneParts::default();
    parts.add(material, [object]);
    let (low, high) = LAMP;
    let side = if up > 0.0 { low.y } else { high.y };
    let along = Vec2::new(high.x - low.x, up * (high.y - low.y));
    let corner = Vec3::new(low.x, side, z);
    let lamp = shapes::quad(corner, along.x * Vec3::X, along.y * Vec3::Y);
    let light = Rgb::new(8.0, 16.0, 24.0);
    parts.add(materials::emitter("lamp", light), [lamp]);
    Scene::new(parts)
}

/// Two corners of the lamp, across its plane.
const LAMP: (Vec2, Vec2) = (Vec2::new(-0.83, -0.41), Vec2::new(0.37, 0.52));

/// Compares glints with an independent computation: `end` is where a camera ray ends in the plane of the lamp. Returns
/// the share of the object's pixels that agree, and the number of pixels that show the lamp.
fn glints_agree(scene: &Scene, end: impl Fn(Vec3, Vec3) -> Option<Vec2>) -> (f32, usize) {
    let (mut agree, mut all, mut lit) = (0, 0, 0);
    for shift in [-0.4, 0.3] {
        let from = Vec3::new(shift, 0.1, 3.0);
        let camera = Camera::look_at(from, from - Vec3::Z, Vec3::Y, 0.8);
        let view = View::new(scene, &camera, SIZE, Window::full(SIZE));
        let (surfaces, _) = Surfaces::of(&view);
        for (i, point) in surfaces.points.iter().enumerate() {
            let pixel = Vec2::new((i as u32 % SIZE.x) as f32, (i as u32 / SIZE.x) as f32);
            let ends = |at: Vec2| end(from, view.sensor.ray(pixel + at).dir);
            if ends(Vec2::splat(0.5)).is_none() {
                continue;
            }
            let shows = |k: usize| {
                let at = Vec2::new(k as f32 + 0.5, (3 * k % 8) as f32 + 0.5) / 8.0;
                ends(at).is_some_and(|at| at.cmpgt(LAMP.0).all() && at.cmplt(LAMP.1).all())
            };
            let rays = (0..8).filter(|k| shows(*k)).count();
            // A point has eight bits of the number.
            let close = (point.glint() - 2.0 * rays as f32).abs() <= 16.0 / 128.0;
            (agree, all) = (agree + usize::from(close), all + 1);
            lit += usize::from(rays > 0);
        }
    }
    (agree as f32 / all as f32, lit)
}

/// A mirror shows a lamp at the pixels of a mirrored camera; a ball shows it where its sphere reflects it. A thin pane
/// shows it along straight rays, a slab along rays that Snell's law shifts.
#[test]
fn glints_are_where_mirrors_and_glass_show_lamps() {
    let plane = || shapes::quad(Vec3::new(-9.0, -9.0, 0.0), 18.0 * Vec3::X, 18.0 * Vec3::Y);
    let mirror = |alpha| materials::metal("mirror", Rgb::splat(0.9), alpha);
    let beyond = |from: Vec3, dir: Vec3, depth: f32| {
        let at = from + dir * (depth / -dir.z);
        Some(at.truncate())
    };
    let scene = lamp_beside(mirror(0.0), plane(), 5.0, -1.0);
    let (share, lit) = glints_agree(&scene, |from, dir| beyond(from, dir, 8.0));
    assert!(share > 0.999 && lit > 50, "{share} {lit}");
    let rough = lamp_beside(mirror(0.2), plane(), 5.0, -1.0);
    let (share, _) = glints_agree(&rough, |_, _| Some(Vec2::INFINITY));
    assert_eq!(share, 1.0);

    let glass = materials::glass("glass", 1.5, 0.0);
    let pane = Material {
        solid: false,
        ..glass.clone()
    };
    let scene = lamp_beside(pane, plane(), -2.0, 1.0);
    let (share, lit) = glints_agree(&scene, |from, dir| beyond(from, dir, 5.0));
    assert!(share > 0.999 && lit > 50, "{share} {lit}");
    let (low, high) = (Vec3::new(-9.0, -9.0, -1.0), Vec3::new(9.0, 9.0, 0.0));
    let scene = lamp_beside(glass, shapes::cuboid(low, high), -2.0, 1.0);
    let shifted = |from: Vec3, dir: Vec3| {
        let across = dir.truncate() / 1.5;
        let inside = across / (1.0 - across.length_squared()).sqrt();
        Some(beyond(from, dir, 4.0)? + inside)
    };
    let (share, lit) = glints_agree(&scene, shifted);
    assert!(share > 0.999 && lit > 50, "{share} {lit}");

    let ball = shapes::sphere(Vec3::ZERO, 1.0, 5);
    let scene = lamp_beside(mirror(0.0), ball, 5.0, -1.0);
    let reflected = |from: Vec3, dir: Vec3| {
        let middle = -from.dot(dir);
        let root = middle * middle - from.length_squared() + 1.0;
        let normal = (root > 0.0).then(|| from + (middle - root.sqrt()) * dir)?;
        let out = dir - 2.0 * dir.dot(normal) * normal;
        let to = (normal + out * ((5.0 - normal.z) / out.z)).truncate();
        Some(if out.z > 0.0 { to } else { Vec2::INFINITY })
    };
    let (share, lit) = glints_agree(&scene, reflected);
    // Pixels at the edge of the lamp have a ray more or less: the ball is a mesh.
    assert!(share > 0.97 && lit > 10, "{share} {lit}");
}

/// Glints that pass over a still mirror stay where they are in every frame, and the mirror beside them is averaged.
#[test]
fn glints_of_other_frames_stay_there() {
    let lit = |k: u32, i: usize| (i % SIZE.x as usize).abs_diff(9 + 3 * k as usize) < 2;
    let film = |noise: f32, known: bool| {
        let of = move |k: u32| {
            let mut frame = frame(k, 0.0, noise, |_| 0.2);
            for i in (0..frame.error.len()).filter(|i| lit(k, *i)) {
                frame.picture.pixels[i] *= 100.0;
                let light = if known { 25.0 } else { 0.0 };
                frame.surfaces.points[i] = frame.surfaces.points[i].with_glint(light);
            }
            frame
        };
        (0..9).map(of).collect::<Vec<Frame>>()
    };
    let (truth, alone) = (&film(0.0, true)[4].picture, &film(0.1, true)[4].picture);
    let square = |known| {
        let all = averaged(film(0.1, known));
        assert!(all[4].motion[1].iter().all(|way| way.length() < 1e-3));
        errors(&all[4].picture, truth).0
    };
    let [unknown, known] = [false, true].map(square);
    let before = errors(alone, truth).0;
    assert!(
        known < 0.25 * before && unknown > 2.0 * known,
        "{before} {unknown} {known}"
    );
}
