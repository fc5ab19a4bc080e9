//! Frames in order, each averaged as soon as its neighbours are there.

use crate::average::{Held, WIDEST, average};
use crate::frame::{Averaged, Frame};
use opsr::math::Vec3;
use std::collections::VecDeque;

/// Frames that are averaged with those around them. It holds the frames of the widest window, 40 bytes a pixel each and the layers
/// that they keep, 36 once they are averaged; 24 more where something moves.
#[derive(Default)]
pub struct Sequence {
    frames: VecDeque<Held>,
    /// Frames among those held that were averaged already.
    done: usize,
    motion: bool,
}

impl Sequence {
    /// No frames yet; `motion` adds that of their surfaces.
    pub fn new(motion: bool) -> Self {
        Self {
            motion,
            ..Self::default()
        }
    }

    /// Places in the next frame, which is about to be added, of the surfaces of the last one.
    pub fn set_after(&mut self, places: Option<Vec<Vec3>>) {
        if let Some(last) = self.frames.back_mut() {
            last.frame.surfaces.after = places;
        }
    }

    /// Adds the next frame. Gives the frame whose widest window is complete now, if there is one, with its average; an error for a
    /// frame that shows another part than the last one.
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

    /// The next frame that was not averaged, with its average over the frames that are there; `None` after the last one. For the
    /// end, when no frame comes after those that are held.
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
