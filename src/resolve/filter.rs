//! Means over the pixels around.

use std::collections::VecDeque;
use std::ops::{AddAssign, DivAssign};

/// Width and height.
pub(super) type Size = (usize, usize);

/// A box filter applied twice, in place: about a tent of radius 2 `radius`. At the border a mean over the pixels inside.
pub(super) fn tent<T>(size: Size, radius: usize, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    boxed(size, radius, values);
    boxed(size, radius, values);
}

/// Mean over the square of radius `radius` around every pixel, in place.
fn boxed<T>((width, height): Size, radius: usize, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
    let mut old = Vec::new();
    for row in values.chunks_mut(width.max(1)) {
        old.clear();
        old.extend_from_slice(row);
        for (x, out) in row.iter_mut().enumerate() {
            let near = &old[around(x, width)];
            *out = T::default();
            near.iter().for_each(|v| *out += *v);
            *out /= near.len() as f32;
        }
    }
    // The rows above, as they were.
    let mut above: VecDeque<Vec<T>> = VecDeque::new();
    for y in 0..height {
        let mut sum = vec![T::default(); width];
        let rows = y * width..around(y, height).end * width;
        let below = values[rows].chunks(width);
        for row in above.iter().map(Vec::as_slice).chain(below) {
            sum.iter_mut().zip(row).for_each(|(sum, v)| *sum += *v);
        }
        let count = around(y, height).len() as f32;
        sum.iter_mut().for_each(|sum| *sum /= count);
        let row = &mut values[y * width..(y + 1) * width];
        above.push_back(row.to_vec());
        if above.len() > radius {
            above.pop_front();
        }
        row.copy_from_slice(&sum);
    }
}
