//! Stored light vertices of an iteration, and a hash grid over them for merging.
//!
//! The edge of a cell is 2r, so that a ball of radius r lies in at most eight cells, whose buckets are visited in a
//! fixed order and each once: cells that share a bucket count no photon twice. A bucket holds its photons in the order
//! of their light paths, so that sums are bit-identical at any number of threads.

use super::split::LightSummary;
use super::vertex::Vertex;
use super::weights::Partial;
use crate::integrator::walk::Surroundings;
use crate::math::{Rgb, Vec3};
use crate::scene::{Hit, Scene, TriangleId};
use glam::DVec3;
use rayon::prelude::*;

/// A light vertex without the data that can be rebuilt from its hit.
#[derive(Clone, Copy)]
pub(super) struct Photon {
    /// World direction towards the previous vertex.
    pub(super) back: Vec3,
    /// 4 n for vertex n of its walk, plus 2 if the previous vertex allows merges here, plus 1 if the walk has come
    /// straight from the light.
    number: u32,
    /// Index of the triangle, see [`TriangleId::index`].
    index: u32,
    at: [f32; 2],
    choice: f32,
}

/// Light of a photon. In a separate list, so that sorting duplicates less memory at a time.
#[derive(Clone, Copy)]
pub(super) struct Arrived {
    /// Flux per area and cosine.
    pub(super) flux: Rgb,
    pub(super) partial: Partial<f32>,
}

const _: () = assert!(size_of::<Photon>() == 32 && size_of::<Arrived>() == 24);

/// Least cosine of the normals of a photon and of the vertex that it merges with.
pub(super) const MIN_COS: f32 = 0.9;

/// Greatest distance of a photon from the plane of the vertex that it merges with, over the radius.
pub(super) const MAX_HEIGHT: f32 = 0.25;

/// Photons near a vertex that are processed together.
const NEAR: usize = 32;

impl Photon {
    fn new(vertex: &Vertex) -> Self {
        Self {
            back: vertex.back,
            number: 4 * vertex.n + 2 * u32::from(vertex.merges) + u32::from(vertex.first),
            index: vertex.hit.triangle.index(),
            at: [vertex.hit.u, vertex.hit.v],
            choice: vertex.choice,
        }
    }

    /// Number of the vertex in its walk, from 1.
    #[inline]
    pub(super) fn n(&self) -> u32 {
        self.number / 4
    }

    /// True if the walk has come straight from the light.
    #[inline]
    pub(super) fn first(&self) -> bool {
        self.number % 2 == 1
    }

    /// True if the previous vertex allows merges here.
    #[inline]
    fn merges(&self) -> bool {
        self.number & 2 == 2
    }

    /// Rebuilds the vertex, in this instance and with this index of refraction, but without the media around it.
    fn vertex(&self, arrived: &Arrived, scene: &Scene, instance: u32, eta: Option<f32>) -> Vertex {
        let hit = Hit {
            t: 0.0,
            triangle: TriangleId::new(instance, self.index),
            u: self.at[0],
            v: self.at[1],
        };
        let mut surface = scene.surface(&hit);
        let mut bsdf = scene.bsdf(&mut surface, self.choice);
        bsdf.set_eta(eta);
        let frame = surface.frame_for(self.back);
        Vertex {
            n: self.n(),
            first: self.first(),
            hit,
            choice: self.choice,
            surface,
            bsdf,
            alpha: bsdf.alpha(),
            back: self.back,
            frame,
            local: frame.to_local(self.back),
            throughput: arrived.flux,
            partial: arrived.partial,
            merges: self.merges(),
            around: Surroundings::default(),
        }
    }
}

/// Light vertices in the order of their paths: those that may merge, and those for connections only.
#[derive(Default)]
pub(super) struct LightVertices {
    photons: Vec<Photon>,
    arrived: Vec<Arrived>,
    places: Vec<Place>,
    /// Vertices that do not merge.
    others: Vec<(Photon, Arrived)>,
    /// For each vertex, 2 i with i its index in `photons`, or 2 i + 1 with i its index in `others`.
    numbers: Vec<u32>,
    /// Instance of each vertex; empty if the scene has no instances.
    instances: Vec<u32>,
    /// Index of refraction at each vertex; empty if every interface has the same index for all paths.
    etas: Vec<Option<f32>>,
    /// One per vertex, or empty.
    summaries: Vec<LightSummary>,
    /// For each path, the index of the vertex after its last.
    ends: Vec<u32>,
}

impl LightVertices {
    /// Adds a vertex to the current path.
    pub(super) fn push(&mut self, vertex: &Vertex, scene: &Scene, summary: Option<LightSummary>) {
        let photon = Photon::new(vertex);
        let arrived = Arrived {
            flux: vertex.throughput,
            partial: vertex.partial,
        };
        if vertex.merges {
            self.numbers.push(2 * self.photons.len() as u32);
            self.photons.push(photon);
            self.arrived.push(arrived);
            let [x, y, z] = (127.0 * vertex.surface.ng).to_array();
            let outside = vertex.back.dot(vertex.surface.ng) > 0.0;
            self.places.push(Place {
                position: vertex.surface.position,
                ng: [x as i8, y as i8, z as i8, i8::from(outside)],
            });
        } else {
            self.numbers.push(2 * self.others.len() as u32 + 1);
            self.others.push((photon, arrived));
        }
        let shares = scene.geometry().instances() > 0;
        (self.instances).extend(shares.then_some(vertex.hit.triangle.instance()));
        (self.etas).extend(scene.has_paths_indices().then(|| vertex.bsdf.eta()));
        self.summaries.extend(summary);
    }

    /// Ends the current path.
    pub(super) fn end(&mut self) {
        self.ends.push(self.numbers.len() as u32);
    }

    /// Number of paths.
    pub(super) fn paths(&self) -> u32 {
        self.ends.len() as u32
    }

    /// Appends the paths of another list; the final number of paths is `all`.
    pub(super) fn append(&mut self, other: Self, all: u32) {
        let first = self.numbers.len() as u32;
        let lengths = [self.photons.len(), self.others.len()].map(|length| length as u32);
        let share = f64::from(all) / f64::from(self.paths() + other.paths());
        extend(&mut self.photons, other.photons, share);
        extend(&mut self.arrived, other.arrived, share);
        extend(&mut self.places, other.places, share);
        extend(&mut self.others, other.others, share);
        let numbers = other.numbers.into_iter();
        let numbers = numbers.map(|number| number + 2 * lengths[number as usize % 2]);
        extend(&mut self.numbers, numbers.collect(), share);
        extend(&mut self.instances, other.instances, share);
        extend(&mut self.etas, other.etas, share);
        extend(&mut self.summaries, other.summaries, share);
        let ends = other.ends.iter().map(|end| first + end);
        extend(&mut self.ends, ends.collect(), share);
    }

    /// Average number of bytes per path, with its share of the grid.
    pub(super) fn bytes_per_path(&self) -> usize {
        let vertex = size_of::<Photon>() + size_of::<Arrived>();
        let by_path = self.numbers.len() * (vertex + 4);
        // Up to two buckets of four bytes. During the sort also a key, an index, and a copy of one list.
        let merging = size_of::<Place>() + 8 + 8 + size_of::<Photon>();
        let by_place = self.photons.len() * merging;
        let summaries = 2 * self.summaries.len() * size_of::<LightSummary>();
        let instances = size_of_val(self.instances.as_slice());
        let etas = size_of_val(self.etas.as_slice());
        (by_path + by_place + summaries + instances + etas) / self.ends.len().max(1) + 4
    }
}

/// Extends a list whose final length is about `share` times the new one, and reserves a sixteenth more than that:
/// doubling would take up to twice the memory.
fn extend<T>(list: &mut Vec<T>, more: Vec<T>, share: f64) {
    let length = list.len() + more.len();
    if length > list.capacity() {
        let end = (17.0 / 16.0 * share * length as f64) as usize;
        list.reserve_exact(end.max(length) - list.len());
    }
    list.extend(more);
}

/// Hash grid of photons.
pub(super) struct PhotonMap {
    radius: f32,
    low: DVec3,
    /// 1 / (2r).
    scale: f64,
    /// First photon of each bucket, and the end of the last.
    buckets: Vec<u32>,
    /// The light vertices; those that merge are sorted by bucket. Positions are a separate list, since most photons
    /// that a query tests do not merge.
    vertices: LightVertices,
    /// Summaries of the vertices that merge, sorted by bucket; or empty.
    summaries: Vec<LightSummary>,
}

/// Position of a photon; its geometric normal in units of 1/127, and 1 if it arrives on the normal's side, else 0.
#[derive(Clone, Copy)]
struct Place {
    position: Vec3,
    ng: [i8; 4],
}

impl Place {
    fn ng(&self) -> Vec3 {
        let [x, y, z, _] = self.ng.map(f32::from);
        Vec3::new(x, y, z) / 127.0
    }
}

/// Bucket of a cell in a table of 2^k buckets. Cells that are neighbours along x have consecutive buckets.
fn bucket([x, y, z]: [i64; 3], mask: u32) -> u32 {
    let [y, z] = [y, z].map(|c| c as u64);
    let mut h = y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f) ^ z.wrapping_mul(0x1656_67b1_9e37_79f9);
    h ^= h >> 32;
    let row = h.wrapping_mul(0xff51_afd7_ed55_8ccd) >> 32;
    row.wrapping_add(x as u64) as u32 & mask
}

impl PhotonMap {
    /// Sorts photons that can merge into at least as many buckets. The photons of a bucket are contiguous, since memory
    /// latency dominates a query.
    pub(super) fn new(mut vertices: LightVertices, low: Vec3, radius: f32) -> Self {
        let size = vertices.photons.len().next_power_of_two();
        let mask = size as u32 - 1;
        let mut map = Self {
            radius,
            low: low.as_dvec3(),
            scale: 0.5 / f64::from(radius),
            buckets: vec![0; size + 1],
            vertices: LightVertices::default(),
            summaries: Vec::new(),
        };
        let cell = |p: &Place| {
            let place = map.place(p.position).floor();
            place.to_array().map(|x| x as i64)
        };
        let keys = vertices.places.par_iter();
        let mut keys: Vec<u32> = keys.map(|place| bucket(cell(place), mask)).collect();
        for &key in &keys {
            map.buckets[key as usize + 1] += 1;
        }
        for i in 0..size {
            map.buckets[i + 1] += map.buckets[i];
        }
        // Counting sort: each bucket's start advances to its end; the rotation restores it. Keys become new indices.
        let mut sorted = vec![0u32; keys.len()];
        for (i, key) in (0..).zip(&mut keys) {
            let at = &mut map.buckets[*key as usize];
            *key = *at;
            sorted[*at as usize] = i;
            *at += 1;
        }
        map.buckets.rotate_right(1);
        map.buckets[0] = 0;
        // List by list, so that memory holds only one of them twice at a time.
        gather(&mut vertices.places, &sorted);
        gather(&mut vertices.arrived, &sorted);
        gather(&mut vertices.photons, &sorted);
        if !vertices.summaries.is_empty() {
            let pairs = vertices.numbers.iter().zip(&vertices.summaries);
            let merging = pairs.filter(|(number, _)| *number % 2 == 0);
            map.summaries = merging.map(|(_, summary)| *summary).collect();
            gather(&mut map.summaries, &sorted);
        }
        let merging = vertices.numbers.par_iter_mut();
        let merging = merging.filter(|number| **number % 2 == 0);
        merging.for_each(|number| *number = 2 * keys[*number as usize / 2]);
        map.vertices = vertices;
        map
    }

    /// Number of light paths.
    pub(super) fn paths(&self) -> u32 {
        self.vertices.paths()
    }

    /// Rebuilds the vertices of a path up to its vertex number `most`.
    pub(super) fn of_path(
        &self,
        path: u32,
        most: u32,
        scene: &Scene,
        vertices: &mut Vec<Vertex>,
        summaries: &mut Vec<LightSummary>,
    ) {
        let path = path as usize;
        let LightVertices {
            photons,
            arrived,
            others,
            numbers,
            instances,
            etas,
            summaries: known,
            ends,
            ..
        } = &self.vertices;
        let first = if path == 0 { 0 } else { ends[path - 1] };
        vertices.clear();
        summaries.clear();
        let range = first as usize..ends[path] as usize;
        for (i, number) in range.clone().zip(&numbers[range]) {
            let at = *number as usize / 2;
            let (photon, arrived) = match number % 2 {
                0 => (&photons[at], &arrived[at]),
                _ => (&others[at].0, &others[at].1),
            };
            if photon.n() > most {
                break;
            }
            let instance = instances.get(i).copied().unwrap_or(0);
            let eta = etas.get(i).copied().flatten();
            vertices.push(photon.vertex(arrived, scene, instance, eta));
            summaries.push(known.get(i).copied().unwrap_or(LightSummary::START));
        }
    }

    /// Summary of the walk of a photon, if summaries are stored.
    #[inline]
    fn summary(&self, index: u32) -> Option<&LightSummary> {
        self.summaries.get(index as usize)
    }

    /// A point in units of cells.
    fn place(&self, p: Vec3) -> DVec3 {
        (p.as_dvec3() - self.low) * self.scale
    }

    /// Visits the photons within the radius of a vertex that lie on its surface.
    #[inline]
    pub(super) fn around(
        &self,
        vertex: &Vertex,
        mut visit: impl FnMut(&Photon, &Arrived, Option<&LightSummary>),
    ) {
        self.around_from(vertex, |photon, arrived, summary, _| {
            visit(photon, arrived, summary);
        });
    }

    /// The same with the vector from the vertex to each photon.
    #[inline]
    pub(super) fn around_from(
        &self,
        vertex: &Vertex,
        mut visit: impl FnMut(&Photon, &Arrived, Option<&LightSummary>, Vec3),
    ) {
        let (p, ng) = (vertex.surface.position, vertex.surface.ng);
        let [x, y, z] = (self.place(p) - 0.5).floor().to_array().map(|x| x as i64);
        let mask = self.buckets.len() as u32 - 2;
        let buckets: [u32; 8] = std::array::from_fn(|i| {
            let i = i as i64;
            bucket([x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)], mask)
        });
        // All ranges first, so that their memory loads overlap.
        let ranges = buckets.map(|key| self.buckets[key as usize]..self.buckets[key as usize + 1]);
        let (mut near, mut count) = ([0; NEAR], 0);
        for (i, range) in ranges.into_iter().enumerate() {
            if buckets[..i].contains(&buckets[i]) {
                continue;
            }
            for index in range {
                let place = &self.vertices.places[index as usize];
                let to = place.position - p;
                if is_within(to, ng, self.radius) && place.ng().dot(ng) > MIN_COS {
                    near[count] = index;
                    count += 1;
                    if count == NEAR {
                        self.visit(&near, (p, ng), &mut visit);
                        count = 0;
                    }
                }
            }
        }
        self.visit(&near[..count], (p, ng), &mut visit);
    }

    /// Visits the photons that arrive on the same side of this vertex's plane as of their own plane.
    fn visit(
        &self,
        near: &[u32],
        (p, ng): (Vec3, Vec3),
        visit: &mut impl FnMut(&Photon, &Arrived, Option<&LightSummary>, Vec3),
    ) {
        let LightVertices {
            photons,
            arrived,
            places,
            ..
        } = &self.vertices;
        // In a separate loop, so that the memory loads of several photons overlap.
        let mut there = [false; NEAR];
        for (there, &index) in there.iter_mut().zip(near) {
            let outside = places[index as usize].ng[3] == 1;
            // A photon that grazes a neighbouring facet from outside may come from below this facet.
            *there = (photons[index as usize].back.dot(ng) > 0.0) == outside;
        }
        for (&index, _) in near.iter().zip(there).filter(|(_, there)| *there) {
            let summary = self.summary(index);
            let index = index as usize;
            let to = places[index].position - p;
            visit(&photons[index], &arrived[index], summary, to);
        }
    }
}

/// True if a photon at offset `to` from a vertex of normal `ng` lies within the radius and near the plane.
#[inline]
pub(super) fn is_within(to: Vec3, ng: Vec3, radius: f32) -> bool {
    to.length_squared() <= radius * radius && to.dot(ng).abs() <= MAX_HEIGHT * radius
}

/// Puts items in this order.
fn gather<T: Copy + Send + Sync>(items: &mut Vec<T>, order: &[u32]) {
    *items = order.par_iter().map(|&i| items[i as usize]).collect();
}

#[cfg(test)]
mod tests;
