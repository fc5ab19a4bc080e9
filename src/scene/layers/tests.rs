use super::Layers;
use crate::math::{Ray, Rgb, Vec3};
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::scene::{AlphaMode, Hit, Material, Scene, SceneParts, SharedMesh, TriangleId};
use crate::unit::shapes::Placing;
use crate::unit::{materials, shapes};
use glam::{DAffine3, UVec2};

fn partly_opaque(opacity: f32) -> Material {
    Material {
        alpha_mode: AlphaMode::Blend,
        opacity,
        ..materials::diffuse("layer", Rgb::ONE)
    }
}

/// Layers of these opacities at heights 0, −1, and so on, the farthest first in scene order, above an opaque one; as
/// meshes of their own, or as instances.
fn stack(opacities: &[f32], instances: bool) -> Scene {
    let square = || shapes::quad(Vec3::new(-1.0, -1.0, 0.0), 2.0 * Vec3::X, 2.0 * Vec3::Y);
    let mut parts = SceneParts::default();
    let ground = square().moved(-50.0 * Vec3::Z);
    parts.add(materials::diffuse("ground", Rgb::ONE), [ground]);
    for (k, &opacity) in opacities.iter().enumerate().rev() {
        let height = -(k as f64);
        if instances {
            parts.add(partly_opaque(opacity), []);
            let mut mesh = square();
            mesh.material = parts.materials.len() as u32 - 1;
            let poses = vec![DAffine3::from_translation(glam::DVec3::Z * height)];
            parts.shared.push(SharedMesh { mesh, poses });
        } else {
            let mesh = square().moved(height as f32 * Vec3::Z);
            parts.add(partly_opaque(opacity), [mesh]);
        }
    }
    Scene::new(parts)
}

/// The layer that a ray from above hits, and `u` afterwards.
fn hit_layer(scene: &Scene, at: [f32; 2], u: f64) -> (usize, f64) {
    let ray = Ray::new(Vec3::new(at[0], at[1], 1.0), Vec3::NEG_Z);
    let mut u = Some(u);
    let hit = scene.intersect_drawn(&ray, &mut u).expect("the ground");
    (hit.t.round() as usize - 1, u.expect("a number"))
}

/// Shares of the rays that hit each layer.
fn shares(opacities: &[f32]) -> Vec<f64> {
    let mut through = 1.0;
    let share = |&opacity: &f32| {
        let share = through * f64::from(opacity);
        through -= share;
        share
    };
    opacities.iter().map(share).collect()
}

#[test]
fn layers_are_hit_by_the_product_of_transmittances() {
    let many = [0.1; 12];
    for opacities in [&[0.3][..], &[0.5, 0.5], &[0.3, 0.6, 0.2], &many] {
        for instances in [false, true] {
            let scene = stack(opacities, instances);
            let mut stream = Independent { seed: Seed(1) }.stream(UVec2::ZERO, 0);
            let n = 40_000;
            let mut hits = vec![(0.0, 0.0); 50];
            for _ in 0..n {
                let at = [(); 2].map(|()| 1.8 * stream.next_1d() - 0.9);
                let (layer, left) = hit_layer(&scene, at, stream.next_pick());
                let (count, sum) = &mut hits[layer.min(49)];
                *count += 1.0;
                *sum += left;
            }
            // Five standard deviations. The number is uniform after each outcome.
            for (k, share) in shares(opacities).into_iter().enumerate() {
                let (count, left) = hits[k];
                let far = 5.0 * (f64::from(n) * share * (1.0 - share)).sqrt();
                let expected = f64::from(n) * share;
                assert!(
                    (count - expected).abs() < far,
                    "{opacities:?} {k}: {count} of {n}"
                );
                let far = 5.0 / (12.0 * count).sqrt();
                assert!(
                    (left / count - 0.5).abs() < far,
                    "{opacities:?} {k}: {left}"
                );
            }
        }
    }
}

/// Stratified numbers hit each layer as often as its share, to within one.
#[test]
fn stratified_numbers_hit_layers_evenly() {
    let opacities = [0.3, 0.5, 0.2, 0.7];
    for instances in [false, true] {
        let scene = stack(&opacities, instances);
        for n in [4, 16, 50] {
            let mut hits = [0.0; 50];
            for i in 0..n {
                let u = (f64::from(i) + 0.5) / f64::from(n);
                hits[hit_layer(&scene, [0.3, 0.1], u).0.min(49)] += 1.0;
            }
            for (k, share) in shares(&opacities).into_iter().enumerate() {
                assert!(
                    (hits[k] - share * f64::from(n)).abs() <= 1.0,
                    "{n} {k}: {}",
                    hits[k]
                );
            }
        }
    }
}

/// The order in which a traversal finds layers changes no bit. Of two at one distance the one of the lower number is hit.
#[test]
fn layers_have_no_order_of_traversal() {
    let hit = |t: f32, triangle| Hit {
        t,
        triangle: TriangleId::single(triangle),
        ..Hit::default()
    };
    let layers = |order: &[u32]| {
        let layers = Layers::default();
        (order.iter()).for_each(|&i| layers.add(&hit(i as f32, i), 0.05 + 0.07 * i as f32));
        layers
    };
    let forward: Vec<u32> = (0..12).collect();
    let mixed: Vec<u32> = (0..12).map(|i| 5 * i % 12).collect();
    assert_eq!(
        layers(&forward).transmittance(),
        layers(&mixed).transmittance()
    );
    for step in 0..100 {
        let first = |order| {
            let mut u = 0.01 * f64::from(step);
            let hit = layers(order).first(None, &mut u);
            (hit.map(|hit| hit.triangle), u)
        };
        assert_eq!(first(&forward), first(&mixed));
    }
    for (behind, expected) in [(9, 7), (3, 3)] {
        let found = layers(&[7]).first(Some(hit(7.0, behind)), &mut 0.0);
        assert_eq!(
            found.map(|hit| hit.triangle),
            Some(TriangleId::single(expected))
        );
    }
}

#[test]
fn transmittance_of_layers_is_their_product() {
    for instances in [false, true] {
        let scene = stack(&[0.5, 0.25, 0.75], instances);
        let ray = |t_max| Ray {
            t_max,
            ..Ray::new(Vec3::new(0.2, 0.1, 1.0), Vec3::NEG_Z)
        };
        for (t_max, passed) in [(0.5, 1.0), (1.5, 0.5), (2.5, 0.375), (40.0, 0.093_75)] {
            assert_eq!(
                scene.open_transmittance(&ray(t_max), 0),
                Some(Rgb::splat(passed))
            );
        }
        assert_eq!(scene.open_transmittance(&ray(60.0), 0), None);
    }
}

/// A pane of partial opacity has the transmittance 1 − a + a t.
#[test]
fn partly_opaque_panes_pass_what_they_transmit() {
    let pane = |opacity| {
        let mut parts = SceneParts::default();
        let square = shapes::quad(Vec3::new(-1.0, -1.0, 0.0), 2.0 * Vec3::X, 2.0 * Vec3::Y);
        let material = Material {
            transmission: 1.0,
            ior: 4.0,
            alpha_mode: AlphaMode::Blend,
            opacity,
            ..materials::coated("pane", Rgb::ONE, 0.0)
        };
        parts.add(material, [square]);
        let scene = Scene::new(parts);
        let n = 10_000;
        let passed = (0..n).map(|i| {
            let ray = Ray {
                t_max: 2.0,
                ..Ray::new(Vec3::new(0.9 * i as f32 / n as f32, 0.1, 1.0), Vec3::NEG_Z)
            };
            scene
                .open_transmittance(&ray, 1)
                .map_or(0.0, |passed| passed.x)
        });
        passed.sum::<f32>() / n as f32
    };
    let (whole, half) = (pane(1.0), pane(0.5));
    assert!(whole < 0.95, "{whole}");
    assert!((half - 0.5 * (1.0 + whole)).abs() < 0.01, "{whole} {half}");
}
