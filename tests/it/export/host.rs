//! The loop of a host path tracer in `docs/renderers.md`, before and after regularisation, compiled and run.
//!
//! In the host, integrals are sums: directions are points of a circle of length 1, an arc of which is a light. Every
//! other ray hits the next of three surfaces. A lobe of roughness α is a triangle of half-width α / 2.

use super::{succeeded, tool};
use crate::support::root;
use opsr::regularise::export::{Format, export};
use opsr::regularise::file::TableFile;
use opsr::regularise::{AttenuationTable, PathRoughness};
use std::process::Command;

/// Roughness of the surfaces, in the order of the path.
const ALPHAS: [f32; 3] = [1.0, 0.04, 0.1];
const ALBEDO: f64 = 0.8;
/// First direction and length of the light's arc, and its radiance.
const LIGHT: [f64; 3] = [0.4, 0.02, 30.0];
/// Direction of camera rays.
const CAMERA: f64 = 0.1;

/// The definitions that the listings need, and a program that prints mean, standard error of the mean and the number of
/// paths on which both loops are bit-identical.
const HOST: &str = r#"
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

typedef struct ray { float w; int next; } ray;
typedef struct hit { float w, alpha, emission; int surface; } hit;
typedef struct light { float w, emission, pdf; } light;

static const float alphas[3] = {ALPHAS};
static const float light_start = LIGHT_START, light_length = LIGHT_LENGTH, radiance = RADIANCE;
static uint64_t state;

static float uniform(void)
{
    uint64_t x = (state += 0x9E3779B97F4A7C15u);
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
    return (float)((x ^ (x >> 31)) >> 40) * 0x1p-24f;
}

static float wrap(float w) { return w - floorf(w); }

static bool trace(ray r, hit *x)
{
    *x = (hit){r.w, 0.0f, 0.0f, r.next};
    if (r.next > 0 && wrap(r.w - light_start) < light_length) {
        x->emission = radiance;
        return true;
    }
    if (r.next < 3) x->alpha = alphas[r.next];
    return r.next < 3;
}

static float f_pdf(const hit *x, float w, float alpha)
{
    float d = wrap(w - x->w + 0.5f) - 0.5f, half = 0.5f * alpha;
    return fabsf(d) < half ? (1.0f - fabsf(d) / half) / half : 0.0f;
}

static float f(const hit *x, float w, float alpha) { return ALBEDO * f_pdf(x, w, alpha); }

static ray sample_f(const hit *x, float alpha, float *pdf)
{
    ray r = {wrap(x->w + 0.5f * alpha * (uniform() + uniform() - 1.0f)), x->surface + 1};
    *pdf = f_pdf(x, r.w, alpha);
    return r;
}

static light sample_light(const hit *x)
{
    light l = {wrap(light_start + light_length * uniform()), radiance, 1.0f / light_length};
    (void)x;
    return l;
}

static float light_pdf(const hit *x) { (void)x; return 1.0f / light_length; }
static bool visible(const hit *x, float w) { (void)x; (void)w; return true; }
static float weight(float p, float q) { return p > 0.0f ? p / (p + q) : 1.0f; }

LISTINGS

static void print(float (*loop)(ray))
{
    const int paths = 1000000;
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < paths; ++i) {
        ray r = {CAMERA, 0};
        double x;
        state = (uint64_t)i << 32;
        x = loop(r);
        sum += x;
        squares += x * x;
    }
    sum /= paths;
    printf("%.9g %.9g\n", sum, sqrt((squares / paths - sum * sum) / paths));
}

int main(void)
{
    int same = 0;
    print(before);
    print(after);
    for (int i = 0; i < 10000; ++i) {
        ray r = {CAMERA, 0};
        float x;
        state = (uint64_t)i << 32;
        x = before(r);
        state = (uint64_t)i << 32;
        same += x == after(r);
    }
    printf("%d 0\n", same);
    return 0;
}
"#;

/// C listings of the page for renderer engineers: the loop before and after, and the choice among levels.
pub(super) fn listings() -> [String; 3] {
    let page = root().join("docs/renderers.md");
    let text = std::fs::read_to_string(page).expect("the page");
    let blocks: Vec<String> = (text.split("```").skip(1).step_by(2))
        .filter_map(|block| block.strip_prefix("c\n").map(str::to_owned))
        .collect();
    blocks.try_into().expect("three listings in C")
}

/// Density of a lobe of roughness `alpha` for two directions at distance `d` on the circle.
fn lobe(d: f64, alpha: f32) -> f64 {
    let (d, half) = (d - d.round(), 0.5 * f64::from(alpha));
    (1.0 - d.abs() / half).max(0.0) / half
}

/// Light at the camera if the last surface of each path is evaluated at its roughness in `last`.
fn integral(last: [f32; 3]) -> f64 {
    const CELLS: usize = 4000;
    let middle = |i: usize| (i as f64 + 0.5) / CELLS as f64;
    let is_light = |i: usize| (middle(i) - LIGHT[0]).rem_euclid(1.0) < LIGHT[1];
    let scattered = |from: &[(f64, f64)], to: f64, alpha: f32| -> f64 {
        let terms = from.iter().map(|&(w, power)| power * lobe(to - w, alpha));
        ALBEDO * terms.sum::<f64>()
    };
    // Directions of rays to a surface, each with the power of its path.
    let mut arriving = vec![(CAMERA, 1.0)];
    let mut sum = 0.0;
    for (alpha, last) in ALPHAS.into_iter().zip(last) {
        let seen = |i: usize| LIGHT[2] * scattered(&arriving, middle(i), last);
        sum += (0..CELLS).filter(|&i| is_light(i)).map(seen).sum::<f64>() / CELLS as f64;
        arriving = (0..CELLS)
            .filter(|&i| !is_light(i))
            .map(|i| {
                (
                    middle(i),
                    scattered(&arriving, middle(i), alpha) / CELLS as f64,
                )
            })
            .collect();
    }
    sum
}

/// Compiles and runs the listings with a table, the second one replaced by `after`. Returns mean and standard error of
/// both loops, and the number of 10,000 paths on which they agree; `None` without a C compiler.
fn run(table: &TableFile, after: &str) -> Option<[[f64; 2]; 3]> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("opsr_table.h"), export(table, Format::C)).unwrap();
    let listings = listings()[0].clone() + after;
    let mut source = HOST.replace("LISTINGS", &listings);
    for (name, value) in [
        ("ALPHAS", ALPHAS.map(|a| format!("{a:?}f")).join(", ")),
        ("LIGHT_START", format!("{:?}f", LIGHT[0])),
        ("LIGHT_LENGTH", format!("{:?}f", LIGHT[1])),
        ("RADIANCE", format!("{:?}f", LIGHT[2])),
        ("ALBEDO", format!("{ALBEDO:?}f")),
        ("CAMERA", format!("{CAMERA:?}f")),
    ] {
        source = source.replace(name, &value);
    }
    std::fs::write(at("main.c"), source).unwrap();
    let warnings = ["-Wall", "-Wextra", "-pedantic", "-Werror"];
    let arguments = [
        &["-std=c99", "-O2"],
        &warnings[..],
        &["-o", "program", "main.c", "-lm"],
    ];
    let output = tool(folder.path(), "cc", &arguments.concat())?;
    succeeded("cc", &output);
    let run = Command::new(at("program")).output().unwrap();
    succeeded("the compiled program", &run);
    let text = String::from_utf8(run.stdout).unwrap();
    let mut numbers = text.split_whitespace().map(|n| n.parse().unwrap());
    Some([(); 3].map(|()| [(); 2].map(|()| numbers.next().unwrap())))
}

/// Roughness of each surface as the last one of a path.
fn roughened(table: &AttenuationTable) -> [f32; 3] {
    let mut path = PathRoughness::default();
    ALPHAS.map(|alpha| {
        let roughened = path.accumulate(alpha, table, 1.0);
        path.push(alpha, table, 1.0);
        roughened
    })
}

fn constant(gamma: f32) -> TableFile {
    TableFile {
        table: AttenuationTable::constant(gamma),
        provenance: None,
    }
}

#[test]
fn loops_of_the_document_have_the_means_of_integrals() {
    let file = constant(0.3);
    let Some([before, after, _]) = run(&file, &listings()[1]) else {
        return;
    };
    let roughened = roughened(&file.table);
    assert!(roughened[1] > 5.0 * ALPHAS[1], "{roughened:?}");
    for ([mean, error], expected) in [(before, integral(ALPHAS)), (after, integral(roughened))] {
        assert!(
            (mean - expected).abs() < 4.0 * error,
            "{mean} ± {error}, {expected}"
        );
    }
    // The means differ significantly, and the second has less noise.
    assert!(
        (before[0] - after[0]).abs() > 20.0 * before[1],
        "{before:?}, {after:?}"
    );
    assert!(after[1] < 0.8 * before[1], "{before:?}, {after:?}");
}

#[test]
fn a_table_of_zeros_leaves_the_loop_of_the_document_as_it_was() {
    if let Some([_, _, [same, _]]) = run(&constant(0.0), &listings()[1]) {
        assert_eq!(same, 10_000.0);
    }
    if let Some([_, _, [same, _]]) = run(&constant(0.3), &listings()[1]) {
        assert!(same < 10_000.0, "no path was roughened");
    }
}

#[test]
fn a_wrong_loop_in_the_document_would_be_found() {
    let after = &listings()[1];
    let file = constant(0.3);
    for (right, wrong) in [
        ("return counted ?", "return !counted ?"),
        ("counted = alpha > x.alpha;", "counted = false;"),
        ("y.emission / (pdf + light_pdf(&y))", "y.emission / pdf"),
        (
            "throughput * f(&x, l.w, alpha)",
            "throughput * f(&x, l.w, x.alpha)",
        ),
        ("        opsr_scatter(&path, x.alpha); // new\n", ""),
    ] {
        assert_eq!(after.matches(right).count(), 1, "{right}");
        let Some([_, [mean, error], _]) = run(&file, &after.replace(right, wrong)) else {
            return;
        };
        let expected = integral(roughened(&file.table));
        assert!(
            (mean - expected).abs() > 6.0 * error,
            "{wrong}: {mean} ± {error}, {expected}"
        );
    }
}
