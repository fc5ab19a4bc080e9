//! Dispersion: one colour channel for the rest of a path.

use crate::bsdf::Bsdf;
use crate::math::Rgb;
use crate::scene::{Footprint, Material, Scene, Surface};

/// The colour channel that a path carries, from its first dispersive interface on.
#[derive(Clone, Copy, Default)]
pub(in crate::integrator) struct Channel(Option<u8>);

impl Channel {
    /// The BSDF at a surface point, with the index of refraction of the path's channel; `u` is uniform in [0, 1).
    ///
    /// At its first dispersive interface a path keeps one channel of `throughput`, each with probability 1/3, times
    /// three. All techniques at the vertex and after it share the channel, so that their MIS weights are those of its
    /// index: the estimate of each channel is that of a scene with its index. Other paths stay as they are.
    #[inline(always)]
    pub(in crate::integrator) fn bsdf(
        &mut self,
        scene: &Scene,
        surface: &mut Surface,
        u: f32,
        footprint: impl FnOnce() -> Option<Footprint>,
        throughput: &mut Rgb,
    ) -> Bsdf {
        let mut bsdf = scene.bsdf_seen(surface, u, footprint);
        if scene.features().dispersion {
            let material = scene.material(surface);
            *throughput = self.split(&mut bsdf, material, u, *throughput);
        }
        bsdf
    }

    /// Changes the BSDF and returns the throughput, which is passed by value so that loops keep it in registers.
    #[cold]
    fn split(&mut self, bsdf: &mut Bsdf, material: &Material, u: f32, mut throughput: Rgb) -> Rgb {
        let Some(glass) = bsdf.dielectric_mut() else {
            return throughput;
        };
        if material.dispersion == 0.0 {
            return throughput;
        }
        let channel = *self.0.get_or_insert_with(|| {
            // The remainder of a 24-bit number, whose high bits choose between BSDFs.
            let channel = ((u * 16_777_216.0) as u32 % 3) as u8;
            let kept = throughput[usize::from(channel)];
            throughput = Rgb::ZERO;
            throughput[usize::from(channel)] = 3.0 * kept;
            channel
        });
        glass.eta = material.iors()[usize::from(channel)];
        throughput
    }
}
