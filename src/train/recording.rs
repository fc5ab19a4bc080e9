//! What a crop's paths depend on the table with: a constant for every path, and its events.

use super::codes::Codes;
use super::event::StoredEvent;
use crate::image::film::Window;
use crate::integrator::{Event, PathObserver, Recorder};
use crate::math::{Rgb, UVec2};

/// A path with events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// What it carries whatever the table says.
    pub constant: [f32; 3],
    /// First of its events.
    pub first: u32,
    /// Number of its events, in order of depth.
    pub count: u32,
}

/// The paths of one pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Samples.
    pub samples: u32,
    /// Sum of the constants of all samples.
    pub constant: [f64; 3],
    /// Sum of their squares, over the channels.
    pub constant_squared: f64,
    /// The paths with events.
    pub paths: Vec<Path>,
}

/// A recorder of events; fork it for tiles of the same crop.
#[derive(Clone, Debug)]
pub struct Recording {
    window: Window,
    /// Row by row.
    pub pixels: Vec<Pixel>,
    /// Events of all paths.
    pub events: Vec<StoredEvent>,
    /// Roughness lists of the events.
    pub codes: Codes,
    /// Own roughness of the current path's vertices.
    alphas: Vec<f32>,
    current: usize,
    first: usize,
}

impl Recording {
    /// An empty recording of a crop.
    pub fn new(window: Window) -> Self {
        Self {
            window,
            pixels: vec![Pixel::default(); window.len()],
            events: Vec::new(),
            codes: Codes::default(),
            alphas: Vec::new(),
            current: 0,
            first: 0,
        }
    }

    /// Bytes held, near enough.
    pub fn bytes(&self) -> usize {
        let paths: usize = self.pixels.iter().map(|p| p.paths.len()).sum();
        size_of_val(self.events.as_slice()) + paths * size_of::<Path>()
    }
}

impl PathObserver for Recording {
    const EVENTS: bool = true;

    fn begin(&mut self, pixel: UVec2, _: u32) {
        let (x, y) = (pixel.x - self.window.x, pixel.y - self.window.y);
        self.current = y as usize * self.window.w as usize + x as usize;
        self.alphas.clear();
        self.first = self.events.len();
    }

    fn event(&mut self, event: &Event) {
        self.alphas.push(event.alpha);
        let code = self.codes.intern(&self.alphas);
        self.alphas.pop();
        self.events.extend(StoredEvent::new(event, code));
    }

    fn scattered(&mut self, alpha: f32) {
        self.alphas.push(alpha);
    }

    fn finish(&mut self, radiance: Rgb) {
        let pixel = &mut self.pixels[self.current];
        pixel.samples += 1;
        if !radiance.is_finite() {
            // The film refuses the sample too.
            self.events.truncate(self.first);
            return;
        }
        let mut constant = radiance.to_array();
        for event in &self.events[self.first..] {
            let x = event.recorded();
            for c in 0..3 {
                constant[c] -= x[c];
            }
        }
        // What rounding leaves of a path whose light is all in its events.
        let floor = radiance.max_element() * 1e-5;
        let constant = constant.map(|c| if c < floor { 0.0 } else { c });
        for (sum, c) in pixel.constant.iter_mut().zip(constant) {
            *sum += f64::from(c);
            pixel.constant_squared += f64::from(c) * f64::from(c);
        }
        let count = (self.events.len() - self.first) as u32;
        if count > 0 {
            pixel.paths.push(Path {
                constant,
                first: self.first as u32,
                count,
            });
        }
    }
}

impl Recorder for Recording {
    fn fork(&self) -> Self {
        Self::new(self.window)
    }

    fn join(&mut self, tile: Self) {
        let codes = self.codes.absorb(&tile.codes);
        let offset = self.events.len() as u32;
        self.events.extend(tile.events.into_iter().map(|mut event| {
            event.code = codes[event.code as usize];
            event
        }));
        for (pixel, other) in self.pixels.iter_mut().zip(tile.pixels) {
            pixel.samples += other.samples;
            pixel.constant_squared += other.constant_squared;
            for c in 0..3 {
                pixel.constant[c] += other.constant[c];
            }
            pixel.paths.extend(other.paths.into_iter().map(|path| Path {
                first: path.first + offset,
                ..path
            }));
        }
    }
}
