//! Free flight through media that scatter.
//!
//! The distance to the next scattering is drawn for one colour channel, which is chosen by the walk's throughput, and
//! weighted by the density of all channels together: one-sample MIS. With pᵢ the probability of channel i, σ its
//! extinction and T its transmittance,
//!
//! ```text
//! scattered after t      weight σs T(t) / Σ pᵢ σᵢ Tᵢ(t)
//! a surface after d      weight    T(d) / Σ pᵢ    Tᵢ(d)
//! ```
//!
//! Each weight is at most 1/pᵢ in channel i, whatever the media, so that the throughput of no channel grows beyond the
//! sum of all.
//!
//! MIS weights leave media out: the density of every strategy has the factor σs of each point in a medium and the
//! transmittance of each edge except one. Weights without these factors also add up to 1.

use super::{Arrival, ClosestHit, PendingWeight, Walk};
use crate::math::Rgb;
use crate::sampler::Sampler;
use crate::scene::Hit;
use crate::scene::bodies::MAX_SURFACES;
use crate::scene::medium::{Media, MediumValues};

/// Share of a channel's probability that does not depend on the throughput: emission at the end of an edge may have
/// colours that are zero in the throughput.
const EVEN: f32 = 0.1;

/// Selection probabilities of the channels.
fn chances(throughput: Rgb) -> Rgb {
    let mean = throughput.element_sum() / 3.0;
    if !(mean > 0.0 && mean.is_finite()) {
        return Rgb::splat(1.0 / 3.0);
    }
    (throughput * ((1.0 - EVEN) / mean) + Rgb::splat(EVEN)) / 3.0
}

/// Distance to the next scattering in a medium, for a channel that `choice` selects; `share` is the probability of
/// scattering before that distance.
fn distance(filling: &MediumValues, chances: Rgb, [choice, share]: [f32; 2]) -> f32 {
    let channel = if choice < chances.x {
        0
    } else {
        1 + usize::from(choice >= chances.x + chances.y)
    };
    let extinction = filling.extinction[channel];
    match extinction > 0.0 {
        true => -(-share).ln_1p() / extinction,
        false => f32::INFINITY,
    }
}

impl Walk<'_> {
    /// [`Walk::arrive`] in a scene with media, where `closest` finds the closest hit along a ray.
    pub(super) fn arrive_in(
        &mut self,
        media: &Media,
        pending: &mut impl PendingWeight,
        numbers: &mut impl Sampler,
        closest: &mut impl ClosestHit,
    ) -> Option<Arrival> {
        let scene = self.scene;
        let (mut rest, mut before) = (self.ray, 0.0);
        for _ in 0..MAX_SURFACES {
            let hit = closest(&rest);
            let end = hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
            let filling = self.around.filling(scene, media);
            // As in light sampling, a dropped body makes the sample NaN.
            let mut transmittance = filling.map_or(Rgb::NAN, |f| f.transmittance(end));
            if let Some(filling) = filling.filter(|f| f.scattering != Rgb::ZERO) {
                let chances = chances(self.throughput);
                let t = distance(filling, chances, [numbers.next_1d(), numbers.next_1d()]);
                if t < end {
                    let transmittance = filling.transmittance(t);
                    let density = chances.dot(filling.extinction * transmittance);
                    self.throughput *= filling.scattering * transmittance / density;
                    return Some(Arrival {
                        surface: filling.point(&rest, t),
                        hit: Hit {
                            t: before + t,
                            ..Hit::IN_MEDIUM
                        },
                    });
                }
                // The density may be 0: a ray to infinity escapes by rounding only.
                let density = chances.dot(transmittance);
                if density > 0.0 {
                    transmittance /= density;
                }
            }
            self.throughput *= transmittance;
            pending.scale(transmittance);
            let hit = hit?;
            let mut surface = self.surface(&hit, rest.dir);
            before += hit.t;
            let unseen = self.from_camera && scene.hides_back(&hit, rest.dir);
            if !unseen && !self.around.passes(scene, &mut surface, rest.dir) {
                return Some(Arrival {
                    surface,
                    hit: Hit { t: before, ..hit },
                });
            }
            rest = surface.spawn(rest.dir);
        }
        None
    }
}
