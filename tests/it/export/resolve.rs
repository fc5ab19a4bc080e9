//! The choice among levels as a C header: compiled with the listing of `docs/renderers.md`, and compared on pictures.

use super::host::listings;
use super::{succeeded, table, tool};
use opsr::image::film::Window;
use opsr::image::level_film::{BATCHES, FEATURES, LevelFilm, PathLevels};
use opsr::math::{Rgb, UVec2};
use opsr::regularise::Lookup;
use opsr::regularise::export::{Format, export};
use opsr::resolve::{Resolve, Resolved, resolve_film};
use rand::{RngExt, SeedableRng};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Without an argument it runs the header's own test picture, else the choice for a film from standard input.
const DRIVER: &str = r#"
#include "listing.c"
#include <stdio.h>
#define WRITE(a, n) (fwrite(a, sizeof *(a), n, stdout) == (size_t)(n) ? 0 : 1)
int main(int argc, char **argv)
{
    static float test_light[(OPSR_TEST_LEVELS + 1) * 12 * OPSR_TEST_PIXELS], test_features[OPSR_TEST_PIXELS * 11];
    int head[4], n, failed;
    (void)argv;
    if (argc == 1) {
        opsr_test_film(test_light, test_features);
        failed = WRITE(test_light, sizeof test_light / 4) + WRITE(test_features, sizeof test_features / 4);
        return failed ? 99 : opsr_resolve_test();
    }
    if (fread(head, 4, 4, stdin) != 4) return 1;
    n = head[0] * head[1];
    float *light = malloc((size_t)n * 48 * (size_t)(head[2] + 1)), *features = malloc((size_t)n * 44);
    float *picture = malloc((size_t)n * 12), *bias2 = malloc((size_t)n * 4), *variance = malloc((size_t)n * 4), *error = malloc((size_t)n * 4);
    unsigned char *level = malloc((size_t)n);
    if (fread(light, 48 * (size_t)(head[2] + 1), (size_t)n, stdin) != (size_t)n) return 2;
    if (fread(features, 44, (size_t)n, stdin) != (size_t)n) return 3;
    opsr_film film = {head[0], head[1], head[2], light, features, {0.25f, 0.25f, 0.25f, 0.25f}, head[3]};
    opsr_resolved out = {picture, level, bias2, variance, error};
    if (opsr_scales[3] != 16.0f) return 4;
    if (head[2] == 4 && head[3] == OPSR_DEFAULT ? choose(head[0], head[1], light, features, out) != 0 : opsr_resolve(&film, &out)) return 6;
    failed = WRITE(picture, n * 3) + WRITE(bias2, n) + WRITE(variance, n) + WRITE(error, n) + WRITE(level, n);
    free(light); free(features); free(picture); free(bias2); free(variance); free(error); free(level);
    return failed ? 5 : 0;
}
"#;

/// Light by level, batch, pixel and channel, with the light common to all levels last, and features by pixel.
struct Arrays {
    size: [usize; 2],
    levels: usize,
    light: Vec<f32>,
    features: Vec<f32>,
}

impl Arrays {
    fn pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// A film of one sample per batch.
    fn film(&self) -> LevelFilm {
        let size = UVec2::new(self.size[0] as u32, self.size[1] as u32);
        let mut film = LevelFilm::new(size, Window::full(size), self.levels);
        for pixel in 0..self.pixels() {
            for batch in 0..BATCHES {
                let light = |level: usize| {
                    let at = (level * BATCHES + batch) * self.pixels() + pixel;
                    Rgb::from_slice(&self.light[3 * at..])
                };
                let levels: Vec<Rgb> = (0..self.levels).map(light).collect();
                let features = &self.features[pixel * FEATURES..(pixel + 1) * FEATURES];
                let path = PathLevels {
                    levels: &levels,
                    shared: light(self.levels),
                    features: features.try_into().unwrap(),
                };
                film.push(pixel, batch as u32, &path);
            }
        }
        film
    }

    /// Two surfaces with a column of pixels that show both, rare hits at sharp levels, and noise.
    fn random(seed: u64) -> Self {
        let (size, levels) = ([37, 29], 4);
        let pixels = size[0] * size[1];
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut light = vec![0.0; (levels + 1) * BATCHES * pixels * 3];
        let mut features = Vec::new();
        for pixel in 0..pixels {
            let wall = pixel % size[0] > 20;
            let [n, m] = match pixel % size[0] {
                20 => [0.4, 0.6],
                _ if wall => [1.0, 0.0],
                _ => [0.0, 1.0],
            };
            let depth = 4.0 + 0.1 * (pixel / size[0]) as f32;
            features.extend([n, m, 0.0, depth, n, m, 0.0, depth, 0.5 * n, 0.3, 0.7]);
            for batch in 0..BATCHES {
                let shared = 0.3 + 0.2 * n + 0.1 * random.random::<f32>();
                for level in 0..=levels {
                    let chance = 0.05 * 4f32.powi(level as i32);
                    let hit = random.random::<f32>() < chance;
                    let own = if level < levels && hit {
                        0.4 / chance.min(1.0)
                    } else {
                        0.0
                    };
                    for c in 0..3 {
                        let at = ((level * BATCHES + batch) * pixels + pixel) * 3 + c;
                        light[at] = shared + own * (1.0 - 0.2 * c as f32) * (1.0 - 0.5 * n);
                    }
                }
            }
        }
        Self {
            size,
            levels,
            light,
            features,
        }
    }
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    let words = bytes.chunks_exact(4).map(|w| w.try_into().unwrap());
    words.map(f32::from_ne_bytes).collect()
}

/// Runs the program on a film and compares its choice. Of two candidates that are equal up to the last digits, either
/// may be chosen.
fn compare(program: &Path, arrays: &Arrays, how: Resolve, smoothing: u32) {
    let resolved = resolve_film(&arrays.film(), how);
    let (error, stated) = (resolved.error(), resolved.statement().mean);
    let Resolved {
        picture,
        level,
        bias2,
        variance,
        ..
    } = resolved;
    let [w, h] = arrays.size.map(|side| side as u32);
    let mut input: Vec<u8> = [w, h, arrays.levels as u32, smoothing]
        .iter()
        .flat_map(|v| v.to_ne_bytes())
        .collect();
    let numbers = arrays.light.iter().chain(&arrays.features);
    input.extend(numbers.flat_map(|v| v.to_ne_bytes()));
    let mut run = Command::new(program)
        .arg("film")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    run.stdin.take().unwrap().write_all(&input).unwrap();
    let output = run.wait_with_output().unwrap();
    succeeded("the compiled choice", &output);
    let n = arrays.pixels();
    let (numbers, levels) = output.stdout.split_at(24 * n);
    let numbers = floats(numbers);
    let pixels = picture.pixels.iter().flat_map(|p| p.to_array());
    let expected: Vec<f32> = pixels.chain(bias2).chain(variance).chain(error).collect();
    let near = |(a, b): &(&f32, &f32)| (*a - *b).abs() <= 2e-3 * b.abs() + 1e-5;
    let right = numbers.iter().zip(&expected).filter(near).count();
    assert!(right * 100 >= 99 * 6 * n, "{how:?}: {right} of {}", 6 * n);
    let mean = numbers[5 * n..].iter().map(|&e| f64::from(e)).sum::<f64>() / n as f64;
    assert!(
        (mean / stated - 1.0).abs() < 0.02,
        "{how:?}: {mean} {stated}"
    );
    let same = levels.iter().zip(&level).filter(|(a, b)| a == b).count();
    assert!(same * 100 >= 99 * n, "{how:?}: {same} of {n} levels");
    assert!(
        (0..arrays.levels as u8)
            .filter(|k| level.contains(k))
            .count()
            > 1
    );
}

#[test]
fn c_chooses_as_the_library_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(
        at("resolve.h"),
        export(&table(Lookup::Nearest, 1.0), Format::Resolve),
    )
    .unwrap();
    let [_, _, listing] = listings();
    std::fs::write(at("listing.c"), listing).unwrap();
    std::fs::write(at("main.c"), DRIVER).unwrap();
    let flags =
        "-std=c99 -O2 -Wall -Wextra -Wpedantic -Werror -DOPSR_RESOLVE_TEST -o program main.c -lm";
    let flags: Vec<&str> = flags.split(' ').collect();
    let Some(output) = tool(folder.path(), "cc", &flags) else {
        return;
    };
    succeeded("cc", &output);
    let program = at("program");
    // The header's test picture: its expected values, and those of the library.
    let output = Command::new(&program).output().unwrap();
    succeeded("the test of the header", &output);
    let numbers = floats(&output.stdout);
    let (size, levels) = ([24, 16], 3);
    let (light, features) = numbers.split_at(numbers.len() - 24 * 16 * FEATURES);
    let test = Arrays {
        size,
        levels,
        light: light.to_vec(),
        features: features.to_vec(),
    };
    compare(&program, &test, Resolve::Default, 1);
    for (how, smoothing) in [(Resolve::Sharp, 0), (Resolve::Default, 1)] {
        compare(
            &program,
            &Arrays::random(3 + u64::from(smoothing)),
            how,
            smoothing,
        );
    }
}
