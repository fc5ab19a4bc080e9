//! A Gaussian filter that stops at edges of the surface that the first rough vertices lie on.

use super::filter::Size;
use crate::math::Vec3A;

/// Pixels that a blur of this standard deviation reaches.
pub(super) fn blur_radius(sigma: f32) -> usize {
    (2.0 * sigma).ceil() as usize
}

/// A Gaussian filter that stops at edges: where normals differ, or lengths by more than a plane explains.
pub(super) struct Blur {
    size: Size,
    radius: usize,
    /// Weights of the pixels around each pixel, row by row; 0 outside of the picture.
    weights: Vec<f32>,
}

impl Blur {
    /// Weights of this standard deviation in pixels. Features are a normal and a length.
    pub(super) fn new((width, height): Size, sigma: f32, features: &[[f32; 4]]) -> Self {
        let radius = blur_radius(sigma);
        let length = |x: usize, y: usize| features[y * width + x][3];
        let change = |x: usize, y: usize| {
            let across = (length((x + 1).min(width - 1), y) - length(x.saturating_sub(1), y)).abs();
            let along = (length(x, (y + 1).min(height - 1)) - length(x, y.saturating_sub(1))).abs();
            0.5 * across.max(along)
        };
        let around = |i: usize| {
            let (x, y) = (i % width, i / width);
            let [nx, ny, nz, z] = features[i];
            let change = change(x, y);
            let weight = move |dx: usize, dy: usize| {
                let (u, v) = (x + dx, y + dy);
                let inside = radius..width + radius;
                if !inside.contains(&u) || !(radius..height + radius).contains(&v) {
                    return 0.0;
                }
                let [mx, my, mz, length] = features[(v - radius) * width + u - radius];
                let d2 = (dx.abs_diff(radius).pow(2) + dy.abs_diff(radius).pow(2)) as f32;
                let turn = (nx - mx).powi(2) + (ny - my).powi(2) + (nz - mz).powi(2);
                let step = (length - z) / (0.02 * z + 0.5 * change * d2.sqrt() + f32::MIN_POSITIVE);
                (-0.5 * d2 / sigma / sigma - 10.0 * turn - 0.5 * step * step).exp()
            };
            let side = 0..2 * radius + 1;
            side.clone()
                .flat_map(move |dy| side.clone().map(move |dx| weight(dx, dy)))
        };
        Self {
            size: (width, height),
            radius,
            weights: (0..features.len()).flat_map(around).collect(),
        }
    }

    /// Several pictures at once, for which weights and places are looked up once.
    pub(super) fn apply<const N: usize>(&self, pictures: &[Vec<Vec3A>; N]) -> [Vec<Vec3A>; N] {
        let ((width, _), radius) = (self.size, self.radius);
        let side = 2 * radius + 1;
        let mut blurred = pictures.each_ref().map(|p| Vec::with_capacity(p.len()));
        for (i, weights) in self.weights.chunks(side * side).enumerate() {
            let (mut sums, mut all) = ([Vec3A::ZERO; N], 0.0);
            for (dy, row) in weights.chunks(side).enumerate() {
                for (dx, &weight) in row.iter().enumerate() {
                    if weight > 0.0 {
                        let from = i + dy * width + dx - radius * (width + 1);
                        for (sum, picture) in sums.iter_mut().zip(pictures) {
                            *sum += weight * picture[from];
                        }
                        all += weight;
                    }
                }
            }
            for (blurred, sum) in blurred.iter_mut().zip(sums) {
                blurred.push(sum / all);
            }
        }
        blurred
    }
}
