//! Radiance from infinity: an equirectangular map or one colour.
//!
//! +Y is up. Looking along `dir`, column u = ½ + atan2(dir.x, −dir.z)/2π (so −Z is the middle of the picture, +X to its
//! right) and row v = acos(dir.y)/π from the top, after a turn about +Y.
//!
//! Texels are looked up without interpolation, and a direction is drawn from its texel uniformly per steradian: the
//! sampling density is then exactly proportional to luminance, and a sun of a few texels at 1e5 adds no noise.

use crate::files::{self, FileError, Problem};
use crate::image::Buffer;
use crate::image::exr;
use crate::math::discrete::Distribution2D;
use crate::math::{DVec2, DVec3, Rgb, Vec2, Vec3, luminance};
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};
use std::f64::consts::PI as PI_F64;
use std::path::Path;
use std::sync::Arc;

/// Radiance from infinity. Clones share the map.
#[derive(Clone, Debug)]
pub struct Environment {
    map: Arc<Buffer>,
    /// Turn about +Y in radians.
    rotation: f32,
    /// Solid angle of a texel of each row.
    solid_angles: Arc<[f32]>,
    /// Probability of each texel, proportional to luminance times solid angle; `None` for a black map.
    texels: Option<Arc<Distribution2D>>,
}

/// Most bytes of a map's file, and of its texels in memory: far above any sky, far below the sizes that a damaged
/// header can claim.
const MAX_BYTES: u64 = 1 << 31;

impl Environment {
    /// One colour from all directions.
    pub fn constant(radiance: Rgb) -> Self {
        Self::from_map(Buffer::filled(1, 1, radiance), 0.0)
    }

    /// A map whose texels are finite and not negative, turned by `rotation` radians about +Y.
    pub fn from_map(map: Buffer, rotation: f32) -> Self {
        let solid_angles: Vec<f64> = (0..map.height).map(|y| solid_angle(&map, y)).collect();
        let weights: Vec<f64> = (map.pixels.iter().enumerate())
            .map(|(i, &texel)| f64::from(luminance(texel)) * solid_angles[i / map.width])
            .collect();
        let texels = Distribution2D::new(map.width, &weights).map(Arc::new);
        Self {
            map: map.into(),
            rotation,
            solid_angles: solid_angles.iter().map(|&s| s as f32).collect(),
            texels,
        }
    }

    /// The environment with its radiance multiplied by a factor.
    pub fn brightened(&self, factor: f32) -> Self {
        Self::from_map(self.map.map(|texel| texel * factor), self.rotation)
    }

    /// The sum of two environments, on the finer of their maps.
    pub fn plus(&self, other: &Self) -> Self {
        /// Number of samples along a side of a texel, with which the texels of the other map need not align.
        const SAMPLES: usize = 3;
        let is_finer = self.map.pixels.len() >= other.map.pixels.len();
        let (fine, coarse) = if is_finer {
            (self, other)
        } else {
            (other, self)
        };
        let Buffer { width, height, .. } = *fine.map;
        let texel = |i: usize| {
            let added = (0..SAMPLES * SAMPLES).map(|s| {
                let at = |k: usize, cell: usize| cell as f32 + (k as f32 + 0.5) / SAMPLES as f32;
                let (x, y) = (at(s % SAMPLES, i % width), at(s / SAMPLES, i / width));
                let phi = (x / width as f32 - 0.5) * TAU - fine.rotation;
                let (sin, cos) = (y / height as f32 * PI).sin_cos();
                coarse.radiance(Vec3::new(sin * phi.sin(), cos, -sin * phi.cos()))
            });
            fine.map.pixels[i] + added.sum::<Rgb>() / (SAMPLES * SAMPLES) as f32
        };
        let map = Buffer {
            width,
            height,
            pixels: (0..width * height).into_par_iter().map(texel).collect(),
        };
        Self::from_map(map, fine.rotation)
    }

    /// Loads an `.hdr` or `.exr` map, multiplied by `intensity`, turned by `rotation` radians about +Y.
    pub fn load(path: &Path, intensity: f32, rotation: f32) -> Result<Self, FileError> {
        // A pipe cannot be read twice, and opening one may block for ever.
        if std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            let what = "not a plain file; maps are read more than once";
            return Err(FileError::content(path, what));
        }
        let map = match path.extension().and_then(|e| e.to_str()) {
            Some("exr") => exr::read_rgb(path)?,
            Some("hdr") => read_hdr(path)?,
            _ => {
                return Err(FileError::content(
                    path,
                    "an environment map is an .hdr or .exr file; there are studio, sky and none beside",
                ));
            }
        };
        if map.pixels.is_empty() {
            return Err(FileError::content(path, "a map without texels"));
        }
        // Tested after the multiplication, which may overflow.
        let map = map.map(|p| p * intensity);
        let bad = |p: &Rgb| !p.is_finite() || p.min_element() < 0.0;
        if let Some(i) = map.pixels.iter().position(bad) {
            let (x, y, value) = (i % map.width, i / map.width, map.pixels[i]);
            let what =
                format!("texel ({x}, {y}) is {value}; radiance must be finite and not negative");
            return Err(FileError::content(path, what));
        }
        Ok(Self::from_map(map, rotation))
    }

    /// Passes the bytes of a map's file to `take` piece by piece, so that the hash of a scene includes its map.
    pub fn bytes(path: &Path, take: impl FnMut(&[u8])) -> Result<(), FileError> {
        files::stream(path, MAX_BYTES, take)
    }

    /// Bytes of the map and of its distribution.
    pub fn bytes_in_memory(&self) -> u64 {
        // A colour, and a running sum.
        self.map.pixels.len() as u64 * 20
    }

    /// Radiance seen when looking along `dir`.
    #[inline]
    pub fn radiance(&self, dir: Vec3) -> Rgb {
        let [x, y] = self.texel(dir);
        self.map.pixels[y * self.map.width + x]
    }

    /// The texel (column, row) in a direction.
    #[inline]
    fn texel(&self, dir: Vec3) -> [usize; 2] {
        let (place, map) = (self.place(dir), &self.map);
        let x = ((place.x * map.width as f32) as usize).min(map.width - 1);
        let y = ((place.y * map.height as f32) as usize).min(map.height - 1);
        [x, y]
    }

    /// Position of a direction in the map, in [0, 1]².
    #[inline]
    fn place(&self, dir: Vec3) -> Vec2 {
        let phi = dir.x.atan2(-dir.z) + self.rotation;
        let u = (0.5 + phi / TAU).rem_euclid(1.0);
        // The arc tangent of two components keeps its digits at the poles, unlike acos.
        let theta = dir.x.hypot(dir.z).atan2(dir.y);
        Vec2::new(u, theta / PI)
    }

    /// A direction, its radiance, and its density per steradian; `None` for a black map.
    #[inline]
    pub(crate) fn sample(&self, u: DVec2) -> Option<(Vec3, Rgb, f32)> {
        let ([x, y], inside, pmf) = self.texels.as_ref()?.sample(u);
        let (map, solid_angle) = (&self.map, self.solid_angles[y]);
        let phi = ((x as f32 + inside.x) / map.width as f32 - 0.5) * TAU - self.rotation;
        // Uniform in cos θ, measured from the nearer pole: there s = sin² ½θ = ½ (1 − cos θ) keeps its digits.
        let below = 2 * y + 1 > map.height;
        let (row, v) = if below {
            (map.height - 1 - y, 1.0 - inside.y)
        } else {
            (y, inside.y)
        };
        let edge = (row as f32 * (0.5 * PI / map.height as f32)).sin();
        let share = solid_angle * (map.width as f32 / (2.0 * TAU));
        let s = (edge * edge + v * share).min(1.0);
        let (sin, cos) = (2.0 * (s * (1.0 - s)).sqrt(), 1.0 - 2.0 * s);
        let cos = if below { -cos } else { cos };
        let dir = Vec3::new(sin * phi.sin(), cos, -sin * phi.cos());
        (pmf > 0.0).then(|| (dir, self.map.pixels[y * map.width + x], pmf / solid_angle))
    }

    /// Density of [`Environment::sample`] per steradian: the same everywhere in a texel.
    #[inline]
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        self.texels.as_ref().map_or(0.0, |texels| {
            let cell = self.texel(dir);
            texels.pmf(cell) / self.solid_angles[cell[1]]
        })
    }

    /// Luminance of the brightest texel over the mean; 1 for a black map.
    pub fn peak(&self) -> f32 {
        let luminances = self.map.pixels.iter().map(|&texel| luminance(texel));
        let mean = luminance(self.average());
        let brightest = luminances.fold(0.0, f32::max);
        if mean > 0.0 { brightest / mean } else { 1.0 }
    }

    /// Mean radiance over the sphere.
    pub fn average(&self) -> Rgb {
        let mut sum = DVec3::ZERO;
        for (y, row) in self.map.pixels.chunks_exact(self.map.width).enumerate() {
            let share = solid_angle(&self.map, y) / (4.0 * PI_F64);
            sum += row.iter().map(|p| p.as_dvec3()).sum::<DVec3>() * share;
        }
        sum.as_vec3()
    }
}

/// Solid angle of a texel of row `y`: Δφ (cos θ₀ − cos θ₁), as a product that keeps its digits at the poles.
fn solid_angle(map: &Buffer, y: usize) -> f64 {
    let step = PI_F64 / map.height as f64;
    let (middle, half) = ((y as f64 + 0.5) * step, 0.5 * step);
    4.0 * PI_F64 / map.width as f64 * middle.sin() * half.sin()
}

/// Reads a Radiance RGBE file.
pub fn read_hdr(path: &Path) -> Result<Buffer, FileError> {
    let mut reader = image::ImageReader::open(path).map_err(|e| Problem::Read(e).at(path))?;
    reader.set_format(image::ImageFormat::Hdr);
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let map = (reader.decode())
        .map_err(|e| FileError::content(path, e))?
        .into_rgb32f();
    let (width, height) = (map.width() as usize, map.height() as usize);
    let pixels = map.pixels().map(|p| Rgb::from_array(p.0)).collect();
    Ok(Buffer {
        width,
        height,
        pixels,
    })
}

#[cfg(test)]
mod tests;
