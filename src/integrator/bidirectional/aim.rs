//! Targets at which light paths are aimed: surfaces that throw caustics, and surfaces in the camera's view.
//!
//! Candidates are spheres around sharp surfaces, and around visible surfaces if these are a small part of the scene;
//! the merge radius enlarges the latter. Pilot light paths with their own random numbers estimate what each candidate
//! contributes to the picture. The shares of a light's targets minimise the second moment ∫ f²/p over its rays, with f
//! the contributions over the brightness of their picture cell. A light stays uniform if aiming gains little.
//!
//! The shares are found before the first sample and do not change: samples are independent, and passes, parts and
//! resumed renders use the same ones. They depend only on seed, scene, camera and frame.

use super::Bidirectional;
use super::iteration::Iteration;
use super::paths::ROULETTE_LEAD;
use super::vertex::Vertex;
use super::walk::{ScatterKind, WeightedWalk};
use crate::bsdf::Bsdf;
use crate::image::film::Window;
use crate::integrator::View;
use crate::math::{Ray, UVec2, Vec2, Vec3, luminance};
use crate::sampler::{Domain, Independent, SampleSource, Sampler, Seed};
use crate::scene::light::aim::MIN_UNIFORM;
use crate::scene::{Aim, AimShares, EmissionSample, Material, Scene, Target};
use rayon::prelude::*;
use std::f32::consts::PI;
use std::sync::Arc;

/// Number of pilot light paths.
const PILOT_PATHS: u32 = 1 << 13;

/// Paths that a thread takes at a time.
const CHUNK: u32 = 256;

/// Roughness below which a lobe throws caustics worth aiming at.
const SHARP: f32 = 0.1;

/// Most targets of each kind.
const MAX_SHARP_TARGETS: usize = 64;
const MAX_VISIBLE_TARGETS: usize = 8;

/// Largest radius of a target of each kind, over that of the scene.
const MAX_SHARP_RADIUS: f32 = 0.5;
const MAX_VISIBLE_RADIUS: f32 = 0.1;

/// Camera rays per side of the lattice that finds the visible surfaces.
const LATTICE: u32 = 32;

/// Most Dirac lobes that such a ray follows, and most sharp surfaces between the camera and a vertex of a light path.
const MAX_SHARP: u32 = 8;

/// Most triangles that are clustered; a larger set is subsampled.
const MAX_ITEMS: usize = 1 << 16;

/// Most groups of lights, each with its own beam.
const GROUPS: u8 = 64;

/// Cells per side of the picture; contributions are divided by the brightness of their cell.
const CELLS: u32 = 16;

/// Ratio of the second moments, aimed over uniform, above which aiming is not worth its cost.
const MAX_MOMENT_RATIO: f64 = 0.7;

/// Share below which a target is dropped.
const MIN_SHARE: f64 = 0.005;

/// Squared weight of light that other strategies sample well: light that reaches its vertex over rough surfaces only.
const EASY_WEIGHT: f64 = 0.05;

impl Bidirectional {
    /// Aim of the light paths of a view, the same for every window of its frame, as
    /// [`Integrator::pass`](crate::integrator::Integrator::pass) computes it.
    pub(crate) fn aim(&self, view: &View<'_>) -> Arc<Aim> {
        let View { sensor, scene, .. } = view;
        let whole = Window::full(sensor.frame);
        let whole = View::new(scene, sensor.camera, sensor.frame, whole);
        self.aim_cache.aim(view, || self.find_aim(&whole))
    }

    fn find_aim(&self, view: &View<'_>) -> Aim {
        let scene = view.scene;
        let lights = scene.lights();
        if lights.is_empty() {
            return Aim::default();
        }
        let radius = self.merging.map_or(0.0, |radius| radius.first(view));
        let targets = candidates(view, radius, MAX_ITEMS);
        if targets.is_empty() {
            return Aim::default();
        }
        let (groups, first) = even_aim(scene, &targets);
        let found = self.try_aim(view, &first, &targets);
        let count = groups.iter().max().map_or(0, |&last| usize::from(last) + 1);
        let beams = (0..count)
            .map(|group| {
                let own = |path: &&PilotPath| usize::from(groups[path.light as usize]) == group;
                beam(&targets, found.iter().filter(own))
            })
            .collect();
        Aim::new(beams, groups)
    }

    /// Traces pilot light paths with this aim; returns those with a visible vertex, and the squares of their
    /// contributions.
    fn try_aim(&self, view: &View<'_>, aim: &Aim, targets: &[Target]) -> Vec<PilotPath> {
        let all = self.pilot_paths(view, aim, targets, PILOT_PATHS);
        let brightness = Brightness::of(&all, CELLS);
        let relative = |vertex: &VisibleVertex| {
            let value = vertex.value / brightness.around(vertex);
            vertex.weight * value * value
        };
        let squared = |(path, visible): (PilotPath, Vec<VisibleVertex>)| PilotPath {
            squared: visible.iter().map(relative).sum(),
            ..path
        };
        (all.into_iter().map(squared))
            .filter(|path| path.squared > 0.0)
            .collect()
    }

    /// Traces a number of pilot light paths with this aim; returns those with a visible vertex, and these vertices.
    pub(super) fn pilot_paths(
        &self,
        view: &View<'_>,
        aim: &Aim,
        targets: &[Target],
        paths: u32,
    ) -> Vec<(PilotPath, Vec<VisibleVertex>)> {
        let iteration = self.iteration(view, aim, 0, None);
        let source = Independent {
            seed: Seed(self.seed).derive(Domain::Aim, 0),
        };
        let trace = |i: u32| {
            let mut stream = source.stream(UVec2::new(i, 0), 0);
            iteration.trace_pilot(&mut stream, targets)
        };
        let chunk = |chunk: u32| (chunk * CHUNK..(chunk + 1) * CHUNK).filter_map(trace);
        let chunks = (0..paths / CHUNK).into_par_iter();
        let chunks: Vec<Vec<_>> = chunks.map(|i| chunk(i).collect()).collect();
        chunks.into_iter().flatten().collect()
    }
}

/// The groups of a scene's lights, and half of the light of each aimed evenly at targets, if there are any.
pub(super) fn even_aim(scene: &Scene, targets: &[Target]) -> (Vec<u8>, Aim) {
    let lights = scene.lights();
    lights.index();
    let groups = lights.groups(scene.geometry(), GROUPS);
    if targets.is_empty() {
        return (groups, Aim::default());
    }
    let count = groups.iter().max().map_or(0, |&last| usize::from(last) + 1);
    let each = 0.5 / targets.len() as f32;
    let even = AimShares::new(targets.iter().map(|&target| (target, each)).collect());
    let aim = Aim::new(vec![Some(even); count], groups.clone());
    (groups, aim)
}

/// Sums of contributions in every cell of the picture, and their mean.
pub(super) struct Brightness {
    /// Cells per side, a divisor of [`CELLS`].
    side: u32,
    cells: Vec<f64>,
    mean: f64,
}

impl Brightness {
    pub(super) fn of(found: &[(PilotPath, Vec<VisibleVertex>)], side: u32) -> Self {
        let mut brightness = Self {
            side,
            cells: vec![0.0; (side * side) as usize],
            mean: 0.0,
        };
        for vertex in found.iter().flat_map(|(_, visible)| visible) {
            let cell = brightness.cell(vertex);
            brightness.cells[cell] += vertex.value;
        }
        let sum: f64 = brightness.cells.iter().sum();
        brightness.mean = sum / brightness.cells.len() as f64;
        brightness
    }

    fn cell(&self, vertex: &VisibleVertex) -> usize {
        let at = vertex.cell / (CELLS / self.side);
        (at.y * self.side + at.x) as usize
    }

    /// The sum in the cell of a vertex, at least a tenth of the mean.
    pub(super) fn around(&self, vertex: &VisibleVertex) -> f64 {
        self.cells[self.cell(vertex)].max(0.1 * self.mean)
    }
}

/// A pilot light path with a visible vertex.
pub(super) struct PilotPath {
    light: u32,
    /// Sum of the squares of its contributions.
    squared: f64,
    /// Densities of its first ray under uniform emission and under each target, over that from which it was drawn.
    parts: Vec<f64>,
}

/// A visible vertex of a light path.
pub(super) struct VisibleVertex {
    /// Column and row of its cell.
    cell: UVec2,
    /// Its contribution to the picture, summed over the pixels.
    pub(super) value: f64,
    weight: f64,
    /// For light by way of sharp surfaces alone, about the radiance of a camera path that finds it by a draw from its
    /// BSDF: infinite for lights that no ray can hit. 0 for other light.
    pub(super) sample: f64,
}

impl Iteration<'_> {
    /// Traces a light path; `None` if none of its vertices is visible.
    fn trace_pilot(
        &self,
        stream: &mut impl Sampler,
        targets: &[Target],
    ) -> Option<(PilotPath, Vec<VisibleVertex>)> {
        let scene = self.view.scene;
        let start = scene.sample_emission(self.aim, stream.emission())?;
        let mut walk = WeightedWalk::light(scene, &start, self.light_merging, self.merge_rule);
        let mut visible = Vec::new();
        let connects = self.strategies.connects();
        let (mut caustic, mut rough) = (false, false);
        // Radiance of the light over the flux of the path.
        let per_flux = start.pdf.position * start.pdf.direction / start.cos;
        for n in 1..=self.settings.max_vertices {
            let Some(arrival) = walk.arrive(stream) else {
                break;
            };
            if walk.first {
                walk.base.throughput *= walk.window(&start, arrival.hit.t);
            }
            let u = stream.vertex();
            let vertex = walk.vertex(n, &arrival, u.material);
            let weight = match (connects && !caustic, vertex.first) {
                (false, _) => 1.0,
                // Light sampling covers it.
                (true, true) => 0.0,
                (true, _) => EASY_WEIGHT,
            };
            if !vertex.is_delta() {
                let per_flux = if caustic && !rough { per_flux } else { 0.0 };
                visible.extend(self.visible_vertex(&vertex, weight, per_flux));
            }
            let Some(drawn) = walk.scatter(&vertex, u.lobe) else {
                break;
            };
            let is_smooth = drawn == ScatterKind::Smooth;
            let sharp = vertex.alpha < SHARP && vertex.bsdf.is_delta_at(0.0);
            caustic |= drawn == ScatterKind::Dirac || (is_smooth && sharp);
            rough |= is_smooth && !sharp;
            if n + ROULETTE_LEAD >= self.settings.roulette_start
                && walk.survive(u.roulette).is_none()
            {
                break;
            }
        }
        let path = (!visible.is_empty()).then(|| pilot_path(scene, &start, targets));
        Some((path?, visible))
    }

    /// Contribution of a light path's vertex, if need be straight through sharp surfaces; `None` if it is hidden.
    fn visible_vertex(&self, vertex: &Vertex, weight: f64, per_flux: f32) -> Option<VisibleVertex> {
        let scene = self.view.scene;
        let sight = (self.view.sensor).see(vertex.surface.position, Vec2::ZERO)?;
        let eval = vertex.towards_camera(sight.wo)?;
        let mut ray = vertex.surface.spawn(sight.wo);
        ray.t_max = sight.distance;
        for passed in 0.. {
            let Some(hit) = scene.intersect(&ray) else {
                break;
            };
            let mut surface = scene.surface(&hit);
            let bsdf = scene.bsdf(&mut surface, 0.0);
            let clear = matches!(bsdf, Bsdf::Dielectric(_) | Bsdf::Thin(_)) && bsdf.alpha() < SHARP;
            if !clear || passed == MAX_SHARP {
                return None;
            }
            let t_max = ray.t_max - hit.t;
            ray = surface.spawn(ray.dir);
            ray.t_max = t_max;
        }
        let value = luminance(vertex.throughput * eval.value);
        // A direction drawn by its cosine scatters π times the BSDF.
        let sample = f64::from(PI * value * per_flux);
        let value = f64::from(value) * f64::from(sight.pdf_area(vertex.cos(sight.wo)));
        let frame = self.view.sensor.frame;
        let cell = sight.pixel * CELLS / frame;
        (value > 0.0 && value.is_finite()).then_some(VisibleVertex {
            cell,
            value,
            weight,
            sample,
        })
    }
}

fn pilot_path(scene: &Scene, start: &EmissionSample, targets: &[Target]) -> PilotPath {
    let drawn = if start.pdf.infinite {
        start.pdf.position
    } else {
        start.pdf.direction
    };
    let (uniform, aimed) = scene.lights().pdf_parts(start, targets);
    let over = |pdf: f32| f64::from(pdf) / f64::from(drawn);
    PilotPath {
        light: start.light,
        squared: 0.0,
        parts: std::iter::once(uniform).chain(aimed).map(over).collect(),
    }
}

/// The beam with the least second moment over these paths; `None` if it gains little.
///
/// ∫ f²/p is convex in the shares. Its derivative by share i is −∫ f² pᵢ/p²; each iteration multiplies share i by the
/// root of ∫ f² pᵢ/p², until these factors are equal.
fn beam<'a>(targets: &[Target], found: impl Iterator<Item = &'a PilotPath>) -> Option<AimShares> {
    let found: Vec<&PilotPath> = found.collect();
    let mut shares = vec![0.5 / targets.len() as f64; targets.len() + 1];
    shares[0] = 0.5;
    let density = |shares: &[f64], path: &PilotPath| -> f64 {
        shares.iter().zip(&path.parts).map(|(q, p)| q * p).sum()
    };
    for _ in 0..40 {
        let mut slopes = vec![0.0; shares.len()];
        for path in &found {
            let p = density(&shares, path);
            for (slope, part) in slopes.iter_mut().zip(&path.parts) {
                *slope += path.squared * part / (p * p);
            }
        }
        for (share, slope) in shares.iter_mut().zip(&slopes) {
            *share *= slope.sqrt();
        }
        normalise(&mut shares);
    }
    for share in &mut shares[1..] {
        if *share < MIN_SHARE {
            *share = 0.0;
        }
    }
    normalise(&mut shares);
    let moment = |p: &dyn Fn(&PilotPath) -> f64| -> f64 {
        found.iter().map(|path| path.squared / p(path)).sum()
    };
    let (aimed, uniform) = (
        moment(&|path| density(&shares, path)),
        moment(&|path| path.parts[0]),
    );
    // Also false for a NaN moment.
    let worth = aimed < MAX_MOMENT_RATIO * uniform;
    if !worth {
        return None;
    }
    let kept = targets
        .iter()
        .zip(&shares[1..])
        .filter(|(_, share)| **share > 0.0);
    Some(AimShares::new(
        kept.map(|(&target, &share)| (target, share as f32))
            .collect(),
    ))
}

/// Makes the shares add up to 1, the first at least [`MIN_UNIFORM`].
fn normalise(shares: &mut [f64]) {
    let sum: f64 = shares.iter().sum();
    if !(sum > 0.0 && sum.is_finite()) {
        shares.fill(0.0);
        shares[0] = 1.0;
        return;
    }
    shares.iter_mut().for_each(|share| *share /= sum);
    let least = f64::from(MIN_UNIFORM);
    if shares[0] < least {
        let scale = (1.0 - least) / (1.0 - shares[0]);
        shares[1..].iter_mut().for_each(|share| *share *= scale);
        shares[0] = least;
    }
}

/// Spheres at which light may be aimed, around at most `most` triangles. Those of visible surfaces are enlarged by
/// `around`, the merge radius.
pub(super) fn candidates(view: &View<'_>, around: f32, most: usize) -> Vec<Target> {
    let scene = view.scene;
    let reach = scene.lights().reach();
    let mut targets = Vec::new();
    let mut add = |clusters: Vec<Target>, around: f32, widest: f32| {
        let extended = |target: Target| Target {
            radius: target.radius + around,
            ..target
        };
        let wide = |target: &Target| target.radius > 0.0 && target.radius < widest * reach;
        // Enlarged, so that rounding of ray origins does not leave geometry outside.
        let grown = |target: Target| Target {
            radius: 1.02 * target.radius + 4e-6 * reach,
            ..target
        };
        let clusters = clusters.into_iter().map(extended);
        targets.extend(clusters.filter(wide).map(grown));
    };
    add(
        clustered(sharp_triangles(scene, most), MAX_SHARP_TARGETS, reach),
        0.0,
        MAX_SHARP_RADIUS,
    );
    add(
        clustered(visible_points(view), MAX_VISIBLE_TARGETS, reach),
        around,
        MAX_VISIBLE_RADIUS,
    );
    targets
}

/// True if a surface of this material throws caustics somewhere.
fn is_sharp(material: &Material) -> bool {
    // Panes transmit light straight, without caustics.
    !material.is_rough() && material.alpha < SHARP && !material.is_pane()
}

/// Corners of the triangles that throw caustics, at most `most` triangles.
fn sharp_triangles(scene: &Scene, most: usize) -> Vec<Vec<Vec3>> {
    let sharp: Vec<bool> = scene.parts().materials.iter().map(is_sharp).collect();
    if !sharp.contains(&true) {
        return Vec::new();
    }
    let geometry = scene.geometry();
    let some = geometry.some_of(most, |material| sharp[material as usize]);
    let corners = |i| geometry.triangle(i).to_vec();
    some.into_iter().map(corners).collect()
}

/// Visible points over a lattice of camera rays, which follow Dirac lobes.
fn visible_points(view: &View<'_>) -> Vec<Vec<Vec3>> {
    let frame = view.sensor.frame.as_vec2();
    let visible = |i: u32| {
        let at = (UVec2::new(i % LATTICE, i / LATTICE).as_vec2() + 0.5) / LATTICE as f32;
        visible_point(view.scene, view.sensor.ray(at * frame))
    };
    let points = (0..LATTICE * LATTICE).filter_map(visible);
    points.map(|point| vec![point]).collect()
}

fn visible_point(scene: &Scene, mut ray: Ray) -> Option<Vec3> {
    for _ in 0..MAX_SHARP {
        let hit = scene.intersect(&ray)?;
        let mut surface = scene.surface(&hit);
        let bsdf = scene.bsdf(&mut surface, 0.5);
        if !bsdf.is_delta_at(bsdf.alpha()) {
            return Some(surface.position);
        }
        let frame = surface.frame_for(-ray.dir);
        // A random number of 0.5 selects the stronger lobe.
        let sample = bsdf.sample(bsdf.alpha(), frame.to_local(-ray.dir), [0.5; 3])?;
        ray = surface.spawn(frame.to_world(sample.wi));
    }
    None
}

/// A cluster of points and its two halves.
struct Node {
    sphere: Target,
    halves: Option<Box<[Node; 2]>>,
}

/// At most `most` spheres around all items, with a small sum of cross sections.
fn clustered(mut items: Vec<Vec<Vec3>>, most: usize, reach: f32) -> Vec<Target> {
    if items.is_empty() {
        return Vec::new();
    }
    let root = halved(&mut items, 10);
    let mut cost = 1e-7 * reach * reach;
    loop {
        let mut spheres = Vec::new();
        collect(&root, cost, &mut spheres);
        if spheres.len() <= most {
            return spheres;
        }
        cost *= 1.5;
    }
}

/// Appends the spheres of the cut of this tree with the least sum of squared radius plus `cost`; returns that sum.
fn collect(node: &Node, cost: f32, spheres: &mut Vec<Target>) -> f32 {
    let own = node.sphere.radius * node.sphere.radius + cost;
    if let Some(halves) = &node.halves {
        let before = spheres.len();
        let sum: f32 = halves.iter().map(|half| collect(half, cost, spheres)).sum();
        if sum < own {
            return sum;
        }
        spheres.truncate(before);
    }
    spheres.push(node.sphere);
    own
}

fn halved(items: &mut [Vec<Vec3>], depth: u32) -> Node {
    let points = || items.iter().flatten();
    let low = points().fold(Vec3::INFINITY, |low, &p| low.min(p));
    let high = points().fold(Vec3::NEG_INFINITY, |high, &p| high.max(p));
    let centre = 0.5 * (low + high);
    let radius = points()
        .map(|p| p.distance_squared(centre))
        .fold(0.0, f32::max)
        .sqrt();
    let sphere = Target { centre, radius };
    if items.len() < 2 || depth == 0 || radius == 0.0 {
        return Node {
            sphere,
            halves: None,
        };
    }
    let extent = high - low;
    let axis = (0..3)
        .find(|&axis| extent[axis] == extent.max_element())
        .unwrap_or(0);
    let middle = |item: &Vec<Vec3>| item.iter().map(|p| p[axis]).sum::<f32>() / item.len() as f32;
    // Split at the middle of the box, which separates distant clusters; at the median if all items are on one side.
    items.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
    let cut = items.partition_point(|item| middle(item) < centre[axis]);
    let cut = if cut == 0 || cut == items.len() {
        items.len() / 2
    } else {
        cut
    };
    let (a, b) = items.split_at_mut(cut);
    let halves = [halved(a, depth - 1), halved(b, depth - 1)];
    Node {
        sphere,
        halves: Some(Box::new(halves)),
    }
}
