//! Emission sampling and camera connections: samples against densities.

use super::scenes::{panel, walls};
use crate::image::Buffer;
use crate::math::{Frame, Ray, Rgb, UVec2, Vec2, Vec3};
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::scene::{
    Aim, AimShares, Camera, EmissionSample, Environment, Lens, Material, Projection, PunctualLight,
    Scene, SceneParts, Sensor, Target,
};
use crate::unit::lab::gallery::materials::{diffuse, emitter};
use crate::unit::lab::verify::chi_square::{integrate, p_value};
use crate::unit::support::assert_likely;
use crate::unit::support::render::scene;
use std::f32::consts::PI;
use std::f64::consts::TAU;

const SAMPLES: u32 = 40_000;
/// Cells over z and φ, or over the unit square.
const CELLS: usize = 12;

fn emission(scene: &Scene) -> Vec<EmissionSample> {
    aimed_emission(scene, &Aim::default())
}

fn aimed_emission(scene: &Scene, aim: &Aim) -> Vec<EmissionSample> {
    let source = Independent { seed: Seed(8) };
    (0..SAMPLES)
        .filter_map(|n| {
            let mut stream = source.stream(UVec2::ZERO, n);
            scene.sample_emission(aim, stream.emission())
        })
        .collect()
}

/// p-value of points in [0, 1]² against a density, given as an integral over a cell.
fn likely(points: impl Iterator<Item = Vec2>, expected: impl Fn([f64; 2], [f64; 2]) -> f64) -> f64 {
    let mut counts = vec![0u32; CELLS * CELLS + 1];
    let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
    let mut n = 0;
    for p in points {
        counts[cell(p.y) * CELLS + cell(p.x)] += 1;
        n += 1;
    }
    let edge = |i: usize| [i as f64 / CELLS as f64, (i + 1) as f64 / CELLS as f64];
    let mut means: Vec<f64> = (0..CELLS * CELLS)
        .map(|i| f64::from(n) * expected(edge(i % CELLS), edge(i / CELLS)))
        .collect();
    // One more cell for the rest must stay empty.
    let rest = f64::from(n) - means.iter().sum::<f64>();
    assert!(rest.abs() < 0.003 * f64::from(n), "{rest} of {n} left over");
    means.push(0.0);
    p_value(&counts, &means)
}

/// p-value of directions against a density per steradian; cells over z and φ of the frame.
fn directions(
    all: impl Iterator<Item = Vec3>,
    frame: Frame,
    low: f32,
    pdf: impl Fn(Vec3) -> f32,
) -> f64 {
    let span = f64::from(1.0 - low);
    let place = |w: Vec3| {
        let l = frame.to_local(w);
        let phi = l.y.atan2(l.x) / (2.0 * PI);
        Vec2::new((l.z - low) / (1.0 - low), phi.rem_euclid(1.0))
    };
    likely(all.map(place), |x, y| {
        let f = |x: f64, y: f64| {
            let z = f64::from(low) + x * span;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let (sin, cos) = (TAU * y).sin_cos();
            let local = Vec3::new((r * cos) as f32, (r * sin) as f32, z as f32);
            f64::from(pdf(frame.to_world(local))) * span * TAU
        };
        integrate(&f, x, y, 1e-5)
    })
}

/// p-value of directions against their own densities, whose edges no quadrature resolves. The sum of 1/p over the
/// samples in a cell is its solid angle, within 4.5 standard errors. The p-value is 0 if a cell fails, else 1.
fn solid_angles(samples: &[EmissionSample], frame: Frame, low: f32) -> f64 {
    let mut cells = vec![(0.0f64, 0.0f64); CELLS * CELLS];
    let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
    for s in samples {
        let l = frame.to_local(s.ray.dir);
        let phi = (l.y.atan2(l.x) / (2.0 * PI)).rem_euclid(1.0);
        if l.z <= low {
            continue;
        }
        let (sum, squares) = &mut cells[cell((l.z - low) / (1.0 - low)) * CELLS + cell(phi)];
        let angle = 1.0 / f64::from(s.pdf.direction);
        *sum += angle;
        *squares += angle * angle;
    }
    let expected = f64::from(SAMPLES) * TAU * f64::from(1.0 - low) / (CELLS * CELLS) as f64;
    let apart = |&(sum, squares): &(f64, f64)| (sum - expected).abs() / squares.sqrt();
    let worst = cells.iter().map(apart).fold(0.0, f64::max);
    println!("worst cell {worst:.2} standard errors apart");
    if worst < 4.5 { 1.0 } else { 0.0 }
}
/// Maps the unit disk to the unit square with uniform density.
fn disk(p: Vec2) -> Vec2 {
    Vec2::new(
        p.length_squared().min(1.0),
        (p.y.atan2(p.x) / (2.0 * PI)).rem_euclid(1.0),
    )
}

fn uniform(x: [f64; 2], y: [f64; 2]) -> f64 {
    (x[1] - x[0]) * (y[1] - y[0])
}

fn dark_box() -> SceneParts {
    walls(diffuse("walls", Rgb::splat(0.5)))
}

/// Centre and radius of the scene's bounding sphere.
fn sphere(scene: &Scene) -> (Vec3, f32) {
    let (low, high) = scene.geometry().bounds();
    (0.5 * (low + high), 0.5 * low.distance(high))
}

/// Chi-square p-value of the points where rays cross the bounding sphere's disk.
fn across(scene: &Scene, samples: &[EmissionSample]) -> f64 {
    let (centre, radius) = sphere(scene);
    let points = samples.iter().map(|s| {
        let frame = Frame::from_normal(s.ray.dir);
        let l = frame.to_local(s.ray.origin - centre) / radius;
        assert!(l.z < -0.999, "the ray starts inside the scene: {l}");
        disk(Vec2::new(l.x, l.y))
    });
    likely(points, uniform)
}

/// The reverse ray, from beyond the first surface.
fn back(sample: &EmissionSample) -> Ray {
    Ray::new(sample.ray.at(2.0), -sample.ray.dir)
}

fn near(a: f32, b: f32) {
    assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
}

#[test]
fn chi_square_of_emission_from_triangles() {
    let mut p_values = Vec::new();
    for double_sided in [false, true] {
        let mut parts = dark_box();
        let material = Material {
            double_sided,
            ..emitter("light", Rgb::splat(3.0))
        };
        parts.add(material, [panel(0.8)]);
        let scene = scene(parts);
        let samples = emission(&scene);
        assert_eq!(samples.len() as u32, SAMPLES);
        // The same panel, hit by a ray.
        let up = Ray::new(Vec3::new(0.1, 1.0, 0.2), Vec3::Y);
        let surface = scene.surface(&scene.intersect(&up).expect("the panel"));
        let pdf = |w: Vec3| {
            let lit = double_sided || w.dot(surface.ng) > 0.0;
            let pdf = scene.lights().pdf_emission(&Aim::default(), &surface, w);
            if lit { pdf.direction } else { 0.0 }
        };
        for s in &samples {
            let expected = scene
                .lights()
                .pdf_emission(&Aim::default(), &surface, s.ray.dir);
            near(s.pdf.direction, expected.direction);
            near(s.pdf.position, 1.0 / 0.64);
            near(s.pdf.position, expected.position);
            near(
                s.throughput.x,
                3.0 * s.cos / (s.pdf.position * s.pdf.direction),
            );
        }
        let low = if double_sided { -1.0 } else { 0.0 };
        let frame = Frame::from_normal(surface.ng);
        let all = samples.iter().map(|s| s.ray.dir);
        let p = directions(all, frame, low, pdf);
        p_values.push((p, format!("direction, two sides {double_sided}")));
        let points = samples.iter().map(|s| {
            let p = s.ray.origin / 0.8 + 0.5;
            Vec2::new(p.x, p.z)
        });
        p_values.push((likely(points, uniform), "point".into()));
    }
    assert_likely(&p_values);
}

#[test]
fn chi_square_of_emission_from_lights_without_area() {
    let position = Vec3::new(0.1, 1.2, 0.0);
    let axis = Vec3::new(0.3, -1.0, 0.2).normalize();
    let intensity = Rgb::splat(2.0);
    let range = f32::INFINITY;
    let lights = [
        PunctualLight::Point {
            position,
            intensity,
            range,
        },
        PunctualLight::Spot {
            position,
            direction: axis,
            intensity,
            range,
            cos_inner: 0.7,
            cos_outer: 0.699,
            falloff: Default::default(),
        },
        PunctualLight::Directional {
            direction: axis,
            irradiance: intensity,
        },
    ];
    let mut p_values = Vec::new();
    for light in lights {
        let mut parts = dark_box();
        parts.lights.push(light);
        let scene = scene(parts);
        let samples = emission(&scene);
        // Density of emission samples to a point, as light sampling states it.
        let pdf = |w: Vec3| {
            let sample = scene.lights().sample(position + w, [0.5; 3].into());
            sample.map_or(0.0, |s| {
                let lights = scene.lights();
                lights.emission_over_sampling(&Aim::default(), &s, position + w)
            })
        };
        let all = samples.iter().map(|s| s.ray.dir);
        let p = match light {
            PunctualLight::Directional { .. } => {
                let (_, radius) = sphere(&scene);
                for s in &samples {
                    assert_eq!(s.ray.dir, axis);
                    near(s.pdf.position, 1.0 / (PI * radius * radius));
                    near(s.pdf.position, pdf(Vec3::Y));
                }
                across(&scene, &samples)
            }
            PunctualLight::Spot { cos_outer, .. } => {
                // Directions just inside the cone, where the falloff is not yet zero.
                samples
                    .iter()
                    .for_each(|s| near(s.pdf.direction, pdf(axis)));
                let inside = |w: Vec3| {
                    if w.dot(axis) > cos_outer {
                        pdf(axis)
                    } else {
                        0.0
                    }
                };
                directions(all, Frame::from_normal(axis), cos_outer, inside)
            }
            PunctualLight::Point { .. } => directions(all, Frame::from_normal(axis), -1.0, pdf),
        };
        p_values.push((p, format!("{light:?}")));
        for s in &samples {
            assert_eq!(s.cos, 0.0);
            assert!(s.throughput.x <= 2.0001 / (s.pdf.position * s.pdf.direction));
        }
    }
    assert_likely(&p_values);
}

#[test]
fn chi_square_of_emission_from_an_environment() {
    let mut parts = dark_box();
    let map = Buffer::from_fn(CELLS, CELLS, |x, y| Rgb::splat((1 + x * y % 7) as f32));
    parts.environment = Some(Environment::from_map(map, 0.0));
    let scene = scene(parts);
    let samples = emission(&scene);
    for s in &samples {
        let expected = scene
            .lights()
            .pdf_emission_environment(&Aim::default(), &back(s));
        near(s.pdf.position, expected.position);
        near(s.pdf.direction, expected.direction);
        assert!(s.pdf.infinite && s.cos == 1.0);
    }
    // Cells in the coordinates of the map, where the density of each is uniform.
    let place = |w: Vec3| {
        let u = 0.5 + w.x.atan2(-w.z) / (2.0 * PI);
        Vec2::new(u, w.y.acos() / PI)
    };
    let p = likely(samples.iter().map(|s| place(-s.ray.dir)), |x, y| {
        let f = |u: f64, v: f64| {
            let (sin, cos) = (v * std::f64::consts::PI).sin_cos();
            let phi = (u - 0.5) * TAU;
            let w = Vec3::new(
                (sin * phi.sin()) as f32,
                cos as f32,
                (-sin * phi.cos()) as f32,
            );
            let ray = Ray::new(Vec3::ZERO, w);
            let pdf = scene
                .lights()
                .pdf_emission_environment(&Aim::default(), &ray)
                .direction;
            f64::from(pdf) * TAU * std::f64::consts::PI * sin
        };
        integrate(&f, x, y, 1e-5)
    });
    let points = across(&scene, &samples);
    assert_likely(&[(p, "direction".into()), (points, "point".into())]);
}

/// An aim of all lights at these targets, with their shares.
fn aim(scene: &Scene, targets: &[(Vec3, f32, f32)]) -> Aim {
    scene.lights().index();
    let target = |&(centre, radius, share): &(Vec3, f32, f32)| (Target { centre, radius }, share);
    let beam = AimShares::new(targets.iter().map(target).collect());
    Aim::new(vec![Some(beam)], vec![0; scene.lights().len()])
}

/// Two targets that overlap from above, and a third inside the first.
const TARGETS: [(Vec3, f32, f32); 3] = [
    (Vec3::new(0.3, 0.2, 0.1), 0.5, 0.2),
    (Vec3::new(-0.2, 0.1, 0.2), 0.4, 0.15),
    (Vec3::new(0.4, 0.3, 0.1), 0.12, 0.15),
];

/// Directions of aimed emission against their density: point and spot lights, and area lights of one and two sides.
/// Some points of the area lights lie inside one target and in front of another.
#[test]
fn chi_square_of_aimed_directions() {
    let position = Vec3::new(0.1, 1.2, 0.0);
    let axis = Vec3::new(0.3, -1.0, 0.2).normalize();
    let (intensity, range) = (Rgb::splat(2.0), f32::INFINITY);
    let point = PunctualLight::Point {
        position,
        intensity,
        range,
    };
    let spot = PunctualLight::Spot {
        position,
        direction: axis,
        intensity,
        range,
        cos_inner: 0.3,
        cos_outer: 0.2,
        falloff: Default::default(),
    };
    let mut p_values = Vec::new();
    for light in [point, spot] {
        let mut parts = dark_box();
        parts.lights.push(light);
        let scene = scene(parts);
        let aim = aim(&scene, &TARGETS);
        let samples = aimed_emission(&scene, &aim);
        let lights = scene.lights();
        // The density of the same rays by light sampling.
        let pdf = |w: Vec3| {
            let from = position + w;
            let sample = lights.sample(from, [0.5; 3].into());
            sample.map_or(0.0, |s| lights.emission_over_sampling(&aim, &s, from))
        };
        for s in &samples {
            near(s.pdf.direction, pdf(s.ray.dir));
            assert!(s.throughput.x <= 2.001 / (s.pdf.position * s.pdf.direction));
        }
        // Samples outside of a spot's cone are dark and are omitted.
        let low = match light {
            PunctualLight::Spot { cos_outer, .. } => cos_outer,
            _ => -1.0,
        };
        let frame = Frame::from_normal(axis);
        p_values.push((solid_angles(&samples, frame, low), format!("{light:?}")));
    }
    let mut rims = 0;
    for double_sided in [false, true] {
        let mut parts = dark_box();
        let material = Material {
            double_sided,
            ..emitter("light", Rgb::splat(3.0))
        };
        // A panel so small that all its points have nearly the same cones.
        parts.add(material, [panel(2e-4)]);
        let scene = scene(parts);
        let aim = aim(
            &scene,
            &TARGETS.map(|(c, r, q)| (c + 0.9 * Vec3::Y * c.x.signum(), r, q)),
        );
        let samples = aimed_emission(&scene, &aim);
        let up = Ray::new(Vec3::new(5e-5, 1.0, 5e-5), Vec3::Y);
        let down = Ray::new(Vec3::new(5e-5, -1.0, 5e-5), Vec3::Y);
        let hit = scene.intersect(&up).or_else(|| scene.intersect(&down));
        let surface = scene.surface(&hit.expect("the panel"));
        for s in &samples {
            near(
                s.throughput.x,
                3.0 * s.cos / (s.pdf.position * s.pdf.direction),
            );
            // Except where the rim of a cone passes between two points of the panel.
            let pdf = scene
                .lights()
                .pdf_emission(&aim, &surface, s.ray.dir)
                .direction;
            rims += u32::from((pdf / s.pdf.direction - 1.0).abs() > 0.01);
        }
        assert!(rims < 100, "{rims}");
        let low = if double_sided { -1.0 } else { 0.0 };
        let p = solid_angles(&samples, Frame::from_normal(surface.ng), low);
        p_values.push((p, format!("two sides {double_sided}")));
    }
    assert_likely(&p_values);
}

/// Origins of aimed rays from infinity against their density, over the disk around the scene.
#[test]
fn chi_square_of_aimed_points() {
    let axis = Vec3::new(0.3, -1.0, 0.2).normalize();
    for sky in [false, true] {
        let mut parts = dark_box();
        if sky {
            parts.environment = Some(Environment::constant(Rgb::ONE));
        } else {
            parts.lights.push(PunctualLight::Directional {
                direction: axis,
                irradiance: Rgb::ONE,
            });
        }
        let scene = scene(parts);
        let aim = aim(&scene, &TARGETS);
        let (centre, radius) = sphere(&scene);
        let samples = aimed_emission(&scene, &aim);
        for s in &samples {
            // The density does not depend on the point along the ray.
            let seen = scene
                .lights()
                .pdf_emission_environment(&aim, &back(s))
                .position;
            if sky {
                near(s.pdf.position, seen);
            }
            let light = scene.lights().sample(s.ray.at(1.3), [0.5; 3].into());
            if !sky {
                let light = light.expect("the sun");
                let lights = scene.lights();
                near(
                    s.pdf.position,
                    lights.emission_over_sampling(&aim, &light, s.ray.at(1.3)),
                );
            }
        }
        // Every direction has its own frame: distances are from a target's centre, angles around it.
        for (place, size, _) in TARGETS {
            let inside = samples.iter().map(|s| {
                let frame = Frame::from_normal(s.ray.dir);
                let l = frame.to_local(s.ray.origin - place) / size;
                Vec2::new(l.x, l.y)
            });
            let inside: Vec<(Vec2, f32)> = (inside.zip(&samples))
                .filter(|(p, _)| p.length_squared() < 1.0)
                .map(|(p, s)| (p, s.pdf.position))
                .collect();
            // With weights 1/p points are uniform: they sum to the area of a part of the disk.
            let area = |keep: &dyn Fn(Vec2) -> bool| {
                let kept = inside.iter().filter(|(p, _)| keep(*p));
                let (sum, squares) = kept.fold((0.0, 0.0), |(sum, squares), (_, pdf)| {
                    let area = 1.0 / f64::from(*pdf);
                    (sum + area, squares + area * area)
                });
                let n = f64::from(SAMPLES);
                (sum / n, squares.sqrt() / n)
            };
            for k in 0..6 {
                let part = |p: Vec2| {
                    let [ring, turn] = disk(p).to_array();
                    (ring < 0.5) == (k % 2 == 0) && (turn * 3.0) as usize == k / 2
                };
                let (found, error) = area(&part);
                let expected = f64::from(PI * size * size) / 6.0;
                let apart = (found - expected).abs() / error;
                assert!(apart < 4.5, "sky {sky}, {k}: {found} ± {error}, {expected}");
            }
        }
        let n = samples.len() as f64;
        let everywhere: f64 = samples
            .iter()
            .map(|s| 1.0 / f64::from(s.pdf.position))
            .sum();
        let error: f64 = samples
            .iter()
            .map(|s| f64::from(s.pdf.position).powi(-2))
            .sum();
        let expected = f64::from(PI * radius * radius);
        let apart = (everywhere - n * expected).abs() / error.sqrt();
        assert!(apart < 4.5, "{everywhere} {expected} {centre}");
    }
}

/// Cameras with and without a lens, centred and shifted, each with random numbers for a point of the lens.
fn cameras() -> [(Camera, Vec2); 6] {
    let pinhole = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, Vec3::Y, 1.4);
    let parallel = Camera {
        projection: Projection::Orthographic { half_height: 1.5 },
        ..pinhole.clone()
    };
    let lens = |camera: &Camera| Camera {
        lens: Some(Lens {
            radius: 0.6,
            focus: 1.0,
        }),
        ..camera.clone()
    };
    let shifted = |camera: &Camera| Camera {
        shift: Vec2::new(0.7, -0.4),
        ..camera.clone()
    };
    let u = Vec2::new(0.9, 0.3);
    [
        (lens(&pinhole), u),
        (lens(&parallel), u),
        (shifted(&pinhole), u),
        (shifted(&lens(&parallel)), u),
        (pinhole, u),
        (parallel, u),
    ]
}

/// The rays of one pixel against the camera's density, over the plane at distance 1.
#[test]
fn chi_square_of_camera_pdf() {
    let mut p_values = Vec::new();
    for (camera, u) in cameras() {
        // A single pixel is the whole frame.
        let sensor = Sensor {
            camera: &camera,
            frame: UVec2::ONE,
        };
        let through = sensor.lens_point(|| u);
        let mut stream = Independent { seed: Seed(1) }.stream(UVec2::ZERO, 0);
        let (half, pinhole) = match camera.projection {
            Projection::Perspective { tan_half_y } => (tan_half_y, true),
            Projection::Orthographic { half_height } => (half_height, false),
        };
        let points = (0..SAMPLES).map(|_| {
            let ray = sensor.sample_ray(stream.film(), || u);
            let l = camera.frame.to_local(ray.dir);
            let t = -1.0 / l.z;
            let p = camera.frame.to_local(ray.at(t) - camera.position) / half;
            0.5 * (Vec2::new(p.x, p.y) - camera.shift) + 0.5
        });
        let p = likely(points, |x, y| {
            let f = |x: f64, y: f64| {
                let at = 2.0 * half * (Vec2::new(x as f32, y as f32) - 0.5) + half * camera.shift;
                let point = camera.position + camera.frame.to_world(at.extend(-1.0));
                let sight = (sensor.see(point, through)).expect("in the frame");
                assert_eq!(sight.parallel, !pinhole);
                // Density per area of the plane, whose normal is the camera's axis.
                let cos = sight.wo.dot(camera.frame.n);
                f64::from(sight.pdf_area(cos) * 4.0 * half * half)
            };
            integrate(&f, x, y, 1e-5)
        });
        p_values.push((p, format!("{:?} {:?}", camera.projection, camera.lens)));
    }
    assert_likely(&p_values);
}

#[test]
fn camera_sees_the_points_of_its_rays_in_their_pixels() {
    for (camera, u) in cameras() {
        let sensor = Sensor {
            camera: &camera,
            frame: UVec2::new(30, 20),
        };
        let through = sensor.lens_point(|| u);
        let mut stream = Independent { seed: Seed(2) }.stream(UVec2::ZERO, 0);
        for _ in 0..1000 {
            let place = stream.film() * Vec2::new(30.0, 20.0);
            let ray = sensor.sample_ray(place, || u);
            let distance = 0.1 + 10.0 * stream.next_1d();
            let sight = (sensor.see(ray.at(distance), through)).expect("in the frame");
            // A point on the border of two pixels may belong to either.
            let inside = (place.fract() - 0.5).abs().max_element() < 0.499;
            assert!(
                !inside || sight.pixel == place.as_uvec2(),
                "{place} {sight:?}"
            );
            assert!((sight.wo + ray.dir).length() < 1e-5);
            assert!((sight.distance / distance - 1.0).abs() < 1e-4);
            near(sight.pdf, sensor.pdf(ray.dir).pdf);
            assert_eq!(
                sensor.see(ray.at(-distance), through),
                None,
                "behind the camera"
            );
        }
        let beside = sensor.sample_ray(Vec2::new(30.01, 10.0), || u);
        assert_eq!(sensor.see(beside.at(3.0), through), None);
    }
}
