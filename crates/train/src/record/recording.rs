//! Recordings: for every path of a crop a constant and the events that depend on the table.

use crate::record::event::StoredEvent;
use crate::record::lists::{Interner, RoughnessLists};
use crate::record::proposals::Proposals;
use crate::record::roulette::EventRoulette;
use opsr::bsdf::SharedNumbers;
use opsr::image::film::Window;
use opsr::integrator::{Event, PathObserver, Recorder, ShadingPoint, Technique};
use opsr::math::{Rgb, UVec2};
use opsr::sampler::IndependentStream;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A path with events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedPath {
    /// Contribution that does not depend on the table.
    pub constant: [f32; 3],
    /// Index of its first event.
    pub first: u32,
    /// Number of its events, in order of depth.
    pub count: u32,
}

/// The paths of one pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedPixel {
    /// Number of samples.
    pub samples: u32,
    /// Sum of the constants of all samples.
    pub constant: [f64; 3],
    /// Sum of their squares, over the channels.
    pub constant_squared: f64,
    /// The paths with events.
    pub paths: Vec<RecordedPath>,
}

/// The paths of a crop.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Row by row.
    pub pixels: Vec<RecordedPixel>,
    /// Events of all paths.
    pub events: Vec<StoredEvent>,
    /// Roughness lists of the events.
    pub lists: RoughnessLists,
}

/// Path observer that collects a [`Recording`]. Each tile of a crop is recorded by a fork.
#[derive(Clone, Debug)]
pub struct Tape {
    window: Window,
    /// Row by row.
    pixels: Vec<RecordedPixel>,
    /// Events of all paths.
    events: Vec<StoredEvent>,
    /// Roughness lists of all vertices.
    lists: Interner,
    /// Proposals of lobe samples, and the roulette over events; `None` for one sample with the renderer's roughness.
    drawn: Option<Arc<(Proposals, EventRoulette)>>,
    /// α′ of the proposals at the last vertex of every code, and the end of each code's values.
    drawn_at: Vec<f32>,
    drawn_ends: Vec<usize>,
    /// Code of the current path before the current vertex, and before the previous one.
    before: Option<u32>,
    before_previous: Option<u32>,
    /// Roughness and code of the current vertex.
    vertex: Option<(f32, u32)>,
    /// Index of the current pixel.
    current: usize,
    /// Index of the current path's first event.
    first: usize,
    /// Random numbers of the roulette on the current path.
    roulette: Option<IndependentStream>,
    /// Contribution of the current path's events.
    counted: Rgb,
    /// Set by the user to end the recording.
    stop: Arc<AtomicBool>,
}

/// Marks the lists that have events.
fn used(lists: &Interner, events: &[StoredEvent]) -> Vec<bool> {
    let mut used = vec![false; lists.len()];
    for event in events {
        used[event.code as usize] = true;
    }
    used
}

impl From<Tape> for Recording {
    fn from(tape: Tape) -> Self {
        let (lists, place) = tape.lists.sorted(&used(&tape.lists, &tape.events));
        let mut events = tape.events;
        for event in &mut events {
            event.code = place[event.code as usize];
        }
        Self {
            pixels: tape.pixels,
            events,
            lists,
        }
    }
}

impl Recording {
    /// The events of a path, in order of depth.
    #[inline]
    pub(crate) fn events_of(&self, path: &RecordedPath) -> &[StoredEvent] {
        &self.events[path.first as usize..][..path.count as usize]
    }

    /// Approximate memory in bytes.
    pub fn bytes(&self) -> usize {
        let paths: usize = self.pixels.iter().map(|p| p.paths.len()).sum();
        size_of_val(self.events.as_slice()) + paths * size_of::<RecordedPath>()
    }
}

impl Tape {
    /// An empty tape. Lobes are sampled with several factors, and faint events undergo Russian roulette.
    pub fn drawn(window: Window, drawn: Arc<(Proposals, EventRoulette)>) -> Self {
        Self {
            drawn: Some(drawn),
            ..Self::new(window)
        }
    }

    /// An empty tape. Lobes are sampled once, with the renderer's roughness.
    pub fn new(window: Window) -> Self {
        Self {
            window,
            pixels: vec![RecordedPixel::default(); window.len()],
            events: Vec::new(),
            lists: Interner::default(),
            drawn: None,
            drawn_at: Vec::new(),
            drawn_ends: Vec::new(),
            before: None,
            before_previous: None,
            vertex: None,
            current: 0,
            first: 0,
            roulette: None,
            counted: Rgb::ZERO,
            stop: Arc::default(),
        }
    }

    /// Ends the recording as soon as `stop` is set.
    pub fn until(self, stop: Arc<AtomicBool>) -> Self {
        Self { stop, ..self }
    }

    /// Code of the current path up to the current vertex, which has roughness `alpha`.
    #[inline]
    fn code(&mut self, alpha: f32) -> u32 {
        match self.vertex {
            Some((known, code)) if known == alpha => code,
            _ => {
                let code = self.intern(self.before, alpha);
                self.vertex = Some((alpha, code));
                code
            }
        }
    }

    fn intern(&mut self, before: Option<u32>, alpha: f32) -> u32 {
        let known = self.lists.len();
        let code = self.lists.intern(before, alpha);
        if self.lists.len() > known
            && let Some(drawn) = &self.drawn
        {
            drawn.0.alphas(&self.lists.list(code), &mut self.drawn_at);
            self.drawn_ends.push(self.drawn_at.len());
        }
        code
    }

    /// Stores an event if it survives the roulette; `brightest` is the largest integrand over all proposals.
    fn keep(&mut self, event: StoredEvent, brightest: Rgb) {
        let roulette = self.drawn.as_ref().map(|drawn| &drawn.1);
        let weight = match (roulette, &mut self.roulette) {
            (Some(roulette), Some(stream)) => {
                roulette.weight(self.current, event.size(brightest), stream)
            }
            _ => Some(1.0),
        };
        self.events.extend(weight.map(|times| event.times(times)));
    }

    /// Range in `drawn_at` of the proposals' α′ at the last vertex of a code.
    fn draws_of(&self, code: u32) -> Range<usize> {
        let code = code as usize;
        let start = code.checked_sub(1).map_or(0, |c| self.drawn_ends[c]);
        start..self.drawn_ends[code]
    }

    /// Stores an event; false if it is dark at every roughness or not finite.
    fn record(&mut self, event: &Event, code: u32) -> bool {
        let (drawn, draws) = if self.drawn.is_some() {
            let alphas = &self.drawn_at[self.draws_of(code)];
            (Proposals::all(&event.query, alphas), alphas.len())
        } else {
            (event.query.at(event.alpha_reg), 1)
        };
        let Some(stored) = StoredEvent::new(event, drawn.pdf_w, draws, code) else {
            return false;
        };
        self.keep(stored, event.radiance * drawn.value);
        true
    }
}

impl PathObserver for Tape {
    const EVENTS: bool = true;

    #[inline]
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn begin(&mut self, pixel: UVec2, sample: u32) {
        self.roulette = self
            .drawn
            .as_ref()
            .map(|drawn| drawn.1.stream(pixel, sample));
        let (x, y) = (pixel.x - self.window.x, pixel.y - self.window.y);
        self.current = y as usize * self.window.w as usize + x as usize;
        (self.before, self.before_previous, self.vertex) = (None, None, None);
        self.first = self.events.len();
        self.counted = Rgb::ZERO;
    }

    fn event(&mut self, event: &Event) {
        let code = match event.technique {
            // Reported at the end of the ray, when the path has left the vertex.
            Technique::Continuation => self.intern(self.before_previous, event.alpha),
            _ => self.code(event.alpha),
        };
        if self.record(event, code) {
            let found = event.query.at(event.alpha_reg);
            let density = if event.delta_light {
                event.pdf_light
            } else {
                event.pdf_light + found.pdf_w
            };
            self.counted += event.radiance * found.value / density;
        }
    }

    fn roughened(&mut self, point: &ShadingPoint<'_>, u: &SharedNumbers) {
        if self.drawn.is_none() {
            return;
        }
        let code = self.code(point.alpha);
        // The path tracer itself has sampled the first roughness.
        for i in self.draws_of(code).skip(1) {
            if let Some(event) = point.lobe_event(self.drawn_at[i], u) {
                self.record(&event, code);
            }
        }
    }

    fn scattered(&mut self, alpha: f32) {
        self.before_previous = self.before;
        self.before = Some(self.code(alpha));
        self.vertex = None;
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
        // Rounding errors of a path whose light is all in its events.
        let floor = radiance.max_element() * 1e-5;
        let constant = constant.map(|c| if c < floor { 0.0 } else { c });
        for (sum, c) in pixel.constant.iter_mut().zip(constant) {
            *sum += f64::from(c);
            pixel.constant_squared += f64::from(c) * f64::from(c);
        }
        let count = (self.events.len() - self.first) as u32;
        if count > 0 {
            pixel.paths.push(RecordedPath {
                constant,
                first: self.first as u32,
                count,
            });
        }
    }
}

impl Recorder for Tape {
    fn fork(&self) -> Self {
        let tape = match &self.drawn {
            Some(drawn) => Self::drawn(self.window, drawn.clone()),
            None => Self::new(self.window),
        };
        tape.until(self.stop.clone())
    }

    fn join(&mut self, tile: Self) {
        let codes = self
            .lists
            .absorb(&tile.lists, used(&tile.lists, &tile.events));
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
            pixel
                .paths
                .extend(other.paths.into_iter().map(|path| RecordedPath {
                    first: path.first + offset,
                    ..path
                }));
        }
    }
}
