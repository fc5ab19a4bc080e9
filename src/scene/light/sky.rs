//! Computed environments: a studio for scenes without light, and a clear sky.
//!
//! Both are maps, so that they are sampled and looked up like maps from files. Angles are in radians; azimuths turn
//! about +Y from +Z, the side that glTF's fronts face, towards +X.

use crate::image::Buffer;
use crate::math::DVec3;
use glam::DMat3;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// Rows of the studio's map.
const STUDIO_ROWS: usize = 512;

/// Rows of the sky's map: the sun is three of them high.
const SKY_ROWS: usize = 1024;

/// A map of twice as many columns as rows, of the radiance in each texel's middle.
fn map(rows: usize, radiance: impl Fn(DVec3) -> DVec3 + Sync) -> Buffer {
    let columns = 2 * rows;
    let pixels = (0..rows * columns).into_par_iter().map(|i| {
        let at = |x: usize| x as f64 + 0.5;
        radiance(direction(at(i % columns), at(i / columns), rows)).as_vec3()
    });
    Buffer {
        width: columns,
        height: rows,
        pixels: pixels.collect(),
    }
}

/// Direction of a place in a map, in texels from the top left.
fn direction(x: f64, y: f64, rows: usize) -> DVec3 {
    let step = PI / rows as f64;
    let (sin_phi, cos_phi) = (x * step - PI).sin_cos();
    let (sin, cos) = (y * step).sin_cos();
    DVec3::new(sin * sin_phi, cos, -sin * cos_phi)
}

/// The unit vector of an azimuth and an elevation.
fn towards(azimuth: f64, elevation: f64) -> DVec3 {
    let (sin, cos) = azimuth.sin_cos();
    let (up, flat) = elevation.sin_cos();
    DVec3::new(flat * sin, up, flat * cos)
}

/// 0 below `low`, 1 above `high`, smooth between.
fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A rectangular panel at infinity: its direction, its half width and half height as tangents, and its added radiance.
struct Panel {
    azimuth: f64,
    elevation: f64,
    half: [f64; 2],
    radiance: f64,
}

/// Lamps of the studio, in degrees: a large key from the front left, a tall strip from the right, a rim light from
/// behind, and a ceiling.
const PANELS: [Panel; 4] = [
    Panel {
        azimuth: -42.0,
        elevation: 42.0,
        half: [0.50, 0.42],
        radiance: 6.0,
    },
    Panel {
        azimuth: 96.0,
        elevation: 18.0,
        half: [0.18, 0.62],
        radiance: 3.0,
    },
    Panel {
        azimuth: 196.0,
        elevation: 40.0,
        half: [0.70, 0.14],
        radiance: 4.0,
    },
    Panel {
        azimuth: 0.0,
        elevation: 88.0,
        half: [0.45, 0.45],
        radiance: 1.6,
    },
];

impl Panel {
    /// Radiance in a direction; the rim is soft.
    fn at(&self, dir: DVec3) -> f64 {
        const RIM: f64 = 0.06;
        let n = towards(self.azimuth.to_radians(), self.elevation.to_radians());
        let depth = dir.dot(n);
        if depth <= 0.0 {
            return 0.0;
        }
        let s = DVec3::Y.cross(n).normalize();
        let t = n.cross(s);
        let inside = |axis: DVec3, half: f64| {
            1.0 - smoothstep(half - RIM, half + RIM, dir.dot(axis).abs() / depth)
        };
        let [wide, high] = self.half;
        self.radiance * inside(s, wide) * inside(t, high)
    }
}

/// Radiance of the studio's lower half, a floor at infinity.
const FLOOR: f64 = 0.32;

/// Albedo of a floor that the studio lights to the radiance of its lower half: a disc of it has no visible rim.
pub(in crate::scene) const FLOOR_ALBEDO: f32 = 0.16745;

/// The studio: neutral walls above an even floor, with dark flags to the left and right of the back wall for the rims of
/// glass, and four soft lamps. A white matt surface has a radiance of about 1 where the key shines, and 0.4 in its shadow.
pub(crate) fn studio() -> Buffer {
    map(STUDIO_ROWS, |dir| {
        let wall = FLOOR + 0.14 * smoothstep(0.0, 0.5, dir.y);
        let side = dir.x.abs() / dir.x.hypot(dir.z).max(1e-9);
        let flag = smoothstep(0.80, 0.88, side) * smoothstep(0.0, 0.2, dir.y);
        let above = 1.0 - smoothstep(0.55, 0.8, dir.y);
        let dark = 1.0 - 0.8 * flag * above;
        let lamps: f64 = PANELS.iter().map(|panel| panel.at(dir)).sum();
        DVec3::splat(wall * dark + lamps)
    })
}

/// A clear or hazy sky with its sun, over grey ground: Preetham, Shirley, Smits, *A Practical Analytic Model for
/// Daylight*, SIGGRAPH 1999, for sky and sunlight.
///
/// Radiance 1 is 32 kcd/m², about that of white paper in the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Elevation of the sun, from 0 to π/2.
    pub elevation: f32,
    /// Azimuth of the sun.
    pub azimuth: f32,
    /// Haze: 2 is a very clear sky, 10 a hazy one.
    pub turbidity: f32,
}

impl Default for Sky {
    /// The sun 40° high, to the left of the front.
    fn default() -> Self {
        Self {
            elevation: 40f32.to_radians(),
            azimuth: -40f32.to_radians(),
            turbidity: 3.0,
        }
    }
}

/// Luminance of radiance 1, in kcd/m².
const UNIT: f64 = 32.0;

/// Angular radius of the sun.
const SUN_RADIUS: f64 = 4.65e-3;

/// Illuminance of the sun above the air, in klx.
const SUN: f64 = 128.0;

/// Wavelengths in µm at which sunlight of red, green and blue passes the air.
const WAVELENGTHS: DVec3 = DVec3::new(0.61, 0.55, 0.465);

/// Part of the light that the ground reflects.
const GROUND: f64 = 0.2;

/// Coefficients A to E of Perez' formula for Y, x and y: slope and intercept in turbidity (Preetham et al., appendix
/// A.2).
const PEREZ: [[[f64; 2]; 5]; 3] = [
    [
        [0.1787, -1.4630],
        [-0.3554, 0.4275],
        [-0.0227, 5.3251],
        [0.1206, -2.5771],
        [-0.0670, 0.3703],
    ],
    [
        [-0.0193, -0.2592],
        [-0.0665, 0.0008],
        [-0.0004, 0.2125],
        [-0.0641, -0.8989],
        [-0.0033, 0.0452],
    ],
    [
        [-0.0167, -0.2608],
        [-0.0950, 0.0092],
        [-0.0079, 0.2102],
        [-0.0441, -1.6537],
        [-0.0109, 0.0529],
    ],
];

/// Chromaticities x and y of the zenith: rows for T², T and 1, columns for the third to the zeroth power of the sun's
/// angle from the zenith (ibid.).
const ZENITH: [[[f64; 4]; 3]; 2] = [
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ],
    [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ],
];

impl Sky {
    /// The sun's angle from the zenith.
    fn sun_angle(&self) -> f64 {
        FRAC_PI_2 - f64::from(self.elevation)
    }

    /// Luminance in kcd/m² and chromaticities x and y of the zenith.
    fn zenith(&self) -> [f64; 3] {
        let (t, s) = (f64::from(self.turbidity), self.sun_angle());
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * s);
        let luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let cubic = |[a, b, c, d]: [f64; 4]| ((a * s + b) * s + c) * s + d;
        let [x, y] = ZENITH.map(|[a, b, c]| (cubic(a) * t + cubic(b)) * t + cubic(c));
        [luminance, x, y]
    }

    /// Luminance in kcd/m² and chromaticities x and y of the sky above the horizon.
    fn sky_luminance(&self, dir: DVec3) -> [f64; 3] {
        let s = self.sun_angle();
        let sun = towards(self.azimuth.into(), self.elevation.into());
        let gamma = dir.dot(sun).clamp(-1.0, 1.0).acos();
        let t = f64::from(self.turbidity);
        let zenith = self.zenith();
        std::array::from_fn(|i| {
            let [a, b, c, d, e] = PEREZ[i].map(|[slope, at_0]| slope * t + at_0);
            let perez = |cos: f64, gamma: f64| {
                let haze = 1.0 + a * (b / cos).exp();
                haze * (1.0 + c * (d * gamma).exp() + e * gamma.cos() * gamma.cos())
            };
            zenith[i] * perez(dir.y.max(1e-3), gamma) / perez(1.0, s)
        })
    }

    /// Radiance of the sky without its sun; below the horizon that of the horizon.
    fn radiance(&self, dir: DVec3) -> DVec3 {
        let [luminance, x, y] = self.sky_luminance(dir.with_y(dir.y.max(0.0)).normalize());
        rec709(luminance.max(0.0) / UNIT, x, y).max(DVec3::ZERO)
    }

    /// Irradiance of the sun on a plane that faces it, after Rayleigh scattering and haze by Ångström's law (ibid.,
    /// A.1).
    fn sunlight(&self) -> DVec3 {
        let degrees = self.sun_angle().to_degrees();
        let mass = 1.0 / (self.sun_angle().cos() + 0.15 * (93.885 - degrees).powf(-1.253));
        let haze = 0.04608 * f64::from(self.turbidity) - 0.04586;
        let depth = |l: f64| 0.008735 * l.powf(-4.08) + haze * l.powf(-1.3);
        let passes = |l: f64| (-mass * depth(l)).exp();
        let [r, g, b] = WAVELENGTHS.to_array().map(passes);
        DVec3::new(r, g, b) * (SUN / UNIT)
    }

    pub(crate) fn map(&self) -> Buffer {
        self.turned(DMat3::IDENTITY, [1.0; 3])
    }

    /// The map of the sky turned from its own directions to the world's by a rotation; factors on sky, sun and ground.
    pub fn turned(&self, to_world: DMat3, [of_sky, of_sun, of_ground]: [f64; 3]) -> Buffer {
        // Irradiance of the ground, by a small map.
        let mut ground = self.sunlight() * f64::from(self.elevation).sin();
        const ROWS: usize = 32;
        for y in 0..ROWS / 2 {
            for x in 0..2 * ROWS {
                let dir = direction(x as f64 + 0.5, y as f64 + 0.5, ROWS);
                ground += self.radiance(dir) * dir.y * texel(y, ROWS);
            }
        }
        let ground = ground * (of_ground * GROUND / PI);
        let to_own = to_world.transpose();
        let mut sky = map(SKY_ROWS, |dir| {
            let dir = to_own * dir;
            let below = smoothstep(0.0, 0.02, -dir.y);
            (of_sky * self.radiance(dir)).lerp(ground, below)
        });
        let sun = towards(self.azimuth.into(), self.elevation.into());
        add_sun(&mut sky, to_world * sun, of_sun * self.sunlight());
        sky
    }
}

/// Adds a sun of exactly this irradiance in total, whichever texels it covers.
fn add_sun(sky: &mut Buffer, sun: DVec3, irradiance: DVec3) {
    /// Points across a texel.
    const POINTS: u32 = 8;
    let (rows, least) = (sky.height, SUN_RADIUS.cos());
    let point = |i: usize, k: u32| i as f64 + (f64::from(k) + 0.5) / f64::from(POINTS);
    let near = (SUN_RADIUS + 2.0 * PI / rows as f64).cos();
    let mut covered = Vec::new();
    for (i, _) in sky.pixels.iter().enumerate() {
        let (x, y) = (i % sky.width, i / sky.width);
        if direction(x as f64 + 0.5, y as f64 + 0.5, rows).dot(sun) < near {
            continue;
        }
        let hits = (0..POINTS * POINTS)
            .map(|k| direction(point(x, k % POINTS), point(y, k / POINTS), rows))
            .filter(|dir| dir.dot(sun) > least)
            .count();
        covered.push((i, hits as f64, hits as f64 * texel(y, rows)));
    }
    let whole: f64 = covered.iter().map(|(_, _, angle)| angle).sum();
    for (i, hits, _) in covered {
        sky.pixels[i] += (irradiance * (hits / whole)).as_vec3();
    }
}

/// Solid angle of a texel of row `y` of a map with `rows` rows.
fn texel(y: usize, rows: usize) -> f64 {
    let step = PI / rows as f64;
    2.0 * step * ((y as f64 + 0.5) * step).sin() * (0.5 * step).sin()
}

/// Linear Rec. 709 of a luminance and chromaticities.
fn rec709(luminance: f64, x: f64, y: f64) -> DVec3 {
    let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance;
    DVec3::new(
        xyz.dot(DVec3::new(3.240_969_94, -1.537_383_18, -0.498_610_76)),
        xyz.dot(DVec3::new(-0.969_243_64, 1.875_967_50, 0.041_555_06)),
        xyz.dot(DVec3::new(0.055_630_08, -0.203_976_96, 1.056_971_51)),
    )
}

#[cfg(test)]
mod tests;
