//! Frames of animations that are played: each is stored, within bounds, until a better one replaces it.

use opsr::image::Buffer;
use opsr::image::display::Display;
use opsr::math::UVec2;
use opsr::render::Spec;
use opsr::render::value::{Exposure, Moment};
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Instant;

/// Maximum frames per second, and maximum number of frames.
const RATE: f64 = 24.0;
const MAX_FRAMES: f64 = 4096.0;

/// Maximum bytes of the frames of a film, and bytes of a pixel.
const MAX_BYTES: f64 = (1 << 29) as f64;
const BYTES_OF_PIXEL: f64 = 12.0;

/// Number of frames of one loop of animations of this length, and frames per second.
pub(super) fn pace(seconds: f64) -> (usize, f64) {
    let rate = RATE / (seconds * RATE / MAX_FRAMES).ceil().max(1.0);
    let count = (seconds * rate - 1e-6).ceil().clamp(1.0, MAX_FRAMES);
    (count as usize, rate)
}

/// Seconds from the start of the animations.
pub(super) fn seconds(moment: Moment) -> f64 {
    match moment {
        Moment::Seconds(seconds) => seconds,
        Moment::Frame(frame, fps) => frame / fps,
    }
}

/// Clock of running animations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    since: Instant,
    from: f64,
}

impl Clock {
    /// A clock that shows these seconds now.
    pub(super) fn at(seconds: f64) -> Self {
        Self {
            since: Instant::now(),
            from: seconds,
        }
    }

    /// The seconds that it shows.
    pub(super) fn seconds(&self) -> f64 {
        self.from + self.since.elapsed().as_secs_f64()
    }
}

/// A stored frame.
pub(super) struct StoredFrame {
    /// Linear radiance.
    pub(super) picture: Buffer,
    /// Number of its round.
    pub(super) round: usize,
    pub(super) samples: u32,
    /// The command that renders this frame alone.
    pub(super) command: String,
}

/// The frames of a film.
pub(super) struct Film {
    pub(super) number: u64,
    /// Options that it was made with.
    pub(super) key: String,
    pub(super) rate: f64,
    /// Minimum edge of a frame's pixel, in pixels of the view, with which all frames fit into memory.
    pub(super) scale: u32,
    in_studio: bool,
    /// Every frame with the number of its change.
    frames: Vec<(u64, Option<Arc<StoredFrame>>)>,
    /// Number of the last change.
    changes: u64,
    exposure: Option<f32>,
}

impl Film {
    /// A film without frames yet.
    pub(super) fn new(
        number: u64,
        key: String,
        (count, rate): (usize, f64),
        frame: UVec2,
        in_studio: bool,
    ) -> Self {
        let bytes = BYTES_OF_PIXEL * count as f64 * frame.as_dvec2().element_product();
        let fits = |scale: &u32| bytes / f64::from(scale * scale) <= MAX_BYTES;
        Self {
            number,
            key,
            rate,
            scale: (1..u32::MAX).find(fits).unwrap_or(1),
            in_studio,
            frames: vec![(0, None); count],
            changes: 0,
            exposure: None,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.frames.len()
    }

    /// Keeps a frame in place of an earlier one.
    pub(super) fn store(&mut self, number: usize, still: StoredFrame) {
        self.changes += 1;
        self.frames[number] = (self.changes, Some(Arc::new(still)));
    }

    /// The missing frame that the clock reaches first, from these seconds on.
    pub(super) fn first_missing(&self, from: f64) -> Option<usize> {
        let from = (from * self.rate).rem_euclid(self.len() as f64).ceil() as usize;
        let mut around = (0..self.len()).map(|i| (from + i) % self.len());
        around.find(|number| self.frames[*number].1.is_none())
    }

    /// The first frame of an earlier round than this one.
    pub(super) fn first_before(&self, round: usize) -> Option<usize> {
        let earlier = |f: &Option<Arc<StoredFrame>>| f.as_ref().is_none_or(|f| f.round < round);
        (self.frames.iter()).position(|(_, still)| earlier(still))
    }

    /// True if there are changes after this one.
    pub(super) fn is_newer(&self, change: u64) -> bool {
        self.changes > change
    }

    /// The oldest change after this one: its number, the number of the frame, and the frame.
    pub(super) fn after(&self, change: u64) -> Option<(u64, usize, Arc<StoredFrame>)> {
        let all = self.frames.iter().enumerate();
        let newer = all.filter_map(|(frame, (number, still))| {
            let still = still.as_ref().filter(|_| *number > change)?;
            Some((*number, frame, still))
        });
        newer
            .min_by_key(|(number, ..)| *number)
            .map(|(number, frame, still)| (number, frame, still.clone()))
    }

    /// Counts every frame as changed, and drops the exposure.
    pub(super) fn repaint(&mut self) {
        self.exposure = None;
        for (number, still) in &mut self.frames {
            if still.is_some() {
                self.changes += 1;
                *number = self.changes;
            }
        }
    }

    /// Exposure and view. All frames share the automatic exposure of one frame, so that a film does not flicker.
    pub(super) fn display(&mut self, spec: &Spec, picture: &Buffer) -> Display {
        let view = spec.view.unwrap_or_default();
        let auto = spec.exposure.unwrap_or_default() == Exposure::Auto;
        if let (true, Some(exposure)) = (auto, self.exposure) {
            return Display { exposure, view };
        }
        let display = spec.display(picture, self.in_studio);
        self.exposure = Some(display.exposure);
        display
    }

    pub(super) fn json(&self, clock: Option<Clock>) -> Value {
        let kept = self.frames.iter().filter(|(_, still)| still.is_some());
        json!({
            "number": self.number,
            "frames": self.len(),
            "kept": kept.count(),
            "position": clock.map(|clock| (clock.seconds() * self.rate).rem_euclid(self.len() as f64)),
        })
    }
}

#[cfg(test)]
mod tests;
