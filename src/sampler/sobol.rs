//! Owen-scrambled Sobol points for camera paths and light paths.
//!
//! The numbers of a path come in sets of four. The first has film and lens, or direction and point of emission. Each of
//! the first [`VERTICES`] vertices has two: one samples a light, one the BSDF. A further set is for the light and side
//! of a light path, the last for the opacity along the first four edges. A set is the first four dimensions of the Sobol
//! sequence (direction numbers of Joe, Kuo: *Constructing Sobol Sequences with Better Two-Dimensional Projections*,
//! 2008), with its own shuffling and scrambling `[Burley20]`. Pairs that cover an area, such as the point on a light, are the first two
//! dimensions: every aligned run of 2^m samples has one such point in every elementary interval of area 2^-m. Every
//! number alone is uniform, so that each sample is an unbiased estimate; samples of one sequence are correlated, and
//! the variance of their mean is about that of independent samples at most.

use super::{EmissionU, LightU, VertexU, mix, unit};
use crate::math::Vec2;

/// Number of vertices of a path whose numbers are Sobol points.
pub(super) const VERTICES: u32 = 4;

/// One point of a sequence, in all sets.
#[derive(Clone, Debug)]
pub(super) struct SobolPoint {
    /// Hash that identifies the sequence.
    key: u64,
    /// Index of the point.
    index: u32,
    /// Index of the point with its bits reversed.
    reversed: u32,
}

/// Coordinates of a point in binary digits, reversed: the first digit is the lowest bit.
type Digits = [u32; 4];

/// Contribution of each byte of the index to a point; the lowest byte has its bits reversed.
static BYTES: [[Digits; 256]; 4] = bytes();

impl SobolPoint {
    pub(super) fn new(key: u64, index: u32) -> Self {
        Self {
            key,
            index,
            reversed: index.reverse_bits(),
        }
    }

    /// Bits of this point in a set, and 64 further bits that all points of the sequence share in this set.
    #[inline(always)]
    fn point(&self, set: u32) -> (Digits, u64) {
        let a = mix(self
            .key
            .wrapping_add(u64::from(set).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        let b = mix(a ^ 0xd1b5_4a32_d192_ed03);
        let order = a.wrapping_add(b.rotate_left(32));
        // A permutation within every aligned run of 256 points keeps its elementary intervals. Longer runs need none:
        // their numbers are the ninth digits and later ones of a point.
        let place = scramble(self.reversed, order as u32) >> 24;
        let mut digits = BYTES[0][place as usize];
        let mut rest = self.index >> 8;
        let mut byte = 1;
        while rest > 0 {
            let row = &BYTES[byte][(rest & 0xff) as usize];
            digits = std::array::from_fn(|d| digits[d] ^ row[d]);
            rest >>= 8;
            byte += 1;
        }
        let seeds = [a as u32, (a >> 32) as u32, b as u32, (b >> 32) as u32];
        let bits = std::array::from_fn(|d| scramble(digits[d], seeds[d]).reverse_bits());
        (bits, order)
    }

    /// Numbers that start a light path.
    pub(super) fn emission(&self) -> EmissionU {
        let ([u, v, x, y], _) = self.point(0);
        let ([pick, side, ..], spare) = self.point(2 * VERTICES + 1);
        EmissionU {
            pick: self.light_choice(pick, spare),
            point: Vec2::new(unit(x), unit(y)),
            direction: Vec2::new(unit(u), unit(v)),
            side: unit(side),
        }
    }

    /// Number for the choice of a light: these 32 bits, and 21 bits of a hash.
    #[inline(always)]
    fn light_choice(&self, bits: u32, spare: u64) -> f64 {
        let spare = mix(spare ^ u64::from(self.index)) >> 43;
        (u64::from(bits) << 21 | spare) as f64 * (0.5 * f64::EPSILON)
    }

    #[inline]
    pub(super) fn film(&self) -> Vec2 {
        let ([x, y, ..], _) = self.point(0);
        Vec2::new(unit(x), unit(y))
    }

    #[inline]
    pub(super) fn lens(&self) -> Vec2 {
        let ([_, _, x, y], _) = self.point(0);
        Vec2::new(unit(x), unit(y))
    }

    /// Number of the opacity along edge `n`, from 0; `None` after the first ones.
    pub(super) fn opacity(&self, n: u8) -> Option<f64> {
        let (bits, _) = self.point(2 * VERTICES + 2);
        Some(f64::from(*bits.get(usize::from(n))?) / 4_294_967_296.0)
    }

    /// Numbers of vertex `n`, from 0.
    #[inline(never)]
    pub(super) fn vertex(&self, n: u32) -> VertexU {
        let ([x, y, pick, material], spare) = self.point(2 * n + 1);
        let ([u, v, lobe, roulette], _) = self.point(2 * n + 2);
        VertexU {
            material: unit(material),
            light: LightU {
                pick: self.light_choice(pick, spare),
                at: Vec2::new(unit(x), unit(y)),
            },
            lobe: [unit(lobe), unit(u), unit(v)],
            roulette: unit(roulette),
        }
    }
}

/// Owen scrambling of reversed digits: each digit changes only with the digits before it. The hash is Laine and Karras'
/// (*Stratified Sampling for Stochastic Transparency*, EGSR 2011) with the constants of Vegdahl (*Building a Better LK
/// Hash*, 2021).
#[inline(always)]
fn scramble(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

const fn bytes() -> [[Digits; 256]; 4] {
    let columns = columns();
    let mut bytes = [[[0; 4]; 256]; 4];
    let mut byte = 0;
    while byte < 4 {
        let mut value = 0;
        while value < 256 {
            let mut bit = 0;
            while bit < 8 {
                let at = if byte == 0 { 7 - bit } else { bit };
                if value >> at & 1 == 1 {
                    let mut d = 0;
                    while d < 4 {
                        bytes[byte][value][d] ^= columns[d][8 * byte + bit];
                        d += 1;
                    }
                }
                bit += 1;
            }
            value += 1;
        }
        byte += 1;
    }
    bytes
}

/// Generator matrices with reversed rows, column by column.
const fn columns() -> [[u32; 32]; 4] {
    // The primitive polynomials 1 + x, 1 + x + x² and 1 + x + x³ over GF(2): degree, inner coefficients, first m.
    let polynomials: [(usize, u64, [u64; 3]); 3] =
        [(1, 0, [1, 0, 0]), (2, 1, [1, 3, 0]), (3, 1, [1, 3, 1])];
    let mut columns = [[0; 32]; 4];
    let mut bit = 0;
    while bit < 32 {
        columns[0][bit] = 1 << bit;
        bit += 1;
    }
    let mut d = 0;
    while d < 3 {
        let (degree, inner, first) = polynomials[d];
        let mut m = [0u64; 32];
        let mut k = 0;
        while k < 32 {
            if k < degree {
                m[k] = first[k];
            } else {
                m[k] = m[k - degree] ^ (m[k - degree] << degree);
                let mut i = 1;
                while i < degree {
                    if inner >> (degree - 1 - i) & 1 == 1 {
                        m[k] ^= m[k - i] << i;
                    }
                    i += 1;
                }
            }
            // m has k + 1 digits, of which the first is the highest.
            columns[d + 1][k] = (m[k] as u32).reverse_bits() >> (31 - k);
            k += 1;
        }
        d += 1;
    }
    columns
}

#[cfg(test)]
mod tests;
