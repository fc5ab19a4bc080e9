//! Results of a bench as a JSON file, which is all that a report needs.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde::{Deserialize, Serialize};

use super::machine::Machine;
use super::suite::Suite;
use opsr::files::{self, FileError};
use opsr::image::Buffer;
use opsr::math::Rgb;

/// Version of the file's layout.
pub const VERSION: u32 = 1;

/// Most bytes of a file: this much JSON becomes some hundred MiB of numbers.
const MAX_BYTES: u64 = 1 << 26;

/// The measurements of a suite, complete or so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Results {
    /// Version of the layout, [`VERSION`].
    pub version: u32,
    /// Version of the program.
    pub program: String,
    /// The command line.
    pub command: String,
    /// Machine that it ran on.
    pub machine: Machine,
    /// The suite.
    pub suite: Suite,
    /// Facts about the scenes, in the suite's order.
    pub scenes: Vec<SceneFacts>,
    /// Runs, one for each method, scene and seed, in the order of measurement.
    pub cells: Vec<Run>,
    /// Products of errors between seeds, for methods with all seeds.
    pub products: Vec<Products>,
    /// Parts of pictures that the report shows.
    pub insets: Vec<Inset>,
}

/// A scene as it was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFacts {
    /// Name in the suite.
    pub name: String,
    /// Number of triangles.
    pub triangles: usize,
    /// SHA-256 of its file, or the name of the builtin scene.
    pub source: String,
    /// Origin of the reference, as a message.
    pub reference: String,
    /// Variance of the reference in the units of relMSE; zero if it is not known.
    pub reference_noise: f64,
}

/// One progressive run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// The scene.
    pub scene: String,
    /// The method.
    pub method: String,
    /// The seed.
    pub seed: u64,
    /// Hash of all inputs of this run: a run with an equal key is not repeated.
    pub key: String,
    /// The errors at increasing samples and times.
    pub points: Vec<Point>,
    /// CPU time of the pilot in seconds, over all threads; the time of every point includes it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pilot: f64,
    /// Paths traced in all.
    pub paths: u64,
    /// Samples that were rejected because they were not finite.
    pub rejected: u64,
    /// Share of the vertices with a roughened lobe, counted outside of the measured time.
    pub regularised: f64,
    /// Memory of the process at the end of the run, in MiB, if the system reports it.
    pub memory: Option<f64>,
    /// Reason for which the scene refuses the method; such a run has no measurements.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// State of a run at a time point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Samples per pixel.
    pub samples: u32,
    /// Wall time of the passes so far in seconds.
    pub wall: f64,
    /// CPU time of the passes so far in seconds, over all threads.
    pub cpu: f64,
    /// Errors by the metric's name.
    pub errors: BTreeMap<String, f64>,
}

/// Products of errors of all pairs of seeds at the end of their runs: mean of (Iₖ − f)(Iₗ − f)/(f² + ε) over pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Products {
    /// The scene.
    pub scene: String,
    /// The method.
    pub method: String,
    /// The keys of the runs, in the order of rows and columns.
    pub keys: Vec<String>,
    /// The products.
    pub values: Vec<Vec<f64>>,
}

/// A part of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inset {
    /// The scene.
    pub scene: String,
    /// The method; `None` for the reference.
    pub method: Option<String>,
    /// Key of the run, or source of the reference.
    pub key: String,
    /// Samples per pixel, 0 for the reference.
    pub samples: u32,
    /// Seconds by the suite's clock, 0 for the reference.
    pub seconds: f64,
    /// Width in pixels.
    pub width: usize,
    /// Linear RGB with a shared exponent, four bytes a pixel (see [`encode`](Self::encode)), row by row, in base64.
    pub pixels: String,
}

impl Point {
    /// This point with errors. All numbers are rounded to seven digits: measurements are not more precise.
    pub(super) fn with(&self, errors: BTreeMap<String, f64>) -> Self {
        let rounded = |x: f64| format!("{x:.6e}").parse().unwrap_or(x);
        Self {
            samples: self.samples,
            wall: rounded(self.wall),
            cpu: rounded(self.cpu),
            errors: errors.into_iter().map(|(k, e)| (k, rounded(e))).collect(),
        }
    }
}

impl Inset {
    /// Pixels as text: eight bits per channel with the exponent of the largest, precise to 0.4 % of it, at a quarter of
    /// the size of single precision. Negative and non-finite values become black.
    pub fn encode(picture: &Buffer) -> String {
        let bytes: Vec<u8> = picture.pixels.iter().flat_map(|p| shared(*p)).collect();
        BASE64_STANDARD.encode(bytes)
    }

    /// The picture, unless its text is damaged.
    pub fn picture(&self) -> Option<Buffer> {
        let bytes = BASE64_STANDARD.decode(&self.pixels).ok()?;
        let (pixels, []) = bytes.as_chunks::<4>() else {
            return None;
        };
        let width = self.width;
        if width == 0 || pixels.is_empty() || pixels.len() % width != 0 {
            return None;
        }
        Some(Buffer {
            width,
            height: pixels.len() / width,
            pixels: pixels.iter().map(|p| unshared(*p)).collect(),
        })
    }
}

/// Least exponent, which is stored as 0.
const LOWEST: i32 = -128;

fn shared(pixel: Rgb) -> [u8; 4] {
    let largest = pixel.max_element();
    if !(largest > 0.0 && largest.is_finite()) {
        return [0; 4];
    }
    // The smallest e with 255 · 2^e not below the largest channel.
    let exponent = ((largest / 255.0).log2().ceil() as i32).max(LOWEST);
    let scale = (exponent as f32).exp2();
    let [r, g, b] = pixel
        .to_array()
        .map(|c| (c / scale).round().clamp(0.0, 255.0) as u8);
    [r, g, b, (exponent - LOWEST).min(255) as u8]
}

fn unshared([r, g, b, exponent]: [u8; 4]) -> Rgb {
    let scale = ((i32::from(exponent) + LOWEST) as f32).exp2();
    Rgb::from_array([r, g, b].map(f32::from)) * scale
}

impl Results {
    /// Reads a file.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let invalid = |reason: String| {
            let what = format!("not results of a bench that this program reads: {reason}");
            FileError::content(path, what)
        };
        let text = files::read_text(path, MAX_BYTES)?;
        let results: Self = serde_json::from_str(&text).map_err(|e| invalid(e.to_string()))?;
        if results.version != VERSION {
            return Err(invalid(format!(
                "version {} of the layout, this program reads {VERSION}",
                results.version
            )));
        }
        super::check::suite(&results.suite).map_err(|e| invalid(format!("suite: {e}")))?;
        Ok(results)
    }

    /// Writes the file atomically.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        files::write(path, |out| {
            // Without line breaks, which would make it three times as large.
            serde_json::to_writer(&mut *out, self)?;
            out.write_all(b"\n")
        })
    }

    /// The runs of a method on a scene, in the suite's order of seeds; none if the scene refuses the method.
    pub fn runs(&self, scene: &str, method: &str) -> Vec<&Run> {
        let of = |seed: u64| {
            self.cells
                .iter()
                .find(|c| c.scene == scene && c.method == method && c.seed == seed)
                .filter(|c| c.refused.is_none())
        };
        self.suite.seeds().filter_map(of).collect()
    }

    /// Methods that a scene refuses, each with the reason.
    pub fn refused(&self, scene: &str) -> Vec<(&str, &str)> {
        let of_scene = self.cells.iter().filter(|c| c.scene == scene);
        let mut refused: Vec<(&str, &str)> = of_scene
            .filter_map(|c| Some((c.method.as_str(), c.refused.as_deref()?)))
            .collect();
        refused.dedup();
        refused
    }

    /// Products of errors of a method on a scene, from which its squared bias is estimated.
    pub fn products(&self, scene: &str, method: &str) -> Option<&Products> {
        self.products
            .iter()
            .find(|p| p.scene == scene && p.method == method)
    }

    /// A picture to show; the reference for `None`.
    pub fn inset(&self, scene: &str, method: Option<&str>) -> Option<&Inset> {
        self.insets
            .iter()
            .find(|i| i.scene == scene && i.method.as_deref() == method)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inset_round_trip() {
        let picture = Buffer::from_fn(5, 3, |x, y| {
            Rgb::new(1e-6, 0.3, 7.0) * (10f32).powi(x as i32 * 2 - 3) * (1.0 + y as f32)
        });
        let inset = Inset {
            scene: String::new(),
            method: None,
            key: String::new(),
            samples: 0,
            seconds: 0.0,
            width: 5,
            pixels: Inset::encode(&picture),
        };
        let back = inset.picture().unwrap();
        assert_eq!(back.size(), picture.size());
        for (a, b) in back.pixels.iter().zip(&picture.pixels) {
            let error = (*a - *b).abs().max_element();
            assert!(error <= 0.004 * b.max_element(), "{a} for {b}");
        }
        for odd in [Rgb::ZERO, Rgb::NAN, Rgb::splat(-1.0)] {
            assert_eq!(unshared(shared(odd)), Rgb::ZERO);
        }
        assert_eq!(unshared(shared(Rgb::splat(4.0))), Rgb::splat(4.0));
        let torn = Inset {
            pixels: inset.pixels[4..].to_owned(),
            ..inset
        };
        assert!(torn.picture().is_none());
    }
}
