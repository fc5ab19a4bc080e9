//! Rendering: estimators, the steps they share, budgets, checkpoints and parts.
//!
//! [`Settings`] name an [`Estimator`] and a [rule](crate::regularise::Rule); [`Settings::integrator`] makes an
//! [`Integrator`] of them, the one place with dynamic dispatch (one call a pass). Everything below is monomorphised:
//! plain path tracing compiles to a loop without a table. `levels` traces several amounts of roughening at once,
//! `guided` learns the directions of light. All share `walk`, so that a loop contains its estimator only.

pub(crate) mod amounts;
pub(crate) mod aov;
pub mod bidirectional;
pub(crate) mod census;
pub mod checkpoint;
pub mod drive;
pub(crate) mod guided;
pub(crate) mod layers;
pub(crate) mod levels;
pub mod method;
pub(crate) mod metropolis;
pub mod part;
pub(crate) mod path;
mod pieces;
pub(crate) mod settings;
pub(crate) mod stop;
pub mod trace;
mod view;
pub(crate) mod walk;

use crate::image::film::{Film, FilmError, Window};
use crate::image::level_film::LevelFilm;
use crate::math::UVec2;
use crate::math::moments::Moments;
pub use amounts::{Amounts, LevelError, RadiusFactors, Scales};
pub use aov::{Aovs, FirstHit, Recorded, centre};
pub(crate) use path::PathTracer;
pub use settings::{Estimator, Settings};
use std::ops::Range;
pub use stop::Stop;
pub(crate) use stop::first_limit;
pub use view::View;
pub use walk::observer::{Event, PathObserver, Recorder, Technique};
pub use walk::shading_point::ShadingPoint;

/// The result of a render.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The moments of every pixel.
    pub film: Film,
    /// AOVs, if they are recorded.
    pub aovs: Option<Aovs>,
    /// Batch means of the [films](Amounts::films) among which a choice is made; `film` then holds the first.
    pub levels: Option<LevelFilm>,
}

impl Picture {
    /// Bytes of a pixel: moments, samples until they are added, the picture, its error. Measured: 78.
    const FILM_BYTES: u64 = 110;
    /// The same of the choice among levels and the error, beside the films. Measured: 95 with one level, 108 with four.
    const CHOICE_BYTES: u64 = 110;
    /// The same of albedo, normal and depth; measured: 181. Light and time take less.
    const AOV_BYTES: u64 = 195;

    /// An empty picture with the films of these amounts and with these parts of AOVs.
    pub fn blank(
        size: UVec2,
        window: Window,
        amounts: &Amounts,
        recorded: Recorded,
    ) -> Result<Self, FilmError> {
        let films = amounts.films();
        Ok(Self {
            film: Film::cropped(size, window)?,
            aovs: Aovs::new(window, recorded),
            levels: (films > 0).then(|| LevelFilm::new(size, window, films)),
        })
    }

    /// Bytes that such a picture takes, its copies in tiles and files included.
    pub(crate) fn bytes(window: Window, amounts: &Amounts, recorded: Recorded) -> u64 {
        let film = match amounts.films() {
            0 => Self::FILM_BYTES,
            levels => {
                let sums = LevelFilm::bytes(1, levels);
                let beside = levels::pass_bytes(levels).max(Self::CHOICE_BYTES);
                size_of::<Moments>() as u64 + sums + beside
            }
        };
        window.len() as u64 * (film + Self::AOV_BYTES * recorded.count())
    }

    /// A picture without AOVs and without levels.
    pub fn new(film: Film) -> Self {
        Self {
            film,
            aovs: None,
            levels: None,
        }
    }
}

/// An estimator that adds independent estimates to a picture.
pub trait Integrator: Send {
    /// Adds the samples with these numbers to every pixel of the view, and to the AOVs where the picture has them.
    /// Returns how many it has added: fewer than all, from the first on, where the view's render is [stopped](Stop).
    ///
    /// The film is that of the view: same frame, same window. Samples depend on their pixel and number only: passes in
    /// any split and at any number of threads make bit-identical films.
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32;

    /// True if pixels share light paths, so that their noise is not independent.
    fn shares_light(&self) -> bool {
        false
    }

    /// Performs in advance the set-up of the first pass of a view; samples do not change.
    fn prepare(&self, _view: &View<'_>) {}

    /// Choices of the integrator for a view, and the memory that it takes there beside the film; `None` if there are
    /// none.
    fn notes(&self, _view: &View<'_>) -> Option<String> {
        None
    }
}
