//! Plots as SVG: lines over two axes, and values with intervals.
//!
//! Ink is `currentColor` and there is no background, so a plot takes the colours of its page, dark or light. A separate
//! file follows the reader's preference. A plot depends only on its data.

use maud::{Markup, PreEscaped, html};

/// The colour of text and axes.
pub(super) const INK: &str = "currentColor";

/// Pixels.
const WIDTH: f64 = 570.0;
const HEIGHT: f64 = 370.0;
const MARGIN: f64 = 10.0;
/// Below the plotting area: tick labels and the axis label.
const FOOT: f64 = 48.0;
/// Heights of a row of intervals and of an entry of a legend.
const ROW: f64 = 22.0;
const ENTRY: f64 = 18.0;

/// Approximate width of a character of a label, because text is not measured.
const CHARACTER: f64 = 6.4;

const MAX_TICKS: usize = 8;

/// An axis from `low` to `high`; both are positive if it is logarithmic.
pub(super) struct Axis<'a> {
    pub(super) label: &'a str,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) log: bool,
}

impl<'a> Axis<'a> {
    /// A linear axis around values, with some room.
    #[cfg(feature = "train")]
    pub(super) fn around(label: &'a str, values: impl Iterator<Item = f64> + Clone) -> Self {
        let finite = values.filter(|v| v.is_finite());
        let low = finite.clone().reduce(f64::min).unwrap_or(0.0);
        let high = finite.reduce(f64::max).unwrap_or(1.0);
        let room = if high > low { 0.03 * (high - low) } else { 1.0 };
        Self {
            label,
            low: low - room,
            high: high + room,
            log: false,
        }
    }
}

/// A line through points, with a band `(x, low, high)` around it.
pub(super) struct Line<'a> {
    pub(super) name: &'a str,
    pub(super) colour: &'a str,
    /// Value of SVG's `stroke-dasharray`; empty for a solid line.
    pub(super) dashes: &'a str,
    pub(super) points: Vec<(f64, f64)>,
    pub(super) band: Vec<(f64, f64, f64)>,
}

/// A straight line through the whole plot.
pub(super) struct Guide<'a> {
    pub(super) place: Place,
    pub(super) colour: &'a str,
    pub(super) dashes: &'a str,
}

/// Place of a [`Guide`].
pub(super) enum Place {
    X(f64),
    Y(f64),
}

/// Name, value and interval of a row.
pub(super) struct Row<'a> {
    pub(super) name: &'a str,
    pub(super) value: f64,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// An axis on pixels `start..end`.
struct Scale<'a> {
    axis: &'a Axis<'a>,
    start: f64,
    end: f64,
}

impl Scale<'_> {
    fn at(&self, x: f64) -> f64 {
        let Axis { low, high, log, .. } = *self.axis;
        let share = match log {
            true => (x / low).ln() / (high / low).ln(),
            false => (x - low) / (high - low),
        };
        self.start + share * (self.end - self.start)
    }
}

/// Lines over two axes, with a legend at the right.
pub(super) fn lines(x: &Axis, y: &Axis, lines: &[Line], guides: &[Guide]) -> String {
    let ticks = [x, y].map(ticks);
    let legend = 44.0 + longest(lines.iter().map(|l| l.name));
    let left = 34.0 + longest(ticks[1].iter().map(|t| t.1.as_str()));
    // Long names leave at least half of the width to the plot.
    let right = (WIDTH - legend).max(WIDTH / 2.0);
    let bottom = HEIGHT - FOOT;
    let (x, y) = (
        Scale {
            axis: x,
            start: left,
            end: right,
        },
        Scale {
            axis: y,
            start: bottom,
            end: MARGIN,
        },
    );
    let middle = (bottom + MARGIN) / 2.0;
    let body = html! {
        (below(&x, &ticks[0], bottom))
        @for (value, text) in &ticks[1] {
            (segment([left, y.at(*value), right, y.at(*value)], INK, "", 0.15))
            text x=(px(left - 6.0)) y=(px(y.at(*value) + 4.0)) text-anchor="end" { (text) }
        }
        (segment([left, MARGIN, left, bottom], INK, "", 1.0))
        text x="13" y=(px(middle)) text-anchor="middle" font-size="13" transform=(format!("rotate(-90 13 {middle:.1})")) {
            (y.axis.label)
        }
        @for line in lines.iter().filter(|l| !l.band.is_empty()) {
            polygon points=(band(&x, &y, &line.band)) fill=(line.colour) fill-opacity="0.1" {}
        }
        @for guide in guides {
            @let (a, b) = match guide.place {
                Place::X(at) => ((x.at(at), MARGIN), (x.at(at), bottom)),
                Place::Y(at) => ((left, y.at(at)), (right, y.at(at))),
            };
            (segment([a.0, a.1, b.0, b.1], guide.colour, guide.dashes, 1.0))
        }
        @for line in lines {
            polyline points=(points(line.points.iter().map(|p| (x.at(p.0), y.at(p.1))))) fill="none" stroke=(line.colour)
                stroke-width="2" stroke-dasharray=[dashes(line.dashes)] {}
        }
        @for (i, line) in lines.iter().enumerate() {
            @let row = MARGIN + ENTRY * (i as f64 + 0.5);
            polyline points=(points([(right + 12.0, row), (right + 32.0, row)])) stroke=(line.colour) stroke-width="3"
                stroke-dasharray=[dashes(line.dashes)] {}
            text x=(px(right + 38.0)) y=(px(row + 4.0)) { (line.name) }
        }
    };
    svg(HEIGHT.max(2.0 * MARGIN + ENTRY * lines.len() as f64), body)
}

/// Values with intervals, one row each, and a dashed line at `reference`.
pub(super) fn intervals(x: &Axis, reference: f64, rows: &[Row], colour: &str) -> String {
    let ticks = ticks(x);
    let left = (20.0 + longest(rows.iter().map(|r| r.name))).min(WIDTH / 2.0);
    let bottom = MARGIN + ROW * rows.len() as f64;
    let x = Scale {
        axis: x,
        start: left,
        end: WIDTH - 20.0,
    };
    let at = x.at(reference);
    let body = html! {
        (below(&x, &ticks, bottom))
        (segment([at, MARGIN, at, bottom], INK, "4 3", 0.8))
        @for (i, row) in rows.iter().enumerate() {
            @let y = MARGIN + ROW * (i as f64 + 0.5);
            text x=(px(left - 8.0)) y=(px(y + 4.0)) text-anchor="end" { (row.name) }
            polyline points=(points([(x.at(row.low), y), (x.at(row.high), y)])) stroke=(colour) stroke-width="2" {}
            circle cx=(px(x.at(row.value))) cy=(px(y)) r="4.5" fill=(colour) {}
        }
    };
    svg(bottom + FOOT, body)
}

/// The horizontal axis below a plot: grid, ticks and label.
fn below(x: &Scale, ticks: &[(f64, String)], bottom: f64) -> Markup {
    html! {
        @for (value, text) in ticks {
            (segment([x.at(*value), MARGIN, x.at(*value), bottom], INK, "", 0.15))
            text x=(px(x.at(*value))) y=(px(bottom + 16.0)) text-anchor="middle" { (text) }
        }
        (segment([x.start, bottom, x.end, bottom], INK, "", 1.0))
        text x=(px((x.start + x.end) / 2.0)) y=(px(bottom + 38.0)) text-anchor="middle" font-size="13" { (x.axis.label) }
    }
}

fn svg(height: f64, body: Markup) -> String {
    let view = format!("0 0 {WIDTH} {height}");
    // A narrow window scales a plot. In a file of its own, where it is the root, the style sets the ink.
    let style = "svg { max-width: 100%; height: auto; } \
                 @media (prefers-color-scheme: dark) { svg:root { color: #ddd; } }";
    let svg = html! {
        svg role="img" xmlns="http://www.w3.org/2000/svg" viewBox=(view) width=(WIDTH) height=(height) fill=(INK)
            font-family="system-ui, sans-serif" font-size="11" {
            style { (PreEscaped(style)) }
            (body)
        }
    };
    svg.into_string()
}

fn segment([x1, y1, x2, y2]: [f64; 4], colour: &str, pattern: &str, opacity: f64) -> Markup {
    html! {
        line x1=(px(x1)) y1=(px(y1)) x2=(px(x2)) y2=(px(y2)) stroke=(colour) stroke-opacity=(opacity)
            stroke-dasharray=[dashes(pattern)] {}
    }
}

fn dashes(pattern: &str) -> Option<&str> {
    (!pattern.is_empty()).then_some(pattern)
}

fn px(x: f64) -> String {
    format!("{x:.1}")
}

fn points(points: impl IntoIterator<Item = (f64, f64)>) -> String {
    let points: Vec<String> = (points.into_iter())
        .map(|(x, y)| format!("{x:.1},{y:.1}"))
        .collect();
    points.join(" ")
}

/// The outline of a band: along its lower edge and back along the upper one.
fn band(x: &Scale, y: &Scale, band: &[(f64, f64, f64)]) -> String {
    let lower = band.iter().map(|b| (x.at(b.0), y.at(b.1)));
    let upper = band.iter().rev().map(|b| (x.at(b.0), y.at(b.2)));
    points(lower.chain(upper))
}

/// Width of the longest text.
fn longest<'a>(texts: impl Iterator<Item = &'a str>) -> f64 {
    texts
        .map(|t| CHARACTER * t.chars().count() as f64)
        .fold(0.0, f64::max)
}

/// Positions and labels of at most [`MAX_TICKS`] ticks.
fn ticks(axis: &Axis) -> Vec<(f64, String)> {
    let (low, high) = (axis.low, axis.high);
    // On a logarithmic axis, the most digits in each decade that fit; over a short range, linear ticks.
    if axis.log && high > 3.0 * low {
        let exponents = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let digits: [&[i64]; 3] = [&[1, 2, 3, 4, 5, 6, 7, 8, 9], &[1, 2, 5], &[1]];
        for digits in digits {
            let decade = |k: i32| digits.iter().map(move |&digit| tick(digit, k));
            let all: Vec<_> = exponents.clone().flat_map(decade).collect();
            let all = inside(all, low, high);
            if (2..=MAX_TICKS).contains(&all.len()) {
                return all;
            }
        }
        let stride = (high / low).log10() as usize / MAX_TICKS + 1;
        return inside(
            exponents.step_by(stride).map(|k| tick(1, k)).collect(),
            low,
            high,
        );
    }
    let exponent = ((high - low) / MAX_TICKS as f64).log10().floor() as i32;
    let steps = [
        (1, exponent),
        (2, exponent),
        (5, exponent),
        (1, exponent + 1),
    ];
    let all = steps.map(|(digit, k)| {
        let step = tick(digit, k).0;
        let range = (low / step).floor() as i64..=(high / step).ceil() as i64;
        inside(range.map(|i| tick(digit * i, k)).collect(), low, high)
    });
    let fits = |ticks: &Vec<_>| ticks.len() <= MAX_TICKS;
    all.into_iter().find(fits).unwrap_or_default()
}

/// `digits`·10^`exponent`, the nearest number to it, and its shortest label.
fn tick(digits: i64, exponent: i32) -> (f64, String) {
    let value: f64 = format!("{digits}e{exponent}").parse().unwrap_or(f64::NAN);
    let plain = value == 0.0 || (1e-4..1e6).contains(&value.abs());
    let label = if plain {
        format!("{value}")
    } else {
        format!("{value:e}")
    };
    (value, label)
}

fn inside(mut ticks: Vec<(f64, String)>, low: f64, high: f64) -> Vec<(f64, String)> {
    ticks.retain(|t| low <= t.0 && t.0 <= high);
    ticks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, log: bool) -> String {
        let axis = Axis {
            label: "",
            low,
            high,
            log,
        };
        let labels: Vec<String> = ticks(&axis).into_iter().map(|t| t.1).collect();
        labels.join(" ")
    }

    #[test]
    fn ticks_are_round_and_few() {
        for (low, high, log, expected) in [
            (0.46, 1.12, true, "0.5 0.6 0.7 0.8 0.9 1 1.1"),
            (0.13, 0.52, true, "0.2 0.3 0.4 0.5"),
            (0.02, 1.1, true, "0.02 0.05 0.1 0.2 0.5 1"),
            (1.0, 64.0, true, "1 2 5 10 20 50"),
            (1e-6, 2.0, true, "1e-6 1e-5 0.0001 0.001 0.01 0.1 1"),
            (1e-12, 1e3, true, "1e-12 1e-10 1e-8 1e-6 0.0001 0.01 1 100"),
            (0.0, 1000.0, false, "0 200 400 600 800 1000"),
            (-0.25, 0.3, false, "-0.2 -0.1 0 0.1 0.2 0.3"),
            (0.0, 1e7, false, "0 2e6 4e6 6e6 8e6 1e7"),
        ] {
            assert_eq!(labels(low, high, log), expected);
        }
    }
}
