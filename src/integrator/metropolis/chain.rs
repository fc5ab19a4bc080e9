//! Markov chains over primary samples `[Kelemen02]`: the random numbers of a path are the state.

use crate::image::splat::Splat;
use crate::math::{UVec2, Vec2};
use crate::sampler::{IndependentStream, Sampler};

/// Probability of a large step, which draws all numbers anew.
pub(super) const LARGE: f64 = 0.3;

/// Share of the small proposals that keep the light walk, and of those that keep the camera walk.
const ONE_WALK_SHARE: f32 = 0.25;

/// log₂ of the least and the largest small step, of numbers in [0, 1).
const STEPS: [f32; 2] = [-10.0, -6.0];

/// The change from the numbers of a state to those of a proposal. Every kind is symmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// All are drawn anew.
    Large,
    /// Each moves a little.
    Small,
    /// None moves.
    None,
}

/// Random numbers of one walk: those of the current state, and those of the state that is proposed.
///
/// Numbers that the current state has not used are independent of it, so that every proposal draws them anew: a state
/// stores only the numbers that its path uses.
pub(super) struct Numbers {
    current: Vec<u32>,
    proposed: Vec<u32>,
    source: IndependentStream,
    step: Step,
    /// Position in the pixel, if this walk begins at the camera.
    place: Vec2,
}

impl Numbers {
    /// No state yet: the first proposal must be a large step.
    pub(super) fn new(source: IndependentStream) -> Self {
        Self {
            current: Vec::new(),
            proposed: Vec::new(),
            source,
            step: Step::Large,
            place: Vec2::ZERO,
        }
    }

    /// Takes the random numbers of further proposals from another stream.
    pub(super) fn continue_with(&mut self, source: IndependentStream) {
        self.source = source;
    }

    /// Begins a proposal.
    pub(super) fn propose(&mut self, step: Step) {
        self.proposed.clear();
        self.step = step;
    }

    /// Makes the proposal the state.
    pub(super) fn accept(&mut self) {
        std::mem::swap(&mut self.current, &mut self.proposed);
    }

    /// The pixel of a camera path, uniform over a frame, from the walk's first two numbers; the next [`Sampler::film`]
    /// is the position in it.
    pub(super) fn pixel(&mut self, frame: UVec2) -> UVec2 {
        let mut side = |length: u32| {
            let product = u64::from(self.next_bits()) * u64::from(length);
            let rest = product as u32;
            ((product >> 32) as u32, (rest >> 8) as f32 / 16_777_216.0)
        };
        let ((x, u), (y, v)) = (side(frame.x), side(frame.y));
        self.place = Vec2::new(u, v);
        UVec2::new(x, y)
    }
}

impl Sampler for Numbers {
    #[inline]
    fn next_bits(&mut self) -> u32 {
        let bits = match self.current.get(self.proposed.len()) {
            Some(&old) if self.step == Step::None => old,
            Some(&old) if self.step == Step::Small => {
                old.wrapping_add(small_step(self.source.next_bits()))
            }
            _ => self.source.next_bits(),
        };
        self.proposed.push(bits);
        bits
    }

    fn film(&mut self) -> Vec2 {
        self.place
    }
}

/// A step of random sign and log-uniform size, in units of 2⁻³². Sums wrap around, which keeps steps symmetric.
#[inline]
fn small_step(bits: u32) -> u32 {
    let [least, most] = STEPS;
    let u = (bits >> 8) as f32 / 16_777_216.0;
    let size = ((least + (most - least) * u).exp2() * 4_294_967_296.0) as u32;
    if bits & 1 == 0 {
        size
    } else {
        size.wrapping_neg()
    }
}

/// A function of primary samples, with values for pixels.
pub(super) trait Target {
    /// Writes the values of a state to `splats` and returns the target, to which the chain's density is proportional.
    /// Neither is negative.
    fn evaluate(
        &mut self,
        light: &mut Numbers,
        camera: &mut Numbers,
        splats: &mut Vec<Splat>,
    ) -> f64;
}

/// A state of a chain.
struct State {
    splats: Vec<Splat>,
    target: f64,
    /// Sum of the factors of its values.
    factor: f64,
}

impl State {
    /// Appends the scaled values to a list.
    fn record(&self, scale: f64, out: &mut Vec<Splat>) {
        let factor = (self.factor * scale) as f32;
        if factor > 0.0 {
            out.extend(self.splats.iter().map(|splat| Splat {
                value: splat.value * factor,
                ..*splat
            }));
        }
    }
}

/// Means of the target over all numbers, of the pass and of all passes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Means {
    /// b: estimate by the bootstrap of the pass, at whose samples the chains start. It enters linearly: its noise is no
    /// bias.
    pub(super) pass: f64,
    /// b₀: a constant above 0, best near b. It only balances chains and fresh paths.
    pub(super) constant: f64,
    /// Fresh paths over mutations: large steps and the bootstrap.
    pub(super) fresh: f64,
}

impl Means {
    /// Density of a state of this target, summed over all techniques: the values of a state are divided by it.
    #[inline]
    pub(super) fn density(&self, target: f64) -> f64 {
        target / self.constant + self.fresh
    }
}

/// Random numbers of a chain.
pub(super) struct Sources {
    /// Streams of the first state: those of a bootstrap sample, chosen with probability in proportion to its target.
    pub(super) start: [IndependentStream; 2],
    /// Streams of the proposals: light walk, camera walk, choices.
    pub(super) steps: [IndependentStream; 3],
}

/// Runs a chain of `mutations` mutations of weight `scale` each, and returns its values in order.
///
/// With the first state as in [`Sources`], the expectation over bootstrap and chain of a sum of values is exactly their
/// integral: a proposal is drawn with density I/b by the chain and, with probability p, uniformly by a large step. Both
/// are weighted by the balance heuristic, with b₀ in place of b (after Kelemen et al. 2002, (9)), and with the
/// bootstrap as further large steps, whose values the caller adds.
pub(super) fn run(
    target: &mut impl Target,
    sources: Sources,
    mutations: u32,
    means: Means,
    scale: f64,
) -> Vec<Splat> {
    let Sources {
        start: [light, camera],
        steps: [light_steps, camera_steps, mut choices],
    } = sources;
    let (mut light, mut camera) = (Numbers::new(light), Numbers::new(camera));
    let mut out = Vec::new();
    let mut splats = Vec::new();
    let first = target.evaluate(&mut light, &mut camera, &mut splats);
    light.accept();
    camera.accept();
    light.continue_with(light_steps);
    camera.continue_with(camera_steps);
    let mut state = State {
        splats,
        target: first,
        factor: 0.0,
    };
    let ratio = means.pass / means.constant;
    let mut spare = Vec::new();
    for _ in 0..mutations {
        let large = f64::from(choices.next_1d()) < LARGE;
        let part = choices.next_1d();
        let step = |kept: bool| match kept {
            _ if large => Step::Large,
            true => Step::None,
            false => Step::Small,
        };
        light.propose(step(part < ONE_WALK_SHARE));
        camera.propose(step(part >= 1.0 - ONE_WALK_SHARE));
        let mut next = State {
            splats: std::mem::take(&mut spare),
            target: 0.0,
            factor: 0.0,
        };
        next.target = target.evaluate(&mut light, &mut camera, &mut next.splats);
        // From a state with target 0 every proposal is accepted.
        let acceptance = if state.target > 0.0 {
            (next.target / state.target).min(1.0)
        } else {
            1.0
        };
        let one = f64::from(u8::from(large));
        next.factor = (acceptance * ratio + one) / means.density(next.target);
        state.factor += (1.0 - acceptance) * ratio / means.density(state.target);
        let left = if f64::from(choices.next_1d()) < acceptance {
            light.accept();
            camera.accept();
            std::mem::replace(&mut state, next)
        } else {
            next
        };
        left.record(scale, &mut out);
        spare = left.splats;
    }
    state.record(scale, &mut out);
    out
}

#[cfg(test)]
mod tests;
