//! Parts of a render: some of its samples or pixels, rendered by one process and merged with the others by another.
//!
//! A picture depends to the last bit on the order in which the samples of a pixel are added, so parts are added in the
//! order of their samples, whatever the order of the files. Sums can be continued, not inserted: a part that begins
//! with sample 0 stores sums, like a checkpoint; a later one stores every sample, 12 bytes for each pixel, 56 more with
//! levels and 12 for each of them. Pixels do not depend on each other, so parts of all samples of a crop stay small.
//!
//! The files of a part and of the whole are written only when complete.

use super::checkpoint::{self, Fingerprint};
use super::drive::{Budget, RenderProgress, drive};
use super::{Amounts, Aovs, Integrator, Picture, Recorded, View};
use crate::files::{FileError, Payload, Problem, Sealed};
use crate::image::batches::Sharing;
use crate::image::film::{Cause, Film, Window};
use crate::image::level_film::{LevelFilm, PathLevels};
use crate::math::{Rgb, UVec2};
use crate::memory::{self, Shortage};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::time::Instant;

const FILE: Sealed = Sealed {
    kind: "part of a render",
    version: 3,
    // Parts are read piece by piece.
    most: 0,
};

/// A part of a render without its pixels: the header of its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// The render that it belongs to.
    pub fingerprint: Fingerprint,
    /// Columns and rows of the whole frame.
    pub size: [u32; 2],
    /// Pixels of this part: x, y, width, height.
    pub window: [u32; 4],
    /// First sample, and the one after the last.
    pub samples: [u32; 2],
    /// The films of the payload.
    pub amounts: Amounts,
    /// True for AOVs of the first surface, and of light.
    aovs: [bool; 2],
    /// Layers of the file of the picture, by name.
    pub layers: Vec<String>,
    /// Text for the file of the picture.
    pub metadata: BTreeMap<String, String>,
    /// World to camera, for the file of the picture.
    pub camera: [f32; 16],
    /// Refused samples that were NaN, and that were infinite, for a part that stores sums.
    refused: [u64; 2],
    first_refused: Vec<(u32, u32, u32, bool)>,
    /// True if pixels share light paths.
    shares: bool,
    /// Batch sums of all pixels, for a part that stores sums.
    shared: Vec<u64>,
}

impl Part {
    /// A part with these samples of the pixels of a view.
    pub fn new(
        fingerprint: Fingerprint,
        view: &View<'_>,
        samples: Range<u32>,
        amounts: Amounts,
        aovs: Recorded,
    ) -> Self {
        let Window { x, y, w, h } = view.window;
        Self {
            fingerprint,
            size: view.sensor.frame.to_array(),
            window: [x, y, w, h],
            samples: [samples.start, samples.end],
            amounts,
            aovs: [aovs.first, aovs.light],
            layers: Vec::new(),
            metadata: BTreeMap::new(),
            camera: view.sensor.camera.world_to_camera(),
            refused: [0; 2],
            first_refused: Vec::new(),
            shares: false,
            shared: Vec::new(),
        }
    }

    /// Pixels of this part.
    pub(crate) fn window(&self) -> Window {
        let [x, y, w, h] = self.window;
        Window { x, y, w, h }
    }

    /// The recorded AOVs, never the time.
    fn recorded(&self) -> Recorded {
        let [first, light] = self.aovs;
        Recorded {
            first,
            light,
            time: false,
        }
    }

    /// A picture of these pixels without samples.
    fn blank(&self, window: Window) -> Picture {
        let size = UVec2::from_array(self.size);
        let blank = Picture::blank(size, window, &self.amounts, self.recorded());
        blank.expect("a window that was checked")
    }

    /// Renders the part and writes its file, whole or not at all. False, and no file, if the listener, which is called
    /// after each pass, returned a break.
    ///
    /// Panics for a window outside of the frame.
    pub fn render(
        self,
        path: &Path,
        integrator: &mut dyn Integrator,
        view: &View<'_>,
        listen: &mut dyn FnMut(&RenderProgress) -> ControlFlow<()>,
    ) -> Result<bool, FileError> {
        self.render_on(None, path, integrator, view, listen)
    }

    /// The same, after the samples of `begun`: a part of the same pixels that begins with sample 0, as this one does.
    /// The file is identical to that of a part rendered at once.
    pub(crate) fn render_on(
        mut self,
        begun: Option<&Path>,
        path: &Path,
        integrator: &mut dyn Integrator,
        view: &View<'_>,
        listen: &mut dyn FnMut(&RenderProgress) -> ControlFlow<()>,
    ) -> Result<bool, FileError> {
        let blank = self.blank(view.window);
        let [start, end] = self.samples;
        self.shares = integrator.shares_light();
        let begun = begun.map(|begun| self.begun(begun)).transpose()?;
        if start == 0 {
            let (mut picture, done) = begun.unwrap_or((blank, 0));
            let samples = Some(end);
            let budget = Budget {
                samples,
                ..Budget::default()
            };
            let on_pass = &mut |progress: &RenderProgress, _: &Picture| listen(progress);
            let (progress, _) = drive(integrator, view, &budget, done, &mut picture, on_pass);
            if progress.samples < end {
                return Ok(false);
            }
            (self.refused, self.first_refused) = checkpoint::refusals(&picture.film.rejected);
            self.shared = checkpoint::shared(&picture.film.sharing);
            FILE.save(path, &self, |out| checkpoint::write(&picture, out))?;
            return Ok(true);
        }
        let clock = Instant::now();
        let mut stopped = false;
        let saved = FILE.save(path, &self, |out| {
            for sample in start..end {
                let mut one = blank.clone();
                integrator.pass(view, sample..sample + 1, &mut one);
                write_sample(&one, sample, out)?;
                let samples = sample + 1;
                let progress = RenderProgress {
                    samples,
                    elapsed: clock.elapsed(),
                    fraction: Some(f64::from(samples - start) / f64::from(end - start)),
                    error: None,
                };
                if listen(&progress).is_break() && samples < end {
                    stopped = true;
                    return Err(io::ErrorKind::Interrupted.into());
                }
            }
            Ok(())
        });
        match saved {
            Err(_) if stopped => Ok(false),
            saved => saved.map(|()| true),
        }
    }

    /// Picture and number of samples of a part that this one continues.
    fn begun(&self, path: &Path) -> Result<(Picture, u32), FileError> {
        let read = || {
            let (old, payload) = Self::open(path)?;
            self.same_render(&old, None).map_err(Problem::content)?;
            let [start, end] = old.samples;
            let fits = old.window == self.window && start == 0 && self.samples[0] == 0;
            if !fits || end > self.samples[1] {
                let (old, own) = (old.words(), self.words());
                return Err(Problem::content(format!("{old} cannot become {own}")));
            }
            Ok((old.sums(&payload.rest()?)?, end))
        };
        read().map_err(|problem: Problem| problem.at(path))
    }

    /// An error unless `part` belongs to the render of this one; `file` is the file of this one, if there is one.
    fn same_render(&self, part: &Self, file: Option<&Path>) -> Result<(), String> {
        let file = file.map(|file| file.display().to_string());
        let render = (file.as_ref()).map_or("render".to_owned(), |file| format!("render ({file})"));
        part.fingerprint
            .differs(&self.fingerprint, "part", &render)?;
        let same = part.size == self.size && part.amounts == self.amounts;
        match same && part.aovs == self.aovs && part.camera == self.camera {
            true => Ok(()),
            false => Err(format!(
                "other settings than {}",
                file.as_deref().unwrap_or("this render")
            )),
        }
    }

    /// The picture of a part that stores sums, from its payload.
    fn sums(&self, payload: &[u8]) -> Result<Picture, Problem> {
        let (size, window) = (UVec2::from_array(self.size), self.window());
        let read = checkpoint::read(size, window, &self.amounts, payload);
        let mut read = read.map_err(Problem::content)?;
        read.film.rejected = checkpoint::rejected(self.refused, &self.first_refused);
        read.film.sharing = checkpoint::sharing(&self.shared);
        Ok(read)
    }

    /// The header of a file and its payload; the header is checked, the payload not.
    fn open(path: &Path) -> Result<(Self, Payload), Problem> {
        let (part, payload): (Self, Payload) = FILE.stream(path)?;
        let size = UVec2::from_array(part.size);
        Film::check(size, part.window()).map_err(Problem::content)?;
        let [start, end] = part.samples;
        if start >= end {
            return Err(Problem::content(format!("no samples: {start}..{end}")));
        }
        if payload.left() != part.payload_bytes() {
            return Err(Problem::content("its length is not that of its samples"));
        }
        Ok((part, payload))
    }

    /// Length of the payload.
    fn payload_bytes(&self) -> u64 {
        let (pixels, levels) = (self.window().len(), self.amounts.films());
        let aovs = self.recorded().numbers();
        let [start, end] = self.samples;
        if start == 0 {
            let film = pixels as u64 * 8 * (Film::NUMBERS + aovs) as u64;
            let head = if levels > 0 { LevelFilm::HEAD } else { 0 };
            film + head + LevelFilm::bytes_with(pixels, levels, end) * u64::from(levels > 0)
        } else {
            let of_levels = match levels {
                0 => 0,
                levels => LevelFilm::sample_numbers(levels),
            };
            let sample = pixels as u64 * 4 * (3 + of_levels + aovs) as u64;
            sample.saturating_mul(u64::from(end - start))
        }
    }

    /// The samples in words, for messages.
    fn words(&self) -> String {
        let [start, end] = self.samples;
        format!("samples {start}..{end} of {}", self.window())
    }
}

/// Writes the values of a sample: of all pixels, then the levels of all pixels, then the AOVs, in their single
/// precision. A refused value is written as NaN or infinity, the cause of its refusal.
fn write_sample(one: &Picture, sample: u32, out: &mut dyn Write) -> io::Result<()> {
    let mut write = |x: f32| out.write_all(&x.to_le_bytes());
    let refused = &one.film.rejected;
    let known = |cause| refused.first.iter().filter(|r| r.cause == cause).count() as u64;
    let mut unknown = refused.nan - known(Cause::Nan);
    for (index, moments) in one.film.pixels.iter().enumerate() {
        let value = if moments.n > 0 {
            moments.mean.as_vec3()
        } else {
            let pixel = one.film.window.pixel(index);
            let first = refused.first.iter().find(|r| r.pixel == pixel);
            let nan = first.map_or(unknown > 0, |r| r.cause == Cause::Nan);
            unknown -= u64::from(nan && first.is_none());
            Rgb::splat(if nan { f32::NAN } else { f32::INFINITY })
        };
        value.to_array().into_iter().try_for_each(&mut write)?;
    }
    if let Some(levels) = &one.levels {
        levels.sample(sample).try_for_each(&mut write)?;
    }
    let aovs = one.aovs.iter().flat_map(Aovs::numbers);
    aovs.map(|x| x as f32).try_for_each(&mut write)
}

/// A merged render.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The first part: levels, layers, camera and text are those of the render.
    pub first: Part,
    /// Samples per pixel.
    pub samples: u32,
    /// The moments and AOVs.
    pub picture: Picture,
}

/// Errors of merging parts.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// A file that cannot be read, is damaged, or belongs to another render.
    #[error("{0}")]
    File(FileError),
    /// The merged render needs more memory than there is.
    #[error("{0}")]
    Memory(Shortage),
    /// Samples that are missing, or that are in several parts.
    #[error("{0}")]
    Samples(String),
}

/// Merges parts, in any order, into the picture of a single render, bit for bit.
///
/// `window` maps the size of the frame to the expected pixels; `samples` is their number of samples, by default the
/// most that a pixel has. Unless `complete`, pixels may have fewer samples, and are black without any.
pub fn merge(
    paths: &[PathBuf],
    window: impl FnOnce(UVec2) -> Window,
    samples: Option<u32>,
    complete: bool,
) -> Result<Merged, MergeError> {
    let mut parts = Vec::new();
    for path in paths {
        let (part, _) = Part::open(path).map_err(|e| MergeError::File(e.at(path)))?;
        parts.push((path.as_path(), part));
    }
    // Sorted by content: the first of several refused samples does not depend on the order of the files.
    parts.sort_by_key(|(_, part)| {
        let [x, y, w, h] = part.window;
        (part.samples, y, x, h, w)
    });
    let Some((first_path, first)) = parts.first().cloned() else {
        return Err(MergeError::Samples("no parts".into()));
    };
    for (path, part) in &parts[1..] {
        let differs = first.same_render(part, Some(first_path));
        differs.map_err(|what| MergeError::File(FileError::content(path, what)))?;
    }
    let size = UVec2::from_array(first.size);
    let window = window(size);
    Film::check(size, window).map_err(|e| MergeError::Samples(e.to_string()))?;
    let samples = Coverage::new(&parts, window)?.check(&parts, samples, complete)?;

    let each = size_of::<[f64; 7]>() as u64 + 8 * first.recorded().numbers() as u64;
    let most = parts.iter().map(|(_, part)| part.samples[1]).max();
    let levels = LevelFilm::bytes_with(window.len(), first.amounts.films(), most.unwrap_or(0));
    let largest = parts.iter().filter(|(_, part)| part.samples[0] == 0);
    let largest = largest.map(|(_, part)| 2 * part.payload_bytes()).max();
    let bytes = window.len() as u64 * each + levels + largest.unwrap_or(0);
    let pixels = format!("{}x{} pixels", window.w, window.h);
    memory::check(pixels, bytes).map_err(MergeError::Memory)?;
    let mut whole = Whole {
        picture: first.blank(window),
        recorded: first.recorded(),
        aovs: first
            .recorded()
            .numbers_by_part()
            .map(|n| vec![0.0; n * window.len()]),
    };
    whole.picture.aovs = None;
    if first.shares {
        whole.picture.film.sharing = Sharing::Batches(Box::default());
    }
    for (path, part) in &parts {
        let added = whole.add(path, part);
        added.map_err(|problem| MergeError::File(problem.at(path)))?;
    }
    Ok(Merged {
        picture: whole.picture(),
        first,
        samples,
    })
}

/// Samples that the pixels have, in cells with the same parts throughout.
struct Coverage {
    window: Window,
    /// Columns and rows at which cells begin, and the end of the last.
    edges: [Vec<u32>; 2],
    /// Number of the next sample, and index of the part with the sample before.
    next: Vec<(u32, usize)>,
}

impl Coverage {
    /// No samples yet. An error for parts outside of the window.
    fn new(parts: &[(&Path, Part)], window: Window) -> Result<Self, MergeError> {
        /// Most cells; few are needed, since crops of one render share their edges.
        const MAX_CELLS: usize = 1 << 26;
        let mut edges = [
            vec![window.x, window.x + window.w],
            vec![window.y, window.y + window.h],
        ];
        for (path, part) in parts {
            let own = part.window();
            if !own.inside(&window) {
                let what = format!("{own} leave the {window} to put together");
                return Err(MergeError::File(FileError::content(path, what)));
            }
            edges[0].extend([own.x, own.x + own.w]);
            edges[1].extend([own.y, own.y + own.h]);
        }
        for edges in &mut edges {
            edges.sort_unstable();
            edges.dedup();
        }
        let cells = (edges[0].len() - 1) * (edges[1].len() - 1);
        if cells > MAX_CELLS {
            let what = "too many parts of different pixels";
            return Err(MergeError::Samples(what.into()));
        }
        Ok(Self {
            window,
            edges,
            next: vec![(0, 0); cells],
        })
    }

    /// Indices and windows of the cells of a window.
    fn cells(&self, window: Window) -> impl Iterator<Item = (usize, Window)> + use<> {
        let [xs, ys] = self.edges.clone();
        let range = |edges: &[u32], from: u32, length: u32| {
            edges.partition_point(|&e| e < from)..edges.partition_point(|&e| e < from + length)
        };
        let columns = range(&xs, window.x, window.w);
        let rows = range(&ys, window.y, window.h);
        rows.flat_map(move |row| columns.clone().map(move |column| (column, row)))
            .map(move |(i, j)| {
                let cell = Window {
                    x: xs[i],
                    y: ys[j],
                    w: xs[i + 1] - xs[i],
                    h: ys[j + 1] - ys[j],
                };
                (j * (xs.len() - 1) + i, cell)
            })
    }

    /// The number of samples: `samples`, or the most that a pixel has. An error for samples that are in two parts or
    /// beyond that number, and, if `complete`, for missing ones.
    fn check(
        mut self,
        parts: &[(&Path, Part)],
        samples: Option<u32>,
        complete: bool,
    ) -> Result<u32, MergeError> {
        /// Most gaps that an error names.
        const NAMED: usize = 8;
        let mut missing: BTreeMap<[u32; 2], Window> = BTreeMap::new();
        let mut miss = |range: [u32; 2], cell: Window| {
            let all = missing.entry(range).or_insert(cell);
            let (x, y) = (all.x.min(cell.x), all.y.min(cell.y));
            let right = (all.x + all.w).max(cell.x + cell.w);
            let below = (all.y + all.h).max(cell.y + cell.h);
            (*all) = Window {
                x,
                y,
                w: right - x,
                h: below - y,
            };
        };
        for (number, (path, part)) in parts.iter().enumerate() {
            let [start, end] = part.samples;
            for (index, cell) in self.cells(part.window()) {
                let (next, before) = self.next[index];
                if next > start {
                    let (other, first) = (parts[before].0.display(), start);
                    let last = next.min(end);
                    let what = format!("both have samples {first}..{last} of {cell}");
                    let what = format!("{other} and {} {what}", path.display());
                    return Err(MergeError::Samples(what));
                }
                if next < start {
                    miss([next, start], cell);
                }
                self.next[index] = (end, number);
            }
        }
        let most = self.next.iter().map(|(next, _)| *next).max().unwrap_or(0);
        let wanted = samples.unwrap_or(most);
        if most > wanted {
            let longer = parts.iter().find(|(_, part)| part.samples[1] > wanted);
            let (path, part) = longer.unwrap_or(&parts[0]);
            let what = format!("{}: more than the {wanted} to put together", part.words());
            return Err(MergeError::File(FileError::content(path, what)));
        }
        for (index, cell) in self.cells(self.window) {
            let (next, _) = self.next[index];
            if next < wanted {
                miss([next, wanted], cell);
            }
        }
        if missing.is_empty() || !complete {
            return Ok(wanted);
        }
        let named = missing.iter().take(NAMED);
        let named = named.map(|([from, to], window)| format!("{from}..{to} within {window}"));
        let named = named.collect::<Vec<_>>().join(", ");
        let more = match missing.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more gaps"),
        };
        Err(MergeError::Samples(format!(
            "missing samples: {named}{more}"
        )))
    }
}

/// The picture so far.
struct Whole {
    picture: Picture,
    recorded: Recorded,
    /// AOVs as numbers: of the first surface, of light, and of time.
    aovs: [Vec<f64>; 3],
}

impl Whole {
    /// Adds a part, whose samples must follow those of its pixels so far.
    fn add(&mut self, path: &Path, part: &Part) -> Result<(), Problem> {
        let (again, mut payload) = Part::open(path)?;
        if again != *part {
            return Err(Problem::content("it changed while it was read"));
        }
        let [start, end] = part.samples;
        if start == 0 {
            return self.add_sums(part, &payload.rest()?);
        }
        let length = payload.left() / u64::from(end - start);
        let mut bytes = vec![0; length as usize];
        for sample in start..end {
            payload.read(&mut bytes)?;
            let added = self.add_sample(part, sample, &bytes);
            added.map_err(Problem::content)?;
        }
        payload.finish()
    }

    fn add_sums(&mut self, part: &Part, bytes: &[u8]) -> Result<(), Problem> {
        let read = part.sums(bytes)?;
        self.picture.film.paste(&read.film);
        self.picture.film.sharing.merge(&read.film.sharing);
        if let Some((all, own)) = self.picture.levels.as_mut().zip(read.levels) {
            all.paste(&own);
        }
        let aovs: Vec<f64> = read.aovs.iter().flat_map(Aovs::numbers).collect();
        self.add_aovs(part, &mut aovs.into_iter());
        Ok(())
    }

    fn add_sample(&mut self, part: &Part, sample: u32, bytes: &[u8]) -> Result<(), &'static str> {
        let (words, _) = bytes.as_chunks::<4>();
        let mut numbers = words.iter().map(|word| f32::from_le_bytes(*word));
        let mut next = || numbers.next().unwrap_or(f32::NAN);
        let window = part.window();
        for index in 0..window.len() {
            let value = Rgb::from_array(std::array::from_fn(|_| next()));
            if value.cmplt(Rgb::ZERO).any() {
                return Err("a sample is negative");
            }
            let at = self.picture.film.window.index(window.pixel(index));
            match part.shares {
                true => self.picture.film.push_shared(at, value, sample),
                false => self.picture.film.push(at, value, sample),
            }
        }
        if let Some(levels) = &mut self.picture.levels {
            let mut values = vec![Rgb::ZERO; levels.levels()];
            for index in 0..window.len() {
                let mut rgb = || Rgb::from_array(std::array::from_fn(|_| next()));
                values.iter_mut().for_each(|value| *value = rgb());
                if values.iter().any(|value| value.cmplt(Rgb::ZERO).any()) {
                    return Err("a sample of a level is negative");
                }
                let path = PathLevels {
                    levels: &values,
                    shared: rgb(),
                    features: std::array::from_fn(|_| next()),
                };
                let at = levels.window().index(window.pixel(index));
                levels.push(at, sample, &path);
            }
        }
        let aovs: Vec<f64> = numbers.map(f64::from).collect();
        if aovs.iter().any(|x| !x.is_finite()) {
            return Err("an AOV is not finite");
        }
        self.add_aovs(part, &mut aovs.into_iter());
        Ok(())
    }

    /// Adds values of AOVs to the sums, which are zero before a part that stores sums.
    fn add_aovs(&mut self, part: &Part, numbers: &mut dyn Iterator<Item = f64>) {
        let (all, own) = (self.picture.film.window, part.window());
        for (sums, each) in self.aovs.iter_mut().zip(part.recorded().numbers_by_part()) {
            if each == 0 {
                continue;
            }
            for index in 0..own.len() {
                let at = each * all.index(own.pixel(index));
                for (sum, number) in sums[at..at + each].iter_mut().zip(&mut *numbers) {
                    *sum += number;
                }
            }
        }
    }

    fn picture(self) -> Picture {
        let aovs = self.aovs.concat();
        Picture {
            aovs: Aovs::from_numbers(self.picture.film.window, self.recorded, &aovs),
            ..self.picture
        }
    }
}
