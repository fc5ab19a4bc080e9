//! Environment maps of other renderers, resampled to this project's projection and axes.

use glam::{DMat3, DVec3};
use opsr::image::Buffer;
use opsr::math::{Rgb, Vec3, luminance};
use opsr::scene::Environment;
use opsr::scene::light::sky::Sky;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// Projection of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// Mitsuba's: latitude and longitude, the top row at +y and the bottom row at −y, the left edge at −z, bilinear.
    LatLong,
    /// The same, with texel centres half a row from the poles, as in pbrt-v3.
    LatLongBetween,
    /// pbrt's: an equal-area octahedral map with constant texels.
    EqualArea,
}

/// Most rows of a resampled map.
const MAX_ROWS: usize = 4096;

/// Samples of each texel along a side.
const SAMPLES: usize = 3;

/// The environment of a map, multiplied by `factor`. `to_world` takes the map's directions to the world.
pub fn resampled(
    map: &Buffer,
    projection: Projection,
    to_world: DMat3,
    factor: Rgb,
) -> Environment {
    // Twice the rows: a rotated map must not blur small suns.
    let rows = (2 * map.height).clamp(64, MAX_ROWS);
    let columns = 2 * rows;
    let back = to_world.inverse();
    let pixels = (0..rows * columns).into_par_iter().map(|i| {
        let mut sum = Vec3::ZERO;
        for s in 0..SAMPLES * SAMPLES {
            let at = |k: usize, cell: usize| cell as f64 + (k as f64 + 0.5) / SAMPLES as f64;
            let (x, y) = (at(s % SAMPLES, i % columns), at(s / SAMPLES, i / columns));
            let (theta, phi) = (y / rows as f64 * PI, x / columns as f64 * TAU - PI);
            let (sin, cos) = theta.sin_cos();
            let dir = DVec3::new(sin * phi.sin(), cos, -sin * phi.cos());
            let own = (back * dir).normalize_or(DVec3::Y);
            sum += match projection {
                Projection::LatLong => lat_long(map, own, false),
                Projection::LatLongBetween => lat_long(map, own, true),
                Projection::EqualArea => equal_area(map, own),
            };
        }
        sum * factor / (SAMPLES * SAMPLES) as f32
    });
    let made = Buffer {
        width: columns,
        height: rows,
        pixels: pixels.collect(),
    };
    Environment::from_map(made, 0.0)
}

/// Illuminance of Mitsuba's sky and of its sun over this project's, at scales of 1, a turbidity of 3 and a sun 40°
/// high. Mitsuba 3.9 has the sky of Hosek and Wilkie (`tests/bench/skies_by_mitsuba.py`).
const OF_MITSUBA: [f64; 2] = [0.274, 0.4511];

/// A sky around the zenith, with scales of sky and sun in Mitsuba's units. It is black below, as in Mitsuba.
pub fn around(sun: DVec3, zenith: DVec3, turbidity: f32, scales: [f64; 2]) -> Environment {
    let height = sun.dot(zenith).clamp(0.0, 1.0);
    let front = (sun - zenith * sun.dot(zenith)).try_normalize();
    let front = front.unwrap_or(zenith.any_orthonormal_vector());
    let sky = Sky {
        elevation: height.asin() as f32,
        azimuth: 0.0,
        turbidity,
    };
    let to_world = DMat3::from_cols(zenith.cross(front), zenith, front);
    let [of_sky, of_sun] = [0, 1].map(|i| scales[i] * OF_MITSUBA[i]);
    Environment::from_map(sky.turned(to_world, [of_sky, of_sun, 0.0]), 0.0)
}

fn lat_long(map: &Buffer, dir: DVec3, between: bool) -> Rgb {
    let u = (dir.x.atan2(-dir.z) / TAU).rem_euclid(1.0);
    let v = dir.x.hypot(dir.z).atan2(dir.y) / PI;
    let (w, h) = (map.width, map.height);
    let x = u * w as f64 - 0.5;
    let y = match between {
        true => (v * h as f64 - 0.5).clamp(0.0, (h - 1) as f64),
        false => v * (h - 1) as f64,
    };
    let (fx, fy) = ((x - x.floor()) as f32, y.fract() as f32);
    let column = |k: i64| (x.floor() as i64 + k).rem_euclid(w as i64) as usize;
    let row = |k: usize| (y as usize + k).min(h - 1);
    let at = |i: i64, j: usize| map.pixels[row(j) * w + column(i)];
    let line = |j| at(0, j).lerp(at(1, j), fx);
    line(0).lerp(line(1), fy)
}

/// Equal-area map of a direction to [0, 1]² (Clarberg: *Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD*, 2008;
/// `[PBRT4 §3.8.3]`).
fn square(dir: DVec3) -> [f64; 2] {
    let (x, y, z) = (dir.x.abs(), dir.y.abs(), dir.z.abs());
    let r = (1.0 - z).max(0.0).sqrt();
    let phi = if x == 0.0 && y == 0.0 {
        0.0
    } else {
        y.atan2(x) / (2.0 * FRAC_PI_4)
    };
    let (mut v, mut u) = (phi * r, r - phi * r);
    if dir.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    [
        0.5 * (u.copysign(dir.x) + 1.0),
        0.5 * (v.copysign(dir.y) + 1.0),
    ]
}

fn equal_area(map: &Buffer, dir: DVec3) -> Rgb {
    let [u, v] = square(dir);
    let place = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
    map.pixels[place(v, map.height) * map.width + place(u, map.width)]
}

/// Illuminance of an equal-area map on a patch that faces +z of the map. Equal areas of the square are equal solid
/// angles; texels of small maps are wide, so they are integrated in parts.
pub fn illuminance(map: &Buffer) -> f64 {
    /// Least parts along a side.
    const PARTS: usize = 512;
    let part = |side: usize| PARTS.div_ceil(side);
    let (columns, rows) = (part(map.width), part(map.height));
    // Distances from the middle of the square, in [0, 1].
    let away = |i: usize, n: usize| (2.0 * (i as f64 + 0.5) / n as f64 - 1.0).abs();
    let (w, h) = (columns * map.width, rows * map.height);
    let mut sum = 0.0;
    for y in 0..h {
        for x in 0..w {
            // The inverse of `square`: z = 1 − r², r = |x| + |y|, in the upper half, where r is at most 1.
            let r = away(x, w) + away(y, h);
            let texel = map.pixels[y / rows * map.width + x / columns];
            sum += f64::from(luminance(texel)) * (1.0 - r * r).max(0.0);
        }
    }
    4.0 * PI * sum / (w * h) as f64
}

#[cfg(test)]
mod tests;
