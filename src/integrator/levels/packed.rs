//! Values of the samples of a pass, stored until the pass is complete.
//!
//! A stopped pass must leave the films unchanged, so samples are added at its end. Copies of the films' sums would take
//! four batches of every level. The values of a sample are fewer, and most repeat others: levels that do not roughen a
//! path have the same light, and most first surfaces are rough. Values equal to their prediction are not stored.

use crate::image::film::FilmBand;
use crate::image::level_film::{FEATURES, Features, LevelBand, MAX_LEVELS, PathLevels};
use crate::integrator::walk::features::PathFeatures;
use crate::math::Rgb;

/// Radiance of one path.
pub(in crate::integrator) struct PathSums<const N: usize> {
    /// Estimate at every level.
    pub(super) levels: [Rgb; N],
    /// Light that no level roughens: the same at all levels. With one level, light that is not blurred.
    pub(super) shared: Rgb,
    /// Features of the path.
    pub(super) features: PathFeatures,
    /// Light that plain path tracing cannot find, from the least roughened level that finds it.
    pub(super) unseen: Rgb,
}

impl<const N: usize> PathSums<N> {
    pub(super) fn new() -> Self {
        Self {
            levels: [Rgb::ZERO; N],
            shared: Rgb::ZERO,
            features: PathFeatures::default(),
            unseen: Rgb::ZERO,
        }
    }

    /// Adds light of a vertex that no level roughens.
    #[inline]
    pub(super) fn add_shared(&mut self, value: Rgb) {
        self.shared += value;
        self.levels.iter_mut().for_each(|t| *t += value);
    }

    /// Adds a share of one way of the path.
    pub(super) fn add_way(&mut self, way: &Self, share: f32) {
        let levels = self.levels.iter_mut().zip(&way.levels);
        levels.for_each(|(sum, value)| *sum += share * *value);
        self.shared += share * way.shared;
        self.features.add_share(&way.features, share);
        self.unseen += share * way.unseen;
    }
}

/// Values of one path, with room for the most levels.
pub(super) struct Path {
    levels: [Rgb; MAX_LEVELS],
    shared: Rgb,
    unseen: Rgb,
    features: Features,
}

impl Path {
    /// A path without light and surfaces, in which all values equal their prediction.
    pub(super) const NONE: Self = Self {
        levels: [Rgb::ZERO; MAX_LEVELS],
        shared: Rgb::ZERO,
        unseen: Rgb::ZERO,
        features: [0.0; FEATURES],
    };

    /// Copies the values of a path.
    pub(super) fn set<const N: usize>(&mut self, path: &PathSums<N>) {
        self.levels[..N].copy_from_slice(&path.levels);
        self.shared = path.shared;
        self.unseen = path.unseen;
        self.features = path.features.values();
    }

    /// Calls `visit` with each group of values and its prediction. The prediction of a level is the one before, of the
    /// first level the shared light, of the rough vertex the first vertex; all others are zero.
    #[inline(always)]
    fn visit(&mut self, levels: usize, mut visit: impl FnMut(&mut [f32], &[f32])) {
        visit(self.shared.as_mut(), &[0.0; 3]);
        let mut before = self.shared;
        for level in &mut self.levels[..levels] {
            visit(level.as_mut(), before.as_ref());
            before = *level;
        }
        visit(self.unseen.as_mut(), &[0.0; 3]);
        let (rough, rest) = self.features.split_at_mut(4);
        let (first, reflectance) = rest.split_at_mut(4);
        visit(first, &[0.0; 4]);
        visit(reflectance, &[0.0; 3]);
        visit(rough, first);
    }

    /// Adds the path to the pixel with this index.
    #[inline]
    pub(super) fn add(
        &self,
        index: usize,
        sample: u32,
        film: &mut FilmBand<'_>,
        levels: &mut LevelBand<'_>,
    ) {
        film.push(index, self.levels[0], sample);
        let mut light = self.levels;
        light[0] += self.unseen;
        let path = PathLevels {
            levels: &light[..levels.levels()],
            shared: self.shared,
            features: self.features,
        };
        levels.push(index, sample, &path);
    }
}

/// Most words that a path takes: all values, and one word of flags for the stored groups.
pub(super) const fn max_words(levels: usize) -> usize {
    1 + 3 * (levels + 2) + FEATURES
}

/// Writes a path to the front of `words`, which it shortens.
#[inline]
pub(super) fn pack(path: &mut Path, levels: usize, words: &mut &mut [u32]) {
    let all = std::mem::take(words);
    let (mut there, mut bit, mut end) = (0u32, 1u32, 1);
    path.visit(levels, |values, predicted| {
        // By their bits, so that NaNs can be equal and a zero keeps its sign.
        let same = (values.iter().zip(predicted)).all(|(a, b)| a.to_bits() == b.to_bits());
        if !same {
            there |= bit;
            all[end..end + values.len()].copy_from_slice(bytemuck::cast_slice(values));
            end += values.len();
        }
        bit <<= 1;
    });
    all[0] = there;
    *words = &mut all[end..];
}

/// Reads a path that [`pack`] wrote from the front of `words`, which it shortens.
#[inline]
pub(super) fn unpack(path: &mut Path, levels: usize, words: &mut &[u32]) {
    let (there, mut bit, mut end) = (words[0], 1u32, 1);
    path.visit(levels, |values, predicted| {
        if there & bit == 0 {
            values.copy_from_slice(predicted);
        } else {
            values.copy_from_slice(bytemuck::cast_slice(&words[end..end + values.len()]));
            end += values.len();
        }
        bit <<= 1;
    });
    *words = &words[end..];
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(path: &mut Path) -> Vec<u32> {
        let mut all = Vec::new();
        path.visit(MAX_LEVELS, |values, _| {
            all.extend(values.iter().map(|x| x.to_bits()));
        });
        all
    }

    /// Every group predicted or not, and values such as NaN and −0 that numerical comparison would lose.
    #[test]
    fn paths_come_back_bit_by_bit() {
        let odd = [0.0, -0.0, f32::NAN, f32::INFINITY, 1e-45, 0.3];
        let groups = 1u32 << (MAX_LEVELS + 5);
        let mut words = vec![0; max_words(MAX_LEVELS)];
        for number in 0..groups {
            let (mut path, mut bit) = (Path::NONE, 1);
            path.visit(MAX_LEVELS, |values, predicted| {
                values.copy_from_slice(predicted);
                if number & bit != 0 {
                    let at = (number ^ bit) as usize % values.len();
                    values[at] = odd[(number / bit) as usize % odd.len()];
                }
                bit <<= 1;
            });
            let before = bits(&mut path);
            pack(&mut path, MAX_LEVELS, &mut &mut words[..]);
            let mut again = Path::NONE;
            unpack(&mut again, MAX_LEVELS, &mut &words[..]);
            assert_eq!(bits(&mut again), before, "{number:b}");
        }
    }
}
