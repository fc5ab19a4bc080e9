use super::*;

/// Illuminance on the ground of the sun and of the sky, against values measured in Mitsuba: 0.777 and 0.236.
#[test]
fn skies_are_as_bright_as_mitsubas_on_the_whole() {
    let height = 40f64.to_radians();
    let sun = DVec3::new(height.cos(), 0.0, height.sin());
    let [bright, dim] = [1.0, 0.0].map(|of_sun| around(sun, DVec3::Z, 3.0, [1.0, of_sun]));
    // The upper half of a map around +z, fine enough for a sun of half a degree.
    let ground = |sky: &Environment| {
        let (rows, columns) = (2048, 4096);
        let sum: f64 = (0..rows / 2)
            .into_par_iter()
            .map(|y| {
                let (sin, cos) = ((y as f64 + 0.5) / rows as f64 * PI).sin_cos();
                let line: f64 = (0..columns)
                    .map(|x| {
                        let phi = (x as f64 + 0.5) / columns as f64 * TAU;
                        let dir = DVec3::new(sin * phi.cos(), sin * phi.sin(), cos);
                        f64::from(luminance(sky.radiance(dir.as_vec3())))
                    })
                    .sum();
                line * sin * cos
            })
            .sum();
        sum * PI * TAU / (rows * columns) as f64
    };
    let (all, alone) = (ground(&bright), ground(&dim));
    assert!(((all - alone) / 0.777 - 1.0).abs() < 0.005, "{all}");
    assert!((alone / 0.236 - 1.0).abs() < 0.005, "{alone}");
    assert_eq!(bright.radiance(Vec3::NEG_Z), Rgb::ZERO);
    // The sun is in the given direction.
    let at = |dir: DVec3| luminance(bright.radiance(dir.as_vec3()));
    assert!(at(sun) > 1000.0 * at(DVec3::new(-sun.x, 0.0, sun.z)));
}

/// The illuminance of a sky of 1 is π, and that of a bright texel follows from its solid angle and cosine.
#[test]
fn sky_illuminance_is_that_of_a_patch_that_faces_up() {
    for side in [1, 4, 64, 700] {
        let white = Buffer::filled(side, side, Rgb::ONE);
        let found = illuminance(&white);
        assert!((found / PI - 1.0).abs() < 1e-4, "{side}: {found}");
    }
    let mut sun = Buffer::filled(64, 64, Rgb::ZERO);
    let dir = DVec3::new(0.6, 0.3, 0.5).normalize();
    let [u, v] = square(dir);
    let at = (v * 64.0) as usize * 64 + (u * 64.0) as usize;
    sun.pixels[at] = Rgb::splat(7.0);
    let expected = 7.0 * 4.0 * PI / 4096.0 * dir.z;
    assert!((illuminance(&sun) / expected - 1.0).abs() < 0.02);
    let dark = Buffer::from_fn(64, 64, |x, y| {
        let below = x.abs_diff(32) + y.abs_diff(32) > 34;
        Rgb::splat(f32::from(u8::from(below)))
    });
    assert_eq!(illuminance(&dark), 0.0);
}

/// The mapping preserves areas: directions that are uniform on the sphere are uniform in the square.
#[test]
fn sky_square_is_of_equal_areas_and_its_middle_is_up() {
    assert!(square(DVec3::Z).iter().all(|x| (x - 0.5).abs() < 1e-9));
    assert!(
        square(DVec3::X)
            .iter()
            .zip([1.0, 0.5])
            .all(|(a, b)| (a - b).abs() < 1e-9)
    );
    const CELLS: usize = 8;
    let n = 200_000;
    let mut counts = [0u32; CELLS * CELLS];
    for i in 0..n {
        let at = |step: f64| ((f64::from(i) + 0.5) * step).fract();
        let (z, phi) = (
            2.0 * at(0.754_877_666_246_69) - 1.0,
            TAU * at(0.569_840_290_998_05),
        );
        let r = (1.0 - z * z).sqrt();
        let [u, v] = square(DVec3::new(r * phi.cos(), r * phi.sin(), z));
        let cell = |x: f64| ((x * CELLS as f64) as usize).min(CELLS - 1);
        counts[cell(v) * CELLS + cell(u)] += 1;
    }
    let expected = f64::from(n) / counts.len() as f64;
    for count in counts {
        assert!(
            (f64::from(count) / expected - 1.0).abs() < 0.02,
            "{counts:?}"
        );
    }
}

/// A bright texel of a map is found in its direction, and a rotation keeps its energy.
#[test]
fn sky_texels_go_where_they_belong() {
    let map = Buffer::from_fn(32, 16, |x, y| {
        Rgb::splat(f32::from(u8::from(x == 0 && y == 8)))
    });
    let sky = resampled(&map, Projection::LatLong, DMat3::IDENTITY, Rgb::ONE);
    // The left edge is −z, and u grows towards +x.
    let bright = |sky: &Environment, dir: Vec3| sky.radiance(dir.normalize()).x;
    assert!(bright(&sky, Vec3::new(0.1, -0.1, -1.0)) > 0.5);
    assert!(bright(&sky, Vec3::new(-0.3, -0.1, -1.0)) < 0.1);
    let turned = resampled(
        &map,
        Projection::LatLong,
        DMat3::from_rotation_x(0.5 * PI),
        Rgb::ONE,
    );
    assert!(bright(&turned, Vec3::new(0.1, 1.0, -0.1)) > 0.5);
    let (a, b) = (sky.average().x, turned.average().x);
    assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
}
