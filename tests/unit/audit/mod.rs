//! Contributions of real paths against the definition.
//!
//! The audit walks paths with the functions of the integrator, closes them in every way, and computes each contribution
//! again from nothing but positions, normals and BSDFs: all densities of both walks by definition, the value of the path,
//! and the balance heuristic by enumeration. It finds what tests of the weights' algebra cannot: swapped directions,
//! a missing η², a shading normal in the wrong place.
//!
//! A module of `opsr::integrator::bidirectional` in tests of the library, since it needs what that room keeps to itself.

mod cases;

use super::iteration::Iteration;
use super::split::{Event, LightSummary, share};
use super::vertex::Vertex;
use super::walk::{ScatterKind, WeightedWalk};
use super::{Bidirectional, Strategies};
use crate::bsdf::Bsdf;
use crate::integrator::View;
use crate::math::{Frame, Ray, Rgb, UVec2, Vec2, Vec3};
use crate::sampler::{LightU, Sampler};
use crate::scene::Surface;
use std::collections::BTreeMap;

/// Differences by rounding: directions are computed again from positions, where edges may be short.
const TOLERANCE: f64 = 1e-3;

/// Result of an audit.
#[derive(Clone, Debug, Default)]
struct Audit {
    /// Contributions that were compared, by strategy (s, t).
    compared: BTreeMap<(u32, u32), u32>,
    /// Contributions whose weight is off by more than 1e-3, or whose value is, relatively.
    apart: u32,
    /// Largest difference of a weight from enumeration.
    weight: f64,
    /// Largest relative difference of a contribution of weight 1 from value over density.
    value: f64,
    /// A contribution that is apart, in words.
    example: String,
    /// Point of the lens through which the path at hand is seen.
    through: Vec2,
}

/// A light's end of a path.
struct LightEnd {
    /// Position, or the direction towards a light at infinity.
    place: Vec3,
    infinite: bool,
    /// Normal of an area light.
    ng: Option<Vec3>,
    /// True if a camera walk can meet the light.
    met: bool,
    /// Index of the light.
    light: usize,
    /// Densities of emission.
    position: f64,
    direction: f64,
    /// Radiance, intensity or irradiance.
    radiance: Rgb,
}

/// A scattering vertex of a path; `delta` if it was passed by a Dirac lobe.
struct Node {
    surface: Surface,
    bsdf: Bsdf,
    alpha: f32,
    delta: bool,
}

impl Node {
    fn new(vertex: &Vertex, delta: bool) -> Self {
        Self {
            surface: vertex.surface,
            bsdf: vertex.bsdf,
            alpha: vertex.alpha,
            delta,
        }
    }
}

/// Densities and value of a whole path; index i belongs to x_i.
struct Definition {
    /// Density per area (per steradian for a light at infinity) of x_i from either walk.
    camera: Vec<f64>,
    light: Vec<f64>,
    /// As `light`, with the exact ratio of Dirac densities at bent normals, as the flux has it.
    flux: Vec<f64>,
    delta: Vec<bool>,
    value: [f64; 3],
    /// Probability with which light sampling at the last vertex draws the light, over that of emission.
    sampling: f64,
}

/// Absolute cosine.
fn cos(a: Vec3, b: Vec3) -> f64 {
    f64::from(a.dot(b).abs())
}

impl Iteration<'_> {
    /// Camera vertices x_1 … and light vertices … x_n of a path and its light, as the definition has them. `None` for
    /// paths that the definition leaves open: with lobes that are not reversible at bent normals.
    fn define(&self, nodes: &[Node], end: &LightEnd, through: Vec2) -> Option<Definition> {
        let sensor = self.view.sensor;
        let n = nodes.len();
        let first = nodes[0].surface.position;
        let sight = sensor.see(first, through)?;
        if self.view.scene.hides_surface(&nodes[0].surface, -sight.wo) {
            return None;
        }
        // Directions at x_i towards the camera and towards the light.
        let (mut to_camera, mut to_light) = (vec![Vec3::ZERO; n + 2], vec![Vec3::ZERO; n + 2]);
        let mut distance2 = vec![1.0f64; n + 2];
        to_camera[1] = sight.wo;
        distance2[1] = if sight.parallel {
            1.0
        } else {
            f64::from(sight.distance).powi(2)
        };
        for i in 1..=n {
            let here = nodes[i - 1].surface.position;
            let edge = match nodes.get(i) {
                Some(next) => next.surface.position - here,
                None if end.infinite => end.place,
                None => end.place - here,
            };
            to_light[i] = edge.normalize();
            to_camera[i + 1] = -to_light[i];
            if i < n || !end.infinite {
                distance2[i + 1] = edge.as_dvec3().length_squared();
            }
        }
        // Geometric cosines at x_i.
        let ng = |i: usize| nodes[i - 1].surface.ng;
        let end_cos = match end.ng {
            Some(ng) => cos(ng, to_camera[n + 1]),
            None => 1.0,
        };
        let cos_c = |i: usize| {
            if i > n {
                end_cos
            } else {
                cos(ng(i), to_camera[i])
            }
        };
        let cos_l = |i: usize| cos(ng(i), to_light[i]);

        let mut events = Vec::new();
        let mut value = Rgb::splat(sight.pdf).as_dvec3() * cos_c(1) / distance2[1];
        let (mut pdf_c, mut pdf_l) = (vec![1.0f64; n + 1], vec![1.0f64; n + 1]);
        let mut exact_l = pdf_l.clone();
        for i in 1..=n {
            let node = &nodes[i - 1];
            let (wo, wi) = (to_camera[i], to_light[i]);
            let frame = node.surface.frame_for(wo);
            let back = node.surface.frame_for(wi);
            let local = |frame: &Frame| (frame.to_local(wo), frame.to_local(wi));
            let (o, l) = local(&frame);
            events.push(if node.delta {
                Event::DIRAC
            } else {
                Event::between(&node.bsdf, node.alpha, Some((o, l)))
            });
            if node.delta {
                if frame.n != back.n {
                    return None;
                }
                let reflects = wo.dot(node.surface.ng) * wi.dot(node.surface.ng) > 0.0;
                let choice = if reflects {
                    0.0
                } else {
                    1.0 - 0.5 * f32::EPSILON
                };
                let sample = node.bsdf.sample(node.alpha, o, [choice, 0.5, 0.5])?;
                // A lobe of total reflection, or rounding at a corner.
                if !sample.delta || sample.wi.dot(l) < 0.9999 {
                    return None;
                }
                value *= sample.weight.as_dvec3();
                let mut bsdf = node.bsdf;
                let index2 = match bsdf.dielectric_mut() {
                    Some(d) if !reflects && !node.bsdf.is_delta_at(1.0) => {
                        let eta = f64::from(d.eta);
                        // (n towards the camera / n towards the light)².
                        let outside = wo.dot(node.surface.ng) > 0.0;
                        if outside {
                            1.0 / (eta * eta)
                        } else {
                            eta * eta
                        }
                    }
                    _ => 1.0,
                };
                pdf_l[i] = cos_c(i) / cos_l(i) * index2;
                exact_l[i] = cos(frame.n, wo) / cos(frame.n, wi) * index2;
            } else {
                let eval = node.bsdf.eval(node.alpha, o, l);
                value *= eval.value.as_dvec3();
                pdf_c[i] = f64::from(eval.pdf_w);
                let (o, l) = local(&back);
                let side =
                    wi.dot(node.surface.ng) * l.z > 0.0 && wo.dot(node.surface.ng) * o.z > 0.0;
                pdf_l[i] = if side {
                    f64::from(node.bsdf.pdf(node.alpha, l, o))
                } else {
                    0.0
                };
                exact_l[i] = pdf_l[i];
            }
            if i < n || !end.infinite {
                value *= cos_c(i + 1) / distance2[i + 1];
            }
        }
        let easy =
            (Rgb::ONE - events[n - 1].gloss * self.split_by_definition(nodes, &events)).as_dvec3();
        let value = (value * easy * end.radiance.as_dvec3()).to_array();
        let mut camera = vec![1.0; n + 2];
        camera[1] = f64::from(sight.pdf) * cos_c(1) / distance2[1];
        for i in 2..=n + 1 {
            let to_area = if i > n && end.infinite {
                1.0
            } else {
                cos_c(i) / distance2[i]
            };
            camera[i] = pdf_c[i - 1] * to_area;
        }
        let light_density = |pdf_l: &[f64]| {
            let mut light = vec![1.0; n + 2];
            light[n + 1] = if end.infinite {
                end.direction
            } else {
                end.position
            };
            for i in (1..=n).rev() {
                let pdf = match i == n {
                    true if end.infinite => end.position,
                    true => end.direction,
                    false => pdf_l[i + 1],
                };
                light[i] = pdf * cos_l(i) / distance2[i + 1];
            }
            light
        };
        let delta = |i: usize| i > 0 && i <= n && nodes[i - 1].delta;
        let lights = self.view.scene.lights();
        Some(Definition {
            light: light_density(&pdf_l),
            flux: light_density(&exact_l),
            camera,
            delta: (0..n + 2).map(delta).collect(),
            value,
            sampling: f64::from(lights.pmf(end.light, nodes[n - 1].surface.position))
                / f64::from(lights.emission_pmf(end.light)),
        })
    }

    /// The share of the last vertex's glossy lobe that is roughened, by all strategies of the path.
    fn split_by_definition(&self, nodes: &[Node], events: &[Event]) -> f32 {
        let (last, before) = nodes.split_last().expect("a vertex");
        if self.rule.is_none() || before.iter().all(|node| node.delta) {
            return 0.0;
        }
        let mut roughness: Vec<f32> = events.iter().map(|event| event.roughness).collect();
        roughness[nodes.len() - 1] = last.alpha;
        let edges = roughness.windows(2).map(|pair| pair[0].min(pair[1]));
        let merges = roughness.iter().copied().filter(|_| self.radius > 0.0);
        share(
            edges
                .chain(merges)
                .fold(roughness[0].max(last.alpha), f32::max),
        )
    }

    /// Density of strategy t, which cuts the edge before x_t, on a path with these densities of the light walk.
    fn strategy_density(&self, path: &Definition, light: &[f64], t: usize) -> f64 {
        let before: f64 = path.camera[1..t.min(path.camera.len())].iter().product();
        let after: f64 = light[t.min(light.len())..].iter().product();
        let n = if t == 1 { f64::from(self.paths) } else { 1.0 };
        // Light sampling draws the light at the last vertex, emission by power.
        let k = path.camera.len() - 1;
        let light = if t == k { path.sampling } else { 1.0 };
        before * after * n * light
    }

    /// Compares a contribution with the definition.
    fn compare(&self, audit: &mut Audit, nodes: &[Node], end: &LightEnd, t: u32, sums: [Rgb; 2]) {
        let [weighted, plain] = sums;
        let k = nodes.len() + 1;
        let (s, t) = (k as u32 + 1 - t, t as usize);
        if plain == Rgb::ZERO || nodes.is_empty() {
            return;
        }
        let Some(path) = self.define(nodes, end, audit.through) else {
            return;
        };
        let possible = |t: usize| match t {
            t if t == k + 1 => end.met,
            t => !path.delta[t - 1] && !path.delta[t],
        };
        let all: Vec<f64> = (1..k + 2)
            .map(|t| {
                if possible(t) {
                    self.strategy_density(&path, &path.light, t)
                } else {
                    0.0
                }
            })
            .collect();
        // Both neighbours allow merges: the camera, surfaces of less than 0.25 and those within 64 radii.
        let allows = |i: usize, j: usize| {
            let [one, other] = [i, j].map(|i| nodes[i - 1].surface.position);
            nodes[i - 1].alpha < 0.25 || one.distance(other) < 64.0 * self.radius
        };
        let merge = |j: usize| (j == 1 || allows(j - 1, j)) && j + 1 < k && allows(j + 1, j);
        let merges: f64 = (1..k)
            .filter(|&j| self.radius > 0.0 && !path.delta[j] && merge(j))
            .map(|j| {
                let m =
                    std::f64::consts::PI * f64::from(self.radius).powi(2) * f64::from(self.paths);
                m * path.camera[1..=j].iter().product::<f64>()
                    * path.light[j..].iter().product::<f64>()
            })
            .sum();
        let expected = all[t - 1] / (all.iter().sum::<f64>() + merges);
        let density = self.strategy_density(&path, &path.flux, t);
        let c = (0..3)
            .max_by(|&a, &b| path.value[a].total_cmp(&path.value[b]))
            .unwrap_or(0);
        let weight = f64::from(weighted[c]) / f64::from(plain[c]);
        let off = (weight - expected).abs();
        let value = (f64::from(plain[c]) * density / path.value[c] - 1.0).abs();
        *audit.compared.entry((s, t as u32)).or_default() += 1;
        if !(off <= TOLERANCE && value <= TOLERANCE) {
            audit.apart += 1;
            audit.example = format!(
                "s {s}, t {t}: weight {weight:.6} for {expected:.6}, value off by {value:.1e}; Dirac {:?}",
                path.delta
            );
        }
        audit.weight = if off > audit.weight {
            off
        } else {
            audit.weight
        };
        audit.value = if value > audit.value {
            value
        } else {
            audit.value
        };
    }

    /// Walks one light path and the camera path of the same number, and compares every contribution.
    fn audit_pair(&self, path: u32, audit: &mut Audit) {
        let View { scene, sensor, .. } = *self.view;
        let lights = scene.lights();
        let only = |s, t| Self {
            strategies: Strategies::Only { s, t },
            ..*self
        };
        // The light walk.
        let mut stream = self.light_stream(path);
        let mut light: Vec<(Vertex, bool, LightSummary)> = Vec::new();
        let mut seen_through = Vec::new();
        let mut summary = LightSummary::START;
        let start = scene.sample_emission(self.aim, stream.emission());
        if let Some(start) = &start {
            let mut walk = WeightedWalk::light(scene, start, self.merging, self.merge_rule);
            for n in 1..=self.settings.max_vertices {
                let Some(arrival) = walk.arrive(&mut stream) else {
                    break;
                };
                if walk.first {
                    walk.base.throughput *= walk.window(start, arrival.hit.t);
                }
                let u = stream.vertex();
                let through = sensor.lens_point(|| stream.lens());
                let vertex = walk.vertex(n, &arrival, u.material);
                let drawn = walk.scatter(&vertex, u.lobe);
                if drawn == Some(ScatterKind::Straight) {
                    continue;
                }
                seen_through.push(through);
                light.push((vertex, drawn == Some(ScatterKind::Dirac), summary));
                let Some(smooth) = drawn.and_then(ScatterKind::smooth) else {
                    break;
                };
                summary = self.summary(summary, &vertex, walk.dir(), smooth);
            }
        }
        let emitted = start.as_ref().map(|start| {
            let distance = light.first().map_or(1.0, |(first, ..)| {
                first.surface.position.distance(start.ray.origin)
            });
            let pdf = start.pdf;
            let scale = if start.cos > 0.0 {
                1.0 / start.cos
            } else {
                start.window(distance)
            };
            LightEnd {
                place: if pdf.infinite {
                    -start.ray.dir
                } else {
                    start.ray.origin
                },
                infinite: pdf.infinite,
                // The cosine is all that counts.
                ng: (start.cos > 0.0 && !pdf.infinite).then(|| {
                    let dir = start.ray.dir;
                    let across = Frame::from_normal(dir).s;
                    start.cos * dir + (1.0 - start.cos * start.cos).max(0.0).sqrt() * across
                }),
                met: start.cos > 0.0,
                light: start.light as usize,
                position: pdf.position.into(),
                direction: pdf.direction.into(),
                radiance: start.throughput * pdf.position * pdf.direction * scale,
            }
        });
        // The light's part of a path from light vertex `j` (from 1) on, nearest the camera first.
        let tail = |j: usize| {
            let passed = light[..j - 1].iter().rev();
            let mut nodes = vec![Node::new(&light[j - 1].0, false)];
            nodes.extend(passed.map(|(v, delta, _)| Node::new(v, *delta)));
            nodes
        };
        if let Some(end) = &emitted {
            for (j, (vertex, _, summary)) in light.iter().enumerate() {
                if !vertex.is_delta() {
                    audit.through = seen_through[j];
                    let sums = [*self, only(vertex.n + 1, 1)].map(|i| {
                        i.connect_to_camera(vertex, summary, audit.through)
                            .map_or(Rgb::ZERO, |splat| splat.value)
                    });
                    self.compare(audit, &tail(j + 1), end, 1, sums);
                }
            }
        }
        // The camera walk.
        let columns = sensor.frame.x;
        let pixel = UVec2::new(path % columns, path / columns);
        let mut stream = self.camera_stream(pixel);
        stream.film();
        audit.through = sensor.lens_point(|| stream.lens());
        let mut stream = self.camera_stream(pixel);
        let mut walk = self.camera_walk(pixel, &mut stream);
        let mut nodes: Vec<Node> = Vec::new();
        let mut prefix = self.prefix();
        for n in 1..=self.settings.max_vertices + 1 {
            let Some(arrival) = walk.arrive(&mut stream) else {
                let pdf = lights.pdf_emission_environment(self.aim, &walk.base.ray);
                let end = LightEnd {
                    place: walk.dir(),
                    infinite: true,
                    ng: None,
                    met: true,
                    light: lights.len() - 1,
                    position: pdf.position.into(),
                    direction: pdf.direction.into(),
                    radiance: lights.environment(walk.dir()),
                };
                let sums =
                    [*self, only(0, n + 1)].map(|i| prefix.easy_emission * i.environment(&walk, n));
                self.compare(audit, &nodes, &end, n + 1, sums);
                return;
            };
            let u = stream.vertex();
            let vertex = walk.vertex(n, &arrival, u.material);
            let sums =
                [*self, only(0, n + 1)].map(|i| prefix.easy_emission * i.emitter(&walk, &vertex));
            if sums[1] != Rgb::ZERO {
                let end = self.area_end(&vertex.surface, vertex.back);
                self.compare(audit, &nodes, &end, n + 1, sums);
            }
            if n > self.settings.max_vertices {
                return;
            }
            let h = prefix.share(&vertex);
            if !vertex.is_delta() {
                nodes.push(Node::new(&vertex, false));
                let sums = [*self, only(1, n + 1)].map(|i| i.sampled_light(&vertex, u.light, h));
                if sums[1] != Rgb::ZERO
                    && let Some(end) = self.sampled_end(&vertex, u.light)
                {
                    self.compare(audit, &nodes, &end, n + 1, sums);
                }
                for (j, (other, _, summary)) in light.iter().enumerate() {
                    if other.is_delta() || n + other.n > self.settings.max_vertices {
                        continue;
                    }
                    let part = prefix.connected(&vertex, other, summary);
                    let sums = [*self, only(other.n + 1, n + 1)]
                        .map(|i| part * i.connection(&vertex, other, (0.0, 0.0)));
                    let before = nodes.len();
                    nodes.extend(tail(j + 1));
                    if let Some(end) = &emitted {
                        self.compare(audit, &nodes, end, n + 1, sums);
                    }
                    nodes.truncate(before);
                }
                nodes.pop();
            }
            let Some(drawn) = walk.scatter(&vertex, u.lobe) else {
                return;
            };
            let Some(smooth) = drawn.smooth() else {
                continue;
            };
            prefix.scatter(&vertex, walk.dir(), smooth, h);
            nodes.push(Node::new(&vertex, !smooth));
        }
    }

    /// An emitting point as the end of a path.
    fn area_end(&self, surface: &Surface, wo: Vec3) -> LightEnd {
        let lights = self.view.scene.lights();
        let pdf = lights.pdf_emission(self.aim, surface, wo);
        LightEnd {
            place: surface.position,
            infinite: false,
            ng: Some(surface.ng),
            met: true,
            light: lights.light_of(surface).unwrap_or(0),
            position: pdf.position.into(),
            direction: pdf.direction.into(),
            radiance: lights.emitted(surface, wo),
        }
    }

    /// The end of a path with a light sample.
    fn sampled_end(&self, vertex: &Vertex, u: LightU) -> Option<LightEnd> {
        let scene = self.view.scene;
        let (lights, from) = (scene.lights(), vertex.surface.position);
        let light = lights.sample(from, u)?;
        let infinite = light.distance == f32::INFINITY;
        if !infinite && !light.density.is_delta() {
            let hit = scene.intersect(&vertex.surface.spawn(light.wi))?;
            return Some(self.area_end(&scene.surface(&hit), -light.wi));
        }
        let end = LightEnd {
            place: light.wi,
            infinite,
            ng: None,
            met: !light.density.is_delta(),
            light: light.light as usize,
            position: 0.0,
            direction: 0.0,
            radiance: light.radiance,
        };
        if end.met {
            let pdf = lights.pdf_emission_environment(self.aim, &Ray::new(from, light.wi));
            return Some(LightEnd {
                position: pdf.position.into(),
                direction: pdf.direction.into(),
                ..end
            });
        }
        let pmf = f64::from(lights.emission_pmf(end.light));
        let over = f64::from(lights.emission_over_sampling(self.aim, &light, from));
        let emission = over * f64::from(light.pmf) / pmf;
        let place = from + light.distance * light.wi;
        Some(if infinite {
            LightEnd {
                position: emission,
                direction: pmf,
                ..end
            }
        } else {
            LightEnd {
                place,
                position: pmf,
                direction: emission,
                radiance: light.radiance * (light.distance * light.distance),
                ..end
            }
        })
    }
}

impl Bidirectional {
    /// Compares all contributions of the first `paths` light paths and camera paths of an iteration with the definition.
    /// Scenes without absorption and without partly opaque surfaces; smooth lobes should not be much sharper than
    /// α = 0.1, since directions are computed from positions.
    fn audit(&self, view: &View<'_>, sample: u32, paths: u32) -> Audit {
        let first = self.merging.map(|radius| radius.first(view));
        let aim = self.aim(view);
        view.scene.lights().index();
        let iteration = self.iteration(view, &aim, sample, first);
        let mut audit = Audit::default();
        for path in 0..paths.min(iteration.paths) {
            iteration.audit_pair(path, &mut audit);
        }
        audit
    }
}
