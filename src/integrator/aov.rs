//! AOVs of the first surface of each path: albedo, normal and depth, for denoisers and compositing.

use super::ShadingPoint;
use super::walk::observer::{PathObserver, Recorder};
use crate::bsdf::Bsdf;
use crate::image::Buffer;
use crate::image::film::Window;
use crate::math::{DVec3, Rgb, UVec2};

/// PixelSums over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct PixelSums {
    albedo: DVec3,
    normal: DVec3,
    depth: f64,
    hits: u32,
    samples: u32,
}

/// Records the first vertex of every path in a window.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstHit {
    window: Window,
    sums: Vec<PixelSums>,
    /// First vertices of a tile's paths, in order: index of the pixel, and the surface if the path met one.
    log: Vec<(usize, Option<Seen>)>,
}

/// Albedo, normal and depth of one first vertex.
type Seen = (Rgb, Rgb, f32);

impl FirstHit {
    /// An empty record of a window of the frame.
    pub fn new(window: Window) -> Self {
        Self {
            window,
            sums: vec![PixelSums::default(); window.len()],
            log: Vec::new(),
        }
    }

    /// Mean reflectance of the first surface; black where there is none.
    pub fn albedo(&self) -> Buffer {
        self.buffer(|s| (s.albedo / f64::from(s.samples.max(1))).as_vec3())
    }

    /// Mean world normal of the first surface; zero where there is none.
    pub fn normal(&self) -> Buffer {
        self.buffer(|s| (s.normal / f64::from(s.samples.max(1))).as_vec3())
    }

    /// Mean distance to the first surface over the paths that met one; infinity where none did. All three channels
    /// are the same.
    pub fn depth(&self) -> Buffer {
        self.buffer(|s| {
            let depth = if s.hits > 0 {
                s.depth / f64::from(s.hits)
            } else {
                f64::INFINITY
            };
            Rgb::splat(depth as f32)
        })
    }

    fn buffer(&self, f: impl Fn(&PixelSums) -> Rgb) -> Buffer {
        Buffer {
            width: self.window.w as usize,
            height: self.window.h as usize,
            pixels: self.sums.iter().map(f).collect(),
        }
    }

    /// The sums as numbers, for a checkpoint: nine a pixel.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        self.sums.iter().flat_map(|s| {
            let (a, n) = (s.albedo, s.normal);
            [
                a.x,
                a.y,
                a.z,
                n.x,
                n.y,
                n.z,
                s.depth,
                f64::from(s.hits),
                f64::from(s.samples),
            ]
        })
    }

    /// The inverse of [`FirstHit::numbers`]; `None` if their number is wrong.
    pub fn from_numbers(window: Window, numbers: &[f64]) -> Option<Self> {
        let (chunks, rest) = numbers.as_chunks::<9>();
        if chunks.len() != window.len() || !rest.is_empty() {
            return None;
        }
        let sums = chunks.iter().map(|c| PixelSums {
            albedo: DVec3::new(c[0], c[1], c[2]),
            normal: DVec3::new(c[3], c[4], c[5]),
            depth: c[6],
            hits: c[7] as u32,
            samples: c[8] as u32,
        });
        Some(Self {
            window,
            sums: sums.collect(),
            log: Vec::new(),
        })
    }
}

/// Reflectance plus transmittance of a BSDF, roughly, for denoisers to divide by.
fn albedo(bsdf: &Bsdf) -> Rgb {
    match bsdf {
        Bsdf::Diffuse(d) => d.albedo,
        Bsdf::Glossy(g) => g.f0 + g.albedo * (Rgb::ONE - g.f0),
        Bsdf::Dielectric(d) => d.tint,
        Bsdf::Thin(t) => t.tint,
    }
}

impl PathObserver for FirstHit {
    fn begin(&mut self, pixel: UVec2, _: u32) {
        let (x, y) = (pixel.x - self.window.x, pixel.y - self.window.y);
        self.log
            .push((y as usize * self.window.w as usize + x as usize, None));
    }

    fn vertex(&mut self, n: u32, distance: f32, point: &ShadingPoint<'_>) {
        if n == 1
            && let Some((_, seen)) = self.log.last_mut()
        {
            *seen = Some((albedo(&point.bsdf), point.frame.n, distance));
        }
    }
}

impl Recorder for FirstHit {
    fn fork(&self) -> Self {
        Self {
            window: self.window,
            sums: Vec::new(),
            log: Vec::new(),
        }
    }

    fn join(&mut self, tile: Self) {
        for (index, seen) in tile.log {
            let sums = &mut self.sums[index];
            sums.samples += 1;
            if let Some((albedo, normal, depth)) = seen {
                sums.albedo += albedo.as_dvec3();
                sums.normal += normal.as_dvec3();
                sums.depth += f64::from(depth);
                sums.hits += 1;
            }
        }
    }
}
