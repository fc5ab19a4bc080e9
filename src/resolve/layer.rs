//! The rule that chooses one candidate of a layer of light for every pixel.

use super::filter::{Size, boxed, tent};
use crate::image::level_film::BATCHES;
use crate::math::Vec3A;

/// r: radius in pixels over which noise and bias are smoothed.
pub(super) const RADIUS: usize = 1;

/// Radii in pixels at which a difference between candidates may be significant, with the sum of the squared weights of
/// the filter along one axis.
const SCALES: [(usize, f32); 2] = [(RADIUS, 19.0 / 81.0), (WIDE_RADIUS, 231.0 / 2401.0)];

/// The larger of the [`SCALES`].
pub(super) const WIDE_RADIUS: usize = 3;

/// Standard deviations of U without a bias from which a difference of four batches is significant; more for fewer.
const SIGNIFICANT: f32 = 4.0;

/// Share that counts of an insignificant difference of four batches, up to the wider U; for n batches times (n/4)².
const INSIGNIFICANT_SHARE: f32 = 0.4;

/// Radius in pixels of the filter of the shares of candidates.
pub(super) const SHARE_RADIUS: usize = 1;

/// By the number of a blur: radius in pixels of the square in which a choice must be common, and least share of the
/// pixels there that have no wider blur. The last entry holds for all wider blurs. No square has exactly such a share.
const COMMON: [(usize, f32); 3] = [(3, 0.37), (3, 0.37), (COMMON_RADIUS, 0.49)];

/// The largest of these radii.
pub(super) const COMMON_RADIUS: usize = 4;

/// Least weight of the noise of a blurred layer, as a share of the weight of the darkest pixel around.
const DARK: f32 = 0.5;

/// Factor on the error of a blurred candidate: it must be clearly better to be chosen.
const CAUTION: f32 = 1.5;

/// Light of some pixels in batches.
pub(super) type Batches = Vec<[Vec3A; BATCHES]>;

/// A candidate picture of a layer.
pub(super) struct Candidate {
    /// Level of roughening.
    pub(super) level: u8,
    /// The light.
    pub(super) light: Batches,
    /// Indices of the candidates that it is compared with.
    pub(super) sharper: Vec<usize>,
    /// Variance of light that it has missed, if any.
    pub(super) missing: Option<Vec<Vec3A>>,
    /// Number of its blur, ascending with the width; 0 for none.
    pub(super) blur: usize,
    /// Index of the candidate with the next wider blur of the same light.
    pub(super) wider: Option<usize>,
    /// True if insignificant differences count less, as for blurs. Roughening certainly has a bias.
    pub(super) doubted: bool,
    /// True if light that it takes across an edge is weighted as on the dark side, as its noise is.
    pub(super) dark_side: bool,
}

/// w of every pixel and channel, for the light there, and for the darkest pixel around.
pub(super) struct Weights {
    pub(super) own: Vec<Vec3A>,
    pub(super) dark: Vec<Vec3A>,
}

/// The best candidate of every pixel.
pub(super) struct Choice {
    /// Index of the candidate.
    pub(super) chosen: Vec<u8>,
    /// Weighted squared bias of the candidate.
    pub(super) bias2: Vec<f32>,
    /// Weighted variance of the candidate.
    pub(super) variance: Vec<f32>,
}

impl Choice {
    /// Chooses the first candidate of the least error, and a wider blur of it where the choice is not [`common`].
    /// Candidates are in ascending order of smoothing. The first `batches` batches have samples.
    pub(super) fn of(
        size: Size,
        candidates: &[Candidate],
        weights: &Weights,
        kappa: f32,
        batches: usize,
        alike: impl Fn(usize, [isize; 2]) -> f32,
    ) -> Self {
        match batches {
            2 => Self::of_batches::<2>(size, candidates, weights, kappa, alike),
            3 => Self::of_batches::<3>(size, candidates, weights, kappa, alike),
            _ => Self::of_batches::<BATCHES>(size, candidates, weights, kappa, alike),
        }
    }

    /// [`Self::of`] for `N` batches with samples.
    fn of_batches<const N: usize>(
        size: Size,
        candidates: &[Candidate],
        weights: &Weights,
        kappa: f32,
        alike: impl Fn(usize, [isize; 2]) -> f32,
    ) -> Self {
        let pixels = weights.own.len();
        let mut all = Self {
            chosen: vec![0; pixels],
            bias2: vec![0.0; pixels],
            variance: vec![0.0; pixels],
        };
        let edges: Vec<Vec3A> = (weights.own.iter().zip(&weights.dark))
            .map(|(own, dark)| own.max(DARK * *dark))
            .collect();
        let mut least = vec![f32::INFINITY; pixels];
        // Variances, which later candidates are compared with, and squared biases.
        let mut anchors: Vec<Vec<f32>> = Vec::with_capacity(candidates.len());
        let mut biases: Vec<Vec<f32>> = Vec::with_capacity(candidates.len());
        for (k, candidate) in candidates.iter().enumerate() {
            let noise = noise::<N>(size, candidate);
            let variance = weighted(&noise, &weights.own);
            let bias2 = bias::<N>(size, candidates, k, weights, &anchors, kappa);
            let judged = (candidate.blur > 0).then(|| weighted(&noise, &edges));
            let judged = judged.as_ref().unwrap_or(&variance);
            let caution = if candidate.blur > 0 { CAUTION } else { 1.0 };
            for i in 0..pixels {
                let error = caution * (bias2[i] + judged[i]);
                if error < least[i] {
                    least[i] = error;
                    all.chosen[i] = k as u8;
                }
            }
            anchors.push(variance);
            biases.push(bias2);
        }
        all.chosen = common(size, candidates, &all.chosen, alike);
        for (i, &k) in all.chosen.iter().enumerate() {
            all.bias2[i] = biases[usize::from(k)][i];
            all.variance[i] = anchors[usize::from(k)][i];
        }
        all
    }

    /// Means and batches of the chosen candidates, blended without hard edges.
    pub(super) fn blend(
        &self,
        size: Size,
        candidates: &[Candidate],
        mean: impl Fn(&[Vec3A; BATCHES]) -> Vec3A,
    ) -> (Vec<Vec3A>, Batches) {
        let mut sum = vec![Vec3A::ZERO; self.chosen.len()];
        let mut batches = vec![[Vec3A::ZERO; BATCHES]; self.chosen.len()];
        for (k, candidate) in candidates.iter().enumerate() {
            let is = |&c: &u8| f32::from(u8::from(usize::from(c) == k));
            let mut shares: Vec<f32> = self.chosen.iter().map(is).collect();
            tent(size, SHARE_RADIUS, &mut shares);
            let sums = sum.iter_mut().zip(&mut batches);
            for (((sum, batches), light), &share) in sums.zip(&candidate.light).zip(&shares) {
                if share > 0.0 {
                    *sum += share * mean(light);
                    let pairs = batches.iter_mut().zip(light);
                    pairs.for_each(|(batch, light)| *batch += share * *light);
                }
            }
        }
        (sum, batches)
    }
}

/// The choices without those due to chance: a pixel takes the next wider blur if too few pixels around have a blur as
/// narrow, among all of them and among those on its surface. Four batches prefer a narrow candidate by chance in single
/// pixels, and at a feature of the picture in many.
pub(super) fn common(
    size: Size,
    candidates: &[Candidate],
    chosen: &[u8],
    alike: impl Fn(usize, [isize; 2]) -> f32,
) -> Vec<u8> {
    let blur = |k: u8| candidates[usize::from(k)].blur;
    let widest = candidates.iter().map(|c| c.blur).max().unwrap_or(0);
    let mut taken = chosen.to_vec();
    for number in 0..widest {
        let (radius, least) = COMMON[number.min(COMMON.len() - 1)];
        let narrow = |&k: &u8| f32::from(u8::from(blur(k) <= number));
        let narrow: Vec<f32> = chosen.iter().map(narrow).collect();
        let mut shares = narrow.clone();
        boxed(size, radius, &mut shares);
        for (i, share) in shares.into_iter().enumerate() {
            let own = &candidates[usize::from(taken[i])];
            if own.blur == number
                && share < least
                && is_rare(size, radius, &narrow, i, least, &alike)
            {
                taken[i] = own.wider.map_or(taken[i], |wider| wider as u8);
            }
        }
    }
    taken
}

/// True if [`share_of_alike`] of values of 0 and 1 is less than `least`. On an even surface it is less in most pixels,
/// and a few weights of values of 0 prove it.
pub(super) fn is_rare(
    size: Size,
    radius: usize,
    values: &[f32],
    pixel: usize,
    least: f32,
    alike: impl Fn(usize, [isize; 2]) -> f32,
) -> bool {
    let near = |value: f32| {
        let near = around(size, radius, pixel);
        near.filter(move |(other, _)| values[*other] == value)
    };
    let sum: f32 = near(1.0).map(|(_, step)| alike(pixel, step)).sum();
    let [fewest, most] = [0.9999, 1.0001].map(|doubt| doubt * sum * (1.0 / least - 1.0));
    let mut others = 0.0;
    for (_, step) in near(0.0) {
        others += alike(pixel, step);
        if others > most {
            return true;
        }
    }
    // If the order of summation may decide, the plain order is used.
    others >= fewest && share_of_alike(size, radius, values, pixel, alike) < least
}

/// Mean of the values in the square around a pixel, weighted by the similarity of their pixels to it.
pub(super) fn share_of_alike(
    size: Size,
    radius: usize,
    values: &[f32],
    pixel: usize,
    alike: impl Fn(usize, [isize; 2]) -> f32,
) -> f32 {
    let near = around(size, radius, pixel);
    let (sum, all) = near.fold((0.0, 0.0), |(sum, all), (other, step)| {
        let weight = alike(pixel, step);
        (sum + weight * values[other], all + weight)
    });
    sum / all
}

/// The pixels in the square around one, row by row, and their offsets to the right and down.
fn around(
    (width, height): Size,
    radius: usize,
    pixel: usize,
) -> impl Iterator<Item = (usize, [isize; 2])> {
    let (x, y) = (pixel % width, pixel / width);
    let range = move |at: usize, end: usize| {
        let (radius, end) = (radius as isize, (end - at) as isize);
        -radius.min(at as isize)..end.min(radius + 1)
    };
    range(y, height).flat_map(move |dy| {
        let row = pixel.wrapping_add_signed(dy * width as isize);
        range(x, width).map(move |dx| (row.wrapping_add_signed(dx), [dx, dy]))
    })
}

/// V of a candidate.
fn noise<const N: usize>(size: Size, candidate: &Candidate) -> Vec<Vec3A> {
    let mut noise: Vec<Vec3A> = (candidate.light.iter())
        .map(|light| variance_of_mean(&light[..N]))
        .collect();
    tent(size, RADIUS, &mut noise);
    if let Some(missing) = &candidate.missing {
        let pairs = noise.iter_mut().zip(missing);
        pairs.for_each(|(noise, missing)| *noise += *missing);
    }
    noise
}

/// b of candidate number `k`.
fn bias<const N: usize>(
    size: Size,
    candidates: &[Candidate],
    k: usize,
    weights: &Weights,
    variance: &[Vec<f32>],
    kappa: f32,
) -> Vec<f32> {
    let one = &candidates[k];
    let weights = if one.dark_side {
        &weights.dark
    } else {
        &weights.own
    };
    let mut all = vec![0.0f32; weights.len()];
    let share = INSIGNIFICANT_SHARE * (N as f32 / BATCHES as f32).powi(2);
    for &anchor in &one.sharper {
        let differences = || {
            let pairs = one.light.iter().zip(&candidates[anchor].light);
            pairs.map(|(ours, theirs)| difference::<N>(ours, theirs))
        };
        let mut smooth: Vec<Vec3A> = differences().map(|d| squared_difference(&d)).collect();
        // Only light of rare hits needs this check for coincidences.
        if one.missing.is_some() {
            smooth = confirmed(size.0, &smooth, |i| {
                let theirs = &candidates[anchor].light[i];
                without_largest(&difference::<N>(&one.light[i], theirs))
            });
        }
        let most = one.doubted.then(|| {
            let variances = differences()
                .zip(weights)
                .map(|(d, weight)| variance_of_mean(&d).dot(*weight) / 3.0);
            doubtful(size, weighted(&smooth, weights), variances.collect(), N)
        });
        tent(size, RADIUS, &mut smooth);
        let mut biases = weighted(&smooth, weights);
        for (bias, most) in biases.iter_mut().zip(most.iter().flatten()) {
            if *most < f32::INFINITY {
                *bias = (share * *bias).min(*most);
            }
        }
        for ((all, bias), noise) in all.iter_mut().zip(biases).zip(&variance[anchor]) {
            *all = all.max(bias - kappa * noise);
        }
    }
    all
}

/// The differences of two candidates' batches.
fn difference<const N: usize>(ours: &[Vec3A; BATCHES], theirs: &[Vec3A; BATCHES]) -> [Vec3A; N] {
    std::array::from_fn(|b| ours[b] - theirs[b])
}

/// Upper bound of the bias where U may be due to chance: U at the wider radius. Infinite where U is significant at one
/// of the [`SCALES`]. Without bias the variance of U is 2 B / (B − 1) times the squared variance of the mean of B
/// batches, which is less certain for fewer. Without this test one pixel in two hundred takes no blur by chance.
fn doubtful(size: Size, squares: Vec<f32>, variances: Vec<f32>, batches: usize) -> Vec<f32> {
    let b = batches as f32;
    let z = SIGNIFICANT * BATCHES as f32 / b * (2.0 * b / (b - 1.0)).sqrt();
    let mut most = vec![0.0f32; squares.len()];
    for (radius, norm) in SCALES {
        let (mut square, mut variance) = (squares.clone(), variances.clone());
        tent(size, radius, &mut square);
        tent(size, radius, &mut variance);
        for (most, (square, variance)) in most.iter_mut().zip(square.iter().zip(&variance)) {
            if *square > z * norm * variance {
                *most = f32::INFINITY;
            } else if radius == WIDE_RADIUS {
                *most = most.max(*square);
            }
        }
    }
    most
}

/// Squared differences, limited to those of a pixel around, or of the pixel's batches without the one that differs
/// most. Hits of several batches that coincide in one pixel would look like a bias.
pub(super) fn confirmed(
    width: usize,
    squares: &[Vec3A],
    without_largest: impl Fn(usize) -> Vec3A,
) -> Vec<Vec3A> {
    // The largest of both neighbours in a row, and of these with the pixel itself.
    let mut beside = vec![Vec3A::ZERO; squares.len()];
    let mut rows = squares.to_vec();
    let lines = rows.chunks_exact_mut(width);
    for ((beside, row), own) in
        (beside.chunks_exact_mut(width).zip(lines)).zip(squares.chunks_exact(width))
    {
        let near = beside[1..].iter_mut().zip(own);
        near.for_each(|(most, left)| *most = most.max(*left));
        let near = beside.iter_mut().zip(&own[1..]);
        near.for_each(|(most, right)| *most = most.max(*right));
        row.iter_mut()
            .zip(beside)
            .for_each(|(row, most)| *row = row.max(*most));
    }
    let confirmed = |i: usize| {
        let mut most = beside[i];
        if i >= width {
            most = most.max(rows[i - width]);
        }
        if let Some(below) = rows.get(i + width) {
            most = most.max(*below);
        }
        if squares[i].cmple(most).all() {
            return squares[i];
        }
        squares[i].min(most.max(without_largest(i)))
    };
    (0..squares.len()).map(confirmed).collect()
}

/// The squared difference of all batches but the one that contributes most, by channel; 0 for two batches.
pub(super) fn without_largest(differences: &[Vec3A]) -> Vec3A {
    let batches = differences.len();
    if batches < 3 {
        return Vec3A::ZERO;
    }
    let sum: Vec3A = differences.iter().sum();
    let sign = Vec3A::select(sum.cmpgt(Vec3A::ZERO), Vec3A::ONE, Vec3A::NEG_ONE);
    let most = (differences.iter()).fold(Vec3A::NEG_INFINITY, |most, d| most.max(*d * sign));
    let mut left = most.cmpeq(most);
    let (mut sum, mut squares) = (Vec3A::ZERO, Vec3A::ZERO);
    for d in differences {
        let largest = left & (*d * sign).cmpeq(most);
        left &= !largest;
        let rest = Vec3A::select(largest, Vec3A::ZERO, *d);
        sum += rest;
        squares += rest * rest;
    }
    (sum * sum - squares) / ((batches - 1) * (batches - 2)) as f32
}

/// Mean over the channels of values times their weights.
pub(super) fn weighted(values: &[Vec3A], weights: &[Vec3A]) -> Vec<f32> {
    let pairs = values.iter().zip(weights);
    pairs.map(|(v, w)| v.dot(*w) / 3.0).collect()
}

/// U: an unbiased estimate of the squared mean of independent numbers with equal means; negative by chance.
pub(super) fn squared_difference(d: &[Vec3A]) -> Vec3A {
    let (sum, squares) = d.iter().fold((Vec3A::ZERO, Vec3A::ZERO), |(s, q), d| {
        (s + *d, q + *d * *d)
    });
    (sum * sum - squares) / (d.len() * (d.len() - 1)) as f32
}

/// Estimated variance of the mean of independent numbers.
pub(super) fn variance_of_mean(x: &[Vec3A]) -> Vec3A {
    let mean = x.iter().sum::<Vec3A>() / x.len() as f32;
    let squares: Vec3A = x.iter().map(|x| (*x - mean) * (*x - mean)).sum();
    squares / (x.len() * (x.len() - 1)) as f32
}

/// Median of the batches by channel; for an even number the mean of the middle two.
pub(super) fn median(x: &[Vec3A]) -> Vec3A {
    let channel = |c: usize| {
        let mut sorted = [0.0; BATCHES];
        let sorted = &mut sorted[..x.len()];
        sorted.iter_mut().zip(x).for_each(|(s, x)| *s = x[c]);
        sorted.sort_by(f32::total_cmp);
        0.5 * (sorted[(x.len() - 1) / 2] + sorted[x.len() / 2])
    };
    Vec3A::new(channel(0), channel(1), channel(2))
}
