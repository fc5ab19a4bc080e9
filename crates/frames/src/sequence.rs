//! Frames in order, each averaged as soon as its neighbours are there.

use crate::average::{Held, WIDEST, average};
use crate::frame::{Averaged, Frame};
use opsr::math::Vec3;
use std::collections::VecDeque;

/// Frames that are averaged with their neighbours. The frames of the widest window are in memory, each with its layers
/// and 40 bytes per pixel, 36 once it is averaged, and 24 more if something moves.
#[derive(Default)]
pub struct Sequence {
    frames: VecDeque<Held>,
    /// Number of frames in memory that are averaged already.
    done: usize,
    motion: bool,
}

impl Sequence {
    /// An empty sequence; with `motion`, averages have the motion of their surfaces.
    pub fn new(motion: bool) -> Self {
        Self {
            motion,
            ..Self::default()
        }
    }

    /// Sets the positions of the last frame's surfaces in the next frame, before that is added.
    pub fn set_after(&mut self, places: Option<Vec<Vec3>>) {
        if let Some(last) = self.frames.back_mut() {
            last.frame.surfaces.after = places;
        }
    }

    /// Adds the next frame. Returns the frame whose widest window is complete now, if there is one, with its average;
    /// an error for a frame of another size or window than the last one.
    pub fn push(&mut self, frame: Frame) -> Result<Option<(&Frame, Averaged)>, String> {
        if let Some(last) = self.frames.back() {
            last.frame.check(&frame)?;
        }
        self.frames.push_back(Held::new(frame));
        match self.frames.len() > self.done + WIDEST {
            true => Ok(self.average_next()),
            false => Ok(None),
        }
    }

    /// Averages the next frame over the frames in memory; `None` after the last one. For the end of a film, when no
    /// more frames come.
    pub fn average_next(&mut self) -> Option<(&Frame, Averaged)> {
        if self.done == self.frames.len() {
            return None;
        }
        while self.done > WIDEST {
            self.frames.pop_front();
            self.done -= 1;
        }
        if let Some(last) = self.done.checked_sub(1) {
            self.frames[last].forget_own();
        }
        let frames: Vec<&Held> = self.frames.iter().collect();
        let averaged = average(&frames, self.done, self.motion);
        self.done += 1;
        Some((&self.frames[self.done - 1].frame, averaged))
    }
}
