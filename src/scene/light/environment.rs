//! Radiance from infinity: an equirectangular map or one colour.
//!
//! +Y is up. Looking along `dir`, column u = ½ + atan2(dir.x, −dir.z)/2π (so −Z is the middle of the picture, +X to its
//! right) and row v = acos(dir.y)/π from the top, after a turn about +Y.
//!
//! Texels are looked up without interpolation: the sampling density is then exactly proportional to what is seen, and a
//! sun of a few texels at 1e5 adds no noise of its own.

use crate::files::{self, FileError, Problem};
use crate::image::Buffer;
use crate::image::exr;
use crate::math::discrete::Distribution2D;
use crate::math::{DVec2, Rgb, Vec2, Vec3, luminance};
use std::f32::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;

/// Radiance from infinity. Clones share the map.
#[derive(Clone, Debug)]
pub struct Environment {
    map: Arc<Buffer>,
    /// Turn about +Y in radians.
    rotation: f32,
    /// Density over (u, v), proportional to luminance · sin θ; `None` for a black map.
    density: Option<Arc<Distribution2D>>,
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
        let height = map.height as f64;
        let weights: Vec<f64> = map
            .pixels
            .iter()
            .enumerate()
            .map(|(i, &texel)| {
                let row = (i / map.width) as f64;
                // Exact solid angle of the row: ∫ sin θ dθ.
                let edge = |r: f64| (std::f64::consts::PI * r / height).cos();
                f64::from(luminance(texel)) * (edge(row) - edge(row + 1.0))
            })
            .collect();
        let density = Distribution2D::new(map.width, &weights).map(Arc::new);
        Self {
            map: map.into(),
            rotation,
            density,
        }
    }

    /// Loads an `.hdr` or `.exr` map, multiplied by `intensity`, turned by `rotation` radians about +Y.
    pub fn load(path: &Path, intensity: f32, rotation: f32) -> Result<Self, FileError> {
        // A pipe is empty when it is read again, and waiting for its other end never ends.
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
                    "an environment map is an .hdr or .exr file",
                ));
            }
        };
        if map.pixels.is_empty() {
            return Err(FileError::content(path, "a map without texels"));
        }
        // After the multiplication: a texel that overflows is as bad as an infinite one.
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

    /// Hands over the bytes of a map's file piece by piece, so that the hash of a scene includes its map.
    pub fn bytes(path: &Path, take: impl FnMut(&[u8])) -> Result<(), FileError> {
        files::stream(path, MAX_BYTES, take)
    }

    /// Radiance seen when looking along `dir`.
    #[inline]
    pub fn radiance(&self, dir: Vec3) -> Rgb {
        self.texel(self.place(dir))
    }

    fn texel(&self, uv: Vec2) -> Rgb {
        let x = ((uv.x * self.map.width as f32) as usize).min(self.map.width - 1);
        let y = ((uv.y * self.map.height as f32) as usize).min(self.map.height - 1);
        self.map.pixels[y * self.map.width + x]
    }

    /// Position of a direction in the map, in [0, 1]².
    #[inline]
    fn place(&self, dir: Vec3) -> Vec2 {
        let phi = dir.x.atan2(-dir.z) + self.rotation;
        let u = (0.5 + phi / TAU).rem_euclid(1.0);
        // acos loses digits at the poles; the angle between two components does not.
        let theta = dir.x.hypot(dir.z).atan2(dir.y);
        Vec2::new(u, theta / PI)
    }

    /// A direction, its radiance, and its density per steradian; `None` for a black map.
    #[inline]
    pub fn sample(&self, u: DVec2) -> Option<(Vec3, Rgb, f32)> {
        let (uv, pdf) = self.density.as_ref()?.sample(u);
        let (sin, cos) = (uv.y * PI).sin_cos();
        let phi = (uv.x - 0.5) * TAU - self.rotation;
        let dir = Vec3::new(sin * phi.sin(), cos, -sin * phi.cos());
        (sin > 0.0 && pdf > 0.0).then(|| (dir, self.texel(uv), pdf / (2.0 * PI * PI * sin)))
    }

    /// Density of [`Environment::sample`] per steradian.
    #[inline]
    pub fn pdf(&self, dir: Vec3) -> f32 {
        let sin = dir.x.hypot(dir.z);
        match &self.density {
            Some(density) if sin > 0.0 => density.pdf(self.place(dir)) / (2.0 * PI * PI * sin),
            _ => 0.0,
        }
    }

    /// Mean radiance over the sphere.
    pub fn average(&self) -> Rgb {
        let height = self.map.height as f64;
        let mut sum = crate::math::DVec3::ZERO;
        for (y, row) in self.map.pixels.chunks_exact(self.map.width).enumerate() {
            let edge = |r: f64| (std::f64::consts::PI * r / height).cos();
            let share = (edge(y as f64) - edge(y as f64 + 1.0)) / (2.0 * self.map.width as f64);
            sum += row.iter().map(|p| p.as_dvec3()).sum::<crate::math::DVec3>() * share;
        }
        sum.as_vec3()
    }
}

/// Reads a Radiance RGBE file.
fn read_hdr(path: &Path) -> Result<Buffer, FileError> {
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
