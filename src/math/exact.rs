//! Sums without rounding, which do not depend on the order of the summands.

/// Bits below the binary point: the smallest number of single precision is 2⁻¹⁴⁹.
const FRACTION: i32 = 149;

/// Sum of finite numbers of single precision, exact: a fixed-point number in two's complement, lowest word first.
///
/// 277 bits hold the largest number; the others leave room for 2¹⁰⁶ summands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ExactSum([u64; Self::WORDS]);

impl ExactSum {
    /// Number of [`ExactSum::words`].
    pub(crate) const WORDS: usize = 6;

    /// The sum with these [`ExactSum::words`].
    pub(crate) fn from_words(words: [u64; Self::WORDS]) -> Self {
        Self(words)
    }

    /// The fixed-point number as words, lowest first, for a file.
    pub(crate) fn words(&self) -> [u64; Self::WORDS] {
        self.0
    }

    /// Adds a number, which must be finite.
    #[inline]
    pub(crate) fn add(&mut self, x: f32) {
        debug_assert!(x.is_finite());
        let bits = x.to_bits();
        let (exponent, fraction) = (bits >> 23 & 0xff, bits & 0x7f_ffff);
        // Subnormal numbers have the exponent of the smallest normal number and no implicit leading one.
        let (shift, digits) = match exponent {
            0 => (0, fraction),
            _ => (exponent - 1, fraction | 0x80_0000),
        };
        if digits == 0 {
            return;
        }
        let wide = u128::from(digits) << (shift % 64);
        let mut other = [0; Self::WORDS];
        let word = (shift / 64) as usize;
        (other[word], other[word + 1]) = (wide as u64, (wide >> 64) as u64);
        let other = Self(other);
        match x < 0.0 {
            true => self.plus(&other.negated()),
            false => self.plus(&other),
        }
    }

    /// Adds another sum.
    pub(crate) fn plus(&mut self, other: &Self) {
        let mut carry = false;
        for (a, b) in self.0.iter_mut().zip(other.0) {
            (*a, carry) = a.carrying_add(b, carry);
        }
    }

    fn negated(&self) -> Self {
        let mut one = Self::default();
        one.0[0] = 1;
        one.plus(&Self(self.0.map(|word| !word)));
        one
    }

    /// The sum, rounded.
    pub(crate) fn value(&self) -> f64 {
        let negative = self.0[Self::WORDS - 1] >> 63 == 1;
        let size = if negative { self.negated() } else { *self };
        let unit = f64::from(2.0f32).powi(-FRACTION);
        let words = size.0.iter().rev();
        let size = words.fold(0.0, |sum, &word| sum * 2.0f64.powi(64) + word as f64 * unit);
        if negative { -size } else { size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of all sizes and signs.
    fn numbers() -> Vec<f32> {
        let bits = (0..4000u32).map(|i| i.wrapping_mul(0x9e37_79b9) ^ i << 7);
        bits.map(f32::from_bits).filter(|x| x.is_finite()).collect()
    }

    #[test]
    fn small_numbers_outlast_large_ones() {
        let mut sum = ExactSum::default();
        for x in [1e30, 1.0, -1e30, 1e-30] {
            sum.add(x);
        }
        assert_eq!(sum.value(), 1.0);
        sum.add(-1.0);
        assert_eq!(sum.value(), f64::from(1e-30f32));
    }

    #[test]
    fn order_changes_nothing() {
        let (mut sum, mut back, mut parts) = <(ExactSum, ExactSum, ExactSum)>::default();
        let numbers = numbers();
        numbers.iter().for_each(|&x| sum.add(x));
        numbers.iter().rev().for_each(|&x| back.add(x));
        for part in numbers.chunks(7) {
            let mut own = ExactSum::default();
            part.iter().for_each(|&x| own.add(x));
            parts.plus(&own);
        }
        assert!(sum == back && sum == parts);
        numbers.iter().for_each(|&x| sum.add(-x));
        assert_eq!(sum, ExactSum::default());
    }

    #[test]
    fn exact_sums_are_those_of_double_precision_where_that_is_exact() {
        let mut sum = ExactSum::default();
        let mut expected = 0.0;
        for i in 0..10_000i32 {
            let x = (i * 37 % 1009 - 500) as f32 * 0.0625;
            sum.add(x);
            expected += f64::from(x);
            assert_eq!(sum.value(), expected);
        }
        for x in [f32::MAX, -f32::MAX, f32::MIN_POSITIVE, 1e-45, -1e-45, 0.0] {
            let mut sum = ExactSum::default();
            sum.add(x);
            assert_eq!(sum.value(), f64::from(x));
        }
    }
}
