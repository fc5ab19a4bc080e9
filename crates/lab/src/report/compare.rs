//! Pictures against a reference: every metric of every picture as numbers, a text table and error maps.

use std::fmt::{self, Write};
use std::path::Path;

use serde::Serialize;

use opsr::files::FileError;
use opsr::image::film::Window;
use opsr::image::{Buffer, exr, png};
use opsr::math::UVec2;
use opsr_metric::false_colour;
use opsr_metric::{self as metric, BiasVariance, Metric, MetricError, Worst, flip};

/// A picture and where it comes from.
#[derive(Clone, Debug)]
pub struct Named {
    /// File name or another name.
    pub name: String,
    /// Linear RGB.
    pub picture: Buffer,
    /// True if values above 1 are meaningful: for EXR, but not for PNG and JPEG.
    pub hdr: bool,
    /// The frame and the part of it that the picture shows; `None` if the picture reaches beyond the frame.
    pub part: Option<(UVec2, Window)>,
}

impl Named {
    /// A picture of a whole frame.
    pub fn new(name: impl Into<String>, picture: Buffer, hdr: bool) -> Self {
        let frame = UVec2::new(picture.width as u32, picture.height as u32);
        Self {
            name: name.into(),
            picture,
            hdr,
            part: Some((frame, Window::full(frame))),
        }
    }

    /// Reads an EXR, PNG or JPEG file, chosen by its ending.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::load_layer(path, None)
    }

    /// Reads a [layer](exr::Layers::layer) of an EXR file; `None` reads the picture, as [`Named::load`] does.
    pub fn load_layer(path: &Path, layer: Option<&str>) -> Result<Self, FileError> {
        let ending = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or("")
            .to_ascii_lowercase();
        let name = path.display().to_string();
        match (ending.as_str(), layer) {
            ("exr", _) => {
                let file = exr::read_layers(path)?;
                let picture = layer.map_or_else(|| file.main(), |layer| file.layer(layer));
                let (x, y) = (file.position.0.try_into(), file.position.1.try_into());
                let window = x.ok().zip(y.ok()).map(|(x, y)| Window {
                    x,
                    y,
                    w: file.width as u32,
                    h: file.height as u32,
                });
                let inside = |window: &Window| window.inside(&Window::full(file.size));
                Ok(Self {
                    part: window.filter(inside).map(|window| (file.size, window)),
                    ..Self::new(name, picture.map_err(|e| e.at(path))?, true)
                })
            }
            ("png" | "jpg" | "jpeg", None) => Ok(Self::new(name, png::read(path)?, false)),
            (_, Some(_)) => Err(FileError::content(path, "only EXR files have layers")),
            _ => Err(FileError::content(
                path,
                "not a picture this program reads (.exr, .png, .jpg)",
            )),
        }
    }

    /// The picture of a window of a frame; `None` if it shows another frame or not all of the window. A picture of the
    /// window's size is accepted as it is.
    pub fn showing(mut self, frame: UVec2, window: Window) -> Option<Buffer> {
        let size = (window.w as usize, window.h as usize);
        if self.part.is_some_and(|(own, _)| own == frame) {
            self.cut(window);
        }
        (self.picture.size() == size).then_some(self.picture)
    }

    /// Cuts the picture to a window of its frame, if it shows all of it.
    fn cut(&mut self, to: Window) {
        if let Some((_, from)) = self.part.as_mut().filter(|(_, from)| to.inside(from)) {
            let (x, y) = ((to.x - from.x) as usize, (to.y - from.y) as usize);
            let old = &self.picture;
            self.picture = Buffer::from_fn(to.w as usize, to.h as usize, |i, j| {
                old.pixels[(y + j) * old.width + x + i]
            });
            *from = to;
        }
    }
}

/// Cuts pictures that show different parts of one frame to the common part. Returns that part; `None` if nothing was
/// cut.
pub fn cut_to_common(pictures: &mut [Named]) -> Option<Window> {
    let parts: Option<Vec<(UVec2, Window)>> = pictures.iter().map(|p| p.part).collect();
    let parts = parts?;
    let &(frame, first) = parts.first()?;
    let equal = parts.iter().all(|(_, window)| *window == first);
    if equal || parts.iter().any(|(other, _)| *other != frame) {
        return None;
    }
    let common =
        (parts.iter()).try_fold(first, |common, (_, window)| common.intersection(window))?;
    pictures.iter_mut().for_each(|p| p.cut(common));
    Some(common)
}

/// Options of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Pixels per degree of the visual field, for FLIP.
    pub ppd: f64,
    /// Exposure of pictures and reference for LDR-FLIP, in stops.
    pub exposure: f32,
    /// True if the pictures are renders of one scene with several seeds: bias and variance are separated.
    pub seeds: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            ppd: flip::DEFAULT_PPD,
            exposure: 0.0,
            seeds: false,
        }
    }
}

/// A comparison that cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("{picture} against {reference}: {reason}")]
pub struct CompareError {
    /// The picture.
    pub picture: String,
    /// The reference.
    pub reference: String,
    /// The fault.
    pub reason: MetricError,
}

/// One picture against the reference.
#[derive(Clone, Debug, Serialize)]
pub struct PictureErrors {
    /// The picture.
    pub name: String,
    /// All numbers, in the same order for every picture.
    pub metrics: Vec<Metric>,
    /// The pixel with the largest error.
    pub worst: Worst,
    /// Error maps by name, from 0; the colour scale ends at 1.
    #[serde(skip)]
    pub maps: Vec<(&'static str, Vec<f32>)>,
}

/// Every picture against the reference.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The reference.
    pub reference: String,
    /// Size of all pictures in pixels.
    pub size: (usize, usize),
    /// One entry per picture, in the order given.
    pub entries: Vec<PictureErrors>,
    /// Bias and variance over all pictures, if they are seeds of one render.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seeds: Option<BiasVariance>,
    /// Metrics that are left out, with the reason.
    pub notes: Vec<String>,
}

impl Comparison {
    /// The metrics of the first picture; every picture has the same ones.
    pub fn metrics(&self) -> &[Metric] {
        self.entries.first().map_or(&[], |e| &e.metrics)
    }
}

/// Compares each picture with the reference.
pub fn compare(
    pictures: &[Named],
    reference: &Named,
    options: &Options,
) -> Result<Comparison, CompareError> {
    compare_with(pictures, reference, options, |_| ())
}

/// Compares each picture with the reference. `begin` is called before each comparison: large pictures take seconds.
pub fn compare_with(
    pictures: &[Named],
    reference: &Named,
    options: &Options,
    mut begin: impl FnMut(&Named),
) -> Result<Comparison, CompareError> {
    let failed = |picture: &str, reason| CompareError {
        picture: picture.to_owned(),
        reference: reference.name.clone(),
        reason,
    };
    let mut notes = Vec::new();
    let hdr = reference.hdr && pictures.iter().all(|p| p.hdr);
    if !hdr {
        notes.push("HDR-FLIP: left out, since not all pictures are HDR".to_owned());
    }
    let hdr = hdr
        && match flip::exposures(&reference.picture) {
            Err(e @ MetricError::BlackReference) => {
                notes.push(format!("HDR-FLIP: left out, {e}"));
                false
            }
            // `entry` reports every other error below.
            _ => true,
        };
    let mut entries = Vec::new();
    for p in pictures {
        begin(p);
        entries.push(entry(p, &reference.picture, options, hdr).map_err(|e| failed(&p.name, e))?);
    }
    let seeds = if options.seeds {
        let all: Vec<&Buffer> = pictures.iter().map(|p| &p.picture).collect();
        let split = metric::bias_variance(&all, &reference.picture);
        Some(split.map_err(|e| failed("the pictures", e))?)
    } else {
        None
    };
    Ok(Comparison {
        reference: reference.name.clone(),
        size: reference.picture.size(),
        entries,
        seeds,
        notes,
    })
}

fn entry(
    named: &Named,
    reference: &Buffer,
    options: &Options,
    hdr: bool,
) -> Result<PictureErrors, MetricError> {
    let picture = &named.picture;
    let mut metrics = metric::pixel::all(picture, reference)?;
    let scale = options.exposure.exp2();
    let (shown, wanted) = (picture.map(|p| p * scale), reference.map(|p| p * scale));
    let map = flip::ldr(&shown, &wanted, options.ppd)?;
    let constants = [
        ("ppd", options.ppd),
        ("exposure", f64::from(options.exposure)),
    ];
    metrics.push(Metric::new(
        "FLIP",
        "mean ΔE of [FLIP20], values clamped to [0, 1]",
        &constants,
        map.mean,
    ));
    let mut maps = vec![
        ("relative", relative_map(picture, reference)),
        ("flip", map.values),
    ];
    if hdr {
        let (map, exposures) = flip::hdr(picture, reference, options.ppd)?;
        let constants = [
            ("ppd", options.ppd),
            ("start", exposures.start),
            ("stop", exposures.stop),
            ("exposures", exposures.count as f64),
        ];
        let formula = "mean of the largest ΔE over exposures, ACES curve [FLIP21]";
        metrics.push(Metric::new("HDR-FLIP", formula, &constants, map.mean));
        maps.push(("hdr-flip", map.values));
    }
    Ok(PictureErrors {
        name: named.name.clone(),
        metrics,
        worst: metric::worst(picture, reference)?,
        maps,
    })
}

/// MAPE's error per pixel, averaged over channels; values above 1 are off the scale.
fn relative_map(picture: &Buffer, reference: &Buffer) -> Vec<f32> {
    let epsilon = opsr::image::relative::EPSILON as f32;
    let pairs = picture.pixels.iter().zip(&reference.pixels);
    pairs
        .map(|(&i, &f)| ((i - f).abs() / (f + epsilon)).element_sum() / 3.0)
        .collect()
}

impl PictureErrors {
    /// An error map in false colours.
    pub fn false_colours(
        &self,
        size: (usize, usize),
    ) -> impl Iterator<Item = (&'static str, Buffer)> + '_ {
        self.maps
            .iter()
            .map(move |(name, values)| (*name, false_colour::map(size.0, size.1, values)))
    }
}

/// Six significant digits, without an exponent if the number is short.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || !value.is_finite() {
        format!("{value}")
    } else if (1e-3..1e6).contains(&size) {
        let digits = (5 - size.log10().floor() as i32).max(0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.5e}")
    }
}

/// A table with one line per metric and one column per picture, then the formulas.
impl fmt::Display for Comparison {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (w, h) = self.size;
        writeln!(out, "reference {} ({w}x{h})\n", self.reference)?;
        let mut rows = vec![vec![String::new()]];
        rows[0].extend(self.entries.iter().map(|e| e.name.clone()));
        let metrics = self.metrics();
        for (i, metric) in metrics.iter().enumerate() {
            let mut row = vec![metric.name.to_owned()];
            row.extend(self.entries.iter().map(|e| number(e.metrics[i].value)));
            rows.push(row);
        }
        let mut row = vec!["worst pixel".to_owned()];
        row.extend(
            self.entries
                .iter()
                .map(|e| format!("({}, {})", e.worst.x, e.worst.y)),
        );
        rows.push(row);
        out.write_str(&aligned(&rows))?;

        let split: Vec<&Metric> = self.seeds.iter().flat_map(BiasVariance::metrics).collect();
        if let Some(seeds) = &self.seeds {
            writeln!(out, "\nover {} renders", seeds.renders)?;
            let rows: Vec<Vec<String>> = split
                .iter()
                .map(|m| vec![m.name.to_owned(), number(m.value)])
                .collect();
            out.write_str(&aligned(&rows))?;
        }
        writeln!(out)?;
        for m in metrics.iter().chain(split) {
            writeln!(out, "{}", definition(m))?;
        }
        for note in &self.notes {
            writeln!(out, "{note}")?;
        }
        Ok(())
    }
}

/// `name: formula; constant = value, …`
pub fn definition(metric: &Metric) -> String {
    let mut text = format!("{}: {}", metric.name, metric.formula);
    let mut separator = "; ";
    for (name, value) in &metric.constants {
        // Shortest decimal, after rounding to five places.
        let _ = write!(text, "{separator}{name} = {}", (value * 1e5).round() / 1e5);
        separator = ", ";
    }
    text
}

/// Columns as wide as their widest cell: the first to the left, numbers to the right.
pub(crate) fn aligned(rows: &[Vec<String>]) -> String {
    let mut widths: Vec<usize> = Vec::new();
    for row in rows {
        widths.resize(widths.len().max(row.len()), 0);
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.chars().count().max(*width);
        }
    }
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (c, (cell, &width)) in row.iter().zip(&widths).enumerate() {
            line += &match c {
                0 => format!("{cell:width$}"),
                _ => format!("  {cell:>width$}"),
            };
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits() {
        let cases = [
            (0.0, "0"),
            (1.0, "1.00000"),
            (0.123_456_789, "0.123457"),
            (123_456.7, "123457"),
            (1e-5, "1.00000e-5"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn constants_are_short() {
        let m = Metric::new(
            "m",
            "f",
            &[("a", 100.0), ("b", 0.01), ("c", 0.0), ("d", -1.512_943_7)],
            1.0,
        );
        assert_eq!(
            definition(&m),
            "m: f; a = 100, b = 0.01, c = 0, d = -1.51294"
        );
    }
}
