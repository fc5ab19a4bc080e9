//! The recursive weights against enumeration of all strategies, over random paths: distances, cosines, densities, Dirac
//! vertices and ends at random, through the functions that the walks call.

use super::*;
use crate::math::UVec2;
use crate::sampler::{Independent, SampleSource, Sampler, Seed};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Light {
    Area,
    Environment,
    Point,
    Directional,
}

/// A path x₀ … x_k; index i belongs to vertex i, distances to the edge before it.
#[derive(Debug)]
struct Path {
    light: Light,
    parallel: bool,
    /// Light samples are the only connections.
    nee: bool,
    light_paths: f64,
    /// M; 0 without merging.
    merging: f64,
    camera_pdf: f64,
    position: f64,
    direction: f64,
    /// Density with which light sampling draws the light's point, over that of emission.
    sampling: f64,
    k: usize,
    distance: Vec<f64>,
    /// Cosines towards the camera and towards the light.
    cos_c: Vec<f64>,
    cos_l: Vec<f64>,
    /// Densities of the camera walk towards the light, and of the light walk towards the camera.
    pdf_c: Vec<f64>,
    pdf_l: Vec<f64>,
    dirac: Vec<bool>,
    /// True if a vertex allows merges at its neighbours; a light does not.
    allows: Vec<bool>,
    /// (n towards the camera / n towards the light)².
    index2: Vec<f64>,
}

impl Path {
    fn random(u: &mut impl Sampler) -> Self {
        let mut next = || f64::from(u.next_1d());
        let pick = |x: f64, n: usize| (x * n as f64) as usize;
        let k = 2 + pick(next(), 8);
        let light = [
            Light::Area,
            Light::Environment,
            Light::Point,
            Light::Directional,
        ][pick(next(), 4)];
        let mut log = |low: f64, high: f64| low * (high / low).powf(next());
        let mut many = |low, high| -> Vec<f64> { (0..=k).map(|_| log(low, high)).collect() };
        let distance = many(0.2, 5.0);
        let (cos_c, cos_l) = (many(0.05, 1.0), many(0.05, 1.0));
        let (mut pdf_c, mut pdf_l) = (many(0.05, 20.0), many(0.05, 20.0));
        let ends = many(0.05, 20.0);
        let light_paths = many(1.0, 1e6)[0].round();
        let m = many(1e-3, 1e3)[0];
        let sampling = many(0.01, 100.0)[0];
        let mut next = || f64::from(u.next_1d());
        let dirac: Vec<bool> = (0..=k).map(|i| i > 0 && i < k && next() < 0.3).collect();
        let allows: Vec<bool> = (0..=k).map(|i| i < k && next() < 0.7).collect();
        let mut index2 = vec![1.0; k + 1];
        for i in (0..=k).filter(|&i| dirac[i]) {
            index2[i] = [1.0, 2.25, 1.0 / 2.25][pick(next(), 3)];
            // Exact ratio of the densities of a Dirac pair: η²|cos| dω is the same on both sides.
            pdf_c[i] = 1.0;
            pdf_l[i] = cos_c[i] / cos_l[i] * index2[i];
        }
        Self {
            light,
            parallel: next() < 0.3,
            nee: false,
            light_paths,
            merging: if next() < 0.5 { m } else { 0.0 },
            camera_pdf: ends[0],
            position: ends[1],
            direction: ends[2],
            sampling,
            k,
            distance,
            cos_c,
            cos_l,
            pdf_c,
            pdf_l,
            dirac,
            allows,
            index2,
        }
    }

    fn infinite(&self) -> bool {
        matches!(self.light, Light::Environment | Light::Directional)
    }

    /// True if strategy t, which cuts the edge before x_t, can make the path.
    fn possible(&self, t: usize) -> bool {
        if t == self.k + 1 {
            return matches!(self.light, Light::Area | Light::Environment);
        }
        !self.dirac[t - 1] && !self.dirac[t] && (t == self.k || !self.nee)
    }

    /// Density per area with which the camera walk finds x_i.
    fn camera_density(&self, i: usize) -> f64 {
        let to_area = self.cos_c[i] / (self.distance[i] * self.distance[i]);
        match i {
            1 if self.parallel => self.camera_pdf * self.cos_c[1],
            1 => self.camera_pdf * to_area,
            _ if i == self.k && self.infinite() => self.pdf_c[i - 1],
            _ => self.pdf_c[i - 1] * to_area,
        }
    }

    /// Density per area with which the light walk finds x_i.
    fn light_density(&self, i: usize) -> f64 {
        if i == self.k {
            return if self.infinite() {
                self.direction
            } else {
                self.position
            };
        }
        let to_area = self.cos_l[i] / (self.distance[i + 1] * self.distance[i + 1]);
        match i + 1 == self.k {
            true if self.infinite() => self.position * self.cos_l[i],
            true => self.direction * to_area,
            false => self.pdf_l[i + 1] * to_area,
        }
    }

    /// True if both walks can merge at x_j.
    fn merges(&self, j: usize) -> bool {
        let inner = j > 0 && j < self.k && !self.dirac[j];
        self.merging > 0.0 && inner && self.allows[j - 1] && self.allows[j + 1]
    }

    /// Balance heuristic by definition: strategies t = 0 … k + 1, then merges at x_0 … x_k.
    fn enumerated(&self) -> Vec<f64> {
        let density = |t: usize| {
            if t == 0 || !self.possible(t) {
                return 0.0;
            }
            let camera: f64 = (1..t).map(|i| self.camera_density(i)).product();
            let light: f64 = (t..=self.k).map(|i| self.light_density(i)).product();
            let chances = match t {
                1 => self.light_paths,
                t if t == self.k => self.sampling,
                _ => 1.0,
            };
            camera * light * chances
        };
        let merge = |j: usize| {
            if !self.merges(j) {
                return 0.0;
            }
            let camera: f64 = (1..=j).map(|i| self.camera_density(i)).product();
            let light: f64 = (j..=self.k).map(|i| self.light_density(i)).product();
            self.merging * camera * light
        };
        let merges = (0..=self.k).map(merge);
        let all: Vec<f64> = (0..self.k + 2).map(density).chain(merges).collect();
        let sum: f64 = all.iter().sum();
        all.iter().map(|q| q / sum).collect()
    }

    /// The weights of the walks; indices as in `enumerated`.
    fn recursive<T: Real>(&self, of: impl Fn(f64) -> T) -> Vec<Option<T>> {
        let k = self.k;
        let squared = |i: usize, free: bool| (!free).then(|| of(self.distance[i].powi(2)));
        let n = of(self.light_paths);
        let merging = match self.merging {
            0.0 => Merging::none(),
            m => Merging::new(of(m)),
        };
        let [merging, light_merging] = if self.nee {
            merging.light_sampling_only()
        } else {
            [merging; 2]
        };
        // Partial sums of both walks on arrival at x_i, and of the camera walk before it.
        let mut walk = Partial::camera(of(self.camera_pdf), n);
        let (mut camera, mut before) = (vec![Partial::default_of(&of)], vec![walk]);
        // c_out / p_f of the vertex before if the one before that allows its merges.
        let mut pending = None;
        for i in 1..=k {
            before.push(walk);
            walk.arrive(squared(i, i == 1 && self.parallel), of(self.cos_c[i]));
            if let Some(pending) = pending.take().filter(|_| self.allows[i]) {
                walk.add_merges(of(pending / self.cos_c[i]), &merging);
            }
            camera.push(walk);
            if self.dirac[i] {
                walk.dirac(of(self.cos_c[i]), of(self.index2[i]));
            } else {
                let step = Step {
                    cos_out: of(self.cos_l[i]),
                    pdf: of(self.pdf_c[i]),
                    pdf_reverse: of(self.pdf_l[i]),
                };
                walk.scatter(&step, &merging);
                pending = self.allows[i - 1].then_some(self.cos_l[i] / self.pdf_c[i]);
            }
        }
        let cos = match self.light {
            Light::Area => self.cos_c[k],
            Light::Environment => 1.0,
            _ => 0.0,
        };
        let mut walk = Partial::light(
            of(self.position),
            of(self.direction),
            self.infinite(),
            of(cos),
            &light_merging,
        );
        let mut light = vec![Partial::default_of(&of); k + 1];
        let mut pending = None;
        for i in (1..k).rev() {
            let free = i + 1 == k && self.infinite();
            walk.arrive(squared(i + 1, free), of(self.cos_l[i]));
            if i + 1 == k {
                walk.sampled(of(self.sampling));
            }
            if let Some(pending) = pending.take().filter(|_| self.allows[i]) {
                walk.add_merges(of(pending / self.cos_l[i]), &light_merging);
            }
            light[i] = walk;
            if self.dirac[i] {
                walk.dirac(of(self.cos_l[i]), of(1.0 / self.index2[i]));
            } else {
                let step = Step {
                    cos_out: of(self.cos_c[i]),
                    pdf: of(self.pdf_l[i]),
                    pdf_reverse: of(self.pdf_c[i]),
                };
                walk.scatter(&step, &light_merging);
                pending = self.allows[i + 1].then_some(self.cos_c[i] / self.pdf_l[i]);
            }
        }
        let end = |partial: Partial<T>, pdf_area: f64, pdf_reverse: f64, j: usize| End {
            partial,
            pdf_area: of(pdf_area),
            pdf_reverse: of(pdf_reverse),
            merges: self.merges(j),
        };
        let weight = |t: usize| {
            if t == 0 || !self.possible(t) {
                return None;
            }
            let d2 = self.distance[t.min(k)].powi(2);
            Some(if t == k + 1 {
                let partial = if self.infinite() {
                    &before[k]
                } else {
                    &camera[k]
                };
                let first = if self.infinite() {
                    self.direction
                } else {
                    self.position
                };
                let emitted = of(self.position) * of(self.direction);
                hit(partial, of(first * self.sampling), emitted)
            } else if t == k {
                let pdf_light = match self.light {
                    Light::Area => self.position * d2 / self.cos_c[k],
                    Light::Environment => self.direction,
                    _ => f64::INFINITY,
                };
                let pdf_light = pdf_light * self.sampling;
                let pdf_area = self.light_density(k - 1) / self.sampling;
                let camera = end(camera[k - 1], pdf_area, self.pdf_l[k - 1], k - 1);
                light_sample(of(self.pdf_c[k - 1] / pdf_light), &camera, &merging)
            } else if t == 1 {
                {
                    let light = end(light[1], self.camera_density(1), self.pdf_c[1], 1);
                    camera_sample(&light, n, &merging)
                }
            } else {
                connection(
                    &end(
                        light[t],
                        self.pdf_c[t - 1] * self.cos_c[t] / d2,
                        self.pdf_c[t],
                        t,
                    ),
                    &end(
                        camera[t - 1],
                        self.pdf_l[t] * self.cos_l[t - 1] / d2,
                        self.pdf_l[t - 1],
                        t - 1,
                    ),
                    &merging,
                )
            })
        };
        let merged = |j: usize| {
            let pdfs = (of(self.pdf_c[j]), of(self.pdf_l[j]));
            let weight = || merge(&light[j], &camera[j], pdfs.0, pdfs.1, &merging);
            self.merges(j).then(weight)
        };
        (0..k + 2).map(weight).chain((0..=k).map(merged)).collect()
    }
}

/// Zeros, where a walk has no sums.
trait Zero<T> {
    fn default_of(of: &impl Fn(f64) -> T) -> Self;
}

impl<T: Real> Zero<T> for Partial<T> {
    fn default_of(of: &impl Fn(f64) -> T) -> Self {
        Self {
            vcm: of(0.0),
            vc: of(0.0),
            vm: of(0.0),
        }
    }
}

/// Largest error of a weight, and of the sum of weights, over this many random paths.
fn errors<T: Real + Into<f64>>(paths: u32, of: impl Fn(f64) -> T) -> (f64, f64) {
    let source = Independent { seed: Seed(19) };
    let (mut single, mut total) = (0f64, 0f64);
    for number in 0..paths {
        let mut path = Path::random(&mut source.stream(UVec2::ZERO, number));
        path.nee = path.merging > 0.0 && number % 4 == 0;
        let expected = path.enumerated();
        let none = (1..path.k + 2).all(|t| !path.possible(t));
        if none && (0..path.k).all(|j| !path.merges(j)) {
            continue;
        }
        let mut sum = 0.0;
        for (t, weight) in path.recursive(&of).into_iter().enumerate() {
            let weight: f64 = weight.map_or(0.0, Into::into);
            let error = (weight - expected[t]).abs();
            assert!(error < 1e-3, "strategy {t}: {weight}, {path:?}");
            single = single.max(error);
            sum += weight;
        }
        total = total.max((sum - 1.0).abs());
    }
    println!("largest error of a weight {single:.1e}, of a sum {total:.1e}");
    (single, total)
}

#[test]
fn mis_weights_equal_enumeration_in_double_precision() {
    let (single, sum) = errors(100_000, |x| x);
    assert!(single < 1e-12 && sum < 1e-12, "{single} {sum}");
}

#[test]
fn mis_weights_sum_to_one_in_single_precision() {
    let (single, sum) = errors(100_000, |x| x as f32);
    assert!(single < 1e-5 && sum < 1e-5, "{single} {sum}");
}
