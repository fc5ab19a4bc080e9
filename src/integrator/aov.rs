//! AOVs for denoisers and compositing: properties of the first surface, light by the number of its scatterings, and
//! time. Each is recorded only on request.

use super::walk::observer::{PathObserver, Recorder};
use super::{ShadingPoint, View};
use crate::image::Buffer;
use crate::image::film::{Film, Window};
use crate::math::{DVec3, Rgb, UVec2, Vec2, Vec3};
use crate::scene::{Hit, Surface};
use rayon::prelude::*;
use std::time::Instant;

/// Values of a tile's paths, in order, each with the index of its pixel.
#[derive(Clone, Debug, PartialEq)]
struct Log<T> {
    window: Window,
    values: Vec<(usize, T)>,
}

impl<T: Default> Log<T> {
    fn new(window: Window) -> Self {
        Self {
            window,
            values: Vec::new(),
        }
    }

    /// Begins the path of a pixel.
    fn begin(&mut self, pixel: UVec2) {
        let (x, y) = (pixel.x - self.window.x, pixel.y - self.window.y);
        let index = y as usize * self.window.w as usize + x as usize;
        self.values.push((index, T::default()));
    }

    /// The value of the current path.
    fn current(&mut self) -> Option<&mut T> {
        self.values.last_mut().map(|(_, value)| value)
    }
}

fn buffer<T>(window: &Window, sums: &[T], f: impl Fn(&T) -> DVec3) -> Buffer {
    Buffer {
        width: window.w as usize,
        height: window.h as usize,
        pixels: sums.iter().map(|s| f(s).as_vec3()).collect(),
    }
}

/// AOVs of a render, recorded along its paths.
#[derive(Clone, Debug, PartialEq)]
pub struct Aovs {
    /// Albedo, normal, depth and coverage.
    pub first: Option<FirstHit>,
    /// Emission and direct light.
    pub(crate) light: Option<LightSplit>,
    /// Time.
    pub(crate) time: Option<PixelTime>,
}

impl From<FirstHit> for Aovs {
    fn from(first: FirstHit) -> Self {
        Self {
            first: Some(first),
            light: None,
            time: None,
        }
    }
}

/// Parts of [`Aovs`] that are recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Recorded {
    /// The first surface.
    pub first: bool,
    /// Light by the number of its scatterings.
    pub light: bool,
    /// Time.
    pub time: bool,
}

impl Recorded {
    /// All parts.
    pub(crate) const ALL: Self = Self {
        first: true,
        light: true,
        time: true,
    };

    /// The set of parts with `each` values per pixel in [`Aovs::numbers`]; the sets have different counts.
    pub(crate) fn with_numbers(each: usize) -> Option<Self> {
        let mut sets = (1..8u8).map(|bits| Self {
            first: bits & 1 != 0,
            light: bits & 2 != 0,
            time: bits & 4 != 0,
        });
        sets.find(|set| set.numbers() == each)
    }

    /// Number of parts.
    pub(crate) fn count(self) -> u64 {
        let parts = [self.first, self.light, self.time];
        parts.into_iter().map(u64::from).sum()
    }

    /// Values per pixel of each part in [`Aovs::numbers`]: of the first surface, of light, and of time.
    pub(crate) fn numbers_by_part(self) -> [usize; 3] {
        [
            FIRST_NUMBERS * usize::from(self.first),
            LIGHT_NUMBERS * usize::from(self.light),
            usize::from(self.time),
        ]
    }

    /// Values per pixel in [`Aovs::numbers`].
    pub(crate) fn numbers(self) -> usize {
        self.numbers_by_part().iter().sum()
    }
}

impl Aovs {
    /// An empty record of these parts; `None` if there are none.
    pub(crate) fn new(window: Window, recorded: Recorded) -> Option<Self> {
        let Recorded { first, light, time } = recorded;
        (first || light || time).then(|| Self {
            first: first.then(|| FirstHit::new(window)),
            light: light.then(|| LightSplit::new(window)),
            time: time.then(|| PixelTime::new(window)),
        })
    }

    /// All values, for a checkpoint: those of the first surface, of light, and of time.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        let first = self.first.iter().flat_map(FirstHit::numbers);
        let light = self.light.iter().flat_map(LightSplit::numbers);
        first
            .chain(light)
            .chain(self.time.iter().flat_map(|t| t.seconds.iter().copied()))
    }

    /// The inverse of [`Aovs::numbers`] for these parts; `None` if their count is wrong.
    pub(crate) fn from_numbers(
        window: Window,
        recorded: Recorded,
        numbers: &[f64],
    ) -> Option<Self> {
        let ends = recorded.numbers_by_part().map(|each| each * window.len());
        let (first, rest) = numbers.split_at_checked(ends[0])?;
        let (light, time) = rest.split_at_checked(ends[1])?;
        (time.len() == ends[2]).then_some(())?;
        let mut aovs = Self::new(window, recorded)?;
        if let Some(own) = &mut aovs.first {
            own.read(first);
        }
        if let Some(own) = &mut aovs.light {
            own.read(light);
        }
        if let Some(own) = &mut aovs.time {
            own.seconds = time.to_vec();
        }
        Some(aovs)
    }
}

impl PathObserver for Aovs {
    fn begin(&mut self, pixel: UVec2, sample: u32) {
        // The clock starts last and stops first.
        self.first.iter_mut().for_each(|o| o.begin(pixel, sample));
        self.light.iter_mut().for_each(|o| o.begin(pixel, sample));
        self.time.iter_mut().for_each(|o| o.begin(pixel, sample));
    }

    fn vertex(&mut self, n: u32, distance: f32, point: &ShadingPoint<'_>) {
        self.first
            .iter_mut()
            .for_each(|o| o.vertex(n, distance, point));
    }

    fn light(&mut self, scatterings: u32, value: Rgb) {
        self.light
            .iter_mut()
            .for_each(|o| o.light(scatterings, value));
    }

    fn way(&mut self, share: f32) {
        self.light.iter_mut().for_each(|o| o.way(share));
    }

    fn finish(&mut self, radiance: Rgb) {
        self.time.iter_mut().for_each(|o| o.finish(radiance));
        self.light.iter_mut().for_each(|o| o.finish(radiance));
    }
}

impl Recorder for Aovs {
    fn fork(&self) -> Self {
        Self {
            first: self.first.as_ref().map(Recorder::fork),
            light: self.light.as_ref().map(Recorder::fork),
            time: self.time.as_ref().map(Recorder::fork),
        }
    }

    fn join(&mut self, tile: Self) {
        fn both<T: Recorder>(all: &mut Option<T>, tile: Option<T>) {
            if let Some((all, tile)) = all.as_mut().zip(tile) {
                all.join(tile);
            }
        }
        both(&mut self.first, tile.first);
        both(&mut self.light, tile.light);
        both(&mut self.time, tile.time);
    }
}

// ── the first surface ──

/// Values per pixel in [`FirstHit::numbers`].
const FIRST_NUMBERS: usize = 9;

/// Sums over the samples of a pixel.
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
    sums: Vec<PixelSums>,
    /// First vertices of a tile's paths; `None` for paths that hit no surface.
    log: Log<Option<FirstVertex>>,
}

/// Albedo, normal and depth of one first vertex.
type FirstVertex = (Rgb, Rgb, f32);

impl FirstHit {
    /// An empty record of a window of the frame.
    pub fn new(window: Window) -> Self {
        Self {
            sums: vec![PixelSums::default(); window.len()],
            log: Log::new(window),
        }
    }

    /// Mean reflectance of the first surface; black where there is none.
    pub fn albedo(&self) -> Buffer {
        self.buffer(|s| s.albedo / f64::from(s.samples.max(1)))
    }

    /// Mean world normal of the first surface; zero where there is none.
    pub fn normal(&self) -> Buffer {
        self.buffer(|s| s.normal / f64::from(s.samples.max(1)))
    }

    /// Mean distance to the first surface over the paths that hit one; infinity where none did. All three channels are
    /// the same.
    pub fn depth(&self) -> Buffer {
        self.buffer(|s| {
            DVec3::splat(if s.hits > 0 {
                s.depth / f64::from(s.hits)
            } else {
                f64::INFINITY
            })
        })
    }

    /// Share of the paths that hit a surface, in [0, 1]. All three channels are the same.
    pub(crate) fn coverage(&self) -> Buffer {
        self.buffer(|s| DVec3::splat(f64::from(s.hits) / f64::from(s.samples.max(1))))
    }

    fn buffer(&self, f: impl Fn(&PixelSums) -> DVec3) -> Buffer {
        buffer(&self.log.window, &self.sums, f)
    }

    /// The sums as numbers, for a checkpoint.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
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

    /// Replaces the sums by those of [`FirstHit::numbers`].
    fn read(&mut self, numbers: &[f64]) {
        let sums = numbers.as_chunks::<FIRST_NUMBERS>().0.iter();
        let sums = sums.map(|c| PixelSums {
            albedo: DVec3::new(c[0], c[1], c[2]),
            normal: DVec3::new(c[3], c[4], c[5]),
            depth: c[6],
            hits: c[7] as u32,
            samples: c[8] as u32,
        });
        self.sums = sums.collect();
    }
}

impl PathObserver for FirstHit {
    fn begin(&mut self, pixel: UVec2, _: u32) {
        self.log.begin(pixel);
    }

    fn vertex(&mut self, n: u32, distance: f32, point: &ShadingPoint<'_>) {
        if n == 1
            && let Some(seen) = self.log.current()
        {
            *seen = Some((point.reflectance(), point.frame.n, distance));
        }
    }
}

impl Recorder for FirstHit {
    fn fork(&self) -> Self {
        Self {
            sums: Vec::new(),
            log: Log::new(self.log.window),
        }
    }

    fn join(&mut self, tile: Self) {
        for (index, seen) in tile.log.values {
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

// ── light ──

/// Values per pixel in [`LightSplit::numbers`].
const LIGHT_NUMBERS: usize = 7;

/// Sums over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct LightSums {
    emission: DVec3,
    direct: DVec3,
    samples: u32,
}

/// Records light by the number of its scatterings.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LightSplit {
    sums: Vec<LightSums>,
    /// Emission and direct light of a tile's paths.
    log: Log<[Rgb; 2]>,
    /// Emission and direct light along the current way of the last path.
    way: [Rgb; 2],
}

impl LightSplit {
    /// An empty record of a window of the frame.
    pub(crate) fn new(window: Window) -> Self {
        Self {
            sums: vec![LightSums::default(); window.len()],
            log: Log::new(window),
            way: [Rgb::ZERO; 2],
        }
    }

    /// Mean radiance straight from emitters and the environment.
    pub(crate) fn emission(&self) -> Buffer {
        self.buffer(|s| s.emission / f64::from(s.samples.max(1)))
    }

    /// Mean radiance that was scattered once.
    pub(crate) fn direct(&self) -> Buffer {
        self.buffer(|s| s.direct / f64::from(s.samples.max(1)))
    }

    /// Mean radiance that was scattered more often: the rest of the film of the same paths.
    pub(crate) fn indirect(&self, film: &Film) -> Buffer {
        let pairs = self.sums.iter().zip(&film.pixels);
        let rest =
            pairs.map(|(s, m)| m.mean - (s.emission + s.direct) / f64::from(s.samples.max(1)));
        buffer(&self.log.window, &rest.collect::<Vec<_>>(), |&rest| rest)
    }

    fn buffer(&self, f: impl Fn(&LightSums) -> DVec3) -> Buffer {
        buffer(&self.log.window, &self.sums, f)
    }

    /// The sums as numbers.
    fn numbers(&self) -> impl Iterator<Item = f64> {
        self.sums.iter().flat_map(|s| {
            let (e, d) = (s.emission, s.direct);
            [e.x, e.y, e.z, d.x, d.y, d.z, f64::from(s.samples)]
        })
    }

    /// Replaces the sums by those of [`LightSplit::numbers`].
    fn read(&mut self, numbers: &[f64]) {
        let sums = numbers.as_chunks::<LIGHT_NUMBERS>().0.iter();
        let sums = sums.map(|c| LightSums {
            emission: DVec3::new(c[0], c[1], c[2]),
            direct: DVec3::new(c[3], c[4], c[5]),
            samples: c[6] as u32,
        });
        self.sums = sums.collect();
    }
}

impl PathObserver for LightSplit {
    fn begin(&mut self, pixel: UVec2, _: u32) {
        self.log.begin(pixel);
    }

    fn light(&mut self, scatterings: u32, value: Rgb) {
        if let Some(part) = self.way.get_mut(scatterings as usize) {
            *part += value;
        }
    }

    fn way(&mut self, share: f32) {
        let way = std::mem::take(&mut self.way);
        if let Some(path) = self.log.current() {
            let parts = path.iter_mut().zip(way);
            parts.for_each(|(sum, part)| *sum += share * part);
        }
    }

    fn finish(&mut self, radiance: Rgb) {
        // The film rejects the sample too.
        if !radiance.is_finite() {
            self.log.values.pop();
        }
    }
}

impl Recorder for LightSplit {
    fn fork(&self) -> Self {
        Self {
            sums: Vec::new(),
            log: Log::new(self.log.window),
            way: [Rgb::ZERO; 2],
        }
    }

    fn join(&mut self, tile: Self) {
        for (index, [emission, direct]) in tile.log.values {
            let sums = &mut self.sums[index];
            sums.emission += emission.as_dvec3();
            sums.direct += direct.as_dvec3();
            sums.samples += 1;
        }
    }
}

// ── time ──

/// Records the time that the paths of a pixel take.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PixelTime {
    seconds: Vec<f64>,
    started: Option<Instant>,
    log: Log<f32>,
}

impl PixelTime {
    /// An empty record of a window of the frame.
    pub(crate) fn new(window: Window) -> Self {
        Self {
            seconds: vec![0.0; window.len()],
            started: None,
            log: Log::new(window),
        }
    }

    /// Seconds spent on each pixel, summed over its paths.
    pub(crate) fn seconds(&self) -> Vec<f32> {
        self.seconds.iter().map(|&s| s as f32).collect()
    }
}

impl PathObserver for PixelTime {
    fn begin(&mut self, pixel: UVec2, _: u32) {
        self.log.begin(pixel);
        self.started = Some(Instant::now());
    }

    fn finish(&mut self, _: Rgb) {
        if let Some((started, seconds)) = self.started.zip(self.log.current()) {
            *seconds = started.elapsed().as_secs_f32();
        }
    }
}

impl Recorder for PixelTime {
    fn fork(&self) -> Self {
        Self {
            seconds: Vec::new(),
            started: None,
            log: Log::new(self.log.window),
        }
    }

    fn join(&mut self, tile: Self) {
        for (index, seconds) in tile.log.values {
            self.seconds[index] += f64::from(seconds);
        }
    }
}

// ── the centres of pixels ──

/// The surface that the ray through the centre of a pixel hits; invisible boundaries of media are passed.
pub fn centre(view: &View<'_>, pixel: UVec2) -> Option<(Hit, Surface)> {
    let ray = view.sensor.ray(pixel.as_vec2() + Vec2::splat(0.5));
    view.scene.surface_seen(&ray)
}

/// AOVs that must not be averaged over surfaces, from the ray through the centre of each pixel.
#[derive(Clone, Debug)]
pub(crate) struct Centres {
    /// World position of the surface; zero where there is none.
    pub position: Buffer,
    /// Number of the mesh and of the material, from 1; zero where there is none.
    pub ids: [Vec<f32>; 2],
}

impl Centres {
    /// Traces one ray per pixel of the view.
    pub(crate) fn of(view: &View<'_>) -> Self {
        let mesh = |s: &Surface| view.scene.geometry().triangle_mesh(s.triangle);
        let found: Vec<(Vec3, [f32; 2])> = (0..view.window.len())
            .into_par_iter()
            .map(|i| match centre(view, view.window.pixel(i)) {
                Some((_, s)) => (
                    s.position,
                    [mesh(&s) + 1, s.material + 1].map(|id| id as f32),
                ),
                None => (Vec3::ZERO, [0.0; 2]),
            })
            .collect();
        let id = |k: usize| found.iter().map(|(_, ids)| ids[k]).collect();
        Self {
            position: buffer(&view.window, &found, |(p, _)| p.as_dvec3()),
            ids: [id(0), id(1)],
        }
    }
}
