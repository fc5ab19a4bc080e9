//! Light over smooth interfaces, found by Newton's method: specular manifold sampling `[SMS]`.
//!
//! Plain path tracing hits a small lamp behind a mirror or under water only by chance, and a light without area never.
//! Here a receiver x₀ draws a point xₖ₊₁ of a light and a seed on a [caster](casters), from which Newton's method on
//! the [`constraint`] finds a specular chain between the two points. A solution contributes f · T · Le · |∂ω₀/∂xₖ₊₁|
//! over the density of xₖ₊₁ and over the unknown probability p of the solution. Both estimators of `[SMS §4]` are
//! implemented:
//!
//! - *unbiased*: 1/p is the mean number of further trials until the same solution is found again;
//! - *biased* with M trials: every solution that one of them finds counts once, so that rare solutions are too dark.
//!
//! Only this strategy samples paths with a receiver of roughness α of at least [`ROUGH`] that scatters by a non-Dirac
//! lobe, a [chain](Kind) of casters, and a light that is not the environment. Emission at the end of such a traced path
//! is not counted. The path tracer samples all other paths. A pane in between blocks a chain.
//!
//! Half of the seeds are uniform points of the casters, equally many per mesh, as in `[SMS]`. The others are hits of
//! rays near the direction to the light, where refractions at gentle waves and in thin bodies have their solutions.
//!
//! The unbiased estimator stops after [`MAX_TRIALS`] trials: rarer solutions are too dark. A solution that no seed
//! converges to, as at the edge of a facet, is lost.

mod casters;
mod constraint;

use super::directions::Directions;
use crate::bsdf::{Bsdf, Lobe, SharedNumbers, fresnel};
use crate::integrator::walk::shading_point::{Continuation, ShadingPoint};
use crate::integrator::walk::{Arrival, Interaction, Walk};
use crate::math::{DVec3, Ray, Rgb, UVec2, Vec2, Vec3, warp};
use crate::sampler::{Domain, Independent, SampleSource, Sampler, Seed, VertexU};
use crate::scene::light::{LightPoint, Location};
use crate::scene::{Scene, Surface};
use casters::{Casters, patch};
use constraint::{ChainVertex, End, chain};

/// Least roughness of a receiver.
const ROUGH: f32 = 0.1;

/// Most trials for one solution.
const MAX_TRIALS: u32 = 1024;

/// Most steps of Newton's method, and the least fraction to which a step is cut.
const STEPS: u32 = 20;
const MIN_STEP: f64 = 1.0 / 64.0;

/// Length of the constraint below which a point is a solution; one more step refines it, since solutions are compared.
const CLOSE: f64 = 2e-5;

/// Distance of directions below which two trials have the same solution.
const SAME: f32 = 5e-4;

/// Largest distance between the direction of a solution at its last vertex and the direction to the light.
const MISSED: f32 = 2e-3;

/// Share of the seeds near the direction to the light.
const AIMED: f32 = 0.5;

/// Bounds of the probability of a reflection at a dielectric, else the Fresnel reflectance at the seed. Even from a
/// seed with total reflection, Newton's method may converge to a refraction.
const REFLECTED: [f32; 2] = [0.05, 0.5];

/// Casters of a scene and the number of trials.
pub(in crate::integrator) struct Manifold {
    casters: Option<Casters>,
    trials: u32,
}

impl Manifold {
    /// The strategy in a scene, with a number of trials; 0 for the unbiased estimator.
    pub(in crate::integrator) fn of(scene: &Scene, trials: u32) -> Self {
        Self {
            casters: Casters::of(scene),
            trials,
        }
    }

    /// The policy of a new path.
    pub(in crate::integrator) fn policy(&self) -> ManifoldPolicy<'_> {
        ManifoldPolicy {
            manifold: self,
            state: ChainState::Elsewhere,
        }
    }
}

/// A chain of casters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// One reflection.
    Reflected,
    /// A refraction out of the body that the receiver is in.
    Left,
    /// A refraction into a body, and one out of it.
    Through,
}

/// Scattering at a vertex of a chain, seen from the receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Mirror,
    Enter,
    Leave,
}

impl Kind {
    fn steps(self) -> &'static [Step] {
        match self {
            Self::Reflected => &[Step::Mirror],
            Self::Left => &[Step::Leave],
            Self::Through => &[Step::Enter, Step::Leave],
        }
    }
}

/// Vertices of the path since its last receiver.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ChainState {
    Elsewhere,
    Receiver,
    /// Into a caster.
    Entered,
    /// Through a whole chain.
    Chain,
}

/// Directions of the BSDF, with manifold sampling at receivers.
pub(in crate::integrator) struct ManifoldPolicy<'a> {
    manifold: &'a Manifold,
    state: ChainState,
}

impl Directions for ManifoldPolicy<'_> {
    const GUIDED: bool = false;

    fn arrive(&mut self, _: &ShadingPoint<'_>, _: &VertexU, _: &mut impl Sampler) {}

    fn pdf(&self, _: Vec3, pdf_w: f32) -> f32 {
        pdf_w
    }

    fn sample(
        &mut self,
        point: &ShadingPoint<'_>,
        alpha: f32,
        u: &SharedNumbers,
    ) -> Option<Continuation> {
        point.sample(alpha, u)
    }

    fn found(&mut self, _: Rgb) {}

    fn met(&mut self, _: Rgb) {}

    fn leave(
        &mut self,
        vertex: &Interaction<'_>,
        next: &Continuation,
        _: Rgb,
        _: &mut impl Sampler,
    ) {
        let Some(casters) = &self.manifold.casters else {
            return;
        };
        let sample = &next.sample;
        let caster = sample.delta && casters.eta(vertex.surface).is_some();
        let outside = vertex.wo.z > 0.0;
        self.state = match (self.state, sample.lobe) {
            _ if !sample.delta && vertex.alpha >= ROUGH => ChainState::Receiver,
            (ChainState::Receiver, Lobe::Transmission) if caster && outside => ChainState::Entered,
            (ChainState::Receiver, _) if caster => ChainState::Chain,
            (ChainState::Entered, Lobe::Transmission) if caster && !outside => ChainState::Chain,
            _ => ChainState::Elsewhere,
        };
    }

    fn finish(&mut self) {}

    fn counts(&self, arrival: Option<&Arrival>) -> bool {
        self.state != ChainState::Chain || arrival.is_none()
    }

    fn beyond(
        &mut self,
        walk: &Walk<'_>,
        vertex: &Interaction<'_>,
        point: &ShadingPoint<'_>,
        u: &VertexU,
    ) -> Rgb {
        let Some(casters) = &self.manifold.casters else {
            return Rgb::ZERO;
        };
        if point.panes == 0 || point.alpha < ROUGH || point.bsdf.is_delta_at(point.alpha) {
            return Rgb::ZERO;
        }
        let Some(light) = point.scene.lights().end(u.light.pick, u.light.at) else {
            return Rgb::ZERO;
        };
        let search = Search {
            casters,
            walk,
            vertex,
            point,
            from: point.surface.position.as_dvec3(),
            light,
            end: match light.place {
                Location::Point(at) => End::Point(at.as_dvec3()),
                Location::Direction(dir) => End::Direction(dir.as_dvec3()),
            },
        };
        // A separate random stream, seeded by the numbers of the vertex.
        let [a, b, c] = u.lobe.map(|x| u64::from(x.to_bits()));
        let seed = Seed(u.light.pick.to_bits() ^ a << 32 ^ b ^ c << 16).derive(Domain::Manifold, 0);
        let mut stream = Independent { seed }.stream(UVec2::ZERO, 0);
        let sum = match self.manifold.trials {
            0 => search.unbiased(&mut stream),
            trials => search.biased(trials, &mut stream),
        };
        point.throughput * sum
    }
}

/// The search for chains from a receiver to a point of a light.
struct Search<'a, 'v> {
    casters: &'a Casters,
    walk: &'a Walk<'v>,
    vertex: &'a Interaction<'a>,
    point: &'a ShadingPoint<'a>,
    /// Position of the receiver.
    from: DVec3,
    light: LightPoint,
    end: End,
}

/// A solution.
struct Solution {
    /// World direction at the receiver.
    dir: Vec3,
    kind: Kind,
    /// f · T · Le · |∂ω₀/∂xₖ₊₁| over the density of xₖ₊₁; throughput of the path left out.
    value: Rgb,
}

impl Solution {
    fn is(&self, other: &Self) -> bool {
        self.kind == other.kind && self.dir.distance_squared(other.dir) < SAME * SAME
    }
}

/// A chain that was traced from the receiver; with one vertex, the second repeats the first.
struct Traced {
    vertices: [ChainVertex; 2],
    length: usize,
}

impl Search<'_, '_> {
    fn unbiased(&self, stream: &mut impl Sampler) -> Rgb {
        let Some(first) = self.trial(stream) else {
            return Rgb::ZERO;
        };
        let mut trials = 1;
        while trials < MAX_TRIALS && !self.trial(stream).is_some_and(|again| again.is(&first)) {
            trials += 1;
        }
        first.value * trials as f32
    }

    fn biased(&self, trials: u32, stream: &mut impl Sampler) -> Rgb {
        let mut found: Vec<Solution> = Vec::new();
        for _ in 0..trials {
            if let Some(solution) = self.trial(stream)
                && !found.iter().any(|known| known.is(&solution))
            {
                found.push(solution);
            }
        }
        found.iter().map(|solution| solution.value).sum()
    }

    /// Runs Newton's method from a random seed; `None` without a solution.
    fn trial(&self, stream: &mut impl Sampler) -> Option<Solution> {
        let (choice, pick) = (stream.next_1d(), stream.next_pick());
        let at = Vec2::new(stream.next_1d(), stream.next_1d());
        let reflection = stream.next_1d();
        let scene = self.point.scene;
        let dir = if choice < AIMED {
            let towards = match self.end {
                End::Point(at) => (at - self.from).normalize(),
                End::Direction(dir) => dir,
            };
            // Offsets over several orders of magnitude.
            towards + (pick * pick * pick) * warp::sphere(at).as_dvec3()
        } else {
            let seed = self.casters.point(pick, at)?;
            scene.surface(&seed).position.as_dvec3() - self.from
        };
        let ray = self.ray(dir)?;
        let (eta, seed) = self.caster_hit(&ray)?;
        let outside = self.is_outside(&seed, self.from);
        let share = |relative: f32| {
            let cos = seed.ns.dot(ray.dir).abs().min(1.0);
            fresnel::dielectric(cos, relative).clamp(REFLECTED[0], REFLECTED[1])
        };
        let kind = match (eta, outside) {
            (0.0, _) => Kind::Reflected,
            (eta, true) if reflection >= share(eta) => Kind::Through,
            (eta, false) if reflection >= share(1.0 / eta) => Kind::Left,
            _ => Kind::Reflected,
        };
        if kind.steps().len() > self.point.panes as usize {
            return None;
        }
        let by = self.solve(seed.position.as_dvec3(), kind)?;
        self.connect(by, kind)
    }

    /// A ray from the receiver.
    fn ray(&self, dir: DVec3) -> Option<Ray> {
        let dir = dir.try_normalize()?.as_vec3().try_normalize()?;
        Some(self.point.surface.spawn(dir))
    }

    /// The caster that a ray hits, and its index inside over that outside.
    fn caster_hit(&self, ray: &Ray) -> Option<(f32, Surface)> {
        let surface = self.point.scene.surface(&self.point.scene.intersect(ray)?);
        Some((self.casters.eta(&surface)?, surface))
    }

    fn is_outside(&self, at: &Surface, before: DVec3) -> bool {
        (before - at.position.as_dvec3()).dot(at.ng.as_dvec3()) > 0.0
    }

    /// The vertex of a chain at a surface seen from `before`; `None` where the step is impossible.
    fn chain_vertex(&self, at: &Surface, before: DVec3, step: Step) -> Option<ChainVertex> {
        let eta = f64::from(self.casters.eta(at)?);
        let indices = match (step, self.is_outside(at, before)) {
            (Step::Mirror, _) => [1.0, 1.0],
            (Step::Enter, true) if eta > 0.0 => [1.0, eta],
            (Step::Leave, false) if eta > 0.0 => [eta, 1.0],
            _ => return None,
        };
        let at = patch(self.point.scene, at.triangle).at(at.position.as_dvec3())?;
        Some(ChainVertex { at, indices })
    }

    /// The chain from the receiver towards a point of its first caster.
    fn traced(&self, target: DVec3, kind: Kind) -> Option<Traced> {
        let steps = kind.steps();
        let (_, surface) = self.caster_hit(&self.ray(target - self.from)?)?;
        let first = self.chain_vertex(&surface, self.from, steps[0])?;
        let mut traced = Traced {
            vertices: [first, first],
            length: 1,
        };
        if let Some(&step) = steps.get(1) {
            let at = first.at.position;
            let next = first.refracted((self.from - at).try_normalize()?)?;
            let (_, surface) = self.caster_hit(&surface.spawn(next.as_vec3().try_normalize()?))?;
            traced.vertices[1] = self.chain_vertex(&surface, at, step)?;
            traced.length = 2;
        }
        Some(traced)
    }

    /// First vertex of a solution by Newton's method; steps that miss casters are halved `[SMS, algorithm 1]`.
    fn solve(&self, seed: DVec3, kind: Kind) -> Option<DVec3> {
        let mut traced = self.traced(seed, kind)?;
        let (mut reach, mut close) = (1.0, false);
        for _ in 0..STEPS {
            let first = traced.vertices[0].at;
            let found = chain(self.from, &traced.vertices[..traced.length], self.end)?;
            if close {
                return Some(first.position);
            }
            close = found.value.length() < CLOSE;
            let step = found.step()? * reach;
            let target = first.position + first.axes[0] * step.x + first.axes[1] * step.y;
            match self.traced(target, kind) {
                Some(next) => (traced, reach) = (next, f64::min(2.0 * reach, 1.0)),
                None if close => return Some(first.position),
                None => {
                    reach *= 0.5;
                    if reach < MIN_STEP {
                        return None;
                    }
                }
            }
        }
        None
    }

    /// The path through a solved first vertex, traced as in the path tracer.
    fn connect(&self, by: DVec3, kind: Kind) -> Option<Solution> {
        let point = self.point;
        let dir = (by - self.from).try_normalize()?.as_vec3().normalize();
        let wi = point.frame.to_local(dir);
        if dir.dot(point.surface.ng) * wi.z <= 0.0 {
            return None;
        }
        let eval = point.bsdf.eval(point.alpha, point.wo, wi);
        if eval.value == Rgb::ZERO {
            return None;
        }
        let mut walk = self.walk.with_unit_throughput();
        let side = if wi.z * point.wo.z < 0.0 {
            Lobe::Transmission
        } else {
            Lobe::Reflection
        };
        walk.leave(self.vertex, side, dir);
        let (steps, mut before) = (kind.steps(), self.from);
        let mut made = Bsdf::BLACK;
        let mut vertices: Vec<ChainVertex> = Vec::with_capacity(steps.len());
        for &step in steps {
            let mut arrival = walk.arrive_without_media(&mut ())?;
            vertices.push(self.chain_vertex(&arrival.surface, before, step)?);
            let bsdf = walk.bsdf(&mut arrival.surface, 0.0, &mut made);
            let surface = arrival.surface;
            let vertex = walk.interaction(&surface, bsdf);
            let lobe = match step {
                Step::Mirror => Lobe::Reflection,
                Step::Enter | Step::Leave => Lobe::Transmission,
            };
            let sample = bsdf.dirac(vertex.wo, lobe)?;
            let next = vertex.frame.to_world(sample.wi);
            if next.dot(surface.ng) * sample.wi.z <= 0.0 {
                return None;
            }
            walk.throughput *= sample.weight;
            if vertices.len() < steps.len() {
                walk.leave(&vertex, lobe, next);
                before = surface.position.as_dvec3();
                continue;
            }
            let light = (point.scene.lights()).sample_end(surface.position, &self.light)?;
            let same_side = light.wi.dot(surface.ng) * next.dot(surface.ng) > 0.0;
            if !same_side || light.wi.distance_squared(next) > MISSED * MISSED {
                return None;
            }
            let ray = surface.spawn_to_light(&light);
            let around = walk.around();
            let passed = vertex.unblocked(point.scene, around, &ray, light.distance, 0)?;
            let spread = chain(self.from, &vertices, self.end)?.spread() as f32;
            // Converts the spread from area at the light to solid angle at the last vertex, as in the light's density.
            let area = match light.distance {
                distance if distance.is_finite() => distance * distance,
                _ => 1.0,
            };
            let value = eval.value * walk.throughput * passed * light.radiance;
            let value = value * (spread * area / light.density.value());
            return value.is_finite().then_some(Solution { dir, kind, value });
        }
        None
    }
}
