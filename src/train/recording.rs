//! What a crop's paths depend on the table with: a constant for every path, and its events.

use super::codes::Codes;
use super::drawn::Drawn;
use super::event::StoredEvent;
use crate::image::film::Window;
use crate::integrator::{Event, PathObserver, Recorder};
use crate::math::{Rgb, UVec2};
use std::sync::Arc;

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
    /// What lobes are drawn with.
    drawn: Option<Arc<Drawn>>,
    /// α′ of every code with each of its factors, while paths are traced.
    at: Vec<f32>,
    /// Own roughness of the current path's vertices.
    alphas: Vec<f32>,
    current: usize,
    first: usize,
    /// What the current path's events have contributed.
    counted: Rgb,
}

impl Recording {
    /// An empty recording of a crop whose lobes are drawn with several factors.
    pub fn drawn(window: Window, drawn: Arc<Drawn>) -> Self {
        Self {
            drawn: Some(drawn),
            ..Self::new(window)
        }
    }

    /// An empty recording of a crop, every event drawn at its own roughness.
    pub fn new(window: Window) -> Self {
        Self {
            window,
            pixels: vec![Pixel::default(); window.len()],
            events: Vec::new(),
            codes: Codes::default(),
            drawn: None,
            at: Vec::new(),
            alphas: Vec::new(),
            current: 0,
            first: 0,
            counted: Rgb::ZERO,
        }
    }

    /// The code of the current path as it ends with a vertex of this roughness.
    fn code(&mut self, alpha: f32) -> u32 {
        self.alphas.push(alpha);
        let known = self.codes.len();
        let code = self.codes.intern(&self.alphas);
        if self.codes.len() > known
            && let Some(drawn) = &self.drawn
        {
            self.at.extend(drawn.alphas(&self.alphas));
        }
        self.alphas.pop();
        code
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
        self.counted = Rgb::ZERO;
    }

    fn draws(&mut self, alpha: f32) -> Vec<f32> {
        let Some(count) = self.drawn.as_ref().map(|drawn| drawn.count()) else {
            return Vec::new();
        };
        let code = self.code(alpha) as usize;
        // The tracer draws with the first itself.
        self.at[code * count..][1..count].to_vec()
    }

    fn event(&mut self, event: &Event) {
        let code = self.code(event.alpha);
        let found = event.query.at(event.alpha_reg);
        let (drawn, draws) = match &self.drawn {
            None => (found.pdf_w, 1),
            Some(drawn) => {
                let at = code as usize * drawn.count();
                let alphas = &self.at[at..][..drawn.count()];
                (Drawn::pdf(&event.query, alphas), drawn.count())
            }
        };
        if let Some(kept) = StoredEvent::new(event, drawn, draws, code) {
            self.events.push(kept);
            if event.counted {
                let density = if event.delta_light {
                    event.pdf_light
                } else {
                    event.pdf_light + found.pdf_w
                };
                self.counted += event.radiance * found.value / density;
            }
        }
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
        let constant = (radiance - self.counted).to_array();
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
        match &self.drawn {
            Some(drawn) => Self::drawn(self.window, drawn.clone()),
            None => Self::new(self.window),
        }
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
