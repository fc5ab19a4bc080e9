//! Meshes that should bound a body and do not: open ones, and ones whose normals point inwards or both ways.
//!
//! Counts of their edges find them when the scene is built. But an open mesh may bound a body: the surface of a pool
//! ends at its walls. So random walks start behind the mesh, and opaque surfaces scatter them like white walls. Walks
//! behind a boundary end at its back. A mesh becomes thin walls if many walks end at a front or leave the scene.

use super::{Material, Mesh, Scene, SceneParts};
use crate::math::{Frame, Ray, UVec2, Vec2, Vec3, warp};
use crate::sampler::{Domain, Independent, SampleSource, Sampler, Seed};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Number of walks from behind a defective mesh.
const WALKS: u32 = 512;

/// Number of surfaces after which a walk ends and does not count.
const MAX_STEPS: u32 = 64;

/// Largest share of walks that may miss the back of a body: some cracks or turned triangles do no great harm.
const MAX_ESCAPES: f64 = 0.1;

/// Edges and volume of a mesh. Vertices at the same place count as one, since exporters split them at seams.
#[derive(Debug, Default)]
pub(super) struct EdgeStats {
    /// Number of edges with an odd number of triangles.
    open: usize,
    /// Number of other edges that their triangles do not use equally often in both directions.
    turned: usize,
    /// Six times the signed volume of each connected part, above 0 where normals point outwards; of closed meshes only.
    volumes: Vec<f64>,
}

impl EdgeStats {
    /// Counts the edges of a mesh. Triangles with a missing vertex are skipped, as in the scene.
    pub(super) fn of(mesh: &Mesh) -> Self {
        // The sum turns −0 into +0, so that equal positions have equal bits.
        let bits = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut numbers = HashMap::new();
        let welded: Vec<u32> = (mesh.positions.iter())
            .map(|&p| {
                let next = numbers.len() as u32;
                *numbers.entry(bits(p)).or_insert(next)
            })
            .collect();
        let mut edges = Vec::with_capacity(3 * mesh.indices.len());
        let mut parts = Parts((0..numbers.len() as u32).collect());
        let mut faces = Vec::with_capacity(mesh.indices.len());
        for face in &mesh.indices {
            let corner = |i: usize| welded.get(face[i] as usize).copied();
            let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) else {
                continue;
            };
            faces.push(face);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                match from.cmp(&to) {
                    std::cmp::Ordering::Less => edges.push((from, to, 1i32)),
                    std::cmp::Ordering::Greater => edges.push((to, from, -1)),
                    // A triangle without area, as at the poles of a sphere.
                    std::cmp::Ordering::Equal => {}
                }
                parts.join(from, to);
            }
        }
        edges.sort_unstable();
        let mut stats = Self::default();
        for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            if edge.len() % 2 == 1 {
                stats.open += 1;
            } else if edge.iter().map(|(.., turn)| turn).sum::<i32>() != 0 {
                stats.turned += 1;
            }
        }
        if stats.has_wrong_edges() {
            return stats;
        }
        let origin = mesh.positions.first().copied().unwrap_or_default();
        let mut volumes: BTreeMap<u32, f64> = BTreeMap::new();
        for face in faces {
            let [a, b, c] = face.map(|v| (mesh.positions[v as usize] - origin).as_dvec3());
            let part = parts.find(welded[face[0] as usize]);
            *volumes.entry(part).or_default() += DVec3::dot(a, b.cross(c));
        }
        stats.volumes = volumes.into_values().collect();
        stats
    }

    fn has_wrong_edges(&self) -> bool {
        self.open + self.turned > 0
    }

    /// True for a mesh that bounds a volume from outside: its surface is closed, and the normals point outwards.
    pub(super) fn is_closed(&self) -> bool {
        self.volumes.iter().sum::<f64>() > 0.0
    }

    /// True for a closed mesh of which no part has inward normals, not even as the wall of a cavity.
    pub(super) fn all_outwards(&self) -> bool {
        !self.has_wrong_edges() && self.volumes.iter().all(|&volume| volume > 0.0)
    }

    /// Describes the fault of the mesh of this name.
    fn defects(&self, name: &str) -> String {
        match (self.turned, self.open) {
            (0, 0) => format!("normals of {name} point inwards"),
            (0, open) => format!("{name} is not closed ({open} open edges)"),
            (turned, _) => {
                format!("normals of {name} point both ways (at {turned} edges)")
            }
        }
    }
}

/// Connected parts of a mesh as a union-find forest: the parent of each vertex, which is itself for a root.
struct Parts(Vec<u32>);

impl Parts {
    fn find(&mut self, mut vertex: u32) -> u32 {
        while self.0[vertex as usize] != vertex {
            let next = self.0[vertex as usize];
            self.0[vertex as usize] = self.0[next as usize];
            vertex = next;
        }
        vertex
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// Meshes that should bound a body but have defects, with their index among all meshes.
pub(super) fn defective_meshes(parts: &SceneParts) -> Vec<(usize, EdgeStats)> {
    let bounds = |mesh: &Mesh| {
        (parts.materials.get(mesh.material as usize)).is_some_and(Material::bounds_body)
    };
    let meshes: Vec<(usize, &Mesh)> = parts.all_meshes().enumerate().collect();
    (meshes.into_par_iter())
        .filter(|(_, mesh)| bounds(mesh) && !mesh.indices.is_empty())
        .map(|(i, mesh)| (i, EdgeStats::of(mesh)))
        .filter(|(_, stats)| !stats.all_outwards())
        .collect()
}

/// Name of a mesh for messages.
fn name(number: usize, mesh: &Mesh) -> String {
    match mesh.name.is_empty() {
        true => format!("mesh {number}"),
        false => mesh.name.clone(),
    }
}

/// Result of the tests of defective meshes.
#[derive(Default)]
pub(super) struct Classification {
    /// Meshes that bound no body, by their index among all meshes.
    pub(super) thin: Vec<usize>,
    /// Materials of meshes that bound bodies except for some turned triangles.
    pub(super) turned: Vec<u32>,
    pub(super) warnings: Vec<String>,
}

impl Scene {
    /// Decides which defective meshes bound a body.
    pub(super) fn classify_meshes(&self, defective: &[(usize, EdgeStats)]) -> Classification {
        let mut found = Classification::default();
        for (i, stats) in defective {
            let mesh = self.numbered_mesh(*i);
            let what = stats.defects(&name(*i, mesh));
            if self.escape_share(*i, stats) > MAX_ESCAPES {
                found.thin.push(*i);
                found.warnings.push(format!(
                    "{what}: it bounds no body, and is shown as thin walls in spite of its thickness"
                ));
            } else if stats.turned > 0 {
                found.turned.push(mesh.material);
                found.warnings.push(format!(
                    "{what}: where they point inwards light is refracted the wrong way"
                ));
            }
        }
        found
    }

    /// Warnings about meshes that do not enclose their medium, for files that define both sides of each boundary.
    pub(super) fn open_media(&self) -> Vec<String> {
        let material = |i: usize| &self.parts.materials[self.numbered_mesh(i).material as usize];
        (defective_meshes(&self.parts).iter())
            .filter(|(i, _)| material(*i).medium.is_some())
            .filter(|(i, stats)| self.escape_share(*i, stats) > MAX_ESCAPES)
            .map(|(i, stats)| {
                let what = stats.defects(&name(*i, self.numbered_mesh(*i)));
                format!("{what}: it does not enclose the medium that it bounds, which is not where it should be")
            })
            .collect()
    }

    fn numbered_mesh(&self, number: usize) -> &Mesh {
        let mesh = self.parts.all_meshes().nth(number);
        mesh.expect("a defective mesh is one of the meshes")
    }

    /// Share of walks from behind a mesh that miss its back; for a closed mesh, of starting points outside of its body.
    fn escape_share(&self, number: usize, stats: &EdgeStats) -> f64 {
        let parts = &self.parts;
        let mesh = self.numbered_mesh(number);
        let identity = [DAffine3::IDENTITY];
        let poses = match number.checked_sub(parts.meshes.len()) {
            Some(shared) => parts.shared[shared].poses.as_slice(),
            None => &identity,
        };
        let source = Independent {
            seed: Seed(0).derive(Domain::Camera, 1),
        };
        let ends: Vec<Option<bool>> = (0..WALKS)
            .into_par_iter()
            .map(|i| {
                let mut stream = source.stream(UVec2::new(i, 0), 0);
                let start = start(mesh, poses, i, &mut stream)?;
                match stats.has_wrong_edges() {
                    true => self.comes_back(start, mesh.material, stream),
                    false => Some(self.bodies_around(&start).contains(&mesh.material)),
                }
            })
            .collect();
        let known = ends.iter().flatten().count();
        let escaped = ends.iter().flatten().filter(|&&back| !back).count();
        escaped as f64 / known.max(1) as f64
    }

    /// True if a walk from behind a body's surface reaches the back of one of its surfaces, false if it comes to a
    /// front or leaves the scene; `None` for neither.
    fn comes_back(&self, mut ray: Ray, material: u32, mut stream: impl Sampler) -> Option<bool> {
        let mut entered = Vec::new();
        for _ in 0..MAX_STEPS {
            let Some(hit) = self.intersect(&ray) else {
                return Some(false);
            };
            let surface = self.surface(&hit);
            let front = ray.dir.dot(surface.ng) < 0.0;
            let met = self.material(&surface);
            let mut dir = ray.dir;
            if met.bounds_body() {
                if surface.material == material {
                    return Some(!front);
                }
                if front {
                    entered.push(surface.material);
                } else if let Some(i) = entered.iter().rposition(|&m| m == surface.material) {
                    entered.remove(i);
                } else {
                    // Two materials bound the body together, or the body lies in another.
                    return Some(true);
                }
            } else if met.transmission == 0.0 || met.metallic == 1.0 {
                let side = if front { surface.ng } else { -surface.ng };
                let u = Vec2::new(stream.next_1d(), stream.next_1d());
                dir = Frame::from_normal(side).to_world(warp::cosine_hemisphere(u));
            }
            ray = surface.spawn(dir);
        }
        None
    }
}

/// A ray from just behind a random point of the mesh at pose `i`, in turn; `None` for a degenerate triangle.
fn start(mesh: &Mesh, poses: &[DAffine3], i: u32, stream: &mut impl Sampler) -> Option<Ray> {
    let pose = poses.get(i as usize % poses.len())?;
    let face = (stream.next_pick() * mesh.indices.len() as f64) as usize;
    let corners = mesh.indices.get(face)?;
    let at = |k: usize| mesh.positions.get(corners[k] as usize).copied();
    let [a, b, c] = [at(0)?, at(1)?, at(2)?].map(|p| pose.transform_point3(p.as_dvec3()));
    // The front stays the front under a mirroring pose.
    let across = (b - a).cross(c - a) * pose.matrix3.determinant().signum();
    let n = across.try_normalize()?;
    let u = warp::triangle(Vec2::new(stream.next_1d(), stream.next_1d())).as_dvec2();
    let p = a + u.x * (b - a) + u.y * (c - a);
    // More than rounding errors, and less than the thickness of any wall.
    let clear = 32.0 * f64::from(f32::EPSILON) * p.abs().max_element().max((b - a).length());
    let u = Vec2::new(stream.next_1d(), stream.next_1d());
    let dir = Frame::from_normal(-n.as_vec3()).to_world(warp::cosine_hemisphere(u));
    Some(Ray::new((p - clear * n).as_vec3(), dir))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::shapes;

    #[test]
    fn closed_meshes_are_found_across_seams_and_open_ones_are_not() {
        let ball = shapes::sphere(Vec3::ONE, 0.5, 3);
        // A mesh without shared vertices, as exporters write hard edges.
        let apart = Mesh {
            positions: (ball.indices.iter().flatten())
                .map(|&v| ball.positions[v as usize])
                .collect(),
            indices: (0..ball.indices.len() as u32)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect(),
            ..Mesh::default()
        };
        let mut inside_out = ball.clone();
        inside_out.indices.iter_mut().for_each(|f| f.reverse());
        let mut holed = ball.clone();
        holed.indices.pop();
        let pane = shapes::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        assert!(EdgeStats::of(&ball).is_closed() && EdgeStats::of(&apart).is_closed());
        assert!(EdgeStats::of(&shapes::cuboid(Vec3::ZERO, Vec3::ONE)).is_closed());
        for open in [inside_out, holed, pane, Mesh::default()] {
            assert!(!EdgeStats::of(&open).is_closed());
        }
    }

    #[test]
    fn open_and_turned_edges_are_counted() {
        let ball = shapes::sphere(Vec3::ONE, 0.5, 3);
        let edges = |change: &dyn Fn(&mut Vec<[u32; 3]>)| {
            let mut mesh = ball.clone();
            change(&mut mesh.indices);
            let stats = EdgeStats::of(&mesh);
            (stats.open, stats.turned)
        };
        assert_eq!(edges(&|_| ()), (0, 0));
        assert_eq!(edges(&|faces| faces.truncate(faces.len() - 1)), (3, 0));
        assert_eq!(edges(&|faces| faces[7].reverse()), (0, 3));
        assert_eq!(
            edges(&|faces| faces.iter_mut().for_each(|f| f.reverse())),
            (0, 0)
        );
    }
}
