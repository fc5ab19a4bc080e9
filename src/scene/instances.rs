//! Meshes that a scene stores once and shows at several poses. Each has its own tree in object space; the scene's tree
//! contains the world-space boxes of the instances beside the unshared triangles.

use super::accel::{self, Accel, LocalRay};
use super::geometry::{Dropped, Run, ToWorld, Triangle, add_faces, corners};
use super::material::may_vanish;
use super::mesh::{Mesh, SharedMesh, cofactors, unit};
use super::{Hit, SceneParts, Surface, TriangleId};
use crate::math::{DVec3, Ray, Vec3, Vec4};
use glam::{DAffine3, DMat3};
use rayon::prelude::*;

/// Bound on the double-precision error of hits on an instance, relative to its largest coordinates and to the condition
/// number of its pose.
const ROUNDINGS: f64 = 16.0 * f64::EPSILON;

/// Number of instances placed at a time, in parallel: few, since these are in memory twice.
const CHUNK: usize = 1 << 12;

/// All instances of a scene.
pub(super) struct Instances {
    meshes: Vec<Shared>,
    list: Vec<Instance>,
    /// Lower and upper corner of each instance, until the tree is built.
    boxes: Vec<(Vec3, Vec3)>,
}

/// A shared mesh.
pub(super) struct Shared {
    triangles: Vec<Triangle>,
    /// Index of the first triangle among all triangles in memory.
    first: u32,
    accel: Accel,
    material: u32,
    /// True if opacity may remove hits.
    pub(super) vanishes: bool,
}

/// A shared mesh at one of its poses.
struct Instance {
    /// Index into `SceneParts::shared`.
    mesh: u32,
    pose: DAffine3,
    inverse: DAffine3,
    /// Transform of normals, towards the front.
    normals: DMat3,
    /// −1 for a mirroring pose, which reverses the winding: the front stays the front `[glTF §3.7.4]`.
    sign: f64,
    /// Error of double precision, in the world.
    slack: f32,
}

impl Instances {
    /// Builds the trees; `first` is the number of triangles that are not shared. `None` without instances.
    pub(super) fn new(
        parts: &SceneParts,
        mut first: u32,
        warnings: &mut Vec<String>,
    ) -> Option<Self> {
        let mut meshes = Vec::new();
        let (mut list, mut boxes) = (Vec::new(), Vec::new());
        for (m, SharedMesh { mesh, poses }) in parts.shared.iter().enumerate() {
            let mut faces = Vec::with_capacity(mesh.indices.len());
            let name = format!("shared mesh {m}");
            let mut dropped = Dropped::default();
            add_faces(&mut faces, (m, mesh), parts, &name, &mut dropped, warnings);
            dropped.say(warnings);
            let accel = Accel::over(faces.len(), |i| corners(mesh, faces[i as usize][1]), &[]);
            let triangles: Vec<Triangle> = (faces.into_iter())
                .map(|face| Triangle::new(mesh, face, parts))
                .collect();
            let material = parts.materials.get(mesh.material as usize);
            if material.is_some_and(|m| m.emission != Vec3::ZERO) {
                warnings.push(format!("shared mesh {m}: its emission is ignored"));
            }
            let extent =
                (triangles.iter().flat_map(|t| &t.corners)).fold(Vec3::ZERO, |e, p| e.max(p.abs()));
            let before = list.len();
            let place = |pose: &DAffine3| {
                let (instance, slack) = Instance::new(m as u32, pose, extent)?;
                Some((instance, bounds(&accel, pose, slack)))
            };
            list.reserve_exact(poses.len());
            boxes.reserve_exact(poses.len());
            let shown = poses.chunks(CHUNK).filter(|_| !triangles.is_empty());
            for poses in shown {
                let placed: Vec<_> = poses.par_iter().filter_map(place).collect();
                for (instance, bounds) in placed {
                    list.push(instance);
                    boxes.push(bounds);
                }
            }
            let dropped = poses.len() - (list.len() - before);
            if dropped > 0 {
                warnings.push(format!(
                    "shared mesh {m}: dropped {dropped} of {} instances (no triangles, or a pose that is singular or out of \
                     range)",
                    poses.len()
                ));
            }
            let count = triangles.len() as u32;
            meshes.push(Shared {
                first,
                vanishes: material.is_some_and(may_vanish),
                material: mesh.material,
                triangles,
                accel,
            });
            first += count;
        }
        (!list.is_empty()).then_some(Self {
            boxes,
            meshes,
            list,
        })
    }

    /// Number of triangles of all instances together.
    pub(super) fn triangle_count(&self) -> usize {
        let of = |i: &Instance| self.meshes[i.mesh as usize].triangles.len();
        self.list.iter().map(of).sum()
    }

    /// Number of instances.
    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// Number of triangles in memory.
    pub(super) fn stored(&self) -> usize {
        self.meshes.iter().map(|m| m.triangles.len()).sum()
    }

    /// The triangles of each instance, in scene order.
    pub(super) fn runs(&self) -> impl Iterator<Item = Run> {
        (1..).zip(&self.list).map(|(instance, of)| {
            let mesh = &self.meshes[of.mesh as usize];
            let indices = mesh.first..mesh.first + mesh.triangles.len() as u32;
            Run { instance, indices }
        })
    }

    /// True if opacity may remove a hit.
    pub(super) fn vanish(&self) -> bool {
        self.meshes.iter().any(|m| m.vanishes)
    }

    /// Moves out the lower and upper corner of each instance.
    pub(super) fn take_boxes(&mut self) -> Vec<(Vec3, Vec3)> {
        std::mem::take(&mut self.boxes)
    }

    /// The instance of a triangle, its mesh, and the triangle in object space.
    fn find(&self, triangle: TriangleId) -> (&Instance, &Shared, &Triangle) {
        let instance = &self.list[triangle.instance() as usize - 1];
        let mesh = &self.meshes[instance.mesh as usize];
        (
            instance,
            mesh,
            &mesh.triangles[(triangle.index() - mesh.first) as usize],
        )
    }

    /// Index of a triangle's material.
    pub(super) fn material(&self, triangle: TriangleId) -> u32 {
        self.find(triangle).1.material
    }

    /// The mesh of a triangle in object space, and the corners' indices.
    pub(super) fn source<'a>(
        &self,
        parts: &'a SceneParts,
        triangle: TriangleId,
    ) -> (&'a Mesh, &'a [u32; 3]) {
        let (instance, _, triangle) = self.find(triangle);
        let mesh = &parts.shared[instance.mesh as usize].mesh;
        (mesh, triangle.indices(mesh))
    }

    /// Corners of a triangle in the world, rounded; counter-clockwise seen from the front.
    pub(super) fn corners(&self, triangle: TriangleId) -> [Vec3; 3] {
        let (instance, _, triangle) = self.find(triangle);
        let [a, b, c] = triangle
            .corners
            .map(|p| instance.pose.transform_point3(p.as_dvec3()).as_vec3());
        if instance.sign < 0.0 {
            [a, c, b]
        } else {
            [a, b, c]
        }
    }

    /// A hit in an instance that `keep` accepts and that is closer than `best`: the closest, or with `ANY` the first
    /// found.
    #[inline]
    pub(super) fn enter<const ANY: bool>(
        &self,
        ray: &Ray,
        number: u32,
        best: &Hit,
        keep: impl Fn(&Shared, &Hit) -> bool,
    ) -> Option<Hit> {
        let instance = &self.list[number as usize];
        let shared = &self.meshes[instance.mesh as usize];
        let first = TriangleId::new(number + 1, shared.first);
        let local = instance.local(ray, first, *best);
        (shared.accel).closer_hit::<ANY>(&local, |hit| {
            if !ANY {
                // The surface at the closest hit is computed next.
                accel::prefetch(&shared.triangles, hit.triangle.index() - shared.first);
            }
            keep(shared, hit)
        })
    }

    /// See [`super::Geometry::surface`].
    pub(super) fn surface(&self, parts: &SceneParts, hit: &Hit) -> Surface {
        let (triangle, to_world) = self.place(hit.triangle);
        triangle.surface(parts, hit, &to_world)
    }

    /// A triangle in its mesh's space, and its transform to the world.
    pub(super) fn place(&self, triangle: TriangleId) -> (&Triangle, impl ToWorld + use<'_>) {
        let (instance, _, triangle) = self.find(triangle);
        (triangle, InstanceTransform(instance))
    }
}

impl Instance {
    /// A mesh of this extent at a pose, and its double-precision error in the world; `None` for an invalid pose.
    fn new(mesh: u32, pose: &DAffine3, extent: Vec3) -> Option<(Self, f64)> {
        let condition = SharedMesh::condition(pose)?;
        let reach = magnitudes(&pose.matrix3) * extent.as_dvec3() + pose.translation.abs();
        if reach.max_element() > Accel::LIMIT.into() {
            return None;
        }
        let slack = ROUNDINGS * condition * reach.length();
        let sign = if pose.matrix3.determinant() < 0.0 {
            -1.0
        } else {
            1.0
        };
        let instance = Self {
            normals: cofactors(&pose.matrix3) * sign,
            sign,
            mesh,
            pose: *pose,
            inverse: pose.inverse(),
            slack: slack as f32,
        };
        Some((instance, slack))
    }

    /// A ray in the mesh's space, with the mesh's first triangle and the best hit so far.
    #[inline]
    fn local(&self, ray: &Ray, first: TriangleId, best: Hit) -> LocalRay {
        let origin = self.inverse.transform_point3(ray.origin.as_dvec3());
        let dir = self.inverse.transform_vector3(ray.dir.as_dvec3());
        LocalRay {
            ray: Ray {
                origin: origin.as_vec3(),
                dir: dir.as_vec3(),
                t_max: best.t,
            },
            origin,
            dir,
            first,
            best,
        }
    }
}

/// Transform of an instance's mesh to the world.
struct InstanceTransform<'a>(&'a Instance);

impl ToWorld for InstanceTransform<'_> {
    fn mesh<'a>(&self, parts: &'a SceneParts, index: u32) -> &'a Mesh {
        &parts.shared[index as usize].mesh
    }

    fn point(&self, p: Vec3) -> DVec3 {
        self.0.pose.transform_point3(p.as_dvec3())
    }

    fn edge(&self, e: DVec3) -> DVec3 {
        self.0.pose.transform_vector3(e)
    }

    fn geometric(&self, _: Vec3, e: DVec3, f: DVec3) -> Vec3 {
        (self.0.sign * e.cross(f)).normalize().as_vec3()
    }

    fn normal(&self, n: Vec3) -> Vec3 {
        unit(self.0.normals * n.as_dvec3())
    }

    fn tangent(&self, t: Vec4) -> Vec4 {
        let hand = if (t.w < 0.0) == (self.0.sign < 0.0) {
            1.0
        } else {
            -1.0
        };
        let along = (self.0.pose).transform_vector3(t.truncate().as_dvec3());
        unit(along).extend(hand)
    }

    fn error(&self, error: f32) -> f32 {
        error + self.0.slack
    }
}

/// The absolute values of a matrix.
fn magnitudes(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// The box in the world around the triangles of a tree, rounded outwards.
fn bounds(accel: &Accel, pose: &DAffine3, slack: f64) -> (Vec3, Vec3) {
    let reach = |sign: f64| {
        let along = |axis: usize| sign * accel.reach(sign * pose.matrix3.row(axis));
        pose.translation + DVec3::from_array([0, 1, 2].map(along))
    };
    let (low, high) = (reach(-1.0), reach(1.0));
    // The rounded ray in object space may deviate from the ray in the world.
    let margin = DVec3::splat(slack) + 4.0 * f64::from(f32::EPSILON) * low.abs().max(high.abs());
    ((low - margin).as_vec3(), (high + margin).as_vec3())
}
